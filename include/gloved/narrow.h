// SPDX-License-Identifier: BSD-3-Clause
// Narrow phase: signed distance of two convex shapes and their contact manifold (section C of the
// paper, Eqn 5 to 8: collision and penetration on the configuration space obstacle A - B).
//
// There are two: `core`, ours, and `libccd`, the package's primitives in the same frame
// (src/collision/libccd.c). While the cores are apart the GJK distance of the cores less the radii is the
// answer, exact to rounding. When the cores overlap, `core` searches with an expanding polytope in fixed
// memory; where that fails its own checks, the least of the face directions bounds it. `libccd` asks MPR for
// a direction and moves the shapes apart along it until their distance gives the depth. Nothing here
// allocates, loops without a bound, or returns a not-a-number for finite input. Only nearly concentric balls
// of hundreds of vertices reach the bound of `core`: every direction is then about as good, and the answer, a
// true h of a true side, can be above the least. Pure; any thread.
#ifndef GLOVED_NARROW_H
#define GLOVED_NARROW_H

#include <stdint.h>

#include "gloved/shape.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum gv_narrow { GV_NARROW_CORE, GV_NARROW_LIBCCD } gv_narrow;

// Kept by the caller from step to step for one pair: a warm start. All zero is a valid cold start.
typedef struct gv_pair_cache {
  gv_vec3 normal_world;         // last normal, or zero
  uint16_t vertex_a, vertex_b;  // last support vertices (hill climbing); of a segment or box its signs,
                                // bit by bit
  uint16_t corner_a[3], corner_b[3],
      corners;          // vertices whose differences carried the nearest point; 0: none
  uint8_t overlap;      // 1: the cores overlapped, the corners are those of the side
  uint8_t inside;       // 1: the surfaces overlapped along normal_world when a manifold was asked for
  uint16_t operations;  // of the last answer, for the next step's budget; 0: none yet
  uint8_t high_first;   // 1: A was the piece of the higher number (collision/broad.c)
  float urgency_m;      // the last answer's depth, and what may have come since (collision/queue.c)
} gv_pair_cache;

// How the distance was found. shift: libccd's way to a depth. side: along the last normal, of a manifold
// whose nearer side is the opposite one. beyond: farther apart than was asked for.
typedef enum gv_distance_method {
  GV_DISTANCE_GJK,
  GV_DISTANCE_EPA,
  GV_DISTANCE_FACES,
  GV_DISTANCE_SHIFT,
  GV_DISTANCE_SIDE,
  GV_DISTANCE_BEYOND
} gv_distance_method;

typedef struct gv_distance {
  double distance;       // metres; negative: penetration depth (Eqn 8)
  gv_vec3 normal_world;  // unit, from B to A: moving A along it by -distance separates
  gv_vec3 on_a, on_b;    // witness points: on the surfaces (radii included), world; on_a - on_b =
                         // distance * normal
  gv_distance_method method;
  int iterations;  // of GJK and of the search for the depth together
  int operations;  // counted work: about 10 instructions each (`make instructions` compares)
} gv_distance;

// Did the cores overlap, so that the depth had to be searched for?
static inline bool gv_distance_overlaps(const gv_distance *d) {
  return d->method != GV_DISTANCE_GJK && d->method != GV_DISTANCE_BEYOND;
}

// Two shapes where they are.
typedef struct gv_pair {
  const gv_shape *a;
  const gv_pose *T_world_a;
  const gv_shape *b;
  const gv_pose *T_world_b;
} gv_pair;

// Signed distance of A and B. Where it is larger than `max_distance` (metres, >= 0) the search may stop
// early: method GV_DISTANCE_BEYOND, distance a lower bound above max_distance, and normal, points not set.
// core: within 1e-8 m of exact (`make bench-accuracy`; DESIGN.md). libccd: within 1e-8 m where the cores are
// apart; its depth is that of a local minimum, which a warm cache follows; from a cold one it can be
// millimetres above the least. Cost: apart 0.15 to 0.2 us with a warm cache, 0.4 us (segment-box) to 3 us
// (two hulls of 1000 vertices) with a cold one; overlapping 0.2 to 6 us, 0.1 ms at worst (0.3 ms for the
// balls above); 25 ns where the last normal shows that they are far apart.
void gv_distance_pair(gv_narrow narrow, const gv_pair *pair, double max_distance, gv_pair_cache *cache,
                      gv_distance *out);

typedef struct gv_contact_point {
  gv_vec3 position_world;  // midway between the surfaces
  gv_vec3 normal_world;    // unit, from B to A
  double depth;            // metres; positive: penetration, negative: gap
  uint16_t face_b;         // polygon of hull B that this point belongs to (0xffff: none)
} gv_contact_point;

// Contact manifold: the closest point and, flat on flat, the clipped corners, each with a depth of its
// own. At most GV_MAX_PAIR_CONTACTS, none deeper than reported, none with a gap over `margin` (metres).
// Returns the count (0: further apart than margin). A limb lying along a face gives 2 points, a palm or
// box on a face 4. `out_distance` (may be null) receives the pair's distance.
int gv_manifold_pair(gv_narrow narrow, const gv_pair *pair, double margin, gv_pair_cache *cache,
                     gv_contact_point out[GV_MAX_PAIR_CONTACTS], gv_distance *out_distance);

typedef struct gv_polygon_depth {
  uint16_t face;           // polygon of hull B
  double depth;            // metres: how far A has come into it along its own normal; negative: a gap
  gv_vec3 position_world;  // on the polygon, under A's lowest point
  gv_vec3 normal_world;    // of the polygon
} gv_polygon_depth;

// A depth for every polygon of hull B that A touches or comes nearer to than `margin`: the deepest point of A
// over each polygon, along that polygon's normal. normal_world: of the pair's contact; polygons more than 72
// degrees away from it are left out. Returns the count, at most max; 0 where B is no hull or a ball.
// Cost: 10 ns a polygon of B, and 0.3 us each that is touched.
int gv_polygon_depths(const gv_pair *pair, gv_vec3 normal_world, double margin, gv_polygon_depth out[],
                      int max);

// Support function h_S(d) of a shape (radius included): the farthest point along the direction d (any
// length > 0), world frame. `hint` (may be null): start vertex for hill climbing, updated.
gv_vec3 gv_support(const gv_shape *shape, const gv_pose *T_world_shape, gv_vec3 d_world, uint16_t *hint);

#ifdef __cplusplus
}
#endif

#endif
