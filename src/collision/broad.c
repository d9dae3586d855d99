// SPDX-License-Identifier: BSD-3-Clause
// Broad phase. One box in the world for each limb and object that moves; where those meet, the box of the
// limb or piece is turned into the other object's frame and asked against the boxes of its pieces there,
// which never change. Everything is in a fixed order, so that contacts and with them the solver's rows are
// too. Cost: 60 instructions a pair of boxes in the world, 10 a piece. Real-time thread.
#include "collision/broad.h"

#include <assert.h>
#include <string.h>

static gv_vec3 absolute(gv_vec3 a) { return gv_v3(fabs(a.x), fabs(a.y), fabs(a.z)); }

static void join(gv_aabb *box, const gv_aabb *other) {
  const gv_vec3 a = other->min;
  const gv_vec3 b = other->max;
  box->min.x = a.x < box->min.x ? a.x : box->min.x;
  box->min.y = a.y < box->min.y ? a.y : box->min.y;
  box->min.z = a.z < box->min.z ? a.z : box->min.z;
  box->max.x = b.x > box->max.x ? b.x : box->max.x;
  box->max.y = b.y > box->max.y ? b.y : box->max.y;
  box->max.z = b.z > box->max.z ? b.z : box->max.z;
}

// The box around center +- reach, grown by `by`.
static gv_aabb make_box(gv_vec3 center, gv_vec3 reach, double by) {
  reach = gv_add(reach, gv_v3(by, by, by));
  return (gv_aabb){gv_sub(center, reach), gv_add(center, reach)};
}

_Static_assert(GV_BODIES <= UINT8_MAX && GV_MAX_PIECES <= UINT16_MAX,
               "a candidate numbers bodies in 8 and pieces in 16 bits");

// The box around a box that is turned by R and moved by p.
static gv_aabb turned_box(const gv_mat3 *R, gv_vec3 p, const gv_aabb *box, double by) {
  gv_vec3 center = gv_scale(gv_add(box->min, box->max), 0.5);
  gv_vec3 half = gv_scale(gv_sub(box->max, box->min), 0.5);
  gv_vec3 reach = gv_v3(0, 0, 0);
  reach = gv_mad(reach, half.x, absolute(gv_mat3_column(R, 0)));
  reach = gv_mad(reach, half.y, absolute(gv_mat3_column(R, 1)));
  reach = gv_mad(reach, half.z, absolute(gv_mat3_column(R, 2)));
  return make_box(gv_add(p, gv_mat3_mul(R, center)), reach, by);
}

// ---- set-up ----

static size_t pairs_of_pieces(size_t pieces) { return pieces * pieces / 2 + 1; }

bool gv_broad_alloc(gv_broad *broad, gv_arena *arena, const gv_scene *scene, int hands) {
  assert(hands >= 1 && hands <= GV_HANDS);
  const size_t n = (size_t)scene->piece_count;
  const size_t limbs = (size_t)hands * GV_LIMBS;
  gv_shape *shape = gv_arena_alloc(arena, "piece shapes", n * sizeof *shape);
  gv_aabb *box = gv_arena_alloc(arena, "piece bounds", n * sizeof *box);
  gv_pair_cache *limb = gv_arena_alloc(arena, "limb pairs", limbs * n * sizeof *limb);
  gv_pair_cache *piece = gv_arena_alloc(arena, "piece pairs", pairs_of_pieces(n) * sizeof *piece);
  if (!broad || !shape || !box || !limb || !piece)
    return false;
  broad->scene = scene;
  broad->hands = hands;
  broad->second_hand = gv_body_of_second_hand(scene->object_count);
  broad->piece_shape = shape;
  broad->piece_box = box;
  broad->limb_cache = limb;
  broad->piece_cache = piece;
  return true;
}

static int limb_count(const gv_broad *broad) { return broad->hands * GV_LIMBS; }

void gv_broad_forget(gv_broad *broad) {
  static const gv_aabb nowhere = {{HUGE_VAL, HUGE_VAL, HUGE_VAL}, {-HUGE_VAL, -HUGE_VAL, -HUGE_VAL}};
  for (int h = 0; h < GV_HANDS; h++)
    broad->hand_box[h] = nowhere;
  const size_t n = (size_t)broad->scene->piece_count;
  memset(broad->limb_cache, 0, (size_t)limb_count(broad) * n * sizeof *broad->limb_cache);
  memset(broad->piece_cache, 0, pairs_of_pieces(n) * sizeof *broad->piece_cache);
}

static gv_pair_cache *limb_cache(const gv_broad *broad, int l, int piece) {
  return &broad->limb_cache[l * broad->scene->piece_count + piece];
}

static gv_pair_cache *piece_cache(const gv_broad *broad, int i, int j) {
  const int high = i > j ? i : j;
  const int low = i > j ? j : i;
  assert(high != low);
  return &broad->piece_cache[high * (high - 1) / 2 + low];
}

void gv_broad_forget_sides(gv_broad *broad, int o) {
  const gv_object *object = &broad->scene->object[o];
  for (int i = object->piece_first; i < object->piece_first + object->piece_count; i++) {
    for (int l = 0; l < limb_count(broad); l++)
      limb_cache(broad, l, i)->inside = 0;
    for (int j = 0; j < broad->scene->piece_count; j++)
      if (j != i)
        piece_cache(broad, i, j)->inside = 0;
  }
}

static void init_piece(gv_broad *broad, int o, int i) {
  assert(i >= 0 && i < broad->scene->piece_count && o >= 0 && o < broad->scene->object_count);
  const gv_hull *hull = &broad->scene->piece[i];
  const gv_vec3 r = {hull->radius, hull->radius, hull->radius};
  broad->piece_shape[i] = gv_shape_hull(hull);
  broad->piece_box[i] = (gv_aabb){gv_sub(hull->aabb_min, r), gv_add(hull->aabb_max, r)};
  for (int v = 0; v < hull->vertex_count; v++) {
    double reach = gv_norm(hull->vertex[v]) + hull->radius;
    broad->object_reach[o] = fmax(broad->object_reach[o], reach);
  }
}

_Static_assert(GV_MAX_OBJECTS <= 64, "a bit of gv_broad.joined for each object");

static void note_joints(gv_broad *broad) {
  for (int i = 0; i < broad->scene->joint_count; i++) {
    const gv_joint *joint = &broad->scene->joint[i];
    if (joint->object_b == GV_WORLD || joint->collides)
      continue;
    broad->joined[joint->object_a] |= 1ULL << joint->object_b;
    broad->joined[joint->object_b] |= 1ULL << joint->object_a;
  }
}

void gv_broad_init(gv_broad *broad, double step_s, double contact_margin_m) {
  assert(step_s > 0.0 && contact_margin_m >= 0.0);
  broad->step_s = step_s;
  broad->contact_margin_m = contact_margin_m;
  note_joints(broad);
  for (int l = 0; l < limb_count(broad); l++) {
    const gv_shape *shape = &broad->limb_shape[l];
    broad->limb_reach[l] = gv_norm(shape->half) + shape->radius;
  }
  for (int o = 0; o < broad->scene->object_count; o++) {
    const gv_object *object = &broad->scene->object[o];
    const int first = object->piece_first;
    assert(object->piece_count >= 1);
    for (int i = first; i < first + object->piece_count; i++) {
      init_piece(broad, o, i);
      if (i == first)
        broad->body_box[o] = broad->piece_box[i];
      else
        join(&broad->body_box[o], &broad->piece_box[i]);
    }
  }
}

// ---- bounds of this step ----

// How far the surface of a body can come in one step, plus its half of the contact margin. However fast it
// is: what is not seen coming is not stopped.
static double body_margin(const gv_broad *broad, const gv_body_state *s, double reach) {
  double travel = broad->step_s * (gv_norm(s->v) + gv_norm(s->w) * reach);
  return 0.5 * broad->contact_margin_m + travel;
}

// The first column of q's matrix.
static gv_vec3 x_axis(gv_quat q) {
  gv_vec3 x;
  x.x = 1.0 - 2.0 * (q.y * q.y + q.z * q.z);
  x.y = 2.0 * (q.x * q.y + q.w * q.z);
  x.z = 2.0 * (q.x * q.z - q.w * q.y);
  return x;
}

// The body that a limb is.
static int body_of(const gv_broad *broad, int l) {
  return l < GV_LIMBS ? l : broad->second_hand + l - GV_LIMBS;
}

static void bound_limb(gv_broad *broad, int l, int body) {
  const gv_shape *shape = &broad->limb_shape[l];
  const gv_body_state *s = &broad->predicted[body];
  gv_vec3 *axis = broad->limb_axis[l];
  broad->margin[body] = body_margin(broad, s, broad->limb_reach[l]);
  axis[0] = gv_scale(x_axis(s->T.q), shape->half.x);
  gv_vec3 reach = absolute(axis[0]);
  if (shape->kind == GV_CORE_BOX) {
    const gv_mat3 R = gv_mat3_from_quat(s->T.q);
    axis[1] = gv_scale(gv_mat3_column(&R, 1), shape->half.y);
    axis[2] = gv_scale(gv_mat3_column(&R, 2), shape->half.z);
    reach = gv_add(reach, gv_add(absolute(axis[1]), absolute(axis[2])));
  }
  broad->limb_box[l] = make_box(s->T.p, reach, shape->radius + broad->margin[body]);
}

void gv_broad_bound_limbs(gv_broad *broad, int hand) {
  assert(hand >= 0 && hand < broad->hands);
  const int first = hand * GV_LIMBS;
  const int first_body = body_of(broad, first);
  for (int i = 0; i < GV_LIMBS; i++)
    bound_limb(broad, first + i, first_body + i);
  broad->hand_box[hand] = broad->limb_box[first];
  for (int l = first + 1; l < first + GV_LIMBS; l++)
    join(&broad->hand_box[hand], &broad->limb_box[l]);
}

void gv_broad_bound_object(gv_broad *broad, int o) {
  const gv_body_state *s = &broad->predicted[GV_LIMBS + o];
  double margin = body_margin(broad, s, broad->object_reach[o]);
  broad->margin[GV_LIMBS + o] = margin;
  const gv_mat3 R = gv_mat3_from_quat(s->T.q);
  broad->object_box[o] = turned_box(&R, s->T.p, &broad->body_box[o], margin);
}

static bool is_near(const gv_broad *broad, int hand, int o) {
  if (!gv_aabb_meet(&broad->hand_box[hand], &broad->object_box[o]))
    return false;
  for (int l = hand * GV_LIMBS; l < (hand + 1) * GV_LIMBS; l++)
    if (gv_aabb_meet(&broad->limb_box[l], &broad->object_box[o]))
      return true;
  return false;
}

bool gv_broad_hand_is_near(const gv_broad *broad, int o) {
  for (int h = 0; h < broad->hands; h++)
    if (is_near(broad, h, o))
      return true;
  return false;
}

// ---- pairs ----

void gv_broad_list_none(gv_broad *broad) {
  broad->pair_count = 0;
  broad->dropped = 0;
}

// The place for one more, with the number of its shapes and bodies; null where there is none.
static gv_candidate *list_pair(gv_broad *broad, int body_a, int shape_a, int body_b, int piece_b) {
  if (broad->pair_count == GV_MAX_PAIRS) {
    broad->dropped++;
    return NULL;
  }
  gv_candidate *pair = &broad->pair[broad->pair_count++];
  pair->body_a = (uint8_t)body_a;
  pair->shape_a = (uint16_t)shape_a;
  pair->body_b = (uint8_t)body_b;
  pair->piece_b = (uint16_t)piece_b;
  return pair;
}

static void list_limb_piece(gv_broad *broad, int l, int o, int piece) {
  gv_candidate *pair = list_pair(broad, body_of(broad, l), l, GV_LIMBS + o, piece);
  if (pair)
    pair->cache = limb_cache(broad, l, piece);
}

// A limb's box in an object's frame, which is turned by R, grown by both margins.
static gv_aabb limb_box_in(const gv_broad *broad, int l, int o, const gv_mat3 *R) {
  const gv_vec3 *axis = broad->limb_axis[l];
  const int body = body_of(broad, l);
  gv_vec3 reach = absolute(gv_mat3_mul_t(R, axis[0]));
  if (broad->limb_shape[l].kind == GV_CORE_BOX)
    reach = gv_add(reach, gv_add(absolute(gv_mat3_mul_t(R, axis[1])), absolute(gv_mat3_mul_t(R, axis[2]))));
  gv_vec3 p = gv_sub(broad->predicted[body].T.p, broad->predicted[GV_LIMBS + o].T.p);
  double by = broad->limb_shape[l].radius + broad->margin[body] + broad->margin[GV_LIMBS + o];
  return make_box(gv_mat3_mul_t(R, p), reach, by);
}

static void list_limb_object(gv_broad *broad, int l, int o, const gv_mat3 *R) {
  const gv_object *object = &broad->scene->object[o];
  const int first = object->piece_first;
  if (object->piece_count == 1) {  // the object's box is the piece's
    list_limb_piece(broad, l, o, first);
    return;
  }
  const gv_aabb box = limb_box_in(broad, l, o, R);
  for (int i = first; i < first + object->piece_count; i++)
    if (gv_aabb_meet(&box, &broad->piece_box[i]))
      list_limb_piece(broad, l, o, i);
}

void gv_broad_list_hand(gv_broad *broad, int hand) {
  assert(hand >= 0 && hand < broad->hands);
  for (int o = 0; o < broad->scene->object_count; o++) {
    if (!gv_aabb_meet(&broad->hand_box[hand], &broad->object_box[o]))
      continue;
    const gv_mat3 R = gv_mat3_from_quat(broad->predicted[GV_LIMBS + o].T.q);
    for (int l = hand * GV_LIMBS; l < (hand + 1) * GV_LIMBS; l++)
      if (gv_aabb_meet(&broad->limb_box[l], &broad->object_box[o]))
        list_limb_object(broad, l, o, &R);
  }
}

static void list_pieces(gv_broad *broad, int a, int i, int b, int j) {
  gv_pair_cache *cache = piece_cache(broad, i, j);
  gv_candidate *pair = list_pair(broad, GV_LIMBS + a, i, GV_LIMBS + b, j);
  if (!pair)
    return;
  // Where one of them has come to rest, the other is A now, and the normal turns round.
  if (cache->high_first != (i > j))
    cache->inside = 0;
  cache->high_first = i > j;
  pair->cache = cache;
}

// a moves; b may be static or at rest. The boxes of a's pieces come into b's frame.
static void list_two_objects(gv_broad *broad, int a, int b) {
  const gv_object *A = &broad->scene->object[a];
  const gv_object *B = &broad->scene->object[b];
  const gv_pose T_b_world = gv_pose_inv(broad->predicted[GV_LIMBS + b].T);
  const gv_pose T_b_a = gv_pose_mul(T_b_world, broad->predicted[GV_LIMBS + a].T);
  const gv_mat3 R = gv_mat3_from_quat(T_b_a.q);
  const double margin = broad->margin[GV_LIMBS + a] + broad->margin[GV_LIMBS + b];
  for (int i = A->piece_first; i < A->piece_first + A->piece_count; i++) {
    const gv_aabb box = turned_box(&R, T_b_a.p, &broad->piece_box[i], margin);
    if (!gv_aabb_meet(&box, &broad->body_box[b]))
      continue;
    for (int j = B->piece_first; j < B->piece_first + B->piece_count; j++)
      if (gv_aabb_meet(&box, &broad->piece_box[j]))
        list_pieces(broad, a, i, b, j);
  }
}

// Pairs of which one moves, each once.
void gv_broad_list_objects(gv_broad *broad, const int moving[], int moving_count) {
  bool moves[GV_MAX_OBJECTS] = {false};
  for (int k = 0; k < moving_count; k++)
    moves[moving[k]] = true;
  for (int k = 0; k < moving_count; k++) {
    const int a = moving[k];
    for (int b = 0; b < broad->scene->object_count; b++) {
      if (b == a || !gv_aabb_meet(&broad->object_box[a], &broad->object_box[b]))
        continue;
      if (broad->joined[a] >> b & 1)
        continue;
      if (b > a || !moves[b])
        list_two_objects(broad, a, b);
    }
  }
}

const gv_shape *gv_broad_shape_a(const gv_broad *broad, const gv_candidate *pair) {
  return gv_broad_is_limb(broad, pair->body_a) ? &broad->limb_shape[pair->shape_a]
                                               : &broad->piece_shape[pair->shape_a];
}
