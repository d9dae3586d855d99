// SPDX-License-Identifier: BSD-3-Clause
// ODE as a function of the contact problem: bodies, velocities and contacts in, velocities and impulses out.
// Nothing of the world is kept from one call to the next. dantzig.c and quickstep.c are the solvers on it.
// One at a time in a process, since ODE keeps its memory functions in globals. Real-time thread: no heap
// call, not even where ODE gives up.
#ifndef DYNAMICS_ODE_H
#define DYNAMICS_ODE_H

#include "dynamics/solver.h"
#include "gloved/arena.h"

// Friction along each of a contact's tangents is at most so much, N s; below 0: what its own law says, as ODE
// reads it.
typedef struct gv_ode_limit {
  double along[2];
} gv_ode_limit;
#define GV_ODE_OWN_LAW (-1.0)

// Which of ODE's solvers, and how.
typedef struct gv_ode_method {
  int iterations;             // of QuickStep; 0: Dantzig's solver
  const gv_ode_limit *limit;  // [contact_count]; null: each contact's own law
} gv_ode_method;

// Null where the arena is too small, in a dry run, or while another one is open. Set-up only: makes heap
// calls.
gv_ode *gv_ode_open(gv_arena *arena);
void gv_ode_close(gv_ode *ode);
// False where ODE gave up, ran out of memory, or said that its answer is wrong ("LCP internal error"):
// nothing was written.
bool gv_ode_solve(gv_ode *ode, const gv_problem *problem, const gv_ode_method *method,
                  gv_velocity out_velocity[], gv_vec3 out_impulse[]);
// Calls that came to nothing so far.
unsigned gv_ode_failures(const gv_ode *ode);

#endif
