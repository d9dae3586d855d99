// SPDX-License-Identifier: BSD-3-Clause
// Fuzz entry (libFuzzer, `make fuzz`): any text as a line of a candump log. What is accepted must come back
// the same from what gv_log_format makes of it.
#include <stdlib.h>
#include <string.h>

#include "gloved/drivers.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
  char *line = malloc(size + 1), text[GV_LOG_LINE_MAX + 1], err[16];
  gv_frame frame, again;
  memcpy(line, data, size);
  line[size] = 0;
  if (gv_log_parse(line, &frame, err, sizeof err) == 0) {
    frame.stamp_ns -= frame.stamp_ns % 1000;
    int length = gv_log_format(&frame, "can0", text);
    text[length - 1] = 0;
    if (gv_log_parse(text, &again, err, sizeof err) ||
        memcmp(&frame, &again, offsetof(gv_frame, data) + sizeof frame.data))
      abort();
  }
  free(line);
  return 0;
}
