// SPDX-License-Identifier: BSD-3-Clause
// The simulated device against what is known without it: the static deviation T r / k of a finger, the
// watchdog's time, the inverse of the calibration, the figures of real recordings (DESIGN.md, "Devices"),
// and what must never become a force.
#include <dirent.h>
#include <string.h>

#include "support/check.h"
#include "gloved/drivers.h"
#include "gloved/force.h"
#include "gloved/sim.h"

enum { MS = 1000000 };
static gv_sim sim;  // large; one at a time
static gv_sim_script script;
static char err[512];

static const char grip[] =
    "posture open  thumb_rotate 10  index_mpj 10  index_pij 20\n"
    "posture fist  like open  index_mpj 70  index_pij 80  index_dij 40  thumb_mpj 30  middle_mpj 55\n"
    "at 0  posture open  wrist -0.2 0.1 0.15  90 0 30  dead_man on\n"
    "at 1  posture fist  wrist 0.1 0 0.2  0 0 0\n"
    "end 600\n";

static void start(const char *text, const char *device) {
  int result = gv_sim_script_parse(text, "test", &script, err, sizeof err);
  CHECK(result == 0, "%s", err);
  if (strcmp(device, "real") == 0)
    script.device = gv_sim_device_real();
  gv_sim_init(&sim, &script, NULL, 7);
  gv_sim_start(&sim);
}

// Advance to `now_ms`, throwing the frames away.
static void skip_to(int64_t now_ms) {
  gv_frame frame[64];
  while (gv_sim_advance(&sim, now_ms * MS, frame, 64) > 0) {}
}

static uint8_t counter;
static gv_frame command(double index_n, uint8_t flags) {
  gv_command_msg msg = {.counter = counter++, .flags = flags, .tension_n = {0, index_n, 0, 0, 0}};
  gv_frame frame;
  gv_fcu_pack_command(&msg, &frame);
  return frame;
}

// From `from_ms` on, a command each millisecond, rising to `index_n` at 200 N/s.
static int64_t pull(int64_t from_ms, int64_t for_ms, double index_n) {
  double now_n = gv_sim_tension(&sim)[1];
  for (int64_t t = from_ms; t < from_ms + for_ms; t++) {
    skip_to(t);
    now_n = fmin(index_n, now_n + 0.2);
    gv_frame frame = command(now_n, GV_COMMAND_ENABLE);
    gv_sim_receive(&sim, &frame);
  }
  return from_ms + for_ms;
}

static void test_finger_is_held_back(void) {
  start(grip, "best");
  int64_t t = pull(2000, 3000, 3.0);
  skip_to(t);
  double angle[GV_SENSORS], arm[3];
  int sensor[3];
  gv_sim_angles(&sim, angle);
  gv_tendon_joints(1, sensor, arm);
  const double k[3] = {script.device.stiffness_0, script.device.stiffness_1, script.device.stiffness_2};
  const gv_sim_keyframe intent = gv_sim_script_at(&script, 1e-3 * (double)t);
  for (int j = 0; j < 3; j++)
    CHECK_NEAR(angle[sensor[j]], intent.angle_rad[sensor[j]] - 3.0 * arm[j] / k[j], 1e-9);
  CHECK(gv_sim_report_of(&sim)->deviation_max_rad < 1.02 * 3.0 * arm[0] / k[0] + 0.2, "it overshot");
  CHECK_NEAR(angle[GV_MIDDLE_MPJ], 55 * GV_PI / 180, 1e-12);  // no tension, no deviation
  CHECK(gv_sim_report_of(&sim)->commands == 3000, "%d", (int)gv_sim_report_of(&sim)->commands);
}

// How far the tendon of the index finger is let out: the sum of its arms times what each joint was held back.
static double way_of_index_m(void) {
  int sensor[3];
  double arm_m[3], angle[GV_SENSORS];
  double way_m = 0.0;
  gv_sim_angles(&sim, angle);
  gv_tendon_joints(1, sensor, arm_m);
  for (int j = 0; j < 3; j++)
    way_m += arm_m[j] * (angle[sensor[j]] - sim.intent.angle_rad[sensor[j]]);
  return way_m;
}

// Along its tendon it is M x'' + B x' + K x = -T, as measured on people (sim_device.c): the answer to a step
// of tension, all the way.
static void check_finger(const char *name, double k_n_m, double b_n_s_m, double m_kg) {
  const double h = 1e-4;
  double way_m = 0.0;
  double speed_m_s = 0.0;
  start(grip, "best");
  CHECK(gv_sim_device_set(&script.device, "finger", name, err, sizeof err) == 0, "%s", err);
  CHECK(gv_sim_device_set(&script.device, "cycle_hz", "10000", err, sizeof err) == 0, "%s", err);
  gv_sim_init(&sim, &script, NULL, 7);
  gv_sim_start(&sim);
  const int64_t from_ns = (pull(2000, 1, 0.2) - 1) * MS;
  for (int step = 1; step <= 1000; step++) {
    gv_frame frame[64];
    const gv_frame again = command(0.2, GV_COMMAND_ENABLE);
    while (gv_sim_advance(&sim, from_ns + step * MS / 10, frame, 64) > 0) {}
    gv_sim_receive(&sim, &again);
    const double tension_n = gv_sim_tension(&sim)[1];
    speed_m_s = (m_kg * speed_m_s - h * (tension_n + k_n_m * way_m)) / (m_kg + h * b_n_s_m + h * h * k_n_m);
    way_m += h * speed_m_s;
    CHECK_NEAR(way_of_index_m(), way_m, 0.005 * 0.2 / k_n_m);
  }
  CHECK_NEAR(way_of_index_m(), -0.2 / k_n_m, 0.02 * 0.2 / k_n_m);
}

static void test_fingers_are_as_measured(void) {
  check_finger("relaxed", 250, 4.0, 0.005);
  check_finger("normal", 600, 5.5, 0.0055);
  check_finger("firm", 1250, 7.4, 0.006);
  CHECK(gv_sim_device_set(&script.device, "finger", "limp", err, sizeof err) < 0, "taken");
  CHECK(strstr(err, "relaxed, normal or firm") != NULL, "%s", err);
}

// 5 ms each way: the same frames 5 ms later, and the tension follows the command 5 ms later.
static void test_wire_holds_up_both_ways(void) {
  enum { FRAMES = 2048 };
  static gv_frame at_once[FRAMES], later[FRAMES];
  start(grip, "best");
  const int sent = gv_sim_advance(&sim, 500 * MS, at_once, FRAMES);
  CHECK(gv_sim_device_set(&script.device, "delay_s", "0.005", err, sizeof err) == 0, "%s", err);
  gv_sim_init(&sim, &script, NULL, 7);
  gv_sim_start(&sim);
  const int came = gv_sim_advance(&sim, 505 * MS, later, FRAMES);
  CHECK(sent > 900 && came == sent, "%d and %d frames", sent, came);
  for (int i = 0; i < sent && i < came; i++) {
    CHECK(later[i].stamp_ns == at_once[i].stamp_ns + 5 * MS, "frame %d", i);
    CHECK(memcmp(later[i].data, at_once[i].data, at_once[i].len) == 0, "frame %d", i);
  }
  for (int64_t t = 2000; t < 2012; t++) {
    skip_to(t);
    CHECK((gv_sim_tension(&sim)[1] > 0.0) == (t > 2005), "%g N at %d ms", gv_sim_tension(&sim)[1], (int)t);
    gv_frame frame = command(0.1, GV_COMMAND_ENABLE);
    gv_sim_receive(&sim, &frame);
  }
}

static void test_watchdog_lets_go_within_5_ms(void) {
  start(grip, "best");
  int64_t t = pull(2000, 200, 5.0);
  int64_t last = t - 1;
  int64_t zero = -1;
  bool flagged = false;
  for (; t < last + 20; t++) {
    gv_frame frame[64];
    int n = gv_sim_advance(&sim, t * MS, frame, 64);
    gv_status_msg status;
    for (int i = 0; i < n; i++)
      if (gv_fcu_unpack_status(&frame[i], &status) == GV_FCU_OK && frame[i].stamp_ns <= (last + 5) * MS)
        flagged |= (status.flags & GV_STATUS_WATCHDOG) && status.mode == GV_FCU_MODE_IDLE &&
                   status.tension_n[1] == 0.0;
    if (zero < 0 && gv_sim_tension(&sim)[1] == 0.0)
      zero = t;
    if (t < last + 3)
      CHECK(gv_sim_tension(&sim)[1] > 4.9, "let go too early, after %d ms", (int)(t - last));
  }
  CHECK(zero > 0 && zero - last <= 5, "zero %d ms after the last command", (int)(zero - last));
  CHECK(flagged, "no status told it within 5 ms");
  CHECK(gv_sim_report_of(&sim)->watchdog_trips == 1, "one trip");
  CHECK(gv_sim_report_of(&sim)->zero_after_s <= 0.005, "%g s", gv_sim_report_of(&sim)->zero_after_s);
  gv_frame again = command(5.0, GV_COMMAND_ENABLE);  // back with full force at once: it rises slowly
  gv_sim_receive(&sim, &again);
  skip_to(t);
  CHECK(gv_sim_tension(&sim)[1] <= 0.41 && gv_sim_report_of(&sim)->slew_max_n_per_s < 400,
        "a jump after silence: %g N", gv_sim_tension(&sim)[1]);
}

static void test_switches(void) {
  start("posture p index_mpj 20\nat 0 posture p wrist 0 0 0.1 0 0 0 dead_man on\nat 1 dead_man off\nend 5\n",
        "best");
  int64_t t = pull(100, 300, 2.0);
  CHECK_NEAR(gv_sim_tension(&sim)[1], 2.0, GV_TENSION_LSB_N);
  gv_frame off = command(2.0, 0);
  gv_sim_receive(&sim, &off);
  skip_to(t);
  CHECK(gv_sim_tension(&sim)[1] == 0.0, "force without ENABLE");
  t = pull(t, 100, 2.0);
  CHECK(gv_sim_tension(&sim)[1] > 1.9, "ENABLE again");
  pull(t, 1200, 2.0);
  CHECK(gv_sim_tension(&sim)[1] == 0.0, "force with the dead-man switch open");
}

static void test_best_device_tells_the_script(void) {
  start(grip, "best");
  gv_calibration cal = gv_calibration_default();
  int gloves = 0;
  int hands = 0;
  int heads = 0;
  for (int64_t t = 0; t < 1000; t++) {
    gv_frame frame[64];
    int n = gv_sim_advance(&sim, t * MS, frame, 64);
    for (int i = 0; i < n; i++) {
      gv_glove_msg glove;
      gv_pose_msg pose;
      gv_sim_keyframe truth = gv_sim_script_at(&script, 1e-9 * (double)frame[i].stamp_ns);
      if (gv_fcu_unpack_glove(&frame[i], &glove) == GV_FCU_OK) {
        CHECK(glove.counter == (gloves & 255) && glove.stamp_us == 1000 * (uint32_t)t && glove.age_us == 0,
              "glove at %d ms", (int)t);
        gloves++;
        for (int s = 0; s < GV_SENSORS; s++)
          CHECK_NEAR(glove.raw[s], gv_calibration_raw(&cal, s, truth.angle_rad[s]), 0.5 + 1e-9);
      } else if (gv_fcu_unpack_pose(&frame[i], &pose) == GV_FCU_OK) {
        if (pose.receiver == 1) {
          heads++;
          continue;
        }
        hands++;
        CHECK(gv_norm(gv_sub(pose.T_world_receiver.p, truth.T_world_wrist.p)) < 1e-7, "position at %d ms",
              (int)t);
        gv_quat turn = gv_quat_mul(gv_quat_conj(pose.T_world_receiver.q), truth.T_world_wrist.q);
        CHECK(gv_norm(gv_quat_log(turn)) < 1e-8, "orientation at %d ms", (int)t);
      }
    }
  }
  CHECK(gloves == 1000 && hands == 1000 && heads == 50, "%d glove, %d hand, %d head samples in 1 s", gloves,
        hands, heads);
}

typedef struct statistics {
  int samples, equal, jumps, beyond, bad_ticks, lost, late;
  double jump_max_rad, quantum_min_rad;
} statistics;

static void count_glove(statistics *s, const gv_glove_msg *g, const gv_glove_msg *last,
                        const gv_glove_msg *before) {
  const gv_calibration cal = gv_calibration_default();
  const gv_hand_model hand = gv_hand_model_default(GV_RIGHT);
  s->samples++;
  s->equal += memcmp(g->raw, last->raw, sizeof g->raw) == 0;
  s->lost += (uint8_t)(g->counter - last->counter - 1);
  s->late += g->age_us > 0;
  uint32_t tick = g->stamp_us - last->stamp_us;
  s->bad_ticks += tick % 1000 != 0 || (tick > 0 && tick < 15000);
  for (int i = 0; i < GV_SENSORS; i++) {
    double a = gv_calibration_angle(&cal, i, g->raw[i]);
    double b = gv_calibration_angle(&cal, i, last->raw[i]);
    double c = gv_calibration_angle(&cal, i, before->raw[i]);
    s->beyond += a < hand.angle_min_rad[i] - 0.02 || a > hand.angle_max_rad[i] + 0.02;
    bool jump = fabs(b - a) > 0.08 && fabs(b - c) > 0.08 && fabs(a - c) < 0.04;  // out and back
    s->jumps += jump;
    if (jump)
      s->jump_max_rad = fmax(s->jump_max_rad, fabs(b - a));
    if (a != b)
      s->quantum_min_rad = fmin(s->quantum_min_rad, fabs(a - b));
  }
}

static void test_real_device_looks_like_recordings(void) {
  start(grip, "real");
  statistics s = {.quantum_min_rad = 1.0};
  gv_glove_msg last = {0};
  gv_glove_msg before = {0};
  gv_glove_msg glove;
  const int64_t length_ms = 300000;
  for (int64_t t = 0; t < length_ms; t++) {
    gv_frame frame[64];
    int n = gv_sim_advance(&sim, t * MS, frame, 64);
    for (int i = 0; i < n; i++) {
      if (gv_fcu_unpack_glove(&frame[i], &glove) != GV_FCU_OK)
        continue;
      if (s.samples == 0) {
        before = last = glove;
        last.counter--;
      }
      count_glove(&s, &glove, &last, &before);
      before = last;
      last = glove;
    }
  }
  double rate = (s.samples + s.lost) / (1e-3 * (double)length_ms);
  CHECK(rate > 90 && rate < 150, "%g Hz", rate);
  CHECK_NEAR((double)s.equal / s.samples, 0.44, 0.02);
  CHECK(s.jumps > 30 && s.jump_max_rad > 0.35 && s.jump_max_rad < 0.49 + 0.04, "%d jumps up to %g rad",
        s.jumps, s.jump_max_rad);
  CHECK(s.quantum_min_rad > 0.014 && s.quantum_min_rad < 0.0185, "quantum %g rad", s.quantum_min_rad);
  CHECK(s.bad_ticks == 0, "%d stamps off the ticks", s.bad_ticks);
  CHECK(s.beyond > 0, "no angle beyond anatomy");
  CHECK(s.lost > s.samples / 1000 && s.lost < s.samples / 100, "%d of %d lost", s.lost, s.samples);
  CHECK(s.late > 0, "no late sample");
}

static void test_stamps_tick_15_16_32(void) {
  start("device real status_hz 1000 loss_chance 0 late_chance 0\n"
        "posture p\nat 0 posture p wrist 0 0 0 0 0 0\nend 60\n",
        "");
  uint32_t last = 0;
  int seen[3] = {0};
  int other = 0;
  for (int64_t t = 0; t < 20000; t++) {
    gv_frame frame[64];
    gv_status_msg status;
    int n = gv_sim_advance(&sim, t * MS, frame, 64);
    for (int i = 0; i < n; i++) {
      if (gv_fcu_unpack_status(&frame[i], &status) != GV_FCU_OK || status.stamp_us == last)
        continue;
      uint32_t tick = status.stamp_us - last;  // wraps 5 s after the start
      if (last)
        *(tick == 15000 ? &seen[0] : tick == 16000 ? &seen[1] : tick == 32000 ? &seen[2] : &other) += 1;
      last = status.stamp_us;
    }
  }
  CHECK(seen[0] > 100 && seen[1] > 100 && seen[2] > 5 && seen[2] < seen[0] && other == 0,
        "15: %d, 16: %d, 32: %d, other: %d", seen[0], seen[1], seen[2], other);
}

static uint64_t hash_run(const char *device, uint64_t seed, int max) {
  gv_sim_script_parse(grip, "test", &script, err, sizeof err);
  if (strcmp(device, "real") == 0)
    script.device = gv_sim_device_real();
  gv_sim_init(&sim, &script, NULL, seed);
  gv_sim_start(&sim);
  uint64_t hash = 14695981039346656037ULL;
  for (int64_t t = 0; t < 3000; t += 3) {
    gv_frame frame[64];
    int n;
    while ((n = gv_sim_advance(&sim, t * MS, frame, max)) > 0)
      for (int i = 0; i < n; i++)
        for (int b = 0; b < frame[i].len; b++)
          hash = (hash ^ frame[i].data[b]) * 1099511628211ULL;
  }
  return hash;
}

static void test_deterministic(void) {
  CHECK(hash_run("real", 3, 64) == hash_run("real", 3, 64), "the same seed, other frames");
  CHECK(hash_run("real", 3, 64) != hash_run("real", 4, 64), "another seed, the same frames");
  CHECK(hash_run("real", 3, 64) == hash_run("real", 3, 1),
        "how many frames are fetched at once changes them");
  CHECK(hash_run("best", 3, 64) == hash_run("best", 4, 64), "the best device has no chance in it");
}

static void check_no_force(const char *what, int64_t t) {
  skip_to(t + 1);
  for (int i = 0; i < GV_FINGERS; i++)
    CHECK(gv_sim_tension(&sim)[i] == 0.0, "%s became a force of %g N", what, gv_sim_tension(&sim)[i]);
}

static void test_bad_commands_are_no_force(void) {
  start(grip, "best");
  int64_t t = 1500;
  skip_to(t);
  unsigned long long random = 5;
  for (int bit = 0; bit < 160; bit++) {  // every single bit flipped
    gv_frame f = command(0.3, GV_COMMAND_ENABLE);
    f.data[bit / 8] ^= (uint8_t)(1 << bit % 8);
    gv_sim_receive(&sim, &f);
  }
  for (int i = 0; i < 2000; i++) {  // noise
    gv_frame f = command(0.3, GV_COMMAND_ENABLE);
    for (int b = 0; b < 20; b++)
      f.data[b] = (uint8_t)check_uniform(&random, 0, 256);
    gv_sim_receive(&sim, &f);
  }
  check_no_force("a corrupt command", t);
  CHECK(gv_sim_report_of(&sim)->refused_frames >= 2159, "%d refused",
        (int)gv_sim_report_of(&sim)->refused_frames);
  gv_frame f = command(0.3, GV_COMMAND_ENABLE);
  f.len = 16;
  gv_sim_receive(&sim, &f);
  f.len = 20;
  f.flags = 0;
  gv_sim_receive(&sim, &f);
  f.flags = GV_FRAME_FD;
  f.id = GV_ID_GLOVE;
  gv_sim_receive(&sim, &f);
  check_no_force("a frame of another length, kind or id", t + 1);
  gv_frame zero = command(0, GV_COMMAND_ENABLE);
  gv_sim_receive(&sim, &zero);
  gv_frame fast = command(3.0, GV_COMMAND_ENABLE);
  gv_frame strong = command(12.2, GV_COMMAND_ENABLE);
  gv_sim_receive(&sim, &fast);
  gv_sim_receive(&sim, &strong);
  CHECK(gv_sim_report_of(&sim)->over_slew + gv_sim_report_of(&sim)->over_max == 2,
        "a jump to 3 N and 12.2 N");
  check_no_force("a command beyond its limits", t + 2);
}

static void test_repeated_command_feeds_no_watchdog(void) {
  start(grip, "best");
  int64_t t = pull(2000, 100, 1.0);
  gv_frame stuck = command(1.0, GV_COMMAND_ENABLE);
  for (int i = 0; i < 10; i++) {
    gv_sim_receive(&sim, &stuck);
    skip_to(t++);
  }
  CHECK(gv_sim_tension(&sim)[1] == 0.0, "a stuck sender keeps a force of %g N", gv_sim_tension(&sim)[1]);
  CHECK(gv_sim_report_of(&sim)->repeated == 9, "%d repeated", (int)gv_sim_report_of(&sim)->repeated);
  counter = (uint8_t)(counter + 5);
  pull(t, 10, 0.2);
  CHECK(gv_sim_report_of(&sim)->counter_gaps == 5, "%d gaps", (int)gv_sim_report_of(&sim)->counter_gaps);
}

static void test_script_curve(void) {
  CHECK(gv_sim_script_parse(grip, "test", &script, err, sizeof err) == 0, "%s", err);
  const double rad = GV_PI / 180;
  gv_sim_keyframe half = gv_sim_script_at(&script, 0.5);
  gv_sim_keyframe begin = gv_sim_script_at(&script, 0);
  gv_sim_keyframe past = gv_sim_script_at(&script, 99);
  CHECK_NEAR(begin.angle_rad[GV_INDEX_MPJ], 10 * rad, 1e-15);
  CHECK_NEAR(half.angle_rad[GV_INDEX_MPJ], 40 * rad, 1e-12);
  CHECK_NEAR(past.angle_rad[GV_INDEX_MPJ], 70 * rad, 1e-15);
  CHECK_NEAR(past.angle_rad[GV_THUMB_ROTATE], 10 * rad, 1e-15);  // not mentioned: kept
  CHECK_NEAR(half.T_world_wrist.p.x, -0.05, 1e-12);
  double h = 1e-4;
  double peak = gv_sim_script_at(&script, 0.5 + h).T_world_wrist.p.x -
                gv_sim_script_at(&script, 0.5 - h).T_world_wrist.p.x;
  CHECK_NEAR(peak / (2 * h), 1.875 * 0.3, 1e-4);  // minimum jerk: 15/8 of the mean speed
  // Half of the arc from Rz(30) Rx(90) to the identity: twice the half turn is the whole.
  gv_quat whole = script.keyframe[0].T_world_wrist.q;
  gv_quat part = half.T_world_wrist.q;
  CHECK(gv_norm(gv_quat_log(gv_quat_mul(gv_quat_mul(part, part), gv_quat_conj(whole)))) < 1e-12,
        "half of the arc");
}

static void test_bad_scripts_say_where(void) {
  static const struct {
    const char *text, *where, *what;
  } bad[] = {
    {"", "test:0: ", "no keyframe"},
    {"at 0 posture open wrist 0 0 0 0 0 0\n", "test:1: ", "no posture \"open\""},
    {"# c\n\nposture open index_mjp 5\n", "test:3: ", "index_mjp"},
    {"posture open index_mpj\n", "test:1: ", "index_mpj is missing"},
    {"posture open index_mpj five\n", "test:1: ", "\"five\""},
    {"posture open index_mpj 500\n", "test:1: ", "-180 to 180"},
    {"posture open index_mpj nan\n", "test:1: ", "-180 to 180"},
    {"posture p\nat 0 posture p wrist 0 0 0 0 0\n", "test:2: ", "yaw (degrees) is missing"},
    {"posture p\nat 0 posture p\n", "test:2: ", "wrist pose"},
    {"posture p\nat 1 posture p wrist 0 0 0 0 0 0\nat 1\n", "test:3: ", "put keyframes in order"},
    {"posture p\nat 1 posture p wrist 0 0 0 0 0 0 dead_man maybe\n", "test:2: ", "on or off"},
    {"device worst\n", "test:1: ", "no value"},
    {"device glove_hz_max 1e9\n", "test:1: ", "from 1 to 1000"},
    {"device nose_rad 1\n", "test:1: ", "no device setting"},
    {"device glove_hz_max 10\nposture p\nat 0 posture p wrist 0 0 0 0 0 0\n",
     "test:3: ", "glove_hz_min is above"},
    {"seed -1\n", "test:1: ", "the seed"},
    {"hand middle\n", "test:1: ", "right or left"},
    {"end 5 6\n", "test:1: ", "left over"},
    {"posture p\nat 3 posture p wrist 0 0 0 0 0 0\nend 2\n", "test:3: ", "before the last keyframe"},
    {"jump 3\n", "test:1: ", "unknown word \"jump\""},
  };
  for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
    err[0] = '\0';
    CHECK(gv_sim_script_parse(bad[i].text, "test", &script, err, sizeof err) < 0, "accepted: %s",
          bad[i].text);
    CHECK(strncmp(err, bad[i].where, strlen(bad[i].where)) == 0 && strstr(err, bad[i].what), "for %s: %s",
          bad[i].text, err);
    CHECK(!strchr(err, '\n'), "more than a line: %s", err);
  }
  CHECK(gv_sim_script_load("data/scripts/none.user", &script, err, sizeof err) < 0 &&
            strstr(err, "none.user"),
        "%s", err);
}

static void test_scripts_of_the_project_load(void) {
  DIR *folder = opendir("data/scripts");
  int scripts = 0;
  CHECK(folder != NULL, "run it from the project's folder");
  for (struct dirent *entry; folder && (entry = readdir(folder));) {
    char path[300];
    if (!strstr(entry->d_name, ".user"))
      continue;
    snprintf(path, sizeof path, "data/scripts/%s", entry->d_name);
    CHECK(gv_sim_script_load(path, &script, err, sizeof err) == 0, "%s", err);
    CHECK(!script.keyframe[0].dead_man && !script.keyframe[script.keyframe_count - 1].dead_man,
          "%s: begins or ends with the switch held", path);
    gv_hand_model hand = gv_hand_model_default(script.side);
    for (int k = 0; k < script.keyframe_count; k++)
      for (int i = 0; i < GV_SENSORS; i++)
        CHECK(fabs(gv_clamp(script.keyframe[k].angle_rad[i], hand.angle_min_rad[i], hand.angle_max_rad[i]) -
                   script.keyframe[k].angle_rad[i]) < 0.002,
              "%s: %s at %g s is beyond anatomy", path, gv_sensor_name(i), script.keyframe[k].time_s);
    scripts++;
  }
  if (folder)
    closedir(folder);
  CHECK(scripts >= 7, "%d scripts", scripts);
}

static void test_driver(void) {
  static const char *const bad[] = {"sim",       "sim:none.user",      "sim:?device=worst",     "sim:?seed=0",
                                    "sim:?seed", "sim:?loss_chance=2", "sim:?glove_hz_min=2000"};
  gv_driver driver;
  for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
    err[0] = '\0';
    CHECK(gv_sim_open(bad[i], &driver, err, sizeof err) < 0 && err[0] && !strchr(err, '\n'), "%s: %s", bad[i],
          err);
  }
  CHECK(gv_sim_open("sim:data/scripts/power_box.user?device=real&seed=3&loss_chance=0", &driver, err,
                    sizeof err) == 0,
        "%s", err);
  const int64_t start_ns = 5000000000123;  // any clock will do
  int64_t last_ns = 0;
  int64_t t = 0;
  gv_frame frame[64];
  for (; t < 60000 && !driver.ended(driver.self); t++) {
    int n = driver.poll(driver.self, start_ns + t * MS, frame, 64);
    for (int i = 0; i < n; i++) {
      CHECK(frame[i].stamp_ns >= last_ns && frame[i].stamp_ns <= start_ns + t * MS, "stamp %lld",
            (long long)frame[i].stamp_ns);
      last_ns = frame[i].stamp_ns;
    }
    gv_frame zero = command(0, 0);
    CHECK(driver.send(driver.self, &zero, 1) == 0, "send");
  }
  CHECK(t > 5000 && t < 30000, "the script ended after %d ms", (int)t);
  CHECK(driver.stats(driver.self).rx > 1000 && driver.stats(driver.self).tx == (uint64_t)t, "counted");
  driver.close(driver.self);
}

int main(void) {
  RUN(test_finger_is_held_back);
  RUN(test_fingers_are_as_measured);
  RUN(test_wire_holds_up_both_ways);
  RUN(test_watchdog_lets_go_within_5_ms);
  RUN(test_switches);
  RUN(test_best_device_tells_the_script);
  RUN(test_real_device_looks_like_recordings);
  RUN(test_stamps_tick_15_16_32);
  RUN(test_deterministic);
  RUN(test_bad_commands_are_no_force);
  RUN(test_repeated_command_feeds_no_watchdog);
  RUN(test_script_curve);
  RUN(test_bad_scripts_say_where);
  RUN(test_scripts_of_the_project_load);
  RUN(test_driver);
  return check_done();
}
