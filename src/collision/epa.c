// SPDX-License-Identifier: BSD-3-Clause
// Penetration depth of overlapping cores: the least support h(n) of the obstacle B - A (Eqn 8), by an
// expanding polytope in fixed memory on the stack (about 50 kB).
//
// The polytope lies inside the obstacle, so the least offset of its faces is a lower bound of the depth, also
// where it is negative (the origin still outside). Every direction that was asked gives an upper bound, h
// itself. The best of these is the answer: whatever rounding does to the polytope, the answer is a true h(n)
// of a unit n, and the search ends when the bounds meet. The obstacle is a polyhedron, so they meet exactly.
// The side of the last time and the far side are the seeds where the cores overlapped then: mostly nothing
// has to be added. Pure; any thread.
#include "collision/simplex.h"

#include <assert.h>

#include "collision/polytope.h"

// Faces whose offsets differ by less are looked at for the point under the origin.
static const double same_side = 1e-9;  // metres

// Steps while the bounds have all but met: at touching corners rounding can let the search go round in
// circles.
enum { CLOSE = 16 };

// In operations, beside the support points: a search that ends at once, and each point that is added.
enum { EPA_OPERATIONS = 150, ADD_OPERATIONS = 100 };

// A sweep asks at most 2 * 40 + 2 * 12 * 12 directions.
enum { SEEDS = 7, SWEEP_FACES = 40, SWEEP_EDGES = 12 };
_Static_assert(SEEDS + 4 + GV_EPA_MAX_ITERATIONS + GV_EPA_MAX_DESCENT + 1 <= GV_EPA_MAX_VERTICES,
               "every iteration adds a point at most");
_Static_assert(GV_EPA_MAX_FACES >= 2 * GV_EPA_MAX_VERTICES,
               "Euler: a closed surface of n points has 2 n - 4 faces");

typedef struct search {
  const gv_cso *cso;
  gv_polytope polytope;
  gv_vec3 w[GV_EPA_MAX_VERTICES], on_a[GV_EPA_MAX_VERTICES];
  gv_polytope_face face[GV_EPA_MAX_FACES];
  gv_polytope_edge edge[GV_EPA_MAX_FACES + 2];
  uint16_t seen[GV_EPA_MAX_FACES + 2], link[GV_EPA_MAX_VERTICES];
  uint16_t vertex_a[GV_EPA_MAX_VERTICES], vertex_b[GV_EPA_MAX_VERTICES];  // of the hulls, below each w
  int count;                                                              // of w
  double size;                                                            // largest |w| of the seeds, metres
  double best;                                                            // least h so far
  double unproved;  // least offset of a face that could not grow, though there was something beyond it
  gv_vec3 best_normal;
} search;

static double ask(search *s, gv_vec3 n) {
  assert(s->count >= 0 && s->count < GV_EPA_MAX_VERTICES);
  gv_cso_point p = gv_cso_support(s->cso, n);
  s->w[s->count] = p.w;
  s->on_a[s->count] = p.a;
  s->vertex_a[s->count] = s->cso->cache->vertex_a;
  s->vertex_b[s->count] = s->cso->cache->vertex_b;
  return gv_dot(p.w, n);
}

// Beyond a face: the climb along the hulls starts at one of its corners.
static double ask_beyond(search *s, const gv_polytope_face *F) {
  s->cso->cache->vertex_a = s->vertex_a[F->vertex[0]];
  s->cso->cache->vertex_b = s->vertex_b[F->vertex[0]];
  return ask(s, F->normal);
}

static void keep_point(search *s) {
  assert(s->count < GV_EPA_MAX_VERTICES);
  s->size = fmax(s->size, gv_norm(s->w[s->count]));
  s->count++;
}

// Seeds: four corners around the guess (on the face itself, where the obstacle has one there), then once
// around the obstacle: sideways, the far side, the other side. Each climb starts at the last one's end.
static void ask_seeds(search *s, gv_vec3 guess) {
  gv_vec3 t = gv_any_perpendicular(guess);
  gv_vec3 u = gv_cross(guess, t);
  const double tilt = 0.02;
  const gv_vec3 direction[SEEDS] = {
    gv_mad(guess, -tilt, t),
    gv_mad(guess, tilt, u),
    gv_mad(guess, -tilt, u),
    gv_mad(guess, tilt, t),
    t,
    gv_neg(guess),
    gv_neg(t),
  };
  for (int i = 0; i < SEEDS; i++) {
    (void)ask(s, direction[i]);
    keep_point(s);
  }
}

// The side that was the nearest last time, and the far side: mostly that is all. False where none is known.
static bool recall_seeds(search *s, gv_vec3 guess) {
  gv_cso_point p;
  if (!s->cso->cache->overlap || s->cso->cache->corners != 3)
    return false;
  for (int k = 0; k < 3; k++) {
    if (!gv_cso_recall(s->cso, k, &p))
      return false;
    s->w[k] = p.w;
    s->on_a[k] = p.a;
    s->vertex_a[k] = p.vertex_a;
    s->vertex_b[k] = p.vertex_b;
    s->size = fmax(s->size, gv_norm(p.w));
  }
  s->count = 3;
  (void)ask(s, gv_neg(guess));
  keep_point(s);
  return true;
}

// A tetrahedron of the seeds; where they lie in a plane, of what lies off that plane too.
static bool start_polytope(search *s) {
  double tolerance = 1e-9 * s->size;
  uint16_t pick[4];
  if (!gv_polytope_pick_tetrahedron(s->w, s->count, tolerance, pick)) {
    gv_vec3 x = gv_sub(s->w[pick[1]], s->w[pick[0]]);
    gv_vec3 y = gv_sub(s->w[pick[2]], s->w[pick[0]]);
    gv_vec3 along = gv_normalize_or(x, gv_v3(0, 0, 1));
    gv_vec3 across = gv_normalize_or(gv_cross(x, y), gv_any_perpendicular(along));
    gv_vec3 other = gv_cross(across, along);
    const gv_vec3 direction[4] = {across, gv_neg(across), other, gv_neg(other)};
    for (int i = 0; i < 4; i++) {
      (void)ask(s, direction[i]);
      keep_point(s);
    }
    if (!gv_polytope_pick_tetrahedron(s->w, s->count, tolerance, pick))
      return false;
  }
  return gv_polytope_start(&s->polytope, pick);
}

static void add_seeds(search *s) {
  for (int i = 0; i < s->count; i++) {
    int seed = gv_polytope_most_visible(&s->polytope, s->w[i]);
    if (seed < 0)
      continue;
    *s->cso->operations += ADD_OPERATIONS;
    (void)gv_polytope_add(&s->polytope, (uint16_t)i, seed);
  }
}

static int find_nearest_face(const gv_polytope *P) {
  int best = -1;
  for (int f = 0; f < P->face_count; f++)
    if (gv_polytope_alive(P, f) && (best < 0 || P->face[f].offset < P->face[best].offset))
      best = f;
  return best;
}

// The face that the ray along n leaves the polytope through.
static int find_pierced_face(const gv_polytope *P, gv_vec3 n) {
  int found = -1;
  double nearest = HUGE_VAL;
  for (int f = 0; f < P->face_count; f++) {
    double slope = gv_dot(P->face[f].normal, n);
    if (!gv_polytope_alive(P, f) || slope <= 0 || P->face[f].offset >= nearest * slope)
      continue;
    nearest = P->face[f].offset / slope;
    found = f;
  }
  return found;
}

// Asks beyond the face and adds what is there. False where it is final: no point lies further out.
static bool grow_at(search *s, int f) {
  assert(gv_polytope_alive(&s->polytope, f));
  gv_polytope *P = &s->polytope;
  *s->cso->operations += ADD_OPERATIONS + P->face_count / 2;  // both searches of the faces
  double offset = P->face[f].offset;
  double h = ask_beyond(s, &P->face[f]);
  if (h < s->best) {
    s->best = h;
    s->best_normal = P->face[f].normal;
  }
  if (h - offset <= P->tolerance)
    return false;
  s->count++;
  if (!gv_polytope_add(P, (uint16_t)(s->count - 1), f)) {  // final: as close as rounding allows
    P->face[f].offset = h;
    s->unproved = fmin(s->unproved, offset);
  }
  return true;
}

// Grow at the face nearest to the origin until the bounds meet. Returns the lower bound.
static double expand(search *s, int *io_iterations) {
  gv_polytope *P = &s->polytope;
  double lower = 0;
  int close = 0;
  for (; *io_iterations < GV_EPA_MAX_ITERATIONS; ++*io_iterations) {
    int f = find_nearest_face(P);
    lower = P->face[f].offset;
    if (lower >= s->best - P->tolerance)
      break;
    if (lower >= s->best - 10 * P->tolerance && ++close > CLOSE)
      break;
    if (lower > 0)
      P->least_offset = lower - 1e-10 * s->size;  // the ball of that radius is inside already
    if (!grow_at(s, f))
      break;
  }
  return fmin(fmin(lower, s->unproved), s->best);
}

// Where the bounds did not meet in time (round bodies almost concentric: every direction is about as good),
// downhill from the best direction so far: the side that its ray leaves through is no farther from the
// origin.
static void descend(search *s, int *io_iterations) {
  for (int i = 0; i < GV_EPA_MAX_DESCENT; i++, ++*io_iterations) {
    double best = s->best;
    int f = find_pierced_face(&s->polytope, s->best_normal);
    if (f < 0 || (!grow_at(s, f) && s->best >= best))
      break;
  }
}

// The point of A under the origin's foot on the best plane: of the triangles of that side, the one that holds
// it.
static void find_on_a(const search *s, gv_epa_result *out) {
  const gv_polytope *P = &s->polytope;
  const gv_polytope_face *best = NULL;
  double least = HUGE_VAL;
  gv_vec3 foot = gv_scale(s->best_normal, s->best);
  out->on_a = s->on_a[0];
  for (int f = 0; f < P->face_count; f++) {
    if (!gv_polytope_alive(P, f) || P->face[f].offset > s->best + same_side)
      continue;
    gv_simplex side = {.count = 3};
    for (int k = 0; k < 3; k++) {
      uint16_t v = P->face[f].vertex[k];
      side.p[k] = (gv_cso_point){.w = s->w[v], .a = s->on_a[v]};
    }
    double off = gv_norm(gv_sub(gv_simplex_solve_triangle(&side), foot));
    if (!(off < least))
      continue;
    least = off;
    out->on_a = gv_simplex_on_a(&side);
    best = &P->face[f];
  }
  out->corners = best ? 3 : 0;
  for (int k = 0; k < out->corners; k++) {
    out->corner_a[k] = s->vertex_a[best->vertex[k]];
    out->corner_b[k] = s->vertex_b[best->vertex[k]];
  }
}

bool gv_epa_run(const gv_cso *cso, gv_vec3 guess, gv_epa_result *out) {
  assert(fabs(gv_norm2(guess) - 1) < 1e-6);
  search s;
  s.cso = cso;
  s.count = 0;
  s.size = 0;
  *cso->operations += EPA_OPERATIONS;
  s.polytope = (gv_polytope){.point = s.w,
                             .face = s.face,
                             .edge = s.edge,
                             .seen = s.seen,
                             .link = s.link,
                             .face_max = GV_EPA_MAX_FACES,
                             .free_head = -1,
                             .least_offset = -HUGE_VAL};
  if (!recall_seeds(&s, guess))
    ask_seeds(&s, guess);
  if (!start_polytope(&s))
    return false;
  s.polytope.tolerance = 1e-12 * s.size;
  s.best = s.unproved = HUGE_VAL;
  s.best_normal = guess;
  add_seeds(&s);
  out->iterations = 0;
  out->lower_bound = expand(&s, &out->iterations);
  if (out->iterations == GV_EPA_MAX_ITERATIONS)
    descend(&s, &out->iterations);
  out->depth = s.best;
  out->normal = s.best_normal;
  find_on_a(&s, out);
  return isfinite(s.best);
}

typedef struct sweep {
  const gv_cso *cso;
  gv_epa_result *out;
} sweep;

static void try_direction(sweep *s, gv_vec3 d) {
  double length = gv_norm(d);
  *s->cso->operations += 5;
  if (!(length > 1e-12))
    return;
  gv_vec3 n = gv_scale(d, 1.0 / length);
  gv_cso_point p = gv_cso_support(s->cso, n);
  double h = gv_dot(p.w, n);
  s->out->iterations++;
  if (!(h < s->out->depth))
    return;
  s->out->depth = h;
  s->out->normal = n;
  s->out->on_a = p.a;
}

static gv_vec3 turn(const gv_core *core, gv_vec3 v) { return core->in_place ? v : gv_mat3_mul(&core->R, v); }

// Directions of the core's edges; none where it has more than `max`.
static int list_edges(const gv_core *core, int max, gv_vec3 *out_edge) {
  int count = 0;
  if (core->kind != GV_CORE_HULL) {
    int axes = core->kind == GV_CORE_BOX ? 3 : 1;
    for (; count < axes && count < max; count++)
      out_edge[count] = core->axis[count];
    return count;
  }
  const gv_hull *hull = core->hull;
  if (hull->neighbor_start[hull->vertex_count] > 2 * max)
    return 0;  // too many for any of them to matter
  for (int v = 0; v < hull->vertex_count; v++) {
    for (int k = hull->neighbor_start[v]; k < hull->neighbor_start[v + 1] && count < max; k++) {
      const int to = hull->neighbor[k];
      if (to > v)
        out_edge[count++] = turn(core, gv_sub(hull->vertex[to], hull->vertex[v]));
    }
  }
  return count;
}

static void try_faces(sweep *s, const gv_core *core, double sign) {
  if (core->kind == GV_CORE_HULL) {
    int step = 1 + core->hull->face_count / SWEEP_FACES;
    for (int f = 0; f < core->hull->face_count; f += step) {
      const gv_vec3 outward = turn(core, core->hull->face_normal[f]);
      try_direction(s, gv_scale(outward, sign));
    }
    return;
  }
  for (int k = 0; k < 3; k++) {
    gv_vec3 side = gv_cross(core->axis[(k + 1) % 3], core->axis[(k + 2) % 3]);
    gv_vec3 axis = gv_normalize_or(core->axis[k], gv_v3(0, 0, 1));
    gv_vec3 n = gv_norm(side) > 0 ? gv_normalize_or(side, side) : gv_any_perpendicular(axis);
    try_direction(s, n);
    try_direction(s, gv_neg(n));
  }
}

void gv_epa_sweep_faces(const gv_cso *cso, gv_vec3 guess, gv_epa_result *out) {
  sweep s = {cso, out};
  gv_vec3 edge_a[SWEEP_EDGES], edge_b[SWEEP_EDGES];
  *out = (gv_epa_result){.depth = HUGE_VAL, .normal = guess, .lower_bound = -HUGE_VAL};
  try_direction(&s, guess);
  try_faces(&s, &cso->b, 1);
  try_faces(&s, &cso->a, -1);
  int na = list_edges(&cso->a, SWEEP_EDGES, edge_a);
  int nb = list_edges(&cso->b, SWEEP_EDGES, edge_b);
  for (int i = 0; i < na; i++) {
    for (int k = 0; k < nb; k++) {
      const gv_vec3 none = {0, 0, 0};
      gv_vec3 n = gv_cross(gv_normalize_or(edge_a[i], none), gv_normalize_or(edge_b[k], none));
      try_direction(&s, n);
      try_direction(&s, gv_neg(n));
    }
  }
}
