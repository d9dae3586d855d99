// SPDX-License-Identifier: BSD-3-Clause
// Shapes by name: one table says their keys, sizes and polygons. All but the box are bodies of revolution
// about z: a pole, circles from north to south, a pole. Main thread, before the loop starts.
#include "daemon/load/scene_primitive.h"

#include <assert.h>
#include <stdio.h>
#include <string.h>

#define LEAST_M 1e-3  // of a whole edge or length
#define MOST_M 10.0   // as MAX_COORDINATE_M of a mesh

typedef struct description {
  const char *key, *shape;  // how it is written, for messages
  int sizes;
  double least_m, most_m;  // of each size
  int circles, sides;      // of a body of revolution
  int points;              // of its piece
} description;

enum {
  BOX_VERTICES = 8,
  BOX_TRIANGLES = 12,
  ROUND = GV_ROUND_SIDES,
  CAP = 6 /* circles of a capsule's end */
};

static const description described[GV_PRIMITIVE_KINDS] = {
  [GV_PRIMITIVE_BOX] = {"box", "[x, y, z], whole edges in metres", 3, LEAST_M, MOST_M, 0, 0, BOX_VERTICES},
  [GV_PRIMITIVE_BALL] = {"ball", "the radius in metres", 1, LEAST_M, MOST_M / 2, 11, 24, 1},
  [GV_PRIMITIVE_CAPSULE] = {"capsule", "[radius, length from tip to tip] in metres", 2, LEAST_M / 2, MOST_M,
                            2 * CAP, 32, 2},
  [GV_PRIMITIVE_CYLINDER] = {"cylinder", "[radius, height] in metres", 2, LEAST_M / 2, MOST_M, 2, ROUND,
                             2 * ROUND},
  [GV_PRIMITIVE_CONE] = {"cone", "[radius of the base, height] in metres", 2, LEAST_M / 2, MOST_M, 1, ROUND,
                         ROUND + 1},
  [GV_PRIMITIVE_ELLIPSOID] = {"ellipsoid", "[x, y, z], half axes in metres", 3, LEAST_M / 2, MOST_M / 2, 15,
                              32, 512},
};

const char *gv_primitive_list(void) {
  return "box = [x, y, z]; ball = radius; capsule = [radius, length]; cylinder = [radius, height]; "
         "cone = [radius, height]; ellipsoid = [x, y, z]; or vertices = ( [x, y, z], ... ); with triangles "
         "and pieces";
}

static void count_polygons(gv_primitive *io) {
  const description *d = &described[io->kind];
  io->point_count = d->points;
  io->vertex_count = io->kind == GV_PRIMITIVE_BOX ? BOX_VERTICES : d->circles * d->sides + 2;
  io->triangle_count = io->kind == GV_PRIMITIVE_BOX ? BOX_TRIANGLES : 2 * d->circles * d->sides;
}

static void read_sizes(gv_conf_group *group, gv_primitive *io) {
  const description *d = &described[io->kind];
  for (int i = 0; i < 3; i++)
    io->size_m[i] = 1;
  if (d->sizes == 1)
    gv_conf_number(group, d->key, d->least_m, d->most_m, &io->size_m[0]);
  else
    gv_conf_numbers(group, d->key, d->least_m, d->most_m, d->sizes, d->shape, io->size_m);
  const double radius = io->size_m[0];
  const double length = io->size_m[1];
  if (io->kind != GV_PRIMITIVE_CAPSULE || group->node.conf->failed)
    return;
  if (!(length - 2 * radius > 1e-6))
    gv_conf_fail(io->node,
                 "a capsule of radius %g is longer than %g; give its length from tip to tip, or ball = %g",
                 radius, 2 * radius, radius);
}

gv_primitive gv_primitive_find(gv_conf_group *group) {
  gv_primitive found = {.kind = GV_PRIMITIVE_NONE};
  for (int k = 1; k < GV_PRIMITIVE_KINDS; k++) {
    const gv_conf_node node = gv_conf_find(group, described[k].key);
    if (!gv_conf_has(node))
      continue;
    if (found.kind) {
      gv_conf_fail(node, "'%s' beside '%s'; give one of the two", described[k].key,
                   described[found.kind].key);
      return found;
    }
    found.kind = (gv_primitive_kind)k;
    found.node = node;
  }
  if (!found.kind)
    return found;
  static const char *const list[3] = {"vertices", "triangles", "pieces"};
  for (int i = 0; i < 3; i++) {
    const gv_conf_node other = gv_conf_find(group, list[i]);
    if (gv_conf_has(other))
      gv_conf_fail(other, "'%s' beside '%s'; give one of the two", list[i], described[found.kind].key);
  }
  count_polygons(&found);
  read_sizes(group, &found);
  return found;
}

// ---- polygons -------------------------------------------------------------------------------------

// Corner i of a box: bit 0 is x, bit 1 is y, bit 2 is z; the triangles are counter-clockwise from outside.
static void make_box(const double size[3], gv_vec3 *vertex, gv_triangle *triangle) {
  static const gv_triangle side[BOX_TRIANGLES] = {
    {{0, 2, 3}}, {{0, 3, 1}}, {{4, 5, 7}}, {{4, 7, 6}}, {{0, 1, 5}}, {{0, 5, 4}},
    {{2, 6, 7}}, {{2, 7, 3}}, {{0, 4, 6}}, {{0, 6, 2}}, {{1, 3, 7}}, {{1, 7, 5}},
  };
  for (int i = 0; i < BOX_VERTICES; i++)
    vertex[i] = gv_v3((i & 1 ? 0.5 : -0.5) * size[0], (i & 2 ? 0.5 : -0.5) * size[1],
                      (i & 4 ? 0.5 : -0.5) * size[2]);
  memcpy(triangle, side, sizeof side);
}

typedef struct circle {
  double radius, z;
} circle;

// Circle i of `count` between the poles of a unit ball.
static circle latitude(int i, int count) {
  double s, c;
  gv_sincos(GV_PI * (1 + i) / (count + 1), &s, &c);
  return (circle){s, c};
}

// Circle i of a capsule: each end has CAP of them, its equator the last.
static circle capsule_circle(double radius, double length, int i) {
  const int from_pole = i < CAP ? i : 2 * CAP - 1 - i;
  const double middle = (i < CAP ? 0.5 : -0.5) * (length - 2 * radius);
  double s, c;
  gv_sincos(0.5 * GV_PI * (1 + from_pole) / CAP, &s, &c);
  return (circle){radius * s, middle + (i < CAP ? radius : -radius) * c};
}

static circle circle_of(const gv_primitive *p, int i) {
  const double *size = p->size_m;
  switch (p->kind) {
    case GV_PRIMITIVE_CAPSULE: return capsule_circle(size[0], size[1], i);
    case GV_PRIMITIVE_CYLINDER: return (circle){gv_round_radius(size[0]), (i ? -0.5 : 0.5) * size[1]};
    case GV_PRIMITIVE_CONE: return (circle){gv_round_radius(size[0]), -0.5 * size[1]};
    case GV_PRIMITIVE_BALL:
    case GV_PRIMITIVE_ELLIPSOID: return latitude(i, described[p->kind].circles);
    case GV_PRIMITIVE_NONE:
    case GV_PRIMITIVE_BOX:
    case GV_PRIMITIVE_KINDS: break;
  }
  assert(false);
  return (circle){0, 0};
}

// What the circles are multiplied by along x, y, z; z too for the poles.
static gv_vec3 scale_of(const gv_primitive *p) {
  const double *size = p->size_m;
  if (p->kind == GV_PRIMITIVE_BALL)
    return gv_v3(size[0], size[0], size[0]);
  if (p->kind == GV_PRIMITIVE_ELLIPSOID)
    return gv_v3(size[0], size[1], size[2]);
  return gv_v3(1, 1, 1);
}

// Vertex 0 is the north pole, the last the south pole, between them circles from north to south.
static void make_vertices(const gv_primitive *p, gv_vec3 *vertex) {
  const int sides = described[p->kind].sides;
  const gv_vec3 scale = scale_of(p);
  const bool unit = p->kind == GV_PRIMITIVE_BALL || p->kind == GV_PRIMITIVE_ELLIPSOID;
  const double pole = unit ? scale.z : 0.5 * p->size_m[1];
  vertex[0] = gv_v3(0, 0, pole);
  vertex[p->vertex_count - 1] = gv_v3(0, 0, -pole);
  for (int i = 0; i < p->vertex_count - 2; i++) {
    const circle c = circle_of(p, i / sides);
    double sin_a, cos_a;
    gv_sincos(2 * GV_PI * (i % sides) / sides, &sin_a, &cos_a);
    vertex[1 + i] = gv_v3(scale.x * c.radius * cos_a, scale.y * c.radius * sin_a, scale.z * c.z);
  }
}

static void make_triangles(const gv_primitive *p, gv_triangle *triangle) {
  const uint32_t sides = (uint32_t)described[p->kind].sides;
  const uint32_t last = (uint32_t)p->vertex_count - 1;
  const uint32_t south = last - sides;
  for (uint32_t k = 0; k < sides; k++) {
    const uint32_t next = (k + 1) % sides;
    *triangle++ = (gv_triangle){{0, 1 + k, 1 + next}};
    *triangle++ = (gv_triangle){{last, south + next, south + k}};
    for (uint32_t c = 1; c + sides < last; c += sides) {
      *triangle++ = (gv_triangle){{c + k, c + sides + k, c + sides + next}};
      *triangle++ = (gv_triangle){{c + k, c + sides + next, c + next}};
    }
  }
}

void gv_primitive_mesh(const gv_primitive *p, gv_vec3 *out_vertex, gv_triangle *out_triangle) {
  if (p->kind == GV_PRIMITIVE_BOX) {
    make_box(p->size_m, out_vertex, out_triangle);
    return;
  }
  make_vertices(p, out_vertex);
  make_triangles(p, out_triangle);
}

// ---- what is touched and weighed ------------------------------------------------------------------

static gv_vec3 capsule_end(const gv_primitive *p, double sign) {
  return gv_v3(0, 0, sign * (0.5 * p->size_m[1] - p->size_m[0]));
}

static int build_box(const gv_primitive *p, gv_vec3 origin, gv_arena *arena, gv_hull *out) {
  gv_vec3 point[BOX_VERTICES];
  gv_triangle unused[BOX_TRIANGLES];
  make_box(p->size_m, point, unused);
  for (int i = 0; i < BOX_VERTICES; i++)
    point[i] = gv_sub(point[i], origin);
  return gv_hull_build(arena, point, BOX_VERTICES, out);
}

int gv_primitive_hull(const gv_primitive *p, gv_vec3 origin, gv_arena *arena, gv_hull *out) {
  const gv_vec3 center = gv_neg(origin);
  const double *size = p->size_m;
  switch (p->kind) {
    case GV_PRIMITIVE_BOX: return build_box(p, origin, arena, out);
    case GV_PRIMITIVE_BALL: return gv_hull_ball(arena, center, size[0], out);
    case GV_PRIMITIVE_CAPSULE: {
      const gv_vec3 low = gv_add(center, capsule_end(p, -1));
      return gv_hull_capsule(arena, low, gv_add(center, capsule_end(p, 1)), size[0], out);
    }
    case GV_PRIMITIVE_CYLINDER: return gv_hull_cylinder(arena, center, size[0], size[1], out);
    case GV_PRIMITIVE_CONE: return gv_hull_cone(arena, center, size[0], size[1], out);
    case GV_PRIMITIVE_ELLIPSOID:
      return gv_hull_ellipsoid(arena, center, gv_v3(size[0], size[1], size[2]), out);
    case GV_PRIMITIVE_NONE:
    case GV_PRIMITIVE_KINDS: break;
  }
  assert(false);
  return GV_HULL_FEW;
}

gv_mass_properties gv_primitive_mass(const gv_primitive *p, const gv_hull *hull) {
  const gv_vec3 here = {0, 0, 0};
  const double *size = p->size_m;
  switch (p->kind) {
    case GV_PRIMITIVE_CYLINDER: return gv_cylinder_mass(here, size[0], size[1]);
    case GV_PRIMITIVE_CONE: return gv_cone_mass(here, size[0], size[1]);
    case GV_PRIMITIVE_ELLIPSOID: return gv_ellipsoid_mass(here, gv_v3(size[0], size[1], size[2]));
    case GV_PRIMITIVE_BOX:
    case GV_PRIMITIVE_BALL:
    case GV_PRIMITIVE_CAPSULE: break;
    case GV_PRIMITIVE_NONE:
    case GV_PRIMITIVE_KINDS: assert(false);
  }
  return gv_hull_mass_properties(hull);
}
