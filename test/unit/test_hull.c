// SPDX-License-Identifier: BSD-3-Clause
// Convex hulls against what is known of them: Euler's formula, all points inside, convex planar faces,
// the faces of a box, degenerate inputs and their errors; mass properties against box and tetrahedron.
#include "support/polyhedra.h"

#include <string.h>

static char memory[1 << 20];
static gv_vec3 points[GV_MAX_HULL_VERTICES + 1];

static int build(int count, gv_hull *out) {
  gv_arena arena;
  gv_arena_init(&arena, memory, sizeof memory);
  return gv_hull_build(&arena, points, count, out);
}

static bool has_neighbor(const gv_hull *h, int i, int j, int face) {
  for (int k = h->neighbor_start[i]; k < h->neighbor_start[i + 1]; k++)
    if (h->neighbor[k] == j && h->neighbor_face[k] == face)
      return true;
  return false;
}

// Everything that shape.h promises of a hull of points[0 .. count).
static void check_hull(const gv_hull *h, int count, double size) {
  int corners = h->face_start[h->face_count];
  CHECK(h->vertex_count - corners / 2 + h->face_count == 2, "Euler: %d vertices, %d faces", h->vertex_count,
        h->face_count);
  CHECK(h->neighbor_start[h->vertex_count] == corners, "two directed edges per edge");
  for (int f = 0; f < h->face_count; f++) {
    int first = h->face_start[f];
    int sides = h->face_start[f + 1] - first;
    CHECK_NEAR(gv_norm(h->face_normal[f]), 1.0, 1e-14);
    for (int i = 0; i < count; i++)
      CHECK(gv_dot(h->face_normal[f], points[i]) <= h->face_offset[f] + 1e-9 * size,
            "point %d outside face %d", i, f);
    for (int k = 0; k < sides; k++) {
      int i = h->face_vertex[first + k];
      int j = h->face_vertex[first + (k + 1) % sides];
      int l = h->face_vertex[first + (k + 2) % sides];
      CHECK_NEAR(gv_dot(h->face_normal[f], h->vertex[i]), h->face_offset[f], 1e-9 * size);
      CHECK(has_neighbor(h, i, j, f), "edge %d %d of face %d in the lists", i, j, f);
      gv_vec3 turn = gv_cross(gv_sub(h->vertex[j], h->vertex[i]), gv_sub(h->vertex[l], h->vertex[j]));
      CHECK(gv_dot(turn, h->face_normal[f]) > 0, "face %d turns left at corner %d", f, k);
    }
    CHECK(gv_dot(h->face_normal[f], h->center) < h->face_offset[f], "centre inside face %d", f);
  }
  for (int i = 0; i < h->vertex_count; i++) {
    gv_vec3 v = h->vertex[i];
    CHECK(v.x >= h->aabb_min.x && v.y >= h->aabb_min.y && v.z >= h->aabb_min.z && v.x <= h->aabb_max.x &&
              v.y <= h->aabb_max.y && v.z <= h->aabb_max.z,
          "vertex %d in the bounds", i);
  }
}

static int put_box(gv_vec3 half, gv_pose T) {
  for (int i = 0; i < 8; i++)
    points[i] = gv_transform(
        T, gv_v3(i & 1 ? half.x : -half.x, i & 2 ? half.y : -half.y, i & 4 ? half.z : -half.z));
  return 8;
}

static void test_box_has_six_quads(void) {
  for (int round = 0; round < 200; round++) {
    gv_pose T = {round ? draw_rotation() : gv_quat_identity(), draw_vector(1)};
    gv_hull h;
    int count = put_box(gv_v3(draw(0.001, 0.5), draw(0.001, 0.5), draw(0.001, 0.5)), T);
    CHECK(build(count, &h) == 0, "box builds");
    CHECK(h.vertex_count == 8 && h.face_count == 6 && h.face_start[6] == 24, "%d vertices, %d faces",
          h.vertex_count, h.face_count);
    check_hull(&h, count, 1);
  }
}

// A lattice: most points inside, on faces or on edges of the cube, and every one twice.
static void test_lattice_is_a_box(void) {
  int count = 0;
  gv_hull h;
  for (int twice = 0; twice < 2; twice++)
    for (int i = 0; i < 7 * 7 * 7; i++)
      points[count++] = gv_v3(0.01 * (i % 7), 0.01 * (i / 7 % 7), 0.01 * (i / 49));
  CHECK(build(count, &h) == 0, "lattice builds");
  CHECK(h.vertex_count == 8 && h.face_count == 6, "%d vertices, %d faces", h.vertex_count, h.face_count);
  check_hull(&h, count, 0.1);
}

static void test_random_points_on_an_ellipsoid(void) {
  const int counts[] = {4, 5, 10, 50, 250, GV_MAX_HULL_VERTICES};
  for (int c = 0; c < 6; c++) {
    gv_hull h;
    gv_vec3 r = gv_v3(draw(0.01, 0.1), draw(0.01, 0.1), draw(0.01, 0.1));
    for (int i = 0; i < counts[c]; i++) {
      gv_vec3 u = draw_unit();
      points[i] = gv_v3(r.x * u.x, r.y * u.y, r.z * u.z);
    }
    int error = build(counts[c], &h);
    CHECK(error == 0, "%d points: %s", counts[c], gv_hull_error(error));
    if (error)
      continue;
    CHECK(h.vertex_count == counts[c] && h.face_count == 2 * counts[c] - 4, "all %d points stay: %d",
          counts[c], h.vertex_count);
    check_hull(&h, counts[c], 0.2);
  }
}

// Prisms with many corners, turned: two polygons of n corners and n quads, though
// every side is two triangles.
static void test_prisms(void) {
  for (int n = 3; n <= GV_MAX_FACE_VERTICES; n++) {
    gv_hull h;
    gv_quat q = draw_rotation();
    for (int i = 0; i < n; i++) {
      double s, c;
      gv_sincos(2 * GV_PI * i / n, &s, &c);
      for (int top = 0; top < 2; top++)
        points[2 * i + top] = gv_rotate(q, gv_v3(0.03 * c, 0.03 * s, top ? 0.05 : -0.05));
    }
    int error = build(2 * n, &h);
    CHECK(error == 0 && h.face_count == n + 2 && h.vertex_count == 2 * n, "prism %d: %s, %d faces", n,
          gv_hull_error(error), h.face_count);
    if (!error)
      check_hull(&h, 2 * n, 0.1);
  }
}

// Coordinates as a text file has them, a few digits, so that flat sides are flat to the last digit only.
static void test_rounded_coordinates(void) {
  const double quanta[7] = {1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11};
  for (int round = 0; round < 2100; round++) {
    int count = put_box(gv_v3(0.04, 0.03, 0.05), (gv_pose){draw_rotation(), {0, 0, 0}});
    double quantum = quanta[round % 7];
    for (int k = 0; k < 40; k++, count++) {  // and points on its sides
      double t = draw(0, 1);
      double u = draw(0, 1);
      points[count] = gv_mad(gv_mad(gv_scale(points[0], 1 - t - u), t, points[1]), u, points[2]);
    }
    for (int i = 0; i < count; i++) {
      points[i].x = floor(points[i].x / quantum + 0.5) * quantum;
      points[i].y = floor(points[i].y / quantum + 0.5) * quantum;
      points[i].z = floor(points[i].z / quantum + 0.5) * quantum;
    }
    gv_hull h;
    int error = build(count, &h);
    CHECK(error == 0, "round %d: %s", round, gv_hull_error(error));
    if (!error)
      CHECK(fabs(gv_hull_mass_properties(&h).volume / (0.08 * 0.06 * 0.1) - 1) < 100 * quantum + 1e-5,
            "volume kept");
  }
}

// A box as a file with six digits has it, turned, with points on its sides: six sides of four corners all
// the same, and no corner more than the rounding away from where it was.
static void test_flat_sides_of_rounded_files(void) {
  for (int round = 0; round < 500; round++) {
    gv_vec3 half = gv_v3(draw(0.03, 0.1), draw(0.03, 0.1), round % 5 ? draw(0.03, 0.1) : 0.002);
    gv_pose T = {draw_rotation(), draw_vector(0.05)};
    gv_hull h;
    int count = put_box(half, T), error;
    for (int k = 0; k < round % 20; k++, count++)
      points[count] = gv_transform(
          T, gv_v3(half.x * draw(-1, 1), half.y * draw(-1, 1), k % 2 ? half.z : -half.z));
    for (int i = 0; i < count; i++)
      points[i] = gv_v3(floor(points[i].x * 1e6 + 0.5) * 1e-6, floor(points[i].y * 1e6 + 0.5) * 1e-6,
                        floor(points[i].z * 1e6 + 0.5) * 1e-6);
    error = build(count, &h);
    CHECK(error == 0 && h.face_count == 6 && h.vertex_count == 8, "round %d: %s, %d faces, %d vertices",
          round, gv_hull_error(error), h.face_count, h.vertex_count);
    for (int i = 0; i < 8 && error == 0; i++) {
      double off = HUGE_VAL;
      for (int k = 0; k < h.vertex_count; k++)
        off = fmin(off, gv_norm(gv_sub(h.vertex[k], points[i])));
      CHECK(off < 4e-6, "corner %d moved by %g m", i, off);
    }
  }
}

static void test_errors(void) {
  gv_hull h;
  put_box(gv_v3(1, 1, 1), gv_pose_identity());
  CHECK(build(3, &h) == GV_HULL_FEW, "three points");
  points[5].y = NAN;
  CHECK(build(8, &h) == GV_HULL_NOT_FINITE, "not a number");
  put_box(gv_v3(1, 1, 0), gv_pose_identity());
  CHECK(build(8, &h) == GV_HULL_FLAT, "flat");
  put_box(gv_v3(1, 0, 0), gv_pose_identity());
  CHECK(build(8, &h) == GV_HULL_FLAT, "a line");
  put_box(gv_v3(0, 0, 0), gv_pose_identity());
  CHECK(build(8, &h) == GV_HULL_FLAT, "one point");
  CHECK(build(GV_MAX_HULL_VERTICES + 1, &h) == GV_HULL_VERTICES, "too many points");
  put_box(gv_v3(1, 1, 1), gv_pose_identity());
  gv_arena arena;
  gv_arena_init(&arena, memory, 300);
  CHECK(gv_hull_build(&arena, points, 8, &h) == GV_HULL_MEMORY, "small arena");
  CHECK(arena.peak > 300, "the arena knows what was missing");
  for (int i = 0; i < 65; i++) {
    double s, c;
    gv_sincos(2 * GV_PI * i / 65, &s, &c);
    points[2 * i] = gv_v3(c, s, 0);
    points[2 * i + 1] = gv_v3(c, s, 1);
  }
  CHECK(build(130, &h) == GV_HULL_POLYGON, "a face of 65 corners");
  for (int e = 0; e >= GV_HULL_DEGENERATE; e--)
    CHECK(strcmp(gv_hull_error(e), "unknown error") != 0, "error %d has a text", e);
}

static void test_mass_of_a_box(void) {
  gv_hull h;
  put_box(gv_v3(0.1, 0.2, 0.3), (gv_pose){{1, 0, 0, 0}, {5, -3, 2}});
  CHECK(build(8, &h) == 0, "builds");
  gv_mass_properties m = gv_hull_mass_properties(&h);
  CHECK_NEAR(m.volume, 0.2 * 0.4 * 0.6, 1e-14);
  CHECK_NEAR(gv_norm(gv_sub(m.center, gv_v3(5, -3, 2))), 0.0, 1e-14);
  CHECK_NEAR(m.inertia.m[0][0], (0.16 + 0.36) / 12, 1e-14);
  CHECK_NEAR(m.inertia.m[1][1], (0.04 + 0.36) / 12, 1e-14);
  CHECK_NEAR(m.inertia.m[2][2], (0.04 + 0.16) / 12, 1e-14);
  CHECK_NEAR(m.inertia.m[0][1], 0.0, 1e-14);
}

// Tetrahedron (0, e_x, e_y, e_z): volume 1/6, centre 1/4, I_xx = 3/40, I_xy = 1/80
// about the centre, per mass.
static void test_mass_of_a_tetrahedron(void) {
  gv_hull h;
  points[0] = gv_v3(0, 0, 0);
  points[1] = gv_v3(1, 0, 0);
  points[2] = gv_v3(0, 1, 0);
  points[3] = gv_v3(0, 0, 1);
  CHECK(build(4, &h) == 0, "builds");
  gv_mass_properties m = gv_hull_mass_properties(&h);
  CHECK_NEAR(m.volume, 1.0 / 6, 1e-15);
  CHECK_NEAR(m.center.x, 0.25, 1e-15);
  CHECK_NEAR(m.inertia.m[2][2], 3.0 / 40, 1e-15);
  CHECK_NEAR(m.inertia.m[0][1], 1.0 / 80, 1e-15);
}

// A box cut in eight at a crooked place is still the box.
static void test_sum_of_parts(void) {
  gv_mass_properties part[8];
  for (int i = 0; i < 8; i++) {
    gv_vec3 low = gv_v3(i & 1 ? 0.03 : -0.1, i & 2 ? -0.07 : -0.2, i & 4 ? 0.11 : -0.3);
    gv_vec3 high = gv_v3(i & 1 ? 0.1 : 0.03, i & 2 ? 0.2 : -0.07, i & 4 ? 0.3 : 0.11);
    gv_hull h;
    put_box(gv_scale(gv_sub(high, low), 0.5), (gv_pose){{1, 0, 0, 0}, gv_scale(gv_add(high, low), 0.5)});
    CHECK(build(8, &h) == 0, "builds");
    part[i] = gv_hull_mass_properties(&h);
  }
  gv_mass_properties m = gv_mass_properties_sum(part, 8);
  CHECK_NEAR(m.volume, 0.2 * 0.4 * 0.6, 1e-14);
  CHECK_NEAR(gv_norm(m.center), 0.0, 1e-14);
  CHECK_NEAR(m.inertia.m[0][0], (0.16 + 0.36) / 12, 1e-14);
  CHECK_NEAR(m.inertia.m[1][2], 0.0, 1e-14);
}

// Climbing finds as high a vertex as a look at all of them, from any start, also across merged faces.
static void test_support_against_scan(void) {
  for (int round = 0; round < 40; round++) {
    gv_hull h;
    int count = 0;
    if (round % 2)
      for (; count < 20 + 20 * round; count++)
        points[count] = gv_scale(draw_unit(), 0.05);
    else
      for (; count < 60; count++) {  // a prism: large faces of many corners
        double s, c;
        gv_sincos(2 * GV_PI * (count / 2) / 30, &s, &c);
        points[count] = gv_v3(0.03 * c, 0.03 * s, count % 2 ? 0.05 : -0.05);
      }
    CHECK(build(count, &h) == 0, "builds");
    gv_shape shape = gv_shape_hull(&h);
    gv_pose T = {draw_rotation(), {0.1, 0.2, 0.3}};
    for (int k = 0; k < 500; k++) {
      gv_vec3 d = k % 5 == 0 ? gv_rotate(T.q, h.face_normal[k % h.face_count]) : draw_unit();
      uint16_t hint = (uint16_t)(k % h.vertex_count);
      double high = gv_dot(gv_support(&shape, &T, d, &hint), d);
      double best = -HUGE_VAL;
      for (int i = 0; i < h.vertex_count; i++)
        best = fmax(best, gv_dot(gv_transform(T, h.vertex[i]), d));
      CHECK_NEAR(high, best, 1e-15);
    }
  }
}

int main(void) {
  RUN(test_box_has_six_quads);
  RUN(test_lattice_is_a_box);
  RUN(test_random_points_on_an_ellipsoid);
  RUN(test_prisms);
  RUN(test_rounded_coordinates);
  RUN(test_flat_sides_of_rounded_files);
  RUN(test_errors);
  RUN(test_mass_of_a_box);
  RUN(test_mass_of_a_tetrahedron);
  RUN(test_sum_of_parts);
  RUN(test_support_against_scan);
  return check_done();
}
