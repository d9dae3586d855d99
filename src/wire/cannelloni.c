// SPDX-License-Identifier: BSD-3-Clause
// Codec of cannelloni's data datagrams, version 2: CAN frames bundled into UDP, big-endian.
//   u8 version 2 | u8 operation 0 | u8 sequence | u16 count, then for each frame
//   u32 identifier (bit 31 extended, 30 remote, 29 error) | u8 length (bit 7: CAN FD) | FD: u8 flags |
//   data (remote: none)
// Bounded by the buffers given; pure, any thread.
#include <assert.h>
#include <string.h>

#include "gloved/drivers.h"

enum { VERSION = 2, OPERATION_DATA = 0, HEADER_BYTES = 5, LENGTH_FD = 0x80, WIRE_BRS = 1, WIRE_ESI = 2 };
#define ID_EXTENDED 0x80000000u
#define ID_REMOTE 0x40000000u
#define ID_ERROR 0x20000000u
#define ID_MASK 0x1fffffffu

// Whether SocketCAN could have such a frame: length fits the kind, the identifier fits its bits.
static bool frame_sound(const gv_frame *frame) {
  bool fd = frame->flags & GV_FRAME_FD;
  bool remote = frame->flags & GV_FRAME_REMOTE;
  bool error = frame->flags & GV_FRAME_ERROR;
  uint32_t id_max = frame->flags & (GV_FRAME_EXTENDED | GV_FRAME_ERROR) ? ID_MASK : 0x7ff;
  uint8_t len_max = fd ? 64 : 8;
  return frame->id <= id_max && frame->len <= len_max && gv_frame_fd_length(frame->len) == frame->len &&
         !(fd && (remote || error)) && !(remote && error);
}

static size_t data_bytes(const gv_frame *frame) { return frame->flags & GV_FRAME_REMOTE ? 0 : frame->len; }

static uint8_t *put_frame(uint8_t *p, const gv_frame *frame) {
  assert(frame->len <= GV_FRAME_DATA && frame->id <= ID_MASK);
  uint8_t f = frame->flags;
  uint32_t id = frame->id | (f & GV_FRAME_EXTENDED ? ID_EXTENDED : 0) |
                (f & GV_FRAME_REMOTE ? ID_REMOTE : 0) | (f & GV_FRAME_ERROR ? ID_ERROR : 0);
  for (int i = 0; i < 4; i++)
    *p++ = (uint8_t)(id >> (24 - 8 * i));
  *p++ = (uint8_t)(frame->len | (f & GV_FRAME_FD ? LENGTH_FD : 0));
  if (f & GV_FRAME_FD)
    *p++ = (uint8_t)((f & GV_FRAME_BRS ? WIRE_BRS : 0) | (f & GV_FRAME_ESI ? WIRE_ESI : 0));
  memcpy(p, frame->data, data_bytes(frame));
  return p + data_bytes(frame);
}

int gv_cannelloni_pack(uint8_t seq, const gv_frame *frame, int count, uint8_t *out, size_t size) {
  size_t need = HEADER_BYTES;
  if (count < 0 || count > GV_CANNELLONI_MAX_FRAMES)
    return -1;
  for (int i = 0; i < count; i++) {
    if (!frame_sound(&frame[i]))
      return -1;
    need += (frame[i].flags & GV_FRAME_FD ? 6 : 5) + data_bytes(&frame[i]);
  }
  if (need > size)
    return -1;
  const uint8_t header[HEADER_BYTES] = {VERSION, OPERATION_DATA, seq, (uint8_t)(count >> 8), (uint8_t)count};
  memcpy(out, header, sizeof header);
  uint8_t *p = out + HEADER_BYTES;
  for (int i = 0; i < count; i++)
    p = put_frame(p, &frame[i]);
  return (int)need;
}

// One frame from at most `size` bytes; returns the bytes it took, 0 where it is not sound.
static size_t get_frame(const uint8_t *p, size_t size, gv_frame *out) {
  if (size < 5)
    return 0;
  uint32_t id = (uint32_t)p[0] << 24 | (uint32_t)p[1] << 16 | (uint32_t)p[2] << 8 | p[3];
  bool fd = p[4] & LENGTH_FD;
  if (fd && size < 6)
    return 0;
  uint8_t wire_flags = fd ? p[5] : 0;
  int flags = (id & ID_EXTENDED ? GV_FRAME_EXTENDED : 0) | (id & ID_REMOTE ? GV_FRAME_REMOTE : 0) |
              (id & ID_ERROR ? GV_FRAME_ERROR : 0) | (fd ? GV_FRAME_FD : 0) |
              (wire_flags & WIRE_BRS ? GV_FRAME_BRS : 0) | (wire_flags & WIRE_ESI ? GV_FRAME_ESI : 0);
  size_t head = fd ? 6 : 5;
  *out = (gv_frame){.id = id & ID_MASK, .flags = (uint8_t)flags, .len = p[4] & 0x7f};
  if (!frame_sound(out) || data_bytes(out) > size - head)
    return 0;
  memcpy(out->data, p + head, data_bytes(out));
  return head + data_bytes(out);
}

int gv_cannelloni_unpack(const uint8_t *data, size_t size, uint8_t *out_seq, gv_frame *out, int max) {
  if (size < HEADER_BYTES || data[0] != VERSION || data[1] != OPERATION_DATA)
    return -1;
  int count = data[3] << 8 | data[4];
  if (count > max)
    return -1;
  size_t at = HEADER_BYTES;
  for (int i = 0; i < count; i++) {
    size_t took = get_frame(data + at, size - at, &out[i]);
    if (took == 0)
      return -1;
    at += took;
  }
  if (at != size)
    return -1;
  *out_seq = data[2];
  return count;
}
