// SPDX-License-Identifier: BSD-3-Clause
// Convex hulls and their mass properties. A polytope grows point by point (polytope.c); then triangles
// that lie in one plane become one polygon, and corners that no longer turn are left out, so that a box
// has six faces and a manifold finds the whole side that another shape rests on.
// Corners that a file has rounded off a common plane by a micrometre are moved back into it first.
// Set-up only: about 350 kB of stack, 25 ms for 1000 points. Volume integrals: signed tetrahedra from a
// point inside to the triangles of each face.
#include "gloved/shape.h"

#include "collision/polytope.h"

enum { POINTS = GV_MAX_HULL_VERTICES, TRIANGLES = 2 * POINTS, NONE = 0xffff };

// Relative to the points' extent: this far off a plane is still in it. Rounded coordinates can make sides
// that are flat or not depending on where one begins: then the next tolerance decides.
_Static_assert(GV_MAX_HULL_VERTICES < UINT16_MAX && GV_MAX_HULL_FACES < UINT16_MAX,
               "a hull numbers both in 16 bits");
_Static_assert(GV_MAX_HULL_FACES >= 2 * GV_MAX_HULL_VERTICES - 4, "Euler: no more faces than that");

static const double in_plane[] = {1e-9, 3e-8, 1e-6};
enum { TOLERANCES = sizeof in_plane / sizeof in_plane[0] };

// Corners this near to one plane were in it before a file rounded them (six digits of a metre: 5e-7 m each
// way): metres, and relative to the extent for tiny bodies. Only of long sides, which bodies can rest on: on
// a round body two small triangles lie in one plane by chance.
static const double rounded_m = 4e-6, rounded_share = 5e-5, long_side = 0.15;

typedef struct side {    // a polygon on its way to a plane
  gv_vec3 n, corner;     // unit normal; one of its corners
  double offset, reach;  // n . x on the plane; largest distance from that corner, metres
  int triangles;
} side;

typedef struct builder {
  gv_vec3 point[POINTS];
  gv_polytope_face face[TRIANGLES + 2];
  gv_polytope_edge edge[TRIANGLES + 4];
  uint16_t seen[TRIANGLES + 4], link[POINTS];
  uint16_t polygon_of[TRIANGLES + 2];  // of each triangle
  uint16_t next[POINTS];               // around the polygon at hand
  uint16_t polygons_at[POINTS];        // how many polygons meet at the point
  uint16_t vertex_of[POINTS];          // number in the hull, or NONE
  uint16_t corner[3 * TRIANGLES];      // of all polygons, before straight corners are left out
  uint16_t start[TRIANGLES + 1];
  side side[GV_MAX_HULL_FACES];  // of the polygons, while corners are moved into their planes
  gv_vec3 given[POINTS];         // the points as they came
  gv_polytope polytope;
  double size, in_plane;  // metres
  int count, polygons;
} builder;

const char *gv_hull_error(int error) {
  switch (error) {
    case 0: return "no error";
    case GV_HULL_FEW: return "fewer than 4 points";
    case GV_HULL_FLAT: return "no volume: all points lie in one plane";
    case GV_HULL_NOT_FINITE: return "a coordinate is not a finite number";
    case GV_HULL_VERTICES: return "more than GV_MAX_HULL_VERTICES points: thin them out or split the piece";
    case GV_HULL_FACES: return "more than GV_MAX_HULL_FACES faces: thin the points out or split the piece";
    case GV_HULL_POLYGON: return "a face with more than GV_MAX_FACE_VERTICES corners: thin its outline out";
    case GV_HULL_MEMORY: return "the arena is full";
    case GV_HULL_DEGENERATE:
      return "points too close to one plane to tell faces apart: move them apart or merge them";
    default: return "unknown error";
  }
}

static int take_points(builder *b, const gv_vec3 *points, int count) {
  if (count < 4)
    return GV_HULL_FEW;
  if (count > POINTS)
    return GV_HULL_VERTICES;
  gv_vec3 low = points[0];
  gv_vec3 high = points[0];
  for (int i = 0; i < count; i++) {
    if (!gv_v3_finite(points[i]))
      return GV_HULL_NOT_FINITE;
    low = gv_v3(fmin(low.x, points[i].x), fmin(low.y, points[i].y), fmin(low.z, points[i].z));
    high = gv_v3(fmax(high.x, points[i].x), fmax(high.y, points[i].y), fmax(high.z, points[i].z));
    b->point[i] = b->given[i] = points[i];
  }
  b->count = count;
  b->size = gv_norm(gv_sub(high, low));
  return isfinite(b->size) ? 0 : GV_HULL_NOT_FINITE;
}

// Far points first would need a list per face; any order gives the same surface.
static int grow(builder *b) {
  gv_polytope *P = &b->polytope;
  uint16_t pick[4];
  *P = (gv_polytope){
    .point = b->point,
    .face = b->face,
    .edge = b->edge,
    .seen = b->seen,
    .link = b->link,
    .face_max = TRIANGLES + 2,
    .free_head = -1,
    .tolerance = 0.1 * b->in_plane,
    .least_offset = -HUGE_VAL,
  };
  if (!gv_polytope_pick_tetrahedron(b->point, b->count, 1e-6 * b->size, pick))
    return GV_HULL_FLAT;
  if (!gv_polytope_start(P, pick))
    return GV_HULL_FLAT;
  for (int i = 0; i < b->count; i++) {
    int seed = gv_polytope_most_visible(P, b->point[i]);
    if (seed >= 0 && !gv_polytope_add(P, (uint16_t)i, seed))
      return GV_HULL_DEGENERATE;
  }
  return 0;
}

static double twice_area(const builder *b, const gv_polytope_face *F) {
  gv_vec3 a = b->point[F->vertex[0]];
  return gv_norm(gv_cross(gv_sub(b->point[F->vertex[1]], a), gv_sub(b->point[F->vertex[2]], a)));
}

static int largest_unmerged(const builder *b) {
  int best = -1;
  double largest = -1;
  for (int f = 0; f < b->polytope.face_count; f++) {
    if (!gv_polytope_alive(&b->polytope, f) || b->polygon_of[f] != NONE)
      continue;
    double area = twice_area(b, &b->face[f]);
    if (!(area > largest))
      continue;
    largest = area;
    best = f;
  }
  return best;
}

static bool lies_in_plane(const builder *b, const gv_polytope_face *F, const gv_polytope_face *plane) {
  if (gv_dot(F->normal, plane->normal) < 0)
    return false;
  for (int k = 0; k < 3; k++)
    if (fabs(gv_dot(plane->normal, b->point[F->vertex[k]]) - plane->offset) > b->in_plane)
      return false;
  return true;
}

// Gather the triangles around `seed` in its plane into the polygon number `polygon`.
static void spread(builder *b, int seed, uint16_t polygon) {
  int count = 0;
  b->seen[count++] = (uint16_t)seed;
  b->polygon_of[seed] = polygon;
  for (int next = 0; next < count; next++) {
    for (int k = 0; k < 3; k++) {
      uint16_t g = b->face[b->seen[next]].adjacent[k];
      if (b->polygon_of[g] != NONE || !lies_in_plane(b, &b->face[g], &b->face[seed]))
        continue;
      b->polygon_of[g] = polygon;
      b->seen[count++] = g;
    }
  }
  b->seen[count] = NONE;
}

// The outline of the triangles in b->seen, one loop, into b->corner from `at` on. Returns its length, or 0.
static int trace_outline(builder *b, uint16_t polygon, int at) {
  int edges = 0;
  int length = 0;
  uint16_t first = NONE;
  for (int i = 0; i < b->count; i++)
    b->next[i] = NONE;
  for (int i = 0; b->seen[i] != NONE; i++) {
    const gv_polytope_face *F = &b->face[b->seen[i]];
    for (int k = 0; k < 3; k++) {
      if (b->polygon_of[F->adjacent[k]] == polygon)
        continue;
      if (b->next[F->vertex[k]] != NONE)
        return 0;
      first = F->vertex[k];
      b->next[first] = F->vertex[(k + 1) % 3];
      edges++;
    }
  }
  for (uint16_t v = first; v != NONE && length < edges; length++) {
    b->corner[at + length] = v;
    b->polygons_at[v]++;
    v = b->next[v];
    if (v == first)
      return length + 1 == edges ? edges : 0;
  }
  return 0;
}

static int merge(builder *b) {
  int at = 0;
  for (int f = 0; f < TRIANGLES + 2; f++)
    b->polygon_of[f] = NONE;
  for (int i = 0; i < b->count; i++)
    b->polygons_at[i] = 0;
  b->polygons = 0;
  for (int seed = largest_unmerged(b); seed >= 0; seed = largest_unmerged(b)) {
    if (b->polygons == GV_MAX_HULL_FACES)
      return GV_HULL_FACES;
    b->start[b->polygons] = (uint16_t)at;
    spread(b, seed, (uint16_t)b->polygons);
    int length = trace_outline(b, (uint16_t)b->polygons, at);
    if (length == 0)
      return GV_HULL_DEGENERATE;
    at += length;
    b->polygons++;
  }
  b->start[b->polygons] = (uint16_t)at;
  return 0;
}

// Number the vertices that stay and leave the others (where fewer than three polygons meet, the outline
// goes straight on) out of the polygons. Returns the number of vertices.
static int drop_straight_corners(builder *b) {
  int vertices = 0;
  int to = 0;
  int from = 0;
  for (int i = 0; i < b->count; i++)
    b->vertex_of[i] = b->polygons_at[i] >= 3 ? (uint16_t)vertices++ : NONE;
  for (int f = 0; f < b->polygons; f++) {
    int end = b->start[f + 1];
    b->start[f] = (uint16_t)to;
    for (; from < end; from++)
      if (b->vertex_of[b->corner[from]] != NONE)
        b->corner[to++] = b->vertex_of[b->corner[from]];
  }
  b->start[b->polygons] = (uint16_t)to;
  return vertices;
}

static int check_polygons(const builder *b, int vertices) {
  int corners = b->start[b->polygons];
  int error = 0;
  for (int f = 0; f < b->polygons; f++) {
    int sides = b->start[f + 1] - b->start[f];
    if (sides < 3)
      return GV_HULL_DEGENERATE;
    if (sides > GV_MAX_FACE_VERTICES)
      error = GV_HULL_POLYGON;
  }
  return vertices - corners / 2 + b->polygons == 2 && corners % 2 == 0 ? error : GV_HULL_DEGENERATE;  // Euler
}

static int build_polygons(builder *b, int *out_vertices) {
  int error = grow(b);
  if (!error)
    error = merge(b);
  if (error)
    return error;
  *out_vertices = drop_straight_corners(b);
  return check_polygons(b, *out_vertices);
}

static int build_strictly(builder *b, int *out_vertices) {
  int error = GV_HULL_DEGENERATE;
  for (int i = 0; i < TOLERANCES && error == GV_HULL_DEGENERATE; i++) {
    b->in_plane = in_plane[i] * b->size;
    error = build_polygons(b, out_vertices);
  }
  return error;
}

// ---- sides that were flat before their corners were rounded ----

// Plane of each polygon: the sum of its triangles' area vectors, and the mean height of their corners.
static void fit_polygons(builder *b) {
  const gv_polytope *P = &b->polytope;
  for (int f = 0; f < b->polygons; f++)
    b->side[f] = (side){.triangles = 0};
  for (int pass = 0; pass < 2; pass++) {
    for (int t = 0; t < P->face_count; t++) {
      if (!gv_polytope_alive(P, t))
        continue;
      side *f = &b->side[b->polygon_of[t]];
      const uint16_t *v = b->face[t].vertex;
      gv_vec3 p = b->point[v[0]];
      gv_vec3 q = b->point[v[1]];
      gv_vec3 r = b->point[v[2]];
      if (f->triangles == 0)
        f->corner = p;
      f->reach = fmax(f->reach, gv_norm(gv_sub(p, f->corner)));
      f->reach = fmax(f->reach, gv_norm(gv_sub(q, f->corner)));
      f->reach = fmax(f->reach, gv_norm(gv_sub(r, f->corner)));
      if (pass == 0) {
        f->n = gv_add(f->n, gv_cross(gv_sub(q, p), gv_sub(r, p)));
        f->triangles++;
      } else {
        f->offset += gv_dot(f->n, gv_add(gv_add(p, q), r)) / (3 * f->triangles);
      }
    }
    for (int f = 0; f < b->polygons; f++)
      b->side[f].n = gv_normalize_or(b->side[f].n, gv_v3(0, 0, 1));
  }
}

// Move a corner by the least into the planes of the polygons around it, three at most (Gram and Schmidt). A
// triangle of its own stays flat wherever its corners go.
static void move_into_planes(builder *b, int v, double limit) {
  gv_vec3 axis[3], shift = gv_v3(0, 0, 0);
  int axes = 0;
  for (int t = 0; t < b->polytope.face_count && axes < 3; t++) {
    const uint16_t *c = b->face[t].vertex;
    if (!gv_polytope_alive(&b->polytope, t) || (c[0] != v && c[1] != v && c[2] != v))
      continue;
    const side *f = &b->side[b->polygon_of[t]];
    gv_vec3 free = f->n;
    for (int k = 0; k < axes; k++)
      free = gv_mad(free, -gv_dot(f->n, axis[k]), axis[k]);
    double share = gv_norm(free);
    if (f->triangles < 2 || f->reach < long_side * b->size)
      continue;
    if (share < 0.05)
      continue;  // the same plane, or one that no small move reaches
    axis[axes] = gv_scale(free, 1.0 / share);
    shift = gv_mad(shift, (f->offset - gv_dot(f->n, gv_add(b->point[v], shift))) / share, axis[axes]);
    axes++;
  }
  if (gv_norm(shift) <= limit)
    b->point[v] = gv_add(b->point[v], shift);
}

// Points inside would stand out of a side that moves inwards.
static void drop_inner_points(builder *b) {
  int corner = 0;
  while (b->vertex_of[corner] == NONE)
    corner++;
  for (int i = 0; i < b->count; i++)
    if (b->vertex_of[i] == NONE)
      b->point[i] = b->point[corner];
}

// True where some polygons share a plane but for rounding: the corners then lie in it.
static bool flatten(builder *b) {
  double limit = fmin(rounded_m, rounded_share * b->size);
  int strict = b->polygons;
  b->in_plane = limit;
  if (merge(b) || b->polygons >= strict)
    return false;
  fit_polygons(b);
  for (int v = 0; v < b->count; v++)
    move_into_planes(b, v, limit);
  drop_inner_points(b);
  return true;
}

// The hull of the points, and where that leaves fewer polygons, of the points moved into common planes.
static int build_flat(builder *b, int *out_vertices) {
  int error = build_strictly(b, out_vertices);
  int strict = b->polygons;
  if (error)
    return error;
  if (flatten(b) && build_strictly(b, out_vertices) == 0 && b->polygons < strict)
    return 0;
  for (int i = 0; i < b->count; i++)
    b->point[i] = b->given[i];
  return build_strictly(b, out_vertices);
}

typedef struct arrays {
  gv_vec3 *vertex, *face_normal;
  double *face_offset;
  uint16_t *face_start, *face_vertex, *neighbor_start, *neighbor, *neighbor_face;
} arrays;

// One block for all arrays: doubles first, then the indices.
static int reserve(gv_arena *arena, int vertices, int faces, int corners, arrays *out) {
  size_t v = (size_t)vertices;
  size_t f = (size_t)faces;
  size_t c = (size_t)corners;
  size_t doubles = 3 * v + 4 * f;
  size_t indices = (f + 1) + c + (v + 1) + c + c;
  uint8_t *mem = gv_arena_alloc(arena, "hull", doubles * sizeof(double) + indices * sizeof(uint16_t));
  if (!mem)
    return GV_HULL_MEMORY;
  out->vertex = (gv_vec3 *)(void *)mem;
  out->face_normal = out->vertex + v;
  out->face_offset = (double *)(void *)(out->face_normal + f);
  out->face_start = (uint16_t *)(void *)(out->face_offset + f);
  out->face_vertex = out->face_start + f + 1;
  out->neighbor_start = out->face_vertex + c;
  out->neighbor = out->neighbor_start + v + 1;
  out->neighbor_face = out->neighbor + c;
  return 0;
}

// Plane through a polygon: the sum of its triangles' area vectors, and the mean height of its corners.
static void fit_plane(const arrays *m, int f) {
  const uint16_t *c = &m->face_vertex[m->face_start[f]];
  int sides = m->face_start[f + 1] - m->face_start[f];
  gv_vec3 area = gv_v3(0, 0, 0);
  for (int k = 1; k + 1 < sides; k++)
    area = gv_add(area, gv_cross(gv_sub(m->vertex[c[k]], m->vertex[c[0]]),
                                 gv_sub(m->vertex[c[k + 1]], m->vertex[c[0]])));
  m->face_normal[f] = gv_normalize_or(area, gv_v3(0, 0, 1));
  double offset = 0;
  for (int k = 0; k < sides; k++)
    offset += gv_dot(m->face_normal[f], m->vertex[c[k]]);
  m->face_offset[f] = offset / sides;
}

// Each polygon edge i -> j makes j a neighbour of i, with the polygon to its left.
static void link_neighbors(const arrays *m, int vertices, int faces) {
  for (int i = 0; i <= vertices; i++)
    m->neighbor_start[i] = 0;
  for (int k = 0; k < m->face_start[faces]; k++)
    m->neighbor_start[m->face_vertex[k] + 1]++;
  for (int i = 0; i < vertices; i++) {
    const int end = m->neighbor_start[i] + m->neighbor_start[i + 1];
    m->neighbor_start[i + 1] = (uint16_t)end;
  }
  for (int f = faces - 1; f >= 0; f--) {
    int first = m->face_start[f];
    int end = m->face_start[f + 1];
    for (int k = first; k < end; k++) {
      uint16_t i = m->face_vertex[k];
      uint16_t j = m->face_vertex[k + 1 < end ? k + 1 : first];
      uint16_t at = m->neighbor_start[i]++;  // becomes the end of i's list, that is, the start of the next
      m->neighbor[at] = j;
      m->neighbor_face[at] = (uint16_t)f;
    }
  }
  for (int i = vertices; i > 0; i--)
    m->neighbor_start[i] = m->neighbor_start[i - 1];
  m->neighbor_start[0] = 0;
}

static void measure(gv_hull *hull) {
  gv_vec3 sum = gv_v3(0, 0, 0);
  gv_vec3 low = hull->vertex[0];
  gv_vec3 high = low;
  for (int i = 0; i < hull->vertex_count; i++) {
    gv_vec3 p = hull->vertex[i];
    sum = gv_add(sum, p);
    low = gv_v3(fmin(low.x, p.x), fmin(low.y, p.y), fmin(low.z, p.z));
    high = gv_v3(fmax(high.x, p.x), fmax(high.y, p.y), fmax(high.z, p.z));
  }
  hull->center = gv_scale(sum, 1.0 / hull->vertex_count);
  hull->aabb_min = low;
  hull->aabb_max = high;
}

static int write_hull(const builder *b, int vertices, gv_arena *arena, gv_hull *out) {
  arrays m;
  int corners = b->start[b->polygons];
  int error = reserve(arena, vertices, b->polygons, corners, &m);
  if (error)
    return error;
  for (int i = 0; i < b->count; i++)
    if (b->vertex_of[i] != NONE)
      m.vertex[b->vertex_of[i]] = b->point[i];
  for (int f = 0; f <= b->polygons; f++)
    m.face_start[f] = b->start[f];
  for (int k = 0; k < corners; k++)
    m.face_vertex[k] = b->corner[k];
  for (int f = 0; f < b->polygons; f++)
    fit_plane(&m, f);
  link_neighbors(&m, vertices, b->polygons);
  *out = (gv_hull){
    .vertex_count = vertices,
    .vertex = m.vertex,
    .face_count = b->polygons,
    .face_normal = m.face_normal,
    .face_offset = m.face_offset,
    .face_start = m.face_start,
    .face_vertex = m.face_vertex,
    .neighbor_start = m.neighbor_start,
    .neighbor = m.neighbor,
    .neighbor_face = m.neighbor_face,
  };
  measure(out);
  return 0;
}

int gv_hull_build(gv_arena *arena, const gv_vec3 *points, int count, gv_hull *out_hull) {
  builder b;
  int vertices = 0;
  int error = take_points(&b, points, count);
  if (error)
    return error;
  error = build_flat(&b, &vertices);
  return error ? error : write_hull(&b, vertices, arena, out_hull);
}

// Adds density 1 times the integrals over the tetrahedron (0, a, b, c): volume, first and second moments.
static void add_tetrahedron(gv_vec3 a, gv_vec3 b, gv_vec3 c, double *volume, gv_vec3 *first,
                            double second[3][3]) {
  double v = gv_dot(a, gv_cross(b, c)) / 6.0;
  gv_vec3 sum = gv_add(gv_add(a, b), c);
  const double p[4][3] = {{a.x, a.y, a.z}, {b.x, b.y, b.z}, {c.x, c.y, c.z}, {sum.x, sum.y, sum.z}};
  *volume += v;
  *first = gv_mad(*first, v / 4.0, sum);
  for (int i = 0; i < 3; i++)
    for (int k = 0; k < 3; k++)  // integral of x_i x_k = v / 20 (sum over corners + (sum)(sum))
      second[i][k] += v / 20.0 *
                      (p[0][i] * p[0][k] + p[1][i] * p[1][k] + p[2][i] * p[2][k] + p[3][i] * p[3][k]);
}

// Inertia m^2 about a point from the second moments about it: trace(S) 1 - S.
static gv_mat3 inertia_from(double s[3][3]) {
  double trace = s[0][0] + s[1][1] + s[2][2];
  gv_mat3 m;
  for (int i = 0; i < 3; i++)
    for (int k = 0; k < 3; k++)
      m.m[i][k] = (i == k ? trace : 0.0) - s[i][k];
  return m;
}

gv_mass_properties gv_hull_mass_properties(const gv_hull *hull) {
  if (hull->vertex_count == 1)
    return gv_ball_mass(hull->center, hull->radius);
  if (hull->vertex_count == 2)
    return gv_capsule_mass(hull->vertex[0], hull->vertex[1], hull->radius);
  double volume = 0;
  double second[3][3] = {{0}};
  gv_vec3 first = gv_v3(0, 0, 0);
  gv_vec3 o = hull->center;
  for (int f = 0; f < hull->face_count; f++) {
    const uint16_t *c = &hull->face_vertex[hull->face_start[f]];
    int sides = hull->face_start[f + 1] - hull->face_start[f];
    const gv_vec3 corner = gv_sub(hull->vertex[c[0]], o);
    for (int k = 1; k + 1 < sides; k++) {
      const gv_vec3 from = gv_sub(hull->vertex[c[k]], o);
      const gv_vec3 to = gv_sub(hull->vertex[c[k + 1]], o);
      add_tetrahedron(corner, from, to, &volume, &first, second);
    }
  }
  gv_vec3 r = gv_scale(first, 1.0 / volume);
  const double d[3] = {r.x, r.y, r.z};
  for (int i = 0; i < 3; i++)
    for (int k = 0; k < 3; k++)
      second[i][k] = second[i][k] / volume - d[i] * d[k];
  return (gv_mass_properties){volume, gv_add(o, r), inertia_from(second)};
}

gv_mass_properties gv_mass_properties_sum(const gv_mass_properties *parts, int count) {
  gv_mass_properties sum = {0, {0, 0, 0}, {{{0}}}};
  for (int i = 0; i < count; i++) {
    sum.volume += parts[i].volume;
    sum.center = gv_mad(sum.center, parts[i].volume, parts[i].center);
  }
  if (!(sum.volume > 0))
    return sum;
  sum.center = gv_scale(sum.center, 1.0 / sum.volume);
  for (int i = 0; i < count; i++) {
    gv_vec3 r = gv_sub(parts[i].center, sum.center);
    const double d[3] = {r.x, r.y, r.z};
    const double share = parts[i].volume / sum.volume;
    for (int j = 0; j < 3; j++) {  // parallel axes
      for (int k = 0; k < 3; k++) {
        const double moved = (j == k ? gv_norm2(r) : 0.0);
        sum.inertia.m[j][k] += share * (parts[i].inertia.m[j][k] + moved - d[j] * d[k]);
      }
    }
  }
  return sum;
}
