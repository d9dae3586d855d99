// SPDX-License-Identifier: BSD-3-Clause
// Fuzz entry (libFuzzer, `make fuzz`): any bytes as those of a LucidGlove, and as a line of brakes to it.
// What is accepted must be sound, and a whole line behind the bytes must come out, whatever they were.
#include <stdlib.h>
#include <string.h>

#include "wire/framer.h"
#include "wire/lucidglove.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static const gv_lucid_format format = {4095};

static int push(framer *f, uint8_t byte, gv_lucid_sample *out) {
  const int length = gv_framer_push(f, byte, gv_lucid_scan, &format);
  if (length <= 0)
    return 0;
  gv_lucid_decode(&format, f->byte, length, out);
  for (int i = 0; i < GV_FINGERS; i++)
    if (out->bend[i] < 0 || out->bend[i] > format.max)
      abort();
  return 1;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
  const gv_lucid_sample whole = {.bend = {1, 22, 333, 4000, 4095}, .letters = gv_lucid_bit('J')};
  uint8_t line[GV_LUCID_LINE_BYTES];
  int brake[GV_FINGERS], out = 0;
  gv_lucid_sample sample;
  framer f;
  memset(&f, 0, sizeof f);
  for (size_t i = 0; i < size; i++)
    push(&f, data[i], &sample);
  const int length = gv_lucid_encode(&format, &whole, line);
  for (int i = 0; i < length; i++)
    out += push(&f, line[i], &sample);
  if (out != 1 || memcmp(sample.bend, whole.bend, sizeof whole.bend) != 0)
    abort();
  if (gv_lucid_decode_brakes((const char *)data, (int)size, brake))
    for (int i = 0; i < GV_FINGERS; i++)
      if (brake[i] < 0 || brake[i] > GV_LUCID_BRAKE_MAX)
        abort();
  return 0;
}
