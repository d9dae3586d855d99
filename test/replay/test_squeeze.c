// SPDX-License-Identifier: BSD-3-Clause
// A hand that closes around an object, and on into a fist, at couplings from the least to the most that a
// configuration takes: the object ends held, or the fingers slip and it lies within reach. It is never
// thrown: no faster than the hand itself has moved. The pull of the springs stays bounded, and so does what
// leaves through the limiter. Virtual time, the simulated user with a perfect device.
//
//   test_squeeze            every coupling, some approaches
//   test_squeeze all        every approach too, a line a coupling
//   test_squeeze COUPLING   a line a run
#include <string.h>

#include "engine/engine_state.h"
#include "support/check.h"
#include "support/user_run.h"

static user_run run;

// ---- what is squeezed, and how -------------------------------------------------------------------------

#define CAN                                                                                                  \
  "version = 1; objects = ("                                                                                 \
  "{ name = \"table\"; static = true; mu = 0.8; box = [1.2, 0.8, 0.04]; position = [0.0, 0.0, -0.02]; },"    \
  "{ name = \"can\"; mass = 0.2; mu = 0.8; cylinder = [0.032, 0.08]; position = [0.0, 0.0, 0.04]; });"

typedef struct grasp {
  const char *script, *scene;  // the object is the scene's second
} grasp;
static const grasp grasps[] = {{"power_box", "data/scenes/box.scene"},
                               {"pinch_box", "data/scenes/box.scene"},
                               {"tripod_box", "data/scenes/box.scene"},
                               {"bar_frame", "data/scenes/frame.scene"},
                               {"power_box", CAN}};
enum { GRASPS = sizeof grasps / sizeof *grasps };

// The wrist beside where the script has it, and how long each of the two closings takes.
typedef struct approach {
  double x_m, y_m, yaw_deg, closing_s;
} approach;
static const approach approaches[] = {{0, 0, 0, 0.3},      {-0.008, 0, 6, 0.15},   {0.008, -0.01, -6, 0.3},
                                      {0, 0.008, 0, 0.3},  {0, -0.01, 8, 0.6},     {0, 0, -10, 0.3},
                                      {0.008, 0, 0, 0.15}, {-0.008, -0.01, 0, 0.6}};
enum { APPROACHES = sizeof approaches / sizeof *approaches, USUAL_APPROACHES = 3 };

// The palm is five times as stiff and ten times as heavy, within what a configuration takes.
typedef struct coupling {
  const char *name;
  gv_coupling limb;
  double mass_kg;
} coupling;
static const coupling couplings[] = {
  {"none", {0, -1, 0, -1}, 0.01},       {"1", {1, -1, 0.0024, -1}, 0.01},
  {"200", {200, -1, 0.48, -1}, 0.01},   {"10000", {1e4, -1, 24, -1}, 0.01},
  {"100000", {1e5, -1, 240, -1}, 0.01}, {"1000000", {1e6, -1, 1e4, -1}, 0.01},
  {"undamped", {1e6, 0, 1e4, 0}, 0.01}, {"damped", {200, 1e5, 0.48, 1e3}, 0.01},
};
enum { COUPLINGS = sizeof couplings / sizeof *couplings };

// ---- a run ---------------------------------------------------------------------------------------------

typedef struct outcome {
  double speed_m_s, hand_m_s, faster;  // the most: of the object, of the hand; object over hand, both so far
  double pull_n, palm_n;               // of a spring on a finger's limb, and on the palm, the most
  long pulls, hard;                    // on fingers' limbs in all steps, and those beyond the bound
  double felt_n;                       // that left through the limiter, the most
  double away_m;                       // from where it stood, at the end
  double depth_m;                      // the deepest that anything sank in
  int limbs_holding;                   // at the end
  bool finite;
} outcome;

static int find_grip(const gv_sim_script *s) {
  for (int i = 3; i < s->keyframe_count; i++)
    if (s->keyframe[i].T_world_wrist.p.z > s->keyframe[i - 1].T_world_wrist.p.z + 0.05)
      return i - 2;
  abort();
}

static gv_sim_keyframe fist_of(gv_sim_keyframe grip) {
  const gv_hand_model hand = gv_hand_model_default(GV_RIGHT);
  for (int finger = 0; finger < GV_FINGERS; finger++)
    for (int j = 0; j < 3; j++) {
      const int s = gv_flexion[finger][j];
      grip.angle_rad[s] = fmin(hand.angle_max_rad[s], grip.angle_rad[s] + 0.5);
    }
  return grip;
}

// Open, up to the object, around it, the grip, a fist, and wait.
static void write_script(gv_sim_script *s, const approach *a) {
  enum { KEYS = 7 };
  const int grip = find_grip(s);
  const gv_sim_keyframe around = s->keyframe[grip - 1], held = s->keyframe[grip], fist = fist_of(held);
  const gv_sim_keyframe open = s->keyframe[grip - 2];
  gv_sim_keyframe far = s->keyframe[0];
  far.T_world_wrist.p = gv_mad(open.T_world_wrist.p, 0.4, gv_sub(far.T_world_wrist.p, open.T_world_wrist.p));
  const gv_sim_keyframe key[KEYS] = {far, far, open, around, held, fist, fist};
  const double pause_s[KEYS] = {0, 0.25, 0.3, 0.15, a->closing_s, a->closing_s, 0.35};
  const gv_quat yaw = gv_quat_axis_angle(gv_v3(0, 0, 1), a->yaw_deg * GV_PI / 180);
  s->end_s = 0;
  for (int i = 0; i < KEYS; i++) {
    gv_sim_keyframe *k = &s->keyframe[i];
    *k = key[i];
    k->time_s = s->end_s += pause_s[i];
    k->dead_man = i > 0;
    k->T_world_wrist.p = gv_add(k->T_world_wrist.p, gv_v3(a->x_m, a->y_m, 0));
    k->T_world_wrist.q = gv_quat_mul(yaw, k->T_world_wrist.q);
  }
  s->keyframe_count = KEYS;
}

static void start(const grasp *g, const coupling *c, const approach *a) {
  char script[256];
  snprintf(script, sizeof script, "data/scripts/%s.user", g->script);
  if (!user_load(&run, g->scene, script))
    abort();
  write_script(&run.script, a);
  gv_config *cfg = &run.settings.engine;
  cfg->limb = cfg->palm = c->limb;
  cfg->palm.k_f = fmin(1e6, 5 * c->limb.k_f);
  cfg->palm.k_t = fmin(1e4, 10 * c->limb.k_t);
  cfg->limb_mass_kg = c->mass_kg;
  cfg->palm_mass_kg = 10 * c->mass_kg;
  user_start(&run);
}

static void watch_springs(outcome *o) {
  for (int i = 0; i < GV_LIMBS; i++) {
    gv_vec3 f, t;
    gv_engine_coupling(run.engine, i, &f, &t);
    o->finite &= gv_v3_finite(f) && gv_v3_finite(t);
    if (i == GV_LIMB_PALM) {
      o->palm_n = fmax(o->palm_n, gv_norm(f));
      continue;
    }
    o->pull_n = fmax(o->pull_n, gv_norm(f));
    o->hard += gv_norm(f) > 1.01 * GV_PULL_N;
    o->pulls++;
  }
}

static void watch_hand(outcome *o) {
  for (int i = 0; i < GV_LIMBS; i++) {
    o->hand_m_s = fmax(o->hand_m_s, gv_norm(run.engine->hand[0].driver[i].v));
    o->finite &= gv_pose_finite(gv_engine_limb_pose(run.engine, i));
  }
  for (int i = 0; i < GV_FINGERS; i++) {
    o->felt_n = fmax(o->felt_n, run.session.force_n[i]);
    o->finite &= isfinite(run.session.result.tension_n[i]);
  }
}

static void watch_object(outcome *o) {
  gv_vec3 v, w;
  gv_engine_object_velocity(run.engine, 1, &v, &w);
  o->finite &= gv_pose_finite(gv_engine_object_pose(run.engine, 1));
  o->speed_m_s = fmax(o->speed_m_s, gv_norm(v));
  if (gv_norm(v) > 0.05)
    o->faster = fmax(o->faster, gv_norm(v) / o->hand_m_s);
}

static int count_holding_limbs(void) {
  bool holds[GV_LIMBS] = {false};
  int count, sum = 0;
  const gv_contact *c = gv_engine_contacts(run.engine, &count);
  for (int i = 0; i < count; i++)
    if (c[i].limb >= 0 && c[i].object == 1 && gv_norm(c[i].force_world) > 0.02)
      holds[c[i].limb] = true;
  for (int i = 0; i < GV_LIMBS; i++)
    sum += holds[i];
  return sum;
}

static outcome squeeze(const grasp *g, const coupling *c, const approach *a) {
  outcome o = {.finite = true};
  start(g, c, a);
  const gv_vec3 from = gv_engine_object_pose(run.engine, 1).p;
  while (run.time_ms < (int)(1000 * run.script.end_s)) {
    user_step(&run);
    watch_springs(&o);
    watch_hand(&o);
    watch_object(&o);
  }
  o.away_m = gv_norm(gv_sub(gv_engine_object_pose(run.engine, 1).p, from));
  o.depth_m = gv_engine_counters(run.engine)->depth_max_m;
  o.limbs_holding = count_holding_limbs();
  CHECK(gv_engine_counters(run.engine)->body_resets == 0, "%s: a body ran away", c->name);
  user_finish(&run);
  return o;
}

// ---- what is asked of it -------------------------------------------------------------------------------

// A limb that is pushed back while it pulls feels its damper, too: more than the bound for some steps.
static const double in_passing_n = 100.0, palm_in_passing_n = 200.0;

static void check_outcome(const outcome *o, const char *what) {
  CHECK(o->finite, "%s: not finite", what);
  CHECK(o->faster <= 1.0, "%s: thrown at %.2f m/s, %.1f times the hand's speed", what, o->speed_m_s,
        o->faster);
  CHECK(o->away_m < 0.15, "%s: ends %.0f mm away", what, o->away_m * 1e3);
  CHECK(o->depth_m < 1e-3, "%s: sinks in by %.2f mm", what, o->depth_m * 1e3);
  CHECK(o->hard <= 3 * o->pulls / 100, "%s: beyond the bound %ld times of %ld", what, o->hard, o->pulls);
  CHECK(o->pull_n <= in_passing_n && o->palm_n <= palm_in_passing_n, "%s: %g N, the palm %g N", what,
        o->pull_n, o->palm_n);
  CHECK(o->felt_n <= gv_limiter_config_default().max_n, "%s: felt %g N", what, o->felt_n);
}

static void take_worse(outcome *most, const outcome *o) {
  most->speed_m_s = fmax(most->speed_m_s, o->speed_m_s);
  most->faster = fmax(most->faster, o->faster);
  most->pull_n = fmax(most->pull_n, o->pull_n);
  most->palm_n = fmax(most->palm_n, o->palm_n);
  most->pulls += o->pulls;
  most->hard += o->hard;
  most->felt_n = fmax(most->felt_n, o->felt_n);
  most->away_m = fmax(most->away_m, o->away_m);
  most->depth_m = fmax(most->depth_m, o->depth_m);
}

static void tell(const outcome *o) {
  printf("object at most %.2f m/s, %.2f of the hand's; ends within %.0f mm; limbs pulled by at most %.1f N, "
         "above the bound in %.2f %%, the palm %.0f N; sunk in %.2f mm; felt %.2f N\n",
         o->speed_m_s, o->faster, o->away_m * 1e3, o->pull_n, 100.0 * (double)o->hard / (double)o->pulls,
         o->palm_n, o->depth_m * 1e3, o->felt_n);
}

// Returns how many runs end with two limbs or more on the object.
static int squeeze_all(const coupling *c, int count_of_approaches, bool each) {
  outcome most = {0};
  char what[64];
  int held = 0;
  for (int g = 0; g < GRASPS; g++)
    for (int a = 0; a < count_of_approaches; a++) {
      const outcome o = squeeze(&grasps[g], c, &approaches[a]);
      snprintf(what, sizeof what, "%s, %s, approach %d", c->name, grasps[g].script, a);
      check_outcome(&o, what);
      if (each) {
        printf("%-30s %2d limbs hold; ", what, o.limbs_holding);
        tell(&o);
      }
      held += o.limbs_holding >= 2;
      take_worse(&most, &o);
    }
  printf("figure coupling %-8s held in %2d of %2d; ", c->name, held, GRASPS * count_of_approaches);
  tell(&most);
  return held;
}

static void test_no_coupling_throws_the_object(void) {
  for (int c = 0; c < COUPLINGS; c++) {
    const int held = squeeze_all(&couplings[c], USUAL_APPROACHES, false);
    const bool follows = couplings[c].limb.k_f > 0.0 && couplings[c].limb.d_f < 1e3;
    CHECK(!follows || held == GRASPS * USUAL_APPROACHES, "%s: held in %d", couplings[c].name, held);
  }
}

// A spring that was softer for some steps is itself again, to the bit.
static void test_an_open_hand_is_coupled_as_before(void) {
  start(&grasps[0], &couplings[5], &approaches[0]);
  gv_sim_keyframe *end = &run.script.keyframe[run.script.keyframe_count];
  gv_spring before[GV_LIMBS];
  memcpy(before, run.engine->hand[0].acting, sizeof before);
  end[0] = end[1] = run.script.keyframe[0];
  end[0].time_s = run.script.end_s + 0.5;
  end[1].time_s = run.script.end_s += 1.0;
  run.script.keyframe_count += 2;
  gv_sim_init(&run.sim, &run.script, NULL, 1);
  gv_sim_start(&run.sim);
  int softer = 0;
  while (run.time_ms < (int)(1000 * run.script.end_s)) {
    user_step(&run);
    softer += run.engine->hand[0].softer != 0;
  }
  CHECK(softer > 300, "softer in %d steps", softer);
  CHECK(run.engine->hand[0].softer == 0 && memcmp(before, run.engine->hand[0].acting, sizeof before) == 0,
        "some are not");
  user_finish(&run);
}

int main(int argc, char **argv) {
  if (argc == 1) {
    RUN(test_no_coupling_throws_the_object);
    RUN(test_an_open_hand_is_coupled_as_before);
    return check_done();
  }
  const bool all = strcmp(argv[1], "all") == 0;
  for (int c = 0; c < COUPLINGS; c++)
    if (all || strcmp(argv[1], couplings[c].name) == 0)
      squeeze_all(&couplings[c], APPROACHES, !all);
  return check_in_test > 0;
}
