// SPDX-License-Identifier: BSD-3-Clause
// Lines on their way out to a device that may be slow to take them: a line that has begun is always
// finished; one that has not gives way to a newer one. So the device never sees half a line, nor a command
// older than need be. Pure; the caller locks.
#ifndef DRIVERS_LINE_OUT_H
#define DRIVERS_LINE_OUT_H

#include <stdbool.h>

enum { LINE_OUT_BYTES = 64 };

typedef struct line_out_line {
  char text[LINE_OUT_BYTES];
  int count;
} line_out_line;  // count 0: none
typedef struct line_out {
  line_out_line next, after;  // after: only while `next` has begun
  int written;                // bytes of `next`
} line_out;

// At most LINE_OUT_BYTES. Returns whether an older line was dropped for it.
bool gv_line_out_put(line_out *out, const char *line, int count);
// What is to be written; returns the number of bytes, 0: nothing.
int gv_line_out_bytes(const line_out *out, const char **out_bytes);
void gv_line_out_wrote(line_out *out, int count);

#endif
