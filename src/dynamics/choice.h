// SPDX-License-Identifier: BSD-3-Clause
// Which solver does a step: the one that was asked for, and where it has no answer or does not fit into its
// share of the period, the next. Real-time thread.
#ifndef DYNAMICS_CHOICE_H
#define DYNAMICS_CHOICE_H

#include "dynamics/ode.h"

typedef struct gv_choice {
  gv_solver solver;  // as configured
  double period_s;   // of the loop
  double effort;     // share of the budgets that is to be used: 1 all
  gv_ode *ode;
  void *memory[GV_SOLVERS];  // of each solver
} gv_choice;

// Which solver found an answer, and what for.
typedef struct gv_solver_report {
  gv_solver solver;  // GV_SOLVER_AUTO: none was needed, or none had an answer
  gv_outcome outcome;
} gv_solver_report;

// False where the arena is too small. Set-up only.
bool gv_choice_open(gv_choice *choice, gv_arena *arena, const gv_config *cfg);
void gv_choice_close(gv_choice *choice);
// Every solver once with the most contacts, so that every later step finds its memory ready. Writes over
// `problem`.
void gv_choice_warm_up(gv_choice *choice, gv_problem *problem);
// problem: all but its budget, which each solver gets from here. out_: as gv_contact_solver.solve.
gv_solver_report gv_choice_solve(gv_choice *choice, gv_problem *problem, gv_velocity out_velocity[],
                                 gv_vec3 out_impulse[]);
// Drops what the solvers kept from the last step.
void gv_choice_forget(gv_choice *choice);

#endif
