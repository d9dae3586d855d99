// SPDX-License-Identifier: BSD-3-Clause
// Contact manifolds against geometry that can be written down: boxes and limbs on a table, over its rim, on
// an edge, tilted; and for thousands of random poses what every manifold must keep: as deep as the pair and
// no deeper, within the margin, points between the surfaces, and no jumps while sliding.
#include "collision/face.h"
#include "support/polyhedra.h"

static const double margin = 0.001;
static gv_hull box, table, round60, round1000, prism;

static void build_hulls(void) {
  static char memory[5][300000];
  static gv_vec3 p[60];
  gv_arena arena;
  build_box_hull(gv_v3(0.03, 0.02, 0.04), memory[0], sizeof memory[0], &box);
  build_box_hull(gv_v3(0.5, 0.6, 0.05), memory[1], sizeof memory[1], &table);
  build_round_hull(60, gv_v3(0.03, 0.02, 0.04), memory[2], sizeof memory[2], &round60);
  build_round_hull(1000, gv_v3(0.03, 0.02, 0.04), memory[3], sizeof memory[3], &round1000);
  for (int i = 0; i < 60; i++) {
    double s, c;
    gv_sincos(2 * GV_PI * (i / 2) / 30, &s, &c);
    p[i] = gv_v3(0.03 * c, 0.03 * s, i % 2 ? 0.05 : -0.05);
  }
  gv_arena_init(&arena, memory[4], sizeof memory[4]);
  if (gv_hull_build(&arena, p, 60, &prism))
    exit(1);
}

typedef struct contacts {
  gv_contact_point p[GV_MAX_PAIR_CONTACTS];
  int count;
  gv_distance d;
} contacts;

static contacts touch(gv_shape a, gv_pose A, gv_shape b, gv_pose B, gv_pair_cache *cache) {
  contacts c;
  gv_pair_cache cold = {.corners = 0};
  c.count = gv_manifold_pair(GV_NARROW_CORE, &(gv_pair){&a, &A, &b, &B}, margin, cache ? cache : &cold, c.p,
                             &c.d);
  return c;
}

// Is one of the contacts at this place (within tol, metres)? Returns it or null.
static const gv_contact_point *at(const contacts *c, gv_vec3 where, double tol) {
  for (int i = 0; i < c->count; i++)
    if (gv_norm(gv_sub(c->p[i].position_world, where)) <= tol)
      return &c->p[i];
  return NULL;
}

static gv_shape limb(void) { return gv_shape_capsule(0.015, 0.008); }
static gv_quat turn(double x, double y, double z, double angle) {
  return gv_quat_axis_angle(gv_v3(x, y, z), angle);
}

// A box flat on the table at any depth or gap, turned about the vertical, in any
// world frame: its four corners.
static void test_box_on_a_table(void) {
  for (int i = 0; i < 2000; i++) {
    gv_pose B = {i % 2 ? draw_rotation() : gv_quat_identity(), draw_vector(1)};
    double depth = i % 7 == 0 ? 0 : draw(-1, 1) * pow(10, draw(-9, -3));
    double yaw = i % 3 ? draw(-4, 4) : 0;
    gv_pose T = {turn(0, 0, 1, yaw), {draw(-0.4, 0.4), draw(-0.4, 0.4), 0.09 - depth}};
    contacts c = touch(gv_shape_hull(&box), gv_pose_mul(B, T), gv_shape_hull(&table), B, NULL);
    CHECK(c.count == 4, "%d contacts at depth %g", c.count, depth);
    for (int k = 0; k < 4; k++) {
      gv_vec3 corner = gv_transform(T, gv_v3(k & 1 ? 0.03 : -0.03, k & 2 ? 0.02 : -0.02, -0.04));
      corner.z = 0.05 - 0.5 * depth;
      const gv_contact_point *p = at(&c, gv_transform(B, corner), 1e-9);
      CHECK(p != NULL, "a contact at corner %d", k);
      if (!p)
        continue;
      CHECK_NEAR(p->depth, depth, 1e-12);
      CHECK_NEAR(gv_dot(p->normal_world, gv_rotate(B.q, gv_v3(0, 0, 1))), 1.0, 1e-12);
      CHECK(p->face_b != 0xffff && table.face_normal[p->face_b].z > 0.999, "face %d of the table", p->face_b);
    }
    contacts swapped = touch(gv_shape_hull(&table), B, gv_shape_hull(&box), gv_pose_mul(B, T), NULL);
    CHECK(swapped.count == 4 && gv_dot(swapped.p[0].normal_world, c.p[0].normal_world) < -0.999999,
          "the same from the other side");
    for (int k = 0; k < c.count; k++)
      CHECK(at(&swapped, c.p[k].position_world, 1e-8) != NULL, "contact %d, sides swapped", k);
  }
}

// A box that a file describes turned, with six digits a coordinate, has flat sides all the same.
static void test_box_from_a_rounded_file(void) {
  static char memory[8000];
  for (int i = 0; i < 200; i++) {
    gv_quat q = draw_rotation();
    gv_vec3 p[8];
    gv_hull rounded;
    gv_arena arena;
    gv_arena_init(&arena, memory, sizeof memory);
    for (int k = 0; k < 8; k++) {
      p[k] = gv_rotate(q, gv_v3(k & 1 ? 0.03 : -0.03, k & 2 ? 0.02 : -0.02, k & 4 ? 0.04 : -0.04));
      p[k] = gv_v3(floor(p[k].x * 1e6 + 0.5) * 1e-6, floor(p[k].y * 1e6 + 0.5) * 1e-6,
                   floor(p[k].z * 1e6 + 0.5) * 1e-6);
    }
    if (gv_hull_build(&arena, p, 8, &rounded))
      exit(1);
    contacts c = touch(gv_shape_hull(&rounded), (gv_pose){gv_quat_conj(q), {0.1, 0.1, 0.09 - 1e-5}},
                       gv_shape_hull(&table), gv_pose_identity(), NULL);
    CHECK(c.count == 4, "%d contacts", c.count);
    for (int k = 0; k < c.count; k++)
      CHECK_NEAR(c.p[k].depth, 1e-5, 4e-6);
  }
}

// Tilted by a little, each corner has the depth of its own height.
static void test_tilted_box(void) {
  for (int i = 0; i < 1000; i++) {
    double tilt = pow(10, draw(-10, -2.2));
    gv_pose T = {turn(0, 1, 0, tilt), {0, 0, 0.09}};
    contacts c = touch(gv_shape_hull(&box), T, gv_shape_hull(&table), gv_pose_identity(), NULL);
    CHECK(c.count == 4, "%d contacts at tilt %g", c.count, tilt);
    for (int k = 0; k < 4; k++) {
      gv_vec3 corner = gv_transform(T, gv_v3(k & 1 ? 0.03 : -0.03, k & 2 ? 0.02 : -0.02, -0.04));
      const gv_contact_point *p = at(&c, gv_v3(corner.x, corner.y, 0.5 * (corner.z + 0.05)), 1e-8);
      CHECK(p && fabs(p->depth - (0.05 - corner.z)) < 1e-10, "corner %d of a box tilted by %g", k, tilt);
    }
  }
}

// Over the rim the common region is cut at the rim.
static void test_box_over_the_rim(void) {
  gv_pose T = {{1, 0, 0, 0}, {0.51, 0.1, 0.09 - 1e-5}};
  contacts c = touch(gv_shape_hull(&box), T, gv_shape_hull(&table), gv_pose_identity(), NULL);
  CHECK(c.count == 4, "%d contacts", c.count);
  for (int k = 0; k < 4; k++)
    CHECK(at(&c, gv_v3(k & 1 ? 0.48 : 0.5, k & 2 ? 0.12 : 0.08, 0.05 - 5e-6), 1e-8) != NULL,
          "corner %d of the region", k);
}

static void test_palm_on_a_table(void) {
  gv_pose T = {turn(0, 0, 1, 0.4), {0.1, 0.1, 0.05 + 0.008 + 0.005 - 1e-4}};
  contacts c = touch(gv_shape_rounded_box(gv_v3(0.04, 0.045, 0.008), 0.005), T, gv_shape_hull(&table),
                     gv_pose_identity(), NULL);
  CHECK(c.count == 4, "%d contacts", c.count);
  for (int k = 0; k < 4; k++) {
    gv_vec3 corner = gv_transform(T, gv_v3(k & 1 ? 0.04 : -0.04, k & 2 ? 0.045 : -0.045, 0));
    const gv_contact_point *p = at(&c, gv_v3(corner.x, corner.y, 0.05 - 5e-5), 1e-9);
    CHECK(p && fabs(p->depth - 1e-4) < 1e-12, "corner %d", k);
  }
}

static void test_limb_along_a_face(void) {
  for (int i = 0; i < 2000; i++) {
    double tilt = i % 10 == 0 ? 0 : draw(-1, 1) * pow(10, draw(-12, -1.8));
    double yaw = draw(-4, 4);
    double s;
    double c0;
    gv_sincos(tilt, &s, &c0);
    gv_pose B = {i % 2 ? draw_rotation() : gv_quat_identity(), {0, 0, 0}};
    gv_pose T = {gv_quat_mul(turn(0, 0, 1, yaw), turn(0, 1, 0, tilt)), {0.1, 0.1, 0.05 + 0.008 - 2e-4}};
    contacts c = touch(limb(), gv_pose_mul(B, T), gv_shape_hull(&table), B, NULL);
    CHECK(c.count == 2, "%d contacts at tilt %g", c.count, tilt);
    for (int end = -1; end <= 1; end += 2) {
      gv_vec3 p = gv_transform(T, gv_v3(end * 0.015, 0, 0));
      double depth = 0.05 + 0.008 - p.z;
      const gv_contact_point *found = at(&c, gv_transform(B, gv_v3(p.x, p.y, 0.05 - 0.5 * depth)), 1e-8);
      CHECK(found && fabs(found->depth - depth) < 1e-10, "end %d at tilt %g", end, tilt);
    }
  }
}

static void test_limb_over_the_rim(void) {
  for (int i = 0; i < 500; i++) {
    double x = draw(0.4851, 0.5149);
    contacts c = touch(limb(), (gv_pose){{1, 0, 0, 0}, {x, 0.2, 0.0579}}, gv_shape_hull(&table),
                       gv_pose_identity(), NULL);
    CHECK(c.count == 2 && at(&c, gv_v3(x - 0.015, 0.2, 0.04995), 1e-8) &&
              at(&c, gv_v3(0.5, 0.2, 0.04995), 1e-8),
          "cut at the rim, x = %g", x);
  }
}

// Along an edge of the box, leaning at 45 degrees on it: two points, the same when
// turned a little, either way.
static void test_limb_along_an_edge(void) {
  double h = sqrt(0.5);
  for (int i = -200; i <= 200; i++) {
    gv_quat along_y = turn(0, 0, 1, GV_PI / 2);
    gv_quat yaw = turn(h, 0, h, 1e-4 * i);
    gv_pose T = {gv_quat_mul(yaw, along_y), {0.03 + 0.008 * h - 1e-4, 0, 0.04 + 0.008 * h - 1e-4}};
    contacts c = touch(limb(), T, gv_shape_hull(&box), gv_pose_identity(), NULL);
    int ends = 0;
    for (int k = 0; k < c.count; k++)
      ends += fabs(c.p[k].position_world.y) > 0.0149;
    CHECK(ends == 2 && (c.count == 2 || (c.count == 3 && i != 0)), "%d contacts, %d at the ends, yaw %g",
          c.count, ends, 1e-4 * i);
  }
}

// A limb across a roof of five faces rests on the two edges of its top, whichever way it rocks; the slopes
// beside them fall by 0.1 mm and are within the margin, too.
static void test_limb_on_two_edges(void) {
  static char memory[100000];
  static const double y[6] = {0.003, 0.010, 0.012, -0.003, -0.010, -0.012};
  static const double z[6] = {0, -0.0001, -0.01, 0, -0.0001, -0.01};
  gv_vec3 p[12];
  gv_arena arena;
  gv_hull roof;
  for (int i = 0; i < 12; i++)
    p[i] = gv_v3(i % 2 ? 0.02 : -0.02, y[i / 2], z[i / 2]);
  gv_arena_init(&arena, memory, sizeof memory);
  CHECK(!gv_hull_build(&arena, p, 12, &roof), "no hull");
  for (int i = 0; i < 200; i++) {
    double rock = draw(-1, 1) * pow(10, draw(-9, -3.3));
    double depth = draw(0, 2e-5);
    gv_pose T = {gv_quat_mul(turn(1, 0, 0, rock), turn(0, 0, 1, 0.5 * GV_PI)),
                 {draw(-0.01, 0.01), 0, 0.008 - depth}};
    gv_pose B = {draw_rotation(), draw_vector(1)};
    contacts c = touch(limb(), gv_pose_mul(B, T), gv_shape_hull(&roof), B, NULL);
    for (int side = -1; side <= 1; side += 2) {
      const gv_contact_point *k = at(&c, gv_transform(B, gv_v3(T.p.x, 0.003 * side, 0)), 5e-5);
      CHECK(k != NULL, "rocked by %g: no contact at the edge at y = %g", rock, 0.003 * side);
      if (k)
        CHECK_NEAR(k->depth, depth - 0.003 * side * rock, 1e-8 + 1e-2 * fabs(rock) * 0.003);
    }
  }
}

// What a limb does not rock on is no contact: of the edges of a roof of seven faces those 0.3 mm below the
// top are left out, although they are within the margin; those at the limb's way's end are not.
static void test_edges_far_below_are_passed_over(void) {
  static char memory[100000];
  static const double y[8] = {0.003, 0.008, 0.012, 0.0125, -0.003, -0.008, -0.012, -0.0125};
  static const double z[8] = {0, -0.0003, -0.0009, -0.01, 0, -0.0003, -0.0009, -0.01};
  gv_vec3 p[16];
  gv_arena arena;
  gv_hull roof;
  for (int i = 0; i < 16; i++)
    p[i] = gv_v3(i % 2 ? 0.02 : -0.02, y[i / 2], z[i / 2]);
  gv_arena_init(&arena, memory, sizeof memory);
  CHECK(!gv_hull_build(&arena, p, 16, &roof), "no hull");
  const gv_pose T = {turn(0, 0, 1, 0.5 * GV_PI), {0, 0, 0.008}};
  contacts c = touch(limb(), T, gv_shape_hull(&roof), gv_pose_identity(), NULL);
  CHECK(c.count == 4, "%d contacts", c.count);
  for (int side = -1; side <= 1; side += 2) {
    CHECK(at(&c, gv_v3(0, 0.003 * side, 0), 1e-6), "no contact on the edge of the top");
    CHECK(at(&c, gv_v3(0, 0.012 * side, -0.00045), 1e-6), "none at the end of the way");
  }
}

// Slopes up to 72 degrees carry a limb that lies along their ridge at both its ends; on steeper ones the
// nearest point is all.
static void test_a_ridge_up_to_72_degrees_carries_both_ends(void) {
  for (int steeper = 0; steeper < 2; steeper++) {
    static char memory[100000];
    const double height = 0.01 * tan((steeper ? 73.5 : 71.5) * GV_PI / 180);
    const gv_vec3 p[] = {{-0.01, -0.1, -height}, {0.01, -0.1, -height}, {-0.01, 0.1, -height},
                         {0.01, 0.1, -height},   {0, -0.1, 0},          {0, 0.1, 0}};
    gv_arena arena;
    gv_hull ridge;
    gv_arena_init(&arena, memory, sizeof memory);
    CHECK(!gv_hull_build(&arena, p, 6, &ridge), "no hull");
    const gv_pose T = {turn(0, 0, 1, 0.5 * GV_PI), {0, 0, 0.0079}};
    contacts c = touch(limb(), T, gv_shape_hull(&ridge), gv_pose_identity(), NULL);
    CHECK(c.count == (steeper ? 1 : 2), "%s: %d contacts", steeper ? "steeper" : "less steep", c.count);
  }
}

static void test_single_points(void) {
  double h = sqrt(0.5);
  gv_pose across = {turn(0, 1, 0, GV_PI / 4), {0.03 + 0.008 * h, 0, 0.04 + 0.008 * h}};
  contacts c = touch(limb(), across, gv_shape_hull(&box), gv_pose_identity(), NULL);
  CHECK(c.count == 1, "limb across an edge: %d", c.count);
  gv_pose upright = {turn(0, 1, 0, GV_PI / 2), {0.1, 0.1, 0.05 + 0.015 + 0.008}};
  c = touch(limb(), upright, gv_shape_hull(&table), gv_pose_identity(), NULL);
  CHECK(c.count == 1, "fingertip on the table: %d", c.count);
  gv_pose corner = {gv_quat_mul(turn(1, 0, 0, 0.6), turn(0, 1, 0, 0.7)), {0, 0, 1}};
  gv_distance d;
  gv_shape a = gv_shape_hull(&box);
  gv_shape b = gv_shape_hull(&table);
  gv_pair_cache cache = {.corners = 0};
  gv_pose B = gv_pose_identity();
  gv_distance_pair(GV_NARROW_CORE, &(gv_pair){&a, &corner, &b, &B}, 2, &cache, &d);
  corner.p.z -= d.distance + 1e-4;
  c = touch(a, corner, b, B, NULL);
  CHECK(c.count == 1, "corner of a box on the table: %d", c.count);
  CHECK_NEAR(c.p[0].depth, 1e-4, 1e-12);
  gv_pose far = {{1, 0, 0, 0}, {0, 0, 0.0911}};
  c = touch(a, far, b, B, NULL);
  CHECK(c.count == 0, "beyond the margin: %d", c.count);
}

// Thirty corners are thinned to at most eight that span nearly as much.
static void test_reduction(void) {
  gv_pose T = {turn(0, 1, 0, 1e-5), {0, 0, 0.1 - 1e-4}};
  contacts c = touch(gv_shape_hull(&prism), T, gv_shape_hull(&table), gv_pose_identity(), NULL);
  CHECK(c.count >= 4 && c.count <= GV_MAX_PAIR_CONTACTS, "%d contacts", c.count);
  double deepest = 0;
  double reach[8] = {0};
  for (int k = 0; k < c.count; k++) {
    deepest = fmax(deepest, c.p[k].depth);
    for (int i = 0; i < 8; i++) {
      double s, q;
      gv_sincos(GV_PI / 4 * i, &s, &q);
      reach[i] = fmax(reach[i], q * c.p[k].position_world.x + s * c.p[k].position_world.y);
    }
  }
  CHECK_NEAR(deepest, -c.d.distance, 1e-9);
  for (int i = 0; i < 8; i++)
    CHECK(reach[i] > 0.8 * 0.03, "reaches %g m in direction %d", reach[i], i);
}

// ---- what every manifold must keep ----

static double core_distance(const gv_shape *s, const gv_pose *T, gv_vec3 p) {
  gv_shape point = gv_shape_capsule(0, 0);
  gv_pose P = {{1, 0, 0, 0}, p};
  gv_pair_cache cache = {.corners = 0};
  gv_distance d;
  gv_distance_pair(GV_NARROW_CORE, &(gv_pair){&point, &P, s, T}, 10, &cache, &d);
  return d.distance;
}

static void check_contacts(const contacts *c, const gv_shape *a, const gv_pose *A, const gv_shape *b,
                           const gv_pose *B) {
  double deepest = -HUGE_VAL;
  double depth = -c->d.distance;
  CHECK((c->count > 0) == (c->d.method != GV_DISTANCE_BEYOND && c->d.distance <= margin),
        "%d contacts at distance %g", c->count, c->d.distance);
  for (int k = 0; k < c->count; k++) {
    const gv_contact_point *p = &c->p[k];
    deepest = fmax(deepest, p->depth);
    CHECK(p->depth >= -margin - 1e-12 && p->depth <= depth + 1e-9, "depth %g of %g", p->depth, depth);
    CHECK_NEAR(gv_norm(p->normal_world), 1.0, 1e-12);
    double from_a = core_distance(a, A, p->position_world);
    double from_b = core_distance(b, B, p->position_world);
    // a rounded side off its own normal
    double allowed = 0.5 * fmax(0, -p->depth) + 0.1 * fmax(0, p->depth) + 1e-6;
    CHECK(from_a <= allowed && from_b <= allowed, "between the surfaces: %g, %g, depth %g", from_a, from_b,
          p->depth);
    CHECK(from_a >= -fmax(0, depth) - 1e-6 || from_b >= -fmax(0, depth) - 1e-6, "not deep inside both");
    CHECK((p->face_b == 0xffff) == (b->kind != GV_CORE_HULL), "polygon of B");
    if (b->kind == GV_CORE_HULL)
      CHECK(p->face_b < b->hull->face_count, "face %d", p->face_b);
    for (int j = 0; j < k; j++)
      CHECK(gv_norm(gv_sub(p->position_world, c->p[j].position_world)) > 9e-6, "two contacts in one place");
  }
  if (c->count)
    CHECK_NEAR(deepest, depth, 2e-9);
}

static void test_random_poses(void) {
  gv_shape palm = gv_shape_rounded_box(gv_v3(0.04, 0.045, 0.008), 0.005);
  const gv_shape shape[6] = {limb(),
                             palm,
                             gv_shape_hull(&box),
                             gv_shape_hull(&round60),
                             gv_shape_hull(&prism),
                             gv_shape_hull(&round1000)};
  int counts[GV_MAX_PAIR_CONTACTS + 1] = {0};
  for (int i = 0; i < 12000; i++) {
    gv_shape a = shape[i % 6];
    gv_shape b = shape[i / 6 % 6];
    gv_pose B = {i % 3 ? draw_rotation() : gv_quat_identity(), {0.1, 0.2, 0.3}};
    gv_pose A = {i % 4 ? draw_rotation() : B.q, gv_mad(B.p, 0.1, draw_unit())};
    gv_pair_cache cache = {.corners = 0};
    gv_distance d;
    gv_distance_pair(GV_NARROW_CORE, &(gv_pair){&a, &A, &b, &B}, 1, &cache, &d);
    double gap = i % 5 == 0 ? draw(-0.01, 0) : draw(-1, 1.2) * pow(10, draw(-9, -3));
    A.p = gv_mad(A.p, gap - d.distance, d.normal_world);
    contacts c = touch(a, A, b, B, i % 2 ? &cache : NULL);
    check_contacts(&c, &a, &A, &b, &B);
    counts[c.count]++;
  }
  printf("  contacts:");
  for (int k = 0; k <= GV_MAX_PAIR_CONTACTS; k++)
    printf(" %d of %d,", counts[k], k);
  printf("\n");
}

// Sliding smoothly, a contact that carries (depth above zero) never appears or vanishes but at depth zero or
// by sharing its place: each has one near it a step later.
static void test_contacts_do_not_jump(void) {
  gv_pair_cache cache = {.corners = 0};
  contacts last = {.count = 0};
  for (int i = 0; i < 6000; i++) {  // a box pushed over the rim, turning
    gv_pose T = {turn(0, 0, 1, 1e-4 * i), {0.45 + 1e-5 * i, 0.1, 0.09 - 1e-5}};
    contacts c = touch(gv_shape_hull(&box), T, gv_shape_hull(&table), gv_pose_identity(), &cache);
    for (int k = 0; k < last.count && i > 0; k++) {
      double nearest = HUGE_VAL;
      for (int j = 0; j < c.count; j++)
        nearest = fmin(nearest, gv_norm(gv_sub(c.p[j].position_world, last.p[k].position_world)));
      if (c.count)
        CHECK(nearest < 5e-4, "step %d: contact %d jumped by %g", i, k, nearest);
      CHECK_NEAR(last.p[k].depth, 1e-5, 1e-11);
    }
    last = c;
  }
}

// The side that another shape lies on flat, but for a little, is the one that is picked, on round hulls and
// on thin ones, wherever the climb begins.
static void test_the_side_lain_on_is_picked(void) {
  static char space[300000];
  for (int trial = 0; trial < 60; trial++) {
    const gv_vec3 half = {0.05, trial % 3 == 0 ? 0.05 : 0.003, trial % 2 ? 0.04 : 0.002};
    gv_hull hull;
    build_round_hull(60 + 4 * trial, half, space, sizeof space, &hull);
    const gv_shape shape = gv_shape_hull(&hull);
    gv_core core;
    gv_core_in_place(&shape, &core);
    for (int i = 0; i < 200; i++) {
      const gv_vec3 about = hull.face_normal[(int)draw(0, hull.face_count)];
      const gv_vec3 d = gv_normalize_or(gv_mad(about, pow(10, draw(-8, -4)), draw_unit()), about);
      uint16_t vertex = (uint16_t)draw(0, hull.vertex_count);
      int operations = 0;
      gv_face found;
      gv_face_towards(&core, d, &vertex, &found, &operations);
      double best = -1;
      for (int f = 0; f < hull.face_count; f++)
        best = fmax(best, gv_dot(hull.face_normal[f], d));
      CHECK(gv_dot(found.normal, d) > best - 2e-9, "trial %d: cosine %.12g, the best is %.12g", trial,
            gv_dot(found.normal, d), best);
    }
  }
}

int main(void) {
  build_hulls();
  RUN(test_box_on_a_table);
  RUN(test_box_from_a_rounded_file);
  RUN(test_tilted_box);
  RUN(test_box_over_the_rim);
  RUN(test_palm_on_a_table);
  RUN(test_limb_along_a_face);
  RUN(test_limb_over_the_rim);
  RUN(test_limb_along_an_edge);
  RUN(test_limb_on_two_edges);
  RUN(test_edges_far_below_are_passed_over);
  RUN(test_a_ridge_up_to_72_degrees_carries_both_ends);
  RUN(test_single_points);
  RUN(test_reduction);
  RUN(test_random_poses);
  RUN(test_contacts_do_not_jump);
  RUN(test_the_side_lain_on_is_picked);
  return check_done();
}
