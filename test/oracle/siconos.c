// SPDX-License-Identifier: BSD-3-Clause
// The contact solver `newton` against an oracle that is not ours: Siconos (Debian's libsiconos-numerics-dev)
// solves the same problems, steps of the recorded grasps and random ones, by block Gauss-Seidel (fc3d_nsgs)
// in the impulses, from the dense Delassus operator that is built here. Bodies must move alike; impulses
// need not, since redundant contacts share friction in many ways. Where the motions differ, the laws of
// contact decide: both answers obey them (the problem has several solutions), Siconos's does not (it did not
// converge), or ours does not, which is a failure. `make test-oracle`.
#include <dirent.h>
#include <string.h>
#include <unistd.h>

#include <FrictionContactProblem.h>
#include <Friction_cst.h>
#include <NonSmoothDrivers.h>
#include <NumericsMatrix.h>
#include <SolverOptions.h>
#include <fc3d_Solvers.h>

#include "dynamics/choice.h"
#include "dynamics/newton.h"
#include "replay/replay.h"
#include "support/check.h"
#include "support/contact_laws.h"

enum { CONTACTS = 60, ROWS = 3 * CONTACTS };

typedef struct answer {
  gv_velocity velocity[GV_BODIES];
  gv_vec3 impulse[GV_MAX_CONTACTS];
} answer;

typedef struct tally {
  int asked, alike, several, not_converged, wrong;
  int confirmed;  // of those that do not move alike: begun from our answer, Siconos stays there
  double apart;
} tally;
static tally now;

// ---- the problem in impulses: u = A r + q ---------------------------------------------------------

static double A[ROWS * ROWS], q[ROWS], mu[CONTACTS], r[ROWS], u[ROWS];  // A by columns

// Velocity of body b's point at `point` for an impulse x at `from`.
static gv_vec3 yield(const gv_problem_body *b, gv_vec3 from, gv_vec3 x, gv_vec3 point) {
  if (!(b->mass > 0.0))
    return gv_v3(0, 0, 0);
  const gv_mat3 inverse = gv_mat3_inverse(&b->inertia);
  const gv_vec3 w = gv_mat3_mul(&inverse, gv_cross(gv_sub(from, b->p), x));
  return gv_mad(gv_cross(w, gv_sub(point, b->p)), 1.0 / b->mass, x);
}

// Velocity of contact i for an impulse x on body a of contact k.
static gv_vec3 response(const gv_problem *p, const gv_problem_contact *i, const gv_problem_contact *k,
                        gv_vec3 x) {
  gv_vec3 sum = gv_v3(0, 0, 0);
  if (i->body_a == k->body_a)
    sum = gv_add(sum, yield(&p->body[i->body_a], k->point, x, i->point));
  if (i->body_b == k->body_b)
    sum = gv_add(sum, yield(&p->body[i->body_b], k->point, x, i->point));
  if (i->body_a == k->body_b)
    sum = gv_sub(sum, yield(&p->body[i->body_a], k->point, x, i->point));
  if (i->body_b == k->body_a)
    sum = gv_sub(sum, yield(&p->body[i->body_b], k->point, x, i->point));
  return sum;
}

static void build(const gv_problem *p) {
  const int rows = 3 * p->contact_count;
  gv_velocity free[GV_BODIES];
  for (int b = 0; b < p->body_count; b++)
    free[b] = (gv_velocity){p->body[b].v, p->body[b].w};
  for (int i = 0; i < p->contact_count; i++) {
    const gv_problem_contact *c = &p->contact[i];
    const gv_vec3 v = contact_velocity(p, c, free);
    mu[i] = c->mu;
    for (int a = 0; a < 3; a++)
      q[3 * i + a] = gv_dot(c->frame[a], v) - (a == 0 ? c->target_velocity : 0.0);
    for (int k = 0; k < p->contact_count; k++)
      for (int e = 0; e < 3; e++) {
        const gv_vec3 y = response(p, c, &p->contact[k], p->contact[k].frame[e]);
        for (int a = 0; a < 3; a++)
          A[3 * i + a + rows * (3 * k + e)] = gv_dot(c->frame[a], y);
      }
    for (int a = 0; a < 3; a++)
      A[(3 * i + a) * (rows + 1)] += a == 0 ? c->normal_compliance : c->tangent_compliance;
  }
}

// From none, or from an answer that is there.
static void ask_siconos(const gv_problem *p, const answer *from, answer *out) {
  const int n = p->contact_count;
  build(p);
  NumericsMatrix *M = NM_create(NM_DENSE, 3 * n, 3 * n);
  memcpy(M->matrix0, A, sizeof *A * (size_t)(9 * n * n));
  FrictionContactProblem problem;
  memset(&problem, 0, sizeof problem);
  problem.dimension = 3;
  problem.numberOfContacts = n;
  problem.M = M;
  problem.q = q;
  problem.mu = mu;
  SolverOptions *options = solver_options_create(SICONOS_FRICTION_3D_NSGS);
  options->dparam[SICONOS_DPARAM_TOL] = 1e-12;
  options->iparam[SICONOS_IPARAM_MAX_ITER] = 20000;
  memset(r, 0, sizeof r);
  memset(u, 0, sizeof u);
  for (int i = 0; i < 3 * n && from; i++)
    r[i] = gv_dot(p->contact[i / 3].frame[i % 3], from->impulse[i / 3]);
  fc3d_driver(&problem, r, u, options);
  solver_options_delete(options);
  free(options);
  NM_clear(M);
  free(M);
  for (int i = 0; i < n; i++) {
    const gv_vec3 *frame = p->contact[i].frame;
    out->impulse[i] = gv_mad(gv_mad(gv_scale(frame[0], r[3 * i]), r[3 * i + 1], frame[1]), r[3 * i + 2],
                             frame[2]);
  }
}

// Velocities that an answer's impulses give: those of both answers are found in the same way.
static void move(const gv_problem *p, answer *a) {
  for (int b = 0; b < p->body_count; b++)
    a->velocity[b] = (gv_velocity){p->body[b].v, p->body[b].w};
  for (int i = 0; i < 2 * p->contact_count; i++) {
    const gv_problem_contact *c = &p->contact[i / 2];
    const int body = i % 2 ? c->body_b : c->body_a;
    const gv_problem_body *b = &p->body[body];
    if (!(b->mass > 0.0))
      continue;
    const gv_mat3 inverse = gv_mat3_inverse(&b->inertia);
    const gv_vec3 x = gv_scale(a->impulse[i / 2], i % 2 ? -1.0 : 1.0);
    a->velocity[body].v = gv_mad(a->velocity[body].v, 1.0 / b->mass, x);
    a->velocity[body].w = gv_add(a->velocity[body].w,
                                 gv_mat3_mul(&inverse, gv_cross(gv_sub(c->point, b->p), x)));
  }
}

// ---- comparison -----------------------------------------------------------------------------------

static bool obeys(const gv_problem *p, const answer *a) {
  contact_laws worst = {0};
  contact_laws_judge(p, a->velocity, a->impulse, &worst);
  return worst.pull_n < 1e-4 && worst.closing_m_s < 1e-5 && worst.outside_n < 1e-3 &&
         worst.creep_m_s < 1e-4 && worst.astray_deg < 2;
}

// Of the largest change that the contacts make, how much the motions differ; a turn counts at 3 cm.
static double motions_apart(const gv_problem *p, const answer *a, const answer *b) {
  double apart = 0;
  double most = 1e-5;
  for (int i = 0; i < p->body_count; i++) {
    if (!(p->body[i].mass > 0.0))
      continue;
    apart = fmax(apart, gv_norm(gv_sub(a->velocity[i].v, b->velocity[i].v)) +
                            0.03 * gv_norm(gv_sub(a->velocity[i].w, b->velocity[i].w)));
    most = fmax(most, gv_norm(gv_sub(a->velocity[i].v, p->body[i].v)) +
                          0.03 * gv_norm(gv_sub(a->velocity[i].w, p->body[i].w)));
  }
  return apart / most;
}

static void compare(const gv_problem *p, const gv_vec3 impulse[]) {
  static answer ours, theirs, from_ours;
  memcpy(ours.impulse, impulse, sizeof *impulse * (size_t)p->contact_count);
  ask_siconos(p, NULL, &theirs);
  move(p, &ours);
  move(p, &theirs);
  now.asked++;
  const double apart = motions_apart(p, &ours, &theirs);
  if (apart < 1e-5) {
    now.alike++;
    now.apart = fmax(now.apart, apart);
    return;
  }
  ask_siconos(p, &ours, &from_ours);
  move(p, &from_ours);
  now.confirmed += motions_apart(p, &ours, &from_ours) < 1e-4;
  if (!obeys(p, &ours)) {
    now.wrong++;
  } else if (!obeys(p, &theirs)) {
    now.not_converged++;
  } else {
    now.several++;
  }
}

static void tell(const char *what) {
  printf("# %-15s %3d problems: %3d move alike (within %.1e), %d with several solutions, %d where Siconos "
         "did not converge, %d wrong; begun from ours it stays there in %d\n",
         what, now.asked, now.alike, now.apart, now.several, now.not_converged, now.wrong, now.confirmed);
  CHECK(now.wrong == 0, "%s: %d answers break the laws", what, now.wrong);
}

// ---- steps of the recorded grasps -----------------------------------------------------------------

static expectation expected;
static measures measured;
static int step;

gv_solver_report __real_gv_choice_solve(gv_choice *choice, gv_problem *problem, gv_velocity out_velocity[],
                                        gv_vec3 out_impulse[]);
gv_solver_report __wrap_gv_choice_solve(gv_choice *choice, gv_problem *problem, gv_velocity out_velocity[],
                                        gv_vec3 out_impulse[]);
gv_solver_report __wrap_gv_choice_solve(gv_choice *choice, gv_problem *problem, gv_velocity out_velocity[],
                                        gv_vec3 out_impulse[]) {
  enum { EVERY = 250, EVERY_OF_MANY_SOLVES = 15 };
  const gv_solver_report report = __real_gv_choice_solve(choice, problem, out_velocity, out_impulse);
  if (problem->contact_count == 0 || problem->contact_count > CONTACTS || report.outcome != GV_OUTCOME_SOLVED)
    return report;
  step += ((const gv_newton *)choice->memory[GV_SOLVER_NEWTON])->solves > 2 ? EVERY / EVERY_OF_MANY_SOLVES
                                                                            : 1;
  if (step < EVERY)
    return report;
  step = 0;
  compare(problem, out_impulse);
  return report;
}

static void test_recorded_grasps_move_alike(void) {
  now = (tally){0};
  if (access(expected.scene, R_OK)) {
    SKIP("its scene is not compiled here; make scenes");
    return;
  }
  CHECK(replay(&expected, VARIANT_DEFAULT, false, &measured) == 0, "%s did not run", expected.name);
  tell(expected.name);
  CHECK(now.asked > 20 && now.alike >= now.asked - now.asked / 20, "%s: %d of %d alike", expected.name,
        now.alike, now.asked);
}

// ---- random problems ------------------------------------------------------------------------------

static unsigned long long seed = 3;
static double draw(double lo, double hi) { return check_uniform(&seed, lo, hi); }
static gv_vec3 draw_vector(double size) {
  return gv_v3(draw(-size, size), draw(-size, size), draw(-size, size));
}

// Nine objects and limbs that hold each other from all sides, as in test_newton.
static void draw_body(gv_problem_body *b, bool is_limb) {
  const gv_mat3 R = gv_mat3_from_quat(gv_quat_exp(draw_vector(2)));
  const double least = draw(1e-5, 1e-4);
  const double d[3] = {least, is_limb ? least : draw(1e-5, 1e-4), is_limb ? least : draw(1e-5, 1e-4)};
  *b = (gv_problem_body){
    .mass = draw(0.01, 0.3), .p = draw_vector(0.05), .v = draw_vector(0.05), .w = draw_vector(1)};
  for (int i = 0; i < 27; i++)
    b->inertia.m[i / 9][i / 3 % 3] += R.m[i / 9][i % 3] * d[i % 3] * R.m[i / 3 % 3][i % 3];
}

static double most_mu = 1.2;

static void draw_contact(gv_problem_contact *c) {
  const int a = (int)draw(1, 6);
  int b;
  do
    b = (int)draw(0, 6);
  while (b == a);
  const gv_vec3 n = gv_normalize_or(draw_vector(1), gv_v3(0, 0, 1));
  const gv_vec3 t = gv_any_perpendicular(n);
  *c = (gv_problem_contact){.body_a = a <= 3 ? a : GV_LIMBS + a,
                            .body_b = b <= 3 ? b : GV_LIMBS + b,
                            .point = draw_vector(0.05),
                            .frame = {n, t, gv_cross(n, t)},
                            .target_velocity = draw(-0.1, 0.04),
                            .normal_compliance = 1.0,
                            .tangent_compliance = 1e-4,
                            .friction = GV_FRICTION_COULOMB,
                            .mu = draw(0.1, most_mu)};
}

static void draw_problem(gv_problem *p) {
  memset(p, 0, sizeof *p);
  p->step_s = 1e-3;
  p->budget_s = 1.0;
  p->body_count = GV_LIMBS + 6;
  p->contact_count = (int)draw(1, 10);
  for (int b = 1; b < 6; b++)
    draw_body(&p->body[b <= 3 ? b : GV_LIMBS + b], b <= 3);
  for (int k = 0; k < p->contact_count; k++)
    draw_contact(&p->contact[k]);
}

static gv_problem drawn;
static answer found;

static bool solve_drawn(void) {
  static gv_newton newton;
  draw_problem(&drawn);
  gv_solver_newton.forget(&newton);
  return gv_solver_newton.solve(&newton, &drawn, found.velocity, found.impulse) == GV_OUTCOME_SOLVED;
}

static void test_random_problems_move_alike(void) {
  enum { PROBLEMS = 400 };
  now = (tally){0};
  for (int i = 0; i < PROBLEMS; i++)
    if (solve_drawn())
      compare(&drawn, found.impulse);
  tell("random");
  CHECK(now.asked >= PROBLEMS - PROBLEMS / 100, "%d of %d solved by newton", now.asked, PROBLEMS);
  CHECK(now.alike >= now.asked - now.asked / 20, "%d of %d alike", now.alike, now.asked);
}

// With much friction a body can wedge itself in or slip out: both are solutions, and neither is a mistake.
static void test_several_solutions_are_no_mistake(void) {
  enum { PROBLEMS = 600 };
  now = (tally){0};
  most_mu = 3.0;
  for (int i = 0; i < PROBLEMS; i++)
    if (solve_drawn())
      compare(&drawn, found.impulse);
  most_mu = 1.2;
  tell("much friction");
  CHECK(now.several > 0, "no problem with several solutions among them: nothing was tested");
  CHECK(now.confirmed > 0, "Siconos takes none of ours for a solution");
}

// A fiftieth more of one contact's impulse is not another solution.
static void test_a_mistake_is_told(void) {
  enum { PROBLEMS = 200 };
  int spoiled = 0;
  now = (tally){0};
  for (int i = 0; i < PROBLEMS; i++) {
    if (!solve_drawn() || gv_norm(found.impulse[0]) < 1e-4)
      continue;
    found.impulse[0] = gv_scale(found.impulse[0], 1.02);
    spoiled++;
    compare(&drawn, found.impulse);
  }
  printf("# %d answers of %d with one impulse 2 %% too large are told as wrong\n", now.wrong, spoiled);
  CHECK(spoiled > 10 && now.wrong == spoiled, "%d of %d", now.wrong, spoiled);
}

static int is_trace(const struct dirent *d) { return d->d_name[0] != '.' && !strchr(d->d_name, '.'); }

int main(void) {
  struct dirent **entry;
  const int count = scandir("data/traces", &entry, is_trace, alphasort);
  for (int i = 0; i < count; i++)
    if (!expectation_read(entry[i]->d_name, &expected))
      RUN(test_recorded_grasps_move_alike);
  RUN(test_random_problems_move_alike);
  RUN(test_several_solutions_are_no_mistake);
  RUN(test_a_mistake_is_told);
  return check_done();
}
