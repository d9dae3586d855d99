// SPDX-License-Identifier: BSD-3-Clause
// Fuzzing of the frames of classic CAN: whatever arrives, in any order, joins to frames that the codec can
// look at; and a joined frame that is sound is cut and joined to itself again.
#include <stdlib.h>
#include <string.h>

#include "gloved/fcu.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void cut_and_join(const gv_frame *whole) {
  gv_classic_join join = {0};
  gv_frame part[GV_CLASSIC_FRAMES], again;
  const int count = gv_classic_split(whole, part);
  for (int i = 0; i < count; i++) {
    if (part[i].len > 8 || part[i].flags)
      abort();
    const int done = gv_classic_take(&join, &part[i], &again);
    if (done != (i + 1 == count))
      abort();
  }
  gv_glove_msg glove;
  if (gv_fcu_unpack_glove(whole, &glove) == GV_FCU_OK &&
      (count == 0 || memcmp(whole->data, again.data, whole->len)))
    abort();
}

// Frames of 12 bytes: identifier (2), length, flags, data.
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
  gv_classic_join join = {0};
  for (; size >= 12; data += 12, size -= 12) {
    gv_frame frame = {
      .id = (data[0] | (uint32_t)data[1] << 8) & 0x7ff, .len = data[2] % 9, .flags = data[3] & 0x3f};
    gv_frame whole;
    memcpy(frame.data, data + 4, 8);
    if (!gv_classic_take(&join, &frame, &whole))
      continue;
    if (whole.len > 64)
      abort();
    cut_and_join(&whole);
  }
  return 0;
}
