// SPDX-License-Identifier: BSD-3-Clause
// Codec of the Polhemus FASTRAK: commands that set it up, and its data records, binary and ASCII.
// Pure; any thread. Source: 3SPACE FASTRAK User Manual, OPM00PI002 Rev. G (June 2012), chapter 9.
//
// The record that we ask for with O<n>,2,11,0 (position, quaternion, a space) in binary (f), 32 bytes:
//   '0' | station '1'..'4' | error ' ' or a letter | x y z, w x y z: seven float32, little-endian | ' '
// and with O<n>,2,11,1 (the same and an end of line) in ASCII (F), 54 bytes:
//   '0' | station | error | x y z as Sxxx.xx | w x y z as Sx.xxxx | CR LF      (S: '-', '+' or ' ')
// What it says of itself on S (pages 68 and 69), 55 bytes of text:
//   '2' | station | 'S' | flags, three hexadecimal digits: bit 0 binary, 1 centimetres, 3 continuous |
//   number of the last built-in test that failed | ' ' | ... | CR LF
// on l<n> (page 54; the record as the FASTRAK-compatible IS-900's manual, page 80, has it): '2' |
// station | 'l' | a digit for each of the four stations, 1 on | CR LF; and on a command that it does not
// take (page 89): '2' ' ' 'E' "*ERROR*" ... CR LF. Settings survive in its memory (EEPROM), so
// everything that changes a record is set.
// Position of the receiver in the transmitter's frame, in centimetres (u): x away from the side where the
// cable leaves, z down, for a transmitter that stands upright.
#ifndef DRIVERS_FASTRAK_H
#define DRIVERS_FASTRAK_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "gloved/math.h"

typedef enum gv_fastrak_format { GV_FASTRAK_BINARY, GV_FASTRAK_ASCII } gv_fastrak_format;
enum {
  GV_FASTRAK_BINARY_BYTES = 32,
  GV_FASTRAK_ASCII_BYTES = 54,
  GV_FASTRAK_STATIONS = 4,
  GV_FASTRAK_COMMAND_MAX = 40
};

typedef struct gv_fastrak_record {
  int station;                 // 1..4
  char error;                  // ' ', or the letter of the last built-in test that failed
  bool usable;                 // the numbers are sound, and the error does not concern them
  gv_pose T_tracker_receiver;  // metres; the identity where there is an error and no sound pose
} gv_fastrak_record;

// For gv_framer_push; `format` points to a gv_fastrak_format. A record counts as one when its four marks are
// right, and its numbers are finite, within 10 m, the quaternion's length within 0.002 of 1. With an error
// letter the numbers are not looked at.
int gv_fastrak_scan(const void *format, const uint8_t *byte, int count);
// A record that gv_fastrak_scan found.
void gv_fastrak_decode(gv_fastrak_format format, const uint8_t *byte, gv_fastrak_record *out);
// The bytes that the device would send (simulated device, tests). Returns their number; out holds 54.
int gv_fastrak_encode(gv_fastrak_format format, const gv_fastrak_record *record, uint8_t *out);
// What an error letter means, e.g. "receiver signal too low".
const char *gv_fastrak_error_text(char error);
// Whether a pose with this letter is not to be used. The letter is the last error that the self test found
// (page 60, note 2), so not every one speaks of the pose beside it. Page 71: m and w are about the memory of
// its settings, t about the compensation map, v about a CRT's sync; all others (the electronics,
// self-calibration, signals, bounds, the position's solution, and what is reserved) leave the pose in doubt.
bool gv_fastrak_error_concerns_pose(char error);

typedef struct gv_fastrak_setup {
  gv_fastrak_format format;
  int head, hand;     // stations that are switched on; head 0: none
  int hemisphere[3];  // direction of the half space that the receivers stay in, e.g. {1, 0, 0}
  int hand2;          // station of a second hand; 0: none
} gv_fastrak_setup;

#define GV_FASTRAK_STOP "c"  // ends continuous output; sent, and waited for, before the set-up
#define GV_FASTRAK_START "C"
#define GV_FASTRAK_ASK_STATUS "S"
#define GV_FASTRAK_ASK_STATIONS "l1\r"
// The number-th command of the set-up, from 0: units (u), format (f, F), and for each station on or
// off (l), hemisphere (H), output list (O), no increment (I, page 53), no alignment (R, page 37),
// no boresight (b, page 39); then no filters (v, x, pages 76 and 81: we have one of our own).
// Returns its length, 0 after the last.
int gv_fastrak_command(const gv_fastrak_setup *setup, int number, char out[GV_FASTRAK_COMMAND_MAX]);

typedef struct gv_fastrak_status {
  bool binary, centimetres, continuous;
  char error;  // ' ' or the letter of the last built-in test that failed
} gv_fastrak_status;
// The first status, or states of the stations (from 1), among the bytes. False where there is none.
bool gv_fastrak_find_status(const uint8_t *byte, int count, gv_fastrak_status *out);
bool gv_fastrak_find_stations(const uint8_t *byte, int count, bool out_on[GV_FASTRAK_STATIONS + 1]);
// Whether the bytes say that a command was not taken.
bool gv_fastrak_find_refusal(const uint8_t *byte, int count);

#endif
