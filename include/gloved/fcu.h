// SPDX-License-Identifier: BSD-3-Clause
// Codec of the force control unit's frames. The layout is data/gloved.dbc; this is its twin in C
// (test/unit/test_fcu.py checks one against the other with cantools). Pure; any thread; under 1 us a frame.
//
// All frames: little-endian; byte 0 counter (modulo 256, per id), byte 1 flags, bytes 2-3 checksum:
// CRC-16/CCITT-FALSE over the id (2 bytes, low first) and the payload with bytes 2-3 taken as zero.
// Padding up to the FD length is zero and inside the checksum.
#ifndef GLOVED_FCU_H
#define GLOVED_FCU_H

#include "gloved/frame.h"
#include "gloved/hand.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
  GV_ID_FORCE_COMMAND = 0x090,  // engine -> device, FD 20 bytes, every period
  GV_ID_STATUS = 0x0A0,         // device -> engine, FD 20 bytes
  GV_ID_EFFORT = 0x0F0,         // in recordings alone: how much of a step the engine does from here on,
                                // FD 8 bytes
  GV_ID_PULL = 0x0F1,           // in recordings alone, with finger.observer: what pulled the fingers before
                                // this step, FD 48 bytes
  GV_ID_GLOVE = 0x110,          // device -> engine, FD 48 bytes
  GV_ID_POSE = 0x120            // device -> engine, FD 48 bytes
};

// GLOVE: 1 flags | 4-7 stamp_us | 8-9 age in 10 us | 10-42 22 x 12 bits, sensor i at bit 80 + 12 i
enum { GV_GLOVE_DEAD_MAN = 1, GV_GLOVE_LEFT = 2, GV_GLOVE_SENSOR_FAULT = 4 };
typedef struct gv_glove_msg {
  uint8_t counter, flags;
  uint32_t stamp_us;         // device clock when measured
  uint32_t age_us;           // from measuring to sending; multiples of 10, at most 655350
  uint16_t raw[GV_SENSORS];  // 0..4095
} gv_glove_msg;

// POSE: 1 flags | 4-7 stamp_us | 8-9 age in 10 us | 10 receiver | 11 zero | 12-23 x y z int32 in 1e-7 m |
// 24-39 quaternion w x y z int32 in 2^-30 | 40-47 zero
enum { GV_POSE_VALID = 1, GV_POSE_TRACKER_ERROR = 2 };
enum { GV_RECEIVER_HEAD = 1, GV_RECEIVER_HAND = 2 };
typedef struct gv_pose_msg {
  uint8_t counter, flags;
  uint32_t stamp_us, age_us;
  uint8_t receiver;  // GV_RECEIVER_...
  gv_pose T_world_receiver;
} gv_pose_msg;

// STATUS: 1 flags | 4-7 stamp_us | 8 counter of the last good command | 9 mode | 10-17 five measured
// tensions, 12 bits each in 0.003 N, channel i at bit 80 + 12 i | 18-19 bad commands so far
enum { GV_STATUS_DEAD_MAN = 1, GV_STATUS_WATCHDOG = 2, GV_STATUS_FAULT = 4 };
typedef enum gv_fcu_mode { GV_FCU_MODE_IDLE, GV_FCU_MODE_FORCE, GV_FCU_MODE_REWIND } gv_fcu_mode;
typedef struct gv_status_msg {
  uint8_t counter, flags;
  uint32_t stamp_us;
  uint8_t command_counter, mode;
  double tension_n[GV_FINGERS];
  uint16_t bad_commands;
} gv_status_msg;

// FORCE_COMMAND: 1 flags | 4-7 stamp_us of the glove sample behind it (device clock) | 8-15 five tensions, 12
// bits each in 0.003 N, channel i at bit 64 + 12 i | 16-17 age of that sample in 10 us | 18-19 GLOVE, POSE
// and STATUS frames that the engine has taken so far, modulo 65536: with it a log of the bus tells which step
// took which frame (gloved-trace align), and a device how many of its frames arrive Ending: the engine stops
// stepping and ramps to zero. Repeat: no step of the engine is behind this command; it keeps the device's
// watchdog content between steps that are far apart, and goes on towards the last step's forces.
enum { GV_COMMAND_ENABLE = 1, GV_COMMAND_ENDING = 2, GV_COMMAND_REPEAT = 4 };
typedef struct gv_command_msg {
  uint8_t counter, flags;
  uint32_t sample_stamp_us, age_us;
  double tension_n[GV_FINGERS];  // 0..12.285
  uint16_t frames_taken;
} gv_command_msg;
#define GV_TENSION_LSB_N 0.003
// What a device reads of a tension that was packed: whole counts, rounded down.
double gv_fcu_command_tension(double tension_n);

// EFFORT: 1 rung of the deadline ladder (daemon/loop/ladder.h), 0 to 2 | 4-7 zero. A
// replay does what the live run did.
typedef struct gv_effort_msg {
  uint8_t counter, rung;
} gv_effort_msg;

// PULL: 4-7 zero | 8-47 five tensions in N, IEEE 754, little-endian. Live they hang on the clock; a replay
// gives the observer of the fingers what it got then.
typedef struct gv_pull_msg {
  uint8_t counter;
  double tension_n[GV_FINGERS];
} gv_pull_msg;

// Values out of range are clamped to the field (a not-a-number tension becomes 0). stamp_ns is not set.
void gv_fcu_pack_glove(const gv_glove_msg *msg, gv_frame *out);
void gv_fcu_pack_pose(const gv_pose_msg *msg, gv_frame *out);
void gv_fcu_pack_status(const gv_status_msg *msg, gv_frame *out);
void gv_fcu_pack_command(const gv_command_msg *msg, gv_frame *out);
void gv_fcu_pack_effort(const gv_effort_msg *msg, gv_frame *out);
void gv_fcu_pack_pull(const gv_pull_msg *msg, gv_frame *out);

// 0, or why the frame is refused.
typedef enum gv_fcu_error {
  GV_FCU_OK = 0,
  GV_FCU_WRONG_ID = -1,      // another id, or extended, remote, error frame
  GV_FCU_WRONG_LENGTH = -2,  // another length, or not FD
  GV_FCU_WRONG_CHECKSUM = -3,
  GV_FCU_WRONG_VALUE = -4  // quaternion length off by more than 1e-3, receiver 0, reserved bits set
} gv_fcu_error;
gv_fcu_error gv_fcu_unpack_glove(const gv_frame *frame, gv_glove_msg *out);
gv_fcu_error gv_fcu_unpack_pose(const gv_frame *frame, gv_pose_msg *out);  // quaternion normalized
gv_fcu_error gv_fcu_unpack_status(const gv_frame *frame, gv_status_msg *out);
gv_fcu_error gv_fcu_unpack_command(const gv_frame *frame, gv_command_msg *out);
gv_fcu_error gv_fcu_unpack_effort(const gv_frame *frame, gv_effort_msg *out);
gv_fcu_error gv_fcu_unpack_pull(const gv_frame *frame, gv_pull_msg *out);
const char *gv_fcu_error_text(gv_fcu_error error);

// CRC-16/CCITT-FALSE (poly 0x1021, start 0xffff, no reflection).
uint16_t gv_crc16(uint16_t crc, const uint8_t *data, size_t len);

// ---- classic CAN ----------------------------------------------------------------------------------
// An interface without FD carries the same messages in frames of at most 8 bytes on identifiers of their own
// (data/gloved.dbc). GLOVE, POSE and STATUS are cut into 6, 8 and 3 frames; byte 0 of each is the message's
// counter, its fields and its checksum are spread over the rest, and what is joined again is the FD frame
// bit by bit. FORCE_COMMAND is one frame, so that a force is never half old:
//   bits 0-3 counter modulo 16 | 4 enable | 5 zero | 6-55 five tensions, 10 bits each in 0.012 N, rounded
//   down | 56-63 CRC-8 (polynomial 0x2f, start and final xor 0xff) over the identifier (2 bytes, low first)
//   and bytes 0-6
// Stamp, age and count do not travel. At 1 Mbit/s some 8 frames fit a millisecond: 1 kHz of commands (1),
// gloves at 150 Hz (0.9), two receivers at 60 Hz (1) and status at 100 Hz (0.3) take less than half of it;
// gloves and poses at 1 kHz need CAN FD.
enum {
  GV_ID_FORCE_COMMAND_CLASSIC = 0x091,
  GV_ID_STATUS_CLASSIC = 0x0A1,  // and the 2 after it
  GV_ID_GLOVE_CLASSIC = 0x111,   // and the 5 after it
  GV_ID_POSE_CLASSIC = 0x121,    // and the 7 after it
  GV_CLASSIC_FRAMES = 8          // of one message at most
};
#define GV_CLASSIC_TENSION_LSB_N 0.012

// The classic frames of one FD message; returns their count, 0 where the frame is none of the four.
int gv_classic_split(const gv_frame *fd, gv_frame out[GV_CLASSIC_FRAMES]);

// Whether it is one of the classic frames above (by identifier and kind).
bool gv_classic_is_part(const gv_frame *frame);

// Joins what arrives. Zeroed at the start. The order of a message's frames does not matter, and some
// messages may be under way at a time (a cannelloni that stalled cuts them anywhere); the one begun first is
// dropped for another (its counter shows it as lost).
enum { GV_CLASSIC_UNDER_WAY = 4 };
// missing: bit per frame
typedef struct gv_classic_begun {
  gv_frame frame;
  unsigned missing, number;
} gv_classic_begun;
typedef struct gv_classic_join {
  gv_classic_begun begun[3][GV_CLASSIC_UNDER_WAY];  // GLOVE, POSE, STATUS
  unsigned number;                                  // of messages begun so far
  uint8_t command_counter;                          // of the last command, modulo 256
} gv_classic_join;
// 1: `out` is a whole message, stamped as its last frame, or the frame itself where it is no classic part.
// 0: more frames are awaited. A damaged command comes out as it is, to be refused by its identifier.
int gv_classic_take(gv_classic_join *join, const gv_frame *frame, gv_frame *out);

#ifdef __cplusplus
}
#endif

#endif
