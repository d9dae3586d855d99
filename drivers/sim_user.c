// SPDX-License-Identifier: BSD-3-Clause
// What the simulated user's hand does besides the script: it sways slowly and it trembles (physiological
// tremor, 8 to 12 Hz: Elble and Koller, Tremor, 1990). Each finger sways and each joint trembles with a
// phase of its own, by the seed, drawn apart from the device's random numbers so that the same device has
// the same defects with and without it. Pure; no engine.
#include "drivers/sim.h"

#include "gloved/force.h"

// A phase in [0, 2 pi) for a seed and a place, by splitmix64's mixing.
static double phase(uint64_t seed, uint64_t place) {
  uint64_t z = (seed + 1) * 0x9e3779b97f4a7c15ULL + place * 0xbf58476d1ce4e5b9ULL;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
  z ^= z >> 31;
  return 2.0 * GV_PI * ((double)(z >> 11) / 9007199254740992.0);
}

static double wave(const gv_sim *sim, double amplitude, double hz, uint64_t place) {
  double sine, cosine;
  if (!(amplitude > 0.0))
    return 0.0;
  const double turns = hz * 1e-9 * (double)sim->now_ns;
  gv_sincos(2.0 * GV_PI * (turns - floor(turns)) + phase(sim->seed, place), &sine, &cosine);
  return amplitude * sine;
}

void gv_sim_user_step(gv_sim *sim) {
  const gv_sim_device *d = &sim->device;
  for (int finger = 0; finger < GV_FINGERS; finger++) {
    int sensor[3];
    double arm_m[3];
    const int joints = gv_tendon_joints(finger, sensor, arm_m);
    const double sway = wave(sim, d->sway_rad, d->sway_hz, (uint64_t)finger);
    for (int j = 0; j < joints; j++) {
      const uint64_t place = 16 + 3 * (uint64_t)finger + (uint64_t)j;
      sim->intent.angle_rad[sensor[j]] += sway + wave(sim, d->tremor_rad, d->tremor_hz, place);
    }
  }
  const gv_vec3 moved = {wave(sim, d->sway_m, d->sway_hz, 64), wave(sim, d->sway_m, d->sway_hz, 65),
                         wave(sim, d->sway_m, d->sway_hz, 66)};
  sim->intent.T_world_wrist.p = gv_add(sim->intent.T_world_wrist.p, moved);
}
