// SPDX-License-Identifier: BSD-3-Clause
// The CyberGlove's frames (cyberglove.h): bytes to 22 counts and back. Pure; any
// thread; 0.1 to 0.5 us a frame.
#include "wire/cyberglove.h"

#include <stdio.h>
#include <string.h>

enum { COUNT_MAX = 4095, WIDE_MAX = 4094, MARK = 3, TIME = 14, ERROR = 2 };
static const double dij_per_pij = 2.0 / 3.0;
static const uint8_t mark[MARK] = {0x0d, 0x0a, 0x00};

static bool is_digit(uint8_t c) { return c >= '0' && c <= '9'; }

// The joint above, or -1 for a sensor that every glove has.
static int filled_from(int sensor) {
  switch (sensor) {
    case GV_INDEX_DIJ:
    case GV_MIDDLE_DIJ:
    case GV_RING_DIJ:
    case GV_LITTLE_DIJ: return sensor - 1;
    default: return -1;
  }
}

static bool has_sensor(const gv_cyberglove_format *format, int sensor) {
  return format->sensors == GV_SENSORS || filled_from(sensor) < 0;
}

// ---- frames ---------------------------------------------------------------------------------------

static bool is_error(const uint8_t *byte) { return byte[0] == 'e' && (byte[1] == 's' || byte[1] == 'g'); }

// A frame whose last two sensors read "es" or "eg" is far more often one with an error that began two
// sensors too late, since a sensor may read 'S' or 'G': it is not taken.
static int scan_narrow(int sensors, const uint8_t *byte, int count) {
  const int end = sensors + 1;
  if (byte[0] != 'S' && byte[0] != 'G')
    return -1;
  for (int i = 1; i < count && i < end; i++)
    if (byte[i] == 0)
      return -1;
  if (count <= end)
    return 0;
  if (byte[end] == 0)
    return is_error(byte + end - ERROR) ? -1 : end + 1;
  if (byte[end] != 'e')
    return -1;
  if (count <= end + 1)
    return 0;
  if (!is_error(byte + end))
    return -1;
  if (count <= end + ERROR)
    return 0;
  return byte[end + ERROR] == 0 ? end + ERROR + 1 : -1;
}

// The time "HH:MM:SS:ss:nS", as far as it is there.
static bool time_may_be(const uint8_t *byte, int count) {
  for (int i = 0; i < count && i < TIME; i++) {
    const bool ok = i == TIME - 1 ? byte[i] == 'S' : i % 3 == 2 ? byte[i] == ':' : is_digit(byte[i]);
    if (!ok)
      return false;
  }
  return true;
}

// Where the time starts: behind the mark, and behind the "nS" or "e1" that may stand there.
static int time_at(const uint8_t *byte, int count) {
  const uint8_t *p = byte + MARK;
  if (count > MARK && p[0] == 'e')
    return MARK + 2;
  return count > MARK + 1 && is_digit(p[0]) && p[1] == 'S' ? MARK + 2 : MARK;
}

static bool stray_may_be(const uint8_t *byte, int count) {
  return count <= MARK + 1 || byte[MARK] != 'e' || byte[MARK + 1] == '1';
}

// Whether the last bytes could be the next frame's mark and the first digit of its time (or the
// e of "e1"): so they are where one to four bytes of this frame are missing. (With five, the
// digits would be no value of a sensor.)
static bool ends_like_mark(const uint8_t *byte, int length) {
  for (int n = 1; n <= MARK + 1; n++) {
    const uint8_t *tail = byte + length - n;
    if (memcmp(tail, mark, (size_t)(n < MARK ? n : MARK)) == 0 &&
        (n <= MARK || is_digit(tail[MARK]) || tail[MARK] == 'e'))
      return true;
  }
  return false;
}

static int scan_wide(int sensors, const uint8_t *byte, int count) {
  if (memcmp(byte, mark, (size_t)(count < MARK ? count : MARK)) != 0)
    return -1;
  if (count <= MARK)
    return 0;
  const int time = time_at(byte, count);
  const int data = time + TIME;
  const int end = data + 2 * sensors;
  if (!stray_may_be(byte, count) || !time_may_be(byte + time, count - time))
    return -1;
  for (int i = data; i + 1 < count && i < end; i += 2) {
    const int value = byte[i] << 8 | byte[i + 1];
    if (value < 1 || value > COUNT_MAX)
      return -1;
  }
  if (count < end)
    return 0;
  if (!ends_like_mark(byte, end))
    return end;
  if (count == end)
    return 0;  // the next byte tells: a mark starts behind a frame that is whole
  return byte[end] == mark[0] ? end : -1;
}

int gv_cyberglove_scan(const void *format, const uint8_t *byte, int count) {
  const gv_cyberglove_format *f = format;
  return f->wide ? scan_wide(f->sensors, byte, count) : scan_narrow(f->sensors, byte, count);
}

gv_cyberglove_end gv_cyberglove_end_of(const gv_cyberglove_format *format, const uint8_t *byte, int length) {
  if (format->wide || length == format->sensors + 2)
    return GV_CYBERGLOVE_PLAIN;
  return byte[length - ERROR] == 'g' ? GV_CYBERGLOVE_UNPLUGGED : GV_CYBERGLOVE_TOO_FAST;
}

static void fill_distal(const gv_calibration *cal, uint16_t raw[GV_SENSORS]) {
  for (int i = 0; i < GV_SENSORS; i++) {
    const int from = filled_from(i);
    if (from < 0)
      continue;
    const double angle_rad = dij_per_pij * gv_calibration_angle(cal, from, raw[from]);
    raw[i] = (uint16_t)gv_clamp(floor(gv_calibration_raw(cal, i, angle_rad) + 0.5), 0.0, COUNT_MAX);
  }
}

void gv_cyberglove_decode(const gv_cyberglove_format *format, const uint8_t *byte, int length,
                          const gv_calibration *cal, uint16_t out_raw[GV_SENSORS]) {
  const uint8_t *p = format->wide ? byte + length - 2 * format->sensors : byte + 1;
  for (int i = 0; i < GV_SENSORS; i++) {
    if (!has_sensor(format, i))
      continue;
    out_raw[i] = (uint16_t)(format->wide ? p[0] << 8 | p[1] : (p[0] * COUNT_MAX + 127) / 255);
    p += format->wide ? 2 : 1;
  }
  if (format->sensors < GV_SENSORS)
    fill_distal(cal, out_raw);
}

static int put_time(double time_s, uint8_t *out) {
  const int64_t ticks = (int64_t)floor(time_s * 90.0);  // 30 samples a second, each in three
  const int s = (int)(ticks / 90 % 86400);
  char text[40];
  snprintf(text, sizeof text, "%02d:%02d:%02d:%02d:%dS", s / 3600, s / 60 % 60, s % 60,
           (int)(ticks % 90 / 3) + 1, (int)(ticks % 3));
  memcpy(out, text, TIME);
  return TIME;
}

int gv_cyberglove_encode(const gv_cyberglove_format *format, const uint16_t raw[GV_SENSORS], char echo,
                         double time_s, uint8_t out[GV_CYBERGLOVE_MAX_BYTES]) {
  int n = 0;
  if (format->wide) {
    memcpy(out, mark, MARK);
    n = MARK + put_time(time_s, out + MARK);
  } else {
    out[n++] = (uint8_t)echo;
  }
  for (int i = 0; i < GV_SENSORS; i++) {
    if (!has_sensor(format, i))
      continue;
    const int wide = raw[i] < 1 ? 1 : raw[i] > WIDE_MAX ? WIDE_MAX : raw[i];
    const int narrow = (raw[i] * 255 + COUNT_MAX / 2) / COUNT_MAX;
    if (format->wide)
      out[n++] = (uint8_t)(wide >> 8);
    out[n++] = (uint8_t)(format->wide ? wide & 255 : narrow < 1 ? 1 : narrow > 255 ? 255 : narrow);
  }
  if (!format->wide)
    out[n++] = 0;
  return n;
}

// ---- replies --------------------------------------------------------------------------------------

bool gv_cyberglove_find_reply(const uint8_t *byte, int count, char query, int values, uint8_t *out) {
  for (int i = 0; i + 2 + values < count; i++) {
    if (byte[i] != '?' || byte[i + 1] != (uint8_t)query || byte[i + 2 + values] != 0)
      continue;
    memcpy(out, byte + i + 2, (size_t)values);
    return true;
  }
  return false;
}
