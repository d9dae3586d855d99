// SPDX-License-Identifier: BSD-3-Clause
// The direct contact solver against the contact problem's own conditions, on random problems whose matrices are
// built here anew: no impulse pulls, no contact closes faster than allowed, what pushes does not separate,
// friction stays in its bounds, and where it is at a bound it opposes the slip.
#include <string.h>

#include "../src/direct.h"
#include "check.h"

enum { BODIES = 6, CONTACTS = 9, ROWS = 3 * CONTACTS };
static unsigned long long seed = 5;
static double draw(double lo, double hi) { return check_uniform(&seed, lo, hi); }
static gv_vec3 draw_vector(double size) { return gv_v3(draw(-size, size), draw(-size, size), draw(-size, size)); }

typedef struct problem {
  gv_config cfg;
  gv_direct_body body[GV_BODIES];
  gv_dynamics_contact contact[CONTACTS];
  int count;
  double jacobian[ROWS][6 * BODIES], asked[ROWS];
} problem;

// Body 0 stands; the others are limbs or objects.
static void draw_body(gv_direct_body *b, bool moves) {
  memset(b, 0, sizeof *b);
  b->p = draw_vector(0.05);
  if (!moves) return;
  b->inv_mass = 1 / draw(0.01, 0.3);
  gv_mat3 R = gv_mat3_from_quat(gv_quat_exp(draw_vector(2)));
  double d[3] = {1 / draw(1e-5, 1e-4), 1 / draw(1e-5, 1e-4), 1 / draw(1e-5, 1e-4)};
  for (int r = 0; r < 3; r++)
    for (int c = 0; c < 3; c++)
      for (int k = 0; k < 3; k++) b->inv_inertia.m[r][c] += R.m[r][k] * d[k] * R.m[c][k];
  b->v = draw_vector(0.05);
  b->w = draw_vector(1);
}

static void draw_problem(problem *q) {
  memset(q, 0, sizeof *q);
  q->cfg = gv_config_default();
  q->count = (int)draw(1, CONTACTS + 1);
  for (int i = 0; i < BODIES; i++) draw_body(&q->body[i], i > 0);
  for (int i = 0; i < q->count; i++) {
    gv_dynamics_contact *c = &q->contact[i];
    c->body_a = (int)draw(1, BODIES);
    do c->body_b = (int)draw(0, BODIES); while (c->body_b == c->body_a);
    c->position = draw_vector(0.05);
    c->normal = gv_normalize_or(draw_vector(1), gv_v3(0, 0, 1));
    c->friction_dir = gv_any_perpendicular(c->normal);
    c->depth = draw(-1e-4, 2e-4);
    c->mu = draw(0.1, 1.2);
  }
}

static void put(double *row, int body, double sign, gv_vec3 d, gv_vec3 arm) {
  gv_vec3 turn = gv_cross(arm, d);
  const double v[6] = {d.x, d.y, d.z, turn.x, turn.y, turn.z};
  for (int k = 0; k < 6; k++) row[6 * body + k] = sign * v[k];
}

static void build(problem *q) {
  for (int r = 0; r < 3 * q->count; r++) {
    const gv_dynamics_contact *c = &q->contact[r / 3];
    gv_vec3 d = r % 3 == 0 ? c->normal : r % 3 == 1 ? c->friction_dir : gv_cross(c->normal, c->friction_dir);
    put(q->jacobian[r], c->body_a, 1, d, gv_sub(c->position, q->body[c->body_a].p));
    put(q->jacobian[r], c->body_b, -1, d, gv_sub(c->position, q->body[c->body_b].p));
    double h = q->cfg.step_s, out = c->depth < 0 ? c->depth / h : fmin(0.2 * c->depth / h, 0.25);
    q->asked[r] = r % 3 == 0 ? out : 0;
  }
}

// Velocities of all bodies after the impulses.
static void apply(const problem *q, const double impulse[ROWS], double out_v[6 * BODIES]) {
  for (int b = 0; b < BODIES; b++) {
    double sum[6] = {0};
    for (int r = 0; r < 3 * q->count; r++)
      for (int k = 0; k < 6; k++) sum[k] += q->jacobian[r][6 * b + k] * impulse[r];
    const gv_direct_body *body = &q->body[b];
    gv_vec3 w = gv_add(body->w, gv_mat3_mul(&body->inv_inertia, gv_v3(sum[3], sum[4], sum[5])));
    gv_vec3 v = gv_mad(body->v, body->inv_mass, gv_v3(sum[0], sum[1], sum[2]));
    const double all[6] = {v.x, v.y, v.z, w.x, w.y, w.z};
    memcpy(&out_v[6 * b], all, sizeof all);
  }
}

static void check_solution(const problem *q, const gv_vec3 force[]) {
  double x[ROWS] = {0}, v[6 * BODIES];
  for (int i = 0; i < q->count; i++) {
    const gv_dynamics_contact *c = &q->contact[i];
    gv_vec3 impulse = gv_scale(force[i], q->cfg.step_s);
    x[3 * i] = gv_dot(impulse, c->normal);
    x[3 * i + 1] = gv_dot(impulse, c->friction_dir);
    x[3 * i + 2] = gv_dot(impulse, gv_cross(c->normal, c->friction_dir));
  }
  apply(q, x, v);
  for (int r = 0; r < 3 * q->count; r++) {
    double soft = (r % 3 == 0 ? q->cfg.contact_cfm : q->cfg.world_cfm) / q->cfg.step_s, slip = -q->asked[r] + soft * x[r];
    for (int k = 0; k < 6 * BODIES; k++) slip += q->jacobian[r][k] * v[k];
    if (r % 3 == 0) {
      CHECK(x[r] >= -2e-8 && slip >= -2e-8, "normal impulse %g, closing beyond what is allowed at %g m/s", x[r], slip);
      CHECK(fabs(x[r] * slip) < 2e-8, "pushes with %g N s and separates at %g m/s", x[r], slip);
      continue;
    }
    double limit = q->contact[r / 3].mu * fmax(0, x[r - r % 3]);
    CHECK(fabs(x[r]) <= limit + 2e-8, "friction %g N s beyond %g", x[r], limit);
    if (fabs(x[r]) < limit - 3e-8) CHECK(fabs(slip) < 1e-7, "holds with %g of %g N s, but slips at %g m/s", x[r], limit, slip);
    else CHECK(x[r] * slip <= 1e-8 * fabs(x[r]) + 1e-12, "friction %g N s drives a slip of %g m/s", x[r], slip);
  }
}

static void test_contact_conditions(void) {
  enum { PROBLEMS = 20000 };
  static gv_direct direct;
  static problem q;
  int solved = 0, closed = 0;
  for (int i = 0; i < PROBLEMS; i++) {
    gv_vec3 force[CONTACTS];
    draw_problem(&q);
    build(&q);
    direct.last_count = 0;
    if (!gv_direct_solve(&direct, &q.cfg, q.body, q.contact, q.count, force)) continue;
    solved++;
    check_solution(&q, force);
    for (int k = 0; k < q.count; k++) closed += gv_norm(force[k]) > 0;
  }
  printf("  %d of %d random problems solved, %d contacts closed\n", solved, PROBLEMS, closed);
  CHECK(solved > PROBLEMS / 2 && closed > PROBLEMS / 2, "too few to mean anything");
}

// Any first guess leads to the same forces.
static void test_guess_does_not_matter(void) {
  static gv_direct direct;
  static problem q;
  int compared = 0;
  for (int i = 0; i < 3000; i++) {
    gv_vec3 cold[CONTACTS], warm[CONTACTS];
    draw_problem(&q);
    for (int k = 0; k < q.count; k++) q.contact[k].mu = draw(0.1, 0.3);  // little friction: one solution
    build(&q);
    direct.last_count = 0;
    if (!gv_direct_solve(&direct, &q.cfg, q.body, q.contact, q.count, cold)) continue;
    for (int k = 0; k < direct.last_count; k++) memset(direct.last[k].row, draw(0, 1) < 0.5 ? GV_DIRECT_HOLDS : GV_DIRECT_OPEN, 3);
    if (!gv_direct_solve(&direct, &q.cfg, q.body, q.contact, q.count, warm)) continue;
    compared++;
    for (int k = 0; k < q.count; k++) CHECK(gv_norm(gv_sub(cold[k], warm[k])) < 1e-3 + 1e-6 * gv_norm(cold[k]), "contact %d: %g N and %g N", k, gv_norm(cold[k]), gv_norm(warm[k]));
  }
  CHECK(compared > 1000, "%d compared", compared);
}

int main(void) {
  RUN(test_contact_conditions);
  RUN(test_guess_does_not_matter);
  return check_done();
}
