// SPDX-License-Identifier: BSD-3-Clause
// One contact of the Newton solver (newton.c has the derivation): its law linearized on its state, and the
// state that the projection onto Coulomb's cone gives it next. World axes throughout. Pure, real-time thread.
#ifndef NEWTON_CONTACT_H
#define NEWTON_CONTACT_H

#include <stdint.h>

#include "gloved/math.h"

typedef enum gv_newton_state { GV_NEWTON_OPEN, GV_NEWTON_STICKING, GV_NEWTON_SLIDING } gv_newton_state;

// A contact's entry in the active set.
typedef struct gv_newton_mode {
  gv_newton_state state;
  gv_vec3 friction_dir;  // e: of the friction on body a, unit, tangent; sliding only
  double lambda;         // slip speed for an impulse of friction, m/s for 1 N s; sliding only
} gv_newton_mode;

typedef struct gv_newton_contact {
  // the problem
  int body_a, body_b;        // of the caller
  int node_a, node_b;        // in the equations; -1: does not move
  gv_vec3 position, normal;  // from b to a
  gv_vec3 arm_a, arm_b;      // from the bodies' origins to the point, metres
  double mu;
  double target;                      // a: normal velocity that is asked, m/s
  double compliance_n, compliance_t;  // c_n, c_t: m/s for 1 N s
  int spin;                           // row of the patch; -1: a point
  int limb;                           // of gv_newton: one that is eliminated first; -1: none
  // a limb with this contact alone: the velocity of its point for an impulse there is (give
  // I - turn arm arm^T) times it
  bool is_lone;
  double give, turn;
  // what does not change in a step
  gv_vec3 free_u;                         // J v_free - a n
  double inverse_mass_n, inverse_mass_t;  // n W n, and the mean of W across n; negative: not asked for yet
  // the iteration
  gv_newton_mode mode, next, first;  // now, in the next solve, and where each stage begins
  bool changed;                      // the mode, since the stiffness was made
  double residual, merit;            // of the projection
  gv_mat3 stiffness;                 // K of the mode; of a lone limb with the limb giving way
  gv_vec3 impulse;                   // x on body a, N s
  gv_vec3 u;                         // J v - a n with that impulse, m/s
  gv_vec3 from_impulse, from_u, full_impulse, full_u;  // ends of a step that is damped
} gv_newton_contact;

// K of x = -K (J v - a n), or of a lone limb x = -K (free_u - J_b dv_b).
gv_mat3 gv_newton_stiffness(const gv_newton_contact *c, double softening);
// Impulse and velocity that follow from the velocity r that the rest of the bodies leave.
void gv_newton_respond(gv_newton_contact *c, gv_vec3 r);
// What the projection (6) says of a contact.
typedef struct gv_newton_projection {
  gv_newton_mode mode;  // the next
  double residual;      // how far the impulse is from its projection, in units of the
                        // tolerance: at most 1 solves it
  double merit;         // the square of that way, over rho
} gv_newton_projection;

// weight: of W in rho (1: Alart and Curnier's steps; 0: the plain velocity map).
gv_newton_projection gv_newton_project(const gv_newton_contact *c, double weight, double softening);

#endif
