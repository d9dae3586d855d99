// SPDX-License-Identifier: BSD-3-Clause
// A manifold on its way: corners of the common region of two sides, gathered by manifold.c (flat on flat) and
// limb.c (a segment along the sides of a core). Frame of B; gaps are those of the cores. Internal to the
// collision room.
#ifndef GLOVED_COLLISION_MANIFOLD_H
#define GLOVED_COLLISION_MANIFOLD_H

#include "collision/face.h"

typedef struct gv_corner {  // a contact to be
  gv_vec3 on_a, on_b;       // on the cores; on_a - on_b = gap * normal
  double gap;               // metres
  uint16_t face_b;
} gv_corner;

typedef struct gv_manifold {
  gv_vec3 n;              // unit, from B to A
  double limit, closest;  // largest gap that counts, and the least there is
  int count;
  int operations;  // counted work
  gv_corner corner[GV_FACE_CORNERS];
} gv_manifold;

// Where two sides meet: which core the reference polygon is of, and the direction away from it.
typedef struct gv_reference {
  const gv_core *core;
  bool of_b;
  gv_vec3 up;  // unit: n where it is of B, else -n
} gv_reference;

static const double gv_manifold_steep = 0.3;  // least cosine of reference face and normal (72 degrees)
static const double gv_manifold_on_side =
    1e-9;  // metres: a corner this far outside the prism is still inside

// Height of q over the face, measured along `up`.
static inline double gv_gap_over(const gv_face *face, gv_vec3 up, gv_vec3 q) {
  return gv_dot(face->normal, gv_sub(q, face->p[0])) / gv_dot(face->normal, up);
}

// A corner at p of the incident side, `gap` over the reference. face_b: the polygon of B that it belongs to.
void gv_manifold_add(gv_manifold *m, const gv_reference *reference, gv_vec3 p, double gap, uint16_t face_b);
// The corners of a limb, a segment, along the sides of the reference's core. vertex: of that core, near the
// contact; io_face: its side that faces the limb best, changed to the one that the limb lies over.
void gv_manifold_add_limb(gv_manifold *m, const gv_reference *reference, int vertex, const gv_face *segment,
                          gv_face *io_face);

#endif
