// SPDX-License-Identifier: BSD-3-Clause
// What an engine is made of: shared by engine.c (the step), contact.c (its collision part) and view.c.
#ifndef ENGINE_STATE_H
#define ENGINE_STATE_H

#include "hand/condition.h"
#include "hand/coupling.h"
#include "dynamics/dynamics.h"
#include "gloved/arena.h"
#include "gloved/engine.h"
#include "gloved/narrow.h"

typedef struct gv_aabb { gv_vec3 min, max; } gv_aabb;

static inline void gv_aabb_join(gv_aabb *box, const gv_aabb *other) {
  const gv_vec3 a = other->min, b = other->max;
  box->min = gv_v3(a.x < box->min.x ? a.x : box->min.x, a.y < box->min.y ? a.y : box->min.y, a.z < box->min.z ? a.z : box->min.z);
  box->max = gv_v3(b.x > box->max.x ? b.x : box->max.x, b.y > box->max.y ? b.y : box->max.y, b.z > box->max.z ? b.z : box->max.z);
}

struct gv_engine {
  gv_config cfg;
  const gv_scene *scene;
  gv_arena arena;
  gv_dynamics *dyn;
  gv_condition condition;
  gv_spring spring[GV_LIMBS];
  gv_shape limb_shape[GV_LIMBS];
  double limb_reach[GV_LIMBS];         // farthest surface point from the limb's origin, m
  double limb_inertia[GV_LIMBS];
  double angle[GV_SENSORS];            // of the skeleton in this step, rad
  gv_pose wrist;                       // T_world_wrist of this step
  gv_pose skeleton[GV_LIMBS];          // T_world_limb of this step
  gv_body_state driver[GV_LIMBS];      // the same with velocities
  gv_pose ahead[GV_LIMBS];             // T_world_driver as it will be after the step, if it goes on at its velocity
  gv_joint_axis joint[GV_SENSORS];     // of the driver
  gv_vec3 felt_f[GV_LIMBS], felt_t[GV_LIMBS]; // by the person at the end of the last step: the opposite of the coupling
  bool placed;
  // collision: bounds of this step, caches from step to step
  gv_shape *piece_shape;               // [piece_count]
  gv_aabb *piece_box;                  // [piece_count] in the object's own frame
  gv_aabb body_box[GV_MAX_OBJECTS];    // around the pieces of each, own frame
  gv_aabb object_box[GV_MAX_OBJECTS];  // the same in the world, grown by the object's margin
  gv_vec3 limb_axis[GV_LIMBS][3];      // half extents of the cores along the limbs' axes, world; a segment has the first
  gv_aabb limb_box[GV_LIMBS], hand_box; // world, grown by the limbs' margins; around all of them
  double margin[GV_BODIES];            // how far each body's surface may come in this step, m
  gv_body_state predicted[GV_BODIES];  // poses of this step, velocities as they would be after it without contacts
  int still_steps[GV_MAX_OBJECTS];     // how long an object has not moved
  bool resting[GV_MAX_OBJECTS];        // not simulated until something comes near
  int moving_count, moving[GV_MAX_OBJECTS]; // objects that are simulated in this step, in their order
  double object_reach[GV_MAX_OBJECTS]; // farthest vertex from the body's origin, m
  gv_pair_cache *limb_cache;           // [GV_LIMBS][piece_count]
  gv_pair_cache *piece_cache;          // [piece_count (piece_count - 1) / 2]
  int contact_count, pair_count;
  gv_contact contact[GV_MAX_CONTACTS];
  gv_dynamics_contact solver_contact[GV_MAX_CONTACTS];
  gv_counters counters;
  uint32_t events;
};

// Objects that lie still and alone are put to rest at a step's end and woken at the start of collision detection.
void gv_engine_put_to_rest(gv_engine *engine);
// The same for one, from outside.
void gv_engine_wake_object(gv_engine *engine, int object);

// Broad phase, narrow phase and contacts of this step into engine->contact and solver_contact.
void gv_engine_collide(gv_engine *engine);

#endif
