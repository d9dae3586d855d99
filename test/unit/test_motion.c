// SPDX-License-Identifier: BSD-3-Clause
// What moves by itself, and what is left of a step where a part of it has no room: spin without torque, a gap
// that closes, objects that only seem to be at rest, a solver without time.
#include "engine/engine_state.h"
#include "support/check.h"
#include "support/lab.h"

static int body_of(int object) { return GV_LIMBS + object; }

// In the world's frame, of a box of these sizes and of 1 kg.
static gv_vec3 angular_momentum(const lab *l, int object) {
  gv_vec3 v, w;
  gv_engine_object_velocity(l->engine, object, &v, &w);
  const gv_pose T = gv_engine_object_pose(l->engine, object);
  return gv_rotate(T.q, gv_mat3_mul(&l->object[object].inertia_kg_m2, gv_rotate_inv(T.q, w)));
}

// Thrown about its middle axis a box tumbles (Dzhanibekov), but its momentum stays where it points.
static void test_spin_without_torque_keeps_its_momentum(void) {
  lab l;
  lab_start(&l);
  l.scene.gravity_m_s2 = gv_v3(0, 0, 0);
  const int box = lab_box(&l, gv_v3(0.2, 0.12, 0.04), gv_v3(0, 0, 1), 1.0, 0.8);
  lab_run(&l);
  gv_engine_set_object(l.engine, box, l.object[box].T_world_body, gv_v3(0, 0, 0), gv_v3(0.05, 8.0, 0.05));
  const gv_vec3 before = angular_momentum(&l, box);
  const double energy = gv_engine_energy(l.engine);
  double most_turn_rad = 0.0;
  double least_up = 1.0;
  for (int i = 0; i < 3000; i++) {
    lab_steps(&l, 1, NULL);
    const gv_vec3 now = angular_momentum(&l, box);
    const gv_vec3 up = gv_rotate(gv_engine_object_pose(l.engine, box).q, gv_v3(0, 1, 0));
    most_turn_rad = fmax(most_turn_rad, gv_norm(gv_cross(now, before)) / (gv_norm(now) * gv_norm(before)));
    least_up = fmin(least_up, up.y);
  }
  CHECK(least_up < -0.9, "the box did not tumble: %g", least_up);
  CHECK(most_turn_rad < 0.03, "its momentum turned by %g rad", most_turn_rad);
  CHECK(gv_engine_energy(l.engine) < energy * 1.001, "energy from %g to %g J", energy,
        gv_engine_energy(l.engine));
  gv_engine_close(l.engine);
}

static void test_what_spins_on_the_spot_is_not_at_rest(void) {
  lab l;
  lab_start(&l);
  l.scene.gravity_m_s2 = gv_v3(0, 0, 0);
  l.cfg.rest_s = 0.1;
  const int box = lab_box(&l, gv_v3(0.1, 0.1, 0.1), gv_v3(0, 0, 1), 0.2, 0.8);
  lab_run(&l);
  gv_engine_set_object(l.engine, box, l.object[box].T_world_body, gv_v3(0, 0, 0), gv_v3(0, 0, 0.5));
  lab_steps(&l, 1000, NULL);
  const gv_vec3 turned = gv_quat_log(gv_engine_object_pose(l.engine, box).q);
  CHECK_NEAR(turned.z, 0.5, 1e-6);
  gv_engine_close(l.engine);
}

// A gap within the margin is a contact already. It closes within the step that would close it, and no deeper.
static void test_a_gap_closes_and_is_not_overshot(void) {
  lab l;
  lab_start(&l);
  l.cfg.rest_s = 0;
  const double gap_m = 0.5 * l.cfg.contact_margin_m;
  lab_box(&l, gv_v3(1, 1, 0.2), gv_v3(0, 0, -0.1), 0, 0.8);
  const int box = lab_box(&l, gv_v3(0.1, 0.1, 0.1), gv_v3(0, 0, 0.05 + gap_m), 0.2, 0.8);
  lab_run(&l);
  gv_engine_set_object(l.engine, box, l.object[box].T_world_body, gv_v3(0, 0, -1), gv_v3(0, 0, 0));
  double deepest_m = 0.0;
  for (int i = 0; i < 50; i++) {
    lab_steps(&l, 1, NULL);
    deepest_m = fmax(deepest_m, 0.05 - gv_engine_object_pose(l.engine, box).p.z);
  }
  const double left_m = gv_engine_object_pose(l.engine, box).p.z - 0.05;
  CHECK(fabs(left_m) < 0.05 * gap_m, "%g m of %g m are left", left_m, gap_m);
  CHECK(deepest_m < 0.2 * gap_m, "%g m deep", deepest_m);
  gv_engine_close(l.engine);
}

// newton takes part in a step only where that fits into its share: with next to none QuickStep does them all.
static void test_less_effort_leaves_less_to_newton(void) {
  lab l;
  lab_start(&l);
  l.cfg.rest_s = 0;
  lab_box(&l, gv_v3(1, 1, 0.2), gv_v3(0, 0, -0.1), 0, 0.8);
  lab_box(&l, gv_v3(0.1, 0.1, 0.1), gv_v3(0, 0, 0.05), 0.2, 0.8);
  lab_run(&l);
  const gv_counters *c = gv_engine_counters(l.engine);
  gv_engine_set_effort(l.engine, (gv_effort){1e-6, GV_MAX_CONTACTS});
  lab_steps(&l, 100, NULL);
  CHECK(c->newton_steps == 0 && c->quickstep_steps == 100, "newton did %llu, quickstep %llu",
        (unsigned long long)c->newton_steps, (unsigned long long)c->quickstep_steps);
  gv_engine_set_effort(l.engine, (gv_effort){1.0, GV_MAX_CONTACTS});
  lab_steps(&l, 100, NULL);
  CHECK(c->newton_steps == 100, "with all of its share newton does every step: %llu",
        (unsigned long long)c->newton_steps);
  gv_engine_close(l.engine);
}

// Where a body will be goes by what pulls it: boxes of the broad phase grow by that.
static void test_a_prediction_falls(void) {
  lab l;
  lab_start(&l);
  const int box = lab_box(&l, gv_v3(0.1, 0.1, 0.1), gv_v3(0, 0, 1), 0.2, 0.8);
  lab_run(&l);
  gv_body_state ahead;
  gv_dynamics_add_force(l.engine->dyn, body_of(box), gv_v3(1, 0, 0), gv_v3(0, 0, 0));
  gv_dynamics_predict(l.engine->dyn, body_of(box), &ahead);
  lab_steps(&l, 1, NULL);
  gv_vec3 v, w;
  gv_engine_object_velocity(l.engine, box, &v, &w);
  CHECK(v.z < 0 && v.x > 0, "it falls and is pushed");
  CHECK(gv_norm(gv_sub(ahead.v, v)) < 1e-12, "foreseen (%g, %g, %g) m/s, came to (%g, %g, %g)", ahead.v.x,
        ahead.v.y, ahead.v.z, v.x, v.y, v.z);
  gv_engine_close(l.engine);
}

// What is no number is no contact: it takes no part, and no force is told of it.
static void test_a_contact_that_is_left_out_has_no_force(void) {
  lab l;
  lab_start(&l);
  const int table = lab_box(&l, gv_v3(1, 1, 0.2), gv_v3(0, 0, -0.1), 0, 0.8);
  const int box = lab_box(&l, gv_v3(0.1, 0.1, 0.1), gv_v3(0, 0, 0.05), 0.2, 0.8);
  lab_run(&l);
  gv_dynamics_contact contact[2];
  for (int i = 0; i < 2; i++)
    contact[i] = (gv_dynamics_contact){.body_a = body_of(box),
                                       .body_b = body_of(table),
                                       .normal = {0, 0, 1},
                                       .friction_dir = {1, 0, 0},
                                       .depth = i == 0 ? NAN : 1e-4,
                                       .mu = 0.8,
                                       .friction = GV_FRICTION_COULOMB};
  gv_vec3 force[2] = {{7, 7, 7}, {7, 7, 7}};
  gv_dynamics_step(l.engine->dyn, contact, 2, force);
  CHECK(gv_norm(force[0]) == 0.0, "%g N of a contact that is none", gv_norm(force[0]));
  CHECK(force[1].z > 1.0, "%g N of the other", force[1].z);
  gv_engine_close(l.engine);
}

int main(void) {
  RUN(test_spin_without_torque_keeps_its_momentum);
  RUN(test_what_spins_on_the_spot_is_not_at_rest);
  RUN(test_a_gap_closes_and_is_not_overshot);
  RUN(test_less_effort_leaves_less_to_newton);
  RUN(test_a_prediction_falls);
  RUN(test_a_contact_that_is_left_out_has_no_force);
  return check_done();
}
