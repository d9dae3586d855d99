// SPDX-License-Identifier: BSD-3-Clause
// Records of a serial device for its driver (serial_source.h). serial_source_next runs in the real-time thread.
#include "drivers/serial_source.h"

#include <stdlib.h>

enum { BITS_PER_BYTE = 10 };   // start, eight, stop

bool serial_source_ready(serial_source *s, bool *may_read) {
  if (s->next < s->count) return true;
  if (!*may_read) return false;
  *may_read = false;
  s->next = 0;
  s->count = serial_port_read(&s->port, s->chunk, SERIAL_CHUNK, &s->setting);
  return s->count > 0;
}

int serial_source_next(serial_source *s, framer_scan scan, const void *format, uint32_t *out_age_us) {
  int length = 0;
  while (length == 0 && s->next < s->count) length = framer_push(&s->framer, s->chunk[s->next++], scan, format);
  if (length == 0) return 0;
  serial_port_alive(&s->port, s->framer.records);
  *out_age_us = (uint32_t)((int64_t)(length + s->count - s->next) * BITS_PER_BYTE * 1000000 / s->port.baud);
  return length;
}

int serial_source_open(serial_source *s, int (*set_up)(void *self, int fd), void *self) {
  char why[256];
  s->port.path = s->url.device;
  s->port.set_up = set_up;
  s->port.self = self;
  if (serial_port_open(&s->port, why, sizeof why) == 0) return 0;
  return serial_url_fail(&s->url, "%s", why);
}

int serial_source_send(void *self, const gv_frame *frame, int count) {
  (void)self;
  (void)frame;
  (void)count;
  return 0;
}

bool serial_source_ended(void *self) {
  (void)self;
  return false;
}

int serial_source_descriptor(void *self) { return atomic_load(&((serial_source *)self)->port.fd); }

gv_driver_stats serial_source_stats(void *self) {
  serial_source *s = self;
  const unsigned up = atomic_load(&s->port.fd) >= 0, connections = atomic_load(&s->port.connections);
  return (gv_driver_stats){.rx = s->rx, .bad = s->framer.bad_runs, .link_downs = connections > up ? connections - up : 0};
}

void serial_source_close(void *self) {
  serial_source *s = self;
  serial_port_close(&s->port);
  free(s);
}

gv_serial_report gv_serial_report_of(const gv_driver *serial) {
  serial_source *s = serial->self;
  gv_serial_report r = {.connected = atomic_load(&s->port.fd) >= 0, .connections = atomic_load(&s->port.connections),
                        .records = s->framer.records, .bad_bytes = s->framer.bad_bytes, .bad_runs = s->framer.bad_runs,
                        .sensors = atomic_load(&s->sensors), .calibrated = atomic_load(&s->calibrated)};
  for (int i = 0; i < GV_SENSORS; i++) {
    r.offset[i] = atomic_load(&s->offset[i]);
    r.gain[i] = atomic_load(&s->gain[i]);
  }
  return r;
}
