// SPDX-License-Identifier: BSD-3-Clause
// One period without clock: what counts as lost, late, bad and unusable; that the simulation sees the
// frames alone and no clock; and when a force may leave. The world is a table with a finger pressed into it.
#include <string.h>

#include "daemon/loop/session.h"
#include "support/check.h"
#include "support/lab.h"

enum { MS = 1000000 };

static lab world;
static gv_session session;
static int64_t now_ns;
static uint8_t glove_counter, pose_counter, status_counter;
static gv_frame command;

static void start(void) {
  const gv_session_config cfg = {.limiter = gv_limiter_config_default(),
                                 .safety = gv_safety_config_default(),
                                 .side = GV_RIGHT,
                                 .period_s = 0.001};
  if (world.engine)
    gv_engine_close(world.engine);
  lab_start(&world);
  lab_box(&world, gv_v3(1, 1, 0.1), gv_v3(0, 0, -0.05), 0, 0.8);
  lab_run(&world);
  gv_session_init(&session, &cfg, world.engine);
  now_ns = 0;
  glove_counter = pose_counter = status_counter = 0;
}

// ---- frames --------------------------------------------------------------------------------------------

static gv_frame stamped(gv_frame frame) {
  frame.stamp_ns = now_ns;
  return frame;
}

// All fingers straight, the index finger bent by `index_rad` in its first joint.
static gv_frame glove(double index_rad, uint8_t flags, uint32_t age_us) {
  gv_glove_msg msg = {
    .counter = glove_counter++, .flags = flags, .age_us = age_us, .stamp_us = (uint32_t)(now_ns / 1000)};
  for (int i = 0; i < GV_SENSORS; i++)
    msg.raw[i] = (uint16_t)gv_clamp(
        gv_calibration_raw(&world.cfg.calibration, i, i == GV_INDEX_MPJ ? index_rad : 0.0), 0.0, 4095.0);
  gv_frame frame;
  gv_fcu_pack_glove(&msg, &frame);
  return stamped(frame);
}

static gv_frame pose(uint8_t receiver, double height_m, uint8_t flags) {
  gv_pose_msg msg = {.counter = pose_counter++,
                     .flags = flags,
                     .receiver = receiver,
                     .stamp_us = (uint32_t)(now_ns / 1000),
                     .T_world_receiver = {{1, 0, 0, 0}, {0, 0, height_m}}};
  gv_frame frame;
  gv_fcu_pack_pose(&msg, &frame);
  return stamped(frame);
}

static gv_frame status(uint8_t flags) {
  gv_status_msg msg = {.counter = status_counter++, .flags = flags, .stamp_us = (uint32_t)(now_ns / 1000)};
  gv_frame frame;
  gv_fcu_pack_status(&msg, &frame);
  return stamped(frame);
}

static void step(const gv_frame *frame, int count) {
  now_ns += MS;
  gv_session_step(&session, now_ns, frame, count, 0, &command);
}

static void step_one(gv_frame frame) { step(&frame, 1); }

// `count` periods with a sound glove and pose, the index finger bent, the wrist 60 mm above the table.
static void press(int count, double index_rad, uint8_t flags) {
  for (int i = 0; i < count; i++) {
    const gv_frame frame[2] = {glove(index_rad, flags, 0), pose(GV_RECEIVER_HAND, 0.06, GV_POSE_VALID)};
    step(frame, 2);
  }
}

static double commanded_max(void) {
  gv_command_msg msg;
  CHECK(gv_fcu_unpack_command(&command, &msg) == GV_FCU_OK, "the command does not decode");
  double max = 0;
  for (int i = 0; i < GV_FINGERS; i++)
    max = fmax(max, msg.tension_n[i]);
  if (max > 0)
    CHECK(msg.flags & GV_COMMAND_ENABLE, "a force without ENABLE");
  return max;
}

// Arms with an open hand, then presses the index finger 60 degrees down: a force flows.
static void press_until_force(void) {
  start();
  press(50, 0.0, 0);
  press(50, 0.0, GV_GLOVE_DEAD_MAN);
  press(300, 1.05, GV_GLOVE_DEAD_MAN);
  CHECK(session.safety.state == GV_SAFETY_ACTIVE, "%s", gv_safety_name(session.safety.state));
  CHECK(commanded_max() > 0.3, "only %g N", commanded_max());
}

// ---- counters -----------------------------------------------------------------------------------------

static void test_gaps_count_as_lost(void) {
  start();
  step_one(glove(0, 0, 0));
  glove_counter = (uint8_t)(glove_counter + 4);
  step_one(glove(0, 0, 0));
  CHECK(session.frames.lost == 4, "%d lost", (int)session.frames.lost);
  start();
  glove_counter = 254;
  for (int i = 0; i < 4; i++)
    step_one(glove(0, 0, 0));
  CHECK(session.frames.lost == 0 && session.frames.late == 0, "the counter wraps");
}

static void test_ids_count_by_themselves(void) {
  start();
  pose_counter = 100;
  status_counter = 200;
  for (int i = 0; i < 3; i++) {
    const gv_frame frame[3] = {glove(0, 0, 0), pose(GV_RECEIVER_HAND, 0.1, GV_POSE_VALID), status(0)};
    step(frame, 3);
  }
  CHECK(session.frames.rx == 9 && session.frames.lost == 0 && session.frames.late == 0, "%d lost",
        (int)session.frames.lost);
}

static void test_doubled_and_overtaken_are_dropped(void) {
  start();
  gv_frame first = glove(0.1, 0, 0);
  gv_frame second = glove(0.2, 0, 0);
  gv_frame third = glove(0.3, 0, 0);
  step_one(first);
  step_one(third);
  step_one(second);
  step_one(third);
  CHECK(session.frames.late == 2, "%d late", (int)session.frames.late);
  CHECK(session.frames.lost == 0, "%d lost: it came, if late", (int)session.frames.lost);
  CHECK(!session.sample.glove_new, "a doubled sample is not new");
  gv_glove_msg newest;
  gv_fcu_unpack_glove(&third, &newest);
  CHECK(session.glove.raw[GV_INDEX_MPJ] == newest.raw[GV_INDEX_MPJ], "the newest stays");
}

static void test_a_late_frame_takes_its_loss_back(void) {
  start();
  gv_frame frame[6];
  for (int i = 0; i < 6; i++)
    frame[i] = glove(0.1 * i, 0, 0);
  step_one(frame[0]);
  step_one(frame[4]);
  CHECK(session.frames.lost == 3, "%d lost", (int)session.frames.lost);
  step_one(frame[2]);
  step_one(frame[1]);
  step_one(frame[3]);
  CHECK(session.frames.lost == 0 && session.frames.late == 3, "%d lost", (int)session.frames.lost);
  for (int i = 0; i < 10; i++)
    step(NULL, 0);
  CHECK(session.frames.errors == 0, "%d errors", (int)session.frames.errors);
  step_one(frame[5]);
  step_one(frame[2]);
  CHECK(session.frames.lost == 0 && session.frames.late == 4, "what came already takes nothing back: %d",
        (int)session.frames.lost);
}

static void test_a_gap_is_an_error_when_its_time_is_over(void) {
  start();
  gv_frame missing = glove(0, 0, 0);
  step_one(glove(0, 0, 0));
  glove_counter = (uint8_t)(glove_counter + 2);
  step_one(glove(0, 0, 0));
  for (int i = 0; i < 5; i++)
    step(NULL, 0);
  CHECK(session.frames.errors == 0, "after 5 ms: %d errors", (int)session.frames.errors);
  step(NULL, 0);
  CHECK(session.frames.errors == 1 && session.frames.lost == 2, "after 6 ms: %d errors",
        (int)session.frames.errors);
  missing.data[0] = 0;
  step_one(missing);
  CHECK(session.frames.errors == 1 && session.frames.lost == 2, "before the first: %d lost",
        (int)session.frames.lost);
}

static void test_one_poll_is_taken_in_order(void) {
  start();
  glove_counter = pose_counter = 250;
  gv_frame sent[20], came[20];
  for (int i = 0; i < 20; i++)
    sent[i] = i % 2 ? pose(GV_RECEIVER_HAND, 0.1, GV_POSE_VALID) : glove(0.05 * i, 0, 0);
  for (int i = 0; i < 20; i++)
    came[i] = sent[i < 6 ? i : 25 - i];
  step(came, 20);
  CHECK(session.frames.lost == 0 && session.frames.late == 0 && session.frames.errors == 0, "%d late",
        (int)session.frames.late);
  CHECK(session.glove.counter == (uint8_t)(250 + 9), "the newest is the last: %d", session.glove.counter);
  const double angle = gv_calibration_angle(&world.cfg.calibration, GV_INDEX_MPJ,
                                            session.sample.raw[GV_INDEX_MPJ]);
  CHECK_NEAR(angle, 0.9, 0.002);
}

// The queue of cannelloni 2 as its source has it (udpthread.cpp prepareBuffer, framebuffer.cpp returnFrame):
// a datagram takes frames from the front while they fit; the rest goes back to the front one by one, and so
// in reverse order. One datagram leaves with each tick of its timer.
enum { CANNELLONI_ROOM = 1472 - 5, CANNELLONI_QUEUE = 200 };
typedef struct cannelloni {
  gv_frame queue[CANNELLONI_QUEUE];
  int count;
} cannelloni;

static int cannelloni_tick(cannelloni *c, gv_frame *out) {
  int taken = 0;
  int bytes = 0;
  while (taken < c->count && bytes + 6 + c->queue[taken].len <= CANNELLONI_ROOM)
    bytes += 6 + c->queue[taken++].len;
  memcpy(out, c->queue, (size_t)taken * sizeof *out);
  gv_frame rest[CANNELLONI_QUEUE];
  const int left = c->count - taken;
  for (int i = 0; i < left; i++)
    rest[i] = c->queue[c->count - 1 - i];
  memcpy(c->queue, rest, (size_t)left * sizeof *rest);
  c->count = left;
  return taken;
}

static void cannelloni_press(cannelloni *c, int count, bool stalled) {
  for (int i = 0; i < count; i++) {
    gv_frame out[CANNELLONI_QUEUE];
    c->queue[c->count++] = glove(1.05, GV_GLOVE_DEAD_MAN, 0);
    c->queue[c->count++] = pose(GV_RECEIVER_HAND, 0.06, GV_POSE_VALID);
    step(out, stalled ? 0 : cannelloni_tick(c, out));
  }
}

static void test_cannelloni_that_stalls_is_no_fault(void) {
  static cannelloni queue;
  queue.count = 0;
  press_until_force();
  for (int i = 0; i < 20; i++) {
    cannelloni_press(&queue, 20 + i % 3 * 4, true);
    cannelloni_press(&queue, 40, false);
  }
  CHECK(session.frames.late > 20, "only %d late: nothing was reversed", (int)session.frames.late);
  CHECK(session.frames.lost == 0 && session.frames.errors == 0, "%d lost, %d errors",
        (int)session.frames.lost, (int)session.frames.errors);
  CHECK(session.safety.state == GV_SAFETY_ACTIVE && commanded_max() > 0.3, "%s",
        gv_safety_name(session.safety.state));
}

static void test_losses_end_the_force(void) {
  press_until_force();
  for (int i = 0; i < 60; i++) {
    glove_counter = (uint8_t)(glove_counter + (i % 3 == 0));
    press(1, 1.05, GV_GLOVE_DEAD_MAN);
  }
  CHECK(session.safety.state == GV_SAFETY_FAULT && session.faults_seen == GV_FAULT_FRAMES, "%s",
        gv_safety_name(session.safety.state));
}

static void test_one_doubled_frame_is_no_error_many_are(void) {
  start();
  for (int i = 0; i < 10; i++) {
    const gv_frame frame = glove(0, 0, 0);
    step_one(frame);
    step_one(frame);
  }
  CHECK(session.frames.late == 10 && session.frames.errors == 0, "%d errors", (int)session.frames.errors);
  const gv_frame stuck = glove(0, 0, 0);
  for (int i = 0; i < 12; i++)
    step_one(stuck);
  CHECK(session.frames.errors == 10, "%d errors of a counter that stands still", (int)session.frames.errors);
}

static void test_a_restarted_device_is_taken_again(void) {
  start();
  glove_counter = 100;
  step_one(glove(0, 0, 0));
  glove_counter = 50;
  int taken_after = 0;
  for (int i = 1; i <= 60 && !taken_after; i++) {
    step_one(glove(0, 0, 0));
    if (session.sample.glove_new)
      taken_after = i;
  }
  CHECK(taken_after == GV_SESSION_RESYNC, "after %d frames", taken_after);
  step_one(glove(0, 0, 0));
  CHECK(session.sample.glove_new, "and stays taken");
}

static void test_broken_frames_are_counted_and_dropped(void) {
  start();
  gv_frame broken = glove(0.5, GV_GLOVE_DEAD_MAN, 0);
  gv_frame shorter = glove(0.5, 0, 0);
  gv_frame other = glove(0.5, 0, 0);
  broken.data[20] ^= 1;
  shorter.len = 32;
  other.id = 0x333;
  step_one(broken);
  step_one(shorter);
  step_one(other);
  CHECK(session.frames.bad == 2 && session.frames.foreign == 1, "%d bad", (int)session.frames.bad);
  CHECK(!session.glove_source.seen, "a broken frame was used");
}

static void test_unusable_samples(void) {
  start();
  step_one(glove(0, GV_GLOVE_LEFT, 0));
  CHECK(session.other_hand, "a left glove for a right hand is noticed");
  step_one(glove(0, GV_GLOVE_SENSOR_FAULT, 0));
  step_one(pose(GV_RECEIVER_HAND, 0.1, 0));
  step_one(pose(GV_RECEIVER_HAND, 0.1, GV_POSE_VALID | GV_POSE_TRACKER_ERROR));
  step_one(pose(GV_RECEIVER_HAND, 150, GV_POSE_VALID));
  CHECK(session.frames.unusable == 5, "%d unusable", (int)session.frames.unusable);
  CHECK(!session.glove_source.seen && !session.hand_source.seen, "used all the same");
  step_one(pose(GV_RECEIVER_HEAD, 1.7, GV_POSE_VALID));
  CHECK(session.head_seen && !session.hand_source.seen, "the head's receiver is not the hand's");
}

static void test_newest_of_several_wins(void) {
  start();
  gv_frame frame[3] = {glove(0.1, 0, 0), glove(0.2, 0, 0), glove(0.3, 0, 0)};
  step(frame, 3);
  double angle = gv_calibration_angle(&world.cfg.calibration, GV_INDEX_MPJ, session.sample.raw[GV_INDEX_MPJ]);
  CHECK_NEAR(angle, 0.3, 0.001);
}

// ---- ages and clocks ----------------------------------------------------------------------------------

// The state after a press whose frames come `delay_ms` late by their stamps, on a
// clock that starts at `origin_ns`.
static uint64_t hash_after_press(int64_t origin_ns, int64_t delay_ms) {
  start();
  now_ns = origin_ns;
  for (int i = 0; i < 300; i++) {
    gv_frame frame[2] = {glove(i < 50 ? 0.0 : 1.05, i < 25 ? 0 : GV_GLOVE_DEAD_MAN, 0),
                         pose(GV_RECEIVER_HAND, 0.06, GV_POSE_VALID)};
    frame[0].stamp_ns = frame[1].stamp_ns = now_ns + MS - delay_ms * MS;
    step(frame, 2);
  }
  return gv_engine_hash(world.engine);
}

static void test_simulation_sees_no_clock(void) {
  const uint64_t hash = hash_after_press(0, 0);
  CHECK(commanded_max() > 0.1, "a force flows: %g N", commanded_max());
  CHECK(hash_after_press(123456789012345, 0) == hash, "another clock");
  CHECK(hash_after_press(0, 200) == hash, "old frames");
  CHECK(commanded_max() == 0.0 && session.frames.late == 600, "but no force on old frames, %g N",
        commanded_max());
}

static void test_age_is_the_devices_and_the_wires(void) {
  start();
  gv_frame frame = glove(0, 0, 12340);
  now_ns += 3 * MS;
  step_one(frame);
  CHECK_NEAR(session.glove_age_s, 0.01634, 1e-9);
  CHECK(isinf(session.hand_age_s), "no pose yet");
  CHECK(session.frames.late == 0, "16 ms is not late");
  step_one(glove(0, 0, 60000));
  CHECK(session.frames.late == 1, "60 ms is");
}

// ---- forces -------------------------------------------------------------------------------------------

static void test_force_needs_the_dead_man_switch(void) {
  start();
  press(50, 0.0, 0);
  press(300, 1.05, 0);
  CHECK(session.result.tension_n[1] > 0.3, "the finger is pressed: %g N wanted", session.result.tension_n[1]);
  CHECK(session.force_max_n[1] == 0.0, "%g N left", session.force_max_n[1]);
  press_until_force();
  press(30, 1.05, 0);
  CHECK(commanded_max() == 0.0, "%g N after letting go", commanded_max());
}

static void test_device_must_report_the_switch_too(void) {
  press_until_force();
  step_one(status(GV_STATUS_DEAD_MAN));
  CHECK(session.safety.state == GV_SAFETY_ACTIVE, "%s", gv_safety_name(session.safety.state));
  step_one(status(0));
  press(30, 1.05, GV_GLOVE_DEAD_MAN);
  CHECK(session.safety.state != GV_SAFETY_ACTIVE && commanded_max() == 0.0, "%g N", commanded_max());
}

static void test_silence_is_a_fault_and_ends_the_force(void) {
  press_until_force();
  for (int i = 0; i < 70; i++)
    step(NULL, 0);
  CHECK(session.safety.state == GV_SAFETY_FAULT, "%s", gv_safety_name(session.safety.state));
  CHECK(commanded_max() == 0.0, "%g N", commanded_max());
  CHECK(session.faults_seen & GV_FAULT_GLOVE_STALE, "the reason is kept");
}

// Frames as fresh as ever, the finger pressed; stamps that go on, or stand still,
// for the glove and for the hand.
static void press_with_stamps(int count, int64_t tick_ns, bool freeze_glove, bool freeze_hand) {
  gv_glove_msg g;
  gv_pose_msg p;
  for (int i = 0; i < count; i++) {
    gv_frame frame[2] = {glove(1.05, GV_GLOVE_DEAD_MAN, 0), pose(GV_RECEIVER_HAND, 0.06, GV_POSE_VALID)};
    CHECK(gv_fcu_unpack_glove(&frame[0], &g) == 0 && gv_fcu_unpack_pose(&frame[1], &p) == 0, "decodes");
    const uint32_t coarse = (uint32_t)(now_ns / tick_ns * tick_ns / 1000);
    g.stamp_us = freeze_glove ? 7 : coarse;
    p.stamp_us = freeze_hand ? 7 : coarse;
    gv_fcu_pack_glove(&g, &frame[0]);
    gv_fcu_pack_pose(&p, &frame[1]);
    step(frame, 2);
  }
}

static void test_a_clock_that_stands_still_ends_the_force(void) {
  for (int which = 0; which < 2; which++) {
    press_until_force();
    press_with_stamps(95, MS, which == 0, which == 1);
    CHECK(session.safety.state == GV_SAFETY_ACTIVE, "too early: %s", gv_safety_name(session.safety.state));
    press_with_stamps(26, MS, which == 0, which == 1);
    CHECK(session.safety.state == GV_SAFETY_FAULT && commanded_max() == 0.0, "%g N", commanded_max());
    CHECK(session.faults_seen == (which == 0 ? GV_FAULT_GLOVE_STALE : GV_FAULT_TRACKER_STALE), "faults %x",
          session.faults_seen);
  }
}

static void test_a_coarse_clock_is_no_fault(void) {
  press_until_force();
  press_with_stamps(500, 48 * MS, false, false);
  CHECK(session.safety.state == GV_SAFETY_ACTIVE && commanded_max() > 0.3, "%s",
        gv_safety_name(session.safety.state));
}

static void test_after_a_pause_forces_start_from_none(void) {
  press_until_force();
  const double before = commanded_max();
  const double rise = session.cfg.limiter.slew_n_per_s * session.cfg.period_s;
  for (unsigned skipped = 0; skipped < 8; skipped++) {
    press(20, 1.05, GV_GLOVE_DEAD_MAN);
    const gv_frame frame[2] = {glove(1.05, GV_GLOVE_DEAD_MAN, 0),
                               pose(GV_RECEIVER_HAND, 0.06, GV_POSE_VALID)};
    now_ns += (1 + skipped) * MS;
    gv_session_step(&session, now_ns, frame, 2, skipped, &command);
    const bool let_go = skipped + 1 >= 5;
    CHECK(let_go ? commanded_max() <= rise : commanded_max() > 0.8 * before, "%u skipped: %g N", skipped,
          commanded_max());
  }
}

// ---- what a force depends on has an age, and may say itself that it is in doubt --------------------------

// Pressing on, with a status every 10 ms while `status_flags` is not negative. Returns the milliseconds
// until the command is zero; -1: never.
static int ms_until_zero(int count, int status_flags, uint8_t glove_flags, uint8_t pose_flags) {
  for (int i = 0; i < count; i++) {
    gv_frame frame[3] = {glove(1.05, glove_flags, 0), pose(GV_RECEIVER_HAND, 0.06, pose_flags)};
    const bool with_status = status_flags >= 0 && i % 10 == 0;
    if (with_status)
      frame[2] = status((uint8_t)status_flags);
    step(frame, with_status ? 3 : 2);
    if (commanded_max() == 0.0)
      return i + 1;
  }
  return -1;
}

static void press_with_status(void) {
  press_until_force();
  CHECK(ms_until_zero(300, GV_STATUS_DEAD_MAN, GV_GLOVE_DEAD_MAN, GV_POSE_VALID) < 0,
        "no force to begin with");
}

static void test_a_status_that_stays_away_ends_the_force(void) {
  press_with_status();
  const int ms = ms_until_zero(200, -1, GV_GLOVE_DEAD_MAN, GV_POSE_VALID);
  CHECK(ms > 0 && ms <= 50 + 15, "zero after %d ms", ms);  // two of its intervals, 30 ms, and the ramp
  CHECK(session.faults_seen == GV_FAULT_STATUS_STALE, "faults %x", session.faults_seen);
}

static void test_a_status_that_is_only_broken_ends_the_force(void) {
  press_with_status();
  int ms = -1;
  for (int i = 0; i < 200 && ms < 0; i++) {
    gv_frame frame[3] = {glove(1.05, GV_GLOVE_DEAD_MAN, 0), pose(GV_RECEIVER_HAND, 0.06, GV_POSE_VALID),
                         status(GV_STATUS_DEAD_MAN)};
    frame[2].data[5] ^= 1;
    step(frame, i % 10 == 0 ? 3 : 2);
    if (commanded_max() == 0.0)
      ms = i + 1;
  }
  CHECK(ms > 0 && ms <= 50 + 15, "zero after %d ms", ms);
}

static void test_the_age_allowed_follows_the_rate_of_the_source(void) {
  press_until_force();
  int ms = 0;
  for (; commanded_max() > 0.0 && ms < 100; ms++)
    step(NULL, 0);
  CHECK(ms <= 33 + 15, "a glove of 1 kHz: zero after %d ms", ms);
  press_until_force();
  for (int i = 0; i < 600; i++) {  // the same glove at 60 Hz: 40 ms without a frame are no fault
    const gv_frame frame[2] = {glove(1.05, GV_GLOVE_DEAD_MAN, 0),
                               pose(GV_RECEIVER_HAND, 0.06, GV_POSE_VALID)};
    step(frame, i % 16 == 0 ? 2 : 0);
    if (i % 16) {
      glove_counter--;
      pose_counter--;
    }
  }
  for (int i = 0; i < 25; i++)
    step(NULL, 0);
  CHECK(session.safety.state == GV_SAFETY_ACTIVE, "%s", gv_safety_name(session.safety.state));
}

static void test_a_device_in_doubt_ends_the_force_at_once(void) {
  static const struct {
    uint8_t glove, pose;
    uint32_t fault;
  } say[] = {
    {GV_GLOVE_DEAD_MAN | GV_GLOVE_SENSOR_FAULT, GV_POSE_VALID, GV_FAULT_SENSOR},
    {GV_GLOVE_DEAD_MAN | GV_GLOVE_LEFT, GV_POSE_VALID, GV_FAULT_OTHER_HAND},
    {GV_GLOVE_DEAD_MAN, GV_POSE_VALID | GV_POSE_TRACKER_ERROR, GV_FAULT_TRACKER},
    {GV_GLOVE_DEAD_MAN, 0, GV_FAULT_TRACKER},
  };
  for (size_t i = 0; i < sizeof say / sizeof *say; i++) {
    press_until_force();
    const int ms = ms_until_zero(100, -1, say[i].glove, say[i].pose);
    CHECK(ms > 0 && ms <= 15, "case %zu: zero after %d ms", i, ms);
    CHECK(session.faults_seen == say[i].fault, "case %zu: faults %x", i, session.faults_seen);
    press(50, 0.0, 0);  // the cause is gone and the switch let go: it may arm again
    CHECK(session.safety.state == GV_SAFETY_READY, "case %zu: %s", i, gv_safety_name(session.safety.state));
  }
}

static void test_every_fault_has_its_words(void) {
  for (uint32_t bit = 1; bit <= GV_FAULT_TRACKER; bit <<= 1)
    CHECK(strcmp(gv_fault_text(bit), "none") != 0, "fault %x", bit);
}

static void test_an_open_switch_counts_in_any_sound_frame(void) {
  press_until_force();
  step_one(glove(1.05, GV_GLOVE_SENSOR_FAULT | GV_GLOVE_DEAD_MAN, 0));
  CHECK(session.safety.state == GV_SAFETY_FAULT && !session.safety.released, "held in the fault");
  step_one(glove(1.05, GV_GLOVE_SENSOR_FAULT, 0));
  CHECK(session.safety.released, "it was let go in a frame that says sensor fault");
  press_until_force();
  gv_frame old = glove(1.05, 0, 0);  // overtaken by the frames after it
  press(1, 1.05, GV_GLOVE_DEAD_MAN);
  now_ns += MS;
  gv_session_step(&session, now_ns, &old, 1, 0, &command);
  CHECK(session.safety.state == GV_SAFETY_READY, "overtaken: %s", gv_safety_name(session.safety.state));
}

// ---- the rise on the wire ------------------------------------------------------------------------------

// Steps that are late by turns: 1.9 ms, 0.1 ms, 1.9 ms.
// One frame in doubt among many of a step, and the newest one sound again: at 100 Hz a step
// takes ten frames of a glove of 1 kHz.
static void test_a_doubt_counts_in_any_sound_frame(void) {
  for (int i = 0; i < 3; i++) {
    press_until_force();
    const uint8_t held = GV_GLOVE_DEAD_MAN;
    step_one(status(GV_STATUS_DEAD_MAN));
    const gv_frame bad = i == 0   ? glove(1.05, held | GV_GLOVE_SENSOR_FAULT, 0)
                         : i == 1 ? pose(GV_RECEIVER_HAND, 0.06, GV_POSE_TRACKER_ERROR)
                                  : status(GV_STATUS_DEAD_MAN | GV_STATUS_FAULT);
    const gv_frame frame[4] = {bad, glove(1.05, held, 0), pose(GV_RECEIVER_HAND, 0.06, GV_POSE_VALID),
                               status(GV_STATUS_DEAD_MAN)};
    step(frame, 4);
    CHECK(session.safety.state == GV_SAFETY_FAULT, "case %d: %s", i, gv_safety_name(session.safety.state));
  }
}

// Milliseconds of repeated commands until there is no force, in a long wait for the next step; 100: it stays.
static int ms_of_repeats_until_zero(void) {
  for (int ms = 1; ms < 100; ms++) {
    now_ns += MS;
    gv_session_command(&session, now_ns, &command);
    if (commanded_max() <= 0.0)
      return ms;
  }
  return 100;
}

// Commands go on between two steps; what comes meanwhile need not wait for the step to end the force.
static void test_what_waits_for_the_step_ends_the_force(void) {
  for (int i = 0; i < 5; i++) {
    press_until_force();
    const uint8_t held = GV_GLOVE_DEAD_MAN;
    const gv_frame say[5] = {glove(1.05, 0, 0), glove(1.05, held | GV_GLOVE_SENSOR_FAULT, 0),
                             glove(1.05, held | GV_GLOVE_LEFT, 0), pose(GV_RECEIVER_HAND, 0.06, 0),
                             status(GV_STATUS_DEAD_MAN | GV_STATUS_FAULT)};
    gv_session_heed(&session, &say[i], 1);
    const int ms = ms_of_repeats_until_zero();
    CHECK(ms <= 15, "case %d: zero after %d ms", i, ms);
  }
  press_until_force();
  const int ms = ms_of_repeats_until_zero();
  CHECK(ms >= 31 && ms <= 32 + 15, "silence: zero after %d ms, 32 ms and the ramp are allowed", ms);
}

static void test_a_late_wake_up_never_steepens_the_rise(void) {
  press_until_force();
  press(30, 1.05, 0);
  press(30, 0.0, GV_GLOVE_DEAD_MAN);
  const double slew = session.cfg.limiter.slew_n_per_s;
  double last = commanded_max();
  double steepest = 0.0;
  for (int i = 0; i < 60; i++) {
    const int64_t passed_ns = i % 2 ? MS / 10 : 2 * MS - MS / 10;
    const gv_frame frame[2] = {glove(1.4, GV_GLOVE_DEAD_MAN, 0),
                               pose(GV_RECEIVER_HAND, 0.045, GV_POSE_VALID)};
    now_ns += passed_ns;
    gv_session_step(&session, now_ns, frame, 2, 0, &command);
    const double rise = commanded_max() - last;
    const double allowed = slew * fmin((double)passed_ns * 1e-9, session.cfg.period_s);
    CHECK(rise <= allowed + GV_TENSION_LSB_N, "%g N in %g ms", rise, (double)passed_ns * 1e-6);
    steepest = fmax(steepest, rise / allowed);
    last = commanded_max();
  }
  CHECK(steepest > 0.5, "the force did not rise: %g", steepest);
}

static void test_device_fault_ends_the_force(void) {
  press_until_force();
  step_one(status(GV_STATUS_FAULT | GV_STATUS_DEAD_MAN));
  CHECK(session.safety.state == GV_SAFETY_FAULT, "%s", gv_safety_name(session.safety.state));
  press(20, 1.05, GV_GLOVE_DEAD_MAN);
  CHECK(commanded_max() == 0.0, "%g N", commanded_max());
}

static void test_broken_frames_end_the_force(void) {
  press_until_force();
  for (int i = 0; i < 40; i++) {
    gv_frame frame[3] = {glove(1.05, GV_GLOVE_DEAD_MAN, 0), pose(GV_RECEIVER_HAND, 0.06, GV_POSE_VALID),
                         glove(1.05, GV_GLOVE_DEAD_MAN, 0)};
    frame[2].data[12] ^= 0x10;
    glove_counter--;
    step(frame, 3);
  }
  CHECK(session.safety.state == GV_SAFETY_FAULT && commanded_max() == 0.0, "%s, %g N",
        gv_safety_name(session.safety.state), commanded_max());
}

// The frames are those that the device sent just before the step: their stamps are fresh.
static void press_after_stall(unsigned periods_skipped) {
  now_ns += (int64_t)periods_skipped * MS;
  const gv_frame frame[2] = {glove(1.05, GV_GLOVE_DEAD_MAN, 0), pose(GV_RECEIVER_HAND, 0.06, GV_POSE_VALID)};
  now_ns += MS;
  gv_session_step(&session, now_ns, frame, 2, periods_skipped, &command);
}

static void test_stalls(void) {
  press_until_force();
  for (int i = 0; i < 3; i++)
    press_after_stall(32);
  CHECK(session.safety.state == GV_SAFETY_ACTIVE, "three short stalls: %s",
        gv_safety_name(session.safety.state));
  press_after_stall(60);
  CHECK(session.safety.state == GV_SAFETY_FAULT, "a stall longer than any sample may be old: %s",
        gv_safety_name(session.safety.state));
  CHECK(session.faults_seen == GV_FAULT_OVERRUN, "and not for old data: faults %x", session.faults_seen);
  press_until_force();
  for (int i = 0; i < 40; i++)
    press_after_stall(1);
  CHECK(session.safety.state == GV_SAFETY_FAULT, "every second period: %s",
        gv_safety_name(session.safety.state));
  CHECK(session.faults_seen == GV_FAULT_OVERRUN, "faults %x", session.faults_seen);
}

static void test_stop_ramps_to_zero(void) {
  press_until_force();
  const int limit = (int)ceil(session.cfg.limiter.ramp_s * 1e3) + 1;
  double last = commanded_max();
  const uint64_t steps = gv_engine_counters(world.engine)->steps;
  int periods = 0;
  for (bool zero = false; !zero && periods < 100; periods++) {
    now_ns += MS;
    zero = gv_session_stop(&session, now_ns, &command);
    CHECK(commanded_max() <= last, "rose from %g to %g N", last, commanded_max());
    last = commanded_max();
  }
  CHECK(last == 0.0 && periods <= limit, "zero after %d ms, allowed %d", periods, limit);
  CHECK(session.safety.state == GV_SAFETY_STOPPED, "%s", gv_safety_name(session.safety.state));
  CHECK(gv_engine_counters(world.engine)->steps == steps, "ending steps the engine");
}

static void test_command_tells_its_sample(void) {
  start();
  now_ns = 7 * MS;
  step_one(glove(0, 0, 2000));
  gv_command_msg msg;
  CHECK(gv_fcu_unpack_command(&command, &msg) == GV_FCU_OK, "does not decode");
  CHECK(msg.sample_stamp_us == 7000 && msg.age_us == 3000, "stamp %u age %u us", msg.sample_stamp_us,
        msg.age_us);
  const uint8_t counter = msg.counter;
  step(NULL, 0);
  gv_fcu_unpack_command(&command, &msg);
  CHECK(msg.counter == (uint8_t)(counter + 1), "the counter counts");
}

// Random bytes, random ids, broken copies of sound frames: every command decodes and stays in its limits.
// A live loop that is late, with the observer of the fingers: the tensions that it reckons with hang on the
// clock. With them in the recording's frames, a replay that knows no clock gives the same bits; without,
// others.
static gv_pull_msg pulls[500];

static uint64_t observed_hash(bool late, bool replay) {
  start();
  gv_engine_close(world.engine);
  world.cfg.finger.observed = true;
  lab_run(&world);
  session.engine = world.engine;
  session.cfg.replay = replay;
  for (int i = 0; i < 500; i++) {
    gv_frame frame[3] = {glove(i < 50 ? 0.0 : 1.05, i < 25 ? 0 : GV_GLOVE_DEAD_MAN, 0),
                         pose(GV_RECEIVER_HAND, 0.06, GV_POSE_VALID)};
    const unsigned skipped = late && i >= 300 && i % 50 == 0 ? 6 : 0;
    gv_fcu_pack_pull(&pulls[i], &frame[2]);
    now_ns += (1 + skipped) * MS;
    gv_session_step(&session, now_ns, frame, replay ? 3 : 2, skipped, &command);
    memcpy(pulls[i].tension_n, session.sample.tension_n, sizeof pulls[i].tension_n);
  }
  return gv_engine_hash(world.engine);
}

static void test_a_late_loop_with_an_observer_replays_to_the_same_bits(void) {
  const uint64_t live = observed_hash(true, false);
  CHECK(observed_hash(false, true) == live, "a replay differs");
  CHECK(session.frames.foreign == 0 && session.frames.rx == 1000,
        "a PULL frame counts as one of the device's");
  CHECK(observed_hash(false, false) != live, "the clock makes no difference: this tests nothing");
}

static void test_random_frames(void) {
  unsigned long long random = 11;
  press_until_force();
  for (int i = 0; i < 3000; i++) {
    gv_frame frame = i % 3 ? glove(check_uniform(&random, -1.5, 1.5), GV_GLOVE_DEAD_MAN, 0)
                           : pose(GV_RECEIVER_HAND, check_uniform(&random, -0.1, 0.3), GV_POSE_VALID);
    for (int k = (int)check_uniform(&random, 0, 4); k > 0; k--)
      frame.data[(int)check_uniform(&random, 0, 64)] = (uint8_t)check_uniform(&random, 0, 256);
    if (i % 7 == 0)
      frame.len = (uint8_t)check_uniform(&random, 0, 65);
    if (i % 11 == 0)
      frame.id = (uint32_t)check_uniform(&random, 0, 0x800);
    if (i % 13 == 0)
      frame.stamp_ns = (int64_t)check_uniform(&random, -1e18, 1e18);
    step_one(frame);
    CHECK(commanded_max() <= session.cfg.limiter.max_n + GV_TENSION_LSB_N, "%g N", commanded_max());
  }
  CHECK(session.frames.bad > 500, "%d bad", (int)session.frames.bad);
}

int main(void) {
  RUN(test_gaps_count_as_lost);
  RUN(test_ids_count_by_themselves);
  RUN(test_doubled_and_overtaken_are_dropped);
  RUN(test_a_late_frame_takes_its_loss_back);
  RUN(test_a_gap_is_an_error_when_its_time_is_over);
  RUN(test_one_poll_is_taken_in_order);
  RUN(test_cannelloni_that_stalls_is_no_fault);
  RUN(test_losses_end_the_force);
  RUN(test_one_doubled_frame_is_no_error_many_are);
  RUN(test_a_restarted_device_is_taken_again);
  RUN(test_broken_frames_are_counted_and_dropped);
  RUN(test_unusable_samples);
  RUN(test_newest_of_several_wins);
  RUN(test_simulation_sees_no_clock);
  RUN(test_age_is_the_devices_and_the_wires);
  RUN(test_force_needs_the_dead_man_switch);
  RUN(test_device_must_report_the_switch_too);
  RUN(test_silence_is_a_fault_and_ends_the_force);
  RUN(test_a_clock_that_stands_still_ends_the_force);
  RUN(test_a_coarse_clock_is_no_fault);
  RUN(test_after_a_pause_forces_start_from_none);
  RUN(test_a_status_that_stays_away_ends_the_force);
  RUN(test_a_status_that_is_only_broken_ends_the_force);
  RUN(test_the_age_allowed_follows_the_rate_of_the_source);
  RUN(test_a_device_in_doubt_ends_the_force_at_once);
  RUN(test_every_fault_has_its_words);
  RUN(test_an_open_switch_counts_in_any_sound_frame);
  RUN(test_a_doubt_counts_in_any_sound_frame);
  RUN(test_what_waits_for_the_step_ends_the_force);
  RUN(test_a_late_wake_up_never_steepens_the_rise);
  RUN(test_device_fault_ends_the_force);
  RUN(test_broken_frames_end_the_force);
  RUN(test_stalls);
  RUN(test_stop_ramps_to_zero);
  RUN(test_command_tells_its_sample);
  RUN(test_a_late_loop_with_an_observer_replays_to_the_same_bits);
  RUN(test_random_frames);
  return check_done();
}
