// SPDX-License-Identifier: BSD-3-Clause
// Friction and the solver against closed solutions: the public rolling test, a pinched box that must not
// creep, and the solver's own complaints.
#include "support/check.h"
#include "gloved/narrow.h"
#include "support/lab.h"

#define G 9.81

static int lab_ball(lab *l, double radius, gv_vec3 at, double mass, double mu) {
  int i = l->scene.object_count;
  if (gv_hull_ball(&l->arena, gv_v3(0, 0, 0), radius, &l->piece[i]))
    abort();
  double inertia = 0.4 * mass * radius * radius;
  l->object[i] = (gv_object){.name = "ball",
                             .T_world_body = {{1, 0, 0, 0}, at},
                             .mass_kg = mass,
                             .inertia_kg_m2 = {{{inertia, 0, 0}, {0, inertia, 0}, {0, 0, inertia}}},
                             .mu = mu,
                             .piece_first = i,
                             .piece_count = 1};
  l->scene.object_count = l->scene.piece_count = i + 1;
  return i;
}

// leggedrobotics/SimBenchmark, "rolling": a box of 20 x 20 x 1 m and 10 kg lies on the
// ground (mu 0.4), 25 balls of
// 1 kg and radius 0.5 m lie on it 2 m apart (mu 0.8). 150 N push the box through its middle. The box slides,
// the balls roll on it without slip. With R the friction of the ground and P that of one ball:
//   R = mu (M + 25 m) g;  M a_box = F - R - 25 P;  m a_ball = P;
//   a_box - a_ball = 5/2 P / m (spin of a solid ball)
//   =>  P = (F - R) / M / (7/2 / m + 25 / M).
// Error: mean over the steps of |v - v*|^2 of the box plus that of the first ball.
static double rolling_error(gv_vec3 direction, const gv_config *cfg, int *out_quick) {
  enum { BALLS = 25, STEPS = 4000, SETTLE = 1000 };
  const double M = 10;
  const double m = 1;
  const double F = 150;
  lab l;
  lab_start(&l);
  if (cfg)
    l.cfg = *cfg;
  lab_box(&l, gv_v3(100, 100, 1), gv_v3(0, 0, -0.5), 0, 0.2);  // mean with the box: 0.4
  int box = lab_box(&l, gv_v3(20, 20, 1), gv_v3(0, 0, 0.5), M, 0.8);
  for (int i = 0; i < BALLS; i++)
    lab_ball(&l, 0.5, gv_v3(2.0 * (i / 5) - 4, 2.0 * (i % 5) - 4, 1.5), m, 0.8);
  lab_run(&l);
  double R = 0.4 * (M + BALLS * m) * G;
  double P = (F - R) / M / (3.5 / m + BALLS / M);
  double a_box = (F - R - BALLS * P) / M;
  double a_ball = P / m;
  double sum = 0;
  lab_steps(&l, SETTLE, NULL);  // sinks into the contacts' springs
  for (int i = 0; i < STEPS; i++) {
    gv_vec3 v, u, w;
    gv_engine_object_velocity(l.engine, box, &v, &w);
    gv_engine_object_velocity(l.engine, box + 1, &u, &w);
    double t = i * l.cfg.step_s;
    sum += gv_norm2(gv_sub(v, gv_scale(direction, a_box * t))) +
           gv_norm2(gv_sub(u, gv_scale(direction, a_ball * t)));
    gv_engine_push_object(l.engine, box, gv_scale(direction, F), gv_v3(0, 0, 0));
    lab_steps(&l, 1, NULL);
  }
  const gv_counters *c = gv_engine_counters(l.engine);
  CHECK(c->solver_errors == 0 && c->contacts_dropped == 0, "%llu solver errors",
        (unsigned long long)c->solver_errors);
  if (out_quick)
    *out_quick = (int)c->quickstep_steps;
  gv_engine_close(l.engine);
  return sum / STEPS;
}

static void test_rolling_balls(void) {
  double along = rolling_error(gv_v3(0, 1, 0), NULL, NULL);
  double across = rolling_error(gv_v3(0.5, 0.866025403784439, 0), NULL, NULL);
  printf("  rolling: mean squared velocity error %.3g along y, %.3g along (0.5, 0.866)\n", along, across);
  CHECK(along <= 1e-7, "along y: %g", along);
  CHECK(across <= 1e-7, "along (0.5, 0.866): %g", across);
}

// A hand of two limbs: index and little finger stretched side by side, the rest of the hand half a metre
// above. Their proximal limbs, radius 9 mm, want to be 5 mm inside a box of 0.1 kg, one from each side.
static void make_pincers(lab *l, double width) {
  gv_hand_model *h = &l->cfg.hand;
  for (int f = 0; f < GV_FINGERS; f++)
    h->base_m[f].z = 0.5;
  h->palm_center_m.z = 0.5;
  const int finger[2] = {1, 4};
  for (int i = 0; i < 2; i++) {
    double side = i ? -1 : 1;
    h->base_m[finger[i]] = gv_v3(0, side * (0.5 * width + 0.009 - 0.005), 0);
    h->segment_m[finger[i]][0] = 0.04;
    h->radius_m[finger[i]][0] = 0.009;
  }
  for (int s = 0; s < GV_SENSORS; s++) {
    h->angle_min_rad[s] = -1e-9;
    h->angle_max_rad[s] = 1e-9;
  }
}

static gv_vec3 in_the_pincers(const lab *l, int box) {
  gv_vec3 a = gv_engine_limb_pose(l->engine, GV_LIMB_INDEX).p;
  gv_vec3 b = gv_engine_limb_pose(l->engine, GV_LIMB_LITTLE).p;
  return gv_sub(gv_engine_object_pose(l->engine, box).p, gv_scale(gv_add(a, b), 0.5));
}

static void test_pinched_box_does_not_creep(void) {
  static const double straight[GV_SENSORS];
  lab l;
  lab_start(&l);
  const double width = 0.06;
  make_pincers(&l, width);
  int box = lab_box(&l, gv_v3(0.02, width, 0.03), gv_v3(0.02, 0, 0), 0.1, 0.8);
  lab_run(&l);
  gv_sample still = lab_hand(&l, straight, gv_pose_identity());
  lab_steps(&l, 1000, &still);
  gv_vec3 held = in_the_pincers(&l, box);
  gv_quat turned = gv_engine_object_pose(l.engine, box).q;
  double slip = 0;
  double tilt = 0;
  for (int i = 0; i < 9000; i++) {
    lab_steps(&l, 1, &still);
    slip = fmax(slip, gv_norm(gv_sub(in_the_pincers(&l, box), held)));
    tilt = fmax(tilt, gv_norm(gv_quat_log(
                          gv_quat_mul(gv_engine_object_pose(l.engine, box).q, gv_quat_conj(turned)))));
  }
  gv_vec3 f, t;
  gv_engine_coupling(l.engine, GV_LIMB_INDEX, &f, &t);
  printf("  pinch: slip %.3g um, tilt %.3g degrees in 9 s; each limb presses with %.3f N\n", slip * 1e6,
         tilt * 180 / GV_PI, -f.y);
  CHECK(-f.y > 0.9 && -f.y < 1.01, "the spring of 200 N/m presses 5 mm deep with %g N", -f.y);
  CHECK_NEAR(f.z, 0.5 * 0.1 * G, 1e-4);  // and carries half of the box
  CHECK(slip <= 1e-6, "slips %g m", slip);
  CHECK(tilt <= 1e-4, "tilts %g rad", tilt);
  CHECK(gv_engine_counters(l.engine)->solver_errors == 0, "%llu solver errors",
        (unsigned long long)gv_engine_counters(l.engine)->solver_errors);
  gv_engine_close(l.engine);
}

// A solid ball that rolls without slip down a slope gains 5/7 g sin; the ball of a slope too steep for its
// friction slides: g (sin - mu cos). Gravity is tilted instead of the ground.
static double ball_speed(double tangent, double mu, gv_vec3 *out_w) {
  lab l;
  lab_start(&l);
  double c = 1 / sqrt(1 + tangent * tangent);
  double s = tangent * c;
  l.scene.gravity_m_s2 = gv_v3(0.6 * G * s, 0.8 * G * s, -G * c);
  lab_box(&l, gv_v3(50, 50, 1), gv_v3(0, 0, -0.5), 0, mu);
  int ball = lab_ball(&l, 0.05, gv_v3(0, 0, 0.05), 0.2, mu);
  lab_run(&l);
  lab_steps(&l, 1000, NULL);
  gv_vec3 v;
  gv_engine_object_velocity(l.engine, ball, &v, out_w);
  CHECK(fabs(gv_engine_object_pose(l.engine, ball).p.z - 0.05) < 5e-5, "height %g",
        gv_engine_object_pose(l.engine, ball).p.z);
  gv_engine_close(l.engine);
  CHECK_NEAR(v.x * 0.8 - v.y * 0.6, 0, 1e-6);
  return v.x * 0.6 + v.y * 0.8;
}

static void test_ball_on_a_slope(void) {
  gv_vec3 w;
  double gentle = 0.2;
  double v = ball_speed(gentle, 0.8, &w);
  double rolling = 5.0 / 7 * G * gentle / sqrt(1 + gentle * gentle);
  CHECK_NEAR(v, rolling, 1e-3 * rolling);
  CHECK_NEAR(gv_norm(w), v / 0.05, 1e-3 * v / 0.05);
  double steep = 1.5;
  double mu = 0.2;
  double slide = G * (steep - mu) / sqrt(1 + steep * steep);
  v = ball_speed(steep, mu, &w);
  CHECK_NEAR(v, slide, 0.01 * slide);
}

// Balls and boxes, apart and deep, against closed forms; the cores of concentric balls have no direction.
static void test_ball_distances(void) {
  gv_arena arena;
  gv_hull small, large, box;
  const gv_vec3 corner[8] = {{-1, -1, -1}, {1, -1, -1}, {-1, 1, -1}, {1, 1, -1},
                             {-1, -1, 1},  {1, -1, 1},  {-1, 1, 1},  {1, 1, 1}};
  gv_arena_init(&arena, lab_scene_memory, sizeof lab_scene_memory);
  CHECK(!gv_hull_ball(&arena, gv_v3(0, 0, 0), 0.1, &small) &&
            !gv_hull_ball(&arena, gv_v3(0.2, 0, 0), 0.3, &large) && !gv_hull_build(&arena, corner, 8, &box),
        "cannot build");
  CHECK(gv_hull_ball(&arena, gv_v3(0, 0, 0), 0, &large) < 0 &&
            gv_hull_ball(&arena, gv_v3((double)NAN, 0, 0), 1, &large) < 0,
        "no ball at all");
  gv_mass_properties m = gv_hull_mass_properties(&large);
  CHECK_NEAR(m.volume, 4.0 / 3 * GV_PI * 0.027, 1e-15);
  CHECK_NEAR(m.center.x, 0.2, 0);
  CHECK_NEAR(m.inertia.m[1][1], 0.4 * 0.09, 1e-15);
  unsigned long long random = 7;
  for (int i = 0; i < 20000; i++) {
    gv_pose A = gv_pose_identity();
    gv_pose B = gv_pose_identity();
    A.p = gv_v3(check_uniform(&random, -1.5, 1.5), check_uniform(&random, -1.5, 1.5),
                check_uniform(&random, -1.5, 1.5));
    A.q = gv_quat_exp(gv_v3(check_uniform(&random, -2, 2), 1, 0));
    bool of_box = i % 2;
    gv_shape a = gv_shape_hull(&small);
    gv_shape b = gv_shape_hull(of_box ? &box : &large);
    gv_vec3 p = of_box ? A.p : gv_sub(A.p, gv_v3(0.2, 0, 0));
    gv_vec3 q = gv_v3(fabs(p.x) - 1, fabs(p.y) - 1, fabs(p.z) - 1);
    gv_vec3 out = gv_v3(fmax(0, q.x), fmax(0, q.y), fmax(0, q.z));
    double inside = fmin(0, fmax(q.x, fmax(q.y, q.z)));
    double exact = of_box ? gv_norm(out) + inside - 0.1 : gv_norm(p) - 0.4;
    gv_pair_cache cache = {.corners = 0};
    gv_contact_point k[GV_MAX_PAIR_CONTACTS];
    gv_distance d;
    int count = gv_manifold_pair(GV_NARROW_CORE, &(gv_pair){&a, &A, &b, &B}, 10, &cache, k, &d);
    CHECK(count == 1, "%d contacts", count);
    CHECK_NEAR(d.distance, exact, 1e-9);
    CHECK_NEAR(k[0].depth, -exact, 1e-9);
  }
  gv_pose same = gv_pose_identity();
  gv_pair_cache cache = {.corners = 0};
  gv_shape a = gv_shape_hull(&small);
  gv_distance d;
  gv_distance_pair(GV_NARROW_CORE, &(gv_pair){&a, &same, &a, &same}, 0.1, &cache, &d);
  CHECK(fabs(d.distance + 0.2) < 1e-9 && fabs(gv_norm(d.normal_world) - 1) < 1e-9, "concentric: %g",
        d.distance);
}

// Friction of a box that 6 N push over a table, from what it gains in half a second.
static double friction_force(const gv_friction_pair *pair, gv_friction of_box, double mu_box,
                             double mu_table) {
  lab l;
  lab_start(&l);
  lab_box(&l, gv_v3(20, 20, 1), gv_v3(0, 0, -0.5), 0, mu_table);
  int box = lab_box(&l, gv_v3(0.2, 0.2, 0.02), gv_v3(0, 0, 0.01), 1, mu_box);
  l.object[0].material = 2;
  l.object[box].material = 3;
  l.object[box].friction = of_box;
  if (pair) {
    l.scene.friction_pair = pair;
    l.scene.friction_pair_count = 1;
  }
  lab_run(&l);
  lab_steps(&l, 500, NULL);
  for (int i = 0; i < 500; i++) {
    gv_engine_push_object(l.engine, box, gv_v3(6 * 0.6, 6 * 0.8, 0), gv_v3(0, 0, 0));
    lab_steps(&l, 1, NULL);
  }
  gv_vec3 v, w;
  gv_engine_object_velocity(l.engine, box, &v, &w);
  gv_engine_close(l.engine);
  return 6 - (v.x * 0.6 + v.y * 0.8) / 0.5;
}

static void test_friction_models_and_pairs(void) {
  CHECK_NEAR(friction_force(NULL, GV_FRICTION_COULOMB, 0.5, 0.32), 0.4 * G, 0.02);
  // Each of the four corners holds the limit, however it is pressed; it goes before the table's coefficient.
  CHECK_NEAR(friction_force(NULL, GV_FRICTION_FIXED_LIMIT, 0.7, 0.32), 4 * 0.7, 0.02);
  const gv_friction_pair pair = {3, 2, GV_FRICTION_COULOMB, 0.1};
  const gv_friction_pair limit = {2, 3, GV_FRICTION_FIXED_LIMIT, 0.25};
  const gv_friction_pair other = {2, 4, GV_FRICTION_COULOMB, 0.1};
  CHECK_NEAR(friction_force(&pair, GV_FRICTION_FIXED_LIMIT, 0.7, 0.32), 0.1 * G, 0.02);
  CHECK_NEAR(friction_force(&limit, GV_FRICTION_COULOMB, 0.5, 0.32), 4 * 0.25, 0.02);
  CHECK_NEAR(friction_force(&other, GV_FRICTION_COULOMB, 0.5, 0.32), 0.4 * G, 0.02);
}

int main(void) {
  RUN(test_ball_distances);
  RUN(test_ball_on_a_slope);
  RUN(test_friction_models_and_pairs);
  RUN(test_rolling_balls);
  RUN(test_pinched_box_does_not_creep);
  return check_done();
}
