// SPDX-License-Identifier: BSD-3-Clause
// One contact of the Newton solver: equations (3) to (6) of newton.c. Real-time thread.
#include "dynamics/newton_contact.h"

#include <assert.h>

static const double least_tolerance = 1e-10;  // N s: two impulses that differ by less are the same
static const double relative_tolerance = 5e-8;
static const double most_lambda = 1e30;  // without friction nothing holds a slip back

// W v of an eliminated limb; zero of any other contact.
static gv_vec3 yield(const gv_newton_contact *c, gv_vec3 v) {
  return gv_mad(gv_scale(v, c->give), -c->turn * gv_dot(c->arm_a, v), c->arm_a);
}

// K += a b^T.
static void add_outer(gv_mat3 *K, gv_vec3 a, gv_vec3 b) {
  const double left[3] = {a.x, a.y, a.z};
  for (int r = 0; r < 3; r++) {
    K->m[r][0] += left[r] * b.x;
    K->m[r][1] += left[r] * b.y;
    K->m[r][2] += left[r] * b.z;
  }
}

// (C + W)^-1.
static gv_mat3 sticking_stiffness(const gv_newton_contact *c, double c_t) {
  const double along = c->is_lone ? c_t + c->give : 1.0 / c_t;
  gv_mat3 K = {{{along, 0, 0}, {0, along, 0}, {0, 0, along}}};
  if (!c->is_lone) {
    add_outer(&K, c->normal, gv_scale(c->normal, 1.0 / c->compliance_n - 1.0 / c_t));
    return K;
  }
  add_outer(&K, c->normal, gv_scale(c->normal, c->compliance_n - c_t));
  add_outer(&K, c->arm_a, gv_scale(c->arm_a, -c->turn));
  return gv_mat3_inverse(&K);
}

// [d f] (diag(c_n, c_t + lambda) + [n f]^T W [d f])^-1 [n f]^T.
static gv_mat3 sliding_stiffness(const gv_newton_contact *c, double c_t) {
  const gv_vec3 n = c->normal;
  const gv_vec3 e = c->mode.friction_dir;
  const gv_vec3 d = gv_mad(n, c->mu, e);
  const gv_vec3 f = gv_cross(n, e);
  double nn = c->compliance_n;
  double nf = 0.0;
  double fn = 0.0;
  double ff = c_t + c->mode.lambda;
  if (c->is_lone) {
    const double arm_n = gv_dot(c->arm_a, n);
    const double arm_f = gv_dot(c->arm_a, f);
    const double arm_d = gv_dot(c->arm_a, d);
    nn += c->give - c->turn * arm_n * arm_d;
    nf -= c->turn * arm_n * arm_f;
    fn -= c->turn * arm_f * arm_d;
    ff += c->give - c->turn * arm_f * arm_f;
  }
  const double by = 1.0 / (nn * ff - nf * fn);
  gv_mat3 K = {{{0}}};
  add_outer(&K, d, gv_mad(gv_scale(n, by * ff), -by * nf, f));
  add_outer(&K, f, gv_mad(gv_scale(f, by * nn), -by * fn, n));
  return K;
}

gv_mat3 gv_newton_stiffness(const gv_newton_contact *c, double softening) {
  const double c_t = softening * c->compliance_t;
  assert(c->compliance_n > 0.0 && c_t > 0.0);
  if (c->mode.state == GV_NEWTON_STICKING)
    return sticking_stiffness(c, c_t);
  if (c->mode.state == GV_NEWTON_SLIDING)
    return sliding_stiffness(c, c_t);
  return (gv_mat3){{{0}}};
}

void gv_newton_respond(gv_newton_contact *c, gv_vec3 r) {
  c->u = r;
  c->impulse = gv_v3(0, 0, 0);
  if (c->mode.state == GV_NEWTON_OPEN)
    return;
  c->impulse = gv_neg(gv_mat3_mul(&c->stiffness, r));
  if (c->is_lone)
    c->u = gv_add(r, yield(c, c->impulse));
}

static double residual_of(gv_vec3 d, gv_vec3 projected) {
  const double most = fmax(fabs(d.x), fmax(fabs(d.y), fabs(d.z)));
  const double tolerance2 = fmax(relative_tolerance * relative_tolerance * gv_norm2(projected),
                                 least_tolerance * least_tolerance);
  return most / sqrt(tolerance2);
}

gv_newton_projection gv_newton_project(const gv_newton_contact *c, double weight, double softening) {
  const gv_vec3 n = c->normal;
  const gv_vec3 x = c->impulse;
  const double c_t = softening * c->compliance_t;
  const double x_n = gv_dot(x, n);
  const double u_n = gv_dot(c->u, n);
  assert(weight == 0.0 || c->inverse_mass_t > 0.0);
  const double by_rho_n = weight * c->inverse_mass_n + c->compliance_n;
  const double by_rho_t = weight * c->inverse_mass_t + c_t;
  const gv_vec3 x_t = gv_mad(x, -x_n, n);
  const gv_vec3 u_t = gv_mad(c->u, -u_n, n);
  const gv_vec3 y_t = gv_mad(x_t, -1.0 / by_rho_t, gv_mad(u_t, c_t, x_t));
  const double y_n = x_n - (u_n + c->compliance_n * x_n) / by_rho_n;
  const double limit = c->mu * y_n;
  const double size = gv_norm(y_t);
  gv_newton_projection p = {.mode = c->mode};
  gv_vec3 projected = gv_v3(0, 0, 0);
  if (!(y_n > 0.0)) {
    p.mode.state = GV_NEWTON_OPEN;
  } else if (size <= limit) {
    p.mode.state = GV_NEWTON_STICKING;
    projected = gv_mad(y_t, y_n, n);
  } else {
    p.mode.state = GV_NEWTON_SLIDING;
    p.mode.friction_dir = gv_scale(y_t, 1.0 / size);
    p.mode.lambda = fmin((size - limit) * by_rho_t / limit, most_lambda);
    projected = gv_mad(gv_scale(n, y_n), limit, p.mode.friction_dir);
  }
  const gv_vec3 d = gv_sub(projected, x);
  const double d_n = gv_dot(d, n);
  p.residual = residual_of(d, projected);
  p.merit = by_rho_n * d_n * d_n + by_rho_t * fmax(0.0, gv_norm2(d) - d_n * d_n);
  return p;
}
