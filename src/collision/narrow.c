// SPDX-License-Identifier: BSD-3-Clause
// Signed distance of two shapes (section C of the paper, Eqn 5 to 8), with either narrow phase. The cores'
// distance is found by GJK on the obstacle B - A, in the frame of B (gjk.c); cores that overlap go to the
// phase's own search (core.c, libccd.c). The spheres' radii are subtracted last, so that a contact in the
// margin costs no more than a distance. Pure; any thread.
#include <assert.h>

#include "collision/gjk.h"
#include "collision/phase.h"

// What a pair costs that is still far apart, and what placing the cores adds, in operations.
enum { PAIR_OPERATIONS = 15, PLACE_OPERATIONS = 25 };

static const gv_phase *const phase_of[] = {
  [GV_NARROW_CORE] = &gv_phase_core,
  [GV_NARROW_LIBCCD] = &gv_phase_libccd,
};

static gv_vec3 usable_normal(gv_vec3 n) {
  double length2 = gv_norm2(n);
  return length2 > 0.5 && length2 < 2 ? gv_scale(n, 1.0 / sqrt(length2)) : gv_v3(0, 0, 0);
}

// The last normal, frame of B, or without one the direction between the centers.
static gv_vec3 first_guess(const gv_cso *cso, bool *out_warm) {
  gv_vec3 last = usable_normal(gv_rotate_inv(cso->q_world_b, cso->cache->normal_world));
  *out_warm = gv_norm2(last) > 0.5;
  if (*out_warm)
    return last;
  gv_vec3 between = gv_sub(gv_core_center(&cso->a), gv_core_center(&cso->b));
  return gv_normalize_or(between, gv_v3(0, 0, 1));
}

static void take_beyond(const gv_cso *cso, gv_vec3 n, gv_distance *out) {
  cso->cache->corners = 0;
  cso->cache->overlap = 0;
  out->method = GV_DISTANCE_BEYOND;
  out->normal_world = n;
}

static void take_apart(const gv_gjk *g, gv_distance *out) {
  out->distance = gv_norm(g->nearest);
  out->normal_world = gv_scale(g->nearest, -1.0 / out->distance);
  out->on_a = gv_simplex_on_a(&g->simplex);
  out->method = GV_DISTANCE_GJK;
}

static void walk(const gv_phase *phase, gv_gjk *g, gv_distance *out) {
  bool warm;
  gv_gjk_outcome end = gv_gjk_walk(g);
  out->iterations += g->iterations;
  g->cso->cache->corners = 0;
  switch (end) {
    case GV_GJK_APART:
      take_apart(g, out);
      gv_gjk_keep(g->cso->cache, &g->simplex);
      break;
    case GV_GJK_OVERLAP: {
      gv_vec3 guess = first_guess(g->cso, &warm);
      phase->depth(g->cso, guess, warm, out);
      break;
    }
    case GV_GJK_BEYOND: take_beyond(g->cso, g->n, out); break;
  }
}

// Cores: frame of B, spheres left out.
static void distance_of_cores(const gv_phase *phase, const gv_cso *cso, double limit, gv_distance *out) {
  gv_gjk g;
  g.cso = cso;
  g.solve = phase->solve;
  g.limit = limit;
  g.iterations = 0;
  if (!gv_gjk_recall(cso, &g.simplex)) {
    bool warm;
    gv_vec3 n = first_guess(cso, &warm);
    g.simplex.p[0] = gv_cso_support(cso, n);
    g.simplex.count = 1;
    double overlap = gv_dot(g.simplex.p[0].w, n);
    if (warm && overlap > 0 && phase->still_overlap) {
      if (phase->still_overlap(cso, &n, out))
        return;
      g.simplex.p[0] = gv_cso_support(cso, n);
    } else if (-overlap > limit) {
      take_beyond(cso, n, out);
      return;
    }
  }
  walk(phase, &g, out);
}

// Pairs that were far apart mostly still are: two support heights along the last normal tell, before anything
// is placed.
static bool still_beyond(const gv_pair *pair, double limit, gv_pair_cache *cache, int *io_operations) {
  gv_vec3 n = cache->normal_world;
  if (cache->corners > 0 || cache->overlap || fabs(gv_norm2(n) - 1) > 1e-9)
    return false;
  const gv_pose *A = pair->T_world_a;
  const gv_pose *B = pair->T_world_b;
  double high = gv_core_height(pair->b, gv_rotate_inv(B->q, n), &cache->vertex_b, io_operations);
  double low = gv_core_height(pair->a, gv_rotate_inv(A->q, gv_neg(n)), &cache->vertex_a, io_operations);
  return gv_dot(n, gv_sub(A->p, B->p)) - low - high > limit;
}

static gv_pose pose_in_b(const gv_pair *pair) {
  gv_quat q = gv_quat_mul(gv_quat_conj(pair->T_world_b->q), pair->T_world_a->q);
  return (gv_pose){q, gv_transform_inv(*pair->T_world_b, pair->T_world_a->p)};
}

// Two segments (a limb and a capsule) have no volume to be deep in: libccd's triangles lose
// micrometres where they cross, ours do not.
static const gv_phase *choose_phase(gv_narrow narrow, const gv_cso *cso) {
  const bool flat = cso->a.kind == GV_CORE_SEGMENT && cso->b.kind == GV_CORE_SEGMENT;
  return flat ? &gv_phase_core : phase_of[narrow];
}

void gv_distance_in_b(gv_narrow narrow, const gv_pair *pair, double max_distance, gv_pair_cache *cache,
                      gv_cso *out_cso, gv_distance *out) {
  assert((unsigned)narrow < sizeof phase_of / sizeof *phase_of);
  assert(max_distance >= 0);
  double radii = pair->a->radius + pair->b->radius;
  *out = (gv_distance){.method = GV_DISTANCE_BEYOND, .distance = max_distance};
  out->operations = PAIR_OPERATIONS;
  if (still_beyond(pair, max_distance + radii, cache, &out->operations))
    return;
  out->operations += PLACE_OPERATIONS;
  gv_core_place(pair->a, pose_in_b(pair), &out_cso->a);
  gv_core_in_place(pair->b, &out_cso->b);
  out_cso->q_world_b = pair->T_world_b->q;
  out_cso->cache = cache;
  out_cso->operations = &out->operations;
  distance_of_cores(choose_phase(narrow, out_cso), out_cso, max_distance + radii, out);
  cache->normal_world = gv_rotate(pair->T_world_b->q, out->normal_world);
  if (out->method == GV_DISTANCE_BEYOND) {
    out->distance = max_distance;
    return;
  }
  out->distance -= radii;
  out->on_a = gv_mad(out->on_a, -pair->a->radius, out->normal_world);
  out->on_b = gv_mad(out->on_a, -out->distance, out->normal_world);
}

void gv_distance_to_world(const gv_pose *T_world_b, const gv_pair_cache *cache, gv_distance *io) {
  io->normal_world = cache->normal_world;
  if (io->method == GV_DISTANCE_BEYOND)
    return;
  io->on_a = gv_transform(*T_world_b, io->on_a);
  io->on_b = gv_mad(io->on_a, -io->distance, io->normal_world);
}

void gv_distance_pair(gv_narrow narrow, const gv_pair *pair, double max_distance, gv_pair_cache *cache,
                      gv_distance *out) {
  gv_cso cso;
  gv_distance_in_b(narrow, pair, max_distance, cache, &cso, out);
  gv_distance_to_world(pair->T_world_b, cache, out);
}
