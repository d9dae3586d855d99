// SPDX-License-Identifier: BSD-3-Clause
// The configuration space obstacle of a pair of cores (section C of the paper), as the set B - A in the
// frame of B: the cores overlap exactly when it contains the origin. Its support h(n), n a unit vector
// from B to A, is the penetration of the cores along n (Eqn 8), negative where n separates them.
// Internal to the narrow phase. Working in the frame of B keeps rounding at the size of the shapes.
#ifndef GLOVED_CSO_H
#define GLOVED_CSO_H

#include <assert.h>

#include "gloved/narrow.h"

typedef struct gv_core {  // a core (no sphere) placed in the frame of B
  gv_core_kind kind;
  gv_vec3 center;   // of its own frame
  gv_vec3 axis[3];  // box and segment: half extents along the core's axes
  const gv_hull *hull;
  gv_mat3 R;      // hull: rotation into the frame of B
  bool in_place;  // hull: R is the identity and center zero
} gv_core;

typedef struct gv_cso {
  gv_core a, b;
  gv_quat q_world_b;
  gv_pair_cache *cache;  // start vertices
  int *operations;       // counted up: vertices and faces looked at, and the like
} gv_cso;

typedef struct gv_cso_point {
  gv_vec3 w;                    // b - a
  gv_vec3 a;                    // the point of A
  uint16_t vertex_a, vertex_b;  // of the cores
} gv_cso_point;

typedef struct gv_epa_result {
  double depth;          // h(normal), metres; negative: this direction separates the cores
  double lower_bound;    // of the depth
  gv_vec3 normal, on_a;  // frame of B; on_a on the core of A
  uint16_t corner_a[3], corner_b[3], corners;  // of the side, as in gv_pair_cache
  int iterations;
} gv_epa_result;

void gv_core_place(const gv_shape *shape, gv_pose T_b_shape, gv_core *out);
void gv_core_in_place(const gv_shape *shape, gv_core *out);  // B itself
// The core's vertex farthest along d, and how far that is in the shape's own frame.
gv_vec3 gv_core_support(const gv_core *core, gv_vec3 d, uint16_t *hint, int *io_operations);
double gv_core_height(const gv_shape *shape, gv_vec3 d, uint16_t *hint, int *io_operations);
int gv_hull_support(const gv_hull *hull, gv_vec3 d, int start, int *io_operations);

// A vertex by its number (of a segment or box: bit k is the sign along axis k).
static inline gv_vec3 gv_core_vertex(const gv_core *core, unsigned vertex) {
  gv_vec3 p = core->center;
  if (core->kind == GV_CORE_HULL) {
    gv_vec3 v = core->hull->vertex[vertex];
    return core->in_place ? v : gv_add(p, gv_mat3_mul(&core->R, v));
  }
  int axes = core->kind == GV_CORE_BOX ? 3 : 1;
  for (int k = 0; k < axes; k++)
    p = vertex >> k & 1 ? gv_add(p, core->axis[k]) : gv_sub(p, core->axis[k]);
  return p;
}

static inline bool gv_core_is_point(const gv_core *core) {  // a ball
  return core->kind == GV_CORE_HULL && core->hull->vertex_count == 1;
}

static inline gv_cso_point gv_cso_support(const gv_cso *cso, gv_vec3 n) {
  gv_vec3 b = gv_core_support(&cso->b, n, &cso->cache->vertex_b, cso->operations);
  gv_vec3 a = gv_core_support(&cso->a, gv_neg(n), &cso->cache->vertex_a, cso->operations);
  return (gv_cso_point){gv_sub(b, a), a, cso->cache->vertex_a, cso->cache->vertex_b};
}

static inline bool gv_core_has_vertex(const gv_core *core, unsigned vertex) {
  if (core->kind == GV_CORE_HULL)
    return vertex < (unsigned)core->hull->vertex_count;
  return vertex < (core->kind == GV_CORE_BOX ? 8U : 2U);
}

// Corner k of the cache, where it is now; false where the shapes have no such vertices.
static inline bool gv_cso_recall(const gv_cso *cso, int k, gv_cso_point *out) {
  assert(k >= 0 && k < 3);
  uint16_t i = cso->cache->corner_a[k];
  uint16_t j = cso->cache->corner_b[k];
  if (!gv_core_has_vertex(&cso->a, i) || !gv_core_has_vertex(&cso->b, j))
    return false;
  gv_vec3 a = gv_core_vertex(&cso->a, i);
  *out = (gv_cso_point){gv_sub(gv_core_vertex(&cso->b, j), a), a, i, j};
  return true;
}

// A point inside the core, frame of B.
static inline gv_vec3 gv_core_center(const gv_core *core) {
  if (core->kind != GV_CORE_HULL)
    return core->center;
  return gv_add(core->center, gv_mat3_mul(&core->R, core->hull->center));
}

// Both find the least h(n); `guess` is a unit vector, any. False: the obstacle has no volume (out is not
// set).
bool gv_epa_run(const gv_cso *cso, gv_vec3 guess, gv_epa_result *out);
// The least h over the guess, face normals, and cross products of edges, a bounded number of them.
void gv_epa_sweep_faces(const gv_cso *cso, gv_vec3 guess, gv_epa_result *out);

// The distance, with the cores as placed in the frame of B left in *out_cso (not where they are beyond the
// limit), and results in that frame; and those results taken to the world.
void gv_distance_in_b(gv_narrow narrow, const gv_pair *pair, double max_distance, gv_pair_cache *cache,
                      gv_cso *out_cso, gv_distance *out);
void gv_distance_to_world(const gv_pose *T_world_b, const gv_pair_cache *cache, gv_distance *io);

#endif
