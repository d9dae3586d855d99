// SPDX-License-Identifier: BSD-3-Clause
// coal (C++) as bench_pairs.c sees it. Poses are p and the quaternion w, x, y, z.
#ifndef BENCH_COAL_H
#define BENCH_COAL_H

#ifdef __cplusplus
extern "C" {
#endif
typedef struct coal_pair coal_pair;
// Shapes as handles; never freed. A capsule lies along x.
void *coal_capsule(double half_length, double radius);
void *coal_rounded_box(const double half[3], double radius);
void *coal_hull(const double *xyz, int count, const int *triangles, int triangle_count);
coal_pair *coal_pair_new(void *a, void *b);
// Signed distance, warm-started from the last call.
double coal_pair_distance(coal_pair *pair, const double a[7], const double b[7]);
// One contact where the distance is below `margin`; returns how many.
int coal_pair_collide(coal_pair *pair, const double a[7], const double b[7], double margin);
#ifdef __cplusplus
}
#endif

#endif
