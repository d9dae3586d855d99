// SPDX-License-Identifier: BSD-3-Clause
// The oracle of polyhedra.h made fast enough for a million poses of hulls of 1000 vertices: the same features
// and directions, but those that cannot matter are left out. What is left out is proved by a hint, the answer
// under test, which may be wrong: it then costs time, never exactness.
//
// Apart, at most U: points of A and B at distance U or less lie within U of each other along any direction d,
// so only features that reach that slab are measured. Overlapping by at most U: the least h(n) is at a face
// normal or where an edge's arc of normals crosses one of the other body (Gauss map); for n between two
// normals of an edge of B through b, h(n) >= (b - a).n for any point a of A, which rules most out.
#ifndef ORACLE_H
#define ORACLE_H

#include "support/polyhedra.h"

enum { WITNESSES = 32 };

typedef struct body {  // a core as the oracle sees it, placed in the frame of B
  solid s;             // v, n: as placed; the rest never changes
  gv_vec3 own_v[SOLID_VERTICES], own_n[SOLID_FACES];  // in its own frame
  double high[SOLID_FACES];                           // n . x on each face, as placed
  int edge_face[SOLID_EDGES][2];                      // beside each edge; -1: a segment has none
  int witness[WITNESSES], witnesses;                  // vertices, spread out
  double seen[SOLID_FACES][WITNESSES];                // n . x of the other body's witnesses
  int near_vertex[SOLID_VERTICES], near_face[SOLID_FACES], near_edge[SOLID_EDGES];  // that can matter
  int near_vertices, near_faces, near_edges;
} body;

static inline double highest(const body *o, gv_vec3 d) {
  double high = -HUGE_VAL;
  for (int i = 0; i < o->s.vertices; i++)
    high = fmax(high, gv_dot(o->s.v[i], d));
  return high;
}

static inline double lowest(const body *o, gv_vec3 d) { return -highest(o, gv_neg(d)); }

static inline void body_link_edges(body *o) {
  solid *s = &o->s;
  for (int e = 0; e < s->edges; e++) {
    int found = 0;
    o->edge_face[e][0] = o->edge_face[e][1] = -1;
    for (int f = 0; f < s->faces && found < 2; f++) {
      int sides = s->start[f + 1] - s->start[f];
      for (int k = 0; k < sides && found < 2; k++) {
        int i = s->corner[s->start[f] + k];
        int j = s->corner[s->start[f] + (k + 1) % sides];
        bool same = (i == s->edge[e][0] && j == s->edge[e][1]) || (i == s->edge[e][1] && j == s->edge[e][0]);
        if (same)
          o->edge_face[e][found++] = f;
      }
    }
  }
}

static inline void body_pick_witnesses(body *o) {
  o->witnesses = o->s.vertices < WITNESSES ? o->s.vertices : WITNESSES;
  for (int k = 0; k < o->witnesses; k++) {
    double z = 1 - (2 * k + 1) / (double)o->witnesses;
    double s;
    double c;
    double high = -HUGE_VAL;
    gv_sincos(k * 2.399963229728653, &s, &c);
    gv_vec3 d = gv_v3(c * sqrt(1 - z * z), s * sqrt(1 - z * z), z);
    o->witness[k] = k;
    for (int i = 0; i < o->s.vertices && o->s.vertices > WITNESSES; i++)
      if (gv_dot(o->s.v[i], d) > high) {
        high = gv_dot(o->s.v[i], d);
        o->witness[k] = i;
      }
  }
}

static inline void body_place(body *o, gv_pose T) {
  gv_mat3 R = gv_mat3_from_quat(T.q);
  for (int i = 0; i < o->s.vertices; i++)
    o->s.v[i] = gv_add(gv_mat3_mul(&R, o->own_v[i]), T.p);
  for (int f = 0; f < o->s.faces; f++) {
    o->s.n[f] = gv_mat3_mul(&R, o->own_n[f]);
    o->high[f] = gv_dot(o->s.n[f], o->s.v[o->s.corner[o->s.start[f]]]);
  }
}

static inline void body_init(body *o, const gv_shape *shape) {
  gv_pose here = gv_pose_identity();
  solid_of(shape, &here, &o->s);
  for (int i = 0; i < o->s.vertices; i++)
    o->own_v[i] = o->s.v[i];
  for (int f = 0; f < o->s.faces; f++)
    o->own_n[f] = o->s.n[f];
  body_link_edges(o);
  body_pick_witnesses(o);
  body_place(o, here);
}

// How far the point is outside the core, metres.
static inline double body_outside(const body *o, gv_vec3 p) {
  if (o->s.faces == 0)
    return gv_norm(gv_sub(p, nearest_on_edge(p, o->s.v[0], o->s.v[1])));
  double out = 0;
  for (int f = 0; f < o->s.faces; f++)
    out = fmax(out, gv_dot(o->s.n[f], p) - o->high[f]);
  return out;
}

// ---- apart ----

// Features that reach further along d than `from`.
static inline void body_find_near(body *o, gv_vec3 d, double from) {
  static bool reaches[SOLID_VERTICES];
  const solid *s = &o->s;
  o->near_vertices = o->near_faces = o->near_edges = 0;
  for (int i = 0; i < s->vertices; i++) {
    reaches[i] = gv_dot(s->v[i], d) >= from;
    if (reaches[i])
      o->near_vertex[o->near_vertices++] = i;
  }
  for (int e = 0; e < s->edges; e++)
    if (reaches[s->edge[e][0]] || reaches[s->edge[e][1]])
      o->near_edge[o->near_edges++] = e;
  for (int f = 0; f < s->faces; f++) {
    bool near = false;
    for (int k = s->start[f]; k < s->start[f + 1] && !near; k++)
      near = reaches[s->corner[k]];
    if (near)
      o->near_face[o->near_faces++] = f;
  }
}

// Distance of cores that are apart by at most `at_most`; d: a unit vector, from B to A about.
static inline oracle oracle_apart_within(body *a, body *b, gv_vec3 d, double at_most) {
  oracle o = {HUGE_VAL, {0, 0, 0}, HUGE_VAL};
  at_most += 1e-9;
  body_find_near(a, gv_neg(d), -highest(b, d) - at_most);
  body_find_near(b, d, lowest(a, d) - at_most);
  for (int f = 0; f < b->near_faces; f++)
    for (int i = 0; i < a->near_vertices; i++)
      oracle_vertex_face(&o, &b->s, b->near_face[f], a->s.v[a->near_vertex[i]], 1);
  for (int f = 0; f < a->near_faces; f++)
    for (int i = 0; i < b->near_vertices; i++)
      oracle_vertex_face(&o, &a->s, a->near_face[f], b->s.v[b->near_vertex[i]], -1);
  for (int i = 0; i < a->near_edges; i++)
    for (int k = 0; k < b->near_edges; k++)
      oracle_edges(&o, &a->s, a->near_edge[i], &b->s, b->near_edge[k]);
  return o;
}

// ---- overlapping ----

typedef struct hunt {
  body *a, *b;
  double reach;
  oracle found;
} hunt;  // reach: a larger h is of no interest

static inline void hunt_try(hunt *t, gv_vec3 n) {
  oracle_keep(&t->found, n, highest(t->b, n) - lowest(t->a, n));
}

// Of `mine`; sign: the direction of the hunt is sign times the face's normal.
static inline void hunt_faces(hunt *t, body *mine, const body *other, double sign) {
  for (int f = 0; f < mine->s.faces; f++) {
    double low = HUGE_VAL;
    for (int k = 0; k < other->witnesses; k++) {
      mine->seen[f][k] = gv_dot(mine->s.n[f], other->s.v[other->witness[k]]);
      low = fmin(low, mine->seen[f][k]);
    }
    if (mine->high[f] - low <= t->reach)
      hunt_try(t, gv_scale(mine->s.n[f], sign));
  }
}

// Edges between whose faces' normals some direction may have an h within reach.
static inline void find_open_edges(const hunt *t, body *mine, const body *other) {
  mine->near_edges = 0;
  for (int e = 0; e < mine->s.edges; e++) {
    int f = mine->edge_face[e][0];
    int g = mine->edge_face[e][1];
    double least = -HUGE_VAL;
    for (int k = 0; f >= 0 && k < other->witnesses && least <= t->reach; k++)
      least = fmax(least, fmin(mine->high[f] - mine->seen[f][k], mine->high[g] - mine->seen[g][k]));
    if (least <= t->reach)
      mine->near_edge[mine->near_edges++] = e;
  }
}

static inline gv_vec3 edge_along(const body *o, int e) {
  return gv_sub(o->s.v[o->s.edge[e][1]], o->s.v[o->s.edge[e][0]]);
}

// Do the normals of edge e reach both sides of the plane at right angles to
// `across`? (Rounding counts as yes.)
static inline bool arc_crosses(const body *o, int e, gv_vec3 across) {
  if (o->edge_face[e][0] < 0)
    return true;
  double p = gv_dot(o->s.n[o->edge_face[e][0]], across);
  double q = gv_dot(o->s.n[o->edge_face[e][1]], across);
  double slack = 1e-9 * gv_norm(across);
  return !(p > slack && q > slack) && !(p < -slack && q < -slack);
}

static inline bool is_on_arc_side(const body *o, int e, gv_vec3 n) {
  if (o->edge_face[e][0] < 0)
    return true;
  return gv_dot(n, o->s.n[o->edge_face[e][0]]) + gv_dot(n, o->s.n[o->edge_face[e][1]]) > 0;
}

static inline void hunt_edges(hunt *t, int i, int k) {
  gv_vec3 e = edge_along(t->a, i);
  gv_vec3 f = edge_along(t->b, k);
  if (!arc_crosses(t->a, i, f) || !arc_crosses(t->b, k, e))
    return;
  gv_vec3 n = gv_cross(e, f);
  double size = gv_norm(n);
  if (size <= 1e-12 * gv_norm(e) * gv_norm(f))
    return;
  for (int sign = -1; sign <= 1; sign += 2) {
    gv_vec3 m = gv_scale(n, sign / size);
    if (!is_on_arc_side(t->a, i, gv_neg(m)) || !is_on_arc_side(t->b, k, m))
      continue;
    double h = gv_dot(m, gv_sub(t->b->s.v[t->b->s.edge[k][0]], t->a->s.v[t->a->s.edge[i][0]]));
    if (h <= t->reach)
      hunt_try(t, m);
  }
}

// Least h over all directions, where some direction is known to have `at_most`: minus the depth. `second` is
// the least at another direction, where it is within a micrometre and a bit of the depth.
static inline oracle oracle_overlap_within(body *a, body *b, double at_most) {
  hunt t = {a, b, fmax(at_most, 0) + 1.2e-6, {-HUGE_VAL, {0, 0, 0}, HUGE_VAL}};
  hunt_faces(&t, b, a, 1);
  hunt_faces(&t, a, b, -1);
  find_open_edges(&t, b, a);
  find_open_edges(&t, a, b);
  for (int i = 0; i < a->near_edges; i++)
    for (int k = 0; k < b->near_edges; k++)
      hunt_edges(&t, a->near_edge[i], b->near_edge[k]);
  return t.found;
}

// Signed distance of the cores, in the frame of B. Hint: a unit normal, and points of the cores.
static inline oracle oracle_with_hint(body *a, body *b, gv_vec3 n, gv_vec3 on_a, gv_vec3 on_b) {
  double h = highest(b, n) - lowest(a, n);
  if (h >= 0 && (a->s.faces > 0 || b->s.faces > 0)) {  // two segments are never deep
    oracle o = oracle_overlap_within(a, b, h);
    if (o.distance <= 0)
      return o;
    n = o.normal;
  }
  double at_most = gv_norm(gv_sub(a->s.v[0], b->s.v[0]));
  if (body_outside(a, on_a) < 1e-10 && body_outside(b, on_b) < 1e-10)
    at_most = fmin(at_most, gv_norm(gv_sub(on_a, on_b)) + 2e-10);
  return oracle_apart_within(a, b, n, at_most);
}

#endif
