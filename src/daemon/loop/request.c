// SPDX-License-Identifier: BSD-3-Clause
// The bounds of what GLOVED_COMMAND may ask. Whether it fits the moment (no reset while a force may flow) is
// decided in the real-time thread (session.c). Slow thread; asks the disk for the kind of a scene's file.
#include "daemon/loop/request.h"

#include <ctype.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

#include "daemon/load/output.h"

const char *gv_request_name(int kind) {
  static const char *const name[GV_REQUEST_KINDS] = {
    "reset", "scene", "coupling", "friction", "start log", "stop log", "disarm", "trace", "status"};
  return kind >= 0 && kind < GV_REQUEST_KINDS ? name[kind] : "?";
}

static bool is_above(gv_request_rate *rate, int64_t now_ns, int per_second) {
  if (rate->count == 0 || now_ns - rate->second_ns >= 1000000000)
    *rate = (gv_request_rate){now_ns, 0};
  return ++rate->count > per_second;
}

bool gv_request_may_complain(gv_request_rate *rate, int64_t now_ns) {
  return !is_above(rate, now_ns, GV_REQUEST_PER_SECOND);
}

// A name without a folder: a command from the network must not choose a place on the disk.
static bool is_file_name(const char *text) {
  if (!isalnum((unsigned char)text[0]) || strlen(text) >= GV_REQUEST_TEXT)
    return false;
  for (; *text; text++)
    if (!isalnum((unsigned char)*text) && !strchr("._-", *text))
      return false;
  return true;
}

// Below the daemon's directory: names as above, a slash between two of them.
static bool is_path_below(const char *text) {
  if (strlen(text) >= GV_REQUEST_TEXT)
    return false;
  for (bool first = true; *text; first = *text++ == '/')
    if (!isalnum((unsigned char)*text) && (first || !strchr("._-/", *text)))
      return false;
  return true;
}

__attribute__((format(printf, 2, 3))) static bool refuse(char out_why[GV_REQUEST_WHY], const char *format,
                                                         ...) {
  va_list arguments;
  va_start(arguments, format);
  vsnprintf(out_why, GV_REQUEST_WHY, format, arguments);
  va_end(arguments);
  return false;
}

// The text as far as it may be said again: it came from the network.
static const char *sayable(const char *text, char out[48]) {
  snprintf(out, 48, "%.40s", *text ? text : "(nothing)");
  for (char *c = out; *c; c++)
    if ((unsigned char)*c < ' ' || (unsigned char)*c >= 127)
      *c = '?';
  return out;
}

// A FIFO or a device would block or never end.
static bool check_scene(const char *text, char out_why[GV_REQUEST_WHY]) {
  struct stat there;
  char said[48];
  const size_t length = strlen(text);
  sayable(text, said);
  if (!is_path_below(text) || length < 7 || strcmp(text + length - 6, ".scene") != 0)
    return refuse(
        out_why,
        "%s: give a file NAME.scene at or below the daemon's directory, of letters, digits, . _ - and /",
        said);
  if (lstat(text, &there) != 0)
    return refuse(out_why, "%s: there is no such file in the daemon's directory", said);
  if (!S_ISREG(there.st_mode))
    return refuse(out_why, "%s: not a plain file", said);
  if (gv_output_is_below_here(text))
    return true;
  return refuse(out_why, "%s: a link leads out of the daemon's directory; put the file itself there", said);
}

static bool check_number(double value, double min, double max, const char *what,
                         char out_why[GV_REQUEST_WHY]) {
  if (value >= min && value <= max)
    return true;
  if (isnan(value))
    return refuse(out_why, "not a number; give %s from %g to %g", what, min, max);
  return refuse(out_why, "%g is %s %g; give %s from %g to %g", value, value < min ? "below" : "above",
                value < min ? min : max, what, min, max);
}

// A name for a file in the daemon's directory.
static bool check_log(const char *text, char out_why[GV_REQUEST_WHY]) {
  char said[48];
  return is_file_name(text) ||
         refuse(out_why, "%s: give a file name of letters, digits, . _ - and no folder", sayable(text, said));
}

// All values, or one by its name.
static bool check_status(const char *text, char out_why[GV_REQUEST_WHY]) {
  char said[48];
  return !*text || is_file_name(text) ||
         refuse(out_why, "%s: no value has such a name; gloved-command status lists them",
                sayable(text, said));
}

static bool check_what_is_asked(const gv_request_message *message, char out_why[GV_REQUEST_WHY]) {
  const double value = message->value;
  switch (message->kind) {
    case GV_REQUEST_RESET:
    case GV_REQUEST_STOP_LOG: return true;
    case GV_REQUEST_SCENE: return check_scene(message->text, out_why);
    case GV_REQUEST_COUPLING:
      return check_number(value, GV_REQUEST_COUPLING_MIN, GV_REQUEST_COUPLING_MAX, "a multiple", out_why);
    case GV_REQUEST_FRICTION:
      return check_number(value, 0.0, GV_REQUEST_FRICTION_MAX, "a coefficient", out_why);
    case GV_REQUEST_START_LOG: return check_log(message->text, out_why);
    case GV_REQUEST_TRACE:
      return value == 0.0 || value == 1.0 || refuse(out_why, "%g is neither; give 1 or 0", value);
    case GV_REQUEST_STATUS: return check_status(message->text, out_why);
    default:
      return refuse(out_why, "no command has the number %d; see data/lcm/gloved_command_t.lcm",
                    message->kind);
  }
}

bool gv_request_check(const gv_request_message *message, gv_request_rate *rate, int64_t now_ns,
                      gv_request *out, char out_why[GV_REQUEST_WHY]) {
  *out = (gv_request){.kind = (gv_request_kind)message->kind, .value = message->value, .tag = message->tag};
  out_why[0] = '\0';
  // whoever else sends, and how much: this one is always obeyed
  if (message->kind == GV_REQUEST_DISARM)
    return true;
  if (is_above(rate, now_ns, GV_REQUEST_PER_SECOND))
    return refuse(out_why, "more than %d a second; send fewer", GV_REQUEST_PER_SECOND);
  snprintf(out->text, sizeof out->text, "%s", message->text);
  return check_what_is_asked(message, out_why);
}
