// SPDX-License-Identifier: BSD-3-Clause
// From poses to contacts: boxes of limbs and objects in the world, where they meet those of limbs and pieces in the
// object's own frame, made once (broad phase), manifolds of the pairs whose boxes meet (narrow phase), and for each point its friction, its direction of predicted slip and its place in the
// list. Gaps that may close within the step count too: the solver lets them close, not overshoot, so a
// limb stops on the surface and not a step's travel inside. Real-time thread.
#include "engine/engine_state.h"

typedef struct rub { gv_friction friction; double mu; int material; } rub;

typedef struct touching {
  int body_a, body_b;          // dynamics numbering
  const gv_shape *shape_a, *shape_b;
  double margin;
  rub rub;
  gv_pair_cache *cache;
} touching;

static bool boxes_meet(const gv_aabb *a, const gv_aabb *b) {
  return a->min.x <= b->max.x && b->min.x <= a->max.x && a->min.y <= b->max.y && b->min.y <= a->max.y &&
         a->min.z <= b->max.z && b->min.z <= a->max.z;
}

// How far the surface of a body can come in one step, plus its half of the contact margin.
static double body_margin(const gv_engine *e, const gv_body_state *s, double reach) {
  double travel = e->cfg.step_s * (gv_norm(s->v) + gv_norm(s->w) * reach);
  return 0.5 * e->cfg.contact_margin_m + (travel < 0.02 ? travel : 0.02);
}

static gv_vec3 absolute(gv_vec3 a) { return gv_v3(fabs(a.x), fabs(a.y), fabs(a.z)); }

// The box around center +- reach, grown by `by`.
static gv_aabb make_box(gv_vec3 center, gv_vec3 reach, double by) {
  reach = gv_add(reach, gv_v3(by, by, by));
  return (gv_aabb){gv_sub(center, reach), gv_add(center, reach)};
}

// The box around a box that is turned by R and moved by p.
static gv_aabb turned_box(const gv_mat3 *R, gv_vec3 p, const gv_aabb *box, double by) {
  gv_vec3 center = gv_scale(gv_add(box->min, box->max), 0.5), half = gv_scale(gv_sub(box->max, box->min), 0.5), reach = gv_v3(0, 0, 0);
  reach = gv_mad(reach, half.x, absolute(gv_mat3_column(R, 0)));
  reach = gv_mad(reach, half.y, absolute(gv_mat3_column(R, 1)));
  reach = gv_mad(reach, half.z, absolute(gv_mat3_column(R, 2)));
  return make_box(gv_add(p, gv_mat3_mul(R, center)), reach, by);
}

// The first column of q's matrix.
static gv_vec3 x_axis(gv_quat q) {
  return gv_v3(1.0 - 2.0 * (q.y * q.y + q.z * q.z), 2.0 * (q.x * q.y + q.w * q.z), 2.0 * (q.x * q.z - q.w * q.y));
}

static void bound_limb(gv_engine *e, int i) {
  const gv_shape *shape = &e->limb_shape[i];
  gv_body_state *s = &e->predicted[i];
  gv_vec3 *axis = e->limb_axis[i];
  gv_dynamics_predict(e->dyn, i, s);
  e->margin[i] = body_margin(e, s, e->limb_reach[i]);
  axis[0] = gv_scale(x_axis(s->T.q), shape->half.x);
  gv_vec3 reach = absolute(axis[0]);
  if (i == GV_LIMB_PALM) {
    const gv_mat3 R = gv_mat3_from_quat(s->T.q);
    axis[1] = gv_scale(gv_mat3_column(&R, 1), shape->half.y);
    axis[2] = gv_scale(gv_mat3_column(&R, 2), shape->half.z);
    reach = gv_add(reach, gv_add(absolute(axis[1]), absolute(axis[2])));
  }
  e->limb_box[i] = make_box(s->T.p, reach, shape->radius + e->margin[i]);
}

static void bound_limbs(gv_engine *e) {
  for (int i = 0; i < GV_LIMBS; i++) bound_limb(e, i);
  e->hand_box = e->limb_box[0];
  for (int i = 1; i < GV_LIMBS; i++) gv_aabb_join(&e->hand_box, &e->limb_box[i]);
}

// A limb's box in an object's frame, which is turned by R, grown by both margins.
static gv_aabb limb_box_in(const gv_engine *e, int limb, int o, const gv_mat3 *R) {
  const gv_vec3 *axis = e->limb_axis[limb];
  gv_vec3 reach = absolute(gv_mat3_mul_t(R, axis[0]));
  if (limb == GV_LIMB_PALM) reach = gv_add(reach, gv_add(absolute(gv_mat3_mul_t(R, axis[1])), absolute(gv_mat3_mul_t(R, axis[2]))));
  gv_vec3 p = gv_sub(e->predicted[limb].T.p, e->predicted[GV_LIMBS + o].T.p);
  return make_box(gv_mat3_mul_t(R, p), reach, e->limb_shape[limb].radius + e->margin[limb] + e->margin[GV_LIMBS + o]);
}

static void bound_object(gv_engine *e, int o) {
  gv_body_state *s = &e->predicted[GV_LIMBS + o];
  gv_dynamics_predict(e->dyn, GV_LIMBS + o, s);
  e->margin[GV_LIMBS + o] = body_margin(e, s, e->object_reach[o]);
  const gv_mat3 R = gv_mat3_from_quat(s->T.q);
  e->object_box[o] = turned_box(&R, s->T.p, &e->body_box[o], e->margin[GV_LIMBS + o]);
}

// Velocity of a body's point after the step without contacts.
static gv_vec3 point_velocity(const gv_body_state *s, gv_vec3 p) { return gv_add(s->v, gv_cross(s->w, gv_sub(p, s->T.p))); }

// The place for one more contact, or -1 where the list is full of deeper ones.
static int contact_slot(gv_engine *e, double depth) {
  if (e->contact_count < GV_MAX_CONTACTS) return e->contact_count++;
  e->events |= GV_EVENT_CONTACTS_DROPPED;
  e->counters.contacts_dropped++;
  int shallow = 0;
  for (int i = 1; i < GV_MAX_CONTACTS; i++)
    if (e->contact[i].depth_m < e->contact[shallow].depth_m) shallow = i;
  return depth > e->contact[shallow].depth_m ? shallow : -1;
}

// The friction pyramid is exact along its first direction: it lies along the coming slip.
static gv_vec3 friction_dir(gv_vec3 slip, gv_vec3 normal) {
  double n = gv_norm(slip);
  return n > 1e-6 ? gv_scale(slip, 1.0 / n) : gv_any_perpendicular(normal);
}

static void add_contact(gv_engine *e, const touching *p, const gv_contact_point *k, const gv_body_state *a, const gv_body_state *b) {
  const gv_vec3 x = k->position_world, n = k->normal_world, v = gv_sub(point_velocity(a, x), point_velocity(b, x));
  const double approach = -gv_dot(v, n), closing = approach > 0.0 ? approach : 0.0;
  if (-k->depth > 0.5 * e->cfg.contact_margin_m + e->cfg.step_s * closing) return;
  const int i = contact_slot(e, k->depth);
  if (i < 0) return;
  gv_contact *told = &e->contact[i];
  told->limb = p->body_a < GV_LIMBS ? p->body_a : -1 - (p->body_a - GV_LIMBS);
  told->object = p->body_b - GV_LIMBS;
  told->piece = (int)(p->shape_b - e->piece_shape);
  told->position_world = x;
  told->normal_world = n;
  told->depth_m = k->depth;
  told->face = k->face_b;
  gv_dynamics_contact *solved = &e->solver_contact[i];
  solved->body_a = p->body_a;
  solved->body_b = p->body_b;
  solved->position = x;
  solved->normal = n;
  solved->friction_dir = friction_dir(gv_mad(v, approach, n), n);
  solved->depth = k->depth;
  solved->friction = p->rub.friction;
  solved->mu = p->rub.mu;
  if (k->depth > e->counters.depth_max_m) e->counters.depth_max_m = k->depth;
}

static void collide_pair(gv_engine *e, const touching *p) {
  if (++e->pair_count > GV_MAX_PAIRS) {
    e->events |= GV_EVENT_PAIRS_DROPPED;
    e->counters.pairs_dropped++;
    return;
  }
  gv_contact_point point[GV_MAX_PAIR_CONTACTS];
  gv_distance distance;
  const gv_body_state *a = &e->predicted[p->body_a], *b = &e->predicted[p->body_b];
  const gv_pair pair = {p->shape_a, &a->T, p->shape_b, &b->T};
  int count = gv_manifold_pair(e->cfg.narrow, &pair, p->margin, p->cache, point, &distance);
  if (gv_distance_overlaps(&distance) && p->body_a < GV_LIMBS) {
    e->events |= GV_EVENT_OVERLAP;
    e->counters.overlaps++;
  }
  for (int i = 0; i < count; i++) add_contact(e, p, &point[i], a, b);
}

static rub rub_of_hand(const gv_engine *e) { return (rub){e->cfg.friction, e->cfg.mu_hand, GV_MATERIAL_HAND}; }
static rub rub_of_object(const gv_object *o) { return (rub){o->friction, o->mu, o->material}; }

// Friction of two bodies: the preset's, what the scene says of the two materials, or the mean of both.
static rub rub_between(const gv_engine *e, rub a, rub b) {
  if (e->cfg.override_mu > 0.0) return (rub){e->cfg.friction, e->cfg.override_mu, GV_MATERIAL_NONE};
  for (int i = 0; i < e->scene->friction_pair_count && a.material && b.material; i++) {
    const gv_friction_pair *p = &e->scene->friction_pair[i];
    if ((p->material_a == a.material && p->material_b == b.material) || (p->material_a == b.material && p->material_b == a.material))
      return (rub){p->friction, p->mu, GV_MATERIAL_NONE};
  }
  if (a.friction != b.friction) return a.friction == GV_FRICTION_FIXED_LIMIT ? a : b;
  return (rub){a.friction, sqrt(a.mu * b.mu), GV_MATERIAL_NONE};
}

static void collide_limb_piece(gv_engine *e, int limb, int o, int piece, rub rubbing) {
  collide_pair(e, &(touching){limb, GV_LIMBS + o, &e->limb_shape[limb], &e->piece_shape[piece], e->margin[limb] + e->margin[GV_LIMBS + o],
                          rubbing, &e->limb_cache[limb * e->scene->piece_count + piece]});
}

static void collide_limb(gv_engine *e, int limb, int o, const gv_mat3 *R, rub rubbing) {
  const int first = e->scene->object[o].piece_first, count = e->scene->object[o].piece_count;
  const gv_aabb box = limb_box_in(e, limb, o, R), *of_piece = &e->piece_box[first];
  for (int i = 0; i < count; i++)
    if (boxes_meet(&box, &of_piece[i])) collide_limb_piece(e, limb, o, first + i, rubbing);
}

static void collide_hand_object(gv_engine *e, int o) {
  const gv_object *object = &e->scene->object[o];
  const rub rubbing = rub_between(e, rub_of_hand(e), rub_of_object(object));
  const gv_mat3 R = gv_mat3_from_quat(e->predicted[GV_LIMBS + o].T.q);
  for (int i = 0; i < GV_LIMBS; i++) {
    if (!boxes_meet(&e->limb_box[i], &e->object_box[o])) continue;
    if (object->piece_count > 1) collide_limb(e, i, o, &R, rubbing);
    else collide_limb_piece(e, i, o, object->piece_first, rubbing);  // the object's box is the piece's
  }
}

static void collide_hand(gv_engine *e) {
  for (int o = 0; o < e->scene->object_count; o++)
    if (boxes_meet(&e->hand_box, &e->object_box[o])) collide_hand_object(e, o);
}

// a moves; b may be static or at rest. The boxes of a's pieces come into b's frame.
static void collide_objects(gv_engine *e, int a, int b) {
  const gv_object *A = &e->scene->object[a], *B = &e->scene->object[b];
  const gv_pose T_b_a = gv_pose_mul(gv_pose_inv(e->predicted[GV_LIMBS + b].T), e->predicted[GV_LIMBS + a].T);
  const gv_mat3 R = gv_mat3_from_quat(T_b_a.q);
  const double margin = e->margin[GV_LIMBS + a] + e->margin[GV_LIMBS + b];
  rub rubbing = rub_between(e, rub_of_object(A), rub_of_object(B));
  for (int i = A->piece_first; i < A->piece_first + A->piece_count; i++) {
    const gv_aabb box = turned_box(&R, T_b_a.p, &e->piece_box[i], margin);
    if (!boxes_meet(&box, &e->body_box[b])) continue;
    for (int j = B->piece_first; j < B->piece_first + B->piece_count; j++) {
      if (!boxes_meet(&box, &e->piece_box[j])) continue;
      int high = i > j ? i : j, low = i > j ? j : i;
      collide_pair(e, &(touching){GV_LIMBS + a, GV_LIMBS + b, &e->piece_shape[i], &e->piece_shape[j], margin, rubbing,
                              &e->piece_cache[high * (high - 1) / 2 + low]});
    }
  }
}

static bool is_moving(const gv_engine *e, int o) { return !e->scene->object[o].is_static && !e->resting[o]; }

static void list_moving(gv_engine *e) {
  e->moving_count = 0;
  for (int o = 0; o < e->scene->object_count; o++)
    if (is_moving(e, o)) e->moving[e->moving_count++] = o;
}

static void bound_objects(gv_engine *e) {
  for (int i = 0; i < e->moving_count; i++) bound_object(e, e->moving[i]);
  for (int o = 0; o < e->scene->object_count && e->counters.steps == 0; o++) bound_object(e, o);
}

// ---- objects at rest ------------------------------------------------------------------------------

// Slower than this all the time, a body is held still by what it lies on (or by nothing, without gravity).
static const double still_m_s = 1e-4;

void gv_engine_wake_object(gv_engine *e, int o) {
  e->still_steps[o] = 0;
  if (!e->resting[o]) return;
  e->resting[o] = false;
  gv_dynamics_set_rest(e->dyn, GV_LIMBS + o, false);
}

static bool hand_is_near(const gv_engine *e, int o) {
  if (!e->placed || !boxes_meet(&e->hand_box, &e->object_box[o])) return false;
  for (int i = 0; i < GV_LIMBS; i++)
    if (boxes_meet(&e->limb_box[i], &e->object_box[o])) return true;
  return false;
}

// Something that moves has come near.
static bool is_disturbed(const gv_engine *e, int o) {
  if (hand_is_near(e, o)) return true;
  for (int i = 0; i < e->moving_count; i++)
    if (boxes_meet(&e->object_box[e->moving[i]], &e->object_box[o]) && e->still_steps[e->moving[i]] == 0) return true;
  return false;
}

// One that wakes disturbs those behind it in the same step, the others in the next.
static void wake_objects(gv_engine *e) {
  const int count = e->moving_count;
  for (int o = 0; o < e->scene->object_count; o++) {
    if (!e->resting[o] || !is_disturbed(e, o)) continue;
    gv_engine_wake_object(e, o);
    bound_object(e, o);
    e->moving[e->moving_count++] = o;
  }
  if (e->moving_count > count) list_moving(e);
}

void gv_engine_put_to_rest(gv_engine *e) {
  const int enough = (int)(e->cfg.rest_s / e->cfg.step_s);
  for (int i = 0; i < e->moving_count; i++) {
    const int o = e->moving[i];
    const gv_body_state *s = gv_dynamics_state(e->dyn, GV_LIMBS + o);
    bool still = gv_norm(s->v) + gv_norm(s->w) * e->object_reach[o] < still_m_s;
    e->still_steps[o] = still ? e->still_steps[o] + 1 : 0;
    if (e->cfg.rest_s <= 0.0 || e->still_steps[o] < enough || hand_is_near(e, o)) continue;
    e->resting[o] = true;
    gv_dynamics_set_rest(e->dyn, GV_LIMBS + o, true);
  }
}

// ---- all together ---------------------------------------------------------------------------------

// Pairs of which one moves, each once.
static void collide_moving(gv_engine *e, int a) {
  for (int b = 0; b < e->scene->object_count; b++)
    if (b != a && boxes_meet(&e->object_box[a], &e->object_box[b]) && (b > a || !is_moving(e, b))) collide_objects(e, a, b);
}

void gv_engine_collide(gv_engine *e) {
  e->contact_count = e->pair_count = 0;
  list_moving(e);
  if (e->placed) bound_limbs(e);
  bound_objects(e);
  wake_objects(e);
  if (e->placed) collide_hand(e);
  for (int i = 0; i < e->moving_count; i++) collide_moving(e, e->moving[i]);
  if ((uint32_t)e->pair_count > e->counters.pairs_max) e->counters.pairs_max = (uint32_t)e->pair_count;
  if ((uint32_t)e->contact_count > e->counters.contacts_max) e->counters.contacts_max = (uint32_t)e->contact_count;
}
