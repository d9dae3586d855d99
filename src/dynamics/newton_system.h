// SPDX-License-Identifier: BSD-3-Clause
// The linear equations of the Newton solver: (1), (4) and (5) of newton.c. Pure, real-time thread.
#ifndef NEWTON_SYSTEM_H
#define NEWTON_SYSTEM_H

#include "dynamics/newton.h"

// Bodies, contacts and the structure of the matrix. False where the problem is not for this solver: another
// law of friction, or more blocks than there are.
bool gv_newton_set_up(gv_newton *s, const gv_problem *problem);
// Every contact changes its mode: nothing is left of the last solution.
void gv_newton_change_all(gv_newton *s);
// Impulse and velocity of each contact on the active set; false where the matrix cannot be solved.
bool gv_newton_solve(gv_newton *s, double softening);
// Velocities of the bodies after the last solution; false where one is not finite.
bool gv_newton_tell(gv_newton *s, const gv_problem *problem, gv_velocity out_velocity[]);
// n W n and the mean of W across n, of both bodies of a contact.
void gv_newton_find_inverse_mass(const gv_newton *s, gv_newton_contact *c);

#endif
