// SPDX-License-Identifier: BSD-3-Clause
// Codecs of the serial devices against bytes written by hand from the manuals, and against everything that
// happens to bytes on a wire: records that break off anywhere, garbage between them, lost and changed bytes.
#include <string.h>

#include "wire/cyberglove.h"
#include "wire/fastrak.h"
#include "wire/framer.h"
#include "support/check.h"

static unsigned long long seed = 20260101;
static uint8_t random_byte(void) { return (uint8_t)check_uniform(&seed, 0, 256); }

// ---- FASTRAK --------------------------------------------------------------------------------------

// Station 2, no error: 12.5 -30 100 cm, quaternion 0.5 0.5 -0.5 0.5 (IEEE 754 by hand).
static const uint8_t golden[32] = {'0',  '2',  ' ',  0x00, 0x00, 0x48, 0x41, 0x00, 0x00, 0xf0, 0xc1,
                                   0x00, 0x00, 0xc8, 0x42, 0x00, 0x00, 0x00, 0x3f, 0x00, 0x00, 0x00,
                                   0x3f, 0x00, 0x00, 0x00, 0xbf, 0x00, 0x00, 0x00, 0x3f, ' '};
static const char golden_text[] = "02   12.50 -30.00 100.00 0.5000 0.5000-0.5000 0.5000\r\n";
static const gv_fastrak_format binary = GV_FASTRAK_BINARY, ascii = GV_FASTRAK_ASCII;

static void check_golden(const gv_fastrak_record *r) {
  const gv_pose T = r->T_tracker_receiver;
  CHECK(r->station == 2 && r->error == ' ', "station %d, error %c", r->station, r->error);
  CHECK_NEAR(T.p.x, 0.125, 1e-12);
  CHECK_NEAR(T.p.y, -0.3, 1e-12);
  CHECK_NEAR(T.p.z, 1.0, 1e-12);
  CHECK_NEAR(T.q.w, 0.5, 1e-12);
  CHECK_NEAR(T.q.x, 0.5, 1e-12);
  CHECK_NEAR(T.q.y, -0.5, 1e-12);
  CHECK_NEAR(T.q.z, 0.5, 1e-12);
}

static framer f;
static gv_fastrak_record last;

// Push the bytes; returns how many records came out, the last one in `last`.
static int push(gv_fastrak_format format, const void *bytes, size_t count) {
  const uint8_t *p = bytes;
  int records = 0;
  for (size_t i = 0; i < count; i++) {
    if (gv_framer_push(&f, p[i], gv_fastrak_scan, &format) <= 0)
      continue;
    gv_fastrak_decode(format, f.byte, &last);
    records++;
  }
  return records;
}

static void reset(void) {
  memset(&f, 0, sizeof f);
  memset(&last, 0, sizeof last);
}

static void test_fastrak_golden(void) {
  uint8_t out[GV_FASTRAK_ASCII_BYTES];
  reset();
  CHECK(push(binary, golden, 32) == 1, "no record");
  check_golden(&last);
  CHECK(gv_fastrak_encode(binary, &last, out) == 32 && memcmp(out, golden, 32) == 0, "binary bytes differ");
  reset();
  CHECK(sizeof golden_text - 1 == GV_FASTRAK_ASCII_BYTES, "%d", (int)sizeof golden_text);
  CHECK(push(ascii, golden_text, 54) == 1, "no record");
  check_golden(&last);
  CHECK(gv_fastrak_encode(ascii, &last, out) == 54 && memcmp(out, golden_text, 54) == 0,
        "text differs: %.54s", (const char *)out);
  CHECK(f.bad_bytes == 0 && f.records == 1, "%d bad", (int)f.bad_bytes);
}

// A record that breaks off after n bytes costs itself alone: the one behind it comes out whole.
static void broken_off(gv_fastrak_format format, const void *record, int length) {
  for (int n = 0; n < length; n++) {
    reset();
    int records = push(format, record, (size_t)n) + push(format, record, (size_t)length);
    CHECK(records == 1 && (int)f.bad_bytes == n && f.count == length, "cut at %d: %d records, %d bad bytes",
          n, records, (int)f.bad_bytes);
    check_golden(&last);
    CHECK(f.bad_runs == (n > 0), "cut at %d: %d runs", n, (int)f.bad_runs);
  }
}
static void test_fastrak_truncated_anywhere(void) {
  broken_off(binary, golden, 32);
  broken_off(ascii, golden_text, 54);
}

// The worst place: the next record's header stands where the end was, and z of the quaternion is small.
static void test_fastrak_truncated_with_small_z(void) {
  const gv_fastrak_record flat = {1, ' ', true, {{1, 0, 0, 0}, {0.2, 0.1, 0.05}}};
  uint8_t bytes[32];
  gv_fastrak_encode(binary, &flat, bytes);
  for (int n = 0; n < 32; n++) {
    reset();
    int records = push(binary, bytes, (size_t)n) + push(binary, bytes, 32);
    CHECK(records == 1 && (int)f.bad_bytes == n, "cut at %d: %d records, %d bad bytes", n, records,
          (int)f.bad_bytes);
    CHECK_NEAR(gv_norm(gv_sub(last.T_tracker_receiver.p, flat.T_tracker_receiver.p)), 0, 1e-7);
  }
}

// Garbage of any length and content in front of a record: that record, and none else, comes out.
static void garbage_between(gv_fastrak_format format, const void *record, int length) {
  int records = 0;
  int garbage = 0;
  reset();
  for (int k = 0; k < 2000; k++) {
    int count = (int)check_uniform(&seed, 0, 80);
    for (int i = 0; i < count; i++) {
      uint8_t byte = random_byte();
      records += push(format, &byte, 1);
    }
    garbage += count;
    records += push(format, record, (size_t)length);
    check_golden(&last);
  }
  CHECK(records == 2000 && (int)f.bad_bytes == garbage, "%d records, %d bad of %d bytes", records,
        (int)f.bad_bytes, garbage);
}
static void test_fastrak_garbage_between(void) {
  garbage_between(binary, golden, 32);
  garbage_between(ascii, golden_text, 54);
}

// In the middle of a stream: the first whole record comes out, whatever the record before looked like inside.
static void test_fastrak_starts_anywhere(void) {
  uint8_t tricky[32];
  memcpy(tricky, golden, 32);
  memcpy(tricky + 7, "01 ", 3);  // a header inside y
  tricky[10] = 0x41;
  for (int n = 1; n < 32; n++) {
    reset();
    push(binary, tricky + n, (size_t)(32 - n));
    CHECK(push(binary, golden, 32) == 1, "started at byte %d", n);
    check_golden(&last);
  }
}

static void test_fastrak_error_letters(void) {
  uint8_t bytes[32];
  for (int c = 0; c < 256; c++) {
    memcpy(bytes, golden, 32);
    bytes[2] = (uint8_t)c;
    reset();
    const bool allowed = c == ' ' || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
    CHECK(push(binary, bytes, 32) == allowed, "error byte %d", c);
    if (allowed)
      CHECK(last.error == c && last.station == 2, "error %c", last.error);
  }
  // A receiver that is unplugged: a letter, and numbers that mean nothing.
  memset(bytes + 3, 0xff, 28);
  bytes[2] = 'k';
  reset();
  CHECK(push(binary, bytes, 32) == 1 && last.error == 'k', "not a record");
  CHECK(last.T_tracker_receiver.q.w == 1 && last.T_tracker_receiver.p.x == 0, "its numbers got through");
  CHECK(strstr(gv_fastrak_error_text('k'), "too low"), "%s", gv_fastrak_error_text('k'));
  CHECK(strstr(gv_fastrak_error_text('Q'), "failed"), "%s", gv_fastrak_error_text('Q'));
}

static void test_fastrak_unsound_numbers(void) {
  static const struct {
    int at;
    uint8_t value[4];
    const char *what;
  } change[] = {{3, {0, 0, 0xc0, 0x7f}, "x is not a number"},
                {7, {0, 0, 0x80, 0x7f}, "y is infinite"},
                {11, {0, 0, 0x7a, 0x45}, "z is 40 m"},
                {15, {0, 0, 0, 0}, "w of the quaternion is 0"},
                {27, {0, 0, 0x80, 0x3f}, "z of the quaternion is 1"},
                {19, {0, 0, 0xc0, 0xff}, "x of the quaternion is not a number"}};
  uint8_t bytes[32];
  for (size_t i = 0; i < sizeof change / sizeof *change; i++) {
    memcpy(bytes, golden, 32);
    memcpy(bytes + change[i].at, change[i].value, 4);
    reset();
    CHECK(push(binary, bytes, 32) == 0, "accepted: %s", change[i].what);
    CHECK(push(binary, golden, 32) == 1 && f.bad_bytes == 32, "%s: the next record was lost", change[i].what);
  }
  static const char *const text[] = {"02   12.50 -30.00 10..00 0.5000 0.5000-0.5000 0.5000\r\n",
                                     "02   12.50 -30.00        0.5000 0.5000-0.5000 0.5000\r\n",
                                     "02   12.50 -30.00 100.00 0.5000 0.5000-0.5000 0.9000\r\n",
                                     "02   12.50 -30.00 100.00 0.5000 0.5000-0.5000 0.5000\n\n",
                                     "05   12.50 -30.00 100.00 0.5000 0.5000-0.5000 0.5000\r\n",
                                     "02   12 50 -30.00 100.00 0.5000 0.5000-0.5000 0.5000\r\n",
                                     "02   12.50 -30.00 1e0.00 0.5000 0.5000-0.5000 0.5000\r\n",
                                     "02   12500 -30.00 100.00 0.5000 0.5000-0.5000 0.5000\r\n"};
  for (size_t i = 0; i < sizeof text / sizeof *text; i++) {
    reset();
    CHECK(push(ascii, text[i], strlen(text[i])) == 0, "accepted: %s", text[i]);
    CHECK(push(ascii, golden_text, 54) == 1, "the record after was lost: %s", text[i]);
  }
}

// Random poses through the bytes: binary to float32, ASCII to 0.1 mm and 1e-4.
static void test_fastrak_round_trip(void) {
  for (int k = 0; k < 2000; k++) {
    gv_vec3 axis = gv_normalize_or(
        gv_v3(check_uniform(&seed, -1, 1), check_uniform(&seed, -1, 1), check_uniform(&seed, -1, 1)),
        gv_v3(1, 0, 0));
    gv_fastrak_record in = {
      1 + k % 4,
      ' ',
      true,
      {gv_quat_axis_angle(axis, check_uniform(&seed, -3, 3)),
       gv_v3(check_uniform(&seed, -3, 3), check_uniform(&seed, -3, 3), check_uniform(&seed, -3, 3))}};
    for (int format = 0; format < 2; format++) {
      uint8_t bytes[GV_FASTRAK_ASCII_BYTES];
      int n = gv_fastrak_encode((gv_fastrak_format)format, &in, bytes);
      reset();
      CHECK(push((gv_fastrak_format)format, bytes, (size_t)n) == 1 && last.station == in.station,
            "no record");
      double p = gv_norm(gv_sub(last.T_tracker_receiver.p, in.T_tracker_receiver.p));
      double r = gv_norm(
          gv_quat_log(gv_quat_mul(gv_quat_conj(last.T_tracker_receiver.q), in.T_tracker_receiver.q)));
      CHECK(p < (format ? 1e-4 : 1e-6) && r < (format ? 3e-4 : 1e-6), "format %d: %g m, %g rad", format, p,
            r);
    }
  }
}

static void check_commands(const gv_fastrak_setup *setup, const char *expected) {
  char all[600] = "", one[GV_FASTRAK_COMMAND_MAX];
  for (int i = 0; gv_fastrak_command(setup, i, one) > 0; i++) {
    const size_t n = strlen(all);
    // A station that is off is told so with each of its commands.
    if (n >= strlen(one) && strcmp(all + n - strlen(one), one) == 0)
      continue;
    strcat(all, one);
  }
  CHECK(strcmp(all, expected) == 0, "%s", all);
}

static void test_fastrak_commands(void) {
  const gv_fastrak_setup both = {GV_FASTRAK_BINARY, 1, 2, {1, 0, 0}, 0};
  check_commands(&both, "ufl1,1\rH1,1,0,0\rO1,2,11,0\rI1,0\rR1\rb1\rl2,1\rH2,1,0,0\rO2,2,11,0\rI2,"
                        "0\rR2\rb2\rl3,0\rl4,0\rv,1\rx,1\r");
  const gv_fastrak_setup one = {GV_FASTRAK_ASCII, 0, 4, {0, 0, -1}, 0};
  check_commands(&one, "uFl1,0\rl2,0\rl3,0\rl4,1\rH4,0,0,-1\rO4,2,11,1\rI4,0\rR4\rb4\rv,1\rx,1\r");
}

// Status as the manual's pages 68 and 69 have it: "2aSfffbbb_F3c___j.k.lmxxxx...", its
// table of 16 flags, 54 and 55 CR LF.
static void test_fastrak_status(void) {
  for (int flags = 0; flags < 16; flags++) {
    char text[100];
    gv_fastrak_status status;
    snprintf(text, sizeof text, "garbage\r\n2%dS3F%X    F33  1.2.34%-32s\r\n", 1 + flags % 4, (unsigned)flags,
             "FASTRAK");
    const int n = (int)strlen(text);
    CHECK(n == 9 + 55, "%d bytes", n);
    CHECK(gv_fastrak_find_status((const uint8_t *)text, n, &status), "not found in %s", text);
    CHECK(status.binary == (flags & 1) && status.centimetres == (flags >> 1 & 1) &&
              status.continuous == flags >> 3,
          "flags %X", (unsigned)flags);
    CHECK(status.error == ' ', "error %c", status.error);
    CHECK(!gv_fastrak_find_status((const uint8_t *)text, 12, &status), "half a status");
  }
  gv_fastrak_status status;
  CHECK(gv_fastrak_find_status((const uint8_t *)"22S3F3107 F3", 12, &status) && status.error == 'k',
        "test 107 is k (page 71): %c", status.error);
  bool on[GV_FASTRAK_STATIONS + 1];
  CHECK(gv_fastrak_find_stations((const uint8_t *)"21l1010\r\n", 9, on) && on[1] && !on[2] && on[3] && !on[4],
        "states of the stations");
  static const char refusal[] = "2 E*ERROR*I9,0*ERROR* EC -3*PS 1*FL 0*ST 8\r\n";
  CHECK(gv_fastrak_find_refusal((const uint8_t *)refusal, (int)sizeof refusal - 1), "page 89");
  CHECK(!gv_fastrak_find_refusal((const uint8_t *)"21S3F3", 6), "no refusal");
}

// Which letters take the pose along: by the manual's page 71.
static void test_fastrak_letters_that_concern_the_pose(void) {
  uint8_t bytes[32];
  for (int c = 'A'; c <= 'z'; c++) {
    if (c > 'Z' && c < 'a')
      continue;
    memcpy(bytes, golden, 32);
    bytes[2] = (uint8_t)c;
    reset();
    CHECK(push(binary, bytes, 32) == 1, "error %c", c);
    CHECK(last.usable == (strchr("mtvw", c) != NULL), "error %c", c);
  }
  memset(bytes + 3, 0xff, 28);
  bytes[2] = 'm';
  reset();
  CHECK(push(binary, bytes, 32) == 1 && !last.usable, "numbers that are none");
}

// ---- CyberGlove -----------------------------------------------------------------------------------

static gv_calibration cal;
static uint16_t raw[GV_SENSORS];

static int push_glove(gv_cyberglove_format format, const uint8_t *bytes, int count) {
  int frames = 0;
  for (int i = 0; i < count; i++) {
    int length = gv_framer_push(&f, bytes[i], gv_cyberglove_scan, &format);
    if (length <= 0)
      continue;
    gv_cyberglove_decode(&format, f.byte, length, &cal, raw);
    frames++;
  }
  return frames;
}

// The reading of a real 22-sensor glove, quoted in a public question as "g 1 76 93 ..." without the echo.
static const uint8_t reading[22] = {1,  76, 93, 113, 89, 42, 20, 77, 98,  106, 117,
                                    81, 62, 23, 52,  60, 34, 68, 57, 254, 92,  26};
static const gv_cyberglove_format glove22 = {22, false}, glove18 = {18, false}, wide22 = {22, true},
                                  wide18 = {18, true};

static void test_glove_golden(void) {
  uint8_t bytes[24] = {'S'};
  memcpy(bytes + 1, reading, 22);
  cal = gv_calibration_default();
  reset();
  CHECK(push_glove(glove22, bytes, 24) == 1, "no frame");
  for (int i = 0; i < 22; i++)
    CHECK(fabs(raw[i] - reading[i] * 4095.0 / 255.0) <= 0.5, "sensor %d: %d for %d", i, raw[i], reading[i]);
  bytes[0] = 'G';
  CHECK(push_glove(glove22, bytes, 24) == 1 && f.bad_bytes == 0, "G is no frame");
  CHECK(raw[0] == 16 && raw[19] == 4079, "%d %d", raw[0], raw[19]);
}

// "es" and "eg" in front of the final 0 (ViSTA, VistaCyberGloveDriver: sampled too
// fast; glove not plugged in).
static int glove_with_error(uint8_t out[26], const uint8_t value[22], char error) {
  out[0] = 'S';
  memcpy(out + 1, value, 22);
  if (error)
    memcpy(out + 23, (const char[]){'e', error}, 2);
  out[error ? 25 : 23] = 0;
  return error ? 26 : 24;
}

static void test_glove_errors_at_the_end(void) {
  static const struct {
    char error;
    gv_cyberglove_end end;
  } t[] = {{0, GV_CYBERGLOVE_PLAIN}, {'s', GV_CYBERGLOVE_TOO_FAST}, {'g', GV_CYBERGLOVE_UNPLUGGED}};
  uint8_t bytes[26];
  cal = gv_calibration_default();
  for (int i = 0; i < 3; i++) {
    const int count = glove_with_error(bytes, reading, t[i].error);
    reset();
    CHECK(push_glove(glove22, bytes, count) == 1 && f.bad_bytes == 0, "error %c: no frame", t[i].error);
    CHECK(gv_cyberglove_end_of(&glove22, f.byte, count) == t[i].end, "error %c: end", t[i].error);
    for (int k = 0; k < 22; k++)
      CHECK(fabs(raw[k] - reading[k] * 4095.0 / 255.0) <= 0.5, "sensor %d: %d", k, raw[k]);
  }
}

// A sensor at the value of 'S' or 'G' looks like a beginning. Wherever the stream is first heard, and
// whatever its frames end with, no frame comes out with its sensors shifted.
static void test_glove_sensors_that_read_s_or_g_never_shift(void) {
  static const char ends[] = {0, 's', 'g'};
  cal = gv_calibration_default();
  for (int k = 0; k < 22 * 2 * 3; k++) {
    uint8_t value[22], stream[26 * 4];
    memcpy(value, reading, 22);
    value[k % 22] = k / 22 % 2 ? 'G' : 'S';
    int count = 0;
    int frame = 0;
    for (int i = 0; i < 4; i++)
      count += frame = glove_with_error(stream + count, value, ends[k / 44]);
    for (int from = 0; from < frame; from++) {
      reset();
      int frames = 0;
      for (int i = from; i < count; i++) {
        if (push_glove(glove22, stream + i, 1) == 0)
          continue;
        frames++;
        for (int s = 0; s < 22; s++)
          CHECK(fabs(raw[s] - value[s] * 4095.0 / 255.0) <= 0.5, "end %d, from %d: sensor %d", ends[k / 44],
                from, s);
      }
      CHECK(frames == (from == 0 ? 4 : 3), "%d frames from %d", frames, from);
    }
  }
}

// 18 sensors: each lands on its joint, and each DIJ is two thirds of the angle of its
// PIJ, whatever the calibration.
static void test_glove_18_sensors(void) {
  static const int order[18] = {GV_THUMB_ROTATE,    GV_THUMB_MPJ,   GV_THUMB_IJ,
                                GV_THUMB_ABDUCTION, GV_INDEX_MPJ,   GV_INDEX_PIJ,
                                GV_MIDDLE_MPJ,      GV_MIDDLE_PIJ,  GV_MIDDLE_INDEX_ABDUCTION,
                                GV_RING_MPJ,        GV_RING_PIJ,    GV_RING_MIDDLE_ABDUCTION,
                                GV_LITTLE_MPJ,      GV_LITTLE_PIJ,  GV_LITTLE_RING_ABDUCTION,
                                GV_PALM_ARCH,       GV_WRIST_PITCH, GV_WRIST_YAW};
  static const int filled[4] = {GV_INDEX_DIJ, GV_MIDDLE_DIJ, GV_RING_DIJ, GV_LITTLE_DIJ};
  uint8_t bytes[20] = {'S'};
  for (int i = 0; i < 18; i++)
    bytes[1 + i] = (uint8_t)(70 + 7 * i);
  for (int k = 0; k < 2; k++) {
    cal = gv_calibration_default();
    for (int i = 0; k && i < GV_SENSORS; i++) {
      cal.raw[i][0] = 3500 - 20 * i;
      cal.raw[i][1] = 700 + 30 * i;
    }  // falling
    reset();
    CHECK(push_glove(glove18, bytes, 20) == 1, "no frame");
    for (int i = 0; i < 18; i++)
      CHECK(fabs(raw[order[i]] - bytes[1 + i] * 4095.0 / 255.0) <= 0.5, "byte %d", i);
    for (int i = 0; i < 4; i++) {
      const double pij = gv_calibration_angle(&cal, filled[i] - 1, raw[filled[i] - 1]);
      // half a count
      CHECK_NEAR(gv_calibration_angle(&cal, filled[i], raw[filled[i]]), 2.0 / 3.0 * pij, 0.0004);
    }
  }
}

// The CyberGlove III: mark, time, 22 numbers, the higher byte first.
static int wide_golden(uint8_t out[GV_CYBERGLOVE_MAX_BYTES], const char *time) {
  int n = 3;
  memcpy(out, "\r\n\0", 3);
  memcpy(out + n, time, strlen(time));
  n += (int)strlen(time);
  for (int i = 0; i < 22; i++) {
    out[n++] = (uint8_t)(i == 3 ? 0x0d : i / 2);
    out[n++] = (uint8_t)(i == 3 ? 0x0a : i == 4 ? 0xff : 0x10 + i);
  }
  return n;
}

static void test_glove_wide(void) {
  uint8_t bytes[GV_CYBERGLOVE_MAX_BYTES];
  static const char *const times[] = {"12:59:03:30:2S", "2S12:59:03:30:2S", "e112:59:03:30:2S"};
  for (int k = 0; k < 3; k++) {
    int n = wide_golden(bytes, times[k]);
    CHECK(n == GV_CYBERGLOVE_WIDE_BYTES + 2 * (k > 0), "%d bytes", n);
    reset();
    CHECK(push_glove(wide22, bytes, n) == 1 && f.bad_bytes == 0, "no frame");
    CHECK(raw[0] == 0x0010 && raw[3] == 0x0d0a && raw[4] == 0x02ff && raw[21] == 0x0a25, "%x %x %x %x",
          raw[0], raw[3], raw[4], raw[21]);
    for (int cut = 0; cut < n; cut++) {
      reset();
      int frames = push_glove(wide22, bytes, cut);
      frames += push_glove(wide22, bytes, n);
      CHECK(frames == 1 && (int)f.bad_bytes == cut, "cut at %d: %d frames, %d bad", cut, frames,
            (int)f.bad_bytes);
      CHECK(raw[0] == 0x0010 && raw[21] == 0x0a25, "cut at %d: %x %x", cut, raw[0], raw[21]);
    }
    bytes[n - 8] = 0x0f;  // one sensor at the end of its range
    bytes[n - 7] = 0xff;
    reset();
    CHECK(push_glove(wide22, bytes, n) == 1 && raw[18] == 4095, "%d: a sensor at 4095 drops the frame",
          raw[18]);
    // A last value that looks like the mark: its frame comes out with the first byte of the next.
    bytes[n - 2] = 0x0d;
    bytes[n - 1] = 0x0a;
    reset();
    CHECK(push_glove(wide22, bytes, n) == 0 && push_glove(wide22, bytes, 1) == 1 && raw[21] == 0x0d0a, "%x",
          raw[21]);
    CHECK(push_glove(wide22, bytes + 1, n - 1) == 0 && push_glove(wide22, bytes, n) == 1 && f.bad_bytes == 0,
          "%d bad", (int)f.bad_bytes);
  }
  static const struct {
    int at;
    uint8_t value;
  } wrong[] = {{3, 'x'}, {5, ';'}, {16, 'T'}, {17, 0x10}, {2, 1}};
  for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
    int n = wide_golden(bytes, times[0]);
    bytes[wrong[i].at] = wrong[i].value;
    reset();
    CHECK(push_glove(wide22, bytes, n) == 0, "accepted with byte %d wrong", wrong[i].at);
  }
}

static void test_glove_truncated_anywhere(void) {
  uint8_t bytes[24] = {'S'};
  memcpy(bytes + 1, reading, 22);
  bytes[5] = 'S';  // a value that looks like the start
  bytes[9] = 'G';
  for (int n = 0; n < 24; n++) {
    reset();
    int frames = push_glove(glove22, bytes, n);
    frames += push_glove(glove22, bytes, 24);
    CHECK(frames == 1 && (int)f.bad_bytes == n, "cut at %d: %d frames, %d bad bytes", n, frames,
          (int)f.bad_bytes);
    CHECK(raw[1] == 1220, "cut at %d: wrong frame", n);
  }
}

// A lost or an added byte never shifts the values of one sensor to another: the frame is dropped as a whole.
static void test_glove_lost_and_added_bytes(void) {
  uint8_t bytes[24] = {'S'}, changed[25];
  memcpy(bytes + 1, reading, 22);
  for (int at = 1; at < 24; at++) {
    reset();
    memcpy(changed, bytes, (size_t)at);
    memcpy(changed + at, bytes + at + 1, (size_t)(23 - at));
    int frames = push_glove(glove22, changed, 23);
    frames += push_glove(glove22, bytes, 24);
    CHECK(frames == 1, "without byte %d: %d frames", at, frames);
    reset();
    memcpy(changed, bytes, (size_t)at);
    changed[at] = 200;
    memcpy(changed + at + 1, bytes + at, (size_t)(24 - at));
    frames = push_glove(glove22, changed, 25);
    frames += push_glove(glove22, bytes, 24);
    CHECK(frames == 1 && raw[1] == 1220, "with a byte more at %d: %d frames", at, frames);
  }
}

// Garbage of any length and content in front of a frame never costs that frame. (Garbage can look like a
// frame itself: there is no checksum; about 1 in 30000 bytes of it does.)
static void test_glove_garbage_between(void) {
  uint8_t bytes[24] = {'S'};
  memcpy(bytes + 1, reading, 22);
  int frames = 0;
  int found = 0;
  reset();
  for (int k = 0; k < 2000; k++) {
    for (int i = (int)check_uniform(&seed, 0, 80); i > 0; i--) {
      uint8_t byte = random_byte();
      found += push_glove(glove22, &byte, 1);
    }
    frames += push_glove(glove22, bytes, 24);
    CHECK(raw[1] == 1220 && raw[19] == 4079, "another frame came out");
  }
  CHECK(frames == 2000 && found < 20, "%d frames, %d in the garbage", frames, found);
}

static void test_glove_round_trip(void) {
  const gv_cyberglove_format *formats[] = {&glove22, &glove18, &wide22, &wide18};
  cal = gv_calibration_default();
  for (int k = 0; k < 2000; k++) {
    const gv_cyberglove_format *format = formats[k % 4];
    uint16_t in[GV_SENSORS];
    uint8_t bytes[GV_CYBERGLOVE_MAX_BYTES];
    for (int i = 0; i < GV_SENSORS; i++)
      in[i] = (uint16_t)check_uniform(&seed, 0, 4096);
    int n = gv_cyberglove_encode(format, in, 'S', 0.011 * k, bytes);
    reset();
    const uint8_t next[] = {'\r'};  // of the next mark: some last values wait for it
    int frames = push_glove(*format, bytes, n);
    if (format->wide)
      frames += push_glove(*format, next, 1);
    CHECK(frames == 1 && f.bad_bytes == 0, "no frame (%d sensors, wide %d)", format->sensors, format->wide);
    for (int i = 0; i < GV_SENSORS; i++) {
      const bool distal = i == GV_INDEX_DIJ || i == GV_MIDDLE_DIJ || i == GV_RING_DIJ || i == GV_LITTLE_DIJ;
      if (format->sensors == 22 || !distal)
        CHECK(abs(raw[i] - in[i]) <= (format->wide ? 1 : 16), "sensor %d: %d for %d", i, raw[i], in[i]);
    }
  }
}

static void test_glove_replies(void) {
  uint8_t out[44];
  static const uint8_t count[] = {'S', 9, 8, 0, '?', 'S', '?', 'S', 22, 0, 'S'};
  CHECK(gv_cyberglove_find_reply(count, sizeof count, 'S', 1, out) && out[0] == 22, "no count");
  for (int n = 0; n < 10; n++)
    CHECK(!gv_cyberglove_find_reply(count, n, 'S', 1, out), "found in %d bytes", n);
  uint8_t gains[2 + 36 + 1] = {'?', 'C'};
  for (int i = 0; i < 36; i++)
    gains[2 + i] = (uint8_t)i;
  CHECK(gv_cyberglove_find_reply(gains, sizeof gains, 'C', 36, out) && out[0] == 0 && out[35] == 35,
        "no gains");
  CHECK(!gv_cyberglove_find_reply(gains, sizeof gains, 'C', 44, out), "more than there is");
}

int main(void) {
  RUN(test_fastrak_golden);
  RUN(test_fastrak_truncated_anywhere);
  RUN(test_fastrak_truncated_with_small_z);
  RUN(test_fastrak_garbage_between);
  RUN(test_fastrak_starts_anywhere);
  RUN(test_fastrak_error_letters);
  RUN(test_fastrak_unsound_numbers);
  RUN(test_fastrak_round_trip);
  RUN(test_fastrak_commands);
  RUN(test_fastrak_status);
  RUN(test_fastrak_letters_that_concern_the_pose);
  RUN(test_glove_golden);
  RUN(test_glove_errors_at_the_end);
  RUN(test_glove_sensors_that_read_s_or_g_never_shift);
  RUN(test_glove_18_sensors);
  RUN(test_glove_wide);
  RUN(test_glove_truncated_anywhere);
  RUN(test_glove_lost_and_added_bytes);
  RUN(test_glove_garbage_between);
  RUN(test_glove_round_trip);
  RUN(test_glove_replies);
  return check_done();
}
