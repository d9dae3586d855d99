// SPDX-License-Identifier: BSD-3-Clause
// The sides of a core as polygons, and clipping them: what manifolds and the depths of polygons share. Frame
// of the obstacle (that of B). Internal to the collision room.
#ifndef GLOVED_COLLISION_FACE_H
#define GLOVED_COLLISION_FACE_H

#include "collision/cso.h"

enum { GV_FACE_CORNERS = 2 * GV_MAX_FACE_VERTICES + 8, GV_NO_FACE = 0xffff };

typedef struct gv_face {
  gv_vec3 p[GV_FACE_CORNERS];  // counter-clockwise from outside
  int count;                   // 2: a segment, 1: a point; both without a normal
  gv_vec3 normal;              // unit, outward
  uint16_t index;              // of the hull, or GV_NO_FACE
} gv_face;

static inline gv_vec3 gv_core_turn(const gv_core *core, gv_vec3 v) {
  return core->in_place ? v : gv_mat3_mul(&core->R, v);
}
static inline gv_vec3 gv_core_turn_back(const gv_core *core, gv_vec3 v) {
  return core->in_place ? v : gv_mat3_mul_t(&core->R, v);
}

// The side of a core that faces d best. vertex: where a hull's climb begins, updated.
void gv_face_towards(const gv_core *core, gv_vec3 d, uint16_t *vertex, gv_face *out, int *io_operations);
// Polygon `index` of a hull.
void gv_face_of_hull(const gv_core *core, int index, gv_face *out);

// Outward from side k of the prism that the polygon sweeps along `up`; not of unit length.
static inline gv_vec3 gv_face_prism_side(const gv_face *face, int k, gv_vec3 up) {
  int next = k + 1 < face->count ? k + 1 : 0;
  return gv_cross(gv_sub(face->p[next], face->p[k]), up);
}

// What of `in` lies inside the plane through `at`, or less than `slack` metres outside it. Points only:
// normal and index are not set.
void gv_face_clip(const gv_face *in, gv_vec3 at, gv_vec3 outward, double slack, gv_face *out);

#endif
