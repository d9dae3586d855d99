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

static int open_glove(const char *url, gv_side side, const gv_calibration *cal, gv_driver *out, char *err,
                      size_t err_size) {
  if (has_type(url, "cyberglove"))
    return gv_cyberglove_open(url, cal, side, out, err, err_size);
  if (has_type(url, "lucidglove"))
    return gv_lucidglove_open(url, cal, side, out, err, err_size);
  if (has_type(url, "doglove"))
    return gv_doglove_open(url, cal, side, out, err, err_size);
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

// url: of the glove that is read with `cal`, for this side.
static int open_fcu(const char *url, gv_side side, const gv_calibration *cal, gv_driver *out,
                    gv_pace *out_pace, char *err, size_t err_size) {
  char bare[1024];
  bool as_fast_as_possible;
  snprintf(bare, sizeof bare, "%s", url);
  *out_pace = GV_PACE_LIVE;
  if (starts_with(url, "udp:"))
    return gv_udp_open(url, out, err, err_size);
  if (starts_with(url, "serial:"))
    return open_glove(url, side, cal, out, err, err_size);
  if (starts_with(url, "can:"))
    return gv_can_open(url, out, err, err_size);
  if (starts_with(url, "hand:"))
    return gv_hand_input_open(url, side, out, err, err_size);
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

int gv_fcu_open(const gv_settings *settings, gv_driver *out, gv_pace *out_pace, char *err, size_t err_size) {
  const gv_config *engine = &settings->engine;
  return open_fcu(settings->fcu, engine->hand.side, &engine->calibration, out, out_pace, err, err_size);
}

// What cannot go together, before anything is opened.
static int check_tracker(const char *fcu, const char *tracker, char *err, size_t err_size) {
  if (!*tracker) {
    if (!starts_with(fcu, "serial:"))
      return 0;
    snprintf(
        err, err_size,
        "--fcu %s: a bare glove does not tell where the hand is; add --tracker serial:DEVICE?type=fastrak",
        fcu);
  } else if (!starts_with(tracker, "serial:") || !has_type(tracker, "fastrak")) {
    snprintf(err, err_size, "--tracker %s: no such tracker; write serial:DEVICE?type=fastrak", tracker);
  } else if (strstr(fcu, "speed=0")) {
    snprintf(err, err_size, "--tracker %s: a live tracker does not go with speed=0; leave one of them out",
             tracker);
  } else {
    return 0;
  }
  return -1;
}

static int add_tracker(const char *url, const gv_pose *T_world_tracker, gv_driver fcu, gv_driver *out,
                       char *err, size_t err_size) {
  gv_driver tracker;
  *out = fcu;
  if (!*url)
    return 0;
  if (gv_fastrak_open(url, T_world_tracker, &tracker, err, err_size) == 0)
    return gv_pair_open(fcu, tracker, out, err, err_size);
  fcu.close(fcu.self);
  return -1;
}

// A FASTRAK has up to four receivers: its one driver tells of both hands.
static bool tracks_both(const gv_settings *settings) {
  return strstr(settings->tracker, "hand2=") && !strstr(settings->tracker, "hand2=none");
}

// ---- the second hand's ----------------------------------------------------------------------------------

// "trace:" and "sim:" live in virtual time, the others in the clock's: both hands have one time.
static int check_paces(const gv_settings *settings, gv_pace first, gv_pace second, char *err,
                       size_t err_size) {
  if (first == second)
    return 0;
  snprintf(err, err_size,
           "--fcu %s and --fcu2 %s: one goes by the clock and the other by a time of its own (trace:, sim:, "
           "speed=0); give two of a kind",
           settings->fcu, settings->fcu2);
  return -1;
}

// Whose forces differ has a limiter of its own kind.
static int check_channels(const gv_settings *settings, char *err, size_t err_size) {
  if (gv_fcu_channel(settings->fcu) == gv_fcu_channel(settings->fcu2))
    return 0;
  snprintf(err, err_size, "--fcu %s and --fcu2 %s: devices of different forces; give two of a kind",
           settings->fcu, settings->fcu2);
  return -1;
}

static int check_one_tracker(const gv_settings *settings, char *err, size_t err_size) {
  if (!tracks_both(settings) || (*settings->fcu2 && !*settings->tracker2))
    return 0;
  snprintf(err, err_size,
           *settings->fcu2 ? "--tracker %s tells of both hands already; leave tracker2 out, or hand2"
                           : "--tracker %s tells of a second hand that has no device; add --fcu2, or leave "
                             "hand2 out",
           settings->tracker);
  return -1;
}

// Names the option that a line speaks of.
static void say_which(char *err, size_t err_size) {
  char line[512];
  snprintf(line, sizeof line, "%s", err);
  if (starts_with(line, "--fcu "))
    snprintf(err, err_size, "--fcu2 %s", line + 6);
  else if (*line)
    snprintf(err, err_size, "second hand: %s", line);
}

static int open_second(const gv_settings *settings, gv_pace first_pace, gv_driver *out, char *err,
                       size_t err_size) {
  const gv_second_hand *second = &settings->engine.second;
  gv_driver fcu;
  gv_pace pace;
  if (check_channels(settings, err, err_size))
    return -1;
  if ((!tracks_both(settings) && check_tracker(settings->fcu2, settings->tracker2, err, err_size)) ||
      open_fcu(settings->fcu2, second->hand.side, &second->calibration, &fcu, &pace, err, err_size)) {
    say_which(err, err_size);
    return -1;
  }
  if (check_paces(settings, first_pace, pace, err, err_size)) {
    fcu.close(fcu.self);
    return -1;
  }
  return add_tracker(settings->tracker2, &settings->T_world_tracker, fcu, out, err, err_size);
}

// ---- all of them ----------------------------------------------------------------------------------------

int gv_device_open(const gv_settings *settings, gv_driver *out, gv_pace *out_pace, char *err,
                   size_t err_size) {
  gv_driver fcu, first, second;
  if (check_one_tracker(settings, err, err_size) ||
      check_tracker(settings->fcu, settings->tracker, err, err_size) ||
      gv_fcu_open(settings, &fcu, out_pace, err, err_size) ||
      add_tracker(settings->tracker, &settings->T_world_tracker, fcu, &first, err, err_size))
    return -1;
  if (!*settings->fcu2) {
    *out = first;
    return 0;
  }
  char said[512];  // of the first one
  snprintf(said, sizeof said, "%s", err);
  if (open_second(settings, *out_pace, &second, err, err_size)) {
    first.close(first.self);
    return -1;
  }
  if (!*err)
    snprintf(err, err_size, "%s", said);
  return gv_two_hands_open(first, second, tracks_both(settings), out, err, err_size);
}
