// SPDX-License-Identifier: BSD-3-Clause
// The picture for Drake's viewer. The viewer dies of a quaternion off unit length by 0.0008, of a radius of
// zero and of a wrong count of numbers, so these are checked in every state, a broken one among them; arrows
// against the force that they show; thinned meshes against the sphere that they stand for.
#include <string.h>

#include "daemon/tell/drake.h"
#include "daemon/tell/thin.h"
#include "support/check.h"

enum {
  RINGS = 180,
  AROUND = 190,
  SPHERE_VERTICES = 2 + (RINGS - 1) * AROUND,
  SPHERE_TRIANGLES = 2 * AROUND * (RINGS - 1)
};

static gv_drake drake;
static gv_snapshot snapshot;
static gv_vec3 vertex[8 + SPHERE_VERTICES];
static gv_triangle triangle[12 + SPHERE_TRIANGLES];
static gv_object object[2];
static gv_scene scene = {
  .object_count = 2, .object = object, .mesh_vertex = vertex, .mesh_triangle = triangle};

// A ball of 50 mm with as many triangles as the Stanford bunny.
static void make_ball(gv_vec3 *v, gv_triangle *t) {
  int n = 0;
  int k = 0;
  v[n++] = gv_v3(0, 0, 0.05);
  for (int i = 1; i < RINGS; i++)
    for (int j = 0; j < AROUND; j++) {
      const double a = GV_PI * i / RINGS;
      const double b = 2 * GV_PI * j / AROUND;
      v[n++] = gv_v3(0.05 * sin(a) * cos(b), 0.05 * sin(a) * sin(b), 0.05 * cos(a));
    }
  v[n++] = gv_v3(0, 0, -0.05);
  for (unsigned j = 0; j < AROUND; j++) {
    const unsigned next = (j + 1) % AROUND;
    const unsigned last = 1 + (RINGS - 2) * AROUND;
    t[k++] = (gv_triangle){{0, 1 + j, 1 + next}};
    for (unsigned i = 0; i + 2 < RINGS; i++) {
      const unsigned a = 1 + i * AROUND;
      t[k++] = (gv_triangle){{a + j, a + AROUND + j, a + AROUND + next}};
      t[k++] = (gv_triangle){{a + j, a + AROUND + next, a + next}};
    }
    t[k++] = (gv_triangle){{last + j, SPHERE_VERTICES - 1, last + next}};
  }
}

static void make_scene(void) {
  for (unsigned i = 0; i < 8; i++)
    vertex[i] = gv_v3(i & 1 ? 0.02 : -0.02, i & 2 ? 0.02 : -0.02, i & 4 ? 0.02 : -0.02);
  static const gv_triangle cube[12] = {{{0, 2, 1}}, {{1, 2, 3}}, {{4, 5, 6}}, {{5, 7, 6}},
                                       {{0, 1, 4}}, {{1, 5, 4}}, {{2, 6, 3}}, {{3, 6, 7}},
                                       {{0, 4, 2}}, {{2, 4, 6}}, {{1, 3, 5}}, {{3, 7, 5}}};
  memcpy(triangle, cube, sizeof cube);
  make_ball(&vertex[8], &triangle[12]);
  object[0] = (gv_object){.name = "cube", .is_static = true, .vertex_count = 8, .triangle_count = 12};
  object[1] = (gv_object){.name = "ball",
                          .vertex_first = 8,
                          .vertex_count = SPHERE_VERTICES,
                          .triangle_first = 12,
                          .triangle_count = SPHERE_TRIANGLES};
}

static void make_snapshot(int contacts) {
  snapshot = (gv_snapshot){
    .object_count = 2, .contact_count = contacts, .head_seen = true, .T_world_head = gv_pose_identity()};
  snapshot.counters.samples = 1;
  for (int i = 0; i < GV_LIMBS; i++)
    snapshot.limb[i].T_world_limb = snapshot.limb[i].T_world_driver = gv_pose_identity();
  for (int i = 0; i < 2; i++)
    snapshot.object[i].T_world_body = gv_pose_identity();
  for (int i = 0; i < contacts; i++)
    snapshot.contact[i] = (gv_contact){.limb = i % 16,
                                       .position_world = gv_v3(0.01 * i, 0, 0),
                                       .force_world = gv_v3(0.1 * i, -0.05 * i, 0.02)};
}

static const gv_drake_link *find(const char *name, const gv_pose **out_T) {
  for (int i = 0; i < drake.link_count; i++)
    if (strcmp(drake.link[i].name, name) == 0) {
      *out_T = &drake.T_world_link[i];
      return &drake.link[i];
    }
  *out_T = NULL;
  return NULL;
}

static bool unit(gv_quat q) { return fabs(sqrt(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z) - 1.0) < 1e-6; }

static void check_shape(const gv_drake_link *link) {
  const float *n = &drake.number[link->number_first];
  static const int wanted[] = {
    [GV_DRAKE_BOX] = 3, [GV_DRAKE_SPHERE] = 1, [GV_DRAKE_CYLINDER] = 2, [GV_DRAKE_CAPSULE] = 2};
  CHECK(unit(link->q_link_shape), "%s", link->name);
  if (link->type != GV_DRAKE_MESH) {
    CHECK(link->number_count == wanted[link->type], "%s: %d", link->name, link->number_count);
    for (int i = 0; i < link->number_count; i++)
      CHECK(n[i] > 1e-5f, "%s: size %g", link->name, (double)n[i]);
    return;
  }
  const int vertices = (int)n[0];
  const int triangles = (int)n[1];
  CHECK(link->number_count == 2 + 3 * vertices + 3 * triangles, "%s: %d V %d T %d", link->name,
        link->number_count, vertices, triangles);
  for (int i = 2; i < 2 + 3 * vertices; i++)
    CHECK(isfinite(n[i]) && fabsf(n[i]) < 10.0f, "%s: vertex %g", link->name, (double)n[i]);
  for (int i = 2 + 3 * vertices; i < link->number_count; i++)
    CHECK(n[i] >= 0.0f && n[i] < n[0] && n[i] == floorf(n[i]), "%s: corner %g", link->name, (double)n[i]);
}

static void check_poses(void) {
  for (int i = 0; i < drake.link_count; i++)
    CHECK(unit(drake.T_world_link[i].q) && gv_v3_finite(drake.T_world_link[i].p), "%s", drake.link[i].name);
}

static void test_every_shape_is_one_the_viewer_takes(void) {
  for (int i = 0; i < drake.link_count; i++) {
    check_shape(&drake.link[i]);
    for (int k = 0; k < i; k++)
      CHECK(strcmp(drake.link[i].name, drake.link[k].name) != 0, "twice: %s", drake.link[i].name);
  }
  CHECK(drake.number_count <= GV_DRAKE_NUMBERS, "%d", drake.number_count);
}

static void test_a_limb_is_as_large_as_in_the_engine(void) {
  const gv_hand_model hand = gv_hand_model_default(GV_RIGHT);
  const gv_pose *T;
  const gv_drake_link *link = find("hand::index_proximal", &T);
  CHECK_NEAR((double)drake.number[link->number_first], hand.radius_m[1][0], 1e-7);
  CHECK_NEAR((double)drake.number[link->number_first + 1], 2 * gv_hand_half_length(&hand, GV_LIMB_INDEX),
             1e-7);
  const gv_vec3 axis = gv_rotate(link->q_link_shape, gv_v3(0, 0, 1));  // the viewer's capsule along our bone
  CHECK(fabs(axis.x) > 1 - 1e-9, "%g %g %g", axis.x, axis.y, axis.z);
  link = find("hand::palm", &T);
  double widest = 0;
  for (int i = 0; i < (int)drake.number[link->number_first]; i++)
    widest = fmax(widest, (double)drake.number[link->number_first + 2 + 3 * i]);
  CHECK(widest <= hand.palm_half_m.x + hand.palm_radius_m &&
            widest > hand.palm_half_m.x + 0.9 * hand.palm_radius_m,
        "%g", widest);
}

static void test_a_mesh_that_fits_stays_and_a_large_one_is_thinned(void) {
  const gv_pose *T;
  const gv_drake_link *cube = find("objects::cube", &T);
  const gv_drake_link *ball = find("objects::ball", &T);
  CHECK(cube->number_count == 2 + 3 * 8 + 3 * 12, "%d", cube->number_count);
  const float *n = &drake.number[ball->number_first];
  CHECK(n[1] > 500.0f && n[1] < 4000.0f, "%g triangles", (double)n[1]);
  for (int i = 0; i < (int)n[0]; i++) {
    const double r = sqrt(
        (double)(n[2 + 3 * i] * n[2 + 3 * i] + n[3 + 3 * i] * n[3 + 3 * i] + n[4 + 3 * i] * n[4 + 3 * i]));
    CHECK(r < 0.0501 && r > 0.047, "vertex %d at %g m", i, r);
  }
}

// A link is the scene file's frame, as in GLOVED_STATE: a mesh about its centre of mass lies off it by that.
static void test_links_of_objects_are_the_frames_of_the_scene_file(void) {
  const gv_pose *T;
  const gv_hand_model hand = gv_hand_model_default(GV_RIGHT);
  make_snapshot(0);
  object[1].center_m = gv_v3(0.01, 0.02, 0.03);
  gv_drake_init(&drake, &hand, NULL, &scene);
  snapshot.object[1].T_world_body = (gv_pose){gv_quat_axis_angle(gv_v3(0, 0, 1), 0.5 * GV_PI),
                                              gv_v3(1, 2, 3)};
  gv_drake_update(&drake, &snapshot);
  const gv_drake_link *ball = find("objects::ball", &T);
  CHECK(gv_norm(gv_sub(T->p, gv_v3(1.02, 1.99, 2.97))) < 1e-12, "%g %g %g", T->p.x, T->p.y, T->p.z);
  const gv_vec3 middle = gv_transform(*T, ball->p_link_shape);
  CHECK(gv_norm(gv_sub(middle, gv_v3(1, 2, 3))) < 1e-12, "%g %g %g", middle.x, middle.y, middle.z);
  object[1].center_m = gv_v3(0, 0, 0);
  gv_drake_init(&drake, &hand, NULL, &scene);
}

static void test_no_state_breaks_a_pose(void) {
  for (int contacts = 0; contacts <= GV_MAX_CONTACTS; contacts += 16) {
    make_snapshot(contacts);
    gv_drake_update(&drake, &snapshot);
    check_poses();
  }
  make_snapshot(20);
  snapshot.limb[3].T_world_limb.q = (gv_quat){NAN, 0, 0, 0};
  snapshot.limb[4].T_world_limb.p.x = INFINITY;
  snapshot.limb[5].T_world_limb.q = (gv_quat){0, 0, 0, 0};
  snapshot.limb[6].T_world_limb.q = (gv_quat){3, 0, 4, 0};
  snapshot.object[1].T_world_body.p.z = 1e300;
  snapshot.contact[0].force_world = gv_v3(NAN, NAN, NAN);
  snapshot.contact[1].position_world.y = -INFINITY;
  snapshot.contact[2].force_world = gv_v3(0, 0, -1e-9);
  snapshot.contact[3].force_world = gv_v3(0, 0, -1e9);
  gv_drake_update(&drake, &snapshot);
  check_poses();
}

// One contact of `newtons` along n at p: the visible shafts reach from p to the tip without a gap.
static void check_arrow(double newtons, gv_vec3 n) {
  static const double shaft[GV_DRAKE_SHAFTS] = {0.02, 0.02, 0.04, 0.08};
  const gv_pose *T;
  char name[16];
  make_snapshot(1);
  snapshot.contact[0].position_world = gv_v3(0.1, 0.2, 0.3);
  snapshot.contact[0].force_world = gv_scale(n, newtons);
  gv_drake_update(&drake, &snapshot);
  find("forces::0-tip", &T);
  const double length = gv_dot(gv_sub(T->p, gv_v3(0.1, 0.2, 0.3)), n);
  const double wanted = fmax(0.008, fmin(0.168, 0.025 * newtons));
  CHECK_NEAR(length, wanted, 1e-12);
  CHECK_NEAR(gv_dot(gv_rotate(T->q, gv_v3(0, 0, 1)), n), 1.0, 1e-9);
  double end = 0;
  for (int i = 0; i < GV_DRAKE_SHAFTS; i++) {
    snprintf(name, sizeof name, "forces::0-%d", i);
    find(name, &T);
    if (T->p.z < -50)
      continue;
    const double middle = gv_dot(gv_sub(T->p, gv_v3(0.1, 0.2, 0.3)), n);
    CHECK(middle - shaft[i] / 2 <= end + 1e-12, "%g N: a gap before shaft %d", newtons, i);
    CHECK(i == 0 || middle - shaft[i] / 2 > -1e-12, "%g N: shaft %d begins %g m behind", newtons, i,
          middle - shaft[i] / 2);
    end = middle + shaft[i] / 2;
  }
  if (newtons > 0.33)
    CHECK_NEAR(end, wanted - 0.008, 1e-12);
}

static void test_arrows_are_as_long_as_the_force(void) {
  for (double newtons = 0.2; newtons < 9; newtons += 0.07)
    check_arrow(newtons, gv_v3(0.6, 0, -0.8));
  check_arrow(2, gv_v3(0, 0, -1));
  check_arrow(2, gv_v3(0, 0, 1));
}

static void test_the_strongest_contacts_are_shown(void) {
  const gv_pose *T;
  make_snapshot(100);
  gv_drake_update(&drake, &snapshot);
  for (int i = 0; i < GV_DRAKE_CONTACTS; i++) {
    char name[24];
    snprintf(name, sizeof name, "contacts::%d", i);
    find(name, &T);
    CHECK_NEAR(T->p.x, 0.01 * (99 - i), 1e-12);
  }
}

static void test_what_was_not_seen_is_not_shown(void) {
  const gv_pose *T;
  make_snapshot(0);
  snapshot.counters.samples = 0;
  snapshot.head_seen = false;
  gv_drake_update(&drake, &snapshot);
  static const char *const names[] = {"hand::palm", "glove::thumb_distal", "head::view", "contacts::0",
                                      "forces::0-tip"};
  for (int i = 0; i < 5; i++) {
    find(names[i], &T);
    CHECK(T && T->p.z < -50, "%s", names[i]);
  }
}

int main(void) {
  const gv_hand_model hand = gv_hand_model_default(GV_RIGHT);
  make_scene();
  gv_drake_init(&drake, &hand, NULL, &scene);
  RUN(test_every_shape_is_one_the_viewer_takes);
  RUN(test_a_limb_is_as_large_as_in_the_engine);
  RUN(test_a_mesh_that_fits_stays_and_a_large_one_is_thinned);
  RUN(test_links_of_objects_are_the_frames_of_the_scene_file);
  RUN(test_no_state_breaks_a_pose);
  RUN(test_arrows_are_as_long_as_the_force);
  RUN(test_the_strongest_contacts_are_shown);
  RUN(test_what_was_not_seen_is_not_shown);
  return check_done();
}
