// SPDX-License-Identifier: BSD-3-Clause
// Support functions and bounds of the shapes: h_S(d), the farthest point of a shape along a direction,
// which is all that the narrow phase knows of a shape (Eqn 5 to 7 of the paper). A hull is climbed along
// its edges from the last answer. Pure; any thread.
#include "collision/cso.h"

// A vertex none of whose neighbours is higher is a highest one: the edges of a convex polyhedron span
// its cone. Each move is strictly upwards, so no vertex comes twice and the loop ends.
int gv_hull_support(const gv_hull *hull, gv_vec3 d, int start, int *io_operations) {
  int here = start < hull->vertex_count ? start : 0;
  int last = -1;
  double high = gv_dot(hull->vertex[here], d);
  while (here != last) {
    last = here;
    *io_operations += 2 + hull->neighbor_start[last + 1] - hull->neighbor_start[last];
    for (int k = hull->neighbor_start[last]; k < hull->neighbor_start[last + 1]; k++) {
      double height = gv_dot(hull->vertex[hull->neighbor[k]], d);
      if (!(height > high))
        continue;
      high = height;
      here = hull->neighbor[k];
    }
  }
  return here;
}

// A capsule's core is a segment as a limb's is, with the same numbers of its ends, but anywhere in its frame.
static void make_segment(const gv_hull *hull, gv_core *io) {
  const gv_vec3 half = gv_scale(gv_sub(hull->vertex[1], hull->vertex[0]), 0.5);
  io->kind = GV_CORE_SEGMENT;
  io->center = gv_add(io->center, gv_mat3_mul(&io->R, hull->center));
  io->axis[0] = gv_mat3_mul(&io->R, half);
  io->axis[1] = io->axis[2] = gv_v3(0, 0, 0);
}

static bool is_capsule(const gv_shape *shape) {
  return shape->kind == GV_CORE_HULL && shape->hull->vertex_count == 2;
}

void gv_core_place(const gv_shape *shape, gv_pose T_b_shape, gv_core *out) {
  out->kind = shape->kind;
  out->center = T_b_shape.p;
  out->hull = shape->hull;
  out->in_place = false;
  out->R = gv_mat3_from_quat(T_b_shape.q);
  out->axis[0] = gv_scale(gv_mat3_column(&out->R, 0), shape->half.x);
  out->axis[1] = gv_scale(gv_mat3_column(&out->R, 1), shape->half.y);
  out->axis[2] = gv_scale(gv_mat3_column(&out->R, 2), shape->half.z);
  if (is_capsule(shape))
    make_segment(shape->hull, out);
}

void gv_core_in_place(const gv_shape *shape, gv_core *out) {
  const gv_vec3 half = shape->half;
  *out = (gv_core){
    .kind = shape->kind,
    .hull = shape->hull,
    .in_place = true,
    .R = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}},
    .axis = {{half.x, 0, 0}, {0, half.y, 0}, {0, 0, half.z}},
  };
  if (is_capsule(shape))
    make_segment(shape->hull, out);
}

gv_vec3 gv_core_support(const gv_core *core, gv_vec3 d, uint16_t *hint, int *io_operations) {
  unsigned vertex;
  *io_operations += 3;
  if (core->kind == GV_CORE_HULL) {
    const gv_vec3 d_hull = core->in_place ? d : gv_mat3_mul_t(&core->R, d);
    vertex = (unsigned)gv_hull_support(core->hull, d_hull, *hint, io_operations);
  } else {
    vertex = gv_dot(core->axis[0], d) >= 0;
    const int axes = core->kind == GV_CORE_BOX ? 3 : 1;
    for (int k = 1; k < axes; k++)
      vertex |= (unsigned)(gv_dot(core->axis[k], d) >= 0) << k;
  }
  *hint = (uint16_t)vertex;
  return gv_core_vertex(core, vertex);
}

double gv_core_height(const gv_shape *shape, gv_vec3 d, uint16_t *hint, int *io_operations) {
  *io_operations += 3;
  const gv_vec3 half = shape->half;
  if (shape->kind != GV_CORE_HULL)
    return fabs(d.x) * half.x + fabs(d.y) * half.y + fabs(d.z) * half.z;
  *hint = (uint16_t)gv_hull_support(shape->hull, d, *hint, io_operations);
  return gv_dot(shape->hull->vertex[*hint], d);
}

gv_vec3 gv_support(const gv_shape *shape, const gv_pose *T_world_shape, gv_vec3 d_world, uint16_t *hint) {
  uint16_t own_hint = 0;
  int operations = 0;
  gv_core core;
  gv_core_place(shape, *T_world_shape, &core);
  gv_vec3 p = gv_core_support(&core, d_world, hint ? hint : &own_hint, &operations);
  return gv_mad(p, shape->radius, gv_normalize_or(d_world, gv_v3(0, 0, 1)));
}
