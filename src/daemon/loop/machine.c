// SPDX-License-Identifier: BSD-3-Clause
// Measures the narrow phase on pairs like those of a full scene: limbs on boxes, and boxes in boxes. The
// fastest of many rounds is the machine undisturbed; a share of that is what the loop may count on.
#include "daemon/loop/machine.h"

#include <time.h>

enum { PAIRS = 48, ROUNDS = 40, HULL_BYTES = 4000 };

static const double share = 0.7;

static double now_s(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static int make_box(void *memory, gv_vec3 half, gv_hull *out) {
  gv_arena arena;
  gv_vec3 corner[8];
  for (int i = 0; i < 8; i++)
    corner[i] = gv_v3(i & 1 ? half.x : -half.x, i & 2 ? half.y : -half.y, i & 4 ? half.z : -half.z);
  gv_arena_init(&arena, memory, HULL_BYTES);
  return gv_hull_build(&arena, corner, 8, out);
}

// One round over all pairs, each a little turned and sunk in. Returns the operations.
static int ask_pairs(gv_narrow narrow, const gv_shape shape[2], const gv_shape *box,
                     gv_pair_cache cache[PAIRS]) {
  int operations = 0;
  for (int i = 0; i < PAIRS; i++) {
    const gv_pose B = gv_pose_identity();
    const gv_pose A = {gv_quat_exp(gv_v3(0.02 * i, 0.03, 0.05 * (i % 7))),
                       {0.001 * i, -0.0007 * i, 0.045 - 0.0003 * i}};
    gv_contact_point point[GV_MAX_PAIR_CONTACTS];
    gv_distance found;
    gv_manifold_pair(narrow, &(gv_pair){&shape[i % 2], &A, box, &B}, 0.001, &cache[i], point, &found);
    operations += found.operations;
  }
  return operations;
}

double gv_machine_operations_per_s(gv_narrow narrow) {
  static char memory[2][HULL_BYTES];
  gv_pair_cache cache[PAIRS] = {{.corners = 0}};
  gv_hull small, large;
  double most = 0;
  if (make_box(memory[0], gv_v3(0.02, 0.02, 0.02), &small) ||
      make_box(memory[1], gv_v3(0.1, 0.1, 0.03), &large))
    return 0;
  const gv_shape shape[2] = {gv_shape_hull(&small), gv_shape_capsule(0.015, 0.008)};
  const gv_shape box = gv_shape_hull(&large);
  for (int k = 0; k < ROUNDS; k++) {
    const double start = now_s();
    const int operations = ask_pairs(narrow, shape, &box, cache);
    const double took = now_s() - start;
    if (took > 0 && operations / took > most)
      most = operations / took;
  }
  return share * most;
}
