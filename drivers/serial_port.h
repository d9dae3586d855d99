// SPDX-License-Identifier: BSD-3-Clause
// A serial line that comes and goes, read from the real-time thread. Opening and closing a tty, and talking
// with a device until it streams, can block; so a thread of the port's own, the keeper, does these, and hands
// the descriptor over when data may flow:
//
//   keeper (ordinary)   open, set the line up, set_up(), hand over; then look every 20 ms: broken, or silent
//                       for SERIAL_SILENCE_MS? take the descriptor back, let_go(), close it, and begin again
//   real-time thread    gv_serial_port_read, gv_serial_port_write: one call that cannot block; an error (EIO:
//                       unplugged) gives the descriptor back
#ifndef DRIVERS_SERIAL_PORT_H
#define DRIVERS_SERIAL_PORT_H

#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum {
  SERIAL_BAUD = 115200,      // where nothing else is said
  SERIAL_SILENCE_MS = 1000,  // without a record: the device was reset, and has forgotten its set-up
  SERIAL_RETRY_MS = 200      // between two attempts to open or to set up
};

typedef struct serial_port {
  const char *path;  // the owner's, for as long as the port lives
  int baud;
  // Bring the device to stream its records; in the keeper; may block for a second, or until `stop`. What it
  // returns (0 or more) is handed to the reader; negative: no answer, try again.
  int (*set_up)(void *self, int fd);
  // For a device that exerts forces, otherwise null, both in the keeper: look every millisecond while the
  // real-time thread has the descriptor; let_go before it is closed, what is written has 0.2 s to leave.
  void (*look)(void *self, int fd, int64_t now_ms);
  void (*let_go)(void *self, int fd);
  void *self;
  pthread_t keeper;
  int first_fd;         // opened by gv_serial_port_open
  atomic_int fd;        // the reader's; -1: none
  atomic_bool reading;  // the reader is inside read() or write()
  atomic_bool stop;
  atomic_bool opened;       // the keeper has the line: it sets the device up, or watches
  atomic_int setting;       // what set_up returned
  atomic_ulong records;     // written by the reader: the device is alive
  atomic_uint connections;  // times that a device was handed over
} serial_port;

bool gv_serial_port_knows(int baud);
// Opens the line once, so that a wrong name is told at once, and starts the keeper; path, baud, set_up and
// self are filled in. 0, or negative with "what; what to do" in why.
int gv_serial_port_open(serial_port *port, char *why, size_t why_size);
void gv_serial_port_close(serial_port *port);
// Up to `size` bytes that are there, without waiting; out_setting as handed over with them. Real-time thread.
int gv_serial_port_read(serial_port *port, uint8_t *out, int size, int *out_setting);
// Writes what the line takes, without waiting: bytes, 0 where it is full, -1 where there
// is no line. Real-time thread.
int gv_serial_port_write(serial_port *port, const void *data, int size);
static inline void serial_port_alive(serial_port *port, uint64_t records) {
  atomic_store_explicit(&port->records, (unsigned long)records, memory_order_relaxed);
}

// For set_up: these wait up to timeout_ms. Write all of it: 0 or negative. Read what comes until nothing came
// for quiet_ms: the number of bytes.
int gv_serial_write(int fd, const void *data, size_t size, int timeout_ms);
int gv_serial_read(int fd, uint8_t *out, int size, int quiet_ms, int timeout_ms);

#endif
