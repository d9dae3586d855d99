// SPDX-License-Identifier: BSD-3-Clause
// The contact solvers behind their table: each is a function of the problem, whatever it was asked before and
// however that ended; dantzig's friction is Coulomb's; none calls the heap, in a thousand hopeless piles with
// fixed friction limits, where ODE gives up now and then.
#include <malloc.h>
#include <string.h>

#include "daemon/load/scene_load.h"
#include "daemon/loop/heap.h"
#include "support/check.h"
#include "support/lab.h"
#include "support/solvers.h"

static unsigned long long seed = 11;
static double draw(double lo, double hi) { return check_uniform(&seed, lo, hi); }
static gv_vec3 draw_vector(double size) {
  return gv_v3(draw(-size, size), draw(-size, size), draw(-size, size));
}

static const gv_contact_solver *const solvers[] = {&gv_solver_newton, &gv_solver_dantzig,
                                                   &gv_solver_quickstep};
enum { SOLVERS = 3 };

typedef struct answer {
  gv_outcome outcome;
  gv_velocity velocity[GV_BODIES];
  gv_vec3 impulse[GV_MAX_CONTACTS];
} answer;

static answer ask(gv_choice *choice, const gv_contact_solver *solver, const gv_problem *problem) {
  answer a;
  memset(&a, 0, sizeof a);
  const int at = solver == &gv_solver_newton    ? GV_SOLVER_NEWTON
                 : solver == &gv_solver_dantzig ? GV_SOLVER_DANTZIG
                                                : GV_SOLVER_QUICKSTEP;
  void *of_solver = choice->memory[at];
  solver->forget(of_solver);
  a.outcome = solver->solve(of_solver, problem, a.velocity, a.impulse);
  return a;
}

// ---- random problems ------------------------------------------------------------------------------

static gv_mat3 ball(double inertia) { return (gv_mat3){{{inertia, 0, 0}, {0, inertia, 0}, {0, 0, inertia}}}; }

// Limbs around an object that lies on what does not move, and a second one beside it.
static void draw_problem(gv_problem *q, gv_friction friction) {
  memset(q, 0, sizeof *q);
  q->step_s = 0.001;
  q->budget_s = 1.0;
  q->body_count = GV_LIMBS + 3;
  for (int i = 0; i < q->body_count; i++) {
    gv_problem_body *b = &q->body[i];
    b->p = draw_vector(0.03);
    if (i == GV_LIMBS + 2)
      continue;
    b->mass = draw(0.05, 0.3);
    b->inertia = ball(draw(2e-5, 1e-4));
    b->v = draw_vector(0.05);
    b->w = draw_vector(0.5);
  }
  q->contact_count = (int)draw(1, 14);
  for (int i = 0; i < q->contact_count; i++) {
    gv_problem_contact *c = &q->contact[i];
    c->body_a = i % 3 == 2 ? GV_LIMBS : (int)draw(0, 6);
    c->body_b = i % 3 == 2 ? GV_LIMBS + 2 : GV_LIMBS + (int)draw(0, 2);
    c->point = draw_vector(0.03);
    c->frame[0] = gv_normalize_or(draw_vector(1), gv_v3(0, 0, 1));
    c->frame[1] = gv_any_perpendicular(c->frame[0]);
    c->frame[2] = gv_cross(c->frame[0], c->frame[1]);
    c->target_velocity = draw(-0.1, 0.04);
    c->normal_compliance = 1.0;
    c->tangent_compliance = 1e-6;
    c->friction = friction;
    if (friction == GV_FRICTION_FIXED_LIMIT)
      c->friction_limit = draw(1e-4, 1e-2);
    else
      c->mu = draw(0.1, 0.6);
  }
}

// The same bits, whatever was asked in between.
static void test_a_solver_is_a_function(void) {
  gv_choice choice = open_solvers();
  static gv_problem q, other;
  static answer first[SOLVERS], again;
  for (int trial = 0; trial < 200; trial++) {
    draw_problem(&q, GV_FRICTION_COULOMB);
    draw_problem(&other, trial % 2 ? GV_FRICTION_COULOMB : GV_FRICTION_FIXED_LIMIT);
    for (int i = 0; i < SOLVERS; i++)
      first[i] = ask(&choice, solvers[i], &q);
    for (int i = 0; i < SOLVERS; i++)
      ask(&choice, solvers[i], &other);
    for (int i = 0; i < SOLVERS; i++) {
      again = ask(&choice, solvers[i], &q);
      CHECK(memcmp(&again, &first[i], sizeof again) == 0, "%s: trial %d", solvers[i]->name, trial);
    }
  }
  gv_choice_close(&choice);
}

// What an answer does to a body follows from its impulses alone.
static void check_momentum(const gv_problem *q, const answer *a, const char *name) {
  for (int b = 0; b < q->body_count; b++) {
    gv_vec3 linear = gv_v3(0, 0, 0);
    gv_vec3 angular = gv_v3(0, 0, 0);
    bool touched = false;
    for (int i = 0; i < q->contact_count; i++) {
      const gv_problem_contact *c = &q->contact[i];
      if (c->body_a != b && c->body_b != b)
        continue;
      const gv_vec3 x = gv_scale(a->impulse[i], c->body_a == b ? 1 : -1);
      touched = true;
      linear = gv_add(linear, x);
      angular = gv_add(angular, gv_cross(gv_sub(c->point, q->body[b].p), x));
    }
    if (!touched || q->body[b].mass <= 0)
      continue;
    const gv_vec3 dv = gv_sub(a->velocity[b].v, q->body[b].v);
    const gv_vec3 dw = gv_sub(a->velocity[b].w, q->body[b].w);
    const double off = gv_norm(gv_sub(gv_scale(dv, q->body[b].mass), linear));
    const double turned_off = gv_norm(gv_sub(gv_mat3_mul(&q->body[b].inertia, dw), angular));
    CHECK(off < 1e-9 && turned_off < 1e-10, "%s: body %d: %g N s, %g N m s", name, b, off, turned_off);
  }
}

static double excess_friction(const gv_problem_contact *c, gv_vec3 x) {
  const double normal = fmax(0, gv_dot(x, c->frame[0]));
  const double bound = c->friction == GV_FRICTION_FIXED_LIMIT ? c->friction_limit : c->mu * normal;
  const double t1 = fabs(gv_dot(x, c->frame[1]));
  const double t2 = fabs(gv_dot(x, c->frame[2]));
  return fmax(t1, t2) - bound;
}

// Beyond Coulomb's cone, N s.
static double excess_of_cone(const gv_problem_contact *c, gv_vec3 x) {
  const double normal = gv_dot(x, c->frame[0]);
  return gv_norm(gv_mad(x, -normal, c->frame[0])) - c->mu * fmax(0, normal);
}

// Dantzig's and Newton's motions agree, for both mean the same problem: Coulomb's law with the round cone, of
// which ODE knows nothing. Momentum is kept. With little friction, so that there is one solution.
static void test_dantzig_means_the_same_problem(void) {
  gv_choice choice = open_solvers();
  static gv_problem q;
  static answer newton, dantzig;
  int compared = 0;
  int differ = 0;
  int solved = 0;
  for (int trial = 0; trial < 2000; trial++) {
    draw_problem(&q, GV_FRICTION_COULOMB);
    for (int i = 0; i < q.contact_count; i++)
      q.contact[i].mu *= 0.5;
    newton = ask(&choice, &gv_solver_newton, &q);
    dantzig = ask(&choice, &gv_solver_dantzig, &q);
    if (dantzig.outcome != GV_OUTCOME_NONE)
      check_momentum(&q, &dantzig, "dantzig");
    if (newton.outcome != GV_OUTCOME_NONE)
      check_momentum(&q, &newton, "newton");
    if (dantzig.outcome != GV_OUTCOME_SOLVED)
      continue;
    solved++;
    for (int i = 0; i < q.contact_count; i++) {
      const double normal = gv_dot(dantzig.impulse[i], q.contact[i].frame[0]);
      const double excess = excess_of_cone(&q.contact[i], dantzig.impulse[i]);
      CHECK(normal > -1e-9 && excess < 1e-7 + 1e-3 * normal, "trial %d: %g N s of friction too much on %g",
            trial, excess, normal);
    }
    if (newton.outcome != GV_OUTCOME_SOLVED)
      continue;
    double apart = 0;
    for (int b = 0; b < q.body_count; b++)
      apart = fmax(apart, gv_norm(gv_sub(newton.velocity[b].v, dantzig.velocity[b].v)));
    compared++;
    differ += apart > 1e-3;
  }
  printf("  %d of 2000 solved by dantzig, %d compared with newton, %d differ by more than 1 mm/s\n", solved,
         compared, differ);
  CHECK(compared > 300 && differ == 0, "%d compared, %d differ", compared, differ);
  gv_choice_close(&choice);
}

// Fixed limits are kept as they are.
static void test_fixed_limits(void) {
  gv_choice choice = open_solvers();
  static gv_problem q;
  static answer a;
  for (int trial = 0; trial < 500; trial++) {
    draw_problem(&q, GV_FRICTION_FIXED_LIMIT);
    for (int i = 0; i < SOLVERS; i++) {
      a = ask(&choice, solvers[i], &q);
      if (a.outcome == GV_OUTCOME_NONE)
        continue;
      check_momentum(&q, &a, solvers[i]->name);
      for (int k = 0; k < q.contact_count; k++)
        CHECK(excess_friction(&q.contact[k], a.impulse[k]) < 1e-9, "%s: trial %d contact %d",
              solvers[i]->name, trial, k);
    }
  }
  gv_choice_close(&choice);
}

// The budget is a share of the loop's period, never of the integration step.
static void test_budget_is_of_the_period(void) {
  static gv_problem q;
  static answer a;
  for (int fits = 0; fits < 2; fits++) {
    gv_choice choice = open_solvers();
    draw_problem(&q, GV_FRICTION_COULOMB);
    q.step_s = fits ? 1e-5 : 0.02;
    choice.period_s = fits ? 0.001 : 1e-6;
    const gv_solver_report report = gv_choice_solve(&choice, &q, a.velocity, a.impulse);
    CHECK(report.solver == (fits ? GV_SOLVER_NEWTON : GV_SOLVER_QUICKSTEP), "%s",
          gv_solver_name(report.solver));
    CHECK(q.budget_s < choice.period_s, "%g s", q.budget_s);
    gv_choice_close(&choice);
  }
}

// Where a solver does not fit into its budget it says so at once.
static void test_out_of_budget(void) {
  gv_choice choice = open_solvers();
  static gv_problem q;
  draw_problem(&q, GV_FRICTION_COULOMB);
  q.budget_s = 1e-7;
  CHECK(ask(&choice, &gv_solver_newton, &q).outcome == GV_OUTCOME_NONE, "newton took its time");
  CHECK(ask(&choice, &gv_solver_dantzig, &q).outcome == GV_OUTCOME_NONE, "dantzig took its time");
  CHECK(ask(&choice, &gv_solver_quickstep, &q).outcome == GV_OUTCOME_SOLVED,
        "quickstep is the last and always answers");
  gv_choice_close(&choice);
}

// ---- piles in which ODE gives up ------------------------------------------------------------------

enum { BOXES = 7 };

// Boxes inside each other, thin and long, heavy on light, with friction that does not depend on the load.
static void draw_pile(lab *l) {
  static const double mass_kg[] = {1e-4, 0.2, 1e3};
  static const double edge_m[] = {0.001, 0.06, 2.0};
  lab_start(l);
  for (int i = 0; i < BOXES; i++) {
    const gv_vec3 size = gv_v3(edge_m[(int)draw(0, 3)], edge_m[(int)draw(0, 3)], edge_m[(int)draw(0, 3)]);
    const gv_vec3 at = gv_v3(draw(-0.1, 0.1), draw(-0.1, 0.1), draw(0, 0.2));
    const int box = lab_box(l, size, at, mass_kg[(int)draw(0, 3)], 200.0);
    l->object[box].friction = GV_FRICTION_FIXED_LIMIT;
    l->object[box].T_world_body.q = gv_quat_exp(gv_v3(draw(0, 3), draw(0, 3), 1));
  }
}

static void open_pile(lab *l, int pile) {
  draw_pile(l);
  l->cfg.solver = pile % 2 ? GV_SOLVER_DANTZIG : GV_SOLVER_AUTO;
  l->cfg.period_s = 0.02;  // Dantzig's solver always fits
  lab_run(l);
}

static void test_no_heap_call_in_a_thousand_piles(void) {
  enum { PILES = 1000, STEPS = 12 };
  unsigned long long errors = 0;
  unsigned long long dantzig = 0;
  unsigned long long quickstep = 0;
  const uint64_t before = gv_heap_calls();
  for (int pile = 0; pile < PILES; pile++) {
    lab l;
    open_pile(&l, pile);
    gv_heap_watch(true);
    lab_steps(&l, STEPS, NULL);
    gv_heap_watch(false);
    const gv_counters *c = gv_engine_counters(l.engine);
    errors += c->solver_errors;
    dantzig += c->dantzig_steps;
    quickstep += c->quickstep_steps;
    for (int i = 0; i < BOXES; i++) {
      const gv_pose T = gv_engine_object_pose(l.engine, i);
      CHECK(gv_pose_finite(T), "pile %d, box %d", pile, i);
    }
    gv_engine_close(l.engine);
  }
  printf("  %d piles: %llu steps by dantzig, %llu by quickstep, %llu given up\n", PILES, dantzig, quickstep,
         errors);
  CHECK(gv_heap_calls() == before, "%llu heap calls", (unsigned long long)(gv_heap_calls() - before));
  CHECK(errors > 20 && dantzig > 5000, "these piles are too easy: nothing was tested");
}

// A step that ODE gave up leaves nothing behind: started anew, the same pile falls the same way, bit by bit.
// And when the engine is closed the heap is as it was.
static void test_a_step_given_up_leaves_no_trace(void) {
  enum { PILES = 100, STEPS = 12 };
  size_t heap = 0;
  int compared = 0;
  for (int pile = 0; pile < PILES; pile++) {
    gv_pose T[2][BOXES];
    lab l;
    open_pile(&l, pile);
    for (int life = 0; life < 2; life++) {
      lab_steps(&l, STEPS, NULL);
      for (int i = 0; i < BOXES; i++)
        T[life][i] = gv_engine_object_pose(l.engine, i);
      if (life == 0)
        compared += gv_engine_counters(l.engine)->solver_errors > 0;
      gv_engine_reset(l.engine);
    }
    gv_engine_close(l.engine);
    CHECK(memcmp(T[0], T[1], sizeof T[0]) == 0, "pile %d falls another way", pile);
    const size_t used = mallinfo2().uordblks;
    if (pile == 0)
      heap = used;
    CHECK(used == heap, "pile %d: %zu bytes of the heap are in use, %zu before", pile, used, heap);
  }
  CHECK(compared > 20, "%d piles with steps given up", compared);
}

// Bodies from a tenth of a gram to a ton, thin and long, jammed into each other, with friction that does not
// depend on the load: Dantzig's solver meets a pivot of zero in some.
static void draw_jam(gv_problem *q) {
  static const double mass_kg[] = {1e-4, 0.2, 1e3};
  static const double radius2_m2[] = {1e-7, 1e-3, 0.3};
  draw_problem(q, GV_FRICTION_FIXED_LIMIT);
  for (int b = GV_LIMBS; b < GV_LIMBS + BOXES; b++) {
    const double mass = mass_kg[(int)draw(0, 3)];
    gv_problem_body *body = &q->body[b];
    *body = (gv_problem_body){.mass = mass, .p = draw_vector(0.1), .v = draw_vector(0.05)};
    for (int k = 0; k < 3; k++)
      body->inertia.m[k][k] = mass * radius2_m2[(int)draw(0, 3)];
  }
  q->body_count = GV_LIMBS + BOXES;
  q->contact_count = (int)draw(10, 30);
  for (int i = 0; i < q->contact_count; i++) {
    gv_problem_contact *c = &q->contact[i];
    *c = q->contact[0];
    c->body_a = GV_LIMBS + (int)draw(0, BOXES);
    do
      c->body_b = GV_LIMBS + (int)draw(0, BOXES);
    while (c->body_b == c->body_a);
    c->point = draw_vector(0.2);
    c->frame[0] = gv_normalize_or(draw_vector(1), gv_v3(0, 0, 1));
    c->frame[1] = gv_any_perpendicular(c->frame[0]);
    c->frame[2] = gv_cross(c->frame[0], c->frame[1]);
    c->target_velocity = draw(-0.1, 0.25);
    c->friction_limit = 0.2;
  }
}

// One ODE that gave up, again and again, answers a plain problem as a new one does.
static void test_gave_up_and_answers_as_before(void) {
  enum { JAMS = 1500 };
  gv_choice choice = open_solvers();
  static gv_problem q, jam;
  static answer before[SOLVERS], again;
  do
    draw_problem(&q, GV_FRICTION_COULOMB);
  while (q.contact_count < 8);
  for (int i = 1; i < SOLVERS; i++)
    before[i] = ask(&choice, solvers[i], &q);
  int given_up = 0;
  for (int trial = 0; trial < JAMS; trial++) {
    const unsigned failures = gv_ode_failures(choice.ode);
    draw_jam(&jam);
    ask(&choice, &gv_solver_dantzig, &jam);
    if (gv_ode_failures(choice.ode) == failures)
      continue;
    given_up++;
    for (int i = 1; i < SOLVERS; i++) {
      again = ask(&choice, solvers[i], &q);
      CHECK(memcmp(&again, &before[i], sizeof again) == 0, "%s differs after jam %d", solvers[i]->name,
            trial);
    }
  }
  printf("  %d of %d jams given up\n", given_up, JAMS);
  CHECK(given_up > 100, "these jams are too easy: nothing was tested");
  gv_choice_close(&choice);
}

int main(void) {
  RUN(test_gave_up_and_answers_as_before);
  RUN(test_a_solver_is_a_function);
  RUN(test_dantzig_means_the_same_problem);
  RUN(test_fixed_limits);
  RUN(test_out_of_budget);
  RUN(test_budget_is_of_the_period);
  RUN(test_no_heap_call_in_a_thousand_piles);
  RUN(test_a_step_given_up_leaves_no_trace);
  return check_done();
}
