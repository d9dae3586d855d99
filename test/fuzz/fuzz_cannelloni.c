// SPDX-License-Identifier: BSD-3-Clause
// Fuzz entry (libFuzzer, `make fuzz`): any bytes as a datagram. What is accepted must survive being written
// and read again, and its frames must go through the codec of the messages without harm.
#include <stdlib.h>
#include <string.h>

#include "gloved/drivers.h"
#include "gloved/fcu.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void require(bool good) {
  if (!good)
    abort();
}

static void decode_message(const gv_frame *f) {
  gv_glove_msg glove;
  gv_pose_msg pose;
  gv_status_msg status;
  gv_command_msg command;
  gv_frame back;
  if (gv_fcu_unpack_glove(f, &glove) == 0)
    gv_fcu_pack_glove(&glove, &back);
  else if (gv_fcu_unpack_status(f, &status) == 0)
    gv_fcu_pack_status(&status, &back);
  else if (gv_fcu_unpack_command(f, &command) == 0)
    gv_fcu_pack_command(&command, &back);
  else {
    if (gv_fcu_unpack_pose(f, &pose) == 0)
      require(gv_pose_finite(pose.T_world_receiver));
    return;
  }
  require(memcmp(f->data, back.data, f->len) == 0);
}

// A frame with the checksum put right: the fuzzer would hardly find one.
static void decode_mended(gv_frame f) {
  if (f.len < 4)
    return;
  const uint8_t head[6] = {(uint8_t)f.id, (uint8_t)(f.id >> 8), f.data[0], f.data[1], 0, 0};
  uint16_t crc = gv_crc16(gv_crc16(0xffff, head, 6), f.data + 4, (size_t)f.len - 4);
  f.data[2] = (uint8_t)crc;
  f.data[3] = (uint8_t)(crc >> 8);
  decode_message(&f);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
  static gv_frame frame[GV_CANNELLONI_MAX_FRAMES], again[GV_CANNELLONI_MAX_FRAMES];
  static uint8_t bytes[GV_CANNELLONI_MAX_BYTES];
  uint8_t seq, seq_again;
  int count = gv_cannelloni_unpack(data, size, &seq, frame, GV_CANNELLONI_MAX_FRAMES);
  if (count < 0)
    return 0;
  for (int i = 0; i < count; i++) {
    decode_message(&frame[i]);
    decode_mended(frame[i]);
  }
  int written = gv_cannelloni_pack(seq, frame, count, bytes, sizeof bytes);
  if (size > sizeof bytes)
    return 0;
  require(written == (int)size);
  require(gv_cannelloni_unpack(bytes, size, &seq_again, again, count) == count && seq == seq_again);
  for (int i = 0; i < count; i++)
    require(frame[i].id == again[i].id && frame[i].flags == again[i].flags && frame[i].len == again[i].len &&
            memcmp(frame[i].data, again[i].data, sizeof frame[i].data) == 0);
  return 0;
}
