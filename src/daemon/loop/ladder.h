// SPDX-License-Identifier: BSD-3-Clause
// The deadline ladder: what a step does without where all of it does not fit into what is left of its
// period. The loop measures what steps cost and asks before each; arithmetic alone, no clock.
// Real-time thread; live pace only.
//
//   full        everything
//   solver      a quarter of the solvers' and of collision detection's budgets
//   contacts    the same, and no more than the 24 deepest contacts
//   hold        no step: the device hears the last forces again, through the limiter as ever
//   ramp        held for too long: forces go to zero (a fault); the engine steps on as it can
#ifndef GLOVED_DAEMON_LADDER_H
#define GLOVED_DAEMON_LADDER_H

#include <stdbool.h>
#include <stdint.h>

typedef enum gv_rung {
  GV_RUNG_FULL,
  GV_RUNG_SOLVER,
  GV_RUNG_CONTACTS,
  GV_RUNG_HOLD,
  GV_RUNG_RAMP,
  GV_RUNGS
} gv_rung;

// Forces are held for at most this long (and for one period where that is longer).
#define GV_LADDER_HOLD_NS 10000000

typedef struct gv_ladder {
  int64_t period_ns;
  int64_t cost_ns[GV_RUNG_HOLD];  // what a step on each rung is thought to take
  int64_t held_ns;                // for how long forces are held now
  gv_rung rung;                   // of the last period
} gv_ladder;

void gv_ladder_init(gv_ladder *ladder, int64_t period_ns);
// The rung for a step that has left_ns until the end of its period.
gv_rung gv_ladder_choose(gv_ladder *ladder, int64_t left_ns);
// What a step on this rung (full, solver, contacts) took.
void gv_ladder_measure(gv_ladder *ladder, gv_rung rung, int64_t took_ns);
const char *gv_rung_name(gv_rung rung);  // "full", "solver", ...

#endif
