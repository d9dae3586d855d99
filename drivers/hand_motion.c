// SPDX-License-Identifier: BSD-3-Clause
// The motion of a hand without a glove (hand_motion.h): x'' = w^2 (target - x) - 2 w x', with the speed held
// within a bound; integrated semi-implicitly. Pure.
#include "drivers/hand_motion.h"

#include <assert.h>
#include <string.h>

static const double step_s = 0.001, omega = 25.0;
static const double fastest_m_s = 0.5, fastest_rad_s = 3.0, fastest_grip_s = 2.5;

// Which finger's grip a sensor follows; -1: none (the wrist's own joints).
static int finger_of(int sensor) {
  if (sensor <= GV_THUMB_ABDUCTION)
    return 0;
  if (sensor <= GV_INDEX_DIJ || sensor == GV_MIDDLE_INDEX_ABDUCTION)
    return 1;
  if (sensor <= GV_MIDDLE_DIJ)
    return 2;
  if (sensor <= GV_RING_MIDDLE_ABDUCTION)
    return 3;
  return sensor <= GV_PALM_ARCH ? 4 : -1;
}

void gv_hand_motion_init(hand_motion *m, const gv_sim_script *way) {
  assert(way->keyframe_count > 0);
  memset(m, 0, sizeof *m);
  m->way = *way;
  m->target = m->T_world_wrist = way->keyframe[0].T_world_wrist;
}

void gv_hand_motion_take(hand_motion *m, const gv_hand_input *in) {
  const bool home = in->flags & GV_HAND_INPUT_HOME;
  m->target = home ? m->way.keyframe[0].T_world_wrist : in->T_world_wrist;
  m->dead_man = in->flags & GV_HAND_INPUT_DEAD_MAN;
  for (int f = 0; f < GV_FINGERS; f++)
    m->target_grip[f] = home ? 0.0 : in->grip[f];
}

void gv_hand_motion_leave(hand_motion *m) {
  m->dead_man = false;
  m->target = m->T_world_wrist;
  memcpy(m->target_grip, m->grip, sizeof m->target_grip);
}

// The next velocity towards an error, no longer than `fastest`.
static gv_vec3 approach(gv_vec3 velocity, gv_vec3 error, double fastest) {
  const gv_vec3 pull = gv_sub(gv_scale(error, omega * omega), gv_scale(velocity, 2.0 * omega));
  const gv_vec3 next = gv_mad(velocity, step_s, pull);
  const double speed = gv_norm(next);
  return speed > fastest ? gv_scale(next, fastest / speed) : next;
}

static void step_wrist(hand_motion *m) {
  const gv_vec3 way = gv_sub(m->target.p, m->T_world_wrist.p);
  const gv_vec3 turn = gv_quat_log(gv_quat_mul(m->target.q, gv_quat_conj(m->T_world_wrist.q)));
  m->velocity = approach(m->velocity, way, fastest_m_s);
  m->turning = approach(m->turning, turn, fastest_rad_s);
  m->T_world_wrist.p = gv_mad(m->T_world_wrist.p, step_s, m->velocity);
  const gv_quat turned = gv_quat_exp(gv_scale(m->turning, step_s));
  m->T_world_wrist.q = gv_quat_normalize(gv_quat_mul(turned, m->T_world_wrist.q));
}

static void step_grip(hand_motion *m, int f) {
  const double pull = omega * omega * (m->target_grip[f] - m->grip[f]) - 2.0 * omega * m->grip_rate[f];
  m->grip_rate[f] = gv_clamp(m->grip_rate[f] + step_s * pull, -fastest_grip_s, fastest_grip_s);
  m->grip[f] = gv_clamp(m->grip[f] + step_s * m->grip_rate[f], 0.0, 1.0);
}

void gv_hand_motion_step(hand_motion *m) {
  step_wrist(m);
  for (int f = 0; f < GV_FINGERS; f++)
    step_grip(m, f);
}

// The angle on the way from open to closed, straight from keyframe to keyframe.
static double angle_at(const gv_sim_script *way, int sensor, double grip) {
  const double at = grip * (way->keyframe_count - 1);
  const int from = (int)at;
  const int to = from + 1 < way->keyframe_count ? from + 1 : from;
  const double a = way->keyframe[from].angle_rad[sensor];
  return a + (at - from) * (way->keyframe[to].angle_rad[sensor] - a);
}

gv_sim_keyframe gv_hand_motion_now(const hand_motion *m) {
  gv_sim_keyframe now = {.T_world_wrist = m->T_world_wrist, .dead_man = m->dead_man};
  for (int i = 0; i < GV_SENSORS; i++) {
    const int finger = finger_of(i);
    now.angle_rad[i] = angle_at(&m->way, i, finger >= 0 ? m->grip[finger] : 0.0);
  }
  return now;
}
