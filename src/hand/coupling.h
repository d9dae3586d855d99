// SPDX-License-Identifier: BSD-3-Clause
// The spring-damper between a driver frame and a simulated limb (Eqn 1 to 4), by backward Euler. Pure.
#ifndef COUPLING_H
#define COUPLING_H

#include <stdint.h>

#include "base/body_state.h"
#include "gloved/config.h"

// The most that a spring-damper pulls a limb with. Nobody feels more than 12 N, what a CyberGrasp pulls with
// (gloved/force.h): a limb that presses harder only sinks in, and throws what it touches. The torque is that
// force on an arm of a finger's half length, 50 mm. The palm bears what all fingers press.
#define GV_PULL_N 12.0
#define GV_PULL_N_M 0.6
#define GV_PALM_N 100.0
#define GV_PALM_N_M 10.0

// A coupling made ready for one limb and one step size.
typedef struct gv_spring {
  double k_f, d_f, k_t, d_t;          // critical damping resolved
  double k_small;                     // small-angle stiffness: k_t, in the paper's law 2 k_t
  double mass_kg, added_mass_kg;      // h d + h^2 k
  double added_inertia;               // h d_t + h^2 k_small, kg m^2, the same about every axis
  double d_f_implicit, d_t_implicit;  // d + h k
  double h;
  double most_n, most_n_m;  // that it pulls with: those of a finger's limb
  gv_rotation_law law;
} gv_spring;

gv_spring gv_spring_make(const gv_coupling *coupling, double mass_kg, double mean_inertia, double h,
                         gv_rotation_law law);
// The same with shares of its stiffness and damping, each from 0 to 1, and of what they add to the
// limb: of the force's, and of the torque's.
gv_spring gv_spring_soften(const gv_spring *spring, double of_force, double of_torque);
// Force and torque to apply to bodies of augmented mass and inertia over the coming step. Returns whether
// some of them may be beyond their bounds: then gv_springs_bound has the last word.
bool gv_springs_apply(const gv_spring s[GV_LIMBS], const gv_body_state sim[GV_LIMBS],
                      const gv_body_state driver[GV_LIMBS], gv_vec3 out_f[GV_LIMBS], gv_vec3 out_t[GV_LIMBS]);
// No limb is pulled by more than its spring's most_n and most_n_m, nor would be if it were stopped in this
// step: a spring that would pull harder is softer in this step, by as much as it takes. f and t are scaled
// down, direction kept, and not touched below the bound. Returns a bit for each limb whose spring is softer;
// acting receives those.
uint32_t gv_springs_bound(const gv_spring s[GV_LIMBS], const gv_body_state sim[GV_LIMBS], gv_vec3 f[GV_LIMBS],
                          gv_vec3 t[GV_LIMBS], gv_spring acting[GV_LIMBS]);
// What the person feels at the end of a step: the opposite of what the springs and the dampers (Eqn 1, 2)
// hold now. T_ahead: where the drivers have moved on to in the step, at their velocities.
void gv_springs_feel(const gv_spring s[GV_LIMBS], const gv_body_state sim[GV_LIMBS],
                     const gv_body_state driver[GV_LIMBS], const gv_pose T_ahead[GV_LIMBS],
                     gv_vec3 out_f[GV_LIMBS], gv_vec3 out_t[GV_LIMBS]);

#endif
