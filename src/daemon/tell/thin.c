// SPDX-License-Identifier: BSD-3-Clause
// Thins a triangle mesh by vertex clustering (Rossignac and Borrel 1993): a grid is laid over it,
// the vertices in one cell become their mean, and triangles with two corners in one cell vanish. The
// cell grows by a tenth until the result fits. For pictures only; collisions use the convex pieces.
// Main thread, before the loop starts.
#include "daemon/tell/thin.h"

#include <math.h>
#include <stdlib.h>

typedef struct sorted {
  int64_t cell;
  int vertex;
} sorted;

typedef struct work {
  const gv_mesh *mesh;
  sorted *order;  // [vertex_count] by cell
  int *cluster;   // [vertex_count] of each vertex
  gv_vec3 *mean;  // [clusters]
  int clusters, triangles;
} work;

static int size_of(int vertices, int triangles) { return 2 + 3 * vertices + 3 * triangles; }

int gv_thin_size(const gv_mesh *mesh) { return size_of(mesh->vertex_count, mesh->triangle_count); }

static int by_cell(const void *a, const void *b) {
  const sorted *x = a;
  const sorted *y = b;
  if (x->cell != y->cell)
    return x->cell < y->cell ? -1 : 1;
  return x->vertex < y->vertex ? -1 : x->vertex > y->vertex;
}

static void find_bounds(const gv_mesh *mesh, gv_vec3 *out_min, double *out_extent) {
  gv_vec3 min = mesh->vertex[0];
  gv_vec3 max = mesh->vertex[0];
  for (int i = 1; i < mesh->vertex_count; i++) {
    const gv_vec3 v = mesh->vertex[i];
    min = gv_v3(fmin(min.x, v.x), fmin(min.y, v.y), fmin(min.z, v.z));
    max = gv_v3(fmax(max.x, v.x), fmax(max.y, v.y), fmax(max.z, v.z));
  }
  *out_min = min;
  *out_extent = fmax(max.x - min.x, fmax(max.y - min.y, max.z - min.z));
}

// The grid has at most 4096 cells along an edge: 12 bits for each coordinate.
static int64_t cell_of(gv_vec3 v, gv_vec3 min, double edge) {
  const gv_vec3 c = gv_scale(gv_sub(v, min), 1.0 / edge);
  return (int64_t)c.x << 24 | (int64_t)c.y << 12 | (int64_t)c.z;
}

static void find_clusters(work *w, gv_vec3 min, double edge) {
  const gv_mesh *mesh = w->mesh;
  for (int i = 0; i < mesh->vertex_count; i++)
    w->order[i] = (sorted){cell_of(mesh->vertex[i], min, edge), i};
  qsort(w->order, (size_t)mesh->vertex_count, sizeof *w->order, by_cell);
  w->clusters = 0;
  for (int i = 0, end; i < mesh->vertex_count; i = end) {
    gv_vec3 sum = gv_v3(0, 0, 0);
    for (end = i; end < mesh->vertex_count && w->order[end].cell == w->order[i].cell; end++) {
      sum = gv_add(sum, mesh->vertex[w->order[end].vertex]);
      w->cluster[w->order[end].vertex] = w->clusters;
    }
    w->mean[w->clusters++] = gv_scale(sum, 1.0 / (end - i));
  }
}

static bool survives(const work *w, const gv_triangle *t, int out_corner[3]) {
  for (int k = 0; k < 3; k++)
    out_corner[k] = w->cluster[t->v[k]];
  return out_corner[0] != out_corner[1] && out_corner[1] != out_corner[2] && out_corner[2] != out_corner[0];
}

static int count_triangles(const work *w) {
  int count = 0, corner[3];
  for (int i = 0; i < w->mesh->triangle_count; i++)
    count += survives(w, &w->mesh->triangle[i], corner);
  return count;
}

static int write_clusters(const work *w, float *out) {
  int n = 0, corner[3];
  out[n++] = (float)w->clusters;
  out[n++] = (float)w->triangles;
  for (int i = 0; i < w->clusters; i++) {
    out[n++] = (float)w->mean[i].x;
    out[n++] = (float)w->mean[i].y;
    out[n++] = (float)w->mean[i].z;
  }
  for (int i = 0; i < w->mesh->triangle_count; i++) {
    if (!survives(w, &w->mesh->triangle[i], corner))
      continue;
    for (int k = 0; k < 3; k++)
      out[n++] = (float)corner[k];
  }
  return n;
}

static void keep_all(work *w) {
  w->clusters = w->mesh->vertex_count;
  for (int i = 0; i < w->clusters; i++) {
    w->cluster[i] = i;
    w->mean[i] = w->mesh->vertex[i];
  }
  w->triangles = w->mesh->triangle_count;
}

static int thin(work *w, float *out, int max) {
  gv_vec3 min;
  double extent;
  find_bounds(w->mesh, &min, &extent);
  keep_all(w);
  for (double edge = extent / 200.0; size_of(w->clusters, w->triangles) > max; edge *= 1.1) {
    find_clusters(w, min, edge);
    w->triangles = count_triangles(w);
  }
  return w->triangles > 0 ? write_clusters(w, out) : 0;
}

int gv_thin_mesh(const gv_mesh *mesh, float *out, int max) {
  if (mesh->vertex_count < 3 || max < size_of(1, 0))
    return 0;
  const size_t count = (size_t)mesh->vertex_count;
  work w = {.mesh = mesh,
            .order = malloc(count * sizeof *w.order),
            .cluster = malloc(count * sizeof *w.cluster),
            .mean = malloc(count * sizeof *w.mean)};
  const int written = w.order && w.cluster && w.mean ? thin(&w, out, max) : 0;
  free(w.order);
  free(w.cluster);
  free(w.mean);
  return written;
}
