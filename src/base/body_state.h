// SPDX-License-Identifier: BSD-3-Clause
// Where a rigid body is and how it moves, in the world's frame: a limb, an object, or
// the frame that drives a limb.
#ifndef GLOVED_BASE_BODY_STATE_H
#define GLOVED_BASE_BODY_STATE_H

#include "gloved/math.h"

typedef struct gv_body_state {
  gv_pose T;  // T_world_body, metres
  gv_vec3 v;  // of its origin, m/s
  gv_vec3 w;  // angular velocity, rad/s
} gv_body_state;

#endif
