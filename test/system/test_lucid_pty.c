// SPDX-License-Identifier: BSD-3-Clause
// The driver of the LucidGlove as it runs: opened by its URL on a real pseudo-terminal, at whose other end
// the simulated glove answers. Bends come out as they were measured, brakes arrive as the limiter's tensions
// say, and whatever happens to the engine or to the line, they go to zero.
#include <time.h>

#include "drivers/serial_sim.h"
#include "support/check.h"
#include "gloved/channel.h"
#include "gloved/drivers.h"
#include "support/pty.h"

enum { MS = 1000000, BYTES = 1 << 17 };

static const char motion[] = "posture open  thumb_abduction 45\n"
                             "posture fist  like open  index_mpj 72  index_pij 80  index_dij 53.6  "
                             "middle_mpj 45  middle_pij 50  middle_dij 33.5\n"
                             "at 0  posture open  wrist 0 0 0.2  0 0 0  dead_man off\n"
                             "at 0.5 dead_man on\n"
                             "at 3  posture fist\n"
                             "end 600\n";

static struct rig {
  pty cable;
  serial_sim device;
  gv_driver driver;
  gv_calibration cal;
  gv_limiter limiter;
  gv_glove_msg glove;  // the newest
  uint8_t counter;
  int frames;
  int64_t now_ns;
} rig;

static char err[512];

static void sleep_ms(int ms) { nanosleep(&(struct timespec){0, ms * MS}, NULL); }

// ---- both ends ------------------------------------------------------------------------------------

static void exchange_bytes(void) {
  uint8_t byte[1024];
  ssize_t n;
  while (rig.cable.master >= 0 && (n = read(rig.cable.master, byte, sizeof byte)) > 0)
    gv_serial_sim_receive(&rig.device, byte, (int)n);
  const int count = gv_serial_sim_advance(&rig.device, rig.now_ns, byte, sizeof byte);
  if (rig.cable.master >= 0 && count > 0)
    CHECK(write(rig.cable.master, byte, (size_t)count) == count, "%s", strerror(errno));
}

static void one_ms(void) {
  gv_frame frame[64];
  rig.now_ns += MS;
  exchange_bytes();
  const int n = rig.driver.poll(rig.driver.self, rig.now_ns, frame, 64);
  for (int i = 0; i < n; i++)
    CHECK(gv_fcu_unpack_glove(&frame[i], &rig.glove) == GV_FCU_OK && frame[i].stamp_ns == rig.now_ns,
          "frame");
  rig.frames += n;
  sleep_ms(1);
}

static void command(const double tension_n[GV_FINGERS], uint8_t flags) {
  gv_command_msg msg = {.counter = rig.counter++, .flags = flags};
  gv_frame frame;
  memcpy(msg.tension_n, tension_n, sizeof msg.tension_n);
  gv_fcu_pack_command(&msg, &frame);
  rig.driver.send(rig.driver.self, &frame, 1);
}

// One period with what the limiter makes of `want_n` for every finger.
static void one_period(double want_n, bool enabled) {
  const double want[GV_FINGERS] = {want_n, want_n, want_n, want_n, want_n};
  double out[GV_FINGERS];
  one_ms();
  gv_limiter_step(&rig.limiter, want, enabled, 0, 0.001, out);
  command(out, enabled || out[0] > 0 ? GV_COMMAND_ENABLE : 0);
}

static int largest(const int brake[GV_FINGERS]) {
  int max = 0;
  for (int i = 0; i < GV_FINGERS; i++)
    max = brake[i] > max ? brake[i] : max;
  return max;
}

// Until every brake is at `brake`, or for ten seconds.
static bool run_until_brakes(int brake, double want_n, bool enabled) {
  for (int ms = 0; ms < 10000; ms++) {
    int same = 0;
    one_period(want_n, enabled);
    for (int i = 0; i < GV_FINGERS; i++)
      same += rig.device.brake[i] == brake;
    if (same == GV_FINGERS && rig.limiter.out_n[0] == want_n)
      return true;
  }
  return false;
}

static bool run_frames(int more) {
  const int until = rig.frames + more;
  for (int ms = 0; ms < 10000 && rig.frames < until; ms++)
    one_period(0, false);
  return rig.frames >= until;
}

static void start(const char *options, gv_side side) {
  static gv_sim_script script;
  char url[256];
  const gv_pose T = gv_pose_identity();
  const gv_limiter_config limits = gv_limiter_config_default();
  memset(&rig, 0, sizeof rig);
  CHECK(gv_sim_script_parse(motion, "motion", &script, err, sizeof err) == 0, "%s", err);
  gv_serial_sim_adapt(&script.device);
  gv_serial_sim_init(&rig.device, SERIAL_SIM_LUCIDGLOVE, &script, &T, 5);
  gv_limiter_init(&rig.limiter, &limits);
  rig.cal = gv_calibration_default();
  pty_plug(&rig.cable);
  snprintf(url, sizeof url, "serial:%s?type=lucidglove%s", rig.cable.link, options);
  const int failed = gv_lucidglove_open(url, &rig.cal, side, &rig.driver, err, sizeof err);
  CHECK(!failed, "%s", err);
  if (failed)
    exit(1);
  CHECK(run_frames(1), "no frame");
}

static void stop(void) {
  rig.driver.close(rig.driver.self);
  pty_unplug(&rig.cable);
}

// ---- tests ----------------------------------------------------------------------------------------

static void test_bends_come_out_as_measured(void) {
  start("", GV_RIGHT);
  CHECK(!(rig.glove.flags & GV_GLOVE_DEAD_MAN), "the switch is open at the start");
  for (int ms = 0; ms < 10000 && rig.device.sim.now_ns < 3500 * (int64_t)MS; ms++)
    one_period(0, false);
  CHECK(rig.glove.flags == GV_GLOVE_DEAD_MAN, "flags %x", rig.glove.flags);
  const double deg = GV_PI / 180;
  CHECK_NEAR(gv_calibration_angle(&rig.cal, GV_INDEX_MPJ, rig.glove.raw[GV_INDEX_MPJ]), 72 * deg, 0.002);
  CHECK_NEAR(gv_calibration_angle(&rig.cal, GV_INDEX_DIJ, rig.glove.raw[GV_INDEX_DIJ]), 53.6 * deg, 0.002);
  CHECK_NEAR(gv_calibration_angle(&rig.cal, GV_MIDDLE_PIJ, rig.glove.raw[GV_MIDDLE_PIJ]), 50 * deg, 0.002);
  CHECK_NEAR(gv_calibration_angle(&rig.cal, GV_RING_MPJ, rig.glove.raw[GV_RING_MPJ]), 0, 0.002);
  const gv_driver_stats stats = rig.driver.stats(rig.driver.self);
  CHECK((int)stats.rx == rig.frames && rig.frames > 100 && stats.bad <= 2, "%d of %d, %d bad", (int)stats.rx,
        rig.frames, (int)stats.bad);
  CHECK(rig.device.refused == 0, "the glove refused %d lines", (int)rig.device.refused);
  stop();
}

static void test_switches_and_sides(void) {
  start("&dead_man=b", GV_LEFT);
  for (int ms = 0; ms < 10000 && rig.device.sim.now_ns < 700 * (int64_t)MS; ms++)
    one_period(0, false);
  CHECK(rig.device.glove.flags & GV_GLOVE_DEAD_MAN, "button A is not held");
  CHECK(rig.glove.flags == GV_GLOVE_LEFT, "button A counts as B: flags %x", rig.glove.flags);
  stop();
}

// The brakes are those of a tension that the limiter let out, never more, and end at what it ends at.
static void test_brakes_follow_the_limiter(void) {
  const gv_channel *channel = gv_channel_of(GV_CHANNEL_LUCIDGLOVE);
  bool sent[GV_LUCID_BRAKE_MAX + 1] = {true};
  int different = 0;
  int last = 0;
  start("", GV_RIGHT);
  for (int ms = 0; ms < 400; ms++) {
    one_period(6.0 * (ms % 200) / 200, true);
    sent[gv_channel_counts(channel,
                           floor(rig.limiter.out_n[0] / GV_TENSION_LSB_N + 1e-6) * GV_TENSION_LSB_N)] = true;
    CHECK(sent[rig.device.brake[0]] && rig.device.brake[0] == rig.device.brake[4],
          "brake %d was never asked for", rig.device.brake[0]);
    different += rig.device.brake[0] != last;
    last = rig.device.brake[0];
  }
  CHECK(different > 20, "only %d different brakes", different);
  CHECK(run_until_brakes(1000, 12.0, true), "12 N is %d", rig.device.brake[0]);
  for (int ms = 0; ms < 10000 && rig.device.sim.report.deviation_max_rad < 0.5; ms++)
    one_period(12, true);
  CHECK(rig.device.sim.report.deviation_max_rad >= 0.5, "the fingers are not held back");
  CHECK(run_until_brakes(250, 3.0, true), "3 N is %d", rig.device.brake[0]);
  CHECK(run_until_brakes(0, 0.0, true), "0 N is %d", rig.device.brake[0]);
  CHECK(rig.device.refused == 0, "the glove refused %d lines", (int)rig.device.refused);
  stop();
}

// The glove reads one line for each of its own: more would pile up in its input and be obeyed late.
static void test_lines_keep_the_gloves_pace(void) {
  start("", GV_RIGHT);
  const uint64_t lines = rig.device.brake_lines;
  const uint64_t unasked = rig.device.brakes_unasked;
  const int frames = rig.frames;
  for (int ms = 0; ms < 500; ms++)
    one_period(5, true);
  const int more = (int)(rig.device.brake_lines - lines);
  const int of = rig.frames - frames;
  CHECK(of > 20 && more < 250 && abs(more - of) <= 3 + (int)(rig.device.brakes_unasked - unasked),
        "%d lines for %d of the glove's", more, of);
  CHECK(rig.driver.stats(rig.driver.self).tx >= 500, "commands are not counted");
  stop();
}

// A glove whose firmware turns its servos the other way round: with flip=yes it is free when no force
// is wanted, from the first line to the last; with the wrong setting "brakes off" are full brakes,
// which is why the calibration asks.
static void test_a_flipped_firmware(void) {
  start("&flip=yes", GV_RIGHT);
  rig.device.flip = true;
  CHECK(run_until_brakes(0, 0, true), "not free: %d", largest(rig.device.brake));
  CHECK(run_until_brakes(500, 6, true), "no brakes: %d", rig.device.brake[0]);
  CHECK(run_until_brakes(0, 0, false), "not let go: %d", largest(rig.device.brake));
  CHECK(run_until_brakes(500, 6, true), "no brakes: %d", rig.device.brake[0]);
  rig.driver.close(rig.driver.self);
  uint8_t byte[1024];
  const ssize_t n = read(rig.cable.master, byte, sizeof byte);
  gv_serial_sim_receive(&rig.device, byte, n > 0 ? (int)n : 0);
  CHECK(largest(rig.device.brake) == 0, "closing leaves brakes of %d", largest(rig.device.brake));
  pty_unplug(&rig.cable);
  start("", GV_RIGHT);
  rig.device.flip = true;
  CHECK(run_until_brakes(1000, 0, false), "the wrong setting: %d", rig.device.brake[0]);
  stop();
}

static void test_no_enable_and_broken_commands_let_go(void) {
  static const double some[GV_FINGERS] = {4, 4, 4, 4, 4};
  start("", GV_RIGHT);
  for (int broken = 0; broken < 2; broken++) {
    rig.limiter.out_n[0] = 0;
    CHECK(run_until_brakes(333, 4.0, true), "4 N is %d", rig.device.brake[0]);
    gv_command_msg msg = {.flags = broken ? GV_COMMAND_ENABLE : 0};
    gv_frame frame;
    memcpy(msg.tension_n, some, sizeof some);
    gv_fcu_pack_command(&msg, &frame);
    frame.data[9] ^= (uint8_t)(broken ? 0x10 : 0);
    int zero_ms = 0;  // in a row: the driver's own thread may let go for a moment where this one is held up
    for (int ms = 0; ms < 10000 && zero_ms < 100; ms++) {
      one_ms();
      rig.driver.send(rig.driver.self, &frame, 1);
      zero_ms = largest(rig.device.brake) > 0 ? 0 : zero_ms + 1;
    }
    CHECK(zero_ms == 100, "they come back");
    CHECK(largest(rig.device.brake) == 0, "%s: brakes at %d", broken ? "broken" : "no ENABLE",
          largest(rig.device.brake));
  }
  stop();
}

// The engine hangs: nobody polls, nobody sends. The driver's own thread lets go.
static void test_silence_lets_go(void) {
  start("", GV_RIGHT);
  CHECK(run_until_brakes(1000, 12.0, true), "12 N is %d", rig.device.brake[0]);
  for (int ms = 0; ms < 10000 && largest(rig.device.brake) > 0; ms++) {
    rig.now_ns += MS;
    exchange_bytes();
    sleep_ms(1);
  }
  CHECK(largest(rig.device.brake) == 0, "brakes at %d", largest(rig.device.brake));
  CHECK(gv_serial_report_of(&rig.driver).connections == 1 && gv_serial_report_of(&rig.driver).connected,
        "only when the line was given up");
  CHECK(run_until_brakes(500, 6.0, true), "and takes hold again: %d", rig.device.brake[0]);
  stop();
}

static void test_closing_lets_go(void) {
  start("", GV_RIGHT);
  CHECK(run_until_brakes(1000, 12.0, true), "12 N is %d", rig.device.brake[0]);
  rig.driver.close(rig.driver.self);
  exchange_bytes();
  CHECK(largest(rig.device.brake) == 0 && rig.device.refused == 0, "brakes at %d", largest(rig.device.brake));
  pty_unplug(&rig.cable);
}

// A glove that was switched off and on, or whose cable was out and in: its brakes are told to be zero first.
static void test_cable_out_and_in(void) {
  start("", GV_RIGHT);
  CHECK(run_until_brakes(1000, 12.0, true), "12 N is %d", rig.device.brake[0]);
  pty_unplug(&rig.cable);
  for (int ms = 0; ms < 100; ms++)
    one_period(12, true);
  CHECK(largest(rig.device.brake) == 1000,
        "the stock firmware keeps its brakes: this is what the driver cannot change");
  pty_plug(&rig.cable);
  const uint64_t lines = rig.device.brake_lines;
  for (int ms = 0; ms < 10000 && rig.device.brake_lines == lines; ms++)
    one_period(0, false);
  CHECK(rig.device.brake_lines > lines && largest(rig.device.brake) == 0, "brakes at %d",
        largest(rig.device.brake));
  CHECK(run_until_brakes(250, 3.0, true), "no brakes after it was plugged in: %d", rig.device.brake[0]);
  CHECK(rig.driver.stats(rig.driver.self).link_downs == 1, "link");
  stop();
}

// Late enough that it may send its line, whatever the glove answers.
static void command_after_20_ms(const double tension_n[GV_FINGERS]) {
  gv_frame frame[64];
  rig.now_ns += 20 * (int64_t)MS;
  rig.driver.poll(rig.driver.self, rig.now_ns, frame, 64);
  command(tension_n, GV_COMMAND_ENABLE);
}

// Nobody reads at the other end: send never waits, and whole lines alone come out of
// it, the newest command last.
static void test_full_line(void) {
  static char bytes[BYTES];
  int count = 0;
  int sends = 0;
  start("", GV_RIGHT);
  for (; sends < 20000 && rig.driver.stats(rig.driver.self).tx_failed < 100; sends++) {
    const double t = 0.012 * (sends % 1000);
    const double tension_n[GV_FINGERS] = {t, t, t, t, t};
    command_after_20_ms(tension_n);
  }
  CHECK(sends < 20000 && sends > 100, "the line never filled");
  for (int k = 0; k < 200; k++) {
    const ssize_t n = read(rig.cable.master, bytes + count, (size_t)(BYTES - 1 - count));
    if (n > 0)
      count += (int)n;
    command_after_20_ms((const double[GV_FINGERS]){1.2, 2.4, 3.6, 4.8, 6.0});
    sleep_ms(1);
  }
  bytes[count] = '\0';
  int brake[GV_FINGERS];
  int wrong = 0;
  int lines = 0;
  bool newest = false;
  for (char *line = bytes, *end; (end = strchr(line, '\n')) != NULL; line = end + 1, lines++) {
    wrong += !gv_lucid_decode_brakes(line, (int)(end - line), brake);
    newest |= memcmp(brake, (const int[]){100, 200, 300, 400, 500}, sizeof brake) == 0;
  }
  CHECK(lines > 100 && wrong == 0 && newest, "%d lines, %d of them broken, the newest %s", lines, wrong,
        newest ? "there" : "lost");
  stop();
}

// Garbage and gaps on the line: angles stay what was measured, lost lines do not stop the exchange.
static void test_disturbed_line(void) {
  start("", GV_RIGHT);
  rig.device.faults = (serial_sim_faults){.garbage = 0.2, .gap = 0.1};
  const int frames = rig.frames;
  const uint64_t whole = rig.device.whole;
  for (int ms = 0; ms < 1000; ms++)
    one_period(2, true);
  rig.device.faults = (serial_sim_faults){0};
  for (int ms = 0; ms < 20; ms++)
    one_period(2, true);
  const int more = (int)(rig.device.whole - whole);
  const int came = rig.frames - frames;
  CHECK(rig.device.damaged > 3 && came >= more && came <= more + (int)rig.device.damaged,
        "%d whole, %d damaged, %d came", more, (int)rig.device.damaged, came);
  CHECK(more > 20, "only %d lines: the exchange stopped", more);
  CHECK(gv_serial_report_of(&rig.driver).connections == 1, "%u connections",
        gv_serial_report_of(&rig.driver).connections);
  stop();
}

static void test_wrong_urls(void) {
  static const struct {
    const char *url, *what;
  } wrong[] = {
    {"serial:/dev/null?type=lucidglove", "give a serial device"},
    {"serial:/dev/null?type=lucidglove&max=2047", "max=2047 is not known; write one of 4095, 1023"},
    {"serial:/dev/null?type=lucidglove&dead_man=grab",
     "dead_man=grab is not known; write one of a, b, joystick"},
    {"serial:/dev/null?type=lucidglove&sensors=22", "no parameter of this device"}};
  gv_driver driver;
  rig.cal = gv_calibration_default();
  for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
    CHECK(gv_lucidglove_open(wrong[i].url, &rig.cal, GV_RIGHT, &driver, err, sizeof err) < 0, "opened: %s",
          wrong[i].url);
    CHECK(strstr(err, wrong[i].what) && strchr(err, ';') && !strchr(err, '\n'), "%s: %s", wrong[i].url, err);
  }
}

int main(void) {
  RUN(test_bends_come_out_as_measured);
  RUN(test_switches_and_sides);
  RUN(test_brakes_follow_the_limiter);
  RUN(test_lines_keep_the_gloves_pace);
  RUN(test_a_flipped_firmware);
  RUN(test_no_enable_and_broken_commands_let_go);
  RUN(test_silence_lets_go);
  RUN(test_closing_lets_go);
  RUN(test_cable_out_and_in);
  RUN(test_full_line);
  RUN(test_disturbed_line);
  RUN(test_wrong_urls);
  return check_done();
}
