// SPDX-License-Identifier: BSD-3-Clause
// What an engine is made of: shared by engine.c (the step), contact.c (its collision part) and engine_view.c.
#ifndef ENGINE_STATE_H
#define ENGINE_STATE_H

#include "collision/queue.h"
#include "collision/rest.h"
#include "hand/condition.h"
#include "hand/coupling.h"
#include "dynamics/dynamics.h"
#include "gloved/arena.h"
#include "gloved/engine.h"

typedef struct gv_engine_hand {
  const gv_config *cfg;  // with this hand's measures and calibration
  int first_body;        // of its limbs
  gv_condition condition;
  gv_spring spring[GV_LIMBS];
  gv_spring acting[GV_LIMBS];  // in this step: where one would pull too hard, a softer one
  uint32_t softer;             // a bit for each of those
  double limb_inertia[GV_LIMBS];
  double angle[GV_SENSORS];         // of the skeleton in this step, rad
  gv_pose wrist;                    // T_world_wrist of this step
  gv_pose skeleton[GV_LIMBS];       // T_world_limb of this step
  gv_body_state driver[GV_LIMBS];   // the same with velocities
  gv_pose ahead[GV_LIMBS];          // T_world_driver as it will be after the step, if it goes on at
                                    // its velocity
  gv_joint_axis joint[GV_SENSORS];  // of the driver
  gv_vec3 felt_f[GV_LIMBS], felt_t[GV_LIMBS];  // by the person at the end of the last step: the opposite
                                               // of the coupling
  double tension_n[GV_FINGERS];                // felt in the last step (gv_tendon_follow)
  bool placed;
  uint32_t events;  // of its sample in this step
} gv_engine_hand;

struct gv_engine {
  gv_config cfg;
  gv_config second_cfg;  // the same with the second hand in place of the first
  const gv_scene *scene;
  gv_arena arena;
  gv_dynamics *dyn;
  int hands;
  gv_engine_hand hand[GV_HANDS];
  gv_broad broad;  // bounds of this step, pairs, warm starts
  bool in_joint[GV_MAX_OBJECTS];
  gv_rest rest;          // which objects are simulated
  gv_queue queue;        // pairs of this step in the order in which they are asked
  int collision_budget;  // operations that the pairs of a step may take
  gv_effort effort;
  int contact_count;
  int shallowest;  // of a full list of contacts; -1: not known
  gv_contact contact[GV_MAX_CONTACTS];
  gv_dynamics_contact solver_contact[GV_MAX_CONTACTS];
  gv_counters counters;
  uint32_t events;
};

// Objects that lie still and alone are put to rest at a step's end and woken at the
// start of collision detection.
void gv_engine_put_to_rest(gv_engine *engine);
// The same for one, from outside.
void gv_engine_wake_object(gv_engine *engine, int object);

// Has any hand been placed?
static inline bool gv_engine_any_placed(const gv_engine *e) { return e->hand[0].placed || e->hand[1].placed; }
// The body that a limb of either hand is.
static inline int gv_engine_body_of_limb(const gv_engine *e, int limb) {
  return e->hand[limb / GV_LIMBS].first_body + limb % GV_LIMBS;
}

// Broad phase, narrow phase and contacts of this step into engine->contact and solver_contact.
void gv_engine_collide(gv_engine *engine);

#endif
