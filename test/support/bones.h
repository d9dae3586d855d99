// SPDX-License-Identifier: BSD-3-Clause
// How far the bones of the hand's fingers come apart where they should meet: the paper's limbs are not
// joined, finger_joints joins them.
#ifndef TEST_SUPPORT_BONES_H
#define TEST_SUPPORT_BONES_H

#include "gloved/engine.h"

static inline double bones_apart(const gv_engine *engine) {
  const gv_hand_model *hand = &gv_engine_config(engine)->hand;
  double most = 0;
  for (int i = 0; i < GV_LIMB_PALM; i++) {
    if (i % 3 == 2)
      continue;
    const double end = hand->segment_m[i / 3][i % 3] - gv_hand_half_length(hand, i);
    const double begin = -gv_hand_half_length(hand, i + 1);
    const gv_vec3 a = gv_transform(gv_engine_limb_pose(engine, i), gv_v3(end, 0, 0));
    const gv_vec3 b = gv_transform(gv_engine_limb_pose(engine, i + 1), gv_v3(begin, 0, 0));
    most = fmax(most, gv_norm(gv_sub(a, b)));
  }
  return most;
}

#endif
