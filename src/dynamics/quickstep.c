// SPDX-License-Identifier: BSD-3-Clause
// Solver `quickstep`: ODE's successive over-relaxation, as many iterations as fit into the budget. Inexact,
// but its cost is linear and it always has an answer: what the other solvers leave comes here. Real-time
// thread.
#include "dynamics/ode.h"

enum { LEAST = 10, MOST = 50 };     // iterations: fewer are worth nothing, more change little
static const double row_s = 15e-9;  // of one row in one iteration, as measured (make bench)

typedef struct gv_quickstep {
  gv_ode *ode;
} gv_quickstep;

static gv_outcome solve(void *memory, const gv_problem *problem, gv_velocity out_velocity[],
                        gv_vec3 out_impulse[]) {
  const gv_quickstep *s = memory;
  const double rows = fmax(3 * problem->contact_count + problem->row_count, 3);
  const gv_ode_method method = {.iterations = (int)gv_clamp(problem->budget_s / (row_s * rows), LEAST, MOST)};
  if (!gv_ode_solve(s->ode, problem, &method, out_velocity, out_impulse))
    return GV_OUTCOME_NONE;
  return GV_OUTCOME_SOLVED;
}

static void forget(void *memory) { (void)memory; }

static void init(void *memory, gv_ode *ode) {
  gv_quickstep *s = memory;
  s->ode = ode;
}

const gv_contact_solver gv_solver_quickstep = {
  .name = "quickstep", .memory_size = sizeof(gv_quickstep), .init = init, .solve = solve, .forget = forget};
