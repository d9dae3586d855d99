// SPDX-License-Identifier: BSD-3-Clause
// Codec of LucidGloves: text lines ("alpha encoding") to joint counts, five brakes to text, and back for the
// simulated device. Pure; any thread.
//
// Sources, read and not copied: LucidVR/lucidgloves, firmware (Encoding.ino: both lines; _main.ino: order of
// writing and reading; haptics.ino: what a brake does; AdvancedConfig.h: ranges), and
// LucidVR/opengloves-driver (alpha_encoding_service.cpp: meaning of the letters, (AB) splay).
// SenseShift's firmware (opengloves alpha_encoding.hpp: a curl for each knuckle).
//   from the glove  A4095B0C17D0E2000F2047G2047P0JM\n   letter and number, no leading zeros; CR LF ends it:
//                   A..E bend of thumb to little finger, F G joystick, P trigger; 0..4095 (ESP32), 0..1023
//                   (AVR)
//                   letter alone while it holds: H joystick pressed, J K buttons A and B, N menu, O
//                   calibrating; I L M trigger, grab and pinch, which the firmware makes up from the fingers
//                   (AB)2047 to (EB)2047: splay, from gloves that have it; not used
//                   (AAA)2047 to (EAD)2047: single joints of thumb (A) to little finger (E). As SenseShift
//                   names them A is MCP, B PIP (of the thumb IP), C DIP; C and D of the thumb, and D, are
//                   not used. A joint that is named goes its own way, the others of its finger follow the
//                   letter, or else the mean of the named ones
//                   (ZV)1, (ZG)0, (ZH)1: firmware, kind and hand; not used
//   to the glove    A0B1000C250D0E0\n                   thumb to little finger, 0 free .. 1000
// No checksum: a digit changed on the way into another passes, a digit lost often too
// (the engine holds a jump back).
//
// What a brake does is the firmware's business. The stock one turns a servo to 180 - 0.18 x degrees: a stop
// that the finger's string runs against, the more the earlier; it holds its last place for ever, without a
// watchdog. It reads one line for each that it writes, and waits for it, up to a second. With
// FLIP_FORCE_FEEDBACK true, which its newer Config.h files have, it turns to 0.18 x degrees: on a glove that
// is built the other way round, brakes 0 are full brakes.
//
// One number a finger: it is spread over the joints by fixed shares of their range, and the
// splay is a guess. At 1: MPJ 90, PIJ 100, DIJ 67 degrees; thumb MPJ 60, IJ 80, and always 45
// abduction (the pad faces the fingers).
#ifndef DRIVERS_LUCIDGLOVE_H
#define DRIVERS_LUCIDGLOVE_H

#include <stdbool.h>
#include <stdint.h>

#include "gloved/hand.h"

enum {
  GV_LUCID_LINE_BYTES = 255,
  GV_LUCID_BRAKES_BYTES = 26,
  GV_LUCID_BRAKE_MAX = 1000,
  GV_LUCID_JOINTS = 3
};

typedef struct gv_lucid_format {
  int max;
} gv_lucid_format;  // largest reading: 4095 or 1023

typedef struct gv_lucid_sample {
  int bend[GV_FINGERS];                    // 0 (straight) .. max, thumb to little finger
  int joint[GV_FINGERS][GV_LUCID_JOINTS];  // the same of single joints
  uint32_t letters;                        // bit (letter - 'A') of each letter that stood in the line
  uint32_t joints;  // bit GV_LUCID_JOINTS finger + joint of each that stood in the line
} gv_lucid_sample;

static inline uint32_t gv_lucid_bit(char letter) { return 1u << (letter - 'A'); }

// For gv_framer_push; `format` points to a gv_lucid_format. A line starts with A or a key, has a number
// for every finger, and nothing twice.
int gv_lucid_scan(const void *format, const uint8_t *byte, int count);
// A line that gv_lucid_scan found.
void gv_lucid_decode(const gv_lucid_format *format, const uint8_t *byte, int length, gv_lucid_sample *out);
// The line that the glove would send, joystick in the middle, without splay; the
// letters H to O as in `letters`.
int gv_lucid_encode(const gv_lucid_format *format, const gv_lucid_sample *sample,
                    uint8_t out[GV_LUCID_LINE_BYTES]);

// Bends to 22 counts by `cal`, which says what counts mean; and bends from joint
// angles, by the flexion joints' sum.
void gv_lucid_raw(const gv_lucid_format *format, const gv_lucid_sample *sample, const gv_calibration *cal,
                  uint16_t out_raw[GV_SENSORS]);
void gv_lucid_bend(const gv_lucid_format *format, const double angle_rad[GV_SENSORS],
                   int out_bend[GV_FINGERS]);

// The brakes, clamped to 0..1000; returns the length, no zero behind it.
int gv_lucid_encode_brakes(const int brake[GV_FINGERS], char out[GV_LUCID_BRAKES_BYTES]);
// As the glove reads a line (without its newline). False where it is no line of five brakes in range.
bool gv_lucid_decode_brakes(const char *line, int length, int out_brake[GV_FINGERS]);

#endif
