// SPDX-License-Identifier: BSD-3-Clause
// Solver `dantzig`: ODE's exact LCP solver (Baraff 1994), made to mean Coulomb's law. ODE bounds a contact's friction by
// the normal force that it would have without any friction, so alone it lets a contact without load hold sideways. So
// the problem is solved again with fixed limits, mu times the last normal impulses, until limits and normals agree.
// Its cost grows with the cube of the rows of bodies that touch each other. Real-time thread.
#include <string.h>

#include "dynamics/ode.h"

enum { ROUNDS = 6, MOST_CONTACTS = 128 };    // of an island: what the step memory is made for
static const double agree_n_s = 1e-8;        // limits that differ by less are the same,
static const double agree_share = 1e-4;      // or by less than this share of them

static int find_root(uint8_t *parent, int i) {
  while (parent[i] != i) {
    parent[i] = parent[parent[i]];
    i = parent[i];
  }
  return i;
}

// Contacts of each group of bodies that touch each other, at its root: ODE solves each alone. Union by path halving.
static void count_islands(const gv_problem *problem, int out_contacts[GV_BODIES]) {
  uint8_t parent[GV_BODIES];
  for (int i = 0; i < GV_BODIES; i++) parent[i] = (uint8_t)i;
  memset(out_contacts, 0, GV_BODIES * sizeof *out_contacts);
  for (int i = 0; i < problem->contact_count; i++) {
    const gv_problem_contact *c = &problem->contact[i];
    if (problem->body[c->body_b].mass > 0.0) parent[find_root(parent, c->body_a)] = (uint8_t)find_root(parent, c->body_b);
  }
  for (int i = 0; i < problem->contact_count; i++) out_contacts[find_root(parent, problem->contact[i].body_a)]++;
}

// Of one round, as measured (make bench): 3 us, 0.4 us a contact, and half a nanosecond a cube of an island's rows.
static double round_cost_s(const gv_problem *problem) {
  int contacts[GV_BODIES];
  double sum = 3e-6;
  count_islands(problem, contacts);
  for (int i = 0; i < problem->body_count; i++) {
    const double rows = 3.0 * contacts[i];
    if (contacts[i] > MOST_CONTACTS) return HUGE_VAL;
    sum += 4e-7 * contacts[i] + 5e-10 * rows * rows * rows;
  }
  return sum;
}

static bool has_coulomb(const gv_problem *problem) {
  for (int i = 0; i < problem->contact_count; i++)
    if (problem->contact[i].friction != GV_FRICTION_FIXED_LIMIT) return true;
  return false;
}

static double limit_of(const gv_problem_contact *c, gv_vec3 impulse) {
  if (c->friction == GV_FRICTION_FIXED_LIMIT) return c->friction_limit;
  return c->mu * fmax(0.0, gv_dot(c->frame[0], impulse));
}

// The limits that these impulses give; true where they are those that were given.
static bool set_limits(const gv_problem *problem, const gv_vec3 impulse[], double io_limit[]) {
  bool agree = true;
  for (int i = 0; i < problem->contact_count; i++) {
    const double limit = limit_of(&problem->contact[i], impulse[i]);
    if (fabs(limit - io_limit[i]) > agree_n_s + agree_share * limit) agree = false;
    io_limit[i] = limit;
  }
  return agree;
}

static gv_outcome solve(void *memory, const gv_problem *problem, gv_velocity out_velocity[], gv_vec3 out_impulse[]) {
  gv_ode *ode = memory;
  gv_ode_method method = {0};
  double limit[GV_MAX_CONTACTS] = {0};
  const bool coulomb = has_coulomb(problem);
  const int rounds = (int)fmin(problem->budget_s / round_cost_s(problem), ROUNDS);
  if (rounds < (coulomb ? 2 : 1)) return GV_OUTCOME_NONE;
  for (int round = 0; round < rounds; round++) {
    if (!gv_ode_solve(ode, problem, &method, out_velocity, out_impulse)) return GV_OUTCOME_NONE;
    const bool agree = set_limits(problem, out_impulse, limit);
    if (!coulomb || (round > 0 && agree)) return GV_OUTCOME_SOLVED;
    method.friction_limit = limit;
  }
  return GV_OUTCOME_LAGGED;
}

static void forget(void *memory) { (void)memory; }

const gv_contact_solver gv_solver_dantzig = {"dantzig", 0, solve, forget};
