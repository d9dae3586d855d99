// SPDX-License-Identifier: BSD-3-Clause
// The contact solver `newton` against the contact problem's own conditions, on random problems whose
// matrices are built here anew: no impulse pulls, no contact closes faster than allowed, what pushes does
// not separate, friction stays in Coulomb's round cone, opposes the slip where it is at the cone's surface
// (maximum dissipation), and holds below it. The problems are nastier than a grasp: strong friction
// between bodies that hold each other from all sides, nothing known from a last step. And the elimination
// of blocks against that of the whole matrix.
#include <string.h>

#include "gloved/engine.h"
#include "dynamics/newton.h"
#include "support/check.h"

enum { BODIES = 6, CONTACTS = 9, ROWS = 3 * CONTACTS };
static unsigned long long seed = 5;
static double draw(double lo, double hi) { return check_uniform(&seed, lo, hi); }
static gv_vec3 draw_vector(double size) {
  return gv_v3(draw(-size, size), draw(-size, size), draw(-size, size));
}

typedef struct problem {
  gv_config cfg;
  gv_problem_body body[GV_BODIES];
  double inv_mass[BODIES];
  gv_mat3 inv_inertia[BODIES];
  gv_dynamics_contact contact[CONTACTS];
  int count;
  double jacobian[ROWS][6 * BODIES], asked[ROWS];
} problem;

typedef struct answer {
  gv_velocity velocity[GV_BODIES];
  gv_vec3 impulse[CONTACTS];  // N s, on body a
  double softening;
} answer;

// Body 0 stands, 1 to 3 are limbs, the others objects: their numbers in the solver.
static int number(int b) { return b <= 3 ? b : GV_LIMBS + b; }
static int of_number(int n) { return n < GV_LIMBS ? n : n - GV_LIMBS; }

static void draw_body(problem *q, int i, bool moves) {
  gv_problem_body *b = &q->body[number(i)];
  b->p = draw_vector(0.05);
  if (!moves)
    return;
  b->mass = draw(0.01, 0.3);
  q->inv_mass[i] = 1 / b->mass;
  gv_mat3 R = gv_mat3_from_quat(gv_quat_exp(draw_vector(2)));
  double d[3] = {draw(1e-5, 1e-4), draw(1e-5, 1e-4), draw(1e-5, 1e-4)};
  if (i <= 3)
    d[1] = d[2] = d[0];  // a limb turns as easily about every axis
  for (int r = 0; r < 3; r++)
    for (int c = 0; c < 3; c++)
      for (int k = 0; k < 3; k++) {
        b->inertia.m[r][c] += R.m[r][k] * d[k] * R.m[c][k];
        q->inv_inertia[i].m[r][c] += R.m[r][k] / d[k] * R.m[c][k];
      }
  b->v = draw_vector(0.05);
  b->w = draw_vector(1);
}

static void draw_problem(problem *q) {
  memset(q, 0, sizeof *q);
  q->cfg = gv_config_default();
  q->count = (int)draw(1, CONTACTS + 1);
  for (int i = 0; i < BODIES; i++)
    draw_body(q, i, i > 0);
  for (int i = 0; i < q->count; i++) {
    gv_dynamics_contact *c = &q->contact[i];
    c->body_a = number((int)draw(1, BODIES));
    do
      c->body_b = number((int)draw(0, BODIES));
    while (c->body_b == c->body_a);
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
  for (int k = 0; k < 6; k++)
    row[6 * body + k] = sign * v[k];
}

static void build(problem *q) {
  for (int r = 0; r < 3 * q->count; r++) {
    const gv_dynamics_contact *c = &q->contact[r / 3];
    gv_vec3 d = r % 3 == 0 ? c->normal : r % 3 == 1 ? c->friction_dir : gv_cross(c->normal, c->friction_dir);
    put(q->jacobian[r], of_number(c->body_a), 1, d, gv_sub(c->position, q->body[c->body_a].p));
    put(q->jacobian[r], of_number(c->body_b), -1, d, gv_sub(c->position, q->body[c->body_b].p));
    double h = q->cfg.step_s;
    double out = c->depth < 0 ? c->depth / h : fmin(0.2 * c->depth / h, 0.25);
    q->asked[r] = r % 3 == 0 ? out : 0;
  }
}

// Velocities of all bodies after the impulses.
static void apply(const problem *q, const double impulse[ROWS], double out_v[6 * BODIES]) {
  for (int b = 0; b < BODIES; b++) {
    double sum[6] = {0};
    for (int r = 0; r < 3 * q->count; r++)
      for (int k = 0; k < 6; k++)
        sum[k] += q->jacobian[r][6 * b + k] * impulse[r];
    const gv_problem_body *body = &q->body[number(b)];
    gv_vec3 w = gv_add(body->w, gv_mat3_mul(&q->inv_inertia[b], gv_v3(sum[3], sum[4], sum[5])));
    gv_vec3 v = gv_mad(body->v, q->inv_mass[b], gv_v3(sum[0], sum[1], sum[2]));
    const double all[6] = {v.x, v.y, v.z, w.x, w.y, w.z};
    memcpy(&out_v[6 * b], all, sizeof all);
  }
}

// Velocity that a row has beyond what is asked of it, with its compliance.
static double row_slip(const problem *q, int r, double softening, const double x[ROWS],
                       const double v[6 * BODIES]) {
  const double cfm = r % 3 == 0 ? q->cfg.contact_cfm : softening * q->cfg.world_cfm;
  double slip = -q->asked[r] + cfm / q->cfg.step_s * x[r];
  for (int k = 0; k < 6 * BODIES; k++)
    slip += q->jacobian[r][k] * v[k];
  return slip;
}

// |f_t| <= mu f_n (1 + 1e-3) + 1e-4 N; below that no slip over 1e-5 m/s; at it
// against the slip within 1 degree.
static void check_friction(const problem *q, int i, const double x[ROWS], const double slip[3]) {
  const double h = q->cfg.step_s;
  const double size = hypot(x[3 * i + 1], x[3 * i + 2]);
  const double speed = hypot(slip[1], slip[2]);
  const double limit = q->contact[i].mu * fmax(0, x[3 * i]);
  CHECK(size <= limit * (1 + 1e-3) + 1e-4 * h, "friction %g N s beyond %g", size, limit);
  if (size < limit * (1 - 1e-3) - 1e-4 * h)
    CHECK(speed < 1e-5, "holds with %g of %g N s, but slips at %g m/s", size, limit, speed);
  if (speed < 1e-5 || size < 1e-4 * h)
    return;
  const double cosine = -(x[3 * i + 1] * slip[1] + x[3 * i + 2] * slip[2]) / (size * speed);
  CHECK(cosine > cos(GV_PI / 180), "friction is %g degrees off the slip", acos(cosine) * 180 / GV_PI);
}

// Momentum: the velocities that were told are those that the impulses give.
static void check_momentum(const problem *q, const double v[6 * BODIES], const gv_velocity told[GV_BODIES]) {
  bool touched[BODIES] = {false};
  for (int i = 0; i < q->count; i++)
    touched[of_number(q->contact[i].body_a)] = touched[of_number(q->contact[i].body_b)] = true;
  for (int b = 0; b < BODIES; b++) {
    const gv_velocity *t = &told[number(b)];
    if (!touched[b] || !(q->inv_mass[b] > 0))
      continue;
    CHECK(gv_norm(gv_sub(t->v, gv_v3(v[6 * b], v[6 * b + 1], v[6 * b + 2]))) < 1e-9, "body %d: velocity", b);
    CHECK(gv_norm(gv_sub(t->w, gv_v3(v[6 * b + 3], v[6 * b + 4], v[6 * b + 5]))) < 1e-7, "body %d: spin", b);
  }
}

static void check_solution(const problem *q, const answer *y) {
  double x[ROWS] = {0}, v[6 * BODIES];
  for (int i = 0; i < q->count; i++) {
    const gv_dynamics_contact *c = &q->contact[i];
    x[3 * i] = gv_dot(y->impulse[i], c->normal);
    x[3 * i + 1] = gv_dot(y->impulse[i], c->friction_dir);
    x[3 * i + 2] = gv_dot(y->impulse[i], gv_cross(c->normal, c->friction_dir));
  }
  apply(q, x, v);
  check_momentum(q, v, y->velocity);
  for (int i = 0; i < q->count; i++) {
    double slip[3];
    for (int k = 0; k < 3; k++)
      slip[k] = row_slip(q, 3 * i + k, y->softening, x, v);
    CHECK(x[3 * i] >= -2e-8 && slip[0] >= -1e-6,
          "normal impulse %g, closing beyond what is allowed at %g m/s", x[3 * i], slip[0]);
    CHECK(fabs(x[3 * i] * slip[0]) < 2e-8, "pushes with %g N s and separates at %g m/s", x[3 * i], slip[0]);
    check_friction(q, i, x, slip);
  }
}

static gv_newton newton;

static gv_outcome solve(const problem *q, answer *out) {
  static gv_problem stated;
  int index[CONTACTS];
  stated.step_s = q->cfg.step_s;
  stated.budget_s = 0.5 * q->cfg.step_s;
  stated.body_count = GV_BODIES;
  memcpy(stated.body, q->body, sizeof q->body);
  gv_problem_set_contacts(&stated, &q->cfg, q->contact, q->count, index);
  const gv_outcome outcome = gv_solver_newton.solve(&newton, &stated, out->velocity, out->impulse);
  out->softening = newton.softening;
  CHECK(outcome != GV_OUTCOME_SOLVED || out->softening == 1, "solved, with %g times the compliance",
        out->softening);
  CHECK(outcome != GV_OUTCOME_LAGGED, "friction bounded by another moment's normal force");
  return outcome;
}

static void test_coulombs_law_on_random_problems(void) {
  enum { PROBLEMS = 20000 };
  static problem q;
  int solved = 0;
  int softened = 0;
  int closed = 0;
  for (int i = 0; i < PROBLEMS; i++) {
    answer y;
    draw_problem(&q);
    build(&q);
    gv_solver_newton.forget(&newton);
    const gv_outcome outcome = solve(&q, &y);
    if (outcome == GV_OUTCOME_NONE)
      continue;
    solved += outcome == GV_OUTCOME_SOLVED;
    softened += outcome == GV_OUTCOME_SOFTENED;
    check_solution(&q, &y);
    for (int k = 0; k < q.count; k++)
      closed += gv_norm(y.impulse[k]) > 0;
  }
  printf("  %d random problems: %d solved, %d softened, %d contacts closed\n", PROBLEMS, solved, softened,
         closed);
  CHECK(solved >= PROBLEMS - PROBLEMS / 100 && solved + softened >= PROBLEMS - PROBLEMS / 1000, "too few");
  CHECK(closed > PROBLEMS, "too few contacts");
}

// Any first guess leads to the same forces.
static void test_guess_does_not_matter(void) {
  static problem q;
  int compared = 0;
  for (int i = 0; i < 3000; i++) {
    answer cold, warm;
    draw_problem(&q);
    for (int k = 0; k < q.count; k++)
      q.contact[k].mu = draw(0.1, 0.3);  // little friction: one solution
    build(&q);
    gv_solver_newton.forget(&newton);
    if (solve(&q, &cold) != GV_OUTCOME_SOLVED)
      continue;
    for (int k = 0; k < newton.last_count; k++)
      newton.last[k].state = draw(0, 1) < 0.5 ? GV_NEWTON_STICKING : GV_NEWTON_OPEN;
    if (solve(&q, &warm) != GV_OUTCOME_SOLVED)
      continue;
    compared++;
    for (int k = 0; k < q.count; k++) {
      const double size = gv_norm(cold.impulse[k]);
      const double apart = gv_norm(gv_sub(cold.impulse[k], warm.impulse[k]));
      CHECK(apart < 1e-6 + 1e-6 * size, "contact %d: %g and %g N s", k, size, gv_norm(warm.impulse[k]));
    }
  }
  CHECK(compared > 2900, "%d compared", compared);
}

// ---- blocks ---------------------------------------------------------------------------------------

enum { NODES = 12, N = 6 * NODES };

// A random sparse matrix, positive but not symmetric unless asked, in both forms.
static void draw_matrix(gv_blocks *b, bool symmetric, double whole[N][N]) {
  bool linked[NODES][NODES] = {{false}};
  gv_blocks_begin(b, NODES);
  for (int i = 0; i < NODES; i++)
    for (int k = 0; k < i; k++)
      if (draw(0, 1) < 0.25) {
        gv_blocks_link(b, i, k);
        linked[i][k] = linked[k][i] = true;
      }
  CHECK(gv_blocks_order(b), "no room");
  gv_blocks_clear(b, symmetric);
  memset(whole, 0, sizeof(double[N][N]));
  for (int r = 0; r < N; r++)
    for (int c = 0; c < N; c++)
      if (linked[r / 6][c / 6] || r / 6 == c / 6)
        whole[r][c] = symmetric && c < r ? whole[c][r] : r == c ? draw(20, 40) : draw(-1, 1);
  for (int r = 0; r < N; r++)
    for (int c = 0; c < N; c++) {
      int i = r / 6;
      int k = c / 6;
      if (whole[r][c] == 0)
        continue;
      if (gv_blocks_first(b, i, k) == i)
        gv_blocks_at(b, i, k)->m[r % 6][c % 6] = whole[r][c];
      else
        gv_blocks_mirror(b, i, k)->m[c % 6][r % 6] = whole[r][c];
    }
}

static void test_blocks_solve_the_whole_matrix(void) {
  static gv_blocks blocks;
  static double whole[N][N];
  for (int trial = 0; trial < 200; trial++) {
    gv_six x[NODES], y[NODES];
    draw_matrix(&blocks, trial % 2, whole);
    for (int r = 0; r < N; r++)
      x[r / 6].m[r % 6] = y[r / 6].m[r % 6] = draw(-1, 1);
    CHECK(gv_blocks_solve(&blocks, trial % 2, x), "trial %d: no solution", trial);
    for (int r = 0; r < N; r++) {
      double sum = -y[r / 6].m[r % 6];
      for (int c = 0; c < N; c++)
        sum += whole[r][c] * x[c / 6].m[c % 6];
      CHECK(fabs(sum) < 1e-12, "trial %d: row %d is off by %g", trial, r, sum);
    }
  }
}

static void test_blocks_refuse(void) {
  static gv_blocks blocks;
  gv_six x[2] = {{{0}}};
  gv_blocks_begin(&blocks, 1);
  CHECK(gv_blocks_order(&blocks), "no room");
  gv_blocks_clear(&blocks, true);
  CHECK(!gv_blocks_solve(&blocks, true, x), "divided by zero");
  gv_blocks_begin(&blocks, GV_NODES);
  for (int i = 0; i < GV_NODES; i++)
    for (int k = 0; k < i; k++)
      gv_blocks_link(&blocks, i, k);
  CHECK(!gv_blocks_order(&blocks), "more blocks than there is room for");
}

int main(void) {
  RUN(test_blocks_solve_the_whole_matrix);
  RUN(test_blocks_refuse);
  RUN(test_coulombs_law_on_random_problems);
  RUN(test_guess_does_not_matter);
  return check_done();
}
