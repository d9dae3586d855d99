// SPDX-License-Identifier: BSD-3-Clause
// When the next step is due where the device's frame is the clock (--sync device): arithmetic alone, without
// clock or descriptor, so that a test can play any device against it. Real-time thread.
//
// A clock of the loop's own runs on beside the device, one period a step: the glove's frame is awaited from
// half a period before its due time (of a faster device: half the time between its frames) until a quarter
// after, and the step begins with it. Without one the step begins at the window's end. The clock follows the
// frames by an eighth of what they are off, at most a fiftieth of a period: the simulation never runs more
// than 2 % beside real time, whatever a device sends.
#ifndef GLOVED_DAEMON_SYNC_H
#define GLOVED_DAEMON_SYNC_H

#include <stdbool.h>
#include <stdint.h>

typedef struct gv_sync {
  int64_t period_ns;
  int64_t interval_ns;  // between the glove's frames, smoothed; a period at most
  int64_t frame_ns;     // of the newest one
  bool following;       // the device's frames are the clock now
  int frames_in_row, misses_in_row;
} gv_sync;

enum {
  GV_SYNC_FRAMES_TO_FOLLOW = 16,  // steps on a frame in a row after which the device counts as the clock
  GV_SYNC_MISSES_TO_LEAVE = 4     // steps without one after which it does not
};

void gv_sync_init(gv_sync *sync, int64_t period_ns);
// A frame of the glove came.
void gv_sync_note(gv_sync *sync, int64_t frame_ns);
// The window around due_ns in which a frame begins a step.
int64_t gv_sync_opens_ns(const gv_sync *sync, int64_t due_ns);
int64_t gv_sync_closes_ns(const gv_sync *sync, int64_t due_ns);
// due_ns, moved towards a frame that came at frame_ns, inside the window or up to half a period before it.
int64_t gv_sync_follow(const gv_sync *sync, int64_t due_ns, int64_t frame_ns);
// A step began, with a frame in its window or without. True where `following` changed by it.
bool gv_sync_count(gv_sync *sync, bool on_frame);

#endif
