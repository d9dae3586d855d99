// SPDX-License-Identifier: BSD-3-Clause
// Which objects are simulated. An object that has not moved for a while and has no limb near it is left
// alone; the box of something that moves, or of a limb, wakes it. Cost: 10 instructions an object at rest and
// moving body.
#include "collision/rest.h"

#include <assert.h>

// Slower than this all the time, a body is held still by what it lies on (or by nothing, without gravity).
static const double still_m_s = 1e-4;

void gv_rest_list_moving(gv_rest *rest, const gv_scene *scene) {
  rest->moving_count = 0;
  for (int o = 0; o < scene->object_count; o++)
    if (!scene->object[o].is_static && !rest->resting[o])
      rest->moving[rest->moving_count++] = o;
}

bool gv_rest_wake(gv_rest *rest, int o) {
  assert(o >= 0 && o < GV_MAX_OBJECTS);
  bool rested = rest->resting[o];
  rest->still_steps[o] = 0;
  rest->resting[o] = false;
  return rested;
}

bool gv_rest_is_disturbed(const gv_rest *rest, const gv_broad *broad, bool hand, int o) {
  assert(o >= 0 && o < GV_MAX_OBJECTS);
  if (hand && gv_broad_hand_is_near(broad, o))
    return true;
  for (int i = 0; i < rest->moving_count; i++) {
    const int other = rest->moving[i];
    if (rest->still_steps[other] > 0)
      continue;  // it lies still beside it
    if (gv_aabb_meet(&broad->object_box[other], &broad->object_box[o]))
      return true;
  }
  return false;
}

bool gv_rest_lies_still(gv_rest *rest, const gv_broad *broad, bool hand, int o, const gv_body_state *s,
                        int enough) {
  assert(o >= 0 && o < GV_MAX_OBJECTS && enough > 0);
  bool still = gv_norm(s->v) + gv_norm(s->w) * broad->object_reach[o] < still_m_s;
  rest->still_steps[o] = still ? rest->still_steps[o] + 1 : 0;
  if (rest->still_steps[o] < enough || (hand && gv_broad_hand_is_near(broad, o)))
    return false;
  rest->resting[o] = true;
  return true;
}
