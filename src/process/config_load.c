// SPDX-License-Identifier: BSD-3-Clause
// Reads the daemon's configuration and the glove's calibration. Main thread, before the loop starts.
#include "config_load.h"

#include <stdio.h>
#include <string.h>

void gv_settings_default(gv_settings *out) {
  memset(out, 0, sizeof *out);
  out->engine = gv_config_default();
  out->limiter = gv_limiter_config_default();
  out->safety = gv_safety_config_default();
  snprintf(out->scene, sizeof out->scene, "data/scenes/box.scene");
  snprintf(out->fcu, sizeof out->fcu, "sim:");
  snprintf(out->lcm, sizeof out->lcm, "udpm://239.255.76.67:7667?ttl=0");
  out->rate_hz = 1000.0;
  out->cpu = -1;
  out->rt_priority = 80;
  out->mlock = true;
}

int gv_settings_load(const char *path, gv_settings *out, char *err, size_t err_size) {
  gv_settings_default(out);
  snprintf(err, err_size, "%s: configuration files are not built yet; leave --config out", path);
  return -1;
}

int gv_calibration_load(const char *path, gv_calibration *out, char *err, size_t err_size) {
  (void)out;
  snprintf(err, err_size, "%s: calibration files are not built yet; leave 'calibration' out", path);
  return -1;
}
