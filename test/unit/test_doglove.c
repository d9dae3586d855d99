// SPDX-License-Identifier: BSD-3-Clause
// The DOGlove's two codecs against bytes that others wrote: Dynamixel packets as the maker's
// e-Manual prints them ("DYNAMIXEL Protocol 2.0", the examples of each instruction), and blocks laid
// out here after the firmware's main.c.
#include <string.h>

#include "gloved/channel.h"
#include "support/check.h"
#include "wire/doglove.h"
#include "wire/dynamixel.h"
#include "wire/framer.h"

// ---- Dynamixel, e-Manual --------------------------------------------------------------------------

static void is_encoded_as(const char *name, gv_dynamixel_packet packet, const uint8_t *manual, int count) {
  uint8_t byte[GV_DYNAMIXEL_BYTES];
  const int n = gv_dynamixel_encode(&packet, byte);
  CHECK(n == count && memcmp(byte, manual, (size_t)count) == 0, "%s: %d bytes, not %d, or others", name, n,
        count);
  CHECK(gv_dynamixel_scan(NULL, manual, count) == count, "%s is not taken", name);
  for (int i = 0; i < count; i++)
    CHECK(gv_dynamixel_scan(NULL, manual, i) == 0, "%s: decided after %d bytes", name, i);
}

static void test_instructions_of_the_manual(void) {
  static const uint8_t read[] = {0xFF, 0xFF, 0xFD, 0, 1, 7, 0, 2, 0x84, 0, 4, 0, 0x1D, 0x15};
  static const uint8_t write[] = {0xFF, 0xFF, 0xFD, 0, 1, 9, 0, 3, 0x74, 0, 0, 2, 0, 0, 0xCA, 0x89};
  is_encoded_as("read", gv_dynamixel_read(1, GV_DYNAMIXEL_POSITION, 4), read, sizeof read);
  is_encoded_as("write", gv_dynamixel_write(1, GV_DYNAMIXEL_GOAL_POSITION, 4, 512), write, sizeof write);
  // The manual's servos are 1 and 2, ours 0 to 4: the packets are put together here.
  static const uint8_t sync_read[] = {0xFF, 0xFF, 0xFD, 0, 0xFE, 9, 0, 0x82, 0x84, 0, 4, 0, 1, 2, 0xCE, 0xFA};
  static const uint8_t sync_write[] = {0xFF, 0xFF, 0xFD, 0, 0xFE, 0x11, 0,    0x83, 0x74, 0, 4,    0,
                                       1,    0x96, 0,    0, 0,    2,    0xAA, 0,    0,    0, 0x82, 0x87};
  gv_dynamixel_packet reading = gv_dynamixel_sync_read(2, GV_DYNAMIXEL_POSITION, 4);
  gv_dynamixel_packet writing = gv_dynamixel_sync_write(2, GV_DYNAMIXEL_GOAL_POSITION, 4,
                                                        (const uint32_t[]){150, 170});
  reading.parameter[4] = 1;
  reading.parameter[5] = 2;
  writing.parameter[4] = 1;
  writing.parameter[9] = 2;
  is_encoded_as("sync read", reading, sync_read, sizeof sync_read);
  is_encoded_as("sync write", writing, sync_write, sizeof sync_write);
}

static void test_status_packets_of_the_manual(void) {
  static const uint8_t first[] = {0xFF, 0xFF, 0xFD, 0, 1, 8, 0, 0x55, 0, 0xA6, 0, 0, 0, 0x8C, 0xC0};
  static const uint8_t second[] = {0xFF, 0xFF, 0xFD, 0, 2, 8, 0, 0x55, 0, 0x1F, 8, 0, 0, 0xBA, 0xBE};
  gv_dynamixel_packet p;
  gv_dynamixel_decode(first, sizeof first, &p);
  CHECK(p.id == 1 && p.instruction == GV_DYNAMIXEL_STATUS && p.error == 0 && p.count == 4, "count %d",
        p.count);
  CHECK(gv_dynamixel_value(p.parameter, 4) == 166, "position %u", gv_dynamixel_value(p.parameter, 4));
  gv_dynamixel_decode(second, sizeof second, &p);
  CHECK(p.id == 2 && gv_dynamixel_value(p.parameter, 4) == 2079, "position %u",
        gv_dynamixel_value(p.parameter, 4));
  is_encoded_as("status", p, second, sizeof second);
}

// "If FF FF FD already exists, add a FD": in parameters that happen to look like a header.
static void test_stuffing(void) {
  gv_dynamixel_packet p = gv_dynamixel_write(3, GV_DYNAMIXEL_GOAL_POSITION, 4, 0x00FDFFFF);
  gv_dynamixel_packet back;
  uint8_t byte[GV_DYNAMIXEL_BYTES];
  const int n = gv_dynamixel_encode(&p, byte);
  CHECK(n == 17 && byte[10] == 0xFF && byte[12] == 0xFD && byte[13] == 0xFD && byte[5] == 10, "%d bytes", n);
  CHECK(gv_dynamixel_scan(NULL, byte, n) == n, "not taken");
  gv_dynamixel_decode(byte, n, &back);
  CHECK(back.count == 6 && memcmp(back.parameter, p.parameter, 6) == 0, "the stuffing stays");
}

static void test_a_changed_byte_is_no_packet(void) {
  uint8_t byte[GV_DYNAMIXEL_BYTES];
  gv_dynamixel_packet p = gv_dynamixel_sync_write(5, GV_DYNAMIXEL_GOAL_CURRENT, 2,
                                                  (const uint32_t[]){1, 2, 3, 4, 350});
  const int n = gv_dynamixel_encode(&p, byte);
  for (int i = 0; i < n; i++)
    for (int bit = 0; bit < 8; bit++) {
      byte[i] ^= (uint8_t)(1 << bit);
      CHECK(gv_dynamixel_scan(NULL, byte, n) != n, "bit %d of byte %d is not looked at", bit, i);
      byte[i] ^= (uint8_t)(1 << bit);
    }
}

// ---- blocks, main.c -------------------------------------------------------------------------------

static void put_word(uint8_t *at, uint32_t value) {
  for (int i = 0; i < 4; i++)
    at[i] = (uint8_t)(value >> (8 * i));
}

// data[0] = 0x55AA, data[1] the reference, data[2] to data[17] the encoders, data[18] = sum <<
// 16 | time; as it lies in memory.
static void lay_out(uint8_t out[76], uint32_t reference_uv, const int32_t encoder[16], uint16_t time) {
  uint16_t sum = (uint16_t)reference_uv;
  put_word(out, 0x55AA);
  put_word(out + 4, reference_uv);
  for (int i = 0; i < 16; i++) {
    put_word(out + 8 + 4 * i, (uint32_t)encoder[i]);
    sum = (uint16_t)(sum + (uint16_t)encoder[i]);
  }
  put_word(out + 72, (uint32_t)sum << 16 | time);
}

static void test_a_block_of_the_firmware(void) {
  // volts = value 5 / 0x7FFFFF; a quarter of 3.2 V is 90 degrees: 0.8 / 5 * 0x7FFFFF = 1342177.
  int32_t encoder[16] = {1342177, 2684354, -1, 0};
  uint8_t byte[76];
  gv_doglove_block block;
  encoder[15] = 4026531;
  lay_out(byte, 3200000, encoder, 54321);
  CHECK(gv_doglove_scan(NULL, byte, 76) == 76, "not taken");
  for (int i = 0; i < 76; i++)
    CHECK(gv_doglove_scan(NULL, byte, i) == 0, "decided after %d bytes", i);
  gv_doglove_decode(byte, &block);
  CHECK_NEAR(block.encoder_deg[0], 90, 1e-4);
  CHECK_NEAR(block.encoder_deg[1], 180, 1e-4);
  CHECK_NEAR(block.encoder_deg[2], 0, 1e-3);
  CHECK_NEAR(block.encoder_deg[15], 270, 1e-4);
  CHECK(block.time_ms == 54321, "%u", block.time_ms);
  byte[40] ^= 1;
  CHECK(gv_doglove_scan(NULL, byte, 76) == -1, "the sum is not looked at");
  lay_out(byte, 0, encoder, 0);
  CHECK(gv_doglove_scan(NULL, byte, 76) == -1, "a reference of 0 V is divided by");
}

static void test_blocks_behind_garbage(void) {
  const int32_t encoder[16] = {0x0055AA, 0x55AA0000};  // what looks like a header within
  uint8_t byte[76];
  framer f = {.count = 0};
  int records = 0;
  lay_out(byte, 3300000, encoder, 7);
  for (int i = 0; i < 200; i++)
    gv_framer_push(&f, (uint8_t)(i % 3 ? 0xAA : 0x55), gv_doglove_scan, NULL);
  for (int round = 0; round < 3; round++)
    for (int i = round == 1 ? 30 : 0; i < 76; i++)
      records += gv_framer_push(&f, byte[i], gv_doglove_scan, NULL) > 0;
  CHECK(records == 2, "%d of two whole blocks", records);
}

// Zeros and signs of udp_receiver.py; flexion is negative in its model (ranges of DOGlove-v3.xml).
static void test_joints_of_the_published_model(void) {
  double encoder[16] = {90, 270, 180, 270, 90, 270, 180, 90, 270, 180, 90, 270, 180, 90, 270, 180};
  double servo[5] = {182.2, 165.2, 150.29, 151.44, 145.9};
  double angle[GV_SENSORS];
  double encoder_back[16];
  double servo_back[5];
  gv_doglove_angles(encoder, servo, angle);
  for (int i = 0; i < GV_SENSORS; i++)
    CHECK_NEAR(angle[i], 0, 1e-12);
  encoder[4] = 90 + 40;   // index tip: -1 * (raw - 90) = -40, bent by 40
  encoder[5] = 270 - 80;  // +1 * (raw - 270) = -80
  servo[1] += 60;         // -1 * (raw - 165.2) = -60
  encoder[6] = 180 - 10;  // split -1 * (raw - 180) = +10: towards the thumb
  gv_doglove_angles(encoder, servo, angle);
  CHECK_NEAR(angle[GV_INDEX_DIJ], 40 * GV_PI / 180, 1e-12);
  CHECK_NEAR(angle[GV_INDEX_PIJ], 80 * GV_PI / 180, 1e-12);
  CHECK_NEAR(angle[GV_INDEX_MPJ], 60 * GV_PI / 180, 1e-12);
  CHECK_NEAR(angle[GV_MIDDLE_INDEX_ABDUCTION], 10 * GV_PI / 180, 1e-12);
  gv_doglove_encoders(angle, encoder_back, servo_back);
  for (int i = 0; i < 16; i++)
    CHECK_NEAR(encoder_back[i], encoder[i], 1e-9);
  for (int i = 0; i < 5; i++)
    CHECK_NEAR(servo_back[i], servo[i], 1e-9);
}

static void test_the_current_follows_the_tension(void) {
  const gv_channel *c = gv_channel_of(GV_CHANNEL_DOGLOVE);
  CHECK(gv_channel_counts(c, 0) == 0 && gv_channel_counts(c, NAN) == 0 &&
            gv_channel_counts(c, 1e9) == c->counts,
        "bounds");
  CHECK(gv_channel_counts(c, 1.65) == 350 && c->fingers == 5, "%d mA at 1.65 N", gv_channel_counts(c, 1.65));
}

int main(void) {
  RUN(test_instructions_of_the_manual);
  RUN(test_status_packets_of_the_manual);
  RUN(test_stuffing);
  RUN(test_a_changed_byte_is_no_packet);
  RUN(test_a_block_of_the_firmware);
  RUN(test_blocks_behind_garbage);
  RUN(test_joints_of_the_published_model);
  RUN(test_the_current_follows_the_tension);
  return check_done();
}
