// SPDX-License-Identifier: BSD-3-Clause
// Contact manifold: where a flat side lies on a flat side (or a limb along one), the closest point alone
// jumps from corner to corner; here every corner of the common region becomes a contact with a depth of
// its own (the paper's wish of a penetration depth per polygon).
//
// The reference polygon is the side of one core that faces the contact normal best. The other core's
// side, or segment, is clipped against the prism that the reference sweeps along the normal; the gap of
// each corner is measured along the normal, so it is never less than the distance of the pair. Works in
// the frame of B. Pure; any thread. Cost: 0.1 us beside the distance, 0.4 us for a limb along small faces.
#include "collision/cso.h"

enum { CORNERS = 2 * GV_MAX_FACE_VERTICES + 8, WALK = 16, NO_FACE = 0xffff };
enum { SCAN_UP_TO = 24 };  // faces: below, a scan is faster than a walk

static const double steep = 0.3;       // least cosine of reference face and normal (72 degrees)
static const double flat = 1 - 1e-9;    // cosine: no other face is nearer (45 microradians)
static const double on_side = 1e-9;    // metres: a corner this far outside the prism is still inside
static const double opposite = -0.5;    // cosine of two normals: a turn by more than 120 degrees
static const double same_gap = 1e-9;   // metres
static const double rocks = 1e-4;      // metres: over edges so much farther than the closest point a limb may rock within a step
static const double same_place = 1e-5; // metres: nearer contacts are one

typedef struct polygon {
  gv_vec3 p[CORNERS];     // counter-clockwise from outside
  int count;
  gv_vec3 normal;         // unit, outward
  uint16_t face;          // of the hull
} polygon;

typedef struct corner {   // a contact to be
  gv_vec3 on_a, on_b;     // on the cores; on_a - on_b = gap * normal
  double gap;             // of the cores, metres
  uint16_t face_b;
} corner;

typedef struct manifold {
  gv_vec3 n;              // unit, from B to A
  double limit, closest;  // largest gap of the cores that counts, and the least there is
  corner corner[CORNERS];
  int count;
  int operations;         // counted work
} manifold;

static gv_vec3 hull_turn(const gv_core *core, gv_vec3 v) { return core->in_place ? v : gv_mat3_mul(&core->R, v); }
static gv_vec3 hull_place(const gv_core *core, gv_vec3 v) { return core->in_place ? v : gv_add(core->center, gv_mat3_mul(&core->R, v)); }

// Of the faces around a vertex, whether one's normal is nearer to d (frame of the hull) than the best so far.
static void better_face_at(const gv_hull *hull, int vertex, gv_vec3 d, int *io_best, double *io_cosine) {
  for (int k = hull->neighbor_start[vertex]; k < hull->neighbor_start[vertex + 1]; k++) {
    double cosine = gv_dot(hull->face_normal[hull->neighbor_face[k]], d);
    if (cosine > *io_cosine) *io_cosine = cosine, *io_best = hull->neighbor_face[k];
  }
}

static int scan_faces(const gv_hull *hull, gv_vec3 d) {
  int best = 0;
  double high = gv_dot(hull->face_normal[0], d);
  for (int f = 1; f < hull->face_count; f++) {
    double cosine = gv_dot(hull->face_normal[f], d);
    if (cosine > high) high = cosine, best = f;
  }
  return best;
}

// Around the farthest vertex, and on while a face at one of the face's corners is nearer: on long thin faces the
// first may not be the best.
static int best_face(const gv_hull *hull, uint16_t *vertex, gv_vec3 d, int *io_operations) {
  if (hull->face_count <= SCAN_UP_TO) {
    *io_operations += hull->face_count;
    return scan_faces(hull, d);
  }
  *vertex = (uint16_t)gv_hull_support(hull, d, *vertex, io_operations);
  int best = hull->neighbor_face[hull->neighbor_start[*vertex]], from = -1;
  double cosine = gv_dot(hull->face_normal[best], d);
  better_face_at(hull, *vertex, d, &best, &cosine);
  while (best != from && cosine < flat) {
    from = best;
    *io_operations += 6 * (hull->face_start[from + 1] - hull->face_start[from]);
    for (int k = hull->face_start[from]; k < hull->face_start[from + 1]; k++)
      if (hull->face_vertex[k] != *vertex) better_face_at(hull, hull->face_vertex[k], d, &best, &cosine);
  }
  return best;
}

static void take_hull_face(const gv_core *core, int f, polygon *out) {
  const gv_hull *hull = core->hull;
  out->count = hull->face_start[f + 1] - hull->face_start[f];
  out->normal = hull_turn(core, hull->face_normal[f]);
  out->face = (uint16_t)f;
  for (int k = 0; k < out->count; k++) out->p[k] = hull_place(core, hull->vertex[hull->face_vertex[hull->face_start[f] + k]]);
}

static void take_box_face(const gv_core *core, gv_vec3 d, polygon *out) {
  gv_vec3 d_box = gv_mat3_mul_t(&core->R, d);
  const double along[3] = {d_box.x, d_box.y, d_box.z};
  int k = fabs(along[1]) > fabs(along[0]) ? 1 : 0;
  if (fabs(along[2]) > fabs(along[k])) k = 2;
  double side = along[k] >= 0 ? 1 : -1;
  gv_vec3 c = gv_mad(core->center, side, core->axis[k]), u = core->axis[(k + 1) % 3], v = gv_scale(core->axis[(k + 2) % 3], side);
  out->count = 4;
  out->normal = gv_scale(gv_v3(core->R.m[0][k], core->R.m[1][k], core->R.m[2][k]), side);
  out->face = NO_FACE;
  out->p[0] = gv_add(gv_add(c, u), v);
  out->p[1] = gv_add(gv_sub(c, u), v);
  out->p[2] = gv_sub(gv_sub(c, u), v);
  out->p[3] = gv_sub(gv_add(c, u), v);
}

// The side of a core that faces d best; a segment is a polygon of two corners without a normal.
static void take_side(const gv_core *core, gv_vec3 d, uint16_t *vertex, polygon *out, int *io_operations) {
  if (core->kind == GV_CORE_BOX) {
    take_box_face(core, d, out);
  } else if (core->kind == GV_CORE_HULL) {
    gv_vec3 d_hull = core->in_place ? d : gv_mat3_mul_t(&core->R, d);
    take_hull_face(core, best_face(core->hull, vertex, d_hull, io_operations), out);
  } else {
    out->count = 2;
    out->normal = gv_v3(0, 0, 0);
    out->face = NO_FACE;
    out->p[0] = gv_sub(core->center, core->axis[0]);
    out->p[1] = gv_add(core->center, core->axis[0]);
  }
}

// Height of q over the reference face, measured along `up` (unit, away from the reference).
static double gap_over(const polygon *reference, gv_vec3 up, gv_vec3 q) {
  return gv_dot(reference->normal, gv_sub(q, reference->p[0])) / gv_dot(reference->normal, up);
}

// Outward from side k of the prism that the polygon sweeps along `up`; not of unit length.
static inline gv_vec3 prism_side(const polygon *reference, int k, gv_vec3 up) {
  int next = k + 1 < reference->count ? k + 1 : 0;
  return gv_cross(gv_sub(reference->p[next], reference->p[k]), up);
}

// Clip by one side of the prism: Sutherland and Hodgman 1974.
static void clip_side(const polygon *in, gv_vec3 at, gv_vec3 outward, polygon *out) {
  int n = in->count;
  double slack = on_side * gv_norm(outward), hp = gv_dot(outward, gv_sub(in->p[0], at)) - slack;
  out->count = 0;
  for (int k = 0; k < n && out->count + 2 <= CORNERS; k++) {
    gv_vec3 p = in->p[k], q = in->p[k + 1 < n ? k + 1 : 0];
    double hq = gv_dot(outward, gv_sub(q, at)) - slack;
    if (hp <= 0) out->p[out->count++] = p;
    if ((hp <= 0) != (hq <= 0)) out->p[out->count++] = gv_mad(p, hp / (hp - hq), gv_sub(q, p));
    hp = hq;
  }
}

static void add_corner(manifold *m, gv_vec3 on_a, gv_vec3 on_b, double gap, uint16_t face_b) {
  if (gap <= m->limit && m->count < CORNERS) m->corner[m->count++] = (corner){on_a, on_b, gap, face_b};
}

// Flat on flat. `of_b`: the reference is a side of B, else of A.
static void clip_polygons(manifold *m, const polygon *reference, const polygon *incident, bool of_b) {
  polygon work[2];
  const polygon *now = incident;
  gv_vec3 up = of_b ? m->n : gv_neg(m->n);
  for (int k = 0; k < reference->count && now->count > 0; k++) {
    m->operations += 6 + 3 * now->count;
    clip_side(now, reference->p[k], prism_side(reference, k, up), &work[k % 2]);
    now = &work[k % 2];
  }
  for (int k = 0; k < now->count; k++) {
    gv_vec3 p = now->p[k];
    double gap = gap_over(reference, up, p);
    gv_vec3 foot = gv_mad(p, -gap, up);
    if (of_b) add_corner(m, p, foot, gap, reference->face);
    else add_corner(m, foot, p, gap, incident->face);
  }
}

typedef struct span {     // the part of a segment that lies over a face: 0 to 1 along it
  double from, to;
  int from_side, to_side; // sides of the prism where it begins and ends; -1: at its own end
} span;

// The part of the segment within the prism of the face; false if none.
static bool clip_segment(const polygon *face, gv_vec3 up, const polygon *segment, span *out) {
  gv_vec3 p = segment->p[0], along = gv_sub(segment->p[1], p);
  *out = (span){0, 1, -1, -1};
  for (int k = 0; k < face->count; k++) {
    gv_vec3 outward = prism_side(face, k, up);
    double h = gv_dot(outward, gv_sub(p, face->p[k])) - on_side * gv_norm(outward), slope = gv_dot(outward, along);
    if (h > 0 && h + slope > 0) return false;
    if (h > 0 && h / -slope > out->from) out->from = h / -slope, out->from_side = k;
    if (h <= 0 && h + slope > 0 && -h / slope < out->to) out->to = -h / slope, out->to_side = k;
  }
  return out->from <= out->to;
}

// The face on the other side of side k of the face.
static int face_across(const gv_hull *hull, int face, int k) {
  int first = hull->face_start[face], sides = hull->face_start[face + 1] - first;
  uint16_t from = hull->face_vertex[first + k], to = hull->face_vertex[first + (k + 1) % sides];
  int e = hull->neighbor_start[to];
  while (e + 1 < hull->neighbor_start[to + 1] && hull->neighbor[e] != from) e++;
  return hull->neighbor_face[e];
}

// Where a segment that has come over the face leaves it, towards its end (0 or 1): how far along, and over which side.
static double leave_face(const polygon *face, gv_vec3 up, const polygon *segment, bool to_end, int *out_side) {
  gv_vec3 p = segment->p[0], along = gv_sub(segment->p[1], p);
  double at = to_end ? 1 : 0;
  *out_side = -1;
  for (int k = 0; k < face->count; k++) {
    gv_vec3 outward = prism_side(face, k, up);
    double slope = gv_dot(outward, along);
    if (to_end ? slope <= 0 : slope >= 0) continue;
    double t = (on_side * gv_norm(outward) - gv_dot(outward, gv_sub(p, face->p[k]))) / slope;
    if (to_end ? t < at : t > at) at = t, *out_side = k;
  }
  return at;
}

typedef struct limb_end { double at, gap; uint16_t face; } limb_end;

static void add_limb_corner(manifold *m, const polygon *segment, limb_end end, gv_vec3 up, bool of_b) {
  gv_vec3 p = gv_mad(segment->p[0], end.at, gv_sub(segment->p[1], segment->p[0])), foot = gv_mad(p, -end.gap, up);
  if (of_b) add_corner(m, p, foot, end.gap, end.face);
  else add_corner(m, foot, p, end.gap, NO_FACE);
}

// From `face`, over which `part` of the segment lies, on over the neighbouring faces towards its end (0 or 1),
// while they are neither steep nor out of reach. A limb along an edge lies half over one face and half over the other.
// Contacts are where it ends, and the edges on the way that it may rock on: without them it would rock each step.
static void walk_limb(manifold *m, const gv_core *core, const polygon *face, span part, gv_vec3 up, const polygon *segment, bool to_end, bool of_b) {
  polygon side;
  double at = to_end ? part.to : part.from;
  int leaves = to_end ? part.to_side : part.from_side;
  limb_end end = {at, gap_over(face, up, gv_mad(segment->p[0], at, gv_sub(segment->p[1], segment->p[0]))), face->face};
  for (int steps = 0; steps < WALK && leaves >= 0 && core->kind == GV_CORE_HULL && end.gap <= m->limit; steps++) {
    m->operations += 40;
    int next = face_across(core->hull, end.face, leaves);
    if (gv_dot(hull_turn(core, core->hull->face_normal[next]), up) < steep) break;
    take_hull_face(core, next, &side);
    at = leave_face(&side, up, segment, to_end, &leaves);
    double gap = gap_over(&side, up, gv_mad(segment->p[0], at, gv_sub(segment->p[1], segment->p[0])));
    if (gap > m->limit || (to_end ? at <= end.at : at >= end.at)) break;
    if (end.gap <= m->closest + rocks) add_limb_corner(m, segment, end, up, of_b);
    end = (limb_end){at, gap, side.face};
  }
  add_limb_corner(m, segment, end, up, of_b);
}

// The nearest face to the reference that the limb lies over at all: the reference, or one around the vertex.
static bool find_under_limb(manifold *m, const gv_core *core, int vertex, gv_vec3 up, const polygon *segment, polygon *io_face, span *out_part) {
  m->operations += 10 * io_face->count;
  if (clip_segment(io_face, up, segment, out_part)) return true;
  if (core->kind != GV_CORE_HULL) return false;
  vertex = gv_hull_support(core->hull, core->in_place ? up : gv_mat3_mul_t(&core->R, up), vertex, &m->operations);
  for (int k = core->hull->neighbor_start[vertex]; k < core->hull->neighbor_start[vertex + 1]; k++) {
    int f = core->hull->neighbor_face[k];
    if (gv_dot(hull_turn(core, core->hull->face_normal[f]), up) < steep) continue;
    take_hull_face(core, f, io_face);
    m->operations += 10 * io_face->count;
    if (clip_segment(io_face, up, segment, out_part)) return true;
  }
  return false;
}

// A limb along the sides of a core.
static void clip_limb(manifold *m, const gv_core *core, int vertex, polygon *reference, const polygon *segment, bool of_b) {
  gv_vec3 up = of_b ? m->n : gv_neg(m->n);
  span part;
  if (!find_under_limb(m, core, vertex, up, segment, reference, &part)) return;
  for (int k = 0; k < 2; k++) walk_limb(m, core, reference, part, up, segment, k == 1, of_b);
}

// Of two corners in one place the deeper stays. The order of the others is kept: it is the order of the solver's rows.
static bool has_deeper_twin(const manifold *m, int i) {
  for (int k = 0; k < m->count; k++) {
    if (k == i || gv_norm2(gv_sub(m->corner[i].on_a, m->corner[k].on_a)) > same_place * same_place) continue;
    if (m->corner[k].gap < m->corner[i].gap || (m->corner[k].gap == m->corner[i].gap && k < i)) return true;
  }
  return false;
}

static void merge_near(manifold *m) {
  bool drop[CORNERS];
  int kept = 0;
  for (int i = 0; i < m->count; i++) drop[i] = has_deeper_twin(m, i);
  for (int i = 0; i < m->count; i++)
    if (!drop[i]) m->corner[kept++] = m->corner[i];
  m->count = kept;
}

// How much a further contact at p would add: its distance to the nearest one kept.
static double spread_of(const corner *kept, int count, gv_vec3 p) {
  double least = HUGE_VAL;
  for (int i = 0; i < count; i++) least = fmin(least, gv_norm2(gv_sub(kept[i].on_a, p)));
  return least;
}

// Keep the deepest, then always the one farthest from those kept.
static void reduce(manifold *m) {
  if (m->count <= GV_MAX_PAIR_CONTACTS) return;
  for (int kept = 0; kept < GV_MAX_PAIR_CONTACTS; kept++) {
    int best = kept;
    for (int i = kept + 1; i < m->count; i++) {
      bool better = kept == 0 ? m->corner[i].gap < m->corner[best].gap - same_gap
                              : spread_of(m->corner, kept, m->corner[i].on_a) > 1.000001 * spread_of(m->corner, kept, m->corner[best].on_a);
      if (better) best = i;
    }
    corner swap = m->corner[kept];
    m->corner[kept] = m->corner[best];
    m->corner[best] = swap;
  }
  m->count = GV_MAX_PAIR_CONTACTS;
}

// The closest point itself, unless a corner is as deep.
static void add_closest(manifold *m, const gv_shape *a, const gv_distance *d, double radii, uint16_t face_b) {
  double gap = d->distance + radii;
  for (int i = 0; i < m->count; i++)
    if (m->corner[i].gap <= gap + same_gap) return;
  gv_vec3 on_a = gv_mad(d->on_a, a->radius, d->normal_world);
  if (m->count == CORNERS) m->count--;
  m->corner[m->count++] = (corner){on_a, gv_mad(on_a, -gap, d->normal_world), gap, face_b};
}

static void gather(manifold *m, const gv_cso *cso, gv_pair_cache *cache, uint16_t *out_face_b) {
  polygon a, b;
  *out_face_b = NO_FACE;
  if (gv_core_is_point(&cso->a) || gv_core_is_point(&cso->b)) return;  // a ball touches in one point
  take_side(&cso->b, m->n, &cache->vertex_b, &b, cso->operations);
  take_side(&cso->a, gv_neg(m->n), &cache->vertex_a, &a, cso->operations);
  *out_face_b = b.face;
  double facing_b = b.count > 2 ? gv_dot(b.normal, m->n) : 0, facing_a = a.count > 2 ? -gv_dot(a.normal, m->n) : 0;
  bool of_b = facing_b >= facing_a - 1e-6;
  if (fmax(facing_a, facing_b) < steep) return;
  if (of_b && a.count == 2) clip_limb(m, &cso->b, cache->vertex_b, &b, &a, true);
  else if (!of_b && b.count == 2) clip_limb(m, &cso->a, cache->vertex_a, &a, &b, false);
  else if (of_b) clip_polygons(m, &b, &a, true);
  else clip_polygons(m, &a, &b, false);
}

// Of a body pressed into a thin one the nearer side can be the far one. Nothing passes from one side to the opposite one
// within a step while it touches both: such a turn of the normal is not taken, and the depth is that along the last normal,
// so that the contact leads back to where the body came from.
static void keep_side_of_entry(const gv_cso *cso, const gv_pair *pair, gv_vec3 last_normal_world, gv_distance *io) {
  if (io->method == GV_DISTANCE_BEYOND || io->distance >= 0) return;
  const gv_vec3 last = gv_rotate_inv(cso->q_world_b, last_normal_world);
  if (gv_dot(last, io->normal_world) > opposite) return;
  const gv_cso_point p = gv_cso_support(cso, last);
  io->distance = -gv_dot(p.w, last) - pair->a->radius - pair->b->radius;
  io->normal_world = last;
  io->method = GV_DISTANCE_SIDE;
  io->on_a = gv_mad(p.a, -pair->a->radius, last);
  io->on_b = gv_mad(io->on_a, -io->distance, last);
  cso->cache->normal_world = last_normal_world;
  cso->cache->corners = 0;
  cso->cache->overlap = 0;
}

int gv_manifold_pair(gv_narrow narrow, const gv_pair *pair, double margin, gv_pair_cache *cache,
                     gv_contact_point out[GV_MAX_PAIR_CONTACTS], gv_distance *out_distance) {
  const gv_shape *a = pair->a, *b = pair->b;
  gv_cso cso;
  gv_distance d;
  manifold m;
  double radii = a->radius + b->radius;
  uint16_t face_b;
  const gv_vec3 last_normal = cache->normal_world;
  gv_distance_in_b(narrow, pair, margin, cache, &cso, &d);
  if (cache->inside) keep_side_of_entry(&cso, pair, last_normal, &d);
  cache->inside = d.method != GV_DISTANCE_BEYOND && d.distance < 0;
  if (out_distance) {
    *out_distance = d;
    gv_distance_to_world(pair->T_world_b, cache, out_distance);
  }
  if (d.method == GV_DISTANCE_BEYOND || d.distance > margin) return 0;
  m.n = d.normal_world;
  m.limit = margin + radii;
  m.closest = d.distance + radii;
  m.count = 0;
  m.operations = 15;
  gather(&m, &cso, cache, &face_b);
  add_closest(&m, a, &d, radii, face_b);
  m.operations += m.count * m.count;
  merge_near(&m);
  reduce(&m);
  if (out_distance) out_distance->operations = d.operations + m.operations;
  for (int i = 0; i < m.count; i++) {
    gv_vec3 middle = gv_scale(gv_add(m.corner[i].on_a, m.corner[i].on_b), 0.5);
    middle = gv_mad(middle, 0.5 * (b->radius - a->radius), m.n);
    double depth = fmin(radii - m.corner[i].gap, -d.distance);  // rounding aside, no corner is deeper
    out[i] = (gv_contact_point){gv_transform(*pair->T_world_b, middle), cache->normal_world, depth, m.corner[i].face_b};
  }
  return m.count;
}
