// SPDX-License-Identifier: BSD-3-Clause
// Pieces by name: ball, capsule, cylinder, cone, ellipsoid, as cores with a radius, and their mass
// properties by formula. Ball and capsule are exact (a point and a segment with a sphere). A core is a
// polyhedron, since contacts are made of its sides: cylinder and cone are prism and pyramid over a
// polygon of GV_ROUND_SIDES sides, half of it outside of the circle and half inside. An ellipsoid is a
// polyhedron inside it, rounded by nearly the least radius of curvature that it has: the rounder, the
// less is left to the polyhedron. Set-up only.
#include "gloved/shape.h"

enum { ELLIPSOID_POINTS = 512 };

static const double rounded = 0.9;  // of the least radius of curvature: the core keeps some volume
static const double golden_rad = 2.399963229728653;  // between points of a Fibonacci lattice

static bool is_size(double a) { return isfinite(a) && a > 0; }

int gv_hull_ball(gv_arena *arena, gv_vec3 center, double radius, gv_hull *out_hull) {
  static const uint16_t none[2];
  if (!gv_v3_finite(center) || !isfinite(radius))
    return GV_HULL_NOT_FINITE;
  if (!(radius > 0))
    return GV_HULL_FLAT;
  gv_vec3 *vertex = gv_arena_alloc(arena, "hull", sizeof *vertex);
  if (!vertex)
    return GV_HULL_MEMORY;
  *vertex = center;
  *out_hull = (gv_hull){.vertex_count = 1,
                        .vertex = vertex,
                        .face_start = none,
                        .neighbor_start = none,
                        .center = center,
                        .aabb_min = center,
                        .aabb_max = center,
                        .radius = radius};
  return 0;
}

int gv_hull_capsule(gv_arena *arena, gv_vec3 from, gv_vec3 to, double radius, gv_hull *out_hull) {
  static const uint16_t none[1];
  static const uint16_t neighbor_start[3] = {0, 1, 2};
  static const uint16_t neighbor[2] = {1, 0};
  if (!gv_v3_finite(from) || !gv_v3_finite(to) || !isfinite(radius))
    return GV_HULL_NOT_FINITE;
  if (!(radius > 0) || !(gv_norm(gv_sub(to, from)) > 0))
    return GV_HULL_FLAT;
  gv_vec3 *vertex = gv_arena_alloc(arena, "hull", 2 * sizeof *vertex);
  if (!vertex)
    return GV_HULL_MEMORY;
  vertex[0] = from;
  vertex[1] = to;
  *out_hull = (gv_hull){
    .vertex_count = 2,
    .vertex = vertex,
    .face_start = none,
    .neighbor_start = neighbor_start,
    .neighbor = neighbor,
    .center = gv_scale(gv_add(from, to), 0.5),
    .aabb_min = gv_v3(fmin(from.x, to.x), fmin(from.y, to.y), fmin(from.z, to.z)),
    .aabb_max = gv_v3(fmax(from.x, to.x), fmax(from.y, to.y), fmax(from.z, to.z)),
    .radius = radius,
  };
  return 0;
}

double gv_round_radius(double radius) {
  double s, c;
  gv_sincos(GV_PI / GV_ROUND_SIDES, &s, &c);
  return 2 * radius / (1 + c);
}

static void put_circle(gv_vec3 center, double radius, gv_vec3 *out) {
  for (int i = 0; i < GV_ROUND_SIDES; i++) {
    double s, c;
    gv_sincos(2 * GV_PI * i / GV_ROUND_SIDES, &s, &c);
    out[i] = gv_add(center, gv_v3(radius * c, radius * s, 0));
  }
}

int gv_hull_cylinder(gv_arena *arena, gv_vec3 center, double radius, double height, gv_hull *out_hull) {
  gv_vec3 point[2 * GV_ROUND_SIDES];
  const gv_vec3 up = {0, 0, 0.5 * height};
  if (!is_size(radius) || !is_size(height))
    return GV_HULL_FLAT;
  put_circle(gv_sub(center, up), gv_round_radius(radius), point);
  put_circle(gv_add(center, up), gv_round_radius(radius), point + GV_ROUND_SIDES);
  return gv_hull_build(arena, point, 2 * GV_ROUND_SIDES, out_hull);
}

int gv_hull_cone(gv_arena *arena, gv_vec3 center, double radius, double height, gv_hull *out_hull) {
  gv_vec3 point[GV_ROUND_SIDES + 1];
  const gv_vec3 up = {0, 0, 0.5 * height};
  if (!is_size(radius) || !is_size(height))
    return GV_HULL_FLAT;
  put_circle(gv_sub(center, up), gv_round_radius(radius), point);
  point[GV_ROUND_SIDES] = gv_add(center, up);
  return gv_hull_build(arena, point, GV_ROUND_SIDES + 1, out_hull);
}

// h(n) of an ellipsoid about the origin.
static double ellipsoid_height(gv_vec3 half, gv_vec3 n) {
  return gv_norm(gv_v3(half.x * n.x, half.y * n.y, half.z * n.z));
}

// The points of the surface over a lattice of directions, each moved inwards by
// `depth` along the surface's normal.
static void put_ellipsoid(gv_vec3 center, gv_vec3 half, double depth, gv_vec3 *out) {
  for (int i = 0; i < ELLIPSOID_POINTS; i++) {
    double z = 1 - (2 * i + 1) / (double)ELLIPSOID_POINTS, s, c;
    gv_sincos(golden_rad * i, &s, &c);
    const double flat = sqrt(1 - z * z);
    const gv_vec3 u = {flat * c, flat * s, z};
    const gv_vec3 normal = gv_normalize_or(gv_v3(u.x / half.x, u.y / half.y, u.z / half.z), u);
    const gv_vec3 surface = {half.x * u.x, half.y * u.y, half.z * u.z};
    out[i] = gv_add(center, gv_mad(surface, -depth, normal));
  }
}

int gv_hull_ellipsoid(gv_arena *arena, gv_vec3 center, gv_vec3 half, gv_hull *out_hull) {
  gv_vec3 point[ELLIPSOID_POINTS];
  if (!is_size(half.x) || !is_size(half.y) || !is_size(half.z))
    return GV_HULL_FLAT;
  const double least = fmin(fmin(half.x, half.y), half.z);
  const double most = fmax(fmax(half.x, half.y), half.z);
  if (least == most)
    return gv_hull_ball(arena, center, most, out_hull);
  const double depth = rounded * least * least / most;
  put_ellipsoid(center, half, depth, point);
  const int error = gv_hull_build(arena, point, ELLIPSOID_POINTS, out_hull);
  if (error)
    return error;
  double missing = 0;  // metres: the most that a face lies inside of the surface
  for (int f = 0; f < out_hull->face_count; f++) {
    const gv_vec3 n = out_hull->face_normal[f];
    const double height = out_hull->face_offset[f] - gv_dot(n, center) + depth;
    missing = fmax(missing, ellipsoid_height(half, n) - height);
  }
  out_hull->radius = depth + 0.5 * missing;  // as far out as in
  return 0;
}

static gv_mass_properties around_z(double volume, gv_vec3 center, double across, double along) {
  return (gv_mass_properties){volume, center, {{{across, 0, 0}, {0, across, 0}, {0, 0, along}}}};
}

gv_mass_properties gv_ball_mass(gv_vec3 center, double r) {
  return around_z(4.0 / 3.0 * GV_PI * r * r * r, center, 0.4 * r * r, 0.4 * r * r);
}

// A cylinder between two hemispheres, whose own centres lie 3/8 r beyond its ends.
gv_mass_properties gv_capsule_mass(gv_vec3 from, gv_vec3 to, double r) {
  const double length = gv_norm(gv_sub(to, from));
  const double middle = GV_PI * r * r * length;
  const double ends = 4.0 / 3.0 * GV_PI * r * r * r;
  const double volume = middle + ends;
  const double along = (0.5 * middle + 0.4 * ends) * r * r / volume;
  const double of_middle = length * length / 12 + r * r / 4;
  const double of_ends = 0.4 * r * r + length * length / 4 + 0.375 * length * r;
  const double across = (middle * of_middle + ends * of_ends) / volume;
  const gv_vec3 u = gv_scale(gv_sub(to, from), 1 / length);
  const double axis[3] = {u.x, u.y, u.z};
  gv_mass_properties m = {volume, gv_scale(gv_add(from, to), 0.5), {{{0}}}};
  for (int i = 0; i < 3; i++)
    for (int k = 0; k < 3; k++)
      m.inertia.m[i][k] = (i == k ? across : 0) + (along - across) * axis[i] * axis[k];
  return m;
}

gv_mass_properties gv_cylinder_mass(gv_vec3 center, double r, double h) {
  return around_z(GV_PI * r * r * h, center, r * r / 4 + h * h / 12, r * r / 2);
}

gv_mass_properties gv_cone_mass(gv_vec3 center, double r, double h) {
  const gv_vec3 heavy = gv_sub(center, gv_v3(0, 0, h / 4));  // a quarter of the height above the base
  return around_z(GV_PI * r * r * h / 3, heavy, 0.15 * r * r + 0.0375 * h * h, 0.3 * r * r);
}

gv_mass_properties gv_ellipsoid_mass(gv_vec3 center, gv_vec3 half) {
  const double x = half.x * half.x / 5;
  const double y = half.y * half.y / 5;
  const double z = half.z * half.z / 5;
  const double volume = 4.0 / 3.0 * GV_PI * half.x * half.y * half.z;
  return (gv_mass_properties){volume, center, {{{y + z, 0, 0}, {0, x + z, 0}, {0, 0, x + y}}}};
}
