// SPDX-License-Identifier: BSD-3-Clause
// Coulomb's law in every step of every recorded grasp, by the default solver: no pull, friction in the round
// cone of the same step's normal force, against the slip where it slides and without slip where it holds,
// momentum kept; and nothing weaker than that in any of them (a softened step, one left to another solver).
// The linker leads the solvers' answers through here.
#include <dirent.h>
#include <string.h>
#include <unistd.h>

#include "dynamics/choice.h"
#include "replay/replay.h"
#include "support/check.h"
#include "support/contact_laws.h"

static expectation expected;
static measures measured;
static contact_laws worst;
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
  by_others += report.solver != GV_SOLVER_NEWTON;
  weaker += report.outcome != GV_OUTCOME_SOLVED;
  contact_laws_judge(problem, out_velocity, out_impulse, &worst);
  return report;
}

static void test_coulombs_law_in_every_step(void) {
  steps = by_others = weaker = 0;
  worst = (contact_laws){0};
  if (access(expected.scene, R_OK)) {
    SKIP("its scene is not compiled here; make scenes");
    return;
  }
  if (replay(&expected, VARIANT_DEFAULT, false, &measured)) {
    CHECK(0, "%s did not run", expected.name);
    return;
  }
  printf("# %-15s %ld steps: pull %.1e N, closing %.1e m/s, outside the cone %.1e N, creep %.1e m/s, astray "
         "%.2f deg, momentum %.1e N s\n",
         expected.name, steps, worst.pull_n, worst.closing_m_s, fmax(0, worst.outside_n), worst.creep_m_s,
         worst.astray_deg, worst.momentum_n_s);
  CHECK(steps > 5000, "%ld steps with contacts", steps);
  CHECK(by_others == 0 && weaker == 0, "%s: %ld steps by other solvers, %ld weaker than asked", expected.name,
        by_others, weaker);
  CHECK(measured.counters.newton_softened == 0, "counted %" PRIu64, measured.counters.newton_softened);
  CHECK(worst.pull_n < 1e-6, "%s: a contact pulls with %g N", expected.name, worst.pull_n);
  CHECK(worst.closing_m_s < 1e-6, "%s: closes, or pushes and separates, at %g m/s", expected.name,
        worst.closing_m_s);
  CHECK(worst.outside_n < 1e-4, "%s: friction %g N outside the cone", expected.name, worst.outside_n);
  CHECK(worst.creep_m_s < 1e-5, "%s: slips at %g m/s below the bound", expected.name, worst.creep_m_s);
  CHECK(worst.dissipation_w < 1e-5, "%s: friction takes %g W less than the most it could", expected.name,
        worst.dissipation_w);
  CHECK(worst.astray_deg < 1, "%s: friction is %g degrees off the slip", expected.name, worst.astray_deg);
  CHECK(worst.momentum_n_s < 1e-10, "%s: %g N s from nowhere", expected.name, worst.momentum_n_s);
}

static int is_trace(const struct dirent *d) { return d->d_name[0] != '.' && !strchr(d->d_name, '.'); }

int main(void) {
  static struct dirent **entry;  // kept until the end
  const int count = scandir("data/traces", &entry, is_trace, alphasort);
  for (int i = 0; i < count; i++) {
    if (expectation_read(entry[i]->d_name, &expected))
      continue;
    RUN(test_coulombs_law_in_every_step);
  }
  if (count < 1) {
    printf("not ok - no trace in data/traces\n");
    return 1;
  }
  return check_done();
}
