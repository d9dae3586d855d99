// SPDX-License-Identifier: BSD-3-Clause
// Contact manifold: where a flat side lies on a flat side (or a limb along one), the closest point alone
// jumps from corner to corner; here every corner of the common region becomes a contact with a depth of
// its own (the paper's wish of a penetration depth per polygon).
//
// The reference polygon is the side of one core that faces the contact normal best. The other core's side, or
// segment (limb.c), is clipped against the prism that the reference sweeps along the normal; the gap of each
// corner is measured along the normal, so it is never less than the distance of the pair. Works in the frame
// of B. Pure; any thread. Cost: 0.1 us beside the distance, 0.4 us for a limb along small faces.
#include "collision/manifold.h"

static const double opposite = -0.5;    // cosine of two normals: a turn by more than 120 degrees
static const double same_gap = 1e-9;    // metres
static const double same_place = 1e-5;  // metres: nearer contacts are one

// Counted work: a plane, a corner and plane, the rest.
enum { CLIP_OPERATIONS = 6, CORNER_OPERATIONS = 3, REST_OPERATIONS = 15 };

void gv_manifold_add(gv_manifold *m, const gv_reference *reference, gv_vec3 p, double gap, uint16_t face_b) {
  gv_vec3 foot = gv_mad(p, -gap, reference->up);
  if (gap > m->limit || m->count == GV_FACE_CORNERS)
    return;
  gv_corner *corner = &m->corner[m->count++];
  corner->on_a = reference->of_b ? p : foot;
  corner->on_b = reference->of_b ? foot : p;
  corner->gap = gap;
  corner->face_b = face_b;
}

// Flat on flat.
static void add_polygons(gv_manifold *m, const gv_reference *r, const gv_face *reference,
                         const gv_face *incident) {
  gv_face work[2];
  const gv_face *now = incident;
  for (int k = 0; k < reference->count && now->count > 0; k++) {
    m->operations += CLIP_OPERATIONS + CORNER_OPERATIONS * now->count;
    const gv_vec3 outward = gv_face_prism_side(reference, k, r->up);
    gv_face_clip(now, reference->p[k], outward, gv_manifold_on_side, &work[k % 2]);
    now = &work[k % 2];
  }
  const uint16_t face_b = r->of_b ? reference->index : incident->index;
  for (int k = 0; k < now->count; k++)
    gv_manifold_add(m, r, now->p[k], gv_gap_over(reference, r->up, now->p[k]), face_b);
}

// A limb along a capsule: where the stretch that they share ends. Each gap is the distance of the two axes
// there, so that of two that cross only the closest point counts.
static void add_segments(gv_manifold *m, const gv_face *a, const gv_face *b) {
  const gv_vec3 along_b = gv_sub(b->p[1], b->p[0]);
  const double length = gv_norm(along_b);
  const gv_vec3 u = gv_normalize_or(along_b, gv_v3(1, 0, 0));
  const double from = gv_dot(u, gv_sub(a->p[0], b->p[0]));  // of a, along b
  const double to = gv_dot(u, gv_sub(a->p[1], b->p[0]));
  if (m->closest <= 0 || fabs(to - from) < same_place)
    return;
  const double ends[2] = {fmax(fmin(from, to), 0), fmin(fmax(from, to), length)};
  if (ends[0] > ends[1])
    return;
  for (int k = 0; k < 2; k++) {
    const double share = (ends[k] - from) / (to - from);
    const gv_vec3 on_a = gv_mad(a->p[0], share, gv_sub(a->p[1], a->p[0]));
    const gv_vec3 on_b = gv_mad(b->p[0], ends[k], u);
    const gv_reference axis_of_b = {.of_b = true, .up = m->n};
    gv_manifold_add(m, &axis_of_b, on_a, gv_norm(gv_sub(on_a, on_b)), GV_NO_FACE);
  }
}

// Of two corners in one place the deeper stays. The order of the others is kept: it is the order of the
// solver's rows.
static bool has_deeper_twin(const gv_manifold *m, int i) {
  for (int k = 0; k < m->count; k++) {
    if (k == i || gv_norm2(gv_sub(m->corner[i].on_a, m->corner[k].on_a)) > same_place * same_place)
      continue;
    if (m->corner[k].gap < m->corner[i].gap || (m->corner[k].gap == m->corner[i].gap && k < i))
      return true;
  }
  return false;
}

static void merge_near(gv_manifold *m) {
  bool drop[GV_FACE_CORNERS];
  int kept = 0;
  for (int i = 0; i < m->count; i++)
    drop[i] = has_deeper_twin(m, i);
  for (int i = 0; i < m->count; i++)
    if (!drop[i])
      m->corner[kept++] = m->corner[i];
  m->count = kept;
}

// How much a further contact at p would add: its distance to the nearest one kept.
static double spread_of(const gv_corner *kept, int count, gv_vec3 p) {
  double least = HUGE_VAL;
  for (int i = 0; i < count; i++)
    least = fmin(least, gv_norm2(gv_sub(kept[i].on_a, p)));
  return least;
}

// Is corner a the better next one, `kept` being there? The deepest first, then the farthest from those.
static bool is_better_next(const gv_manifold *m, int kept, const gv_corner *a, const gv_corner *b) {
  if (kept == 0)
    return a->gap < b->gap - same_gap;
  return spread_of(m->corner, kept, a->on_a) > 1.000001 * spread_of(m->corner, kept, b->on_a);
}

// Keep the deepest, then always the one farthest from those kept.
static void reduce(gv_manifold *m) {
  if (m->count <= GV_MAX_PAIR_CONTACTS)
    return;
  for (int kept = 0; kept < GV_MAX_PAIR_CONTACTS; kept++) {
    int best = kept;
    for (int i = kept + 1; i < m->count; i++)
      if (is_better_next(m, kept, &m->corner[i], &m->corner[best]))
        best = i;
    gv_corner swap = m->corner[kept];
    m->corner[kept] = m->corner[best];
    m->corner[best] = swap;
  }
  m->count = GV_MAX_PAIR_CONTACTS;
}

// The closest point itself, unless a corner is as deep.
static void add_closest(gv_manifold *m, double radius_a, const gv_distance *d, uint16_t face_b) {
  double gap = m->closest;
  for (int i = 0; i < m->count; i++)
    if (m->corner[i].gap <= gap + same_gap)
      return;
  gv_vec3 on_a = gv_mad(d->on_a, radius_a, d->normal_world);
  if (m->count == GV_FACE_CORNERS)
    m->count--;
  m->corner[m->count++] = (gv_corner){on_a, gv_mad(on_a, -gap, d->normal_world), gap, face_b};
}

// The corners of the sides that face each other. *out_face_b: the polygon of B there.
static void gather(gv_manifold *m, const gv_cso *cso, uint16_t *out_face_b) {
  gv_pair_cache *cache = cso->cache;
  gv_face a, b;
  *out_face_b = GV_NO_FACE;
  if (gv_core_is_point(&cso->a) || gv_core_is_point(&cso->b))
    return;  // a ball touches in one point
  gv_face_towards(&cso->b, m->n, &cache->vertex_b, &b, cso->operations);
  gv_face_towards(&cso->a, gv_neg(m->n), &cache->vertex_a, &a, cso->operations);
  *out_face_b = b.index;
  if (a.count == 2 && b.count == 2) {
    add_segments(m, &a, &b);
    return;
  }
  double facing_a = a.count > 2 ? -gv_dot(a.normal, m->n) : 0;
  double facing_b = b.count > 2 ? gv_dot(b.normal, m->n) : 0;
  if (fmax(facing_a, facing_b) < gv_manifold_steep)
    return;
  const bool of_b = facing_b >= facing_a - 1e-6;
  const gv_reference r = {of_b ? &cso->b : &cso->a, of_b, of_b ? m->n : gv_neg(m->n)};
  gv_face *reference = of_b ? &b : &a;
  const gv_face *incident = of_b ? &a : &b;
  const int vertex = of_b ? cache->vertex_b : cache->vertex_a;
  if (incident->count == 2)
    gv_manifold_add_limb(m, &r, vertex, incident, reference);
  else
    add_polygons(m, &r, reference, incident);
}

// Of a body pressed into a thin one the nearer side can be the far one. Nothing passes from one side to the
// opposite one within a step while it touches both: such a turn of the normal is not taken, and the depth is
// that along the last normal, so that the contact leads back to where the body came from.
static void keep_side_of_entry(const gv_cso *cso, const gv_pair *pair, gv_vec3 last_normal_world,
                               gv_distance *io) {
  if (io->method == GV_DISTANCE_BEYOND || io->distance >= 0)
    return;
  const gv_vec3 last = gv_rotate_inv(cso->q_world_b, last_normal_world);
  if (gv_dot(last, io->normal_world) > opposite)
    return;
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
  const gv_shape *a = pair->a;
  const gv_shape *b = pair->b;
  gv_cso cso;
  gv_distance d;
  gv_manifold m;
  double radii = a->radius + b->radius;
  uint16_t face_b;
  const gv_vec3 last_normal = cache->normal_world;
  gv_distance_in_b(narrow, pair, margin, cache, &cso, &d);
  if (cache->inside)
    keep_side_of_entry(&cso, pair, last_normal, &d);
  cache->inside = d.method != GV_DISTANCE_BEYOND && d.distance < 0;
  if (out_distance) {
    *out_distance = d;
    gv_distance_to_world(pair->T_world_b, cache, out_distance);
  }
  if (d.method == GV_DISTANCE_BEYOND || d.distance > margin)
    return 0;
  m.n = d.normal_world;
  m.limit = margin + radii;
  m.closest = d.distance + radii;
  m.count = 0;
  m.operations = REST_OPERATIONS;
  gather(&m, &cso, &face_b);
  add_closest(&m, a->radius, &d, face_b);
  m.operations += m.count * m.count;
  merge_near(&m);
  reduce(&m);
  if (out_distance)
    out_distance->operations = d.operations + m.operations;
  for (int i = 0; i < m.count; i++) {
    gv_vec3 middle = gv_scale(gv_add(m.corner[i].on_a, m.corner[i].on_b), 0.5);
    middle = gv_mad(middle, 0.5 * (b->radius - a->radius), m.n);
    double depth = fmin(radii - m.corner[i].gap, -d.distance);  // rounding aside, no corner is deeper
    out[i].position_world = gv_transform(*pair->T_world_b, middle);
    out[i].normal_world = cache->normal_world;
    out[i].depth = depth;
    out[i].face_b = m.corner[i].face_b;
  }
  return m.count;
}
