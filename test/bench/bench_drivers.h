// SPDX-License-Identifier: BSD-3-Clause
// What the engine under test hands to its peers: the hand's springs and, for every step, where the skeleton
// pulls each limb. A file of one header and `steps` records, read on the machine that wrote it.
#ifndef BENCH_DRIVERS_H
#define BENCH_DRIVERS_H

#include "hand/coupling.h"

// Answer of each step: whole, collision and dynamics in microseconds; contacts; the object's position in the
// palm (m); its height (m).
enum { GV_BENCH_VALUES = 8 };

// How far a step is from the laws of contact, of its worst contact or body: Signorini (the lesser of
// m/s and N), Coulomb (N), maximum dissipation (W), momentum (N s). A peer that is asked for them
// gives them after each step's values.
enum { GV_BENCH_LAWS = 4 };

typedef struct gv_bench_header {
  int64_t steps;
  double h;
  gv_spring spring[GV_LIMBS];
  gv_shape shape[GV_LIMBS];
  double inertia[GV_LIMBS];  // kg m^2, without what the spring adds
} gv_bench_header;

typedef struct gv_bench_drivers {
  int64_t placed;  // 0: no hand yet
  gv_body_state limb[GV_LIMBS];
} gv_bench_drivers;

#endif
