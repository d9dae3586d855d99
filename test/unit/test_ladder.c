// SPDX-License-Identifier: BSD-3-Clause
// The deadline ladder: which rung a load leads to, that it comes back, that nothing jumps on
// the way, and that a replay does what the live run did. The load is injected as measured
// times, so that no machine decides.
#include <string.h>

#include "daemon/loop/session.h"
#include "support/check.h"
#include "support/lab.h"

enum { MS = 1000000 };

// ---- the ladder alone -----------------------------------------------------------------------------

// Periods of 1 ms in which a step takes cost[rung]; counts the rungs.
static void run_ladder(gv_ladder *ladder, int periods, const int64_t cost_ns[GV_RUNG_HOLD], int64_t late_ns,
                       int out_count[GV_RUNGS]) {
  memset(out_count, 0, GV_RUNGS * sizeof *out_count);
  for (int i = 0; i < periods; i++) {
    const gv_rung rung = gv_ladder_choose(ladder, MS - late_ns);
    out_count[rung]++;
    if (rung == GV_RUNG_HOLD)
      continue;
    const gv_rung done = rung == GV_RUNG_RAMP ? GV_RUNG_CONTACTS : rung;
    gv_ladder_measure(ladder, done, cost_ns[done]);
  }
}

static void test_each_load_has_its_rung(void) {
  static const struct {
    int64_t cost_us[GV_RUNG_HOLD];
    gv_rung rung;
  } load[] = {
    {{30, 20, 15}, GV_RUNG_FULL},       {{750, 700, 600}, GV_RUNG_FULL},
    {{1500, 500, 200}, GV_RUNG_SOLVER}, {{2000, 1500, 400}, GV_RUNG_CONTACTS},
    {{5000, 5000, 1500}, GV_RUNG_HOLD},
  };
  for (size_t i = 0; i < sizeof load / sizeof *load; i++) {
    gv_ladder ladder;
    int count[GV_RUNGS];
    int64_t cost_ns[GV_RUNG_HOLD];
    for (int k = 0; k < GV_RUNG_HOLD; k++)
      cost_ns[k] = 1000 * load[i].cost_us[k];
    gv_ladder_init(&ladder, MS);
    run_ladder(&ladder, 50, cost_ns, 0, count);  // until the costs are known
    run_ladder(&ladder, 1000, cost_ns, 0, count);
    for (int r = 0; r < GV_RUNGS; r++)
      CHECK(r == (int)load[i].rung || count[r] <= count[load[i].rung], "load %zu: %d periods on %s", i,
            count[r], gv_rung_name((gv_rung)r));
    CHECK(count[load[i].rung] > 600, "load %zu: %d on %s", i, count[load[i].rung],
          gv_rung_name(load[i].rung));
  }
}

static void test_a_single_stall_leaves_no_rung(void) {
  static const int64_t light[GV_RUNG_HOLD] = {100000, 80000, 50000};
  gv_ladder ladder;
  int count[GV_RUNGS];
  gv_ladder_init(&ladder, MS);
  run_ladder(&ladder, 100, light, 0, count);
  gv_ladder_measure(&ladder, GV_RUNG_FULL, 30 * MS);
  run_ladder(&ladder, 100, light, 0, count);
  CHECK(count[GV_RUNG_FULL] == 100, "%d full", count[GV_RUNG_FULL]);
}

static void test_the_ladder_is_climbed_again(void) {
  static const int64_t heavy[GV_RUNG_HOLD] = {3 * MS, 3 * MS, 3 * MS};
  static const int64_t light[GV_RUNG_HOLD] = {100000, 80000, 50000};
  gv_ladder ladder;
  int count[GV_RUNGS];
  gv_ladder_init(&ladder, MS);
  run_ladder(&ladder, 300, heavy, 0, count);
  CHECK(count[GV_RUNG_HOLD] + count[GV_RUNG_RAMP] > 200, "a load that fits nowhere: %d held",
        count[GV_RUNG_HOLD]);
  run_ladder(&ladder, 3000, light, 0, count);
  run_ladder(&ladder, 100, light, 0, count);
  CHECK(count[GV_RUNG_FULL] == 100, "%d full once the load is gone", count[GV_RUNG_FULL]);
}

static void test_forces_are_held_for_10_ms_at_most(void) {
  for (int64_t period_ns = MS / 2; period_ns <= 10 * MS; period_ns *= 2) {
    gv_ladder ladder;
    gv_ladder_init(&ladder, period_ns);
    for (int i = 0; i < GV_RUNG_HOLD; i++)
      ladder.cost_ns[i] = INT64_MAX / 8;
    int64_t held_ns = 0;
    while (gv_ladder_choose(&ladder, period_ns) == GV_RUNG_HOLD && held_ns < 100 * MS)
      held_ns += period_ns;
    CHECK(ladder.rung == GV_RUNG_RAMP && held_ns <= (period_ns > 10 * MS ? period_ns : 10 * MS), "%g ms held",
          (double)held_ns * 1e-6);
  }
}

static void test_a_late_start_does_what_still_fits(void) {
  static const int64_t cost[GV_RUNG_HOLD] = {600000, 200000, 100000};
  gv_ladder ladder;
  int count[GV_RUNGS];
  gv_ladder_init(&ladder, MS);
  run_ladder(&ladder, 100, cost, 0, count);
  CHECK(gv_ladder_choose(&ladder, 700000) == GV_RUNG_SOLVER || ladder.rung == GV_RUNG_FULL, "0.3 ms late: %s",
        gv_rung_name(ladder.rung));
  ladder.cost_ns[GV_RUNG_SOLVER] = 200000;
  ladder.cost_ns[GV_RUNG_CONTACTS] = 100000;
  CHECK(gv_ladder_choose(&ladder, 300000) == GV_RUNG_SOLVER, "0.7 ms late: %s", gv_rung_name(ladder.rung));
  CHECK(gv_ladder_choose(&ladder, 150000) == GV_RUNG_CONTACTS, "0.85 ms late: %s", gv_rung_name(ladder.rung));
  CHECK(gv_ladder_choose(&ladder, 50000) == GV_RUNG_HOLD, "0.95 ms late: %s", gv_rung_name(ladder.rung));
}

// ---- with a hand that presses ---------------------------------------------------------------------

static lab world;
static gv_session session;
static int64_t now_ns;
static uint8_t glove_counter, pose_counter;
static gv_frame command;

static void start(bool replay) {
  const gv_session_config cfg = {.limiter = gv_limiter_config_default(),
                                 .safety = gv_safety_config_default(),
                                 .side = GV_RIGHT,
                                 .replay = replay,
                                 .period_s = 0.001};
  if (world.engine)
    gv_engine_close(world.engine);
  lab_start(&world);
  lab_box(&world, gv_v3(1, 1, 0.1), gv_v3(0, 0, -0.05), 0, 0.8);
  lab_run(&world);
  gv_session_init(&session, &cfg, world.engine);
  now_ns = 0;
  glove_counter = pose_counter = 0;
}

static void make_frames(double index_rad, uint8_t flags, gv_frame out[2]) {
  gv_glove_msg glove = {.counter = glove_counter++, .flags = flags, .stamp_us = (uint32_t)(now_ns / 1000)};
  for (int i = 0; i < GV_SENSORS; i++)
    glove.raw[i] = (uint16_t)gv_calibration_raw(&world.cfg.calibration, i,
                                                i == GV_INDEX_MPJ ? index_rad : 0.0);
  const gv_pose_msg pose = {.counter = pose_counter++,
                            .flags = GV_POSE_VALID,
                            .receiver = GV_RECEIVER_HAND,
                            .stamp_us = (uint32_t)(now_ns / 1000),
                            .T_world_receiver = {{1, 0, 0, 0}, {0, 0, 0.06}}};
  gv_fcu_pack_glove(&glove, &out[0]);
  gv_fcu_pack_pose(&pose, &out[1]);
  out[0].stamp_ns = out[1].stamp_ns = now_ns;
}

static void press(int count, double index_rad, uint8_t flags) {
  for (int i = 0; i < count; i++) {
    gv_frame frame[2];
    make_frames(index_rad, flags, frame);
    now_ns += MS;
    gv_session_step(&session, now_ns, frame, 2, 0, &command);
  }
}

static double commanded_max(void) {
  gv_command_msg msg;
  CHECK(gv_fcu_unpack_command(&command, &msg) == GV_FCU_OK, "the command does not decode");
  double max = 0;
  for (int i = 0; i < GV_FINGERS; i++)
    max = fmax(max, msg.tension_n[i]);
  return max;
}

static void press_until_force(void) {
  start(false);
  press(50, 0.0, 0);
  press(50, 0.0, GV_GLOVE_DEAD_MAN);
  press(300, 1.05, GV_GLOVE_DEAD_MAN);
  CHECK(commanded_max() > 0.3, "only %g N", commanded_max());
}

// Random rungs for a second: steps of less effort, held periods, a ramp at the end.
static void test_forces_never_jump_between_rungs(void) {
  unsigned long long random = 5;
  press_until_force();
  const double rise = session.cfg.limiter.slew_n_per_s * 0.001 + GV_TENSION_LSB_N;
  const double fall = session.cfg.limiter.max_n * 0.001 / session.cfg.limiter.ramp_s + GV_TENSION_LSB_N;
  double last = commanded_max();
  for (int i = 0; i < 1000; i++) {
    const gv_rung rung = (gv_rung)check_uniform(&random, 0, i % 10 ? 3 : 4);
    gv_frame frame[2];
    make_frames(1.05 + 0.2 * (i / 50 % 2), GV_GLOVE_DEAD_MAN, frame);
    now_ns += MS;
    if (rung == GV_RUNG_HOLD) {
      gv_session_hold(&session, now_ns, frame, 2);
      glove_counter--;  // these wait for the step, which takes them as the newest
      pose_counter--;
    } else {
      gv_session_set_rung(&session, rung);
      gv_session_compute(&session, now_ns, frame, 2, 0);
    }
    gv_session_command(&session, now_ns, &command);
    CHECK(commanded_max() - last <= rise, "%s: rises by %g N", gv_rung_name(rung), commanded_max() - last);
    last = commanded_max();
  }
  CHECK(session.safety.state == GV_SAFETY_ACTIVE, "%s", gv_safety_name(session.safety.state));
  gv_frame frame[2];
  for (int i = 0; i < 16; i++) {
    make_frames(1.05, GV_GLOVE_DEAD_MAN, frame);
    now_ns += MS;
    gv_session_compute(&session, now_ns, frame, 2, 1000000);
    gv_session_command(&session, now_ns, &command);
    CHECK(last - commanded_max() <= fall, "ramp: falls by %g N", last - commanded_max());
    last = commanded_max();
  }
  CHECK(last == 0.0 && session.safety.faults == GV_FAULT_OVERRUN, "%g N, faults %x", last,
        session.safety.faults);
}

static void test_an_open_switch_counts_while_forces_are_held(void) {
  press_until_force();
  gv_frame frame[2];
  make_frames(1.05, 0, frame);
  now_ns += MS;
  gv_session_hold(&session, now_ns, frame, 2);
  gv_session_command(&session, now_ns, &command);
  CHECK(session.safety.state == GV_SAFETY_READY, "%s", gv_safety_name(session.safety.state));
}

// Holding is no way around the ages.
static void test_held_forces_end_with_their_data(void) {
  press_until_force();
  int ms = 0;
  for (; commanded_max() > 0.0 && ms < 100; ms++) {
    now_ns += MS;
    gv_session_hold(&session, now_ns, NULL, 0);
    gv_session_command(&session, now_ns, &command);
  }
  CHECK(ms <= 50, "zero after %d ms", ms);
}

// The same frames, the rungs once set by the loop and once by the EFFORT frames of a recording.
static uint64_t hash_of_rungs(bool replay, gv_rung other) {
  start(replay);
  for (int i = 0; i < 400; i++) {
    const gv_rung rung = i >= 200 && i < 300 ? other : GV_RUNG_FULL;
    gv_frame frame[3];
    make_frames(i < 50 ? 0.0 : 1.05, i < 25 ? 0 : GV_GLOVE_DEAD_MAN, frame);
    now_ns += MS;
    gv_fcu_pack_effort(&(gv_effort_msg){.rung = (uint8_t)rung}, &frame[2]);
    if (!replay)
      gv_session_set_rung(&session, rung);
    gv_session_step(&session, now_ns, frame, i == 200 || i == 300 ? 3 : 2, 0, &command);
  }
  return gv_engine_hash(world.engine);
}

static void test_a_replay_stands_on_the_same_rungs(void) {
  for (int rung = GV_RUNG_FULL; rung < GV_RUNG_HOLD; rung++)
    CHECK(hash_of_rungs(false, (gv_rung)rung) == hash_of_rungs(true, (gv_rung)rung), "%s",
          gv_rung_name((gv_rung)rung));
  CHECK(session.frames.foreign == 0 && session.frames.rx == 800,
        "an EFFORT frame counts as one of the device's");
  hash_of_rungs(false, GV_RUNG_CONTACTS);
  CHECK(session.frames.foreign == 2, "on a wire it is foreign");
}

// 24 of a limb's many contacts: the step leaves the shallow ones out, and no more.
static void test_less_effort_leaves_contacts_out(void) {
  lab many;
  memset(&many, 0, sizeof many);
  if (world.engine)
    gv_engine_close(world.engine);
  world.engine = NULL;
  lab_start(&many);
  lab_box(&many, gv_v3(4, 4, 0.1), gv_v3(0, 0, -0.05), 0, 0.8);
  for (int i = 0; i < 16; i++)
    lab_box(&many, gv_v3(0.1, 0.1, 0.1), gv_v3(0.2 * (i % 4), 0.2 * (i / 4), 0.0499), 0.5, 0.8);
  lab_run(&many);
  gv_sample none = {.T_world_receiver = gv_pose_identity()};
  gv_step_result result;
  gv_engine_step(many.engine, &none, &result);
  CHECK(result.contact_count > 24, "only %d contacts", result.contact_count);
  gv_engine_set_effort(many.engine, (gv_effort){0.25, 24});
  gv_engine_step(many.engine, &none, &result);
  CHECK(result.contact_count == 24, "%d contacts", result.contact_count);
  gv_engine_set_effort(many.engine, (gv_effort){1.0, GV_MAX_CONTACTS});
  gv_engine_step(many.engine, &none, &result);
  CHECK(result.contact_count > 24, "only %d contacts again", result.contact_count);
  gv_engine_close(many.engine);
}

int main(void) {
  RUN(test_each_load_has_its_rung);
  RUN(test_a_single_stall_leaves_no_rung);
  RUN(test_the_ladder_is_climbed_again);
  RUN(test_forces_are_held_for_10_ms_at_most);
  RUN(test_a_late_start_does_what_still_fits);
  RUN(test_forces_never_jump_between_rungs);
  RUN(test_an_open_switch_counts_while_forces_are_held);
  RUN(test_held_forces_end_with_their_data);
  RUN(test_a_replay_stands_on_the_same_rungs);
  RUN(test_less_effort_leaves_contacts_out);
  return check_done();
}
