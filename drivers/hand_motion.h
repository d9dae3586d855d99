// SPDX-License-Identifier: BSD-3-Clause
// How a hand without a glove goes to where it was told: critically damped, never faster than a hand that
// knows what it wants (0.5 m/s, 3 rad/s, from open to closed in 0.4 s), so that targets may jump and the
// gates for jumps have nothing to hold back. Steps of 1 ms; no clock, no heap; the same inputs give the same
// motion, bit by bit.
#ifndef DRIVERS_HAND_MOTION_H
#define DRIVERS_HAND_MOTION_H

#include "gloved/sim.h"
#include "wire/hand_input.h"

typedef struct hand_motion {
  gv_sim_script way;  // where it starts, and the keyframes from open to closed
  gv_pose target, T_world_wrist;
  gv_vec3 velocity, turning;  // of the wrist, in the world
  double target_grip[GV_FINGERS], grip[GV_FINGERS], grip_rate[GV_FINGERS];
  bool dead_man;
} hand_motion;

// At the start of `way`, the hand open, the switch open.
void gv_hand_motion_init(hand_motion *m, const gv_sim_script *way);
// New targets (not those of GV_HAND_INPUT_ASK).
void gv_hand_motion_take(hand_motion *m, const gv_hand_input *in);
// Nobody is heard any more: the switch opens, and the hand stays where it is.
void gv_hand_motion_leave(hand_motion *m);
// One millisecond on.
void gv_hand_motion_step(hand_motion *m);
// What the user does now.
gv_sim_keyframe gv_hand_motion_now(const hand_motion *m);

#endif
