// SPDX-License-Identifier: BSD-3-Clause
// The narrow phase `libccd`: as much of the package as serves, in the frame of narrow.c. The one file that
// knows it.
//
// Apart: libccd's distances of a point from a segment and a triangle under our GJK walk. Overlapping: its
// Minkowski portal refinement (MPR, Snethen 2008) for a direction, then the "shift": A is moved out along n
// by its height and a bit, the distance of the moved pair gives the next n, and the last one's distance less
// the move is the depth. With the normal of the last time MPR is not asked at all.
//
// libccd is asked in millimetres: it compares areas and squared lengths with an absolute epsilon of 2e-16,
// which in metres is the size of its own rounding. It allocates nothing here (its EPA, which does, is not
// used). MPR's loops are not all under max_iterations, so support calls are counted, and MPR is left by
// longjmp at MOST_SUPPORTS. The shift finds a local minimum of the depth: the least where a pair is followed
// from step to step, sometimes not the least of a pair seen for the first time deep inside (seven starts, up
// to 0.6 mm above it). Pure; any thread.
#include <ccd/ccd.h>
#include <ccd/vec3.h>
#include <setjmp.h>

#include "collision/gjk.h"
#include "collision/phase.h"

enum { MOST_SUPPORTS = 400, MPR_ITERATIONS = 100, SHIFTS = 16, STARTS = 6 };

static const double mm = 1000.0;             // per metre
static const double no_weight = 1e-12;       // a corner that carries less of the nearest point carries none
static const double same_depth = 1e-12;      // metres
static const double least_clearance = 1e-3;  // metres between the shapes when A has been moved out

static ccd_vec3_t to_mm(gv_vec3 v) { return (ccd_vec3_t)CCD_VEC3_STATIC(mm * v.x, mm * v.y, mm * v.z); }
static gv_vec3 from_mm(const ccd_vec3_t *v) { return gv_v3(v->v[0] / mm, v->v[1] / mm, v->v[2] / mm); }

// ---- the nearest point of a simplex ----

static gv_vec3 keep_corner(gv_simplex *s, int k) {
  s->p[0] = s->p[k];
  s->count = 1;
  s->weight[0] = 1;
  return s->p[0].w;
}

static gv_vec3 solve_segment(gv_simplex *s) {
  ccd_vec3_t from = to_mm(s->p[0].w);
  ccd_vec3_t to = to_mm(s->p[1].w);
  ccd_vec3_t nearest;
  ccdVec3PointSegmentDist2(ccd_vec3_origin, &from, &to, &nearest);
  gv_vec3 v = from_mm(&nearest);
  gv_vec3 edge = gv_sub(s->p[1].w, s->p[0].w);
  double length2 = gv_norm2(edge);
  double t = length2 > 0 ? gv_dot(gv_sub(v, s->p[0].w), edge) / length2 : 0;
  if (!(t > no_weight))
    return keep_corner(s, 0);  // metres to millimetres and back is rounding too
  if (t >= 1 - no_weight)
    return keep_corner(s, 1);
  s->count = 2;
  s->weight[0] = 1 - t;
  s->weight[1] = t;
  return v;
}

// Keeps the corners that carry the point; weights are areas of the parts of the triangle. Returns the point
// that they make, which is in the triangle.
static gv_vec3 weigh_triangle(const gv_simplex *s, const double area[3], gv_simplex *out) {
  gv_vec3 v = gv_v3(0, 0, 0);
  double sum = 0;
  out->count = 0;
  for (int k = 0; k < 3; k++) {
    if (!(area[k] > no_weight))
      continue;
    out->p[out->count] = s->p[k];
    out->weight[out->count++] = area[k];
    sum += area[k];
  }
  for (int k = 0; k < out->count; k++) {
    out->weight[k] /= sum;
    v = gv_mad(v, out->weight[k], out->p[k].w);
  }
  return v;
}

static gv_vec3 solve_edges(gv_simplex *s) {
  gv_simplex best = *s;
  gv_vec3 v = gv_v3(HUGE_VAL, 0, 0);
  for (int k = 0; k < 3; k++) {
    gv_simplex edge = {.count = 2, .p = {s->p[k], s->p[(k + 1) % 3]}};
    gv_vec3 v_edge = solve_segment(&edge);
    if (!(gv_norm2(v_edge) < gv_norm2(v)))
      continue;
    v = v_edge;
    best = edge;
  }
  *s = best;
  return v;
}

// libccd's answer for a triangle without height can lie centimetres outside: what counts is the point of the
// triangle that its weights make, and where they make none, the nearest of the edges.
static gv_vec3 solve_triangle(gv_simplex *s) {
  ccd_vec3_t corner[3], nearest;
  gv_simplex carrying;
  for (int k = 0; k < 3; k++)
    corner[k] = to_mm(s->p[k].w);
  ccdVec3PointTriDist2(ccd_vec3_origin, &corner[0], &corner[1], &corner[2], &nearest);
  gv_vec3 asked = from_mm(&nearest);
  gv_vec3 a = gv_sub(s->p[0].w, asked);
  gv_vec3 b = gv_sub(s->p[1].w, asked);
  gv_vec3 c = gv_sub(s->p[2].w, asked);
  gv_vec3 n = gv_cross(gv_sub(b, a), gv_sub(c, a));
  double n2 = gv_norm2(n);
  const double area[3] = {
    gv_dot(n, gv_cross(b, c)) / n2,
    gv_dot(n, gv_cross(c, a)) / n2,
    gv_dot(n, gv_cross(a, b)) / n2,
  };
  gv_vec3 v = weigh_triangle(s, area, &carrying);
  if (!(n2 > 0) || carrying.count == 0)
    return solve_edges(s);
  *s = carrying;
  return s->count == 2 ? solve_segment(s) : v;  // areas do not tell an end from a point near it
}

static bool solve(gv_simplex *s, gv_vec3 *out_nearest) {
  if (s->count == 4)
    return gv_simplex_solve_tetrahedron(s, solve_triangle, out_nearest);
  *out_nearest = s->count == 3 ? solve_triangle(s) : solve_segment(s);
  return true;
}

// ---- a direction out of an overlap: MPR ----

typedef struct asked {
  jmp_buf way_out;
  int supports;
  int *operations;
} asked;

typedef struct side {  // one core, as libccd sees it
  const gv_core *core;
  uint16_t *hint;
  asked *asked;
} side;

static void support(const void *object, const ccd_vec3_t *direction, ccd_vec3_t *out) {
  const side *s = object;
  *s->asked->operations += 10;
  if (++s->asked->supports > MOST_SUPPORTS)
    longjmp(s->asked->way_out, 1);
  gv_vec3 d = gv_v3(direction->v[0], direction->v[1], direction->v[2]);
  *out = to_mm(gv_core_support(s->core, d, s->hint, s->asked->operations));
}

static void center(const void *object, ccd_vec3_t *out) {
  *out = to_mm(gv_core_center(((const side *)object)->core));
}

// The direction that MPR would move A out along, or `otherwise`.
static gv_vec3 ask_mpr(const gv_cso *cso, gv_vec3 otherwise) {
  asked query = {.operations = cso->operations};
  const side A = {&cso->a, &cso->cache->vertex_a, &query};
  const side B = {&cso->b, &cso->cache->vertex_b, &query};
  ccd_real_t depth;
  ccd_vec3_t direction, position;
  ccd_t ccd;
  CCD_INIT(&ccd);
  ccd.support1 = support;
  ccd.support2 = support;
  ccd.center1 = center;
  ccd.center2 = center;
  ccd.max_iterations = MPR_ITERATIONS;
  ccd.mpr_tolerance = 1e-9 * mm;
  if (setjmp(query.way_out))
    return otherwise;
  if (ccdMPRPenetration(&B, &A, &ccd, &depth, &direction, &position))
    return otherwise;
  gv_vec3 n = gv_v3(direction.v[0], direction.v[1], direction.v[2]);
  return gv_norm2(n) > 0.5 ? gv_normalize_or(n, otherwise) : otherwise;
}

// ---- depth by distances alone: the shift ----

typedef struct overlap {
  double depth;  // of the cores along n, metres; never less than the true one
  gv_vec3 n, on_a;
} overlap;

static double height(const gv_cso *cso, gv_vec3 n) { return gv_dot(gv_cso_support(cso, n).w, n); }

// A local minimum of the height, from n downhill, into *io_best where it is less.
static void shift_out(const gv_cso *cso, gv_vec3 n, overlap *io_best, int *io_iterations) {
  gv_cso moved = *cso;
  for (int i = 0; i < SHIFTS; i++) {
    double h = height(cso, n);
    double move = h + fmax(least_clearance, 0.5 * fabs(h));
    moved.a.center = gv_mad(cso->a.center, move, n);
    gv_gjk g = {.cso = &moved, .solve = solve, .limit = HUGE_VAL, .simplex = {.count = 1}};
    g.simplex.p[0] = gv_cso_support(&moved, n);
    gv_gjk_outcome end = gv_gjk_walk(&g);
    *io_iterations += g.iterations;
    if (end != GV_GJK_APART)
      return;
    double distance = gv_norm(g.nearest);
    gv_vec3 next = gv_scale(g.nearest, -1.0 / distance);
    double depth = move * gv_dot(n, next) - distance;
    double gain = io_best->depth - depth;
    if (gain < -same_depth)
      return;
    *io_best = (overlap){depth, next, gv_mad(gv_simplex_on_a(&g.simplex), -move, n)};
    if (gain < same_depth && gv_norm2(gv_sub(next, n)) < 1e-20)
      return;  // A's witness lies over B's
    n = next;
  }
}

// From those of the six axes along which the overlap is less than `share` of the best so far. True: one was
// better.
static bool shift_from_axes(const gv_cso *cso, double share, overlap *io_best, int *io_iterations) {
  const gv_vec3 axis[STARTS] = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
  double before = io_best->depth;
  for (int k = 0; k < STARTS; k++)
    if (height(cso, axis[k]) < share * io_best->depth)
      shift_out(cso, axis[k], io_best, io_iterations);
  return io_best->depth < before - same_depth;
}

static void find_depth(const gv_cso *cso, gv_vec3 guess, bool warm, gv_distance *out) {
  gv_cso_point p = gv_cso_support(cso, guess);
  overlap best = {gv_dot(p.w, guess), guess, p.a};
  best.depth += 1e-12;  // the same direction with the foot under it is better
  shift_out(cso, guess, &best, &out->iterations);
  // Where an axis was better, the guess led nowhere, or is of another life.
  if (!warm || shift_from_axes(cso, 1.0, &best, &out->iterations)) {
    shift_out(cso, ask_mpr(cso, guess), &best, &out->iterations);
    shift_from_axes(cso, 4.0, &best, &out->iterations);
  }
  out->distance = -best.depth;
  out->normal_world = best.n;
  out->on_a = best.on_a;
  out->method = GV_DISTANCE_SHIFT;
  cso->cache->corners = 0;
  cso->cache->overlap = 1;
}

const gv_phase gv_phase_libccd = {solve, NULL, find_depth};
