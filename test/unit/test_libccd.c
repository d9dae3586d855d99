// SPDX-License-Identifier: BSD-3-Clause
// The faults that the packaged libccd (2.1) is known for, each a test of ours by name, and beside
// it, printed, what libccd answers where it answers at all. It is asked in a process of its own,
// which may die or run out of time. (A segment almost parallel to a face is not asked of it: its
// search then takes memory without end.)
#include "support/polyhedra.h"

#include <ccd/ccd.h>
#include <ccd/vec3.h>
#include <signal.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

typedef struct box {
  gv_vec3 half;
  gv_pose T;
} box;

static void box_support(const void *object, const ccd_vec3_t *direction, ccd_vec3_t *out) {
  const box *b = object;
  gv_vec3 d = gv_rotate_inv(b->T.q, gv_v3(direction->v[0], direction->v[1], direction->v[2]));
  gv_vec3 h = b->half;
  gv_vec3 p = gv_transform(b->T, gv_v3(d.x >= 0 ? h.x : -h.x, d.y >= 0 ? h.y : -h.y, d.z >= 0 ? h.z : -h.z));
  ccdVec3Set(out, p.x, p.y, p.z);
}

typedef struct answer {
  int code;
  double depth;
  gv_vec3 direction;
} answer;

static answer ask_libccd(const box *a, const box *b, double tolerance) {
  ccd_t ccd;
  CCD_INIT(&ccd);
  ccd.support1 = ccd.support2 = box_support;
  ccd.max_iterations = 100;
  if (tolerance > 0)
    ccd.epa_tolerance = tolerance;
  ccd_real_t depth = 0;
  ccd_vec3_t dir = {{0, 0, 0}};
  ccd_vec3_t pos = {{0, 0, 0}};
  int code = ccdGJKPenetration(a, b, &ccd, &depth, &dir, &pos);
  return (answer){code, depth, {dir.v[0], dir.v[1], dir.v[2]}};
}

// Run `ask` in a child: 5 seconds, 256 MB.
static void in_a_child(const char *what, void (*ask)(void)) {
  fflush(stdout);
  pid_t child = fork();
  if (child == 0) {
    struct rlimit memory = {256 << 20, 256 << 20}, cores = {0, 0};
    setrlimit(RLIMIT_AS, &memory);
    setrlimit(RLIMIT_CORE, &cores);
    alarm(5);
    printf("  libccd, %s: ", what);
    fflush(stdout);
    ask();
    fflush(stdout);
    _exit(0);
  }
  int status = 0;
  if (child < 0 || waitpid(child, &status, 0) < 0)
    return;
  if (WIFSIGNALED(status))
    printf("it %s\n", WTERMSIG(status) == SIGALRM ? "does not end" : strsignal(WTERMSIG(status)));
}

static void print_answer(answer r) {
  printf("code %d, depth %.9g, direction %g %g %g\n", r.code, r.depth, r.direction.x, r.direction.y,
         r.direction.z);
}

static gv_distance ask_ours(const box *a, const box *b) {
  static char memory[2][4000];
  gv_hull hull_a, hull_b;
  build_box_hull(a->half, memory[0], sizeof memory[0], &hull_a);
  build_box_hull(b->half, memory[1], sizeof memory[1], &hull_b);
  gv_shape sa = gv_shape_hull(&hull_a);
  gv_shape sb = gv_shape_hull(&hull_b);
  gv_pair_cache cache = {.corners = 0};
  gv_distance d;
  gv_distance_pair(GV_NARROW_CORE, &(gv_pair){&sa, &a->T, &sb, &b->T}, 10, &cache, &d);
  return d;
}

static box cube_at(double z) { return (box){{1, 1, 1}, {{1, 0, 0, 0}, {0, 0, z}}}; }

// ---- two cubes of side 2 at z offset 1.9 ----

static void ask_two_cubes(void) {
  box a = cube_at(1.9);
  box b = cube_at(0);
  print_answer(ask_libccd(&a, &b, 0));
}

static void test_two_cubes_at_1_9(void) {
  box a = cube_at(1.9);
  box b = cube_at(0);
  in_a_child("two cubes at 1.9", ask_two_cubes);
  gv_distance d = ask_ours(&a, &b);
  CHECK_NEAR(d.distance, -0.1, 1e-14);
  CHECK_NEAR(d.normal_world.z, 1.0, 1e-14);
}

// ---- boxes that touch exactly: by a face, an edge, a corner, turned on it ----

static box touching(int k) {
  box a = cube_at(2);
  if (k == 1)
    a.T.p = gv_v3(2, 0, 2);
  if (k == 2)
    a.T.p = gv_v3(2, 2, 2);
  if (k == 3)
    a.T.q = gv_quat_axis_angle(gv_v3(0, 0, 1), GV_PI / 4);
  if (k == 4) {
    a.half = gv_v3(0.5, 1, 1);
    a.T.p = gv_v3(0.25, 0.5, 2);
  }
  return a;
}

static void ask_touching(void) {
  box b = cube_at(0);
  for (int k = 0; k < 5; k++) {
    box a = touching(k);
    answer r = ask_libccd(&a, &b, 0);
    printf("%scode %d depth %g", k ? "; " : "", r.code, r.depth);
    fflush(stdout);
  }
  printf("\n");
}

static void test_touching_boxes(void) {
  box b = cube_at(0);
  in_a_child("touching boxes", ask_touching);
  for (int k = 0; k < 5; k++) {
    box a = touching(k);
    gv_distance d = ask_ours(&a, &b);
    CHECK_NEAR(d.distance, 0.0, 1e-14);
    CHECK_NEAR(gv_norm(d.normal_world), 1.0, 1e-14);
    CHECK(gv_dot(d.normal_world, a.T.p) > 0, "case %d: the normal leads from B to A", k);
  }
}

// ---- success with a direction of zero: boxes aligned with a grid ----

enum { GRID = 17 * 17 * 17 };
static const gv_vec3 grid_a = {0.03, 0.02, 0.04}, grid_b = {0.03, 0.02, 0.04};

static gv_vec3 grid_offset(int i) {
  return gv_v3(0.01 * (i % 17 - 8), 0.01 * (i / 17 % 17 - 8), 0.01 * (i / 289 - 8));
}

static double grid_depth(gv_vec3 offset) {
  double x = grid_a.x + grid_b.x - fabs(offset.x);
  double y = grid_a.y + grid_b.y - fabs(offset.y);
  double z = grid_a.z + grid_b.z - fabs(offset.z);
  return fmin(x, fmin(y, z));
}

static void ask_grid(void) {
  int pairs = 0;
  int no_direction = 0;
  int failed = 0;
  int wrong = 0;
  for (int i = 0; i < GRID; i++) {
    box a = {grid_a, {{1, 0, 0, 0}, grid_offset(i)}};
    box b = {grid_b, gv_pose_identity()};
    double depth = grid_depth(grid_offset(i));
    if (depth < 0)
      continue;
    answer r = ask_libccd(&a, &b, 1e-10);
    pairs++;
    failed += r.code != 0 && depth > 1e-6;
    no_direction += r.code == 0 && !(gv_norm(r.direction) > 0.5);
    wrong += r.code == 0 && !(fabs(r.depth - depth) < 1e-5);
  }
  printf("of %d pairs that touch or overlap: %d successes without a direction, %d with another depth, %d "
         "failures\n",
         pairs, no_direction, wrong, failed);
}

static void test_zero_direction_with_success(void) {
  in_a_child("boxes on a grid of 10 mm", ask_grid);
  for (int i = 0; i < GRID; i++) {
    box a = {grid_a, {{1, 0, 0, 0}, grid_offset(i)}};
    box b = {grid_b, gv_pose_identity()};
    gv_distance d = ask_ours(&a, &b);
    CHECK_NEAR(gv_norm(d.normal_world), 1.0, 1e-14);
    if (grid_depth(a.T.p) >= 0)
      CHECK_NEAR(d.distance, -grid_depth(a.T.p), 1e-14);
  }
}

// ---- a tolerance that is compared with squared lengths: boxes of centimetres, in metres ----

static void small_boxes(int i, box *a, box *b) {
  *b = (box){{0.03, 0.02, 0.04}, gv_pose_identity()};
  *a = (box){{0.015, 0.01, 0.01}, {gv_quat_axis_angle(gv_v3(0, 0, 1), 0.1 * i), {0, 0, 0.05 - 1e-4 * i}}};
}

static void ask_small_boxes(void) {
  double depth_off = 0;
  double angle = 0;
  for (int i = 1; i <= 20; i++) {
    box a, b;
    small_boxes(i, &a, &b);
    answer r = ask_libccd(&a, &b, 0);
    if (r.code != 0)
      continue;
    depth_off = fmax(depth_off, fabs(r.depth - 1e-4 * i));
    angle = fmax(angle,
                 180 / GV_PI * gv_atan2(gv_norm(gv_v3(r.direction.x, r.direction.y, 0)), r.direction.z));
  }
  printf("with its own tolerance, up to 2 mm deep: off by %.2g mm, %.0f degrees\n", 1e3 * depth_off, angle);
}

static void test_squared_tolerance(void) {
  in_a_child("boxes of centimetres", ask_small_boxes);
  for (int i = 1; i <= 20; i++) {
    box a, b;
    small_boxes(i, &a, &b);
    gv_distance d = ask_ours(&a, &b);
    CHECK_NEAR(d.distance, -1e-4 * i, 1e-14);
    CHECK_NEAR(d.normal_world.z, 1.0, 1e-14);
  }
}

// ---- a limb almost parallel to a face, its core above, on and under it: libccd does not end ----

static void test_segment_nearly_parallel_to_a_face(void) {
  static char memory[4000];
  gv_hull hull;
  build_box_hull(gv_v3(0.03, 0.02, 0.04), memory, sizeof memory, &hull);
  gv_shape a = gv_shape_capsule(0.015, 0.008);
  gv_shape b = gv_shape_hull(&hull);
  for (int i = 0; i < 6000; i++) {
    double tilt = i % 5 ? pow(10, draw(-16, -1)) : 0;
    double gap = i % 3 ? pow(10, draw(-14, -2.3)) * (i % 2 ? 1 : -1) : 0;
    double s;
    double c;
    gv_pose B = {i % 4 ? gv_quat_identity() : draw_rotation(), {0, 0, 0}};
    gv_pose A = gv_pose_mul(B, (gv_pose){gv_quat_axis_angle(gv_v3(0, 1, 0), tilt),
                                         {draw(-0.012, 0.012), draw(-0.01, 0.01), 0.04 + gap}});
    gv_pair_cache cache = {.corners = 0};
    gv_distance d;
    gv_distance_pair(GV_NARROW_CORE, &(gv_pair){&a, &A, &b, &B}, 1, &cache, &d);
    gv_sincos(tilt, &s, &c);
    CHECK_NEAR(d.distance, gap - 0.015 * s - 0.008, 1e-12);
    CHECK(gv_dot(d.normal_world, gv_rotate(B.q, gv_v3(0, 0, 1))) > 1 - 1e-12, "straight up, tilt %g gap %g",
          tilt, gap);
    CHECK(d.iterations <= GV_GJK_MAX_ITERATIONS + GV_EPA_MAX_ITERATIONS + GV_EPA_MAX_DESCENT, "%d iterations",
          d.iterations);
  }
}

int main(void) {
  RUN(test_two_cubes_at_1_9);
  RUN(test_touching_boxes);
  RUN(test_zero_direction_with_success);
  RUN(test_squared_tolerance);
  RUN(test_segment_nearly_parallel_to_a_face);
  return check_done();
}
