// SPDX-License-Identifier: BSD-3-Clause
// The safety state machine: nothing but armed and active lets a force out.
//
//   start -> wait -> ready -> armed -> active        fault: from any state, left only to wait when all
//              ^_______|________|________|            causes are gone and the dead-man switch was let go
//
// wait: devices missing, stale or in doubt. ready: data fresh, dead-man open. armed: dead-man held and the
// desired force was near zero. active: a force flows. stopped: final. Pure.
#ifndef GLOVED_SAFETY_H
#define GLOVED_SAFETY_H

#include <stdbool.h>
#include <stdint.h>

#include "gloved/setting.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum gv_safety_state {
  GV_SAFETY_START,
  GV_SAFETY_WAIT,
  GV_SAFETY_READY,
  GV_SAFETY_ARMED,
  GV_SAFETY_ACTIVE,
  GV_SAFETY_FAULT,
  GV_SAFETY_STOPPED
} gv_safety_state;

typedef enum gv_fault {  // bits
  GV_FAULT_GLOVE_STALE = 1 << 0,
  GV_FAULT_TRACKER_STALE = 1 << 1,
  GV_FAULT_FRAMES = 1 << 2,
  GV_FAULT_NOT_FINITE = 1 << 3,
  GV_FAULT_OVERRUN = 1 << 4,
  GV_FAULT_DEVICE = 1 << 5,
  GV_FAULT_STATUS_STALE = 1 << 6,
  // A source says itself that it is in doubt: these end a force at once, and are waited out where none flows.
  GV_FAULT_SENSOR = 1 << 7,
  GV_FAULT_OTHER_HAND = 1 << 8,
  GV_FAULT_TRACKER = 1 << 9,
  GV_FAULT_OTHER_DEVICE = 1 << 10  // of two hands: the other one's device is in a fault
} gv_fault;

typedef struct gv_safety_input {
  bool glove_seen, tracker_seen;                    // at least one good sample ever
  bool status_seen;                                 // a device that never sent one is not waited for
  double glove_age_s, tracker_age_s, status_age_s;  // of the newest good message
  double glove_interval_s, tracker_interval_s, status_interval_s;  // mean time between messages; 0: not known
  uint32_t doubts;       // GV_FAULT_SENSOR, _OTHER_HAND, _TRACKER as the newest sound
                         // messages say; GV_FAULT_OTHER_DEVICE
  bool dead_man;         // held
  bool finite;           // every number of this step was finite
  bool device_fault;     // the device reports one
  unsigned bad_frames;   // counter or checksum errors since the last call
  unsigned overruns;     // late steps since the last call
  double desired_max_n;  // largest tension asked for
  bool stop;             // the program is ending
} gv_safety_input;

typedef struct gv_safety_config {
  // Data is fresh for two of its source's intervals and 30 ms, and never for longer
  // than these (safety/source.h).
  double max_age_s;        // glove and tracker (default 0.05)
  double status_age_s;     // the device's status, from its first one on (0.1)
  double arm_below_n;      // forces near zero (0.1)
  unsigned bad_limit;      // bad frames within bad_window_s that make a fault (10)
  double bad_window_s;     // (0.1)
  unsigned overrun_limit;  // overruns within the window that make a fault (20)
} gv_safety_config;

typedef struct gv_safety {
  gv_safety_config cfg;
  gv_safety_state state;
  uint32_t faults;                  // causes of the present fault, 0 outside
  bool released;                    // dead-man was seen open since the last fault or start
  double bad_level, overrun_level;  // leaky counters
} gv_safety;

gv_safety_config gv_safety_config_default(void);
// The members with their hard bounds (src/safety/bounds.c). Null when all are within, else the first name.
enum { GV_SAFETY_SETTINGS = 6 };
extern const gv_setting gv_safety_settings[GV_SAFETY_SETTINGS];
const char *gv_safety_check(const gv_safety_config *cfg);
void gv_safety_init(gv_safety *safety, const gv_safety_config *cfg);
// One period. Returns the new state; forces may leave only in ARMED and ACTIVE.
gv_safety_state gv_safety_step(gv_safety *safety, const gv_safety_input *in, double dt_s);
static inline bool gv_safety_lets_force_out(const gv_safety *safety) {
  return safety->state == GV_SAFETY_ARMED || safety->state == GV_SAFETY_ACTIVE;
}
const char *gv_safety_name(gv_safety_state state);  // "start", "wait", ...
// Text of the lowest set fault bit, e.g. "glove data too old".
const char *gv_fault_text(uint32_t faults);

#ifdef __cplusplus
}
#endif

#endif
