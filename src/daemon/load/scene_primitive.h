// SPDX-License-Identifier: BSD-3-Clause
// Shapes that a scene file gives by name and sizes: box, ball, capsule, cylinder, cone, ellipsoid. Each has
// one piece and polygons to be shown by; what is touched and weighed is the true shape (gloved/shape.h says
// how true). Main thread, before the loop starts.
#ifndef GLOVED_SCENE_PRIMITIVE_H
#define GLOVED_SCENE_PRIMITIVE_H

#include "daemon/load/conf.h"
#include "gloved/scene.h"

typedef enum gv_primitive_kind {
  GV_PRIMITIVE_NONE,
  GV_PRIMITIVE_BOX,
  GV_PRIMITIVE_BALL,
  GV_PRIMITIVE_CAPSULE,
  GV_PRIMITIVE_CYLINDER,
  GV_PRIMITIVE_CONE,
  GV_PRIMITIVE_ELLIPSOID,
  GV_PRIMITIVE_KINDS
} gv_primitive_kind;

typedef struct gv_primitive {
  gv_primitive_kind kind;
  gv_conf_node node;                              // where it stands
  double size_m[3];                               // as the file gives them
  int vertex_count, triangle_count, point_count;  // of the polygons; of the piece
} gv_primitive;

// The group's primitive; kind NONE where it has none. Refuses two of them.
gv_primitive gv_primitive_find(gv_conf_group *group);
// For messages: "box = [x, y, z]; ball = radius; ..."
const char *gv_primitive_list(void);

// Its polygons in the object's frame, counter-clockwise from outside.
void gv_primitive_mesh(const gv_primitive *primitive, gv_vec3 *out_vertex, gv_triangle *out_triangle);
// Its piece, seen from `origin` of the object's frame. 0, or an error of gv_hull_build.
int gv_primitive_hull(const gv_primitive *primitive, gv_vec3 origin, gv_arena *arena, gv_hull *out);
// In the object's frame; hull: as built with the origin zero.
gv_mass_properties gv_primitive_mass(const gv_primitive *primitive, const gv_hull *hull);

#endif
