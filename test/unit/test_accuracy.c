// SPDX-License-Identifier: BSD-3-Clause
// The accuracy campaign: for every pair type, poses that are random, shallow, touching, deep, almost parallel
// (1e-12 to 1e-2 rad) and aligned with a grid, each asked with a cold, a warm and a wrong cache, against the
// exact oracle (oracle.h), which a test here compares with brute force. Prints one line per pair type.
//
//   test_accuracy             GV_POSES poses of every type (default: a tenth of the campaign)
//   test_accuracy TYPE        this type alone; GV_POSE=I: its pose number I alone, with what was found
//   GV_NARROW=libccd          the same of the other narrow phase, within limits of its own
//   test_accuracy --list      the types, for running them side by side (make bench-accuracy)
#include "support/oracle.h"

#include <string.h>

// The limits, metres and rad: error with the cores apart and overlapping, cores closer than `touching`
// counting as overlapping; points off their shapes; normal, where it is unique. libccd finds a local minimum
// of the depth: from a cold cache millimetres above the least, from a wrong one anything that separates.
typedef struct limits {
  double touching, apart, overlap, overlap_wrong_cache, points, normal, too_deep_percent;
} limits;
static const limits limits_of[] = {
  [GV_NARROW_CORE] = {0, 1e-6, 1e-5, 1e-5, 1e-6, GV_PI / 1800, 0},
  [GV_NARROW_LIBCCD] = {1e-8, 1e-6, 0.03, 0.09, 0.09, 4, 13},
};
static gv_narrow asked = GV_NARROW_CORE;
// POSES: a tenth of the whole, for `make test`; two minutes.
enum {
  POSES = 100000,
  SWEEP = 370,
  LIMIT_ITERATIONS = GV_GJK_MAX_ITERATIONS + 2 * (GV_EPA_MAX_ITERATIONS + GV_EPA_MAX_DESCENT) + SWEEP
};

enum {
  BOX,
  TABLE,
  PLATE,
  ROD,
  HULL12,
  HULL21,
  HULL127,
  HULL250,
  HULL1000,
  CAPSULE,
  CYLINDER,
  CONE,
  ELLIPSOID,
  HULLS,
  LIMB,
  PALM,
  SHAPES
};
static const char *const shape_name[SHAPES] = {
  "box",      "table",   "plate",    "rod",  "hull12",    "hull21", "hull127", "hull250",
  "hull1000", "capsule", "cylinder", "cone", "ellipsoid", "",       "limb",    "palm"};
static gv_hull hull[HULLS];
static const int pair[][2] = {
  {LIMB, BOX},        {LIMB, TABLE},        {LIMB, PLATE},    {LIMB, ROD},      {LIMB, HULL12},
  {LIMB, HULL21},     {LIMB, HULL127},      {LIMB, HULL250},  {LIMB, HULL1000}, {PALM, BOX},
  {PALM, TABLE},      {PALM, PLATE},        {PALM, ROD},      {PALM, HULL12},   {PALM, HULL21},
  {PALM, HULL127},    {PALM, HULL250},      {PALM, HULL1000}, {BOX, BOX},       {BOX, TABLE},
  {PLATE, PLATE},     {ROD, ROD},           {ROD, PLATE},     {HULL12, HULL21}, {HULL21, PLATE},
  {HULL21, HULL21},   {HULL127, HULL21},    {HULL127, ROD},   {HULL250, TABLE}, {HULL250, HULL250},
  {HULL1000, LIMB},   {HULL1000, HULL1000}, {LIMB, CAPSULE},  {PALM, CAPSULE},  {BOX, CAPSULE},
  {CAPSULE, CAPSULE}, {LIMB, CYLINDER},     {LIMB, CONE},     {LIMB, ELLIPSOID}};
enum { PAIRS = sizeof pair / sizeof pair[0] };

// A rod of eight sides, 4 mm thick and 30 cm long.
static void build_rod(void *mem, size_t size, gv_hull *out) {
  gv_vec3 p[16];
  gv_arena arena;
  gv_arena_init(&arena, mem, size);
  for (int i = 0; i < 16; i++) {
    double s, c;
    gv_sincos(GV_PI / 4 * (i / 2), &s, &c);
    p[i] = gv_v3(i % 2 ? 0.15 : -0.15, 0.002 * c, 0.002 * s);
  }
  if (gv_hull_build(&arena, p, 16, out))
    exit(1);
}

static void build_named_shapes(void *mem, size_t size) {
  const gv_vec3 here = {0, 0, 0};
  gv_arena arena;
  gv_arena_init(&arena, mem, 4 * size);
  int error = gv_hull_capsule(&arena, gv_v3(0.01, 0.02, -0.03), gv_v3(-0.01, -0.02, 0.03), 0.012,
                              &hull[CAPSULE]);
  error += gv_hull_cylinder(&arena, here, 0.03, 0.08, &hull[CYLINDER]);
  error += gv_hull_cone(&arena, here, 0.03, 0.08, &hull[CONE]);
  error += gv_hull_ellipsoid(&arena, here, gv_v3(0.02, 0.03, 0.04), &hull[ELLIPSOID]);
  if (error)
    exit(1);
}

static void build_hulls(void) {
  static char memory[HULLS][300000];
  const int vertices[HULLS] = {
    [HULL12] = 12, [HULL21] = 21, [HULL127] = 127, [HULL250] = 250, [HULL1000] = 1000};
  build_box_hull(gv_v3(0.03, 0.02, 0.04), memory[BOX], sizeof memory[BOX], &hull[BOX]);
  build_box_hull(gv_v3(0.5, 0.6, 0.05), memory[TABLE], sizeof memory[TABLE], &hull[TABLE]);
  build_box_hull(gv_v3(0.05, 0.04, 0.0002), memory[PLATE], sizeof memory[PLATE], &hull[PLATE]);
  build_rod(memory[ROD], sizeof memory[ROD], &hull[ROD]);
  build_named_shapes(memory[CAPSULE], sizeof memory[CAPSULE]);
  for (int h = HULL12; h <= HULL1000; h++)
    build_round_hull(vertices[h], gv_v3(0.03, 0.02, 0.04), memory[h], sizeof memory[h], &hull[h]);
}

static gv_shape shape_of(int kind) {
  if (kind == LIMB)
    return gv_shape_capsule(0.015, 0.008);
  if (kind == PALM)
    return gv_shape_rounded_box(gv_v3(0.04, 0.045, 0.008), 0.005);
  return gv_shape_hull(&hull[kind]);
}

// ---- poses ----

// Shortest turn that takes the unit vector a onto b.
static gv_quat turn_onto(gv_vec3 a, gv_vec3 b) {
  gv_vec3 axis = gv_cross(a, b);
  double c = gv_dot(a, b);
  if (c < -0.999999)
    return gv_quat_axis_angle(gv_any_perpendicular(a), GV_PI);
  return gv_quat_normalize((gv_quat){1 + c, axis.x, axis.y, axis.z});
}

static gv_quat quarter_turns(void) {
  gv_quat q = gv_quat_identity();
  for (int k = 0; k < 3; k++)
    q = gv_quat_mul(gv_quat_axis_angle(gv_v3(k == 0, k == 1, k == 2), 0.5 * GV_PI * floor(draw(0, 4))), q);
  return gv_quat_normalize(q);
}

static double lattice(double span) { return 0.005 * floor(draw(-span, span) / 0.005 + 0.5); }

static gv_quat draw_small_turn(void) {
  double angle = draw(0, 1) < 0.2 ? 0 : pow(10, draw(-12, -2));
  return gv_quat_axis_angle(draw_unit(), angle);
}

// A side of a body, in its own frame: a point on it, its outward normal, and the
// direction of one of its edges.
typedef struct side {
  gv_vec3 p, n, along;
} side;

static side draw_side(const body *o) {
  const solid *s = &o->s;
  side out;
  int f = (int)draw(0, s->faces);
  int first = f < s->faces ? s->start[f] : 0;
  int sides = s->faces ? s->start[f + 1] - first : 2;
  int k = (int)draw(0, sides);
  int m = (int)draw(0, sides);
  int next = (k + 1) % sides;
  gv_vec3 p = o->own_v[s->faces ? s->corner[first + k] : k];
  gv_vec3 q = o->own_v[s->faces ? s->corner[first + next] : next];
  out.p = gv_mad(p, draw(0, 1), gv_sub(o->own_v[s->faces ? s->corner[first + m] : m], p));
  out.along = gv_normalize_or(gv_sub(q, p), gv_v3(1, 0, 0));
  out.n = s->faces ? o->own_n[f] : gv_any_perpendicular(out.along);
  return out;
}

// Side on side, half of the time edge along edge, but for a small turn.
static gv_pose draw_parallel(const body *a, const body *b) {
  side sa = draw_side(a);
  side sb = draw_side(b);
  gv_quat q = turn_onto(sa.n, gv_neg(sb.n));
  gv_vec3 along = gv_rotate(q, sa.along);
  double twist = gv_atan2(gv_dot(gv_cross(along, sb.along), sb.n), gv_dot(along, sb.along));
  q = gv_quat_mul(gv_quat_axis_angle(sb.n, draw(0, 1) < 0.5 ? twist : draw(-4, 4)), q);
  q = gv_quat_normalize(gv_quat_mul(draw_small_turn(), q));
  return (gv_pose){q, gv_sub(gv_mad(sb.p, 1e-3, sb.n), gv_rotate(q, sa.p))};
}

static void draw_poses(const body *a, const body *b, gv_pose *A, gv_pose *B) {
  double style = draw(0, 4);
  *B = (gv_pose){draw_rotation(), draw_vector(1)};
  if (style > 3.5)
    *B = gv_pose_identity();
  gv_pose T_b_a = {draw_rotation(), gv_scale(draw_unit(), draw(0, 0.12))};
  if (style > 2) {
    gv_quat q = quarter_turns();
    T_b_a.p = gv_v3(lattice(0.08), lattice(0.08), lattice(0.08));
    T_b_a.q = gv_quat_mul(draw_small_turn(), q);
  }
  if (style > 1 && style < 2)
    T_b_a = draw_parallel(a, b);
  *A = gv_pose_mul(*B, T_b_a);
}

// Move A along the normal so that the cores are as far apart as drawn: as they are, shallow, touching, deep.
static void draw_gap(const gv_shape *a, gv_pose *A, const gv_shape *b, const gv_pose *B) {
  double style = draw(0, 6);
  double size = pow(10, draw(-12, -2.5));
  double sign = draw(-1, 1) < 0 ? -1 : 1;
  if (style < 1.5)
    return;
  double gap = style < 3     ? sign * size
               : style < 3.5 ? 0
               : style < 4   ? draw(-1e-6, 1e-6)
               : style < 5   ? sign * draw(0, 0.003)
                             : -draw(0.003, 0.03);
  gv_pair_cache cold = {.corners = 0};
  gv_distance d;
  gv_distance_pair(GV_NARROW_CORE, &(gv_pair){a, A, b, B}, 1, &cold, &d);
  A->p = gv_mad(A->p, gap - d.distance - a->radius - b->radius, d.normal_world);
}

// ---- what must hold of every answer ----

typedef struct found {
  double apart, overlap, normal, wrong_cache;  // worst errors, m and rad; libccd's with a wrong cache apart
  int overlapping, too_deep;  // answers from a cold or warm cache; those off by more than 0.01 mm
  int poses, misses, not_finite, iterations, sweeps;
} found;

static void raise(double *top, double value) {
  if (!(value <= *top))
    *top = value;
}

typedef struct query {
  gv_shape a, b;
  gv_pose A, B;
  body *body_a, *body_b;
  int number;
  const char *cache;
  bool show;
} query;

static gv_vec3 in_b(const query *q, gv_vec3 p_world) { return gv_transform_inv(q->B, p_world); }

static oracle ask_oracle(const query *q, const gv_distance *d) {
  gv_vec3 on_a = in_b(q, gv_mad(d->on_a, q->a.radius, d->normal_world));
  gv_vec3 on_b = in_b(q, gv_mad(d->on_b, -q->b.radius, d->normal_world));
  return oracle_with_hint(q->body_a, q->body_b, gv_rotate_inv(q->B.q, d->normal_world), on_a, on_b);
}

static bool is_unique(const oracle *o) {
  return o->distance > 1e-6 || (o->distance < -1e-6 && o->second + o->distance > 1e-6);
}

static void check_points(const query *q, const gv_distance *d, double depth) {
  double out_a = body_outside(q->body_a, in_b(q, gv_mad(d->on_a, q->a.radius, d->normal_world)));
  double out_b = body_outside(q->body_b, in_b(q, gv_mad(d->on_b, -q->b.radius, d->normal_world)));
  const double limit = limits_of[asked].points;
  CHECK((out_a < limit && out_b < limit) || d->method == GV_DISTANCE_FACES,
        "pose %d, %s cache: points off their shapes by %g and %g at %g", q->number, q->cache, out_a, out_b,
        depth);
}

static void check_answer(const query *q, const oracle *o, const gv_distance *d, found *w) {
  double core = d->distance + q->a.radius + q->b.radius;
  double error = fabs(core - o->distance);
  double angle = gv_norm(gv_sub(gv_rotate_inv(q->B.q, d->normal_world), o->normal));
  bool finite = isfinite(d->distance) && gv_v3_finite(d->normal_world) && gv_v3_finite(d->on_a) &&
                gv_v3_finite(d->on_b);
  const limits *limit = &limits_of[asked];
  bool missed = d->method == GV_DISTANCE_BEYOND || (core > limit->apart && o->distance < 0) ||
                (core < 0 && o->distance > limit->apart);
  w->not_finite += !finite;
  w->misses += missed;
  CHECK(finite && !missed, "pose %d, %s cache: distance %g, true %g, method %d", q->number, q->cache, core,
        o->distance, (int)d->method);
  if (!finite || missed)
    return;
  bool apart = o->distance > limit->touching;
  bool wrong_cache = q->cache[0] == 'w' && q->cache[1] == 'r';
  double allowed = apart ? limit->apart : wrong_cache ? limit->overlap_wrong_cache : limit->overlap;
  w->overlapping += !apart && !wrong_cache;
  w->too_deep += !apart && !wrong_cache && error > 1e-5;
  raise(apart ? &w->apart : wrong_cache && asked == GV_NARROW_LIBCCD ? &w->wrong_cache : &w->overlap, error);
  CHECK(error <= allowed, "pose %d, %s cache: distance %.9g, true %.9g, method %d, %d iterations", q->number,
        q->cache, core, o->distance, (int)d->method, d->iterations);
  CHECK(core <= o->distance + limit->apart,
        "pose %d, %s cache: distance %.9g, true %.9g: this would not separate them", q->number, q->cache,
        core, o->distance);
  if (is_unique(o))
    raise(&w->normal, angle);
  CHECK(!is_unique(o) || angle <= limit->normal,
        "pose %d, %s cache: normal off by %g rad at %g, next best %g", q->number, q->cache, angle,
        o->distance, o->second);
  CHECK_NEAR(gv_norm(d->normal_world), 1.0, 1e-12);
  check_points(q, d, o->distance);
  w->sweeps += d->method == GV_DISTANCE_FACES;
  if (d->iterations > w->iterations)
    w->iterations = d->iterations;
  if (q->show)
    printf("  %s cache: distance %.12g, true %.12g, normal off by %.3g, method %d, %d iterations\n", q->cache,
           core, o->distance, angle, (int)d->method, d->iterations);
}

static void show_pose(const query *q) {
  const gv_pose *T[2] = {&q->A, &q->B};
  for (int k = 0; k < 2; k++)
    printf("  %c: q %a %a %a %a, p %a %a %a\n", "AB"[k], T[k]->q.w, T[k]->q.x, T[k]->q.y, T[k]->q.z,
           T[k]->p.x, T[k]->p.y, T[k]->p.z);
}

static gv_pair_cache draw_cache(void) {
  gv_pair_cache c = {.normal_world = draw_unit(),
                     .vertex_a = (uint16_t)draw(0, 60000),
                     .vertex_b = (uint16_t)draw(0, 60000),
                     .corners = (uint16_t)draw(0, 5)};
  for (int k = 0; k < 3; k++) {
    c.corner_a[k] = (uint16_t)draw(0, 9);
    c.corner_b[k] = (uint16_t)draw(0, 9);
  }
  c.overlap = (uint8_t)draw(0, 2);
  return c;
}

// Pose number i of a type is the same whatever was run before.
static query draw_query(int type, int i) {
  static body a, b;
  static int of_type = -1;
  query q = {
    .a = shape_of(pair[type][0]), .b = shape_of(pair[type][1]), .body_a = &a, .body_b = &b, .number = i};
  if (of_type != type) {
    body_init(&a, &q.a);
    body_init(&b, &q.b);
    of_type = type;
  }
  polyhedra_seed = 0x9e3779b97f4a7c15ULL * (unsigned long long)(i + 1) + (unsigned long long)type;
  for (int k = 0; k < 3; k++)
    (void)draw(0, 1);
  draw_poses(&a, &b, &q.A, &q.B);
  draw_gap(&q.a, &q.A, &q.b, &q.B);
  return q;
}

static void ask_query(query *q, found *w) {
  gv_pair_cache cache = {.corners = 0};
  gv_pair_cache wrong = draw_cache();
  gv_distance d;
  body_place(q->body_a, gv_pose_mul(gv_pose_inv(q->B), q->A));
  if (q->show)
    show_pose(q);
  gv_distance_pair(asked, &(gv_pair){&q->a, &q->A, &q->b, &q->B}, 1, &cache, &d);
  oracle o = ask_oracle(q, &d);
  q->cache = "cold";
  check_answer(q, &o, &d, w);
  gv_distance_pair(asked, &(gv_pair){&q->a, &q->A, &q->b, &q->B}, 1, &cache, &d);
  q->cache = "warm";
  check_answer(q, &o, &d, w);
  gv_distance_pair(asked, &(gv_pair){&q->a, &q->A, &q->b, &q->B},
                   fmax(0, o.distance - q->a.radius - q->b.radius) + 1e-6, &wrong, &d);
  q->cache = "wrong";
  check_answer(q, &o, &d, w);
  w->poses++;
}

static void run_pose(int type, int i, bool show, found *w) {
  query q = draw_query(type, i);
  q.show = show;
  ask_query(&q, w);
}

static int env_number(const char *name, int otherwise) {
  const char *text = getenv(name);
  return text ? atoi(text) : otherwise;
}

static void type_name(int type, char out[32]) {
  snprintf(out, 32, "%s-%s", shape_name[pair[type][0]], shape_name[pair[type][1]]);
}

static void run_type(int type) {
  char name[32];
  found w = {.poses = 0};
  int poses = env_number("GV_POSES", POSES);
  int only = env_number("GV_POSE", -1);
  if (only >= 0)
    run_pose(type, only, true, &w);
  for (int i = 0; i < poses && only < 0; i++)
    run_pose(type, i, false, &w);
  CHECK(asked == GV_NARROW_LIBCCD || w.iterations <= LIMIT_ITERATIONS, "%d iterations", w.iterations);
  type_name(type, name);
  printf("  %-18s %7d poses: off by %.1e m apart, %.1e m overlapping, %.1e rad; %d missed, %d not finite, %d "
         "iterations at most, %d sweeps\n",
         name, w.poses, w.apart, w.overlap, w.normal, w.misses, w.not_finite, w.iterations, w.sweeps);
  if (asked == GV_NARROW_LIBCCD)
    printf(
        "  %-18s %.2f %% of the overlapping deeper than 0.01 mm above the least; %.1e m with a wrong cache\n",
        "", 100.0 * w.too_deep / fmax(1, w.overlapping), w.wrong_cache);
  CHECK(100.0 * w.too_deep <= limits_of[asked].too_deep_percent * w.overlapping || w.overlapping < 1500,
        "%d of %d overlapping too deep", w.too_deep, w.overlapping);
}

static void test_accuracy_of_pairs(void) {
  for (int type = 0; type < PAIRS; type++)
    run_type(type);
}

// As many of the same poses as take some seconds.
static void test_accuracy_of_libccd(void) {
  setenv("GV_POSES", "2000", 0);
  asked = GV_NARROW_LIBCCD;
  for (int type = 0; type < PAIRS; type++)
    run_type(type);
  asked = GV_NARROW_CORE;
}

typedef struct known_pose {
  int a, b, number;
  gv_pose A, B;
} known_pose;

// Poses that a whole campaign found wrong, as they were then (the number draws the wrong cache).
static const known_pose once_wrong[] = {
  // cold; a polygon of the obstacle lost its side to rounding: 0.5 mm off
  {PLATE,
   PLATE,
   520058,
   {{0x1.bea933744c1f9p-1, -0x1.12676794dea1cp-4, -0x1.73c8b813c31ep-3, -0x1.cba9ba4c3dc6cp-2},
    {0x1.3684e6aa3f9a4p-1, -0x1.fa9a3d91c1153p-1, 0x1.6f4112b02151dp-2}},
   {{-0x1.1485c96bce5fap-2, 0x1.7d8f4afa4a071p-1, -0x1.7589feb0b228ap-2, -0x1.f43a7b78b8087p-2},
    {0x1.42bac23581c72p-1, -0x1.f8e1427a71296p-1, 0x1.53c754d7e6e5p-2}}},
  // cold; the bounds did not meet: 0.14 mm off
  {HULL1000,
   HULL1000,
   417829,
   {{-0x1.0e87e0ae38ba2p-3, -0x1.bd1f80ec00ef7p-1, -0x1.d70360d1b6cffp-5, 0x1.e404ef2a0e622p-2},
    {-0x1.69e15978849cdp-3, 0x1.98e0ef3a0659dp-2, -0x1.f158623193ce1p-8}},
   {{0x1.887e3d0826d5ap-2, -0x1.d3821f05940f1p-3, -0x1.7aa33dfec4f28p-1, -0x1.02141e4338cfep-1},
    {-0x1.6a783222b6c88p-3, 0x1.98eca46e3cfa4p-2, -0x1.d9a0551c06bp-8}}},
  // these three, wrong cache: the way along an edge was lost, points off sideways
  {BOX,
   TABLE,
   588779,
   {{-0x1.22bfd5b545c9p-1, -0x1.9ed692a0a1adep-3, 0x1.8bf66e9ee0c9ap-1, -0x1.91552751c0782p-3},
    {-0x1.a6d8925ee8fa7p+0, -0x1.89afac95a42c4p-1, -0x1.a773894b32ac3p-2}},
   {{0x1.3b298878d11bcp-2, -0x1.37e0fc608351ep-4, 0x1.4178ef0de7fbdp-1, -0x1.6bef12c9f7b1bp-1},
    {-0x1.f169be4863afep-1, -0x1.19efc0873b10ep-1, -0x1.b03ec73d8b42ap-1}}},
  {PALM,
   TABLE,
   312165,
   {{0x1.63daabc2abfa2p-2, -0x1.32072e5cfa04bp-2, -0x1.9940973c6bcb3p-1, -0x1.8debae51c7568p-2},
    {0x1.122b39eb27dbp-3, 0x1.34d9f390381b3p-1, 0x1.1ee08209f0cbep-1}},
   {{0x1.cd30874270352p-2, 0x1.3217d7c82c13p-1, -0x1.4438756877e74p-1, -0x1.932630bfca74ep-3},
    {0x1.261d68b34fd06p-1, -0x1.987f3b256e78p-7, 0x1.e043842314a68p-3}}},
  {LIMB,
   PLATE,
   919120,
   {{-0x1.bba3db702997cp-2, -0x1.aa68cd4250b1ap-1, -0x1.492e5cb3ca21p-2, -0x1.fb88cf312546ap-4},
    {-0x1.aa59b47623b48p-1, -0x1.8afd12c6fcd7ap-1, 0x1.2b01e1bbf5e7cp-2}},
   {{-0x1.b800134c564ccp-1, 0x1.012c2b4038c97p-4, -0x1.7bbf8ce4238bbp-2, 0x1.62ba9c76abaefp-2},
    {-0x1.a5991e32f55e6p-1, -0x1.663ab75eb5c94p-1, 0x1.3982586f6ae2cp-2}}},
};

static int find_type(int a, int b) {
  int type = 0;
  while (type < PAIRS - 1 && (pair[type][0] != a || pair[type][1] != b))
    type++;
  return type;
}

static void test_poses_that_were_wrong(void) {
  found w = {.poses = 0};
  for (size_t i = 0; i < sizeof once_wrong / sizeof once_wrong[0]; i++) {
    const known_pose *k = &once_wrong[i];
    query q = draw_query(find_type(k->a, k->b), k->number);
    q.A = k->A;
    q.B = k->B;
    ask_query(&q, &w);
  }
}

// ---- sliding ----

// A goes around B, turning, its cores between `low` and `high` apart (metres; negative:
// overlapping): pose at frame i.
static gv_pose slide_pose(const gv_shape *a, const gv_shape *b, const gv_pose *B, int i, double low,
                          double high) {
  double t = i * GV_PI / 1800, s, c, s2, c2, s3, c3;
  gv_sincos(t, &s, &c);
  gv_sincos(0.37 * t, &s2, &c2);
  gv_sincos(0.23 * t, &s3, &c3);
  gv_vec3 d = gv_normalize_or(gv_v3(c, s, 0.8 * s2), gv_v3(1, 0, 0));
  gv_pose T = gv_pose_mul(*B, (gv_pose){gv_quat_exp(gv_v3(s2, c3, 0.5 * c2)), gv_scale(d, 0.1)});
  gv_pair_cache cold = {.corners = 0};
  gv_distance now;
  for (int k = 0; k < 3; k++) {
    gv_distance_pair(GV_NARROW_CORE, &(gv_pair){a, &T, b, B}, 1, &cold, &now);
    T.p = gv_mad(T.p, 0.5 * (low + high) - 0.5 * (high - low) * c3 - now.distance - a->radius - b->radius,
                 now.normal_world);
  }
  return T;
}

typedef struct motion {
  gv_vec3 normal;
  double depth;
} motion;

// Depth and normal as the engine has them: of the deepest contact.
static motion contact_motion(const gv_shape *a, const gv_pose *A, const gv_shape *b, const gv_pose *B,
                             gv_pair_cache *cache, gv_distance *out) {
  gv_contact_point p[GV_MAX_PAIR_CONTACTS];
  cache->inside = 0;  // the nearest side, whichever it came from
  int count = gv_manifold_pair(GV_NARROW_CORE, &(gv_pair){a, A, b, B}, 1, cache, p, out);
  int deepest = 0;
  CHECK(count > 0, "a contact at %g m", out->distance);
  for (int k = 1; k < count; k++)
    if (p[k].depth > p[deepest].depth)
      deepest = k;
  return count ? (motion){p[deepest].normal_world, p[deepest].depth} : (motion){{0, 0, 0}, 0};
}

// From frame to frame, how much the contact moves otherwise than the true one: root mean squares.
static void run_slide(int kind_a, int kind_b, double low, double high, double *io_worst_normal,
                      double *io_worst_depth) {
  enum { FRAMES = 3000 };
  static body body_a, body_b;
  query q = {.a = shape_of(kind_a),
             .b = shape_of(kind_b),
             .B = {draw_rotation(), {0.3, 0.2, 0.1}},
             .body_a = &body_a,
             .body_b = &body_b};
  gv_pair_cache cache = {.corners = 0};
  motion last_off = {{0, 0, 0}, 0};
  double normal2 = 0;
  double depth2 = 0;
  bool follows = false;
  body_init(&body_a, &q.a);
  body_init(&body_b, &q.b);
  for (int i = 0; i < FRAMES; i++) {
    gv_distance d;
    q.A = slide_pose(&q.a, &q.b, &q.B, i, low, high);
    body_place(&body_a, gv_pose_mul(gv_pose_inv(q.B), q.A));
    motion seen = contact_motion(&q.a, &q.A, &q.b, &q.B, &cache, &d);
    oracle o = ask_oracle(&q, &d);
    motion off = {gv_sub(seen.normal, gv_rotate(q.B.q, o.normal)),
                  seen.depth + o.distance - q.a.radius - q.b.radius};
    if (follows && is_unique(&o))
      normal2 += gv_norm2(gv_sub(off.normal, last_off.normal));
    if (i > 0)
      depth2 += (off.depth - last_off.depth) * (off.depth - last_off.depth);
    follows = is_unique(&o);
    last_off = off;
  }
  raise(io_worst_normal, sqrt(normal2 / FRAMES));
  raise(io_worst_depth, sqrt(depth2 / FRAMES));
  CHECK(sqrt(normal2 / FRAMES) < 0.01 * GV_PI / 180, "%s on %s: %g rad rms", shape_name[kind_a],
        shape_name[kind_b], sqrt(normal2 / FRAMES));
  CHECK(sqrt(depth2 / FRAMES) < 1e-6, "%s on %s: %g m rms", shape_name[kind_a], shape_name[kind_b],
        sqrt(depth2 / FRAMES));
}

static void test_sliding_moves_as_the_true_contact(void) {
  const int on[] = {BOX, PLATE, ROD, HULL21, HULL127, HULL1000};
  double normal = 0;
  double depth = 0;
  for (unsigned k = 0; k < sizeof on / sizeof on[0]; k++) {
    for (int palm = 0; palm < 2; palm++) {
      int kind = palm ? PALM : LIMB;
      double radius = shape_of(kind).radius;
      run_slide(kind, on[k], 0.5 * radius, radius, &normal, &depth);  // up to half of the radius deep
      run_slide(kind, on[k], -1e-4, 1e-4, &normal, &depth);           // cores touching and letting go
      run_slide(kind, on[k], -2e-3, -1e-4, &normal, &depth);          // cores overlapping
    }
  }
  printf(
      "  frame to frame, root mean squares at worst: normal %.1e degrees, depth %.1e m off the true change\n",
      normal * 180 / GV_PI, depth);
}

// The oracle with hints, good and useless ones, against brute force over every feature and direction.
static void test_oracle_against_brute_force(void) {
  static body a, b;
  const int small[5] = {BOX, PLATE, ROD, HULL12, HULL21};
  for (int i = 0; i < 3000; i++) {
    gv_shape sa = i % 3 ? shape_of(i % 3 == 1 ? LIMB : PALM) : shape_of(small[i % 5]);
    gv_shape sb = shape_of(small[i / 5 % 5]);
    gv_pose A, B, here = gv_pose_identity();
    body_init(&a, &sa);
    body_init(&b, &sb);
    draw_poses(&a, &b, &A, &B);
    draw_gap(&sa, &A, &sb, &B);
    A = gv_pose_mul(gv_pose_inv(B), A);
    body_place(&a, A);
    oracle exact = oracle_distance(&sa, &A, &sb, &here);
    gv_pair_cache cold = {.corners = 0};
    gv_distance d;
    gv_distance_pair(GV_NARROW_CORE, &(gv_pair){&sa, &A, &sb, &here}, 1, &cold, &d);
    gv_vec3 n = i % 2 ? draw_unit() : d.normal_world;
    gv_vec3 on_a = gv_mad(d.on_a, sa.radius, n);
    gv_vec3 on_b = gv_mad(d.on_b, -sb.radius, n);
    oracle o = oracle_with_hint(&a, &b, n, on_a, on_b);
    CHECK_NEAR(o.distance, exact.distance, 1e-11);
    CHECK(!is_unique(&exact) || gv_norm(gv_sub(o.normal, exact.normal)) < 1e-6, "%d: normal off by %g at %g",
          i, gv_norm(gv_sub(o.normal, exact.normal)), exact.distance);
    CHECK(!is_unique(&exact) || is_unique(&o), "%d: next best %g, %g", i, o.second, exact.second);
  }
}

int main(int argc, char **argv) {
  char name[32];
  int wanted_type = -1;
  bool known = argc < 2;
  for (int type = PAIRS - 1; argc == 2 && type >= 0; type--) {  // those that take longest first
    type_name(type, name);
    if (strcmp(argv[1], "--list") == 0) {
      puts(name);
      known = true;
    }
    if (strcmp(argv[1], name) == 0) {
      wanted_type = type;
      known = true;
    }
  }
  if (!known || argc > 2) {
    fprintf(stderr, "test_accuracy: unknown pair type %s: see test_accuracy --list\n", argv[1]);
    return 2;
  }
  if (argc == 2 && wanted_type < 0)
    return 0;
  build_hulls();
  const char *phase = getenv("GV_NARROW");
  if (phase && strcmp(phase, "libccd") == 0)
    asked = GV_NARROW_LIBCCD;
  if (wanted_type >= 0) {
    run_type(wanted_type);
    return check_in_test ? 1 : 0;
  }
  RUN(test_oracle_against_brute_force);
  RUN(test_poses_that_were_wrong);
  RUN(test_accuracy_of_pairs);
  RUN(test_sliding_moves_as_the_true_contact);
  RUN(test_accuracy_of_libccd);
  return check_done();
}
