// SPDX-License-Identifier: BSD-3-Clause
// Joints' rows in the Newton solver: their part of the equations (4) and of the projection
// (6) of newton.c. Real-time thread.
#include "dynamics/newton_row.h"

#include <assert.h>

#include "dynamics/newton.h"

static const double least_tolerance = 2e-10;  // N s or N m s: two impulses that differ by less are the same
static const double relative_tolerance = 2e-7;

// ---- set-up ---------------------------------------------------------------------------------------

static gv_six jacobian(const gv_problem_row *row, gv_vec3 arm, double sign) {
  const gv_vec3 along = gv_scale(row->direction, row->turns ? 0.0 : sign);
  const gv_vec3 about = row->turns ? gv_scale(row->direction, sign) : gv_cross(arm, along);
  return (gv_six){{along.x, along.y, along.z, about.x, about.y, about.z}};
}

static double times(const gv_six *row, const gv_six *v) {
  double sum = 0.0;
  for (int k = 0; k < 6; k++)
    sum += row->m[k] * v->m[k];
  return sum;
}

static double free_velocity(const gv_problem *problem, int body, const gv_six *row) {
  const gv_problem_body *b = &problem->body[body];
  const gv_six v = {{b->v.x, b->v.y, b->v.z, b->w.x, b->w.y, b->w.z}};
  return times(row, &v);
}

// G M^-1 G^T of one body.
static double give_of(const gv_newton_node *node, const gv_six *row) {
  const gv_vec3 along = gv_v3(row->m[0], row->m[1], row->m[2]);
  const gv_vec3 about = gv_v3(row->m[3], row->m[4], row->m[5]);
  return gv_norm2(along) / node->mass + gv_dot(about, gv_mat3_mul(&node->inverse_inertia, about));
}

static void make_row(gv_newton *s, const gv_problem *problem, const gv_problem_row *from,
                     gv_newton_row *row) {
  row->node_a = s->node_of[from->body_a];
  row->node_b = from->body_b == GV_WORLD ? -1 : s->node_of[from->body_b];
  row->slot = from->slot;
  row->contact = -1;
  row->to_a = jacobian(from, from->arm_a, 1.0);
  row->to_b = jacobian(from, from->arm_b, -1.0);
  row->compliance = from->compliance;
  row->low = from->low;
  row->high = from->high;
  row->free_u = free_velocity(problem, from->body_a, &row->to_a) - from->target_velocity;
  row->inverse_mass = give_of(&s->node[row->node_a], &row->to_a);
  if (row->node_b >= 0) {
    row->free_u += free_velocity(problem, from->body_b, &row->to_b);
    row->inverse_mass += give_of(&s->node[row->node_b], &row->to_b);
  }
}

// The turn of a over b about the contact's normal.
static void make_patch(gv_newton *s, const gv_problem *problem, int contact, gv_newton_row *row) {
  const gv_problem_contact *c = &problem->contact[contact];
  const bool b_moves = problem->body[c->body_b].mass > 0.0;
  const gv_problem_row turn = {.body_a = c->body_a,
                               .body_b = b_moves ? c->body_b : GV_WORLD,
                               .turns = true,
                               .direction = c->frame[0],
                               .compliance = c->tangent_compliance * gv_patch_give(c)};
  make_row(s, problem, &turn, row);
  row->contact = contact;
  row->first = row->state = GV_ROW_HOLDS;
  row->normal_to_most = gv_patch_arm(c);
}

static void set_up_patches(gv_newton *s, const gv_problem *problem) {
  for (int i = 0; i < s->count; i++) {
    s->contact[i].spin = -1;
    if (!(problem->contact[i].patch > 0.0))
      continue;
    assert(s->rows < GV_MAX_ROWS + GV_MAX_CONTACTS);
    s->contact[i].spin = s->rows;
    make_patch(s, problem, i, &s->row[s->rows++]);
  }
}

void gv_newton_rows_set_up(gv_newton *s, const gv_problem *problem) {
  s->rows = problem->row_count;
  for (int i = 0; i < s->rows; i++) {
    const gv_problem_row *from = &problem->row[i];
    gv_newton_row *row = &s->row[i];
    assert(from->compliance > 0.0 && from->low <= 0.0 && from->high >= 0.0);
    make_row(s, problem, from, row);
    assert(row->node_a >= 0 && row->node_a < s->blocks.nodes && row->node_b < s->blocks.nodes);
    if (row->node_b >= 0)
      gv_blocks_link(&s->blocks, row->node_a, row->node_b);
  }
  set_up_patches(s, problem);
}

// ---- the equations --------------------------------------------------------------------------------

static double bound_of(const gv_newton_row *row) {
  if (row->contact >= 0)
    return row->state == GV_ROW_AT_LOW ? -row->applied : row->applied;
  return row->state == GV_ROW_AT_LOW ? row->low : row->high;
}

void gv_newton_rows_mark(gv_newton *s) {
  for (int i = 0; i < s->rows; i++) {
    gv_newton_row *row = &s->row[i];
    if (!row->changed)
      continue;
    row->changed = false;
    row->applied = row->high;
    gv_blocks_change(&s->blocks, row->node_a);
    if (row->node_b >= 0)
      gv_blocks_change(&s->blocks, row->node_b);
  }
}

// H += k left^T right.
static void add_product(gv_block *H, double k, const gv_six *left, const gv_six *right) {
  for (int r = 0; r < 6; r++) {
    const double by = k * left->m[r];
    for (int c = 0; c < 6; c++)
      H->m[r][c] += by * right->m[c];
  }
}

static void add_to_node(gv_newton *s, const gv_newton_row *row, int node, const gv_six *to) {
  if (node < 0 || !s->blocks.changed[node])
    return;
  const bool holds = row->state == GV_ROW_HOLDS;
  const double push = holds ? -row->free_u / row->compliance : bound_of(row);
  for (int k = 0; k < 6; k++)
    s->dv[node].m[k] += push * to->m[k];
  if (holds)
    add_product(gv_blocks_at(&s->blocks, node, node), 1.0 / row->compliance, to, to);
}

static void add_coupling(gv_newton *s, const gv_newton_row *row, bool symmetric) {
  const int first = gv_blocks_first(&s->blocks, row->node_a, row->node_b);
  if (!s->blocks.changed[first])
    return;
  const gv_six *left = first == row->node_a ? &row->to_a : &row->to_b;
  const gv_six *right = first == row->node_a ? &row->to_b : &row->to_a;
  const double k = 1.0 / row->compliance;
  add_product(gv_blocks_at(&s->blocks, row->node_a, row->node_b), k, left, right);
  if (!symmetric)
    add_product(gv_blocks_mirror(&s->blocks, row->node_a, row->node_b), k, left, right);
}

void gv_newton_rows_add(gv_newton *s, bool symmetric) {
  for (int i = 0; i < s->rows; i++) {
    const gv_newton_row *row = &s->row[i];
    add_to_node(s, row, row->node_a, &row->to_a);
    add_to_node(s, row, row->node_b, &row->to_b);
    if (row->node_b >= 0 && row->state == GV_ROW_HOLDS)
      add_coupling(s, row, symmetric);
  }
}

void gv_newton_rows_respond(gv_newton *s) {
  for (int i = 0; i < s->rows; i++) {
    gv_newton_row *row = &s->row[i];
    row->u = row->free_u + times(&row->to_a, &s->dv[row->node_a]);
    if (row->node_b >= 0)
      row->u += times(&row->to_b, &s->dv[row->node_b]);
    row->impulse = row->state == GV_ROW_HOLDS ? -row->u / row->compliance : bound_of(row);
  }
}

// ---- the next states ------------------------------------------------------------------------------

static void project_row(gv_newton_row *row, double weight) {
  const double by_rho = weight * row->inverse_mass + row->compliance;
  const double y = row->impulse - (row->u + row->compliance * row->impulse) / by_rho;
  const double projected = gv_clamp(y, row->low, row->high);
  const double off = projected - row->impulse;
  row->next = y < row->low ? GV_ROW_AT_LOW : y > row->high ? GV_ROW_AT_HIGH : GV_ROW_HOLDS;
  row->residual = fabs(off) / fmax(relative_tolerance * fabs(projected), least_tolerance);
  row->merit = by_rho * off * off;
}

static void bound_by_normal(gv_newton_row *row, const gv_newton_contact *c) {
  row->high = row->normal_to_most * fmax(0.0, gv_dot(c->impulse, c->normal));
  row->low = -row->high;
}

double gv_newton_rows_project(gv_newton *s, double weight, double *io_merit) {
  double worst = 0.0;
  for (int i = 0; i < s->rows; i++) {
    gv_newton_row *row = &s->row[i];
    if (row->contact >= 0)
      bound_by_normal(row, &s->contact[row->contact]);
    project_row(row, weight);
    *io_merit += row->merit;
    if (!(row->residual <= worst))
      worst = row->residual;
  }
  return worst;
}

void gv_newton_rows_adopt(gv_newton *s) {
  for (int i = 0; i < s->rows; i++) {
    gv_newton_row *row = &s->row[i];
    if (!(row->residual > 1.0) || (row->next == row->state && row->contact < 0))
      continue;
    row->state = row->next;
    row->changed = true;
  }
}

// ---- from step to step ----------------------------------------------------------------------------

// A limit that was the low one may be the high one now, which has no low bound to stand at.
void gv_newton_rows_start(gv_newton *s) {
  for (int i = 0; i < s->rows; i++) {
    gv_newton_row *row = &s->row[i];
    if (row->contact >= 0)
      continue;
    row->first = row->state = (gv_row_state)s->last_row[row->slot];
    if (row->state != GV_ROW_HOLDS && isinf(bound_of(row)))
      row->first = GV_ROW_HOLDS;
  }
}

void gv_newton_rows_keep(gv_newton *s) {
  for (int i = 0; i < s->rows; i++)
    if (s->row[i].contact < 0)
      s->last_row[s->row[i].slot] = (uint8_t)s->row[i].state;
}
