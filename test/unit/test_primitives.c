// SPDX-License-Identifier: BSD-3-Clause
// Capsule, cylinder, cone and ellipsoid: how far what is touched lies from the true shape (closed formulas
// of the support function), signed distances against a dense sweep of the true shape's directions (Eqn 8),
// what a limb along a capsule and shapes that lie on a table feel. Mass properties: test_scene. Exact
// distances of the cores: test_accuracy.
#include <string.h>

#include "daemon/load/scene_load.h"
#include "gloved/engine.h"
#include "support/polyhedra.h"

#include "collision/manifold.h"

enum { CAPSULE, CYLINDER, CONE, ELLIPSOID, EGG, DISC, LENS, KINDS };
static const char *const kind_name[KINDS] = {"capsule", "cylinder", "cone", "ellipsoid",
                                             "egg",     "disc",     "lens"};
static const gv_vec3 half_axes[KINDS] = {[ELLIPSOID] = {0.02, 0.03, 0.05},
                                         [EGG] = {0.022, 0.022, 0.03},
                                         [DISC] = {0.04, 0.04, 0.01},
                                         [LENS] = {0.1, 0.08, 0.01}};
static const double radius = 0.03, height = 0.08;  // of cylinder and cone
static gv_hull hull[KINDS];

static void build_all(void) {
  static char memory[1 << 20];
  const gv_vec3 here = {0, 0, 0};
  gv_arena arena;
  gv_arena_init(&arena, memory, sizeof memory);
  int error = gv_hull_capsule(&arena, gv_v3(0, 0, -0.03), gv_v3(0, 0, 0.03), 0.02, &hull[CAPSULE]);
  error += gv_hull_cylinder(&arena, here, radius, height, &hull[CYLINDER]);
  error += gv_hull_cone(&arena, here, radius, height, &hull[CONE]);
  for (int k = ELLIPSOID; k < KINDS; k++)
    error += gv_hull_ellipsoid(&arena, here, half_axes[k], &hull[k]);
  if (error)
    exit(1);
}

// h(n) of the true shape, by formula.
static double true_height(int kind, gv_vec3 n) {
  const double across = sqrt(n.x * n.x + n.y * n.y);
  const gv_vec3 half = half_axes[kind];
  switch (kind) {
    case CAPSULE: return 0.03 * fabs(n.z) + 0.02;
    case CYLINDER: return radius * across + 0.5 * height * fabs(n.z);
    case CONE: return fmax(0.5 * height * n.z, radius * across - 0.5 * height * n.z);
    default:
      return sqrt(half.x * half.x * n.x * n.x + half.y * half.y * n.y * n.y + half.z * half.z * n.z * n.z);
  }
}

// What gloved/shape.h promises.
static double promised(int kind) {
  const gv_vec3 half = half_axes[kind];
  if (kind == CAPSULE)
    return 1e-15;
  if (kind == CYLINDER || kind == CONE)
    return 6.1e-4 * radius;
  return 3e-3 * fmax(half.x, fmax(half.y, half.z));
}

static gv_vec3 lattice(int i, int count) {
  double z = 1 - (2 * i + 1) / (double)count, s, c;
  gv_sincos(i * 2.399963229728653, &s, &c);
  return gv_v3(c * sqrt(1 - z * z), s * sqrt(1 - z * z), z);
}

static void test_surfaces_lie_where_the_formulas_say(void) {
  const gv_pose here = gv_pose_identity();
  for (int kind = 0; kind < KINDS; kind++) {
    const gv_shape shape = gv_shape_hull(&hull[kind]);
    double out = 0;
    double in = 0;
    uint16_t hint = 0;
    for (int i = 0; i < 200000; i++) {
      const gv_vec3 n = lattice(i, 200000);
      const double off = gv_dot(gv_support(&shape, &here, n, &hint), n) - true_height(kind, n);
      out = fmax(out, off);
      in = fmax(in, -off);
    }
    printf("  %-10s stands out of the true shape by at most %.4f mm, in by %.4f\n", kind_name[kind],
           out * 1e3, in * 1e3);
    CHECK(out <= promised(kind) && in <= promised(kind), "%s: %g out, %g in, promised %g", kind_name[kind],
          out, in, promised(kind));
  }
}

// ---- Eqn 8 over the true shape ----

typedef struct sweep {
  int kind;
  gv_shape a;
  gv_pose A, B;
} sweep;

static double overlap(const sweep *s, gv_vec3 n) {
  static uint16_t hint;
  const double low = gv_dot(gv_support(&s->a, &s->A, gv_neg(n), &hint), n);
  return true_height(s->kind, gv_rotate_inv(s->B.q, n)) + gv_dot(s->B.p, n) - low;
}

static double sweep_depth(const sweep *s) {
  gv_vec3 best = gv_v3(0, 0, 1);
  double least = HUGE_VAL;
  for (int i = 0; i < 1500; i++) {
    const double h = overlap(s, lattice(i, 1500));
    if (h < least) {
      least = h;
      best = lattice(i, 1500);
    }
  }
  for (double step = 0.05; step > 1e-7; step *= 0.97) {
    gv_vec3 n = gv_mad(best, step, draw_unit());
    n = gv_scale(n, 1 / gv_norm(n));
    const double h = overlap(s, n);
    if (h < least) {
      least = h;
      best = n;
      step /= 0.97;
    }
  }
  return least;
}

static void test_depth_against_a_sweep_of_the_true_shape(void) {
  const gv_shape limb = gv_shape_capsule(0.015, 0.008);
  const gv_shape palm = gv_shape_rounded_box(gv_v3(0.04, 0.045, 0.008), 0.005);
  for (int kind = 0; kind < KINDS; kind++) {
    const gv_shape b = gv_shape_hull(&hull[kind]);
    double off = 0;
    int deep = 0;
    for (int i = 0; i < 120; i++) {
      sweep s = {.kind = kind, .a = i % 2 ? palm : limb};
      s.A.q = draw_rotation();  // one after the other, so that every compiler draws the same poses
      s.B.q = draw_rotation();
      s.B.p = draw_vector(1);
      const double away = draw(0, 0.1);
      s.A.p = gv_mad(s.B.p, away, draw_unit());
      gv_pair_cache cache = {.corners = 0};
      gv_distance d;
      gv_distance_pair(GV_NARROW_CORE, &(gv_pair){&s.a, &s.A, &b, &s.B}, 1, &cache, &d);
      deep += d.distance < 0;
      off = fmax(off, -d.distance - sweep_depth(&s));                   // no direction has less
      off = fmax(off, fabs(overlap(&s, d.normal_world) + d.distance));  // and the answer's own has just that
    }
    printf("  %-10s %d of 120 poses overlap, depth off by at most %.4f mm\n", kind_name[kind], deep,
           off * 1e3);
    CHECK(off <= promised(kind) + 2e-7, "%s: off by %g m, promised %g", kind_name[kind], off, promised(kind));
    CHECK(deep > 20, "%d", deep);
  }
}

// ---- what they feel like ----

// A limb that lies along a capsule is held at both ends of what they share; across it in one point.
static void test_a_limb_along_a_capsule_has_two_contacts(void) {
  const gv_shape limb = gv_shape_capsule(0.015, 0.008);
  const gv_shape b = gv_shape_hull(&hull[CAPSULE]);
  const gv_pose B = {gv_quat_axis_angle(gv_v3(0, 1, 0), GV_PI / 2), {0, 0, 0}};  // along x
  for (int k = 0; k < 3; k++) {
    const double turn = k == 0 ? 0 : k == 1 ? 0.002 : GV_PI / 2;
    const gv_pose A = {gv_quat_axis_angle(gv_v3(0, 0, 1), turn), {0.02, 0, 0.0279}};
    gv_pair_cache cache = {.corners = 0};
    gv_contact_point p[GV_MAX_PAIR_CONTACTS];
    const int count = gv_manifold_pair(GV_NARROW_CORE, &(gv_pair){&limb, &A, &b, &B}, 5e-4, &cache, p, NULL);
    CHECK(count == (k == 0 ? 2 : k == 1 ? 3 : 1), "turned by %g: %d contacts", turn, count);
    for (int i = 0; i < count; i++) {
      CHECK_NEAR(p[i].depth, 1e-4, k == 1 ? 1e-7 : 1e-12);
      CHECK(p[i].normal_world.z > 0.999 && p[i].position_world.x > 0.004 && p[i].position_world.x < 0.031,
            "contact at %g", p[i].position_world.x);
    }
    if (count == 2)
      CHECK_NEAR(fabs(p[0].position_world.x - p[1].position_world.x), 0.025, 1e-4);  // 0.005 to the end, 0.03
  }
}

// Each is dropped by a millimetre, lies still after half a second, and where the formula says.
static void test_shapes_come_to_rest_on_a_table(void) {
  static const struct {
    const char *shape;
    double z, spin;
  } lying[] = {
    {"capsule = [0.02, 0.1]; rotation = [0.0, 90.0, 0.0]", 0.02, 1},
    {"cylinder = [0.03, 0.08]", 0.04, 0},
    {"cylinder = [0.03, 0.08]; rotation = [90.0, 0.0, 0.0]", 0.03, 1},
    {"cone = [0.03, 0.08]", 0.02, 0},
    {"ellipsoid = [0.03, 0.04, 0.02]", 0.02, 0},
    {"ball = 0.03", 0.03, 1},
  };
  static char text[1000], err[300], scene_memory[1 << 21];
  static _Alignas(64) char engine_memory[1 << 24];
  for (size_t i = 0; i < sizeof lying / sizeof *lying; i++) {
    gv_scene scene;
    gv_arena arena;
    gv_arena_init(&arena, scene_memory, sizeof scene_memory);
    snprintf(text, sizeof text,
             "version = 1;\nobjects = ( { name = \"t\"; static = true; box = [1.0, 1.0, 0.1]; position = "
             "[0.0, 0.0, -0.05]; },\n"
             "{ name = \"o\"; mass = 0.2; position = [0.0, 0.0, 0.2]; %s; } );\n",
             lying[i].shape);
    CHECK(gv_scene_load_text("text", text, &arena, &scene, err, sizeof err) == 0, "%s", err);
    gv_config cfg = gv_config_default();
    gv_engine *engine = gv_engine_init(engine_memory, sizeof engine_memory, &cfg, &scene);
    CHECK(engine, "no engine");
    if (!engine)
      return;
    gv_pose T = gv_engine_object_pose(engine, 1);
    T.p.z = lying[i].z + 0.001;
    gv_engine_set_object(engine, 1, T, gv_v3(0, 0, 0), gv_v3(0, 0, 0));
    for (int step = 0; step < 500; step++)
      gv_engine_step(engine, &(gv_sample){.glove_new = false}, &(gv_step_result){0});
    gv_vec3 v, w;
    gv_engine_object_velocity(engine, 1, &v, &w);
    T = gv_engine_object_pose(engine, 1);
    CHECK_NEAR(T.p.z, lying[i].z, 1e-4);
    CHECK(gv_norm(v) < 1e-3 + 0.01 * lying[i].spin && gv_norm(gv_v3(T.p.x, T.p.y, 0)) < 1e-3,
          "%s: %g m/s, %g m away", lying[i].shape, gv_norm(v), gv_norm(T.p));
    gv_engine_close(engine);
  }
}

int main(void) {
  build_all();
  RUN(test_surfaces_lie_where_the_formulas_say);
  RUN(test_depth_against_a_sweep_of_the_true_shape);
  RUN(test_a_limb_along_a_capsule_has_two_contacts);
  RUN(test_shapes_come_to_rest_on_a_table);
  return check_done();
}
