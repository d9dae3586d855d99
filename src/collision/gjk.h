// SPDX-License-Identifier: BSD-3-Clause
// The walk of Gilbert, Johnson and Keerthi (1988) to the point of the obstacle B - A that is nearest to the
// origin. Internal to the narrow phase.
#ifndef GLOVED_COLLISION_GJK_H
#define GLOVED_COLLISION_GJK_H

#include "collision/simplex.h"

// Cores nearer than this are treated as overlapping: the direction between two points that close is rounding.
static const double gv_touching_m = 1e-10;

typedef enum gv_gjk_outcome { GV_GJK_APART, GV_GJK_OVERLAP, GV_GJK_BEYOND } gv_gjk_outcome;

typedef struct gv_gjk {
  const gv_cso *cso;
  gv_simplex_solver solve;
  double limit;        // metres: cores farther apart than this need no exact answer
  gv_simplex simplex;  // in: where to begin, one to three points; out: the points that carry the nearest
  gv_vec3 nearest;     // out: of the obstacle, where the cores are apart
  gv_vec3 n;           // out: unit, the direction asked last; if beyond, it separates by more than limit
  int iterations;      // counted up
} gv_gjk;

// Ends after GV_GJK_MAX_ITERATIONS.
gv_gjk_outcome gv_gjk_walk(gv_gjk *g);

// The corners that carried the nearest point last time, where they are now. False: none are known.
bool gv_gjk_recall(const gv_cso *cso, gv_simplex *out);
void gv_gjk_keep(gv_pair_cache *cache, const gv_simplex *s);

#endif
