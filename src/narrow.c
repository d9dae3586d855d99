// SPDX-License-Identifier: BSD-3-Clause
// Signed distance of two shapes (section C of the paper, Eqn 5 to 8). The cores' distance is found by
// GJK (Gilbert, Johnson, Keerthi 1988) on the obstacle B - A, in the frame of B, built on libccd's
// point-segment and point-triangle distances; overlapping cores go to the expanding polytope (epa.c).
// The spheres' radii are subtracted last, so that a contact in the margin costs no more than a distance.
// Pure; any thread. At most GV_GJK_MAX_ITERATIONS + GV_EPA_MAX_ITERATIONS support evaluations and a sweep.
#include "cso.h"

#include <ccd/vec3.h>

// Cores nearer than this are treated as overlapping: the direction between two points that close is rounding.
static const double touching = 1e-9;  // metres

typedef enum outcome { APART, OVERLAP, FAR } outcome;

typedef struct simplex {
  gv_cso_point p[4];
  double weight[4];       // of the point nearest to the origin
  int count;
} simplex;

// libccd compares squared areas with the absolute 2e-16: in millimetres that is a triangle of 0.1 um sides.
static const double to_ccd = 1024.0;  // a power of two loses no bits

static ccd_vec3_t ccd_from(gv_vec3 v) { return (ccd_vec3_t)CCD_VEC3_STATIC(v.x * to_ccd, v.y * to_ccd, v.z * to_ccd); }
static gv_vec3 ccd_to(ccd_vec3_t v) { return gv_scale(gv_v3(v.v[0], v.v[1], v.v[2]), 1.0 / to_ccd); }

// Nearest point to the origin of a segment or a triangle.
static gv_vec3 nearest_of_segment(gv_vec3 a, gv_vec3 b) {
  ccd_vec3_t ca = ccd_from(a), cb = ccd_from(b), nearest;
  ccdVec3PointSegmentDist2(ccd_vec3_origin, &ca, &cb, &nearest);
  return ccd_to(nearest);
}

static gv_vec3 nearest_of_edges(gv_vec3 a, gv_vec3 b, gv_vec3 c) {
  gv_vec3 p[3] = {nearest_of_segment(a, b), nearest_of_segment(b, c), nearest_of_segment(c, a)};
  int best = 0;
  for (int i = 1; i < 3; i++)
    if (gv_norm2(p[i]) < gv_norm2(p[best])) best = i;
  return p[best];
}

static gv_vec3 nearest_of_triangle(gv_vec3 a, gv_vec3 b, gv_vec3 c) {
  gv_vec3 ab = gv_sub(b, a), ac = gv_sub(c, a);
  // libccd solves the normal equations: below this the determinant is rounding.
  if (gv_norm2(gv_cross(ab, ac)) <= 1e-13 * gv_norm2(ab) * gv_norm2(ac)) return nearest_of_edges(a, b, c);
  ccd_vec3_t ca = ccd_from(a), cb = ccd_from(b), cc = ccd_from(c), nearest;
  ccdVec3PointTriDist2(ccd_vec3_origin, &ca, &cb, &cc, &nearest);
  return ccd_to(nearest);
}

// Reduce to the corners that carry the nearest point v of the segment.
static void reduce_segment(simplex *s, gv_vec3 v) {
  gv_vec3 e = gv_sub(s->p[1].w, s->p[0].w);
  double length2 = gv_norm2(e), t = length2 > 0 ? gv_dot(gv_sub(v, s->p[0].w), e) / length2 : 0;
  s->weight[0] = 1 - t, s->weight[1] = t;
  if (t <= 1e-14 || t >= 1 - 1e-14) {
    if (t > 0.5) s->p[0] = s->p[1];
    s->count = 1, s->weight[0] = 1;
  }
}

static void drop_corner(simplex *s, int k) {
  s->count--;
  s->p[k] = s->p[s->count];
}

static void reduce_triangle(simplex *s, gv_vec3 v) {
  gv_vec3 a = gv_sub(s->p[0].w, v), b = gv_sub(s->p[1].w, v), c = gv_sub(s->p[2].w, v);
  gv_vec3 n = gv_cross(gv_sub(b, a), gv_sub(c, a));
  double area2 = gv_norm2(n), w[3] = {gv_dot(n, gv_cross(b, c)), gv_dot(n, gv_cross(c, a)), gv_dot(n, gv_cross(a, b))};
  int least = w[0] < w[1] ? 0 : 1;
  if (w[2] < w[least]) least = 2;
  if (w[least] <= 1e-14 * area2) {
    drop_corner(s, least);
    reduce_segment(s, v);
    return;
  }
  for (int k = 0; k < 3; k++) s->weight[k] = w[k] / area2;
}

// Is the origin on the other side of the plane a, b, c than d? Undecided (a flat tetrahedron) counts as yes.
static bool is_outside(gv_vec3 a, gv_vec3 b, gv_vec3 c, gv_vec3 d) {
  gv_vec3 n = gv_cross(gv_sub(b, a), gv_sub(c, a));
  double of_origin = -gv_dot(n, a), of_d = gv_dot(n, gv_sub(d, a));
  if (fabs(of_d) <= 1e-14 * gv_norm(n) * gv_norm(gv_sub(d, a))) return true;
  return of_d > 0 ? of_origin < 0 : of_origin > 0;
}

// Nearest point of a tetrahedron; false where the origin is inside.
static bool solve_tetrahedron(simplex *s, gv_vec3 *out_v) {
  static const uint8_t face[4][4] = {{0, 1, 3, 2}, {1, 2, 3, 0}, {2, 0, 3, 1}, {0, 1, 2, 3}};
  int best = -1;
  for (int f = 0; f < 4; f++) {
    gv_vec3 a = s->p[face[f][0]].w, b = s->p[face[f][1]].w, c = s->p[face[f][2]].w;
    if (!is_outside(a, b, c, s->p[face[f][3]].w)) continue;
    gv_vec3 v = nearest_of_triangle(a, b, c);
    if (best < 0 || gv_norm2(v) < gv_norm2(*out_v)) *out_v = v, best = f;
  }
  if (best < 0) return false;
  simplex old = *s;
  for (int k = 0; k < 3; k++) s->p[k] = old.p[face[best][k]];
  s->count = 3;
  reduce_triangle(s, *out_v);
  return true;
}

static bool solve_simplex(simplex *s, gv_vec3 *out_v) {
  if (s->count == 4) return solve_tetrahedron(s, out_v);
  if (s->count == 3) {
    *out_v = nearest_of_triangle(s->p[0].w, s->p[1].w, s->p[2].w);
    reduce_triangle(s, *out_v);
  } else {
    *out_v = nearest_of_segment(s->p[0].w, s->p[1].w);
    reduce_segment(s, *out_v);
  }
  return true;
}

static bool is_corner(const simplex *s, gv_vec3 w) {
  for (int k = 0; k < s->count; k++)
    if (s->p[k].w.x == w.x && s->p[k].w.y == w.y && s->p[k].w.z == w.z) return true;
  return false;
}

// The vector from the origin to the simplex once more, from the feature's own direction: exact where the
// difference of two near points is not.
static gv_vec3 polish(const simplex *s, gv_vec3 v) {
  gv_vec3 a = s->p[0].w;
  if (s->count == 1) return a;
  gv_vec3 e = gv_sub(s->p[1].w, a);
  if (s->count == 2) return gv_mad(a, -gv_dot(a, e) / gv_norm2(e), e);
  gv_vec3 n = gv_cross(e, gv_sub(s->p[2].w, a));
  double n2 = gv_norm2(n);
  return n2 > 0 ? gv_scale(n, gv_dot(n, a) / n2) : v;
}

// Walks to the point of B - A nearest to the origin. On FAR, *io_n separates by more than `limit`.
static outcome walk(const gv_cso *cso, double limit, gv_vec3 *io_n, simplex *s, gv_vec3 *out_v, int *io_iterations) {
  gv_vec3 v;
  s->p[0] = gv_cso_support(cso, *io_n);
  s->count = 1, s->weight[0] = 1;
  v = s->p[0].w;
  if (-gv_dot(*io_n, v) > limit) return FAR;
  for (int i = 0; i < GV_GJK_MAX_ITERATIONS; i++) {
    double far = gv_norm(v);
    if (far <= touching) return OVERLAP;
    ++*io_iterations;
    *io_n = gv_scale(v, -1.0 / far);
    gv_cso_point p = gv_cso_support(cso, *io_n);
    double lower = -gv_dot(*io_n, p.w);
    if (lower > limit) return FAR;
    if (far - lower <= 1e-13 * (far + gv_norm(p.w)) || is_corner(s, p.w)) break;
    simplex next = *s;
    gv_vec3 v_next;
    next.p[next.count++] = p;
    if (!solve_simplex(&next, &v_next)) return OVERLAP;
    double progress = far - gv_norm(v_next);
    if (progress > 0) *s = next, v = v_next;
    if (progress <= 1e-15 * gv_norm(p.w)) break;  // as near as rounding allows
  }
  *out_v = polish(s, v);
  return gv_norm(*out_v) <= touching ? OVERLAP : APART;
}

static void take_apart(const simplex *s, gv_vec3 v, gv_distance *out) {
  gv_vec3 on_a = gv_scale(s->p[0].a, s->weight[0]);
  for (int k = 1; k < s->count; k++) on_a = gv_mad(on_a, s->weight[k], s->p[k].a);
  out->distance = gv_norm(v);
  out->normal_world = gv_scale(v, -1.0 / out->distance);
  out->on_a = on_a;
  out->method = GV_NARROW_GJK;
}

static void take_overlap(const gv_epa_result *r, gv_narrow_method method, gv_distance *out) {
  out->distance = -r->depth;
  out->normal_world = r->normal;
  out->on_a = r->on_a;
  out->method = method;
  out->iterations += r->iterations;
}

static void find_depth(const gv_cso *cso, gv_vec3 guess, gv_distance *out) {
  gv_epa_result r, faces;
  bool found = gv_epa_run(cso, guess, &r);
  if (found && r.depth - r.lower_bound <= 1e-6) {
    take_overlap(&r, GV_NARROW_EPA, out);
    return;
  }
  gv_epa_sweep_faces(cso, guess, &faces);
  if (found && r.depth <= faces.depth) take_overlap(&r, GV_NARROW_EPA, out);
  else take_overlap(&faces, GV_NARROW_FACES, out);
}

// Cores: frame of B, spheres left out. A cached normal along which the cores overlap means that they most
// likely still do (a box at rest on a table): the polytope is asked first.
static void distance_of_cores(const gv_cso *cso, double limit, gv_vec3 cached, gv_distance *out) {
  simplex s;
  gv_epa_result r;
  gv_vec3 v = gv_v3(0, 0, 0), between = gv_sub(gv_core_center(&cso->a), gv_core_center(&cso->b));
  bool warm = gv_norm2(cached) > 0.5;
  gv_vec3 n = warm ? cached : gv_normalize_or(between, gv_v3(0, 0, 1)), guess = n;
  if (warm && gv_dot(gv_cso_support(cso, n).w, n) > 0 && gv_epa_run(cso, n, &r)) {
    if (r.lower_bound >= -touching && r.depth - r.lower_bound <= 1e-6) {
      take_overlap(&r, GV_NARROW_EPA, out);
      return;
    }
    n = r.normal;
  }
  outcome end = walk(cso, limit, &n, &s, &v, &out->iterations);
  if (end == APART) take_apart(&s, v, out);
  if (end == OVERLAP) find_depth(cso, guess, out);
  if (end == FAR) out->method = GV_NARROW_FAR, out->distance = limit, out->normal_world = n;
}

static gv_vec3 usable_normal(gv_vec3 n) {
  double length2 = gv_norm2(n);
  return length2 > 0.5 && length2 < 2 ? gv_scale(n, 1.0 / sqrt(length2)) : gv_v3(0, 0, 0);
}

void gv_distance_in_b(const gv_shape *a, const gv_pose *T_world_a, const gv_shape *b, const gv_pose *T_world_b,
                      double max_distance, gv_pair_cache *cache, gv_cso *out_cso, gv_distance *out) {
  double radii = a->radius + b->radius;
  gv_pose T_b_a = gv_pose_mul(gv_pose_inv(*T_world_b), *T_world_a);
  *out_cso = (gv_cso){gv_core_place(a, T_b_a, false), gv_core_place(b, gv_pose_identity(), true), cache};
  *out = (gv_distance){.method = GV_NARROW_FAR};
  distance_of_cores(out_cso, max_distance + radii, usable_normal(gv_rotate_inv(T_world_b->q, cache->normal_world)), out);
  out->distance -= radii;
  out->on_a = gv_mad(out->on_a, -a->radius, out->normal_world);
  out->on_b = gv_mad(out->on_a, -out->distance, out->normal_world);
  cache->normal_world = gv_rotate(T_world_b->q, out->normal_world);
}

void gv_distance_pair(const gv_shape *a, const gv_pose *T_world_a, const gv_shape *b, const gv_pose *T_world_b,
                      double max_distance, gv_pair_cache *cache, gv_distance *out) {
  gv_cso cso;
  gv_distance_in_b(a, T_world_a, b, T_world_b, max_distance, cache, &cso, out);
  out->normal_world = cache->normal_world;
  out->on_a = gv_transform(*T_world_b, out->on_a);
  out->on_b = gv_transform(*T_world_b, out->on_b);
}
