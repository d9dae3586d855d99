// SPDX-License-Identifier: BSD-3-Clause
// A simulated FASTRAK, CyberGlove or LucidGlove: the scripted user of gv_sim, seen through the bytes of a
// serial line. It understands the commands that the drivers send, starts silent as the real ones do, and
// does to its bytes what lines do: garbage between records, bytes that are missing, bytes that changed.
// Bytes and time in, bytes out; no descriptor, no clock. tools/serialsim.c puts it behind a
// pseudo-terminal. The LucidGlove's brakes hold the user's fingers back as tensions of the channel
// (channel.h) do; like its stock firmware it waits for a line of brakes after each of its own, up to a
// second, and keeps the last brakes for ever.
#ifndef DRIVERS_SERIAL_SIM_H
#define DRIVERS_SERIAL_SIM_H

#include "drivers/doglove_sim.h"
#include "wire/cyberglove.h"
#include "wire/fastrak.h"
#include "gloved/sim.h"
#include "wire/lucidglove.h"

typedef enum serial_sim_kind {
  SERIAL_SIM_FASTRAK,
  SERIAL_SIM_CYBERGLOVE,
  SERIAL_SIM_LUCIDGLOVE,
  SERIAL_SIM_DOGLOVE,  // its main board
  SERIAL_SIM_DOGLOVE_SERVOS,
  SERIAL_SIM_KINDS
} serial_sim_kind;

enum { SERIAL_SIM_OUT = 4096, SERIAL_SIM_COMMAND = 32 };

typedef struct serial_sim_faults {
  double garbage, gap;  // chance per record: 1 to 20 random bytes in front of it; a part of it missing
  double noise;         // chance per byte to become another
} serial_sim_faults;

typedef struct serial_sim {
  gv_sim sim;
  serial_sim_kind kind;
  serial_sim_faults faults;
  gv_pose T_tracker_world;
  int sensors;              // of the glove, 18 or 22
  uint8_t mask[3], number;  // of the glove's sensors that are sent
  char error;               // of every record; 0: none. FASTRAK: the letter; CyberGlove: 's' or 'g' at
                            // the end of 8-bit frames
  uint64_t random;
  // what the driver has set up; a reset forgets it
  bool streaming, binary, centimetres, wide;
  // what its memory keeps, and a driver has to set: 0 and false is as it should be
  double increment[GV_FASTRAK_STATIONS + 1];
  bool aligned[GV_FASTRAK_STATIONS + 1], boresighted[GV_FASTRAK_STATIONS + 1], filtered;
  int deaf_to_units;  // so many more `u` get lost on the way
  bool unplugged[GV_FASTRAK_STATIONS + 1];
  bool station_on[GV_FASTRAK_STATIONS + 1], listed[GV_FASTRAK_STATIONS + 1];
  char command[SERIAL_SIM_COMMAND];  // begun
  unsigned command_length;
  gv_glove_msg glove;  // newest sample
  // LucidGlove: brakes now and their largest so far; lines of them that came, that came while it
  // waited for none, and those of these that stand for an answer yet to come; when its own last
  // line left, -1: it waits for nothing
  int brake[GV_FINGERS], brake_max[GV_FINGERS], brakes_early;
  bool flip;  // FLIP_FORCE_FEEDBACK does not fit the glove: it brakes by 1000 - x
  uint64_t brake_lines, brakes_unasked;
  int64_t waits_since_ns;
  doglove_sim servos;
  uint8_t out[SERIAL_SIM_OUT];  // waiting to be sent
  int out_count;
  uint64_t whole, damaged, garbage_bytes, commands, refused;  // so far
} serial_sim;

// Makes rates and transport of a gv_sim device those of a serial one: tracker 60 Hz a receiver, glove 90 to
// 150 Hz, nothing late or lost but what the faults say. A LucidGlove's brakes obey as they are told:
// gv_serial_sim_init takes the device's own watchdog and slew limit away.
void gv_serial_sim_adapt(gv_sim_device *device);
// The script starts at once.
void gv_serial_sim_init(serial_sim *s, serial_sim_kind kind, const gv_sim_script *script,
                        const gv_pose *T_world_tracker, uint64_t seed);
// What the driver wrote.
void gv_serial_sim_receive(serial_sim *s, const uint8_t *byte, int count);
// Power off and on: it forgets its set-up, and the line crackles.
void gv_serial_sim_reset(serial_sim *s);
// Up to `max` bytes due by now_ns (since init). Cost: 1 us a millisecond.
int gv_serial_sim_advance(serial_sim *s, int64_t now_ns, uint8_t *out, int max);

#endif
