// SPDX-License-Identifier: BSD-3-Clause
// The order in which solvers are asked, and the share of the loop's period that each may take. Together it is
// at most 0.65: a quarter is collision detection's, the rest the rest's. Real-time thread.
//
// But for one: dantzig reckons with bodies jammed into each other, where its cost is six times that of a
// grasp. Asked for by name it may take four periods in that reckoning, so that grasps of 40 contacts fit, and
// a jam that is met all the same makes steps late by so much at most. `auto` keeps the promise.
#include "dynamics/choice.h"

#include <assert.h>
#include <string.h>

enum { TURNS = 3 };

typedef struct turn {
  gv_solver solver;  // GV_SOLVER_AUTO ends the list
  double share;      // of the period
} turn;

static const turn order[GV_SOLVERS][TURNS] = {
  [GV_SOLVER_AUTO] = {{GV_SOLVER_NEWTON, 0.35}, {GV_SOLVER_DANTZIG, 0.15}, {GV_SOLVER_QUICKSTEP, 0.15}},
  [GV_SOLVER_NEWTON] = {{GV_SOLVER_NEWTON, 0.4}, {GV_SOLVER_QUICKSTEP, 0.25}},
  [GV_SOLVER_DANTZIG] = {{GV_SOLVER_DANTZIG, 4.0}, {GV_SOLVER_QUICKSTEP, 0.25}},
  [GV_SOLVER_QUICKSTEP] = {{GV_SOLVER_QUICKSTEP, 0.65}},
};

static const gv_contact_solver *const solvers[GV_SOLVERS] = {
  [GV_SOLVER_NEWTON] = &gv_solver_newton,
  [GV_SOLVER_DANTZIG] = &gv_solver_dantzig,
  [GV_SOLVER_QUICKSTEP] = &gv_solver_quickstep,
};

const char *gv_solver_name(gv_solver solver) {
  assert(solver >= GV_SOLVER_AUTO && solver < GV_SOLVERS);
  return solver == GV_SOLVER_AUTO ? "auto" : solvers[solver]->name;
}

bool gv_choice_open(gv_choice *choice, gv_arena *arena, const gv_config *cfg) {
  *choice = (gv_choice){
    .solver = cfg->solver, .period_s = cfg->period_s > 0.0 ? cfg->period_s : cfg->step_s, .effort = 1.0};
  bool opened = true;
  for (int i = GV_SOLVER_NEWTON; i < GV_SOLVERS; i++) {
    choice->memory[i] = gv_arena_alloc(arena, solvers[i]->name, solvers[i]->memory_size);
    opened = opened && choice->memory[i];
  }
  choice->ode = gv_ode_open(arena);
  if (!choice->ode || !opened)
    return false;
  for (int i = GV_SOLVER_NEWTON; i < GV_SOLVERS; i++)
    if (solvers[i]->init)
      solvers[i]->init(choice->memory[i], choice->ode);
  return true;
}

void gv_choice_close(gv_choice *choice) { gv_ode_close(choice->ode); }

void gv_choice_forget(gv_choice *choice) {
  for (int i = GV_SOLVER_NEWTON; i < GV_SOLVERS; i++)
    solvers[i]->forget(choice->memory[i]);
}

// The first in turn hears what the one after it found.
static void tell_first(gv_choice *choice, const gv_problem *problem, const gv_velocity velocity[],
                       const gv_vec3 impulse[]) {
  const gv_solver first = order[choice->solver][0].solver;
  if (solvers[first]->learn)
    solvers[first]->learn(choice->memory[first], problem, velocity, impulse);
}

gv_solver_report gv_choice_solve(gv_choice *choice, gv_problem *problem, gv_velocity out_velocity[],
                                 gv_vec3 out_impulse[]) {
  const bool is_free = problem->contact_count + problem->row_count == 0;
  if (is_free)
    gv_choice_forget(choice);
  for (int i = 0; i < TURNS && !is_free; i++) {
    const turn *t = &order[choice->solver][i];
    if (t->solver == GV_SOLVER_AUTO)
      break;
    problem->budget_s = t->share * choice->effort * choice->period_s;
    void *memory = choice->memory[t->solver];
    const gv_outcome outcome = solvers[t->solver]->solve(memory, problem, out_velocity, out_impulse);
    if (outcome == GV_OUTCOME_NONE)
      continue;
    if (i > 0)
      tell_first(choice, problem, out_velocity, out_impulse);
    return (gv_solver_report){t->solver, outcome};
  }
  return (gv_solver_report){GV_SOLVER_AUTO, GV_OUTCOME_NONE};
}

// A ring of limbs, each pressed against the next in many places.
static void state_ring(gv_problem *problem, int contacts) {
  assert(contacts > 0 && contacts <= GV_MAX_CONTACTS);
  memset(problem, 0, sizeof *problem);
  problem->step_s = 0.001;
  problem->budget_s = 1e3;
  problem->body_count = GV_LIMBS;
  problem->contact_count = contacts;
  const gv_mat3 inertia = {{{1e-4, 0, 0}, {0, 1e-4, 0}, {0, 0, 1e-4}}};
  for (int i = 0; i < GV_LIMBS; i++)
    problem->body[i] = (gv_problem_body){.mass = 0.1, .inertia = inertia};
  for (int i = 0; i < contacts; i++) {
    problem->contact[i] = (gv_problem_contact){.body_a = i % GV_LIMBS,
                                               .body_b = (i + 1) % GV_LIMBS,
                                               .point = {0.01 * i, 0.02 * (i % 7), 0},
                                               .frame = {{0, 0, 1}, {1, 0, 0}, {0, 1, 0}},
                                               .normal_compliance = 1.0,
                                               .tangent_compliance = 1e-6,
                                               .mu = 1.0};
  }
}

void gv_choice_warm_up(gv_choice *choice, gv_problem *problem) {
  enum { DANTZIG_MOST = 128 };
  gv_velocity velocity[GV_BODIES];
  gv_vec3 impulse[GV_MAX_CONTACTS];
  for (int i = GV_SOLVER_NEWTON; i < GV_SOLVERS; i++) {
    state_ring(problem, i == GV_SOLVER_DANTZIG ? DANTZIG_MOST : GV_MAX_CONTACTS);
    solvers[i]->solve(choice->memory[i], problem, velocity, impulse);
  }
  gv_choice_forget(choice);
}
