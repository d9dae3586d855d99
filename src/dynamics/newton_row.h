// SPDX-License-Identifier: BSD-3-Clause
// Rows of joints, and of the patches of contacts, in the Newton solver. A row's law is y = clamp(y - rho w),
// w = g - target + c y, the projection of newton.c's (6) onto an interval in place of a cone: it holds (y
// follows linearly, stiffness 1/c on its Jacobian) or stands at one of its bounds (y is known). Pure,
// real-time thread.
#ifndef NEWTON_ROW_H
#define NEWTON_ROW_H

#include <stdint.h>

#include "dynamics/blocks.h"
#include "dynamics/problem.h"

typedef enum gv_row_state { GV_ROW_HOLDS, GV_ROW_AT_LOW, GV_ROW_AT_HIGH } gv_row_state;

typedef struct gv_newton_row {
  int node_a, node_b;  // in the equations; -1: does not move
  int slot;            // of a joint's row
  int contact;  // of a patch's row, whose bound follows the normal impulse from one solution to the next; -1
  double normal_to_most;  // gv_patch_arm
  double applied;         // the bound in the equations
  gv_six to_a, to_b;      // the Jacobian G
  double free_u;          // G v_free - target
  double compliance, low, high;
  double inverse_mass;  // G M^-1 G^T
  // the iteration
  gv_row_state state, next, first, kept;
  bool changed;                                       // the state, since the last solution
  double residual, merit;                             // of the projection
  double impulse, u;                                  // y, and G v - target with it
  double from_impulse, from_u, full_impulse, full_u;  // ends of a step that is damped
} gv_newton_row;

struct gv_newton;

// Rows of the problem, with the nodes that they join; the matrix gets their blocks.
void gv_newton_rows_set_up(struct gv_newton *s, const gv_problem *problem);
// Nodes of rows whose state changed change with them.
void gv_newton_rows_mark(struct gv_newton *s);
// What rows add to the matrix and its right-hand side, where nodes change.
void gv_newton_rows_add(struct gv_newton *s, bool symmetric);
// Impulses and velocities after a solution.
void gv_newton_rows_respond(struct gv_newton *s);
// Next states and residuals, from impulses and velocities as they are. Returns the largest
// residual and adds to the merit.
double gv_newton_rows_project(struct gv_newton *s, double weight, double *io_merit);
// Rows that are not solved take their next state.
void gv_newton_rows_adopt(struct gv_newton *s);

// First states from the last step, and those for the next.
void gv_newton_rows_start(struct gv_newton *s);
void gv_newton_rows_keep(struct gv_newton *s);

#endif
