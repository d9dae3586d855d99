// SPDX-License-Identifier: BSD-3-Clause
// The datagrams that move a hand without a glove, and their answers (hand_input.h). Pure; any thread.
#include "wire/hand_input.h"

#include <string.h>

enum { VERSION = 1 };
enum { AT_VERSION = 4, AT_FLAGS = 5, AT_NUMBER = 6, AT_WRIST = 8, AT_GRIP = 36, AT_TENSION = 56 };
enum { INPUT_FLAGS = GV_HAND_INPUT_DEAD_MAN | GV_HAND_INPUT_HOME | GV_HAND_INPUT_ASK };
enum { OUTPUT_FLAGS = GV_HAND_OUTPUT_DEAD_MAN | GV_HAND_OUTPUT_FORCES | GV_HAND_OUTPUT_OTHER };
static const double reach_m = 2.0, length_off = 1e-3;

static void put_float(uint8_t *out, double value) {
  const float single = (float)value;
  uint32_t bits;
  memcpy(&bits, &single, sizeof bits);
  for (int i = 0; i < 4; i++)
    out[i] = (uint8_t)(bits >> (8 * i));
}

static double get_float(const uint8_t *in) {
  uint32_t bits = 0;
  float single;
  for (int i = 0; i < 4; i++)
    bits |= (uint32_t)in[i] << (8 * i);
  memcpy(&single, &bits, sizeof single);
  return (double)single;
}

static void put_floats(uint8_t *out, const double *value, int count) {
  for (int i = 0; i < count; i++)
    put_float(out + 4 * i, value[i]);
}

static void get_floats(const uint8_t *in, double *out, int count) {
  for (int i = 0; i < count; i++)
    out[i] = get_float(in + 4 * i);
}

static void put_head(uint8_t *out, const char *magic, uint8_t flags, uint16_t number) {
  memcpy(out, magic, 4);
  out[AT_VERSION] = VERSION;
  out[AT_FLAGS] = flags;
  out[AT_NUMBER] = (uint8_t)number;
  out[AT_NUMBER + 1] = (uint8_t)(number >> 8);
}

static bool get_head(const uint8_t *in, const char *magic, int known, uint8_t *flags, uint16_t *number) {
  if (memcmp(in, magic, 4) != 0 || in[AT_VERSION] != VERSION || (in[AT_FLAGS] & ~known))
    return false;
  *flags = in[AT_FLAGS];
  *number = (uint16_t)(in[AT_NUMBER] | in[AT_NUMBER + 1] << 8);
  return true;
}

static void put_pose(uint8_t *out, const gv_pose *T) {
  const double value[7] = {T->p.x, T->p.y, T->p.z, T->q.w, T->q.x, T->q.y, T->q.z};
  put_floats(out, value, 7);
}

static bool get_pose(const uint8_t *in, gv_pose *out) {
  double v[7];
  get_floats(in, v, 7);
  for (int i = 0; i < 3; i++)
    if (!(fabs(v[i]) <= reach_m))
      return false;
  const double length = sqrt(v[3] * v[3] + v[4] * v[4] + v[5] * v[5] + v[6] * v[6]);
  if (!(fabs(length - 1.0) <= length_off))
    return false;
  *out = (gv_pose){gv_quat_normalize((gv_quat){v[3], v[4], v[5], v[6]}), {v[0], v[1], v[2]}};
  return true;
}

static bool get_grip(const uint8_t *in, double out[GV_FINGERS]) {
  get_floats(in, out, GV_FINGERS);
  for (int f = 0; f < GV_FINGERS; f++)
    if (!(out[f] >= 0.0 && out[f] <= 1.0))
      return false;
  return true;
}

void gv_hand_input_pack(const gv_hand_input *in, uint8_t out[GV_HAND_INPUT_BYTES]) {
  put_head(out, "GVHI", in->flags, in->number);
  put_pose(out + AT_WRIST, &in->T_world_wrist);
  put_floats(out + AT_GRIP, in->grip, GV_FINGERS);
}

bool gv_hand_input_unpack(const uint8_t *data, size_t size, gv_hand_input *out) {
  if (size != GV_HAND_INPUT_BYTES)
    return false;
  if (!get_head(data, "GVHI", INPUT_FLAGS, &out->flags, &out->number))
    return false;
  return get_pose(data + AT_WRIST, &out->T_world_wrist) && get_grip(data + AT_GRIP, out->grip);
}

void gv_hand_output_pack(const gv_hand_output *in, uint8_t out[GV_HAND_OUTPUT_BYTES]) {
  put_head(out, "GVHO", in->flags, in->number);
  put_pose(out + AT_WRIST, &in->T_world_wrist);
  put_floats(out + AT_GRIP, in->grip, GV_FINGERS);
  put_floats(out + AT_TENSION, in->tension_n, GV_FINGERS);
}

bool gv_hand_output_unpack(const uint8_t *data, size_t size, gv_hand_output *out) {
  if (size != GV_HAND_OUTPUT_BYTES)
    return false;
  if (!get_head(data, "GVHO", OUTPUT_FLAGS, &out->flags, &out->number))
    return false;
  if (!get_pose(data + AT_WRIST, &out->T_world_wrist) || !get_grip(data + AT_GRIP, out->grip))
    return false;
  get_floats(data + AT_TENSION, out->tension_n, GV_FINGERS);
  for (int f = 0; f < GV_FINGERS; f++)
    if (!isfinite(out->tension_n[f]))
      return false;
  return true;
}
