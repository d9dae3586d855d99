// SPDX-License-Identifier: BSD-3-Clause
// One contact of the Newton solver (newton.c has the derivation): its law linearized on its state, and the state that
// the projection onto Coulomb's cone gives it next. World axes throughout. Pure, real-time thread.
#ifndef NEWTON_CONTACT_H
#define NEWTON_CONTACT_H

#include <stdint.h>

#include "gloved/math.h"

typedef enum gv_newton_state { GV_NEWTON_OPEN, GV_NEWTON_STICKING, GV_NEWTON_SLIDING } gv_newton_state;

// A contact's entry in the active set.
typedef struct gv_newton_mode {
  gv_newton_state state;
  gv_vec3 friction_dir;         // e: of the friction on body a, unit, tangent; sliding only
  double lambda;                // slip speed for an impulse of friction, m/s for 1 N s; sliding only
} gv_newton_mode;

typedef struct gv_newton_contact {
  // the problem
  int body_a, body_b;           // of the caller
  int node_a, node_b;           // in the equations; -1: does not move
  gv_vec3 position, normal;     // from b to a
  gv_vec3 arm_a, arm_b;         // from the bodies' origins to the point, metres
  double mu;
  double target;                // a: normal velocity that is asked, m/s
  double compliance_n, compliance_t; // c_n, c_t: m/s for 1 N s
  // a limb whose only contact this is, eliminated: velocity of its point for an impulse there is give I - turn [arm]x^2
  bool is_lone;
  double give, turn;
  // what does not change in a step
  gv_vec3 free_u;               // J v_free - a n
  double inverse_mass_n, inverse_mass_t; // n W n, and the mean of W across n; negative: not asked for yet
  // the iteration
  gv_newton_mode mode, first;   // now, and where each stage begins
  gv_mat3 stiffness;            // K of the mode; of a lone limb with the limb giving way
  gv_vec3 impulse;              // x on body a, N s
  gv_vec3 u;                    // J v - a n with that impulse, m/s
} gv_newton_contact;

// K of x = -K (J v - a n), or of a lone limb x = -K (free_u - J_b dv_b).
gv_mat3 gv_newton_stiffness(const gv_newton_contact *c, double softening);
// Impulse and velocity that follow from the velocity r that the rest of the bodies leave.
void gv_newton_respond(gv_newton_contact *c, gv_vec3 r);
// The next mode by the projection with weight W (1: Alart and Curnier's steps; 0: the plain velocity map), and how far
// the impulse is from that projection, in units of the tolerance: at most 1 is a solution.
double gv_newton_project(const gv_newton_contact *c, double weight, double softening, gv_newton_mode *out_mode);

#endif
