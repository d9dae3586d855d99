// SPDX-License-Identifier: BSD-3-Clause
// Shapes of the collision space. Every shape is a convex core plus a sphere (the paper's Minkowski
// sums): a finger limb is a segment + sphere, the palm a box + sphere, an object's piece a convex
// hull + a sphere that is mostly nothing (a ball is a point + sphere, a capsule a segment + sphere).
// The narrow phase works on the cores; the radius is a margin.
#ifndef GLOVED_SHAPE_H
#define GLOVED_SHAPE_H

#include <stddef.h>
#include <stdint.h>

#include "gloved/arena.h"
#include "gloved/limits.h"
#include "gloved/math.h"

#ifdef __cplusplus
extern "C" {
#endif

// A convex polyhedron, immutable after loading. Faces are planar polygons, counter-clockwise seen
// from outside, coplanar triangles merged. All arrays are the owner's (usually an arena's).
typedef struct gv_hull {
  int vertex_count, face_count;
  const gv_vec3 *vertex;           // [vertex_count] in the body frame, metres
  const gv_vec3 *face_normal;      // [face_count] unit, outward
  const double *face_offset;       // [face_count] n . x = offset on the plane
  const uint16_t *face_start;      // [face_count + 1] into face_vertex
  const uint16_t *face_vertex;     // polygon corners
  const uint16_t *neighbor_start;  // [vertex_count + 1] into neighbor
  const uint16_t *neighbor;        // vertices joined by an edge (for hill climbing)
  const uint16_t *neighbor_face;   // the face to the left of each of these edges: all faces around the vertex
  gv_vec3 center;                  // mean of the vertices: a point inside
  gv_vec3 aabb_min, aabb_max;      // body frame, of the vertices
  double radius;  // metres, of the sphere that rounds the polyhedron; a ball has one vertex, no face
} gv_hull;

typedef enum gv_core_kind { GV_CORE_SEGMENT, GV_CORE_BOX, GV_CORE_HULL } gv_core_kind;

typedef struct gv_shape {
  gv_core_kind kind;
  double radius;        // of the sphere added to the core, metres
  gv_vec3 half;         // segment: half length in x, others 0; box: half extents
  const gv_hull *hull;  // hull only
} gv_shape;

static inline gv_shape gv_shape_capsule(double half_length, double radius) {
  return (gv_shape){GV_CORE_SEGMENT, radius, {half_length, 0, 0}, NULL};
}
static inline gv_shape gv_shape_rounded_box(gv_vec3 half, double radius) {
  return (gv_shape){GV_CORE_BOX, radius, half, NULL};
}
static inline gv_shape gv_shape_hull(const gv_hull *hull) {
  return (gv_shape){GV_CORE_HULL, hull->radius, {0, 0, 0}, hull};
}

// Build the convex hull of `count` points into the arena: only points on the hull are kept, coplanar facets
// merge into polygons. Corners of a long side that a file has rounded off its plane (by up to 4e-6 m) are
// moved back into it. Set-up only: cost about vertices x faces. The order of the points is not kept. Errors
// (negative): GV_HULL_FEW (under 4 points), GV_HULL_FLAT (no volume), GV_HULL_NOT_FINITE, GV_HULL_VERTICES /
// GV_HULL_FACES / GV_HULL_POLYGON (over GV_MAX_...), GV_HULL_MEMORY (arena full).
enum {
  GV_HULL_FEW = -1,
  GV_HULL_FLAT = -2,
  GV_HULL_NOT_FINITE = -3,
  GV_HULL_VERTICES = -4,
  GV_HULL_FACES = -5,
  GV_HULL_POLYGON = -6,
  GV_HULL_MEMORY = -7,
  GV_HULL_DEGENERATE = -8
};
int gv_hull_build(gv_arena *arena, const gv_vec3 *points, int count, gv_hull *out_hull);

// Pieces by name, metres, all sizes above 0. 0, or GV_HULL_NOT_FINITE, GV_HULL_FLAT, GV_HULL_MEMORY, or what
// gv_hull_build says of sizes a thousand times apart. Ball and capsule are exact; of the others: cylinder,
// cone upright (along z) about `center`, the middle of their height, the cone's point up. Their circles are
// polygons of GV_ROUND_SIDES sides, off by at most 0.06 % of the radius, as much outside as inside. An
// ellipsoid of half axes along x, y, z: off by at most 0.3 % of the longest, less the nearer it is to a ball.
enum { GV_ROUND_SIDES = 64 };
int gv_hull_ball(gv_arena *arena, gv_vec3 center, double radius, gv_hull *out_hull);
int gv_hull_capsule(gv_arena *arena, gv_vec3 from, gv_vec3 to, double radius, gv_hull *out_hull);
int gv_hull_cylinder(gv_arena *arena, gv_vec3 center, double radius, double height, gv_hull *out_hull);
int gv_hull_cone(gv_arena *arena, gv_vec3 center, double radius, double height, gv_hull *out_hull);
int gv_hull_ellipsoid(gv_arena *arena, gv_vec3 center, gv_vec3 half, gv_hull *out_hull);
// To the corners of the polygon that stands for a circle.
double gv_round_radius(double radius);
// A text for such an error ("no volume: all points lie in one plane").
const char *gv_hull_error(int error);

// Mass properties at uniform density: volume (m^3), centre, and inertia per mass about the centre (m^2).
// Of a ball, a capsule, or the polyhedron: what a radius adds to a polyhedron is left out.
typedef struct gv_mass_properties {
  double volume;
  gv_vec3 center;
  gv_mat3 inertia;
} gv_mass_properties;
gv_mass_properties gv_hull_mass_properties(const gv_hull *hull);
// By formula, of the true shapes.
gv_mass_properties gv_ball_mass(gv_vec3 center, double radius);
gv_mass_properties gv_capsule_mass(gv_vec3 from, gv_vec3 to, double radius);
gv_mass_properties gv_cylinder_mass(gv_vec3 center, double radius, double height);
gv_mass_properties gv_cone_mass(gv_vec3 center, double radius, double height);
gv_mass_properties gv_ellipsoid_mass(gv_vec3 center, gv_vec3 half);
// Sum of several parts at the same density (parallel axes).
gv_mass_properties gv_mass_properties_sum(const gv_mass_properties *parts, int count);

#ifdef __cplusplus
}
#endif

#endif
