// SPDX-License-Identifier: BSD-3-Clause
// A penetration depth for every polygon that a shape touches: the paper's further work. The side of A that
// faces a polygon is clipped against the prism that the polygon sweeps along its own normal; the lowest point
// left is how far A has come into this polygon. Polygons that face away from the contact are left out: a
// thin plate's back is not touched. Frame of B. Pure; any thread.
#include "collision/face.h"

#include <assert.h>

static const double facing = 0.3;  // least cosine of the polygon's normal and the contact's (72 degrees)

// Lowest point of A's side over the polygon, as its height above the polygon; false where none is over it.
static bool lowest_over(const gv_face *polygon, double offset, const gv_face *of_a, gv_vec3 *out_point,
                        double *out_height) {
  gv_face work[2];
  const gv_face *now = of_a;
  for (int k = 0; k < polygon->count && now->count > 0; k++) {
    gv_face_clip(now, polygon->p[k], gv_face_prism_side(polygon, k, polygon->normal), 0, &work[k % 2]);
    now = &work[k % 2];
  }
  *out_height = HUGE_VAL;
  for (int i = 0; i < now->count; i++) {
    double height = gv_dot(polygon->normal, now->p[i]) - offset;
    if (height >= *out_height)
      continue;
    *out_height = height;
    *out_point = now->p[i];
  }
  return now->count > 0;
}

int gv_polygon_depths(const gv_pair *pair, gv_vec3 normal_world, double margin, gv_polygon_depth out[],
                      int max) {
  assert(max >= 0 && margin >= 0.0 && fabs(gv_norm2(normal_world) - 1.0) < 1e-6);
  const gv_pose T_world_b = *pair->T_world_b;
  const gv_hull *hull = pair->b->hull;
  const double radii = pair->a->radius + pair->b->radius;
  const double reach = radii + margin;
  int count = 0;
  int operations = 0;
  uint16_t hint = 0;
  uint16_t vertex = 0;
  gv_core a, b;
  if (pair->b->kind != GV_CORE_HULL)
    return 0;
  gv_core_place(pair->a, gv_pose_mul(gv_pose_inv(T_world_b), *pair->T_world_a), &a);
  gv_core_in_place(pair->b, &b);
  const gv_vec3 n = gv_rotate_inv(T_world_b.q, normal_world);
  for (int f = 0; f < hull->face_count && count < max; f++) {
    const gv_vec3 up = hull->face_normal[f];
    const double offset = hull->face_offset[f];
    gv_vec3 point = gv_v3(0, 0, 0);
    gv_face polygon, of_a;
    double height;
    if (gv_dot(up, n) < facing)
      continue;
    if (gv_dot(up, gv_core_support(&a, gv_neg(up), &hint, &operations)) - offset > reach)
      continue;
    gv_face_of_hull(&b, f, &polygon);
    gv_face_towards(&a, gv_neg(up), &vertex, &of_a, &operations);
    if (!lowest_over(&polygon, offset, &of_a, &point, &height) || height > reach)
      continue;
    gv_polygon_depth *told = &out[count++];
    told->face = (uint16_t)f;
    told->depth = radii - height;
    told->position_world = gv_transform(T_world_b, gv_mad(point, -height, up));
    told->normal_world = gv_rotate(T_world_b.q, up);
  }
  return count;
}
