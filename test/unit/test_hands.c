// SPDX-License-Identifier: BSD-3-Clause
// Two hands, each with a device, a limiter and a safety machine, over one engine: a fault in one lets both
// go, each hand's frames are its own, and what asks for rest asks it of both. And their two devices as one
// driver.
#include <string.h>

#include "daemon/loop/hands.h"
#include "gloved/drivers.h"
#include "support/check.h"
#include "support/lab.h"

enum { MS = 1000000, RIGHT = 0, LEFT = 1, FRAMES = 2 };

// A person's two gloves, their index fingers pressing on one table 0.4 m apart.
typedef struct person {
  uint8_t glove_counter, pose_counter, glove_flags;
  bool silent;
  double index_rad;
} person;

static lab world;
static gv_session session[GV_HANDS];
static person hand[GV_HANDS];
static int64_t now_ns;
static gv_frame command[GV_HANDS];

static void start(void) {
  gv_session_config cfg = {
    .limiter = gv_limiter_config_default(), .safety = gv_safety_config_default(), .period_s = 0.001};
  if (world.engine)
    gv_engine_close(world.engine);
  lab_start(&world);
  lab_box(&world, gv_v3(1, 1, 0.1), gv_v3(0, 0, -0.05), 0, 0.8);
  world.cfg.second = (gv_second_hand){.present = true,
                                      .hand = gv_hand_model_default(GV_LEFT),
                                      .calibration = world.cfg.calibration,
                                      .T_receiver_wrist = world.cfg.T_receiver_wrist};
  lab_run(&world);
  for (int i = 0; i < GV_HANDS; i++) {
    cfg.hand = i;
    cfg.side = i ? GV_LEFT : GV_RIGHT;
    gv_session_init(&session[i], &cfg, world.engine);
    hand[i] = (person){.glove_flags = i ? GV_GLOVE_LEFT : 0};
  }
  now_ns = 0;
}

static void put_frames(int which, gv_frame out[FRAMES]) {
  person *p = &hand[which];
  gv_glove_msg glove = {
    .counter = p->glove_counter++, .flags = p->glove_flags, .stamp_us = (uint32_t)(now_ns / 1000)};
  gv_pose_msg pose = {.counter = p->pose_counter++,
                      .flags = GV_POSE_VALID,
                      .receiver = GV_RECEIVER_HAND,
                      .stamp_us = (uint32_t)(now_ns / 1000),
                      .T_world_receiver = {{1, 0, 0, 0}, {0, which ? 0.2 : -0.2, 0.06}}};
  for (int i = 0; i < GV_SENSORS; i++)
    glove.raw[i] = (uint16_t)gv_clamp(
        gv_calibration_raw(&world.cfg.calibration, i, i == GV_INDEX_MPJ ? p->index_rad : 0.0), 0.0, 4095.0);
  gv_fcu_pack_glove(&glove, &out[0]);
  gv_fcu_pack_pose(&pose, &out[1]);
  for (int i = 0; i < FRAMES; i++) {
    out[i].stamp_ns = now_ns;
    out[i].flags |= which ? GV_FRAME_SECOND : 0;
  }
}

// Both hands' frames in one list, the second one's first, as the driver gives them.
static void run(int steps) {
  gv_frame frame[GV_HANDS * FRAMES];
  for (int s = 0; s < steps; s++) {
    int count = 0;
    now_ns += MS;
    for (int i = GV_HANDS - 1; i >= 0; i--) {
      if (hand[i].silent)
        continue;
      put_frames(i, &frame[count]);
      count += FRAMES;
    }
    gv_hands_compute(session, now_ns, frame, count, 0);
    gv_hands_command(session, now_ns, command);
  }
}

static void hold_switches(bool held) {
  for (int i = 0; i < GV_HANDS; i++)
    hand[i].glove_flags = (uint8_t)((i ? GV_GLOVE_LEFT : 0) | (held ? GV_GLOVE_DEAD_MAN : 0));
}

static double force_n(int which) {
  gv_command_msg msg;
  double most = 0;
  CHECK(gv_fcu_unpack_command(&command[which], &msg) == GV_FCU_OK, "hand %d: no command", which);
  for (int i = 0; i < GV_FINGERS; i++)
    most = fmax(most, msg.tension_n[i]);
  return most;
}

static void press_with_both(void) {
  start();
  run(50);
  hold_switches(true);
  run(50);
  hand[RIGHT].index_rad = hand[LEFT].index_rad = 1.05;
  run(300);
  for (int i = 0; i < GV_HANDS; i++) {
    CHECK(session[i].safety.state == GV_SAFETY_ACTIVE, "hand %d: %s", i,
          gv_safety_name(session[i].safety.state));
    CHECK(force_n(i) > 0.3, "hand %d: only %g N", i, force_n(i));
  }
}

// ---- each its own ---------------------------------------------------------------------------------------

static void test_both_feel_the_same_table(void) {
  press_with_both();
  CHECK(fabs(force_n(RIGHT) - force_n(LEFT)) < 0.02, "%g and %g N", force_n(RIGHT), force_n(LEFT));
  CHECK(!(command[RIGHT].flags & GV_FRAME_SECOND) && command[LEFT].flags & GV_FRAME_SECOND,
        "a command goes to its own device");
  for (int i = 0; i < GV_HANDS; i++)
    CHECK(session[i].frames.rx == FRAMES * 400 && session[i].frames.lost == 0 && session[i].frames.late == 0,
          "hand %d took %d frames", i, (int)session[i].frames.rx);
}

static void test_one_presses_and_the_other_rests(void) {
  press_with_both();
  hand[LEFT].index_rad = 0;
  run(300);
  CHECK(force_n(RIGHT) > 0.3, "the right one feels %g N", force_n(RIGHT));
  CHECK(force_n(LEFT) < 0.01, "the left one feels %g N", force_n(LEFT));
}

static void test_an_open_switch_is_its_own_hands(void) {
  press_with_both();
  hand[LEFT].glove_flags = GV_GLOVE_LEFT;
  run(40);
  CHECK(force_n(LEFT) <= 0 && session[LEFT].safety.state == GV_SAFETY_READY, "the left one still feels %g N",
        force_n(LEFT));
  CHECK(force_n(RIGHT) > 0.3 && session[RIGHT].safety.state == GV_SAFETY_ACTIVE, "the right one feels %g N",
        force_n(RIGHT));
}

static void test_a_second_device_that_never_came_hinders_nobody(void) {
  start();
  hand[LEFT].silent = true;
  run(50);
  hold_switches(true);
  run(50);
  hand[RIGHT].index_rad = 1.05;
  run(300);
  CHECK(force_n(RIGHT) > 0.3, "only %g N", force_n(RIGHT));
  CHECK(force_n(LEFT) <= 0 && session[LEFT].safety.state == GV_SAFETY_WAIT, "%s",
        gv_safety_name(session[LEFT].safety.state));
}

// ---- a fault in one -------------------------------------------------------------------------------------

// Steps from now until neither feels anything; both forces fall all the time.
static int steps_to_zero(void) {
  double before[GV_HANDS] = {force_n(RIGHT), force_n(LEFT)};
  int steps = 0;
  while ((force_n(RIGHT) > 0 || force_n(LEFT) > 0) && steps < 200) {
    run(1);
    steps++;
    for (int i = 0; i < GV_HANDS; i++) {
      CHECK(force_n(i) <= before[i], "hand %d: from %g to %g N", i, before[i], force_n(i));
      before[i] = force_n(i);
    }
  }
  return steps;
}

static void break_glove(int which) { hand[which].glove_flags |= GV_GLOVE_SENSOR_FAULT; }

static void test_a_fault_in_one_lets_both_go(void) {
  for (int broken = 0; broken < GV_HANDS; broken++) {
    const int other = 1 - broken;
    press_with_both();
    const double before_n = force_n(other);
    break_glove(broken);
    run(1);
    CHECK(force_n(other) < before_n, "hand %d: the same command still says %g N", other, force_n(other));
    const int steps = 1 + steps_to_zero();
    CHECK(steps <= 17, "hand %d's fault ended the forces after %d ms", broken, steps);
    CHECK(session[broken].safety.faults == GV_FAULT_SENSOR, "0x%x", session[broken].safety.faults);
    CHECK(session[other].safety.state == GV_SAFETY_FAULT &&
              session[other].safety.faults == GV_FAULT_OTHER_DEVICE,
          "hand %d: %s, 0x%x", other, gv_safety_name(session[other].safety.state),
          session[other].safety.faults);
    CHECK(gv_hands_at_fault(session) == &session[broken], "the wrong one is named");
  }
}

static void test_silence_of_one_lets_both_go(void) {
  press_with_both();
  hand[LEFT].silent = true;
  run(33 + 17);
  CHECK(force_n(RIGHT) <= 0 && force_n(LEFT) <= 0, "%g and %g N", force_n(RIGHT), force_n(LEFT));
}

// Neither fault keeps the other alive: mended, let go of and pressed again, both feel their forces.
static void test_both_come_back(void) {
  press_with_both();
  break_glove(LEFT);
  run(100);
  hold_switches(true);
  run(200);
  for (int i = 0; i < GV_HANDS; i++)
    CHECK(force_n(i) <= 0, "hand %d: a force before the switch was let go", i);
  hand[RIGHT].index_rad = hand[LEFT].index_rad = 0;
  hold_switches(false);
  run(300);
  for (int i = 0; i < GV_HANDS; i++)
    CHECK(session[i].safety.state == GV_SAFETY_READY, "hand %d: %s", i,
          gv_safety_name(session[i].safety.state));
  hold_switches(true);
  run(20);
  hand[RIGHT].index_rad = hand[LEFT].index_rad = 1.05;
  run(300);
  for (int i = 0; i < GV_HANDS; i++)
    CHECK(force_n(i) > 0.3, "hand %d: only %g N", i, force_n(i));
}

static void test_a_held_period_lets_both_go(void) {
  press_with_both();
  gv_frame frame[FRAMES];
  break_glove(LEFT);
  put_frames(LEFT, frame);
  now_ns += MS;
  const double before_n = force_n(RIGHT);
  gv_hands_hold(session, now_ns, frame, FRAMES);
  gv_hands_command(session, now_ns, command);
  CHECK(force_n(RIGHT) < before_n, "%g N", force_n(RIGHT));
}

// Where steps are far apart, a doubt does not wait for the next one.
static void test_a_doubt_between_two_steps_lets_both_go(void) {
  press_with_both();
  gv_frame frame[FRAMES];
  break_glove(LEFT);
  put_frames(LEFT, frame);
  now_ns += MS;
  const double before_n = force_n(RIGHT);
  gv_hands_heed(session, frame, FRAMES);
  gv_hands_command(session, now_ns, command);
  CHECK(force_n(RIGHT) < before_n && force_n(LEFT) < before_n, "%g and %g N", force_n(RIGHT), force_n(LEFT));
}

// ---- requests -------------------------------------------------------------------------------------------

static void test_requests(void) {
  const gv_request reset = {.kind = GV_REQUEST_RESET}, disarm = {.kind = GV_REQUEST_DISARM};
  press_with_both();
  hand[RIGHT].glove_flags = 0;
  run(100);
  CHECK(!gv_hands_request(session, &reset), "a reset while the left hand feels %g N", force_n(LEFT));
  hold_switches(true);
  run(20);
  CHECK(gv_hands_request(session, &disarm), "disarm is refused");
  run(20);
  for (int i = 0; i < GV_HANDS; i++)
    CHECK(force_n(i) <= 0 && session[i].safety.state == GV_SAFETY_READY, "hand %d: %g N", i, force_n(i));
  CHECK(gv_hands_request(session, &reset), "a reset with no force is refused");
}

static void test_stop(void) {
  press_with_both();
  int steps = 0;
  bool done = false;
  while (!done && ++steps < 100)
    done = gv_hands_stop(session, now_ns += MS, command);
  CHECK(steps <= 17 && force_n(RIGHT) <= 0 && force_n(LEFT) <= 0, "%d steps", steps);
  for (int i = 0; i < GV_HANDS; i++)
    CHECK(session[i].safety.state == GV_SAFETY_STOPPED, "hand %d", i);
}

// ---- two devices as one driver --------------------------------------------------------------------------

typedef struct fake {
  int waiting;  // frames
  int sent;
  uint8_t sent_flags;
  bool ended, closed, tells;
} fake;

static int fake_poll(void *self, int64_t at_ns, gv_frame *out, int max) {
  fake *f = self;
  const int count = f->waiting < max ? f->waiting : max;
  for (int i = 0; i < count; i++)
    out[i] = (gv_frame){.stamp_ns = at_ns, .id = GV_ID_GLOVE, .flags = GV_FRAME_FD};
  f->waiting -= count;
  return count;
}

static int fake_send(void *self, const gv_frame *frame, int count) {
  fake *f = self;
  f->sent += count;
  f->sent_flags |= frame->flags;
  return 0;
}

static bool fake_ended(void *self) { return ((fake *)self)->ended; }
static gv_driver_stats fake_stats(void *self) {
  return (gv_driver_stats){.tx = (uint64_t)((fake *)self)->sent};
}
static void fake_close(void *self) { ((fake *)self)->closed = true; }
static bool fake_tell(void *self, int64_t at_ns, char *out, size_t size) {
  (void)at_ns;
  snprintf(out, size, "unplugged; plug it in");
  return ((fake *)self)->tells;
}

static void test_two_devices_are_one_driver(void) {
  static gv_frame frame[100];
  char text[100] = "";
  fake device[2] = {{.waiting = 1000}, {.waiting = 10}};
  gv_driver one[2], both;
  for (int i = 0; i < 2; i++)
    one[i] = (gv_driver){&device[i], fake_poll, fake_send, fake_ended, fake_stats,
                         fake_close, NULL,      0,         fake_tell};
  CHECK(gv_two_hands_open(one[0], one[1], false, &both, text, sizeof text) == 0, "%s", text);
  int own[2] = {0, 0};
  int count = both.poll(both.self, 0, frame, 100);
  for (int i = 0; i < count; i++)
    own[frame[i].flags & GV_FRAME_SECOND ? 1 : 0]++;
  CHECK(count == 100 && own[1] == 10, "in a flood of the first the second has %d frames", own[1]);
  device[0].waiting = 10;
  device[1].waiting = 1000;
  count = both.poll(both.self, 0, frame, 100);
  CHECK(count == 60, "in a flood of the second the first has %d frames", count - 50);
  const gv_frame out[2] = {{.flags = GV_FRAME_FD}, {.flags = GV_FRAME_FD | GV_FRAME_SECOND}};
  CHECK(both.send(both.self, out, 2) == 0 && device[0].sent == 1 && device[1].sent == 1, "%d and %d sent",
        device[0].sent, device[1].sent);
  CHECK(!(device[1].sent_flags & GV_FRAME_SECOND), "the mark leaves the process");
  CHECK(both.stats(both.self).tx == 2, "counters add up");
  device[1].tells = true;
  CHECK(both.tell(both.self, 0, text, sizeof text) && strcmp(text, "second hand: unplugged; plug it in") == 0,
        "%s", text);
  CHECK(!both.ended(both.self), "ended");
  device[1].ended = true;
  CHECK(both.ended(both.self), "either ends both");
  both.close(both.self);
  CHECK(device[0].closed && device[1].closed, "closed");
}

int main(void) {
  RUN(test_both_feel_the_same_table);
  RUN(test_one_presses_and_the_other_rests);
  RUN(test_an_open_switch_is_its_own_hands);
  RUN(test_a_second_device_that_never_came_hinders_nobody);
  RUN(test_a_fault_in_one_lets_both_go);
  RUN(test_silence_of_one_lets_both_go);
  RUN(test_both_come_back);
  RUN(test_a_held_period_lets_both_go);
  RUN(test_a_doubt_between_two_steps_lets_both_go);
  RUN(test_requests);
  RUN(test_stop);
  RUN(test_two_devices_are_one_driver);
  return check_done();
}
