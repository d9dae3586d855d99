// SPDX-License-Identifier: BSD-3-Clause
// Fuzz entry (libFuzzer, `make fuzz`): any bytes as those of a DOGlove's board, of its servos, and as
// instructions to the simulated servos. What is accepted must be sound, and a whole record behind the
// bytes must come out, whatever they were.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "drivers/doglove_sim.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static int push_block(framer *f, uint8_t byte) {
  gv_doglove_block block;
  if (gv_framer_push(f, byte, gv_doglove_scan, NULL) <= 0)
    return 0;
  gv_doglove_decode(f->byte, &block);
  for (int i = 0; i < GV_DOGLOVE_ENCODERS; i++)
    if (!isfinite(block.encoder_deg[i]))
      abort();
  return 1;
}

static int push_packet(framer *f, uint8_t byte) {
  gv_dynamixel_packet p;
  const int length = gv_framer_push(f, byte, gv_dynamixel_scan, NULL);
  if (length <= 0)
    return 0;
  gv_dynamixel_decode(f->byte, length, &p);
  if (p.count < 0 || p.count > GV_DYNAMIXEL_PARAMETERS)
    abort();
  return 1;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
  static doglove_sim servos;
  static uint8_t out[DOGLOVE_SIM_ANSWER];
  const gv_doglove_block whole = {.encoder_deg = {90}};
  const gv_dynamixel_packet read = gv_dynamixel_sync_read(GV_FINGERS, GV_DYNAMIXEL_POSITION, 4);
  uint8_t block[GV_DOGLOVE_BYTES];
  uint8_t packet[GV_DYNAMIXEL_BYTES];
  framer board = {.count = 0};
  framer line = {.count = 0};
  int blocks = 0;
  int packets = 0;
  gv_doglove_sim_init(&servos);
  for (size_t i = 0; i < size; i++) {
    push_block(&board, data[i]);
    push_packet(&line, data[i]);
    gv_doglove_sim_receive(&servos, data[i], (int64_t)i, out);
  }
  gv_doglove_encode(&whole, block);
  const int count = gv_dynamixel_encode(&read, packet);
  // Garbage that begins as a record does is waited for to its end; what lies in it is found then.
  for (int i = 0; i < 2 * GV_DOGLOVE_BYTES; i++)
    blocks += push_block(&board, block[i % GV_DOGLOVE_BYTES]);
  for (int i = 0; i < GV_DYNAMIXEL_BYTES + count; i++)
    packets += push_packet(&line, packet[i % count]);
  if (blocks < 1 || packets < 1)
    abort();
  return 0;
}
