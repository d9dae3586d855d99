// SPDX-License-Identifier: BSD-3-Clause
// Checks that a scene's mesh is a solid and that its convex pieces fill it: edges counted with their
// directions, volumes by the divergence theorem, inside and outside by the crossings of a ray upwards
// (scan line: half-open edges, both triangles of an edge get the same bits). Main thread, before the loop
// starts; 70,000 triangles and 64 pieces take some 0.3 s.
#include "daemon/load/scene_check.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

static bool find_fault(gv_mesh_fault *out, int triangle, int piece, const char *format, ...)
    __attribute__((format(printf, 4, 5)));
static bool find_fault(gv_mesh_fault *out, int triangle, int piece, const char *format, ...) {
  va_list args;
  va_start(args, format);
  out->triangle = triangle;
  out->piece = piece;
  vsnprintf(out->text, sizeof out->text, format, args);
  va_end(args);
  return false;
}

static gv_vec3 corner(const gv_mesh *mesh, int triangle, int k) {
  return mesh->vertex[mesh->triangle[triangle].v[k]];
}

// Twice the area, along the outward normal.
static gv_vec3 double_area(const gv_mesh *mesh, int triangle) {
  gv_vec3 a = corner(mesh, triangle, 0);
  return gv_cross(gv_sub(corner(mesh, triangle, 1), a), gv_sub(corner(mesh, triangle, 2), a));
}

// ---- the mesh -------------------------------------------------------------------------------------

typedef struct edge {
  uint32_t low, high;  // vertices
  int triangle;
  bool forward;  // the triangle runs from low to high
} edge;

static int compare_edges(const void *a, const void *b) {
  const edge *p = a;
  const edge *q = b;
  if (p->low != q->low)
    return p->low < q->low ? -1 : 1;
  if (p->high != q->high)
    return p->high < q->high ? -1 : 1;
  return (p->triangle > q->triangle) - (p->triangle < q->triangle);
}

static void list_edges(const gv_mesh *mesh, edge *out) {
  for (int t = 0; t < mesh->triangle_count; t++)
    for (int k = 0; k < 3; k++) {
      uint32_t a = mesh->triangle[t].v[k];
      uint32_t b = mesh->triangle[t].v[(k + 1) % 3];
      out[3 * t + k] = (edge){a < b ? a : b, a < b ? b : a, t, a < b};
    }
  qsort(out, (size_t)mesh->triangle_count * 3, sizeof *out, compare_edges);
}

// Every edge twice. `flips[t]` counts the edges along which t runs like its neighbour.
static bool check_edges(const gv_mesh *mesh, const edge *e, uint8_t *flips, gv_mesh_fault *out) {
  for (int i = 0, next, count = mesh->triangle_count * 3; i < count; i = next) {
    for (next = i + 1; next < count && e[next].low == e[i].low && e[next].high == e[i].high; next++)
      continue;
    if (next - i == 1)
      return find_fault(out, e[i].triangle, -1,
                        "the mesh is open: the edge %u-%u belongs to triangle %d alone; add the "
                        "missing triangle, or merge vertices in the same place",
                        e[i].low, e[i].high, e[i].triangle);
    if (next - i > 2)
      return find_fault(out, e[i].triangle, -1,
                        "the edge %u-%u belongs to %d triangles, %d and %d among them; two must "
                        "meet at each edge",
                        e[i].low, e[i].high, next - i, e[i].triangle, e[i + 1].triangle);
    if (e[i].forward == e[i + 1].forward) {
      flips[e[i].triangle]++;
      flips[e[i + 1].triangle]++;
    }
  }
  return true;
}

// The triangle at odds with most of its neighbours is the one that is flipped.
static bool check_flips(const gv_mesh *mesh, const uint8_t *flips, gv_mesh_fault *out) {
  int worst = 0;
  for (int t = 1; t < mesh->triangle_count; t++)
    if (flips[t] > flips[worst])
      worst = t;
  if (!flips[worst])
    return true;
  const uint32_t *v = mesh->triangle[worst].v;
  return find_fault(out, worst, -1, "triangle %d is flipped against its neighbours; write [%u, %u, %u]",
                    worst, v[0], v[2], v[1]);
}

static bool check_areas(const gv_mesh *mesh, gv_mesh_fault *out) {
  for (int t = 0; t < mesh->triangle_count; t++) {
    double longest = 0;
    for (int k = 0; k < 3; k++)
      longest = fmax(longest, gv_norm(gv_sub(corner(mesh, t, (k + 1) % 3), corner(mesh, t, k))));
    if (!(gv_norm(double_area(mesh, t)) > 1e-9 * longest * longest))
      return find_fault(out, t, -1, "triangle %d has no area: its corners lie on one line; move or remove it",
                        t);
  }
  return true;
}

static bool check_used(const gv_mesh *mesh, uint8_t *used, gv_mesh_fault *out) {
  for (int t = 0; t < mesh->triangle_count; t++)
    for (int k = 0; k < 3; k++)
      used[mesh->triangle[t].v[k]] = 1;
  for (int v = 0; v < mesh->vertex_count; v++)
    if (!used[v])
      return find_fault(out, -1, -1,
                        "vertex %d belongs to no triangle; remove it (pieces may have points of their own)",
                        v);
  return true;
}

double gv_mesh_volume(const gv_mesh *mesh) {
  double volume = 0;
  for (int t = 0; t < mesh->triangle_count; t++)
    volume += gv_dot(corner(mesh, t, 0), gv_cross(corner(mesh, t, 1), corner(mesh, t, 2))) / 6;
  return volume;
}

bool gv_mesh_check(const gv_mesh *mesh, gv_mesh_fault *out) {
  size_t triangles = (size_t)mesh->triangle_count;
  edge *edges = malloc(3 * triangles * sizeof *edges);
  uint8_t *flips = calloc(triangles, 1);
  uint8_t *used = calloc((size_t)mesh->vertex_count, 1);
  bool good = edges && flips && used;
  if (good) {
    list_edges(mesh, edges);
    good = check_areas(mesh, out) && check_edges(mesh, edges, flips, out) && check_flips(mesh, flips, out) &&
           check_used(mesh, used, out);
  } else
    find_fault(out, -1, -1, "out of memory while checking the mesh");
  free(edges);
  free(flips);
  free(used);
  if (good && !(gv_mesh_volume(mesh) > 0))
    return find_fault(out, 0, -1,
                      "the mesh is inside out; list every triangle counter-clockwise seen from outside");
  return good;
}

// ---- pieces against the mesh ----------------------------------------------------------------------

// How far p lies outside of the piece's bounding box along one axis; 0 or less: inside.
static double outside_box(gv_vec3 p, const gv_hull *piece) {
  gv_vec3 low = gv_sub(piece->aabb_min, p);
  gv_vec3 high = gv_sub(p, piece->aabb_max);
  return fmax(fmax(fmax(low.x, high.x), fmax(low.y, high.y)), fmax(low.z, high.z));
}

// How far p lies outside of the nearest piece, by its face planes (at most the distance); 0 or less:
// inside. Takes what it looks at from *work.
static double outside_pieces(gv_vec3 p, const gv_hull *piece, int piece_count, int64_t *work) {
  double least = HUGE_VAL;
  for (int i = 0; i < piece_count && least > 0; i++) {
    --*work;
    if (outside_box(p, &piece[i]) >= least)
      continue;
    double most = -HUGE_VAL;
    for (int f = 0; f < piece[i].face_count && most < least; f++)
      most = fmax(most, gv_dot(piece[i].face_normal[f], p) - piece[i].face_offset[f]);
    *work -= piece[i].face_count;
    least = fmin(least, most);
  }
  return least;
}

static bool fail_work(const gv_mesh *mesh, int piece_count, gv_mesh_fault *out) {
  return find_fault(
      out, -1, -1,
      "%d triangles with %d pieces take too long to check against each other; give fewer pieces, "
      "or a simpler mesh",
      mesh->triangle_count, piece_count);
}

static bool check_probe(const gv_mesh *mesh, gv_vec3 p, const char *which, int triangle, const gv_hull *piece,
                        int piece_count, double fit_m, int64_t *work, gv_mesh_fault *out) {
  double gap = outside_pieces(p, piece, piece_count, work);
  if (*work < 0)
    return fail_work(mesh, piece_count, out);
  if (gap <= fit_m)
    return true;
  return find_fault(out, triangle, -1,
                    "the %s (%g, %g, %g) of triangle %d lies %.3g mm outside of every piece; add or "
                    "enlarge a piece there",
                    which, p.x, p.y, p.z, triangle, gap * 1e3);
}

// `seen` [vertex_count] zeros: each corner is looked at once.
static bool check_mesh_covered(const gv_mesh *mesh, uint8_t *seen, const gv_hull *piece, int piece_count,
                               double fit_m, int64_t *work, gv_mesh_fault *out) {
  for (int t = 0; t < mesh->triangle_count; t++) {
    gv_vec3 middle = gv_v3(0, 0, 0);
    for (int k = 0; k < 3; k++) {
      gv_vec3 p = corner(mesh, t, k);
      uint8_t *known = &seen[mesh->triangle[t].v[k]];
      middle = gv_mad(middle, 1.0 / 3, p);
      if (!*known && !check_probe(mesh, p, "corner", t, piece, piece_count, fit_m, work, out))
        return false;
      *known = 1;
    }
    if (!check_probe(mesh, middle, "middle", t, piece, piece_count, fit_m, work, out))
      return false;
  }
  return true;
}

// Distance of p to the segment a b.
static double segment_distance(gv_vec3 p, gv_vec3 a, gv_vec3 b) {
  gv_vec3 along = gv_sub(b, a);
  double s = gv_dot(gv_sub(p, a), along) / gv_dot(along, along);
  return gv_norm(gv_sub(p, gv_mad(a, fmin(fmax(s, 0), 1), along)));
}

static double triangle_distance(gv_vec3 p, gv_vec3 a, gv_vec3 b, gv_vec3 c) {
  gv_vec3 n = gv_cross(gv_sub(b, a), gv_sub(c, a));
  gv_vec3 from[3] = {a, b, c};
  gv_vec3 to[3] = {b, c, a};
  double nearest = HUGE_VAL;
  bool above = true;
  for (int k = 0; k < 3; k++) {
    above = above && gv_dot(gv_cross(n, gv_sub(to[k], from[k])), gv_sub(p, from[k])) >= 0;
    nearest = fmin(nearest, segment_distance(p, from[k], to[k]));
  }
  return above ? fabs(gv_dot(n, gv_sub(p, a))) / gv_norm(n) : nearest;
}

// A ray from p along z meets the triangle from inside (+1), from outside (-1) or not (0). The line y = p.y
// enters and leaves the triangle on two edges; the ray meets what lies between.
static int crossing(gv_vec3 p, const gv_vec3 q[3]) {
  // on the edge that runs to larger y, and on the other
  gv_vec3 rising = {0, 0, 0};
  gv_vec3 falling = rising;
  bool met = false;
  for (int k = 0; k < 3; k++) {
    gv_vec3 from = q[k];
    gv_vec3 to = q[(k + 1) % 3];
    bool rises = from.y <= p.y;
    if (rises == (to.y <= p.y))
      continue;
    gv_vec3 low = rises ? from : to;
    gv_vec3 high = rises ? to : from;
    gv_vec3 at = gv_mad(low, (p.y - low.y) / (high.y - low.y), gv_sub(high, low));
    if (rises)
      rising = at;
    else
      falling = at;
    met = true;
  }
  if (!met)
    return 0;
  bool outward = rising.x > falling.x;  // counter-clockwise seen from above
  gv_vec3 left = outward ? falling : rising;
  gv_vec3 right = outward ? rising : falling;
  if (p.x < left.x || p.x >= right.x)
    return 0;
  double z = left.z + (p.x - left.x) / (right.x - left.x) * (right.z - left.z);
  return z <= p.z ? 0 : outward ? 1 : -1;
}

// The triangle's bounds, wider by fit_m, and without end below, meet the piece's.
static bool concerns(const gv_vec3 q[3], const gv_hull *piece, double fit_m) {
  gv_vec3 low = gv_v3(fmin(fmin(q[0].x, q[1].x), q[2].x), fmin(fmin(q[0].y, q[1].y), q[2].y), 0);
  gv_vec3 high = gv_v3(fmax(fmax(q[0].x, q[1].x), q[2].x), fmax(fmax(q[0].y, q[1].y), q[2].y),
                       fmax(fmax(q[0].z, q[1].z), q[2].z));
  return low.x - fit_m <= piece->aabb_max.x && low.y - fit_m <= piece->aabb_max.y &&
         high.x + fit_m >= piece->aabb_min.x && high.y + fit_m >= piece->aabb_min.y &&
         high.z + fit_m >= piece->aabb_min.z;
}

static double mesh_distance(const gv_mesh *mesh, gv_vec3 p) {
  double nearest = HUGE_VAL;
  for (int t = 0; t < mesh->triangle_count; t++)
    nearest = fmin(nearest, triangle_distance(p, corner(mesh, t, 0), corner(mesh, t, 1), corner(mesh, t, 2)));
  return nearest;
}

static bool check_piece_inside(const gv_mesh *mesh, const gv_hull *piece, int number, int piece_count,
                               double fit_m, int64_t *work, gv_mesh_fault *out) {
  int turns[GV_MAX_HULL_VERTICES] = {0};
  bool near[GV_MAX_HULL_VERTICES] = {false};
  for (int t = 0; t < mesh->triangle_count; t++) {
    const gv_vec3 q[3] = {corner(mesh, t, 0), corner(mesh, t, 1), corner(mesh, t, 2)};
    if (--*work < 0)
      return fail_work(mesh, piece_count, out);
    if (!concerns(q, piece, fit_m))
      continue;
    *work -= 4 * piece->vertex_count;  // a corner's crossing and distance cost as much as four planes
    for (int v = 0; v < piece->vertex_count; v++) {
      turns[v] += crossing(piece->vertex[v], q);
      near[v] = near[v] || triangle_distance(piece->vertex[v], q[0], q[1], q[2]) <= fit_m;
    }
  }
  for (int v = 0; v < piece->vertex_count; v++) {
    gv_vec3 p = piece->vertex[v];
    if (near[v] || turns[v] > 0)
      continue;
    return find_fault(out, -1, number,
                      "the corner (%g, %g, %g) of piece %d sticks out of the mesh by %.3g mm; move it", p.x,
                      p.y, p.z, number, mesh_distance(mesh, p) * 1e3);
  }
  return true;
}

static bool check_volumes(const gv_mesh *mesh, double pieces_volume, double fit_m, gv_mesh_fault *out) {
  double volume = gv_mesh_volume(mesh);
  double area = 0;
  for (int t = 0; t < mesh->triangle_count; t++)
    area += gv_norm(double_area(mesh, t)) / 2;
  double differ = pieces_volume - volume;
  if (fabs(differ) <= 0.01 * volume + fit_m * area)
    return true;
  return find_fault(out, -1, -1, "the pieces add up to %.4g cm3, the mesh encloses %.4g cm3: %s",
                    pieces_volume * 1e6, volume * 1e6,
                    differ > 0 ? "they overlap or fill a hollow; cut them so that they only touch"
                               : "a part is not filled; add a piece there");
}

bool gv_pieces_check(const gv_mesh *mesh, const gv_hull *piece, int piece_count, double pieces_volume,
                     double fit_m, int64_t *work, gv_mesh_fault *out) {
  uint8_t *seen = calloc((size_t)mesh->vertex_count, 1);
  if (!seen)
    return find_fault(out, -1, -1, "out of memory while checking the pieces");
  bool good = check_mesh_covered(mesh, seen, piece, piece_count, fit_m, work, out);
  free(seen);
  for (int i = 0; i < piece_count && good; i++)
    good = check_piece_inside(mesh, &piece[i], i, piece_count, fit_m, work, out);
  return good && check_volumes(mesh, pieces_volume, fit_m, out);
}
