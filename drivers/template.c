// SPDX-License-Identifier: BSD-3-Clause
// The smallest driver that does all that a driver must (doc/writing-a-driver.md): copy it, put your
// device where the two functions of the made-up one are, and let test/unit/test_template.c pass. poll
// and send run in the real-time thread.
//
// What every driver promises: a counter that goes up by one with each frame of an identifier; a stamp that
// is never in the future; an age that says how long before it the device measured; zero on any doubt about a
// command, and zero when none came for 5 ms; zero at the end. Where the device's library can block, call it
// in a thread of your own (serial_port.c has one).
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "drivers/template.h"
#include "gloved/fcu.h"

static const int64_t watchdog_ns = 5000000, sample_every_ns = 10000000;

typedef struct template_driver {
  gv_template_device *device;
  gv_driver_stats stats;
  uint8_t counter;
  int64_t now_ns;  // of the last poll
  int64_t next_sample_ns;
  int64_t command_ns;  // when the newest good command came
  bool pulling;
} template_driver;

// ---- the device: here it is a structure in memory ---------------------------------------------------

// The newest measurement. False: none; then no frame goes out, and gloved lets go by itself.
static bool read_device(template_driver *d, uint16_t out_raw[GV_SENSORS], bool *out_dead_man,
                        uint32_t *out_age_us) {
  memcpy(out_raw, d->device->raw, sizeof d->device->raw);
  *out_dead_man = d->device->dead_man;
  *out_age_us = d->device->age_us;
  return d->device->connected;
}

static void write_device(template_driver *d, const double tension_n[GV_FINGERS]) {
  memcpy(d->device->tension_n, tension_n, sizeof d->device->tension_n);
  d->pulling = false;
  for (int i = 0; i < GV_FINGERS; i++)
    d->pulling |= tension_n[i] > 0.0;
}

// ---- frames -----------------------------------------------------------------------------------------

static void let_go(template_driver *d) {
  static const double zero[GV_FINGERS];
  write_device(d, zero);
}

static bool make_frame(template_driver *d, int64_t now_ns, gv_frame *out) {
  gv_glove_msg msg = {.stamp_us = (uint32_t)(now_ns / 1000)};
  bool dead_man;
  if (!read_device(d, msg.raw, &dead_man, &msg.age_us))
    return false;
  msg.counter = d->counter++;
  msg.flags = dead_man ? GV_GLOVE_DEAD_MAN : 0;
  gv_fcu_pack_glove(&msg, out);
  out->stamp_ns = now_ns;
  return true;
}

static int poll_template(void *self, int64_t now_ns, gv_frame *out, int max) {
  template_driver *d = self;
  d->now_ns = now_ns;
  if (d->pulling && now_ns - d->command_ns > watchdog_ns)
    let_go(d);
  if (max < 1 || now_ns < d->next_sample_ns || !make_frame(d, now_ns, out))
    return 0;
  d->next_sample_ns = now_ns + sample_every_ns;
  d->stats.rx++;
  return 1;
}

static int send_template(void *self, const gv_frame *frame, int count) {
  template_driver *d = self;
  for (int i = 0; i < count; i++) {
    gv_command_msg msg;
    if (frame[i].id != GV_ID_FORCE_COMMAND)
      continue;
    const bool sound = gv_fcu_unpack_command(&frame[i], &msg) == GV_FCU_OK;
    if (sound && msg.flags & GV_COMMAND_ENABLE)
      write_device(d, msg.tension_n);
    else
      let_go(d);
    if (sound)
      d->command_ns = d->now_ns;
    d->stats.tx++;
  }
  return 0;
}

static bool template_ended(void *self) { return (void)self, false; }
static gv_driver_stats template_stats(void *self) { return ((template_driver *)self)->stats; }

static void close_template(void *self) {
  let_go(self);
  free(self);
}

int gv_template_open(gv_template_device *device, gv_driver *out, char *err, size_t err_size) {
  template_driver *d = calloc(1, sizeof *d);
  if (!d) {
    snprintf(err, err_size, "out of memory; close other programs");
    return -1;
  }
  d->device = device;
  *out = (gv_driver){.self = d,
                     .poll = poll_template,
                     .send = send_template,
                     .ended = template_ended,
                     .stats = template_stats,
                     .close = close_template};
  return 0;
}
