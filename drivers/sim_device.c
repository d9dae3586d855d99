// SPDX-License-Identifier: BSD-3-Clause
// The settings of the simulated device by name: ranges and both presets in one table. Set-up only.
//
// `real` imitates recordings of gloves and trackers (DESIGN.md, "Devices"): a quantum of 0.015 to 0.018 rad,
// 90 to 150 Hz, 44 % of consecutive samples equal, single-sample jumps up to 0.49 rad, stamps that tick 15,
// 16 and sometimes 32 ms, two FASTRAK receivers at 60 Hz each. The fingers' stiffness, 0.4 to 1.5 N m/rad,
// is that of a finger held lightly: at the fingertip of an 83 mm index finger 1.5 N m/rad at the knuckle are
// 220 N/m, the low end of what is measured on people; damping ratios measured there lie near 1.
//
// finger=relaxed|normal|firm sets all seven numbers of the fingers instead, so that the index finger, felt
// along its tendon, is a mass, a damper and a spring as measured at the fingertip: Hajian and Howe,
// Identification of the mechanical impedance at the human finger tip, J. Biomech. Eng. 119 (1997), extension
// at 2 to 20 N: 3.5 to 8.7 g, 4.0 to 7.4 N s/m, 255 to 1255 N/m as later papers quote them, stiffness and
// damping growing with the force, mass nearly constant, damping ratio above 1. Their least is `relaxed`,
// their most `firm`. Joints share the compliance as above; all have the same natural frequency, so that what
// the tendon feels is of second order, as in that model. The other fingers follow by their arms.
#include "gloved/sim.h"

#include "gloved/force.h"

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
  SETTING(glove_hz_min, 1, 10000, 1000, 90),
  SETTING(glove_hz_max, 1, 10000, 1000, 150),
  SETTING(quantum_min_rad, 0, 0.1, 0, 0.015),
  SETTING(quantum_max_rad, 0, 0.1, 0, 0.018),
  SETTING(noise_rad, 0, 0.1, 0, 0.004),
  SETTING(equal_share, 0, 0.99, 0, 0.44),
  SETTING(jump_chance, 0, 1, 0, 0.003),
  SETTING(jump_min_rad, 0, 1.5, 0, 0.1),
  SETTING(jump_max_rad, 0, 1.5, 0, 0.49),
  SETTING(offset_rad, 0, 0.2, 0, 0.04),
  SETTING(gain_error, 0, 0.2, 0, 0.03),
  SETTING(tracker_hz, 1, 10000, 1000, 60),
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
  SETTING(delay_s, 0, GV_SIM_DELAY_MAX_S, 0, 0),
  SETTING(cycle_hz, 1000, 10000, 1000, 1000),
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

typedef struct finger {
  const char *name;
  double stiffness_n_m, damping_n_s_m, mass_kg;  // of the index finger along its tendon
} finger;
static const finger fingers[] = {
  {"relaxed", 250, 4.0, 0.0050},
  {"normal", 600, 5.5, 0.0055},
  {"firm", 1250, 7.4, 0.0060},
};

// The preset's spring of each joint, all stiffer by the same factor: a tendon with arms r over springs k has
// the compliance sum r^2 / k.
static void set_finger(gv_sim_device *device, const finger *f) {
  const gv_sim_device best = gv_sim_device_best();
  const double k[3] = {best.stiffness_0, best.stiffness_1, best.stiffness_2};
  double *const stiffness[3] = {&device->stiffness_0, &device->stiffness_1, &device->stiffness_2};
  double *const inertia[3] = {&device->inertia_0, &device->inertia_1, &device->inertia_2};
  int sensor[3];
  double arm_m[3];
  double compliance = 0.0;
  gv_tendon_joints(1, sensor, arm_m);
  for (int j = 0; j < 3; j++)
    compliance += arm_m[j] * arm_m[j] / k[j];
  for (int j = 0; j < 3; j++) {
    *stiffness[j] = k[j] * f->stiffness_n_m * compliance;
    *inertia[j] = *stiffness[j] * f->mass_kg / f->stiffness_n_m;
  }
  device->damping_ratio = 0.5 * f->damping_n_s_m / sqrt(f->stiffness_n_m * f->mass_kg);
}

static int set_finger_named(gv_sim_device *device, const char *name, char *err, size_t err_size) {
  for (size_t i = 0; i < sizeof fingers / sizeof fingers[0]; i++)
    if (strcmp(fingers[i].name, name) == 0) {
      set_finger(device, &fingers[i]);
      return 0;
    }
  snprintf(err, err_size, "finger is \"%.40s\"; give relaxed, normal or firm", name);
  return -1;
}

int gv_sim_device_set(gv_sim_device *device, const char *name, const char *value, char *err,
                      size_t err_size) {
  if (strcmp(name, "finger") == 0)
    return set_finger_named(device, value, err, err_size);
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
