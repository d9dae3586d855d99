// SPDX-License-Identifier: BSD-3-Clause
// The lines of LucidGloves (lucidglove.h): bytes to bends and buttons, bends to joint counts, brakes to bytes. Pure;
// any thread; 5 us a line, most of it that it is looked
// at again with each byte.
#include "wire/lucidglove.h"

#include <stdio.h>
#include <string.h>

enum { COUNT_MAX = 4095 };
static const double rad_per_deg = GV_PI / 180.0;

// Angles of a straight finger and of one that is bent all the way, degrees; joints that are not named are at 0.
typedef struct spread { int sensor, finger; double straight_deg, bent_deg; } spread;
static const spread spreads[] = {
  {GV_THUMB_MPJ, 0, 0, 60},  {GV_THUMB_IJ, 0, 0, 80},   {GV_THUMB_ABDUCTION, 0, 45, 45},
  {GV_INDEX_MPJ, 1, 0, 90},  {GV_INDEX_PIJ, 1, 0, 100}, {GV_INDEX_DIJ, 1, 0, 67},
  {GV_MIDDLE_MPJ, 2, 0, 90}, {GV_MIDDLE_PIJ, 2, 0, 100}, {GV_MIDDLE_DIJ, 2, 0, 67},
  {GV_RING_MPJ, 3, 0, 90},   {GV_RING_PIJ, 3, 0, 100},  {GV_RING_DIJ, 3, 0, 67},
  {GV_LITTLE_MPJ, 4, 0, 90}, {GV_LITTLE_PIJ, 4, 0, 100}, {GV_LITTLE_DIJ, 4, 0, 67}};
enum { SPREADS = sizeof spreads / sizeof *spreads };

// ---- lines from the glove -------------------------------------------------------------------------

// A number without leading zeros. Returns its digits, -1 where it is none or above max; at the end of the bytes more
// digits may follow.
static int take_number(const uint8_t *byte, int count, int max, int *out) {
  int n = 0, value = 0;
  for (; n < count && byte[n] >= '0' && byte[n] <= '9'; n++) {
    if (n == 1 && value == 0) return -1;
    value = 10 * value + (byte[n] - '0');
    if (value > max) return -1;
  }
  *out = value;
  return n > 0 || count == 0 ? n : -1;
}

static bool has_number(uint8_t letter) { return letter <= 'G' || letter == 'P'; }

// "(AB)" to "(EB)" with its number, as far as it is there.
static int take_splay(int max, const uint8_t *byte, int count) {
  static const char rest[] = "B)";
  int ignored;
  if (count > 1 && (byte[1] < 'A' || byte[1] > 'E')) return -1;
  for (int i = 0; i < 2; i++)
    if (count > 2 + i && byte[2 + i] != (uint8_t)rest[i]) return -1;
  if (count <= 4) return count;
  const int digits = take_number(byte + 4, count - 4, max, &ignored);
  return digits < 0 ? -1 : 4 + digits;
}

// A letter with what belongs to it. Bytes taken, or -1.
static int take_item(int max, const uint8_t *byte, int count, gv_lucid_sample *s) {
  const uint8_t letter = byte[0];
  int value = 0, digits = 0;
  if (letter == '(') return take_splay(max, byte, count);
  if (letter < 'A' || letter > 'P' || s->letters & gv_lucid_bit((char)letter)) return -1;
  if (has_number(letter)) digits = take_number(byte + 1, count - 1, max, &value);
  if (digits < 0) return -1;
  s->letters |= gv_lucid_bit((char)letter);
  if (letter <= 'E') s->bend[letter - 'A'] = value;
  return 1 + digits;
}

// Length of the line with its newline, 0 where more bytes may make it one, -1 where not.
static int read_line(int max, const uint8_t *byte, int count, gv_lucid_sample *out) {
  const uint32_t fingers = 0x1f;
  int n = 0;
  *out = (gv_lucid_sample){.letters = 0};
  if (byte[0] != 'A') return -1;
  while (n < count && byte[n] != '\n') {
    const int taken = take_item(max, byte + n, count - n, out);
    if (taken < 0) return -1;
    n += taken;
  }
  if (n == count) return n < GV_LUCID_LINE_BYTES ? 0 : -1;
  return (out->letters & fingers) == fingers && n < GV_LUCID_LINE_BYTES ? n + 1 : -1;
}

int gv_lucid_scan(const void *format, const uint8_t *byte, int count) {
  gv_lucid_sample ignored;
  return read_line(((const gv_lucid_format *)format)->max, byte, count, &ignored);
}

void gv_lucid_decode(const gv_lucid_format *format, const uint8_t *byte, int length, gv_lucid_sample *out) {
  read_line(format->max, byte, length, out);
}

int gv_lucid_encode(const gv_lucid_format *format, const gv_lucid_sample *s, uint8_t out[GV_LUCID_LINE_BYTES]) {
  char text[GV_LUCID_LINE_BYTES];
  const int middle = format->max / 2;
  int n = snprintf(text, sizeof text, "A%dB%dC%dD%dE%dF%dG%dP%d", s->bend[0], s->bend[1], s->bend[2], s->bend[3], s->bend[4],
                   middle, middle, s->bend[1] > middle ? 2 * (s->bend[1] - middle) - 1 : 0);
  for (char letter = 'H'; letter <= 'O'; letter++)
    if (s->letters & gv_lucid_bit(letter)) text[n++] = letter;
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
    angle_deg[s->sensor] = s->straight_deg + (s->bent_deg - s->straight_deg) * sample->bend[s->finger] / format->max;
  }
  for (int i = 0; i < GV_SENSORS; i++)
    out_raw[i] = (uint16_t)gv_clamp(floor(gv_calibration_raw(cal, i, angle_deg[i] * rad_per_deg) + 0.5), 0.0, COUNT_MAX);
}

void gv_lucid_bend(const gv_lucid_format *format, const double angle_rad[GV_SENSORS], int out_bend[GV_FINGERS]) {
  double bent_rad[GV_FINGERS] = {0}, range_rad[GV_FINGERS] = {0};
  for (int i = 0; i < SPREADS; i++) {
    const spread *s = &spreads[i];
    if (s->straight_deg >= s->bent_deg) continue;
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
  for (int f = 0; f < GV_FINGERS; f++) b[f] = brake[f] < 0 ? 0 : brake[f] > GV_LUCID_BRAKE_MAX ? GV_LUCID_BRAKE_MAX : brake[f];
  const int n = snprintf(text, sizeof text, "A%dB%dC%dD%dE%d\n", b[0], b[1], b[2], b[3], b[4]);
  memcpy(out, text, (size_t)n);
  return n;
}

bool gv_lucid_decode_brakes(const char *line, int length, int out_brake[GV_FINGERS]) {
  const uint8_t *p = (const uint8_t *)line;
  int brake[GV_FINGERS];
  for (int f = 0; f < GV_FINGERS; f++) {
    if (length < 2 || *p != 'A' + f) return false;
    const int digits = take_number(p + 1, length - 1, GV_LUCID_BRAKE_MAX, &brake[f]);
    if (digits < 1) return false;
    p += 1 + digits;
    length -= 1 + digits;
  }
  if (length != 0) return false;
  memcpy(out_brake, brake, sizeof brake);
  return true;
}
