// SPDX-License-Identifier: BSD-3-Clause
// URLs to drivers. The parameter speed belongs to the loop and not to the driver: it is taken out here.
// A tracker of its own and the fcu become one driver (drivers/pair.c), so that the loop knows one.
#include "daemon/load/devices.h"

#include <stdio.h>
#include <string.h>

static bool starts_with(const char *text, const char *start) {
  return strncmp(text, start, strlen(start)) == 0;
}

// Takes "speed=N" out of the URL's parameters. 0, or negative with one line in err.
static int take_speed(char *url, bool *out_free, char *err, size_t err_size) {
  char *at = strstr(url, "?speed=");
  if (!at)
    at = strstr(url, "&speed=");
  *out_free = false;
  if (!at)
    return 0;
  const char value = at[7];
  const char end = value ? at[8] : '\0';
  if ((value != '0' && value != '1') || (end != '\0' && end != '&')) {
    snprintf(err, err_size, "--fcu %s: speed can be 0 (as fast as possible) or 1 (real time)", url);
    return -1;
  }
  *out_free = value == '0';
  // "?speed=0&x=1" leaves "?x=1", "?x=1&speed=0" leaves "?x=1".
  if (end == '&')
    memmove(at + 1, at + 9, strlen(at + 9) + 1);
  else
    *at = '\0';
  return 0;
}

// Whether the URL says type=NAME.
static bool has_type(const char *url, const char *type) {
  const char *at = strstr(url, "type=");
  const size_t n = strlen(type);
  return at && strncmp(at + 5, type, n) == 0 && (at[5 + n] == '\0' || at[5 + n] == '&');
}

static int open_glove(const char *url, const gv_settings *settings, gv_driver *out, char *err,
                      size_t err_size) {
  if (has_type(url, "cyberglove"))
    return gv_cyberglove_open(url, &settings->engine.calibration, settings->engine.hand.side, out, err,
                              err_size);
  if (has_type(url, "lucidglove"))
    return gv_lucidglove_open(url, &settings->engine.calibration, settings->engine.hand.side, out, err,
                              err_size);
  if (has_type(url, "doglove"))
    return gv_doglove_open(url, &settings->engine.calibration, settings->engine.hand.side, out, err,
                           err_size);
  snprintf(err, err_size,
           has_type(url, "fastrak")
               ? "--fcu %s: this is a tracker; give it as --tracker"
               : "--fcu %s: no type of device; write serial:DEVICE?type=cyberglove, lucidglove or doglove",
           url);
  return -1;
}

const gv_channel *gv_fcu_channel(const char *url) {
  const bool serial = starts_with(url, "serial:");
  if (serial && has_type(url, "lucidglove"))
    return gv_channel_of(GV_CHANNEL_LUCIDGLOVE);
  return gv_channel_of(serial && has_type(url, "doglove") ? GV_CHANNEL_DOGLOVE : GV_CHANNEL_CYBERGRASP);
}

int gv_fcu_open(const gv_settings *settings, gv_driver *out, gv_pace *out_pace, char *err, size_t err_size) {
  const char *url = settings->fcu;
  char bare[1024];
  bool as_fast_as_possible;
  snprintf(bare, sizeof bare, "%s", url);
  *out_pace = GV_PACE_LIVE;
  if (starts_with(url, "udp:"))
    return gv_udp_open(url, out, err, err_size);
  if (starts_with(url, "serial:"))
    return open_glove(url, settings, out, err, err_size);
  if (starts_with(url, "can:"))
    return gv_can_open(url, out, err, err_size);
  if (starts_with(url, "hand:"))
    return gv_hand_input_open(url, settings->engine.hand.side, out, err, err_size);
  if (starts_with(url, "trace:") || starts_with(url, "sim:")) {
    if (take_speed(bare, &as_fast_as_possible, err, err_size))
      return -1;
    *out_pace = as_fast_as_possible ? GV_PACE_FREE : GV_PACE_PACED;
    return bare[0] == 's' ? gv_sim_open(bare, out, err, err_size)
                          : gv_trace_open(bare + 6, out, err, err_size);
  }
  snprintf(err, err_size,
           "--fcu %s: no such kind of URL; use can:, udp:, serial:, hand:, trace: or sim: (gloved --help)",
           url);
  return -1;
}

// What cannot go together, before anything is opened.
static int check_tracker(const gv_settings *settings, char *err, size_t err_size) {
  const char *url = settings->tracker;
  if (!*url) {
    if (!starts_with(settings->fcu, "serial:"))
      return 0;
    snprintf(
        err, err_size,
        "--fcu %s: a bare glove does not tell where the hand is; add --tracker serial:DEVICE?type=fastrak",
        settings->fcu);
  } else if (!starts_with(url, "serial:") || !has_type(url, "fastrak")) {
    snprintf(err, err_size, "--tracker %s: no such tracker; write serial:DEVICE?type=fastrak", url);
  } else if (strstr(settings->fcu, "speed=0")) {
    snprintf(err, err_size, "--tracker %s: a live tracker does not go with speed=0; leave one of them out",
             url);
  } else {
    return 0;
  }
  return -1;
}

int gv_device_open(const gv_settings *settings, gv_driver *out, gv_pace *out_pace, char *err,
                   size_t err_size) {
  gv_driver fcu, tracker;
  if (check_tracker(settings, err, err_size) || gv_fcu_open(settings, &fcu, out_pace, err, err_size))
    return -1;
  if (!*settings->tracker) {
    *out = fcu;
    return 0;
  }
  if (gv_fastrak_open(settings->tracker, &settings->T_world_tracker, &tracker, err, err_size) == 0)
    return gv_pair_open(fcu, tracker, out, err, err_size);
  fcu.close(fcu.self);
  return -1;
}
