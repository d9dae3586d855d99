// SPDX-License-Identifier: BSD-3-Clause
// Memory of the solver `newton`: contact and friction by Newton's method on the velocities of all bodies that touch. Pure.
#ifndef DIRECT_H
#define DIRECT_H

#include "dynamics/blocks.h"
#include "dynamics/solver.h"

enum { GV_DIRECT_ROWS = 3 * GV_MAX_CONTACTS };

// What a row does: nothing; hold its velocity at the one that is asked; push with all that friction has.
typedef enum gv_direct_row { GV_DIRECT_OPEN, GV_DIRECT_HOLDS, GV_DIRECT_SLIDES_UP, GV_DIRECT_SLIDES_DOWN } gv_direct_row;
typedef struct gv_direct_guess { int body_a, body_b; double normal_impulse; uint8_t row[3]; } gv_direct_guess;

typedef struct gv_direct {
  gv_direct_guess last[GV_MAX_CONTACTS];   // the last step's contacts: the first guess of the next
  int last_count;
  bool limits_right;                       // friction was bounded by mu times the normal impulses of the same solution
  // work
  int count, steps_left;
  int node_a[GV_MAX_CONTACTS], node_b[GV_MAX_CONTACTS]; // -1: does not move
  int nodes;                               // the first ones in `blocks`, then the limbs with one contact each
  uint8_t row[GV_DIRECT_ROWS];
  gv_vec3 along[GV_MAX_CONTACTS][3];       // of each row, unit: normal and two of friction
  gv_vec3 arm_a[GV_MAX_CONTACTS], arm_b[GV_MAX_CONTACTS]; // from the bodies' origins, metres
  double asked[GV_DIRECT_ROWS];            // velocity, m/s
  double stiff[GV_DIRECT_ROWS];            // N s for a velocity of 1 m/s
  double mu[GV_MAX_CONTACTS];
  double limit[GV_MAX_CONTACTS], kept_limit[GV_MAX_CONTACTS]; // of friction, N s
  bool bold;                               // the limits move with the normal impulses
  double u[GV_DIRECT_ROWS], du[GV_DIRECT_ROWS]; // relative velocity, and its change in this iteration
  double bend[2 * GV_DIRECT_ROWS];
  gv_six free[GV_NODES], v[GV_NODES], dv[GV_NODES], kept_v[GV_NODES];
  double mass[GV_NODES];
  gv_mat3 inertia[GV_NODES];
  gv_blocks blocks;
  gv_mat3 lone[GV_MAX_CONTACTS];           // how stiff the contact of such a limb is to the other body, N s for 1 m/s, world
  gv_vec3 lone_u[GV_MAX_CONTACTS];         // its velocity, beyond what is asked, if the other body kept its own
} gv_direct;

#endif
