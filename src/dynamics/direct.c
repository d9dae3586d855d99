// SPDX-License-Identifier: BSD-3-Clause
// The contact problem (Eqn 11 to 18) as ODE states it, in the velocities v of the bodies that touch:
//
//   M (v - v_free) = J^T x(J v)
//
// A row's impulse x follows from its relative velocity u: a normal row pushes with (asked - u) stiff, but never pulls;
// a friction row holds with -u stiff up to its limit, mu times the normal impulse of its own contact (the friction
// pyramid). These are straight pieces, and Newton's method ends, exactly, on the piece where it solves itself.
// - It starts on the last step's pieces. While a hand holds an object they are right, and one factorization will do.
// - Else it is bold: full steps, with the friction limits moving along with the normal impulses (which makes the
//   matrix unsymmetric). A few of them mostly settle it.
// - Where they do not, it takes the friction limits as given, those of the last step. The problem is then convex, has
//   one solution, friction in it takes energy and never gives it, and Newton's method with an exact line search finds
//   it (Castro et al. 2022). From there it is bold again. After a second such round that is the answer.
// The cost grows with the number of contacts (blocks.c), and any number of them may say the same twice. Real-time thread.
#include "dynamics/direct.h"

#include <string.h>

enum { BOLD = 5, SAFE = 40, ROUNDS = 2, SEARCH = 40, LEAST_STEPS = 12, MOST_STEPS = 100 };
static const double settled = 1e-9;          // N s: two impulses that differ by less are the same

// ---- the problem ----------------------------------------------------------------------------------

static void make_rows(gv_direct *s, const gv_problem_body body[], const gv_problem_contact *c, int i) {
  memcpy(s->along[i], c->frame, sizeof c->frame);
  s->arm_a[i] = gv_sub(c->point, body[c->body_a].p);
  s->arm_b[i] = gv_sub(c->point, body[c->body_b].p);
  s->mu[i] = c->mu;
  for (int k = 0; k < 3; k++) {
    s->asked[3 * i + k] = k == 0 ? c->target_velocity : 0.0;
    s->stiff[3 * i + k] = 1.0 / (k == 0 ? c->normal_compliance : c->tangent_compliance);
  }
}

static void add_node(gv_direct *s, int node[GV_BODIES], const gv_problem_body body[], int b) {
  int n = node[b] = s->nodes++;
  s->free[n] = s->v[n] = (gv_six){{body[b].v.x, body[b].v.y, body[b].v.z, body[b].w.x, body[b].w.y, body[b].w.z}};
  s->mass[n] = body[b].mass;
  s->inertia[n] = body[b].inertia;
}

// Bodies that touch something: first those that go into the matrix, then the limbs with a single contact.
static bool make_nodes(gv_direct *s, int node[GV_BODIES], const gv_problem_body body[], const gv_problem_contact *contact) {
  int touched[GV_BODIES] = {0};
  s->nodes = 0;
  for (int i = 0; i < s->count; i++) {
    int a = contact[i].body_a, b = contact[i].body_b;
    touched[a] += b < GV_LIMBS ? 2 : 1;
    touched[b] += b < GV_LIMBS ? 2 : 1;  // a limb in second place is no lone one
  }
  for (int lone = 0; lone < 2; lone++) {
    for (int b = 0; b < GV_BODIES; b++) {
      if (lone == 0) node[b] = -1;
      if (touched[b] > 0 && body[b].mass > 0.0 && (b < GV_LIMBS && touched[b] == 1) == lone) add_node(s, node, body, b);
    }
    if (lone == 0) gv_blocks_begin(&s->blocks, s->nodes);
  }
  for (int i = 0; i < s->count; i++) {
    int a = s->node_a[i] = node[contact[i].body_a], b = s->node_b[i] = node[contact[i].body_b];
    if (a >= 0 && b >= 0 && a < s->blocks.nodes && b < s->blocks.nodes) gv_blocks_link(&s->blocks, a, b);
  }
  return gv_blocks_order(&s->blocks);
}

// As the contact of the same bodies was in the last step; a new one holds, unless it parts.
static void take_guess(gv_direct *s, const gv_problem_contact *contact) {
  bool used[GV_MAX_CONTACTS] = {false};
  for (int i = 0; i < s->count; i++) {
    memset(&s->row[3 * i], GV_DIRECT_HOLDS, 3);
    s->limit[i] = HUGE_VAL;
    for (int k = 0; k < s->last_count; k++) {
      const gv_direct_guess *g = &s->last[k];
      if (used[k] || g->body_a != contact[i].body_a || g->body_b != contact[i].body_b) continue;
      used[k] = true;
      memcpy(&s->row[3 * i], g->row, 3);
      s->limit[i] = contact[i].mu * g->normal_impulse;
      break;
    }
  }
}

// ---- pieces ---------------------------------------------------------------------------------------

static double impulse_on(const gv_direct *s, int r, uint8_t piece, double u) {
  switch (piece) {
    case GV_DIRECT_HOLDS: return (s->asked[r] - u) * s->stiff[r];
    case GV_DIRECT_SLIDES_UP: return s->limit[r / 3];
    case GV_DIRECT_SLIDES_DOWN: return -s->limit[r / 3];
    default: return 0.0;
  }
}

static uint8_t piece_at(const gv_direct *s, int r, double u) {
  double x = (s->asked[r] - u) * s->stiff[r];
  if (r % 3 == 0) return x > 0.0 ? GV_DIRECT_HOLDS : GV_DIRECT_OPEN;
  const double limit = s->limit[r / 3];
  if (!(limit > 0.0)) return GV_DIRECT_OPEN;
  return x > limit ? GV_DIRECT_SLIDES_UP : x < -limit ? GV_DIRECT_SLIDES_DOWN : GV_DIRECT_HOLDS;
}

static gv_vec3 point_velocity(const gv_six *v, gv_vec3 arm) {
  const double *m = v->m;
  return gv_add(gv_v3(m[0], m[1], m[2]), gv_cross(gv_v3(m[3], m[4], m[5]), arm));
}

// Of body a over body b at contact i.
static gv_vec3 relative_velocity(const gv_direct *s, int i, const gv_six v[]) {
  gv_vec3 u = gv_v3(0, 0, 0);
  if (s->node_a[i] >= 0) u = point_velocity(&v[s->node_a[i]], s->arm_a[i]);
  if (s->node_b[i] >= 0) u = gv_sub(u, point_velocity(&v[s->node_b[i]], s->arm_b[i]));
  return u;
}

static void find_velocities(const gv_direct *s, const gv_six v[], double out_u[]) {
  for (int i = 0; i < s->count; i++) {
    gv_vec3 u = relative_velocity(s, i, v);
    for (int k = 0; k < 3; k++) out_u[3 * i + k] = gv_dot(s->along[i][k], u);
  }
}

// v += J^T x of a body: an impulse at the end of its arm.
static void add_impulse(gv_six *v, gv_vec3 arm, gv_vec3 x) {
  gv_vec3 turn = gv_cross(arm, x);
  v->m[0] += x.x, v->m[1] += x.y, v->m[2] += x.z;
  v->m[3] += turn.x, v->m[4] += turn.y, v->m[5] += turn.z;
}

static gv_vec3 in_world(const gv_direct *s, int i, gv_vec3 x) {
  const gv_vec3 *along = s->along[i];
  return gv_mad(gv_mad(gv_scale(along[0], x.x), x.y, along[1]), x.z, along[2]);
}

static double limit_now(const gv_direct *s, int i) { return s->mu[i] * impulse_on(s, 3 * i, s->row[3 * i], s->u[3 * i]); }

// A row to the piece that its velocity is on; true where it was there already. What slid one way and now would the
// other way is tried holding when bold.
static bool set_piece(gv_direct *s, int r) {
  uint8_t piece = piece_at(s, r, s->u[r]), was = s->row[r];
  if (piece == was || fabs(impulse_on(s, r, piece, s->u[r]) - impulse_on(s, r, was, s->u[r])) < settled) return true;
  s->row[r] = s->bold && piece > GV_DIRECT_HOLDS && was != GV_DIRECT_HOLDS ? GV_DIRECT_HOLDS : piece;
  return false;
}

static bool set_pieces(gv_direct *s) {
  bool right = true;
  for (int i = 0; i < s->count; i++) {
    right = set_piece(s, 3 * i) && right;
    if (s->bold) s->limit[i] = limit_now(s, i);
    for (int k = 1; k < 3; k++) right = set_piece(s, 3 * i + k) && right;
  }
  return right;
}

// The impulses of a contact's rows from those of the rows that hold: themselves, and friction that slides follows the normal.
static gv_mat3 follow(const gv_direct *s, int i) {
  const uint8_t *row = &s->row[3 * i];
  gv_mat3 B = {{{0}}};
  for (int k = 0; k < 3; k++) {
    if (row[k] == GV_DIRECT_HOLDS) B.m[k][k] = 1.0;
    else if (s->bold && k > 0 && row[0] == GV_DIRECT_HOLDS && row[k] != GV_DIRECT_OPEN)
      B.m[k][0] = row[k] == GV_DIRECT_SLIDES_UP ? s->mu[i] : -s->mu[i];
  }
  return B;
}

// Symmetric while nothing slides, or the friction limits do not move.
static bool is_symmetric(const gv_direct *s) {
  for (int r = 0; r < 3 * s->count && s->bold; r++)
    if (s->row[r] > GV_DIRECT_HOLDS) return false;
  return true;
}

// ---- one iteration --------------------------------------------------------------------------------

static void add_masses(gv_direct *s) {
  for (int n = 0; n < s->nodes; n++) {
    double *y = s->dv[n].m;
    const double *v = s->v[n].m, *free = s->free[n].m;
    gv_vec3 turn = gv_mat3_mul(&s->inertia[n], gv_v3(free[3] - v[3], free[4] - v[4], free[5] - v[5]));
    for (int k = 0; k < 3; k++) y[k] = s->mass[n] * (free[k] - v[k]);
    y[3] = turn.x, y[4] = turn.y, y[5] = turn.z;
    if (n >= s->blocks.nodes) continue;
    gv_block *H = gv_blocks_at(&s->blocks, n, n);
    for (int k = 0; k < 3; k++) {
      H->m[k][k] = s->mass[n];
      for (int c = 0; c < 3; c++) H->m[3 + k][3 + c] = s->inertia[n].m[k][c];
    }
  }
}

// Does nothing of contact i slide or gape? Then its stiffness needs no rows of its own: it is a matrix in the world's axes.
static bool is_stuck(const gv_direct *s, int i) {
  const uint8_t *row = &s->row[3 * i];
  return row[0] == GV_DIRECT_HOLDS && row[1] == GV_DIRECT_HOLDS && row[2] == GV_DIRECT_HOLDS;
}

static bool is_lone(const gv_direct *s, int i) { return s->node_a[i] >= s->blocks.nodes; }

// a I + b n n^T.
static gv_mat3 scaled_sum(double a, double b, gv_vec3 n) {
  return (gv_mat3){{{a + b * n.x * n.x, b * n.x * n.y, b * n.x * n.z},
                    {b * n.y * n.x, a + b * n.y * n.y, b * n.y * n.z},
                    {b * n.z * n.x, b * n.z * n.y, a + b * n.z * n.z}}};
}

// R^T K R: from the axes of contact i to the world's.
static gv_mat3 to_world(const gv_direct *s, int i, const gv_mat3 *K) {
  const gv_vec3 *d = s->along[i];
  const gv_mat3 R = {{{d[0].x, d[0].y, d[0].z}, {d[1].x, d[1].y, d[1].z}, {d[2].x, d[2].y, d[2].z}}};
  gv_mat3 T = gv_mat3_transposed(&R), KR = gv_mat3_times(K, &R);
  return gv_mat3_times(&T, &KR);
}

static gv_vec3 row_of(const gv_mat3 *K, int r) { return gv_v3(K->m[r][0], K->m[r][1], K->m[r][2]); }

// row += (k, arm x k).
static void add_row(double row[6], gv_vec3 k, gv_vec3 arm) {
  gv_vec3 turn = gv_cross(arm, k);
  row[0] += k.x, row[1] += k.y, row[2] += k.z, row[3] += turn.x, row[4] += turn.y, row[5] += turn.z;
}

// H += sign A^T K B, with A and B the 3 x 6 Jacobians of points at the ends of two arms, 1 | -[arm]x. KT: K transposed.
static void add_stiffness(gv_block *H, double sign, const gv_mat3 *K, const gv_mat3 *KT, gv_vec3 arm_of_row, gv_vec3 arm_of_column) {
  const gv_vec3 c0 = gv_cross(arm_of_row, row_of(KT, 0)), c1 = gv_cross(arm_of_row, row_of(KT, 1)), c2 = gv_cross(arm_of_row, row_of(KT, 2));
  const gv_vec3 turned[3] = {{c0.x, c1.x, c2.x}, {c0.y, c1.y, c2.y}, {c0.z, c1.z, c2.z}};
  for (int r = 0; r < 3; r++) {
    add_row(H->m[r], gv_scale(row_of(K, r), sign), arm_of_column);
    add_row(H->m[3 + r], gv_scale(turned[r], sign), arm_of_column);
  }
}

// Impulses of contact i as they are now, on both bodies. Of a limb with one contact only those that stay: the others come as
// a whole later, since at the start they are a million times what they will be.
static void add_impulses(gv_direct *s, int i) {
  double x[3];
  if (is_lone(s, i) && (s->bold || is_stuck(s, i))) return;
  for (int k = 0; k < 3; k++) {
    int r = 3 * i + k;
    x[k] = is_lone(s, i) && s->row[r] == GV_DIRECT_HOLDS ? 0.0 : impulse_on(s, r, s->row[r], s->u[r]);
  }
  gv_vec3 on_a = in_world(s, i, gv_v3(x[0], x[1], x[2]));
  if (s->node_a[i] >= 0) add_impulse(&s->dv[s->node_a[i]], s->arm_a[i], on_a);
  if (s->node_b[i] >= 0) add_impulse(&s->dv[s->node_b[i]], s->arm_b[i], gv_neg(on_a));
}

// Velocities of a limb, whose mass and inertia are the same in every direction, that impulses y give it.
static gv_six accelerated(const gv_direct *s, int n, const gv_six *y) {
  double m = 1.0 / s->mass[n], turn = 1.0 / s->inertia[n].m[0][0];
  return (gv_six){{m * y->m[0], m * y->m[1], m * y->m[2], turn * y->m[3], turn * y->m[4], turn * y->m[5]}};
}

// How a limb gives way at the end of its arm, J M^-1 J^T in the world's axes.
static gv_mat3 yielding(const gv_direct *s, int i) {
  const gv_vec3 arm = s->arm_a[i];
  double m = 1.0 / s->mass[s->node_a[i]], turn = 1.0 / s->inertia[s->node_a[i]].m[0][0];
  return scaled_sum(m + turn * gv_norm2(arm), -turn, arm);
}

// How the impulses answer to the other body's velocity when the limb gives way, in the world's axes: (1 / stiff + yielding)^-1.
static gv_mat3 stuck_stiffness(const gv_direct *s, int i) {
  double soft_n = 1.0 / s->stiff[3 * i], soft_t = 1.0 / s->stiff[3 * i + 1];
  gv_mat3 A = yielding(s, i), soft = scaled_sum(soft_t, soft_n - soft_t, s->along[i][0]);
  for (int r = 0; r < 3; r++)
    for (int c = 0; c < 3; c++) A.m[r][c] += soft.m[r][c];
  return gv_mat3_inverse(&A);
}

// The same where some rows hold and others follow: B (1 / stiff + yielding B)^-1 in the rows that hold.
static gv_mat3 sliding_stiffness(const gv_direct *s, int i) {
  const gv_mat3 B = follow(s, i), Y = yielding(s, i);
  gv_mat3 yields, A;
  for (int c = 0; c < 3; c++) {
    gv_vec3 u = gv_mat3_mul(&Y, s->along[i][c]);
    for (int r = 0; r < 3; r++) yields.m[r][c] = gv_dot(s->along[i][r], u);
  }
  A = gv_mat3_times(&yields, &B);
  for (int r = 0; r < 3; r++) {
    if (s->row[3 * i + r] == GV_DIRECT_HOLDS) A.m[r][r] += 1.0 / s->stiff[3 * i + r];
    else A.m[r][0] = A.m[r][1] = A.m[r][2] = 0.0, A.m[r][r] = 1.0;
  }
  A = gv_mat3_inverse(&A);
  for (int r = 0; r < 3; r++)
    if (s->row[3 * i + r] != GV_DIRECT_HOLDS) A.m[r][0] = A.m[r][1] = A.m[r][2] = 0.0;
  A = gv_mat3_times(&B, &A);
  return to_world(s, i, &A);
}

// A limb with one contact is solved for beforehand: to the other body its contact is a softer one.
static void add_lone(gv_direct *s, int i) {
  const int a = s->node_a[i], b = s->node_b[i];
  s->dv[a] = accelerated(s, a, &s->dv[a]);
  gv_mat3 K = s->lone[i] = is_stuck(s, i) ? stuck_stiffness(s, i) : sliding_stiffness(s, i);
  gv_vec3 u = gv_add(relative_velocity(s, i, s->v), point_velocity(&s->dv[a], s->arm_a[i]));
  s->lone_u[i] = gv_mad(u, -s->asked[3 * i], s->along[i][0]);
  if (b < 0) return;
  add_impulse(&s->dv[b], s->arm_b[i], gv_mat3_mul(&K, s->lone_u[i]));
  const gv_mat3 KT = gv_mat3_transposed(&K);
  add_stiffness(gv_blocks_at(&s->blocks, b, b), 1.0, &K, &KT, s->arm_b[i], s->arm_b[i]);
}

// Its velocities once those of the other body are known.
static void step_lone(gv_direct *s, int i) {
  const int a = s->node_a[i], b = s->node_b[i];
  gv_vec3 u = s->lone_u[i];
  if (b >= 0) u = gv_sub(u, point_velocity(&s->dv[b], s->arm_b[i]));
  gv_six by_contact = {{0}};
  add_impulse(&by_contact, s->arm_a[i], gv_neg(gv_mat3_mul(&s->lone[i], u)));
  by_contact = accelerated(s, a, &by_contact);
  for (int k = 0; k < 6; k++) s->dv[a].m[k] += by_contact.m[k];
}

// The stiffness of contact i between bodies that are in the matrix, in the world's axes: B stiff.
static gv_mat3 contact_stiffness(const gv_direct *s, int i) {
  const double *stiff = &s->stiff[3 * i];
  if (is_stuck(s, i)) return scaled_sum(stiff[1], stiff[0] - stiff[1], s->along[i][0]);
  gv_mat3 B = follow(s, i);
  for (int r = 0; r < 3; r++)
    for (int c = 0; c < 3; c++) B.m[r][c] *= stiff[c];
  return to_world(s, i, &B);
}

static void add_contact(gv_direct *s, int i, bool symmetric) {
  const int a = s->node_a[i], b = s->node_b[i];
  if (!memchr(&s->row[3 * i], GV_DIRECT_HOLDS, 3)) return;
  const gv_mat3 K = contact_stiffness(s, i), KT = gv_mat3_transposed(&K);
  if (a >= 0) add_stiffness(gv_blocks_at(&s->blocks, a, a), 1.0, &K, &KT, s->arm_a[i], s->arm_a[i]);
  if (b >= 0) add_stiffness(gv_blocks_at(&s->blocks, b, b), 1.0, &K, &KT, s->arm_b[i], s->arm_b[i]);
  if (a < 0 || b < 0) return;
  bool a_first = gv_blocks_first(&s->blocks, a, b) == a;
  gv_vec3 row = a_first ? s->arm_a[i] : s->arm_b[i], column = a_first ? s->arm_b[i] : s->arm_a[i];
  add_stiffness(gv_blocks_at(&s->blocks, a, b), -1.0, &K, &KT, row, column);
  if (!symmetric) add_stiffness(gv_blocks_mirror(&s->blocks, a, b), -1.0, &KT, &K, row, column);
}

// Newton's step from v on the pieces that the rows are on; false where the matrix cannot be solved or time is up.
static bool find_step(gv_direct *s) {
  if (s->steps_left-- <= 0) return false;
  const bool symmetric = is_symmetric(s);
  gv_blocks_clear(&s->blocks, symmetric);
  add_masses(s);
  for (int i = 0; i < s->count; i++) add_impulses(s, i);
  for (int i = 0; i < s->count; i++)
    if (is_lone(s, i)) add_lone(s, i);
    else add_contact(s, i, symmetric);
  if (!gv_blocks_solve(&s->blocks, symmetric, s->dv)) return false;
  for (int i = 0; i < s->count; i++)
    if (is_lone(s, i)) step_lone(s, i);
  return true;
}

// The part of the slope of the convex function along the step that the masses have: at v, and how it grows.
static void find_mass_slope(const gv_direct *s, double *out_at_v, double *out_growth) {
  *out_at_v = *out_growth = 0.0;
  for (int n = 0; n < s->nodes; n++) {
    const double *d = s->dv[n].m, *v = s->v[n].m, *free = s->free[n].m;
    for (int k = 0; k < 3; k++) {
      *out_at_v += s->mass[n] * d[k] * (v[k] - free[k]);
      *out_growth += s->mass[n] * d[k] * d[k];
      for (int c = 0; c < 3; c++) {
        *out_at_v += d[3 + k] * s->inertia[n].m[k][c] * (v[3 + c] - free[3 + c]);
        *out_growth += d[3 + k] * s->inertia[n].m[k][c] * d[3 + c];
      }
    }
  }
}

static double slope_at(const gv_direct *s, double at_v, double growth, double t) {
  double sum = at_v + t * growth;
  for (int r = 0; r < 3 * s->count; r++) {
    double u = s->u[r] + t * s->du[r];
    sum -= s->du[r] * impulse_on(s, r, piece_at(s, r, u), u);
  }
  return sum;
}

// Where along the step, between low and high, rows change their pieces.
static int find_bends(gv_direct *s, double low, double high) {
  int count = 0;
  for (int r = 0; r < 3 * s->count; r++) {
    const double at = 1.0 / s->du[r], middle = (s->asked[r] - s->u[r]) * at, zone = r % 3 == 0 ? 0.0 : s->limit[r / 3] / s->stiff[r] * at;
    if (middle - zone > low && middle - zone < high) s->bend[count++] = middle - zone;
    if (zone != 0.0 && middle + zone > low && middle + zone < high) s->bend[count++] = middle + zone;
  }
  return count;
}

// The bend nearest to t; those that are not between low and high are dropped on the way.
static double nearest_bend(gv_direct *s, int *io_count, double low, double high, double t) {
  double best = HUGE_VAL;
  int kept = 0;
  for (int k = 0; k < *io_count; k++) {
    const double at = s->bend[k];
    if (!(at > low && at < high)) continue;
    s->bend[kept++] = at;
    if (fabs(at - t) < fabs(best - t)) best = at;
  }
  *io_count = kept;
  return best;
}

// How far to go: to the least value of the function along the step. Its slope grows all the way, by straight pieces
// between bends; the search halves in on the piece that crosses zero.
static double search_line(gv_direct *s) {
  double at_v, growth, low = 0.0, high = 1.0;
  find_velocities(s, s->dv, s->du);
  find_mass_slope(s, &at_v, &growth);
  double at_low = slope_at(s, at_v, growth, low), at_high = slope_at(s, at_v, growth, high);
  for (int i = 0; i < SEARCH && at_high < 0.0; i++) low = high, at_low = at_high, high *= 2.0, at_high = slope_at(s, at_v, growth, high);
  int bends = find_bends(s, low, high);
  for (int i = 0; i < SEARCH; i++) {
    double t = nearest_bend(s, &bends, low, high, i % 2 ? 0.5 * (low + high) : low + (high - low) * at_low / (at_low - at_high));
    if (t == HUGE_VAL) break;
    double at = slope_at(s, at_v, growth, t);
    if (at < 0.0) low = t, at_low = at;
    else high = t, at_high = at;
  }
  return at_low < at_high ? low + (high - low) * at_low / (at_low - at_high) : low;
}

static void take_step(gv_direct *s, double t) {
  for (int n = 0; n < s->nodes; n++)
    for (int k = 0; k < 6; k++) s->v[n].m[k] += t * s->dv[n].m[k];
  find_velocities(s, s->v, s->u);
}

// Full steps from the pieces that the rows are on, at most so many.
static bool step_boldly(gv_direct *s, int most) {
  s->bold = true;
  for (int i = 0; i < s->count; i++) s->limit[i] = limit_now(s, i);
  for (int i = 0; i < most; i++) {
    if (!find_step(s)) return false;
    take_step(s, 1.0);
    if (set_pieces(s)) return true;
  }
  return false;
}

// The convex problem of the friction limits as they are, from v.
static bool step_safely(gv_direct *s) {
  s->bold = false;
  set_pieces(s);
  for (int i = 0; i < SAFE; i++) {
    if (!find_step(s)) return false;
    take_step(s, search_line(s));
    if (set_pieces(s)) return true;
  }
  return false;
}

// The last step's pieces and friction limits, and a full step from there. A new contact gets its limit after that.
static bool start_safely(gv_direct *s, const gv_problem_contact *contact) {
  s->bold = false;
  take_guess(s, contact);
  memcpy(s->v, s->free, sizeof s->v[0] * (size_t)s->nodes);
  find_velocities(s, s->v, s->u);
  if (!find_step(s)) return false;
  take_step(s, 1.0);
  for (int i = 0; i < s->count; i++) {
    if (s->limit[i] < HUGE_VAL) continue;
    s->row[3 * i] = piece_at(s, 3 * i, s->u[3 * i]);
    s->limit[i] = limit_now(s, i);
  }
  return true;
}

// Halfway from the limits that were given to those that came out.
static void mix_limits(gv_direct *s) {
  for (int i = 0; i < s->count; i++) s->limit[i] = 0.5 * (s->limit[i] + limit_now(s, i));
}

static bool iterate(gv_direct *s, const gv_problem_contact *contact) {
  const size_t of_v = sizeof s->v[0] * (size_t)s->nodes, of_limit = sizeof s->limit[0] * (size_t)s->count;
  s->limits_right = true;
  take_guess(s, contact);
  find_velocities(s, s->v, s->u);
  for (int i = 0; i < s->count; i++)
    if (s->limit[i] == HUGE_VAL && s->u[3 * i] > s->asked[3 * i]) memset(&s->row[3 * i], GV_DIRECT_OPEN, 3);
  if (step_boldly(s, BOLD)) return true;
  if (!start_safely(s, contact)) return false;
  for (int round = 0; round < ROUNDS; round++) {
    if (round > 0) mix_limits(s);
    if (!step_safely(s)) return false;
    memcpy(s->kept_v, s->v, of_v);
    memcpy(s->kept_limit, s->limit, of_limit);
    if (step_boldly(s, BOLD)) return true;
    memcpy(s->v, s->kept_v, of_v);
    memcpy(s->limit, s->kept_limit, of_limit);
    s->bold = false;
    find_velocities(s, s->v, s->u);
    set_pieces(s);
  }
  s->limits_right = false;
  return true;
}

// ---- the answer -----------------------------------------------------------------------------------

static gv_vec3 find_impulse(gv_direct *s, const gv_problem_contact *c, int i) {
  double x[3];
  for (int k = 0; k < 3; k++) x[k] = impulse_on(s, 3 * i + k, s->row[3 * i + k], s->u[3 * i + k]);
  s->last[i] = (gv_direct_guess){c->body_a, c->body_b, x[0], {0}};
  memcpy(s->last[i].row, &s->row[3 * i], 3);
  return in_world(s, i, gv_v3(x[0], x[1], x[2]));
}

// As many linear solves as fit into the budget; as measured, 0.1 us a contact and 0.08 us a block operation
// each. None where too few fit to be worth a try: another solver needs its share then.
static int count_steps(const gv_direct *s, double budget_s) {
  double solve_s = 1e-7 * s->count + 8e-8 * s->blocks.work;
  int fit = (int)fmin(budget_s / fmax(solve_s, 1e-6), MOST_STEPS);
  return fit < LEAST_STEPS ? 0 : fit;
}

static bool is_finite(const gv_direct *s) {
  for (int n = 0; n < s->nodes; n++)
    for (int k = 0; k < 6; k++)
      if (!isfinite(s->v[n].m[k])) return false;
  return true;
}

static bool suits(const gv_problem *problem) {
  for (int i = 0; i < problem->contact_count; i++)
    if (problem->contact[i].friction != GV_FRICTION_PYRAMID) return false;
  return true;
}

static gv_outcome solve(void *memory, const gv_problem *problem, gv_velocity out_velocity[], gv_vec3 out_impulse[]) {
  gv_direct *s = memory;
  const gv_problem_contact *contact = problem->contact;
  int node[GV_BODIES];
  s->count = problem->contact_count;
  if (!suits(problem) || !make_nodes(s, node, problem->body, contact)) return GV_OUTCOME_NONE;
  s->steps_left = count_steps(s, problem->budget_s);
  for (int i = 0; i < s->count; i++) make_rows(s, problem->body, &contact[i], i);
  if (!iterate(s, contact) || !is_finite(s)) return GV_OUTCOME_NONE;
  for (int i = 0; i < s->count; i++) out_impulse[i] = find_impulse(s, &contact[i], i);
  s->last_count = s->count;
  for (int b = 0; b < GV_BODIES; b++) {
    if (node[b] < 0) continue;
    const double *v = s->v[node[b]].m;
    out_velocity[b] = (gv_velocity){{v[0], v[1], v[2]}, {v[3], v[4], v[5]}};
  }
  return s->limits_right ? GV_OUTCOME_SOLVED : GV_OUTCOME_LAGGED;
}

static void forget(void *memory) {
  gv_direct *s = memory;
  s->last_count = 0;
}

const gv_contact_solver gv_solver_newton = {"newton", sizeof(gv_direct), solve, forget};
