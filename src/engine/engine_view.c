// SPDX-License-Identifier: BSD-3-Clause
// Reading an engine's state, hashing it, and placing objects. Called between steps by the thread that steps.
#include <assert.h>
#include <string.h>

#include "engine/engine_state.h"

const gv_counters *gv_engine_counters(const gv_engine *e) { return &e->counters; }
const gv_contact *gv_engine_contacts(const gv_engine *e, int *out_count) {
  *out_count = e->contact_count;
  return e->contact;
}
int gv_engine_hands(const gv_engine *e) { return e->hands; }
bool gv_engine_hand_placed(const gv_engine *e) { return e->hand[0].placed; }
gv_pose gv_engine_limb_pose(const gv_engine *e, int limb) {
  assert(limb >= 0 && limb < e->hands * GV_LIMBS);
  return gv_dynamics_state(e->dyn, gv_engine_body_of_limb(e, limb))->T;
}
gv_pose gv_engine_driver_pose(const gv_engine *e, int limb) {
  assert(limb >= 0 && limb < e->hands * GV_LIMBS);
  return e->hand[limb / GV_LIMBS].driver[limb % GV_LIMBS].T;
}
void gv_engine_limb_velocity(const gv_engine *e, int limb, gv_vec3 *out_v, gv_vec3 *out_w) {
  assert(limb >= 0 && limb < e->hands * GV_LIMBS);
  *out_v = gv_dynamics_state(e->dyn, gv_engine_body_of_limb(e, limb))->v;
  *out_w = gv_dynamics_state(e->dyn, gv_engine_body_of_limb(e, limb))->w;
}
void gv_engine_coupling(const gv_engine *e, int limb, gv_vec3 *out_f, gv_vec3 *out_t) {
  assert(limb >= 0 && limb < e->hands * GV_LIMBS);
  const gv_engine_hand *hand = &e->hand[limb / GV_LIMBS];
  *out_f = gv_neg(hand->felt_f[limb % GV_LIMBS]);
  *out_t = gv_neg(hand->felt_t[limb % GV_LIMBS]);
}
gv_pose gv_engine_object_pose(const gv_engine *e, int object) {
  assert(object >= 0 && object < e->scene->object_count);
  return gv_dynamics_state(e->dyn, GV_LIMBS + object)->T;
}
void gv_engine_object_velocity(const gv_engine *e, int object, gv_vec3 *out_v, gv_vec3 *out_w) {
  assert(object >= 0 && object < e->scene->object_count);
  *out_v = gv_dynamics_state(e->dyn, GV_LIMBS + object)->v;
  *out_w = gv_dynamics_state(e->dyn, GV_LIMBS + object)->w;
}
gv_joint_state gv_engine_joint(const gv_engine *e, int joint) { return gv_dynamics_joint(e->dyn, joint); }
const double *gv_engine_measured(const gv_engine *e) { return gv_engine_measured_of(e, 0); }
const double *gv_engine_angles(const gv_engine *e) { return gv_engine_angles_of(e, 0); }
const double *gv_engine_measured_of(const gv_engine *e, int hand) {
  assert(hand >= 0 && hand < e->hands);
  return e->hand[hand].condition.target;
}
const double *gv_engine_angles_of(const gv_engine *e, int hand) {
  assert(hand >= 0 && hand < e->hands);
  return e->hand[hand].angle;
}
void gv_engine_memory(const gv_engine *e, size_t *out_used, size_t *out_peak, size_t *out_size) {
  *out_used = e->arena.used;
  *out_peak = e->arena.peak;
  *out_size = e->arena.size;
}
double gv_engine_energy(const gv_engine *e) { return gv_dynamics_object_energy(e->dyn); }
void gv_engine_push_object(gv_engine *e, int object, gv_vec3 f_world, gv_vec3 t_world) {
  assert(object >= 0 && object < e->scene->object_count);
  gv_dynamics_add_force(e->dyn, GV_LIMBS + object, f_world, t_world);
  if (gv_dynamics_pushed(e->dyn, GV_LIMBS + object))
    gv_engine_wake_object(e, object);
}
void gv_engine_set_object(gv_engine *e, int object, gv_pose T_world_body, gv_vec3 v, gv_vec3 w) {
  assert(object >= 0 && object < e->scene->object_count);
  for (int o = 0; o < e->scene->object_count; o++)
    gv_engine_wake_object(e, o);  // it may have carried others
  gv_broad_forget_sides(&e->broad, object);
  gv_dynamics_set_state(e->dyn, GV_LIMBS + object, &(gv_body_state){T_world_body, v, w});
}

// A limb has several contacts with one piece: only the first of a pair asks for its polygons.
static bool is_first_of_pair(const gv_engine *e, int i) {
  const gv_contact *c = &e->contact[i];
  for (int k = 0; k < i; k++)
    if (e->contact[k].limb == c->limb && e->contact[k].piece == c->piece)
      return false;
  return true;
}

int gv_engine_polygons(const gv_engine *e, gv_polygon_contact out[], int max) {
  assert(out && max >= 0);
  enum { OF_PAIR = 32 };
  gv_polygon_depth polygon[OF_PAIR];
  int count = 0;
  for (int i = 0; i < e->contact_count; i++) {
    const gv_contact *c = &e->contact[i];
    if (c->limb < 0 || !is_first_of_pair(e, i))
      continue;
    const gv_pair pair = {
      &e->broad.limb_shape[c->limb], &gv_dynamics_state(e->dyn, gv_engine_body_of_limb(e, c->limb))->T,
      &e->broad.piece_shape[c->piece], &gv_dynamics_state(e->dyn, GV_LIMBS + c->object)->T};
    int found = gv_polygon_depths(&pair, c->normal_world, 0.0, polygon, OF_PAIR);
    for (int k = 0; k < found && count < max; k++)
      out[count++] = (gv_polygon_contact){c->limb,         c->object,        c->piece,
                                          polygon[k].face, polygon[k].depth, polygon[k].position_world};
  }
  return count;
}

static uint64_t fnv1a(uint64_t hash, const void *data, size_t size) {
  const uint8_t *byte = data;
  for (size_t i = 0; i < size; i++)
    hash = (hash ^ byte[i]) * 1099511628211ULL;
  return hash;
}

static uint64_t add_condition(uint64_t hash, const gv_condition *c, bool observed) {
  hash = fnv1a(hash, c->angle, sizeof c->angle);
  hash = fnv1a(hash, c->rate, sizeof c->rate);
  hash = fnv1a(hash, &c->wrist, sizeof c->wrist);
  hash = fnv1a(hash, &c->v, sizeof c->v);
  hash = fnv1a(hash, c->pace, sizeof c->pace);
  if (observed)
    hash = fnv1a(hash, &c->fingers, sizeof c->fingers);
  return fnv1a(hash, &c->w, sizeof c->w);
}

uint64_t gv_engine_hash(const gv_engine *e) {
  uint64_t hash = fnv1a(14695981039346656037ULL, &e->counters.steps, sizeof e->counters.steps);
  for (int i = 0; i < GV_LIMBS + e->scene->object_count; i++)
    hash = fnv1a(hash, gv_dynamics_state(e->dyn, i), sizeof(gv_body_state));
  hash = add_condition(hash, &e->hand[0].condition, e->cfg.finger.observed);
  if (e->hands == 1)
    return hash;
  for (int i = GV_LIMBS; i < 2 * GV_LIMBS; i++)
    hash = fnv1a(hash, gv_dynamics_state(e->dyn, gv_engine_body_of_limb(e, i)), sizeof(gv_body_state));
  return add_condition(hash, &e->hand[1].condition, e->cfg.finger.observed);
}
