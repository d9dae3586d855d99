// SPDX-License-Identifier: BSD-3-Clause
// Rotational coupling (Eqn 2 to 4) by its properties, against rotations built here: the torque turns the
// limb towards its driver and nowhere else, damping takes energy, both laws have the stiffness that they
// promise, and a person feels the opposite of what acts on the limb. And the bound of what a spring pulls
// with.
#include "hand/coupling.h"

#include <string.h>

#include "support/check.h"

static const double h = 0.001, inertia = 2e-6;

static gv_vec3 random_vector(unsigned long long *random, double size) {
  return gv_v3(check_uniform(random, -size, size), check_uniform(random, -size, size),
               check_uniform(random, -size, size));
}

static gv_vec3 random_axis(unsigned long long *random) {
  for (;;) {
    const gv_vec3 v = random_vector(random, 1.0);
    if (gv_norm(v) > 0.2 && gv_norm(v) < 1.0)
      return gv_scale(v, 1.0 / gv_norm(v));
  }
}

static gv_spring spring_of(gv_rotation_law law, double k_t, double d_t) {
  const gv_coupling coupling = {.k_f = 200.0, .d_f = -1.0, .k_t = k_t, .d_t = d_t};
  return gv_spring_make(&coupling, 0.01, inertia, h, law);
}

// Torque on one limb whose driver is turned by `angle` about `axis` (world) from it.
static gv_vec3 torque_on(const gv_spring *one, const gv_body_state *sim, const gv_body_state *driver) {
  gv_spring spring[GV_LIMBS];
  gv_body_state a[GV_LIMBS], b[GV_LIMBS];
  gv_vec3 f[GV_LIMBS], t[GV_LIMBS];
  for (int i = 0; i < GV_LIMBS; i++) {
    spring[i] = *one;
    a[i] = *sim;
    b[i] = *driver;
  }
  gv_springs_apply(spring, a, b, f, t);
  for (int i = 1; i < GV_LIMBS; i++)
    CHECK(gv_norm(gv_sub(t[i], t[0])) == 0.0, "limb %d differs", i);
  return t[0];
}

typedef struct turn {
  gv_body_state sim, driver;
  gv_vec3 axis;
  double angle;
} turn;

static turn random_turn(unsigned long long *random, double most) {
  turn out = {.axis = random_axis(random), .angle = check_uniform(random, 0.001, most)};
  out.sim.T = gv_pose_identity();
  out.sim.T.q = gv_quat_exp(random_vector(random, 1.5));
  out.driver = out.sim;
  out.driver.T.q = gv_quat_mul(gv_quat_axis_angle(out.axis, out.angle), out.sim.T.q);
  return out;
}

// Along the axis of the shortest turn, of the law's own length: k_t angle; 2 k_t sin(angle) (Eqn 3 and 4).
static void test_torque_turns_the_limb_towards_its_driver(void) {
  unsigned long long random = 3;
  for (int i = 0; i < 2000; i++) {
    const turn x = random_turn(&random, 3.1);
    const double k_t = check_uniform(&random, 0.01, 5.0);
    const gv_spring log_law = spring_of(GV_ROTATION_LOG, k_t, 0.0);
    const gv_spring paper = spring_of(GV_ROTATION_PAPER, k_t, 0.0);
    const gv_vec3 by_log = torque_on(&log_law, &x.sim, &x.driver);
    const gv_vec3 by_paper = torque_on(&paper, &x.sim, &x.driver);
    CHECK(gv_norm(gv_sub(by_log, gv_scale(x.axis, k_t * x.angle))) < 1e-9 * k_t, "log law at %g rad",
          x.angle);
    CHECK(gv_norm(gv_sub(by_paper, gv_scale(x.axis, 2.0 * k_t * sin(x.angle)))) < 1e-9 * k_t,
          "paper's law at %g rad", x.angle);
  }
}

static void test_no_turn_is_no_torque(void) {
  unsigned long long random = 4;
  for (int i = 0; i < 100; i++) {
    turn x = random_turn(&random, 1.0);
    x.driver = x.sim;
    x.driver.T.q = (gv_quat){-x.sim.T.q.w, -x.sim.T.q.x, -x.sim.T.q.y, -x.sim.T.q.z};  // the same rotation
    const gv_spring spring = spring_of(GV_ROTATION_LOG, 1.0, -1.0);
    CHECK(gv_norm(torque_on(&spring, &x.sim, &x.driver)) < 1e-9, "%g N m",
          gv_norm(torque_on(&spring, &x.sim, &x.driver)));
  }
}

// Only the difference of the spins counts, and it is slowed: (d_t + h k_t) of backward Euler.
static void test_damping_takes_energy(void) {
  unsigned long long random = 5;
  for (int i = 0; i < 500; i++) {
    turn x = random_turn(&random, 1.0);
    x.driver = x.sim;
    x.sim.w = random_vector(&random, 30.0);
    x.driver.w = random_vector(&random, 30.0);
    const double k_t = 0.48;
    const double d_t = check_uniform(&random, 0.0, 0.01);
    const gv_spring spring = spring_of(GV_ROTATION_LOG, k_t, d_t);
    const gv_vec3 relative = gv_sub(x.sim.w, x.driver.w);
    const gv_vec3 t = torque_on(&spring, &x.sim, &x.driver);
    CHECK(gv_norm(gv_sub(t, gv_scale(relative, -(d_t + h * k_t)))) < 1e-12, "damping %g", d_t);
  }
}

// The limb alone, with the augmented inertia: from any turn it comes to rest on its
// driver, and its energy only falls.
static void test_a_turned_limb_comes_to_rest_on_its_driver(void) {
  unsigned long long random = 6;
  for (int law = GV_ROTATION_LOG; law <= GV_ROTATION_PAPER; law++)
    for (int k = 0; k < 20; k++) {
      turn x = random_turn(&random, law == GV_ROTATION_PAPER ? 1.4 : 3.0);
      const gv_spring spring = spring_of((gv_rotation_law)law, 0.48, -1.0);
      double last = x.angle;
      for (int i = 0; i < 400; i++) {
        const gv_vec3 t = torque_on(&spring, &x.sim, &x.driver);
        x.sim.w = gv_mad(x.sim.w, h / (inertia + spring.added_inertia), t);
        x.sim.T.q = gv_quat_normalize(gv_quat_mul(gv_quat_exp(gv_scale(x.sim.w, h)), x.sim.T.q));
        const double angle = gv_norm(gv_quat_log(gv_quat_mul(x.driver.T.q, gv_quat_conj(x.sim.T.q))));
        CHECK(angle <= last + 1e-12, "it overshoots: %g rad after %g", angle, last);
        last = angle;
      }
      CHECK(last < 1e-3, "law %d: %g rad left of %g", law, last, x.angle);
    }
}

// Felt at the end of a step, with the driver where it moved on to: minus spring, minus
// damper, without the implicit part.
static void test_a_person_feels_the_opposite(void) {
  unsigned long long random = 7;
  for (int i = 0; i < 200; i++) {
    const turn x = random_turn(&random, 2.0);
    const gv_spring one = spring_of(GV_ROTATION_LOG, 0.48, 0.003);
    gv_spring spring[GV_LIMBS];
    gv_body_state sim[GV_LIMBS], driver[GV_LIMBS];
    gv_pose ahead[GV_LIMBS];
    gv_vec3 f[GV_LIMBS], t[GV_LIMBS];
    const gv_vec3 w_sim = random_vector(&random, 10.0);
    const gv_vec3 w_driver = random_vector(&random, 10.0);
    for (int l = 0; l < GV_LIMBS; l++) {
      spring[l] = one;
      sim[l] = x.sim;
      sim[l].w = w_sim;
      driver[l] = x.sim;  // where it was: must not count
      driver[l].w = w_driver;
      ahead[l] = x.driver.T;
    }
    gv_springs_feel(spring, sim, driver, ahead, f, t);
    const gv_vec3 expected = gv_mad(gv_scale(x.axis, -0.48 * x.angle), 0.003, gv_sub(w_sim, w_driver));
    CHECK(gv_norm(gv_sub(t[3], expected)) < 1e-9, "%g N m off", gv_norm(gv_sub(t[3], expected)));
  }
}

// ---- the bound ----------------------------------------------------------------------------------------

typedef struct hand {
  gv_spring spring[GV_LIMBS], acting[GV_LIMBS];
  gv_body_state sim[GV_LIMBS], driver[GV_LIMBS];
  gv_vec3 f[GV_LIMBS], t[GV_LIMBS];
} hand;

// Ten to the power of something between: settings and distances of all sizes.
static double any_size(unsigned long long *random, double least, double most) {
  return pow(10.0, check_uniform(random, log10(least), log10(most)));
}

static gv_spring any_spring(unsigned long long *random) {
  gv_coupling c = {any_size(random, 1.0, 1e6), any_size(random, 1e-3, 1e5), any_size(random, 1e-3, 1e4),
                   any_size(random, 1e-6, 1e3)};
  if (check_uniform(random, 0.0, 1.0) < 0.5)
    c.d_f = c.d_t = -1.0;
  return gv_spring_make(&c, any_size(random, 1e-4, 10.0), any_size(random, 1e-8, 1e-2), h, GV_ROTATION_LOG);
}

static void make_hand(hand *x, unsigned long long *random) {
  for (int i = 0; i < GV_LIMBS; i++) {
    x->spring[i] = x->acting[i] = any_spring(random);
    x->sim[i].T = x->driver[i].T = gv_pose_identity();
    x->driver[i].T.p = random_vector(random, any_size(random, 1e-9, 10.0));
    x->driver[i].T.q = gv_quat_exp(random_vector(random, any_size(random, 1e-9, 1.5)));
    x->driver[i].v = random_vector(random, any_size(random, 1e-9, 100.0));
    x->driver[i].w = random_vector(random, any_size(random, 1e-9, 1000.0));
    x->sim[i].v = random_vector(random, any_size(random, 1e-9, 100.0));
    x->sim[i].w = random_vector(random, any_size(random, 1e-9, 1000.0));
  }
  x->spring[GV_LIMB_PALM].most_n = GV_PALM_N;
  x->spring[GV_LIMB_PALM].most_n_m = GV_PALM_N_M;
}

// Of the pull before and after: the same direction, and by the share that the spring was softened.
static void check_share(gv_vec3 before, gv_vec3 after, double share, double most) {
  CHECK(gv_norm(after) <= most * (1.0 + 1e-12), "%.17g of %g", gv_norm(after), most);
  CHECK(gv_norm(gv_sub(after, gv_scale(before, share))) <= 1e-12 * gv_norm(before), "another direction");
  CHECK(share > 0.0 && share <= 1.0, "%g", share);
}

// From a nanometre to ten metres, at rest or in flight, with every coupling that there is.
static void test_no_pull_is_beyond_its_bound(void) {
  unsigned long long random = 8;
  int softened = 0;
  for (int i = 0; i < 3000; i++) {
    static hand x;
    gv_vec3 f[GV_LIMBS], t[GV_LIMBS];
    make_hand(&x, &random);
    const bool asked = gv_springs_apply(x.spring, x.sim, x.driver, f, t);
    memcpy(x.f, f, sizeof f);
    memcpy(x.t, t, sizeof t);
    const uint32_t softer = gv_springs_bound(x.spring, x.sim, x.f, x.t, x.acting);
    CHECK(asked || softer == 0, "gv_springs_apply missed one");
    for (int k = 0; k < GV_LIMBS; k++) {
      const gv_spring *s = &x.acting[k];
      const double of_f = s->k_f / x.spring[k].k_f;
      const double of_t = s->k_t / x.spring[k].k_t;
      softened += (softer >> k & 1) != 0;
      check_share(f[k], x.f[k], of_f, x.spring[k].most_n);
      check_share(t[k], x.t[k], of_t, x.spring[k].most_n_m);
      // stopped in this step, by what it runs against
      CHECK(gv_norm(gv_mad(x.f[k], s->d_f_implicit, x.sim[k].v)) <= x.spring[k].most_n * (1.0 + 1e-9), "%g N",
            gv_norm(gv_mad(x.f[k], s->d_f_implicit, x.sim[k].v)));
      CHECK_NEAR(s->added_mass_kg, h * s->d_f + h * h * s->k_f, 1e-12 * x.spring[k].added_mass_kg);
      CHECK_NEAR(s->added_inertia, h * s->d_t + h * h * s->k_small, 1e-12 * x.spring[k].added_inertia);
    }
  }
  CHECK(softened > 1000 && softened < 47000, "%d of 48000", softened);
}

// Not a bit: neither of the pulls nor of the springs.
static void test_below_the_bound_nothing_changes(void) {
  unsigned long long random = 9;
  for (int i = 0; i < 3000; i++) {
    static hand x;
    make_hand(&x, &random);
    const gv_coupling usual = {200.0, -1.0, 0.48, -1.0};
    for (int k = 0; k < GV_LIMBS; k++) {
      x.spring[k] = x.acting[k] = gv_spring_make(&usual, 0.01, inertia, h, GV_ROTATION_LOG);
      x.driver[k].T.p = gv_scale(random_axis(&random), check_uniform(&random, 0.0, 0.055));
      x.driver[k].T.q = gv_quat_axis_angle(random_axis(&random), check_uniform(&random, 0.0, 1.0));
      x.sim[k].v = x.driver[k].v = random_vector(&random, 0.1);
      x.sim[k].w = x.driver[k].w = random_vector(&random, 1.0);
    }
    const hand before = x;
    gv_springs_apply(x.spring, x.sim, x.driver, x.f, x.t);
    gv_vec3 f[GV_LIMBS], t[GV_LIMBS];
    memcpy(f, x.f, sizeof f);
    memcpy(t, x.t, sizeof t);
    CHECK(gv_springs_bound(x.spring, x.sim, x.f, x.t, x.acting) == 0, "some are softer");
    CHECK(memcmp(f, x.f, sizeof f) == 0 && memcmp(t, x.t, sizeof t) == 0, "another pull");
    CHECK(memcmp(before.acting, x.acting, sizeof x.acting) == 0, "another spring");
  }
}

// Far from its driver a limb comes to it and stays, whatever the coupling: a bounded pull on the mass that a
// stiff spring adds would swing about it for seconds.
static void test_a_bounded_spring_brings_the_limb_home(void) {
  const gv_coupling stiff[] = {
    {1e4, -1.0, 24.0, -1.0}, {1e6, -1.0, 1e4, -1.0}, {1e6, 0.0, 1e4, 0.0}, {1e6, 1e3, 1e4, 1.0}};
  for (size_t c = 0; c < sizeof stiff / sizeof *stiff; c++) {
    static hand x;
    int ms = 0;
    double off_m = 0.0, last_off_ms = 0.0;
    memset(&x, 0, sizeof x);
    for (int i = 0; i < GV_LIMBS; i++) {
      x.spring[i] = gv_spring_make(&stiff[c], 0.01, inertia, h, GV_ROTATION_LOG);
      x.sim[i].T = x.driver[i].T = gv_pose_identity();
    }
    x.driver[2].T.p.x = 0.05;
    while (ms < 1000) {
      gv_springs_apply(x.spring, x.sim, x.driver, x.f, x.t);
      memcpy(x.acting, x.spring, sizeof x.acting);
      gv_springs_bound(x.spring, x.sim, x.f, x.t, x.acting);
      const gv_spring *s = &x.acting[2];
      x.sim[2].v = gv_mad(x.sim[2].v, h / (s->mass_kg + s->added_mass_kg), x.f[2]);
      x.sim[2].T.p = gv_mad(x.sim[2].T.p, h, x.sim[2].v);
      off_m = gv_norm(gv_sub(x.sim[2].T.p, x.driver[2].T.p));
      ms++;
      if (off_m > 1e-4)
        last_off_ms = ms;
    }
    printf("figure a limb 50 mm off, %g N/m: within 0.1 mm after %.0f ms\n", stiff[c].k_f, last_off_ms);
    CHECK(last_off_ms < 300 && off_m < 1e-6, "%g N/m: %g mm off", stiff[c].k_f, off_m * 1e3);
  }
}

int main(void) {
  RUN(test_torque_turns_the_limb_towards_its_driver);
  RUN(test_no_turn_is_no_torque);
  RUN(test_damping_takes_energy);
  RUN(test_a_turned_limb_comes_to_rest_on_its_driver);
  RUN(test_a_person_feels_the_opposite);
  RUN(test_no_pull_is_beyond_its_bound);
  RUN(test_below_the_bound_nothing_changes);
  RUN(test_a_bounded_spring_brings_the_limb_home);
  return check_done();
}
