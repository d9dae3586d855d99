// SPDX-License-Identifier: BSD-3-Clause
// The lines of LucidGloves (lucidglove.h): bytes to bends and buttons, bends to joint counts, brakes to
// bytes. Pure; any thread; 1 us a line: it is read when its newline is there.
#include "wire/lucidglove.h"

#include <stdio.h>
#include <string.h>

enum { COUNT_MAX = 4095 };
static const double rad_per_deg = GV_PI / 180.0;

// Angles of a straight finger and of one that is bent all the way, degrees; joints
// that are not named are at 0.
typedef struct spread {
  int sensor, finger, joint;
  double straight_deg, bent_deg;
} spread;
static const spread spreads[] = {
  {GV_THUMB_MPJ, 0, 0, 0, 60},  {GV_THUMB_IJ, 0, 1, 0, 80},    {GV_THUMB_ABDUCTION, 0, -1, 45, 45},
  {GV_INDEX_MPJ, 1, 0, 0, 90},  {GV_INDEX_PIJ, 1, 1, 0, 100},  {GV_INDEX_DIJ, 1, 2, 0, 67},
  {GV_MIDDLE_MPJ, 2, 0, 0, 90}, {GV_MIDDLE_PIJ, 2, 1, 0, 100}, {GV_MIDDLE_DIJ, 2, 2, 0, 67},
  {GV_RING_MPJ, 3, 0, 0, 90},   {GV_RING_PIJ, 3, 1, 0, 100},   {GV_RING_DIJ, 3, 2, 0, 67},
  {GV_LITTLE_MPJ, 4, 0, 0, 90}, {GV_LITTLE_PIJ, 4, 1, 0, 100}, {GV_LITTLE_DIJ, 4, 2, 0, 67}};
enum { SPREADS = sizeof spreads / sizeof *spreads };

// ---- lines from the glove -------------------------------------------------------------------------

// A number without leading zeros. Returns its digits, -1 where it is none or above max.
static int take_number(const uint8_t *byte, int count, int max, int *out) {
  int n = 0;
  int value = 0;
  for (; n < count && byte[n] >= '0' && byte[n] <= '9'; n++) {
    if (n == 1 && value == 0)
      return -1;
    value = 10 * value + (byte[n] - '0');
    if (value > max)
      return -1;
  }
  *out = value;
  return n > 0 ? n : -1;
}

static bool has_number(uint8_t letter) { return letter <= 'G' || letter == 'P'; }

static uint32_t joint_bit(int finger, int joint) { return 1u << (GV_LUCID_JOINTS * finger + joint); }

// Where the value of "AAA" to "EAD" goes; null where it is not used.
static int *joint_of(const uint8_t key[3], gv_lucid_sample *s) {
  const int finger = key[0] - 'A';
  const int joint = key[2] - 'A';
  const int joints = finger == 0 ? 2 : GV_LUCID_JOINTS;
  return joint < joints ? &s->joint[finger][joint] : NULL;
}

// Length of the key in brackets at byte[0]: splay "(AB)", joint "(AAA)", about itself "(ZV)"; -1: it is none.
static int key_length(const uint8_t *byte, int count) {
  if (count >= 4 && byte[1] == 'Z' && byte[2] >= 'A' && byte[2] <= 'Z' && byte[3] == ')')
    return 4;
  if (count < 4 || byte[1] < 'A' || byte[1] > 'E')
    return -1;
  if (byte[2] == 'B' && byte[3] == ')')
    return 4;
  return count >= 5 && byte[2] == 'A' && byte[3] >= 'A' && byte[3] <= 'D' && byte[4] == ')' ? 5 : -1;
}

// A key in brackets with its number.
static int take_key(int max, const uint8_t *byte, int count, gv_lucid_sample *s) {
  const int key = key_length(byte, count);
  int value = 0;
  if (key < 0 || count == key)
    return -1;
  const int digits = take_number(byte + key, count - key, max, &value);
  if (digits < 1)
    return -1;
  int *place = key == 5 ? joint_of(byte + 1, s) : NULL;
  if (place) {
    const uint32_t bit = joint_bit(byte[1] - 'A', byte[3] - 'A');
    if (s->joints & bit)
      return -1;
    s->joints |= bit;
    *place = value;
  }
  return key + digits;
}

// A letter with what belongs to it. Bytes taken, or -1.
static int take_item(int max, const uint8_t *byte, int count, gv_lucid_sample *s) {
  const uint8_t letter = byte[0];
  int value = 0;
  int digits = 0;
  if (letter == '(')
    return take_key(max, byte, count, s);
  if (letter < 'A' || letter > 'P' || s->letters & gv_lucid_bit((char)letter))
    return -1;
  if (has_number(letter))
    digits = take_number(byte + 1, count - 1, max, &value);
  if (digits < 0)
    return -1;
  s->letters |= gv_lucid_bit((char)letter);
  if (letter <= 'E')
    s->bend[letter - 'A'] = value;
  return 1 + digits;
}

// A finger that has joints alone bends by their mean. Returns whether there is something of it.
static bool has_finger(gv_lucid_sample *s, int finger) {
  int sum = 0;
  int n = 0;
  if (s->letters & gv_lucid_bit((char)('A' + finger)))
    return true;
  for (int j = 0; j < GV_LUCID_JOINTS; j++) {
    if (!(s->joints & joint_bit(finger, j)))
      continue;
    sum += s->joint[finger][j];
    n++;
  }
  if (n > 0)
    s->bend[finger] = sum / n;
  return n > 0;
}

// The items of a line without its end. False where it is none.
static bool read_items(int max, const uint8_t *byte, int count, gv_lucid_sample *out) {
  *out = (gv_lucid_sample){.letters = 0};
  for (int n = 0; n < count;) {
    const int taken = take_item(max, byte + n, count - n, out);
    if (taken < 0)
      return false;
    n += taken;
  }
  for (int f = 0; f < GV_FINGERS; f++)
    if (!has_finger(out, f))
      return false;
  return true;
}

static int without_end(const uint8_t *byte, int length) {
  return length >= 2 && byte[length - 2] == '\r' ? length - 2 : length - 1;
}

static bool may_stand_in_line(uint8_t c) {
  return (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '(' || c == ')' || c == '\r' || c == '\n';
}

// Each byte is looked at as it comes; what the line says, when its newline is there.
int gv_lucid_scan(const void *format, const uint8_t *byte, int count) {
  const gv_lucid_format *f = format;
  gv_lucid_sample ignored;
  if ((byte[0] != 'A' && byte[0] != '(') || !may_stand_in_line(byte[count - 1]))
    return -1;
  const uint8_t *end = memchr(byte, '\n', (size_t)count);
  if (!end)
    return count < GV_LUCID_LINE_BYTES ? 0 : -1;
  const int length = (int)(end - byte) + 1;
  return read_items(f->max, byte, without_end(byte, length), &ignored) ? length : -1;
}

void gv_lucid_decode(const gv_lucid_format *format, const uint8_t *byte, int length, gv_lucid_sample *out) {
  read_items(format->max, byte, without_end(byte, length), out);
}

int gv_lucid_encode(const gv_lucid_format *format, const gv_lucid_sample *s,
                    uint8_t out[GV_LUCID_LINE_BYTES]) {
  char text[GV_LUCID_LINE_BYTES];
  const int middle = format->max / 2;
  int n = snprintf(text, sizeof text, "A%dB%dC%dD%dE%dF%dG%dP%d", s->bend[0], s->bend[1], s->bend[2],
                   s->bend[3], s->bend[4], middle, middle,
                   s->bend[1] > middle ? 2 * (s->bend[1] - middle) - 1 : 0);
  for (char letter = 'H'; letter <= 'O'; letter++)
    if (s->letters & gv_lucid_bit(letter))
      text[n++] = letter;
  text[n++] = '\n';
  memcpy(out, text, (size_t)n);
  return n;
}

// ---- joints ---------------------------------------------------------------------------------------

void gv_lucid_raw(const gv_lucid_format *format, const gv_lucid_sample *sample, const gv_calibration *cal,
                  uint16_t out_raw[GV_SENSORS]) {
  double angle_deg[GV_SENSORS] = {0};
  for (int i = 0; i < SPREADS; i++) {
    const spread *s = &spreads[i];
    const bool own = s->joint >= 0 && sample->joints & joint_bit(s->finger, s->joint);
    const int bend = own ? sample->joint[s->finger][s->joint] : sample->bend[s->finger];
    angle_deg[s->sensor] = s->straight_deg + (s->bent_deg - s->straight_deg) * bend / format->max;
  }
  for (int i = 0; i < GV_SENSORS; i++)
    out_raw[i] = (uint16_t)gv_clamp(floor(gv_calibration_raw(cal, i, angle_deg[i] * rad_per_deg) + 0.5), 0.0,
                                    COUNT_MAX);
}

void gv_lucid_bend(const gv_lucid_format *format, const double angle_rad[GV_SENSORS],
                   int out_bend[GV_FINGERS]) {
  double bent_rad[GV_FINGERS] = {0};
  double range_rad[GV_FINGERS] = {0};
  for (int i = 0; i < SPREADS; i++) {
    const spread *s = &spreads[i];
    if (s->straight_deg >= s->bent_deg)
      continue;
    bent_rad[s->finger] += angle_rad[s->sensor];
    range_rad[s->finger] += s->bent_deg * rad_per_deg;
  }
  for (int f = 0; f < GV_FINGERS; f++)
    out_bend[f] = (int)floor(gv_clamp(bent_rad[f] / range_rad[f], 0.0, 1.0) * format->max + 0.5);
}

// ---- brakes ---------------------------------------------------------------------------------------

int gv_lucid_encode_brakes(const int brake[GV_FINGERS], char out[GV_LUCID_BRAKES_BYTES]) {
  char text[GV_LUCID_BRAKES_BYTES + 1];
  int b[GV_FINGERS];
  for (int f = 0; f < GV_FINGERS; f++)
    b[f] = brake[f] < 0 ? 0 : brake[f] > GV_LUCID_BRAKE_MAX ? GV_LUCID_BRAKE_MAX : brake[f];
  const int n = snprintf(text, sizeof text, "A%dB%dC%dD%dE%d\n", b[0], b[1], b[2], b[3], b[4]);
  memcpy(out, text, (size_t)n);
  return n;
}

bool gv_lucid_decode_brakes(const char *line, int length, int out_brake[GV_FINGERS]) {
  const uint8_t *p = (const uint8_t *)line;
  int brake[GV_FINGERS];
  for (int f = 0; f < GV_FINGERS; f++) {
    if (length < 2 || *p != 'A' + f)
      return false;
    const int digits = take_number(p + 1, length - 1, GV_LUCID_BRAKE_MAX, &brake[f]);
    if (digits < 1)
      return false;
    p += 1 + digits;
    length -= 1 + digits;
  }
  if (length != 0)
    return false;
  memcpy(out_brake, brake, sizeof brake);
  return true;
}
