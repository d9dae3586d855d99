// SPDX-License-Identifier: BSD-3-Clause
// What moves the hand of `--fcu hand:` without a glove: one UDP datagram in, one out as its answer
// (drivers/hand_input.c on the loopback; tools/gloved-hand.c sends keys, tools/hand_source.py sends what a
// page's sliders say). All little-endian.
//
//   in, 56 bytes                                       out, 76 bytes: the answer to each
//    0  "GVHI", 4 version 1                             0  "GVHO", 4 version 1
//    5  flags: GV_HAND_INPUT_...                        5  flags: GV_HAND_OUTPUT_...
//    6  u16 number, up by one each                      6  u16 number that is answered
//    8  3 x float32 wrist in the world, m               8  3 x float32 wrist now, m
//   20  4 x float32 its orientation, w x y z           20  4 x float32
//   36  5 x float32 grip, thumb to little finger:      36  5 x float32 grip now
//       0 open, 1 closed                               56  5 x float32 tension a glove would pull with, N
//
// Both are targets: the hand goes there at the speed of a hand (drivers/hand_motion.h), so a sender may jump.
// It has to go on sending, 20 times a second or more: half a second of silence opens the dead-man switch and
// leaves the hand where it is. Pure; any thread.
#ifndef WIRE_HAND_INPUT_H
#define WIRE_HAND_INPUT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "gloved/limits.h"
#include "gloved/math.h"

enum { GV_HAND_INPUT_BYTES = 56, GV_HAND_OUTPUT_BYTES = 76, GV_HAND_INPUT_PORT = 20500 };

// dead-man: the switch is held. home: back to the start with an open hand, whatever the other fields say.
// ask: nothing is taken; only the answer is wanted.
enum { GV_HAND_INPUT_DEAD_MAN = 1, GV_HAND_INPUT_HOME = 2, GV_HAND_INPUT_ASK = 4 };
// dead-man: as taken. forces: the commands are enabled. other: somebody else moves the hand, and this sender
// was not heard.
enum { GV_HAND_OUTPUT_DEAD_MAN = 1, GV_HAND_OUTPUT_FORCES = 2, GV_HAND_OUTPUT_OTHER = 4 };

typedef struct gv_hand_input {
  uint8_t flags;
  uint16_t number;
  gv_pose T_world_wrist;
  double grip[GV_FINGERS];  // 0..1
} gv_hand_input;

typedef struct gv_hand_output {
  uint8_t flags;
  uint16_t number;
  gv_pose T_world_wrist;
  double grip[GV_FINGERS];
  double tension_n[GV_FINGERS];
} gv_hand_output;

void gv_hand_input_pack(const gv_hand_input *in, uint8_t out[GV_HAND_INPUT_BYTES]);
// False for another length, magic, version or flag, a number that is not finite, a wrist more than 2 m from
// the origin along an axis, a quaternion whose length is off by more than 1e-3, a grip beyond 0..1. The
// quaternion is normalized.
bool gv_hand_input_unpack(const uint8_t *data, size_t size, gv_hand_input *out);
void gv_hand_output_pack(const gv_hand_output *in, uint8_t out[GV_HAND_OUTPUT_BYTES]);
bool gv_hand_output_unpack(const uint8_t *data, size_t size, gv_hand_output *out);

#endif
