// SPDX-License-Identifier: BSD-3-Clause
// What lets a force out: the limiter's promises under random input, every transition of the safety machine,
// the tendon map against virtual work, and how fast its tensions rise.
#include <string.h>

#include "support/check.h"
#include "gloved/force.h"
#include "gloved/safety.h"
#include "safety/source.h"

static const double dt = 0.001;

static void test_limiter_never_breaks_its_promises(void) {
  gv_limiter l;
  gv_limiter_config cfg = gv_limiter_config_default();
  gv_limiter_init(&l, &cfg);
  unsigned long long r = 3;
  double last[GV_FINGERS] = {0}, out[GV_FINGERS];
  for (int i = 0; i < 200000; i++) {
    double want[GV_FINGERS];
    for (int f = 0; f < GV_FINGERS; f++)
      want[f] = check_uniform(&r, -20, 40);
    double odd = check_uniform(&r, 0, 1);
    double age = check_uniform(&r, 0, 1) < 0.02 ? 1.0 : 0.01;
    if (odd < 0.01)
      want[2] = NAN;
    else if (odd < 0.02)
      want[4] = INFINITY;
    else if (odd < 0.03)
      age = NAN;
    unsigned flags = gv_limiter_step(&l, want, check_uniform(&r, 0, 1) < 0.98, age, dt, out);
    for (int f = 0; f < GV_FINGERS; f++) {
      CHECK(out[f] >= 0 && out[f] <= cfg.max_n, "step %d: %g N", i, out[f]);
      CHECK(out[f] <= last[f] + cfg.slew_n_per_s * dt + 1e-12, "step %d rises by %g N", i, out[f] - last[f]);
      if (flags & (GV_LIMITER_AGE | GV_LIMITER_NOT_FINITE | GV_LIMITER_DISABLED))
        CHECK(out[f] <= last[f], "doubt, but the force rises");
      last[f] = out[f];
    }
  }
}

static void test_each_channel_has_its_own_limits(void) {
  gv_limiter l;
  gv_limiter_config cfg = gv_limiter_config_default();
  cfg.finger_max_n[3] = 2.0;
  cfg.pretension_n = 0.15;
  gv_limiter_init(&l, &cfg);
  const double want[GV_FINGERS] = {0, 0.1, 5, 5, 50};
  double out[GV_FINGERS];
  for (int i = 0; i < 100; i++)
    gv_limiter_step(&l, want, true, 0, dt, out);
  const double expect[GV_FINGERS] = {0.15, 0.15, 5, 2, 12};
  for (int f = 0; f < GV_FINGERS; f++)
    CHECK_NEAR(out[f], expect[f], 1e-12);
  for (int i = 0; i < 20; i++)
    gv_limiter_step(&l, want, false, 0, dt, out);
  for (int f = 0; f < GV_FINGERS; f++)
    CHECK(out[f] == 0, "no pretension while forces may not leave");
}

static void test_any_doubt_is_zero_within_the_ramp(void) {
  const double want[GV_FINGERS] = {20, 20, 20, 20, 20};
  const double broken[GV_FINGERS] = {1, NAN, 1, 1, 1};
  for (int cause = 0; cause < 4; cause++) {
    gv_limiter l;
    gv_limiter_config cfg = gv_limiter_config_default();
    gv_limiter_init(&l, &cfg);
    double out[GV_FINGERS];
    for (int i = 0; i < 200; i++)
      gv_limiter_step(&l, want, true, 0, dt, out);
    CHECK_NEAR(out[0], cfg.max_n, 1e-12);
    int steps = 0;
    while (out[0] > 0 && steps < 1000) {
      gv_limiter_step(&l, cause == 0 ? broken : want, cause != 1,
                      cause == 2   ? 1.0
                      : cause == 3 ? -1.0
                                   : 0,
                      dt, out);
      steps++;
    }
    CHECK(steps <= (int)(cfg.ramp_s / dt) + 1, "cause %d: %d ms to zero", cause, steps);
  }
}

typedef struct machine {
  gv_safety s;
  gv_safety_input in;
} machine;
static machine fresh_machine(void) {
  gv_safety_config cfg = gv_safety_config_default();
  machine m = {.in = {.finite = true}};
  gv_safety_init(&m.s, &cfg);
  return m;
}
static gv_safety_state go(machine *m) { return gv_safety_step(&m->s, &m->in, dt); }
static void devices(machine *m, bool there) { m->in.glove_seen = m->in.tracker_seen = there; }
static machine active_machine(void) {
  machine m = fresh_machine();
  go(&m);
  devices(&m, true);
  go(&m);
  go(&m);
  m.in.dead_man = true;
  go(&m);
  m.in.desired_max_n = 3;
  go(&m);
  return m;
}

static void test_the_way_up(void) {
  machine m = fresh_machine();
  CHECK(m.s.state == GV_SAFETY_START, "starts in start");
  CHECK(go(&m) == GV_SAFETY_WAIT && go(&m) == GV_SAFETY_WAIT, "waits for devices");
  devices(&m, true);
  CHECK(go(&m) == GV_SAFETY_READY, "ready with fresh data");
  m.in.desired_max_n = 2;
  go(&m);
  m.in.dead_man = true;
  CHECK(go(&m) == GV_SAFETY_READY, "does not arm into a force");
  m.in.desired_max_n = 0;
  CHECK(go(&m) == GV_SAFETY_ARMED && gv_safety_lets_force_out(&m.s), "arms near zero");
  m.in.desired_max_n = 2;
  CHECK(go(&m) == GV_SAFETY_ACTIVE && gv_safety_lets_force_out(&m.s), "active");
  m.in.dead_man = false;
  CHECK(go(&m) == GV_SAFETY_READY && !gv_safety_lets_force_out(&m.s), "the dead-man switch ends it");
}

static void test_a_switch_held_at_start_does_not_arm(void) {
  machine m = fresh_machine();
  m.in.dead_man = true;
  devices(&m, true);
  for (int i = 0; i < 100; i++)
    CHECK(!gv_safety_lets_force_out(&m.s) && go(&m) != GV_SAFETY_ARMED, "step %d", i);
  m.in.dead_man = false;
  go(&m);
  m.in.dead_man = true;
  CHECK(go(&m) == GV_SAFETY_ARMED, "arms after it was let go");
}

static void test_every_fault_stops_the_force(void) {
  static const char *const name[] = {"glove", "tracker", "frames", "finite", "overrun", "device"};
  for (int f = 0; f < 6; f++) {
    machine m = active_machine();
    CHECK(m.s.state == GV_SAFETY_ACTIVE, "active before");
    if (f == 0)
      m.in.glove_age_s = 0.06;
    if (f == 1)
      m.in.tracker_age_s = NAN;
    if (f == 2)
      m.in.bad_frames = 20;
    if (f == 3)
      m.in.finite = false;
    if (f == 4)
      m.in.overruns = 30;
    if (f == 5)
      m.in.device_fault = true;
    CHECK(go(&m) == GV_SAFETY_FAULT && m.s.faults == 1u << f, "%s: state %s, faults %x", name[f],
          gv_safety_name(m.s.state), m.s.faults);
    // All well again, but the switch still held: no force. Let go, and it may be armed anew.
    m.in = (gv_safety_input){.glove_seen = true, .tracker_seen = true, .finite = true, .dead_man = true};
    for (int i = 0; i < 1000; i++)
      CHECK(go(&m) == GV_SAFETY_FAULT, "%s: stays until the switch is let go", name[f]);
    m.in.dead_man = false;
    go(&m);
    go(&m);
    CHECK(go(&m) == GV_SAFETY_READY, "%s: back to ready, not further", name[f]);
    m.in.dead_man = true;
    CHECK(go(&m) == GV_SAFETY_ARMED, "%s: a person arms", name[f]);
  }
}

// At 100 Hz ten periods fit into the window: a limit of 20 would never be passed.
static void test_repeated_overruns_at_low_rates(void) {
  static const double rate_hz[] = {100, 200, 500, 1000, 4000};
  for (size_t r = 0; r < sizeof rate_hz / sizeof *rate_hz; r++) {
    gv_safety s;
    const gv_safety_config cfg = gv_safety_config_default();
    gv_safety_input in = {.glove_seen = true, .tracker_seen = true, .finite = true};
    gv_safety_init(&s, &cfg);
    for (int i = 0; i < 5; i++)
      gv_safety_step(&s, &in, 1.0 / rate_hz[r]);
    in.dead_man = true;
    gv_safety_step(&s, &in, 1.0 / rate_hz[r]);
    in.overruns = 1;
    double passed_s = 0.0;
    while (gv_safety_step(&s, &in, 1.0 / rate_hz[r]) != GV_SAFETY_FAULT && passed_s < 1.0)
      passed_s += 1.0 / rate_hz[r];
    CHECK(passed_s < 0.2 && s.faults == GV_FAULT_OVERRUN, "%g Hz: every period late, no fault after %g s",
          rate_hz[r], passed_s);
  }
}

// Ten bad frames within a tenth of a second are allowed: at 1 kHz one in eleven periods comes to less than
// that whatever its time, one in nine to more.
static void test_the_window_counts_what_comes_steadily(void) {
  for (int every = 8; every <= 13; every += 5) {
    machine m = active_machine();
    bool fault = false;
    for (int i = 0; i < 3000; i++) {
      m.in.bad_frames = i % every == 0;
      fault |= go(&m) == GV_SAFETY_FAULT;
    }
    CHECK(fault == (every == 8), "one bad frame in %d periods: %s", every, fault ? "a fault" : "none");
    CHECK(!fault || m.s.faults == GV_FAULT_FRAMES || m.s.faults == 0, "for another reason: %x", m.s.faults);
  }
}

// The rate of a source is that of its frames, not of its outages: after a pause of a second the age that is
// allowed is that of before.
static void test_an_outage_says_nothing_about_the_rate(void) {
  gv_source source = {0};
  int64_t now_ns = 0;
  for (int i = 0; i < 200; i++) {
    gv_source_take(&source, now_ns, (uint32_t)i, 0);
    now_ns += 2000000;
  }
  const double allowed_s = gv_source_largest_age_s(source.interval_s, 0.05);
  CHECK_NEAR(allowed_s, 0.034, 1e-4);
  now_ns += 1000000000;
  gv_source_take(&source, now_ns, 300, 0);
  CHECK_NEAR(gv_source_largest_age_s(source.interval_s, 0.05), allowed_s, 1e-9);
}

static void test_stop_is_final(void) {
  machine m = active_machine();
  m.in.stop = true;
  CHECK(go(&m) == GV_SAFETY_STOPPED, "stops");
  m.in.stop = false;
  CHECK(go(&m) == GV_SAFETY_STOPPED, "and stays");
}

// A tension T on joints with arms r does the work T sum(r_j dq_j); limb wrenches do sum(J^T w) dq. For
// wrenches that come from a tension the map must give that tension back.
static void test_tendon_map_inverts_a_tension(void) {
  gv_hand_model m = gv_hand_model_default(GV_RIGHT);
  gv_pose wrist = {gv_quat_exp(gv_v3(0.2, 0.1, -0.4)), {0.3, 0, 0.1}}, T[GV_LIMBS];
  double angle[GV_SENSORS];
  for (int i = 0; i < GV_SENSORS; i++)
    angle[i] = 0.02 * i;
  gv_joint_axis joint[GV_SENSORS];
  gv_hand_frames(&m, &wrist, angle, T);
  gv_hand_joints(&m, &wrist, angle, joint);
  for (int finger = 0; finger < GV_FINGERS; finger++) {
    gv_vec3 f[GV_LIMBS], t[GV_LIMBS];
    memset(f, 0, sizeof f);
    memset(t, 0, sizeof t);
    int sensor[3];
    double arm[3], out[GV_FINGERS], tension = 2.5;
    gv_tendon_joints(finger, sensor, arm);
    // pure torques on the segments that leave tension * arm at each joint, extending
    for (int j = 0; j < 3; j++) {
      double next = j < 2 ? arm[j + 1] : 0.0;
      gv_vec3 a = joint[sensor[j]].axis_world;
      t[3 * finger + j] = gv_scale(a, -tension * (arm[j] - next));
    }
    gv_tendon_map(joint, T, f, t, out);
    CHECK_NEAR(out[finger], tension, 1e-12);
    for (int j = 0; j < 3; j++)
      t[3 * finger + j] = gv_neg(t[3 * finger + j]);
    gv_tendon_map(joint, T, f, t, out);
    CHECK(out[finger] == 0.0, "a tendon cannot push");
  }
}

// A force on the fingertip, square to its pad, is felt as about its size.
static void test_a_fingertip_force_is_felt(void) {
  gv_hand_model m = gv_hand_model_default(GV_RIGHT);
  gv_pose wrist = gv_pose_identity(), T[GV_LIMBS];
  double angle[GV_SENSORS] = {0};
  angle[GV_INDEX_MPJ] = 0.6;
  angle[GV_INDEX_PIJ] = 0.6;
  angle[GV_INDEX_DIJ] = 0.3;
  gv_joint_axis joint[GV_SENSORS];
  gv_hand_frames(&m, &wrist, angle, T);
  gv_hand_joints(&m, &wrist, angle, joint);
  gv_vec3 f[GV_LIMBS], t[GV_LIMBS];
  memset(f, 0, sizeof f);
  memset(t, 0, sizeof t);
  int tip = GV_LIMB_INDEX + 2;
  f[tip] = gv_rotate(T[tip].q, gv_v3(0, 0, 1));  // pushed from the pad side
  double out[GV_FINGERS];
  gv_tendon_map(joint, T, f, t, out);
  CHECK(out[1] > 0.5 && out[1] < 1.5, "1 N at the tip is felt as %g N", out[1]);
  CHECK(out[0] == 0 && out[2] == 0, "by that finger alone");
}

// By k times the tip's way and 50 N/s at the most, at every length of a step.
static void test_a_tension_rises_as_the_fingertip_moves(void) {
  static const double step_s[] = {0.0001, 0.001, 0.01};
  unsigned long long r = 11;
  int held_back[3] = {0};
  for (int s = 0; s < 3; s++) {
    double felt[GV_FINGERS] = {0};
    for (int i = 0; i < 20000; i++) {
      double asked[GV_FINGERS], last[GV_FINGERS];
      gv_vec3 moved[GV_FINGERS];
      const double k = check_uniform(&r, 0, 1000);
      memcpy(last, felt, sizeof last);
      for (int f = 0; f < GV_FINGERS; f++) {
        asked[f] = fmax(0, last[f] + check_uniform(&r, -150, 150) * step_s[s]);
        const double way = check_uniform(&r, 0, 0.2) * step_s[s];
        moved[f] = gv_scale(
            gv_normalize_or(gv_v3(check_uniform(&r, -1, 1), check_uniform(&r, -1, 1), 0.1), gv_v3(1, 0, 0)),
            way);
      }
      gv_tendon_follow(asked, moved, k, step_s[s], felt);
      for (int f = 0; f < GV_FINGERS; f++) {
        const double most = last[f] + k * gv_norm(moved[f]) + 50.0 * step_s[s];
        CHECK_NEAR(felt[f], fmin(asked[f], most), 1e-12);
        CHECK(felt[f] <= asked[f] && (asked[f] > last[f] || felt[f] == asked[f]), "%g of %g N", felt[f],
              asked[f]);
        held_back[s] += felt[f] < asked[f];
      }
    }
    CHECK(held_back[s] > 1000, "%d steps", held_back[s]);
  }
}

// A force that stays is felt in full, a tenth of a second later for each 5 N; none is felt at once.
static void test_a_tension_falls_at_once_and_is_reached(void) {
  const gv_vec3 still[GV_FINGERS] = {{0, 0, 0}};
  const double full[GV_FINGERS] = {5, 5, 5, 5, 5}, none[GV_FINGERS] = {0}, part[GV_FINGERS] = {0, 1, 2, 3, 4};
  double felt[GV_FINGERS] = {0};
  for (int i = 0; i < 99; i++)
    gv_tendon_follow(full, still, 200, dt, felt);
  CHECK(felt[2] < 5, "%g N", felt[2]);
  for (int i = 0; i < 2; i++)
    gv_tendon_follow(full, still, 200, dt, felt);
  CHECK(memcmp(felt, full, sizeof felt) == 0, "%g N", felt[2]);
  gv_tendon_follow(part, still, 200, dt, felt);
  CHECK(memcmp(felt, part, sizeof felt) == 0, "%g N", felt[4]);
  gv_tendon_follow(none, still, 200, dt, felt);
  CHECK(memcmp(felt, none, sizeof felt) == 0, "%g N", felt[4]);
}

// The safety machine must see it.
static void test_what_is_not_finite_is_not_hidden(void) {
  const gv_vec3 still[GV_FINGERS] = {{0, 0, 0}};
  const double odd[GV_FINGERS] = {NAN, INFINITY, 0, 0, 0};
  double felt[GV_FINGERS] = {0};
  gv_tendon_follow(odd, still, 200, dt, felt);
  CHECK(!isfinite(felt[0]) && !isfinite(felt[1]), "%g, %g", felt[0], felt[1]);
}

int main(void) {
  RUN(test_limiter_never_breaks_its_promises);
  RUN(test_each_channel_has_its_own_limits);
  RUN(test_any_doubt_is_zero_within_the_ramp);
  RUN(test_the_way_up);
  RUN(test_a_switch_held_at_start_does_not_arm);
  RUN(test_every_fault_stops_the_force);
  RUN(test_repeated_overruns_at_low_rates);
  RUN(test_the_window_counts_what_comes_steadily);
  RUN(test_an_outage_says_nothing_about_the_rate);
  RUN(test_stop_is_final);
  RUN(test_tendon_map_inverts_a_tension);
  RUN(test_a_fingertip_force_is_felt);
  RUN(test_a_tension_rises_as_the_fingertip_moves);
  RUN(test_a_tension_falls_at_once_and_is_reached);
  RUN(test_what_is_not_finite_is_not_hidden);
  return check_done();
}
