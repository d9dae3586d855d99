// SPDX-License-Identifier: BSD-3-Clause
// The engine's physics against what is known: free fall, weight, Coulomb's limit, Newton's third law, Hooke's
// law at rest, the second law of thermodynamics.
#include "engine/engine_state.h"
#include "support/check.h"
#include "support/lab.h"

#define G 9.81

static void test_free_fall(void) {
  lab l;
  lab_start(&l);
  int box = lab_box(&l, gv_v3(0.1, 0.1, 0.1), gv_v3(0, 0, 5), 0.2, 0.8);
  lab_run(&l);
  const int n = 800;
  lab_steps(&l, n, NULL);
  const double h = l.cfg.step_s;
  gv_vec3 v, w;
  gv_engine_object_velocity(l.engine, box, &v, &w);
  CHECK_NEAR(v.z, -G * n * h, 1e-11);
  // semi-implicit Euler, exactly
  CHECK_NEAR(gv_engine_object_pose(l.engine, box).p.z, 5 - G * h * h * n * (n + 1) / 2, 1e-11);
  gv_engine_close(l.engine);
}

static gv_vec3 force_on_object(const lab *l, int object) {
  int count;
  const gv_contact *c = gv_engine_contacts(l->engine, &count);
  gv_vec3 sum = gv_v3(0, 0, 0);
  for (int i = 0; i < count; i++) {
    if (c[i].object == object)
      sum = gv_sub(sum, c[i].force_world);
    if (c[i].limb == -1 - object)
      sum = gv_add(sum, c[i].force_world);
  }
  return sum;
}

static void test_weight_on_the_table(void) {
  lab l;
  lab_start(&l);
  l.cfg.rest_s = 0;  // an object at rest has no contacts
  lab_box(&l, gv_v3(1, 1, 0.04), gv_v3(0, 0, -0.02), 0, 0.8);
  int box = lab_box(&l, gv_v3(0.06, 0.05, 0.08), gv_v3(0, 0, 0.05), 0.2, 0.8);
  lab_run(&l);
  lab_steps(&l, 2000, NULL);
  int count;
  gv_engine_contacts(l.engine, &count);
  gv_pose T = gv_engine_object_pose(l.engine, box);
  CHECK(count == 4, "a box stands on %d points", count);
  CHECK_NEAR(force_on_object(&l, box).z, 0.2 * G, 1e-6);
  CHECK(fabs(T.p.z - 0.04) < 2e-5, "sunk %g m", 0.04 - T.p.z);
  CHECK(gv_engine_counters(l.engine)->depth_max_m < 1e-4, "deepest %g m while landing",
        gv_engine_counters(l.engine)->depth_max_m);
  CHECK(fabs(T.p.x) < 1e-6 && fabs(T.p.y) < 1e-6, "drifted %g %g", T.p.x, T.p.y);
  gv_engine_close(l.engine);
}

// A contact's force at rest is its spring's, k times depth, whatever the load: a box sinks
// by m g / 4 k at its four corners and stays there. A contact that could push with 250 N at
// most let 110 kg through the table.
static void test_any_load_sinks_by_its_springs(void) {
  static const double mass_kg[] = {1, 100, 110, 1000, 5000};
  for (int i = 0; i < (int)(sizeof mass_kg / sizeof *mass_kg); i++) {
    lab l;
    lab_start(&l);
    l.cfg.rest_s = 0;
    lab_box(&l, gv_v3(2, 2, 0.4), gv_v3(0, 0, -0.2), 0, 0.8);
    const double k = l.cfg.contact_erp / (l.cfg.contact_cfm * l.cfg.step_s);
    const double sinks = mass_kg[i] * G / (4 * k);
    const int box = lab_box(&l, gv_v3(0.5, 0.4, 0.6), gv_v3(0, 0, 0.3 - 0.5 * sinks), mass_kg[i], 0.8);
    lab_run(&l);
    lab_steps(&l, 3000, NULL);
    const gv_pose T = gv_engine_object_pose(l.engine, box);
    gv_vec3 v, w;
    gv_engine_object_velocity(l.engine, box, &v, &w);
    CHECK(fabs(0.3 - T.p.z - sinks) < 1e-3 * sinks + 1e-7, "%g kg: sunk %g m, its springs %g", mass_kg[i],
          0.3 - T.p.z, sinks);
    CHECK_NEAR(force_on_object(&l, box).z, mass_kg[i] * G, 1e-3 * mass_kg[i] * G);
    CHECK(gv_norm(v) + gv_norm(w) < 1e-5 && fabs(T.p.x) + fabs(T.p.y) < 1e-5, "%g kg: does not stay",
          mass_kg[i]);
    gv_engine_close(l.engine);
  }
}

// However deep it starts, a body comes out at 0.25 m/s and no faster.
static void test_deep_body_is_let_out_gently(void) {
  lab l;
  lab_start(&l);
  l.cfg.rest_s = 0;
  l.scene.gravity_m_s2 = gv_v3(0, 0, -1e-3);
  lab_box(&l, gv_v3(2, 2, 0.4), gv_v3(0, 0, -0.2), 0, 0.8);
  const int box = lab_box(&l, gv_v3(0.1, 0.1, 0.2), gv_v3(0, 0, 0.1 - 0.03), 0.2, 0.8);
  lab_run(&l);
  double fastest = 0;
  for (int i = 0; i < 1000; i++) {
    gv_vec3 v, w;
    lab_steps(&l, 1, NULL);
    gv_engine_object_velocity(l.engine, box, &v, &w);
    fastest = fmax(fastest, gv_norm(v));
  }
  CHECK(fastest > 0.2 && fastest < 0.2501, "came out at %g m/s", fastest);
  CHECK(gv_engine_object_pose(l.engine, box).p.z > 0.0999, "at %g m",
        gv_engine_object_pose(l.engine, box).p.z);
  gv_engine_close(l.engine);
}

// Gravity is tilted instead of the table. Returns the speed along the slope after one second.
static double slope_speed(double mu, double tangent, double direction_rad) {
  lab l;
  lab_start(&l);
  double c = 1.0 / sqrt(1.0 + tangent * tangent);
  double s = tangent * c;
  l.scene.gravity_m_s2 = gv_v3(G * s * cos(direction_rad), G * s * sin(direction_rad), -G * c);
  lab_box(&l, gv_v3(20, 20, 0.04), gv_v3(0, 0, -0.02), 0, mu);
  int box = lab_box(&l, gv_v3(0.2, 0.2, 0.05), gv_v3(0, 0, 0.025), 1.0, mu);
  lab_run(&l);
  lab_steps(&l, 1000, NULL);
  gv_vec3 v, w;
  gv_engine_object_velocity(l.engine, box, &v, &w);
  gv_engine_close(l.engine);
  return v.x * cos(direction_rad) + v.y * sin(direction_rad);
}

static void test_coulomb_limit_from_both_sides(void) {
  for (int i = 0; i < 4; i++) {
    double direction = 0.3 + 0.7 * i;
    double mu = 0.5;
    double steep = 0.55;
    double flat = 0.45;
    CHECK_NEAR(slope_speed(mu, flat, direction), 0.0, 1e-5);
    double expected = G * (steep - mu) / sqrt(1 + steep * steep) * 1.0;  // a = g (sin - mu cos)
    CHECK_NEAR(slope_speed(mu, steep, direction), expected, 0.02 * expected);
  }
}

// A hand over a table: palm down, all fingers straight, wrist at the given height.
static const double straight[GV_SENSORS];
static gv_pose wrist_at(double x, double y, double z) { return (gv_pose){{1, 0, 0, 0}, {x, y, z}}; }

static void test_coupling_at_rest_is_k_times_deviation(void) {
  lab l;
  lab_start(&l);
  l.cfg.filter_hz = 0;
  l.cfg.gate_m_s = l.cfg.gate_rad_s = 0;
  lab_box(&l, gv_v3(1, 1, 0.04), gv_v3(0, 0, -0.02), 0, 0.8);
  lab_run(&l);
  for (int i = 0; i <= 500; i++) {
    gv_sample lower = lab_hand(&l, straight, wrist_at(0, 0, 0.004 + 0.0004 * (500 - i)));
    lab_steps(&l, i == 500 ? 3000 : 1, &lower);
  }
  // the middle finger's proximal limb (radius 9.5 mm) wants 5.5 mm into the table
  gv_vec3 f, t;
  int limb = GV_LIMB_MIDDLE;
  gv_engine_coupling(l.engine, limb, &f, &t);
  gv_vec3 x_d = gv_sub(gv_engine_driver_pose(l.engine, limb).p, gv_engine_limb_pose(l.engine, limb).p);
  CHECK_NEAR(f.z, -l.cfg.limb.k_f * 0.0055, 2e-3);
  CHECK_NEAR(gv_norm(gv_sub(f, gv_scale(x_d, l.cfg.limb.k_f))), 0.0, 1e-6);
  int count;
  const gv_contact *c = gv_engine_contacts(l.engine, &count);
  double up = 0;
  for (int i = 0; i < count; i++)
    if (c[i].limb == limb)
      up += c[i].force_world.z;
  CHECK_NEAR(up, -f.z, 1e-6);  // what the table gives is what the spring takes
  CHECK(gv_engine_counters(l.engine)->depth_max_m < 1e-4, "deepest %g m",
        gv_engine_counters(l.engine)->depth_max_m);
  gv_engine_close(l.engine);
}

// What the person feels is what the step did to the limb: m (v' - v) / h, for a hand
// that accelerates through the air.
static void test_the_force_felt_is_what_moved_the_limb(void) {
  lab l;
  lab_start(&l);
  lab_run(&l);
  double worst = 0;
  double largest = 0;
  for (int step = 0; step < 300; step++) {
    gv_sample s = lab_hand(&l, straight, wrist_at(2e-6 * step * step, 0, 0.3));
    gv_vec3 before[GV_LIMBS], w;
    for (int i = 0; i < GV_LIMBS; i++)
      gv_engine_limb_velocity(l.engine, i, &before[i], &w);
    lab_steps(&l, 1, &s);
    for (int i = 0; step > 0 && i < GV_LIMBS; i++) {
      gv_vec3 after, f, t;
      gv_engine_limb_velocity(l.engine, i, &after, &w);
      gv_engine_coupling(l.engine, i, &f, &t);
      double mass = i == GV_LIMB_PALM ? l.cfg.palm_mass_kg : l.cfg.limb_mass_kg;
      gv_vec3 momentum = gv_scale(gv_sub(after, before[i]), mass / l.cfg.step_s);
      worst = fmax(worst, gv_norm(gv_sub(momentum, f)));
      largest = fmax(largest, gv_norm(f));
    }
  }
  CHECK(worst < 1e-9, "felt and applied differ by %g N", worst);
  CHECK(largest > 0.01, "at most %g N: nothing was tested", largest);
  gv_engine_close(l.engine);
}

// A box that finds itself 10 mm inside the table is let out slowly.
static void test_deep_inside_is_let_out_gently(void) {
  lab l;
  lab_start(&l);
  lab_box(&l, gv_v3(1, 1, 0.04), gv_v3(0, 0, -0.02), 0, 0.8);
  int box = lab_box(&l, gv_v3(0.06, 0.06, 0.08), gv_v3(0, 0, 0.03), 0.2, 0.8);
  lab_run(&l);
  double fastest = 0;
  for (int step = 0; step < 500; step++) {
    gv_vec3 v, w;
    lab_steps(&l, 1, NULL);
    gv_engine_object_velocity(l.engine, box, &v, &w);
    fastest = fmax(fastest, gv_norm(v));
  }
  CHECK(fastest > 0.1 && fastest < 0.26, "it leaves at %g m/s", fastest);
  CHECK_NEAR(gv_engine_object_pose(l.engine, box).p.z, 0.04, 1e-4);
  gv_engine_close(l.engine);
}

static void test_action_equals_reaction(void) {
  lab l;
  lab_start(&l);
  l.cfg.rest_s = 0;
  l.scene.gravity_m_s2 = gv_v3(0, 0, -G);
  lab_box(&l, gv_v3(1, 1, 0.04), gv_v3(0, 0, -0.02), 0, 0.8);
  int box = lab_box(&l, gv_v3(0.06, 0.06, 0.08), gv_v3(0.20, 0, 0.04), 0.2, 0.8);
  lab_run(&l);
  int touched = 0;
  for (int step = 0; step < 700; step++) {  // the fingertips push the box along the table
    gv_sample s = lab_hand(&l, straight, wrist_at(-0.07 + 0.0003 * step, 0, 0.03));
    gv_vec3 before, after, w;
    gv_engine_object_velocity(l.engine, box, &before, &w);
    lab_steps(&l, 1, &s);
    gv_engine_object_velocity(l.engine, box, &after, &w);
    gv_vec3 momentum = gv_scale(gv_sub(after, before), 0.2 / l.cfg.step_s);
    gv_vec3 force = gv_add(force_on_object(&l, box), gv_v3(0, 0, -0.2 * G));
    CHECK(gv_norm(gv_sub(momentum, force)) < 1e-5, "step %d: momentum and contact forces differ by %g N",
          step, gv_norm(gv_sub(momentum, force)));
    int count;
    const gv_contact *c = gv_engine_contacts(l.engine, &count);
    for (int i = 0; i < count; i++)
      touched += c[i].limb >= 0 && c[i].object == box && c[i].force_world.x < -1e-3;
  }
  CHECK(touched > 100, "the fingers pushed the box in %d contacts", touched);
  CHECK(gv_engine_object_pose(l.engine, box).p.x > 0.24, "the box moved to %g",
        gv_engine_object_pose(l.engine, box).p.x);
  gv_engine_close(l.engine);
}

// What the contacts' springs hold, k d^2 / 2 each.
static double contact_energy(const lab *l) {
  int count;
  const gv_contact *c = gv_engine_contacts(l->engine, &count);
  double k = l->cfg.contact_erp / (l->cfg.contact_cfm * l->cfg.step_s);
  double sum = 0;
  for (int i = 0; i < count; i++)
    sum += 0.5 * k * pow(fmax(0, c[i].depth_m), 2);
  return sum;
}

static void test_energy_is_never_created(void) {
  for (int trial = 0; trial < 6; trial++) {
    lab l;
    lab_start(&l);
    bool weightless = trial == 0;
    if (weightless)
      l.scene.gravity_m_s2 = gv_v3(0, 0, 0);
    lab_box(&l, gv_v3(4, 4, 0.04), gv_v3(0, 0, -0.02), 0, 0.4);
    int box = lab_box(&l, gv_v3(0.06, 0.10, 0.16), gv_v3(0, 0, 0.5), 0.3, 0.4);
    lab_run(&l);
    gv_pose T = {gv_quat_exp(gv_v3(0.5 * trial, 0.3, -0.2 * trial)), {0, 0, 0.4}};
    gv_engine_set_object(l.engine, box, T, gv_v3(0.4, -0.2, weightless ? 0 : -1), gv_v3(3, 8 - trial, -2));
    double bodies = gv_engine_energy(l.engine);
    double start = bodies;
    double last = bodies;
    double rise = 0;
    for (int i = 0; i < 1500; i++) {
      lab_steps(&l, 1, NULL);  // its contacts belong to the state before it
      double now = bodies + contact_energy(&l);
      rise = fmax(rise, now - last);
      last = now;
      bodies = gv_engine_energy(l.engine);
    }
    CHECK(rise < 2e-5 * start, "trial %d: one step gained %g of %g J", trial, rise, start);
    CHECK(last <= start, "trial %d: %g J became %g J", trial, start, last);
    gv_engine_close(l.engine);
  }
}

static void test_free_limbs_follow_without_overshoot(void) {
  lab l;
  lab_start(&l);
  l.cfg.filter_hz = 0;
  l.cfg.gate_m_s = 0;
  lab_run(&l);
  gv_sample a = lab_hand(&l, straight, wrist_at(0, 0, 0.3));
  gv_sample b = lab_hand(&l, straight, wrist_at(0.01, 0, 0.3));
  lab_steps(&l, 5, &a);
  double goal = gv_engine_limb_pose(l.engine, 4).p.x + 0.01;
  double over = 0;
  lab_steps(&l, 1, &b);
  int settled = 0;
  for (int i = 0; i < 300; i++) {
    lab_steps(&l, 1, &b);
    double left = goal - gv_engine_limb_pose(l.engine, 4).p.x;
    over = fmax(over, -left);
    if (fabs(left) > 2e-4)
      settled = i;
  }
  // The jump's one-step driver velocity pushes ahead; a critically damped limb then comes to rest at once.
  CHECK(settled < 60, "settles in %d ms", settled);
  CHECK(over < 0.002, "overshoots by %g m", over);
  gv_engine_close(l.engine);
}

static void test_bad_samples_are_held_back(void) {
  lab l;
  lab_start(&l);
  lab_run(&l);
  gv_sample good = lab_hand(&l, straight, wrist_at(0, 0, 0.3));
  gv_sample bad = good;
  lab_steps(&l, 20, &good);
  bad.raw[3] = NAN;
  bad.T_world_receiver.p.x = INFINITY;
  lab_steps(&l, 20, &bad);
  gv_sample jump = lab_hand(&l, straight, wrist_at(0.5, 0, 0.3));
  lab_steps(&l, 1, &jump);
  lab_steps(&l, 20, &good);
  CHECK(gv_engine_counters(l.engine)->samples_refused == 41, "%llu refused",
        (unsigned long long)gv_engine_counters(l.engine)->samples_refused);
  CHECK_NEAR(gv_engine_limb_pose(l.engine, GV_LIMB_PALM).p.x, l.cfg.hand.palm_center_m.x, 1e-6);
  gv_engine_close(l.engine);
}

static void test_more_contacts_than_fit(void) {
  lab l;
  lab_start(&l);
  l.cfg.operations_per_s = 1e10;  // every pair is asked
  lab_box(&l, gv_v3(4, 4, 0.04), gv_v3(0, 0, -0.02), 0, 0.8);
  for (int i = 0; i < 60; i++) {  // they touch each other too; the last ten begin 0.2 mm deep
    double z = i < 50 ? 0.03 : 0.0298;
    lab_box(&l, gv_v3(0.06, 0.06, 0.06), gv_v3(0.0602 * (i % 10) - 0.3, 0.0602 * (i / 10) - 0.2, z), 0.2,
            0.8);
  }
  lab_run(&l);
  lab_steps(&l, 1, NULL);
  int count, deep = 0;
  const gv_contact *contact = gv_engine_contacts(l.engine, &count);
  for (int i = 0; i < count; i++)
    deep += contact[i].depth_m > 1e-4;
  CHECK(count == GV_MAX_CONTACTS && deep == 40,
        "of %d contacts %d are deep; the shallowest are to be left out", count, deep);
  lab_steps(&l, 200, NULL);
  const gv_counters *c = gv_engine_counters(l.engine);
  CHECK(c->contacts_max == GV_MAX_CONTACTS && c->contacts_dropped > 0, "max %u dropped %llu", c->contacts_max,
        (unsigned long long)c->contacts_dropped);
  CHECK(c->body_resets == 0, "nothing blew up");
  gv_engine_close(l.engine);
}

// Boxes inside each other, heavy on light, with friction that does not depend on the load:
// Dantzig's solver meets a pivot of zero in some of these, and ODE would end the process. Counted,
// and the step is done by QuickStep.
static void test_a_solver_that_gives_up(void) {
  static const double mass_kg[] = {1e-4, 0.2, 1e3};
  static const double edge_m[] = {0.001, 0.06, 2.0};
  unsigned long long random = 7;
  unsigned long long given_up = 0;
  for (int pile = 0; pile < 60; pile++) {
    lab l;
    lab_start(&l);
    l.cfg = gv_config_paper();
    l.cfg.override_mass_kg = 0.0;
    l.cfg.solver = GV_SOLVER_DANTZIG;
    l.cfg.period_s = 0.02;  // it always fits
    for (int i = 0; i < 7; i++) {
      double v[9];
      for (int k = 0; k < 9; k++)
        v[k] = check_uniform(&random, 0.0, 1.0);
      gv_vec3 size = gv_v3(edge_m[(int)(3 * v[0])], edge_m[(int)(3 * v[1])], edge_m[(int)(3 * v[2])]);
      int box = lab_box(&l, size, gv_v3(0.2 * v[3] - 0.1, 0.2 * v[4] - 0.1, 0.2 * v[5]),
                        mass_kg[(int)(3 * v[6])], 0.8);
      l.object[box].T_world_body.q = gv_quat_exp(gv_v3(3 * v[7], 3 * v[8], 1));
    }
    lab_run(&l);
    for (int step = 0; step < 20; step++) {
      lab_steps(&l, 1, NULL);
      for (int i = 0; i < 7; i++)
        CHECK(gv_pose_finite(gv_engine_object_pose(l.engine, i)), "pile %d, step %d, box %d", pile, step, i);
    }
    given_up += gv_engine_counters(l.engine)->quickstep_steps;
    CHECK(gv_engine_counters(l.engine)->solver_errors >= gv_engine_counters(l.engine)->quickstep_steps,
          "given up, but not counted");
    gv_engine_close(l.engine);
  }
  CHECK(given_up > 0, "these piles are too easy: nothing was tested");
}

// A tower of two boxes comes to rest and costs nothing; pushed, touched, or robbed of what it stands on,
// it moves as if it had never rested.
static void test_objects_at_rest(void) {
  lab l;
  lab_start(&l);
  lab_box(&l, gv_v3(1, 1, 0.04), gv_v3(0, 0, -0.02), 0, 0.8);
  int low = lab_box(&l, gv_v3(0.06, 0.06, 0.06), gv_v3(0, 0, 0.0305), 0.2, 0.8);
  int high = lab_box(&l, gv_v3(0.04, 0.04, 0.04), gv_v3(0, 0, 0.081), 0.1, 0.8);
  int far = lab_box(&l, gv_v3(0.04, 0.04, 0.04), gv_v3(0.3, 0, 0.02), 0.1, 0.8);
  lab_run(&l);
  lab_steps(&l, 2000, NULL);
  int count;
  gv_engine_contacts(l.engine, &count);
  gv_pose stood = gv_engine_object_pose(l.engine, high);
  gv_pose alone = gv_engine_object_pose(l.engine, far);
  CHECK(count == 0, "%d contacts of objects at rest", count);
  CHECK(fabs(stood.p.z - 0.08) < 2e-5, "the tower stands at %g", stood.p.z);
  gv_engine_set_object(l.engine, low, (gv_pose){{1, 0, 0, 0}, {0, 0.2, 0.0305}}, gv_v3(0, 0, 0),
                       gv_v3(0, 0, 0));
  lab_steps(&l, 100, NULL);
  double fallen = stood.p.z - gv_engine_object_pose(l.engine, high).p.z;
  CHECK_NEAR(fallen, 0.5 * G * 0.1 * 0.1, 0.001);
  lab_steps(&l, 2000, NULL);
  gv_engine_push_object(l.engine, low, gv_v3(0, 40, 0), gv_v3(0, 0, 0));  // a kick of 0.2 m/s
  lab_steps(&l, 50, NULL);
  CHECK(gv_engine_object_pose(l.engine, low).p.y > 0.201, "kicked to %g",
        gv_engine_object_pose(l.engine, low).p.y);
  gv_pose now = gv_engine_object_pose(l.engine, far);
  CHECK(gv_norm(gv_sub(now.p, alone.p)) < 1e-9, "the third moved by %g", gv_norm(gv_sub(now.p, alone.p)));
  gv_engine_close(l.engine);
}

// A support that slides away: what rests on it wakes and falls.
static void test_support_pulled_away(void) {
  lab l;
  lab_start(&l);
  lab_box(&l, gv_v3(1, 1, 0.04), gv_v3(0, 0, -0.02), 0, 0.1);
  int low = lab_box(&l, gv_v3(0.06, 0.06, 0.06), gv_v3(0, 0, 0.0305), 0.2, 0.1);
  int high = lab_box(&l, gv_v3(0.04, 0.04, 0.04), gv_v3(0, 0, 0.081), 0.1, 0.1);
  lab_run(&l);
  lab_steps(&l, 2000, NULL);
  for (int i = 0; i < 300; i++) {
    gv_engine_push_object(l.engine, low, gv_v3(4, 0, 0), gv_v3(0, 0, 0));
    lab_steps(&l, 1, NULL);
  }
  lab_steps(&l, 500, NULL);
  CHECK(gv_engine_object_pose(l.engine, high).p.z < 0.021, "hangs in the air at %g",
        gv_engine_object_pose(l.engine, high).p.z);
  gv_engine_close(l.engine);
}

static void test_what_runs_away_is_put_back(void) {
  static const struct {
    gv_vec3 p, v, w;
  } away[] = {{{99.9, 0, 5}, {200, 0, 0}, {0, 0, 0}},
              {{0, 0, 5}, {0, 0, 501}, {0, 0, 0}},
              {{0, 0, 5}, {0, 0, 0}, {2e5, 0, 0}}};
  for (int i = 0; i < 3; i++) {
    lab l;
    lab_start(&l);
    int box = lab_box(&l, gv_v3(0.1, 0.1, 0.1), gv_v3(0, 0, 5), 0.2, 0.8);
    lab_run(&l);
    gv_engine_set_object(l.engine, box, (gv_pose){gv_quat_identity(), away[i].p}, away[i].v, away[i].w);
    lab_steps(&l, 1, NULL);
    CHECK(gv_engine_counters(l.engine)->body_resets == 1, "case %d: %d resets", i,
          (int)gv_engine_counters(l.engine)->body_resets);
    CHECK_NEAR(gv_norm(gv_sub(gv_engine_object_pose(l.engine, box).p, gv_v3(0, 0, 5))), 0, 1e-12);
    gv_engine_close(l.engine);
  }
}

// Without any coupling nothing but the rule brings a limb back: to its driver, at rest.
static void test_limb_that_runs_away_is_put_back(void) {
  static const struct {
    gv_vec3 p, v, w;
    int resets;
  } away[] = {{{101, 0, 0}, {0, 0, 0}, {0, 0, 0}, 1},   {{99, 0, 0}, {0, 0, 0}, {0, 0, 0}, 0},
              {{0, 0, 1}, {0, 501, 0}, {0, 0, 0}, 1},   {{0, 0, 1}, {0, 499, 0}, {0, 0, 0}, 0},
              {{0, 0, 1}, {0, 0, 0}, {0, 1.1e5, 0}, 1}, {{0, 0, 1}, {0, 0, 0}, {0, 0.9e5, 0}, 0}};
  static const double flat[GV_SENSORS];
  for (size_t i = 0; i < sizeof away / sizeof *away; i++) {
    lab l;
    lab_start(&l);
    l.cfg.limb = (gv_coupling){0, 0, 0, 0};
    lab_run(&l);
    const gv_sample hand = lab_hand(&l, flat, gv_pose_identity());
    lab_steps(&l, 5, &hand);
    const int limb = GV_LIMB_INDEX + 1;
    const gv_body_state state = {.T = {gv_quat_identity(), away[i].p}, .v = away[i].v, .w = away[i].w};
    gv_dynamics_set_state(l.engine->dyn, limb, &state);
    lab_steps(&l, 1, NULL);
    CHECK((int)gv_engine_counters(l.engine)->body_resets == away[i].resets, "case %zu: %d resets", i,
          (int)gv_engine_counters(l.engine)->body_resets);
    if (away[i].resets) {
      gv_vec3 v, w;
      const gv_pose T = gv_engine_limb_pose(l.engine, limb);
      const gv_pose T_driver = gv_engine_driver_pose(l.engine, limb);
      gv_engine_limb_velocity(l.engine, limb, &v, &w);
      CHECK(gv_norm(gv_sub(T.p, T_driver.p)) == 0.0 && gv_norm(v) == 0.0 && gv_norm(w) == 0.0,
            "case %zu: at rest on its driver", i);
    }
    gv_engine_close(l.engine);
  }
}

static void test_arena_one_byte_too_small(void) {
  lab l;
  lab_start(&l);
  lab_box(&l, gv_v3(1, 1, 1), gv_v3(0, 0, 0), 1, 0.5);
  size_t size = gv_engine_size(&l.cfg, &l.scene);
  CHECK(size < sizeof lab_engine_memory, "asks for %zu", size);
  CHECK(gv_engine_init(lab_engine_memory, size / 2, &l.cfg, &l.scene) == NULL, "half the memory is refused");
  gv_engine *e = gv_engine_init(lab_engine_memory + 1, size, &l.cfg, &l.scene);
  CHECK(e != NULL, "the size asked for is enough at any alignment");
  size_t used, peak, given;
  gv_engine_memory(e, &used, &peak, &given);
  gv_engine_close(e);
  // Exactly what was used is enough, one byte less is not.
  CHECK(gv_engine_init(lab_engine_memory + 1, used - 1, &l.cfg, &l.scene) == NULL,
        "one byte less is refused");
  e = gv_engine_init(lab_engine_memory + 1, used, &l.cfg, &l.scene);
  CHECK(e != NULL, "exactly enough");
  gv_engine_close(e);
}

static void test_same_bits_twice(void) {
  unsigned long long hash[4];
  for (int run = 0; run < 4; run++) {
    lab l;
    lab_start(&l);
    // QuickStep shuffles its rows by random numbers
    l.cfg.solver = run < 2 ? GV_SOLVER_DANTZIG : GV_SOLVER_QUICKSTEP;
    lab_box(&l, gv_v3(1, 1, 0.04), gv_v3(0, 0, -0.02), 0, 0.8);
    lab_box(&l, gv_v3(0.06, 0.06, 0.08), gv_v3(0.18, 0, 0.05), 0.2, 0.8);
    lab_run(&l);
    for (int i = 0; i < 500; i++) {
      gv_sample s = lab_hand(&l, straight, wrist_at(-0.03 + 0.0002 * i, 0, 0.03));
      lab_steps(&l, 1, &s);
    }
    hash[run] = gv_engine_hash(l.engine);
    gv_engine_close(l.engine);
  }
  CHECK(hash[0] == hash[1] && hash[2] == hash[3], "%llx %llx, QuickStep %llx %llx", hash[0], hash[1], hash[2],
        hash[3]);
}

static void test_reset_is_a_fresh_start(void) {
  gv_pose box[2], tip[2];
  lab l;
  lab_start(&l);
  lab_box(&l, gv_v3(1, 1, 0.04), gv_v3(0, 0, -0.02), 0, 0.8);
  lab_box(&l, gv_v3(0.06, 0.06, 0.08), gv_v3(0.18, 0, 0.05), 0.2, 0.8);
  lab_run(&l);
  for (int life = 0; life < 2; life++) {
    for (int i = 0; i < 400; i++) {
      gv_sample s = lab_hand(&l, straight, wrist_at(-0.03 + 0.0002 * i, 0, 0.03));
      lab_steps(&l, 1, &s);
    }
    box[life] = gv_engine_object_pose(l.engine, 1);
    tip[life] = gv_engine_limb_pose(l.engine, GV_LIMB_MIDDLE + 2);
    gv_engine_reset(l.engine);
  }
  CHECK(box[0].p.x > 0.181, "the box was pushed");
  CHECK(!memcmp(&box[0], &box[1], sizeof *box) && !memcmp(&tip[0], &tip[1], sizeof *tip),
        "the second life differs");
  gv_engine_close(l.engine);
}

int main(void) {
  RUN(test_free_fall);
  RUN(test_weight_on_the_table);
  RUN(test_any_load_sinks_by_its_springs);
  RUN(test_deep_body_is_let_out_gently);
  RUN(test_coulomb_limit_from_both_sides);
  RUN(test_coupling_at_rest_is_k_times_deviation);
  RUN(test_the_force_felt_is_what_moved_the_limb);
  RUN(test_deep_inside_is_let_out_gently);
  RUN(test_action_equals_reaction);
  RUN(test_energy_is_never_created);
  RUN(test_free_limbs_follow_without_overshoot);
  RUN(test_bad_samples_are_held_back);
  RUN(test_more_contacts_than_fit);
  RUN(test_a_solver_that_gives_up);
  RUN(test_objects_at_rest);
  RUN(test_support_pulled_away);
  RUN(test_what_runs_away_is_put_back);
  RUN(test_limb_that_runs_away_is_put_back);
  RUN(test_arena_one_byte_too_small);
  RUN(test_same_bits_twice);
  RUN(test_reset_is_a_fresh_start);
  return check_done();
}
