// SPDX-License-Identifier: BSD-3-Clause
// A DOGlove as a driver: its main board's blocks and its servos' positions become GLOVE frames, FORCE_COMMAND
// frames become currents of the servos. Two serial lines, each with a keeper of its own (serial_port.h). poll
// and send run in the real-time thread; set_up, look and let_go in the servos' keeper.
//
// Forces: each servo is in current-based position mode with the open finger as its goal. So it can only pull
// the finger open, whichever way it is wound, with at most the current that it was told, and never beyond the
// open hand. No current, no torque.
//
// Pace: every 5 ms one burst goes out: currents, and a request for all positions. Zero currents go at once.
//
// Letting go: a command without ENABLE, one that does not decode, and 5 ms without a command are zero
// currents; where the real-time thread hangs, the keeper sends them. Where the process dies the servos' Bus
// Watchdog stops them after 20 ms.
#include <errno.h>
#include <fcntl.h>
#include <linux/input.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "drivers/serial_source.h"
#include "gloved/channel.h"
#include "gloved/fcu.h"
#include "wire/doglove.h"
#include "wire/dynamixel.h"

enum {
  BAUD = 921600,
  SERVO_BAUD = 3000000,
  WRITE_MS = 100,
  QUIET_MS = 5,
  REPLY_MS = 60,
  LET_GO_AFTER_MS = 5
};
enum { BURST_BYTES = 4 * GV_DYNAMIXEL_BYTES, EVENTS = 16, WATCHDOG_STOPPED = 255 };
enum { BURSTS_A_LOOK = 10 };  // every tenth burst asks for the watchdogs in place of the positions
static const int64_t burst_ns = 5000000;      // from one burst to the next
static const int64_t watchdog_ns = 20000000;  // of the servos, as set
static const int64_t command_ns = 5000000;    // without a command: zero
static const int64_t position_ns = 50000000;  // a servo's position that is older is none

typedef struct doglove {
  serial_source source;  // the main board's; first: gv_serial_source_close frees it
  serial_source servos;
  gv_calibration standard;      // what the counts in frames mean
  double open_deg[GV_FINGERS];  // where a servo stands with the open hand
  bool left;
  int pedal;  // descriptor of the dead-man switch; -1: none
  // real-time thread
  bool held;
  uint8_t counter;
  int64_t now_ns, sent_ns, commanded_ns;  // of the last poll, burst, command
  double servo_deg[GV_FINGERS];
  int64_t servo_ns[GV_FINGERS];  // 0: never
  int current_ma[GV_FINGERS];
  uint64_t tx, tx_failed;
  unsigned bursts;
  bool stopped;  // a servo says that its watchdog has stopped it
  // both threads
  atomic_flag busy;     // holds the servos' line; whoever finds it taken does without
  atomic_bool pulling;  // the last currents sent were not zero
  atomic_ulong polls;
  atomic_bool stopped_once;  // for the user
  bool told_stopped;
  // keeper of the servos
  unsigned long polls_seen;
  int64_t seen_ms;
} doglove;

static const serial_words words = {
  "DOGlove's main board", "blocks of 76 bytes that begin with aa 55 00 00",
  "compare baud with its firmware (921600), and the two lines with each other"};
static const serial_words servo_words = {
  "DOGlove's servos", "status packets that begin with ff ff fd 00",
  "switch their supply on, and see their identifiers 0 to 4 and 3000000 baud"};

// ---- bursts ---------------------------------------------------------------------------------------

static bool take(doglove *d) { return !atomic_flag_test_and_set_explicit(&d->busy, memory_order_acquire); }
static void release(doglove *d) { atomic_flag_clear_explicit(&d->busy, memory_order_release); }

typedef struct burst {
  uint8_t byte[BURST_BYTES];
  int count;
} burst;

static void add(burst *b, gv_dynamixel_packet packet) {
  b->count += gv_dynamixel_encode(&packet, b->byte + b->count);
}

static void add_same(burst *b, int address, int size, uint32_t value) {
  uint32_t all[GV_FINGERS];
  for (int f = 0; f < GV_FINGERS; f++)
    all[f] = value;
  add(b, gv_dynamixel_sync_write(GV_FINGERS, address, size, all));
}

static void add_currents(burst *b, const int current_ma[GV_FINGERS]) {
  uint32_t all[GV_FINGERS];
  for (int f = 0; f < GV_FINGERS; f++)
    all[f] = (uint32_t)current_ma[f];
  add(b, gv_dynamixel_sync_write(GV_FINGERS, GV_DYNAMIXEL_GOAL_CURRENT, 2, all));
}

// A watchdog that has stopped a servo is cleared by 0.
static void add_watchdog(burst *b) {
  add_same(b, GV_DYNAMIXEL_WATCHDOG, 1, 0);
  add_same(b, GV_DYNAMIXEL_WATCHDOG, 1, (uint32_t)(watchdog_ns / 20000000));
}

static bool is_zero(const int current_ma[GV_FINGERS]) {
  int sum = 0;
  for (int f = 0; f < GV_FINGERS; f++)
    sum += current_ma[f];
  return sum == 0;
}

// The oldest of the servos' positions, ns; negative: one is missing.
static int64_t oldest_position(const doglove *d) {
  int64_t oldest = 0;
  for (int f = 0; f < GV_FINGERS; f++) {
    const int64_t age = d->now_ns - d->servo_ns[f];
    if (!d->servo_ns[f] || age > position_ns)
      return -1;
    if (age > oldest)
      oldest = age;
  }
  return oldest;
}

// A servo that did not answer for so long may not have heard us either.
static bool may_have_stopped(const doglove *d) {
  const int64_t oldest = oldest_position(d);
  return d->stopped || oldest < 0 || oldest >= watchdog_ns || d->now_ns - d->sent_ns >= watchdog_ns;
}

static void send_burst(doglove *d) {
  burst b = {.count = 0};
  if (!take(d))
    return;  // the keeper lets go just now
  if (may_have_stopped(d))
    add_watchdog(&b);
  add_currents(&b, d->current_ma);
  const bool look = d->bursts++ % BURSTS_A_LOOK == 0;
  add(&b, look ? gv_dynamixel_sync_read(GV_FINGERS, GV_DYNAMIXEL_WATCHDOG, 1)
               : gv_dynamixel_sync_read(GV_FINGERS, GV_DYNAMIXEL_POSITION, 4));
  d->stopped = false;
  // A part of a burst is garbage with a wrong sum to the servos: the next one is whole again.
  if (gv_serial_port_write(&d->servos.port, b.byte, b.count) != b.count)
    d->tx_failed++;
  atomic_store(&d->pulling, !is_zero(d->current_ma));
  d->sent_ns = d->now_ns;
  release(d);
}

// A finger that is open already is not pulled: the servo would close it up to its goal.
static void read_command(doglove *d, const gv_frame *frame) {
  const gv_channel *channel = gv_channel_of(GV_CHANNEL_DOGLOVE);
  gv_command_msg msg;
  memset(d->current_ma, 0, sizeof d->current_ma);
  if (gv_fcu_unpack_command(frame, &msg) != GV_FCU_OK || !(msg.flags & GV_COMMAND_ENABLE))
    return;
  for (int f = 0; f < GV_FINGERS; f++)
    if (d->servo_deg[f] > d->open_deg[f])
      d->current_ma[f] = gv_channel_counts(channel, msg.tension_n[f]);
}

static int send_doglove(void *self, const gv_frame *frame, int count) {
  doglove *d = self;
  for (int i = 0; i < count; i++) {
    if (frame[i].id != GV_ID_FORCE_COMMAND)
      continue;
    read_command(d, &frame[i]);
    d->commanded_ns = d->now_ns;
    d->tx++;
  }
  if (atomic_load(&d->pulling) && is_zero(d->current_ma))
    send_burst(d);
  return 0;
}

// ---- the servos' keeper ---------------------------------------------------------------------------

static void take_surely(doglove *d) {
  while (!take(d))
    usleep(100);
}

static int write_burst(const burst *b, int fd) {
  return gv_serial_write(fd, b->byte, (size_t)b->count, WRITE_MS);
}

// One byte of a servo's control table; false where it does not answer.
static bool ask_servo(int fd, uint8_t id, int address, uint8_t *out) {
  burst b = {.count = 0};
  uint8_t reply[GV_DYNAMIXEL_BYTES];
  gv_dynamixel_packet p;
  framer f = {.count = 0};
  add(&b, gv_dynamixel_read(id, address, 1));
  if (write_burst(&b, fd))
    return false;
  const int count = gv_serial_read(fd, reply, sizeof reply, REPLY_MS, REPLY_MS);
  for (int i = 0; i < count; i++) {
    const int length = gv_framer_push(&f, reply[i], gv_dynamixel_scan, NULL);
    if (length == 0)
      continue;
    gv_dynamixel_decode(f.byte, length, &p);
    if (p.instruction != GV_DYNAMIXEL_STATUS || p.id != id || p.count != 1)
      continue;
    *out = p.parameter[0];
    return true;
  }
  return false;
}

// What its memory keeps is written only where it is another. With torque off.
static bool set_kept(int fd, uint8_t id, int address, uint8_t value) {
  burst b = {.count = 0};
  uint8_t now;
  if (!ask_servo(fd, id, address, &now))
    return false;
  if (now == value)
    return true;
  add(&b, gv_dynamixel_write(id, address, 1, value));
  return write_burst(&b, fd) == 0 && ask_servo(fd, id, address, &now) && now == value;
}

static void add_goals(const doglove *d, burst *b) {
  uint32_t goal[GV_FINGERS];
  for (int f = 0; f < GV_FINGERS; f++)
    goal[f] = (uint32_t)(d->open_deg[f] / 360.0 * GV_DYNAMIXEL_TURN + 0.5);
  add(b, gv_dynamixel_sync_write(GV_FINGERS, GV_DYNAMIXEL_GOAL_POSITION, 4, goal));
}

static int set_up_servos(void *self, int fd) {
  doglove *d = self;
  uint8_t rest[256];
  burst off = {.count = 0};
  burst goals = {.count = 0};
  burst on = {.count = 0};
  add_same(&off, GV_DYNAMIXEL_TORQUE, 1, 0);
  add_same(&off, GV_DYNAMIXEL_STATUS_LEVEL, 1, 1);
  add_same(&off, GV_DYNAMIXEL_WATCHDOG, 1, 0);
  if (write_burst(&off, fd))
    return -1;
  gv_serial_read(fd, rest, sizeof rest, QUIET_MS, REPLY_MS);
  for (uint8_t id = 0; id < GV_FINGERS; id++) {
    const bool set = set_kept(fd, id, GV_DYNAMIXEL_MODE, GV_DYNAMIXEL_MODE_CURRENT_POSITION);
    if (!set || !set_kept(fd, id, GV_DYNAMIXEL_RETURN_DELAY, 0))
      return gv_serial_source_give_up(
          &d->servos, "do not all answer, or keep another mode; switch their supply on, and see "
                      "that their identifiers are 0 to 4");
  }
  gv_serial_source_give_up(&d->servos, NULL);
  add_currents(&goals, (const int[GV_FINGERS]){0});
  add_goals(d, &goals);
  add_same(&on, GV_DYNAMIXEL_TORQUE, 1, 1);
  add_watchdog(&on);
  atomic_store(&d->pulling, false);
  return write_burst(&goals, fd) || write_burst(&on, fd) ? -1 : 0;
}

static int write_zero(int fd, bool torque_off) {
  burst b = {.count = 0};
  add_currents(&b, (const int[GV_FINGERS]){0});
  if (torque_off)
    add_same(&b, GV_DYNAMIXEL_TORQUE, 1, 0);
  return write_burst(&b, fd);
}

// The real-time thread hangs while a force is out.
static void look(void *self, int fd, int64_t now_ms) {
  doglove *d = self;
  const unsigned long polls = atomic_load_explicit(&d->polls, memory_order_relaxed);
  if (polls != d->polls_seen || !d->seen_ms) {
    d->polls_seen = polls;
    d->seen_ms = now_ms;
  }
  if (now_ms - d->seen_ms < LET_GO_AFTER_MS || !atomic_load(&d->pulling) || !take(d))
    return;
  if (write_zero(fd, false) == 0)
    atomic_store(&d->pulling, false);
  release(d);
}

static void let_go(void *self, int fd) {
  doglove *d = self;
  take_surely(d);
  write_zero(fd, true);
  atomic_store(&d->pulling, false);
  release(d);
}

// ---- frames, in the real-time thread --------------------------------------------------------------

// The switch is another device: what is held there is held.
static void read_pedal(doglove *d) {
  struct input_event event[EVENTS];
  if (d->pedal < 0)
    return;
  const ssize_t n = read(d->pedal, event, sizeof event);
  if (n == 0 || (n < 0 && errno != EAGAIN && errno != EINTR))
    d->held = false;  // unplugged
  for (ssize_t i = 0; n > 0 && i < n / (ssize_t)sizeof event[0]; i++) {
    if (event[i].type == EV_SYN && event[i].code == SYN_DROPPED)
      d->held = false;  // the kernel's queue ran over: that it was let go may be among what is lost
    if (event[i].type == EV_KEY && event[i].value != 2)
      d->held = event[i].value == 1;
  }
}

static void take_positions(doglove *d) {
  bool may_read = true;
  uint32_t age_us;
  gv_dynamixel_packet p;
  while (gv_serial_source_ready(&d->servos, &may_read)) {
    const int length = gv_serial_source_next(&d->servos, gv_dynamixel_scan, NULL, &age_us);
    if (length == 0)
      continue;
    gv_dynamixel_decode(d->servos.framer.byte, length, &p);
    if (p.instruction != GV_DYNAMIXEL_STATUS || p.id >= GV_FINGERS)
      continue;
    if (p.count == 1 && p.parameter[0] == WATCHDOG_STOPPED)
      d->stopped = true;
    if (d->stopped)
      atomic_store_explicit(&d->stopped_once, true, memory_order_relaxed);
    if (p.count != 4)
      continue;
    d->servo_deg[p.id] = 360.0 / GV_DYNAMIXEL_TURN * (int32_t)gv_dynamixel_value(p.parameter, 4);
    d->servo_ns[p.id] = d->now_ns;
  }
}

static bool make_frame(doglove *d, uint32_t age_us, gv_frame *out) {
  const int64_t servos_ns = oldest_position(d);
  const uint32_t servos_us = (uint32_t)(servos_ns / 1000);
  if (servos_ns < 0)
    return false;
  gv_glove_msg msg = {.counter = d->counter++, .stamp_us = (uint32_t)(d->now_ns / 1000)};
  gv_doglove_block block;
  double angle_rad[GV_SENSORS];
  msg.age_us = age_us > servos_us ? age_us : servos_us;
  if (d->left)
    msg.flags |= GV_GLOVE_LEFT;
  if (d->held)
    msg.flags |= GV_GLOVE_DEAD_MAN;
  gv_doglove_decode(d->source.framer.byte, &block);
  gv_doglove_angles(block.encoder_deg, d->servo_deg, angle_rad);
  for (int i = 0; i < GV_SENSORS; i++)
    msg.raw[i] = (uint16_t)gv_clamp(floor(gv_calibration_raw(&d->standard, i, angle_rad[i]) + 0.5), 0, 4095);
  gv_fcu_pack_glove(&msg, out);
  out->stamp_ns = d->now_ns;
  return true;
}

static int poll_doglove(void *self, int64_t now_ns, gv_frame *out, int max) {
  doglove *d = self;
  bool may_read = true;
  int n = 0;
  d->now_ns = now_ns;
  atomic_fetch_add_explicit(&d->polls, 1, memory_order_relaxed);
  read_pedal(d);
  take_positions(d);
  while (n < max && gv_serial_source_ready(&d->source, &may_read)) {
    uint32_t age_us;
    const int length = gv_serial_source_next(&d->source, gv_doglove_scan, NULL, &age_us);
    if (length > 0 && make_frame(d, age_us, &out[n]))
      n++;
  }
  if (now_ns - d->commanded_ns > command_ns)
    memset(d->current_ma, 0, sizeof d->current_ma);
  if (now_ns - d->sent_ns >= burst_ns || (atomic_load(&d->pulling) && is_zero(d->current_ma)))
    send_burst(d);
  d->source.rx += (uint64_t)n;
  return n;
}

static gv_driver_stats stats_doglove(void *self) {
  const doglove *d = self;
  gv_driver_stats stats = gv_serial_source_stats(self);
  stats.bad += d->servos.framer.bad_runs;
  stats.tx = d->tx;
  stats.tx_failed = d->tx_failed;
  return stats;
}

static bool tell_doglove(void *self, int64_t now_ns, char *out, size_t size) {
  doglove *d = self;
  if (atomic_load_explicit(&d->stopped_once, memory_order_relaxed) && !d->told_stopped) {
    snprintf(out, size,
             "%s: the servos' watchdog let go, since nothing came for 20 ms; gloved --doctor says what this "
             "machine "
             "does to deadlines",
             d->servos.url.device);
    return d->told_stopped = true;
  }
  return gv_serial_source_tell(&d->source, now_ns, out, size) ||
         gv_serial_source_tell(&d->servos, now_ns, out, size);
}

// ---- opening --------------------------------------------------------------------------------------

// The board sends by itself.
static int set_up_board(void *self, int fd) {
  (void)self;
  (void)fd;
  return 0;
}

static void close_doglove(void *self) {
  doglove *d = self;
  gv_serial_port_close(&d->servos.port);
  if (d->pedal >= 0)
    close(d->pedal);
  gv_serial_source_close(self);
}

static int open_pedal(doglove *d, const char *path) {
  if (!path)
    return 0;
  d->pedal = open(path, O_RDONLY | O_NONBLOCK | O_CLOEXEC);
  if (d->pedal >= 0)
    return 0;
  return gv_serial_url_fail(&d->source.url,
                            "dead_man=%.60s: %s; give an input device that you may read, e.g. of "
                            "/dev/input/by-id",
                            path, strerror(errno));
}

// Where the calibration has the flat hand's zero, in degrees of the servo.
static void find_open(doglove *d, const gv_calibration *cal) {
  static const int sensor[GV_FINGERS] = {GV_THUMB_ROTATE, GV_INDEX_MPJ, GV_MIDDLE_MPJ, GV_RING_MPJ,
                                         GV_LITTLE_MPJ};
  for (int f = 0; f < GV_FINGERS; f++) {
    const double raw = gv_calibration_raw(cal, sensor[f], 0.0);
    d->open_deg[f] = gv_clamp(gv_doglove_servo_deg(f, gv_calibration_angle(&d->standard, sensor[f], raw)),
                              0.0, 359.0);
  }
}

static int read_url(doglove *d, const char *text, const char **out_pedal, char *err, size_t err_size) {
  static const char *const types[] = {"doglove", NULL};
  serial_url *url = &d->source.url;
  gv_serial_url_parse(url, text, err, err_size);
  gv_serial_url_choice(url, "type", types, 0);
  d->source.port.baud = gv_serial_url_baud(url, BAUD);
  d->servos.url.device = gv_serial_url_text(url, "servos");
  *out_pedal = gv_serial_url_text(url, "dead_man");
  if (!d->servos.url.device)
    gv_serial_url_fail(url, "servos=DEVICE is missing, the line of the U2D2; they measure, too");
  return gv_serial_url_finish(
      url, "serial:/dev/ttyUSB0?type=doglove&servos=/dev/ttyUSB1&dead_man=/dev/input/event5");
}

static int open_servos(doglove *d) {
  char why[256];
  serial_port *port = &d->servos.port;
  port->path = d->servos.url.device;
  port->baud = SERVO_BAUD;
  port->set_up = set_up_servos;
  port->look = look;
  port->let_go = let_go;
  port->self = d;
  if (gv_serial_port_open(port, why, sizeof why) == 0)
    return 0;
  return gv_serial_url_fail(&d->source.url, "servos=%.60s %s", port->path, why);
}

static int open_all(doglove *d, const char *pedal) {
  if (open_pedal(d, pedal) || open_servos(d))
    return -1;
  if (gv_serial_source_open(&d->source, set_up_board, d) == 0)
    return 0;
  gv_serial_port_close(&d->servos.port);
  return -1;
}

int gv_doglove_open(const char *url, const gv_calibration *cal, gv_side side, gv_driver *out, char *err,
                    size_t err_size) {
  doglove *d = calloc(1, sizeof *d);
  const char *pedal;
  if (!d) {
    snprintf(err, err_size, "%.80s: out of memory; close other programs", url);
    return -1;
  }
  d->pedal = -1;
  d->standard = gv_calibration_default();
  d->left = side == GV_LEFT;
  d->source.words = &words;
  d->servos.words = &servo_words;
  atomic_flag_clear(&d->busy);
  find_open(d, cal);
  if (read_url(d, url, &pedal, err, err_size) || open_all(d, pedal)) {
    if (d->pedal >= 0)
      close(d->pedal);
    free(d);
    return -1;
  }
  *out = (gv_driver){.self = d,
                     .poll = poll_doglove,
                     .send = send_doglove,
                     .ended = gv_serial_source_ended,
                     .stats = stats_doglove,
                     .close = close_doglove,
                     .descriptor = gv_serial_source_descriptor,
                     .calls = GV_CALLS_LINE,
                     .tell = tell_doglove};
  return 0;
}
