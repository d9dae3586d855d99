// SPDX-License-Identifier: BSD-3-Clause
// Benchmark of the narrow phase per pair, beside coal: a limb slides around a body, turning,
// between 1 mm deep and 3 mm away, half a degree a frame, and both engines see the same poses in
// alternating blocks. Prints CSV to standard output: the median over the blocks of the time of one
// pair, and how far the distances differ.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "bench/bench_coal.h"
#include "support/check.h"
#include "gloved/narrow.h"
#include "support/polyhedra.h"

enum { BLOCKS = 60, BLOCK = 250, FRAMES = BLOCKS * BLOCK, MEMORY = 4 << 20 };
static const double margin = 0.004;
static gv_pose motion[FRAMES];
static double ours[FRAMES], theirs[FRAMES];
static _Alignas(64) unsigned char memory[2][MEMORY];

static int64_t now_ns(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

static void plain(const gv_pose *T, double out[7]) {
  const double p[7] = {T->p.x, T->p.y, T->p.z, T->q.w, T->q.x, T->q.y, T->q.z};
  memcpy(out, p, sizeof p);
}

// A comes from the direction d and stays at its distance along the true normal.
static void make_motion(const gv_shape *a, const gv_shape *b) {
  gv_pose at_origin = gv_pose_identity();
  gv_pair_cache cache = {.normal_world = {0, 0, 0}};
  gv_distance now;
  for (int i = 0; i < FRAMES; i++) {
    double t = i * 0.5 * GV_PI / 180;
    gv_vec3 d = gv_normalize_or(gv_v3(cos(t), sin(t), 0.8 * sin(0.37 * t)), gv_v3(1, 0, 0));
    gv_pose T = {gv_quat_exp(gv_v3(sin(0.31 * t), cos(0.23 * t), 0.5 * sin(0.11 * t))), {0, 0, 0}};
    double high = gv_dot(gv_support(b, &at_origin, d, NULL), d);
    double low = gv_dot(gv_support(a, &T, gv_neg(d), NULL), d);
    T.p = gv_scale(d, high - low);
    for (int k = 0; k < 4; k++) {
      gv_distance_pair(GV_NARROW_CORE, &(gv_pair){a, &T, b, &at_origin}, 1.0, &cache, &now);
      T.p = gv_mad(T.p, 0.001 - 0.002 * cos(0.7 * t) - now.distance, now.normal_world);
    }
    motion[i] = T;
  }
}

typedef struct figures {
  double distance_ns[2], contacts_ns[2];
} figures;  // ours, coal

static int by_value(const void *a, const void *b) {
  double x = *(const double *)a;
  double y = *(const double *)b;
  return (x > y) - (x < y);
}

static double median(double *v, int n) {
  qsort(v, (size_t)n, sizeof *v, by_value);
  return v[n / 2];
}

static double run_ours(const gv_shape *a, const gv_shape *b, int first, bool contacts, gv_pair_cache *cache) {
  gv_pose at_origin = gv_pose_identity();
  gv_contact_point point[GV_MAX_PAIR_CONTACTS];
  gv_distance d;
  int64_t start = now_ns();
  for (int i = first; i < first + BLOCK; i++) {
    if (contacts)
      gv_manifold_pair(GV_NARROW_CORE, &(gv_pair){a, &motion[i], b, &at_origin}, margin, cache, point, &d);
    else {
      gv_distance_pair(GV_NARROW_CORE, &(gv_pair){a, &motion[i], b, &at_origin}, 1.0, cache, &d);
      ours[i] = d.distance;
    }
  }
  return (double)(now_ns() - start) / BLOCK;
}

static double run_coal(coal_pair *pair, int first, bool contacts) {
  static double pose[BLOCK][7];
  gv_pose identity = gv_pose_identity();
  double origin[7], found = 0;
  plain(&identity, origin);
  for (int i = 0; i < BLOCK; i++)
    plain(&motion[first + i], pose[i]);
  int64_t start = now_ns();
  for (int i = 0; i < BLOCK; i++) {
    if (contacts)
      found += coal_pair_collide(pair, pose[i], origin, margin);
    else
      theirs[first + i] = coal_pair_distance(pair, pose[i], origin);
  }
  double ns = (double)(now_ns() - start) / BLOCK;
  if (contacts && found < 1)
    fprintf(stderr, "bench_pairs: coal found no contact\n");
  return ns;
}

static void measure(const char *name, const gv_shape *a, void *coal_a, const gv_shape *b, void *coal_b) {
  static double ns[4][BLOCKS];
  gv_pair_cache cache[2];
  memset(cache, 0, sizeof cache);
  coal_pair *pair = coal_pair_new(coal_a, coal_b);
  make_motion(a, b);
  for (int k = 0; k < BLOCKS; k++) {
    ns[0][k] = run_ours(a, b, k * BLOCK, false, &cache[0]);
    ns[1][k] = run_coal(pair, k * BLOCK, false);
    ns[2][k] = run_ours(a, b, k * BLOCK, true, &cache[1]);
    ns[3][k] = run_coal(pair, k * BLOCK, true);
  }
  double differ = 0;
  for (int i = 0; i < FRAMES; i++)
    differ = fmax(differ, fabs(ours[i] - theirs[i]));
  double m[4];
  for (int k = 0; k < 4; k++)
    m[k] = median(ns[k], BLOCKS);
  printf("%s,%.0f,%.0f,%.2f,%.0f,%.0f,%.2f,%.2g\n", name, m[0], m[1], m[1] / m[0], m[2], m[3], m[3] / m[2],
         differ * 1e6);
  fflush(stdout);
}

static void *hull_to_coal(const gv_hull *h) {
  static int triangle[3 * 4096];
  int count = 0;
  for (int f = 0; f < h->face_count; f++)
    for (int k = h->face_start[f] + 1; k + 1 < h->face_start[f + 1]; k++, count++) {
      triangle[3 * count] = h->face_vertex[h->face_start[f]];
      triangle[3 * count + 1] = h->face_vertex[k];
      triangle[3 * count + 2] = h->face_vertex[k + 1];
    }
  return coal_hull(&h->vertex[0].x, h->vertex_count, triangle, count);
}

int main(void) {
  printf("pair,distance_ns,coal_distance_ns,ratio,manifold_ns,coal_contact_ns,ratio_contact,differ_um\n");
  const double palm_half[3] = {0.03, 0.035, 0.008};
  const double half[3] = {0.03, 0.03, 0.04};
  gv_shape limb = gv_shape_capsule(0.015, 0.008);
  gv_shape palm = gv_shape_rounded_box(gv_v3(0.03, 0.035, 0.008), 0.008);
  void *coal_limb = coal_capsule(0.015, 0.008);
  void *coal_palm = coal_rounded_box(palm_half, 0.008);
  gv_hull hull, other;
  build_box_hull(gv_v3(0.03, 0.03, 0.04), memory[0], MEMORY, &hull);
  gv_shape box = gv_shape_hull(&hull);
  void *coal_box = coal_rounded_box(half, 0);
  measure("limb-box", &limb, coal_limb, &box, coal_box);
  measure("palm-box", &palm, coal_palm, &box, coal_box);
  const int sizes[] = {32, 64, 125, 250, 500, 1000};
  for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++) {
    char name[64];
    build_round_hull(sizes[i], gv_v3(0.03, 0.035, 0.04), memory[0], MEMORY, &hull);
    gv_shape body = gv_shape_hull(&hull);
    void *coal_body = hull_to_coal(&hull);
    snprintf(name, sizeof name, "limb-hull%d", sizes[i]);
    measure(name, &limb, coal_limb, &body, coal_body);
    if (sizes[i] != 250)
      continue;
    measure("palm-hull250", &palm, coal_palm, &body, coal_body);
    build_round_hull(64, gv_v3(0.02, 0.02, 0.02), memory[1], MEMORY, &other);
    gv_shape second = gv_shape_hull(&other);
    measure("hull64-hull250", &second, hull_to_coal(&other), &body, coal_body);
  }
  (void)check_in_test;
  (void)check_skipped;
  (void)check_tests;
  return check_failures;
}
