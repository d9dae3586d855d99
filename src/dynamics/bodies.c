// SPDX-License-Identifier: BSD-3-Clause
// Masses and inertias from the scene and the settings, and the bodies' states and forces. Real-time thread;
// set-up apart.
#include "dynamics/bodies.h"

#include <assert.h>

#include "dynamics/dynamics.h"

static void set_mass(gv_body *b, double mass_kg, double added_kg, const gv_mat3 *inertia,
                     double added_inertia) {
  assert(mass_kg > 0.0 && added_kg >= 0.0 && added_inertia >= 0.0);
  b->mass_kg = mass_kg;
  b->inv_mass = 1.0 / (mass_kg + added_kg);
  b->inertia = *inertia;
  for (int k = 0; k < 3; k++)
    b->inertia.m[k][k] += added_inertia;
  b->inv_inertia = gv_mat3_inverse(&b->inertia);
}

void gv_bodies_set_limb(gv_bodies *bodies, int limb, const gv_spring *spring, double inertia) {
  assert(limb >= 0 && limb < bodies->count && gv_bodies_is_limb(bodies, limb));
  const gv_mat3 own = {{{inertia, 0, 0}, {0, inertia, 0}, {0, 0, inertia}}};
  set_mass(&bodies->body[limb], spring->mass_kg, spring->added_mass_kg, &own, spring->added_inertia);
}

// I / m = 2/5 r^2 with 4/3 pi r^3 = volume.
double gv_sphere_inertia_of_box(gv_vec3 size_m) {
  double r = gv_cbrt(size_m.x * size_m.y * size_m.z * 3.0 / (4.0 * GV_PI));
  return 0.4 * r * r;
}

static double sphere_inertia_per_mass(const gv_scene *scene, const gv_object *o) {
  gv_vec3 lo = gv_v3(1e9, 1e9, 1e9);
  gv_vec3 hi = gv_v3(-1e9, -1e9, -1e9);
  for (int i = 0; i < o->piece_count; i++) {
    const gv_hull *hull = &scene->piece[o->piece_first + i];
    const gv_vec3 r = gv_v3(hull->radius, hull->radius, hull->radius);
    const gv_vec3 min = gv_sub(hull->aabb_min, r);
    const gv_vec3 max = gv_add(hull->aabb_max, r);
    lo = gv_v3(fmin(lo.x, min.x), fmin(lo.y, min.y), fmin(lo.z, min.z));
    hi = gv_v3(fmax(hi.x, max.x), fmax(hi.y, max.y), fmax(hi.z, max.z));
  }
  return gv_sphere_inertia_of_box(gv_sub(hi, lo));
}

static gv_mat3 object_inertia(const gv_config *cfg, const gv_scene *scene, const gv_object *o,
                              double mass_kg) {
  gv_mat3 inertia = {{{0}}};
  const double sphere = cfg->override_sphere_inertia ? mass_kg * sphere_inertia_per_mass(scene, o) : 0.0;
  for (int r = 0; r < 3; r++) {
    for (int c = 0; c < 3; c++) {
      if (sphere > 0.0)
        inertia.m[r][c] = r == c ? sphere : 0.0;
      else
        inertia.m[r][c] = o->inertia_kg_m2.m[r][c] * mass_kg / o->mass_kg;
    }
  }
  return inertia;
}

static void init_object(gv_bodies *bodies, const gv_config *cfg, const gv_scene *scene, int index) {
  assert(index >= 0 && index < scene->object_count);
  const gv_object *o = &scene->object[index];
  gv_body *b = &bodies->body[GV_LIMBS + index];
  b->is_static = o->is_static;
  bodies->state[GV_LIMBS + index].T = o->T_world_body;
  if (o->is_static)
    return;
  const double mass_kg = cfg->override_mass_kg > 0.0 ? cfg->override_mass_kg : o->mass_kg;
  const gv_mat3 inertia = object_inertia(cfg, scene, o, mass_kg);
  set_mass(b, mass_kg, 0.0, &inertia, 0.0);
  gv_bodies_set_state(bodies, GV_LIMBS + index, &(gv_body_state){.T = o->T_world_body});
}

static gv_vec3 choose_gravity(const gv_config *cfg, const gv_scene *scene) {
  if (!(cfg->override_gravity_m_s2 > 0.0))
    return scene->gravity_m_s2;
  return gv_scale(gv_normalize_or(scene->gravity_m_s2, gv_v3(0, 0, -1)), cfg->override_gravity_m_s2);
}

void gv_bodies_init(gv_bodies *bodies, const gv_config *cfg, const gv_scene *scene,
                    const gv_spring spring[GV_LIMBS], const double limb_inertia[GV_LIMBS]) {
  const int second_hand = gv_body_of_second_hand(scene->object_count);
  *bodies = (gv_bodies){.count = second_hand + (cfg->second.present ? GV_LIMBS : 0),
                        .second_hand = second_hand,
                        .gravity = choose_gravity(cfg, scene)};
  assert(bodies->count <= GV_BODIES);
  for (int i = second_hand; i < bodies->count; i++) {
    bodies->state[i].T = gv_pose_identity();
    bodies->body[i].stands = true;
  }
  for (int i = 0; i < GV_LIMBS; i++) {
    bodies->state[i].T = gv_pose_identity();
    bodies->body[i].stands = true;
    gv_bodies_set_limb(bodies, i, &spring[i], limb_inertia[i]);
  }
  for (int i = 0; i < scene->object_count; i++)
    init_object(bodies, cfg, scene, i);
}

void gv_bodies_set_state(gv_bodies *bodies, int body, const gv_body_state *s) {
  assert(body >= 0 && body < bodies->count);
  if (bodies->body[body].is_static)
    return;
  if (!gv_pose_finite(s->T) || !gv_v3_finite(s->v) || !gv_v3_finite(s->w))
    return;
  bodies->state[body] = *s;
  bodies->state[body].T.q = gv_quat_normalize(s->T.q);
}

void gv_bodies_set_standing(gv_bodies *bodies, int body, bool stands) {
  assert(body >= 0 && body < bodies->count);
  bodies->body[body].stands = stands;
}

void gv_bodies_add_force(gv_bodies *bodies, int body, gv_vec3 f, gv_vec3 t) {
  assert(body >= 0 && body < bodies->count);
  gv_body *b = &bodies->body[body];
  if (b->is_static || !gv_v3_finite(f) || !gv_v3_finite(t))
    return;
  b->force = gv_add(b->force, f);
  b->torque = gv_add(b->torque, t);
}
