// SPDX-License-Identifier: BSD-3-Clause
// The laws of contact and friction, checked on an answer to a contact problem, whoever gave it: from the
// velocities of the bodies and the impulses alone, in newtons and metres a second. The four residuals of
// "Contact Models in Robotics: a Comparative Analysis" (Le Lidec et al. 2023) are closing_m_s (Signorini),
// coulomb_n, dissipation_w and momentum_n_s.
#ifndef TEST_SUPPORT_CONTACT_LAWS_H
#define TEST_SUPPORT_CONTACT_LAWS_H

#include "dynamics/problem.h"

typedef struct contact_laws {
  double pull_n;         // a contact pulls
  double closing_m_s;    // closes faster than its compliance allows, or pushes and parts (the lesser of both)
  double outside_n;      // friction beyond mu (1 + 1e-3) times the normal force
  double creep_m_s;      // slip where friction is below its bound
  double astray_deg;     // friction against slip, where both are there
  double coulomb_n;      // friction beyond mu times the normal force
  double dissipation_w;  // power that friction takes less than the most it could: mu f_n |u_t| + f_t u_t
  double momentum_n_s;   // of a body, and its angular momentum at 0.1 m
  long loaded;           // contacts that carry more than a millinewton
  long outside;          // of these, beyond the cone by more than 1e-4 N
  double worst_ratio;    // of those: friction / (mu times normal force)
} contact_laws;

static inline double larger(double a, double b) { return b <= a ? a : b; }  // of a not-a-number: that

static inline gv_velocity velocity_after(const gv_problem *q, int body, const gv_velocity v[]) {
  return q->body[body].mass > 0.0 ? v[body] : (gv_velocity){{0, 0, 0}, {0, 0, 0}};
}

// Of a over b.
static inline gv_vec3 contact_velocity(const gv_problem *q, const gv_problem_contact *c,
                                       const gv_velocity v[]) {
  const gv_velocity a = velocity_after(q, c->body_a, v);
  const gv_velocity b = velocity_after(q, c->body_b, v);
  const gv_vec3 of_a = gv_add(a.v, gv_cross(a.w, gv_sub(c->point, q->body[c->body_a].p)));
  const gv_vec3 of_b = gv_add(b.v, gv_cross(b.w, gv_sub(c->point, q->body[c->body_b].p)));
  return gv_sub(of_a, of_b);
}

static inline void count_outside(double f_t, double f_n, double bound, contact_laws *worst) {
  if (hypot(f_t, f_n) < 1e-3)
    return;
  worst->loaded++;
  if (f_t <= bound * (1.0 + 1e-3) + 1e-4)
    return;
  worst->outside++;
  worst->worst_ratio = larger(worst->worst_ratio, f_t / fmax(bound, 1e-4));
}

static inline void judge_contact(const gv_problem *q, const gv_problem_contact *c, const gv_velocity v[],
                                 gv_vec3 x, contact_laws *worst) {
  const double h = q->step_s;
  const double x_n = gv_dot(x, c->frame[0]);
  const double f_n = x_n / h;
  const gv_vec3 u = contact_velocity(q, c, v);
  const gv_vec3 x_t = gv_mad(x, -x_n, c->frame[0]);
  const gv_vec3 u_t = gv_mad(u, -gv_dot(u, c->frame[0]), c->frame[0]);
  const double w_n = gv_dot(u, c->frame[0]) - c->target_velocity + c->normal_compliance * x_n;
  const double f_t = gv_norm(x_t) / h;
  const double slip = gv_norm(u_t);
  const double bound = c->mu * fmax(0.0, f_n);
  worst->pull_n = larger(worst->pull_n, -f_n);
  worst->closing_m_s = larger(worst->closing_m_s, fabs(fmin(w_n, f_n)));
  worst->coulomb_n = larger(worst->coulomb_n, f_t - bound);
  worst->dissipation_w = larger(worst->dissipation_w, fabs(bound * slip + gv_dot(x_t, u_t) / h));
  worst->outside_n = larger(worst->outside_n, f_t - bound * (1.0 + 1e-3));
  count_outside(f_t, f_n, bound, worst);
  if (f_t < bound * (1.0 - 1e-3) - 1e-4)
    worst->creep_m_s = larger(worst->creep_m_s, slip - c->tangent_compliance * h * f_t);
  if (slip < 1e-5 + c->tangent_compliance * h * f_t || f_t < 1e-4)
    return;
  const double cosine = gv_clamp(-gv_dot(x_t, u_t) / (gv_norm(x_t) * slip), -1.0, 1.0);
  worst->astray_deg = larger(worst->astray_deg, acos(cosine) * 180.0 / GV_PI);
}

// Of a row of a joint, on a: what its law makes of the velocities.
static inline double row_impulse(const gv_problem *q, const gv_problem_row *row, const gv_velocity v[]) {
  const gv_velocity a = velocity_after(q, row->body_a, v);
  const gv_velocity b = row->body_b == GV_WORLD ? (gv_velocity){{0, 0, 0}, {0, 0, 0}}
                                                : velocity_after(q, row->body_b, v);
  const gv_vec3 turning = gv_sub(a.w, b.w);
  const gv_vec3 moving = gv_sub(gv_add(a.v, gv_cross(a.w, row->arm_a)),
                                gv_add(b.v, gv_cross(b.w, row->arm_b)));
  const double g = gv_dot(row->direction, row->turns ? turning : moving);
  return gv_clamp((row->target_velocity - g) / row->compliance, row->low, row->high);
}

static inline void add_rows(const gv_problem *q, int body, const gv_velocity v[], gv_vec3 *io_linear,
                            gv_vec3 *io_angular) {
  for (int i = 0; i < q->row_count; i++) {
    const gv_problem_row *row = &q->row[i];
    if (row->body_a != body && row->body_b != body)
      continue;
    const bool is_a = row->body_a == body;
    const gv_vec3 y = gv_scale(row->direction, (is_a ? 1.0 : -1.0) * row_impulse(q, row, v));
    if (row->turns) {
      *io_angular = gv_add(*io_angular, y);
      continue;
    }
    *io_linear = gv_add(*io_linear, y);
    *io_angular = gv_add(*io_angular, gv_cross(is_a ? row->arm_a : row->arm_b, y));
  }
}

static inline void judge_momentum(const gv_problem *q, int body, const gv_velocity v[], const gv_vec3 x[],
                                  contact_laws *worst) {
  const gv_problem_body *b = &q->body[body];
  gv_vec3 linear = gv_v3(0, 0, 0);
  gv_vec3 angular = gv_v3(0, 0, 0);
  bool touched = false;
  for (int i = 0; i < q->contact_count; i++) {
    const gv_problem_contact *c = &q->contact[i];
    if (c->body_a != body && c->body_b != body)
      continue;
    const gv_vec3 y = gv_scale(x[i], c->body_a == body ? 1.0 : -1.0);
    touched = true;
    linear = gv_add(linear, y);
    angular = gv_add(angular, gv_cross(gv_sub(c->point, b->p), y));
  }
  if (!touched || !(b->mass > 0.0))
    return;
  add_rows(q, body, v, &linear, &angular);
  const gv_vec3 dp = gv_scale(gv_sub(v[body].v, b->v), b->mass);
  const gv_vec3 dL = gv_mat3_mul(&b->inertia, gv_sub(v[body].w, b->w));
  worst->momentum_n_s = larger(worst->momentum_n_s,
                               gv_norm(gv_sub(dp, linear)) + 10.0 * gv_norm(gv_sub(dL, angular)));
}

// Adds what this answer does worst. v: of the bodies after the step; x: impulse on body
// a of each contact, N s, world.
static inline void contact_laws_judge(const gv_problem *q, const gv_velocity v[], const gv_vec3 x[],
                                      contact_laws *worst) {
  for (int i = 0; i < q->contact_count; i++)
    judge_contact(q, &q->contact[i], v, x[i], worst);
  for (int b = 0; b < q->body_count; b++)
    judge_momentum(q, b, v, x, worst);
}

#endif
