// SPDX-License-Identifier: BSD-3-Clause
// Up to four points of the obstacle B - A, and the point of their hull that is nearest to the origin.
// Internal to the narrow phase.
#ifndef GLOVED_NARROW_SIMPLEX_H
#define GLOVED_NARROW_SIMPLEX_H

#include "collision/cso.h"

typedef struct gv_simplex {
  gv_cso_point p[4];
  double weight[4];  // of the nearest point, once solved; they add up to 1
  int count;
} gv_simplex;

// Find the nearest point and keep only the corners that carry it. False: the origin is inside (4 points).
bool gv_simplex_solve(gv_simplex *s, gv_vec3 *out_nearest);
// The same for three points.
gv_vec3 gv_simplex_solve_triangle(gv_simplex *s);
// The nearest point v once more, to the last digit.
gv_vec3 gv_simplex_polish(const gv_simplex *s, gv_vec3 v);
// The point of A under it.
gv_vec3 gv_simplex_on_a(const gv_simplex *s);

#endif
