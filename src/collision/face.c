// SPDX-License-Identifier: BSD-3-Clause
// Picking the side of a core that faces a direction, and clipping polygons by planes (Sutherland and Hodgman
// 1974). Pure; any thread. Cost: 20 to 60 ns a side, 5 ns a corner and plane.
#include "collision/face.h"

#include <assert.h>

_Static_assert((int)GV_MAX_HULL_FACES < (int)GV_NO_FACE, "no face has the number that means none");
_Static_assert((int)GV_FACE_CORNERS >= 2 * GV_MAX_FACE_VERTICES,
               "each plane of a clip adds a corner at most");

enum { SCAN_UP_TO = 24 };  // faces: below, a scan is faster than a walk

static const double flat = 1 - 1e-9;  // cosine: no other face is nearer (45 microradians)

// The best face so far by the cosine of its normal and d, frame of the hull.
typedef struct best_face {
  int index;
  double cosine;
} best_face;

static void better_face_at(const gv_hull *hull, int vertex, gv_vec3 d, best_face *io_best) {
  assert(vertex >= 0 && vertex < hull->vertex_count);
  for (int k = hull->neighbor_start[vertex]; k < hull->neighbor_start[vertex + 1]; k++) {
    double cosine = gv_dot(hull->face_normal[hull->neighbor_face[k]], d);
    if (cosine > io_best->cosine)
      *io_best = (best_face){hull->neighbor_face[k], cosine};
  }
}

static int scan_faces(const gv_hull *hull, gv_vec3 d) {
  int best = 0;
  double high = gv_dot(hull->face_normal[0], d);
  for (int f = 1; f < hull->face_count; f++) {
    double cosine = gv_dot(hull->face_normal[f], d);
    if (!(cosine > high))
      continue;
    high = cosine;
    best = f;
  }
  return best;
}

// Around the farthest vertex, and on while a face at one of the face's corners is nearer: on long thin faces
// the first may not be the best.
static int walk_faces(const gv_hull *hull, uint16_t *vertex, gv_vec3 d, int *io_operations) {
  *vertex = (uint16_t)gv_hull_support(hull, d, *vertex, io_operations);
  int first = hull->neighbor_face[hull->neighbor_start[*vertex]];
  int from = -1;
  best_face best = {first, gv_dot(hull->face_normal[first], d)};
  better_face_at(hull, *vertex, d, &best);
  while (best.index != from && best.cosine < flat) {
    from = best.index;
    *io_operations += 6 * (hull->face_start[from + 1] - hull->face_start[from]);
    for (int k = hull->face_start[from]; k < hull->face_start[from + 1]; k++)
      if (hull->face_vertex[k] != *vertex)
        better_face_at(hull, hull->face_vertex[k], d, &best);
  }
  return best.index;
}

void gv_face_of_hull(const gv_core *core, int f, gv_face *out) {
  const gv_hull *hull = core->hull;
  assert(f >= 0 && f < hull->face_count);
  const uint16_t *corner = &hull->face_vertex[hull->face_start[f]];
  out->count = hull->face_start[f + 1] - hull->face_start[f];
  out->normal = gv_core_turn(core, hull->face_normal[f]);
  out->index = (uint16_t)f;
  for (int k = 0; k < out->count; k++)
    out->p[k] = gv_core_vertex(core, corner[k]);
}

static void take_hull_side(const gv_core *core, gv_vec3 d, uint16_t *vertex, gv_face *out,
                           int *io_operations) {
  const gv_hull *hull = core->hull;
  gv_vec3 d_hull = gv_core_turn_back(core, d);
  if (hull->face_count > SCAN_UP_TO) {
    gv_face_of_hull(core, walk_faces(hull, vertex, d_hull, io_operations), out);
    return;
  }
  *io_operations += hull->face_count;
  gv_face_of_hull(core, scan_faces(hull, d_hull), out);
}

static void take_points(gv_face *out, int count) {
  assert(count == 1 || count == 2);
  out->count = count;
  out->normal = gv_v3(0, 0, 0);
  out->index = GV_NO_FACE;
}

static void take_box_side(const gv_core *core, gv_vec3 d, gv_face *out) {
  gv_vec3 d_box = gv_mat3_mul_t(&core->R, d);
  const double along[3] = {d_box.x, d_box.y, d_box.z};
  int k = fabs(along[1]) > fabs(along[0]) ? 1 : 0;
  if (fabs(along[2]) > fabs(along[k]))
    k = 2;
  double side = along[k] >= 0 ? 1 : -1;
  gv_vec3 c = gv_mad(core->center, side, core->axis[k]);
  gv_vec3 u = core->axis[(k + 1) % 3];
  gv_vec3 v = gv_scale(core->axis[(k + 2) % 3], side);
  out->count = 4;
  out->normal = gv_scale(gv_mat3_column(&core->R, k), side);
  out->index = GV_NO_FACE;
  out->p[0] = gv_add(gv_add(c, u), v);
  out->p[1] = gv_add(gv_sub(c, u), v);
  out->p[2] = gv_sub(gv_sub(c, u), v);
  out->p[3] = gv_sub(gv_add(c, u), v);
}

void gv_face_towards(const gv_core *core, gv_vec3 d, uint16_t *vertex, gv_face *out, int *io_operations) {
  switch (core->kind) {
    case GV_CORE_BOX: take_box_side(core, d, out); return;
    case GV_CORE_SEGMENT:
      take_points(out, 2);
      out->p[0] = gv_sub(core->center, core->axis[0]);
      out->p[1] = gv_add(core->center, core->axis[0]);
      return;
    case GV_CORE_HULL: break;
  }
  if (!gv_core_is_point(core)) {
    take_hull_side(core, d, vertex, out, io_operations);
    return;
  }
  take_points(out, 1);
  out->p[0] = gv_core_vertex(core, 0);
}

// Segments and points are open: no edge leads back.
void gv_face_clip(const gv_face *in, gv_vec3 at, gv_vec3 outward, double slack, gv_face *out) {
  assert(slack >= 0.0);
  int n = in->count;
  int edges = n > 2 ? n : n - 1;
  double outside = slack * gv_norm(outward);
  double hp = gv_dot(outward, gv_sub(in->p[0], at)) - outside;
  assert(n >= 1 && in != out);
  out->count = 0;
  for (int k = 0; k < n && out->count + 2 <= GV_FACE_CORNERS; k++) {
    gv_vec3 p = in->p[k];
    if (hp <= 0)
      out->p[out->count++] = p;
    if (k == edges)
      break;
    gv_vec3 q = in->p[k + 1 < n ? k + 1 : 0];
    double hq = gv_dot(outward, gv_sub(q, at)) - outside;
    if ((hp <= 0) != (hq <= 0))
      out->p[out->count++] = gv_mad(p, hp / (hp - hq), gv_sub(q, p));
    hp = hq;
  }
}
