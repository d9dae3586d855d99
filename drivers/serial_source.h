// SPDX-License-Identifier: BSD-3-Clause
// What the drivers of serial devices share: port, bytes read, the window over them, and the counts.
#ifndef DRIVERS_SERIAL_SOURCE_H
#define DRIVERS_SERIAL_SOURCE_H

#include "wire/framer.h"
#include "gloved/drivers.h"
#include "drivers/serial_port.h"
#include "drivers/serial_url.h"

enum { SERIAL_CHUNK = 512 };  // bytes of one read(): 44 ms at 115200 baud

// For the user, of a device whose bytes never become records: what was expected, and what to try.
typedef struct serial_words {
  const char *name, *expected, *attempt;
} serial_words;

typedef struct serial_source {
  serial_port port;
  serial_url url;
  framer framer;
  int setting;  // of the connection that the bytes came from
  uint8_t chunk[SERIAL_CHUNK];
  int next, count;  // within chunk
  uint64_t rx;      // frames handed out
  // What a glove said of itself; written by the keeper.
  atomic_int sensors;
  atomic_bool calibrated;
  _Atomic uint8_t offset[GV_SENSORS], gain[GV_SENSORS];
  // What there is to tell. Any thread: bytes read so far, the newest eight of them, why set_up
  // gave up last (a constant text).
  const serial_words *words;
  atomic_ulong bytes;
  _Atomic uint64_t newest;
  _Atomic(const char *) gave_up;
  // The thread that asks: records and bytes when the last record came, and when that was; it was told.
  unsigned long told_records, told_bytes;
  int64_t record_ns;
  bool told;
} serial_source;

// Whether there are bytes; reads from the line at most once for each *may_read.
bool gv_serial_source_ready(serial_source *s, bool *may_read);
// Takes the next record among them. Returns its length (it stands at s->framer.byte) or 0: the bytes are used
// up. out_age_us: what the line took for it and for the bytes behind it.
int gv_serial_source_next(serial_source *s, framer_scan scan, const void *format, uint32_t *out_age_us);
// What set_up returns where the device does not do as it should, and why: a constant text "what; what to do".
int gv_serial_source_give_up(serial_source *s, const char *why);
// Opens the port of s->url. 0, or negative with one line in the URL's err.
int gv_serial_source_open(serial_source *s, int (*set_up)(void *self, int fd), void *self);

// Entries of the driver table that are the same for all; `self` starts with a serial_source.
int gv_serial_source_send(void *self, const gv_frame *frame, int count);
bool gv_serial_source_ended(void *self);
gv_driver_stats gv_serial_source_stats(void *self);
int gv_serial_source_descriptor(void *self);
// Two seconds without a record: what arrives, what was expected, what to try; once, until records come.
bool gv_serial_source_tell(void *self, int64_t now_ns, char *out, size_t size);
void gv_serial_source_close(void *self);

#endif
