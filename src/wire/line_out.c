// SPDX-License-Identifier: BSD-3-Clause
// The two lines of line_out.h. Pure; any thread.
#include "wire/line_out.h"

#include <assert.h>
#include <string.h>

bool gv_line_out_put(line_out *out, const char *line, int count) {
  assert(count > 0 && (size_t)count <= sizeof out->next.text);
  line_out_line *place = out->written == 0 ? &out->next : &out->after;
  const bool dropped = place->count > 0;
  memcpy(place->text, line, (size_t)count);
  place->count = count;
  return dropped;
}

int gv_line_out_bytes(const line_out *out, const char **out_bytes) {
  *out_bytes = out->next.text + out->written;
  return out->next.count - out->written;
}

void gv_line_out_wrote(line_out *out, int count) {
  assert(count >= 0 && out->written + count <= out->next.count);
  out->written += count;
  if (out->written < out->next.count)
    return;
  out->next = out->after;
  out->after.count = out->written = 0;
}
