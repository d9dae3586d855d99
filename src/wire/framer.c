// SPDX-License-Identifier: BSD-3-Clause
// The sliding window of framer.h. Pure; any thread.
#include "wire/framer.h"

#include <assert.h>
#include <string.h>

static void drop(framer *f, int count) {
  assert(count >= 0 && count <= f->count);
  f->count -= count;
  memmove(f->byte, f->byte + count, (size_t)f->count);
}

static void throw_away(framer *f) {
  f->bad_bytes++;
  f->bad_runs += f->losing ? 0 : 1;
  f->losing = true;
  drop(f, 1);
}

int gv_framer_push(framer *f, uint8_t byte, framer_scan scan, const void *format) {
  assert(f->count - f->taken >= 0 && f->count - f->taken < FRAMER_BYTES);
  drop(f, f->taken);
  f->taken = 0;
  f->byte[f->count++] = byte;
  while (f->count > 0) {
    int length = scan(format, f->byte, f->count);
    assert(length <= f->count);
    if (length == 0 && f->count < FRAMER_BYTES)
      return 0;
    if (length > 0) {
      f->records++;
      f->losing = false;
      return f->taken = length;
    }
    throw_away(f);
  }
  return 0;
}
