// SPDX-License-Identifier: BSD-3-Clause
// Objects that lie still and alone are not simulated, and have no pairs, until something that moves comes
// near. Memory of the caller; real-time thread.
#ifndef GLOVED_COLLISION_REST_H
#define GLOVED_COLLISION_REST_H

#include "collision/broad.h"

typedef struct gv_rest {
  int still_steps[GV_MAX_OBJECTS];  // how long an object has not moved
  bool resting[GV_MAX_OBJECTS];
  int moving_count;
  int moving[GV_MAX_OBJECTS];  // objects that are simulated in this step, in their order
} gv_rest;

// The objects that move: neither static nor at rest.
void gv_rest_list_moving(gv_rest *rest, const gv_scene *scene);
// True where it was at rest.
bool gv_rest_wake(gv_rest *rest, int object);
// Has something that moves come near an object at rest? hand: there is one.
bool gv_rest_is_disturbed(const gv_rest *rest, const gv_broad *broad, bool hand, int object);
// At the step's end, with the object's state then. True where it has been still for `enough` steps, no limb
// near, and is at rest from now on.
bool gv_rest_lies_still(gv_rest *rest, const gv_broad *broad, bool hand, int object,
                        const gv_body_state *state, int enough);

#endif
