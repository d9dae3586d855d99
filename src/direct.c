// SPDX-License-Identifier: BSD-3-Clause
// The contact problem (Eqn 11 to 18) as ODE states it, solved by block pivoting (Judice and Pires 1994): guess which
// contacts are open, hold or slide, solve the linear system that remains, and let every row that contradicts its
// guess change sides, after a few rounds one contact at a time. While a hand holds an object the last step's guess
// is right at once: one factorization in place of Dantzig's row by row. A friction row that slides is at its limit,
// mu times the normal impulse of its own contact (the friction pyramid alone). Where the guesses do not settle the
// caller asks ODE. Real-time thread.
//
// In impulses x = h f:  (J M^-1 J^T + cfm / h) x = c - J v,  c the velocity that takes back depth, or closes a gap.
#include "direct.h"

#include <string.h>

enum { BLOCK_GUESSES = 3, GUESSES = 12 };
static const double rounding = 1e-8;         // of an impulse, N s, or a velocity, m/s: such contradictions are none
static const double most_out_m_s = 0.25;    // a deep limb is let out gently, not shot

static gv_vec3 turned(const gv_direct_body *body, gv_vec3 moment) { return gv_mat3_mul(&body->inv_inertia, moment); }

static double wanted_velocity(const gv_config *cfg, double depth) {
  return depth < 0.0 ? depth / cfg->step_s : fmin(cfg->contact_erp * depth / cfg->step_s, most_out_m_s);
}

static void make_rows(gv_direct *s, const gv_config *cfg, const gv_direct_body body[], const gv_dynamics_contact *c, int i) {
  const gv_direct_body *a = &body[c->body_a], *b = &body[c->body_b];
  const gv_vec3 along[3] = {c->normal, c->friction_dir, gv_cross(c->normal, c->friction_dir)};
  gv_vec3 arm_a = gv_sub(c->position, a->p), arm_b = gv_sub(c->position, b->p);
  for (int k = 0; k < 3; k++) {
    int r = 3 * i + k;
    s->d[r] = along[k];
    s->ang_a[r] = gv_cross(arm_a, along[k]);
    s->ang_b[r] = gv_cross(arm_b, along[k]);
    s->turn_a[r] = turned(a, s->ang_a[r]);
    s->turn_b[r] = turned(b, s->ang_b[r]);
    double now = gv_dot(along[k], gv_sub(a->v, b->v)) + gv_dot(s->ang_a[r], a->w) - gv_dot(s->ang_b[r], b->w);
    s->b[r] = (k == 0 ? wanted_velocity(cfg, c->depth) : 0.0) - now;
    s->mu[r] = c->mu;
  }
}

// One body's part in the 3 x 3 block of two contacts that share it.
static void add_block(gv_direct *s, int i, int k, double sign, double inv_mass, const gv_vec3 ang[], const gv_vec3 turn[]) {
  for (int r = 3 * i; r < 3 * i + 3; r++)
    for (int c = 3 * k; c < 3 * k + 3; c++)
      s->A[r][c] += sign * (inv_mass * gv_dot(s->d[r], s->d[c]) + gv_dot(ang[r], turn[c]));
}

// The moving body that most contacts share: what the hand holds.
static int find_shared(const gv_direct_body body[], const gv_dynamics_contact *contact, int count) {
  int of_body[GV_BODIES] = {0}, most = contact[0].body_a;
  for (int i = 0; i < 2 * count; i++) {
    int b = i % 2 ? contact[i / 2].body_b : contact[i / 2].body_a;
    if (body[b].inv_mass > 0.0 && ++of_body[b] > of_body[most]) most = b;
  }
  return most;
}

// The shared body's part of the whole matrix, four columns at a time (and a few to the left of the diagonal's block,
// which the mirror image overwrites).
static void add_shared(gv_direct *s, const gv_direct_body *shared, int shared_body, const gv_dynamics_contact *contact) {
  int rows = 3 * s->count;
  for (int r = 0; r < rows; r++) {
    const gv_dynamics_contact *c = &contact[r / 3];
    bool is_a = c->body_a == shared_body;
    double sign = is_a ? 1.0 : c->body_b == shared_body ? -1.0 : 0.0;
    gv_vec3 d = s->d[r], ang = is_a ? s->ang_a[r] : s->ang_b[r], turn = is_a ? s->turn_a[r] : s->turn_b[r];
    const double own[6] = {d.x, d.y, d.z, ang.x, ang.y, ang.z};
    const double moved[6] = {shared->inv_mass * d.x, shared->inv_mass * d.y, shared->inv_mass * d.z, turn.x, turn.y, turn.z};
    for (int k = 0; k < 6; k++) s->own[k][r] = sign * own[k], s->moved[k][r] = sign * moved[k];
  }
  for (int r = 0; r < rows; r++) {
    const double j0 = s->own[0][r], j1 = s->own[1][r], j2 = s->own[2][r], j3 = s->own[3][r], j4 = s->own[4][r], j5 = s->own[5][r];
    for (int first = (r - r % 3) & ~3; first < rows; first += 4)
      for (int c = first; c < first + 4; c++)
        s->A[r][c] = j0 * s->moved[0][c] + j1 * s->moved[1][c] + j2 * s->moved[2][c] + j3 * s->moved[3][c] + j4 * s->moved[4][c] + j5 * s->moved[5][c];
  }
}

static void make_matrix(gv_direct *s, const gv_config *cfg, const gv_direct_body body[], const gv_dynamics_contact *contact) {
  int shared = find_shared(body, contact, s->count), rows = 3 * s->count;
  add_shared(s, &body[shared], shared, contact);
  for (int i = 0; i < s->count; i++) {
    const gv_dynamics_contact *p = &contact[i];
    bool a = p->body_a != shared, b = p->body_b != shared && body[p->body_b].inv_mass > 0.0;
    for (int k = i; k < s->count; k++) {
      const gv_dynamics_contact *q = &contact[k];
      if (a && p->body_a == q->body_a) add_block(s, i, k, 1.0, body[p->body_a].inv_mass, s->ang_a, s->turn_a);
      if (b && p->body_b == q->body_b) add_block(s, i, k, 1.0, body[p->body_b].inv_mass, s->ang_b, s->turn_b);
      if (a && p->body_a == q->body_b) add_block(s, i, k, -1.0, body[p->body_a].inv_mass, s->ang_a, s->turn_b);
      if (b && p->body_b == q->body_a) add_block(s, i, k, -1.0, body[p->body_b].inv_mass, s->ang_b, s->turn_a);
    }
    for (int r = 3 * i; r < 3 * i + 3; r++) s->A[r][r] += (r == 3 * i ? cfg->contact_cfm : cfg->world_cfm) / cfg->step_s;
  }
  for (int r = 0; r < rows; r++)
    for (int c = 0; c < r; c++) s->A[r][c] = s->A[c][r];
}

// As the contact of the same bodies was in the last step; a new one holds.
static void take_guess(gv_direct *s, const gv_dynamics_contact *contact) {
  bool used[GV_DIRECT_CONTACTS] = {false};
  for (int i = 0; i < s->count; i++) {
    memset(&s->row[3 * i], GV_DIRECT_HOLDS, 3);
    for (int k = 0; k < s->last_count; k++) {
      const gv_direct_guess *g = &s->last[k];
      if (used[k] || g->body_a != contact[i].body_a || g->body_b != contact[i].body_b) continue;
      used[k] = true;
      memcpy(&s->row[3 * i], g->row, 3);
      break;
    }
  }
}

static void keep_guess(gv_direct *s, const gv_dynamics_contact *contact) {
  s->last_count = s->count;
  for (int i = 0; i < s->count; i++) {
    s->last[i] = (gv_direct_guess){.body_a = contact[i].body_a, .body_b = contact[i].body_b};
    memcpy(s->last[i].row, &s->row[3 * i], 3);
  }
}

static double slide_sign(uint8_t row) { return row == GV_DIRECT_SLIDES_UP ? 1.0 : row == GV_DIRECT_SLIDES_DOWN ? -1.0 : 0.0; }

// row -= f pivot from column `from` on, by whole groups of four (M has room for them; what lies before `from` is
// not looked at any more): compilers make two or four of them one instruction, with the same bits.
static void subtract_row(double *restrict row, const double *restrict pivot, double f, int from, int n) {
  for (int c = from & ~3; c < n; c += 4)
    for (int k = 0; k < 4; k++) row[c + k] -= f * pivot[c + k];
}

// Gauss without exchange of rows on the n rows of M and y; `symmetric`: only the upper half is kept up to date.
static bool eliminate(gv_direct *s, int n, bool symmetric) {
  for (int k = 0; k < n; k++) {
    const double *pivot = s->M[k];
    if (!(pivot[k] > 1e-9)) return false;
    double inverse = 1.0 / pivot[k];
    for (int i = k + 1; i < n; i++) {
      double *row = s->M[i], f = (symmetric ? pivot[i] : row[k]) * inverse;
      if (f == 0.0) continue;
      subtract_row(row, pivot, f, symmetric ? i : k + 1, n);
      s->y[i] -= f * s->y[k];
    }
  }
  for (int i = n - 1; i >= 0; i--) {
    double sum = s->y[i];
    for (int c = i + 1; c < n; c++) sum -= s->M[i][c] * s->y[c];
    s->y[i] = sum / s->M[i][i];
  }
  return true;
}

// Solves for the rows that hold; a sliding row follows its contact's normal.
static bool solve_guess(gv_direct *s) {
  int held[GV_DIRECT_ROWS], n = 0, rows = 3 * s->count;
  bool symmetric = true;
  for (int r = 0; r < rows; r++)
    if (s->row[r] == GV_DIRECT_HOLDS) held[n++] = r;
  for (int i = 0; i < n; i++) {
    const double *row = s->A[held[i]];
    s->y[i] = s->b[held[i]];
    for (int c = 0; c < n; c++) s->M[i][c] = row[held[c]];
  }
  for (int c = 0; c < n; c++) {
    int normal = held[c];
    for (int f = normal + 1; normal % 3 == 0 && f < normal + 3; f++) {
      double share = slide_sign(s->row[f]) * s->mu[f];
      if (share == 0.0) continue;
      symmetric = false;
      for (int i = 0; i < n; i++) s->M[i][c] += share * s->A[held[i]][f];
    }
  }
  if (!eliminate(s, n, symmetric)) return false;
  memset(s->x, 0, sizeof s->x[0] * (size_t)rows);
  for (int i = 0; i < n; i++) s->x[held[i]] = s->y[i];
  for (int r = 0; r < rows; r++)
    if (slide_sign(s->row[r]) != 0.0) s->x[r] = slide_sign(s->row[r]) * s->mu[r] * s->x[r - r % 3];
  return true;
}

// What the row's velocity would be, beyond what is asked of it.
static double excess(const gv_direct *s, int r) {
  double sum = -s->b[r];
  for (int c = 0; c < 3 * s->count; c++) sum += s->A[r][c] * s->x[c];
  return sum;
}

static uint8_t judge_friction(const gv_direct *s, int r) {
  double limit = s->mu[r] * s->x[r - r % 3];
  if (s->row[r] == GV_DIRECT_HOLDS) {
    if (s->x[r] > limit + rounding) return GV_DIRECT_SLIDES_UP;
    return s->x[r] < -limit - rounding ? GV_DIRECT_SLIDES_DOWN : GV_DIRECT_HOLDS;
  }
  // A sliding contact's friction must oppose the slip that is left.
  return slide_sign(s->row[r]) * excess(s, r) > rounding ? GV_DIRECT_HOLDS : s->row[r];
}

// What the rows of the contact whose normal is row n should be, as far as this solution tells.
static void judge_contact(const gv_direct *s, int n, uint8_t out[3]) {
  memcpy(out, &s->row[n], 3);
  if (s->row[n] == GV_DIRECT_OPEN) {
    if (excess(s, n) < -rounding) memset(out, GV_DIRECT_HOLDS, 3);
  } else if (s->x[n] < -rounding) {
    memset(out, GV_DIRECT_OPEN, 3);
  } else {
    for (int k = 1; k < 3; k++) out[k] = judge_friction(s, n + k);
  }
}

// Rows that contradict the guess change sides: those of all contacts, or, where that went in circles, of the last
// such contact alone. Returns the number of contacts that contradicted.
static int judge(gv_direct *s, bool all) {
  int changes = 0;
  for (int i = s->count - 1; i >= 0; i--) {
    uint8_t *row = &s->row[3 * i], next[3];
    judge_contact(s, 3 * i, next);
    if (memcmp(row, next, 3) == 0) continue;
    if (all || changes == 0) memcpy(row, next, 3);
    changes++;
  }
  return changes;
}

bool gv_direct_solve(gv_direct *s, const gv_config *cfg, const gv_direct_body body[GV_BODIES],
                     const gv_dynamics_contact *contact, int count, gv_vec3 force_on_a[]) {
  s->count = count;
  for (int i = 0; i < count; i++) make_rows(s, cfg, body, &contact[i], i);
  make_matrix(s, cfg, body, contact);
  take_guess(s, contact);
  int left = -1;
  for (int guess = 0; guess < GUESSES && left != 0; guess++) {
    if (!solve_guess(s)) return false;
    left = judge(s, guess < BLOCK_GUESSES);
  }
  if (left != 0) return false;
  keep_guess(s, contact);
  for (int i = 0; i < count; i++) {
    gv_vec3 sum = gv_scale(s->d[3 * i], s->x[3 * i]);
    sum = gv_mad(gv_mad(sum, s->x[3 * i + 1], s->d[3 * i + 1]), s->x[3 * i + 2], s->d[3 * i + 2]);
    force_on_a[i] = gv_scale(sum, 1.0 / cfg->step_s);
    if (!gv_v3_finite(force_on_a[i])) return false;
  }
  return true;
}
