// SPDX-License-Identifier: BSD-3-Clause
// The clock that follows a device (sync.h): a phase-locked loop of first order with a bounded pull.
#include "daemon/loop/sync.h"

#include <assert.h>

enum { GAIN = 8, PULL_MAX = 50 };  // parts of the error, and of the period, by which the clock moves at once

void gv_sync_init(gv_sync *sync, int64_t period_ns) {
  assert(period_ns > 0);
  *sync = (gv_sync){.period_ns = period_ns, .interval_ns = period_ns};
}

void gv_sync_note(gv_sync *sync, int64_t frame_ns) {
  int64_t interval_ns = frame_ns - sync->frame_ns;
  if (interval_ns < 0)
    interval_ns = 0;
  if (interval_ns > sync->period_ns)
    interval_ns = sync->period_ns;
  sync->interval_ns += (interval_ns - sync->interval_ns) / GAIN;
  sync->frame_ns = frame_ns;
}

// Of a device that is faster than the loop, the frame nearest to the due time is the one to take.
int64_t gv_sync_opens_ns(const gv_sync *sync, int64_t due_ns) { return due_ns - sync->interval_ns / 2; }
int64_t gv_sync_closes_ns(const gv_sync *sync, int64_t due_ns) { return due_ns + sync->period_ns / 4; }

int64_t gv_sync_follow(const gv_sync *sync, int64_t due_ns, int64_t frame_ns) {
  const int64_t most_ns = sync->period_ns / PULL_MAX;
  int64_t off_ns = frame_ns - due_ns;
  // A frame before the window came late for the step before this one.
  if (off_ns < -sync->period_ns / 2)
    off_ns += sync->period_ns;
  int64_t pull_ns = off_ns / GAIN;
  if (pull_ns > most_ns)
    pull_ns = most_ns;
  if (pull_ns < -most_ns)
    pull_ns = -most_ns;
  assert(pull_ns >= -most_ns && pull_ns <= most_ns);
  return due_ns + pull_ns;
}

bool gv_sync_count(gv_sync *sync, bool on_frame) {
  sync->frames_in_row = on_frame ? sync->frames_in_row + 1 : 0;
  sync->misses_in_row = on_frame ? 0 : sync->misses_in_row + 1;
  const bool leaves = sync->following && sync->misses_in_row >= GV_SYNC_MISSES_TO_LEAVE;
  const bool begins = !sync->following && sync->frames_in_row >= GV_SYNC_FRAMES_TO_FOLLOW;
  sync->following = (sync->following && !leaves) || begins;
  return leaves || begins;
}
