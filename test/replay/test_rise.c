// SPDX-License-Identifier: BSD-3-Clause
// How fast a force rises against what the hand's own motion explains: in no step by more than the coupling's
// stiffness times the way of the fingertip's driver, and 0.05 N, neither where it is asked for nor where it
// leaves. Over the recorded grasps (touch, slip, regrasp, a real glove's jumps), with solvers that change in
// the grasp and couplings that change, and a hand that is drawn over an edge and back.
#include "replay/replay.h"
#include "support/check.h"
#include "support/user_run.h"

static const double anyway_n = 0.05;  // in a step of a millisecond

// ---- what is measured ----------------------------------------------------------------------------------

typedef struct rise {
  double most_n, beyond_n, left_beyond_n;  // the most in a step; beyond k times the way: asked for, sent
  double asked_n[GV_FINGERS], sent_n[GV_FINGERS];  // of the last step
  gv_vec3 tip_m[GV_FINGERS];
  long steps, at_the_limit;  // each finger counts
  bool begun;
} rise;

static void watch_rise(rise *r, const gv_session *session) {
  const gv_engine *engine = session->engine;
  if (!gv_engine_hand_placed(engine))
    return;
  const double k = gv_engine_config(engine)->limb.k_f;
  for (int i = 0; i < GV_FINGERS; i++) {
    const gv_vec3 tip_m = gv_engine_driver_pose(engine, 3 * i + 2).p;
    const double asked_n = session->result.tension_n[i];
    const double explained_n = r->begun ? k * gv_norm(gv_sub(tip_m, r->tip_m[i])) : 0.0;
    const double beyond_n = asked_n - r->asked_n[i] - explained_n;
    r->most_n = fmax(r->most_n, asked_n - r->asked_n[i]);
    r->beyond_n = fmax(r->beyond_n, beyond_n);
    r->left_beyond_n = fmax(r->left_beyond_n, session->force_n[i] - r->sent_n[i] - explained_n);
    r->at_the_limit += beyond_n > 0.999 * anyway_n;
    r->steps++;
    r->asked_n[i] = asked_n;
    r->sent_n[i] = session->force_n[i];
    r->tip_m[i] = tip_m;
  }
  r->begun = true;
}

static void check_rise(const rise *r, const char *what) {
  printf("figure %-36s rises by at most %.3f N a step, %.4f N beyond the way's (%.4f N of what leaves), held "
         "back "
         "in %ld of %ld\n",
         what, r->most_n, r->beyond_n, r->left_beyond_n, r->at_the_limit, r->steps);
  CHECK(r->beyond_n <= anyway_n + 1e-9, "%s: %g N", what, r->beyond_n);
  CHECK(r->left_beyond_n <= anyway_n + 1e-9, "%s: %g N leave", what, r->left_beyond_n);
  CHECK(r->most_n > 0.02, "%s: nothing was felt", what);
}

// ---- recorded grasps -----------------------------------------------------------------------------------

// What is done to the engine before a step.
typedef void disturbance(gv_engine *engine, int step);

static void leave_alone(gv_engine *engine, int step) {
  (void)engine;
  (void)step;
}

// With a fiftieth of its budget newton leaves what does not fit to quickstep.
static void change_solvers(gv_engine *engine, int step) {
  gv_engine_set_effort(engine, (gv_effort){step / 50 % 2 ? 0.02 : 1.0, GV_MAX_CONTACTS});
}

static void change_couplings(gv_engine *engine, int step) {
  if (step % 500 != 0)
    return;
  gv_config cfg = gv_config_default();
  const double times = step % 1000 == 0 ? 1.0 : 2.0;
  cfg.limb.k_f *= times;
  cfg.limb.k_t *= times;
  cfg.palm.k_f *= times;
  CHECK(gv_engine_adjust(engine, &cfg.limb, &cfg.palm, cfg.mu_hand) == 0, "refused");
}

static rise replay_grasp(const char *name, variant v, disturbance *disturb) {
  static expectation expected;
  static gv_session session;
  static gv_frame frame[256];
  replay_run run;
  rise r = {0};
  if (expectation_read(name, &expected) || replay_open(&expected, v, &run)) {
    CHECK(false, "%s does not open", name);
    return r;
  }
  const gv_session_config cfg = {.limiter = run.settings.limiter,
                                 .safety = run.settings.safety,
                                 .side = run.settings.engine.hand.side,
                                 .period_s = run.settings.engine.step_s};
  gv_session_init(&session, &cfg, run.engine);
  for (int step = 0; step < MAX_STEPS && !run.trace.ended(run.trace.self); step++) {
    gv_frame command;
    const int64_t now_ns = step * 1000000LL;
    disturb(run.engine, step);
    const int count = run.trace.poll(run.trace.self, now_ns, frame, 256);
    gv_session_step(&session, now_ns, frame, count, 0, &command);
    watch_rise(&r, &session);
  }
  run.trace.close(run.trace.self);
  gv_engine_close(run.engine);
  return r;
}

static void judge_grasp(const char *name, variant v, disturbance *disturb, const char *how) {
  char what[80];
  snprintf(what, sizeof what, "%s, %s:", name, how);
  const rise r = replay_grasp(name, v, disturb);
  check_rise(&r, what);
}

static void test_no_force_rises_beyond_the_way(void) {
  judge_grasp("power_box", VARIANT_DEFAULT, leave_alone, "as recorded");
  judge_grasp("pinch_box", VARIANT_DEFAULT, leave_alone, "as recorded");
  judge_grasp("regrasp_box", VARIANT_DEFAULT, leave_alone, "as recorded");
  judge_grasp("bar_frame", VARIANT_DEFAULT, leave_alone, "as recorded");
  judge_grasp("finger_frame", VARIANT_DEFAULT, leave_alone, "as recorded");
  judge_grasp("power_box_real", VARIANT_DEFAULT, leave_alone, "as recorded");
  judge_grasp("tripod_box", VARIANT_PAPER, leave_alone, "preset paper");
}

static void test_no_force_rises_as_solvers_change(void) {
  judge_grasp("regrasp_box", VARIANT_DEFAULT, change_solvers, "solvers change");
}

static void test_no_force_rises_as_couplings_change(void) {
  judge_grasp("power_box", VARIANT_DEFAULT, change_couplings, "couplings change");
}

// ---- an edge -------------------------------------------------------------------------------------------

// A flat hand, palm down, its fingers pressed by 4 mm onto a plate: aside over the plate's edge within 0.3 s,
// and back against it.
static void test_no_force_rises_at_an_edge(void) {
  static const double at_s[] = {0, 0.3, 0.8, 1.1, 1.3, 1.6, 1.9}, y_m[] = {0, 0, 0, 0.1, 0.1, 0, 0};
  static const double z_m[] = {0.08, 0.08, 0.0435, 0.0435, 0.0435, 0.0435, 0.08};
  enum { KEYS = sizeof at_s / sizeof *at_s };
  static user_run run;
  rise r = {0};
  if (!user_load(&run,
                 "version = 1; objects = ({ name = \"plate\"; static = true; mu = 0.8; "
                 "box = [0.1, 0.08, 0.04]; position = [0.14, 0.0, 0.02]; });",
                 "data/scripts/power_box.user"))
    abort();
  for (int i = 0; i < KEYS; i++)
    run.script.keyframe[i] = (gv_sim_keyframe){
      .time_s = at_s[i], .T_world_wrist = {gv_quat_identity(), {0, y_m[i], z_m[i]}}, .dead_man = i > 0};
  run.script.keyframe_count = KEYS;
  run.script.end_s = at_s[KEYS - 1];
  user_start(&run);
  while (run.time_ms < 1900) {
    user_step(&run);
    watch_rise(&r, &run.session);
  }
  user_finish(&run);
  check_rise(&r, "flat hand over an edge and back:");
  CHECK(r.at_the_limit > 10, "held back in %ld", r.at_the_limit);
}

int main(void) {
  RUN(test_no_force_rises_beyond_the_way);
  RUN(test_no_force_rises_as_solvers_change);
  RUN(test_no_force_rises_as_couplings_change);
  RUN(test_no_force_rises_at_an_edge);
  return check_done();
}
