// SPDX-License-Identifier: BSD-3-Clause
// Fuzz entry (libFuzzer, `make fuzz`): any bytes as datagrams that move a hand without a glove. What is
// accepted is finite and within its bounds, and the hand then moves no faster than a hand.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "drivers/hand_motion.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static const gv_sim_script way = {
  .keyframe_count = 2,
  .keyframe = {{.T_world_wrist = {{1, 0, 0, 0}, {0, 0, 0}}}, {.angle_rad = {[GV_INDEX_PIJ] = 1.5}}}};

static void check_output(const uint8_t *data, size_t size) {
  gv_hand_output out;
  if (!gv_hand_output_unpack(data, size, &out))
    return;
  for (int f = 0; f < GV_FINGERS; f++)
    if (!isfinite(out.tension_n[f]))
      abort();
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
  static hand_motion m;
  gv_hand_motion_init(&m, &way);
  check_output(data, size);
  for (size_t at = 0; at + GV_HAND_INPUT_BYTES <= size; at += GV_HAND_INPUT_BYTES) {
    gv_hand_input in;
    if (!gv_hand_input_unpack(data + at, GV_HAND_INPUT_BYTES, &in))
      continue;
    gv_hand_motion_take(&m, &in);
    for (int ms = 0; ms < 50; ms++) {
      const gv_pose before = m.T_world_wrist;
      gv_hand_motion_step(&m);
      if (!(gv_norm(gv_sub(m.T_world_wrist.p, before.p)) < 0.00051))
        abort();
      const gv_sim_keyframe now = gv_hand_motion_now(&m);
      if (!gv_pose_finite(now.T_world_wrist) ||
          !(now.angle_rad[GV_INDEX_PIJ] >= 0 && now.angle_rad[GV_INDEX_PIJ] <= 1.5))
        abort();
    }
  }
  return 0;
}
