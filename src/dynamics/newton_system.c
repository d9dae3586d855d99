// SPDX-License-Identifier: BSD-3-Clause
// From the contact problem to the linear equations (4) of newton.c, and their solution. Limbs that
// touch one other body are leaves of the graph of contacts: each is eliminated by itself before the
// matrix (one contact: (5), a 3 x 3 inverse; more: one 6 x 6 block), and what it leaves on the other
// body is kept until one of its contacts changes its mode. So the second and later solves of a step
// cost what has changed. Real-time thread.
#include "dynamics/newton_system.h"

#include <assert.h>
#include <string.h>

// ---- bodies ---------------------------------------------------------------------------------------

enum { NOBODY = -2, STATIC = -1, MANY = GV_BODIES };

// Where the limbs of a second hand begin; the number of bodies where there is none.
static int second_hand(const gv_problem *problem) {
  return problem->second_hand > 0 ? problem->second_hand : problem->body_count;
}

static bool is_limb(const gv_problem *problem, int body) {
  return gv_body_is_limb(body, second_hand(problem));
}

static void add_node(gv_newton *s, const gv_problem *problem, int body) {
  assert(body >= 0 && body < problem->body_count);
  const gv_problem_body *b = &problem->body[body];
  gv_newton_node *node = &s->node[s->nodes];
  assert(s->nodes < GV_NODES);
  node->body = body;
  node->mass = b->mass;
  node->inertia = b->inertia;
  node->inverse_inertia = gv_mat3_inverse(&b->inertia);
  s->node_of[body] = s->nodes++;
}

// The one body that each limb touches, which itself must not be a leaf. A limb in a row is none.
static void find_partners(const gv_newton *s, const gv_problem *problem, int out_partner[GV_BODIES]) {
  for (int i = 0; i < GV_LIMBS; i++)
    out_partner[i] = NOBODY;
  for (int i = second_hand(problem); i < problem->body_count; i++)
    out_partner[i] = NOBODY;
  for (int i = 0; i < s->count; i++) {
    const gv_problem_contact *c = &problem->contact[i];
    const int other = problem->body[c->body_b].mass > 0.0 ? c->body_b : STATIC;
    if (is_limb(problem, c->body_b))
      out_partner[c->body_b] = MANY;
    if (!is_limb(problem, c->body_a))
      continue;
    int *partner = &out_partner[c->body_a];
    *partner = c->patch > 0.0 || (*partner != NOBODY && *partner != other) ? MANY : other;
  }
  for (int i = 0; i < problem->row_count; i++) {
    const gv_problem_row *row = &problem->row[i];
    if (is_limb(problem, row->body_a))
      out_partner[row->body_a] = MANY;
    if (row->body_b != GV_WORLD && is_limb(problem, row->body_b))
      out_partner[row->body_b] = MANY;
  }
}

static void add_if_leaf(gv_newton *s, const gv_problem *problem, int body, int partner) {
  if (partner == MANY || partner == NOBODY || !(problem->body[body].mass > 0.0))
    return;
  add_node(s, problem, body);
  gv_newton_limb *limb = &s->limb[s->limbs++];
  limb->node = s->node_of[body];
  limb->other = partner == STATIC ? -1 : s->node_of[partner];
  limb->first = limb->count = 0;
}

// Bodies that move and touch something: first those of the matrix, then the leaves.
static void make_nodes(gv_newton *s, const gv_problem *problem) {
  int partner[GV_BODIES];
  bool touched[GV_BODIES] = {false};
  find_partners(s, problem, partner);
  for (int i = 0; i < s->count; i++)
    touched[problem->contact[i].body_a] = touched[problem->contact[i].body_b] = true;
  for (int i = 0; i < problem->row_count; i++) {
    touched[problem->row[i].body_a] = true;
    if (problem->row[i].body_b != GV_WORLD)
      touched[problem->row[i].body_b] = true;
  }
  s->nodes = s->limbs = 0;
  for (int b = 0; b < problem->body_count; b++) {
    s->node_of[b] = -1;
    if (!touched[b] || !(problem->body[b].mass > 0.0))
      continue;
    if (!is_limb(problem, b) || partner[b] == MANY)
      add_node(s, problem, b);
  }
  gv_blocks_begin(&s->blocks, s->nodes);
  for (int b = 0; b < GV_LIMBS && b < problem->body_count; b++)
    add_if_leaf(s, problem, b, partner[b]);
  for (int b = second_hand(problem); b < problem->body_count; b++)
    add_if_leaf(s, problem, b, partner[b]);
}

// ---- contacts -------------------------------------------------------------------------------------

static gv_vec3 point_velocity(const gv_problem_body *b, gv_vec3 arm) {
  return gv_add(b->v, gv_cross(b->w, arm));
}

static void make_contact(gv_newton *s, const gv_problem *problem, int i) {
  assert(i >= 0 && i < problem->contact_count);
  const gv_problem_contact *from = &problem->contact[i];
  const gv_problem_body *a = &problem->body[from->body_a];
  const gv_problem_body *b = &problem->body[from->body_b];
  gv_newton_contact *c = &s->contact[i];
  c->body_a = from->body_a;
  c->body_b = from->body_b;
  c->node_a = s->node_of[from->body_a];
  c->node_b = s->node_of[from->body_b];
  c->limb = -1;
  c->normal = from->frame[0];
  c->arm_a = gv_sub(from->point, a->p);
  c->arm_b = gv_sub(from->point, b->p);
  c->mu = from->mu;
  c->compliance_n = from->normal_compliance;
  c->compliance_t = from->tangent_compliance;
  c->is_lone = false;
  const gv_vec3 u = gv_sub(point_velocity(a, c->arm_a), point_velocity(b, c->arm_b));
  c->free_u = gv_mad(u, -from->target_velocity, c->normal);
  c->inverse_mass_n = c->inverse_mass_t = -1.0;
  assert(fabs(gv_norm2(c->normal) - 1.0) < 1e-5 && c->compliance_n > 0.0 && c->compliance_t > 0.0);
}

static int limb_of(const gv_newton *s, const gv_newton_contact *c) { return c->node_a - s->blocks.nodes; }

// Lists the contacts of each leaf, and what the single one of a leaf yields.
static void list_contacts_of_limbs(gv_newton *s) {
  int at = 0;
  for (int i = 0; i < s->count; i++) {
    gv_newton_contact *c = &s->contact[i];
    if (limb_of(s, c) < 0)
      continue;
    c->limb = limb_of(s, c);
    s->limb[c->limb].count++;
  }
  for (int l = 0; l < s->limbs; l++) {
    s->limb[l].first = at;
    at += s->limb[l].count;
    s->limb[l].count = 0;
  }
  for (int i = 0; i < s->count; i++) {
    gv_newton_limb *limb = s->contact[i].limb < 0 ? NULL : &s->limb[s->contact[i].limb];
    if (limb)
      s->of_limb[limb->first + limb->count++] = i;
  }
}

static void mark_lone_contacts(gv_newton *s) {
  for (int l = 0; l < s->limbs; l++) {
    const gv_newton_limb *limb = &s->limb[l];
    if (limb->count > 1)
      continue;
    gv_newton_contact *c = &s->contact[s->of_limb[limb->first]];
    const gv_newton_node *node = &s->node[limb->node];
    c->is_lone = true;
    c->turn = node->inverse_inertia.m[0][0];
    c->give = 1.0 / node->mass + c->turn * gv_norm2(c->arm_a);
  }
}

static int count_assembled(const gv_newton *s) {
  int sum = 0;
  for (int i = 0; i < s->count; i++) {
    const gv_newton_contact *c = &s->contact[i];
    const bool both = c->node_a >= 0 && c->node_b >= 0;
    sum += c->limb >= 0 || both ? 4 : 1;
  }
  return sum;
}

bool gv_newton_set_up(gv_newton *s, const gv_problem *problem) {
  s->count = problem->contact_count;
  make_nodes(s, problem);
  for (int i = 0; i < s->count; i++) {
    if (problem->contact[i].friction != GV_FRICTION_COULOMB)
      return false;
    make_contact(s, problem, i);
    const gv_newton_contact *c = &s->contact[i];
    if (c->node_a >= 0 && c->node_b >= 0 && limb_of(s, c) < 0)
      gv_blocks_link(&s->blocks, c->node_a, c->node_b);
  }
  gv_newton_rows_set_up(s, problem);
  list_contacts_of_limbs(s);
  mark_lone_contacts(s);
  s->most_assembled = count_assembled(s);
  return gv_blocks_order(&s->blocks);
}

void gv_newton_find_inverse_mass(const gv_newton *s, gv_newton_contact *c) {
  double along = 0.0;
  double trace = 0.0;
  for (int side = 0; side < 2; side++) {
    const int n = side ? c->node_b : c->node_a;
    if (n < 0)
      continue;
    const gv_vec3 arm = side ? c->arm_b : c->arm_a;
    const gv_vec3 turn = gv_cross(arm, c->normal);
    const gv_mat3 *I = &s->node[n].inverse_inertia;
    const double by_mass = 1.0 / s->node[n].mass;
    along += by_mass + gv_dot(turn, gv_mat3_mul(I, turn));
    trace += 3.0 * by_mass + (I->m[0][0] + I->m[1][1] + I->m[2][2]) * gv_norm2(arm) -
             gv_dot(arm, gv_mat3_mul(I, arm));
  }
  c->inverse_mass_n = along;
  c->inverse_mass_t = 0.5 * (trace - along);
}

// ---- blocks ---------------------------------------------------------------------------------------

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
  for (int r = 0; r < 3; r++)
    add_row(H->m[r], row_of(K, r), arm_of_column);
  add_row(H->m[3], gv_v3(c0.x, c1.x, c2.x), arm_of_column);
  add_row(H->m[4], gv_v3(c0.y, c1.y, c2.y), arm_of_column);
  add_row(H->m[5], gv_v3(c0.z, c1.z, c2.z), arm_of_column);
}

static gv_mat3 negative(const gv_mat3 *K) {
  gv_mat3 N;
  for (int r = 0; r < 3; r++)
    for (int k = 0; k < 3; k++)
      N.m[r][k] = -K->m[r][k];
  return N;
}

static void set_mass(gv_block *H, const gv_newton_node *node) {
  *H = (gv_block){{{0}}};
  for (int k = 0; k < 3; k++) {
    H->m[k][k] = node->mass;
    for (int c = 0; c < 3; c++)
      H->m[3 + k][3 + c] = node->inertia.m[k][c];
  }
}

static gv_vec3 point_change(const gv_six *dv, gv_vec3 arm) {
  const double *m = dv->m;
  return gv_add(gv_v3(m[0], m[1], m[2]), gv_cross(gv_v3(m[3], m[4], m[5]), arm));
}

// Impulse if nothing moved from v_free.
static gv_vec3 first_impulse(const gv_newton_contact *c) {
  return gv_neg(gv_mat3_mul(&c->stiffness, c->free_u));
}

// ---- leaves ---------------------------------------------------------------------------------------

// What contact c is to its body b.
static void add_to_schur(gv_newton_limb *limb, const gv_newton_contact *c) {
  if (limb->other < 0)
    return;
  add_stiffness(&limb->schur, &c->stiffness, c->arm_b, c->arm_b);
  add_row(limb->push.m, gv_neg(first_impulse(c)), c->arm_b);
}

static bool sticks_or_opens(const gv_newton *s, const gv_newton_limb *limb) {
  for (int k = 0; k < limb->count; k++)
    if (s->contact[s->of_limb[limb->first + k]].mode.state == GV_NEWTON_SLIDING)
      return false;
  return true;
}

static void add_mirror(gv_block *mirror, const gv_newton_contact *c, const gv_mat3 *N) {
  const gv_mat3 NT = gv_mat3_transposed(N);
  add_stiffness(mirror, c->mode.state == GV_NEWTON_SLIDING ? &NT : N, c->arm_a, c->arm_b);
}

// Its diagonal, its coupling with the other body (in both triangles, where they
// differ), and its right-hand side.
static void assemble_limb(gv_newton *s, gv_newton_limb *limb, bool symmetric, gv_block *out_mirror) {
  set_mass(&limb->own, &s->node[limb->node]);
  limb->coupling = *out_mirror = (gv_block){{{0}}};
  limb->right = (gv_six){{0}};
  for (int k = 0; k < limb->count; k++) {
    const gv_newton_contact *c = &s->contact[s->of_limb[limb->first + k]];
    if (c->mode.state == GV_NEWTON_OPEN)
      continue;
    add_stiffness(&limb->own, &c->stiffness, c->arm_a, c->arm_a);
    add_row(limb->right.m, first_impulse(c), c->arm_a);
    if (limb->other < 0)
      continue;
    const gv_mat3 N = negative(&c->stiffness);
    add_stiffness(&limb->coupling, &N, c->arm_a, c->arm_b);
    if (!symmetric)
      add_mirror(out_mirror, c, &N);
    add_to_schur(limb, c);
  }
}

static bool eliminate_limb(gv_newton *s, gv_newton_limb *limb) {
  limb->changed = false;
  s->assembled += 4 * limb->count;
  limb->schur = (gv_block){{{0}}};
  limb->push = (gv_six){{0}};
  if (limb->count == 1) {
    const gv_newton_contact *c = &s->contact[s->of_limb[limb->first]];
    if (c->mode.state != GV_NEWTON_OPEN)
      add_to_schur(limb, c);
    return true;
  }
  const bool symmetric = sticks_or_opens(s, limb);
  gv_block mirror;
  assemble_limb(s, limb, symmetric, &mirror);
  if (!gv_block_factor(&limb->own))
    return false;
  gv_block_forward(&limb->own, &limb->right);
  if (limb->other < 0)
    return true;
  gv_block_divide_by_lower(&limb->own, &limb->coupling);
  if (symmetric)
    gv_block_scale_by_pivots(&limb->own, &limb->coupling, &mirror);
  else
    gv_block_divide_by_upper(&limb->own, &mirror);
  gv_block_subtract_product(&limb->schur, &mirror, &limb->coupling);
  gv_six_subtract(limb->push.m, limb->right.m, 1, mirror.m, 6);
  return true;
}

// Its velocities once those of the other body are known.
static void substitute_limb(gv_newton *s, const gv_newton_limb *limb) {
  gv_six *dv = &s->dv[limb->node];
  if (limb->count == 1)
    return;  // after its impulse, in gv_newton_tell
  *dv = limb->right;
  for (int k = 0; k < 6 && limb->other >= 0; k++)
    for (int c = 0; c < 6; c++)
      dv->m[k] -= limb->coupling.m[k][c] * s->dv[limb->other].m[c];
  gv_block_back(&limb->own, dv);
}

// ---- the equations --------------------------------------------------------------------------------

static void add_coupling(gv_newton *s, const gv_newton_contact *c, bool symmetric) {
  const bool a_first = gv_blocks_first(&s->blocks, c->node_a, c->node_b) == c->node_a;
  const gv_vec3 row = a_first ? c->arm_a : c->arm_b;
  const gv_vec3 column = a_first ? c->arm_b : c->arm_a;
  const gv_mat3 N = negative(&c->stiffness);
  const gv_mat3 NT = gv_mat3_transposed(&N);
  s->assembled += symmetric ? 1 : 2;
  add_stiffness(gv_blocks_at(&s->blocks, c->node_a, c->node_b), &N, row, column);
  if (!symmetric)
    add_stiffness(gv_blocks_mirror(&s->blocks, c->node_a, c->node_b), &NT, row, column);
}

static bool changes(const gv_newton *s, int node) { return node >= 0 && s->blocks.changed[node]; }

static void add_contact(gv_newton *s, const gv_newton_contact *c, bool symmetric) {
  if (!changes(s, c->node_a) && !changes(s, c->node_b))
    return;
  const gv_vec3 x = first_impulse(c);
  s->assembled += changes(s, c->node_a) + changes(s, c->node_b);
  if (changes(s, c->node_a)) {
    add_stiffness(gv_blocks_at(&s->blocks, c->node_a, c->node_a), &c->stiffness, c->arm_a, c->arm_a);
    add_row(s->dv[c->node_a].m, x, c->arm_a);
  }
  if (changes(s, c->node_b)) {
    add_stiffness(gv_blocks_at(&s->blocks, c->node_b, c->node_b), &c->stiffness, c->arm_b, c->arm_b);
    add_row(s->dv[c->node_b].m, gv_neg(x), c->arm_b);
  }
  if (c->node_a < 0 || c->node_b < 0)
    return;
  if (changes(s, gv_blocks_first(&s->blocks, c->node_a, c->node_b)))
    add_coupling(s, c, symmetric);
}

static void add_limb(gv_newton *s, const gv_newton_limb *limb) {
  if (!changes(s, limb->other))
    return;
  gv_block *H = gv_blocks_at(&s->blocks, limb->other, limb->other);
  double *right = s->dv[limb->other].m;
  for (int r = 0; r < 6; r++) {
    right[r] += limb->push.m[r];
    for (int c = 0; c < 6; c++)
      H->m[r][c] += limb->schur.m[r][c];
  }
}

static bool is_symmetric(const gv_newton *s) {
  for (int i = 0; i < s->count; i++)
    if (s->contact[i].mode.state == GV_NEWTON_SLIDING)
      return false;
  return true;
}

static void update_stiffnesses(gv_newton *s, double softening) {
  s->assembled = 0;
  for (int i = 0; i < s->count; i++) {
    gv_newton_contact *c = &s->contact[i];
    if (!c->changed)
      continue;
    c->changed = false;
    if (c->limb >= 0)
      s->limb[c->limb].changed = true;
    if (c->limb < 0)
      gv_blocks_change(&s->blocks, c->node_a);
    if (c->node_b >= 0)
      gv_blocks_change(&s->blocks, c->node_b);
    if (c->mode.state != GV_NEWTON_OPEN)
      c->stiffness = gv_newton_stiffness(c, softening);
  }
  gv_newton_rows_mark(s);
}

static bool assemble(gv_newton *s, bool symmetric) {
  gv_blocks_clear(&s->blocks, symmetric);
  for (int n = 0; n < s->blocks.nodes; n++) {
    if (!s->blocks.changed[n])
      continue;
    set_mass(gv_blocks_at(&s->blocks, n, n), &s->node[n]);
    s->dv[n] = (gv_six){{0}};
  }
  for (int l = 0; l < s->limbs; l++) {
    if (s->limb[l].changed && !eliminate_limb(s, &s->limb[l]))
      return false;
    add_limb(s, &s->limb[l]);
  }
  for (int i = 0; i < s->count; i++) {
    const gv_newton_contact *c = &s->contact[i];
    if (c->limb < 0 && c->mode.state != GV_NEWTON_OPEN)
      add_contact(s, c, symmetric);
  }
  gv_newton_rows_add(s, symmetric);
  return true;
}

static void respond(const gv_newton *s, gv_newton_contact *c) {
  gv_vec3 r = c->free_u;
  if (c->node_a >= 0 && !c->is_lone)
    r = gv_add(r, point_change(&s->dv[c->node_a], c->arm_a));
  if (c->node_b >= 0)
    r = gv_sub(r, point_change(&s->dv[c->node_b], c->arm_b));
  gv_newton_respond(c, r);
}

void gv_newton_change_all(gv_newton *s) {
  for (int i = 0; i < s->count; i++)
    s->contact[i].changed = true;
  for (int i = 0; i < s->rows; i++)
    s->row[i].changed = true;
}

bool gv_newton_solve(gv_newton *s, double softening) {
  assert(softening >= 1.0);
  const bool symmetric = is_symmetric(s);
  update_stiffnesses(s, softening);
  if (!assemble(s, symmetric))
    return false;
  if (!gv_blocks_solve(&s->blocks, symmetric, s->dv))
    return false;
  for (int l = 0; l < s->limbs; l++)
    substitute_limb(s, &s->limb[l]);
  for (int i = 0; i < s->count; i++)
    respond(s, &s->contact[i]);
  gv_newton_rows_respond(s);
  return true;
}

// ---- the answer -----------------------------------------------------------------------------------

// M^-1 J^T x of a limb with a single contact.
static gv_six change_of_lone(const gv_newton *s, const gv_newton_contact *c) {
  const gv_vec3 v = gv_scale(c->impulse, 1.0 / s->node[c->node_a].mass);
  const gv_vec3 w = gv_scale(gv_cross(c->arm_a, c->impulse), c->turn);
  return (gv_six){{v.x, v.y, v.z, w.x, w.y, w.z}};
}

bool gv_newton_tell(gv_newton *s, const gv_problem *problem, gv_velocity out_velocity[]) {
  double sum = 0.0;
  for (int i = 0; i < s->count; i++)
    if (s->contact[i].is_lone)
      s->dv[s->contact[i].node_a] = change_of_lone(s, &s->contact[i]);
  for (int n = 0; n < s->nodes; n++)
    for (int k = 0; k < 6; k++)
      sum += fabs(s->dv[n].m[k]);
  if (!isfinite(sum))
    return false;
  for (int n = 0; n < s->nodes; n++) {
    const int body = s->node[n].body;
    const double *m = s->dv[n].m;
    out_velocity[body].v = gv_add(problem->body[body].v, gv_v3(m[0], m[1], m[2]));
    out_velocity[body].w = gv_add(problem->body[body].w, gv_v3(m[3], m[4], m[5]));
  }
  return true;
}
