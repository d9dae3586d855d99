// SPDX-License-Identifier: BSD-3-Clause
// What the hand feels against what it should feel, in closed formulas: the weight of what it lifts, the
// angle at which friction lets go, the inertia of what it shakes.
#include "support/check.h"
#include "support/lab.h"
#include "support/user_run.h"

#define G 9.81

// ---- the power grasp, with another mass in it -----------------------------------------------------

static user_run run;
static gv_object object[2];

// The box of data/scenes/box.scene with a mass of its own, grasped and lifted as power_box.user does.
static void grasp(double mass_kg) {
  if (!user_load(&run, "data/scenes/box.scene", "data/scripts/power_box.user"))
    abort();
  if (mass_kg > 0.5)
    run.settings.engine.limb.k_f *= 4;  // a firmer hand
  for (int i = 0; i < 2; i++)
    object[i] = run.scene.object[i];
  for (int k = 0; k < 9; k++)
    object[1].inertia_kg_m2.m[k / 3][k % 3] *= mass_kg / object[1].mass_kg;
  object[1].mass_kg = mass_kg;
  object[1].mu = 1.2;
  run.scene.object = object;
  user_start(&run);
}

// Momentum of the limbs and the object, N s.
static gv_vec3 momentum(double mass_kg) {
  const gv_config *cfg = gv_engine_config(run.engine);
  gv_vec3 v, w;
  gv_engine_object_velocity(run.engine, 1, &v, &w);
  gv_vec3 sum = gv_scale(v, mass_kg);
  for (int i = 0; i < GV_LIMBS; i++) {
    gv_engine_limb_velocity(run.engine, i, &v, &w);
    sum = gv_mad(sum, i == GV_LIMB_PALM ? cfg->palm_mass_kg : cfg->limb_mass_kg, v);
  }
  return sum;
}

static void test_the_hand_carries_the_weight_that_it_lifts(void) {
  static const double mass_kg[] = {0.1, 0.2, 0.3, 0.5, 0.75, 1.0};
  for (int i = 0; i < 6; i++) {
    grasp(mass_kg[i]);
    while (run.time_ms < 7000)
      user_step(&run);
    const gv_vec3 f = user_carries(&run);
    printf("# %.2f kg: %.4f N of %.4f N, %.4f N sideways\n", mass_kg[i], f.z, mass_kg[i] * G,
           hypot(f.x, f.y));
    CHECK(gv_engine_object_pose(run.engine, 1).p.z > 0.1, "%g kg is not lifted", mass_kg[i]);
    CHECK(fabs(f.z - mass_kg[i] * G) < 0.02 * mass_kg[i] * G, "%g kg weigh %g N", mass_kg[i], f.z);
    CHECK(hypot(f.x, f.y) < 0.02 * mass_kg[i] * G, "%g N sideways", hypot(f.x, f.y));
    user_finish(&run);
  }
}

// Shaken up and down by 10 mm: the couplings carry the weight and the inertia of
// object and limbs, at each step.
static void test_what_is_shaken_has_its_inertia(void) {
  static const double hz[] = {1, 2, 3, 4, 5};
  for (int i = 0; i < 5; i++) {
    const double mass_kg = 0.2;
    grasp(mass_kg);
    while (run.time_ms < 5500)
      user_step(&run);
    double worst = 0;
    double most = 0;
    gv_vec3 last = momentum(mass_kg);
    for (int k = 0; k < 2000; k++) {
      // The user's hand, whatever the script says.
      for (int key = 0; key < run.sim.script.keyframe_count; key++)
        run.sim.script.keyframe[key].T_world_wrist.p.z = 0.195 + 0.01 * sin(2 * GV_PI * hz[i] * 1e-3 * k);
      user_step(&run);
      const gv_vec3 now = momentum(mass_kg);
      const double felt = user_carries(&run).z;
      const double moved = (now.z - last.z) / 1e-3 + mass_kg * G;
      last = now;
      if (k < 500)
        continue;
      worst = fmax(worst, fabs(felt - moved));
      most = fmax(most, fabs(moved));
    }
    printf("# %g Hz: felt and moved differ by %.4f N of at most %.3f N\n", hz[i], worst, most);
    CHECK(worst < 0.02 * most, "off by %g of %g N", worst, most);
    user_finish(&run);
  }
}

// ---- friction -------------------------------------------------------------------------------------

// A plate lies on the hand's back, which is tilted slowly about its long axis: the plate slides off at
// atan(mu). Radians; 0: it never slid. It slides when it moves by 1 mm/s: quickstep, which leaves a
// residual, lets it creep below its angle by some um/s.
enum { SLIDE_STEPS = 20 };
static const double slides_m = 20e-6;

static double slides_at(gv_solver solver, double mu) {
  static const double straight[GV_SENSORS];
  lab l;
  lab_start(&l);
  l.cfg.solver = solver;
  l.cfg.mu_hand = mu;
  const int plate = lab_box(&l, gv_v3(0.04, 0.04, 0.01), gv_v3(0, 0, 1), 0.05, mu);
  lab_run(&l);
  gv_sample hand = lab_hand(&l, straight, (gv_pose){{1, 0, 0, 0}, {0, 0, 0.5}});
  lab_steps(&l, 500, &hand);
  const gv_pose palm = gv_engine_limb_pose(l.engine, GV_LIMB_PALM);
  gv_engine_set_object(l.engine, plate, (gv_pose){{1, 0, 0, 0}, gv_add(palm.p, gv_v3(0, 0, 0.012 + 0.0051))},
                       gv_v3(0, 0, 0), gv_v3(0, 0, 0));
  lab_steps(&l, 500, &hand);
  gv_vec3 at = gv_v3(0, 0, 0);
  double angle = 0;
  double moved = 0;
  double turn = 0;
  for (int k = 0; turn < 1.0 && moved < slides_m; k++) {
    turn += turn < 0.9 * gv_atan2(mu, 1) ? 5e-5 : 5e-6;
    hand = lab_hand(&l, straight, (gv_pose){gv_quat_axis_angle(gv_v3(1, 0, 0), turn), {0, 0, 0.5}});
    lab_steps(&l, 1, &hand);
    if (k % SLIDE_STEPS)
      continue;
    const gv_pose T = gv_engine_limb_pose(l.engine, GV_LIMB_PALM);
    const gv_vec3 up = gv_rotate(T.q, gv_v3(0, 0, 1));
    const gv_vec3 now = gv_transform_inv(T, gv_engine_object_pose(l.engine, plate).p);
    angle = gv_atan2(hypot(up.x, up.y), up.z);
    moved = k ? gv_norm(gv_sub(now, at)) : 0.0;
    at = now;
  }
  gv_engine_close(l.engine);
  return moved >= slides_m ? angle : 0.0;
}

static void check_slide(gv_solver solver, const char *name, double mu) {
  const double angle = slides_at(solver, mu);
  const double expected = gv_atan2(mu, 1);
  printf("# %s, mu %.1f: slides at %.2f degrees, atan(mu) is %.2f\n", name, mu, angle * 180 / GV_PI,
         expected * 180 / GV_PI);
  CHECK(fabs(angle - expected) < 0.02 * expected, "%s: at %g rad, %g expected", name, angle, expected);
}

static void test_what_lies_on_the_hand_slides_at_the_angle_of_friction(void) {
  static const double mu_hand[] = {0.3, 0.5, 0.8, 1.0};
  for (int i = 0; i < 4; i++)
    check_slide(GV_SOLVER_AUTO, "auto", mu_hand[i]);
}

static void test_with_the_solvers_of_ode_it_slides_there_too(void) {
  static const double mu_hand[] = {0.3, 0.8};
  for (int i = 0; i < 2; i++) {
    check_slide(GV_SOLVER_DANTZIG, "dantzig", mu_hand[i]);
    check_slide(GV_SOLVER_QUICKSTEP, "quickstep", mu_hand[i]);
  }
}

int main(void) {
  RUN(test_the_hand_carries_the_weight_that_it_lifts);
  RUN(test_what_is_shaken_has_its_inertia);
  RUN(test_what_lies_on_the_hand_slides_at_the_angle_of_friction);
  RUN(test_with_the_solvers_of_ode_it_slides_there_too);
  return check_done();
}
