// SPDX-License-Identifier: BSD-3-Clause
// Every compiled scene (make scenes) in the simulated user's hand: grasped, lifted 0.15 m, and
// held without slipping, without clock or descriptor. What the mesh compiler makes is worth what a
// hand can do with it. Coulomb's law is judged in every step, on the way there too: the linker
// leads the solvers' answers through here.
#include <string.h>
#include <unistd.h>

#include "dynamics/choice.h"
#include "support/bones.h"
#include "support/check.h"
#include "support/contact_laws.h"
#include "support/shapes.h"
#include "support/user_run.h"

enum { HELD_FROM = 5500, STEPS = 9000 };  // ms: lifted at 4.6 s, then held
static user_run run;

typedef struct measures {
  double lift_m, slip_m, tilt_rad, depth_m, force_max_n, apart_m;  // the first four while held
} measures;

static contact_laws worst;  // of newton's answers
static long steps, by_others, softened;
static bool joined;  // the limbs of a finger

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
  softened += report.solver == GV_SOLVER_NEWTON && report.outcome != GV_OUTCOME_SOLVED;
  if (report.solver == GV_SOLVER_NEWTON && report.outcome == GV_OUTCOME_SOLVED)
    contact_laws_judge(problem, out_velocity, out_impulse, &worst);
  return report;
}

static void check_laws(const char *scene) {
  const contact_laws *w = &worst;
  printf("  %-12s %ld steps with contacts: outside the cone %ld of %ld, creep %.1e m/s, astray %.2f deg, "
         "closing %.1e m/s; "
         "%ld softened, %ld left to ODE\n",
         scene, steps, w->outside, w->loaded, w->creep_m_s, w->astray_deg, w->closing_m_s, softened,
         by_others);
  CHECK(w->pull_n < 1e-6 && w->closing_m_s < 1e-6, "%s: pulls %g N, closes at %g m/s", scene, w->pull_n,
        w->closing_m_s);
  // Many pieces that lie flat on the table share their friction in many ways: a few
  // steps on the way to the grasp.
  CHECK(by_others <= steps / 500 && softened <= steps / 500, "%s: %ld left to ODE, %ld softened", scene,
        by_others, softened);
  CHECK(w->outside_n < 1e-4, "%s: friction %g N beyond the cone", scene, w->outside_n);
  CHECK(w->creep_m_s < 1e-5, "%s: slips at %g m/s below the bound", scene, w->creep_m_s);
  CHECK(w->astray_deg < 1, "%s: friction is %g degrees off the slip", scene, w->astray_deg);
  CHECK(w->momentum_n_s < (joined ? 1e-9 : 1e-10), "%s: %g N s from nowhere", scene, w->momentum_n_s);
}

static bool start(const shape_grasp *g) {
  char scene[256], script[256];
  snprintf(scene, sizeof scene, "build/scenes/%s.scene", g->scene);
  snprintf(script, sizeof script, "data/scripts/%s.user", g->script);
  const bool good = user_load(&run, scene, script);
  CHECK(good, "%s does not load", g->scene);
  if (!good)
    return false;
  run.settings.engine.finger_joints = joined;
  user_start(&run);
  return true;
}

static void watch(const gv_engine *engine, double start_z, gv_pose held_at, measures *m) {
  gv_pose T_palm_object = gv_pose_mul(gv_pose_inv(gv_engine_limb_pose(engine, GV_LIMB_PALM)),
                                      gv_engine_object_pose(engine, 1));
  int count;
  const gv_contact *c = gv_engine_contacts(engine, &count);
  for (int i = 0; i < count; i++)
    m->depth_m = fmax(m->depth_m, c[i].depth_m);
  m->slip_m = fmax(m->slip_m, gv_norm(gv_sub(T_palm_object.p, held_at.p)));
  m->tilt_rad = fmax(m->tilt_rad,
                     gv_norm(gv_quat_log(gv_quat_mul(T_palm_object.q, gv_quat_conj(held_at.q)))));
  m->lift_m = fmin(m->lift_m, gv_engine_object_pose(engine, 1).p.z - start_z);
}

static const shape_grasp *current;
static void test_grasp(void) {
  const shape_grasp *g = current;
  measures m = {.lift_m = 1e9};
  gv_pose held_at = gv_pose_identity();
  worst = (contact_laws){0};
  steps = by_others = softened = 0;
  if (!start(g))
    return;
  const gv_engine *engine = run.engine;
  const gv_scene *scene = &run.scene;
  double start_z = gv_engine_object_pose(engine, 1).p.z;
  for (int ms = 0; ms < STEPS; ms++) {
    user_step(&run);
    for (int i = 0; i < GV_FINGERS; i++)
      m.force_max_n = fmax(m.force_max_n, run.session.force_n[i]);
    m.apart_m = fmax(m.apart_m, bones_apart(engine));
    if (ms == HELD_FROM)
      held_at = gv_pose_mul(gv_pose_inv(gv_engine_limb_pose(engine, GV_LIMB_PALM)),
                            gv_engine_object_pose(engine, 1));
    if (ms >= HELD_FROM)
      watch(engine, start_z, held_at, &m);
  }
  printf("  %-12s %5d triangles %3d pieces%s: lifted %.0f mm, slip %.3f mm, tilt %.3f deg, depth %.3f mm, "
         "force at most %.1f N, bones apart by %.2f mm\n",
         g->scene, scene->object[1].triangle_count, scene->object[1].piece_count,
         joined ? ", finger_joints" : "", m.lift_m * 1e3, m.slip_m * 1e3, m.tilt_rad * 180 / GV_PI,
         m.depth_m * 1e3, m.force_max_n, m.apart_m * 1e3);
  CHECK(scene->object[1].piece_count >= g->min_pieces, "%s: %d pieces", g->scene,
        scene->object[1].piece_count);
  CHECK(!g->triangles || scene->object[1].triangle_count == g->triangles, "%s: %d triangles", g->scene,
        scene->object[1].triangle_count);
  CHECK(m.lift_m > 0.1, "%s: lifted by %g m", g->scene, m.lift_m);
  CHECK(m.slip_m < 1e-3, "%s: slips %g mm in 3.5 s", g->scene, m.slip_m * 1e3);
  CHECK(m.depth_m < 1e-3, "%s: sinks in by %g mm", g->scene, m.depth_m * 1e3);
  CHECK(m.force_max_n > 0.2, "%s: the person feels %g N", g->scene, m.force_max_n);
  CHECK(m.apart_m < 1e-3 || !joined, "%s: bones apart by %g mm", g->scene, m.apart_m * 1e3);
  check_laws(g->scene);
  user_finish(&run);
}

static void test_grasp_with_finger_joints(void) {
  joined = true;
  test_grasp();
  joined = false;
}

int main(void) {
  int ran = 0;
  for (int i = 0; i < SHAPE_GRASPS; i++) {
    char path[256];
    snprintf(path, sizeof path, "build/scenes/%s.scene", shape_grasps[i].scene);
    if (access(path, R_OK))
      continue;
    current = &shape_grasps[i];
    RUN(test_grasp);
    RUN(test_grasp_with_finger_joints);
    ran++;
  }
  if (!ran)
    printf("ok - test_grasp # SKIP no compiled scenes; make test-scenes makes them and runs this\n");
  return check_done();
}
