// SPDX-License-Identifier: BSD-3-Clause
// One CAN or CAN FD frame with its stamp, and the table of functions that every driver has: a socket,
// a recording and a simulated device look the same to the loop.
#ifndef GLOVED_FRAME_H
#define GLOVED_FRAME_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum {
  GV_FRAME_FD = 1,
  GV_FRAME_BRS = 2,
  GV_FRAME_ESI = 4,
  GV_FRAME_EXTENDED = 8,
  GV_FRAME_REMOTE = 16,
  GV_FRAME_ERROR = 32,
  GV_FRAME_SECOND = 64  // from or for the second hand's device: in this process alone, on no wire
};

enum { GV_FRAME_DATA = 64 };  // bytes, the most that CAN FD carries

typedef struct gv_frame {
  int64_t stamp_ns;  // reception (or recording) time; the driver's clock
  uint32_t id;       // 11 or 29 bits
  uint8_t flags;     // GV_FRAME_...
  uint8_t len;       // bytes in data: 0..8, FD 0..8 12 16 20 24 32 48 64
  uint8_t data[GV_FRAME_DATA];
} gv_frame;

typedef struct gv_driver_stats {
  uint64_t rx, tx;      // frames
  uint64_t bad;         // datagrams or lines that do not parse: dropped
  uint64_t lost;        // known lost on this hop (sequence gaps of the transport)
  uint64_t foreign;     // from a peer that is not ours: dropped
  uint64_t tx_failed;   // the link refused: dropped
  uint64_t bus_errors;  // error frames of the CAN controller
  uint64_t link_downs;  // times the link went away (interface down or removed)
} gv_driver_stats;

// Of a driver's poll and send. SOCKET: recvmmsg and sendto; LINE: read and write.
enum { GV_CALLS_SOCKET = 1, GV_CALLS_LINE = 2 };

// A driver. `poll` and `send` never block, never allocate and may be called from the real-time thread.
typedef struct gv_driver {
  void *self;
  // Up to `max` frames with stamp_ns <= now_ns, in order; returns the count.
  int (*poll)(void *self, int64_t now_ns, gv_frame *out, int max);
  // Send `count` frames as one bundle. Returns 0, or negative where the link refused.
  int (*send)(void *self, const gv_frame *frame, int count);
  bool (*ended)(void *self);  // nothing will ever come again (end of a recording)
  gv_driver_stats (*stats)(void *self);
  void (*close)(void *self);
  // Descriptor that poll(2) calls readable when frames may have come (now and then without one), -1
  // while there is none, for example with the device unplugged; it may become another one at any
  // time. Null: never (in the process).
  int (*descriptor)(void *self);
  unsigned calls;  // GV_CALLS_...: the system calls of poll and send; 0: none
  // Something to say to the user: one line "what; what to do" in out; false: nothing for now. Each
  // thing is said once, until it has been mended. Asked ten times a second by an ordinary thread,
  // now_ns of CLOCK_MONOTONIC. Null: never.
  bool (*tell)(void *self, int64_t now_ns, char *out, size_t size);
} gv_driver;

// Valid FD length that holds `len` bytes (9 -> 12); 0..64.
uint8_t gv_frame_fd_length(uint8_t len);

#ifdef __cplusplus
}
#endif

#endif
