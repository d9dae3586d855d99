// SPDX-License-Identifier: BSD-3-Clause
// A CyberGlove on a serial line as a driver: its frames become GLOVE frames. poll runs in the real-time
// thread; set_up in the port's keeper, again after every reset of the glove and every reconnection.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "wire/cyberglove.h"
#include "gloved/fcu.h"
#include "drivers/serial_source.h"

enum { QUIET_MS = 40, STOP_MS = 400, WRITE_MS = 500, REPLY_MS = 300, REPLY_BYTES = 256 };
enum { SETTING_LEFT = 256 };   // added to the sensors in what set_up returns

typedef struct cyberglove {
  serial_source source;        // first: serial_source_close frees it
  gv_calibration cal;
  gv_side side;                // of a glove that does not say
  int sensors;                 // 18 or 22; 0: ask
  gv_cyberglove_format format; // of the connection
  uint8_t counter;
} cyberglove;

// ---- set-up, in the keeper ------------------------------------------------------------------------

// Sends "?query" and takes `values` bytes of the reply. False where the glove does not answer.
static bool ask(int fd, char query, int values, uint8_t *out) {
  const char question[2] = {'?', query};
  uint8_t reply[REPLY_BYTES];
  if (serial_write(fd, question, sizeof question, WRITE_MS)) return false;
  const int count = serial_read(fd, reply, sizeof reply, QUIET_MS, REPLY_MS);
  return gv_cyberglove_find_reply(reply, count, query, values, out);
}

static void let_pass(int fd) {
  uint8_t rest[1024];
  serial_read(fd, rest, sizeof rest, QUIET_MS, STOP_MS);
}

static int stop_stream(int fd) {
  const uint8_t stop = GV_CYBERGLOVE_STOP;
  if (serial_write(fd, &stop, 1, WRITE_MS)) return -1;
  let_pass(fd);
  return 0;
}

// Frames without time stamp and status byte (an old glove that knows neither answers with an error, which is
// let pass), then the stream.
static int start_stream(const cyberglove *d, int fd) {
  static const uint8_t plain[] = {'D', 0, 'U', 0};
  static const char wide[] = "1eu1S";
  if (serial_write(fd, plain, sizeof plain, WRITE_MS)) return -1;
  let_pass(fd);
  return d->format.wide ? serial_write(fd, wide, strlen(wide), WRITE_MS) : serial_write(fd, "S", 1, WRITE_MS);
}

static void ask_calibration(cyberglove *d, int fd, int sensors) {
  uint8_t reply[2 * GV_SENSORS];
  if (!ask(fd, 'C', 2 * sensors, reply)) return;
  for (int i = 0; i < sensors; i++) {
    atomic_store(&d->source.offset[i], reply[i]);
    atomic_store(&d->source.gain[i], reply[sensors + i]);
  }
  atomic_store(&d->source.calibrated, true);
}

static int set_up(void *self, int fd) {
  cyberglove *d = self;
  uint8_t sensors = (uint8_t)d->sensors, right = d->side == GV_RIGHT;
  if (stop_stream(fd)) return -1;
  if (!d->sensors && !ask(fd, 'S', 1, &sensors)) return -1;
  if (sensors != GV_SENSORS && sensors != GV_CYBERGLOVE_FEWER) return -1;
  atomic_store(&d->source.sensors, sensors);
  ask(fd, 'R', 1, &right);
  ask_calibration(d, fd, sensors);
  if (start_stream(d, fd)) return -1;
  return sensors + (right ? 0 : SETTING_LEFT);
}

// ---- frames, in the real-time thread --------------------------------------------------------------

static void make_frame(cyberglove *d, int length, int64_t now_ns, uint32_t age_us, gv_frame *out) {
  gv_glove_msg msg = {.counter = d->counter++, .flags = d->source.setting & SETTING_LEFT ? GV_GLOVE_LEFT : 0,
                      .stamp_us = (uint32_t)(now_ns / 1000), .age_us = age_us};
  gv_cyberglove_decode(&d->format, d->source.framer.byte, length, &d->cal, msg.raw);
  gv_fcu_pack_glove(&msg, out);
  out->stamp_ns = now_ns;
}

static int poll_cyberglove(void *self, int64_t now_ns, gv_frame *out, int max) {
  cyberglove *d = self;
  bool may_read = true;
  int n = 0;
  while (n < max && serial_source_ready(&d->source, &may_read)) {
    uint32_t age_us;
    d->format.sensors = d->source.setting & ~SETTING_LEFT;
    const int length = serial_source_next(&d->source, gv_cyberglove_scan, &d->format, &age_us);
    if (length > 0) make_frame(d, length, now_ns, age_us, &out[n++]);
  }
  d->source.rx += (uint64_t)n;
  return n;
}

// ---- opening --------------------------------------------------------------------------------------

static void read_url(cyberglove *d, const char *text, char *err, size_t err_size) {
  static const char *const types[] = {"cyberglove", NULL}, *const no_yes[] = {"no", "yes", NULL};
  static const char *const sensors[] = {"ask", "18", "22", NULL};
  static const int count[] = {0, GV_CYBERGLOVE_FEWER, GV_SENSORS};
  serial_url *url = &d->source.url;
  serial_url_parse(url, text, err, err_size);
  serial_url_choice(url, "type", types, 0);
  d->source.port.baud = serial_url_baud(url);
  d->sensors = count[serial_url_choice(url, "sensors", sensors, 0)];
  d->format.wide = serial_url_choice(url, "wide", no_yes, 0) == 1;
  serial_url_finish(url, "serial:/dev/ttyUSB0?type=cyberglove&baud=115200&sensors=22&wide=no");
}

int gv_cyberglove_open(const char *url, const gv_calibration *cal, gv_side side, gv_driver *out, char *err, size_t err_size) {
  cyberglove *d = calloc(1, sizeof *d);
  if (!d) {
    snprintf(err, err_size, "%.80s: out of memory; close other programs", url);
    return -1;
  }
  d->cal = *cal;
  d->side = side;
  read_url(d, url, err, err_size);
  if (d->source.url.failed || serial_source_open(&d->source, set_up, d)) {
    free(d);
    return -1;
  }
  *out = (gv_driver){d, poll_cyberglove, serial_source_send, serial_source_ended, serial_source_stats, serial_source_close,
                     serial_source_descriptor, GV_CALLS_LINE};
  return 0;
}
