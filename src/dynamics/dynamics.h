// SPDX-License-Identifier: BSD-3-Clause
// Rigid bodies with contact and friction, one step at a time (Eqn 11 to 18). Bodies 0..15 are the limbs, then
// the scene's objects, then the limbs of a second hand. Memory from the arena; the real-time thread steps it.
#ifndef DYNAMICS_H
#define DYNAMICS_H

#include "dynamics/choice.h"
#include "hand/coupling.h"

typedef struct gv_dynamics gv_dynamics;

// Inertia per mass (m^2) of the sphere with the volume of a box of these full sizes (Table 1).
double gv_sphere_inertia_of_box(gv_vec3 size_m);

// Null where the arena is too small. spring, limb_inertia: of the first hand; gv_dynamics_set_limb gives a
// second one's.
gv_dynamics *gv_dynamics_create(gv_arena *arena, const gv_config *cfg, const gv_scene *scene,
                                const gv_spring spring[GV_LIMBS], const double limb_inertia[GV_LIMBS]);
void gv_dynamics_destroy(gv_dynamics *dyn);
// Runs every solver once with the most contacts, so that every later step finds its memory ready.
void gv_dynamics_warm_up(gv_dynamics *dyn);

// Of a body; those of the others lie beside it, in their order.
const gv_body_state *gv_dynamics_state(const gv_dynamics *dyn, int body);
void gv_dynamics_set_state(gv_dynamics *dyn, int body, const gv_body_state *state);
// Another spring for a limb: its mass with the augmentation that belongs to it. Never allocates.
void gv_dynamics_set_limb(gv_dynamics *dyn, int limb, const gv_spring *spring, double inertia);
// Limbs without a driver are parked: not simulated. first: of the hand's bodies.
void gv_dynamics_park_limbs(gv_dynamics *dyn, int first, bool parked);
// An object at rest stands still and is not simulated; others see it as static.
void gv_dynamics_set_rest(gv_dynamics *dyn, int body, bool rest);
// Was a force added for the coming step?
bool gv_dynamics_pushed(const gv_dynamics *dyn, int body);
// The solvers' share of their budgets from the next step on: above 0, at most 1.
void gv_dynamics_set_share(gv_dynamics *dyn, double share);
// Drop what was kept from the last step.
void gv_dynamics_forget(gv_dynamics *dyn);
// Broken joints hold again.
void gv_dynamics_mend_joints(gv_dynamics *dyn);
// How many broke in the last step.
int gv_dynamics_joints_broken(const gv_dynamics *dyn);
gv_joint_state gv_dynamics_joint(const gv_dynamics *dyn, int joint);
gv_vec3 gv_dynamics_gravity(const gv_dynamics *dyn);
// Velocity that a body would have after the step without contacts.
void gv_dynamics_predict(const gv_dynamics *dyn, int body, gv_body_state *out);

void gv_dynamics_add_force(gv_dynamics *dyn, int body, gv_vec3 f, gv_vec3 t);
// One step. out_force[i] receives contact i's force on its body a, newtons.
gv_solver_report gv_dynamics_step(gv_dynamics *dyn, const gv_dynamics_contact contact[], int count,
                                  gv_vec3 out_force[]);
// Solutions so far that a solver gave up, or said to be wrong; another one did those steps.
unsigned gv_dynamics_solver_errors(const gv_dynamics *dyn);
// Kinetic energy of the objects plus their potential energy, joules.
double gv_dynamics_object_energy(const gv_dynamics *dyn);

#endif
