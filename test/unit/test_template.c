// SPDX-License-Identifier: BSD-3-Clause
// What a driver must do (doc/writing-a-driver.md), asked of the template: whoever copies it copies this too.
#include "drivers/template.h"
#include "gloved/fcu.h"
#include "support/check.h"

enum { MS = 1000000 };

static gv_template_device device;
static gv_driver driver;
static int64_t now_ns;
static uint8_t command_counter;

static void start(void) {
  char err[200];
  device = (gv_template_device){.connected = true, .age_us = 2000};
  for (int i = 0; i < GV_SENSORS; i++)
    device.raw[i] = (uint16_t)(100 + i);
  now_ns = 0;
  command_counter = 0;
  CHECK(gv_template_open(&device, &driver, err, sizeof err) == 0, "%s", err);
}

static int poll_ms(int ms, gv_frame *out, int max) {
  int n = 0;
  for (int i = 0; i < ms; i++) {
    now_ns += MS;
    n += driver.poll(driver.self, now_ns, out + n, max - n);
  }
  return n;
}

static gv_frame command(double index_n, uint8_t flags) {
  gv_frame frame;
  const gv_command_msg msg = {
    .counter = command_counter++, .flags = flags, .tension_n = {0, index_n, 0, 0, 0}};
  gv_fcu_pack_command(&msg, &frame);
  return frame;
}

static void send(gv_frame frame) { driver.send(driver.self, &frame, 1); }

static void test_counters_stamps_and_ages(void) {
  gv_frame frame[64];
  start();
  const int n = poll_ms(200, frame, 64);
  CHECK(n >= 19, "%d frames", n);
  for (int i = 0; i < n; i++) {
    gv_glove_msg msg;
    CHECK(gv_fcu_unpack_glove(&frame[i], &msg) == GV_FCU_OK, "frame %d", i);
    CHECK(msg.counter == (uint8_t)i, "counter %d of frame %d", msg.counter, i);
    CHECK(frame[i].stamp_ns <= now_ns && (i == 0 || frame[i].stamp_ns > frame[i - 1].stamp_ns),
          "stamp of frame %d", i);
    CHECK(msg.age_us == 2000 && msg.raw[21] == 121, "age %u, sensor %d", msg.age_us, msg.raw[21]);
  }
  driver.close(driver.self);
}

static void test_a_device_that_is_away_sends_nothing(void) {
  gv_frame frame[64];
  start();
  device.connected = false;
  CHECK(poll_ms(100, frame, 64) == 0, "frames of a device that is away");
  device.connected = true;
  CHECK(poll_ms(20, frame, 64) >= 1, "none when it is back");
  driver.close(driver.self);
}

static void test_zero_on_doubt(void) {
  gv_frame frame[64];
  start();
  send(command(3.0, GV_COMMAND_ENABLE));
  CHECK_NEAR(device.tension_n[1], 3.0, 0.002);
  send(command(3.0, 0));
  CHECK(device.tension_n[1] == 0.0, "without ENABLE: %g N", device.tension_n[1]);
  send(command(3.0, GV_COMMAND_ENABLE));
  gv_frame broken = command(3.0, GV_COMMAND_ENABLE);
  broken.data[9] ^= 1;
  send(broken);
  CHECK(device.tension_n[1] == 0.0, "broken: %g N", device.tension_n[1]);
  poll_ms(1, frame, 64);
  send(command(3.0, GV_COMMAND_ENABLE));
  poll_ms(5, frame, 64);
  CHECK(device.tension_n[1] > 0.0, "5 ms are not too long");
  poll_ms(1, frame, 64);
  CHECK(device.tension_n[1] == 0.0, "6 ms without a command: %g N", device.tension_n[1]);
  send(command(3.0, GV_COMMAND_ENABLE));
  driver.close(driver.self);
  CHECK(device.tension_n[1] == 0.0, "closing: %g N", device.tension_n[1]);
}

int main(void) {
  RUN(test_counters_stamps_and_ages);
  RUN(test_a_device_that_is_away_sends_nothing);
  RUN(test_zero_on_doubt);
  return check_done();
}
