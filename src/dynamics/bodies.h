// SPDX-License-Identifier: BSD-3-Clause
// The rigid bodies, the only copy of them: where they are, how they move, what they weigh, what pushes them
// in the coming step. Numbers 0 to GV_LIMBS - 1 are the limbs, then come the scene's objects, then the
// limbs of a second hand. Pure; real-time thread.
#ifndef DYNAMICS_BODIES_H
#define DYNAMICS_BODIES_H

#include "base/body_state.h"
#include "dynamics/problem.h"
#include "hand/coupling.h"

typedef struct gv_body {
  bool is_static;   // never moves
  bool stands;      // does not move for now: an object at rest, a limb without a driver
  double mass_kg;   // its own, without what the coupling adds
  double inv_mass;  // 1/kg, with that
  gv_mat3 inertia;  // kg m^2, body axes, with that
  gv_mat3 inv_inertia;
  gv_vec3 force, torque;  // world, in the coming step, gravity apart
} gv_body;

typedef struct gv_bodies {
  int count;
  int second_hand;  // number of the first limb of a second hand: behind the last object
  gv_vec3 gravity;  // m/s^2, of objects
  gv_body_state state[GV_BODIES];
  gv_body body[GV_BODIES];
} gv_bodies;

// Every body of the scene and the limbs, which stand. spring, limb_inertia: of each limb of the first hand;
// those of a second are the caller's to set.
void gv_bodies_init(gv_bodies *bodies, const gv_config *cfg, const gv_scene *scene,
                    const gv_spring spring[GV_LIMBS], const double limb_inertia[GV_LIMBS]);
// A limb's mass and inertia (kg m^2, about every axis), with the augmentation that belongs to its spring.
void gv_bodies_set_limb(gv_bodies *bodies, int limb, const gv_spring *spring, double inertia);
// What is not finite is ignored, and a static body stays where it is.
void gv_bodies_set_state(gv_bodies *bodies, int body, const gv_body_state *state);
void gv_bodies_set_standing(gv_bodies *bodies, int body, bool stands);
void gv_bodies_add_force(gv_bodies *bodies, int body, gv_vec3 f, gv_vec3 t);
static inline bool gv_bodies_is_limb(const gv_bodies *bodies, int body) {
  return gv_body_is_limb(body, bodies->second_hand);
}
static inline bool gv_body_moves(const gv_body *b) { return !b->is_static && !b->stands; }

// integrate.c: velocities and world inertias after a step of h without contacts, into the problem's bodies.
void gv_bodies_move_freely(const gv_bodies *bodies, double h, gv_problem_body out_body[]);
// The velocity alone of one body; torques and gyroscopic terms do not count.
void gv_bodies_predict(const gv_bodies *bodies, double h, int body, gv_body_state *out);
// Poses after a step of h with these velocities; all forces are zero again.
void gv_bodies_advance(gv_bodies *bodies, double h, const gv_velocity velocity[]);
// Kinetic energy of the objects plus their potential energy, joules.
double gv_bodies_object_energy(const gv_bodies *bodies);

#endif
