// SPDX-License-Identifier: BSD-3-Clause
// A FASTRAK on a serial line as a driver: its records become POSE frames in the world. poll
// runs in the real-time thread; set_up in the port's keeper, again after every reset of the
// tracker and every reconnection.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "wire/fastrak.h"
#include "gloved/fcu.h"
#include "drivers/serial_source.h"

enum { RECEIVER_HEAD = 1, RECEIVER_HAND = 2 };
enum { LATENCY_US = 4000 };  // from measuring to the first byte (manual, "Specification")
enum { QUIET_MS = 40, PAUSE_MS = 10, STOP_MS = 400, WRITE_MS = 500, REPLY_BYTES = 1024, ATTEMPTS = 3 };

typedef struct fastrak {
  serial_source source;  // first: gv_serial_source_close frees it
  gv_fastrak_setup setup;
  gv_pose T_world_tracker;
  uint8_t counter, counter2;  // of the second hand's frames
  atomic_int error;           // letter of the newest record
  char error_told;
} fastrak;

static const serial_words words = {
  "FASTRAK", "'0', station, error, seven numbers, a space or an end of line",
  "compare baud with the switches on its back; format=ascii where a line changes bytes"};

// ---- set-up, in the keeper ------------------------------------------------------------------------

// Sends it and takes what comes back. Negative where the line does not take it.
static int ask(int fd, const char *command, int quiet_ms, uint8_t reply[REPLY_BYTES]) {
  if (gv_serial_write(fd, command, strlen(command), WRITE_MS))
    return -1;
  return gv_serial_read(fd, reply, REPLY_BYTES, quiet_ms, STOP_MS);
}

static bool ask_status(int fd, gv_fastrak_status *out) {
  uint8_t reply[REPLY_BYTES];
  return gv_fastrak_find_status(reply, ask(fd, GV_FASTRAK_ASK_STATUS, QUIET_MS, reply), out);
}

// With a pause behind each, in which a refusal would come. Returns whether all were taken.
static bool send_commands(const fastrak *d, int fd) {
  char command[GV_FASTRAK_COMMAND_MAX];
  uint8_t reply[REPLY_BYTES];
  for (int i = 0; gv_fastrak_command(&d->setup, i, command) > 0; i++) {
    const int count = ask(fd, command, PAUSE_MS, reply);
    if (count < 0 || gv_fastrak_find_refusal(reply, count))
      return false;
  }
  return true;
}

static bool as_set(const fastrak *d, const gv_fastrak_status *status) {
  return status->centimetres && status->binary == (d->setup.format == GV_FASTRAK_BINARY);
}

// Whether the stations are on that were asked for; a tracker that does not tell is believed.
static bool stations_are_on(const fastrak *d, int fd) {
  uint8_t reply[REPLY_BYTES];
  bool on[GV_FASTRAK_STATIONS + 1];
  if (!gv_fastrak_find_stations(reply, ask(fd, GV_FASTRAK_ASK_STATIONS, QUIET_MS, reply), on))
    return true;
  on[0] = true;  // of a station that was not asked for
  return on[d->setup.hand] && on[d->setup.head] && on[d->setup.hand2];
}

// Stop, set up, and ask whether it is so: a lost `u` would make inches of centimetres.
static int set_up(void *self, int fd) {
  fastrak *d = self;
  uint8_t rest[REPLY_BYTES];
  gv_fastrak_status status;
  if (ask(fd, GV_FASTRAK_STOP, QUIET_MS, rest) < 0)
    return -1;
  if (!ask_status(fd, &status))
    return gv_serial_source_give_up(&d->source, "does not answer S (its status); switch it on, "
                                                "compare baud with the switches on its back");
  for (int i = 0; i < ATTEMPTS; i++) {
    if (!send_commands(d, fd))
      continue;
    if (!ask_status(fd, &status) || !as_set(d, &status))
      continue;
    if (!stations_are_on(d, fd))
      return gv_serial_source_give_up(&d->source, "has a receiver of ours switched off; plug it in, "
                                                  "or give hand= and head= (and hand2=) as they are plugged");
    gv_serial_source_give_up(&d->source, NULL);
    return gv_serial_write(fd, GV_FASTRAK_START, strlen(GV_FASTRAK_START), WRITE_MS);
  }
  return gv_serial_source_give_up(&d->source,
                                  "keeps another unit or format than it was asked for; switch it off and on");
}

// ---- what there is to tell ------------------------------------------------------------------------

static bool tell_fastrak(void *self, int64_t now_ns, char *out, size_t size) {
  fastrak *d = self;
  const char error = (char)atomic_load_explicit(&d->error, memory_order_relaxed);
  if (error == d->error_told)
    return gv_serial_source_tell(self, now_ns, out, size);
  d->error_told = error;
  if (error == ' ')
    return false;
  const bool dropped = gv_fastrak_error_concerns_pose(error);
  snprintf(out, size, "%s: the tracker reports error %c: %s; %s", d->source.url.device, error,
           gv_fastrak_error_text(error), dropped ? "its poses are not used meanwhile" : "its poses are used");
  return true;
}

// ---- frames, in the real-time thread --------------------------------------------------------------

// False for a station that was not asked for.
static bool make_frame(fastrak *d, const gv_fastrak_record *record, int64_t now_ns, uint32_t age_us,
                       gv_frame *out) {
  const bool hand2 = record->station == d->setup.hand2;
  const bool hand = hand2 || record->station == d->setup.hand;
  if (!hand && record->station != d->setup.head)
    return false;
  atomic_store_explicit(&d->error, record->error, memory_order_relaxed);
  const gv_pose_msg msg = {.counter = hand2 ? d->counter2++ : d->counter++,
                           .flags = record->usable ? GV_POSE_VALID : GV_POSE_TRACKER_ERROR,
                           .stamp_us = (uint32_t)(now_ns / 1000),
                           .age_us = age_us,
                           .receiver = hand ? RECEIVER_HAND : RECEIVER_HEAD,
                           .T_world_receiver = gv_pose_mul(d->T_world_tracker, record->T_tracker_receiver)};
  gv_fcu_pack_pose(&msg, out);
  out->stamp_ns = now_ns;
  out->flags |= hand2 ? GV_FRAME_SECOND : 0;
  return true;
}

static int poll_fastrak(void *self, int64_t now_ns, gv_frame *out, int max) {
  fastrak *d = self;
  bool may_read = true;
  int n = 0;
  while (n < max && gv_serial_source_ready(&d->source, &may_read)) {
    gv_fastrak_record record;
    uint32_t age_us;
    if (gv_serial_source_next(&d->source, gv_fastrak_scan, &d->setup.format, &age_us) == 0)
      continue;
    gv_fastrak_decode(d->setup.format, d->source.framer.byte, &record);
    n += make_frame(d, &record, now_ns, age_us + LATENCY_US, &out[n]) ? 1 : 0;
  }
  d->source.rx += (uint64_t)n;
  return n;
}

static void read_url(fastrak *d, const char *text, char *err, size_t err_size) {
  static const char *const types[] = {"fastrak", NULL};
  static const char *const formats[] = {"binary", "ascii", NULL};
  static const char *const hands[] = {"1", "2", "3", "4", NULL};
  static const char *const heads[] = {"none", "1", "2", "3", "4", NULL};
  static const char *const hemispheres[] = {"+x", "-x", "+y", "-y", "+z", "-z", NULL};
  serial_url *url = &d->source.url;
  gv_serial_url_parse(url, text, err, err_size);
  gv_serial_url_choice(url, "type", types, 0);
  d->source.port.baud = gv_serial_url_baud(url, SERIAL_BAUD);
  d->setup.format = (gv_fastrak_format)gv_serial_url_choice(url, "format", formats, GV_FASTRAK_BINARY);
  d->setup.hand = 1 + gv_serial_url_choice(url, "hand", hands, 1);
  d->setup.head = gv_serial_url_choice(url, "head", heads, d->setup.hand == 1 ? 0 : 1);
  d->setup.hand2 = gv_serial_url_choice(url, "hand2", heads, 0);
  const int hemisphere = gv_serial_url_choice(url, "hemisphere", hemispheres, 0);
  d->setup.hemisphere[hemisphere / 2] = hemisphere % 2 ? -1 : 1;
  if (d->setup.hand == d->setup.head)
    gv_serial_url_fail(url, "hand and head are both station %d; give them different ones, or head=none",
                       d->setup.hand);
  if (d->setup.hand2 && (d->setup.hand2 == d->setup.hand || d->setup.hand2 == d->setup.head))
    gv_serial_url_fail(url, "hand2 is station %d, as hand or head; give it one of its own", d->setup.hand2);
  gv_serial_url_finish(url, "serial:/dev/ttyUSB0?type=fastrak&baud=115200&hand=2&head=1&hemisphere=+x");
}

int gv_fastrak_open(const char *url, const gv_pose *T_world_tracker, gv_driver *out, char *err,
                    size_t err_size) {
  fastrak *d = calloc(1, sizeof *d);
  if (!d) {
    snprintf(err, err_size, "%.80s: out of memory; close other programs", url);
    return -1;
  }
  d->T_world_tracker = *T_world_tracker;
  d->source.words = &words;
  atomic_init(&d->error, ' ');
  d->error_told = ' ';
  read_url(d, url, err, err_size);
  if (d->source.url.failed || gv_serial_source_open(&d->source, set_up, d)) {
    free(d);
    return -1;
  }
  *out = (gv_driver){d,
                     poll_fastrak,
                     gv_serial_source_send,
                     gv_serial_source_ended,
                     gv_serial_source_stats,
                     gv_serial_source_close,
                     gv_serial_source_descriptor,
                     GV_CALLS_LINE,
                     tell_fastrak};
  return 0;
}
