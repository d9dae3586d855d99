// SPDX-License-Identifier: BSD-3-Clause
// The distance of two cores: from a simplex of the obstacle B - A, always on to the support point beyond the
// nearest point found so far (Gilbert, Johnson, Keerthi 1988). The support height is a lower bound of the
// distance, the nearest point an upper one: the walk ends when they meet, or when rounding allows no step
// nearer. Pure; any thread. Cost: 60 to 150 ns an iteration; one or two from a warm simplex.
#include "collision/gjk.h"

#include <assert.h>

// Steps without progress that are taken while the bounds are apart. From one end of a limb lying nearly along
// an edge the way to the other end begins so: the nearest point moves by less than rounding, the direction by
// enough.
enum { STALLS = 2 };

// What an iteration costs beside its support points, in operations.
enum { GJK_OPERATIONS = 20 };

static bool is_corner(const gv_simplex *s, gv_vec3 w) {
  for (int k = 0; k < s->count; k++)
    if (s->p[k].w.x == w.x && s->p[k].w.y == w.y && s->p[k].w.z == w.z)
      return true;
  return false;
}

bool gv_gjk_recall(const gv_cso *cso, gv_simplex *s) {
  const gv_pair_cache *c = cso->cache;
  if (c->corners == 0 || c->corners > 3 || c->overlap)
    return false;
  for (s->count = 0; s->count < c->corners; s->count++)
    if (!gv_cso_recall(cso, s->count, &s->p[s->count]))
      return false;
  return true;
}

void gv_gjk_keep(gv_pair_cache *cache, const gv_simplex *s) {
  assert(s->count >= 1 && s->count <= 3);
  cache->corners = (uint16_t)s->count;
  cache->overlap = 0;
  for (int k = 0; k < s->count; k++) {
    cache->corner_a[k] = s->p[k].vertex_a;
    cache->corner_b[k] = s->p[k].vertex_b;
  }
}

gv_gjk_outcome gv_gjk_walk(gv_gjk *g) {
  assert(g->limit >= 0.0);
  gv_simplex *s = &g->simplex;
  gv_vec3 v = s->p[0].w;
  double lower = 0.0;
  int stalls = 0;
  assert(s->count >= 1 && s->count <= 3);
  s->weight[0] = 1;
  if (s->count > 1)
    g->solve(s, &v);
  for (int i = 0; i < GV_GJK_MAX_ITERATIONS; i++) {
    double upper = gv_norm(v);
    if (upper <= gv_touching_m)
      return GV_GJK_OVERLAP;
    g->iterations++;
    *g->cso->operations += GJK_OPERATIONS;
    g->n = gv_scale(v, -1.0 / upper);
    gv_cso_point p = gv_cso_support(g->cso, g->n);
    lower = -gv_dot(g->n, p.w);
    if (lower > g->limit)
      return GV_GJK_BEYOND;
    if (upper - lower <= 1e-13 * (upper + gv_norm(p.w)) || is_corner(s, p.w))
      break;
    gv_simplex next = *s;
    gv_vec3 v_next = v;
    next.p[next.count++] = p;
    if (!g->solve(&next, &v_next))
      return GV_GJK_OVERLAP;
    double progress = upper - gv_norm(v_next);
    double rounding = 1e-16 * gv_norm(p.w);
    if (progress <= rounding)
      stalls++;
    if (progress <= -rounding || stalls > STALLS)
      break;  // as near as rounding allows
    *s = next;
    v = v_next;
  }
  g->nearest = gv_simplex_polish(s, v);
  // Nearly touching along edges, rounding can hide the way: where the bounds do not meet, let the depth
  // decide.
  double distance = gv_norm(g->nearest);
  return distance <= gv_touching_m || lower < 0.5 * distance ? GV_GJK_OVERLAP : GV_GJK_APART;
}
