// SPDX-License-Identifier: BSD-3-Clause
// Codec of the CyberGlove: commands, replies, and its 8-bit and 16-bit data frames. Pure; any thread.
//
// Sources: the maker's command set as public drivers use it (ASR of KIT: replies; Shadow Robot: the 16-bit
// stream of the CyberGlove III; ViSTA of RWTH Aachen: errors at a frame's end, masks, which it quotes from
// the maker's manual, page 20), and a reading of a real glove quoted in a public question (ASCII g).
//   G          one sample:  'G', one byte 1..255 a sensor, 0
//   S          a stream of: 'S', one byte 1..255 a sensor, 0        0x03 ends it
//              in front of the 0 may stand "es": sampled faster than the glove can, the values are good;
//              or "eg": the glove is not plugged into its box, the values are none
//   ?S         "?S" count 0                (18 or 22)
//   ?C         "?C" offset of each sensor, gain of each, 0
//   ?R         "?R" 1 right or 0 left, 0
//   M b b b    mask of the sensors that are sent, lowest first, within the glove's own (?K); N n: the first
//              n of these. "M" 0 and "N" 0 come back; ?M, ?K: "?M" b b b 0; ?N: "?N" n 0. They survive
//              until power is off.
//   D 0, U 0   time stamp and status byte of a frame off: "D" 0, "U" 0
//   1eu 1S     CyberGlove III: 16-bit stream over USB: 0D 0A 00, "HH:MM:SS:ss:nS", two bytes 1..4094 a
//              sensor, the higher first; now and then another "nS", or "e1", stands between the mark and
//              the time
// The frames of both streams carry no checksum: a byte changed on the way into another value passes.
//
// The glove with 18 sensors lacks the distal joints (DIJ) of the four fingers; the order is otherwise that of
// gv_sensor. They are filled with angle(DIJ) = 2/3 angle(PIJ): the rule of Rijpkema and Girard (Computer
// animation of knowledge-based human grasping, 1991) for a finger that moves freely; a fingertip pressed
// against something departs from it.
#ifndef DRIVERS_CYBERGLOVE_H
#define DRIVERS_CYBERGLOVE_H

#include <stdbool.h>
#include <stdint.h>

#include "gloved/hand.h"

enum { GV_CYBERGLOVE_FEWER = 18, GV_CYBERGLOVE_MAX_BYTES = 63, GV_CYBERGLOVE_WIDE_BYTES = 61 };
enum { GV_CYBERGLOVE_STOP = 0x03 };

typedef struct gv_cyberglove_format {
  int sensors;  // 18 or 22
  bool wide;    // 16-bit frames
} gv_cyberglove_format;

// For gv_framer_push; `format` points to a gv_cyberglove_format.
int gv_cyberglove_scan(const void *format, const uint8_t *byte, int count);
// How a frame that gv_cyberglove_scan found ends.
typedef enum gv_cyberglove_end {
  GV_CYBERGLOVE_PLAIN,
  GV_CYBERGLOVE_TOO_FAST,
  GV_CYBERGLOVE_UNPLUGGED
} gv_cyberglove_end;
gv_cyberglove_end gv_cyberglove_end_of(const gv_cyberglove_format *format, const uint8_t *byte, int length);
// A frame that gv_cyberglove_scan found, as counts 0..4095 (8 bits: v 4095 / 255, rounded). The DIJ of a
// glove with 18 sensors are filled by `cal`, which says what counts mean.
void gv_cyberglove_decode(const gv_cyberglove_format *format, const uint8_t *byte, int length,
                          const gv_calibration *cal, uint16_t out_raw[GV_SENSORS]);
// The bytes that the device would send: echo 'S' or 'G' (8 bits), the time for the stamp (16 bits).
int gv_cyberglove_encode(const gv_cyberglove_format *format, const uint16_t raw[GV_SENSORS], char echo,
                         double time_s, uint8_t out[GV_CYBERGLOVE_MAX_BYTES]);
// The values of the first reply to ?query within the bytes: "?", query, `values` bytes,
// 0. False where there is none.
bool gv_cyberglove_find_reply(const uint8_t *byte, int count, char query, int values, uint8_t *out);

#endif
