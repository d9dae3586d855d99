// SPDX-License-Identifier: BSD-3-Clause
// Friction of a patch against turning about the normal: its torque by the formula, in each solver, and a
// pinched box whose weight is to one side, which swings in fingers of points and is held by pads.
#include "support/check.h"
#include "support/solvers.h"
#include "support/user_run.h"

// ---- one contact ----------------------------------------------------------------------------------

static const double mass = 0.1, turn_inertia = 2e-5, mu = 0.8, patch = 0.006;

// A ball of 0.1 kg falls by a step's gravity onto the floor, pressed with press_n besides, and turns.
static void state_spinning_ball(gv_problem *q, const gv_config *cfg, double press_n, double turn_rad_s) {
  memset(q, 0, sizeof *q);
  q->step_s = cfg->step_s;
  q->budget_s = 1.0;
  q->body_count = GV_LIMBS + 2;
  gv_problem_body *ball = &q->body[GV_LIMBS];
  *ball = (gv_problem_body){
    .mass = mass, .p = {0, 0, 0.02}, .v = {0, 0, -press_n * cfg->step_s / mass}, .w = {0, 0, turn_rad_s}};
  for (int k = 0; k < 3; k++)
    ball->inertia.m[k][k] = turn_inertia;
  const gv_dynamics_contact c = {.body_a = GV_LIMBS,
                                 .body_b = GV_LIMBS + 1,
                                 .normal = {0, 0, 1},
                                 .friction_dir = {1, 0, 0},
                                 .mu = mu,
                                 .patch = patch};
  int index[1];
  gv_problem_set_contacts(q, cfg, &c, 1, index);
}

static void test_a_patch_takes_a_turn_by_the_formula(void) {
  static gv_problem problem;
  const gv_config cfg = gv_config_default();
  gv_choice choice = open_solvers();
  choice.period_s = 1.0;
  for (int s = 0; s < EVERY_SOLVER; s++) {
    choice.solver = every_solver[s];
    for (double press_n = 0.5; press_n < 20; press_n *= 2) {
      gv_velocity v[GV_BODIES] = {{{0, 0, 0}, {0, 0, 0}}};
      gv_vec3 impulse[GV_MAX_CONTACTS];
      state_spinning_ball(&problem, &cfg, press_n, 10.0);
      gv_choice_forget(&choice);
      gv_choice_solve(&choice, &problem, v, impulse);
      const double torque = turn_inertia * (10.0 - v[GV_LIMBS].w.z) / cfg.step_s;
      const double expected = 2.0 / 3.0 * mu * patch * impulse[0].z / cfg.step_s;
      CHECK(fabs(torque - expected) < 1e-6 * expected && expected > 1e-4,
            "%s, pressed with %g N: %g N m, expected %g", gv_solver_name(every_solver[s]), press_n, torque,
            expected);
      state_spinning_ball(&problem, &cfg, press_n, -0.01);
      gv_choice_solve(&choice, &problem, v, impulse);
      CHECK(fabs(v[GV_LIMBS].w.z) < 1e-4, "%s: a slow turn goes on at %g rad/s",
            gv_solver_name(every_solver[s]), v[GV_LIMBS].w.z);
    }
  }
  gv_choice_close(&choice);
}

// ---- a pinch --------------------------------------------------------------------------------------

static user_run run;

// The box of data/scenes/box.scene, its centre of mass 28 mm beside the line between the fingers.
static const char *const lopsided =
    "version = 1;\n"
    "objects = (\n"
    "  { name = \"table\"; static = true; mu = 0.8; box = [1.2, 0.8, 0.04];\n"
    "    position = [0.0, 0.0, -0.02]; },\n"
    "  { name = \"box\"; mass = 0.2; mu = 0.8; box = [0.06, 0.06, 0.08]; position = [0.0, 0.0, 0.04];\n"
    "    center = [0.0, -0.028, 0.0]; inertia = [2e-4, 2e-4, 1.2e-4, 0.0, 0.0, 0.0]; }\n"
    ");\n";

typedef struct swing {
  double turned_rad;   // 9 s after the lift
  double turning_rad;  // in the last of them
} swing;

static swing pinch(gv_solver solver, double patch_m) {
  if (!user_load(&run, lopsided, "data/scripts/pinch_box.user"))
    abort();
  run.settings.engine.solver = solver;
  run.settings.engine.patch_m = patch_m;
  user_start(&run);
  while (run.time_ms < 13000)
    user_step(&run);
  const gv_quat before = gv_engine_object_pose(run.engine, 1).q;
  while (run.time_ms < 14000)
    user_step(&run);
  const gv_pose T = gv_engine_object_pose(run.engine, 1);
  CHECK(T.p.z > 0.12, "dropped to %g m", T.p.z);
  user_finish(&run);
  return (swing){gv_norm(gv_quat_log(T.q)), gv_norm(gv_quat_log(gv_quat_mul(T.q, gv_quat_conj(before))))};
}

static void test_pads_hold_what_swings_between_points(void) {
  for (int s = 0; s < EVERY_SOLVER; s++) {
    const char *name = gv_solver_name(every_solver[s]);
    const swing points = pinch(every_solver[s], 0.0);
    const swing pads = pinch(every_solver[s], 0.008);
    printf("# %s: turns by %.1f degrees between points, %.1f between pads of 8 mm (%.4f in the last s)\n",
           name, points.turned_rad * 180 / GV_PI, pads.turned_rad * 180 / GV_PI,
           pads.turning_rad * 180 / GV_PI);
    CHECK(points.turned_rad > 0.9, "%s: turns by %g rad between points", name, points.turned_rad);
    CHECK(pads.turned_rad < 0.5, "%s: turns by %g rad between pads", name, pads.turned_rad);
    CHECK(pads.turning_rad < 1e-3, "%s: goes on turning by %g rad/s", name, pads.turning_rad);
  }
}

int main(void) {
  RUN(test_a_patch_takes_a_turn_by_the_formula);
  RUN(test_pads_hold_what_swings_between_points);
  return check_done();
}
