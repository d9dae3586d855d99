// SPDX-License-Identifier: BSD-3-Clause
// Contact with Coulomb's friction, exactly, by a semismooth Newton method (Alart and Curnier 1991) on the
// velocities of the bodies that touch. Of each contact with normal n, from body b to body a: x its
// impulse on a, u = J v - a n its velocity beyond the target a, C = diag(c_n, c_t, c_t) its compliance
// along and across n. Sought are v and x with
//
//   M (v - v_free) = J^T x                                                                    (1)
//   w = u + C x:   0 <= x_n | w_n >= 0,   |x_t| <= mu x_n,   w_t = -lambda x_t,
//                  lambda >= 0 only where |x_t| = mu x_n                                       (2)
//
// The active set says of each contact whether it is open, sticks, or slides with friction along the unit
// tangent e. On it the law is linear, x = -K u, with f = n x e, d = n + mu e:
//
//   open      K = 0
//   sticking  K = C^-1
//   sliding   K = 1/c_n d n^T + 1/(c_t + lambda) f f^T                                         (3)
//             (the bound follows the normal impulse: K is not symmetric)
//
// and with v = v_free + dv, (1) becomes one system of linear equations, a 6 x 6 block for
// each pair of bodies (blocks.c):
//
//   (M + J^T K J) dv = -J^T K (J v_free - a n)                                                (4)
//
// A limb with no other contact is eliminated first (its Schur complement): with W = J M^-1 J^T of that limb
// its contact is a softer one to the other body, K = (C + W)^-1 where it sticks, and where it slides
//
//   K = [d f] (diag(c_n, c_t + lambda) + [n f]^T W [d f])^-1 [n f]^T                          (5)
//
// The next active set is where a step of rho = 1/(W + C) (W of all bodies of that contact)
// leads, projected onto the cone:
//
//   y_n = x_n - rho_n w_n,  y_t = x_t - rho_t w_t;   y_n <= 0 open;  |y_t| <= mu y_n sticks;
//   else slides along e = y_t / |y_t| with lambda = (|y_t| - mu y_n) / (mu y_n rho_t)         (6)
//
// and x is a solution where it is that projection itself: the residual. The solver begins with the active
// set of the last step, which in a held grasp is right: one factorization and done. Where full steps do not
// settle, the programme below goes on: first with other steps, then from a problem with much softer
// friction, which is easy, back to the one asked. Real-time thread.
#include "dynamics/newton.h"

#include <assert.h>
#include <string.h>

#include "dynamics/newton_system.h"

typedef struct stage {
  double weight;     // of W in rho: 1 Alart and Curnier's, 0 the plain velocity map
  double softening;  // factor on the tangent compliance
  int solves;        // at most
  enum { FROM_LAST_STEP, FROM_STAGE_BEFORE } start;  // the latter only where that one ended
  bool damped;                                       // halve a step that leads away
} stage;

// Chosen on the recorded grasps and on random problems: of 5,000 nasty ones the first stage ends 98 %, the
// second 1.4 %, the third 0.5 %, the softened ones all but 2 of the rest: 15 with the compliance asked, 6
// with a softer one. clang-format off: a row a stage
static const stage programme[] = {
  {1.0, 1, 16, FROM_LAST_STEP, false},      {0.0, 1, 24, FROM_LAST_STEP, true},
  {0.1, 1, 16, FROM_LAST_STEP, true},       {1.0, 1e7, 12, FROM_LAST_STEP, false},
  {0.33, 1e6, 8, FROM_STAGE_BEFORE, false}, {0.33, 1e5, 8, FROM_STAGE_BEFORE, false},
  {0.33, 1e4, 8, FROM_STAGE_BEFORE, false}, {0.33, 1e3, 8, FROM_STAGE_BEFORE, false},
  {0.33, 1e2, 8, FROM_STAGE_BEFORE, false}, {0.33, 1e1, 8, FROM_STAGE_BEFORE, false},
  {0.33, 1, 8, FROM_STAGE_BEFORE, false},
};
// clang-format on
enum { STAGES = sizeof programme / sizeof programme[0], MOST_SOLVES = 100 };

// ---- where to begin -------------------------------------------------------------------------------

// The state of the last step's contact, friction turned into the new tangent plane.
static void take_guess(gv_newton *s, gv_newton_contact *c, const gv_newton_guess *g) {
  const gv_vec3 e = gv_mad(g->friction_dir, -gv_dot(g->friction_dir, c->normal), c->normal);
  c->first.state = g->state;
  c->first.lambda = g->lambda;
  c->first.friction_dir = gv_normalize_or(e, gv_any_perpendicular(c->normal));
  if (c->spin < 0)
    return;
  gv_newton_row *row = &s->row[c->spin];
  row->first = row->state = (gv_row_state)g->spin;
  row->high = g->spin_most;
  row->low = -g->spin_most;
}

// Contacts of the same two bodies belong together in their order, which is mostly that of the last step.
static int find_guess(const gv_newton *s, const gv_newton_contact *c, const bool used[], int from) {
  for (int tried = 0; tried < s->last_count; tried++) {
    const int k = (from + tried) % s->last_count;
    const gv_newton_guess *g = &s->last[k];
    if (!used[k] && g->body_a == c->body_a && g->body_b == c->body_b)
      return k;
  }
  return -1;
}

// A contact that is new sticks if nothing else happened.
static void choose_start(gv_newton *s) {
  bool used[GV_MAX_CONTACTS] = {false};
  int at = 0;
  for (int i = 0; i < s->count; i++) {
    gv_newton_contact *c = &s->contact[i];
    const int k = find_guess(s, c, used, at);
    if (k >= 0) {
      used[k] = true;
      at = k + 1;
      take_guess(s, c, &s->last[k]);
      continue;
    }
    const bool parts = gv_dot(c->free_u, c->normal) > 0.0;
    c->first = (gv_newton_mode){parts ? GV_NEWTON_OPEN : GV_NEWTON_STICKING, gv_any_perpendicular(c->normal),
                                0.0};
  }
}

static void keep_guess(gv_newton *s) {
  assert(s->count >= 0 && s->count <= GV_MAX_CONTACTS);
  for (int i = 0; i < s->count; i++) {
    const gv_newton_contact *c = &s->contact[i];
    const gv_newton_row *spin = c->spin < 0 ? NULL : &s->row[c->spin];
    s->last[i] = (gv_newton_guess){.body_a = c->body_a,
                                   .body_b = c->body_b,
                                   .friction_dir = c->mode.friction_dir,
                                   .lambda = c->mode.lambda,
                                   .state = c->mode.state,
                                   .spin = spin ? (uint8_t)spin->state : GV_ROW_HOLDS,
                                   .spin_most = spin ? spin->high : 0.0};
  }
  s->last_count = s->count;
}

// ---- the next active set, (6) ---------------------------------------------------------------------

// One that opens or sticks stays as it is whatever the steps rho are, if its own conditions hold.
static bool stands(const gv_newton_contact *c) {
  const double x_n = gv_dot(c->impulse, c->normal);
  if (c->mode.state == GV_NEWTON_OPEN)
    return gv_dot(c->u, c->normal) >= 0.0;
  if (c->mode.state != GV_NEWTON_STICKING || !(x_n > 0.0))
    return false;
  return gv_norm2(c->impulse) <= (1.0 + c->mu * c->mu) * x_n * x_n;
}

static void project_contact(gv_newton *s, gv_newton_contact *c, double weight, double softening) {
  if (c->inverse_mass_n < 0.0)
    gv_newton_find_inverse_mass(s, c);
  const gv_newton_projection p = gv_newton_project(c, weight, softening);
  c->next = p.mode;
  c->residual = p.residual;
  c->merit = p.merit;
}

// Next modes after a full step, and the residual over all contacts (not a number
// where there was no solution).
static double project(gv_newton *s, double weight, double softening) {
  double worst = 0.0;
  for (int i = 0; i < s->count; i++) {
    gv_newton_contact *c = &s->contact[i];
    c->residual = 0.0;
    if (stands(c))
      continue;
    project_contact(s, c, weight, softening);
    if (!(c->residual <= worst))
      worst = c->residual;
  }
  double merit = 0.0;
  const double rows = gv_newton_rows_project(s, weight, &merit);
  return rows <= worst ? worst : rows;
}

// What slid one way and now would the other way sticks first.
static void adopt_mode(gv_newton_contact *c) {
  const gv_newton_mode was = c->mode;
  c->mode = c->next;
  c->changed = true;
  if (c->mode.state != GV_NEWTON_SLIDING || was.state != GV_NEWTON_SLIDING)
    return;
  if (gv_dot(c->mode.friction_dir, was.friction_dir) < 0.0)
    c->mode.state = GV_NEWTON_STICKING;
}

static bool wants_another_state(const gv_newton_contact *c) {
  return c->residual > 1.0 && c->next.state != c->mode.state;
}

// Of contacts that want another state the one that is farthest off gets it: the others mostly follow from
// it, and where all change at once they go in circles. Of more than one pair of pieces can have (a ring of
// sixteen pieces flat on the table: 74) all that are a tenth as far off get it: one by one would take as
// many solves. Those that slide on follow their slip.
static void adopt_modes(gv_newton_contact contact[], int count) {
  const double share = count > GV_MAX_PAIR_CONTACTS ? 0.1 : 1.0;
  double worst = 0.0;
  for (int i = 0; i < count; i++)
    if (wants_another_state(&contact[i]))
      worst = fmax(worst, contact[i].residual);
  for (int i = 0; i < count; i++) {
    gv_newton_contact *c = &contact[i];
    if (!(c->residual > 1.0))
      continue;
    if (c->next.state == c->mode.state || c->residual >= share * worst)
      adopt_mode(c);
  }
}

// Contacts of the same two bodies lie beside each other.
static void adopt_modes_by_pair(gv_newton *s) {
  int first = 0;
  for (int i = 1; i <= s->count; i++) {
    const gv_newton_contact *c = &s->contact[first];
    if (i < s->count && s->contact[i].body_a == c->body_a && s->contact[i].body_b == c->body_b)
      continue;
    adopt_modes(&s->contact[first], i - first);
    first = i;
  }
  gv_newton_rows_adopt(s);
}

// ---- what it costs --------------------------------------------------------------------------------

// Of one solution, seconds: a contact that answers and is projected, a block that one adds to the matrix,
// and a block operation there. Measured in heaps of sixty boxes (2,900 steps of 1 to 60 solutions, warm
// caches; the sum follows the time within a fifth), and a third more.
static double solve_cost_s(int contacts, int assembled, int block_operations) {
  assert(contacts >= 0 && assembled >= 0 && block_operations >= 0);
  return 2e-8 * contacts + 6e-8 * assembled + 8e-8 * block_operations;
}

// Of looking along a damped step once.
static double look_cost_s(int contacts) { return 5.5e-8 * contacts; }

static double set_up_cost_s(int contacts) { return 1e-6 + 3e-8 * contacts; }

// ---- damping --------------------------------------------------------------------------------------

// Impulses and velocities so far along the step, next modes there, and how far all that is from a solution.
static double go_along_step(gv_newton *s, const stage *st, double t) {
  double merit = 0.0;
  s->time_left_s -= look_cost_s(s->count);
  for (int i = 0; i < s->count; i++) {
    gv_newton_contact *c = &s->contact[i];
    c->impulse = gv_mad(c->from_impulse, t, gv_sub(c->full_impulse, c->from_impulse));
    c->u = gv_mad(c->from_u, t, gv_sub(c->full_u, c->from_u));
    project_contact(s, c, st->weight, st->softening);
    merit += c->merit;
  }
  for (int i = 0; i < s->rows; i++) {
    gv_newton_row *row = &s->row[i];
    row->impulse = row->from_impulse + t * (row->full_impulse - row->from_impulse);
    row->u = row->from_u + t * (row->full_u - row->from_u);
  }
  gv_newton_rows_project(s, st->weight, &merit);
  return merit;
}

// The first of 1, 1/2, 1/4... of the step that leads nearer to a solution, or the
// best of them. Returns its merit.
static double damp_step(gv_newton *s, const stage *st, double merit_before) {
  enum { HALVINGS = 5 };
  for (int i = 0; i < s->count; i++) {
    s->contact[i].full_impulse = s->contact[i].impulse;
    s->contact[i].full_u = s->contact[i].u;
  }
  for (int i = 0; i < s->rows; i++) {
    s->row[i].full_impulse = s->row[i].impulse;
    s->row[i].full_u = s->row[i].u;
  }
  double t = 1.0;
  double best = 1.0;
  double least = go_along_step(s, st, 1.0);
  for (int i = 0; i < HALVINGS && least > merit_before && s->time_left_s > 0.0; i++) {
    t *= 0.5;
    const double merit = go_along_step(s, st, t);
    if (merit >= least)
      continue;
    least = merit;
    best = t;
  }
  if (t != best)
    go_along_step(s, st, best);
  return least;
}

static void begin_next_step_here(gv_newton *s) {
  for (int i = 0; i < s->count; i++) {
    s->contact[i].from_impulse = s->contact[i].impulse;
    s->contact[i].from_u = s->contact[i].u;
  }
  for (int i = 0; i < s->rows; i++) {
    s->row[i].from_impulse = s->row[i].impulse;
    s->row[i].from_u = s->row[i].u;
  }
}

// ---- the programme --------------------------------------------------------------------------------

// The first solution of a stage is the dearest, where everything changes: none is begun that would not fit.
static bool solve_within_budget(gv_newton *s, double softening) {
  const int parts = s->count + s->rows;
  if (s->solves >= MOST_SOLVES || s->time_left_s < solve_cost_s(parts, s->most_assembled, s->blocks.work))
    return false;
  s->solves++;
  const bool solved = gv_newton_solve(s, softening);
  s->time_left_s -= solve_cost_s(parts, s->assembled, s->blocks.work_done);
  return solved;
}

// Next modes where the stage's own steps lead. Returns the merit, of damped stages.
static double choose_next(gv_newton *s, const stage *st, int solve, double merit) {
  if (!st->damped) {
    if (st->weight < 1.0)
      project(s, st->weight, st->softening);
    return HUGE_VAL;
  }
  if (solve == 0)
    begin_next_step_here(s);
  merit = damp_step(s, st, merit);
  begin_next_step_here(s);
  return merit;
}

static bool run_stage(gv_newton *s, const stage *st) {
  double merit = HUGE_VAL;
  gv_newton_change_all(s);
  for (int i = 0; i < st->solves; i++) {
    if (!solve_within_budget(s, st->softening))
      return false;
    const double residual = project(s, 1.0, st->softening);
    if (residual <= 1.0)
      return true;
    if (!isfinite(residual))
      return false;
    merit = choose_next(s, st, i, merit);
    adopt_modes_by_pair(s);
  }
  return false;
}

static void start_stage(gv_newton *s, const stage *st) {
  if (st->start == FROM_STAGE_BEFORE)
    return;
  for (int i = 0; i < s->count; i++)
    s->contact[i].mode = s->contact[i].first;
  for (int i = 0; i < s->rows; i++)
    s->row[i].state = s->row[i].first;
}

static gv_outcome run_programme(gv_newton *s) {
  bool going = true;   // the stage before ended
  s->softening = 0.0;  // none accepted yet
  for (s->stage = 0; s->stage < STAGES; s->stage++) {
    const stage *st = &programme[s->stage];
    if (st->start == FROM_STAGE_BEFORE && !going)
      continue;
    if (st->start == FROM_LAST_STEP && s->softening > 0.0)
      break;
    start_stage(s, st);
    going = run_stage(s, st);
    if (!going)
      continue;
    s->softening = st->softening;
    if (st->softening <= 1.0)
      return GV_OUTCOME_SOLVED;
    for (int i = 0; i < s->count; i++)
      s->kept[i] = s->contact[i].mode;
    for (int i = 0; i < s->rows; i++)
      s->row[i].kept = s->row[i].state;
  }
  if (!(s->softening > 0.0))
    return GV_OUTCOME_NONE;
  for (int i = 0; i < s->count; i++)
    s->contact[i].mode = s->kept[i];
  for (int i = 0; i < s->rows; i++)
    s->row[i].state = s->row[i].kept;
  gv_newton_change_all(s);
  return gv_newton_solve(s, s->softening) ? GV_OUTCOME_SOFTENED : GV_OUTCOME_NONE;
}

// ---- the answer -----------------------------------------------------------------------------------

static gv_outcome solve(void *memory, const gv_problem *problem, gv_velocity out_velocity[],
                        gv_vec3 out_impulse[]) {
  gv_newton *s = memory;
  assert(problem->contact_count <= GV_MAX_CONTACTS && problem->body_count <= GV_BODIES);
  if (!gv_newton_set_up(s, problem)) {
    s->count = 0;
    return GV_OUTCOME_NONE;
  }
  s->solves = 0;
  s->time_left_s = problem->budget_s - set_up_cost_s(s->count + s->rows);
  choose_start(s);
  gv_newton_rows_start(s);
  const gv_outcome outcome = run_programme(s);
  keep_guess(s);
  gv_newton_rows_keep(s);
  if (outcome == GV_OUTCOME_NONE || !gv_newton_tell(s, problem, out_velocity))
    return GV_OUTCOME_NONE;
  for (int i = 0; i < s->count; i++)
    out_impulse[i] = s->contact[i].impulse;
  return outcome;
}

// ---- another solver's answer ----------------------------------------------------------------------

static gv_vec3 change_at(const gv_problem *problem, int body, const gv_velocity velocity[], gv_vec3 arm) {
  const gv_problem_body *b = &problem->body[body];
  const gv_vec3 turn = gv_cross(gv_sub(velocity[body].w, b->w), arm);
  return gv_add(gv_sub(velocity[body].v, b->v), turn);
}

// The active set that the projection (6) reads off an inexact answer is nearer to the next step's
// than that of an iteration that was given up: with it a heap of boxes that quickstep holds comes
// back to Newton as soon as it has settled.
static void learn(void *memory, const gv_problem *problem, const gv_velocity velocity[],
                  const gv_vec3 impulse[]) {
  gv_newton *s = memory;
  if (s->count != problem->contact_count)
    return;
  for (int i = 0; i < s->count; i++) {
    gv_newton_contact *c = &s->contact[i];
    c->u = c->free_u;
    if (c->node_a >= 0)
      c->u = gv_add(c->u, change_at(problem, c->body_a, velocity, c->arm_a));
    if (c->node_b >= 0)
      c->u = gv_sub(c->u, change_at(problem, c->body_b, velocity, c->arm_b));
    c->impulse = impulse[i];
    project_contact(s, c, 1.0, 1.0);
    c->mode = c->next;
  }
  keep_guess(s);
}

static void forget(void *memory) {
  gv_newton *s = memory;
  s->last_count = 0;
  memset(s->last_row, 0, sizeof s->last_row);
}

const gv_contact_solver gv_solver_newton = {
  .name = "newton", .memory_size = sizeof(gv_newton), .solve = solve, .learn = learn, .forget = forget};
