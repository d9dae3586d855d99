// SPDX-License-Identifier: BSD-3-Clause
// gateway: the side of a device. It stands beside a device that speaks another language, turns its
// samples into our frames and our force commands into its own, and lets go by itself. Fill in
// device_read and device_write; the rest stays.
//
//   gateway --udp udp://HOST:PORT?listen=PORT|--can IFACE [--duration S]
//
// As it stands the device is none: a hand over a table that bends its index finger onto it
// every four seconds, so that forces can be seen. One thread, 1 kHz: commands in, forces out,
// samples out. See doc/gateway.md.
#include <errno.h>
#include <inttypes.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "gloved/drivers.h"
#include "gloved/fcu.h"
#include "tools/program.h"

static const char help_text[] =
    "gateway: the side of a device that speaks another language; a reference to fill in (doc/gateway.md).\n"
    "\n"
    "  --udp udp://HOST:PORT?listen=PORT   cannelloni v2 datagrams; or\n"
    "  --can IFACE          a CAN interface\n"
    "  --duration S         end after S seconds\n"
    "  --help, --version\n"
    "\n"
    "As it stands the device is none: a hand that bends its index finger onto a table every four seconds.\n";

enum {
  PERIOD_NS = 1000000,
  WATCHDOG_NS = 5000000,
  RESTART_NS = 100000000,
  BUNDLE = 4,
  COMMANDS = 32,
  STATUS_EVERY = 20,
  RECEIVER_HAND = 2
};

typedef struct device_sample {
  uint16_t raw[GV_SENSORS];  // counts 0..4095, in the order of gv_sensor; `calibration` says what they mean
  gv_pose T_world_wrist;     // metres
  bool dead_man;             // the switch is held
  bool sensor_fault, pose_valid;
  uint32_t age_us;  // between measuring and now
} device_sample;

// ---- the device: fill in these two --------------------------------------------------------------------

static double largest_n;

// The newest measurement at time_s since the start. False: there is none (no frame
// is sent, and gloved lets go).
static bool device_read(double time_s, device_sample *out) {
  const gv_calibration cal = gv_calibration_default();
  // a second with the switch open, one with a flat hand, two of bending
  const double t_s = fmod(time_s, 4.0);
  const double bent_rad = 60.0 * GV_PI / 180.0 * gv_clamp(t_s - 2.0, 0.0, 1.0);
  double angle_rad[GV_SENSORS] = {[GV_THUMB_ABDUCTION] = 40.0 * GV_PI / 180.0, [GV_INDEX_MPJ] = bent_rad};
  for (int i = 0; i < GV_SENSORS; i++)
    out->raw[i] = (uint16_t)gv_calibration_raw(&cal, i, angle_rad[i]);
  out->T_world_wrist = (gv_pose){{1, 0, 0, 0}, {-0.3, 0, 0.06}};
  out->dead_man = t_s > 1.0;
  out->pose_valid = true;
  out->sensor_fault = false;
  out->age_us = 0;
  return true;
}

// Tensions, thumb to little finger, never below 0; called a thousand times a second, also
// with zeros. It must not wait.
static void device_write(const double tension_n[GV_FINGERS]) {
  for (int i = 0; i < GV_FINGERS; i++)
    largest_n = fmax(largest_n, tension_n[i]);
}

// ---- frames -------------------------------------------------------------------------------------------

static gv_driver link_driver;
static gv_command_msg command;              // the newest good one
static int64_t command_ns = INT64_MIN / 2;  // when it came
static uint8_t glove_counter, pose_counter, status_counter;
static uint64_t taken, refused, let_go;
static bool pulling;

static int64_t clock_ns(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

// A command that is doubled or older does not keep a force alive; after a silence gloved may have begun anew.
static bool is_new(const gv_command_msg *msg, int64_t now_ns) {
  const uint8_t ahead = (uint8_t)(msg->counter - command.counter);
  return taken == 0 || (ahead >= 1 && ahead < 128) || (ahead != 0 && now_ns - command_ns > RESTART_NS);
}

// The newest command that is sound.
static void take_commands(int64_t now_ns) {
  gv_frame frame[COMMANDS];
  const int n = link_driver.poll(link_driver.self, now_ns, frame, COMMANDS);
  for (int i = 0; i < n; i++) {
    gv_command_msg msg;
    if (gv_fcu_unpack_command(&frame[i], &msg) != GV_FCU_OK) {
      refused++;
      continue;
    }
    if (!is_new(&msg, now_ns))
      continue;
    command = msg;
    command_ns = now_ns;
    taken++;
  }
}

// Zero without ENABLE, and zero when the newest command is older than the watchdog.
static void write_forces(int64_t now_ns) {
  static const double zero[GV_FINGERS];
  const bool alive = now_ns - command_ns <= WATCHDOG_NS;
  const bool enabled = command.flags & GV_COMMAND_ENABLE;
  if (pulling && !alive)
    let_go++;
  pulling = alive && enabled;
  device_write(pulling ? command.tension_n : zero);
}

static int make_frames(const device_sample *s, int64_t now_ns, int64_t step, gv_frame out[BUNDLE]) {
  const uint32_t stamp_us = (uint32_t)(now_ns / 1000);
  gv_glove_msg glove = {.counter = glove_counter++,
                        .stamp_us = stamp_us,
                        .age_us = s->age_us,
                        .flags = (uint8_t)((s->dead_man ? GV_GLOVE_DEAD_MAN : 0) |
                                           (s->sensor_fault ? GV_GLOVE_SENSOR_FAULT : 0))};
  const gv_pose_msg pose = {.counter = pose_counter++,
                            .stamp_us = stamp_us,
                            .age_us = s->age_us,
                            .receiver = RECEIVER_HAND,
                            .flags = s->pose_valid ? GV_POSE_VALID : 0,
                            .T_world_receiver = s->T_world_wrist};
  int n = 2;
  memcpy(glove.raw, s->raw, sizeof glove.raw);
  gv_fcu_pack_glove(&glove, &out[0]);
  gv_fcu_pack_pose(&pose, &out[1]);
  if (step % STATUS_EVERY == 0) {
    gv_status_msg status = {
      .counter = status_counter++, .stamp_us = stamp_us, .flags = s->dead_man ? GV_STATUS_DEAD_MAN : 0};
    memcpy(status.tension_n, pulling ? command.tension_n : (double[GV_FINGERS]){0}, sizeof status.tension_n);
    gv_fcu_pack_status(&status, &out[n++]);
  }
  return n;
}

static volatile sig_atomic_t interrupted;
static void on_signal(int number) {
  (void)number;
  interrupted = 1;
}

static void run(double duration_s) {
  const int64_t start_ns = clock_ns();
  int64_t due_ns = start_ns;
  for (int64_t step = 0; !interrupted && (double)(due_ns - start_ns) * 1e-9 < duration_s;
       step++, due_ns += PERIOD_NS) {
    const struct timespec due = {due_ns / 1000000000, due_ns % 1000000000};
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &due, NULL) == EINTR && !interrupted) {}
    const int64_t now_ns = clock_ns();
    device_sample sample;
    gv_frame frame[BUNDLE];
    take_commands(now_ns);
    write_forces(now_ns);
    if (device_read((double)(now_ns - start_ns) * 1e-9, &sample))
      link_driver.send(link_driver.self, frame, make_frames(&sample, now_ns, step, frame));
  }
  device_write((const double[GV_FINGERS]){0});
}

static int usage(void) {
  fprintf(stderr, "gateway: give one of --udp and --can, and values to options; see gateway --help\n");
  return 2;
}

int main(int argc, char **argv) {
  gv_keep_standard_files();
  if (program_answers(argc, argv, help_text))
    return 0;
  char url[300] = "";
  char err[512] = "";
  double duration_s = 1e9;
  for (int i = 1; i + 1 < argc; i += 2) {
    if (strcmp(argv[i], "--udp") == 0)
      snprintf(url, sizeof url, "%s", argv[i + 1]);
    else if (strcmp(argv[i], "--can") == 0)
      snprintf(url, sizeof url, "can:%s", argv[i + 1]);
    else if (strcmp(argv[i], "--duration") == 0)
      duration_s = atof(argv[i + 1]);
    else
      return usage();
  }
  if (!url[0] || argc % 2 == 0)
    return usage();
  const bool can = strncmp(url, "can:", 4) == 0;
  if ((can ? gv_can_open : gv_udp_open)(url, &link_driver, err, sizeof err)) {
    fprintf(stderr, "gateway: %s\n", err);
    return 2;
  }
  signal(SIGINT, on_signal);
  signal(SIGTERM, on_signal);
  run(duration_s);
  printf("gateway: %" PRIu64 " commands taken, %" PRIu64
         " refused, largest tension %.2f N, the watchdog let go %" PRIu64 " times, %s\n",
         taken, refused, largest_n, let_go, pulling ? "pulling" : "free");
  link_driver.close(link_driver.self);
  return 0;
}
