// SPDX-License-Identifier: BSD-3-Clause
// The wire: frame codec, cannelloni datagrams, candump logs, the UDP and trace drivers. Buffers are
// malloc'ed to the byte, so that a sanitizer or valgrind sees any read or write beyond them.
#include <arpa/inet.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>
#include <zlib.h>

#include "support/check.h"
#include "gloved/drivers.h"
#include "gloved/fcu.h"

static unsigned long long seed = 88172645463325252ULL;
static int below(int n) { return (int)check_uniform(&seed, 0, n); }
static uint8_t any_byte(void) { return (uint8_t)below(256); }
static uint8_t *exact_copy(const uint8_t *data, size_t size) {
  uint8_t *p = malloc(size ? size : 1);
  memcpy(p, data, size);
  return p;
}

static gv_frame random_frame(void) {
  gv_frame f = {.stamp_ns = (int64_t)below(1000000000) * 1000};
  bool fd = below(2);
  if (fd)
    f.flags = (uint8_t)(GV_FRAME_FD | (below(2) ? GV_FRAME_BRS : 0) | (below(2) ? GV_FRAME_ESI : 0));
  else
    f.flags = (uint8_t)((int[]){0, 0, GV_FRAME_REMOTE, GV_FRAME_ERROR}[below(4)]);
  if (below(2) && !(f.flags & GV_FRAME_ERROR))
    f.flags |= GV_FRAME_EXTENDED;
  f.id = (uint32_t)below(f.flags & (GV_FRAME_EXTENDED | GV_FRAME_ERROR) ? 1 << 29 : 1 << 11);
  f.len = gv_frame_fd_length((uint8_t)below(fd ? 65 : 9));
  if (!(f.flags & GV_FRAME_REMOTE))
    for (int i = 0; i < f.len; i++)
      f.data[i] = any_byte();
  return f;
}
static bool same_frame(const gv_frame *a, const gv_frame *b) {
  return a->id == b->id && a->flags == b->flags && a->len == b->len &&
         memcmp(a->data, b->data, sizeof a->data) == 0;
}

// ---- codec ----------------------------------------------------------------------------------------

static void test_crc_check_value(void) {
  CHECK(gv_crc16(0xffff, (const uint8_t *)"123456789", 9) == 0x29b1,
        "CRC-16/CCITT-FALSE of the catalogue's check string");
}

static gv_command_msg random_command(void) {
  gv_command_msg m = {.counter = any_byte(),
                      .flags = (uint8_t)below(2),
                      .sample_stamp_us = (uint32_t)below(1 << 30) * 4u,
                      .age_us = 10u * (uint32_t)below(65536)};
  for (int i = 0; i < GV_FINGERS; i++)
    m.tension_n[i] = below(4096) * GV_TENSION_LSB_N;
  return m;
}

static void test_messages_survive_the_wire(void) {
  for (int n = 0; n < 2000; n++) {
    gv_frame f;
    gv_glove_msg g = {.counter = any_byte(),
                      .flags = (uint8_t)below(8),
                      .stamp_us = (uint32_t)below(1 << 30) * 4u,
                      .age_us = 10u * (uint32_t)below(65536)};
    gv_glove_msg g2;
    for (int i = 0; i < GV_SENSORS; i++)
      g.raw[i] = (uint16_t)below(4096);
    gv_fcu_pack_glove(&g, &f);
    CHECK(f.id == 0x110 && f.len == 48 && (f.flags & GV_FRAME_FD), "the glove's frame");
    CHECK(gv_fcu_unpack_glove(&f, &g2) == 0 && memcmp(g.raw, g2.raw, sizeof g.raw) == 0 &&
              g2.counter == g.counter && g2.flags == g.flags && g2.stamp_us == g.stamp_us &&
              g2.age_us == g.age_us,
          "glove %d", n);
    gv_command_msg c = random_command(), c2;
    gv_fcu_pack_command(&c, &f);
    CHECK(gv_fcu_unpack_command(&f, &c2) == 0 && c2.counter == c.counter && c2.flags == c.flags &&
              c2.sample_stamp_us == c.sample_stamp_us && c2.age_us == c.age_us,
          "command %d", n);
    for (int i = 0; i < GV_FINGERS; i++)
      CHECK(c2.tension_n[i] == c.tension_n[i], "tension %d: %.17g against %.17g", i, c2.tension_n[i],
            c.tension_n[i]);
    gv_status_msg s = {.counter = any_byte(),
                       .flags = (uint8_t)below(8),
                       .stamp_us = (uint32_t)n,
                       .command_counter = any_byte(),
                       .mode = GV_FCU_MODE_FORCE,
                       .bad_commands = (uint16_t)below(65536)};
    gv_status_msg s2;
    for (int i = 0; i < GV_FINGERS; i++)
      s.tension_n[i] = below(4096) * GV_TENSION_LSB_N;
    gv_fcu_pack_status(&s, &f);
    CHECK(gv_fcu_unpack_status(&f, &s2) == 0 && memcmp(&s, &s2, sizeof s) == 0, "status %d", n);
  }
}

static void test_pose_survives_the_wire(void) {
  for (int n = 0; n < 2000; n++) {
    gv_quat q = gv_quat_normalize((gv_quat){check_uniform(&seed, -1, 1), check_uniform(&seed, -1, 1),
                                            check_uniform(&seed, -1, 1), check_uniform(&seed, -1, 1)});
    gv_pose_msg m = {
      .counter = any_byte(),
      .flags = GV_POSE_VALID,
      .stamp_us = 7,
      .age_us = 20,
      .receiver = 2,
      .T_world_receiver = {
        q, {check_uniform(&seed, -9, 9), check_uniform(&seed, -9, 9), check_uniform(&seed, -9, 9)}}};
    gv_pose_msg back;
    gv_frame f;
    gv_fcu_pack_pose(&m, &f);
    CHECK(gv_fcu_unpack_pose(&f, &back) == 0, "pose %d", n);
    gv_quat r = back.T_world_receiver.q;
    CHECK_NEAR(gv_norm(gv_sub(back.T_world_receiver.p, m.T_world_receiver.p)), 0.0, 1e-7);
    CHECK_NEAR(fabs(r.w - q.w) + fabs(r.x - q.x) + fabs(r.y - q.y) + fabs(r.z - q.z), 0.0, 4e-9);
    CHECK_NEAR(r.w * r.w + r.x * r.x + r.y * r.y + r.z * r.z, 1.0, 1e-15);
  }
}

static void test_out_of_range_is_clamped(void) {
  gv_frame f;
  gv_command_msg c = {.age_us = UINT32_MAX, .flags = 0xff, .tension_n = {nan(""), HUGE_VAL, -3, 1e9, 5.0}};
  gv_command_msg c2;
  gv_fcu_pack_command(&c, &f);
  CHECK(gv_fcu_unpack_command(&f, &c2) == 0, "clamped command");
  CHECK(c2.tension_n[0] == 0 && c2.tension_n[1] == 0 && c2.tension_n[2] == 0, "no force from doubt");
  CHECK_NEAR(c2.tension_n[3], 12.285, 1e-12);
  CHECK(c2.tension_n[4] <= 5.0 && c2.tension_n[4] > 4.9969, "a command rounds down: %g", c2.tension_n[4]);
  CHECK(c2.age_us == 655350 && c2.flags == 7, "age %u flags %u", c2.age_us, c2.flags);
  gv_glove_msg g = {.age_us = 11}, g2;
  for (int i = 0; i < GV_SENSORS; i++)
    g.raw[i] = 60000;
  gv_fcu_pack_glove(&g, &f);
  CHECK(gv_fcu_unpack_glove(&f, &g2) == 0 && g2.raw[0] == 4095 && g2.raw[21] == 4095 && g2.age_us == 20,
        "an age rounds up: %u", g2.age_us);
  gv_pose_msg p = {.receiver = 2,
                   .T_world_receiver = {{nan(""), nan(""), nan(""), nan("")}, {nan(""), 1e9, -1e9}}};
  gv_pose_msg p2;
  gv_fcu_pack_pose(&p, &f);
  CHECK(gv_fcu_unpack_pose(&f, &p2) == GV_FCU_WRONG_VALUE,
        "a pose that is not a number must not arrive as one");
}

// Recompute the checksum after changing a byte, as a sender with other ideas would.
static void change_byte(gv_frame *f, int at, uint8_t value) {
  f->data[at] = value;
  const uint8_t head[6] = {(uint8_t)f->id, (uint8_t)(f->id >> 8), f->data[0], f->data[1], 0, 0};
  uint16_t crc = gv_crc16(gv_crc16(0xffff, head, 6), f->data + 4, (size_t)f->len - 4);
  f->data[2] = (uint8_t)crc;
  f->data[3] = (uint8_t)(crc >> 8);
}

static void test_refusals(void) {
  gv_command_msg c = random_command();
  gv_pose_msg p = {.receiver = 2, .T_world_receiver = gv_pose_identity()}, p2;
  gv_frame f, good;
  gv_fcu_pack_command(&c, &good);
  for (int bit = 0; bit < 8 * good.len; bit++) {
    f = good;
    f.data[bit / 8] ^= (uint8_t)(1 << bit % 8);
    CHECK(gv_fcu_unpack_command(&f, &c) == GV_FCU_WRONG_CHECKSUM, "bit %d flipped", bit);
  }
  f = good;
  f.id = 0x091;
  CHECK(gv_fcu_unpack_command(&f, &c) == GV_FCU_WRONG_ID, "other id");
  f = good;
  f.flags |= GV_FRAME_EXTENDED;
  CHECK(gv_fcu_unpack_command(&f, &c) == GV_FCU_WRONG_ID, "extended");
  f = good;
  f.len = 16;
  CHECK(gv_fcu_unpack_command(&f, &c) == GV_FCU_WRONG_LENGTH, "short");
  f = good;
  f.flags = 0;
  CHECK(gv_fcu_unpack_command(&f, &c) == GV_FCU_WRONG_LENGTH, "not FD");
  f = good;
  change_byte(&f, 1, 8);
  CHECK(gv_fcu_unpack_command(&f, &c) == GV_FCU_WRONG_VALUE, "unknown flag");
  f = good;
  change_byte(&f, 15, 0xf0);
  CHECK(gv_fcu_unpack_command(&f, &c) == GV_FCU_WRONG_VALUE, "reserved bits");
  gv_fcu_pack_pose(&p, &good);
  f = good;
  change_byte(&f, 10, 0);
  CHECK(gv_fcu_unpack_pose(&f, &p2) == GV_FCU_WRONG_VALUE, "receiver 0");
  f = good;
  change_byte(&f, 27, 0x3f);
  CHECK(gv_fcu_unpack_pose(&f, &p2) == GV_FCU_WRONG_VALUE, "quaternion too short");
  f = good;
  change_byte(&f, 26, 0x04);
  CHECK(gv_fcu_unpack_pose(&f, &p2) == 0 && p2.T_world_receiver.q.w == 1, "a little long: made unit");
}

// ---- cannelloni -----------------------------------------------------------------------------------

static void test_cannelloni_golden_vector(void) {
  const uint8_t golden[] = {2, 0,    0x23, 0, 1, 0x99, 0xfa, 0x04, 0x4d,
                            8, 0x0c, 0x11, 1, 0, 0xf2, 0x1d, 0x0b, 2};
  gv_frame f[4];
  uint8_t seq, back[64];
  CHECK(gv_cannelloni_unpack(golden, sizeof golden, &seq, f, 4) == 1 && seq == 0x23, "decodes");
  CHECK(f[0].id == 0x19fa044d && f[0].flags == GV_FRAME_EXTENDED && f[0].len == 8 && f[0].data[0] == 0x0c &&
            f[0].data[7] == 2,
        "content");
  CHECK(gv_cannelloni_pack(seq, f, 1, back, sizeof back) == sizeof golden &&
            memcmp(back, golden, sizeof golden) == 0,
        "re-encodes to the same bytes");
}

static int random_bundle(gv_frame *f, uint8_t *out, uint8_t *seq) {
  int count = below(20);
  for (int i = 0; i < count; i++)
    f[i] = random_frame();
  *seq = any_byte();
  int size = gv_cannelloni_pack(*seq, f, count, out, GV_CANNELLONI_MAX_BYTES);
  return size < 0 ? random_bundle(f, out, seq) : size;
}

static void test_cannelloni_round_trip(void) {
  for (int n = 0; n < 2000; n++) {
    gv_frame f[20], back[20];
    uint8_t bytes[GV_CANNELLONI_MAX_BYTES], seq, seq2;
    int size = random_bundle(f, bytes, &seq);
    int count = bytes[3] << 8 | bytes[4];
    uint8_t *small = malloc((size_t)size);
    CHECK(gv_cannelloni_pack(seq, f, count, small, (size_t)size) == size, "fits to the byte");
    CHECK(gv_cannelloni_pack(seq, f, count, small, (size_t)size - 1) == -1, "one byte too small");
    CHECK(gv_cannelloni_unpack(small, (size_t)size, &seq2, back, 20) == count && seq2 == seq, "bundle %d", n);
    for (int i = 0; i < count; i++)
      CHECK(same_frame(&f[i], &back[i]), "bundle %d frame %d", n, i);
    if (count > 0)
      CHECK(gv_cannelloni_unpack(small, (size_t)size, &seq2, back, count - 1) == -1,
            "more frames than the caller takes");
    free(small);
  }
}

static bool frames_valid(const gv_frame *f, int count) {
  for (int i = 0; i < count; i++)
    if (f[i].len > 64 || gv_frame_fd_length(f[i].len) != f[i].len || f[i].id > 0x1fffffff ||
        (f[i].len > 8 && !(f[i].flags & GV_FRAME_FD)))
      return false;
  return true;
}

static void test_cannelloni_damage(void) {
  static gv_frame f[GV_CANNELLONI_MAX_FRAMES];
  for (int n = 0; n < 100; n++) {
    uint8_t bytes[GV_CANNELLONI_MAX_BYTES], seq;
    int size = random_bundle(f, bytes, &seq);
    for (int cut = 0; cut < size; cut++) {
      uint8_t *p = exact_copy(bytes, (size_t)cut);
      CHECK(gv_cannelloni_unpack(p, (size_t)cut, &seq, f, GV_CANNELLONI_MAX_FRAMES) == -1, "cut to %d of %d",
            cut, size);
      free(p);
    }
    for (int bit = 0; bit < 8 * 11 && bit < 8 * size; bit++) {  // header and the first frame's head
      uint8_t *p = exact_copy(bytes, (size_t)size);
      p[bit / 8] ^= (uint8_t)(1 << bit % 8);
      int count = gv_cannelloni_unpack(p, (size_t)size, &seq, f, GV_CANNELLONI_MAX_FRAMES);
      CHECK(count == -1 || frames_valid(f, count), "bit %d", bit);
      CHECK(bit / 8 == 2 || bit >= 40 || count == -1, "header bit %d went unseen", bit);
      free(p);
    }
  }
}

static void test_cannelloni_fuzz(void) {
  static gv_frame f[GV_CANNELLONI_MAX_FRAMES];
  int accepted = 0;
  for (int n = 0; n < 100000; n++) {
    int size = below(80);
    uint8_t *p = malloc(size ? (size_t)size : 1), seq;
    for (int i = 0; i < size; i++)
      p[i] = below(3) ? 0 : any_byte();
    if (size > 4 && below(8)) {
      p[0] = 2;
      p[1] = 0;
      p[3] = 0;
      p[4] = (uint8_t)below(5);
    }
    int count = gv_cannelloni_unpack(p, (size_t)size, &seq, f, GV_CANNELLONI_MAX_FRAMES);
    CHECK(count == -1 || (count >= 0 && frames_valid(f, count)), "datagram %d", n);
    accepted += count >= 0;
    free(p);
  }
  CHECK(accepted > 100, "only %d of the fuzzed datagrams were sound: the fuzz reaches too little", accepted);
}

// ---- candump text ---------------------------------------------------------------------------------

static void test_log_lines_as_candump_writes_them(void) {
  static const struct {
    gv_frame f;
    const char *line;
  } t[] = {
    {{.stamp_ns = 1436509052249713000, .id = 0x44, .len = 5, .data = {0x2a, 0x36, 0x6c, 0x2b, 0xba}},
     "(1436509052.249713) vcan0 044#2A366C2BBA\n"},
    {{.stamp_ns = 1249903999, .id = 0x12345678, .flags = GV_FRAME_EXTENDED | GV_FRAME_REMOTE},
     "(0000000001.249903) vcan0 12345678#R\n"},
    {{.id = 0x123, .flags = GV_FRAME_REMOTE, .len = 5}, "(0000000000.000000) vcan0 123#R5\n"},
    {{.id = 0x123, .flags = GV_FRAME_FD | GV_FRAME_BRS, .len = 3, .data = {1, 2, 0xff}},
     "(0000000000.000000) vcan0 123##10102FF\n"},
    {{.id = 0x123, .flags = GV_FRAME_FD}, "(0000000000.000000) vcan0 123##0\n"},
    {{.id = 0x80, .flags = GV_FRAME_ERROR, .len = 1, .data = {9}}, "(0000000000.000000) vcan0 20000080#09\n"},
  };
  for (size_t i = 0; i < sizeof t / sizeof *t; i++) {
    char line[GV_LOG_LINE_MAX + 1], err[120];
    gv_frame back;
    int n = gv_log_format(&t[i].f, "vcan0", line);
    CHECK(strcmp(line, t[i].line) == 0 && n == (int)strlen(line), "%s", line);
    line[n - 1] = 0;
    CHECK(gv_log_parse(line, &back, err, sizeof err) == 0 && same_frame(&back, &t[i].f) &&
              back.stamp_ns == t[i].f.stamp_ns / 1000 * 1000,
          "%s", line);
  }
}

static void test_log_round_trip(void) {
  for (int n = 0; n < 5000; n++) {
    gv_frame f = random_frame(), back;
    char line[GV_LOG_LINE_MAX + 1], err[120];
    int len = gv_log_format(&f, "an_interface_too_long", line);
    CHECK(len <= GV_LOG_LINE_MAX && line[len] == 0, "length %d", len);
    char *p = malloc((size_t)len);
    memcpy(p, line, (size_t)len);
    p[len - 1] = 0;
    CHECK(gv_log_parse(p, &back, err, sizeof err) == 0 && same_frame(&f, &back) &&
              f.stamp_ns == back.stamp_ns,
          "%s", line);
    // a cut line is refused or valid, never read beyond
    for (int cut = 0; cut < len - 1; cut += 1 + below(9)) {
      p[cut] = 0;
      CHECK(gv_log_parse(p, &back, err, sizeof err) < 0 || frames_valid(&back, 1), "%s", p);
      p[cut] = line[cut];
    }
    free(p);
  }
}

static void test_log_accepts_and_refuses(void) {
  static const char *good[] = {"(1.5) can0 123#",
                               "(0000000001.000001)   can0  123#11.22.33",
                               "(1.000000001) can0 123##0 R",
                               "(1.0) can0 123#11 T more",
                               "(1.0)\tcan0\t123#r8\r",
                               "(1.0) can0 123#1122334455667788_9",
                               "(9000000000.999999) can0 1fffffff#aA"};
  static const char *bad[] = {"",
                              "x",
                              "(1) can0 123#",
                              "(nan) can0 123#",
                              "(inf.0) can0 123#",
                              "(-1.0) can0 123#",
                              "(99999999999.0) can0 123#",
                              "(9100000000.0) can0 123#",
                              "(1.0000000001) can0 123#",
                              "(1.0)can0 123#",
                              "(1.0) can0",
                              "(1.0) 123#11",
                              "(1.0) can0 12#",
                              "(1.0) can0 800#",
                              "(1.0) can0 1234#",
                              "(1.0) can0 123456789#",
                              "(1.0) can0 C0000000#",
                              "(1.0) can0 123#1",
                              "(1.0) can0 123#112233445566778899",
                              "(1.0) can0 123##",
                              "(1.0) can0 123##0112233445566778899",
                              "(1.0) can0 123#11x",
                              "(1.0) can0 123#R9",
                              "(1.0) can0 123###00",
                              "(1.0) sixteencharacter 123#",
                              "can0 123 [3] 11 22 33"};
  gv_frame f;
  char err[120];
  for (size_t i = 0; i < sizeof good / sizeof *good; i++)
    CHECK(gv_log_parse(good[i], &f, err, sizeof err) == 0, "%s: %s", good[i], err);
  for (size_t i = 0; i < sizeof bad / sizeof *bad; i++)
    CHECK(gv_log_parse(bad[i], &f, err, sizeof err) < 0 && err[0] && !strchr(err, '\n'), "accepted: %s",
          bad[i]);
}

static const char *temp_path(const char *name) {
  static char path[300];
  snprintf(path, sizeof path, "%s/test/%s", getenv("B") ? getenv("B") : ".", name);
  return path;
}
static const char *write_file(const char *name, const char *text, size_t size) {
  const char *path = temp_path(name);
  FILE *f = fopen(path, "wb");
  if (!f) {
    printf("cannot write %s\n", path);
    exit(1);
  }
  fwrite(text, 1, size, f);
  fclose(f);
  return path;
}

// can-utils reads what we write: log2long prints stamp, interface, identifier, [length], bytes.
static void test_can_utils_read_our_logs(void) {
  if (system("command -v log2long >/dev/null 2>&1")) {
    SKIP("log2long is not installed; apt-get install can-utils (make test does)");
    return;
  }
  enum { FRAMES = 500 };
  static gv_frame f[FRAMES];
  static char text[FRAMES * (GV_LOG_LINE_MAX + 1)], command[400], out[600];
  size_t size = 0;
  for (int i = 0; i < FRAMES; i++) {
    f[i] = random_frame();
    size += (size_t)gv_log_format(&f[i], "can0", text + size);
  }
  snprintf(command, sizeof command, "log2long < %s", write_file("wire.log", text, size));
  FILE *p = popen(command, "r");
  for (int i = 0; i < FRAMES; i++) {
    long long seconds = 0;
    long long micros = 0;
    char iface[20];
    unsigned id = 0;
    unsigned len = 0;
    int at = 0;
    CHECK(fgets(out, sizeof out, p) &&
              sscanf(out, " (%lld.%lld) %19s %x [%u] %n", &seconds, &micros, iface, &id, &len, &at) == 5,
          "line %d: %s", i, out);
    uint32_t want = f[i].id | (f[i].flags & GV_FRAME_ERROR ? 0x20000000u : 0);
    CHECK(seconds * 1000000 + micros == f[i].stamp_ns / 1000 && id == want && len == f[i].len, "%s", out);
    if (f[i].flags & GV_FRAME_REMOTE)
      CHECK(strstr(out, "remote request"), "%s", out);
    else
      for (int k = 0; k < f[i].len; k++)
        CHECK(strtol(out + at + 3 * k, NULL, 16) == f[i].data[k], "byte %d of %s", k, out);
  }
  pclose(p);
}

// ---- trace ----------------------------------------------------------------------------------------

// A log of `frames` glove frames 10 ms apart from second 1000, each followed by a command of our own.
static size_t glove_log(char *text, int frames) {
  size_t size = 0;
  for (int i = 0; i < frames; i++) {
    gv_glove_msg g = {.counter = (uint8_t)i, .stamp_us = (uint32_t)i * 10000};
    gv_command_msg c = {.counter = (uint8_t)i};
    gv_frame f;
    f.stamp_ns = 1000000000000 + (int64_t)i * 10000000;
    gv_fcu_pack_glove(&g, &f);
    size += (size_t)gv_log_format(&f, "can0", text + size);
    gv_fcu_pack_command(&c, &f);
    size += (size_t)gv_log_format(&f, "can0", text + size);
  }
  return size;
}

static void play_trace(const char *path, int frames, uint64_t bad) {
  gv_driver d;
  gv_frame f[8];
  char err[400] = "";
  CHECK(gv_trace_open(path, &d, err, sizeof err) == 0, "%s", err);
  if (err[0])
    return;
  CHECK(gv_trace_length_ns(&d) == (frames - 1) * 10000000LL, "length %lld",
        (long long)gv_trace_length_ns(&d));
  CHECK(d.poll(d.self, -1, f, 8) == 0, "nothing before the start");
  CHECK(d.poll(d.self, 0, f, 8) == 1 && f[0].stamp_ns == 0 && f[0].data[0] == 0, "the first at 0");
  CHECK(d.poll(d.self, 35000000, f, 2) == 2 && f[0].data[0] == 1 && f[1].data[0] == 2,
        "in order, at most max");
  CHECK(!d.ended(d.self), "not yet");
  int n, rest = 0;
  while ((n = d.poll(d.self, INT64_MAX, f, 8)) > 0)
    rest += n;
  CHECK(rest == frames - 3 && d.ended(d.self), "%d more", rest);
  CHECK(d.send(d.self, f, 3) == 0, "sending goes nowhere");
  gv_driver_stats s = d.stats(d.self);
  CHECK(s.rx == (uint64_t)frames && s.tx == 3 && s.bad == bad, "rx %llu tx %llu bad %llu",
        (unsigned long long)s.rx, (unsigned long long)s.tx, (unsigned long long)s.bad);
  d.close(d.self);
}

static void test_trace_plays_its_frames(void) {
  static char text[20 * 2 * GV_LOG_LINE_MAX];
  size_t size = glove_log(text, 20);
  play_trace(write_file("trace.log", text, size), 20, 0);
  const char *path = temp_path("trace.log.gz");
  gzFile gz = gzopen(path, "wb");
  gzwrite(gz, text, (unsigned)size);
  gzclose(gz);
  play_trace(path, 20, 0);
}

static void test_trace_cut_by_a_crash(void) {
  static char text[20 * 2 * GV_LOG_LINE_MAX], packed[sizeof text];
  size_t size = glove_log(text, 20);
  size_t line = strcspn(text, "\n") + 1;
  size_t command = strcspn(text + line, "\n") + 1;
  play_trace(write_file("cut.log", text, size - command - 1), 20, 0);  // the newline alone is missing
  // half a byte: the last frame is dropped
  play_trace(write_file("cut.log", text, size - command - 2), 19, 1);
  // stored: cut anywhere, the text before it is there
  gzFile gz = gzopen(temp_path("whole.gz"), "wb0");
  gzwrite(gz, text, (unsigned)size);
  gzclose(gz);
  FILE *f = fopen(temp_path("whole.gz"), "rb");
  size_t packed_size = fread(packed, 1, sizeof packed, f);
  fclose(f);
  gv_driver d;
  char err[400] = "";
  CHECK(gv_trace_open(write_file("cut.gz", packed, packed_size - 900), &d, err, sizeof err) == 0, "%s", err);
  if (err[0])
    return;
  CHECK(d.stats(d.self).bad == 1 && gv_trace_length_ns(&d) > 0, "a gzip stream that broke off");
  d.close(d.self);
}

// A recording at 4 kHz that ended while forces were held: repeats and the ramp are no steps.
static void test_a_recording_ends_with_its_last_step(void) {
  static char text[4000];
  static const struct {
    int us, flags;  // of a command; flags below 0: a glove
  } line[] = {{0, -1},
              {0, GV_COMMAND_ENABLE},
              {250, -1},
              {250, GV_COMMAND_ENABLE},
              {498, GV_COMMAND_REPEAT},
              {498, GV_COMMAND_ENDING}};
  size_t size = 0;
  for (size_t i = 0; i < sizeof line / sizeof *line; i++) {
    gv_frame f;
    if (line[i].flags < 0)
      gv_fcu_pack_glove(&(gv_glove_msg){.counter = (uint8_t)i}, &f);
    else
      gv_fcu_pack_command(&(gv_command_msg){.counter = (uint8_t)i, .flags = (uint8_t)line[i].flags}, &f);
    f.stamp_ns = 1000000000 + line[i].us * 1000LL;
    size += (size_t)gv_log_format(&f, "can0", text + size);
  }
  gv_driver d;
  char err[400] = "";
  CHECK(gv_trace_open(write_file("held.log", text, size), &d, err, sizeof err) == 0, "%s", err);
  if (err[0])
    return;
  CHECK(gv_trace_length_ns(&d) == 250000, "%lld ns", (long long)gv_trace_length_ns(&d));
  d.close(d.self);
}

// Opening must fail with one line that has both words.
static void expect_error(const char *path, const char *place, const char *word) {
  gv_driver d;
  char err[400] = "";
  int code = gv_trace_open(path, &d, err, sizeof err);
  CHECK(code < 0 && strstr(err, place) && strstr(err, word) && strstr(err, "; ") && !strchr(err, '\n'), "%s",
        err);
  if (code == 0)
    d.close(d.self);
}

static void test_trace_refusals(void) {
  static char text[6 * GV_LOG_LINE_MAX];
  expect_error("/nowhere/x.log", "/nowhere/x.log", "No such file");
  expect_error("/", "/", "directory");
  expect_error(write_file("bad.log", "", 0), "bad.log", "no frame of a glove");
  expect_error(write_file("bad.log", "(1.0) can0 123#11\n", 18), "bad.log", "no frame of a glove");
  glove_log(text, 1);
  strcat(text, "\n# a comment\n(1000.0) can0 110#1\n");
  expect_error(write_file("bad.log", text, strlen(text)), "bad.log:5:", "hexadecimal");
  glove_log(text, 1);
  strcat(text, "(999.980000) can0 123#\n");
  expect_error(write_file("bad.log", text, strlen(text)), "bad.log:3:", "10 ms");
  memset(text, 'x', 500);
  text[499] = '\n';
  expect_error(write_file("bad.log", text, 500), "bad.log:1:", "200");
  expect_error(write_file("bad.log", "(1.0) can0 123#\n\0\0\0\n", 20), "bad.log:2:", "zero byte");
}

static void test_trace_small_steps_back(void) {
  const char *text = "(5.000000) can0 110#\n(4.999000) can1 123#\n(5.000001) can0 123#\n";
  gv_log log;
  gv_frame f;
  char err[400];
  CHECK(gv_log_open(&log, write_file("late.log", text, strlen(text)), err, sizeof err) == 0, "%s", err);
  int64_t last = 0;
  for (int i = 0; i < 3; i++) {
    CHECK(gv_log_next(&log, &f, err, sizeof err) == 1 && f.stamp_ns >= last, "%s", err);
    last = f.stamp_ns;
  }
  CHECK(gv_log_next(&log, &f, err, sizeof err) == 0 && log.late == 1, "late %llu",
        (unsigned long long)log.late);
  gv_log_close(&log);
}

// ---- UDP ------------------------------------------------------------------------------------------

static int64_t now(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}
// Poll until `want` frames came or a second went by.
static int poll_all(gv_driver *d, gv_frame *f, int want) {
  int n = 0;
  for (int64_t end = now() + 1000000000; n < want && now() < end;)
    n += d->poll(d->self, now(), f + n, want - n);
  return n;
}

// Two drivers that are each other's peer, on a free pair of ports.
static int port_a, port_b;
static bool open_pair(gv_driver *a, gv_driver *b) {
  char url[100], err[300] = "";
  for (int try = 0; try < 50; try++) {
    port_a = 20000 + (int)((unsigned)(getpid() * 7 + try * 331) % 20000u);
    port_b = port_a + 1;
    snprintf(url, sizeof url, "udp://127.0.0.1:%d?listen=%d", port_b, port_a);
    if (gv_udp_open(url, a, err, sizeof err))
      continue;
    snprintf(url, sizeof url, "udp://localhost:%d?listen=%d", port_a, port_b);
    if (gv_udp_open(url, b, err, sizeof err) == 0)
      return true;
    a->close(a->self);
  }
  CHECK(false, "no free ports: %s", err);
  return false;
}

static void test_udp_both_ways(void) {
  gv_driver a, b;
  if (!open_pair(&a, &b))
    return;
  gv_frame f[30], back[30];
  for (int i = 0; i < 30; i++)
    f[i] = random_frame();
  CHECK(a.poll(a.self, now(), back, 30) == 0, "nothing yet");
  int64_t before = now();
  for (int i = 0; i < 30; i += 10)
    CHECK(a.send(a.self, f + i, 10) == 0, "bundle %d", i);
  CHECK(b.send(b.self, f, 1) == 0 && poll_all(&a, back, 1) == 1 && same_frame(f, back), "the other way");
  CHECK(poll_all(&b, back, 3) == 3, "fewer than a bundle at a time");
  CHECK(poll_all(&b, back + 3, 27) == 27, "and the rest");
  for (int i = 0; i < 30; i++) {
    CHECK(same_frame(&f[i], &back[i]), "frame %d", i);
    CHECK(back[i].stamp_ns > before - 1000000 && back[i].stamp_ns <= now() &&
              (i == 0 || back[i].stamp_ns >= back[i - 1].stamp_ns),
          "stamp %d", i);
  }
  gv_driver_stats s = b.stats(b.self);
  CHECK(s.rx == 30 && s.tx == 1 && s.bad == 0 && s.lost == 0 && s.foreign == 0, "counters");
  CHECK(!b.ended(b.self), "a link never ends");
  static gv_frame many[GV_CANNELLONI_MAX_FRAMES];
  for (int i = 0; i < 40; i++)
    many[i] = (gv_frame){.id = 1, .flags = GV_FRAME_FD, .len = 64};
  CHECK(a.send(a.self, many, 40) < 0 && a.stats(a.self).tx_failed == 40,
        "a bundle over one datagram is refused");
  a.close(a.self);
  b.close(b.self);
}

static void test_udp_without_a_peer(void) {
  gv_driver a, b;
  if (!open_pair(&a, &b))
    return;
  b.close(b.self);
  gv_frame f = random_frame(), back;
  for (int i = 0; i < 20; i++) {
    CHECK(a.send(a.self, &f, 1) == 0, "a peer that is not up is no error");
    CHECK(a.poll(a.self, now(), &back, 1) == 0, "and nothing comes");
  }
  char url[100], err[300];
  snprintf(url, sizeof url, "udp://127.0.0.1:%d?listen=%d", port_a, port_b);
  CHECK(gv_udp_open(url, &b, err, sizeof err) == 0, "%s", err);
  CHECK(b.send(b.self, &f, 1) == 0 && poll_all(&a, &back, 1) == 1 && same_frame(&f, &back),
        "the peer comes up");
  gv_driver c;
  CHECK(gv_udp_open(url, &c, err, sizeof err) < 0 && strstr(err, "in use"), "a port that is taken: %s", err);
  a.close(a.self);
  b.close(b.self);
}

// A socket that sends raw bytes from port `from` to the driver listening on port `to`.
static int raw_socket(int from, int to) {
  int fd = socket(AF_INET, SOCK_DGRAM, 0);
  struct sockaddr_in s = {
    .sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK), .sin_port = htons((uint16_t)from)};
  CHECK(bind(fd, (const struct sockaddr *)&s, sizeof s) == 0, "port %d", from);
  s.sin_port = htons((uint16_t)to);
  CHECK(connect(fd, (const struct sockaddr *)&s, sizeof s) == 0, "port %d", to);
  return fd;
}
static uint16_t raw_port(int fd) {
  struct sockaddr_in s;
  socklen_t size = sizeof s;
  CHECK(getsockname(fd, (struct sockaddr *)&s, &size) == 0, "name");
  return ntohs(s.sin_port);
}
static void send_seq(int fd, int seq) {
  const uint8_t datagram[] = {2, 0, (uint8_t)seq, 0, 1, 0, 0, 1, 0x23, 0};
  CHECK(send(fd, datagram, sizeof datagram, 0) == sizeof datagram, "sequence %d", seq);
}

// Datagrams as cannelloni 2 writes them for a classic bus (its doc/udp_format.md): version,
// operation, sequence, count (two bytes), then a frame's identifier (four bytes), its length
// without bit 7, its data; no flags.
static int put_classic(const gv_frame *frame, int count, uint8_t *out) {
  int n = 5;
  memcpy(out, (const uint8_t[]){2, 0, 0, 0, (uint8_t)count}, 5);
  for (int i = 0; i < count; i++) {
    memcpy(out + n, (const uint8_t[]){0, 0, (uint8_t)(frame[i].id >> 8), (uint8_t)frame[i].id, frame[i].len},
           5);
    memcpy(out + n + 5, frame[i].data, frame[i].len);
    n += 5 + frame[i].len;
  }
  return n;
}

static void test_udp_classic_can_is_joined_and_answered_in_kind(void) {
  gv_driver a, b;
  if (!open_pair(&a, &b))
    return;
  b.close(b.self);
  const int peer = raw_socket(port_b, port_a);
  gv_frame glove, part[GV_CLASSIC_FRAMES], back[4], command;
  uint8_t datagram[200], answer[200];
  const gv_glove_msg sent = {.counter = 7, .flags = GV_GLOVE_DEAD_MAN, .raw = {1, 2, 3}};
  gv_glove_msg got;
  const gv_command_msg force = {.counter = 5, .flags = GV_COMMAND_ENABLE, .tension_n = {0, 1.2, 0, 0, 0}};
  gv_fcu_pack_glove(&sent, &glove);
  gv_fcu_pack_command(&force, &command);
  const int parts = gv_classic_split(&glove, part);
  CHECK(send(peer, datagram, (size_t)put_classic(part, parts, datagram), 0) > 0, "sends");
  CHECK(poll_all(&a, back, 1) == 1 && gv_fcu_unpack_glove(&back[0], &got) == GV_FCU_OK, "not joined");
  CHECK(got.counter == 7 && got.raw[2] == 3, "counter %d", got.counter);
  CHECK(a.send(a.self, &command, 1) == 0, "refused");
  const ssize_t size = recv(peer, answer, sizeof answer, 0);
  // 0x091, 8 bytes; byte 0: counter 5 and ENABLE; 1.2 N are 100 counts of 0.012 N, in bits
  // 16 to 25 (data/gloved.dbc).
  const uint8_t expected[] = {2, 0, 0, 0, 1, 0, 0, 0, 0x91, 8, 0x15, 0, 100, 0, 0, 0, 0};
  CHECK(size == 18 && memcmp(answer, expected, sizeof expected) == 0, "%d bytes, byte 9: %02x, 12: %d",
        (int)size, answer[9], answer[12]);
  // A peer that speaks CAN FD again is answered with CAN FD: length 20 with bit 7.
  const int bytes = gv_cannelloni_pack(1, &glove, 1, datagram, sizeof datagram);
  CHECK(send(peer, datagram, (size_t)bytes, 0) > 0 && poll_all(&a, back, 1) == 1 &&
            a.send(a.self, &command, 1) == 0,
        "CAN FD");
  CHECK(recv(peer, answer, sizeof answer, 0) == 5 + 6 + 20 && answer[8] == 0x90 && answer[9] == (0x80 | 20),
        "answer");
  close(peer);
  a.close(a.self);
}

// The flush order of a cannelloni that stalled: the rest of a datagram comes in reverse, so that a message
// may be cut and its second part come after messages that are newer. Nothing of it is lost.
static void test_classic_messages_cut_by_a_stall_are_joined(void) {
  enum { MESSAGES = 8, PARTS = 6, FRAMES = MESSAGES * PARTS, CUT = 21 };
  gv_frame sent[FRAMES], came[FRAMES], whole;
  gv_classic_join join = {.number = 0};
  bool seen[MESSAGES] = {false};
  for (int m = 0; m < MESSAGES; m++) {
    gv_frame glove;
    const gv_glove_msg msg = {.counter = (uint8_t)m, .raw = {(uint16_t)(100 * m)}};
    gv_fcu_pack_glove(&msg, &glove);
    CHECK(gv_classic_split(&glove, &sent[PARTS * m]) == PARTS, "parts");
  }
  for (int i = 0; i < FRAMES; i++)
    came[i] = sent[i < CUT ? i : FRAMES - 1 + CUT - i];
  for (int i = 0; i < FRAMES; i++) {
    gv_glove_msg msg;
    if (!gv_classic_take(&join, &came[i], &whole))
      continue;
    CHECK(gv_fcu_unpack_glove(&whole, &msg) == GV_FCU_OK && msg.raw[0] == 100 * msg.counter,
          "damaged by joining");
    seen[msg.counter] = true;
  }
  for (int m = 0; m < MESSAGES; m++)
    CHECK(seen[m], "message %d was lost", m);
}

// cannelloni -m 9000: one datagram of as many frames of 64 bytes as fit, 70 bytes each.
static void test_udp_jumbo_datagrams(void) {
  enum { FRAMES = (GV_CANNELLONI_TAKEN_BYTES - 5) / 70, BYTES = 5 + 70 * FRAMES };
  gv_driver a, b;
  if (!open_pair(&a, &b))
    return;
  b.close(b.self);
  const int peer = raw_socket(port_b, port_a);
  static uint8_t datagram[BYTES] = {2, 0, 0, 0, FRAMES};
  static gv_frame back[FRAMES];
  for (int i = 0; i < FRAMES; i++)
    memcpy(datagram + 5 + 70 * i, (const uint8_t[]){0, 0, 1, (uint8_t)i, 0x80 | 64}, 5);
  CHECK(send(peer, datagram, BYTES, 0) == BYTES, "sends");
  CHECK(poll_all(&a, back, FRAMES) == FRAMES, "taken");
  for (int i = 0; i < FRAMES; i++)
    CHECK(back[i].id == 0x100u + (uint8_t)i && back[i].len == 64, "frame %d", i);
  CHECK(a.stats(a.self).bad == 0, "%d bad", (int)a.stats(a.self).bad);
  close(peer);
  a.close(a.self);
}

// A flood from elsewhere fills its own socket's buffer, not the peer's: every frame of the peer still comes.
static void test_udp_foreign_flood_starves_nobody(void) {
  gv_driver a, b;
  if (!open_pair(&a, &b))
    return;
  b.close(b.self);
  const int peer = raw_socket(port_b, port_a);
  const int other = raw_socket(0, port_a);
  gv_frame f[300];
  int came = 0;
  for (int round = 0; round < 200; round++) {
    for (int i = 0; i < 150; i++)
      send_seq(other, i);  // as many as 150,000 a second in a period of 1 ms
    send_seq(peer, round);
    came += a.poll(a.self, now(), f, 300);
  }
  for (int i = 0; i < 20 && came < 200; i++)
    came += a.poll(a.self, now(), f, 300);
  const gv_driver_stats s = a.stats(a.self);
  CHECK(came == 200, "%d of 200 frames came", came);
  CHECK(s.lost == 0 && s.foreign > 200, "lost %llu, foreign %llu", (unsigned long long)s.lost,
        (unsigned long long)s.foreign);
  close(peer);
  close(other);
  a.close(a.self);
}

static void test_udp_foreign_broken_and_lost(void) {
  gv_driver a, b;
  if (!open_pair(&a, &b))
    return;
  b.close(b.self);
  int peer = raw_socket(port_b, port_a);
  int other = raw_socket(0, port_a);
  static uint8_t giant[GV_CANNELLONI_TAKEN_BYTES + 1] = {2};
  gv_frame f[300];
  send_seq(other, 0);
  CHECK(send(peer, giant, 0, 0) == 0 && send(peer, giant, 7, 0) == 7 &&
            send(peer, giant, sizeof giant, 0) == sizeof giant,
        "broken ones");
  static const struct {
    int seq;
    unsigned lost;
  } t[] = {{250, 0},  {251, 0},  {254, 2},  {255, 2}, {0, 2}, {3, 4},  // gaps, also over the wrap
           {3, 4},    {2, 4},    {4, 4},                               // doubled and swapped
           {90, 89},  {0, 89},   {1, 89},                              // many lost; a new start
           {200, 89}, {201, 89}, {202, 89}, {0, 89},  {1, 89}};        // 199 ahead or 57 behind: a new start
  int64_t sent_ns = now();
  bool stalled = false;  // a pause of the machine is a silence of the peer: nothing can be said then
  for (size_t i = 0; i < sizeof t / sizeof *t && !stalled; i++) {
    send_seq(peer, t[i].seq);
    stalled = now() - sent_ns > 200000000;
    sent_ns = now();
    CHECK(poll_all(&a, f, 1) == 1 && f[0].id == 0x123, "sequence %d", t[i].seq);
    CHECK(stalled || a.stats(a.self).lost == t[i].lost, "after %d: lost %llu, not %u", t[i].seq,
          (unsigned long long)a.stats(a.self).lost, t[i].lost);
  }
  if (stalled)
    SKIP("this machine stood still for 0.2 s; run it again when less else runs here");
  nanosleep(&(struct timespec){.tv_nsec = 270000000}, NULL);
  send_seq(peer, 77);
  CHECK(poll_all(&a, f, 1) == 1 && (stalled || a.stats(a.self).lost == 89),
        "after a silence nothing is known");
  a.poll(a.self, now(), f, 300);  // with room left it looks at what strangers sent
  gv_driver_stats s = a.stats(a.self);
  CHECK(s.foreign == 1 && s.bad == 3, "foreign %llu bad %llu", (unsigned long long)s.foreign,
        (unsigned long long)s.bad);
  for (int i = 0; i < 200; i++)
    send_seq(other, i);
  CHECK(a.poll(a.self, now(), f, 300) == 0 && a.stats(a.self).foreign <= 65,
        "one poll reads a bounded number of datagrams");
  char told[3][400], from[40];
  snprintf(from, sizeof from, "127.0.0.1:%d", (int)raw_port(other));
  for (int i = 0; i < 3; i++)
    CHECK(a.tell(a.self, now(), told[i], sizeof told[i]), "trouble %d is not told", i);
  CHECK(strstr(told[0], from) && strstr(told[1], "version 2") && strstr(told[2], "-m 9000"), "%s | %s | %s",
        told[0], told[1], told[2]);
  CHECK(!a.tell(a.self, now(), told[0], sizeof told[0]), "told twice: %s", told[0]);
  close(peer);
  close(other);
  a.close(a.self);
}

// Sequence 0 is a new start where more than 16 are missing before it, else a gap over the wrap; up to 16
// behind is doubled or swapped, more is a new start.
static void test_udp_restart_gap(void) {
  gv_driver a, b;
  if (!open_pair(&a, &b))
    return;
  b.close(b.self);
  const int peer = raw_socket(port_b, port_a);
  static const struct {
    int seq;
    unsigned lost;
  } t[] = {{238, 0},  {0, 0},             // 17 missing: anew
           {239, 0},  {0, 16},            // 18 behind: anew; 16 missing: lost
           {241, 16}, {1, 16},  {2, 16},  // 16 behind: swapped, and the count goes on where it was
           {242, 16}, {243, 16}};         // 17 behind: anew
  gv_frame f[4];
  int64_t sent_ns = now();
  bool stalled = false;
  for (size_t i = 0; i < sizeof t / sizeof *t && !stalled; i++) {
    send_seq(peer, t[i].seq);
    stalled = now() - sent_ns > 200000000;
    sent_ns = now();
    CHECK(poll_all(&a, f, 1) == 1, "sequence %d", t[i].seq);
    const unsigned lost = (unsigned)a.stats(a.self).lost;
    CHECK(stalled || lost == t[i].lost, "%zu: after %d: lost %u, not %u", i, t[i].seq, lost, t[i].lost);
  }
  if (stalled)
    SKIP("this machine stood still for 0.2 s; run it again when less else runs here");
  close(peer);
  a.close(a.self);
}

// A classic command has 4 bits of counter: joined, it counts modulo 256 as it was sent, over gaps of up
// to 8; what lies behind stays behind.
static void test_classic_counter_wraps(void) {
  gv_classic_join join = {.number = 0};
  int counter = 0;
  for (int i = 0; i < 600; i++) {
    counter += i == 0 ? 0 : 1 + i % 8;
    gv_command_msg command = {.counter = (uint8_t)counter, .flags = GV_COMMAND_ENABLE}, back;
    gv_frame fd, part[GV_CLASSIC_FRAMES], whole;
    gv_fcu_pack_command(&command, &fd);
    CHECK(gv_classic_split(&fd, part) == 1 && gv_classic_take(&join, &part[0], &whole) == 1, "command %d", i);
    CHECK(gv_fcu_unpack_command(&whole, &back) == GV_FCU_OK && back.counter == (uint8_t)counter, "%u, not %u",
          back.counter, (uint8_t)counter);
    for (int behind = 0; behind < 8 && counter >= 8; behind++) {
      command.counter = (uint8_t)(counter - behind);
      gv_fcu_pack_command(&command, &fd);
      gv_classic_split(&fd, part);
      gv_classic_take(&join, &part[0], &whole);
      CHECK(gv_fcu_unpack_command(&whole, &back) == GV_FCU_OK && back.counter == (uint8_t)(counter - behind),
            "%d behind", behind);
    }
  }
}

static void test_udp_over_ipv6(void) {
  gv_driver a, b;
  char url[100], err[300];
  int port = 20000 + getpid() % 20000;
  snprintf(url, sizeof url, "udp://[::1]:%d?listen=%d", port, port + 1);
  if (gv_udp_open(url, &a, err, sizeof err)) {
    SKIP("this machine has no IPv6 on the loopback");
    return;
  }
  snprintf(url, sizeof url, "udp://[::1]:%d?listen=%d", port + 1, port);
  CHECK(gv_udp_open(url, &b, err, sizeof err) == 0, "%s", err);
  gv_frame f = random_frame(), back;
  CHECK(a.send(a.self, &f, 1) == 0 && poll_all(&b, &back, 1) == 1 && same_frame(&f, &back), "one way");
  CHECK(b.send(b.self, &f, 1) == 0 && poll_all(&a, &back, 1) == 1 && same_frame(&f, &back), "the other");
  a.close(a.self);
  b.close(b.self);
}

static void test_udp_urls(void) {
  static const char *bad[] = {"udp:",
                              "udp://",
                              "udp://:1?listen=2",
                              "udp://h",
                              "udp://h:0?listen=2",
                              "udp://h:70000?listen=2",
                              "udp://h:1",
                              "udp://h:1?listen=",
                              "udp://h:1?listen=0",
                              "udp://h:1?listen=2&x=3",
                              "udp://h:1?listen=2x",
                              "tcp://h:1?listen=2",
                              "udp://[::1:1?listen=2",
                              "udp://h:-1?listen=2"};
  gv_driver d;
  for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
    char err[400] = "";
    CHECK(gv_udp_open(bad[i], &d, err, sizeof err) < 0 && strstr(err, bad[i]) && strstr(err, "; ") &&
              !strchr(err, '\n'),
          "%s: %s", bad[i], err);
  }
}

int main(void) {
  RUN(test_crc_check_value);
  RUN(test_messages_survive_the_wire);
  RUN(test_pose_survives_the_wire);
  RUN(test_out_of_range_is_clamped);
  RUN(test_refusals);
  RUN(test_cannelloni_golden_vector);
  RUN(test_cannelloni_round_trip);
  RUN(test_cannelloni_damage);
  RUN(test_cannelloni_fuzz);
  RUN(test_log_lines_as_candump_writes_them);
  RUN(test_log_round_trip);
  RUN(test_log_accepts_and_refuses);
  RUN(test_can_utils_read_our_logs);
  RUN(test_trace_plays_its_frames);
  RUN(test_a_recording_ends_with_its_last_step);
  RUN(test_trace_cut_by_a_crash);
  RUN(test_trace_refusals);
  RUN(test_trace_small_steps_back);
  RUN(test_udp_both_ways);
  RUN(test_udp_without_a_peer);
  RUN(test_udp_classic_can_is_joined_and_answered_in_kind);
  RUN(test_classic_messages_cut_by_a_stall_are_joined);
  RUN(test_udp_jumbo_datagrams);
  RUN(test_udp_foreign_flood_starves_nobody);
  RUN(test_udp_foreign_broken_and_lost);
  RUN(test_udp_restart_gap);
  RUN(test_classic_counter_wraps);
  RUN(test_udp_over_ipv6);
  RUN(test_udp_urls);
  return check_done();
}
