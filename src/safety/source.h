// SPDX-License-Identifier: BSD-3-Clause
// One source that a force depends on (glove, tracker, status of the device): how old what it said is,
// and how often it speaks. Times are the session's; what they decide is whether a force may leave,
// never what the engine computes. Pure.
#ifndef SAFETY_SOURCE_H
#define SAFETY_SOURCE_H

#include <stdbool.h>
#include <stdint.h>

typedef struct gv_source {
  bool seen;          // a good message ever
  bool doubt;         // its newest sound message says that it is not to be trusted
  int64_t time_ns;    // of the newest measurement
  int64_t came_ns;    // arrival of its message
  int64_t moved_ns;   // arrival of the first message with the present stamp
  uint32_t stamp_us;  // the source's own clock
  double interval_s;  // mean time between messages; 0: not known yet
} gv_source;

// A good message: when it came, the source's stamp, and how old its measurement was when it was sent.
void gv_source_take(gv_source *source, int64_t came_ns, uint32_t stamp_us, uint32_t age_us);

// Age of what the source said last; infinite before the first. One that repeats a stamp, however
// fresh its messages, is as old as that stamp; since the clocks of some devices tick only every 32
// ms, twice max_age_s is let pass.
double gv_source_age_s(const gv_source *source, int64_t now_ns, double max_age_s);

// The largest age that counts as fresh: two missing messages and what a link and a shared machine may hold
// them up, and never more than max_age_s.
double gv_source_largest_age_s(double interval_s, double max_age_s);

#endif
