// SPDX-License-Identifier: BSD-3-Clause
// Up to four points of the obstacle B - A, and the point of their hull that is nearest to the origin.
// Internal to the narrow phase.
#ifndef GLOVED_COLLISION_SIMPLEX_H
#define GLOVED_COLLISION_SIMPLEX_H

#include "collision/cso.h"

typedef struct gv_simplex {
  gv_cso_point p[4];
  double weight[4];  // of the nearest point, once solved; they add up to 1
  int count;
} gv_simplex;

// Finds the point nearest to the origin and keeps only the corners that carry it. False: the origin is inside
// (four points).
typedef bool (*gv_simplex_solver)(gv_simplex *s, gv_vec3 *out_nearest);
// The same for three points, of which the origin never is inside.
typedef gv_vec3 (*gv_triangle_solver)(gv_simplex *s);

bool gv_simplex_solve(gv_simplex *s, gv_vec3 *out_nearest);
gv_vec3 gv_simplex_solve_triangle(gv_simplex *s);
// A tetrahedron by way of its sides, each asked of the solver given.
bool gv_simplex_solve_tetrahedron(gv_simplex *s, gv_triangle_solver triangle, gv_vec3 *out_nearest);
// The nearest point v once more, to the last digit.
gv_vec3 gv_simplex_polish(const gv_simplex *s, gv_vec3 v);
// The witness point of A that belongs to it.
gv_vec3 gv_simplex_on_a(const gv_simplex *s);

#endif
