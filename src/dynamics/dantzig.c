// SPDX-License-Identifier: BSD-3-Clause
// Solver `dantzig`: ODE's exact LCP solver (Baraff 1994), made to mean Coulomb's law. ODE bounds a contact's
// friction by the normal force that it would have without any friction, separately along two tangents; alone
// it lets a contact without load hold sideways. So the problem is solved again with fixed limits from the
// last answer, until they agree with the answer that they give. With x the impulse, u_t the slip, y_t = x_t -
// rho u_t and rho the two bodies' reduced mass:
//
//   |y_t| <= mu x_n     the contact sticks: both tangents are limited by mu x_n
//   else                it slides along e = y_t / |y_t|: they are limited by mu x_n |e_1| and mu x_n |e_2|
//
// which where it ends is Coulomb's round cone. The first limits are those of the last step. Real-time thread.
#include <assert.h>
#include <string.h>

#include "dynamics/ode.h"

// Limits swing where contacts share a load in many ways. So from DAMPED_FROM on they move halfway; where no
// contact is new they do so at once, and a few rounds are enough, for the next step goes on with them.
enum { ROUNDS = 8, ROUNDS_KNOWN = 3, DAMPED_FROM = 3 };
enum { MOST_ROWS = 3 * 128 };            // of an island: what the step memory is made for
static const double agree_n_s = 1e-8;    // limits that differ by less are the same,
static const double agree_share = 5e-4;  // or by less than this share of mu x_n

typedef struct guess {
  int body_a, body_b;
  gv_ode_limit limit;
} guess;

typedef struct gv_dantzig {
  gv_ode *ode;
  guess last[GV_MAX_CONTACTS];  // the last step's contacts
  int last_count;
  gv_ode_limit limit[GV_MAX_CONTACTS];  // of this step's
} gv_dantzig;

// ---- cost -----------------------------------------------------------------------------------------

_Static_assert(GV_BODIES <= UINT8_MAX + 1, "bodies are numbered in 8 bits");

static int find_root(uint8_t *parent, int i) {
  assert(i >= 0 && i < GV_BODIES);
  while (parent[i] != i) {
    parent[i] = parent[parent[i]];
    i = parent[i];
  }
  return i;
}

static void join(const gv_problem *problem, uint8_t *parent, int a, int b) {
  if (b == GV_WORLD || !(problem->body[b].mass > 0.0))
    return;
  const int root = find_root(parent, a);
  parent[root] = (uint8_t)find_root(parent, b);
}

// Rows of each group of bodies that hold on to each other, at its root: ODE solves each alone. Union by path
// halving.
static void count_islands(const gv_problem *problem, int out_rows[GV_BODIES]) {
  uint8_t parent[GV_BODIES];
  for (int i = 0; i < GV_BODIES; i++)
    parent[i] = (uint8_t)i;
  memset(out_rows, 0, GV_BODIES * sizeof *out_rows);
  for (int i = 0; i < problem->contact_count; i++)
    join(problem, parent, problem->contact[i].body_a, problem->contact[i].body_b);
  for (int i = 0; i < problem->row_count; i++)
    join(problem, parent, problem->row[i].body_a, problem->row[i].body_b);
  for (int i = 0; i < problem->contact_count; i++)
    out_rows[find_root(parent, problem->contact[i].body_a)] += 3;
  for (int i = 0; i < problem->row_count; i++)
    out_rows[find_root(parent, problem->row[i].body_a)]++;
}

// Of one round, as bodies jammed into each other need it (99 of 100 of them; a grasp needs a sixth): 4 us a
// row (12 a contact) and half a nanosecond a cube of an island's rows.
static double round_cost_s(const gv_problem *problem) {
  int count[GV_BODIES];
  double sum = 1e-6;
  count_islands(problem, count);
  for (int i = 0; i < problem->body_count; i++) {
    const double rows = count[i];
    if (count[i] > MOST_ROWS)
      return HUGE_VAL;
    sum += 4e-6 * rows + 5e-10 * rows * rows * rows;
  }
  return sum;
}

// ---- limits ---------------------------------------------------------------------------------------

static bool is_of(const guess *g, const gv_problem_contact *c) {
  return g->body_a == c->body_a && g->body_b == c->body_b;
}

// Those of the same two bodies in the last step; of a new contact what ODE makes of its law. True where all
// are known.
static bool take_guess(gv_dantzig *s, const gv_problem *problem) {
  bool used[GV_MAX_CONTACTS] = {false};
  bool known = true;
  for (int i = 0; i < problem->contact_count; i++) {
    const gv_problem_contact *c = &problem->contact[i];
    s->limit[i].along[0] = s->limit[i].along[1] = GV_ODE_OWN_LAW;
    int k = 0;
    while (k < s->last_count && (used[k] || !is_of(&s->last[k], c)))
      k++;
    if (k < s->last_count) {
      used[k] = true;
      s->limit[i] = s->last[k].limit;
    }
    known = known && k < s->last_count;
  }
  return known;
}

static void keep_guess(gv_dantzig *s, const gv_problem *problem) {
  for (int i = 0; i < problem->contact_count; i++)
    s->last[i] = (guess){problem->contact[i].body_a, problem->contact[i].body_b, s->limit[i]};
  s->last_count = problem->contact_count;
}

static gv_vec3 slip(const gv_problem *problem, const gv_problem_contact *c, const gv_velocity velocity[]) {
  const gv_velocity *a = &velocity[c->body_a];
  const gv_vec3 u = gv_add(a->v, gv_cross(a->w, gv_sub(c->point, problem->body[c->body_a].p)));
  if (!(problem->body[c->body_b].mass > 0.0))
    return u;
  const gv_velocity *b = &velocity[c->body_b];
  return gv_sub(u, gv_add(b->v, gv_cross(b->w, gv_sub(c->point, problem->body[c->body_b].p))));
}

static gv_ode_limit limit_of(const gv_problem *problem, const gv_problem_contact *c,
                             const gv_velocity velocity[], gv_vec3 impulse) {
  if (c->friction == GV_FRICTION_FIXED_LIMIT)
    return (gv_ode_limit){{GV_ODE_OWN_LAW, GV_ODE_OWN_LAW}};
  const double mass_a = problem->body[c->body_a].mass;
  const double mass_b = problem->body[c->body_b].mass;
  const double rho = mass_b > 0.0 ? mass_a * mass_b / (mass_a + mass_b) : mass_a;
  const gv_vec3 y = gv_mad(impulse, -rho, slip(problem, c, velocity));
  const double bound = c->mu * fmax(0.0, gv_dot(c->frame[0], impulse));
  const double y1 = fabs(gv_dot(c->frame[1], y));
  const double y2 = fabs(gv_dot(c->frame[2], y));
  const double length = sqrt(y1 * y1 + y2 * y2);
  if (length <= bound)
    return (gv_ode_limit){{bound, bound}};
  return (gv_ode_limit){{bound * y1 / length, bound * y2 / length}};
}

static gv_ode_limit halfway(gv_ode_limit a, gv_ode_limit b) {
  return (gv_ode_limit){{0.5 * (a.along[0] + b.along[0]), 0.5 * (a.along[1] + b.along[1])}};
}

// The limits that an answer gives; true where they are those that it was found with.
static bool set_limits(gv_dantzig *s, const gv_problem *problem, bool damp, const gv_velocity velocity[],
                       const gv_vec3 impulse[]) {
  bool agree = true;
  for (int i = 0; i < problem->contact_count; i++) {
    const gv_ode_limit was = s->limit[i];
    const gv_ode_limit now = limit_of(problem, &problem->contact[i], velocity, impulse[i]);
    const double off = fmax(fabs(now.along[0] - was.along[0]), fabs(now.along[1] - was.along[1]));
    if (off > agree_n_s + agree_share * fmax(now.along[0], now.along[1]))
      agree = false;
    s->limit[i] = damp ? halfway(was, now) : now;
  }
  return agree;
}

// ---- the solver -----------------------------------------------------------------------------------

static bool has_coulomb(const gv_problem *problem) {
  for (int i = 0; i < problem->contact_count; i++)
    if (problem->contact[i].friction != GV_FRICTION_FIXED_LIMIT)
      return true;
  return false;
}

static gv_outcome solve(void *memory, const gv_problem *problem, gv_velocity out_velocity[],
                        gv_vec3 out_impulse[]) {
  gv_dantzig *s = memory;
  const bool known = take_guess(s, problem) || !has_coulomb(problem);
  const double fit = problem->budget_s / round_cost_s(problem);
  if (fit < (known ? 1 : 2))
    return GV_OUTCOME_NONE;
  const int rounds = (int)fmin(fit, known ? ROUNDS_KNOWN : ROUNDS);
  const gv_ode_method method = {.limit = s->limit};
  bool agree = false;
  for (int round = 0; round < rounds && !agree; round++) {
    if (!gv_ode_solve(s->ode, problem, &method, out_velocity, out_impulse))
      return GV_OUTCOME_NONE;
    agree = set_limits(s, problem, known || round >= DAMPED_FROM, out_velocity, out_impulse);
  }
  keep_guess(s, problem);
  return agree ? GV_OUTCOME_SOLVED : GV_OUTCOME_LAGGED;
}

static void forget(void *memory) {
  gv_dantzig *s = memory;
  s->last_count = 0;
}

static void init(void *memory, gv_ode *ode) {
  gv_dantzig *s = memory;
  s->ode = ode;
}

const gv_contact_solver gv_solver_dantzig = {
  .name = "dantzig", .memory_size = sizeof(gv_dantzig), .init = init, .solve = solve, .forget = forget};
