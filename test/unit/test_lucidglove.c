// SPDX-License-Identifier: BSD-3-Clause
// Force channels, and the LucidGlove's codec: lines written by hand after its firmware's format, and
// all that happens to lines on a wire.
#include <string.h>

#include "wire/framer.h"
#include "wire/line_out.h"
#include "wire/lucidglove.h"
#include "support/check.h"
#include "gloved/channel.h"
#include "gloved/fcu.h"

static unsigned long long seed = 20260102;
static const gv_lucid_format wide = {4095}, narrow = {1023};
static const char golden[] = "A0B4095C2048D100E7F2047G2047P4093JM\n";
static framer f;
static gv_lucid_sample last;

// Push the bytes; returns how many lines came out, the last one in `last`.
static int push(const gv_lucid_format *format, const char *bytes, size_t count) {
  int lines = 0;
  for (size_t i = 0; i < count; i++) {
    const int length = gv_framer_push(&f, (uint8_t)bytes[i], gv_lucid_scan, format);
    if (length <= 0)
      continue;
    gv_lucid_decode(format, f.byte, length, &last);
    lines++;
  }
  return lines;
}

static int push_anew(const gv_lucid_format *format, const char *line) {
  memset(&f, 0, sizeof f);
  memset(&last, 0, sizeof last);
  return push(format, line, strlen(line));
}

static void check_golden(const char *when) {
  CHECK(last.bend[0] == 0 && last.bend[1] == 4095 && last.bend[2] == 2048 && last.bend[3] == 100 &&
            last.bend[4] == 7,
        "%s: %d %d %d %d %d", when, last.bend[0], last.bend[1], last.bend[2], last.bend[3], last.bend[4]);
}

// ---- lines from the glove -------------------------------------------------------------------------

static void test_golden_line(void) {
  CHECK(push_anew(&wide, golden) == 1 && f.bad_bytes == 0, "no line");
  check_golden("golden");
  CHECK(last.letters & gv_lucid_bit('J') && last.letters & gv_lucid_bit('M') &&
            !(last.letters & gv_lucid_bit('K')),
        "letters %x", last.letters);
  CHECK(push_anew(&narrow, "A1023B0C512D3E4F511G511P0\n") == 1 && last.bend[0] == 1023 && last.bend[2] == 512,
        "an AVR board's line");
  CHECK(push_anew(&wide, "A1B2C3D4E5F6G7P8HIJKLMNO(AB)4095(BB)0(CB)2047(DB)1(EB)9\n") == 1 &&
            last.bend[4] == 5,
        "a line with splay");
}

// What the counts mean: 2048 to a right angle, 1024 straight (gv_calibration_default).
static void test_bends_become_joints(void) {
  const gv_calibration cal = gv_calibration_default();
  uint16_t raw[GV_SENSORS];
  push_anew(&wide, golden);
  gv_lucid_raw(&wide, &last, &cal, raw);
  CHECK(raw[GV_INDEX_MPJ] == 3072 && raw[GV_INDEX_PIJ] == 3300 && raw[GV_INDEX_DIJ] == 2549, "index %d %d %d",
        raw[GV_INDEX_MPJ], raw[GV_INDEX_PIJ], raw[GV_INDEX_DIJ]);
  CHECK(raw[GV_MIDDLE_MPJ] == 2048 && raw[GV_THUMB_MPJ] == 1024 && raw[GV_THUMB_ABDUCTION] == 2048,
        "middle %d thumb %d %d", raw[GV_MIDDLE_MPJ], raw[GV_THUMB_MPJ], raw[GV_THUMB_ABDUCTION]);
  CHECK(raw[GV_PALM_ARCH] == 1024 && raw[GV_INDEX_MPJ - 1] == 2048 && raw[GV_WRIST_YAW] == 1024,
        "the rest is straight");
}

// A SenseShift glove with a curl for each knuckle, and opengloves' keys (written after
// their tables, not by our encoder).
static void test_keys_of_single_joints(void) {
  static const char knuckles[] = "A2000(AB)2047(AAA)1000(AAB)3000B100(BB)2047(BAA)4095(BAB)0(BAC)2048C5(CB)"
                                 "2047(CAA)5(CAB)5(CAC)5D6(DB)2047E7(EB)2047F2047G2047JO\r\n";
  static const char joints_alone[] =
      "(AAA)10(AAB)20(AAC)4000(AAD)0(BAA)0(BAB)100(BAC)200(BAD)0C1D2E3(ZV)1(ZG)0(ZH)1\n";
  const gv_calibration cal = gv_calibration_default();
  uint16_t raw[GV_SENSORS];
  CHECK(push_anew(&wide, knuckles) == 1 && f.bad_bytes == 0 && last.letters & gv_lucid_bit('J'), "no line");
  CHECK(last.bend[0] == 2000 && last.joint[0][0] == 1000 && last.joint[0][1] == 3000 &&
            last.joint[1][0] == 4095,
        "joints");
  gv_lucid_raw(&wide, &last, &cal, raw);
  // 1024 counts are straight, 1024 more a right angle (gv_calibration_default).
  CHECK(raw[GV_INDEX_MPJ] == 2048 + 1024 && raw[GV_INDEX_PIJ] == 1024, "index %d %d", raw[GV_INDEX_MPJ],
        raw[GV_INDEX_PIJ]);
  CHECK_NEAR(gv_calibration_angle(&cal, GV_INDEX_DIJ, raw[GV_INDEX_DIJ]) * 180 / GV_PI, 33.5, 0.1);
  CHECK_NEAR(gv_calibration_angle(&cal, GV_THUMB_MPJ, raw[GV_THUMB_MPJ]) * 180 / GV_PI, 60.0 * 1000 / 4095,
             0.1);
  CHECK_NEAR(gv_calibration_angle(&cal, GV_THUMB_IJ, raw[GV_THUMB_IJ]) * 180 / GV_PI, 80.0 * 3000 / 4095,
             0.1);
  CHECK_NEAR(gv_calibration_angle(&cal, GV_RING_MPJ, raw[GV_RING_MPJ]) * 180 / GV_PI, 90.0 * 6 / 4095, 0.1);
  CHECK(push_anew(&wide, joints_alone) == 1 && f.bad_bytes == 0, "no line of joints alone");
  CHECK(last.bend[0] == 15 && last.bend[1] == 100 && last.bend[4] == 3, "means: %d %d %d", last.bend[0],
        last.bend[1], last.bend[4]);
}

// Whatever the calibration, bends come back from the angles that the engine reads.
static void test_bends_round_trip(void) {
  for (int k = 0; k < 500; k++) {
    gv_calibration cal = gv_calibration_default();
    for (int i = 0; k % 2 && i < GV_SENSORS; i++) {
      cal.raw[i][0] = 3500 - 20 * i;
      cal.raw[i][1] = 700 + 30 * i;
    }  // falling
    gv_lucid_sample in = {.letters = gv_lucid_bit('K')};
    uint8_t line[GV_LUCID_LINE_BYTES];
    uint16_t raw[GV_SENSORS];
    double angle_rad[GV_SENSORS];
    int bend[GV_FINGERS];
    for (int i = 0; i < GV_FINGERS; i++)
      in.bend[i] = (int)check_uniform(&seed, 0, 4096);
    const int n = gv_lucid_encode(&wide, &in, line);
    memset(&f, 0, sizeof f);
    CHECK(push(&wide, (const char *)line, (size_t)n) == 1 && last.letters & gv_lucid_bit('K'),
          "no line: %.*s", n, (const char *)line);
    gv_lucid_raw(&wide, &last, &cal, raw);
    for (int i = 0; i < GV_SENSORS; i++)
      angle_rad[i] = gv_calibration_angle(&cal, i, raw[i]);
    gv_lucid_bend(&wide, angle_rad, bend);
    for (int i = 0; i < GV_FINGERS; i++)
      CHECK(last.bend[i] == in.bend[i] && abs(bend[i] - in.bend[i]) <= 3, "%d, %d for %d", last.bend[i],
            bend[i], in.bend[i]);
  }
}

// A line that breaks off after n bytes costs itself alone: the one behind it comes out whole.
static void test_truncated_anywhere(void) {
  const size_t length = sizeof golden - 1;
  for (size_t n = 0; n < length; n++) {
    memset(&f, 0, sizeof f);
    const int lines = push(&wide, golden, n) + push(&wide, golden, length);
    CHECK(lines == 1 && f.bad_bytes == n && f.bad_runs == (n > 0), "cut at %d: %d lines, %d bad bytes",
          (int)n, lines, (int)f.bad_bytes);
    check_golden("after a cut");
    memset(&f, 0, sizeof f);
    CHECK(push(&wide, golden + n, length - n) + push(&wide, golden, length) == 1 + (n == 0),
          "started at byte %d", (int)n);
    check_golden("started anywhere");
  }
}

static void test_garbage_between(void) {
  static const char likely[] = "ABCDEFGHIJKLMNOP0123456789()-\r\n";
  size_t garbage = 0;
  int lines = 0;
  memset(&f, 0, sizeof f);
  for (int k = 0; k < 4000; k++) {
    for (int i = (int)check_uniform(&seed, 0, 60); i > 0; i--, garbage++) {
      const char byte = k % 2 ? likely[(int)check_uniform(&seed, 0, sizeof likely - 1)]
                              : (char)check_uniform(&seed, -128, 128);
      lines += push(&wide, &byte, 1);
    }
    lines += push(&wide, golden, sizeof golden - 1);
    check_golden("after garbage");
  }
  CHECK(lines == 4000 && f.bad_bytes == garbage, "%d lines, %d bad of %d bytes", lines, (int)f.bad_bytes,
        (int)garbage);
}

// A lost byte: the line is dropped, or a digit or a button is missing; a value never moves to another finger.
static void test_lost_byte(void) {
  static const int bend[GV_FINGERS] = {0, 4095, 2048, 100, 7};
  for (size_t at = 0; at < sizeof golden - 2; at++) {
    char line[sizeof golden] = "";
    memcpy(line, golden, at);
    strcpy(line + at, golden + at + 1);
    if (push_anew(&wide, line) == 0)
      continue;
    int differ = 0;
    for (int i = 0; i < GV_FINGERS; i++)
      differ += last.bend[i] != bend[i];
    CHECK(golden[at] < 'A' || golden[at] > 'G', "passed without the letter %c", golden[at]);
    CHECK(differ <= 1, "without byte %d %d fingers differ", (int)at, differ);
  }
}

static void test_ranges(void) {
  static const char *const wrong[] = {
    "A4096B0C0D0E0\n", "A0B0C0D0E99999999999\n", "A0B0C0D0\n", "B0C0D0E0\n", "A0B0C0D0E\n", "AB0C0D0E0\n",
    "A-1B0C0D0E0\n", "A00B0C0D0E0\n", "A05B0C0D0E0\n", "A0B0C0D0E0A0\n", "A0B0C0D0E0JJ\n", "a0b0c0d0e0\n",
    "A0 B0 C0 D0 E0\n", "A0B0C0D0E0Q\n", "A0B0C0D0E0J1\n", "A0B0C0D0E0(FB)0\n", "A0B0C0D0E0(AB)\n",
    "A0B0C0D0E0(AB)4096\n", "A0B0C0D0E0(AAE)1\n", "A0B0C0D0E0(AAB)1(AAB)1\n", "A0B0C0D0E0\r",
    "A0B0C0D0E0\r0\n", "A0B0C0D0(AAA)5\n", "(ZV)1(ZG)2(ZH)0\n", "A0B0C0D0E0F4096\n", "\n",
    // 256 bytes: longer than any line
    ("A0B0C0D0E0(AB)1000(BB)1000(CB)1000(DB)1000(EB)1000(AB)1000(BB)1000(CB)1000(DB)1000(EB)1000(AB)1000(BB)"
     "1000(CB)1000(DB)1000"
     "(EB)1000(AB)1000(BB)1000(CB)1000(DB)1000(EB)1000(AB)1000(BB)1000(CB)1000(DB)1000(EB)1000(AB)1000(BB)"
     "1000(CB)1000(DB)1000(EB)1000(AB)1000\n")};
  for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
    CHECK(push_anew(&wide, wrong[i]) == 0, "accepted: %s", wrong[i]);
    CHECK(push(&wide, golden, sizeof golden - 1) == 1, "the line after was lost: %s", wrong[i]);
    check_golden(wrong[i]);
  }
  CHECK(push_anew(&narrow, "A1024B0C0D0E0\n") == 0, "over an AVR board's range");
  CHECK(push_anew(&wide, "A0B0C0D0E0\n") == 1, "the shortest line");
}

// ---- brakes ---------------------------------------------------------------------------------------

static void test_brake_lines(void) {
  char line[GV_LUCID_BRAKES_BYTES];
  int brake[GV_FINGERS] = {0, 1000, 250, 1, 999};
  int n = gv_lucid_encode_brakes(brake, line);
  CHECK(n == 18 && memcmp(line, "A0B1000C250D1E999\n", 18) == 0, "%.*s", n, line);
  n = gv_lucid_encode_brakes((const int[]){5000, 1001, 1000, 1000, 1000}, line);
  CHECK(n == GV_LUCID_BRAKES_BYTES && memcmp(line, "A1000B1000C1000D1000E1000\n", 26) == 0, "%.*s", n, line);
  n = gv_lucid_encode_brakes((const int[]){-5, 0, 0, 0, 0}, line);
  CHECK(n == 11 && memcmp(line, "A0B0C0D0E0\n", 11) == 0, "%.*s", n, line);
  CHECK(gv_lucid_decode_brakes("A0B1000C250D1E999", 17, brake) && brake[1] == 1000 && brake[4] == 999,
        "not read");
  static const char *const wrong[] = {
    "",           "A", "A0B0C0D0", "A0B0C0D0E", "A0B0C0D0E1001", "B0C0D0E0A0", "A0B0C0D0E0F0", "A0B0C0D0E01",
    "A0B-1C0D0E0"};
  for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++)
    CHECK(!gv_lucid_decode_brakes(wrong[i], (int)strlen(wrong[i]), brake), "accepted: %s", wrong[i]);
}

// A line that takes a few bytes at a time, or none: the device reads whole lines, the
// newest at the end, none older after.
static void test_a_full_line_drops_the_older_command(void) {
  line_out out = {.written = 0};
  char seen[1 << 16], text[16];
  int count = 0;
  int dropped = 0;
  int previous = -1;
  for (int k = 0; k < 2000; k++) {
    const char *bytes;
    dropped += gv_line_out_put(&out, text, snprintf(text, sizeof text, "N%d\n", k));
    int room = k == 1999 ? 1000 : (int)check_uniform(&seed, -8, 6);
    for (int n; room > 0 && (n = gv_line_out_bytes(&out, &bytes)) > 0; room -= n) {
      n = n < room ? n : room;
      memcpy(seen + count, bytes, (size_t)n);
      gv_line_out_wrote(&out, n);
      count += n;
    }
  }
  seen[count] = '\0';
  int lines = 0;
  for (char *line = seen; *line; line = strchr(line, '\n') + 1, lines++) {
    char *end;
    const int number = (int)strtol(line + 1, &end, 10);
    CHECK(line[0] == 'N' && *end == '\n' && number > previous, "\"%.8s\" after %d", line, previous);
    previous = number;
  }
  CHECK(previous == 1999 && lines + dropped == 2000 && dropped > 500, "%d lines, %d dropped, the last is %d",
        lines, dropped, previous);
}

// ---- channels -------------------------------------------------------------------------------------

static void test_channels(void) {
  const gv_channel *grasp = gv_channel_of(GV_CHANNEL_CYBERGRASP);
  const gv_channel *lucid = gv_channel_of(GV_CHANNEL_LUCIDGLOVE);
  CHECK(grasp->kind == GV_CHANNEL_TENSION && grasp->max_n == 12 && lucid->kind == GV_CHANNEL_BRAKE &&
            lucid->counts == 1000,
        "table");
  CHECK_NEAR(gv_channel_tension_n(grasp, 1), GV_TENSION_LSB_N, 1e-15);
  CHECK(gv_channel_counts(gv_channel_of(GV_CHANNEL_SENSEGLOVE_R1), 0.8) == 800, "millinewtons");
  CHECK(gv_channel_counts(lucid, 3.0) == 250 && gv_channel_counts(lucid, 12.0) == 1000 &&
            gv_channel_counts(lucid, 0.0119) == 0,
        "brakes");
  CHECK(!gv_channel_of(GV_CHANNELS) && !gv_channel_of((gv_channel_name)-1), "beyond the table");
  for (int name = 0; name < GV_CHANNELS; name++) {
    const gv_channel *c = gv_channel_of((gv_channel_name)name);
    const double one_n = c->max_n / c->counts;
    int before = 0;
    for (int i = 0; i <= 30000; i++) {
      const double tension_n = c->max_n * i / 30000;
      const int counts = gv_channel_counts(c, tension_n);
      const double back_n = gv_channel_tension_n(c, counts);
      CHECK(counts >= before && back_n <= tension_n + 2e-6 * one_n && back_n > tension_n - one_n,
            "%s: %g N is %d, %g N", c->device, tension_n, counts, back_n);
      before = counts;
    }
    CHECK(before == c->counts && gv_channel_counts(c, 1e9) == c->counts, "%s: at most %d", c->device, before);
    CHECK(gv_channel_counts(c, -1) == 0 && gv_channel_counts(c, NAN) == 0 &&
              gv_channel_counts(c, INFINITY) == 0,
          "%s: doubt is 0", c->device);
    CHECK(gv_channel_tension_n(c, -5) == 0 && gv_channel_tension_n(c, 2 * c->counts) == c->max_n,
          "%s: clamped", c->device);
  }
}

static void test_limiter_fits_the_channel(void) {
  const gv_channel *sense = gv_channel_of(GV_CHANNEL_SENSEGLOVE_R1);
  gv_limiter_config cfg = gv_limiter_config_default();
  gv_limiter_config four = cfg;
  CHECK(gv_channel_limit(sense, &four) && four.finger_max_n[3] == 3.5 && four.finger_max_n[4] == 0.0,
        "no motor at the little finger");
  CHECK(!gv_channel_limit(gv_channel_of(GV_CHANNEL_CYBERGRASP), &cfg) &&
            !gv_channel_limit(gv_channel_of(GV_CHANNEL_LUCIDGLOVE), &cfg),
        "the defaults fit");
  cfg.finger_max_n[2] = 1.0;
  CHECK(gv_channel_limit(sense, &cfg) && cfg.max_n == 3.5 && cfg.finger_max_n[2] == 1.0 &&
            cfg.finger_max_n[0] == 3.5 && cfg.pretension_n == 0.8,
        "limited");
  CHECK(!gv_channel_limit(sense, &cfg), "once is enough");
  gv_limiter limiter;
  double want[GV_FINGERS] = {100, 100, 100, 0, 100}, out[GV_FINGERS];
  gv_limiter_init(&limiter, &cfg);
  for (int i = 0; i < 200; i++)
    gv_limiter_step(&limiter, want, true, 0, 0.001, out);
  CHECK(out[0] == 3.5 && out[2] == 1.0 && out[3] == 0.8 && out[4] == 0.0, "%g %g %g %g", out[0], out[2],
        out[3], out[4]);
}

int main(void) {
  RUN(test_golden_line);
  RUN(test_bends_become_joints);
  RUN(test_keys_of_single_joints);
  RUN(test_bends_round_trip);
  RUN(test_truncated_anywhere);
  RUN(test_garbage_between);
  RUN(test_lost_byte);
  RUN(test_ranges);
  RUN(test_brake_lines);
  RUN(test_a_full_line_drops_the_older_command);
  RUN(test_channels);
  RUN(test_limiter_fits_the_channel);
  return check_done();
}
