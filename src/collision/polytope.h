// SPDX-License-Identifier: BSD-3-Clause
// A closed convex surface of triangles that grows point by point, in memory of the caller: what the
// hull builder (set-up, up to GV_MAX_HULL_VERTICES points) and the expanding polytope (real time, up to
// GV_EPA_MAX_VERTICES) share.
#ifndef GLOVED_POLYTOPE_H
#define GLOVED_POLYTOPE_H

#include <stdbool.h>
#include <stdint.h>

#include "gloved/math.h"

typedef struct gv_polytope_face {
  gv_vec3 normal;        // unit, outward
  double offset;         // normal . x on the plane, metres
  uint16_t vertex[3];    // counter-clockwise from outside
  uint16_t adjacent[3];  // face across the edge vertex[k], vertex[k + 1]
  uint8_t state;         // dead, alive or seen from the point being added
} gv_polytope_face;

typedef struct gv_polytope_edge {  // of the horizon, while a point is added
  uint16_t from, to;               // as the dying face has them
  uint16_t outside;                // face that stays, across the edge
  uint16_t outside_edge;
  gv_vec3 normal;  // of the face that will take the edge
  double offset;
} gv_polytope_edge;

typedef struct gv_polytope {
  const gv_vec3 *point;      // [points] the caller's
  gv_polytope_face *face;    // [face_max]
  gv_polytope_edge *edge;    // [face_max] scratch
  uint16_t *seen;            // [face_max] scratch
  uint16_t *link;            // [points] scratch
  int face_max, face_count;  // face_count: slots in use, dead ones included
  int free_head;             // list of dead slots, -1: none
  double tolerance;          // metres: a point less than this outside a face lies on it
  double least_offset;       // of a new face: a smaller one is a triangle that rounding has turned over
} gv_polytope;

static inline bool gv_polytope_alive(const gv_polytope *P, int face) { return P->face[face].state != 0; }

// Four of the `count` points that span a volume, far apart; false where all lie within `tolerance` of a plane
// (the first three then span it, or some of them are the same).
bool gv_polytope_pick_tetrahedron(const gv_vec3 *point, int count, double tolerance, uint16_t out_pick[4]);
// Start with the tetrahedron of four points (any orientation); false where a face has no area.
bool gv_polytope_start(gv_polytope *P, const uint16_t pick[4]);
// The living face that the point lies farthest outside of; -1 where it lies inside or on all faces.
int gv_polytope_most_visible(const gv_polytope *P, gv_vec3 point);
// Add a point outside the living face `seed`. False, and nothing changed, where the surface would not stay a
// closed surface of true triangles no nearer than `least_offset`, or has no room.
bool gv_polytope_add(gv_polytope *P, uint16_t point, int seed);

#endif
