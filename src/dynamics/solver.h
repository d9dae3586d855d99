// SPDX-License-Identifier: BSD-3-Clause
// What every contact solver looks like. A solver is a function of the problem: it owns no body, and what it
// keeps from one step to the next is at most a first guess, which `forget` drops. Real-time thread; no heap,
// bounded time.
#ifndef DYNAMICS_SOLVER_H
#define DYNAMICS_SOLVER_H

#include <stddef.h>

#include "dynamics/problem.h"

typedef struct gv_ode gv_ode;

typedef enum gv_outcome {
  GV_OUTCOME_NONE,     // not for this solver, out of budget, or no answer: nothing was written
  GV_OUTCOME_SOLVED,   // to the problem as stated
  GV_OUTCOME_LAGGED,   // but friction was bounded by the normal impulses of an earlier iteration
  GV_OUTCOME_SOFTENED  // but with more compliance than asked
} gv_outcome;

typedef struct gv_contact_solver {
  const char *name;
  size_t memory_size;                       // bytes, all zero before init
  void (*init)(void *memory, gv_ode *ode);  // null: does without
  // Writes the velocities of the bodies that move and have a contact (the others are left as they are), and
  // the impulse on body a of each contact, N s, world axes. Calls with the same problem after `forget` give
  // the same bits.
  gv_outcome (*solve)(void *memory, const gv_problem *problem, gv_velocity out_velocity[],
                      gv_vec3 out_impulse[]);
  // What another solver found for the problem that this one was asked last and left: the next may be begun
  // from it. Null: does without.
  void (*learn)(void *memory, const gv_problem *problem, const gv_velocity velocity[],
                const gv_vec3 impulse[]);
  void (*forget)(void *memory);
} gv_contact_solver;

extern const gv_contact_solver gv_solver_newton;
extern const gv_contact_solver gv_solver_dantzig;
extern const gv_contact_solver gv_solver_quickstep;

#endif
