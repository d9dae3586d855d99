// SPDX-License-Identifier: BSD-3-Clause
// How far each step of a recorded grasp is from the laws of contact, with one of the engine's solvers: the
// four residuals of test/support/contact_laws.h, the worst contact or body of the step. The linker leads the
// solvers' answers through here. test/bench/residuals.py asks it.
//
//   bench_laws TRACE VARIANT     writes GV_BENCH_LAWS doubles for each step with contacts (bench_drivers.h)
#include <stdio.h>
#include <stdlib.h>

#include "bench/bench_drivers.h"
#include "dynamics/choice.h"
#include "replay/replay.h"
#include "support/contact_laws.h"

static expectation expected;
static measures measured;

gv_solver_report __real_gv_choice_solve(gv_choice *choice, gv_problem *problem, gv_velocity out_velocity[],
                                        gv_vec3 out_impulse[]);
gv_solver_report __wrap_gv_choice_solve(gv_choice *choice, gv_problem *problem, gv_velocity out_velocity[],
                                        gv_vec3 out_impulse[]);
gv_solver_report __wrap_gv_choice_solve(gv_choice *choice, gv_problem *problem, gv_velocity out_velocity[],
                                        gv_vec3 out_impulse[]) {
  const gv_solver_report report = __real_gv_choice_solve(choice, problem, out_velocity, out_impulse);
  if (problem->contact_count == 0 || report.outcome == GV_OUTCOME_NONE)
    return report;
  contact_laws worst = {0};
  contact_laws_judge(problem, out_velocity, out_impulse, &worst);
  const double values[GV_BENCH_LAWS] = {worst.closing_m_s, worst.coulomb_n, worst.dissipation_w,
                                        worst.momentum_n_s};
  fwrite(values, sizeof values, 1, stdout);
  return report;
}

int main(int argc, char **argv) {
  const int v = argc == 3 ? variant_of_name(argv[2]) : -1;
  if (v < 0 || expectation_read(argv[1], &expected)) {
    fprintf(stderr, "usage: bench_laws TRACE VARIANT\n");
    return 2;
  }
  return replay(&expected, (variant)v, false, &measured) ? 2 : 0;
}
