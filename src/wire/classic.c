// SPDX-License-Identifier: BSD-3-Clause
// The four messages on classic CAN (fcu.h, data/gloved.dbc): an FD frame cut into frames of at most 8 bytes
// and joined again. Where each field goes stands in tables, in half-bytes, least significant first. Pure; any
// thread.
#include <assert.h>
#include <string.h>

#include "gloved/fcu.h"

enum {
  GLOVE_PARTS = 6,
  POSE_PARTS = 8,
  STATUS_PARTS = 3,
  MESSAGES = 3,
  COMMAND_BYTES = 8,
  COMMAND_COUNTERS = 16
};
enum { SENSOR_FD = 20, SENSOR_NIBBLES = 3, SENSORS_BY_RULE = 20 };  // from bit 80 on, 12 bits each

// `count` half-bytes from half-byte `fd` of the FD payload to half-byte `at` of classic frame `part`.
typedef struct field {
  uint8_t fd, part, at, count;
} field;

// Sensors 0 to 19 lie four to a frame from byte 2 on, and are not listed; 20 and 21
// share the last with the stamp.
static const field glove_field[] = {
  {2, 0, 2, 2}, {16, 1, 2, 2},  {18, 2, 2, 2}, {4, 3, 2, 2}, {6, 4, 2, 2},  // flags, age, checksum
  {8, 5, 2, 8}, {80, 5, 10, 6},                                             // stamp, sensors 20 and 21
};
static const field pose_field[] = {
  {8, 0, 2, 8},  {2, 0, 10, 2},  {20, 0, 12, 2},                                // stamp, flags, receiver
  {24, 1, 2, 8}, {16, 1, 10, 4}, {32, 2, 2, 8},  {4, 2, 10, 4},                 // x, age, y, checksum
  {40, 3, 2, 8}, {48, 4, 2, 8},  {56, 5, 2, 8},  {64, 6, 2, 8}, {72, 7, 2, 8},  // z, quaternion
};
static const field status_field[] = {
  {2, 0, 2, 2}, {8, 0, 4, 8},  {16, 0, 12, 4},                 // flags, stamp, counter of the command, mode
  {4, 1, 2, 4}, {20, 1, 6, 9}, {29, 2, 2, 6},  {36, 2, 8, 4},  // checksum, tensions, bad commands
};

typedef struct message {
  uint32_t fd_id, classic_id;
  uint8_t fd_len, parts;
  uint8_t len[GV_CLASSIC_FRAMES];
  const field *field;
  int fields;
} message;

#define FIELDS(table) (table), (int)(sizeof(table) / sizeof *(table))
_Static_assert((int)GLOVE_PARTS <= (int)GV_CLASSIC_FRAMES && (int)POSE_PARTS <= (int)GV_CLASSIC_FRAMES,
               "a message fits its parts");
_Static_assert(SENSOR_FD + SENSOR_NIBBLES * SENSORS_BY_RULE <= 2 * 48,
               "the sensors lie in the glove's frame");
_Static_assert((COMMAND_COUNTERS & (COMMAND_COUNTERS - 1)) == 0, "a counter is taken by a mask");
static const message layout[MESSAGES] = {
  {GV_ID_GLOVE, GV_ID_GLOVE_CLASSIC, 48, GLOVE_PARTS, {8, 8, 8, 8, 8, 8}, FIELDS(glove_field)},
  {GV_ID_POSE, GV_ID_POSE_CLASSIC, 48, POSE_PARTS, {7, 7, 7, 5, 5, 5, 5, 5}, FIELDS(pose_field)},
  {GV_ID_STATUS, GV_ID_STATUS_CLASSIC, 20, STATUS_PARTS, {8, 8, 6}, FIELDS(status_field)},
};

static unsigned get_nibble(const uint8_t *data, int at) {
  assert(at >= 0);
  return data[at / 2] >> (at % 2 * 4) & 15u;
}
static void put_nibble(uint8_t *data, int at, unsigned value) {
  assert(at >= 0 && at < 2 * GV_FRAME_DATA && value < 16);
  data[at / 2] = (uint8_t)((data[at / 2] & ~(15u << (at % 2 * 4))) | value << (at % 2 * 4));
}
static void copy_nibbles(uint8_t *to, int to_at, const uint8_t *from, int from_at, int count) {
  for (int i = 0; i < count; i++)
    put_nibble(to, to_at + i, get_nibble(from, from_at + i));
}

// Field number i of a message; null after the last. `room` is for the sensors, whose places follow a rule.
static const field *field_of(const message *m, int i, field *room) {
  if (i < m->fields)
    return &m->field[i];
  const int sensor = i - m->fields;
  if (m->fd_id != GV_ID_GLOVE || sensor >= SENSORS_BY_RULE)
    return NULL;
  *room = (field){(uint8_t)(SENSOR_FD + SENSOR_NIBBLES * sensor), (uint8_t)(sensor / 4),
                  (uint8_t)(4 + SENSOR_NIBBLES * (sensor % 4)), SENSOR_NIBBLES};
  return room;
}

// ---- the command ------------------------------------------------------------------------------------

static uint8_t command_checksum(const gv_frame *frame) {
  uint8_t crc = 0xff;
  for (int i = -2; i < COMMAND_BYTES - 1; i++) {
    crc ^= i < 0 ? (uint8_t)(frame->id >> 8 * (i + 2)) : frame->data[i];
    for (int bit = 0; bit < 8; bit++)
      crc = (uint8_t)(crc & 0x80 ? crc << 1 ^ 0x2f : crc << 1);
  }
  return crc ^ 0xff;
}

// Ten bits at any place.
static unsigned get_10(const uint8_t *data, int bit) {
  return (unsigned)(data[bit / 8] | data[bit / 8 + 1] << 8) >> bit % 8 & 1023u;
}
static void put_10(uint8_t *data, int bit, unsigned value) {
  data[bit / 8] |= (uint8_t)(value << bit % 8);
  data[bit / 8 + 1] |= (uint8_t)(value << bit % 8 >> 8);
}

static int split_command(const gv_frame *fd, gv_frame *out) {
  gv_command_msg msg;
  if (gv_fcu_unpack_command(fd, &msg) != GV_FCU_OK)
    return 0;
  *out = (gv_frame){.stamp_ns = fd->stamp_ns, .id = GV_ID_FORCE_COMMAND_CLASSIC, .len = COMMAND_BYTES};
  out->data[0] = (uint8_t)((msg.counter & 15) | (msg.flags & GV_COMMAND_ENABLE) << 4);
  for (int i = 0; i < GV_FINGERS; i++)
    put_10(out->data, 6 + 10 * i, (unsigned)(msg.tension_n[i] / GV_CLASSIC_TENSION_LSB_N + 1e-6));
  out->data[7] = command_checksum(out);
  return 1;
}

// The counter modulo 16 is taken to be at most 8 ahead of the last one or 7 behind it.
static void join_command(gv_classic_join *join, const gv_frame *frame, gv_frame *out) {
  *out = *frame;
  if (frame->len != COMMAND_BYTES || frame->data[7] != command_checksum(frame) || frame->data[0] & 0x20)
    return;
  int ahead = (frame->data[0] - join->command_counter) & (COMMAND_COUNTERS - 1);
  if (ahead > COMMAND_COUNTERS / 2)
    ahead -= COMMAND_COUNTERS;
  gv_command_msg msg = {.counter = (uint8_t)(join->command_counter + ahead),
                        .flags = frame->data[0] >> 4 & GV_COMMAND_ENABLE};
  for (int i = 0; i < GV_FINGERS; i++)
    msg.tension_n[i] = get_10(frame->data, 6 + 10 * i) * GV_CLASSIC_TENSION_LSB_N;
  if (ahead > 0)
    join->command_counter = msg.counter;
  gv_fcu_pack_command(&msg, out);
}

// ---- cutting and joining ------------------------------------------------------------------------------

int gv_classic_split(const gv_frame *fd, gv_frame out[GV_CLASSIC_FRAMES]) {
  field room;
  const field *f;
  if (!(fd->flags & GV_FRAME_FD) || fd->flags & GV_FRAME_EXTENDED)
    return 0;
  if (fd->id == GV_ID_FORCE_COMMAND)
    return split_command(fd, out);
  for (const message *m = layout; m < layout + MESSAGES; m++) {
    if (fd->id != m->fd_id || fd->len != m->fd_len)
      continue;
    for (uint8_t i = 0; i < m->parts; i++) {
      out[i] = (gv_frame){.stamp_ns = fd->stamp_ns, .id = m->classic_id + i, .len = m->len[i]};
      out[i].data[0] = fd->data[0];
    }
    for (int i = 0; (f = field_of(m, i, &room)); i++)
      copy_nibbles(out[f->part].data, f->at, fd->data, f->fd, f->count);
    return m->parts;
  }
  return 0;
}

static bool is_part_of(const message *m, const gv_frame *frame) {
  const uint32_t part = frame->id - m->classic_id;
  return part < m->parts && frame->len == m->len[part];
}

// The message of the kind that the frame belongs to: one under way, or a new one in the place of the oldest.
static gv_classic_begun *begun_for(gv_classic_join *join, int kind, uint8_t counter) {
  assert(kind >= 0 && kind < MESSAGES);
  const message *m = &layout[kind];
  gv_classic_begun *oldest = join->begun[kind];
  for (int i = 0; i < GV_CLASSIC_UNDER_WAY; i++) {
    gv_classic_begun *b = &join->begun[kind][i];
    if (b->missing && b->frame.data[0] == counter)
      return b;
    if (oldest->missing && (!b->missing || b->number < oldest->number))
      oldest = b;
  }
  *oldest = (gv_classic_begun){.missing = (1u << m->parts) - 1u, .number = ++join->number};
  oldest->frame = (gv_frame){.id = m->fd_id, .flags = GV_FRAME_FD | GV_FRAME_BRS, .len = m->fd_len};
  oldest->frame.data[0] = counter;
  return oldest;
}

// The message that the frame completes, or null.
static const gv_frame *join_part(gv_classic_join *join, int kind, const gv_frame *frame) {
  const message *m = &layout[kind];
  const uint32_t part = frame->id - m->classic_id;
  gv_classic_begun *b = begun_for(join, kind, frame->data[0]);
  field room;
  const field *f;
  for (int i = 0; (f = field_of(m, i, &room)); i++)
    if (f->part == part)
      copy_nibbles(b->frame.data, f->fd, frame->data, f->at, f->count);
  b->missing &= ~(1u << part);
  b->frame.stamp_ns = frame->stamp_ns;
  return b->missing == 0 ? &b->frame : NULL;
}

static bool is_special(const gv_frame *frame) {
  return frame->flags & (GV_FRAME_FD | GV_FRAME_EXTENDED | GV_FRAME_REMOTE | GV_FRAME_ERROR);
}

bool gv_classic_is_part(const gv_frame *frame) {
  if (is_special(frame))
    return false;
  for (int i = 0; i < MESSAGES; i++)
    if (frame->id - layout[i].classic_id < layout[i].parts)
      return true;
  return frame->id == GV_ID_FORCE_COMMAND_CLASSIC;
}

int gv_classic_take(gv_classic_join *join, const gv_frame *frame, gv_frame *out) {
  *out = *frame;
  if (is_special(frame))
    return 1;
  if (frame->id == GV_ID_FORCE_COMMAND_CLASSIC)
    join_command(join, frame, out);
  for (int i = 0; i < MESSAGES; i++) {
    if (!is_part_of(&layout[i], frame))
      continue;
    const gv_frame *whole = join_part(join, i, frame);
    if (!whole)
      return 0;
    *out = *whole;
  }
  return 1;
}
