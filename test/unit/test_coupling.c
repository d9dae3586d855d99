// SPDX-License-Identifier: BSD-3-Clause
// Rotational coupling (Eqn 2 to 4) by its properties, against rotations built here: the torque turns the
// limb towards its driver and nowhere else, damping takes energy, both laws have the stiffness that they
// promise, and a person feels the opposite of what acts on the limb.
#include "hand/coupling.h"
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

int main(void) {
  RUN(test_torque_turns_the_limb_towards_its_driver);
  RUN(test_no_turn_is_no_torque);
  RUN(test_damping_takes_energy);
  RUN(test_a_turned_limb_comes_to_rest_on_its_driver);
  RUN(test_a_person_feels_the_opposite);
  return check_done();
}
