// SPDX-License-Identifier: BSD-3-Clause
// Codec of the force control unit's four frames, as laid out in fcu.h and data/gloved.dbc: structs to bytes
// and back. Pure, any thread; encoding or decoding one frame takes about 0.3 us, most of it the checksum.
#include "gloved/fcu.h"

#include <assert.h>
#include <string.h>

enum {
  GLOVE_BYTES = 48,
  POSE_BYTES = 48,
  STATUS_BYTES = 20,
  COMMAND_BYTES = 20,
  EFFORT_BYTES = 8,
  PULL_BYTES = 48
};
enum { GLOVE_BIT = 80, STATUS_BIT = 80, COMMAND_BIT = 64, FIELD_BITS = 12, FIELD_MAX = 4095 };
_Static_assert(GLOVE_BIT + GV_SENSORS * FIELD_BITS <= 8 * GLOVE_BYTES, "the sensors fit their frame");
_Static_assert(STATUS_BIT + GV_FINGERS * FIELD_BITS <= 8 * STATUS_BYTES, "the tensions fit their frame");
_Static_assert(COMMAND_BIT + GV_FINGERS * FIELD_BITS <= 8 * COMMAND_BYTES, "the forces fit their frame");
_Static_assert(FIELD_MAX == (1 << FIELD_BITS) - 1, "twelve bits");
static const double quat_one = 1073741824.0;  // 2^30 counts
static const double counts_per_m = 1e7;

uint16_t gv_crc16(uint16_t crc, const uint8_t *data, size_t len) {
  static const uint16_t table[16] = {0x0000, 0x1021, 0x2042, 0x3063, 0x4084, 0x50a5, 0x60c6, 0x70e7,
                                     0x8108, 0x9129, 0xa14a, 0xb16b, 0xc18c, 0xd1ad, 0xe1ce, 0xf1ef};
  for (size_t i = 0; i < len; i++) {
    crc = (uint16_t)((crc << 4) ^ table[(crc >> 12) ^ (data[i] >> 4)]);
    crc = (uint16_t)((crc << 4) ^ table[(crc >> 12) ^ (data[i] & 15)]);
  }
  return crc;
}

static void put_u16(uint8_t *p, uint32_t v) {
  p[0] = (uint8_t)v;
  p[1] = (uint8_t)(v >> 8);
}
static void put_u32(uint8_t *p, uint32_t v) {
  put_u16(p, v & 0xffff);
  put_u16(p + 2, v >> 16);
}
static uint16_t get_u16(const uint8_t *p) { return (uint16_t)(p[0] | p[1] << 8); }
static uint32_t get_u32(const uint8_t *p) { return get_u16(p) | (uint32_t)get_u16(p + 2) << 16; }
static int32_t get_i32(const uint8_t *p) {
  uint32_t v = get_u32(p);
  return v & 0x80000000u ? -1 - (int32_t)~v : (int32_t)v;
}

// Twelve bits at any multiple of four bits, least significant first.
static void put_12(uint8_t *data, int bit, uint32_t v) {
  assert(bit >= 0 && bit % 4 == 0 && bit + FIELD_BITS <= 8 * GV_FRAME_DATA && v <= FIELD_MAX);
  uint8_t *p = data + bit / 8;
  if (bit % 8 == 0) {
    p[0] = (uint8_t)v;
    p[1] = (uint8_t)((p[1] & 0xf0) | v >> 8);
  } else {
    p[0] = (uint8_t)((p[0] & 0x0f) | (v & 15) << 4);
    p[1] = (uint8_t)(v >> 4);
  }
}
static uint16_t get_12(const uint8_t *data, int bit) {
  assert(bit >= 0 && bit % 4 == 0 && bit + FIELD_BITS <= 8 * GV_FRAME_DATA);
  return (get_u16(data + bit / 8) >> bit % 8) & FIELD_MAX;
}

// Nearest whole number of counts; a not-a-number becomes 0.
static int32_t to_i32(double counts) {
  if (!(counts == counts))
    return 0;
  return (int32_t)gv_clamp(floor(counts + 0.5), -2147483648.0, 2147483647.0);
}
static uint32_t to_tension(double tension_n, double rounding) {
  if (!isfinite(tension_n))
    return 0;
  return (uint32_t)gv_clamp(floor(tension_n / GV_TENSION_LSB_N + rounding), 0, FIELD_MAX);
}
double gv_fcu_command_tension(double tension_n) { return to_tension(tension_n, 1e-6) * GV_TENSION_LSB_N; }
// Ages round up: a sample is never made younger than it is.
static uint32_t to_age(uint32_t age_us) { return age_us > 655350 ? 65535 : (age_us + 9) / 10; }

static uint16_t frame_checksum(const gv_frame *frame) {
  assert(frame->len >= 4);
  const uint8_t head[6] = {
    (uint8_t)frame->id, (uint8_t)(frame->id >> 8), frame->data[0], frame->data[1], 0, 0};
  return gv_crc16(gv_crc16(0xffff, head, sizeof head), frame->data + 4, (size_t)(frame->len - 4));
}

static void start_frame(gv_frame *out, uint32_t id, uint8_t len, uint8_t counter, uint8_t flags) {
  assert(len <= GV_FRAME_DATA && gv_frame_fd_length(len) == len);
  out->id = id;
  out->flags = GV_FRAME_FD | GV_FRAME_BRS;
  out->len = len;
  memset(out->data, 0, sizeof out->data);
  out->data[0] = counter;
  out->data[1] = flags;
}
static void finish_frame(gv_frame *out) { put_u16(out->data + 2, frame_checksum(out)); }

static gv_fcu_error check_frame(const gv_frame *frame, uint32_t id, uint8_t len) {
  if (frame->id != id || frame->flags & (GV_FRAME_EXTENDED | GV_FRAME_REMOTE | GV_FRAME_ERROR))
    return GV_FCU_WRONG_ID;
  if (frame->len != len || !(frame->flags & GV_FRAME_FD))
    return GV_FCU_WRONG_LENGTH;
  if (get_u16(frame->data + 2) != frame_checksum(frame))
    return GV_FCU_WRONG_CHECKSUM;
  return GV_FCU_OK;
}
static bool all_zero(const uint8_t *p, int count) {
  for (int i = 0; i < count; i++)
    if (p[i])
      return false;
  return true;
}

void gv_fcu_pack_glove(const gv_glove_msg *msg, gv_frame *out) {
  start_frame(out, GV_ID_GLOVE, GLOVE_BYTES, msg->counter, msg->flags & 7);
  put_u32(out->data + 4, msg->stamp_us);
  put_u16(out->data + 8, to_age(msg->age_us));
  for (int i = 0; i < GV_SENSORS; i++)
    put_12(out->data, GLOVE_BIT + FIELD_BITS * i, msg->raw[i] > FIELD_MAX ? FIELD_MAX : msg->raw[i]);
  finish_frame(out);
}

gv_fcu_error gv_fcu_unpack_glove(const gv_frame *frame, gv_glove_msg *out) {
  gv_fcu_error error = check_frame(frame, GV_ID_GLOVE, GLOVE_BYTES);
  if (error)
    return error;
  const uint8_t *d = frame->data;
  if (d[1] & ~7 || !all_zero(d + 43, 5))
    return GV_FCU_WRONG_VALUE;
  *out = (gv_glove_msg){
    .counter = d[0], .flags = d[1], .stamp_us = get_u32(d + 4), .age_us = 10u * get_u16(d + 8)};
  for (int i = 0; i < GV_SENSORS; i++)
    out->raw[i] = get_12(d, GLOVE_BIT + FIELD_BITS * i);
  return GV_FCU_OK;
}

void gv_fcu_pack_pose(const gv_pose_msg *msg, gv_frame *out) {
  const gv_vec3 p = msg->T_world_receiver.p;
  const gv_quat q = msg->T_world_receiver.q;
  const double counts[7] = {p.x * counts_per_m, p.y * counts_per_m, p.z * counts_per_m, q.w * quat_one,
                            q.x * quat_one,     q.y * quat_one,     q.z * quat_one};
  start_frame(out, GV_ID_POSE, POSE_BYTES, msg->counter, msg->flags & 3);
  put_u32(out->data + 4, msg->stamp_us);
  put_u16(out->data + 8, to_age(msg->age_us));
  out->data[10] = msg->receiver;
  for (int i = 0; i < 7; i++)
    put_u32(out->data + 12 + 4 * i, (uint32_t)to_i32(counts[i]));
  finish_frame(out);
}

gv_fcu_error gv_fcu_unpack_pose(const gv_frame *frame, gv_pose_msg *out) {
  gv_fcu_error error = check_frame(frame, GV_ID_POSE, POSE_BYTES);
  if (error)
    return error;
  const uint8_t *d = frame->data;
  double v[7];
  for (int i = 0; i < 7; i++)
    v[i] = get_i32(d + 12 + 4 * i) / (i < 3 ? counts_per_m : quat_one);
  double length = sqrt(v[3] * v[3] + v[4] * v[4] + v[5] * v[5] + v[6] * v[6]);
  if (d[1] & ~3 || d[10] == 0 || d[11] != 0 || !all_zero(d + 40, 8) || fabs(length - 1) > 1e-3)
    return GV_FCU_WRONG_VALUE;
  *out = (gv_pose_msg){.counter = d[0],
                       .flags = d[1],
                       .stamp_us = get_u32(d + 4),
                       .age_us = 10u * get_u16(d + 8),
                       .receiver = d[10]};
  out->T_world_receiver.p = gv_v3(v[0], v[1], v[2]);
  out->T_world_receiver.q = gv_quat_normalize((gv_quat){v[3], v[4], v[5], v[6]});
  return GV_FCU_OK;
}

void gv_fcu_pack_status(const gv_status_msg *msg, gv_frame *out) {
  start_frame(out, GV_ID_STATUS, STATUS_BYTES, msg->counter, msg->flags & 7);
  put_u32(out->data + 4, msg->stamp_us);
  out->data[8] = msg->command_counter;
  out->data[9] = msg->mode;
  for (int i = 0; i < GV_FINGERS; i++)
    put_12(out->data, STATUS_BIT + FIELD_BITS * i, to_tension(msg->tension_n[i], 0.5));
  put_u16(out->data + 18, msg->bad_commands);
  finish_frame(out);
}

gv_fcu_error gv_fcu_unpack_status(const gv_frame *frame, gv_status_msg *out) {
  gv_fcu_error error = check_frame(frame, GV_ID_STATUS, STATUS_BYTES);
  if (error)
    return error;
  const uint8_t *d = frame->data;
  if (d[1] & ~7 || d[17] & 0xf0)
    return GV_FCU_WRONG_VALUE;
  *out = (gv_status_msg){.counter = d[0],
                         .flags = d[1],
                         .stamp_us = get_u32(d + 4),
                         .command_counter = d[8],
                         .mode = d[9],
                         .bad_commands = get_u16(d + 18)};
  for (int i = 0; i < GV_FINGERS; i++)
    out->tension_n[i] = get_12(d, STATUS_BIT + FIELD_BITS * i) * GV_TENSION_LSB_N;
  return GV_FCU_OK;
}

// Tensions round down (up to a millionth of a count), so that a limit is never passed by half a count.
void gv_fcu_pack_command(const gv_command_msg *msg, gv_frame *out) {
  start_frame(out, GV_ID_FORCE_COMMAND, COMMAND_BYTES, msg->counter, msg->flags & 7);
  put_u32(out->data + 4, msg->sample_stamp_us);
  for (int i = 0; i < GV_FINGERS; i++)
    put_12(out->data, COMMAND_BIT + FIELD_BITS * i, to_tension(msg->tension_n[i], 1e-6));
  put_u16(out->data + 16, to_age(msg->age_us));
  put_u16(out->data + 18, msg->frames_taken);
  finish_frame(out);
}

gv_fcu_error gv_fcu_unpack_command(const gv_frame *frame, gv_command_msg *out) {
  gv_fcu_error error = check_frame(frame, GV_ID_FORCE_COMMAND, COMMAND_BYTES);
  if (error)
    return error;
  const uint8_t *d = frame->data;
  if (d[1] & ~7 || d[15] & 0xf0)
    return GV_FCU_WRONG_VALUE;
  *out = (gv_command_msg){.counter = d[0],
                          .flags = d[1],
                          .sample_stamp_us = get_u32(d + 4),
                          .age_us = 10u * get_u16(d + 16),
                          .frames_taken = get_u16(d + 18)};
  for (int i = 0; i < GV_FINGERS; i++)
    out->tension_n[i] = get_12(d, COMMAND_BIT + FIELD_BITS * i) * GV_TENSION_LSB_N;
  return GV_FCU_OK;
}

void gv_fcu_pack_effort(const gv_effort_msg *msg, gv_frame *out) {
  start_frame(out, GV_ID_EFFORT, EFFORT_BYTES, msg->counter, msg->rung & 3);
  finish_frame(out);
}

gv_fcu_error gv_fcu_unpack_effort(const gv_frame *frame, gv_effort_msg *out) {
  gv_fcu_error error = check_frame(frame, GV_ID_EFFORT, EFFORT_BYTES);
  if (error)
    return error;
  const uint8_t *d = frame->data;
  if (d[1] > 2 || !all_zero(d + 4, 4))
    return GV_FCU_WRONG_VALUE;
  *out = (gv_effort_msg){.counter = d[0], .rung = d[1]};
  return GV_FCU_OK;
}

static void put_double(uint8_t *out, double value) {
  uint64_t bits;
  memcpy(&bits, &value, sizeof bits);
  put_u32(out, (uint32_t)bits);
  put_u32(out + 4, (uint32_t)(bits >> 32));
}

static double get_double(const uint8_t *in) {
  const uint64_t bits = get_u32(in) | (uint64_t)get_u32(in + 4) << 32;
  double value;
  memcpy(&value, &bits, sizeof value);
  return value;
}

void gv_fcu_pack_pull(const gv_pull_msg *msg, gv_frame *out) {
  start_frame(out, GV_ID_PULL, PULL_BYTES, msg->counter, 0);
  for (int i = 0; i < GV_FINGERS; i++)
    put_double(out->data + 8 + 8 * i, msg->tension_n[i]);
  finish_frame(out);
}

gv_fcu_error gv_fcu_unpack_pull(const gv_frame *frame, gv_pull_msg *out) {
  gv_fcu_error error = check_frame(frame, GV_ID_PULL, PULL_BYTES);
  if (error)
    return error;
  const uint8_t *d = frame->data;
  gv_pull_msg msg = {.counter = d[0]};
  for (int i = 0; i < GV_FINGERS; i++) {
    msg.tension_n[i] = get_double(d + 8 + 8 * i);
    if (!(msg.tension_n[i] >= 0.0 && msg.tension_n[i] <= FIELD_MAX * GV_TENSION_LSB_N))
      return GV_FCU_WRONG_VALUE;
  }
  if (d[1] || !all_zero(d + 4, 4))
    return GV_FCU_WRONG_VALUE;
  *out = msg;
  return GV_FCU_OK;
}

const char *gv_fcu_error_text(gv_fcu_error error) {
  switch (error) {
    case GV_FCU_OK: return "sound";
    case GV_FCU_WRONG_ID: return "not this message's identifier";
    case GV_FCU_WRONG_LENGTH: return "wrong length or not CAN FD";
    case GV_FCU_WRONG_CHECKSUM: return "wrong checksum";
    case GV_FCU_WRONG_VALUE: return "a value outside its range or a reserved bit set";
  }
  return "unknown";
}
