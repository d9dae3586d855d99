// SPDX-License-Identifier: BSD-3-Clause
// Blocks of a DOGlove, and what its encoders mean (doglove.h). Pure; any thread.
#include "wire/doglove.h"

#include <string.h>

enum { WORDS = 19, AT_REFERENCE = 1, AT_ENCODERS = 2, AT_SUM = 18, FULL_SCALE = 0x7FFFFF };
static const uint8_t header[4] = {0xAA, 0x55, 0, 0};
static const uint32_t reference_min_uv = 1000000, reference_max_uv = 6000000;

// Which sensor an encoder feeds, its angle at zero, and its sign; split: of the finger against the next one.
enum { NONE = -1 };
typedef struct place {
  int sensor;
  double zero_deg, sign;
} place;
static const place bends[GV_DOGLOVE_ENCODERS] = {
  {GV_THUMB_IJ, 90, 1},     {GV_THUMB_MPJ, 270, -1}, {NONE, 180, 1},           {GV_THUMB_ABDUCTION, 270, -1},
  {GV_INDEX_DIJ, 90, 1},    {GV_INDEX_PIJ, 270, -1}, {NONE, 180, -1},          {GV_MIDDLE_DIJ, 90, 1},
  {GV_MIDDLE_PIJ, 270, -1}, {NONE, 180, -1},         {GV_RING_DIJ, 90, 1},     {GV_RING_PIJ, 270, -1},
  {NONE, 180, -1},          {GV_LITTLE_DIJ, 90, 1},  {GV_LITTLE_PIJ, 270, -1}, {NONE, 180, -1}};
// Splits of index to little finger, positive towards the thumb, and the spread between each and the next.
static const int splits[4] = {6, 9, 12, 15};
static const int spreads[3] = {GV_MIDDLE_INDEX_ABDUCTION, GV_RING_MIDDLE_ABDUCTION, GV_LITTLE_RING_ABDUCTION};
static const double servo_zero_deg[GV_FINGERS] = {182.2, 165.2, 150.29, 151.44, 145.9};
static const int servo_sensor[GV_FINGERS] = {GV_THUMB_ROTATE, GV_INDEX_MPJ, GV_MIDDLE_MPJ, GV_RING_MPJ,
                                             GV_LITTLE_MPJ};
static const double deg = GV_PI / 180.0;

static uint32_t get_word(const uint8_t *byte, int word) {
  const uint8_t *b = byte + 4 * word;
  return (uint32_t)b[0] | (uint32_t)b[1] << 8 | (uint32_t)b[2] << 16 | (uint32_t)b[3] << 24;
}

static void put_word(uint8_t *byte, int word, uint32_t value) {
  for (int i = 0; i < 4; i++)
    byte[4 * word + i] = (uint8_t)(value >> (8 * i));
}

static uint32_t sum_of(const uint8_t *byte) {
  uint32_t sum = 0;
  for (int word = AT_REFERENCE; word < AT_SUM; word++)
    sum += get_word(byte, word);
  return sum & 0xFFFF;
}

int gv_doglove_scan(const void *format, const uint8_t *byte, int count) {
  (void)format;
  const int known = count < 4 ? count : 4;
  if (memcmp(byte, header, (size_t)known) != 0)
    return -1;
  if (count < GV_DOGLOVE_BYTES)
    return 0;
  const uint32_t reference_uv = get_word(byte, AT_REFERENCE);
  if (reference_uv < reference_min_uv || reference_uv > reference_max_uv)
    return -1;
  return get_word(byte, AT_SUM) >> 16 == sum_of(byte) ? GV_DOGLOVE_BYTES : -1;
}

void gv_doglove_decode(const uint8_t byte[GV_DOGLOVE_BYTES], gv_doglove_block *out) {
  const double reference_v = 1e-6 * get_word(byte, AT_REFERENCE);
  for (int i = 0; i < GV_DOGLOVE_ENCODERS; i++) {
    const double volts = 5.0 * (int32_t)get_word(byte, AT_ENCODERS + i) / FULL_SCALE;
    out->encoder_deg[i] = 360.0 * volts / reference_v;
  }
  out->time_ms = (uint16_t)get_word(byte, AT_SUM);
}

void gv_doglove_encode(const gv_doglove_block *block, uint8_t out[GV_DOGLOVE_BYTES]) {
  static const uint32_t reference_uv = 3300000;
  memset(out, 0, GV_DOGLOVE_BYTES);
  memcpy(out, header, sizeof header);
  put_word(out, AT_REFERENCE, reference_uv);
  for (int i = 0; i < GV_DOGLOVE_ENCODERS; i++) {
    const double volts = block->encoder_deg[i] / 360.0 * 1e-6 * reference_uv;
    put_word(out, AT_ENCODERS + i, (uint32_t)(int32_t)floor(volts / 5.0 * FULL_SCALE + 0.5));
  }
  put_word(out, AT_SUM, sum_of(out) << 16 | block->time_ms);
}

// ---- joints ---------------------------------------------------------------------------------------

static double split_rad(const double encoder_deg[GV_DOGLOVE_ENCODERS], int finger) {
  const place *p = &bends[splits[finger]];
  return deg * p->sign * (encoder_deg[splits[finger]] - p->zero_deg);
}

void gv_doglove_angles(const double encoder_deg[GV_DOGLOVE_ENCODERS], const double servo_deg[GV_FINGERS],
                       double out_rad[GV_SENSORS]) {
  memset(out_rad, 0, GV_SENSORS * sizeof *out_rad);
  for (int i = 0; i < GV_DOGLOVE_ENCODERS; i++)
    if (bends[i].sensor != NONE)
      out_rad[bends[i].sensor] = deg * bends[i].sign * (encoder_deg[i] - bends[i].zero_deg);
  for (int k = 0; k < 3; k++)
    out_rad[spreads[k]] = split_rad(encoder_deg, k) - split_rad(encoder_deg, k + 1);
  for (int f = 0; f < GV_FINGERS; f++)
    out_rad[servo_sensor[f]] = deg * (servo_deg[f] - servo_zero_deg[f]);
}

double gv_doglove_servo_deg(int finger, double angle_rad) { return servo_zero_deg[finger] + angle_rad / deg; }

// The middle finger's split is 0.
static void spread_encoders(const double angle_rad[GV_SENSORS], double out_encoder_deg[GV_DOGLOVE_ENCODERS]) {
  const double ring = -angle_rad[GV_RING_MIDDLE_ABDUCTION];
  const double split[4] = {angle_rad[GV_MIDDLE_INDEX_ABDUCTION], 0.0, ring,
                           ring - angle_rad[GV_LITTLE_RING_ABDUCTION]};
  for (int k = 0; k < 4; k++) {
    const place *p = &bends[splits[k]];
    out_encoder_deg[splits[k]] = p->zero_deg + p->sign * split[k] / deg;
  }
}

void gv_doglove_encoders(const double angle_rad[GV_SENSORS], double out_encoder_deg[GV_DOGLOVE_ENCODERS],
                         double out_servo_deg[GV_FINGERS]) {
  for (int i = 0; i < GV_DOGLOVE_ENCODERS; i++) {
    const double angle = bends[i].sensor == NONE ? 0.0 : angle_rad[bends[i].sensor];
    out_encoder_deg[i] = bends[i].zero_deg + bends[i].sign * angle / deg;
  }
  spread_encoders(angle_rad, out_encoder_deg);
  for (int f = 0; f < GV_FINGERS; f++)
    out_servo_deg[f] = gv_doglove_servo_deg(f, angle_rad[servo_sensor[f]]);
}
