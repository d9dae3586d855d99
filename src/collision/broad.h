// SPDX-License-Identifier: BSD-3-Clause
// Broad phase: boxes around limbs, objects and pieces, and the list of pairs whose boxes meet. Boxes of a
// limb and of an object are the world's, grown by how far the body's surface may come within the step; boxes
// of pieces are made once, in their object's own frame, and others are turned into it. Memory of the caller;
// real-time thread.
#ifndef GLOVED_COLLISION_BROAD_H
#define GLOVED_COLLISION_BROAD_H

#include "base/body_state.h"
#include "gloved/narrow.h"
#include "gloved/scene.h"

typedef struct gv_aabb {
  gv_vec3 min, max;
} gv_aabb;

// A limb or a piece of an object (shape_a), and a piece of another object, whose boxes meet.
typedef struct gv_candidate {
  gv_pair_cache *cache;
  uint16_t shape_a, piece_b;  // limb number where body_a is a limb, else piece number
  uint8_t body_a, body_b;     // limbs, then objects, then limbs of a second hand; a moves
} gv_candidate;

typedef struct gv_broad {
  const gv_scene *scene;
  double step_s, contact_margin_m;
  int hands;
  int second_hand;  // number of the first body of a second hand: behind the last object
  gv_shape limb_shape[GV_HANDS * GV_LIMBS];  // those of a second hand behind the first one's
  double limb_reach[GV_HANDS * GV_LIMBS];    // farthest surface point from the limb's origin, m
  gv_shape *piece_shape;                     // [piece_count]
  gv_aabb *piece_box;                        // [piece_count] in the object's own frame
  gv_aabb body_box[GV_MAX_OBJECTS];          // around the pieces of each, own frame
  uint64_t joined[GV_MAX_OBJECTS];           // bit of each object that a joint holds this one to: the two do
                                             // not collide
  double object_reach[GV_MAX_OBJECTS];       // farthest vertex from the body's origin, m
  // of this step
  gv_body_state predicted[GV_BODIES];  // poses of this step, velocities after it without contacts
  double margin[GV_BODIES];            // how far each body's surface may come in this step, m
  gv_vec3 limb_axis[GV_HANDS * GV_LIMBS]
                   [3];  // half extents along the limbs' axes, world; a segment has the first
  gv_aabb limb_box[GV_HANDS * GV_LIMBS];
  gv_aabb hand_box[GV_HANDS];  // that no other box meets, of a hand that is not there
  gv_aabb object_box[GV_MAX_OBJECTS];
  int pair_count;  // at most GV_MAX_PAIRS
  int dropped;     // pairs that there was no room for
  gv_candidate pair[GV_MAX_PAIRS];
  // warm starts, from step to step
  gv_pair_cache *limb_cache;   // [GV_LIMBS of each hand][piece_count]
  gv_pair_cache *piece_cache;  // [piece_count (piece_count - 1) / 2]
} gv_broad;

static inline bool gv_broad_is_limb(const gv_broad *broad, int body) {
  return gv_body_is_limb(body, broad->second_hand);
}
static inline bool gv_aabb_meet(const gv_aabb *a, const gv_aabb *b) {
  return a->min.x <= b->max.x && b->min.x <= a->max.x && a->min.y <= b->max.y && b->min.y <= a->max.y &&
         a->min.z <= b->max.z && b->min.z <= a->max.z;
}

// Set-up: arrays from the arena (false: it is full), then the pieces. Limb shapes are the caller's to fill
// in.
bool gv_broad_alloc(gv_broad *broad, gv_arena *arena, const gv_scene *scene, int hands);
void gv_broad_init(gv_broad *broad, double step_s, double contact_margin_m);
// Drop the warm starts; no hand is there any more.
void gv_broad_forget(gv_broad *broad);

// An object was placed from outside: which side of what it came from says nothing any more.
void gv_broad_forget_sides(gv_broad *broad, int object);

// Bounds from predicted[], which the caller has written. All limbs of a hand,
// then objects one by one.
void gv_broad_bound_limbs(gv_broad *broad, int hand);
void gv_broad_bound_object(gv_broad *broad, int object);
// Does the box of any limb meet the object's?
bool gv_broad_hand_is_near(const gv_broad *broad, int object);

// The list of pairs, from empty: the hands' first. Limbs have no pairs with limbs. moving: the objects that
// are simulated, in their order.
void gv_broad_list_none(gv_broad *broad);
void gv_broad_list_hand(gv_broad *broad, int hand);
void gv_broad_list_objects(gv_broad *broad, const int moving[], int moving_count);

const gv_shape *gv_broad_shape_a(const gv_broad *broad, const gv_candidate *pair);

#endif
