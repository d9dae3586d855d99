// SPDX-License-Identifier: BSD-3-Clause
// The settings of the simulated device by name: ranges and both presets in one table. Set-up only.
//
// `real` imitates recordings of gloves and trackers (DESIGN.md, "Devices"): a quantum of 0.015 to 0.018 rad,
// 90 to 150 Hz, 44 % of consecutive samples equal, single-sample jumps up to 0.49 rad, stamps that tick 15,
// 16 and sometimes 32 ms, two FASTRAK receivers at 60 Hz each. The fingers' stiffness, 0.4 to 1.5 N m/rad,
// is that of a finger held lightly: at the fingertip of an 83 mm index finger 1.5 N m/rad at the knuckle are
// 220 N/m, the low end of what is measured on people; damping ratios measured there lie near 1.
#include "gloved/sim.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct setting {
  const char *name;
  size_t offset;
  double min, max, best, real;
} setting;

#define SETTING(name, min, max, best, real) {#name, offsetof(gv_sim_device, name), min, max, best, real}

static const setting table[] = {
  SETTING(glove_hz_min, 1, 1000, 1000, 90),
  SETTING(glove_hz_max, 1, 1000, 1000, 150),
  SETTING(quantum_min_rad, 0, 0.1, 0, 0.015),
  SETTING(quantum_max_rad, 0, 0.1, 0, 0.018),
  SETTING(noise_rad, 0, 0.1, 0, 0.004),
  SETTING(equal_share, 0, 0.99, 0, 0.44),
  SETTING(jump_chance, 0, 1, 0, 0.003),
  SETTING(jump_min_rad, 0, 1.5, 0, 0.1),
  SETTING(jump_max_rad, 0, 1.5, 0, 0.49),
  SETTING(offset_rad, 0, 0.2, 0, 0.04),
  SETTING(gain_error, 0, 0.2, 0, 0.03),
  SETTING(tracker_hz, 1, 1000, 1000, 60),
  SETTING(head_hz, 1, 1000, 50, 60),
  SETTING(position_noise_m, 0, 0.01, 0, 5e-5),
  SETTING(rotation_noise_rad, 0, 0.1, 0, 3e-4),
  SETTING(status_hz, 1, 1000, 100, 100),
  SETTING(coarse_stamps, 0, 1, 0, 1),
  SETTING(clock_start_s, 0, 4294, 0, 4290),
  SETTING(late_chance, 0, 1, 0, 0.005),
  SETTING(late_max_s, 0, 0.5, 0, 0.03),
  SETTING(loss_chance, 0, 1, 0, 0.005),
  SETTING(max_n, 0, 12.285, 12, 12),
  SETTING(slew_n_per_s, 1, 1e5, 400, 400),
  SETTING(wire_count_n, 0.001, 0.1, 0.003, 0.003),
  SETTING(command_hz, 50, 10000, 1000, 1000),
  SETTING(watchdog_s, 0.001, 0.005, 0.004, 0.004),
  SETTING(stiffness_0, 0.01, 100, 1.5, 1.5),
  SETTING(stiffness_1, 0.01, 100, 0.8, 0.8),
  SETTING(stiffness_2, 0.01, 100, 0.4, 0.4),
  SETTING(inertia_0, 1e-6, 1, 3e-4, 3e-4),
  SETTING(inertia_1, 1e-6, 1, 1e-4, 1e-4),
  SETTING(inertia_2, 1e-6, 1, 3e-5, 3e-5),
  SETTING(damping_ratio, 0, 10, 1, 1),
  SETTING(sway_rad, 0, 0.5, 0, 0),
  SETTING(sway_m, 0, 0.1, 0, 0),
  SETTING(sway_hz, 0.01, 20, 2, 2),
  SETTING(tremor_rad, 0, 0.1, 0, 0),
  SETTING(tremor_hz, 1, 30, 9, 9),
};
enum { SETTINGS = sizeof table / sizeof table[0] };
_Static_assert(SETTINGS * sizeof(double) == sizeof(gv_sim_device), "every member has its row");

static double *member(gv_sim_device *device, const setting *row) {
  return (double *)(void *)((char *)device + row->offset);
}

gv_sim_device gv_sim_device_best(void) {
  gv_sim_device device;
  for (int i = 0; i < SETTINGS; i++)
    *member(&device, &table[i]) = table[i].best;
  return device;
}

gv_sim_device gv_sim_device_real(void) {
  gv_sim_device device;
  for (int i = 0; i < SETTINGS; i++)
    *member(&device, &table[i]) = table[i].real;
  return device;
}

static const setting *find_setting(const char *name) {
  for (int i = 0; i < SETTINGS; i++)
    if (strcmp(name, table[i].name) == 0)
      return &table[i];
  return NULL;
}

int gv_sim_device_set(gv_sim_device *device, const char *name, const char *value, char *err,
                      size_t err_size) {
  const setting *row = find_setting(name);
  if (!row) {
    snprintf(err, err_size,
             "no device setting \"%.40s\"; the settings are the members of gv_sim_device (sim.h), "
             "e.g. glove_hz_max",
             name);
    return -1;
  }
  char *end;
  double v = strtod(value, &end);
  if (end == value || *end || !(v >= row->min && v <= row->max)) {
    snprintf(err, err_size, "%s is \"%.40s\"; give a number from %g to %g", name, value, row->min, row->max);
    return -1;
  }
  *member(device, row) = v;
  return 0;
}

int gv_sim_device_check(const gv_sim_device *device, char *err, size_t err_size) {
  const char *pair = device->glove_hz_min > device->glove_hz_max         ? "glove_hz"
                     : device->quantum_min_rad > device->quantum_max_rad ? "quantum"
                     : device->jump_min_rad > device->jump_max_rad       ? "jump"
                                                                         : NULL;
  if (pair)
    snprintf(err, err_size, "%s_min is above %s_max; set both", pair, pair);
  return pair ? -1 : 0;
}
