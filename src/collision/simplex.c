// SPDX-License-Identifier: BSD-3-Clause
// The innermost step of the narrow phase: the point nearest to the origin of a point, segment, triangle or
// tetrahedron of the obstacle B - A (Ericson, Real-Time Collision Detection, 5.1). What decides between near
// equals is computed so that it keeps its digits on thin triangles, which shapes aligned with each other
// produce all the time. Pure; any thread. Cost: 20 to 100 ns.
#include "collision/simplex.h"

#include <assert.h>

static void drop_corner(gv_simplex *s, int k) {
  assert(k >= 0 && k < s->count);
  s->count--;
  s->p[k] = s->p[s->count];
}

static void swap_ends(gv_simplex *s) {
  gv_cso_point p = s->p[0];
  s->p[0] = s->p[1];
  s->p[1] = p;
}

// The nearer end comes first. However near to it the point is, the other end stays: between edges that almost
// touch a step of 1e-15 m along the edge still turns the direction by radians.
static gv_vec3 solve_segment(gv_simplex *s) {
  assert(s->count == 2);
  if (gv_norm2(s->p[1].w) < gv_norm2(s->p[0].w))
    swap_ends(s);
  gv_vec3 a = s->p[0].w;
  gv_vec3 edge = gv_sub(s->p[1].w, a);
  double length2 = gv_norm2(edge);
  double t = length2 > 0 ? -gv_dot(a, edge) / length2 : 0;
  if (!(t > 0)) {
    drop_corner(s, 1);
    s->weight[0] = 1;
    return a;
  }
  s->weight[0] = 1 - t;
  s->weight[1] = t;
  return gv_mad(a, t, edge);
}

static gv_vec3 solve_edges(gv_simplex *s, const bool wanted[3]) {
  gv_simplex best = *s;
  gv_vec3 v = gv_v3(HUGE_VAL, 0, 0);
  for (int k = 0; k < 3; k++) {
    if (!wanted[k])
      continue;
    gv_simplex edge = *s;
    drop_corner(&edge, k);
    gv_vec3 v_edge = solve_segment(&edge);
    if (!(gv_norm2(v_edge) < gv_norm2(v)))
      continue;
    v = v_edge;
    best = edge;
  }
  *s = best;
  return v;
}

// The foot of the origin on the plane, where that is inside; else the nearest of the edges that the foot sees
// (opposite a corner of negative weight).
gv_vec3 gv_simplex_solve_triangle(gv_simplex *s) {
  assert(s->count == 3);
  gv_vec3 a = s->p[0].w;
  gv_vec3 b = s->p[1].w;
  gv_vec3 c = s->p[2].w;
  gv_vec3 ab = gv_sub(b, a);
  gv_vec3 ac = gv_sub(c, a);
  gv_vec3 n = gv_cross(ab, ac);
  double n2 = gv_norm2(n);
  double w[3] = {gv_dot(n, gv_cross(b, c)), gv_dot(n, gv_cross(c, a)), gv_dot(n, gv_cross(a, b))};
  bool flat = !(n2 > 1e-20 * gv_norm2(ab) * gv_norm2(ac));
  bool edge[3];
  for (int k = 0; k < 3; k++)
    edge[k] = flat || w[k] <= 0;
  if (edge[0] || edge[1] || edge[2])
    return solve_edges(s, edge);
  for (int k = 0; k < 3; k++)
    s->weight[k] = w[k] / n2;
  return gv_scale(n, gv_dot(n, a) / n2);
}

// Is the origin on the other side of the plane a, b, c than d? Undecided (a flat tetrahedron) counts as yes.
static bool is_outside(gv_vec3 a, gv_vec3 b, gv_vec3 c, gv_vec3 d) {
  gv_vec3 n = gv_cross(gv_sub(b, a), gv_sub(c, a));
  double of_origin = -gv_dot(n, a);
  double of_d = gv_dot(n, gv_sub(d, a));
  if (fabs(of_d) <= 1e-14 * gv_norm(n) * gv_norm(gv_sub(d, a)))
    return true;
  return of_d > 0 ? of_origin < 0 : of_origin > 0;
}

static inline bool solve_tetrahedron(gv_simplex *s, gv_triangle_solver triangle, gv_vec3 *out_v) {
  static const uint8_t face[4][4] = {{0, 1, 3, 2}, {1, 2, 3, 0}, {2, 0, 3, 1}, {0, 1, 2, 3}};
  gv_simplex best = *s;
  bool found = false;
  for (int f = 0; f < 4; f++) {
    gv_simplex side = {.count = 3};
    for (int k = 0; k < 3; k++)
      side.p[k] = s->p[face[f][k]];
    if (!is_outside(side.p[0].w, side.p[1].w, side.p[2].w, s->p[face[f][3]].w))
      continue;
    gv_vec3 v = triangle(&side);
    if (found && !(gv_norm2(v) < gv_norm2(*out_v)))
      continue;
    *out_v = v;
    best = side;
    found = true;
  }
  *s = best;
  return found;
}

bool gv_simplex_solve_tetrahedron(gv_simplex *s, gv_triangle_solver triangle, gv_vec3 *out_nearest) {
  assert(s->count == 4);
  return solve_tetrahedron(s, triangle, out_nearest);
}

bool gv_simplex_solve(gv_simplex *s, gv_vec3 *out_nearest) {
  assert(s->count >= 2 && s->count <= 4);
  if (s->count == 4)
    return solve_tetrahedron(s, gv_simplex_solve_triangle, out_nearest);
  *out_nearest = s->count == 3 ? gv_simplex_solve_triangle(s) : solve_segment(s);
  return true;
}

// On an edge, once more at right angles to it: exact where the difference of two near points is not.
gv_vec3 gv_simplex_polish(const gv_simplex *s, gv_vec3 v) {
  if (s->count != 2)
    return v;
  gv_vec3 edge = gv_sub(s->p[1].w, s->p[0].w);
  return gv_mad(v, -gv_dot(v, edge) / gv_norm2(edge), edge);
}

gv_vec3 gv_simplex_on_a(const gv_simplex *s) {
  assert(s->count >= 1 && s->count <= 3);
  gv_vec3 on_a = gv_scale(s->p[0].a, s->weight[0]);
  for (int k = 1; k < s->count; k++)
    on_a = gv_mad(on_a, s->weight[k], s->p[k].a);
  return on_a;
}
