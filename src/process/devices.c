// SPDX-License-Identifier: BSD-3-Clause
// URLs to drivers. The parameter speed belongs to the loop and not to the driver: it is taken out here.
#include "devices.h"

#include <stdio.h>
#include <string.h>

static bool starts_with(const char *text, const char *start) { return strncmp(text, start, strlen(start)) == 0; }

// Takes "speed=N" out of the URL's parameters. 0, or negative with one line in err.
static int take_speed(char *url, bool *out_free, char *err, size_t err_size) {
  char *at = strstr(url, "?speed=");
  if (!at) at = strstr(url, "&speed=");
  *out_free = false;
  if (!at) return 0;
  const char value = at[7], end = value ? at[8] : '\0';
  if ((value != '0' && value != '1') || (end != '\0' && end != '&')) {
    snprintf(err, err_size, "--fcu %s: speed can be 0 (as fast as possible) or 1 (real time)", url);
    return -1;
  }
  *out_free = value == '0';
  // "?speed=0&x=1" leaves "?x=1", "?x=1&speed=0" leaves "?x=1".
  if (end == '&') memmove(at + 1, at + 9, strlen(at + 9) + 1);
  else *at = '\0';
  return 0;
}

int gv_device_open(const char *url, gv_driver *out, gv_pace *out_pace, char *err, size_t err_size) {
  char bare[1024];
  bool as_fast_as_possible;
  snprintf(bare, sizeof bare, "%s", url);
  *out_pace = GV_PACE_LIVE;
  if (starts_with(url, "udp:")) return gv_udp_open(url, out, err, err_size);
  if (starts_with(url, "trace:") || starts_with(url, "sim:")) {
    if (take_speed(bare, &as_fast_as_possible, err, err_size)) return -1;
    *out_pace = as_fast_as_possible ? GV_PACE_FREE : GV_PACE_PACED;
    return bare[0] == 's' ? gv_sim_open(bare, out, err, err_size) : gv_trace_open(bare + 6, out, err, err_size);
  }
  if (starts_with(url, "can:") || starts_with(url, "serial:"))
    snprintf(err, err_size, "--fcu %s: not built yet; use udp:, trace: or sim:", url);
  else
    snprintf(err, err_size, "--fcu %s: no such kind of URL; use udp:, trace: or sim: (gloved --help)", url);
  return -1;
}

int gv_tracker_check(const char *url, char *err, size_t err_size) {
  if (!*url) return 0;
  snprintf(err, err_size, "--tracker %s: not built yet; leave it out: the poses come with the frames of --fcu", url);
  return -1;
}
