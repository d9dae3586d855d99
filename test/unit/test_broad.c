// SPDX-License-Identifier: BSD-3-Clause
// Broad phase: compounds tumble through a hand and through each other, and every pair of pieces that touches
// is found: the same poses without any boxes, each pair asked for its distance.
#include "engine/engine_state.h"
#include "support/check.h"
#include "support/lab.h"

enum { OBJECTS = 3, PIECES = 6 };  // of each; the last object is static

static gv_object object[OBJECTS];
static gv_hull piece[OBJECTS * PIECES];

static gv_vec3 random_vector(unsigned long long *r, double most) {
  return gv_v3(check_uniform(r, -most, most), check_uniform(r, -most, most), check_uniform(r, -most, most));
}

// Splinters of 10 to 60 mm around the object's middle, every third a ball.
static void make_pieces(unsigned long long *r, gv_arena *arena) {
  for (int i = 0; i < OBJECTS * PIECES; i++) {
    gv_vec3 corner[12], middle = random_vector(r, 0.06);
    for (int k = 0; k < 12; k++)
      corner[k] = gv_add(middle, random_vector(r, check_uniform(r, 0.005, 0.03)));
    if (i % 3 ? gv_hull_build(arena, corner, 12, &piece[i]) : gv_hull_ball(arena, middle, 0.01, &piece[i]))
      abort();
  }
}

static gv_pose random_pose(unsigned long long *r) {
  return (gv_pose){gv_quat_exp(random_vector(r, 1.8)), gv_add(gv_v3(0.08, 0, 0.05), random_vector(r, 0.12))};
}

static gv_scene make_scene(unsigned long long *r, gv_arena *arena) {
  make_pieces(r, arena);
  for (int o = 0; o < OBJECTS; o++)
    object[o] = (gv_object){.name = "splinters",
                            .is_static = o == OBJECTS - 1,
                            .T_world_body = random_pose(r),
                            .mass_kg = 0.2,
                            .inertia_kg_m2 = {{{1e-4, 0, 0}, {0, 1e-4, 0}, {0, 0, 1e-4}}},
                            .mu = 0.5,
                            .piece_first = o * PIECES,
                            .piece_count = PIECES};
  return (gv_scene){
    .object_count = OBJECTS, .piece_count = OBJECTS * PIECES, .object = object, .piece = piece};
}

static bool touch(const gv_engine *e, const gv_shape *a, int body_a, const gv_shape *b, int body_b) {
  gv_pair_cache cold = {.corners = 0};
  gv_distance d;
  const double near = 0.49 * e->cfg.contact_margin_m;
  gv_distance_pair(GV_NARROW_CORE,
                   &(gv_pair){a, &e->broad.predicted[body_a].T, b, &e->broad.predicted[body_b].T}, near,
                   &cold, &d);
  return d.distance < near;
}

static bool is_told(const gv_engine *e, int limb, int piece_b) {
  for (int i = 0; i < e->contact_count; i++)
    if (e->contact[i].limb == limb && e->contact[i].piece == piece_b)
      return true;
  return false;
}

// Returns the touching pairs of limbs and pieces, and checks that each has a contact.
static int check_limbs(const gv_engine *e, int step) {
  int found = 0;
  for (int l = 0; l < GV_LIMBS; l++)
    for (int p = 0; p < OBJECTS * PIECES; p++) {
      if (!touch(e, &e->broad.limb_shape[l], l, &e->broad.piece_shape[p], GV_LIMBS + p / PIECES))
        continue;
      CHECK(is_told(e, l, p), "step %d: limb %d touches piece %d", step, l, p);
      found++;
    }
  return found;
}

static int check_pieces(const gv_engine *e, int step) {
  int found = 0;
  for (int p = 0; p < (OBJECTS - 1) * PIECES; p++)
    for (int q = (p / PIECES + 1) * PIECES; q < OBJECTS * PIECES; q++) {
      if (!touch(e, &e->broad.piece_shape[p], GV_LIMBS + p / PIECES, &e->broad.piece_shape[q],
                 GV_LIMBS + q / PIECES))
        continue;
      CHECK(is_told(e, -1 - p / PIECES, q), "step %d: pieces %d and %d touch", step, p, q);
      found++;
    }
  return found;
}

static void test_no_touching_pair_is_missed(void) {
  static const double bent[GV_SENSORS] = {0.3, 0.2, 0.4, 0.5, 0.9, 0.7, 0.3, 0.2, 0.8, 1.2,
                                          0.1, 0.5, 0.5, 0.5, 0.1, 0.7, 0.2, 0.1, 0.1, 0.2};
  unsigned long long r = 5;
  lab l;
  lab_start(&l);
  l.scene = make_scene(&r, &l.arena);
  lab_run(&l);
  gv_sample hand = lab_hand(&l, bent, (gv_pose){gv_quat_exp(gv_v3(0.3, -0.4, 0.8)), {0, 0, 0}});
  int limbs = 0;
  int pieces = 0;
  for (int step = 0; step < 6000; step++) {
    for (int o = 0; o < OBJECTS - 1; o++)
      gv_engine_set_object(l.engine, o, random_pose(&r), random_vector(&r, 0.5), random_vector(&r, 5));
    lab_steps(&l, 1, &hand);
    CHECK(l.engine->contact_count < GV_MAX_CONTACTS, "room for all contacts");
    limbs += check_limbs(l.engine, step);
    pieces += check_pieces(l.engine, step);
  }
  CHECK(limbs > 2000 && pieces > 2000, "only %d and %d touching pairs", limbs, pieces);
  gv_engine_close(l.engine);
}

int main(void) {
  RUN(test_no_touching_pair_is_missed);
  return check_done();
}
