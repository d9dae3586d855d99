// SPDX-License-Identifier: BSD-3-Clause
// How time runs with a device (loop/loop.h says what each does).
#ifndef GLOVED_DAEMON_PACE_H
#define GLOVED_DAEMON_PACE_H

typedef enum gv_pace {
  GV_PACE_LIVE,   // the device runs by itself: the clock is real, and what is late is late
  GV_PACE_PACED,  // a recording or a simulated device, at the pace of the clock
  GV_PACE_FREE    // the same, as fast as possible
} gv_pace;

#endif
