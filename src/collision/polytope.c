// SPDX-License-Identifier: BSD-3-Clause
// Growing a convex surface: the faces that a new point sees are found by walking over edges from one of
// them, and replaced by a fan from their outline to the point. Every change is checked before it is made
// (one outline, no triangle without area), so that rounding can end the growth but never tear the surface.
// Pure, fixed memory; any thread. Cost of a point: about 20 ns per face that it sees.
#include "collision/polytope.h"

#include <assert.h>

enum { DEAD, ALIVE, SEEN, NONE = 0xffff };

// The point farthest from point a, from the line through a along a unit vector, and from the plane through a
// with a unit normal; of equals the first. *out_distance: how far.
static int farthest_from_point(const gv_vec3 *point, int count, int a, double *out_distance) {
  int found = 0;
  double best = 0;
  for (int i = 1; i < count; i++) {
    double distance2 = gv_norm2(gv_sub(point[i], point[a]));
    if (!(distance2 > best))
      continue;
    best = distance2;
    found = i;
  }
  *out_distance = sqrt(best);
  return found;
}

static double distance_to_line2(gv_vec3 p, gv_vec3 a, gv_vec3 direction) {
  gv_vec3 r = gv_sub(p, a);
  return gv_norm2(gv_mad(r, -gv_dot(r, direction), direction));
}

static int farthest_from_line(const gv_vec3 *point, int count, int a, gv_vec3 along, double *out_distance) {
  int found = 0;
  double best = 0;
  for (int i = 0; i < count; i++) {
    double distance2 = distance_to_line2(point[i], point[a], along);
    if (!(distance2 > best))
      continue;
    best = distance2;
    found = i;
  }
  *out_distance = sqrt(best);
  return found;
}

static int farthest_from_plane(const gv_vec3 *point, int count, int a, gv_vec3 normal, double *out_distance) {
  int found = 0;
  *out_distance = 0;
  for (int i = 0; i < count; i++) {
    double height = fabs(gv_dot(normal, gv_sub(point[i], point[a])));
    if (!(height > *out_distance))
      continue;
    *out_distance = height;
    found = i;
  }
  return found;
}

bool gv_polytope_pick_tetrahedron(const gv_vec3 *point, int count, double tolerance, uint16_t out_pick[4]) {
  assert(count > 0 && count <= NONE && tolerance >= 0.0);
  double distance;
  for (int k = 0; k < 4; k++)
    out_pick[k] = 0;
  const int a = 0;
  const int b = farthest_from_point(point, count, a, &distance);
  out_pick[1] = (uint16_t)b;
  if (!(distance > tolerance))
    return false;
  const gv_vec3 along = gv_scale(gv_sub(point[b], point[a]), 1.0 / distance);
  const int c = farthest_from_line(point, count, a, along, &distance);
  out_pick[2] = (uint16_t)c;
  if (!(distance > tolerance))
    return false;
  const gv_vec3 across = gv_cross(along, gv_sub(point[c], point[a]));
  const gv_vec3 normal = gv_normalize_or(across, gv_v3(0, 0, 1));
  out_pick[3] = (uint16_t)farthest_from_plane(point, count, a, normal, &distance);
  return distance > tolerance;
}

// Plane of the triangle a, b, c; false where it has no area worth a direction (height under 1e-14 of its
// length).
static bool find_plane(gv_vec3 a, gv_vec3 b, gv_vec3 c, gv_vec3 *out_normal, double *out_offset) {
  gv_vec3 ab = gv_sub(b, a);
  gv_vec3 ac = gv_sub(c, a);
  gv_vec3 n = gv_cross(ab, ac);
  double area = gv_norm(n);
  double length2 = fmax(gv_norm2(ab), gv_norm2(ac));
  if (!(area > 1e-14 * length2))
    return false;
  *out_normal = gv_scale(n, 1.0 / area);
  *out_offset = gv_dot(*out_normal, gv_scale(gv_add(gv_add(a, b), c), 1.0 / 3.0));
  return true;
}

bool gv_polytope_start(gv_polytope *P, const uint16_t pick[4]) {
  assert(P->face_max >= 4);
  static const uint8_t corner[4][3] = {{0, 1, 2}, {0, 3, 1}, {1, 3, 2}, {2, 3, 0}};
  static const uint8_t adjacent[4][3] = {{1, 2, 3}, {3, 2, 0}, {1, 3, 0}, {2, 1, 0}};
  uint16_t v[4] = {pick[0], pick[1], pick[2], pick[3]};
  const gv_vec3 *p = P->point;
  gv_vec3 n = gv_cross(gv_sub(p[v[1]], p[v[0]]), gv_sub(p[v[2]], p[v[0]]));
  if (gv_dot(n, gv_sub(p[v[3]], p[v[0]])) > 0) {  // the other way round
    v[1] = pick[2];
    v[2] = pick[1];
  }
  for (int f = 0; f < 4; f++) {
    gv_polytope_face *F = &P->face[f];
    for (int k = 0; k < 3; k++) {
      F->vertex[k] = v[corner[f][k]];
      F->adjacent[k] = adjacent[f][k];
    }
    F->state = ALIVE;
    if (!find_plane(p[F->vertex[0]], p[F->vertex[1]], p[F->vertex[2]], &F->normal, &F->offset))
      return false;
  }
  P->face_count = 4;
  P->free_head = -1;
  return true;
}

int gv_polytope_most_visible(const gv_polytope *P, gv_vec3 point) {
  double best = P->tolerance;
  int found = -1;
  for (int f = 0; f < P->face_count; f++) {
    double height = gv_dot(P->face[f].normal, point) - P->face[f].offset;
    if (P->face[f].state == DEAD || !(height > best))
      continue;
    best = height;
    found = f;
  }
  return found;
}

static uint16_t edge_towards(const gv_polytope_face *F, uint16_t from) {
  assert(F->vertex[0] == from || F->vertex[1] == from || F->vertex[2] == from);
  return F->vertex[0] == from ? 0 : F->vertex[1] == from ? 1 : 2;
}

// Walk over the faces that the point sees; their outline goes to P->edge. Returns how many faces.
static int find_seen(gv_polytope *P, gv_vec3 point, int seed, int *out_edges) {
  assert(seed >= 0 && seed < P->face_count && P->face[seed].state == ALIVE);
  int seen = 0;
  int edges = 0;
  P->seen[seen++] = (uint16_t)seed;
  P->face[seed].state = SEEN;
  for (int next = 0; next < seen; next++) {
    const gv_polytope_face *F = &P->face[P->seen[next]];
    for (int k = 0; k < 3; k++) {
      gv_polytope_face *G = &P->face[F->adjacent[k]];
      if (G->state == ALIVE && gv_dot(G->normal, point) - G->offset > P->tolerance) {
        G->state = SEEN;
        P->seen[seen++] = F->adjacent[k];
      }
    }
  }
  for (int next = 0; next < seen; next++) {
    const gv_polytope_face *F = &P->face[P->seen[next]];
    for (int k = 0; k < 3; k++) {
      uint16_t from = F->vertex[k];
      uint16_t to = F->vertex[(k + 1) % 3];
      uint16_t outside = F->adjacent[k];
      if (P->face[outside].state == SEEN)
        continue;
      const uint16_t outside_edge = edge_towards(&P->face[outside], to);
      P->edge[edges++] = (gv_polytope_edge){from, to, outside, outside_edge, {0, 0, 0}, 0};
    }
  }
  *out_edges = edges;
  return seen;
}

// The outline must be one closed loop; P->link[vertex] becomes the number of the edge that leaves it.
static bool is_one_loop(gv_polytope *P, int edges) {
  for (int e = 0; e < edges; e++) {
    P->link[P->edge[e].from] = NONE;
    P->link[P->edge[e].to] = NONE;
  }
  for (int e = 0; e < edges; e++) {
    if (P->link[P->edge[e].from] != NONE)
      return false;
    P->link[P->edge[e].from] = (uint16_t)e;
  }
  int e = 0;
  int steps = 0;
  do {
    e = P->link[P->edge[e].to];
    steps++;
  } while (e != 0 && e != NONE && steps <= edges);
  return e == 0 && steps == edges;
}

static bool plan_fan(gv_polytope *P, uint16_t point, int edges) {
  for (int e = 0; e < edges; e++) {
    gv_polytope_edge *E = &P->edge[e];
    const gv_vec3 from = P->point[E->from];
    const gv_vec3 to = P->point[E->to];
    if (!find_plane(from, to, P->point[point], &E->normal, &E->offset))
      return false;
    if (E->offset < P->least_offset)
      return false;
  }
  return true;
}

static int count_free(const gv_polytope *P, int wanted) {
  int free_slots = P->face_max - P->face_count;
  for (int f = P->free_head; f >= 0 && free_slots < wanted; free_slots++)
    f = P->face[f].adjacent[0] == NONE ? -1 : P->face[f].adjacent[0];
  return free_slots;
}

static uint16_t take_slot(gv_polytope *P) {
  assert(P->free_head >= 0 || P->face_count < P->face_max);
  int f = P->free_head;
  if (f < 0)
    return (uint16_t)P->face_count++;
  P->free_head = P->face[f].adjacent[0] == NONE ? -1 : P->face[f].adjacent[0];
  return (uint16_t)f;
}

static void give_slot(gv_polytope *P, uint16_t f) {
  P->face[f].state = DEAD;
  P->face[f].adjacent[0] = P->free_head < 0 ? NONE : (uint16_t)P->free_head;
  P->free_head = f;
}

static void build_fan(gv_polytope *P, uint16_t point, int edges) {
  for (int e = 0; e < edges; e++)
    P->seen[e] = take_slot(P);
  for (int e = 0; e < edges; e++) {
    const gv_polytope_edge *E = &P->edge[e];
    gv_polytope_face *F = &P->face[P->seen[e]];
    *F = (gv_polytope_face){E->normal, E->offset, {E->from, E->to, point}, {E->outside, 0, 0}, ALIVE};
    P->face[E->outside].adjacent[E->outside_edge] = P->seen[e];
  }
  for (int e = 0; e < edges; e++) {
    uint16_t next = P->seen[P->link[P->edge[e].to]];
    P->face[P->seen[e]].adjacent[1] = next;
    P->face[next].adjacent[2] = P->seen[e];
  }
}

bool gv_polytope_add(gv_polytope *P, uint16_t point, int seed) {
  assert(seed >= 0 && gv_polytope_alive(P, seed));
  int edges, seen = find_seen(P, P->point[point], seed, &edges);
  bool fits = edges >= 3 && count_free(P, edges) + seen >= edges;
  bool possible = fits && is_one_loop(P, edges) && plan_fan(P, point, edges);
  for (int i = 0; i < seen; i++) {
    if (possible)
      give_slot(P, P->seen[i]);
    else
      P->face[P->seen[i]].state = ALIVE;
  }
  if (possible)
    build_fan(P, point, edges);
  return possible;
}
