// SPDX-License-Identifier: BSD-3-Clause
// A limb along the sides of a core: the segment is cut by the prism of the face under it, and followed over
// the neighbouring faces to where it ends. Contacts are where it ends, and the edges on the way that it may
// rock on: without them it would rock each step. Pure; any thread. Cost: 0.2 us, 0.4 us along small faces.
#include <assert.h>

#include "collision/manifold.h"

enum { WALK = 16 };  // faces that are followed to each end
// Counted work: a side of a face, a step to the next face.
enum { SIDE_OPERATIONS = 10, STEP_OPERATIONS = 40 };

// Metres: over edges so much farther than the closest point a limb may rock within a step.
static const double rocks = 1e-4;

typedef struct span {  // the part of a segment that lies over a face: 0 to 1 along it
  double from, to;
  int from_side, to_side;  // sides of the prism where it begins and ends; -1: at its own end
} span;

typedef struct walk {  // on the way towards one end
  bool to_end;         // to the segment's second point
  double at, gap;      // along the segment; over the face
  int face;            // of the hull
  int leaves;          // side of that face over which the segment goes on; -1: it ends here
} walk;

static gv_vec3 point_at(const gv_face *segment, double at) {
  return gv_mad(segment->p[0], at, gv_sub(segment->p[1], segment->p[0]));
}

// The part of the segment within the prism of the face; false if none.
static bool clip_segment(gv_manifold *m, const gv_face *face, gv_vec3 up, const gv_face *segment, span *out) {
  gv_vec3 p = segment->p[0];
  gv_vec3 along = gv_sub(segment->p[1], p);
  m->operations += SIDE_OPERATIONS * face->count;
  *out = (span){0, 1, -1, -1};
  for (int k = 0; k < face->count; k++) {
    gv_vec3 outward = gv_face_prism_side(face, k, up);
    double h = gv_dot(outward, gv_sub(p, face->p[k])) - gv_manifold_on_side * gv_norm(outward);
    double slope = gv_dot(outward, along);
    if (h > 0 && h + slope > 0)
      return false;
    if (h > 0 && h / -slope > out->from) {
      out->from = h / -slope;
      out->from_side = k;
    }
    if (h <= 0 && h + slope > 0 && -h / slope < out->to) {
      out->to = -h / slope;
      out->to_side = k;
    }
  }
  return out->from <= out->to;
}

// The face on the other side of side k of the face.
static int face_across(const gv_hull *hull, int face, int k) {
  assert(face >= 0 && face < hull->face_count);
  int first = hull->face_start[face];
  int sides = hull->face_start[face + 1] - first;
  assert(k >= 0 && k < sides);
  uint16_t from = hull->face_vertex[first + k];
  uint16_t to = hull->face_vertex[first + (k + 1) % sides];
  int e = hull->neighbor_start[to];
  while (e + 1 < hull->neighbor_start[to + 1] && hull->neighbor[e] != from)
    e++;
  return hull->neighbor_face[e];
}

// Where a segment that has come over the face leaves it, towards its end: how far along, and over which side.
static double leave_face(const gv_face *face, gv_vec3 up, const gv_face *segment, bool to_end,
                         int *out_side) {
  gv_vec3 p = segment->p[0];
  gv_vec3 along = gv_sub(segment->p[1], p);
  double at = to_end ? 1 : 0;
  *out_side = -1;
  for (int k = 0; k < face->count; k++) {
    gv_vec3 outward = gv_face_prism_side(face, k, up);
    double slope = gv_dot(outward, along);
    if (to_end ? slope <= 0 : slope >= 0)
      continue;
    double slack = gv_manifold_on_side * gv_norm(outward);
    double t = (slack - gv_dot(outward, gv_sub(p, face->p[k]))) / slope;
    if (to_end ? t >= at : t <= at)
      continue;
    at = t;
    *out_side = k;
  }
  return at;
}

static void add_at(gv_manifold *m, const gv_reference *r, const gv_face *segment, const walk *w) {
  gv_manifold_add(m, r, point_at(segment, w->at), w->gap, r->of_b ? (uint16_t)w->face : GV_NO_FACE);
}

// On to the next face. False where that is steep, out of reach, or no further along.
static bool step_over(gv_manifold *m, const gv_reference *r, const gv_face *segment, walk *io) {
  const gv_hull *hull = r->core->hull;
  gv_face side;
  walk next = {.to_end = io->to_end, .face = face_across(hull, io->face, io->leaves)};
  m->operations += STEP_OPERATIONS;
  if (gv_dot(gv_core_turn(r->core, hull->face_normal[next.face]), r->up) < gv_manifold_steep)
    return false;
  gv_face_of_hull(r->core, next.face, &side);
  next.at = leave_face(&side, r->up, segment, io->to_end, &next.leaves);
  next.gap = gv_gap_over(&side, r->up, point_at(segment, next.at));
  if (next.gap > m->limit || (io->to_end ? next.at <= io->at : next.at >= io->at))
    return false;
  if (io->gap <= m->closest + rocks)
    add_at(m, r, segment, io);  // an edge to rock on
  *io = next;
  return true;
}

// From the face that `part` of the segment lies over towards one of its ends.
static void walk_to_end(gv_manifold *m, const gv_reference *r, const gv_face *face, const span *part,
                        const gv_face *segment, bool to_end) {
  walk w = {.to_end = to_end, .face = face->index};
  w.at = to_end ? part->to : part->from;
  w.leaves = to_end ? part->to_side : part->from_side;
  w.gap = gv_gap_over(face, r->up, point_at(segment, w.at));
  for (int steps = 0; steps < WALK && w.leaves >= 0 && w.gap <= m->limit; steps++) {
    if (r->core->kind != GV_CORE_HULL)
      break;
    if (!step_over(m, r, segment, &w))
      break;
  }
  add_at(m, r, segment, &w);
}

// The nearest face to the reference that the limb lies over at all: the reference, or one around the vertex.
static bool find_under_limb(gv_manifold *m, const gv_reference *r, int vertex, const gv_face *segment,
                            gv_face *io_face, span *out_part) {
  assert(vertex >= 0);
  const gv_core *core = r->core;
  if (clip_segment(m, io_face, r->up, segment, out_part))
    return true;
  if (core->kind != GV_CORE_HULL)
    return false;
  const gv_hull *hull = core->hull;
  vertex = gv_hull_support(hull, gv_core_turn_back(core, r->up), vertex, &m->operations);
  for (int k = hull->neighbor_start[vertex]; k < hull->neighbor_start[vertex + 1]; k++) {
    int f = hull->neighbor_face[k];
    if (gv_dot(gv_core_turn(core, hull->face_normal[f]), r->up) < gv_manifold_steep)
      continue;
    gv_face_of_hull(core, f, io_face);
    if (clip_segment(m, io_face, r->up, segment, out_part))
      return true;
  }
  return false;
}

void gv_manifold_add_limb(gv_manifold *m, const gv_reference *reference, int vertex, const gv_face *segment,
                          gv_face *io_face) {
  span part;
  assert(segment->count == 2);
  if (!find_under_limb(m, reference, vertex, segment, io_face, &part))
    return;
  walk_to_end(m, reference, io_face, &part, segment, false);
  walk_to_end(m, reference, io_face, &part, segment, true);
}
