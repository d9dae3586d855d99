// SPDX-License-Identifier: BSD-3-Clause
// Coulomb's law in every step of every recorded grasp, by every solver: no pull, friction in the round
// cone of the same step's normal force, against the slip where it slides and without slip where it
// holds, momentum kept. Newton's is exact, over both narrow phases, and nothing weaker than that in any
// of them (a softened step, friction bounded by the forces of the moment before, a step left to another
// solver). ODE's solvers have their exceptions in a table: dantzig keeps the cone but in the steps that
// it counts as lagged, and its friction may point away from the slip; quickstep has a pyramid over an
// earlier iterate's normal forces, and stops before it is exact. Pull and momentum are for all. The
// linker leads the solvers' answers through here.
#include <dirent.h>
#include <string.h>
#include <unistd.h>

#include "dynamics/choice.h"
#include "replay/replay.h"
#include "support/check.h"
#include "support/contact_laws.h"

// What a variant's answers may miss the law by: in steps that it calls solved, and
// how often there are others.
typedef struct exceptions {
  variant of;
  gv_solver solver;      // that does the steps
  double outside_share;  // of the loaded contacts, beyond the cone
  double creep_m_s, astray_deg, dissipation_w, closing_m_s;
  double weaker_share;  // of the steps: not solved as asked (newton_softened, dantzig_lagged)
  double others_share;  // of the steps, left to another solver
} exceptions;

static const exceptions allowed[] = {
  {VARIANT_DEFAULT, GV_SOLVER_NEWTON, 0.0, 1e-5, 1.0, 1e-5, 1e-6, 0.0, 0.0},
  {VARIANT_LIBCCD, GV_SOLVER_NEWTON, 0.0, 1e-5, 1.0, 1e-5, 1e-6, 0.0, 0.0},
  {VARIANT_FINGER_JOINTS, GV_SOLVER_NEWTON, 0.0, 1e-5, 1.0, 1e-5, 1e-6, 0.0, 0.0},
  {VARIANT_DANTZIG, GV_SOLVER_DANTZIG, 0.0, 1e-5, 45.0, 1e-2, 1e-6, 0.35, 1e-3},
  {VARIANT_QUICKSTEP, GV_SOLVER_QUICKSTEP, 0.4, 0.2, 180.0, 10.0, 0.02, 0.0, 0.0},
};
enum { ALLOWED = sizeof allowed / sizeof allowed[0] };

static expectation expected;
static measures measured;
static const exceptions *may;
static contact_laws worst, unsolved;  // of the steps that were solved as asked, and of the others
static long steps, by_others, weaker;

gv_solver_report __real_gv_choice_solve(gv_choice *choice, gv_problem *problem, gv_velocity out_velocity[],
                                        gv_vec3 out_impulse[]);
gv_solver_report __wrap_gv_choice_solve(gv_choice *choice, gv_problem *problem, gv_velocity out_velocity[],
                                        gv_vec3 out_impulse[]);
gv_solver_report __wrap_gv_choice_solve(gv_choice *choice, gv_problem *problem, gv_velocity out_velocity[],
                                        gv_vec3 out_impulse[]) {
  const gv_solver_report report = __real_gv_choice_solve(choice, problem, out_velocity, out_impulse);
  if (problem->contact_count == 0)
    return report;
  steps++;
  by_others += report.solver != may->solver;
  weaker += report.outcome != GV_OUTCOME_SOLVED;
  const bool solved = report.outcome == GV_OUTCOME_SOLVED && report.solver == may->solver;
  contact_laws_judge(problem, out_velocity, out_impulse, solved ? &worst : &unsolved);
  return report;
}

static void print_figures(const char *name) {
  const contact_laws *w = &worst;
  printf("# %-15s %-9s %ld steps: pull %.1e N, closing %.1e m/s, outside %.3f %%, creep %.1e m/s, astray "
         "%.2f deg, "
         "momentum %.1e N s; weaker %.2f %% (outside %.3f %%), by others %.3f %%\n",
         name, variant_name[may->of], steps, w->pull_n, w->closing_m_s,
         100.0 * (double)w->outside / (double)w->loaded, w->creep_m_s, w->astray_deg, w->momentum_n_s,
         100.0 * (double)weaker / (double)steps,
         100.0 * (double)unsolved.outside / fmax(1.0, (double)unsolved.loaded),
         100.0 * (double)by_others / (double)steps);
}

// The limits of an earlier moment, and what is weaker than asked, are counted by
// name, where everybody sees them.
static void check_counters(const gv_counters *c) {
  const uint64_t counted = may->solver == GV_SOLVER_NEWTON ? c->newton_softened : c->dantzig_lagged;
  CHECK((long)counted == weaker, "%" PRIu64 " counted, %ld seen", counted, weaker);
  if (may->solver != GV_SOLVER_NEWTON)
    return;
  CHECK(c->dantzig_steps == 0 && c->quickstep_steps == 0 && c->unsolved_steps == 0, "steps left to ODE");
}

static void test_coulombs_law_in_every_step(void) {
  const char *name = expected.name;
  const char *solver = variant_name[may->of];
  const contact_laws *w = &worst;
  steps = by_others = weaker = 0;
  worst = unsolved = (contact_laws){0};
  if (access(expected.scene, R_OK)) {
    SKIP("its scene is not compiled here; make scenes");
    return;
  }
  if (replay(&expected, may->of, false, &measured)) {
    CHECK(0, "%s did not run", name);
    return;
  }
  print_figures(name);
  CHECK(steps > 5000, "%ld steps with contacts", steps);
  CHECK((double)by_others <= may->others_share * (double)steps, "%s %s: %ld by others", name, solver,
        by_others);
  CHECK((double)weaker <= may->weaker_share * (double)steps, "%s %s: %ld weaker", name, solver, weaker);
  check_counters(&measured.counters);
  CHECK(fmax(w->pull_n, unsolved.pull_n) < 1e-6, "%s %s: a contact pulls with %g N", name, solver, w->pull_n);
  CHECK(w->closing_m_s < may->closing_m_s, "%s %s: closes, or pushes and parts, at %g m/s", name, solver,
        w->closing_m_s);
  CHECK((double)w->outside <= may->outside_share * (double)w->loaded, "%s %s: %ld of %ld beyond the cone",
        name, solver, w->outside, w->loaded);
  CHECK(may->outside_share > 0.0 || w->outside_n < 1e-4, "%s %s: %g N beyond the cone", name, solver,
        w->outside_n);
  CHECK(w->creep_m_s < may->creep_m_s, "%s %s: slips at %g m/s below the bound", name, solver, w->creep_m_s);
  CHECK(w->dissipation_w < may->dissipation_w, "%s %s: friction takes %g W less than the most it could", name,
        solver, w->dissipation_w);
  CHECK(w->astray_deg <= may->astray_deg, "%s %s: %g degrees off the slip", name, solver, w->astray_deg);
  // Impulses of joints' rows are read off the velocities: more rounding.
  const double rounding = may->of == VARIANT_FINGER_JOINTS ? 1e-9 : 1e-10;
  CHECK(fmax(w->momentum_n_s, unsolved.momentum_n_s) < rounding, "%s %s: %g N s from nowhere", name, solver,
        w->momentum_n_s);
}

static int is_trace(const struct dirent *d) { return d->d_name[0] != '.' && !strchr(d->d_name, '.'); }

int main(void) {
  static struct dirent **entry;  // kept until the end
  const int count = scandir("data/traces", &entry, is_trace, alphasort);
  for (int i = 0; i < count; i++) {
    if (expectation_read(entry[i]->d_name, &expected))
      continue;
    for (may = allowed; may < allowed + ALLOWED; may++)
      RUN(test_coulombs_law_in_every_step);
  }
  if (count < 1) {
    printf("not ok - no trace in data/traces\n");
    return 1;
  }
  return check_done();
}
