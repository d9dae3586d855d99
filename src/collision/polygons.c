// SPDX-License-Identifier: BSD-3-Clause
// A penetration depth for every polygon that a shape touches: the paper's further work. The side of A that
// faces a polygon is clipped against the prism that the polygon sweeps along its own normal; the lowest point
// left is how far A has come into this polygon. Polygons that face away from the contact are left out: a
// thin plate's back is not touched. Frame of B. Pure; any thread.
#include "collision/cso.h"

enum { CORNERS = 2 * GV_MAX_FACE_VERTICES + 8 };

static const double facing = 0.3;   // least cosine of the polygon's normal and the contact's (72 degrees)

typedef struct side { gv_vec3 p[CORNERS]; int count; } side;

static double along_axis(const gv_core *box, int k, gv_vec3 d) {
  return box->R.m[0][k] * d.x + box->R.m[1][k] * d.y + box->R.m[2][k] * d.z;
}

static void box_side(const gv_core *box, gv_vec3 d, side *out) {
  int k = 0;
  for (int i = 1; i < 3; i++)
    if (fabs(along_axis(box, i, d)) > fabs(along_axis(box, k, d))) k = i;
  double sign = along_axis(box, k, d) >= 0 ? 1 : -1;
  gv_vec3 c = gv_mad(box->center, sign, box->axis[k]), u = box->axis[(k + 1) % 3], v = box->axis[(k + 2) % 3];
  out->count = 4;
  out->p[0] = gv_add(gv_add(c, u), v);
  out->p[1] = gv_add(gv_sub(c, u), v);
  out->p[2] = gv_sub(gv_sub(c, u), v);
  out->p[3] = gv_sub(gv_add(c, u), v);
}

static void hull_side(const gv_core *core, gv_vec3 d, side *out) {
  const gv_hull *hull = core->hull;
  gv_vec3 d_hull = gv_mat3_mul_t(&core->R, d);
  int best = 0;
  for (int f = 1; f < hull->face_count; f++)
    if (gv_dot(hull->face_normal[f], d_hull) > gv_dot(hull->face_normal[best], d_hull)) best = f;
  out->count = 0;
  if (hull->face_count == 0) {  // a ball: its one vertex
    out->p[out->count++] = gv_add(core->center, gv_mat3_mul(&core->R, hull->vertex[0]));
    return;
  }
  for (int k = hull->face_start[best]; k < hull->face_start[best + 1]; k++)
    out->p[out->count++] = gv_add(core->center, gv_mat3_mul(&core->R, hull->vertex[hull->face_vertex[k]]));
}

// The side of A that faces along d: a point, a segment or a polygon.
static void take_side(const gv_core *a, gv_vec3 d, side *out) {
  switch (a->kind) {
    case GV_CORE_BOX: box_side(a, d, out); return;
    case GV_CORE_HULL: hull_side(a, d, out); return;
    case GV_CORE_SEGMENT: break;
  }
  out->count = 2;
  out->p[0] = gv_sub(a->center, a->axis[0]);
  out->p[1] = gv_add(a->center, a->axis[0]);
}

// Sutherland and Hodgman 1974, for closed polygons and for segments and points (open: no edge back).
static void clip(const side *in, gv_vec3 at, gv_vec3 outward, side *out) {
  int n = in->count, edges = n > 2 ? n : n - 1;
  out->count = 0;
  for (int k = 0; k < n && out->count + 2 <= CORNERS; k++) {
    gv_vec3 p = in->p[k], q = in->p[(k + 1) % n];
    double hp = gv_dot(outward, gv_sub(p, at)), hq = gv_dot(outward, gv_sub(q, at));
    if (hp <= 0) out->p[out->count++] = p;
    if (k < edges && (hp <= 0) != (hq <= 0)) out->p[out->count++] = gv_mad(p, hp / (hp - hq), gv_sub(q, p));
  }
}

// Lowest point of A's side over polygon f, as its height above the polygon; false where none is over it.
static bool lowest_over(const gv_hull *hull, int f, const side *of_a, gv_vec3 *out_point, double *out_height) {
  side work[2];
  int now = 0, first = hull->face_start[f], count = hull->face_start[f + 1] - first;
  gv_vec3 n = hull->face_normal[f];
  work[0] = *of_a;
  for (int k = 0; k < count && work[now].count > 0; k++, now = !now) {
    gv_vec3 p = hull->vertex[hull->face_vertex[first + k]], q = hull->vertex[hull->face_vertex[first + (k + 1) % count]];
    clip(&work[now], p, gv_cross(gv_sub(q, p), n), &work[!now]);
  }
  *out_height = HUGE_VAL;
  for (int i = 0; i < work[now].count; i++) {
    double height = gv_dot(n, work[now].p[i]) - hull->face_offset[f];
    if (height < *out_height) { *out_height = height; *out_point = work[now].p[i]; }
  }
  return work[now].count > 0;
}

int gv_polygon_depths(const gv_pair *pair, gv_vec3 normal_world, double margin, gv_polygon_depth out[], int max) {
  const gv_shape *a = pair->a, *b = pair->b;
  if (b->kind != GV_CORE_HULL) return 0;
  const gv_hull *hull = b->hull;
  gv_core core;
  gv_core_place(a, gv_pose_mul(gv_pose_inv(*pair->T_world_b), *pair->T_world_a), &core);
  gv_vec3 n = gv_rotate_inv(pair->T_world_b->q, normal_world);
  const double radii = a->radius + b->radius;
  int count = 0;
  for (int f = 0; f < hull->face_count && count < max; f++) {
    gv_vec3 up = hull->face_normal[f], point = gv_v3(0, 0, 0);
    uint16_t hint = 0;
    int operations = 0;
    double height;
    if (gv_dot(up, n) < facing) continue;
    if (gv_dot(up, gv_core_support(&core, gv_neg(up), &hint, &operations)) - hull->face_offset[f] > radii + margin) continue;
    side of_a;
    take_side(&core, gv_neg(up), &of_a);
    if (!lowest_over(hull, f, &of_a, &point, &height) || height > radii + margin) continue;
    out[count++] = (gv_polygon_depth){(uint16_t)f, radii - height, gv_transform(*pair->T_world_b, gv_mad(point, -height, up)),
                                      gv_rotate(pair->T_world_b->q, up)};
  }
  return count;
}
