// SPDX-License-Identifier: BSD-3-Clause
// The bounds of what GLOVED_COMMAND may ask. Whether it fits the moment (no reset while a force may flow) is
// decided in the real-time thread (session.c). Slow thread; asks the disk for the kind of a scene's file.
#include "daemon/loop/request.h"

#include <ctype.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

#include "daemon/load/output.h"

const char *gv_request_name(int kind) {
  static const char *const name[GV_REQUEST_KINDS] = {"reset", "scene", "coupling", "friction", "start log", "stop log", "disarm", "trace"};
  return kind >= 0 && kind < GV_REQUEST_KINDS ? name[kind] : "?";
}

static bool is_above(gv_request_rate *rate, int64_t now_ns, int per_second) {
  if (rate->count == 0 || now_ns - rate->second_ns >= 1000000000) *rate = (gv_request_rate){now_ns, 0};
  return ++rate->count > per_second;
}

bool gv_request_may_complain(gv_request_rate *rate, int64_t now_ns) { return !is_above(rate, now_ns, GV_REQUEST_PER_SECOND); }

// A name without a folder: a command from the network must not choose a place on the disk.
static bool is_file_name(const char *text) {
  if (!isalnum((unsigned char)text[0]) || strlen(text) >= GV_REQUEST_TEXT) return false;
  for (; *text; text++)
    if (!isalnum((unsigned char)*text) && !strchr("._-", *text)) return false;
  return true;
}

// Below the daemon's directory: names as above, a slash between two of them.
static bool is_path_below(const char *text) {
  if (strlen(text) >= GV_REQUEST_TEXT) return false;
  for (bool first = true; *text; first = *text++ == '/')
    if (!isalnum((unsigned char)*text) && (first || !strchr("._-/", *text))) return false;
  return true;
}

// A FIFO or a device would block or never end.
static const char *check_scene(const char *text) {
  struct stat there;
  const size_t length = strlen(text);
  if (!is_path_below(text) || length < 7 || strcmp(text + length - 6, ".scene") != 0)
    return "give a file NAME.scene at or below the daemon's directory, of letters, digits, . _ - and /";
  if (lstat(text, &there) != 0) return "there is no such file in the daemon's directory";
  if (!S_ISREG(there.st_mode)) return "not a plain file";
  return gv_output_is_below_here(text) ? NULL : "a link leads out of the daemon's directory; put the file itself there";
}

const char *gv_request_check(int kind, double value, const char *text, gv_request_rate *rate, int64_t now_ns, gv_request *out) {
  *out = (gv_request){.kind = (gv_request_kind)kind, .value = value};
  if (kind == GV_REQUEST_DISARM) return NULL;  // whoever else sends, and how much: this one is always obeyed
  if (is_above(rate, now_ns, GV_REQUEST_PER_SECOND)) return "more than 10 a second; send fewer";
  snprintf(out->text, sizeof out->text, "%s", text);
  switch (kind) {
    case GV_REQUEST_RESET: case GV_REQUEST_STOP_LOG: case GV_REQUEST_DISARM: return NULL;
    case GV_REQUEST_SCENE: return check_scene(text);
    case GV_REQUEST_COUPLING:
      return value >= GV_REQUEST_COUPLING_MIN && value <= GV_REQUEST_COUPLING_MAX ? NULL : "give a multiple from 0.1 to 2";
    case GV_REQUEST_FRICTION: return value >= 0.0 && value <= GV_REQUEST_FRICTION_MAX ? NULL : "give a coefficient from 0 to 2";
    case GV_REQUEST_START_LOG: return is_file_name(text) ? NULL : "give a file name of letters, digits, . _ - and no folder";
    case GV_REQUEST_TRACE: return value >= 0.0 && value <= 1.0 ? NULL : "give 1 or 0";
    default: return "no such command; see data/lcm/gloved_command_t.lcm";
  }
}
