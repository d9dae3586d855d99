// SPDX-License-Identifier: BSD-3-Clause
// Records out of a stream of bytes that may start anywhere and may be disturbed: a window slides over the
// stream, and a byte is thrown away only when no record can start with it. A whole record behind garbage,
// or behind a record that broke off, is therefore never lost. Pure; no heap; any thread.
#ifndef DRIVERS_FRAMER_H
#define DRIVERS_FRAMER_H

#include <stdbool.h>
#include <stdint.h>

// the longest record of any device here is a LucidGlove's line with a key for each joint
enum { FRAMER_BYTES = 256 };

typedef struct framer {
  uint8_t byte[FRAMER_BYTES];  // the window
  int count;
  int taken;    // bytes of the record given out last: they leave with the next byte
  bool losing;  // the last byte that left was thrown away
  uint64_t records;
  uint64_t bad_bytes;  // thrown away
  uint64_t bad_runs;   // unbroken stretches of them
} framer;

// What starts at byte[0]: the length of a whole record, 0 where more bytes may make it one, -1 where not.
// It may look at bytes behind the record, but never asks for more than FRAMER_BYTES.
typedef int (*framer_scan)(const void *format, const uint8_t *byte, int count);

// One byte more. Returns the length of the record that it completes, which stands at f->byte until the
// next call, or 0. Cost: one scan, and one more for each byte thrown away.
int gv_framer_push(framer *f, uint8_t byte, framer_scan scan, const void *format);

#endif
