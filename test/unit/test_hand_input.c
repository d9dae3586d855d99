// SPDX-License-Identifier: BSD-3-Clause
// The hand without a glove: datagrams as the header lays them out (laid out here by hand), what is refused, a
// motion that is bounded and the same twice, and the driver over the loopback: silence opens the switch, a
// second sender is not heard.
#include <arpa/inet.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "drivers/hand_motion.h"
#include "gloved/drivers.h"
#include "support/check.h"

static void put_float(uint8_t *out, float value) {
  memcpy(out, &value, 4);
}  // the test runs on little-endian machines

// 56 bytes after the layout in wire/hand_input.h: wrist (0.1, -0.2, 0.3), turned by 90 degrees about x, grips
// 0 to 1.
static void lay_out(uint8_t out[56], uint8_t flags, uint16_t number) {
  static const float value[12] = {0.1f, -0.2f, 0.3f,  0.70710678f, 0.70710678f, 0,
                                  0,    0,     0.25f, 0.5f,        0.75f,       1};
  memcpy(out, "GVHI\1", 5);
  out[5] = flags;
  out[6] = (uint8_t)number;
  out[7] = (uint8_t)(number >> 8);
  for (int i = 0; i < 12; i++)
    put_float(out + 8 + 4 * i, value[i]);
}

static void test_datagrams_are_as_the_header_says(void) {
  uint8_t byte[56], again[56];
  gv_hand_input in;
  lay_out(byte, GV_HAND_INPUT_DEAD_MAN, 0x1234);
  CHECK(gv_hand_input_unpack(byte, 56, &in), "refused");
  CHECK(in.flags == GV_HAND_INPUT_DEAD_MAN && in.number == 0x1234, "flags %d number %x", in.flags, in.number);
  CHECK_NEAR(in.T_world_wrist.p.y, -0.2, 1e-7);
  CHECK_NEAR(in.T_world_wrist.q.x, sqrt(0.5), 1e-7);
  CHECK_NEAR(in.grip[3], 0.75, 0);
  gv_hand_input_pack(&in, again);
  CHECK(memcmp(byte, again, 8) == 0 && memcmp(byte + 36, again + 36, 20) == 0, "packed otherwise");
}

static bool refuses(int at, float value) {
  uint8_t byte[56];
  gv_hand_input in;
  lay_out(byte, 0, 1);
  put_float(byte + at, value);
  return !gv_hand_input_unpack(byte, 56, &in);
}

static void test_what_cannot_be_is_refused(void) {
  uint8_t byte[57] = {0};
  gv_hand_input in;
  lay_out(byte, 0, 1);
  CHECK(!gv_hand_input_unpack(byte, 55, &in) && !gv_hand_input_unpack(byte, 57, &in),
        "another length is taken");
  for (int at = 0; at < 5; at++) {
    lay_out(byte, 0, 1);
    byte[at] ^= 1;
    CHECK(!gv_hand_input_unpack(byte, 56, &in), "magic or version is not looked at (%d)", at);
  }
  lay_out(byte, 0x80, 1);
  CHECK(!gv_hand_input_unpack(byte, 56, &in), "an unknown flag is taken");
  const float nan = (float)NAN;
  const float inf = (float)INFINITY;
  CHECK(refuses(8, nan) && refuses(12, 2.1f) && refuses(16, -inf), "a wrist that cannot be");
  CHECK(refuses(20, nan) && refuses(20, 0.0f) && refuses(24, 3.0f), "a rotation that is none");
  CHECK(refuses(36, -0.01f) && refuses(52, 1.01f) && refuses(44, nan), "a grip beyond 0 to 1");
}

static gv_sim_script way(void) {
  gv_sim_script s;
  char err[200];
  CHECK(gv_sim_script_load("data/scripts/hand.user", &s, err, sizeof err) == 0, "%s", err);
  return s;
}

// Targets jump across the room; the hand never moves faster than a hand, and arrives.
static void test_targets_may_jump(void) {
  static hand_motion m, twin;
  static gv_sim_script s;
  s = way();
  gv_hand_motion_init(&m, &s);
  gv_hand_input in = {.flags = GV_HAND_INPUT_DEAD_MAN,
                      .T_world_wrist = {gv_quat_axis_angle(gv_v3(0, 0, 1), 2.0), {0.5, 0.5, 0.5}},
                      .grip = {1, 1, 1, 1, 0.5}};
  gv_hand_motion_take(&m, &in);
  twin = m;
  double fastest_m_s = 0;
  double fastest_rad_s = 0;
  for (int ms = 0; ms < 3000; ms++) {
    const gv_sim_keyframe before = gv_hand_motion_now(&m);
    gv_hand_motion_step(&m);
    const gv_sim_keyframe now = gv_hand_motion_now(&m);
    fastest_m_s = fmax(fastest_m_s, 1e3 * gv_norm(gv_sub(now.T_world_wrist.p, before.T_world_wrist.p)));
    for (int i = 0; i < GV_SENSORS; i++)
      fastest_rad_s = fmax(fastest_rad_s, 1e3 * fabs(now.angle_rad[i] - before.angle_rad[i]));
    gv_hand_motion_step(&twin);
  }
  const gv_sim_keyframe now = gv_hand_motion_now(&m);
  printf("# at most %.2f m/s and %.1f rad/s a joint\n", fastest_m_s, fastest_rad_s);
  CHECK(fastest_m_s < 0.51 && fastest_rad_s < 10, "%g m/s, %g rad/s", fastest_m_s, fastest_rad_s);
  CHECK(gv_norm(gv_sub(now.T_world_wrist.p, in.T_world_wrist.p)) < 1e-4 && now.dead_man, "it did not arrive");
  CHECK_NEAR(now.angle_rad[GV_INDEX_PIJ], s.keyframe[2].angle_rad[GV_INDEX_PIJ], 1e-4);
  CHECK_NEAR(now.angle_rad[GV_LITTLE_PIJ], s.keyframe[1].angle_rad[GV_LITTLE_PIJ], 1e-4);
  CHECK(memcmp(&m, &twin, sizeof m) == 0, "not the same twice");
  in.flags = GV_HAND_INPUT_HOME;
  gv_hand_motion_take(&m, &in);
  for (int ms = 0; ms < 3000; ms++)
    gv_hand_motion_step(&m);
  CHECK(gv_norm(gv_sub(m.T_world_wrist.p, s.keyframe[0].T_world_wrist.p)) < 1e-4 && m.grip[0] < 1e-4 &&
            !m.dead_man,
        "not at home");
}

// ---- the driver -----------------------------------------------------------------------------------

enum { PORT = 28511 };
static gv_driver driver;
static int64_t now_ns;

static int sender(void) {
  const struct sockaddr_in to = {
    .sin_family = AF_INET, .sin_port = htons(PORT), .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
  const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK, 0);
  CHECK(connect(fd, (const struct sockaddr *)&to, sizeof to) == 0, "no socket");
  return fd;
}

static void send_to(int fd, uint8_t flags, uint16_t number) {
  uint8_t byte[56];
  lay_out(byte, flags, number);
  CHECK(send(fd, byte, sizeof byte, 0) == sizeof byte, "not sent");
}

// The flags of the newest answer, -1: none came.
static int answer_of(int fd) {
  uint8_t byte[128];
  gv_hand_output out;
  int flags = -1;
  ssize_t n;
  while ((n = recv(fd, byte, sizeof byte, 0)) > 0)
    if (gv_hand_output_unpack(byte, (size_t)n, &out))
      flags = out.flags;
  return flags;
}

// Polls for some milliseconds; returns how many GLOVE frames came, and whether the last had the dead-man
// switch held.
static int poll_ms(int ms, bool *out_held) {
  gv_frame frame[64];
  int gloves = 0;
  for (int i = 0; i < ms; i++) {
    now_ns += 1000000;
    const int n = driver.poll(driver.self, now_ns, frame, 64);
    for (int k = 0; k < n; k++) {
      gv_glove_msg msg;
      CHECK(frame[k].stamp_ns <= now_ns, "a stamp in the future");
      if (gv_fcu_unpack_glove(&frame[k], &msg) != GV_FCU_OK)
        continue;
      gloves++;
      *out_held = msg.flags & GV_GLOVE_DEAD_MAN;
    }
  }
  return gloves;
}

static void open_driver(void) {
  char err[300];
  now_ns = 5000000000;
  CHECK(gv_hand_input_open("hand:?listen=28511", GV_RIGHT, &driver, err, sizeof err) == 0, "%s", err);
}

static void test_silence_opens_the_switch(void) {
  bool held = true;
  open_driver();
  const int me = sender();
  CHECK(poll_ms(100, &held) >= 99 && !held, "the switch is held by nobody");
  send_to(me, GV_HAND_INPUT_DEAD_MAN, 1);
  poll_ms(100, &held);
  CHECK(held && answer_of(me) >= 0, "not taken");
  poll_ms(380, &held);
  CHECK(held, "let go too early");
  poll_ms(40, &held);
  CHECK(!held, "half a second of silence, and the switch is still held");
  close(me);
  driver.close(driver.self);
}

static void test_one_sender_at_a_time(void) {
  bool held = false;
  open_driver();
  const int me = sender();
  const int other = sender();
  send_to(me, GV_HAND_INPUT_DEAD_MAN, 7);
  poll_ms(5, &held);
  send_to(other, 0, 1);
  poll_ms(5, &held);
  CHECK(held && answer_of(other) & GV_HAND_OUTPUT_OTHER, "another sender opened the switch");
  send_to(me, 0, 6);
  poll_ms(5, &held);
  CHECK(held, "a datagram that was overtaken is taken");
  poll_ms(600, &held);
  send_to(other, GV_HAND_INPUT_DEAD_MAN, 2);
  poll_ms(5, &held);
  CHECK(held && !(answer_of(other) & GV_HAND_OUTPUT_OTHER), "the other one never gets the hand");
  CHECK(driver.stats(driver.self).foreign == 2, "%d", (int)driver.stats(driver.self).foreign);
  close(me);
  close(other);
  driver.close(driver.self);
}

static void test_what_is_wrong_is_told_once(void) {
  char said[300];
  bool held;
  open_driver();
  const int me = sender();
  CHECK(!driver.tell(driver.self, now_ns, said, sizeof said), "told at once: %s", said);
  CHECK(driver.tell(driver.self, now_ns + 2500000000, said, sizeof said) &&
            strstr(said, "gloved-hand --port 28511"),
        "%s", said);
  CHECK(!driver.tell(driver.self, now_ns + 5000000000, said, sizeof said), "told twice: %s", said);
  CHECK(send(me, "garbage", 7, 0) == 7, "not sent");
  poll_ms(2, &held);
  CHECK(driver.tell(driver.self, now_ns, said, sizeof said) && strstr(said, "no input of a hand"), "%s",
        said);
  CHECK(driver.stats(driver.self).bad == 1 && answer_of(me) == -1, "garbage was answered");
  close(me);
  driver.close(driver.self);
}

static void test_urls(void) {
  static const char *const wrong[] = {"hand:?listen=0", "hand:?listen=70000", "hand:?listen=",
                                      "hand:?port=1",   "hand:?listen=2x",    "hand:no.user"};
  char err[300];
  for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
    gv_driver none;
    CHECK(gv_hand_input_open(wrong[i], GV_RIGHT, &none, err, sizeof err) < 0 && strstr(err, "; "), "%s: %s",
          wrong[i], err);
  }
  open_driver();
  gv_driver second;
  CHECK(gv_hand_input_open("hand:?listen=28511", GV_RIGHT, &second, err, sizeof err) < 0 &&
            strstr(err, "give another"),
        "%s", err);
  driver.close(driver.self);
}

int main(void) {
  RUN(test_datagrams_are_as_the_header_says);
  RUN(test_what_cannot_be_is_refused);
  RUN(test_targets_may_jump);
  RUN(test_silence_opens_the_switch);
  RUN(test_one_sender_at_a_time);
  RUN(test_what_is_wrong_is_told_once);
  RUN(test_urls);
  return check_done();
}
