// SPDX-License-Identifier: BSD-3-Clause
// The made-up device of template.c, so that its test can look at both ends.
#ifndef DRIVERS_TEMPLATE_H
#define DRIVERS_TEMPLATE_H

#include "gloved/drivers.h"

typedef struct gv_template_device {
  bool connected, dead_man;
  uint16_t raw[GV_SENSORS];
  uint32_t age_us;               // from measuring to reading
  double tension_n[GV_FINGERS];  // what pulls now
} gv_template_device;

int gv_template_open(gv_template_device *device, gv_driver *out, char *err, size_t err_size);

#endif
