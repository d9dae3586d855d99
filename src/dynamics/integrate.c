// SPDX-License-Identifier: BSD-3-Clause
// Time stepping (Eqn 17, 18), semi-implicit: velocities without contacts, which the contact solver corrects,
// then poses by the new velocities. Forces are explicit; the gyroscopic term is implicit, so that a spinning
// body does not gain energy. Real-time thread.
#include "dynamics/bodies.h"

#include <assert.h>

// R K R^T.
static gv_mat3 in_world(gv_quat q, const gv_mat3 *K) {
  const gv_mat3 R = gv_mat3_from_quat(q);
  gv_mat3 out;
  for (int r = 0; r < 3; r++) {
    const gv_vec3 row = gv_mat3_mul_t(K, gv_v3(R.m[r][0], R.m[r][1], R.m[r][2]));
    const gv_vec3 of_world = gv_mat3_mul(&R, row);
    out.m[r][0] = of_world.x;
    out.m[r][1] = of_world.y;
    out.m[r][2] = of_world.z;
  }
  return out;
}

// Spin w (body axes) after a step without torque: I (w1 - w) + h w1 x I w1 = 0, one Newton step from w (Catto
// 2015).
static gv_vec3 turn_freely(const gv_mat3 *I, gv_vec3 w, double h) {
  assert(h > 0.0);
  const gv_vec3 L = gv_mat3_mul(I, w);
  const gv_vec3 residual = gv_scale(gv_cross(w, L), h);
  gv_mat3 J;
  for (int c = 0; c < 3; c++) {
    const gv_vec3 e = gv_v3(c == 0, c == 1, c == 2);
    const gv_vec3 Ie = gv_mat3_mul(I, e);
    const gv_vec3 column = gv_mad(Ie, h, gv_add(gv_cross(w, Ie), gv_cross(e, L)));
    J.m[0][c] = column.x;
    J.m[1][c] = column.y;
    J.m[2][c] = column.z;
  }
  J = gv_mat3_inverse(&J);
  return gv_sub(w, gv_mat3_mul(&J, residual));
}

// A limb's inertia is the same about every axis, and gravity is one of the forces on it.
static void move_limb(const gv_body *b, const gv_body_state *s, double h, gv_problem_body *out) {
  out->inertia = b->inertia;
  out->v = gv_mad(s->v, h * b->inv_mass, b->force);
  out->w = gv_mad(s->w, h * b->inv_inertia.m[0][0], b->torque);
}

static void move_object(const gv_body *b, const gv_body_state *s, gv_vec3 gravity, double h,
                        gv_problem_body *out) {
  out->inertia = in_world(s->T.q, &b->inertia);
  out->v = gv_mad(gv_mad(s->v, h, gravity), h * b->inv_mass, b->force);
  const gv_vec3 by_torque = gv_mat3_mul(&b->inv_inertia, gv_rotate_inv(s->T.q, b->torque));
  const gv_vec3 spin = turn_freely(&b->inertia, gv_rotate_inv(s->T.q, s->w), h);
  out->w = gv_rotate(s->T.q, gv_mad(spin, h, by_torque));
}

void gv_bodies_move_freely(const gv_bodies *bodies, double h, gv_problem_body out_body[]) {
  assert(bodies->count >= GV_LIMBS && bodies->count <= GV_BODIES);
  for (int i = 0; i < bodies->count; i++) {
    const gv_body *b = &bodies->body[i];
    const gv_body_state *s = &bodies->state[i];
    gv_problem_body *out = &out_body[i];
    out->p = s->T.p;
    out->mass = 0.0;
    out->v = out->w = gv_v3(0, 0, 0);
    if (!gv_body_moves(b))
      continue;
    out->mass = 1.0 / b->inv_mass;
    if (gv_bodies_is_limb(bodies, i))
      move_limb(b, s, h, out);
    else
      move_object(b, s, bodies->gravity, h, out);
  }
}

void gv_bodies_predict(const gv_bodies *bodies, double h, int body, gv_body_state *out) {
  assert(body >= 0 && body < bodies->count);
  const gv_body *b = &bodies->body[body];
  *out = bodies->state[body];
  if (!gv_body_moves(b)) {
    out->v = out->w = gv_v3(0, 0, 0);
    return;
  }
  out->v = gv_mad(out->v, h * b->inv_mass, b->force);
  if (!gv_bodies_is_limb(bodies, body))
    out->v = gv_mad(out->v, h, bodies->gravity);
}

static void advance(gv_body_state *s, double h, const gv_velocity *velocity) {
  s->v = velocity->v;
  s->w = velocity->w;
  s->T.p = gv_mad(s->T.p, h, s->v);
  const gv_quat q = s->T.q;
  const gv_quat d = gv_quat_mul((gv_quat){0, s->w.x, s->w.y, s->w.z}, q);
  const double half = 0.5 * h;
  const gv_quat turned = {q.w + half * d.w, q.x + half * d.x, q.y + half * d.y, q.z + half * d.z};
  s->T.q = gv_quat_normalize(turned);
}

void gv_bodies_advance(gv_bodies *bodies, double h, const gv_velocity velocity[]) {
  for (int i = 0; i < bodies->count; i++) {
    gv_body *b = &bodies->body[i];
    if (gv_body_moves(b))
      advance(&bodies->state[i], h, &velocity[i]);
    b->force = b->torque = gv_v3(0, 0, 0);
  }
}

double gv_bodies_object_energy(const gv_bodies *bodies) {
  double sum = 0.0;
  for (int i = GV_LIMBS; i < bodies->second_hand; i++) {
    const gv_body *b = &bodies->body[i];
    if (b->is_static)
      continue;
    const gv_body_state *s = &bodies->state[i];
    const gv_vec3 w = gv_rotate_inv(s->T.q, s->w);
    sum += 0.5 * b->mass_kg * gv_norm2(s->v) + 0.5 * gv_dot(w, gv_mat3_mul(&b->inertia, w));
    sum -= b->mass_kg * gv_dot(bodies->gravity, s->T.p);
  }
  return sum;
}
