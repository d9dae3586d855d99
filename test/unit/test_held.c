// SPDX-License-Identifier: BSD-3-Clause
// How far an object moved in the hand while it was held: what closing, lifting and
// letting go move does not count.
#include "daemon/tell/held.h"
#include "support/check.h"

#include <math.h>
#include <string.h>

static gv_snapshot s;
static gv_object object[2];
static gv_scene scene;
static gv_held held;

static void start(void) {
  memset(&s, 0, sizeof s);
  memset(&held, 0, sizeof held);
  object[0].is_static = true;
  scene = (gv_scene){.object = object, .object_count = 2};
  s.object_count = 2;
  for (int i = 0; i < 2; i++)
    s.object[i].T_world_body = gv_pose_identity();
  for (int i = 0; i < GV_LIMBS; i++)
    s.limb[i].T_world_limb = gv_pose_identity();
}

// The palm goes up to `to_m` with the object; `drift_m_s` is the object's own way in
// the hand; `limbs` touch it.
static void go(double seconds, double to_m, double drift_m_s, int limbs) {
  const double from_m = s.limb[GV_LIMB_PALM].T_world_limb.p.z;
  const double step_s = 0.02;
  const int count = (int)lround(seconds / step_s);
  s.contact_count = limbs;
  for (int i = 0; i < limbs; i++) {
    s.contact[i].limb = i;
    s.contact[i].object = 1;
  }
  for (int i = 1; i <= count; i++) {
    const double up_m = (to_m - from_m) / count;
    s.time_s += step_s;
    s.limb[GV_LIMB_PALM].T_world_limb.p.z += up_m;
    s.object[1].T_world_body.p.z += up_m;
    s.object[1].T_world_body.p.x += drift_m_s * step_s;
    gv_held_snapshot(&held, &scene, &s);
  }
}

static void test_what_lies_on_the_table_is_not_held(void) {
  start();
  go(5, 0, 0.001, 3);
  CHECK(held.object[1].seconds <= 0 && held.object[1].moved_m <= 0, "%g s, %g m", held.object[1].seconds,
        held.object[1].moved_m);
}

static void test_lifting_and_letting_go_do_not_count(void) {
  start();
  go(1, 0, 0, 3);
  go(1, 0.15, 0.02, 3);   // while lifted it settles by 20 mm
  go(10, 0.15, 1e-5, 3);  // then it creeps by 0.1 mm
  go(0.3, 0.15, 0.1, 2);  // the fingers open
  go(2, 0.15, 0.5, 0);
  const gv_held_object *o = &held.object[1];
  CHECK(o->seconds > 8.5 && o->seconds < 10.0, "held for %g s", o->seconds);
  CHECK(o->moved_m > 0.8e-4 && o->moved_m < 1.01e-4, "moved %g m", o->moved_m);
  CHECK(fabs(o->lift_m - 0.15) < 1e-9, "lifted %g m", o->lift_m);
}

static void test_what_drops_is_held_until_then(void) {
  start();
  go(1, 0.15, 0, 3);
  go(4, 0.15, 0.004, 3);  // it slides all the time
  go(1, 0.15, 0.004, 1);  // and hangs on one limb
  CHECK(held.object[1].moved_m > 0.010, "a slide of 4 mm/s is %g m", held.object[1].moved_m);
}

static void test_two_grasps_are_one_sum(void) {
  start();
  go(1, 0.15, 0, 3);
  go(3, 0.15, 1e-4, 3);
  go(1, 0.15, 0, 0);
  go(3, 0.15, 0, 3);
  const gv_held_object *o = &held.object[1];
  CHECK(o->seconds > 3.5 && o->seconds < 5.0, "held for %g s", o->seconds);
  CHECK(o->moved_m > 1.5e-4 && o->moved_m < 3e-4, "moved %g m", o->moved_m);
}

static void test_an_object_that_a_hand_carries_about_is_held(void) {
  start();
  go(1, 0.15, 0, 3);
  go(2, 0.15, 0, 3);
  go(1, 0.30, 0, 3);  // once it counts, carrying does, too
  go(1, 0.30, 0, 3);
  CHECK(held.object[1].seconds > 2.9 && held.object[1].lift_m > 0.29, "%g s, %g m", held.object[1].seconds,
        held.object[1].lift_m);
}

int main(void) {
  RUN(test_what_lies_on_the_table_is_not_held);
  RUN(test_lifting_and_letting_go_do_not_count);
  RUN(test_what_drops_is_held_until_then);
  RUN(test_two_grasps_are_one_sum);
  RUN(test_an_object_that_a_hand_carries_about_is_held);
  return check_done();
}
