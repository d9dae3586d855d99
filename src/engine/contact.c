// SPDX-License-Identifier: BSD-3-Clause
// From pairs to contacts: the pairs that the broad phase lists (collision/broad.h) are asked within the
// step's budget (collision/queue.h), and each point of their manifolds gets its friction, its direction of
// predicted slip and its place in the list. Gaps that may close within the step count too: the solver lets
// them close, not overshoot, so a limb stops on the surface and not a step's travel inside. Real-time thread.
#include <assert.h>
#include <limits.h>

#include "engine/engine_state.h"

typedef struct rub {
  gv_friction friction;
  double mu;
  int material;
} rub;

// Velocity of a body's point after the step without contacts.
static gv_vec3 point_velocity(const gv_body_state *s, gv_vec3 p) {
  return gv_add(s->v, gv_cross(s->w, gv_sub(p, s->T.p)));
}

static int find_shallowest(const gv_engine *e) {
  int shallow = 0;
  for (int i = 1; i < e->effort.contacts_max; i++)
    if (e->contact[i].depth_m < e->contact[shallow].depth_m)
      shallow = i;
  return shallow;
}

// The place for one more contact, or -1 where the list is full of deeper ones. The shallowest is looked for
// only once between two that take its place: most of a crowd's contacts are shallower still.
static int contact_slot(gv_engine *e, double depth) {
  if (e->contact_count < e->effort.contacts_max)
    return e->contact_count++;
  e->events |= GV_EVENT_CONTACTS_DROPPED;
  e->counters.contacts_dropped++;
  if (e->shallowest < 0)
    e->shallowest = find_shallowest(e);
  const int slot = e->shallowest;
  if (depth <= e->contact[slot].depth_m)
    return -1;
  e->shallowest = -1;
  return slot;
}

// The first tangent lies along the coming slip: there a friction pyramid (quickstep's) is exact.
static gv_vec3 friction_dir(gv_vec3 slip, gv_vec3 normal) {
  double n = gv_norm(slip);
  return n > 1e-6 ? gv_scale(slip, 1.0 / n) : gv_any_perpendicular(normal);
}

// As gv_contact.limb has it.
static int told_number(const gv_engine *e, int body) {
  if (body < GV_LIMBS)
    return body;
  const int of_second = body - e->broad.second_hand;
  return of_second >= 0 ? GV_LIMBS + of_second : -1 - (body - GV_LIMBS);
}

static void add_contact(gv_engine *e, const gv_candidate *pair, const rub *rubbing,
                        const gv_contact_point *k) {
  const gv_body_state *a = &e->broad.predicted[pair->body_a];
  const gv_body_state *b = &e->broad.predicted[pair->body_b];
  const gv_vec3 x = k->position_world;
  const gv_vec3 n = k->normal_world;
  const gv_vec3 v = gv_sub(point_velocity(a, x), point_velocity(b, x));
  const double approach = -gv_dot(v, n);
  const double closing = approach > 0.0 ? approach : 0.0;
  if (-k->depth > 0.5 * e->cfg.contact_margin_m + e->cfg.step_s * closing)
    return;
  const int i = contact_slot(e, k->depth);
  if (i < 0)
    return;
  assert(i < GV_MAX_CONTACTS);
  gv_contact *told = &e->contact[i];
  told->limb = told_number(e, pair->body_a);
  told->object = pair->body_b - GV_LIMBS;
  told->piece = pair->piece_b;
  told->position_world = x;
  told->normal_world = n;
  told->depth_m = k->depth;
  told->face = k->face_b;
  gv_dynamics_contact *solved = &e->solver_contact[i];
  solved->body_a = pair->body_a;
  solved->body_b = pair->body_b;
  solved->position = x;
  solved->normal = n;
  solved->friction_dir = friction_dir(gv_mad(v, approach, n), n);
  solved->depth = k->depth;
  solved->friction = rubbing->friction;
  solved->mu = rubbing->mu;
  solved->patch = gv_broad_is_limb(&e->broad, pair->body_a) ? e->cfg.patch_m : 0.0;
  if (k->depth > e->counters.depth_max_m)
    e->counters.depth_max_m = k->depth;
}

static rub rub_of_hand(const gv_engine *e) {
  return (rub){e->cfg.friction, e->cfg.mu_hand, GV_MATERIAL_HAND};
}
static rub rub_of_object(const gv_object *o) { return (rub){o->friction, o->mu, o->material}; }

// Friction of two bodies: the preset's, what the scene says of the two materials, or the mean of both.
static rub rub_between(const gv_engine *e, rub a, rub b) {
  if (e->cfg.override_mu > 0.0)
    return (rub){e->cfg.friction, e->cfg.override_mu, GV_MATERIAL_NONE};
  for (int i = 0; i < e->scene->friction_pair_count && a.material && b.material; i++) {
    const gv_friction_pair *p = &e->scene->friction_pair[i];
    const bool fits = p->material_a == a.material && p->material_b == b.material;
    const bool fits_turned = p->material_a == b.material && p->material_b == a.material;
    if (fits || fits_turned)
      return (rub){p->friction, p->mu, GV_MATERIAL_NONE};
  }
  if (a.friction != b.friction)
    return a.friction == GV_FRICTION_FIXED_LIMIT ? a : b;
  return (rub){a.friction, sqrt(a.mu * b.mu), GV_MATERIAL_NONE};
}

static rub rub_of_body(const gv_engine *e, int body) {
  return gv_broad_is_limb(&e->broad, body) ? rub_of_hand(e)
                                           : rub_of_object(&e->scene->object[body - GV_LIMBS]);
}

static void collide_pair(gv_engine *e, const gv_candidate *pair, gv_distance *out_distance) {
  const gv_broad *broad = &e->broad;
  const gv_body_state *a = &broad->predicted[pair->body_a];
  const gv_body_state *b = &broad->predicted[pair->body_b];
  const gv_pair shapes = {gv_broad_shape_a(broad, pair), &a->T, &broad->piece_shape[pair->piece_b], &b->T};
  const double margin = broad->margin[pair->body_a] + broad->margin[pair->body_b];
  gv_contact_point point[GV_MAX_PAIR_CONTACTS];
  const int count = gv_manifold_pair(e->cfg.narrow, &shapes, margin, pair->cache, point, out_distance);
  if (gv_distance_overlaps(out_distance) && gv_broad_is_limb(broad, pair->body_a)) {
    e->events |= GV_EVENT_OVERLAP;
    e->counters.overlaps++;
  }
  if (count == 0)
    return;
  const rub rubbing = rub_between(e, rub_of_body(e, pair->body_a), rub_of_body(e, pair->body_b));
  for (int i = 0; i < count; i++)
    add_contact(e, pair, &rubbing, &point[i]);
}

static void tell_left_over(gv_engine *e, int left_over) {
  e->counters.pairs_dropped += (uint64_t)e->broad.dropped;
  e->counters.pairs_left_over += (uint64_t)left_over;
  if (e->broad.dropped > 0)
    e->events |= GV_EVENT_PAIRS_DROPPED;
  if (left_over > 0)
    e->events |= GV_EVENT_PAIRS_LEFT_OVER;
}

static void collide_pairs(gv_engine *e) {
  gv_queue *queue = &e->queue;
  gv_distance found;
  gv_queue_start(queue, &e->broad, e->collision_budget);
  for (const gv_candidate *pair = gv_queue_next(queue); pair; pair = gv_queue_next(queue)) {
    collide_pair(e, pair, &found);
    gv_queue_done(queue, pair, &found);
  }
  tell_left_over(e, gv_queue_finish(queue));
}

static void bound_object(gv_engine *e, int o) {
  gv_dynamics_predict(e->dyn, GV_LIMBS + o, &e->broad.predicted[GV_LIMBS + o]);
  gv_broad_bound_object(&e->broad, o);
}

static void bound_hand(gv_engine *e, int h) {
  const int first = e->hand[h].first_body;
  for (int b = first; b < first + GV_LIMBS; b++)
    gv_dynamics_predict(e->dyn, b, &e->broad.predicted[b]);
  gv_broad_bound_limbs(&e->broad, h);
}

static void bound_objects(gv_engine *e) {
  for (int i = 0; i < e->rest.moving_count; i++)
    bound_object(e, e->rest.moving[i]);
  for (int o = 0; o < e->scene->object_count && e->counters.steps == 0; o++)
    bound_object(e, o);
}

// ---- objects at rest ----

void gv_engine_wake_object(gv_engine *e, int o) {
  if (gv_rest_wake(&e->rest, o))
    gv_dynamics_set_rest(e->dyn, GV_LIMBS + o, false);
}

// One that wakes disturbs those behind it in the same step, the others in the next.
static void wake_objects(gv_engine *e) {
  gv_rest *rest = &e->rest;
  const int count = rest->moving_count;
  for (int o = 0; o < e->scene->object_count; o++) {
    if (!rest->resting[o] || !gv_rest_is_disturbed(rest, &e->broad, gv_engine_any_placed(e), o))
      continue;
    gv_engine_wake_object(e, o);
    bound_object(e, o);
    rest->moving[rest->moving_count++] = o;
  }
  if (rest->moving_count > count)
    gv_rest_list_moving(rest, e->scene);
}

void gv_engine_put_to_rest(gv_engine *e) {
  const int enough = e->cfg.rest_s > 0.0 ? (int)(e->cfg.rest_s / e->cfg.step_s) : INT_MAX;
  for (int i = 0; i < e->rest.moving_count; i++) {
    const int o = e->rest.moving[i];
    const gv_body_state *s = gv_dynamics_state(e->dyn, GV_LIMBS + o);
    // One in a joint goes on: it may be pushed by way of the other.
    const int steps = e->in_joint[o] ? INT_MAX : enough;
    if (!gv_rest_lies_still(&e->rest, &e->broad, gv_engine_any_placed(e), o, s, steps))
      continue;
    gv_dynamics_set_rest(e->dyn, GV_LIMBS + o, true);
  }
}

// ---- all together ----

void gv_engine_collide(gv_engine *e) {
  e->contact_count = 0;
  e->shallowest = -1;
  gv_rest_list_moving(&e->rest, e->scene);
  for (int h = 0; h < e->hands; h++)
    if (e->hand[h].placed)
      bound_hand(e, h);
  bound_objects(e);
  wake_objects(e);
  gv_broad_list_none(&e->broad);
  for (int h = 0; h < e->hands; h++)
    if (e->hand[h].placed)
      gv_broad_list_hand(&e->broad, h);
  gv_broad_list_objects(&e->broad, e->rest.moving, e->rest.moving_count);
  collide_pairs(e);
  const uint32_t pairs = (uint32_t)(e->broad.pair_count + e->broad.dropped);
  const uint32_t contacts = (uint32_t)e->contact_count;
  if (pairs > e->counters.pairs_max)
    e->counters.pairs_max = pairs;
  if (contacts > e->counters.contacts_max)
    e->counters.contacts_max = contacts;
}
