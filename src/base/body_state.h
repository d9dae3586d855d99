// SPDX-License-Identifier: BSD-3-Clause
// Where a rigid body is and how it moves, in the world's frame: a limb, an object, or
// the frame that drives a limb.
#ifndef GLOVED_BASE_BODY_STATE_H
#define GLOVED_BASE_BODY_STATE_H

#include <stdbool.h>

#include "gloved/limits.h"
#include "gloved/math.h"

// Bodies are numbered: the first hand's limbs from 0 on, the scene's objects, the limbs of a second hand.
static inline int gv_body_of_second_hand(int objects) { return GV_LIMBS + objects; }
static inline bool gv_body_is_limb(int body, int second_hand) {
  return body < GV_LIMBS || body >= second_hand;
}

typedef struct gv_body_state {
  gv_pose T;  // T_world_body, metres
  gv_vec3 v;  // of its origin, m/s
  gv_vec3 w;  // angular velocity, rad/s
} gv_body_state;

#endif
