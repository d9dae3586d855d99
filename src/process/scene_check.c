// SPDX-License-Identifier: BSD-3-Clause
// Checks that a scene's mesh is a solid and that its convex pieces fill it: edges counted with their
// directions, volumes by the divergence theorem, inside and outside by the winding number (sum of the
// triangles' solid angles, Van Oosterom and Strackee 1983). Main thread, before the loop starts.
#include "scene_check.h"

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

static gv_vec3 corner(const gv_mesh *mesh, int triangle, int k) { return mesh->vertex[mesh->triangle[triangle].v[k]]; }

// Twice the area, along the outward normal.
static gv_vec3 double_area(const gv_mesh *mesh, int triangle) {
  gv_vec3 a = corner(mesh, triangle, 0);
  return gv_cross(gv_sub(corner(mesh, triangle, 1), a), gv_sub(corner(mesh, triangle, 2), a));
}

// ---- the mesh -------------------------------------------------------------------------------------

typedef struct edge {
  uint32_t low, high; // vertices
  int triangle;
  bool forward;       // the triangle runs from low to high
} edge;

static int compare_edges(const void *a, const void *b) {
  const edge *p = a, *q = b;
  if (p->low != q->low) return p->low < q->low ? -1 : 1;
  if (p->high != q->high) return p->high < q->high ? -1 : 1;
  return (p->triangle > q->triangle) - (p->triangle < q->triangle);
}

static void list_edges(const gv_mesh *mesh, edge *out) {
  for (int t = 0; t < mesh->triangle_count; t++)
    for (int k = 0; k < 3; k++) {
      uint32_t a = mesh->triangle[t].v[k], b = mesh->triangle[t].v[(k + 1) % 3];
      out[3 * t + k] = (edge){a < b ? a : b, a < b ? b : a, t, a < b};
    }
  qsort(out, (size_t)mesh->triangle_count * 3, sizeof *out, compare_edges);
}

// Every edge twice. `flips[t]` counts the edges along which t runs like its neighbour.
static bool check_edges(const gv_mesh *mesh, const edge *e, uint8_t *flips, gv_mesh_fault *out) {
  for (int i = 0, next, count = mesh->triangle_count * 3; i < count; i = next) {
    for (next = i + 1; next < count && e[next].low == e[i].low && e[next].high == e[i].high; next++) continue;
    if (next - i == 1)
      return find_fault(out, e[i].triangle, -1, "the mesh is open: the edge %u-%u belongs to triangle %d alone; add the "
                        "missing triangle, or merge vertices in the same place", e[i].low, e[i].high, e[i].triangle);
    if (next - i > 2)
      return find_fault(out, e[i].triangle, -1, "the edge %u-%u belongs to %d triangles, %d and %d among them; two must "
                        "meet at each edge", e[i].low, e[i].high, next - i, e[i].triangle, e[i + 1].triangle);
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
    if (flips[t] > flips[worst]) worst = t;
  if (!flips[worst]) return true;
  const uint32_t *v = mesh->triangle[worst].v;
  return find_fault(out, worst, -1, "triangle %d is flipped against its neighbours; write [%u, %u, %u]", worst, v[0],
                    v[2], v[1]);
}

static bool check_areas(const gv_mesh *mesh, gv_mesh_fault *out) {
  for (int t = 0; t < mesh->triangle_count; t++) {
    double longest = 0;
    for (int k = 0; k < 3; k++)
      longest = fmax(longest, gv_norm(gv_sub(corner(mesh, t, (k + 1) % 3), corner(mesh, t, k))));
    if (!(gv_norm(double_area(mesh, t)) > 1e-9 * longest * longest))
      return find_fault(out, t, -1, "triangle %d has no area: its corners lie on one line; move or remove it", t);
  }
  return true;
}

static bool check_used(const gv_mesh *mesh, uint8_t *used, gv_mesh_fault *out) {
  for (int t = 0; t < mesh->triangle_count; t++)
    for (int k = 0; k < 3; k++) used[mesh->triangle[t].v[k]] = 1;
  for (int v = 0; v < mesh->vertex_count; v++)
    if (!used[v])
      return find_fault(out, -1, -1, "vertex %d belongs to no triangle; remove it (pieces may have points of their own)",
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
  uint8_t *flips = calloc(triangles, 1), *used = calloc((size_t)mesh->vertex_count, 1);
  bool good = edges && flips && used;
  if (good) {
    list_edges(mesh, edges);
    good = check_areas(mesh, out) && check_edges(mesh, edges, flips, out) && check_flips(mesh, flips, out) &&
           check_used(mesh, used, out);
  } else find_fault(out, -1, -1, "out of memory while checking the mesh");
  free(edges);
  free(flips);
  free(used);
  if (good && !(gv_mesh_volume(mesh) > 0))
    return find_fault(out, 0, -1, "the mesh is inside out; list every triangle counter-clockwise seen from outside");
  return good;
}

// ---- pieces against the mesh ----------------------------------------------------------------------

// How far p lies outside of the nearest piece, by its face planes; 0 or less: inside.
static double outside_pieces(gv_vec3 p, const gv_hull *piece, int piece_count) {
  double least = HUGE_VAL;
  for (int i = 0; i < piece_count && least > 0; i++) {
    double most = -HUGE_VAL;
    for (int f = 0; f < piece[i].face_count && most < least; f++)
      most = fmax(most, gv_dot(piece[i].face_normal[f], p) - piece[i].face_offset[f]);
    least = fmin(least, most);
  }
  return least;
}

static bool check_mesh_covered(const gv_mesh *mesh, const gv_hull *piece, int piece_count, double fit_m,
                               gv_mesh_fault *out) {
  for (int t = 0; t < mesh->triangle_count; t++) {
    gv_vec3 a = corner(mesh, t, 0), b = corner(mesh, t, 1), c = corner(mesh, t, 2);
    gv_vec3 probe[4] = {a, b, c, gv_scale(gv_add(gv_add(a, b), c), 1.0 / 3)};
    for (int k = 0; k < 4; k++) {
      double gap = outside_pieces(probe[k], piece, piece_count);
      if (gap <= fit_m) continue;
      return find_fault(out, t, -1, "the %s (%g, %g, %g) of triangle %d lies %.3g mm outside of every piece; add or "
                        "enlarge a piece there", k < 3 ? "corner" : "middle", probe[k].x, probe[k].y, probe[k].z, t,
                        gap * 1e3);
    }
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
  gv_vec3 from[3] = {a, b, c}, to[3] = {b, c, a};
  double nearest = HUGE_VAL;
  bool above = true;
  for (int k = 0; k < 3; k++) {
    above = above && gv_dot(gv_cross(n, gv_sub(to[k], from[k])), gv_sub(p, from[k])) >= 0;
    nearest = fmin(nearest, segment_distance(p, from[k], to[k]));
  }
  return above ? fabs(gv_dot(n, gv_sub(p, a))) / gv_norm(n) : nearest;
}

// Solid angle of the triangle seen from p over 4 pi, with its sign.
static double winding(gv_vec3 p, gv_vec3 a, gv_vec3 b, gv_vec3 c) {
  gv_vec3 u = gv_sub(a, p), v = gv_sub(b, p), w = gv_sub(c, p);
  double ul = gv_norm(u), vl = gv_norm(v), wl = gv_norm(w);
  double below = ul * vl * wl + gv_dot(u, v) * wl + gv_dot(v, w) * ul + gv_dot(w, u) * vl;
  return atan2(gv_dot(u, gv_cross(v, w)), below) / (2 * GV_PI);
}

// How far p lies outside of the mesh; 0: in it, or within fit_m of its surface.
static double outside_mesh(const gv_mesh *mesh, gv_vec3 p, double fit_m) {
  double nearest = HUGE_VAL, turns = 0;
  for (int t = 0; t < mesh->triangle_count; t++) {
    gv_vec3 a = corner(mesh, t, 0), b = corner(mesh, t, 1), c = corner(mesh, t, 2);
    nearest = fmin(nearest, triangle_distance(p, a, b, c));
    if (nearest <= fit_m) return 0;
    turns += winding(p, a, b, c);
  }
  return turns > 0.5 ? 0 : nearest;
}

static bool check_pieces_inside(const gv_mesh *mesh, const gv_hull *piece, int piece_count, double fit_m,
                                gv_mesh_fault *out) {
  for (int i = 0; i < piece_count; i++)
    for (int v = 0; v < piece[i].vertex_count; v++) {
      gv_vec3 p = piece[i].vertex[v];
      double gap = outside_mesh(mesh, p, fit_m);
      if (gap > 0)
        return find_fault(out, -1, i, "the corner (%g, %g, %g) of piece %d sticks out of the mesh by %.3g mm; move it",
                          p.x, p.y, p.z, i, gap * 1e3);
    }
  return true;
}

static bool check_volumes(const gv_mesh *mesh, double pieces_volume, double fit_m, gv_mesh_fault *out) {
  double volume = gv_mesh_volume(mesh), area = 0;
  for (int t = 0; t < mesh->triangle_count; t++) area += gv_norm(double_area(mesh, t)) / 2;
  double differ = pieces_volume - volume;
  if (fabs(differ) <= 0.01 * volume + fit_m * area) return true;
  return find_fault(out, -1, -1, "the pieces add up to %.4g cm3, the mesh encloses %.4g cm3: %s", pieces_volume * 1e6,
                    volume * 1e6, differ > 0 ? "they overlap or fill a hollow; cut them so that they only touch"
                                             : "a part is not filled; add a piece there");
}

bool gv_pieces_check(const gv_mesh *mesh, const gv_hull *piece, int piece_count, double pieces_volume, double fit_m,
                     gv_mesh_fault *out) {
  return check_mesh_covered(mesh, piece, piece_count, fit_m, out) &&
         check_pieces_inside(mesh, piece, piece_count, fit_m, out) &&
         check_volumes(mesh, pieces_volume, fit_m, out);
}
