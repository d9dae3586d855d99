// SPDX-License-Identifier: BSD-3-Clause
// Signed distance where something is known to go wrong, and where the answer can be written down: a
// dense sweep of directions over h(n) (Eqn 8), formulas for aligned boxes and for sliding limbs,
// shapes without size. (Random poses: test_accuracy. The faults of the packaged libccd:
// test_libccd.) GV_BENCH=1 prints times instead.
#include "support/polyhedra.h"

#include <time.h>

enum { BOX, PLATE, TABLE, ROUND21, ROUND60, ROUND127, ROUND1000, HULLS };
static const char *const hull_name[HULLS] = {"box",    "plate",   "table",   "hull21",
                                             "hull60", "hull127", "hull1000"};
static gv_hull hull[HULLS];

static void build_hulls(void) {
  static char memory[HULLS][300000];
  build_box_hull(gv_v3(0.03, 0.02, 0.04), memory[BOX], sizeof memory[BOX], &hull[BOX]);
  build_box_hull(gv_v3(0.05, 0.04, 0.0002), memory[PLATE], sizeof memory[PLATE], &hull[PLATE]);
  build_box_hull(gv_v3(0.5, 0.6, 0.05), memory[TABLE], sizeof memory[TABLE], &hull[TABLE]);
  build_round_hull(21, gv_v3(0.03, 0.02, 0.04), memory[ROUND21], sizeof memory[ROUND21], &hull[ROUND21]);
  build_round_hull(60, gv_v3(0.03, 0.02, 0.04), memory[ROUND60], sizeof memory[ROUND60], &hull[ROUND60]);
  build_round_hull(127, gv_v3(0.03, 0.02, 0.04), memory[ROUND127], sizeof memory[ROUND127], &hull[ROUND127]);
  build_round_hull(1000, gv_v3(0.03, 0.02, 0.04), memory[ROUND1000], sizeof memory[ROUND1000],
                   &hull[ROUND1000]);
}

static gv_shape limb(void) { return gv_shape_capsule(0.015, 0.008); }
static gv_shape palm(void) { return gv_shape_rounded_box(gv_v3(0.04, 0.045, 0.008), 0.005); }
static gv_shape piece(int h) { return gv_shape_hull(&hull[h]); }

static void raise(double *top, double value) {
  if (!(value <= *top))
    *top = value;
}

// ---- Eqn 8 itself: no direction may give less than the depth, and the answer's own direction gives

static double support_overlap(const gv_shape *a, const gv_pose *A, const gv_shape *b, const gv_pose *B,
                              gv_vec3 n) {
  static uint16_t hint_a, hint_b;
  return gv_dot(gv_sub(gv_support(b, B, n, &hint_b), gv_support(a, A, gv_neg(n), &hint_a)), n);
}

static double sweep_depth(const gv_shape *a, const gv_pose *A, const gv_shape *b, const gv_pose *B) {
  gv_vec3 best = gv_v3(0, 0, 1);
  double least = HUGE_VAL;
  for (int i = 0; i < 1500; i++) {  // Fibonacci lattice on the sphere
    double z = 1 - (2 * i + 1) / 1500.0, s, c;
    gv_sincos(i * 2.399963229728653, &s, &c);
    gv_vec3 n = gv_v3(c * sqrt(1 - z * z), s * sqrt(1 - z * z), z);
    double h = support_overlap(a, A, b, B, n);
    if (h < least) {
      least = h;
      best = n;
    }
  }
  for (double step = 0.05; step > 1e-7; step *= 0.97) {
    gv_vec3 n = gv_mad(best, step, draw_unit());
    n = gv_scale(n, 1 / gv_norm(n));
    double h = support_overlap(a, A, b, B, n);
    if (h < least) {
      least = h;
      best = n;
      step /= 0.97;
    }
  }
  return least;
}

static void test_depth_against_a_sweep_of_directions(void) {
  const int round[4] = {ROUND60, ROUND127, ROUND1000, BOX};
  double above = 0;
  double off = 0;
  int iterations = 0;
  for (int i = 0; i < 240; i++) {
    gv_shape a = i % 3 == 0 ? limb() : i % 3 == 1 ? palm() : piece(round[i % 7 % 4]);
    gv_shape b = piece(round[i % 4]);
    gv_pose B = {draw_rotation(), {0.1, 0.2, 0.3}};
    gv_pose A = {draw_rotation(), gv_mad(B.p, draw(0, 0.02), draw_unit())};
    gv_pair_cache cache = {.corners = 0};
    gv_distance d;
    gv_distance_pair(GV_NARROW_CORE, &(gv_pair){&a, &A, &b, &B}, 1, &cache, &d);
    double swept = sweep_depth(&a, &A, &b, &B);
    raise(&above, -d.distance - swept);
    raise(&off, fabs(support_overlap(&a, &A, &b, &B, d.normal_world) + d.distance));
    CHECK(-d.distance <= swept + 1e-9, "%d: depth %.9g, but a direction with %.9g", i, -d.distance, swept);
    if (d.iterations > iterations)
      iterations = d.iterations;
  }
  CHECK(off < 1e-9, "h along the normal is the depth: off by %g", off);
  printf(
      "  depth at most %.1e m above the best of the sweep, h along the normal within %.1e; %d iterations\n",
      above, off, iterations);
}

// Certificate for large hulls: the two points bound the distance from above, h(normal) from below.
static void test_large_hulls_certified(void) {
  double gap = 0;
  int iterations = 0;
  for (int i = 0; i < 4000; i++) {
    gv_shape a = i % 2 ? limb() : piece(ROUND1000);
    gv_shape b = piece(i % 3 ? ROUND1000 : ROUND127);
    gv_pose B = {draw_rotation(), {0.1, 0.2, 0.3}};
    gv_pose A = {draw_rotation(), gv_mad(B.p, draw(0.05, 0.15), draw_unit())};
    gv_pair_cache cache = {.corners = 0};
    gv_distance d;
    gv_distance_pair(GV_NARROW_CORE, &(gv_pair){&a, &A, &b, &B}, 1, &cache, &d);
    if (d.distance < 0)
      continue;
    raise(&gap, fabs(d.distance + support_overlap(&a, &A, &b, &B, d.normal_world)));
    if (d.iterations > iterations)
      iterations = d.iterations;
  }
  CHECK(gap < 1e-12, "bounds meet to %g m", gap);
  CHECK(iterations < 40, "%d iterations", iterations);
}

// ---- aligned boxes: the distance has a formula ----------------------------------------------------

static double aligned_distance(gv_vec3 ha, gv_vec3 hb, gv_vec3 offset) {
  double x = fabs(offset.x) - ha.x - hb.x;
  double y = fabs(offset.y) - ha.y - hb.y;
  double z = fabs(offset.z) - ha.z - hb.z;
  if (x <= 0 && y <= 0 && z <= 0)
    return fmax(x, fmax(y, z));
  return gv_norm(gv_v3(fmax(x, 0), fmax(y, 0), fmax(z, 0)));
}

static void test_grid_aligned_boxes(void) {
  gv_vec3 ha = gv_v3(0.01, 0.02, 0.03);
  gv_vec3 hb = gv_v3(0.03, 0.02, 0.01);
  static char memory[2][4000];
  gv_hull hull_a, hull_b;
  build_box_hull(ha, memory[0], sizeof memory[0], &hull_a);
  build_box_hull(hb, memory[1], sizeof memory[1], &hull_b);
  gv_shape box_a = {GV_CORE_BOX, 0, ha, NULL};
  gv_shape box_b = {GV_CORE_BOX, 0, hb, NULL};
  for (int i = 0; i < 11 * 11 * 11; i++) {
    gv_vec3 offset = gv_v3(0.01 * (i % 11 - 5), 0.01 * (i / 11 % 11 - 5), 0.01 * (i / 121 - 5));
    double exact = aligned_distance(ha, hb, offset);
    for (int kind = 0; kind < 4; kind++) {
      gv_shape a = kind & 1 ? box_a : gv_shape_hull(&hull_a);
      gv_shape b = kind & 2 ? box_b : gv_shape_hull(&hull_b);
      gv_pose B = gv_pose_identity();
      gv_pose A = {{1, 0, 0, 0}, offset};
      gv_pair_cache cache = {.corners = 0};
      gv_distance d;
      gv_distance_pair(GV_NARROW_CORE, &(gv_pair){&a, &A, &b, &B}, 1, &cache, &d);
      CHECK_NEAR(d.distance, exact, 1e-14);
      CHECK_NEAR(gv_norm(d.normal_world), 1.0, 1e-14);
      CHECK_NEAR(-support_overlap(&a, &A, &b, &B, d.normal_world), exact, 1e-9);
    }
  }
}

// A limb lies micrometres off the edge of a thin plate, almost along it, one end almost above the corner, and
// the search starts anywhere: it used to stop at that end, 3e-8 m and 0.012 rad off (one pose in 83,333).
static void test_limb_along_the_edge_of_a_plate(void) {
  gv_shape a = limb();
  gv_shape b = piece(PLATE);
  for (int i = 0; i < 20000; i++) {
    gv_pose B = {draw_rotation(), draw_vector(1)};
    gv_vec3 end = gv_v3(-0.05 + draw(-1, 1) * pow(10, draw(-15, -8)), -0.04 - 3.3e-6, -0.0002 - 4.6e-6);
    gv_quat tilt = gv_quat_exp(gv_scale(draw_unit(), pow(10, draw(-7, -5))));
    gv_pose A = gv_pose_mul(B, (gv_pose){tilt, gv_sub(end, gv_rotate(tilt, gv_v3(-0.015, 0, 0)))});
    oracle o = oracle_distance(&a, &A, &b, &B);
    gv_pair_cache cache = {.normal_world = draw_unit()};
    gv_distance d;
    gv_distance_pair(GV_NARROW_CORE, &(gv_pair){&a, &A, &b, &B}, 1, &cache, &d);
    CHECK_NEAR(d.distance + a.radius, o.distance, 1e-10);
    CHECK(gv_norm(gv_sub(d.normal_world, o.normal)) < 2e-4, "normal off by %g",
          gv_norm(gv_sub(d.normal_world, o.normal)));
  }
}

// ---- shapes without size, and nonsense ------------------------------------------------------------

static void test_degenerate_shapes(void) {
  const gv_shape odd[6] = {gv_shape_capsule(0, 0.01),
                           gv_shape_capsule(0.02, 0),
                           gv_shape_rounded_box(gv_v3(0, 0, 0), 0.01),
                           gv_shape_rounded_box(gv_v3(0.02, 0, 0), 0.01),
                           gv_shape_rounded_box(gv_v3(0.02, 0.03, 0), 0.01),
                           piece(PLATE)};
  for (int i = 0; i < 3600; i++) {
    gv_shape a = odd[i % 6];
    gv_shape b = odd[i / 6 % 6];
    gv_pose A = {i % 5 ? draw_rotation() : gv_quat_identity(), {0.1, 0.2, 0.3}};
    gv_pose B = A;
    if (i % 7)
      B.q = draw_rotation();
    if (i % 4 == 1)
      A.p = gv_mad(A.p, 0.03, draw_unit());
    if (i % 4 == 2)
      A.p = gv_mad(A.p, pow(10, draw(-17, -3)), draw_unit());
    gv_pair_cache cache = {.corners = 0};
    gv_distance d;
    gv_distance_pair(GV_NARROW_CORE, &(gv_pair){&a, &A, &b, &B}, 1, &cache, &d);
    CHECK(isfinite(d.distance) && gv_v3_finite(d.on_a) && gv_v3_finite(d.on_b), "finite");
    CHECK_NEAR(gv_norm(d.normal_world), 1.0, 1e-12);
    CHECK_NEAR(-support_overlap(&a, &A, &b, &B, d.normal_world), d.distance, 2e-9);
  }
}

// Whatever is in a pose or a cache, the query ends; with finite poses the normal is a unit vector.
static void test_nonsense_ends(void) {
  const double value[8] = {NAN, INFINITY, -INFINITY, 1e300, 1e12, -1e6, 1e-300, 0};
  for (int i = 0; i < 4000; i++) {
    gv_shape a = i % 3 ? limb() : piece(ROUND60);
    gv_shape b = piece(i % 2 ? BOX : ROUND127);
    gv_pose A = {{draw(-1, 1), value[i % 8], draw(-1, 1), 1}, {value[i / 8 % 8], value[i / 64 % 8], 0}};
    gv_pose B = gv_pose_identity();
    gv_pair_cache cache = {.normal_world = {value[i % 5], value[i % 7], 1},
                           .vertex_a = 65535,
                           .vertex_b = 40000,
                           .corners = 65535};
    gv_contact_point out[GV_MAX_PAIR_CONTACTS];
    gv_distance d;
    int count = gv_manifold_pair(GV_NARROW_CORE, &(gv_pair){&a, &A, &b, &B}, 1, &cache, out, &d);
    CHECK(count >= 0 && count <= GV_MAX_PAIR_CONTACTS, "%d contacts", count);
  }
}

static void test_far_is_a_bound(void) {
  for (int i = 0; i < 3000; i++) {
    gv_shape a = i % 2 ? limb() : piece(ROUND21);
    gv_shape b = piece(i % 3 ? BOX : ROUND60);
    gv_pose B = {draw_rotation(), {0, 0, 0}};
    gv_pose A = {draw_rotation(), gv_scale(draw_unit(), draw(0, 0.2))};
    double limit = draw(0, 0.1);
    gv_pair_cache cold = {.corners = 0};
    gv_pair_cache warm = {.normal_world = draw_unit(), .vertex_a = 3, .vertex_b = 4};
    if (i % 5 == 0)
      warm.normal_world = gv_scale(warm.normal_world, 3);  // no unit: not to be believed
    gv_distance exact, d;
    gv_distance_pair(GV_NARROW_CORE, &(gv_pair){&a, &A, &b, &B}, 1, &cold, &exact);
    gv_distance_pair(GV_NARROW_CORE, &(gv_pair){&a, &A, &b, &B}, limit, &warm, &d);
    if (d.method == GV_DISTANCE_BEYOND)
      CHECK(d.distance >= limit && exact.distance >= d.distance - 1e-12, "far: %g of %g, exact %g",
            d.distance, limit, exact.distance);
    else
      CHECK_NEAR(d.distance, exact.distance, 1e-12);
  }
}

// ---- smoothness -----------------------------------------------------------------------------------

// A limb along y slides over the top of the box in x, past the edge and down its side.
static void test_sliding_over_a_face_and_an_edge(void) {
  gv_shape a = limb();
  gv_shape b = piece(BOX);
  gv_pose B = {draw_rotation(), {0.3, 0.2, 0.1}};
  gv_pair_cache cache = {.corners = 0};
  double half = sqrt(0.5);
  for (int i = 0; i < 20000; i++) {
    double x = -0.02 + 3e-6 * i;
    double z = 0.047 - 2e-7 * i;
    double ex = fmax(0, x - 0.03);
    double ez = fmax(0, z - 0.04);
    double gap = sqrt(ex * ex + ez * ez);
    gv_pose A = gv_pose_mul(B, (gv_pose){{half, 0, 0, half}, {x, 0.001, z}});
    gv_distance d;
    gv_distance_pair(GV_NARROW_CORE, &(gv_pair){&a, &A, &b, &B}, 1, &cache, &d);
    CHECK_NEAR(d.distance, gap - 0.008, 1e-14);
    CHECK(gv_norm(gv_sub(d.normal_world, gv_rotate(B.q, gv_v3(ex / gap, 0, ez / gap)))) < 1e-11,
          "normal at step %d", i);
  }
}

// The vector between the nearest points of convex cores moves no faster than the limb does.
static void test_sliding_around_a_hull(void) {
  for (int h = ROUND21; h < HULLS; h++) {
    gv_shape a = limb();
    gv_shape b = piece(h);
    gv_pose B = {draw_rotation(), {0.3, 0.2, 0.1}};
    gv_pose A = {draw_rotation(), {0, 0, 0}};
    gv_pair_cache cache = {.corners = 0};
    gv_vec3 u = draw_unit();
    gv_vec3 v = gv_any_perpendicular(u);
    gv_vec3 last_p = u;
    gv_vec3 last_between = u;
    for (int i = 0; i < 4000; i++) {
      double s, c;
      gv_distance d;
      gv_sincos(2 * GV_PI * i / 4000, &s, &c);
      A.p = gv_add(B.p, gv_add(gv_scale(u, 0.062 * c), gv_scale(v, 0.062 * s)));
      gv_distance_pair(GV_NARROW_CORE, &(gv_pair){&a, &A, &b, &B}, 1, &cache, &d);
      gv_vec3 between = gv_scale(d.normal_world, d.distance + a.radius);
      double moved = gv_norm(gv_sub(A.p, last_p));
      if (i && d.distance + a.radius > 1e-9)
        CHECK(gv_norm(gv_sub(between, last_between)) <= moved + 1e-12, "step %d of %s", i, hull_name[h]);
      last_p = A.p;
      last_between = between;
    }
  }
}

// Overlapping, the depth moves no faster than the shape, and no direction tried along the way gives less: the
// normal that was best a step ago is never better than the answer.
static void test_sliding_in_overlap(void) {
  const int kinds[4] = {BOX, ROUND21, ROUND127, TABLE};
  for (int k = 0; k < 32; k++) {
    gv_shape a = k % 2 ? limb() : piece(kinds[k % 3]);
    gv_shape b = piece(kinds[k / 4 % 4]);
    gv_pose B = {draw_rotation(), {0.1, 0.2, 0.3}};
    gv_pose A = {k % 5 ? draw_rotation() : B.q, gv_mad(B.p, 0.2, draw_unit())};
    gv_pair_cache cache = {.corners = 0};
    gv_distance d, last;
    gv_distance_pair(GV_NARROW_CORE, &(gv_pair){&a, &A, &b, &B}, 1, &cache, &d);
    A.p = gv_mad(A.p, -1e-4 - a.radius - d.distance, d.normal_world);  // the cores 0.1 mm deep
    gv_vec3 step = gv_scale(gv_mad(draw_unit(), -0.5, d.normal_world), 2e-6);
    gv_distance_pair(GV_NARROW_CORE, &(gv_pair){&a, &A, &b, &B}, 1, &cache, &last);
    for (int i = 0; i < 1500; i++) {
      A.p = gv_add(A.p, step);
      gv_distance_pair(GV_NARROW_CORE, &(gv_pair){&a, &A, &b, &B}, 1, &cache, &d);
      CHECK(fabs(d.distance - last.distance) <= gv_norm(step) + 3e-10, "pair %d step %d: %g to %g", k, i,
            last.distance, d.distance);
      CHECK(-d.distance <= support_overlap(&a, &A, &b, &B, last.normal_world) + 1e-9,
            "pair %d step %d: the last normal was better", k, i);
      last = d;
    }
  }
}

// A box at rest on a table, shaken by nanometres and nanoradians through contact, touching and gap.
static void test_resting_box_does_not_chatter(void) {
  gv_shape a = piece(BOX);
  gv_shape b = piece(TABLE);
  gv_pair_cache cache = {.corners = 0};
  for (int i = 0; i < 5000; i++) {
    gv_vec3 tilt = gv_scale(gv_v3(draw(-1, 1), draw(-1, 1), 0), 1e-8);
    gv_pose B = gv_pose_identity();
    gv_pose A = {gv_quat_exp(tilt), {0.1, 0.2, 0.09 + draw(-3, 3) * 1e-9}};
    gv_distance d;
    gv_distance_pair(GV_NARROW_CORE, &(gv_pair){&a, &A, &b, &B}, 0.001, &cache, &d);
    double lowest = A.p.z - 0.04 - 0.03 * fabs(tilt.y) - 0.02 * fabs(tilt.x) - 0.05;
    CHECK_NEAR(d.distance, lowest, 1e-11);
    CHECK(d.normal_world.z > 1 - 1e-15, "normal leans by %g",
          gv_norm(gv_sub(d.normal_world, gv_v3(0, 0, 1))));
  }
}

// From apart to overlapping and back the distance has no step: it moves as the box does.
static void test_no_step_at_touching(void) {
  const int kinds[3] = {BOX, ROUND21, ROUND127};
  for (int k = 0; k < 60; k++) {
    gv_shape a = piece(kinds[k % 3]);
    gv_shape b = piece(kinds[k / 3 % 3]);
    gv_pose B = {draw_rotation(), {0.1, 0.2, 0.3}};
    gv_pose A = {draw_rotation(), gv_mad(B.p, 0.2, draw_unit())};
    gv_pair_cache cache = {.corners = 0};
    gv_distance d, last;
    gv_distance_pair(GV_NARROW_CORE, &(gv_pair){&a, &A, &b, &B}, 1, &cache, &d);
    gv_vec3 n = d.normal_world;
    A.p = gv_mad(A.p, 4e-9 - d.distance, n);
    gv_distance_pair(GV_NARROW_CORE, &(gv_pair){&a, &A, &b, &B}, 1, &cache, &last);
    for (int i = 0; i < 200; i++) {
      A.p = gv_mad(A.p, -4e-11, n);
      gv_distance_pair(GV_NARROW_CORE, &(gv_pair){&a, &A, &b, &B}, 1, &cache, &d);
      CHECK(fabs(d.distance - last.distance) <= 4e-11 + 3e-10, "step of %g at %g", d.distance - last.distance,
            d.distance);
      last = d;
    }
  }
}

// ---- times ----------------------------------------------------------------------------------------

static double now_ns(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (double)t.tv_sec * 1e9 + (double)t.tv_nsec;
}

static int by_value(const void *a, const void *b) {
  double x = *(const double *)a;
  double y = *(const double *)b;
  return (x > y) - (x < y);
}

// Slow drifts of A over B at a constant gap of the surfaces, each pose the best of 5 calls.
static void bench_pair(const char *name, gv_shape a, gv_shape b, double gap, bool with_manifold) {
  enum { POSES = 2000, DRIFT = 200 };
  static double ns[POSES];
  gv_pose A = gv_pose_identity();
  gv_pose B = {draw_rotation(), {0.1, 0.2, 0.3}};
  gv_vec3 axis = draw_unit();
  gv_vec3 step = axis;
  gv_pair_cache cache = {.corners = 0};
  double iterations = 0;
  double contacts = 0;
  for (int i = 0; i < POSES; i++) {
    gv_distance d;
    gv_contact_point out[GV_MAX_PAIR_CONTACTS];
    if (i % DRIFT == 0) {
      A = (gv_pose){draw_rotation(), gv_mad(B.p, 0.05, draw_unit())};
      axis = draw_unit();
      step = gv_scale(draw_unit(), 1e-4);
    }
    A = (gv_pose){gv_quat_normalize(gv_quat_mul(gv_quat_axis_angle(axis, 0.002), A.q)), gv_add(A.p, step)};
    for (int k = 0; k < 3; k++) {
      gv_pair_cache cold = {.corners = 0};
      gv_distance_pair(GV_NARROW_CORE, &(gv_pair){&a, &A, &b, &B}, 10, &cold, &d);
      A.p = gv_mad(A.p, gap - d.distance, d.normal_world);
    }
    gv_pair_cache next = cache;
    ns[i] = HUGE_VAL;
    int count = 0;
    for (int k = 0; k < 5; k++) {
      next = cache;
      double start = now_ns();
      if (with_manifold)
        count = gv_manifold_pair(GV_NARROW_CORE, &(gv_pair){&a, &A, &b, &B}, 0.001, &next, out, &d);
      else
        gv_distance_pair(GV_NARROW_CORE, &(gv_pair){&a, &A, &b, &B}, 0.001, &next, &d);
      ns[i] = fmin(ns[i], now_ns() - start);
    }
    cache = next;
    iterations += d.iterations;
    contacts += count;
  }
  qsort(ns, POSES, sizeof ns[0], by_value);
  printf("%s,%s,%g,%.0f,%.0f,%.0f,%.1f,%.1f\n", name, with_manifold ? "manifold" : "distance", gap,
         ns[POSES / 2], ns[POSES * 99 / 100], ns[POSES - 1], iterations / POSES, contacts / POSES);
}

static void bench(void) {
  const int solids[4] = {BOX, ROUND21, ROUND127, ROUND1000};
  const double gaps[3] = {5e-4, -1e-4, -0.012};
  char name[64];
  printf("pair,query,gap_m,median_ns,p99_ns,max_ns,iterations,contacts\n");
  for (int g = 0; g < 3; g++) {
    for (int k = 0; k < 4; k++) {
      for (int with_manifold = 0; with_manifold < 2; with_manifold++) {
        snprintf(name, sizeof name, "limb-%s", hull_name[solids[k]]);
        bench_pair(name, limb(), piece(solids[k]), gaps[g], with_manifold);
        snprintf(name, sizeof name, "palm-%s", hull_name[solids[k]]);
        bench_pair(name, palm(), piece(solids[k]), gaps[g], with_manifold);
        snprintf(name, sizeof name, "%s-%s", hull_name[solids[k]], hull_name[solids[k]]);
        bench_pair(name, piece(solids[k]), piece(solids[k]), gaps[g], with_manifold);
      }
    }
  }
}

int main(void) {
  build_hulls();
  if (getenv("GV_BENCH")) {
    bench();
    return 0;
  }
  RUN(test_depth_against_a_sweep_of_directions);
  RUN(test_large_hulls_certified);
  RUN(test_grid_aligned_boxes);
  RUN(test_limb_along_the_edge_of_a_plate);
  RUN(test_degenerate_shapes);
  RUN(test_nonsense_ends);
  RUN(test_far_is_a_bound);
  RUN(test_sliding_over_a_face_and_an_edge);
  RUN(test_sliding_around_a_hull);
  RUN(test_sliding_in_overlap);
  RUN(test_resting_box_does_not_chatter);
  RUN(test_no_step_at_touching);
  return check_done();
}
