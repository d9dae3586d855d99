// SPDX-License-Identifier: BSD-3-Clause
// Records of a serial device for its driver (serial_source.h). gv_serial_source_next
// runs in the real-time thread.
#include "drivers/serial_source.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { BITS_PER_BYTE = 10 };                    // start, eight, stop
static const int64_t patience_ns = 2000000000;  // without a record, before the user is told
static const int64_t set_up_ns = 6000000000;    // the same while the first set-up goes on

// For the user's eyes: how many, and what the newest look like.
static void note_bytes(serial_source *s) {
  uint64_t newest = 0;
  const int n = s->count < (int)sizeof newest ? s->count : (int)sizeof newest;
  memcpy(&newest, s->chunk + s->count - n, (size_t)n);
  atomic_store_explicit(&s->newest, newest, memory_order_relaxed);
  atomic_fetch_add_explicit(&s->bytes, (unsigned long)s->count, memory_order_relaxed);
}

bool gv_serial_source_ready(serial_source *s, bool *may_read) {
  if (s->next < s->count)
    return true;
  if (!*may_read)
    return false;
  *may_read = false;
  s->next = 0;
  s->count = gv_serial_port_read(&s->port, s->chunk, SERIAL_CHUNK, &s->setting);
  if (s->count > 0)
    note_bytes(s);
  return s->count > 0;
}

int gv_serial_source_next(serial_source *s, framer_scan scan, const void *format, uint32_t *out_age_us) {
  int length = 0;
  while (length == 0 && s->next < s->count)
    length = gv_framer_push(&s->framer, s->chunk[s->next++], scan, format);
  if (length == 0)
    return 0;
  serial_port_alive(&s->port, s->framer.records);
  *out_age_us = (uint32_t)((int64_t)(length + s->count - s->next) * BITS_PER_BYTE * 1000000 / s->port.baud);
  return length;
}

int gv_serial_source_open(serial_source *s, int (*set_up)(void *self, int fd), void *self) {
  char why[256];
  s->port.path = s->url.device;
  s->port.set_up = set_up;
  s->port.self = self;
  if (gv_serial_port_open(&s->port, why, sizeof why) == 0)
    return 0;
  return gv_serial_url_fail(&s->url, "%s", why);
}

int gv_serial_source_give_up(serial_source *s, const char *why) {
  atomic_store(&s->gave_up, why);
  return -1;
}

// ---- what there is to tell ------------------------------------------------------------------------

static void tell_bytes(serial_source *s, unsigned long bytes, char *out, size_t size) {
  uint8_t newest[sizeof s->newest];
  char text[sizeof newest * 3 + 1];
  const uint64_t word = atomic_load(&s->newest);
  memcpy(newest, &word, sizeof newest);
  for (size_t i = 0; i < sizeof newest; i++)
    snprintf(text + 3 * i, 4, "%02x ", newest[i]);
  snprintf(out, size, "%s: %lu bytes came (the last: %s) but no record of the %s: expected is %s; %s",
           s->url.device, bytes, text, s->words->name, s->words->expected, s->words->attempt);
}

static void tell_silence(serial_source *s, unsigned long bytes, char *out, size_t size) {
  const char *gave_up = atomic_load(&s->gave_up);
  if (bytes > 0)
    tell_bytes(s, bytes, out, size);
  else if (gave_up)
    snprintf(out, size, "%s: the %s %s", s->url.device, s->words->name, gave_up);
  else if (!atomic_load(&s->port.opened))
    snprintf(out, size, "%s: the line is gone; plug the %s in", s->url.device, s->words->name);
  else
    snprintf(out, size, "%s: nothing comes from the %s; %s", s->url.device, s->words->name,
             s->words->attempt);
}

bool gv_serial_source_tell(void *self, int64_t now_ns, char *out, size_t size) {
  serial_source *s = self;
  const unsigned long records = atomic_load(&s->port.records);
  const unsigned long bytes = atomic_load(&s->bytes);
  if (records != s->told_records || s->record_ns == 0) {
    s->told_records = records;
    s->told_bytes = bytes;
    s->record_ns = now_ns;
    s->told = false;
  }
  const bool set_up = atomic_load(&s->port.connections) == 0 && atomic_load(&s->port.opened) &&
                      !atomic_load(&s->gave_up);
  if (s->told || now_ns - s->record_ns < (set_up ? set_up_ns : patience_ns))
    return false;
  tell_silence(s, bytes - s->told_bytes, out, size);
  return s->told = true;
}

int gv_serial_source_send(void *self, const gv_frame *frame, int count) {
  (void)self;
  (void)frame;
  (void)count;
  return 0;
}

bool gv_serial_source_ended(void *self) {
  (void)self;
  return false;
}

int gv_serial_source_descriptor(void *self) { return atomic_load(&((serial_source *)self)->port.fd); }

gv_driver_stats gv_serial_source_stats(void *self) {
  serial_source *s = self;
  const unsigned up = atomic_load(&s->port.fd) >= 0;
  const unsigned connections = atomic_load(&s->port.connections);
  return (gv_driver_stats){
    .rx = s->rx, .bad = s->framer.bad_runs, .link_downs = connections > up ? connections - up : 0};
}

void gv_serial_source_close(void *self) {
  serial_source *s = self;
  gv_serial_port_close(&s->port);
  free(s);
}

gv_serial_report gv_serial_report_of(const gv_driver *serial) {
  serial_source *s = serial->self;
  gv_serial_report r = {.connected = atomic_load(&s->port.fd) >= 0,
                        .connections = atomic_load(&s->port.connections),
                        .records = s->framer.records,
                        .bad_bytes = s->framer.bad_bytes,
                        .bad_runs = s->framer.bad_runs,
                        .sensors = atomic_load(&s->sensors),
                        .calibrated = atomic_load(&s->calibrated)};
  for (int i = 0; i < GV_SENSORS; i++) {
    r.offset[i] = atomic_load(&s->offset[i]);
    r.gain[i] = atomic_load(&s->gain[i]);
  }
  return r;
}
