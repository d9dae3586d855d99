// SPDX-License-Identifier: BSD-3-Clause
// The counters of device frames: which frame is new, which came late, and which never came. Pure;
// real-time thread; below 0.1 us a frame.
//
// What is between a device and the daemon may change the order of frames: a cannelloni that stalled sends
// what did not fit into a datagram in reverse (its framebuffer.cpp returns each frame to the front of its
// queue), a switch may take two ways. So a gap is a loss only when it was not filled in time; a frame
// that comes late takes its loss back.
#ifndef WIRE_STREAM_H
#define WIRE_STREAM_H

#include "gloved/frame.h"

enum {
  GV_STREAM_RESYNC = 16,  // so many refused in a row: the device has restarted, and counting starts anew
  GV_STREAM_GAPS = 8,     // gaps that may be open at a time; the oldest is given up for another one
  GV_STREAM_COUNTERS = 256
};
// A gap that is not filled by then is a loss: what comes later is of no use, as the
// device's own watchdog has it.
#define GV_STREAM_GRACE_NS 5000000

typedef struct gv_stream_gap {
  uint8_t first, left;
  uint8_t count;
  int64_t opened_ns;
} gv_stream_gap;

// Counters of one identifier. Zeroed at the start.
typedef struct gv_stream {
  bool seen;
  uint8_t counter;                    // of the newest frame
  unsigned refused_in_row;            // that filled no gap
  bool missing[GV_STREAM_COUNTERS];   // by counter: never came, and still could
  gv_stream_gap gap[GV_STREAM_GAPS];  // in the order of their opening
  int gaps;
} gv_stream;

typedef struct gv_stream_verdict {
  bool is_new;      // to be used; otherwise it is older than what was used already
  int lost;         // frames that are missing now and were not before; -1: one less
  unsigned errors;  // for the limit of bad frames
} gv_stream_verdict;

// A sound frame with this counter (modulo 256) came. 1 to 127 ahead is new, anything else is doubled or late.
// A single doubled frame is the network's doing and no error; from the second in a row on it is the device's.
gv_stream_verdict gv_stream_take(gv_stream *stream, uint8_t counter, int64_t now_ns);
// Gaps that were open for longer than the grace: each is one error, however long.
unsigned gv_stream_give_up(gv_stream *stream, int64_t now_ns);

enum { GV_ORDER_MAX = 256 };
// The order in which frames of one poll are to be taken: those of one identifier by their
// counters, in the places that frames of this identifier have. out_order[i]: index of the i-th
// frame. `count` is at most GV_ORDER_MAX.
void gv_stream_order(const gv_frame *frame, int count, uint16_t out_order[GV_ORDER_MAX]);

#endif
