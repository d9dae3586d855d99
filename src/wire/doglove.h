// SPDX-License-Identifier: BSD-3-Clause
// Codec of a DOGlove's main board: blocks of 76 bytes with 16 encoders, and what encoders and servos mean as
// joint angles; back for the simulated device. The servos' own line is dynamixel.h. Pure; any thread.
//
// Sources, read and not copied: doublehan07/DOGlove_Firmware (main.c: the block; fsr.c: reference; ads1256.c:
// sign), and TEA-Lab/DOGlove (glove_mcu.py: volts to degrees; udp_receiver.py: zero and sign of each joint;
// DOGlove-v3.xml: order of the joints along a finger and their axes).
//
//   bytes  0  AA 55 00 00      4  reference voltage, uint32, microvolts
//          8  16 x int32: volts = value 5 / 0x7FFFFF, angle = volts / reference 360 degrees; thumb tip
//             joint, middle joint, split, roll; index, middle, ring, little: tip joint, middle joint, split
//         72  uint32: upper 16 bits the sum of the 17 words before it modulo 65536, lower 16 a time stamp
//             in ms
// All little-endian; sent without being asked.
#ifndef WIRE_DOGLOVE_H
#define WIRE_DOGLOVE_H

#include <stdbool.h>
#include <stdint.h>

#include "gloved/hand.h"

enum { GV_DOGLOVE_BYTES = 76, GV_DOGLOVE_ENCODERS = 16 };

typedef struct gv_doglove_block {
  double encoder_deg[GV_DOGLOVE_ENCODERS];
  uint16_t time_ms;
} gv_doglove_block;

// For gv_framer_push; `format` is not used. Header and sum are right, the reference is 1 to 6 V.
int gv_doglove_scan(const void *format, const uint8_t *byte, int count);
void gv_doglove_decode(const uint8_t byte[GV_DOGLOVE_BYTES], gv_doglove_block *out);
void gv_doglove_encode(const gv_doglove_block *block, uint8_t out[GV_DOGLOVE_BYTES]);

// Angles as the published model has them, each glove a little off: gloved-calibrate takes two points of each
// sensor. The servos' joint is the first of each finger (of the thumb: rotation), their angles in degrees as
// they report them. The thumb's roll is taken as its abduction; its split is not used; palm arch and wrist
// are 0.
void gv_doglove_angles(const double encoder_deg[GV_DOGLOVE_ENCODERS], const double servo_deg[GV_FINGERS],
                       double out_rad[GV_SENSORS]);
void gv_doglove_encoders(const double angle_rad[GV_SENSORS], double out_encoder_deg[GV_DOGLOVE_ENCODERS],
                         double out_servo_deg[GV_FINGERS]);
// The servo's angle where its joint has this one.
double gv_doglove_servo_deg(int finger, double angle_rad);

#endif
