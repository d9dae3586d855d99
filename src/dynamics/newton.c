// SPDX-License-Identifier: BSD-3-Clause
// Contact with Coulomb's friction, exactly, by a semismooth Newton method (Alart and Curnier 1991) on the velocities of
// the bodies that touch. Of each contact with normal n, from body b to body a: x its impulse on a, u = J v - a n its
// velocity beyond the target a, C = diag(c_n, c_t, c_t) its compliance along and across n. Sought are v and x with
//
//   M (v - v_free) = J^T x                                                                    (1)
//   w = u + C x:   0 <= x_n | w_n >= 0,   |x_t| <= mu x_n,   w_t = -lambda x_t, lambda >= 0 only where |x_t| = mu x_n  (2)
//
// The active set says of each contact whether it is open, sticks, or slides with friction along the unit tangent e. On
// it the law is linear, x = -K u, with f = n x e, d = n + mu e:
//
//   open      K = 0
//   sticking  K = C^-1
//   sliding   K = 1/c_n d n^T + 1/(c_t + lambda) f f^T   (the bound follows the normal impulse: K is not symmetric)  (3)
//
// and with v = v_free + dv, (1) becomes one system of linear equations, a 6 x 6 block for each pair of bodies (blocks.c):
//
//   (M + J^T K J) dv = -J^T K (J v_free - a n)                                                (4)
//
// A limb with no other contact is eliminated first (its Schur complement): with W = J M^-1 J^T of that limb its contact is
// a softer one to the other body, K = (C + W)^-1 where it sticks, and where it slides
//
//   K = [d f] (diag(c_n, c_t + lambda) + [n f]^T W [d f])^-1 [n f]^T                          (5)
//
// The next active set is where a step of rho = 1/(W + C) (W of all bodies of that contact) leads, projected onto the cone:
//
//   y_n = x_n - rho_n w_n,  y_t = x_t - rho_t w_t;   y_n <= 0 open;  |y_t| <= mu y_n sticks;
//   else slides along e = y_t / |y_t| with lambda = (|y_t| - mu y_n) / (mu y_n rho_t)         (6)
//
// and x is a solution where it is that projection itself: the residual. The solver begins with the active set of the last
// step, which in a held grasp is right: one factorization and done. Where full steps do not settle, the programme below
// goes on: first with other steps, then from a problem with much softer friction, which is easy, back to the one asked.
// Real-time thread.
#include "dynamics/newton.h"

#include <assert.h>

typedef struct stage {
  double weight;                 // of W in rho: 1 Alart and Curnier's, 0 the plain velocity map
  double softening;              // factor on the tangent compliance
  int solves;                    // at most
  enum { FROM_LAST_STEP, FROM_STAGE_BEFORE } start; // the latter only where that one ended
} stage;

// Chosen on the recorded grasps and on random problems: of 5,000 nasty ones the first stage ends 97 %, the next three
// 1.6 %, the softened ones all but 2 of the rest, with the compliance asked or, in 13, a softer one.
static const stage programme[] = {
  {1.0, 1, 12, FROM_LAST_STEP},
  {0.1, 1, 12, FROM_LAST_STEP},
  {0.0, 1, 8, FROM_LAST_STEP},
  {0.33, 1, 8, FROM_LAST_STEP},
  {1.0, 1e7, 12, FROM_LAST_STEP},
  {0.33, 1e6, 8, FROM_STAGE_BEFORE},
  {0.33, 1e5, 8, FROM_STAGE_BEFORE},
  {0.33, 1e4, 8, FROM_STAGE_BEFORE},
  {0.33, 1e3, 8, FROM_STAGE_BEFORE},
  {0.33, 1e2, 8, FROM_STAGE_BEFORE},
  {0.33, 1e1, 8, FROM_STAGE_BEFORE},
  {0.33, 1, 8, FROM_STAGE_BEFORE},
};
enum { STAGES = sizeof programme / sizeof programme[0], LEAST_SOLVES = 12, MOST_SOLVES = 100 };

// ---- the problem ----------------------------------------------------------------------------------

static void add_node(gv_newton *s, const gv_problem *problem, int body) {
  const gv_problem_body *b = &problem->body[body];
  gv_newton_node *node = &s->node[s->nodes];
  assert(s->nodes < GV_NODES);
  node->body = body;
  node->mass = b->mass;
  node->inertia = b->inertia;
  node->inverse_inertia = gv_mat3_inverse(&b->inertia);
  s->node_of[body] = s->nodes++;
}

static bool is_limb(int body) { return body < GV_LIMBS; }

// Bodies that move and touch something: first those of the matrix, then the limbs with a single contact.
static void make_nodes(gv_newton *s, const gv_problem *problem) {
  int weight[GV_BODIES] = {0};   // 1: a limb with one contact, of which it is body a
  for (int i = 0; i < s->count; i++) {
    const gv_problem_contact *c = &problem->contact[i];
    weight[c->body_a] += is_limb(c->body_b) ? 2 : 1;
    weight[c->body_b] += 2;
  }
  s->nodes = 0;
  for (int b = 0; b < problem->body_count; b++) {
    s->node_of[b] = -1;
    if (weight[b] == 0 || !(problem->body[b].mass > 0.0)) continue;
    if (!is_limb(b) || weight[b] > 1) add_node(s, problem, b);
  }
  gv_blocks_begin(&s->blocks, s->nodes);
  for (int b = 0; b < GV_LIMBS && b < problem->body_count; b++)
    if (weight[b] == 1 && problem->body[b].mass > 0.0) add_node(s, problem, b);
}

static gv_vec3 point_velocity(const gv_problem_body *b, gv_vec3 arm) { return gv_add(b->v, gv_cross(b->w, arm)); }

static void make_contact(gv_newton *s, const gv_problem *problem, int i) {
  const gv_problem_contact *from = &problem->contact[i];
  const gv_problem_body *a = &problem->body[from->body_a], *b = &problem->body[from->body_b];
  gv_newton_contact *c = &s->contact[i];
  c->body_a = from->body_a;
  c->body_b = from->body_b;
  c->node_a = s->node_of[from->body_a];
  c->node_b = s->node_of[from->body_b];
  c->normal = from->frame[0];
  c->arm_a = gv_sub(from->point, a->p);
  c->arm_b = gv_sub(from->point, b->p);
  c->mu = from->mu;
  c->compliance_n = from->normal_compliance;
  c->compliance_t = from->tangent_compliance;
  const gv_vec3 u = gv_sub(point_velocity(a, c->arm_a), point_velocity(b, c->arm_b));
  c->free_u = gv_mad(u, -from->target_velocity, c->normal);
  c->inverse_mass_n = c->inverse_mass_t = -1.0;
  c->is_lone = c->node_a >= s->blocks.nodes;
  assert(fabs(gv_norm2(c->normal) - 1.0) < 1e-5);
  if (!c->is_lone) return;
  const gv_newton_node *limb = &s->node[c->node_a];
  c->turn = limb->inverse_inertia.m[0][0];
  c->give = 1.0 / limb->mass + c->turn * gv_norm2(c->arm_a);
}

// As many linear solves as fit into the budget; as measured, 0.1 us a contact and 0.08 us a block operation each. None
// where too few fit to be worth a try.
static int count_solves(const gv_newton *s, const gv_problem *problem) {
  const double solve_s = 1e-7 * s->count + 8e-8 * s->blocks.work;
  const int fit = (int)fmin(problem->budget_s / fmax(solve_s, 1e-6), MOST_SOLVES);
  return fit < LEAST_SOLVES ? 0 : fit;
}

static bool make_problem(gv_newton *s, const gv_problem *problem) {
  s->count = problem->contact_count;
  make_nodes(s, problem);
  for (int i = 0; i < s->count; i++) {
    if (problem->contact[i].friction != GV_FRICTION_PYRAMID) return false;
    make_contact(s, problem, i);
    const gv_newton_contact *c = &s->contact[i];
    const bool linked = c->node_a >= 0 && c->node_b >= 0 && !c->is_lone;
    if (linked) gv_blocks_link(&s->blocks, c->node_a, c->node_b);
  }
  if (!gv_blocks_order(&s->blocks)) return false;
  s->solves = 0;
  s->solves_left = count_solves(s, problem);
  return true;
}

// ---- where to begin -------------------------------------------------------------------------------

// The state of the last step's contact, friction turned into the new tangent plane.
static void take_guess(gv_newton_contact *c, const gv_newton_guess *g) {
  const gv_vec3 e = gv_mad(g->friction_dir, -gv_dot(g->friction_dir, c->normal), c->normal);
  c->first.state = g->state;
  c->first.lambda = g->lambda;
  c->first.friction_dir = gv_normalize_or(e, gv_any_perpendicular(c->normal));
}

// Contacts of the same two bodies belong together in their order, which is mostly that of the last step.
static int find_guess(const gv_newton *s, const gv_newton_contact *c, const bool used[], int from) {
  for (int tried = 0; tried < s->last_count; tried++) {
    const int k = (from + tried) % s->last_count;
    const gv_newton_guess *g = &s->last[k];
    if (!used[k] && g->body_a == c->body_a && g->body_b == c->body_b) return k;
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
      take_guess(c, &s->last[k]);
      continue;
    }
    const bool parts = gv_dot(c->free_u, c->normal) > 0.0;
    c->first = (gv_newton_mode){parts ? GV_NEWTON_OPEN : GV_NEWTON_STICKING, gv_any_perpendicular(c->normal), 0.0};
  }
}

static void keep_guess(gv_newton *s) {
  for (int i = 0; i < s->count; i++) {
    const gv_newton_contact *c = &s->contact[i];
    s->last[i] = (gv_newton_guess){c->body_a, c->body_b, c->mode.friction_dir, c->mode.lambda, c->mode.state};
  }
  s->last_count = s->count;
}

// ---- one linear solution, (4) ---------------------------------------------------------------------

static gv_vec3 row_of(const gv_mat3 *K, int r) { return gv_v3(K->m[r][0], K->m[r][1], K->m[r][2]); }

// row += (k, arm x k).
static void add_row(double row[6], gv_vec3 k, gv_vec3 arm) {
  const gv_vec3 turn = gv_cross(arm, k);
  row[0] += k.x;
  row[1] += k.y;
  row[2] += k.z;
  row[3] += turn.x;
  row[4] += turn.y;
  row[5] += turn.z;
}

// H += A^T K B, with A and B the 3 x 6 Jacobians 1 | -[arm]x of points at the ends of two arms.
static void add_stiffness(gv_block *H, const gv_mat3 *K, gv_vec3 arm_of_row, gv_vec3 arm_of_column) {
  const gv_vec3 c0 = gv_cross(arm_of_row, gv_mat3_column(K, 0));
  const gv_vec3 c1 = gv_cross(arm_of_row, gv_mat3_column(K, 1));
  const gv_vec3 c2 = gv_cross(arm_of_row, gv_mat3_column(K, 2));
  for (int r = 0; r < 3; r++) add_row(H->m[r], row_of(K, r), arm_of_column);
  add_row(H->m[3], gv_v3(c0.x, c1.x, c2.x), arm_of_column);
  add_row(H->m[4], gv_v3(c0.y, c1.y, c2.y), arm_of_column);
  add_row(H->m[5], gv_v3(c0.z, c1.z, c2.z), arm_of_column);
}

static void add_masses(gv_newton *s) {
  for (int n = 0; n < s->blocks.nodes; n++) {
    const gv_newton_node *node = &s->node[n];
    gv_block *H = gv_blocks_at(&s->blocks, n, n);
    for (int k = 0; k < 3; k++) {
      H->m[k][k] = node->mass;
      for (int c = 0; c < 3; c++) H->m[3 + k][3 + c] = node->inertia.m[k][c];
    }
    s->dv[n] = (gv_six){{0}};
  }
}

static void add_coupling(gv_newton *s, const gv_newton_contact *c, bool symmetric) {
  const bool a_first = gv_blocks_first(&s->blocks, c->node_a, c->node_b) == c->node_a;
  const gv_vec3 row = a_first ? c->arm_a : c->arm_b, column = a_first ? c->arm_b : c->arm_a;
  gv_mat3 K = c->stiffness;
  for (int r = 0; r < 3; r++)
    for (int k = 0; k < 3; k++) K.m[r][k] = -K.m[r][k];
  add_stiffness(gv_blocks_at(&s->blocks, c->node_a, c->node_b), &K, row, column);
  if (symmetric) return;
  K = gv_mat3_transposed(&K);
  add_stiffness(gv_blocks_mirror(&s->blocks, c->node_a, c->node_b), &K, row, column);
}

static void add_contact(gv_newton *s, const gv_newton_contact *c, bool symmetric) {
  const gv_vec3 x = gv_neg(gv_mat3_mul(&c->stiffness, c->free_u));
  const bool in_a = c->node_a >= 0 && !c->is_lone;
  if (in_a) {
    add_stiffness(gv_blocks_at(&s->blocks, c->node_a, c->node_a), &c->stiffness, c->arm_a, c->arm_a);
    add_row(s->dv[c->node_a].m, x, c->arm_a);
  }
  if (c->node_b < 0) return;
  add_stiffness(gv_blocks_at(&s->blocks, c->node_b, c->node_b), &c->stiffness, c->arm_b, c->arm_b);
  add_row(s->dv[c->node_b].m, gv_neg(x), c->arm_b);
  if (in_a) add_coupling(s, c, symmetric);
}

static gv_vec3 point_change(const gv_six *dv, gv_vec3 arm) {
  const double *m = dv->m;
  return gv_add(gv_v3(m[0], m[1], m[2]), gv_cross(gv_v3(m[3], m[4], m[5]), arm));
}

static void respond(const gv_newton *s, gv_newton_contact *c) {
  gv_vec3 r = c->free_u;
  if (c->node_a >= 0 && !c->is_lone) r = gv_add(r, point_change(&s->dv[c->node_a], c->arm_a));
  if (c->node_b >= 0) r = gv_sub(r, point_change(&s->dv[c->node_b], c->arm_b));
  gv_newton_respond(c, r);
}

static bool is_symmetric(const gv_newton *s) {
  for (int i = 0; i < s->count; i++)
    if (s->contact[i].mode.state == GV_NEWTON_SLIDING) return false;
  return true;
}

// Velocities and impulses on the active set; false where the matrix cannot be solved or time is up.
static bool solve_active_set(gv_newton *s, double softening) {
  if (s->solves_left <= 0) return false;
  s->solves_left--;
  s->solves++;
  const bool symmetric = is_symmetric(s);
  gv_blocks_clear(&s->blocks, symmetric);
  add_masses(s);
  for (int i = 0; i < s->count; i++) {
    gv_newton_contact *c = &s->contact[i];
    if (c->mode.state == GV_NEWTON_OPEN) continue;
    c->stiffness = gv_newton_stiffness(c, softening);
    add_contact(s, c, symmetric);
  }
  if (!gv_blocks_solve(&s->blocks, symmetric, s->dv)) return false;
  for (int i = 0; i < s->count; i++) respond(s, &s->contact[i]);
  return true;
}

// ---- the next active set, (6) ---------------------------------------------------------------------

// n W n and the mean of W across n.
static void find_inverse_mass(const gv_newton *s, gv_newton_contact *c) {
  double along = 0.0, trace = 0.0;
  for (int side = 0; side < 2; side++) {
    const int n = side ? c->node_b : c->node_a;
    if (n < 0) continue;
    const gv_vec3 arm = side ? c->arm_b : c->arm_a, turn = gv_cross(arm, c->normal);
    const gv_mat3 *I = &s->node[n].inverse_inertia;
    const double by_mass = 1.0 / s->node[n].mass;
    along += by_mass + gv_dot(turn, gv_mat3_mul(I, turn));
    trace += 3.0 * by_mass + (I->m[0][0] + I->m[1][1] + I->m[2][2]) * gv_norm2(arm) - gv_dot(arm, gv_mat3_mul(I, arm));
  }
  c->inverse_mass_n = along;
  c->inverse_mass_t = 0.5 * (trace - along);
}

// One that opens or sticks stays as it is whatever the steps rho are, if its own conditions hold.
static bool stands(const gv_newton_contact *c) {
  const double x_n = gv_dot(c->impulse, c->normal);
  if (c->mode.state == GV_NEWTON_OPEN) return gv_dot(c->u, c->normal) >= 0.0;
  if (c->mode.state != GV_NEWTON_STICKING || !(x_n > 0.0)) return false;
  return gv_norm2(c->impulse) <= (1.0 + c->mu * c->mu) * x_n * x_n;
}

// The residual over all contacts, in units of the tolerance (not a number where the solution was none), and next[].
static double project(gv_newton *s, double weight, double softening) {
  double worst = 0.0;
  for (int i = 0; i < s->count; i++) {
    gv_newton_contact *c = &s->contact[i];
    s->next[i] = c->mode;
    if (stands(c)) continue;
    if (c->inverse_mass_n < 0.0) find_inverse_mass(s, c);
    const double error = gv_newton_project(c, weight, softening, &s->next[i]);
    if (!(error <= worst)) worst = error;
  }
  return worst;
}

// What slid one way and now would the other way sticks first.
static void adopt_next(gv_newton *s) {
  for (int i = 0; i < s->count; i++) {
    gv_newton_mode *mode = &s->contact[i].mode;
    const gv_newton_mode was = *mode;
    *mode = s->next[i];
    if (mode->state != GV_NEWTON_SLIDING || was.state != GV_NEWTON_SLIDING) continue;
    if (gv_dot(mode->friction_dir, was.friction_dir) < 0.0) mode->state = GV_NEWTON_STICKING;
  }
}

// ---- the programme --------------------------------------------------------------------------------

static bool run_stage(gv_newton *s, const stage *st) {
  for (int i = 0; i < st->solves; i++) {
    if (!solve_active_set(s, st->softening)) return false;
    const double residual = project(s, 1.0, st->softening);
    if (residual <= 1.0) return true;
    if (!isfinite(residual)) return false;
    if (st->weight < 1.0) project(s, st->weight, st->softening);
    adopt_next(s);
  }
  return false;
}

static void start_stage(gv_newton *s, const stage *st) {
  if (st->start == FROM_STAGE_BEFORE) return;
  for (int i = 0; i < s->count; i++) s->contact[i].mode = s->contact[i].first;
}

static gv_outcome run_programme(gv_newton *s) {
  bool going = true;              // the stage before ended
  s->softening = 0.0;             // none accepted yet
  for (s->stage = 0; s->stage < STAGES; s->stage++) {
    const stage *st = &programme[s->stage];
    if (st->start == FROM_STAGE_BEFORE && !going) continue;
    if (st->start == FROM_LAST_STEP && s->softening > 0.0) break;
    start_stage(s, st);
    going = run_stage(s, st);
    if (!going) continue;
    s->softening = st->softening;
    if (st->softening <= 1.0) return GV_OUTCOME_SOLVED;
    for (int i = 0; i < s->count; i++) s->kept[i] = s->contact[i].mode;
  }
  if (!(s->softening > 0.0)) return GV_OUTCOME_NONE;
  for (int i = 0; i < s->count; i++) s->contact[i].mode = s->kept[i];
  s->solves_left++;
  return solve_active_set(s, s->softening) ? GV_OUTCOME_SOFTENED : GV_OUTCOME_NONE;
}

// ---- the answer -----------------------------------------------------------------------------------

// M^-1 J^T x of a limb that was eliminated.
static gv_six limb_change(const gv_newton *s, const gv_newton_contact *c) {
  const gv_vec3 v = gv_scale(c->impulse, 1.0 / s->node[c->node_a].mass);
  const gv_vec3 w = gv_scale(gv_cross(c->arm_a, c->impulse), c->turn);
  return (gv_six){{v.x, v.y, v.z, w.x, w.y, w.z}};
}

static bool is_finite(const gv_newton *s) {
  double sum = 0.0;
  for (int n = 0; n < s->nodes; n++)
    for (int k = 0; k < 6; k++) sum += fabs(s->dv[n].m[k]);
  return isfinite(sum);
}

static void tell(const gv_newton *s, const gv_problem *problem, gv_velocity out_velocity[], gv_vec3 out_impulse[]) {
  for (int i = 0; i < s->count; i++) out_impulse[i] = s->contact[i].impulse;
  for (int n = 0; n < s->nodes; n++) {
    const int body = s->node[n].body;
    const double *m = s->dv[n].m;
    out_velocity[body].v = gv_add(problem->body[body].v, gv_v3(m[0], m[1], m[2]));
    out_velocity[body].w = gv_add(problem->body[body].w, gv_v3(m[3], m[4], m[5]));
  }
}

static gv_outcome solve(void *memory, const gv_problem *problem, gv_velocity out_velocity[], gv_vec3 out_impulse[]) {
  gv_newton *s = memory;
  assert(problem->contact_count <= GV_MAX_CONTACTS && problem->body_count <= GV_BODIES);
  if (!make_problem(s, problem)) return GV_OUTCOME_NONE;
  choose_start(s);
  const gv_outcome outcome = run_programme(s);
  if (outcome == GV_OUTCOME_NONE) return outcome;
  for (int i = 0; i < s->count; i++)
    if (s->contact[i].is_lone) s->dv[s->contact[i].node_a] = limb_change(s, &s->contact[i]);
  if (!is_finite(s)) return GV_OUTCOME_NONE;
  keep_guess(s);
  tell(s, problem, out_velocity, out_impulse);
  return outcome;
}

static void forget(void *memory) {
  gv_newton *s = memory;
  s->last_count = 0;
}

const gv_contact_solver gv_solver_newton = {"newton", sizeof(gv_newton), solve, forget};
