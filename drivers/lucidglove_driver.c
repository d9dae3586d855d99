// SPDX-License-Identifier: BSD-3-Clause
// A LucidGlove on a serial line as a driver: its lines become GLOVE frames, FORCE_COMMAND frames become
// lines of brakes. poll and send run in the real-time thread; set_up, look and let_go in the port's keeper.
//
// Pace: the glove reads one line for each that it writes, and its input queue is long: lines sent faster
// would be obeyed late. So a line goes out for each that came in, with the newest command at that time;
// after 20 ms without one (a line was lost on the way), one more; and zero brakes at once.
//
// Letting go: a command without ENABLE, one that does not decode, and silence of the engine for 5 ms are
// zero brakes. The silence is the keeper's to see: it runs while the real-time thread hangs, not while the
// process is stopped or killed, and the stock firmware has no watchdog of its own.
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "gloved/channel.h"
#include "gloved/fcu.h"
#include "wire/line_out.h"
#include "wire/lucidglove.h"
#include "drivers/serial_source.h"

enum { BOOT_MS = 3000, QUIET_MS = 100, WRITE_MS = 200, LET_GO_AFTER_MS = 5 };
static const int64_t answer_ns = 20000000;  // a glove that has not answered by then lost its line

static const int no_brake[GV_FINGERS];

typedef struct lucidglove {
  serial_source source;  // first: gv_serial_source_close frees it
  gv_calibration cal;
  gv_side side;
  gv_lucid_format format;
  uint32_t dead_man;  // the letter of the switch
  bool flip;          // its firmware turns the servos the other way round: 1000 is free
  // real-time thread
  uint8_t counter;
  int64_t now_ns, put_ns;  // of the last poll; when a line was last put
  uint64_t tx, tx_failed;
  // both threads
  atomic_int unanswered;  // lines that the glove has not read yet, as far as its own lines tell
  atomic_ulong commands;  // so far
  atomic_flag busy;       // holds `out` and `braked`; whoever finds it taken does without
  line_out out;
  bool braked;  // the last line put was not zero
  // keeper
  unsigned long commands_seen;
  int64_t seen_ms;
} lucidglove;

static const serial_words words = {"LucidGlove", "lines of letters with numbers, from A on",
                                   "compare baud and max with its firmware's Config.h"};

// ---- lines out ------------------------------------------------------------------------------------

static bool take(lucidglove *d) { return !atomic_flag_test_and_set_explicit(&d->busy, memory_order_acquire); }
static void release(lucidglove *d) { atomic_flag_clear_explicit(&d->busy, memory_order_release); }

static bool is_zero(const int brake[GV_FINGERS]) { return memcmp(brake, no_brake, sizeof no_brake) == 0; }

// The line that this glove understands; returns its length.
static int encode_brakes(const lucidglove *d, const int brake[GV_FINGERS], char out[GV_LUCID_BRAKES_BYTES]) {
  int turned[GV_FINGERS];
  for (int f = 0; f < GV_FINGERS; f++)
    turned[f] = d->flip ? GV_LUCID_BRAKE_MAX - brake[f] : brake[f];
  return gv_lucid_encode_brakes(turned, out);
}

// Returns whether an older line was dropped for it.
static bool put_brakes(lucidglove *d, const int brake[GV_FINGERS]) {
  char line[GV_LUCID_BRAKES_BYTES];
  const int count = encode_brakes(d, brake, line);
  d->braked = !is_zero(brake);
  atomic_fetch_add(&d->unanswered, 1);
  return gv_line_out_put(&d->out, line, count);
}

static bool may_put(const lucidglove *d, const int brake[GV_FINGERS]) {
  if (d->braked && is_zero(brake))
    return true;
  return atomic_load(&d->unanswered) < 1 || d->now_ns - d->put_ns >= answer_ns;
}

static void write_out(lucidglove *d) {
  const char *bytes;
  int count;
  while ((count = gv_line_out_bytes(&d->out, &bytes)) > 0) {
    const int n = gv_serial_port_write(&d->source.port, bytes, count);
    if (n <= 0)
      return;
    gv_line_out_wrote(&d->out, n);
  }
}

static void offer(lucidglove *d, const int brake[GV_FINGERS]) {
  if (!take(d)) {  // the keeper lets go just now
    d->tx_failed++;
    return;
  }
  if (may_put(d, brake)) {
    if (d->now_ns - d->put_ns >= answer_ns)
      atomic_store(&d->unanswered, 0);
    d->put_ns = d->now_ns;
    if (put_brakes(d, brake))
      d->tx_failed++;
  }
  write_out(d);
  release(d);
}

static void read_command(const gv_frame *frame, int out_brake[GV_FINGERS]) {
  const gv_channel *channel = gv_channel_of(GV_CHANNEL_LUCIDGLOVE);
  gv_command_msg msg;
  memset(out_brake, 0, sizeof no_brake);
  if (gv_fcu_unpack_command(frame, &msg) != GV_FCU_OK || !(msg.flags & GV_COMMAND_ENABLE))
    return;
  for (int f = 0; f < GV_FINGERS; f++)
    out_brake[f] = gv_channel_counts(channel, msg.tension_n[f]);
}

static int send_lucid(void *self, const gv_frame *frame, int count) {
  lucidglove *d = self;
  int brake[GV_FINGERS];
  for (int i = 0; i < count; i++) {
    if (frame[i].id != GV_ID_FORCE_COMMAND)
      continue;
    read_command(&frame[i], brake);
    offer(d, brake);
    atomic_fetch_add_explicit(&d->commands, 1, memory_order_relaxed);
    d->tx++;
  }
  return 0;
}

// ---- the keeper's part ----------------------------------------------------------------------------

static void take_surely(lucidglove *d) {
  while (!take(d))
    nanosleep(&(struct timespec){0, 100000}, NULL);
}

static int write_zero(const lucidglove *d, int fd) {
  char line[GV_LUCID_BRAKES_BYTES];
  const int count = encode_brakes(d, no_brake, line);
  return gv_serial_write(fd, line, (size_t)count, WRITE_MS);
}

// A board that opening has reset needs a second to start; opening it again would reset it again.
static int set_up(void *self, int fd) {
  lucidglove *d = self;
  uint8_t bytes[256];
  take_surely(d);
  d->out = (line_out){.written = 0};
  d->braked = false;
  release(d);
  if (write_zero(d, fd))
    return -1;
  for (int ms = 0; ms < BOOT_MS && !atomic_load(&d->source.port.stop); ms += QUIET_MS) {
    const int count = gv_serial_read(fd, bytes, sizeof bytes, QUIET_MS, QUIET_MS);
    if (count > 0 && memchr(bytes, '\n', (size_t)count))
      return 0;
  }
  return -1;
}

static void look(void *self, int fd, int64_t now_ms) {
  lucidglove *d = self;
  const char *bytes;
  const unsigned long commands = atomic_load_explicit(&d->commands, memory_order_relaxed);
  if (commands != d->commands_seen || !d->seen_ms) {
    d->commands_seen = commands;
    d->seen_ms = now_ms;
  }
  if (now_ms - d->seen_ms < LET_GO_AFTER_MS || !take(d))
    return;
  if (d->braked)
    put_brakes(d, no_brake);
  const int count = gv_line_out_bytes(&d->out, &bytes);
  const ssize_t n = count > 0 ? write(fd, bytes, (size_t)count) : 0;
  if (n > 0)
    gv_line_out_wrote(&d->out, (int)n);
  release(d);
}

// A line that has begun is ended first.
static void let_go(void *self, int fd) {
  lucidglove *d = self;
  const char *rest;
  take_surely(d);
  const int count = d->out.written > 0 ? gv_line_out_bytes(&d->out, &rest) : 0;
  if (count == 0 || gv_serial_write(fd, rest, (size_t)count, WRITE_MS) == 0)
    write_zero(d, fd);
  d->out = (line_out){.written = 0};
  d->braked = false;
  release(d);
}

// ---- frames, in the real-time thread --------------------------------------------------------------

static void make_frame(lucidglove *d, int length, int64_t now_ns, uint32_t age_us, gv_frame *out) {
  gv_glove_msg msg = {.counter = d->counter++, .stamp_us = (uint32_t)(now_ns / 1000), .age_us = age_us};
  gv_lucid_sample sample;
  gv_lucid_decode(&d->format, d->source.framer.byte, length, &sample);
  gv_lucid_raw(&d->format, &sample, &d->cal, msg.raw);
  if (d->side == GV_LEFT)
    msg.flags |= GV_GLOVE_LEFT;
  if (sample.letters & d->dead_man)
    msg.flags |= GV_GLOVE_DEAD_MAN;
  // its ranges start anew: no angle holds
  if (sample.letters & gv_lucid_bit('O'))
    msg.flags |= GV_GLOVE_SENSOR_FAULT;
  gv_fcu_pack_glove(&msg, out);
  out->stamp_ns = now_ns;
}

static int poll_lucid(void *self, int64_t now_ns, gv_frame *out, int max) {
  lucidglove *d = self;
  bool may_read = true;
  int n = 0;
  d->now_ns = now_ns;
  while (n < max && gv_serial_source_ready(&d->source, &may_read)) {
    uint32_t age_us;
    const int length = gv_serial_source_next(&d->source, gv_lucid_scan, &d->format, &age_us);
    if (length == 0)
      continue;
    if (atomic_load(&d->unanswered) > 0)
      atomic_fetch_sub(&d->unanswered, 1);
    make_frame(d, length, now_ns, age_us, &out[n++]);
  }
  d->source.rx += (uint64_t)n;
  return n;
}

// ---- opening --------------------------------------------------------------------------------------

static gv_driver_stats stats_lucid(void *self) {
  const lucidglove *d = self;
  gv_driver_stats stats = gv_serial_source_stats(self);
  stats.tx = d->tx;
  stats.tx_failed = d->tx_failed;
  return stats;
}

static void read_url(lucidglove *d, const char *text, char *err, size_t err_size) {
  static const char *const types[] = {"lucidglove", NULL};
  static const char *const max[] = {"4095", "1023", NULL};
  static const char *const switches[] = {"a", "b", "joystick", NULL};
  static const char letters[] = {'J', 'K', 'H'};
  static const char *const no_yes[] = {"no", "yes", NULL};
  serial_url *url = &d->source.url;
  gv_serial_url_parse(url, text, err, err_size);
  gv_serial_url_choice(url, "type", types, 0);
  d->source.port.baud = gv_serial_url_baud(url, SERIAL_BAUD);
  d->format.max = gv_serial_url_choice(url, "max", max, 0) == 0 ? 4095 : 1023;
  d->dead_man = gv_lucid_bit(letters[gv_serial_url_choice(url, "dead_man", switches, 0)]);
  d->flip = gv_serial_url_choice(url, "flip", no_yes, 0) == 1;
  gv_serial_url_finish(url, "serial:/dev/ttyUSB0?type=lucidglove&baud=115200&max=4095&dead_man=a&flip=no");
}

int gv_lucidglove_open(const char *url, const gv_calibration *cal, gv_side side, gv_driver *out, char *err,
                       size_t err_size) {
  lucidglove *d = calloc(1, sizeof *d);
  if (!d) {
    snprintf(err, err_size, "%.80s: out of memory; close other programs", url);
    return -1;
  }
  d->cal = *cal;
  d->source.words = &words;
  d->side = side;
  d->source.port.look = look;
  d->source.port.let_go = let_go;
  atomic_flag_clear(&d->busy);
  read_url(d, url, err, err_size);
  if (d->source.url.failed || gv_serial_source_open(&d->source, set_up, d)) {
    free(d);
    return -1;
  }
  *out = (gv_driver){d,
                     poll_lucid,
                     send_lucid,
                     gv_serial_source_ended,
                     stats_lucid,
                     gv_serial_source_close,
                     gv_serial_source_descriptor,
                     GV_CALLS_LINE,
                     gv_serial_source_tell};
  return 0;
}
