// SPDX-License-Identifier: BSD-3-Clause
// A depth for every polygon that a shape touches, against geometry done by hand and
// a dense sampling of the core.
#include "support/check.h"
#include "support/lab.h"
#include "gloved/narrow.h"

static gv_arena arena;
static _Alignas(64) unsigned char memory[1 << 20];
static const gv_pose here = {{1, 0, 0, 0}, {0, 0, 0}};

static gv_hull hull_of(const gv_vec3 *p, int count) {
  gv_hull hull;
  gv_arena_init(&arena, memory, sizeof memory);
  if (gv_hull_build(&arena, p, count, &hull))
    abort();
  return hull;
}

// A roof: ridge along y at height 0.01, falling to 0 at x = +-0.05 (slopes of 11.3 degrees).
static gv_hull roof(void) {
  const gv_vec3 p[] = {{-0.05, -0.1, 0}, {0.05, -0.1, 0}, {-0.05, 0.1, 0},
                       {0.05, 0.1, 0},   {0, -0.1, 0.01}, {0, 0.1, 0.01}};
  return hull_of(p, 6);
}

static void test_a_limb_across_a_ridge_touches_both_slopes(void) {
  gv_hull hull = roof();
  gv_shape limb = gv_shape_capsule(0.02, 0.008);
  gv_shape b = gv_shape_hull(&hull);
  const double height = 0.0175;  // axis, 7.5 mm over the ridge: 0.5 mm deep there
  gv_pose T = {{1, 0, 0, 0}, {0.003, 0, height}};
  gv_polygon_depth out[16];
  int count = gv_polygon_depths(&(gv_pair){&limb, &T, &b, &here}, gv_v3(0, 0, 1), 0.0, out, 16);
  CHECK(count == 2, "%d polygons", count);
  // The axis' point nearest to a slope, among those whose foot lies on it, has its foot
  // on the ridge: 7.5 mm / cos.
  double slope = atan(0.2);
  for (int i = 0; i < count; i++) {
    CHECK_NEAR(out[i].normal_world.z, cos(slope), 1e-12);
    CHECK_NEAR(out[i].depth, 0.008 - 0.0075 / cos(slope), 1e-12);
    CHECK_NEAR(out[i].position_world.x, 0, 1e-12);
  }
}

// A limb 0.5 mm over the table: its polygon is told from a margin of that size on, with a depth below zero.
static void test_a_gap_within_the_margin_is_told(void) {
  gv_hull hull = roof();
  gv_shape limb = gv_shape_capsule(0.02, 0.008);
  gv_shape b = gv_shape_hull(&hull);
  const double slope = atan(0.2);
  const double up = 0.0085;  // along the slope's normal: 0.5 mm over it
  gv_pose T = {gv_quat_exp(gv_v3(0, 0, 0.5 * GV_PI)), {0.025 + up * sin(slope), 0, 0.005 + up * cos(slope)}};
  for (int i = 0; i < 2; i++) {
    gv_polygon_depth out[16];
    const double margin = i == 0 ? 0.0004 : 0.0006;
    int count = gv_polygon_depths(&(gv_pair){&limb, &T, &b, &here}, gv_v3(0, 0, 1), margin, out, 16);
    CHECK(count == i, "margin %g m: %d polygons", margin, count);
    if (count == 1)
      CHECK_NEAR(out[0].depth, -0.0005, 1e-12);
  }
}

// Polygons up to 72 degrees away from the contact's normal are told, steeper ones are
// not: a needle's tip of slopes.
static void test_polygons_up_to_72_degrees_are_told(void) {
  for (int steeper = 0; steeper < 2; steeper++) {
    const double angle = (steeper ? 73.5 : 71.5) * GV_PI / 180;
    const double height = 0.02 * tan(angle);
    const gv_vec3 p[] = {{-0.02, -0.1, -height}, {0.02, -0.1, -height}, {-0.02, 0.1, -height},
                         {0.02, 0.1, -height},   {0, -0.1, 0},          {0, 0.1, 0}};
    gv_hull hull = hull_of(p, 6);
    gv_shape limb = gv_shape_capsule(0.02, 0.008);
    gv_shape b = gv_shape_hull(&hull);
    gv_pose T = {{1, 0, 0, 0}, {0, 0, 0.001}};
    gv_polygon_depth out[16];
    int count = gv_polygon_depths(&(gv_pair){&limb, &T, &b, &here}, gv_v3(0, 0, 1), 0.0, out, 16);
    CHECK(count == (steeper ? 0 : 2), "slopes of %g degrees: %d polygons", angle * 180 / GV_PI, count);
  }
}

// Against brute force: points of the axis, those whose foot lies in the polygon.
static void test_depths_equal_dense_sampling(void) {
  unsigned long long r = 11;
  gv_vec3 p[40];
  int compared = 0;
  for (int trial = 0; trial < 200; trial++) {
    for (int i = 0; i < 40; i++) {
      p[i] = gv_v3(check_uniform(&r, -1, 1), check_uniform(&r, -1, 1), check_uniform(&r, -1, 1));
      p[i] = gv_scale(gv_normalize_or(p[i], gv_v3(0, 0, 1)), 0.04);
    }
    gv_hull hull = hull_of(p, 40);
    gv_shape limb = gv_shape_capsule(0.02, 0.009);
    gv_shape b = gv_shape_hull(&hull);
    gv_pose T = {
      gv_quat_exp(gv_v3(check_uniform(&r, -2, 2), check_uniform(&r, -2, 2), check_uniform(&r, -2, 2))),
      {0, 0, 0.046}};
    gv_pair_cache cache = {0};
    gv_distance d;
    gv_distance_pair(GV_NARROW_CORE, &(gv_pair){&limb, &T, &b, &here}, 1.0, &cache, &d);
    gv_polygon_depth out[64];
    int count = gv_polygon_depths(&(gv_pair){&limb, &T, &b, &here}, d.normal_world, 0.0, out, 64);
    for (int i = 0; i < count; i++) {
      double lowest = 1;
      gv_vec3 n = hull.face_normal[out[i].face];
      for (int s = -4000; s <= 4000; s++) {
        gv_vec3 q = gv_transform(T, gv_v3(0.02 * s / 4000, 0, 0));
        double h = gv_dot(n, q) - hull.face_offset[out[i].face];
        gv_vec3 foot = gv_mad(q, -h, n);
        bool inside = true;
        for (int f = 0; f < hull.face_count && inside; f++)
          inside = gv_dot(hull.face_normal[f], foot) - hull.face_offset[f] < 1e-9;
        if (inside)
          lowest = fmin(lowest, h);
      }
      if (lowest > 0.5)
        continue;  // touched on a sliver between two samples
      compared++;
      CHECK(fabs(out[i].depth - (0.009 - lowest)) < 2e-5, "trial %d polygon %d: %g against %g", trial,
            out[i].face, out[i].depth, 0.009 - lowest);
    }
    if (d.distance < -1e-6 && d.method == GV_DISTANCE_GJK) {
      double deepest = 0;
      for (int i = 0; i < count; i++)
        deepest = fmax(deepest, out[i].depth);
      CHECK(deepest <= -d.distance + 1e-12, "trial %d: a polygon is deeper (%g) than the pair (%g)", trial,
            deepest, -d.distance);
    }
  }
  CHECK(compared > 100, "%d polygons compared", compared);
}

static void test_a_palm_covers_a_small_polygon(void) {
  const gv_vec3 p[] = {{-0.01, -0.01, 0},    {0.01, -0.01, 0},      {-0.01, 0.01, 0},
                       {0.01, 0.01, 0},      {-0.01, -0.01, -0.05}, {0.01, -0.01, -0.05},
                       {-0.01, 0.01, -0.05}, {0.01, 0.01, -0.05}};
  gv_hull hull = hull_of(p, 8);
  gv_shape palm = gv_shape_rounded_box(gv_v3(0.03, 0.03, 0), 0.01);
  gv_shape b = gv_shape_hull(&hull);
  gv_pose T = {gv_quat_exp(gv_v3(0, 0.1, 0)), {0, 0, 0.01}};  // a flat core, wider than the polygon, tilted
  gv_polygon_depth out[8];
  int count = gv_polygon_depths(&(gv_pair){&palm, &T, &b, &here}, gv_v3(0, 0, 1), 0.0, out, 8);
  CHECK(count == 1, "%d polygons", count);
  CHECK_NEAR(out[0].depth, 0.01 * tan(0.1), 1e-12);  // lowest over the polygon's edge at x = 0.01
  CHECK_NEAR(out[0].position_world.x, 0.01, 1e-12);
}

// In the engine: a held box is touched on its faces, and each depth is what the pair's contact says.
static void test_engine_publishes_them(void) {
  lab l;
  lab_start(&l);
  lab_box(&l, gv_v3(1, 1, 0.04), gv_v3(0, 0, -0.02), 0, 0.8);
  lab_run(&l);
  static const double straight[GV_SENSORS];
  for (int i = 0; i <= 600; i++) {
    gv_sample s = lab_hand(&l, straight, (gv_pose){{1, 0, 0, 0}, {0, 0, fmax(0.006, 0.2 - 0.0004 * i)}});
    lab_steps(&l, i == 600 ? 1000 : 1, &s);
  }
  gv_polygon_contact out[GV_MAX_POLYGONS];
  int count = gv_engine_polygons(l.engine, out, GV_MAX_POLYGONS);
  bool seen[GV_LIMBS] = {false};
  for (int i = 0; i < count; i++) {
    CHECK(!seen[out[i].limb], "limb %d touches one face of the table, and it is named once", out[i].limb);
    seen[out[i].limb] = true;
    CHECK(fabs(out[i].position_world.z) < 1e-12, "on the table");
    CHECK(out[i].depth_m > 0 && out[i].depth_m < 1e-4, "depth %g", out[i].depth_m);
  }
  CHECK(seen[GV_LIMB_PALM] && seen[GV_LIMB_MIDDLE], "palm and middle finger lie on the table; %d polygons",
        count);
  gv_engine_close(l.engine);
}

int main(void) {
  RUN(test_a_limb_across_a_ridge_touches_both_slopes);
  RUN(test_a_gap_within_the_margin_is_told);
  RUN(test_polygons_up_to_72_degrees_are_told);
  RUN(test_depths_equal_dense_sampling);
  RUN(test_a_palm_covers_a_small_polygon);
  RUN(test_engine_publishes_them);
  return check_done();
}
