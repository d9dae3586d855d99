// SPDX-License-Identifier: BSD-3-Clause
// The contact law: how far a contact's gap, penetration, softness and friction (Eqn 9, 10) fix the velocities
// after the step. Pure; real-time thread.
#include "dynamics/problem.h"

#include <assert.h>

// A limb that finds itself deep inside an object is let out gently, not shot.
static const double most_correcting_m_s = 0.25;

// The damping of a contact, 1 / c, is one for hands and what they lift. Between bodies heavier than a
// kilogram it is more, so that an anvil that is dropped does not go through the table; the spring, target /
// c, stays. Twenty times as much is the most, so that a ton still settles within a second.
static double share_of_softness(const gv_problem *problem, const gv_dynamics_contact *c) {
  const double one_kg = 1.0;
  const double least = 0.05;
  const double mass_a = problem->body[c->body_a].mass;
  const double mass_b = problem->body[c->body_b].mass;  // 0: static
  if (mass_a <= one_kg || (mass_b > 0.0 && mass_b <= one_kg))
    return 1.0;
  const double inverse = 1.0 / mass_a + (mass_b > 0.0 ? 1.0 / mass_b : 0.0);
  return gv_clamp(one_kg * inverse, least, 1.0);
}

// Normal velocity that an implicit spring of k = erp / (h cfm) asks for, and its compliance. A gap may close
// within this step, not more. A penetration leaves by the share ERP of itself, f = (erp depth / h - u) / cfm;
// where that is faster than a deep limb may come out, the damping grows with the depth and the spring stays:
// f = (most - u) erp depth / (h most cfm). softness: at most 1; less of it is more damping.
static void set_spring(gv_problem_contact *out, const gv_config *cfg, double depth, double softness) {
  const double h = cfg->step_s;
  const double wanted = depth < 0.0 ? depth / h : cfg->contact_erp * depth / h;
  if (wanted * softness > most_correcting_m_s)
    softness = most_correcting_m_s / wanted;
  out->target_velocity = wanted > 0.0 ? softness * wanted : wanted;
  out->normal_compliance = softness * cfg->contact_cfm / h;
}

static bool is_sound(const gv_dynamics_contact *c) {
  if (!gv_v3_finite(c->position) || !gv_v3_finite(c->normal) || !gv_v3_finite(c->friction_dir))
    return false;
  if (!isfinite(c->depth) || !isfinite(c->mu) || !isfinite(c->patch))
    return false;
  return fabs(gv_norm2(c->normal) - 1.0) < 1e-6;
}

// Softness on the normal row alone: friction rows that inherit a large CFM creep and drop the object.
static void set_contact(gv_problem_contact *out, const gv_config *cfg, const gv_dynamics_contact *c,
                        double softness) {
  const bool coulomb = c->friction == GV_FRICTION_COULOMB;
  out->body_a = c->body_a;
  out->body_b = c->body_b;
  out->point = c->position;
  out->frame[0] = c->normal;
  out->frame[1] = c->friction_dir;
  out->frame[2] = gv_cross(c->normal, c->friction_dir);
  set_spring(out, cfg, c->depth, softness);
  out->tangent_compliance = cfg->world_cfm / cfg->step_s;
  out->friction = c->friction;
  out->mu = coulomb ? c->mu : 0.0;
  out->friction_limit = coulomb ? 0.0 : c->mu * cfg->step_s;
  out->patch = coulomb ? c->patch : 0.0;
}

void gv_problem_set_contacts(gv_problem *problem, const gv_config *cfg, const gv_dynamics_contact contact[],
                             int count, int out_index[]) {
  assert(count <= GV_MAX_CONTACTS);
  problem->contact_count = 0;
  for (int i = 0; i < count; i++) {
    const gv_dynamics_contact *c = &contact[i];
    assert(c->body_a != c->body_b && c->body_a < problem->body_count && c->body_b < problem->body_count);
    if (!is_sound(c) || !(problem->body[c->body_a].mass > 0.0))
      continue;
    out_index[problem->contact_count] = i;
    set_contact(&problem->contact[problem->contact_count], cfg, c, share_of_softness(problem, c));
    problem->contact_count++;
  }
}
