// SPDX-License-Identifier: BSD-3-Clause
// The FASTRAK's commands and records (fastrak.h): bytes to poses in metres and back. Pure; any thread;
// a record takes 0.2 us (binary) to 0.5 us (ASCII).
#include "wire/fastrak.h"

#include "gloved/drivers.h"  // gv_fastrak_upright

#include <stdio.h>
#include <string.h>

// numbers of a record, characters of one in ASCII, marks in front
enum { VALUES = 7, FIELD = 7, HEADER = 3 };
static const double cm_per_m = 100.0, range_m = 10.0, length_tolerance = 2e-3;

static bool is_letter(uint8_t c) { return (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z'); }
static bool is_digit(uint8_t c) { return c >= '0' && c <= '9'; }

// ---- numbers --------------------------------------------------------------------------------------

static double get_float(const uint8_t *p) {
  uint32_t bits = p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
  float value;
  memcpy(&value, &bits, sizeof value);
  return (double)value;
}

static void put_float(uint8_t *p, double value) {
  float f = (float)value;
  uint32_t bits;
  memcpy(&bits, &f, sizeof bits);
  for (int i = 0; i < 4; i++)
    p[i] = (uint8_t)(bits >> 8 * i);
}

// Blanks, a sign, digits with one point among or before them, and nothing behind; NAN for anything else.
static double get_field(const uint8_t *p) {
  int i = 0;
  int digits = 0;
  double value = 0.0;
  double scale = 0.0;
  while (i < FIELD && p[i] == ' ')
    i++;
  bool negative = i < FIELD && p[i] == '-';
  if (i < FIELD && (p[i] == '-' || p[i] == '+'))
    i++;
  while (i < FIELD && p[i] == ' ')
    i++;
  for (; i < FIELD; i++) {
    if (p[i] == '.' && scale == 0.0) {
      scale = 1.0;
      continue;
    }
    if (!is_digit(p[i]))
      return (double)NAN;
    value = 10.0 * value + (p[i] - '0');
    scale *= 10.0;
    digits++;
  }
  if (digits == 0 || scale == 0.0)
    return (double)NAN;
  value /= scale;
  return negative ? -value : value;
}

// ---- records --------------------------------------------------------------------------------------

static void read_values(gv_fastrak_format format, const uint8_t *byte, double out[VALUES]) {
  for (int i = 0; i < VALUES; i++)
    out[i] = format == GV_FASTRAK_BINARY ? get_float(byte + HEADER + 4 * i)
                                         : get_field(byte + HEADER + FIELD * i);
}

static bool read_pose(gv_fastrak_format format, const uint8_t *byte, gv_pose *out) {
  double v[VALUES];
  read_values(format, byte, v);
  out->p = gv_scale(gv_v3(v[0], v[1], v[2]), 1.0 / cm_per_m);
  out->q = (gv_quat){v[3], v[4], v[5], v[6]};
  double length = sqrt(v[3] * v[3] + v[4] * v[4] + v[5] * v[5] + v[6] * v[6]);
  return gv_pose_finite(*out) && gv_norm(out->p) <= range_m && fabs(length - 1.0) <= length_tolerance;
}

static bool header_may_be(const uint8_t *byte, int count) {
  if (byte[0] != '0')
    return false;
  if (count > 1 && (byte[1] < '1' || byte[1] >= '1' + GV_FASTRAK_STATIONS))
    return false;
  return count < HEADER || byte[2] == ' ' || is_letter(byte[2]);
}

// Where exactly the last three bytes are missing, the header of the next record ends with the space that is
// waited for, and z of the quaternion (then 3e-9 to 2e-7) can be too small for its length to tell.
static bool ends_in_header(const uint8_t *byte) {
  const uint8_t *tail = byte + GV_FASTRAK_BINARY_BYTES - HEADER;
  return tail[0] == '0' && tail[1] >= '1' && tail[1] < '1' + GV_FASTRAK_STATIONS;
}

static int scan_binary(const uint8_t *byte, int count) {
  gv_pose T;
  if (count < GV_FASTRAK_BINARY_BYTES)
    return 0;
  if (byte[GV_FASTRAK_BINARY_BYTES - 1] != ' ' || ends_in_header(byte))
    return -1;
  return byte[2] != ' ' || read_pose(GV_FASTRAK_BINARY, byte, &T) ? GV_FASTRAK_BINARY_BYTES : -1;
}

// Every character is looked at as it comes: the next record behind one that broke
// off is at once seen as such.
static int scan_ascii(const uint8_t *byte, int count) {
  const int end = HEADER + VALUES * FIELD;
  gv_pose T;
  for (int i = HEADER; i < count && i < end; i++)
    if (!is_digit(byte[i]) && !memchr(" +-.", byte[i], 4))
      return -1;
  if (count > end && byte[end] != '\r')
    return -1;
  if (count < GV_FASTRAK_ASCII_BYTES)
    return 0;
  if (byte[end + 1] != '\n')
    return -1;
  return byte[2] != ' ' || read_pose(GV_FASTRAK_ASCII, byte, &T) ? GV_FASTRAK_ASCII_BYTES : -1;
}

int gv_fastrak_scan(const void *format, const uint8_t *byte, int count) {
  if (!header_may_be(byte, count))
    return -1;
  return *(const gv_fastrak_format *)format == GV_FASTRAK_BINARY ? scan_binary(byte, count)
                                                                 : scan_ascii(byte, count);
}

void gv_fastrak_decode(gv_fastrak_format format, const uint8_t *byte, gv_fastrak_record *out) {
  out->station = byte[1] - '0';
  out->error = (char)byte[2];
  const bool sound = read_pose(format, byte, &out->T_tracker_receiver);
  if (!sound)
    out->T_tracker_receiver = gv_pose_identity();
  out->usable = sound && !gv_fastrak_error_concerns_pose(out->error);
  out->T_tracker_receiver.q = gv_quat_normalize(out->T_tracker_receiver.q);
}

int gv_fastrak_encode(gv_fastrak_format format, const gv_fastrak_record *record, uint8_t *out) {
  const gv_vec3 p = gv_scale(record->T_tracker_receiver.p, cm_per_m);
  const gv_quat q = record->T_tracker_receiver.q;
  const double v[VALUES] = {p.x, p.y, p.z, q.w, q.x, q.y, q.z};
  out[0] = '0';
  out[1] = (uint8_t)('0' + record->station);
  out[2] = (uint8_t)record->error;
  if (format == GV_FASTRAK_BINARY) {
    for (int i = 0; i < VALUES; i++)
      put_float(out + HEADER + 4 * i, v[i]);
    out[GV_FASTRAK_BINARY_BYTES - 1] = ' ';
    return GV_FASTRAK_BINARY_BYTES;
  }
  for (int i = 0; i < VALUES; i++) {
    char field[32];
    snprintf(field, sizeof field, i < 3 ? "%7.2f" : "%7.4f", gv_clamp(v[i], -999.99, 999.99));
    memcpy(out + HEADER + FIELD * i, field, FIELD);
  }
  memcpy(out + HEADER + VALUES * FIELD, "\r\n", 2);
  return GV_FASTRAK_ASCII_BYTES;
}

bool gv_fastrak_error_concerns_pose(char error) {
  static const char others[] = {' ', 'm', 't', 'v', 'w'};
  return memchr(others, error, sizeof others) == NULL;
}

// Manual, pages 70 and 71: capital letters are tests of the electronics, small ones those below.
const char *gv_fastrak_error_text(char error) {
  static const struct {
    const char *letters, *text;
  } known[] = {
    {" ", "none"},
    {"abc", "transmitter driver out of limits in self-calibration"},
    {"def", "receiver gain out of limits in self-calibration"},
    {"g", "coil out of limits in self-calibration"},
    {"j", "receiver signal saturated: too near the transmitter"},
    {"k", "receiver signal too low: too far from the transmitter, or unplugged"},
    {"l", "receiver signal is zero: unplugged"},
    {"mw", "configuration memory of the tracker"},
    {"s", "position found anew"},
    {"t", "compensation map of the tracker"},
    {"v", "no CRT sync signal"},
    {"u", "position outside the compensated volume"},
    {"x", "receiver outside the motion box"},
    {"y", "angles outside the allowed range"},
  };
  for (size_t i = 0; error && i < sizeof known / sizeof *known; i++)
    if (strchr(known[i].letters, error))
      return known[i].text;
  return is_letter((uint8_t)error) ? "built-in test failed" : "no error letter";
}

// ---- commands -------------------------------------------------------------------------------------

enum { FIRST = 2, PER_STATION = 6, FILTERS = 2 };  // units and format; of a station; both filters

// One of a station's commands. Of one that is off only the first says something.
static int station_command(const gv_fastrak_setup *setup, int station, int number,
                           char out[GV_FASTRAK_COMMAND_MAX]) {
  const size_t size = GV_FASTRAK_COMMAND_MAX;
  const bool on = station == setup->head || station == setup->hand || station == setup->hand2;
  const int *h = setup->hemisphere;
  if (number == 0 || !on)
    return snprintf(out, size, "l%d,%d\r", station, on ? 1 : 0);
  switch (number) {
    case 1: return snprintf(out, size, "H%d,%d,%d,%d\r", station, h[0], h[1], h[2]);
    case 2: return snprintf(out, size, "O%d,2,11,%d\r", station, setup->format == GV_FASTRAK_BINARY ? 0 : 1);
    case 3: return snprintf(out, size, "I%d,0\r", station);
    case 4: return snprintf(out, size, "R%d\r", station);
    default: return snprintf(out, size, "b%d\r", station);
  }
}

int gv_fastrak_command(const gv_fastrak_setup *setup, int number, char out[GV_FASTRAK_COMMAND_MAX]) {
  const size_t size = GV_FASTRAK_COMMAND_MAX;
  const int of_station = number - FIRST;
  const int filter = of_station - PER_STATION * GV_FASTRAK_STATIONS;
  if (number == 0)
    return snprintf(out, size, "u");
  if (number == 1)
    return snprintf(out, size, "%c", setup->format == GV_FASTRAK_BINARY ? 'f' : 'F');
  if (filter < 0)
    return station_command(setup, 1 + of_station / PER_STATION, of_station % PER_STATION, out);
  return filter < FILTERS ? snprintf(out, size, "%c,1\r", filter == 0 ? 'v' : 'x') : 0;
}

// ---- what it says of itself -----------------------------------------------------------------------

static int hex_digit(uint8_t c) {
  if (is_digit(c))
    return c - '0';
  return c >= 'A' && c <= 'F' ? c - 'A' + 10 : -1;
}

static bool is_station(uint8_t c) { return c >= '1' && c < '1' + GV_FASTRAK_STATIONS; }

// Number of the test in three characters, blank: none. Its letter has that number (page 71).
static char error_of(const uint8_t *p) {
  int number = 0;
  for (int i = 0; i < 3; i++)
    if (is_digit(p[i]))
      number = 10 * number + p[i] - '0';
  return is_letter((uint8_t)number) ? (char)number : ' ';
}

bool gv_fastrak_find_status(const uint8_t *byte, int count, gv_fastrak_status *out) {
  for (int i = 0; i + 9 <= count; i++) {
    const uint8_t *p = byte + i;
    const int flags = hex_digit(p[5]);
    if (p[0] != '2' || !is_station(p[1]) || p[2] != 'S' || hex_digit(p[3]) < 0 || hex_digit(p[4]) < 0 ||
        flags < 0)
      continue;
    *out = (gv_fastrak_status){
      .binary = flags & 1, .centimetres = flags & 2, .continuous = flags & 8, .error = error_of(p + 6)};
    return true;
  }
  return false;
}

bool gv_fastrak_find_stations(const uint8_t *byte, int count, bool out_on[GV_FASTRAK_STATIONS + 1]) {
  for (int i = 0; i + 3 + GV_FASTRAK_STATIONS <= count; i++) {
    const uint8_t *p = byte + i;
    bool states = p[0] == '2' && is_station(p[1]) && p[2] == 'l';
    for (int s = 0; states && s < GV_FASTRAK_STATIONS; s++)
      states = p[3 + s] == '0' || p[3 + s] == '1';
    for (int s = 1; states && s <= GV_FASTRAK_STATIONS; s++)
      out_on[s] = p[2 + s] == '1';
    if (states)
      return true;
  }
  return false;
}

bool gv_fastrak_find_refusal(const uint8_t *byte, int count) {
  static const char mark[] = "*ERROR*";
  const int n = (int)sizeof mark - 1;
  for (int i = 0; i + n <= count; i++)
    if (memcmp(byte + i, mark, (size_t)n) == 0)
      return true;
  return false;
}

gv_pose gv_fastrak_upright(void) { return (gv_pose){{0, 1, 0, 0}, {0, 0, 0}}; }
