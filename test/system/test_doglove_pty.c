// SPDX-License-Identifier: BSD-3-Clause
// The driver of the DOGlove as it runs: opened by its URL on two real pseudo-terminals, at whose other ends
// the simulated board and the simulated servos answer. Angles come out as they were measured, currents
// arrive as the limiter's tensions say, the switch is somebody's foot, and whatever happens to the engine
// or to a line, the currents go to zero.
#include <linux/input.h>
#include <time.h>

#include "drivers/serial_sim.h"
#include "gloved/channel.h"
#include "gloved/drivers.h"
#include "support/check.h"
#include "support/pty.h"

enum { MS = 1000000 };

static const char motion[] =
    "posture open  thumb_abduction 45\n"
    "posture fist  like open  index_mpj 60  index_pij 70  index_dij 40  middle_mpj 45\n"
    "at 0  posture open  wrist 0 0 0.2  0 0 0  dead_man on\n"
    "at 0.5  posture fist\n"
    "end 600\n";

static struct rig {
  pty board_cable, servo_cable;
  serial_sim board, servos;
  int pedal[2];  // a pipe: what an input device would say
  gv_driver driver;
  gv_glove_msg glove;  // the newest
  uint8_t counter;
  int frames;
  int64_t now_ns;
  bool servos_run;
} rig;

static char err[512];

static void exchange(pty *cable, serial_sim *device) {
  uint8_t byte[4096];
  ssize_t n;
  while (cable->master >= 0 && (n = read(cable->master, byte, sizeof byte)) > 0)
    gv_serial_sim_receive(device, byte, (int)n);
  const int count = gv_serial_sim_advance(device, rig.now_ns, byte, sizeof byte);
  if (cable->master >= 0 && count > 0)
    CHECK(write(cable->master, byte, (size_t)count) == count, "%s", strerror(errno));
}

// Both devices for a millisecond, and the driver where it runs.
static void one_ms(bool polls) {
  gv_frame frame[64];
  rig.now_ns += MS;
  exchange(&rig.board_cable, &rig.board);
  if (rig.servos_run)
    exchange(&rig.servo_cable, &rig.servos);
  const int n = polls ? rig.driver.poll(rig.driver.self, rig.now_ns, frame, 64) : 0;
  for (int i = 0; i < n; i++)
    CHECK(gv_fcu_unpack_glove(&frame[i], &rig.glove) == GV_FCU_OK, "frame");
  rig.frames += n;
  nanosleep(&(struct timespec){0, MS}, NULL);
}

static void for_ms(int ms) {
  while (ms-- > 0)
    one_ms(true);
}

static void send(double index_n, uint8_t flags) {
  const gv_command_msg msg = {.counter = rig.counter++, .flags = flags, .tension_n = {0, index_n, 0, 0, 0}};
  gv_frame frame;
  gv_fcu_pack_command(&msg, &frame);
  rig.driver.send(rig.driver.self, &frame, 1);
}

static int index_ma(void) { return gv_doglove_sim_current(&rig.servos.servos, 1); }
static bool torque_on(void) { return rig.servos.servos.table[1][GV_DYNAMIXEL_TORQUE]; }

static void press(int value) {
  const struct input_event event = {.type = EV_KEY, .code = KEY_SPACE, .value = value};
  CHECK(write(rig.pedal[1], &event, sizeof event) == sizeof event, "no pipe");
}

// Until frames come: the servos have been set up.
static void start(void) {
  static gv_sim_script script;
  const gv_pose T = gv_pose_identity();
  const gv_calibration cal = gv_calibration_default();
  char url[300];
  memset(&rig, 0, sizeof rig);
  rig.now_ns = 1000000000;
  rig.servos_run = true;
  CHECK(gv_sim_script_parse(motion, "motion", &script, err, sizeof err) == 0, "%s", err);
  gv_serial_sim_adapt(&script.device);
  gv_serial_sim_init(&rig.board, SERIAL_SIM_DOGLOVE, &script, &T, 1);
  gv_serial_sim_init(&rig.servos, SERIAL_SIM_DOGLOVE_SERVOS, &script, &T, 1);
  CHECK(pipe2(rig.pedal, O_NONBLOCK) == 0, "no pipe");
  pty_plug(&rig.board_cable);
  pty_plug(&rig.servo_cable);
  snprintf(url, sizeof url, "serial:%s?type=doglove&servos=%s&dead_man=/dev/fd/%d", rig.board_cable.link,
           rig.servo_cable.link, rig.pedal[0]);
  CHECK(gv_doglove_open(url, &cal, GV_RIGHT, &rig.driver, err, sizeof err) == 0, "%s", err);
  for (int ms = 0; ms < 8000 && rig.frames < 10; ms++)
    one_ms(true);
  CHECK(rig.frames >= 10, "no frames");
}

static void stop(void) {
  rig.driver.close(rig.driver.self);
  pty_unplug(&rig.board_cable);
  pty_unplug(&rig.servo_cable);
  close(rig.pedal[0]);
  close(rig.pedal[1]);
}

static double angle_deg(int sensor) {
  const gv_calibration cal = gv_calibration_default();
  return gv_calibration_angle(&cal, sensor, rig.glove.raw[sensor]) * 180 / GV_PI;
}

static void pull(void) {
  for (int ms = 0; ms < 300 && index_ma() == 0; ms++) {
    send(1.65, GV_COMMAND_ENABLE);
    one_ms(true);
  }
  CHECK(index_ma() == 350, "%d mA for 1.65 N", index_ma());
}

static void test_angles_of_both_lines(void) {
  start();
  for_ms(1500);
  CHECK_NEAR(angle_deg(GV_INDEX_PIJ), 70, 0.1);  // encoder
  CHECK_NEAR(angle_deg(GV_INDEX_DIJ), 40, 0.1);
  CHECK_NEAR(angle_deg(GV_INDEX_MPJ), 60, 0.15);  // servo: 4096 a turn
  CHECK_NEAR(angle_deg(GV_MIDDLE_MPJ), 45, 0.15);
  CHECK(rig.glove.age_us < 30000, "age %u us", rig.glove.age_us);
  CHECK(torque_on() && rig.servos.servos.table[0][GV_DYNAMIXEL_MODE] == 5 && rig.servos.servos.refused == 0,
        "not set up");
  const int frames = rig.frames;
  rig.servos_run = false;
  for_ms(200);
  CHECK(rig.frames - frames < 12, "%d frames while the servos are silent", rig.frames - frames);
  stop();
}

static void test_the_switch_is_a_pedal(void) {
  start();
  for_ms(50);
  CHECK(!(rig.glove.flags & GV_GLOVE_DEAD_MAN), "held by nobody");
  press(1);
  for_ms(50);
  CHECK(rig.glove.flags & GV_GLOVE_DEAD_MAN, "not held");
  press(2);
  for_ms(50);
  CHECK(rig.glove.flags & GV_GLOVE_DEAD_MAN, "a key that repeats lets go");
  press(0);
  for_ms(50);
  CHECK(!(rig.glove.flags & GV_GLOVE_DEAD_MAN), "still held");
  press(1);
  for_ms(50);
  const struct input_event lost = {.type = EV_SYN, .code = SYN_DROPPED};
  CHECK(write(rig.pedal[1], &lost, sizeof lost) == sizeof lost, "no pipe");
  for_ms(50);
  CHECK(!(rig.glove.flags & GV_GLOVE_DEAD_MAN), "held although the kernel has lost events");
  press(1);
  for_ms(50);
  close(rig.pedal[1]);  // unplugged
  rig.pedal[1] = -1;
  for_ms(50);
  CHECK(!(rig.glove.flags & GV_GLOVE_DEAD_MAN), "held by a pedal that is gone");
  stop();
}

static void test_currents_and_letting_go(void) {
  start();
  for_ms(1200);
  pull();
  for (int f = 0; f < GV_FINGERS; f++)
    CHECK(f == 1 || gv_doglove_sim_current(&rig.servos.servos, f) == 0, "finger %d pulls", f);
  send(1.65, 0);  // without ENABLE: at once
  one_ms(true);
  one_ms(true);
  CHECK(index_ma() == 0, "%d mA without ENABLE", index_ma());
  pull();
  gv_frame broken;
  const gv_command_msg msg = {
    .counter = rig.counter++, .flags = GV_COMMAND_ENABLE, .tension_n = {0, 1, 0, 0, 0}};
  gv_fcu_pack_command(&msg, &broken);
  broken.data[9] ^= 1;
  rig.driver.send(rig.driver.self, &broken, 1);
  one_ms(true);
  one_ms(true);
  CHECK(index_ma() == 0, "%d mA for a command that does not decode", index_ma());
  pull();
  for_ms(9);  // no command
  CHECK(index_ma() == 0, "%d mA without commands", index_ma());
  CHECK(rig.servos.servos.trips == 0, "the servos' watchdog was needed");
  stop();
}

static void test_the_keeper_lets_go_for_a_thread_that_hangs(void) {
  start();
  for_ms(1200);
  pull();
  int ms = 0;
  while (index_ma() > 0 && ms < 200) {
    one_ms(false);  // neither polled nor sent
    ms++;
  }
  CHECK(ms < 100, "%d mA for %d ms", index_ma(), ms);
  stop();
}

// The process is gone, as after SIGKILL: nothing reaches the servos any more.
static void test_the_servos_watchdog(void) {
  start();
  for_ms(1200);
  pull();
  pty gone = rig.servo_cable;
  rig.servo_cable.master = -1;
  int ms = 0;
  for (; index_ma() > 0 && ms < 200; ms++)
    one_ms(true);
  CHECK(ms >= 15 && ms <= 25 && rig.servos.servos.trips >= 1, "%d ms", ms);
  rig.servo_cable = gone;  // the cable is in again: the driver clears the watchdog, and pulls again
  for_ms(1500);
  pull();
  stop();
}

static void test_closing_switches_the_torque_off(void) {
  start();
  for_ms(1200);
  pull();
  rig.driver.close(rig.driver.self);
  for (int i = 0; i < 10; i++) {
    rig.now_ns += MS;
    exchange(&rig.servo_cable, &rig.servos);
  }
  CHECK(index_ma() == 0 && !torque_on(), "%d mA, torque %d", index_ma(), torque_on());
  pty_unplug(&rig.board_cable);
  pty_unplug(&rig.servo_cable);
  close(rig.pedal[0]);
  close(rig.pedal[1]);
}

// An open finger is not pulled: the servo would close it up to its goal.
static void test_no_finger_is_closed(void) {
  start();
  for_ms(20);  // the hand is still open
  for (int f = 0; f < GV_FINGERS; f++)
    rig.servos.sim.script.keyframe[0].angle_rad[gv_flexion[f][0]] = -0.2;
  rig.servos.sim.script.keyframe_count = 1;
  for (int ms = 0; ms < 200; ms++) {
    send(3, GV_COMMAND_ENABLE);
    one_ms(true);
    const int goal_ma = (int)gv_dynamixel_value(rig.servos.servos.table[1] + GV_DYNAMIXEL_GOAL_CURRENT, 2);
    CHECK(ms < 100 || goal_ma == 0, "%d mA towards a goal that closes the finger", goal_ma);
  }
  stop();
}

static void test_urls(void) {
  static const char *const wrong[][2] = {
    {"serial:/dev/null?type=doglove", "servos=DEVICE is missing"},
    {"serial:/dev/null?type=doglove&servos=/nonexistent", "plug it in"},
    {"serial:/dev/null?type=doglove&servos=/dev/null&dead_man=/nonexistent", "input device"},
    {"serial:/dev/null?type=doglove&servos=/dev/null&flip=yes", "no parameter"}};
  const gv_calibration cal = gv_calibration_default();
  for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
    gv_driver none;
    CHECK(gv_doglove_open(wrong[i][0], &cal, GV_RIGHT, &none, err, sizeof err) < 0, "%s", wrong[i][0]);
    CHECK(strstr(err, wrong[i][1]), "%s: %s", wrong[i][0], err);
  }
}

int main(void) {
  RUN(test_angles_of_both_lines);
  RUN(test_the_switch_is_a_pedal);
  RUN(test_currents_and_letting_go);
  RUN(test_the_keeper_lets_go_for_a_thread_that_hangs);
  RUN(test_the_servos_watchdog);
  RUN(test_closing_switches_the_torque_off);
  RUN(test_no_finger_is_closed);
  RUN(test_urls);
  return check_done();
}
