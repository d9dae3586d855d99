// SPDX-License-Identifier: BSD-3-Clause
// Lengths that a CAN FD frame can have (ISO 11898-1, data length code). Pure; any thread.
#include "gloved/frame.h"

uint8_t gv_frame_fd_length(uint8_t len) {
  static const uint8_t length[] = {12, 16, 20, 24, 32, 48, 64};
  if (len <= 8)
    return len;
  for (size_t i = 0; i < sizeof length; i++)
    if (len <= length[i])
      return length[i];
  return 64;
}
