// SPDX-License-Identifier: BSD-3-Clause
// Shapes, poses and an oracle for the tests of the narrow phase: the signed distance of two convex
// polyhedra by brute force over all pairs of features, with nothing of the code under test.
// Apart: the least of vertex-face, face-vertex and edge-edge distances. Overlapping: the least of
// h_{B-A}(n) over all face normals and all cross products of edges, which is exact for polyhedra.
#ifndef POLYHEDRA_H
#define POLYHEDRA_H

#include "support/check.h"
#include "gloved/narrow.h"

enum { SOLID_VERTICES = 1024, SOLID_FACES = 2048, SOLID_CORNERS = 6144, SOLID_EDGES = 3072 };

typedef struct solid {
  int vertices, faces, edges;
  gv_vec3 v[SOLID_VERTICES];
  int start[SOLID_FACES + 1], corner[SOLID_CORNERS];
  gv_vec3 n[SOLID_FACES];
  int edge[SOLID_EDGES][2];
} solid;

typedef struct oracle {
  double distance;
  gv_vec3 normal;
  double second;
} oracle;

static unsigned long long polyhedra_seed = 88172645463325252ULL;
static inline double draw(double lo, double hi) { return check_uniform(&polyhedra_seed, lo, hi); }
static inline gv_vec3 draw_vector(double reach) {  // in order, so that every compiler draws the same poses
  double x = draw(-reach, reach);
  double y = draw(-reach, reach);
  double z = draw(-reach, reach);
  return gv_v3(x, y, z);
}
static inline gv_vec3 draw_unit(void) {
  for (;;) {
    gv_vec3 v = draw_vector(1);
    if (gv_norm(v) > 0.1 && gv_norm(v) <= 1)
      return gv_scale(v, 1 / gv_norm(v));
  }
}
static inline gv_quat draw_rotation(void) {
  gv_vec3 v = draw_vector(1);
  return gv_quat_normalize((gv_quat){draw(-1, 1), v.x, v.y, v.z});
}

static inline void solid_from_box(gv_vec3 h, solid *s) {
  static const int quad[6][4] = {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4},
                                 {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}};
  static const double normal[6][3] = {{-1, 0, 0}, {1, 0, 0}, {0, -1, 0}, {0, 1, 0}, {0, 0, -1}, {0, 0, 1}};
  s->vertices = 8;
  s->faces = 6;
  s->edges = 0;
  for (int i = 0; i < 8; i++)
    s->v[i] = gv_v3(i & 1 ? h.x : -h.x, i & 2 ? h.y : -h.y, i & 4 ? h.z : -h.z);
  for (int f = 0; f < 6; f++) {
    s->start[f] = 4 * f;
    s->n[f] = gv_v3(normal[f][0], normal[f][1], normal[f][2]);
    for (int k = 0; k < 4; k++)
      s->corner[4 * f + k] = quad[f][k];
  }
  s->start[6] = 24;
  for (int i = 0; i < 8; i++)
    for (int b = 1; b < 8; b *= 2)
      if (!(i & b)) {
        s->edge[s->edges][0] = i;
        s->edge[s->edges++][1] = i | b;
      }
}

static inline void solid_from_hull(const gv_hull *h, solid *s) {
  s->vertices = h->vertex_count;
  s->faces = h->face_count;
  s->edges = 0;
  for (int i = 0; i < h->vertex_count; i++)
    s->v[i] = h->vertex[i];
  for (int f = 0; f < h->face_count; f++) {
    s->start[f] = h->face_start[f];
    s->n[f] = h->face_normal[f];
    int sides = h->face_start[f + 1] - h->face_start[f];
    for (int k = 0; k < sides; k++) {
      int i = h->face_vertex[h->face_start[f] + k];
      int j = h->face_vertex[h->face_start[f] + (k + 1) % sides];
      s->corner[h->face_start[f] + k] = i;
      if (i < j) {
        s->edge[s->edges][0] = i;
        s->edge[s->edges++][1] = j;
      }
    }
  }
  s->start[h->face_count] = h->face_start[h->face_count];
  if (h->vertex_count == 2) {
    // a capsule
    s->edge[0][0] = 0;
    s->edge[0][1] = 1;
    s->edges = 1;
  }
}

static inline void solid_of(const gv_shape *shape, const gv_pose *T, solid *s) {
  if (shape->kind == GV_CORE_HULL)
    solid_from_hull(shape->hull, s);
  if (shape->kind == GV_CORE_BOX)
    solid_from_box(shape->half, s);
  if (shape->kind == GV_CORE_SEGMENT) {
    s->vertices = 2;
    s->faces = 0;
    s->edges = 1;
    s->start[0] = 0;
    s->v[0] = gv_v3(-shape->half.x, 0, 0);
    s->v[1] = gv_v3(shape->half.x, 0, 0);
    s->edge[0][0] = 0;
    s->edge[0][1] = 1;
  }
  for (int i = 0; i < s->vertices; i++)
    s->v[i] = gv_transform(*T, s->v[i]);
  for (int f = 0; f < s->faces; f++)
    s->n[f] = gv_rotate(T->q, s->n[f]);
}

// h_{B-A}(n) = max b.n - min a.n: how deep A and B overlap along n (Eqn 8).
static inline double overlap_along(const solid *a, const solid *b, gv_vec3 n) {
  double high = -HUGE_VAL;
  double low = HUGE_VAL;
  for (int i = 0; i < b->vertices; i++)
    high = fmax(high, gv_dot(b->v[i], n));
  for (int i = 0; i < a->vertices; i++)
    low = fmin(low, gv_dot(a->v[i], n));
  return high - low;
}

// Keeps h along n where it is the least so far, and the least of the other directions.
static inline void oracle_keep(oracle *o, gv_vec3 n, double h) {
  if (gv_dot(n, o->normal) > 0.99999) {  // the same direction, about
    if (h < -o->distance) {
      o->distance = -h;
      o->normal = n;
    }
  } else if (h < -o->distance) {
    o->second = -o->distance;
    o->distance = -h;
    o->normal = n;
  } else {
    o->second = fmin(o->second, h);
  }
}

static inline void oracle_try(oracle *o, const solid *a, const solid *b, gv_vec3 n) {
  oracle_keep(o, n, overlap_along(a, b, n));
}

// Largest separation over all directions that can bound the obstacle: minus the depth where they overlap.
static inline oracle oracle_overlap(const solid *a, const solid *b) {
  oracle o = {-HUGE_VAL, {0, 0, 0}, HUGE_VAL};
  for (int f = 0; f < b->faces; f++)
    oracle_try(&o, a, b, b->n[f]);
  for (int f = 0; f < a->faces; f++)
    oracle_try(&o, a, b, gv_neg(a->n[f]));
  for (int i = 0; i < a->edges; i++) {
    for (int k = 0; k < b->edges; k++) {
      gv_vec3 e = gv_sub(a->v[a->edge[i][1]], a->v[a->edge[i][0]]);
      gv_vec3 f = gv_sub(b->v[b->edge[k][1]], b->v[b->edge[k][0]]);
      gv_vec3 n = gv_cross(e, f);
      if (gv_norm(n) <= 1e-7 * gv_norm(e) * gv_norm(f))
        continue;
      n = gv_scale(n, 1 / gv_norm(n));
      if (gv_dot(n, gv_sub(a->v[a->edge[i][0]], b->v[b->edge[k][0]])) < 0)
        n = gv_neg(n);
      oracle_try(&o, a, b, n);
      oracle_try(&o, a, b, gv_neg(n));
    }
  }
  return o;
}

static inline void oracle_nearer(oracle *o, gv_vec3 from_b_to_a) {
  double d = gv_norm(from_b_to_a);
  if (d < o->distance) {
    o->distance = d;
    o->normal = gv_normalize_or(from_b_to_a, gv_v3(0, 0, 1));
  }
}

static inline gv_vec3 nearest_on_edge(gv_vec3 p, gv_vec3 a, gv_vec3 b) {
  gv_vec3 e = gv_sub(b, a);
  double l2 = gv_norm2(e);
  return gv_mad(a, l2 > 0 ? gv_clamp(gv_dot(gv_sub(p, a), e) / l2, 0, 1) : 0, e);
}

static inline void oracle_vertex_face(oracle *o, const solid *s, int f, gv_vec3 p, double sign) {
  double height = gv_dot(s->n[f], gv_sub(p, s->v[s->corner[s->start[f]]]));
  if (height < -1e-12)
    return;  // known to be apart: in front, rounding aside
  gv_vec3 foot = gv_mad(p, -height, s->n[f]);
  int sides = s->start[f + 1] - s->start[f];
  for (int k = 0; k < sides; k++) {
    gv_vec3 c = s->v[s->corner[s->start[f] + k]];
    gv_vec3 d = s->v[s->corner[s->start[f] + (k + 1) % sides]];
    if (gv_dot(gv_cross(gv_sub(d, c), gv_sub(foot, c)), s->n[f]) < 0)
      return;
  }
  if (height < o->distance) {
    o->distance = height;
    o->normal = gv_scale(s->n[f], sign);
  }
}

static inline void oracle_edges(oracle *o, const solid *a, int i, const solid *b, int k) {
  gv_vec3 p = a->v[a->edge[i][0]];
  gv_vec3 p2 = a->v[a->edge[i][1]];
  gv_vec3 q = b->v[b->edge[k][0]];
  gv_vec3 q2 = b->v[b->edge[k][1]];
  oracle_nearer(o, gv_sub(p, nearest_on_edge(p, q, q2)));
  oracle_nearer(o, gv_sub(p2, nearest_on_edge(p2, q, q2)));
  oracle_nearer(o, gv_sub(nearest_on_edge(q, p, p2), q));
  oracle_nearer(o, gv_sub(nearest_on_edge(q2, p, p2), q2));
  gv_vec3 e = gv_sub(p2, p);
  gv_vec3 f = gv_sub(q2, q);
  gv_vec3 r = gv_sub(p, q);
  gv_vec3 n = gv_cross(e, f);
  double n2 = gv_norm2(n);
  if (n2 <= 1e-20 * gv_norm2(e) * gv_norm2(f))
    return;  // parallel: the ends have it
  double t = gv_dot(gv_cross(f, r), n) / n2;
  double u = gv_dot(gv_cross(e, r), n) / n2;
  if (t < 0 || t > 1 || u < 0 || u > 1)
    return;
  oracle_nearer(o, gv_sub(gv_mad(p, t, e), gv_mad(q, u, f)));
}

static inline oracle oracle_apart(const solid *a, const solid *b) {
  oracle o = {HUGE_VAL, {0, 0, 0}, HUGE_VAL};
  for (int f = 0; f < b->faces; f++)
    for (int i = 0; i < a->vertices; i++)
      oracle_vertex_face(&o, b, f, a->v[i], 1);
  for (int f = 0; f < a->faces; f++)
    for (int i = 0; i < b->vertices; i++)
      oracle_vertex_face(&o, a, f, b->v[i], -1);
  for (int i = 0; i < a->edges; i++)
    for (int k = 0; k < b->edges; k++)
      oracle_edges(&o, a, i, b, k);
  return o;
}

// Of the cores, radii left out.
static inline oracle oracle_distance(const gv_shape *sa, const gv_pose *Ta, const gv_shape *sb,
                                     const gv_pose *Tb) {
  static solid a, b;
  solid_of(sa, Ta, &a);
  solid_of(sb, Tb, &b);
  oracle o = oracle_overlap(&a, &b);
  return o.distance > 0 ? oracle_apart(&a, &b) : o;
}

// A rounded hull of `count` points on an ellipsoid.
static inline void build_round_hull(int count, gv_vec3 radius, void *mem, size_t size, gv_hull *out) {
  static gv_vec3 p[GV_MAX_HULL_VERTICES];
  gv_arena arena;
  gv_arena_init(&arena, mem, size);
  for (int i = 0; i < count; i++) {
    gv_vec3 u = draw_unit();
    p[i] = gv_v3(u.x * radius.x, u.y * radius.y, u.z * radius.z);
  }
  int error = gv_hull_build(&arena, p, count, out);
  if (error) {
    printf("round hull: %s\n", gv_hull_error(error));
    exit(1);
  }
}

static inline void build_box_hull(gv_vec3 h, void *mem, size_t size, gv_hull *out) {
  gv_vec3 p[8];
  gv_arena arena;
  gv_arena_init(&arena, mem, size);
  for (int i = 0; i < 8; i++)
    p[i] = gv_v3(i & 1 ? h.x : -h.x, i & 2 ? h.y : -h.y, i & 4 ? h.z : -h.z);
  int error = gv_hull_build(&arena, p, 8, out);
  if (error) {
    printf("box hull: %s\n", gv_hull_error(error));
    exit(1);
  }
}

#endif
