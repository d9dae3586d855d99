// SPDX-License-Identifier: BSD-3-Clause
// A CyberGlove on a serial line as a driver: its frames become GLOVE frames. poll runs in the real-time
// thread; set_up in the port's keeper, again after every reset of the glove and every reconnection.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "wire/cyberglove.h"
#include "gloved/fcu.h"
#include "drivers/serial_source.h"

enum { MASK_BYTES = 3 };
enum { QUIET_MS = 40, STOP_MS = 400, WRITE_MS = 500, REPLY_MS = 300, REPLY_BYTES = 256 };
enum { SETTING_LEFT = 256 };  // added to the sensors in what set_up returns

typedef struct cyberglove {
  serial_source source;  // first: gv_serial_source_close frees it
  gv_calibration cal;
  gv_side side;                 // of a glove that does not say
  int sensors;                  // 18 or 22; 0: ask
  gv_cyberglove_format format;  // of the connection
  uint8_t counter;
  atomic_bool unplugged;  // from its box, as the newest frame says
  bool unplugged_told;
} cyberglove;

static const serial_words words = {
  "CyberGlove", "'S', a byte for each sensor, 0",
  "compare baud with the switch of its box, sensors=18|22 and wide=yes|no with the glove"};

// ---- set-up, in the keeper ------------------------------------------------------------------------

// Sends "?query" and takes `values` bytes of the reply. False where the glove does not answer.
static bool ask(int fd, char query, int values, uint8_t *out) {
  const char question[2] = {'?', query};
  uint8_t reply[REPLY_BYTES];
  if (gv_serial_write(fd, question, sizeof question, WRITE_MS))
    return false;
  const int count = gv_serial_read(fd, reply, sizeof reply, QUIET_MS, REPLY_MS);
  return gv_cyberglove_find_reply(reply, count, query, values, out);
}

static void let_pass(int fd) {
  uint8_t rest[1024];
  gv_serial_read(fd, rest, sizeof rest, QUIET_MS, STOP_MS);
}

static int stop_stream(int fd) {
  const uint8_t stop = GV_CYBERGLOVE_STOP;
  if (gv_serial_write(fd, &stop, 1, WRITE_MS))
    return -1;
  let_pass(fd);
  return 0;
}

// Frames without time stamp and status byte (an old glove that knows neither answers with an error, which is
// let pass), then the stream.
static int start_stream(const cyberglove *d, int fd) {
  static const uint8_t plain[] = {'D', 0, 'U', 0};
  static const char wide[] = "1eu1S";
  if (gv_serial_write(fd, plain, sizeof plain, WRITE_MS))
    return -1;
  let_pass(fd);
  return d->format.wide ? gv_serial_write(fd, wide, strlen(wide), WRITE_MS)
                        : gv_serial_write(fd, "S", 1, WRITE_MS);
}

static void ask_calibration(cyberglove *d, int fd, int sensors) {
  uint8_t reply[2 * GV_SENSORS];
  if (!ask(fd, 'C', 2 * sensors, reply))
    return;
  for (int i = 0; i < sensors; i++) {
    atomic_store(&d->source.offset[i], reply[i]);
    atomic_store(&d->source.gain[i], reply[sensors + i]);
  }
  atomic_store(&d->source.calibrated, true);
}

// All of its sensors, in their order: what another program masked out would shift the rest.
static int send_all_sensors(int fd, uint8_t sensors) {
  static const uint8_t all[] = {'M', 0xff, 0xff, 0xff};
  const uint8_t number[] = {'N', sensors};
  if (gv_serial_write(fd, all, sizeof all, WRITE_MS))
    return -1;
  let_pass(fd);
  if (gv_serial_write(fd, number, sizeof number, WRITE_MS))
    return -1;
  let_pass(fd);
  return 0;
}

static int bits_of(const uint8_t mask[MASK_BYTES], const uint8_t within[MASK_BYTES]) {
  int bits = 0;
  for (int i = 0; i < MASK_BYTES; i++)
    bits += __builtin_popcount(mask[i] & within[i]);
  return bits;
}

// Whether number and mask are as they were set; a glove that does not tell (a CyberGlove III) is believed.
static bool sends_all_sensors(int fd, uint8_t sensors) {
  uint8_t number, mask[MASK_BYTES], own[MASK_BYTES] = {0xff, 0xff, 0xff};
  if (ask(fd, 'N', 1, &number) && number != sensors)
    return false;
  ask(fd, 'K', MASK_BYTES, own);
  return !ask(fd, 'M', MASK_BYTES, mask) || bits_of(mask, own) >= sensors;
}

static int set_up(void *self, int fd) {
  cyberglove *d = self;
  uint8_t sensors = (uint8_t)d->sensors;
  uint8_t right = d->side == GV_RIGHT;
  if (stop_stream(fd))
    return -1;
  if (!d->sensors && !ask(fd, 'S', 1, &sensors))
    return gv_serial_source_give_up(&d->source,
                                    "does not answer ?S (how many sensors); compare baud with its box, "
                                    "or give sensors=18|22");
  if (sensors != GV_SENSORS && sensors != GV_CYBERGLOVE_FEWER)
    return gv_serial_source_give_up(&d->source,
                                    "has neither 18 nor 22 sensors by its answer to ?S; give sensors=18|22");
  if (send_all_sensors(fd, sensors))
    return -1;
  if (!sends_all_sensors(fd, sensors))
    return gv_serial_source_give_up(
        &d->source, "does not send all of its sensors (?N, ?M, ?K); switch its box off and on");
  gv_serial_source_give_up(&d->source, NULL);
  atomic_store(&d->source.sensors, sensors);
  ask(fd, 'R', 1, &right);
  ask_calibration(d, fd, sensors);
  if (start_stream(d, fd))
    return -1;
  return sensors + (right ? 0 : SETTING_LEFT);
}

// ---- frames, in the real-time thread --------------------------------------------------------------

static void make_frame(cyberglove *d, int length, int64_t now_ns, uint32_t age_us, gv_frame *out) {
  const bool unplugged = gv_cyberglove_end_of(&d->format, d->source.framer.byte, length) ==
                         GV_CYBERGLOVE_UNPLUGGED;
  const int side = d->source.setting & SETTING_LEFT ? GV_GLOVE_LEFT : 0;
  const int fault = unplugged ? GV_GLOVE_SENSOR_FAULT : 0;
  gv_glove_msg msg = {.counter = d->counter++,
                      .flags = (uint8_t)(side | fault),
                      .stamp_us = (uint32_t)(now_ns / 1000),
                      .age_us = age_us};
  atomic_store_explicit(&d->unplugged, unplugged, memory_order_relaxed);
  gv_cyberglove_decode(&d->format, d->source.framer.byte, length, &d->cal, msg.raw);
  gv_fcu_pack_glove(&msg, out);
  out->stamp_ns = now_ns;
}

static int poll_cyberglove(void *self, int64_t now_ns, gv_frame *out, int max) {
  cyberglove *d = self;
  bool may_read = true;
  int n = 0;
  while (n < max && gv_serial_source_ready(&d->source, &may_read)) {
    uint32_t age_us;
    d->format.sensors = d->source.setting & ~SETTING_LEFT;
    const int length = gv_serial_source_next(&d->source, gv_cyberglove_scan, &d->format, &age_us);
    if (length > 0)
      make_frame(d, length, now_ns, age_us, &out[n++]);
  }
  d->source.rx += (uint64_t)n;
  return n;
}

static bool tell_cyberglove(void *self, int64_t now_ns, char *out, size_t size) {
  cyberglove *d = self;
  const bool unplugged = atomic_load_explicit(&d->unplugged, memory_order_relaxed);
  const bool news = unplugged && !d->unplugged_told;
  d->unplugged_told = unplugged;
  if (!news)
    return gv_serial_source_tell(self, now_ns, out, size);
  snprintf(out, size, "%s: the glove is not plugged into its box; plug it in", d->source.url.device);
  return true;
}

// ---- opening --------------------------------------------------------------------------------------

static void read_url(cyberglove *d, const char *text, char *err, size_t err_size) {
  static const char *const types[] = {"cyberglove", NULL};
  static const char *const no_yes[] = {"no", "yes", NULL};
  static const char *const sensors[] = {"ask", "18", "22", NULL};
  static const int count[] = {0, GV_CYBERGLOVE_FEWER, GV_SENSORS};
  serial_url *url = &d->source.url;
  gv_serial_url_parse(url, text, err, err_size);
  gv_serial_url_choice(url, "type", types, 0);
  d->source.port.baud = gv_serial_url_baud(url, SERIAL_BAUD);
  d->sensors = count[gv_serial_url_choice(url, "sensors", sensors, 0)];
  d->format.wide = gv_serial_url_choice(url, "wide", no_yes, 0) == 1;
  gv_serial_url_finish(url, "serial:/dev/ttyUSB0?type=cyberglove&baud=115200&sensors=22&wide=no");
}

int gv_cyberglove_open(const char *url, const gv_calibration *cal, gv_side side, gv_driver *out, char *err,
                       size_t err_size) {
  cyberglove *d = calloc(1, sizeof *d);
  if (!d) {
    snprintf(err, err_size, "%.80s: out of memory; close other programs", url);
    return -1;
  }
  d->cal = *cal;
  d->source.words = &words;
  d->side = side;
  read_url(d, url, err, err_size);
  if (d->source.url.failed || gv_serial_source_open(&d->source, set_up, d)) {
    free(d);
    return -1;
  }
  *out = (gv_driver){d,
                     poll_cyberglove,
                     gv_serial_source_send,
                     gv_serial_source_ended,
                     gv_serial_source_stats,
                     gv_serial_source_close,
                     gv_serial_source_descriptor,
                     GV_CALLS_LINE,
                     tell_cyberglove};
  return 0;
}
