// SPDX-License-Identifier: BSD-3-Clause
// A FASTRAK on a serial line as a driver: its records become POSE frames in the world. poll runs in the
// real-time thread; set_up in the port's keeper, again after every reset of the tracker and every reconnection.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "wire/fastrak.h"
#include "gloved/fcu.h"
#include "drivers/serial_source.h"

enum { RECEIVER_HEAD = 1, RECEIVER_HAND = 2 };
enum { LATENCY_US = 4000 };    // from measuring to the first byte (manual, "Specification")
enum { QUIET_MS = 40, STOP_MS = 400, WRITE_MS = 500 };

typedef struct fastrak {
  serial_source source;        // first: serial_source_close frees it
  gv_fastrak_setup setup;
  gv_pose T_world_tracker;
  uint8_t counter;
} fastrak;

// Stop, let what is under way pass by, then set up and start. The tracker acknowledges nothing; that it
// streams is seen by the records.
static int set_up(void *self, int fd) {
  fastrak *d = self;
  uint8_t rest[1024];
  char commands[GV_FASTRAK_SETUP_MAX];
  const int length = gv_fastrak_commands(&d->setup, commands);
  if (serial_write(fd, GV_FASTRAK_STOP, strlen(GV_FASTRAK_STOP), WRITE_MS)) return -1;
  serial_read(fd, rest, sizeof rest, QUIET_MS, STOP_MS);
  return serial_write(fd, commands, (size_t)length, WRITE_MS);
}

// False for a station that was not asked for.
static bool make_frame(fastrak *d, const gv_fastrak_record *record, int64_t now_ns, uint32_t age_us, gv_frame *out) {
  const bool hand = record->station == d->setup.hand;
  if (!hand && record->station != d->setup.head) return false;
  const gv_pose_msg msg = {
    .counter = d->counter++, .flags = record->error == ' ' ? GV_POSE_VALID : GV_POSE_TRACKER_ERROR,
    .stamp_us = (uint32_t)(now_ns / 1000), .age_us = age_us, .receiver = hand ? RECEIVER_HAND : RECEIVER_HEAD,
    .T_world_receiver = gv_pose_mul(d->T_world_tracker, record->T_tracker_receiver)};
  gv_fcu_pack_pose(&msg, out);
  out->stamp_ns = now_ns;
  return true;
}

static int poll_fastrak(void *self, int64_t now_ns, gv_frame *out, int max) {
  fastrak *d = self;
  bool may_read = true;
  int n = 0;
  while (n < max && serial_source_ready(&d->source, &may_read)) {
    gv_fastrak_record record;
    uint32_t age_us;
    if (serial_source_next(&d->source, gv_fastrak_scan, &d->setup.format, &age_us) == 0) continue;
    gv_fastrak_decode(d->setup.format, d->source.framer.byte, &record);
    n += make_frame(d, &record, now_ns, age_us + LATENCY_US, &out[n]) ? 1 : 0;
  }
  d->source.rx += (uint64_t)n;
  return n;
}

static void read_url(fastrak *d, const char *text, char *err, size_t err_size) {
  static const char *const types[] = {"fastrak", NULL}, *const formats[] = {"binary", "ascii", NULL};
  static const char *const hands[] = {"1", "2", "3", "4", NULL}, *const heads[] = {"none", "1", "2", "3", "4", NULL};
  static const char *const hemispheres[] = {"+x", "-x", "+y", "-y", "+z", "-z", NULL};
  serial_url *url = &d->source.url;
  serial_url_parse(url, text, err, err_size);
  serial_url_choice(url, "type", types, 0);
  d->source.port.baud = serial_url_baud(url);
  d->setup.format = (gv_fastrak_format)serial_url_choice(url, "format", formats, GV_FASTRAK_BINARY);
  d->setup.hand = 1 + serial_url_choice(url, "hand", hands, 1);
  d->setup.head = serial_url_choice(url, "head", heads, d->setup.hand == 1 ? 0 : 1);
  const int hemisphere = serial_url_choice(url, "hemisphere", hemispheres, 0);
  d->setup.hemisphere[hemisphere / 2] = hemisphere % 2 ? -1 : 1;
  if (d->setup.hand == d->setup.head) serial_url_fail(url, "hand and head are both station %d; give them different ones, or head=none", d->setup.hand);
  serial_url_finish(url, "serial:/dev/ttyUSB0?type=fastrak&baud=115200&hand=2&head=1&hemisphere=+x");
}

gv_pose gv_fastrak_upright(void) { return (gv_pose){{0, 1, 0, 0}, {0, 0, 0}}; }

int gv_fastrak_open(const char *url, const gv_pose *T_world_tracker, gv_driver *out, char *err, size_t err_size) {
  fastrak *d = calloc(1, sizeof *d);
  if (!d) {
    snprintf(err, err_size, "%.80s: out of memory; close other programs", url);
    return -1;
  }
  d->T_world_tracker = *T_world_tracker;
  read_url(d, url, err, err_size);
  if (d->source.url.failed || serial_source_open(&d->source, set_up, d)) {
    free(d);
    return -1;
  }
  *out = (gv_driver){d, poll_fastrak, serial_source_send, serial_source_ended, serial_source_stats, serial_source_close,
                     serial_source_descriptor, GV_CALLS_LINE, serial_source_tell};
  return 0;
}
