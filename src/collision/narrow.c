// SPDX-License-Identifier: BSD-3-Clause
// Signed distance of two shapes (section C of the paper, Eqn 5 to 8). The cores' distance is found by
// GJK (Gilbert, Johnson, Keerthi 1988) on the obstacle B - A, in the frame of B
// (narrow_simplex.c, over libccd); overlapping cores go to the expanding polytope (epa.c).
// The spheres' radii are subtracted last, so that a contact in the margin costs no more than a distance.
// Pure; any thread. At most one GJK search, three of the polytope's and a sweep: each ends after a fixed number of steps.
#include "collision/narrow_simplex.h"

// Cores nearer than this are treated as overlapping: the direction between two points that close is rounding.
static const double touching = 1e-10;  // metres

// Steps without progress that are taken while the bounds are apart. From one end of a limb lying nearly along
// an edge the way to the other end begins so: the nearest point moves by less than rounding, the direction by enough.
enum { STALLS = 2 };

typedef enum outcome { APART, OVERLAP, FAR } outcome;

static bool is_corner(const gv_simplex *s, gv_vec3 w) {
  for (int k = 0; k < s->count; k++)
    if (s->p[k].w.x == w.x && s->p[k].w.y == w.y && s->p[k].w.z == w.z) return true;
  return false;
}

// The corners that carried the nearest point last time, where they are now.
static bool recall_simplex(const gv_cso *cso, gv_simplex *s) {
  const gv_pair_cache *c = cso->cache;
  if (c->corners == 0 || c->corners > 3 || c->overlap) return false;
  for (s->count = 0; s->count < c->corners; s->count++)
    if (!gv_cso_recall(cso, s->count, &s->p[s->count])) return false;
  return true;
}

static void keep_simplex(gv_pair_cache *cache, const gv_simplex *s) {
  cache->corners = (uint16_t)s->count, cache->overlap = 0;
  for (int k = 0; k < s->count; k++) cache->corner_a[k] = s->p[k].vertex_a, cache->corner_b[k] = s->p[k].vertex_b;
}

// Walks from the simplex to the point of B - A nearest to the origin. On FAR, *io_n separates by more than `limit`.
static outcome walk(const gv_cso *cso, double limit, gv_vec3 *io_n, gv_simplex *s, gv_vec3 *out_v, int *io_iterations) {
  gv_vec3 v = s->p[0].w;
  s->weight[0] = 1;
  if (s->count > 1) gv_simplex_solve(s, &v);
  double lower = 0.0;
  int stalls = 0;
  for (int i = 0; i < GV_GJK_MAX_ITERATIONS; i++) {
    double far = gv_norm(v);
    if (far <= touching) return OVERLAP;
    ++*io_iterations;
    *io_n = gv_scale(v, -1.0 / far);
    gv_cso_point p = gv_cso_support(cso, *io_n);
    lower = -gv_dot(*io_n, p.w);
    if (lower > limit) return FAR;
    if (far - lower <= 1e-13 * (far + gv_norm(p.w)) || is_corner(s, p.w)) break;
    gv_simplex next = *s;
    gv_vec3 v_next = v;
    next.p[next.count++] = p;
    if (!gv_simplex_solve(&next, &v_next)) return OVERLAP;
    double progress = far - gv_norm(v_next), rounding = 1e-16 * gv_norm(p.w);
    if (progress <= -rounding || (progress <= rounding && ++stalls > STALLS)) break;  // as near as rounding allows
    *s = next, v = v_next;
  }
  *out_v = gv_simplex_polish(s, v);
  // Nearly touching along edges, rounding can hide the way: where the bounds do not meet, let the faces decide.
  double far = gv_norm(*out_v);
  return far <= touching || lower < 0.5 * far ? OVERLAP : APART;
}

static void take_apart(const gv_simplex *s, gv_vec3 v, gv_distance *out) {
  out->distance = gv_norm(v);
  out->normal_world = gv_scale(v, -1.0 / out->distance);
  out->on_a = gv_simplex_on_a(s);
  out->method = GV_NARROW_GJK;
}

static void keep_side(gv_pair_cache *cache, const gv_epa_result *r) {
  cache->corners = r->corners, cache->overlap = 1;
  for (int k = 0; k < r->corners; k++) cache->corner_a[k] = r->corner_a[k], cache->corner_b[k] = r->corner_b[k];
}

static void take_overlap(const gv_epa_result *r, gv_narrow_method method, gv_distance *out) {
  out->distance = -r->depth;
  out->normal_world = r->normal;
  out->on_a = r->on_a;
  out->method = method;
}

static bool has_met(const gv_epa_result *r) { return r->depth - r->lower_bound <= 1e-6; }

static bool is_better(const gv_epa_result *r, const gv_epa_result *best) {
  return r->depth < best->depth + (has_met(r) ? touching : -touching);
}

// Where the polytope's bounds did not meet: once more from beside the best side so far, since rounding then falls
// differently; if they still do not, the faces may know better.
static void settle_depth(const gv_cso *cso, gv_vec3 guess, const gv_epa_result *found, gv_distance *out) {
  gv_epa_result best = *found, other;
  gv_narrow_method method = GV_NARROW_EPA;
  out->iterations += found->iterations;
  cso->cache->corners = 0;
  if (!has_met(&best) && gv_epa_run(cso, gv_normalize_or(gv_mad(best.normal, 0.1, gv_any_perpendicular(best.normal)), guess), &other)) {
    out->iterations += other.iterations;
    if (is_better(&other, &best)) best = other;
  }
  if (!has_met(&best)) {
    gv_epa_sweep_faces(cso, guess, &other);
    out->iterations += other.iterations;
    if (is_better(&other, &best)) best = other, method = GV_NARROW_FACES;
  }
  take_overlap(&best, method, out);
  keep_side(cso->cache, &best);
}

static void find_depth(const gv_cso *cso, gv_vec3 guess, gv_distance *out) {
  gv_epa_result r;
  if (!gv_epa_run(cso, guess, &r)) r = (gv_epa_result){.depth = HUGE_VAL, .normal = guess};
  settle_depth(cso, guess, &r, out);
}

// A cached normal along which the cores overlap means that they most likely still do (a box at rest on a table):
// the polytope is asked first. True where it shows that they do; else *io_n is a better guess.
static bool still_overlap(const gv_cso *cso, gv_vec3 *io_n, gv_distance *out) {
  gv_epa_result r;
  if (!gv_epa_run(cso, *io_n, &r)) return false;
  if (r.lower_bound >= (has_met(&r) ? -touching : touching)) {
    settle_depth(cso, *io_n, &r, out);
    return true;
  }
  *io_n = r.normal;
  return false;
}

static gv_vec3 usable_normal(gv_vec3 n) {
  double length2 = gv_norm2(n);
  return length2 > 0.5 && length2 < 2 ? gv_scale(n, 1.0 / sqrt(length2)) : gv_v3(0, 0, 0);
}

// The last normal, frame of B, or without one the direction between the centers.
static gv_vec3 first_guess(const gv_cso *cso, bool *out_warm) {
  gv_vec3 last = usable_normal(gv_rotate_inv(cso->q_world_b, cso->cache->normal_world));
  *out_warm = gv_norm2(last) > 0.5;
  return *out_warm ? last : gv_normalize_or(gv_sub(gv_core_center(&cso->a), gv_core_center(&cso->b)), gv_v3(0, 0, 1));
}

static void take_far(const gv_cso *cso, double limit, gv_vec3 n, gv_distance *out) {
  cso->cache->corners = cso->cache->overlap = 0;
  out->method = GV_NARROW_FAR, out->distance = limit, out->normal_world = n;
}

// Cores: frame of B, spheres left out.
static void distance_of_cores(const gv_cso *cso, double limit, gv_distance *out) {
  gv_simplex s;
  gv_vec3 v = gv_v3(0, 0, 0), n = v;
  bool warm;
  if (!recall_simplex(cso, &s)) {
    n = first_guess(cso, &warm);
    s.p[0] = gv_cso_support(cso, n), s.count = 1;
    double overlap = gv_dot(s.p[0].w, n);
    if (warm && overlap > 0) {
      if (still_overlap(cso, &n, out)) return;
      s.p[0] = gv_cso_support(cso, n);
    } else if (-overlap > limit) {
      take_far(cso, limit, n, out);
      return;
    }
  }
  outcome end = walk(cso, limit, &n, &s, &v, &out->iterations);
  cso->cache->corners = 0;
  if (end == APART) take_apart(&s, v, out), keep_simplex(cso->cache, &s);
  if (end == OVERLAP) find_depth(cso, first_guess(cso, &warm), out);
  if (end == FAR) take_far(cso, limit, n, out);
}

// Pairs that were far mostly still are: two support heights along the last normal tell, before anything is placed.
static bool still_far(const gv_shape *a, const gv_pose *T_world_a, const gv_shape *b, const gv_pose *T_world_b, double limit, gv_pair_cache *cache) {
  gv_vec3 n = cache->normal_world;
  if (cache->corners > 0 || cache->overlap || fabs(gv_norm2(n) - 1) > 1e-9) return false;
  double high = gv_core_height(b, gv_rotate_inv(T_world_b->q, n), &cache->vertex_b);
  double low = gv_core_height(a, gv_rotate_inv(T_world_a->q, gv_neg(n)), &cache->vertex_a);
  return gv_dot(n, gv_sub(T_world_a->p, T_world_b->p)) - low - high > limit;
}

void gv_distance_in_b(const gv_shape *a, const gv_pose *T_world_a, const gv_shape *b, const gv_pose *T_world_b,
                      double max_distance, gv_pair_cache *cache, gv_cso *out_cso, gv_distance *out) {
  double radii = a->radius + b->radius;
  *out = (gv_distance){.method = GV_NARROW_FAR, .distance = max_distance};
  if (still_far(a, T_world_a, b, T_world_b, max_distance + radii, cache)) return;
  gv_core_place(a, (gv_pose){gv_quat_mul(gv_quat_conj(T_world_b->q), T_world_a->q), gv_transform_inv(*T_world_b, T_world_a->p)}, &out_cso->a);
  gv_core_in_place(b, &out_cso->b);
  out_cso->q_world_b = T_world_b->q;
  out_cso->cache = cache;
  distance_of_cores(out_cso, max_distance + radii, out);
  cache->normal_world = gv_rotate(T_world_b->q, out->normal_world);
  if (out->method == GV_NARROW_FAR) {
    out->distance = max_distance;
    return;
  }
  out->distance -= radii;
  out->on_a = gv_mad(out->on_a, -a->radius, out->normal_world);
  out->on_b = gv_mad(out->on_a, -out->distance, out->normal_world);
}

void gv_distance_to_world(const gv_pose *T_world_b, const gv_pair_cache *cache, gv_distance *io) {
  io->normal_world = cache->normal_world;
  if (io->method == GV_NARROW_FAR) return;
  io->on_a = gv_transform(*T_world_b, io->on_a);
  io->on_b = gv_mad(io->on_a, -io->distance, io->normal_world);
}

void gv_distance_pair(const gv_shape *a, const gv_pose *T_world_a, const gv_shape *b, const gv_pose *T_world_b,
                      double max_distance, gv_pair_cache *cache, gv_distance *out) {
  gv_cso cso;
  gv_distance_in_b(a, T_world_a, b, T_world_b, max_distance, cache, &cso, out);
  gv_distance_to_world(T_world_b, cache, out);
}
