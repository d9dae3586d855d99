// SPDX-License-Identifier: BSD-3-Clause
// The spring-damper between a driver frame and a simulated limb (Eqn 1 to 4), by backward Euler. Pure.
#ifndef COUPLING_H
#define COUPLING_H

#include "base/body_state.h"
#include "gloved/config.h"

// A coupling made ready for one limb and one step size.
typedef struct gv_spring {
  double k_f, d_f, k_t, d_t;          // critical damping resolved
  double k_small;                     // small-angle stiffness: k_t, in the paper's law 2 k_t
  double mass_kg, added_mass_kg;      // h d + h^2 k
  double added_inertia;               // h d_t + h^2 k_small, kg m^2, the same about every axis
  double d_f_implicit, d_t_implicit;  // d + h k
  double h;
  gv_rotation_law law;
} gv_spring;

gv_spring gv_spring_make(const gv_coupling *coupling, double mass_kg, double mean_inertia, double h,
                         gv_rotation_law law);
// Force and torque to apply to bodies of augmented mass and inertia over the coming step.
void gv_springs_apply(const gv_spring s[GV_LIMBS], const gv_body_state sim[GV_LIMBS],
                      const gv_body_state driver[GV_LIMBS], gv_vec3 out_f[GV_LIMBS], gv_vec3 out_t[GV_LIMBS]);
// What the person feels at the end of a step: the opposite of what the springs and the dampers (Eqn 1, 2)
// hold now. T_ahead: where the drivers have moved on to in the step, at their velocities.
void gv_springs_feel(const gv_spring s[GV_LIMBS], const gv_body_state sim[GV_LIMBS],
                     const gv_body_state driver[GV_LIMBS], const gv_pose T_ahead[GV_LIMBS],
                     gv_vec3 out_f[GV_LIMBS], gv_vec3 out_t[GV_LIMBS]);

#endif
