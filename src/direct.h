// SPDX-License-Identifier: BSD-3-Clause
// Contact and friction by guessing which contacts are closed and which of them slide, one linear solve per guess.
// Internal to the dynamics. Pure.
#ifndef DIRECT_H
#define DIRECT_H

#include "dynamics.h"

enum { GV_DIRECT_CONTACTS = 32, GV_DIRECT_ROWS = 3 * GV_DIRECT_CONTACTS };

// A body as the contacts find it, world frame; velocities after the step without contacts.
typedef struct gv_direct_body {
  double inv_mass;              // 0: does not move
  gv_mat3 inv_inertia;
  gv_vec3 p, v, w;
} gv_direct_body;

// How a contact was found last: the first guess of the next step.
typedef enum gv_direct_row { GV_DIRECT_OPEN, GV_DIRECT_HOLDS, GV_DIRECT_SLIDES_UP, GV_DIRECT_SLIDES_DOWN } gv_direct_row;
typedef struct gv_direct_guess { int body_a, body_b; uint8_t row[3]; } gv_direct_guess;

typedef struct gv_direct {
  gv_direct_guess last[GV_DIRECT_CONTACTS];
  int last_count;
  // work
  int count;
  uint8_t row[GV_DIRECT_ROWS];
  double A[GV_DIRECT_ROWS][GV_DIRECT_ROWS], b[GV_DIRECT_ROWS], x[GV_DIRECT_ROWS], mu[GV_DIRECT_ROWS];
  double M[GV_DIRECT_ROWS][GV_DIRECT_ROWS], y[GV_DIRECT_ROWS];
  double own[6][GV_DIRECT_ROWS], moved[6][GV_DIRECT_ROWS]; // of the body that most contacts share: J and M^-1 J
  gv_vec3 d[GV_DIRECT_ROWS], ang_a[GV_DIRECT_ROWS], ang_b[GV_DIRECT_ROWS], turn_a[GV_DIRECT_ROWS], turn_b[GV_DIRECT_ROWS];
} gv_direct;

// Force on body a of each contact, newtons; false where no guess held (then nothing is written).
bool gv_direct_solve(gv_direct *direct, const gv_config *cfg, const gv_direct_body body[GV_BODIES],
                     const gv_dynamics_contact *contact, int count, gv_vec3 force_on_a[]);

#endif
