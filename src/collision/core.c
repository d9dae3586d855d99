// SPDX-License-Identifier: BSD-3-Clause
// The narrow phase `core`: GJK on a simplex solver of our own, and for cores that overlap the expanding
// polytope (epa.c), which is asked again from elsewhere, and at last the faces, where its bounds do not meet.
// Pure; any thread. At most three searches of the polytope and a sweep: each ends after a fixed number of
// steps.
#include "collision/gjk.h"
#include "collision/phase.h"

static void keep_side(gv_pair_cache *cache, const gv_epa_result *r) {
  cache->corners = r->corners;
  cache->overlap = 1;
  for (int k = 0; k < r->corners; k++) {
    cache->corner_a[k] = r->corner_a[k];
    cache->corner_b[k] = r->corner_b[k];
  }
}

static bool bounds_meet(const gv_epa_result *r) { return r->depth - r->lower_bound <= 1e-6; }

static bool is_better(const gv_epa_result *r, const gv_epa_result *best) {
  return r->depth < best->depth + (bounds_meet(r) ? gv_touching_m : -gv_touching_m);
}

// Once more from beside the best side so far, since rounding then falls differently; if the bounds still do
// not meet, the faces may know better.
static void settle_depth(const gv_cso *cso, gv_vec3 guess, const gv_epa_result *found, gv_distance *out) {
  gv_epa_result best = *found, other;
  out->method = GV_DISTANCE_EPA;
  out->iterations += found->iterations;
  cso->cache->corners = 0;
  if (!bounds_meet(&best)) {
    gv_vec3 beside = gv_mad(best.normal, 0.1, gv_any_perpendicular(best.normal));
    if (gv_epa_run(cso, gv_normalize_or(beside, guess), &other)) {
      out->iterations += other.iterations;
      if (is_better(&other, &best))
        best = other;
    }
  }
  if (!bounds_meet(&best)) {
    gv_epa_sweep_faces(cso, guess, &other);
    out->iterations += other.iterations;
    if (is_better(&other, &best)) {
      best = other;
      out->method = GV_DISTANCE_FACES;
    }
  }
  out->distance = -best.depth;
  out->normal_world = best.normal;
  out->on_a = best.on_a;
  keep_side(cso->cache, &best);
}

static void find_depth(const gv_cso *cso, gv_vec3 guess, bool warm, gv_distance *out) {
  gv_epa_result r;
  (void)warm;
  if (!gv_epa_run(cso, guess, &r))
    r = (gv_epa_result){.depth = HUGE_VAL, .normal = guess};
  settle_depth(cso, guess, &r, out);
}

// A cached normal along which the cores overlap means that they most likely still do (a box at rest on a
// table): the polytope is asked first.
static bool still_overlap(const gv_cso *cso, gv_vec3 *io_guess, gv_distance *out) {
  gv_epa_result r;
  if (!gv_epa_run(cso, *io_guess, &r))
    return false;
  if (r.lower_bound >= (bounds_meet(&r) ? -gv_touching_m : gv_touching_m)) {
    settle_depth(cso, *io_guess, &r, out);
    return true;
  }
  *io_guess = r.normal;
  return false;
}

const gv_phase gv_phase_core = {gv_simplex_solve, still_overlap, find_depth};
