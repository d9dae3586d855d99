// SPDX-License-Identifier: BSD-3-Clause
// Fuzz entry (libFuzzer, `make fuzz`): any bytes as those of a FASTRAK or a CyberGlove. The first
// byte chooses the format. What is accepted must be sound, and a whole record behind the bytes
// must come out, whatever they were.
#include <stdlib.h>
#include <string.h>

#include "wire/cyberglove.h"
#include "wire/fastrak.h"
#include "wire/framer.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static const gv_cyberglove_format gloves[] = {{22, false}, {18, false}, {22, true}, {18, true}};
static const gv_fastrak_format trackers[] = {GV_FASTRAK_BINARY, GV_FASTRAK_ASCII};

static int push_tracker(framer *f, const gv_fastrak_format *format, uint8_t byte) {
  if (gv_framer_push(f, byte, gv_fastrak_scan, format) <= 0)
    return 0;
  gv_fastrak_record r;
  gv_fastrak_decode(*format, f->byte, &r);
  if (!gv_pose_finite(r.T_tracker_receiver) || r.station < 1 || r.station > GV_FASTRAK_STATIONS)
    abort();
  return 1;
}

static int push_glove(framer *f, const gv_cyberglove_format *format, uint8_t byte) {
  const gv_calibration cal = gv_calibration_default();
  uint16_t raw[GV_SENSORS];
  const int length = gv_framer_push(f, byte, gv_cyberglove_scan, format);
  if (length <= 0)
    return 0;
  gv_cyberglove_decode(format, f->byte, length, &cal, raw);
  for (int i = 0; i < GV_SENSORS; i++)
    if (raw[i] > 4095)
      abort();
  return 1;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
  if (size == 0)
    return 0;
  framer f;
  memset(&f, 0, sizeof f);
  const int kind = data[0] % 6;
  uint8_t whole[GV_CYBERGLOVE_MAX_BYTES];
  uint16_t raw[GV_SENSORS];
  for (int i = 0; i < GV_SENSORS; i++)
    raw[i] = (uint16_t)(1000 + i);
  const gv_fastrak_record record = {3, ' ', true, {{0.5, -0.5, 0.5, 0.5}, {0.1, -0.2, 0.3}}};
  int length = kind < 4 ? gv_cyberglove_encode(&gloves[kind], raw, 'S', 1.5, whole)
                        : gv_fastrak_encode(trackers[kind - 4], &record, whole);
  int out = 0;
  for (size_t i = 1; i < size; i++)
    (void)(kind < 4 ? push_glove(&f, &gloves[kind], data[i])
                    : push_tracker(&f, &trackers[kind - 4], data[i]));
  for (int i = 0; i < length; i++)
    out += kind < 4 ? push_glove(&f, &gloves[kind], whole[i])
                    : push_tracker(&f, &trackers[kind - 4], whole[i]);
  // Bytes that end in an error record of a tracker, or in a short 16-bit frame, can look whole with the
  // first bytes of the next; the record after that one then comes out.
  for (int i = 0; out == 0 && i < length; i++)
    out += kind < 4 ? push_glove(&f, &gloves[kind], whole[i])
                    : push_tracker(&f, &trackers[kind - 4], whole[i]);
  if (out == 0)
    abort();
  return 0;
}
