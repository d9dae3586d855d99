// SPDX-License-Identifier: BSD-3-Clause
// The five servos of a simulated DOGlove on their line: control tables that instructions read and write, and
// the Bus Watchdog as the maker's e-Manual describes it. Bytes, angles and time in, bytes out. Pure.
#ifndef DRIVERS_DOGLOVE_SIM_H
#define DRIVERS_DOGLOVE_SIM_H

#include "wire/doglove.h"
#include "wire/dynamixel.h"
#include "wire/framer.h"

enum { DOGLOVE_SIM_TABLE = 148, DOGLOVE_SIM_ANSWER = GV_FINGERS * GV_DYNAMIXEL_BYTES };

typedef struct doglove_sim {
  framer line;
  uint8_t table[GV_FINGERS][DOGLOVE_SIM_TABLE];
  int64_t heard_ns;           // of the newest instruction
  uint64_t packets, refused;  // writes that were refused: read-only now, or out of range
  uint64_t trips;             // of watchdogs
  int current_max_ma[GV_FINGERS];
} doglove_sim;

void gv_doglove_sim_init(doglove_sim *d);
// One byte of the host; returns the bytes of the answer.
int gv_doglove_sim_receive(doglove_sim *d, uint8_t byte, int64_t now_ns, uint8_t out[DOGLOVE_SIM_ANSWER]);
// Where the fingers are now; watchdogs look at the time.
void gv_doglove_sim_advance(doglove_sim *d, const double servo_deg[GV_FINGERS], int64_t now_ns);
// What pulls the finger open, mA; 0 where the servo is off, stopped by its watchdog, or beyond its goal.
int gv_doglove_sim_current(const doglove_sim *d, int finger);

#endif
