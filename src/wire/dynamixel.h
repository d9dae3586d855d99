// SPDX-License-Identifier: BSD-3-Clause
// Packets of Dynamixel servos, protocol 2.0: instructions out, status packets in, and the other way round for
// the simulated ones. Pure; any thread.
//
// Source: ROBOTIS e-Manual, "DYNAMIXEL Protocol 2.0" (packets, sync read, sync write, byte stuffing, CRC),
// and the control tables of XL330-M288-T and XC330-M288-T.
//
//   FF FF FD 00  id  length, uint16: bytes from here on  instruction  parameters  CRC, uint16
// A status packet has the instruction 55 and an error byte in front of its parameters. Where FF FF FD stands
// in instruction and parameters, FD follows it once more. CRC-16 with polynomial 8005, start 0, no
// reflection, over all before it.
#ifndef WIRE_DYNAMIXEL_H
#define WIRE_DYNAMIXEL_H

#include <stdbool.h>
#include <stdint.h>

enum { GV_DYNAMIXEL_BYTES = 96, GV_DYNAMIXEL_PARAMETERS = 64, GV_DYNAMIXEL_ALL = 0xFE };

// Instructions, and addresses of the control table with their size in bytes.
enum {
  GV_DYNAMIXEL_READ = 0x02,
  GV_DYNAMIXEL_WRITE = 0x03,
  GV_DYNAMIXEL_STATUS = 0x55,
  GV_DYNAMIXEL_SYNC_READ = 0x82,
  GV_DYNAMIXEL_SYNC_WRITE = 0x83
};
enum {
  GV_DYNAMIXEL_RETURN_DELAY = 9,     // 1, kept when switched off: 2 us
  GV_DYNAMIXEL_MODE = 11,            // 1, kept: 5 is position with a bound on the current
  GV_DYNAMIXEL_TORQUE = 64,          // 1: on
  GV_DYNAMIXEL_STATUS_LEVEL = 68,    // 1: 1 answers reads alone
  GV_DYNAMIXEL_WATCHDOG = 98,        // 1: 20 ms, 0 off, 255 it has stopped the servo
  GV_DYNAMIXEL_GOAL_CURRENT = 102,   // 2: mA
  GV_DYNAMIXEL_GOAL_POSITION = 116,  // 4: 4096 a turn
  GV_DYNAMIXEL_POSITION = 132        // 4
};
enum { GV_DYNAMIXEL_MODE_CURRENT_POSITION = 5, GV_DYNAMIXEL_TURN = 4096 };

typedef struct gv_dynamixel_packet {
  uint8_t id, instruction, error;  // error: of a status packet
  int count;
  uint8_t parameter[GV_DYNAMIXEL_PARAMETERS];  // without the stuffing
} gv_dynamixel_packet;

uint16_t gv_dynamixel_crc(const uint8_t *byte, int count);
// The packet's bytes; returns their number.
int gv_dynamixel_encode(const gv_dynamixel_packet *packet, uint8_t out[GV_DYNAMIXEL_BYTES]);
// For gv_framer_push; `format` is not used. Any whole packet of at most GV_DYNAMIXEL_BYTES whose CRC is
// right.
int gv_dynamixel_scan(const void *format, const uint8_t *byte, int count);
// A packet that gv_dynamixel_scan found.
void gv_dynamixel_decode(const uint8_t *byte, int length, gv_dynamixel_packet *out);

// Packets to be encoded. Values are little-endian, `size` 1, 2 or 4 bytes; sync: servos 0 to count - 1.
gv_dynamixel_packet gv_dynamixel_read(uint8_t id, int address, int size);
gv_dynamixel_packet gv_dynamixel_write(uint8_t id, int address, int size, uint32_t value);
gv_dynamixel_packet gv_dynamixel_sync_read(int count, int address, int size);
gv_dynamixel_packet gv_dynamixel_sync_write(int count, int address, int size, const uint32_t *value);
uint32_t gv_dynamixel_value(const uint8_t *byte, int size);

#endif
