// SPDX-License-Identifier: BSD-3-Clause
// Codec of one line of a candump -L log: "(1436509052.249713) vcan0 110##1A0B1..." to a frame and back.
// What it accepts is what canplayer accepts, with the ranges checked; what it writes is what candump -L
// writes. Pure text, any thread; formatting a line costs about 1 us.
#include <string.h>

#include "gloved/drivers.h"

enum { IFACE_MAX = 15, SECONDS_MAX_DIGITS = 10, WIRE_BRS = 1, WIRE_ESI = 2 };
#define SECONDS_MAX 9000000000LL  // year 2255: the stamp still fits 63 bits of nanoseconds
#define ID_ERROR 0x20000000u

static int refuse(const char *why, char *err, size_t err_size) {
  size_t n = strlen(why) < err_size ? strlen(why) : err_size - 1;
  if (err_size) {
    memcpy(err, why, n);
    err[n] = 0;
  }
  return -1;
}

static bool is_space(char c) { return c == ' ' || c == '\t' || c == '\r'; }
static int hex_digit(char c) {
  if (c >= '0' && c <= '9')
    return c - '0';
  if (c >= 'A' && c <= 'F')
    return c - 'A' + 10;
  if (c >= 'a' && c <= 'f')
    return c - 'a' + 10;
  return -1;
}
static const char *skip_space(const char *p) {
  while (is_space(*p))
    p++;
  return p;
}

// "(seconds.fraction)", 1 to 9 digits of fraction. Returns what follows, null where it is no stamp.
static const char *read_stamp(const char *p, int64_t *out_ns) {
  int64_t seconds = 0;
  int64_t ns = 0;
  int64_t unit = 1000000000;
  int digits = 0;
  if (*p++ != '(')
    return NULL;
  for (; *p >= '0' && *p <= '9'; p++, digits++) {
    if (digits == SECONDS_MAX_DIGITS)
      return NULL;
    seconds = 10 * seconds + (*p - '0');
  }
  if (digits == 0 || seconds > SECONDS_MAX || *p++ != '.')
    return NULL;
  for (; *p >= '0' && *p <= '9' && unit > 1; p++) {
    unit /= 10;
    ns += unit * (*p - '0');
  }
  if (unit == 1000000000 || *p++ != ')' || !is_space(*p))
    return NULL;
  *out_ns = seconds * 1000000000 + ns;
  return p;
}

// Three digits: 11 bits; eight: 29 bits, or an error frame where bit 29 is set.
static const char *read_id(const char *p, gv_frame *out) {
  int digits = 0;
  uint32_t id = 0;
  for (; digits < 8 && hex_digit(p[digits]) >= 0; digits++)
    id = id << 4 | (uint32_t)hex_digit(p[digits]);
  if (p[digits] != '#' || (digits != 3 && digits != 8))
    return NULL;
  if (digits == 3) {
    if (id > 0x7ff)
      return NULL;
  } else if (id & ID_ERROR) {
    out->flags |= GV_FRAME_ERROR;
    id &= ~ID_ERROR;
  } else {
    out->flags |= GV_FRAME_EXTENDED;
  }
  out->id = id;
  return id > 0x1fffffff ? NULL : p + digits + 1;
}

// Pairs of hexadecimal digits, dots between them allowed. Null where half a byte or
// more than max bytes stand there.
static const char *read_data(const char *p, int max, gv_frame *out) {
  while (hex_digit(*p) >= 0 || (*p == '.' && hex_digit(p[1]) >= 0)) {
    if (*p == '.')
      p++;
    if (hex_digit(p[1]) < 0 || out->len == max)
      return NULL;
    out->data[out->len++] = (uint8_t)(hex_digit(p[0]) << 4 | hex_digit(p[1]));
    p += 2;
  }
  return p;
}

// What follows the identifier's first '#'. Null with the reason in *why.
static const char *read_payload(const char *p, gv_frame *out, const char **why) {
  if (*p == '#') {  // CAN FD: "##" and one digit of flags
    int wire_flags = hex_digit(p[1]);
    *why = "after ## a digit of flags must follow";
    if (wire_flags < 0)
      return NULL;
    out->flags |= GV_FRAME_FD;
    if (wire_flags & WIRE_BRS)
      out->flags |= GV_FRAME_BRS;
    if (wire_flags & WIRE_ESI)
      out->flags |= GV_FRAME_ESI;
    *why = "the data must be at most 64 bytes of two hexadecimal digits";
    p = read_data(p + 2, 64, out);
    if (p && gv_frame_fd_length(out->len) == out->len)
      return p;
    if (p)
      *why = "CAN FD has frames of 0 to 8, 12, 16, 20, 24, 32, 48 or 64 bytes only";
    return NULL;
  }
  if (*p == 'R' || *p == 'r') {
    out->flags |= GV_FRAME_REMOTE;
    if (*++p >= '0' && *p <= '8')
      out->len = (uint8_t)(*p++ - '0');
  } else {
    *why = "the data must be at most 8 bytes of two hexadecimal digits (CAN FD is written with ##)";
    if (!(p = read_data(p, 8, out)))
      return NULL;
  }
  if (*p == '_' && hex_digit(p[1]) > 8)
    p += 2;  // a raw length code of 9 to 15 on a frame of 8 bytes
  return p;
}

int gv_log_parse(const char *line, gv_frame *out, char *err, size_t err_size) {
  gv_frame frame = {.id = 0};
  const char *why = NULL;
  const char *p = read_stamp(line, &frame.stamp_ns);
  if (!p)
    return refuse("it must open with a stamp like (1436509052.249713)", err, err_size);
  const char *iface = p = skip_space(p);
  while (*p && !is_space(*p))
    p++;
  if (p == iface || p - iface > IFACE_MAX || !*p)
    return refuse("after the stamp an interface name (1 to 15 characters) must follow", err, err_size);
  p = read_id(skip_space(p), &frame);
  if (!p)
    return refuse("the identifier must be 3 or 8 hexadecimal digits before #, at most 7FF or 1FFFFFFF", err,
                  err_size);
  p = read_payload(p, &frame, &why);
  if (!p)
    return refuse(why, err, err_size);
  if (*p && !is_space(*p))
    return refuse("characters after the data that are none of it", err, err_size);
  *out = frame;
  return 0;
}

static char *put_decimal(char *p, uint64_t v, int digits) {
  for (int i = digits; i-- > 0; v /= 10)
    p[i] = (char)('0' + v % 10);
  return p + digits;
}
static char *put_hex(char *p, uint32_t v, int digits) {
  for (int i = digits; i-- > 0; v >>= 4)
    p[i] = "0123456789ABCDEF"[v & 15];
  return p + digits;
}

int gv_log_format(const gv_frame *frame, const char *iface, char out[GV_LOG_LINE_MAX + 1]) {
  uint64_t us = frame->stamp_ns > 0 ? (uint64_t)frame->stamp_ns / 1000 : 0;
  uint8_t f = frame->flags;
  uint8_t len = frame->len > 64 ? 64 : frame->len;
  size_t name = strnlen(iface, IFACE_MAX);
  char *p = out;
  *p++ = '(';
  p = put_decimal(p, us / 1000000, SECONDS_MAX_DIGITS);
  *p++ = '.';
  p = put_decimal(p, us % 1000000, 6);
  *p++ = ')';
  *p++ = ' ';
  memcpy(p, iface, name);
  p += name;
  *p++ = ' ';
  if (f & (GV_FRAME_ERROR | GV_FRAME_EXTENDED))
    p = put_hex(p, frame->id | (f & GV_FRAME_ERROR ? ID_ERROR : 0), 8);
  else
    p = put_hex(p, frame->id, 3);
  *p++ = '#';
  if (f & GV_FRAME_REMOTE) {
    *p++ = 'R';
    if (len > 0 && len <= 8)
      *p++ = (char)('0' + len);
  } else {
    if (f & GV_FRAME_FD) {
      *p++ = '#';
      *p++ = (char)('0' + (f & GV_FRAME_BRS ? WIRE_BRS : 0) + (f & GV_FRAME_ESI ? WIRE_ESI : 0));
    }
    for (int i = 0; i < len; i++)
      p = put_hex(p, frame->data[i], 2);
  }
  *p++ = '\n';
  *p = 0;
  return (int)(p - out);
}
