// SPDX-License-Identifier: BSD-3-Clause
// Two hands in one world, each with a scripted user, device and limiter of its own: a bar goes from the right
// hand to the left. And: a hand that touches nothing changes no bit of what the other one does, and a step of
// both is within its time. `test_two_hands show` tells how it goes.
#include <inttypes.h>
#include <string.h>
#include <time.h>

#include "daemon/load/config_load.h"
#include "daemon/load/scene_load.h"
#include "gloved/fcu.h"
#include "gloved/sim.h"
#include "support/check.h"

enum { MEMORY = 48 << 20 };
static _Alignas(64) unsigned char scene_memory[MEMORY], engine_memory[MEMORY];
static gv_scene scene;
static gv_engine *engine;

typedef struct user {
  gv_sim sim;
  gv_limiter limiter;
  gv_sample sample;
  uint8_t counter;
  double force_n[GV_FINGERS], most_n;
} user;

static user users[GV_HANDS];
static int hands, time_ms;
static bool soft;  // joints between the limbs of a finger, pads that are patches
static double depth_m;

// ---- a run ----------------------------------------------------------------------------------------

static void load_scene(const char *name) {
  char path[256], err[512] = "";
  gv_arena arena;
  gv_arena_init(&arena, scene_memory, sizeof scene_memory);
  snprintf(path, sizeof path, "data/scenes/%s.scene", name);
  if (gv_scene_load(path, &arena, &scene, err, sizeof err)) {
    printf("# %s\n", err);
    abort();
  }
}

static void start_user(user *u, const char *script_name, const gv_limiter_config *limits) {
  static gv_sim_script script;
  char path[256], err[512] = "";
  snprintf(path, sizeof path, "data/scripts/%s.user", script_name);
  if (gv_sim_script_load(path, &script, err, sizeof err)) {
    printf("# %s\n", err);
    abort();
  }
  memset(u, 0, sizeof *u);
  gv_limiter_init(&u->limiter, limits);
  gv_sim_init(&u->sim, &script, NULL, 1);
  gv_sim_start(&u->sim);
}

// second: the left hand's script; null: one hand.
static void begin(const char *scene_name, gv_solver solver, const char *first, const char *second) {
  gv_settings settings;
  gv_settings_default(&settings);
  gv_config *cfg = &settings.engine;
  cfg->solver = solver;
  cfg->finger_joints = soft;
  cfg->patch_m = soft ? 0.005 : 0.0;
  cfg->second.present = second != NULL;
  cfg->second.hand = gv_hand_model_default(GV_LEFT);
  cfg->second.calibration = cfg->calibration;
  cfg->second.T_receiver_wrist = cfg->T_receiver_wrist;
  load_scene(scene_name);
  engine = gv_engine_init(engine_memory, sizeof engine_memory, cfg, &scene);
  if (!engine)
    abort();
  hands = gv_engine_hands(engine);
  start_user(&users[0], first, &settings.limiter);
  if (second)
    start_user(&users[1], second, &settings.limiter);
  time_ms = 0;
  depth_m = 0;
}

static void take_frames(user *u, int64_t now_ns) {
  static gv_frame frame[256];
  const int count = gv_sim_advance(&u->sim, now_ns, frame, 256);
  gv_glove_msg glove;
  gv_pose_msg pose;
  u->sample.glove_new = u->sample.pose_new = false;
  for (int i = 0; i < count; i++) {
    if (frame[i].id == GV_ID_GLOVE && gv_fcu_unpack_glove(&frame[i], &glove) == GV_FCU_OK) {
      u->sample.glove_new = true;
      for (int k = 0; k < GV_SENSORS; k++)
        u->sample.raw[k] = glove.raw[k];
    }
    if (frame[i].id == GV_ID_POSE && gv_fcu_unpack_pose(&frame[i], &pose) == GV_FCU_OK &&
        pose.receiver == GV_RECEIVER_HAND) {
      u->sample.pose_new = true;
      u->sample.T_world_receiver = pose.T_world_receiver;
    }
  }
}

static void send_force(user *u, const gv_step_result *result) {
  gv_frame frame;
  gv_limiter_step(&u->limiter, result->tension_n, true, 0.0, 0.001, u->force_n);
  gv_command_msg msg = {.counter = u->counter++, .flags = GV_COMMAND_ENABLE};
  memcpy(msg.tension_n, u->force_n, sizeof msg.tension_n);
  gv_fcu_pack_command(&msg, &frame);
  gv_sim_receive(&u->sim, &frame);
  for (int i = 0; i < GV_FINGERS; i++)
    u->most_n = fmax(u->most_n, u->force_n[i]);
}

static double cpu_us(void) {
  struct timespec t;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return 1e6 * (double)t.tv_sec + 1e-3 * (double)t.tv_nsec;
}

static void note_depths(void) {
  int count;
  const gv_contact *c = gv_engine_contacts(engine, &count);
  for (int i = 0; i < count; i++)
    depth_m = fmax(depth_m, c[i].depth_m);
}

static void run_to(int ms) {
  gv_sample sample[GV_HANDS];
  gv_step_result result[GV_HANDS];
  for (; time_ms < ms; time_ms++) {
    for (int h = 0; h < hands; h++) {
      take_frames(&users[h], time_ms * 1000000LL);
      sample[h] = users[h].sample;
    }
    gv_engine_step_hands(engine, sample, result);
    for (int h = 0; h < hands; h++)
      send_force(&users[h], &result[h]);
    note_depths();
  }
}

static gv_pose bar(void) { return gv_engine_object_pose(engine, 1); }

// How many limbs of a hand the bar's contacts press, and with what force in all.
static int limbs_on_bar(int hand, double *out_n) {
  bool touches[GV_HANDS * GV_LIMBS] = {false};
  int count, limbs = 0;
  const gv_contact *c = gv_engine_contacts(engine, &count);
  *out_n = 0;
  for (int i = 0; i < count; i++) {
    if (c[i].limb < 0 || c[i].limb / GV_LIMBS != hand || gv_norm(c[i].force_world) < 1e-3)
      continue;
    *out_n += gv_norm(c[i].force_world);
    limbs += !touches[c[i].limb];
    touches[c[i].limb] = true;
  }
  return limbs;
}

static void show(void) {
  double right_n, left_n;
  const int right = limbs_on_bar(0, &right_n);
  const int left = limbs_on_bar(1, &left_n);
  const gv_vec3 p = bar().p;
  const gv_vec3 r = gv_quat_log(bar().q);
  printf("# %5d ms  bar %.4f %.4f %.4f (%.4f %.4f %.4f)  right %d limbs %.1f N, left %d limbs %.1f N\n",
         time_ms, p.x, p.y, p.z, r.x, r.y, r.z, right, right_n, left, left_n);
}

static void finish(void) { gv_engine_close(engine); }

// ---- the bar goes over ----------------------------------------------------------------------------

// Hashes of the end; one that a change is meant to alter is printed for copying.
static const struct {
  gv_solver solver;
  uint64_t hash;
} golden[] = {
  {GV_SOLVER_AUTO, 0x5e2436d293601cfd},
  {GV_SOLVER_DANTZIG, 0x76c552337d31c5d6},
  {GV_SOLVER_QUICKSTEP, 0x6af7a3d5f0240aad},
};
enum { SOLVERS = sizeof golden / sizeof *golden };

// All that the two hands do to the bar is to carry it.
static void check_both_hold(const char *name) {
  const double weight_n = 0.2 * 9.81;
  double right_n, left_n;
  const int right = limbs_on_bar(0, &right_n);
  const int left = limbs_on_bar(1, &left_n);
  gv_vec3 sum = gv_v3(0, 0, 0);
  int count;
  const gv_contact *c = gv_engine_contacts(engine, &count);
  for (int i = 0; i < count; i++)
    sum = gv_sub(sum, c[i].force_world);
  printf("# %s: right hand %d limbs, %.1f N; left hand %d limbs, %.1f N\n", name, right, right_n, left,
         left_n);
  CHECK(right >= 3 && left >= 3, "%s: %d limbs of the right hand, %d of the left", name, right, left);
  CHECK(gv_norm(gv_sub(sum, gv_v3(0, 0, weight_n))) < 0.02, "%s: forces on the bar add up to %g %g %g N",
        name, sum.x, sum.y, sum.z);
  for (int h = 0; h < 2; h++)
    CHECK(users[h].most_n > 0.5 && users[h].most_n < 6, "%s: hand %d feels %g N", name, h, users[h].most_n);
}

static void hand_over(int which) {
  const char *name = gv_solver_name(golden[which].solver);
  double force_n;
  begin("handover", golden[which].solver, "give_bar", "take_bar");
  run_to(7900);
  CHECK(bar().p.z > 0.21, "%s: the bar is at %g m", name, bar().p.z);
  check_both_hold(name);
  run_to(9000);
  CHECK(limbs_on_bar(0, &force_n) == 0, "%s: the right hand still presses with %g N", name, force_n);
  CHECK(limbs_on_bar(1, &force_n) >= 5, "%s: %d limbs of the left hand", name, limbs_on_bar(1, &force_n));
  run_to(10900);
  const gv_pose before = bar();
  CHECK(before.p.y > 0.035 && before.p.z > 0.25, "%s: carried to %g, %g m", name, before.p.y, before.p.z);
  run_to(11400);
  const double slip_m = gv_norm(gv_sub(bar().p, before.p));
  printf("# %s: slips by %.4f mm, sank in by at most %.4f mm\n", name, 1e3 * slip_m, 1e3 * depth_m);
  CHECK(slip_m < 1e-4, "%s: the bar slips by %g m", name, slip_m);
  CHECK(depth_m < 5e-5, "%s: sinks in by %g m", name, depth_m);
  CHECK(gv_engine_hash(engine) == golden[which].hash, "%s: hash 0x%016" PRIx64, name, gv_engine_hash(engine));
  finish();
}

static void test_a_bar_goes_from_one_hand_to_the_other(void) {
  for (int i = 0; i < SOLVERS; i++)
    hand_over(i);
}

// ---- neither hand knows of the other --------------------------------------------------------------

typedef struct world {
  gv_pose limb[GV_LIMBS], bar;
  double force_n[GV_FINGERS];
} world;

static world look(int hand) {
  world w = {.bar = bar()};
  for (int i = 0; i < GV_LIMBS; i++)
    w.limb[i] = gv_engine_limb_pose(engine, hand * GV_LIMBS + i);
  memcpy(w.force_n, users[hand].force_n, sizeof w.force_n);
  return w;
}

// The bar is grasped and lifted; the other hand waits 0.1 m above and beside it.
static void test_a_hand_that_does_not_touch_changes_no_bit(void) {
  begin("handover", GV_SOLVER_AUTO, "give_bar", NULL);
  run_to(4800);
  const world alone = look(0);
  finish();
  begin("handover", GV_SOLVER_AUTO, "give_bar", "take_bar");
  run_to(4800);
  const world beside = look(0);
  finish();
  CHECK(alone.bar.p.z > 0.2, "nothing was lifted");
  CHECK(memcmp(&alone, &beside, sizeof alone) == 0, "the bar is %g m off", beside.bar.p.z - alone.bar.p.z);
}

static gv_pose mirrored(gv_pose T) {
  return (gv_pose){{T.q.w, -T.q.x, T.q.y, -T.q.z}, {T.p.x, -T.p.y, T.p.z}};
}

static void mirror_script(gv_sim_script *script) {
  for (int i = 0; i < script->keyframe_count; i++)
    script->keyframe[i].T_world_wrist = mirrored(script->keyframe[i].T_world_wrist);
}

// The second hand, a left one, with the mirrored script does what the first one does, mirrored.
static void compare_mirrored(void) {
  begin("handover", GV_SOLVER_AUTO, "give_bar", "take_bar");
  run_to(4800);
  const world right = look(0);
  finish();
  begin("handover", GV_SOLVER_AUTO, "take_bar", "give_bar");
  mirror_script(&users[0].sim.script);
  mirror_script(&users[1].sim.script);
  run_to(4800);
  const world left = look(1);
  finish();
  double worst_m = gv_norm(gv_sub(left.bar.p, mirrored(right.bar).p));
  double worst_n = 0;
  for (int i = 0; i < GV_LIMBS; i++)
    worst_m = fmax(worst_m, gv_norm(gv_sub(left.limb[i].p, mirrored(right.limb[i]).p)));
  for (int i = 0; i < GV_FINGERS; i++)
    worst_n = fmax(worst_n, fabs(left.force_n[i] - right.force_n[i]));
  printf("# mirrored%s, the second hand is off by %.2g mm and %.2g N\n",
         soft ? " with joined fingers and soft pads" : "", 1e3 * worst_m, worst_n);
  CHECK(right.bar.p.z > 0.2 && worst_m < 1e-4, "off by %g m", worst_m);
  CHECK(worst_n < 0.02, "off by %g N", worst_n);
}

static void test_the_second_hand_is_the_mirror_of_the_first(void) {
  compare_mirrored();
  soft = true;
  compare_mirrored();
  soft = false;
}

// ---- time -----------------------------------------------------------------------------------------

static int by_size(const void *a, const void *b) {
  const double d = *(const double *)a - *(const double *)b;
  return (d > 0) - (d < 0);
}

// Both hands hold the bar: a step leaves half of a period of 1 kHz.
static void test_half_of_a_period_is_left(void) {
  enum { STEPS = 10000 };
  static double us[STEPS];
  static const gv_sample nothing[GV_HANDS];
  gv_step_result result[GV_HANDS];
  begin("handover", GV_SOLVER_AUTO, "give_bar", "take_bar");
  run_to(7900);
  for (int i = 0; i < STEPS; i++) {
    const double start_us = cpu_us();
    gv_engine_step_hands(engine, nothing, result);
    us[i] = cpu_us() - start_us;
  }
  qsort(us, STEPS, sizeof *us, by_size);
  printf("# a step of two hands that hold: median %.1f us, p99.9 %.1f us\n", us[STEPS / 2],
         us[STEPS - 1 - STEPS / 1000]);
  CHECK(us[STEPS - 1 - STEPS / 1000] < 500, "p99.9 %g us", us[STEPS - 1 - STEPS / 1000]);
  CHECK(gv_engine_counters(engine)->newton_steps > STEPS, "another solver did them");
  finish();
}

int main(int argc, char **argv) {
  if (argc > 1 && strcmp(argv[1], "show") == 0) {
    begin("handover", GV_SOLVER_AUTO, "give_bar", "take_bar");
    for (int ms = 200; ms <= 11400; ms += 200) {
      run_to(ms);
      show();
    }
    return 0;
  }
  RUN(test_a_bar_goes_from_one_hand_to_the_other);
  RUN(test_a_hand_that_does_not_touch_changes_no_bit);
  RUN(test_the_second_hand_is_the_mirror_of_the_first);
  RUN(test_half_of_a_period_is_left);
  return check_done();
}
