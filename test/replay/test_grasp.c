// SPDX-License-Identifier: BSD-3-Clause
// Every compiled scene (make scenes) in the simulated user's hand: grasped, lifted 0.15 m, and
// held without slipping, without clock or descriptor. What the mesh compiler makes is worth what a
// hand can do with it. Coulomb's law is judged in every step, on the way there too: the linker
// leads the solvers' answers through here.
#include <string.h>
#include <unistd.h>

#include "daemon/load/config_load.h"
#include "daemon/load/scene_load.h"
#include "daemon/loop/session.h"
#include "dynamics/choice.h"
#include "support/bones.h"
#include "support/check.h"
#include "support/contact_laws.h"
#include "support/shapes.h"
#include "gloved/sim.h"

enum { MEMORY = 48 << 20, HELD_FROM = 5500, STEPS = 9000 };  // ms: lifted at 4.6 s, then held
static _Alignas(64) unsigned char scene_memory[MEMORY], engine_memory[MEMORY];
static gv_sim sim;
static gv_sim_script script;
static gv_session session;

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

static gv_engine *start(const shape_grasp *g, gv_scene *scene) {
  char path[256], err[512] = "";
  gv_arena arena;
  gv_settings settings;
  gv_settings_default(&settings);
  settings.engine.finger_joints = joined;
  gv_arena_init(&arena, scene_memory, sizeof scene_memory);
  snprintf(path, sizeof path, "build/scenes/%s.scene", g->scene);
  bool good = gv_scene_load(path, &arena, scene, err, sizeof err) == 0;
  snprintf(path, sizeof path, "data/scripts/%s.user", g->script);
  good = good && gv_sim_script_load(path, &script, err, sizeof err) == 0;
  gv_engine *engine = good ? gv_engine_init(engine_memory, sizeof engine_memory, &settings.engine, scene)
                           : NULL;
  CHECK(engine != NULL, "%s: %s", g->scene, err);
  if (!engine)
    return NULL;
  const gv_session_config cfg = {.limiter = settings.limiter,
                                 .safety = settings.safety,
                                 .side = settings.engine.hand.side,
                                 .period_s = settings.engine.step_s};
  gv_session_init(&session, &cfg, engine);
  gv_sim_init(&sim, &script, NULL, 1);
  gv_sim_start(&sim);
  return engine;
}

static void step(int ms) {
  static gv_frame frame[256];
  gv_frame command;
  int count = gv_sim_advance(&sim, ms * 1000000LL, frame, 256);
  gv_session_step(&session, ms * 1000000LL, frame, count, 0, &command);
  gv_sim_receive(&sim, &command);
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
  gv_scene scene;
  measures m = {.lift_m = 1e9};
  gv_pose held_at = gv_pose_identity();
  worst = (contact_laws){0};
  steps = by_others = softened = 0;
  gv_engine *engine = start(g, &scene);
  if (!engine)
    return;
  double start_z = gv_engine_object_pose(engine, 1).p.z;
  for (int ms = 0; ms < STEPS; ms++) {
    step(ms);
    for (int i = 0; i < GV_FINGERS; i++)
      m.force_max_n = fmax(m.force_max_n, session.force_n[i]);
    m.apart_m = fmax(m.apart_m, bones_apart(engine));
    if (ms == HELD_FROM)
      held_at = gv_pose_mul(gv_pose_inv(gv_engine_limb_pose(engine, GV_LIMB_PALM)),
                            gv_engine_object_pose(engine, 1));
    if (ms >= HELD_FROM)
      watch(engine, start_z, held_at, &m);
  }
  printf("  %-12s %5d triangles %3d pieces%s: lifted %.0f mm, slip %.3f mm, tilt %.3f deg, depth %.3f mm, "
         "force at most %.1f N, bones apart by %.2f mm\n",
         g->scene, scene.object[1].triangle_count, scene.object[1].piece_count,
         joined ? ", finger_joints" : "", m.lift_m * 1e3,
         m.slip_m * 1e3, m.tilt_rad * 180 / GV_PI, m.depth_m * 1e3, m.force_max_n, m.apart_m * 1e3);
  CHECK(scene.object[1].piece_count >= g->min_pieces, "%s: %d pieces", g->scene, scene.object[1].piece_count);
  CHECK(!g->triangles || scene.object[1].triangle_count == g->triangles, "%s: %d triangles", g->scene,
        scene.object[1].triangle_count);
  CHECK(m.lift_m > 0.1, "%s: lifted by %g m", g->scene, m.lift_m);
  CHECK(m.slip_m < 1e-3, "%s: slips %g mm in 3.5 s", g->scene, m.slip_m * 1e3);
  CHECK(m.depth_m < 1e-3, "%s: sinks in by %g mm", g->scene, m.depth_m * 1e3);
  CHECK(m.force_max_n > 0.2, "%s: the person feels %g N", g->scene, m.force_max_n);
  CHECK(m.apart_m < 1e-3 || !joined, "%s: bones apart by %g mm", g->scene, m.apart_m * 1e3);
  check_laws(g->scene);
  gv_engine_close(engine);
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
