// SPDX-License-Identifier: BSD-3-Clause
// Packets of Dynamixel servos (dynamixel.h). Pure; any thread.
#include "wire/dynamixel.h"

#include <assert.h>
#include <string.h>

enum { HEAD = 7, AT_ID = 4, AT_LENGTH = 5, AT_INSTRUCTION = 7, CRC_BYTES = 2, POLYNOMIAL = 0x8005 };
static const uint8_t header[4] = {0xFF, 0xFF, 0xFD, 0};

uint16_t gv_dynamixel_crc(const uint8_t *byte, int count) {
  unsigned crc = 0;
  for (int i = 0; i < count; i++) {
    crc ^= (unsigned)byte[i] << 8;
    for (int bit = 0; bit < 8; bit++)
      crc = crc & 0x8000 ? crc << 1 ^ POLYNOMIAL : crc << 1;
    crc &= 0xFFFF;
  }
  return (uint16_t)crc;
}

// Whether the bytes so far end with FF FF FD.
static bool ends_like_a_header(const uint8_t *byte, int count) {
  return count >= 3 && memcmp(byte + count - 3, header, 3) == 0;
}

int gv_dynamixel_encode(const gv_dynamixel_packet *p, uint8_t out[GV_DYNAMIXEL_BYTES]) {
  uint8_t body[2 + GV_DYNAMIXEL_PARAMETERS];
  int plain = 0;
  int n = AT_INSTRUCTION;
  assert(p->count >= 0 && p->count <= GV_DYNAMIXEL_PARAMETERS);
  body[plain++] = p->instruction;
  if (p->instruction == GV_DYNAMIXEL_STATUS)
    body[plain++] = p->error;
  memcpy(body + plain, p->parameter, (size_t)p->count);
  plain += p->count;
  memcpy(out, header, sizeof header);
  out[AT_ID] = p->id;
  for (int i = 0; i < plain; i++) {
    out[n++] = body[i];
    if (ends_like_a_header(body, i + 1))
      out[n++] = 0xFD;
  }
  const int length = n - HEAD + CRC_BYTES;
  out[AT_LENGTH] = (uint8_t)length;
  out[AT_LENGTH + 1] = (uint8_t)(length >> 8);
  const uint16_t crc = gv_dynamixel_crc(out, n);
  out[n++] = (uint8_t)crc;
  out[n++] = (uint8_t)(crc >> 8);
  return n;
}

int gv_dynamixel_scan(const void *format, const uint8_t *byte, int count) {
  (void)format;
  const int known = count < 4 ? count : 4;
  if (memcmp(byte, header, (size_t)known) != 0)
    return -1;
  if (count < HEAD)
    return 0;
  const int length = HEAD + (byte[AT_LENGTH] | byte[AT_LENGTH + 1] << 8);
  const int least = AT_INSTRUCTION + 1 + CRC_BYTES;
  if (byte[AT_ID] == 0xFF || byte[AT_ID] == 0xFD || length < least || length > GV_DYNAMIXEL_BYTES)
    return -1;
  if (count < length)
    return 0;
  const int crc = byte[length - 2] | byte[length - 1] << 8;
  return crc == gv_dynamixel_crc(byte, length - CRC_BYTES) ? length : -1;
}

void gv_dynamixel_decode(const uint8_t *byte, int length, gv_dynamixel_packet *out) {
  uint8_t body[GV_DYNAMIXEL_BYTES] = {0};
  int n = 0;
  bool stuffed = false;
  for (int i = AT_INSTRUCTION; i < length - CRC_BYTES; i++) {
    if (!stuffed)
      body[n++] = byte[i];
    stuffed = !stuffed && ends_like_a_header(body, n) && i + 1 < length - CRC_BYTES && byte[i + 1] == 0xFD;
  }
  const int from = body[0] == GV_DYNAMIXEL_STATUS && n > 1 ? 2 : 1;
  const int count = n - from < GV_DYNAMIXEL_PARAMETERS ? n - from : GV_DYNAMIXEL_PARAMETERS;
  *out = (gv_dynamixel_packet){
    .id = byte[AT_ID], .instruction = body[0], .error = from == 2 ? body[1] : 0, .count = count};
  memcpy(out->parameter, body + from, (size_t)count);
}

// ---- instructions ---------------------------------------------------------------------------------

static void put(gv_dynamixel_packet *p, uint32_t value, int size) {
  assert(p->count + size <= GV_DYNAMIXEL_PARAMETERS);
  for (int i = 0; i < size; i++)
    p->parameter[p->count++] = (uint8_t)(value >> (8 * i));
}

uint32_t gv_dynamixel_value(const uint8_t *byte, int size) {
  uint32_t value = 0;
  for (int i = 0; i < size; i++)
    value |= (uint32_t)byte[i] << (8 * i);
  return value;
}

gv_dynamixel_packet gv_dynamixel_read(uint8_t id, int address, int size) {
  gv_dynamixel_packet p = {.id = id, .instruction = GV_DYNAMIXEL_READ};
  put(&p, (uint32_t)address, 2);
  put(&p, (uint32_t)size, 2);
  return p;
}

gv_dynamixel_packet gv_dynamixel_write(uint8_t id, int address, int size, uint32_t value) {
  gv_dynamixel_packet p = {.id = id, .instruction = GV_DYNAMIXEL_WRITE};
  put(&p, (uint32_t)address, 2);
  put(&p, value, size);
  return p;
}

gv_dynamixel_packet gv_dynamixel_sync_read(int count, int address, int size) {
  gv_dynamixel_packet p = {.id = GV_DYNAMIXEL_ALL, .instruction = GV_DYNAMIXEL_SYNC_READ};
  put(&p, (uint32_t)address, 2);
  put(&p, (uint32_t)size, 2);
  for (int id = 0; id < count; id++)
    put(&p, (uint32_t)id, 1);
  return p;
}

gv_dynamixel_packet gv_dynamixel_sync_write(int count, int address, int size, const uint32_t *value) {
  gv_dynamixel_packet p = {.id = GV_DYNAMIXEL_ALL, .instruction = GV_DYNAMIXEL_SYNC_WRITE};
  put(&p, (uint32_t)address, 2);
  put(&p, (uint32_t)size, 2);
  for (int id = 0; id < count; id++) {
    put(&p, (uint32_t)id, 1);
    put(&p, value[id], size);
  }
  return p;
}
