// SPDX-License-Identifier: BSD-3-Clause
// The campaign's worker (`make campaign`): draws grasps from seeds (draw.h), lets the simulated user do
// each once in closed loop with the solver newton, then plays the frames that its device sent to the
// other solvers, and its fingers' drivers to another engine where there is one (peer.h). In every step
// the laws of contact are judged on the solver's answer (support/contact_laws.h), and the forces that
// leave on the limiter's promises. No clock.
//
//   campaign FAMILY FIRST COUNT [SOLVER...]   a line of CSV for each seed and solver, on standard output:
//
//     newton, dantzig, quickstep   the solvers, over core
//     libccd                       newton over libccd
//     relaxed                      newton with MuJoCo's law: what slides parts, at mu times the slip
//     fine                         newton at a tenth of the step, its contacts' springs and dampers the same
//     mujoco                       the other engine, with newton's drivers
//     mujoco_fine                  refined, at a tenth of the step
//     mujoco_late, ..._late_fine   from newton's state at the moment when the fingers have closed
//
//   campaign FAMILY FIRST COUNT watch SOLVER  height, place in the palm, contacts, forces every 5 ms instead
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "campaign/draw.h"
#include "campaign/peer.h"
#include "daemon/load/config_load.h"
#include "daemon/loop/session.h"
#include "dynamics/choice.h"
#include "support/contact_laws.h"

enum {
  MEMORY = 48 << 20,
  STEPS_MAX = 20000,
  FRAMES_MAX = 1 << 18,
  FRAMES_A_STEP = 256,
  OBJECT = 1,
  FINE = 10
};
static const double window_s = 0.5;  // at the start and the end of holding: mean place in the palm
static _Alignas(64) unsigned char scene_memory[MEMORY], engine_memory[MEMORY];

// What the device sent, step by step of 1 ms.
static gv_frame frame[FRAMES_MAX];
static int first_frame[STEPS_MAX + 1];
static int recorded;

typedef struct way {
  const char *name;
  gv_solver solver;
  gv_narrow narrow;
  bool relaxed;           // the law is MuJoCo's and Drake's: what slides parts at mu times the slip
  bool peer, fine, late;  // late: the peer goes on from newton's state when the fingers have closed
} way;
static const way ways[] = {
  {.name = "newton", .solver = GV_SOLVER_NEWTON},
  {.name = "dantzig", .solver = GV_SOLVER_DANTZIG},
  {.name = "quickstep", .solver = GV_SOLVER_QUICKSTEP},
  {.name = "libccd", .solver = GV_SOLVER_NEWTON, .narrow = GV_NARROW_LIBCCD},
  {.name = "mujoco", .solver = GV_SOLVER_NEWTON, .peer = true},
  {.name = "relaxed", .solver = GV_SOLVER_NEWTON, .relaxed = true},
  {.name = "fine", .solver = GV_SOLVER_NEWTON, .fine = true},
  {.name = "mujoco_fine", .solver = GV_SOLVER_NEWTON, .peer = true, .fine = true},
  {.name = "mujoco_late", .solver = GV_SOLVER_NEWTON, .peer = true, .late = true},
  {.name = "mujoco_late_fine", .solver = GV_SOLVER_NEWTON, .peer = true, .fine = true, .late = true},
};
enum { WAYS = sizeof ways / sizeof ways[0] };

typedef struct outcome {
  gv_vec3 first, last;  // mean place in the palm, at the start of holding and at its end
  int first_count, last_count;
  double lift_m, depth_m, apart_max_m;  // apart: the object from its first place in the palm
  double force_max_n;
  long bad_forces;  // steps in which a force broke a promise
  long steps, by_others,
      weaker;  // with contacts; left to another solver; with softer or older friction than asked
  bool fell;   // off the table's edge: for ever, and then it is put back
  uint64_t resets;
} outcome;

static contact_laws laws;  // of the solver's own answers, but for newton's softened ones, which creep
static outcome got;
static bool judging, relaxing;

static void fail(const char *what, const char *why) {
  fprintf(stderr, "campaign: %s: %s\n", what, why);
  exit(2);
}

// ---- judging ----------------------------------------------------------------------------------------------

gv_solver_report __real_gv_choice_solve(gv_choice *choice, gv_problem *problem, gv_velocity out_velocity[],
                                        gv_vec3 out_impulse[]);
gv_solver_report __wrap_gv_choice_solve(gv_choice *choice, gv_problem *problem, gv_velocity out_velocity[],
                                        gv_vec3 out_impulse[]);

// The convex relaxation of Coulomb's law (Anitescu and Potra): the exact law with a target
// velocity that is mu times the slip more. Its fixed point, by halves, until no target moves by
// more than a micrometre a second.
static gv_solver_report solve_relaxed(gv_choice *choice, gv_problem *problem, gv_velocity v[], gv_vec3 x[]) {
  static double target[GV_MAX_CONTACTS];
  gv_solver_report report = {GV_SOLVER_AUTO, GV_OUTCOME_NONE};
  double moved = 1.0;
  for (int i = 0; i < problem->contact_count; i++)
    target[i] = problem->contact[i].target_velocity;
  for (int round = 0; round < 40 && moved > 1e-6; round++) {
    report = __real_gv_choice_solve(choice, problem, v, x);
    moved = 0.0;
    for (int i = 0; i < problem->contact_count; i++) {
      gv_problem_contact *c = &problem->contact[i];
      const gv_vec3 u = contact_velocity(problem, c, v);
      const double slip = gv_norm(gv_mad(u, -gv_dot(u, c->frame[0]), c->frame[0]));
      const double change = 0.5 * (target[i] + c->mu * slip - c->target_velocity);
      c->target_velocity += change;
      moved = fmax(moved, fabs(change));
    }
  }
  for (int i = 0; i < problem->contact_count; i++)
    problem->contact[i].target_velocity = target[i];
  return report;
}

gv_solver_report __wrap_gv_choice_solve(gv_choice *choice, gv_problem *problem, gv_velocity out_velocity[],
                                        gv_vec3 out_impulse[]) {
  const gv_solver_report report = relaxing && problem->contact_count > 0
                                      ? solve_relaxed(choice, problem, out_velocity, out_impulse)
                                      : __real_gv_choice_solve(choice, problem, out_velocity, out_impulse);
  if (problem->contact_count == 0 || !judging)
    return report;
  got.steps++;
  got.by_others += report.solver != choice->solver;
  if (report.solver != choice->solver)
    return report;
  got.weaker += report.outcome != GV_OUTCOME_SOLVED;
  if (report.outcome != GV_OUTCOME_SOFTENED)
    contact_laws_judge(problem, out_velocity, out_impulse, &laws);
  return report;
}

static void judge_forces(const gv_session *session, double last_n[GV_FINGERS], double *shut_s) {
  const gv_limiter_config *limiter = &session->limiter.cfg;
  const bool lets = gv_safety_lets_force_out(&session->safety);
  bool bad = false;
  *shut_s = lets ? 0.0 : *shut_s + session->cfg.period_s;
  for (int i = 0; i < GV_FINGERS; i++) {
    const double force_n = session->force_n[i];
    const double rise_n = force_n - last_n[i];
    bad = bad || !(isfinite(force_n) && force_n >= 0.0 && force_n <= limiter->max_n);
    bad = bad || !(rise_n <= limiter->slew_n_per_s * session->cfg.period_s + 1e-9);
    bad = bad || (!lets && rise_n > 1e-9) || (*shut_s > limiter->ramp_s + 1e-9 && force_n > 0.0);
    got.force_max_n = fmax(got.force_max_n, force_n);
    last_n[i] = force_n;
  }
  got.bad_forces += bad;
}

static void watch_object(gv_pose palm, gv_pose object, double t, const drawn *d, double end_s,
                         double start_z) {
  const gv_vec3 in_palm = gv_transform_inv(palm, object.p);
  got.fell = got.fell || object.p.z < -1.0;
  const double hold_s = d->lifted_s + 0.4;
  if (t < hold_s)
    return;
  if (t < hold_s + window_s) {
    got.first = gv_add(got.first, in_palm);
    got.first_count++;
  }
  if (t >= end_s - window_s) {
    got.last = gv_add(got.last, in_palm);
    got.last_count++;
  }
  const gv_vec3 first = gv_scale(got.first, 1.0 / got.first_count);
  got.apart_max_m = fmax(got.apart_max_m, gv_norm(gv_sub(in_palm, first)));
  got.lift_m = object.p.z - start_z;
}

// ---- a run ------------------------------------------------------------------------------------------------

// A contact's spring and damper stay when the step is shorter: k = erp / (h cfm), d = (1 - erp) / cfm.
static void refine(gv_config *cfg, double factor) {
  const double k = cfg->contact_erp / (cfg->step_s * cfg->contact_cfm);
  const double d = (1.0 - cfg->contact_erp) / cfg->contact_cfm;
  cfg->step_s /= factor;
  cfg->contact_cfm = 1.0 / (d + k * cfg->step_s);
  cfg->contact_erp = k * cfg->step_s * cfg->contact_cfm;
}

typedef struct bench {  // a run's parts
  drawn d;
  gv_scene scene;
  gv_sim_script script;
  gv_settings settings;
  gv_session session;
  gv_sim sim;
  gv_engine *engine;
  peer *other;
  bool watching;
} bench;
static bench b;

static void start(const way *w) {
  char err[512] = "no memory";
  gv_config cfg = b.settings.engine;
  cfg.solver = w->solver;
  cfg.narrow = w->narrow;
  cfg.mu_hand = b.d.mu;
  cfg.period_s = cfg.step_s;  // a finer step may take as long as the usual one
  if (w->fine)
    refine(&cfg, FINE);
  b.engine = gv_engine_init(engine_memory, sizeof engine_memory, &cfg, &b.scene);
  if (!b.engine)
    fail(b.d.shape, "the engine does not start");
  const gv_session_config session = {.limiter = b.settings.limiter,
                                     .safety = b.settings.safety,
                                     .side = cfg.hand.side,
                                     .period_s = cfg.step_s};
  gv_session_init(&b.session, &session, b.engine);
  b.other = w->peer ? peer_open(b.engine, w->fine, err, sizeof err) : NULL;
  if (w->peer && !b.other)
    fail(w->name, err);
  got = (outcome){0};
  laws = (contact_laws){0};
  judging = !w->peer;
  relaxing = w->relaxed;
}

// Frames of a step, from the simulated device (and kept) or as they were kept.
static const gv_frame *take_frames(int step, bool live, int *out_count) {
  if (live) {
    if (first_frame[step] + FRAMES_A_STEP > FRAMES_MAX)
      fail(b.d.script, "more frames than fit");
    *out_count = gv_sim_advance(&b.sim, step * INT64_C(1000000), &frame[first_frame[step]], FRAMES_A_STEP);
    first_frame[step + 1] = first_frame[step] + *out_count;
  }
  *out_count = first_frame[step + 1] - first_frame[step];
  return &frame[first_frame[step]];
}

static void print_watch(const way *w, double t, gv_pose palm, gv_pose object) {
  const gv_vec3 in_palm = gv_transform_inv(palm, object.p);
  double friction = 0.0;
  double normal = 0.0;
  int count;
  const gv_contact *c = gv_engine_contacts(b.engine, &count);
  for (int i = 0; i < count; i++) {
    if (c[i].limb < 0)
      continue;
    const double n = gv_dot(c[i].force_world, c[i].normal_world);
    normal += n;
    friction += gv_norm(gv_mad(c[i].force_world, -n, c[i].normal_world));
  }
  printf("%s %.3f z %.3f mm, in palm %.3f %.3f %.3f mm, contacts %d, normal %.3f N, friction %.3f N\n",
         w->name, t, object.p.z * 1e3, in_palm.x * 1e3, in_palm.y * 1e3, in_palm.z * 1e3, count, normal,
         friction);
}

static void run(const way *w, bool live) {
  double last_n[GV_FINGERS] = {0};
  double shut_s = 0.0;
  bool taken = false;
  const int parts = w->fine ? FINE : 1;
  const int64_t period_ns = 1000000 / parts;
  const double end_s = b.script.end_s;
  const double start_z = b.scene.object[OBJECT].T_world_body.p.z;
  const int steps = live ? (int)(end_s * 1e3) : recorded;
  if (steps > STEPS_MAX)
    fail(b.d.script, "longer than fits");
  start(w);
  for (int i = 0; i < steps * parts; i++) {
    int count = 0, contacts;
    gv_frame command;
    const gv_frame *in = i % parts == 0 ? take_frames(i / parts, live, &count) : frame;
    gv_session_step(&b.session, i * period_ns, in, count, 0, &command);
    if (live)
      gv_sim_receive(&b.sim, &command);
    if (w->late && !taken && i * 1e-9 * (double)period_ns >= b.d.grasp_s) {
      peer_take_over(b.other, b.engine);
      taken = true;
    }
    if (b.other)
      peer_step(b.other, b.engine);
    else
      judge_forces(&b.session, last_n, &shut_s);
    const gv_contact *c = gv_engine_contacts(b.engine, &contacts);
    for (int k = 0; k < contacts && !b.other; k++)
      got.depth_m = fmax(got.depth_m, c[k].depth_m);
    const double t = (i + 1) * 1e-9 * (double)period_ns;
    const gv_pose palm = b.other ? peer_palm(b.other) : gv_engine_limb_pose(b.engine, GV_LIMB_PALM);
    const gv_pose object = b.other ? peer_object(b.other) : gv_engine_object_pose(b.engine, OBJECT);
    watch_object(palm, object, t, &b.d, end_s, start_z);
    if (b.watching && i % (5 * parts) == 0)
      print_watch(w, t, palm, object);
  }
  if (live)
    recorded = steps;
  got.resets = got.fell ? 0 : gv_engine_counters(b.engine)->body_resets;
  peer_close(b.other);
  gv_engine_close(b.engine);
}

// ---- rows -------------------------------------------------------------------------------------------------

static void print_head(void) {
  printf("family,seed,solver,outcome,lift_mm,slip_mm,apart_mm,depth_mm,script,shape,x_mm,y_mm,z_mm,mass_kg,"
         "mu,off_mm,off_deg,grip,tempo,"
         "device,sway_mrad,steps,others,weaker,loaded,outside,ratio,outside_n,creep_m_s,astray_deg,pull_n,"
         "closing_m_s,momentum_n_s,"
         "force_max_n,bad_forces,resets\n");
}

// Held: at the end as high as half of the lift at the least.
static void print_row(const way *w) {
  const drawn *d = &b.d;
  const bool held = got.lift_m > 0.5 * d->lift_m;
  const gv_vec3 first = gv_scale(got.first, 1.0 / got.first_count);
  const gv_vec3 last = gv_scale(got.last, 1.0 / got.last_count);
  printf("%s,%llu,%s,%s,%.2f,%.4f,%.4f,%.4f,%s,%s,%.2f,%.2f,%.2f,%.4f,%.3f,%.2f,%.2f,%.3f,%.3f,%s,%.1f,",
         d->family, d->seed, w->name, held ? "held" : "dropped", got.lift_m * 1e3,
         gv_norm(gv_sub(last, first)) * 1e3, got.apart_max_m * 1e3, got.depth_m * 1e3, d->script, d->shape,
         d->size_m.x * 1e3, d->size_m.y * 1e3, d->size_m.z * 1e3, d->mass_kg, d->mu, gv_norm(d->off_m) * 1e3,
         gv_norm(d->off_rad) * 180.0 / GV_PI, d->grip, d->tempo, d->real ? "real" : "best",
         d->sway_rad * 1e3);
  printf("%ld,%ld,%ld,%ld,%ld,%.3f,%.2e,%.2e,%.3f,%.2e,%.2e,%.2e,%.3f,%ld,%" PRIu64 "\n", got.steps,
         got.by_others, got.weaker, laws.loaded, laws.outside, laws.worst_ratio, fmax(0.0, laws.outside_n),
         laws.creep_m_s, laws.astray_deg, laws.pull_n, laws.closing_m_s, laws.momentum_n_s, got.force_max_n,
         got.bad_forces, got.resets);
  fflush(stdout);
}

// False where its shape is not compiled here.
static bool set_up(const char *family, unsigned long long seed) {
  char err[512];
  gv_arena arena;
  gv_arena_init(&arena, scene_memory, sizeof scene_memory);
  if (!draw(family, seed, &b.d))
    fail(family, "no such family; give boxes or any");
  const int error = draw_build(&b.d, &arena, &b.scene, &b.script, err, sizeof err);
  if (error < 0)
    fail(b.d.shape, err);
  gv_sim_init(&b.sim, &b.script, NULL, seed);
  gv_sim_start(&b.sim);
  return error == 0;
}

static const way *find_way(const char *name) {
  for (int i = 0; i < WAYS; i++)
    if (strcmp(ways[i].name, name) == 0)
      return &ways[i];
  fail(name, "no such solver; give newton, dantzig, quickstep, libccd, relaxed, mujoco, fine, mujoco_fine, "
             "mujoco_late or "
             "mujoco_late_fine");
  return NULL;
}

// Newton comes first, whether asked or not: the others get what its device sent.
static void compare(int count, char **names) {
  b.watching = count > 0 && strcmp(names[0], "watch") == 0;
  const bool newton_alone = b.watching && strcmp(names[count - 1], "newton") == 0;
  const bool others = b.watching && !newton_alone;
  b.watching = newton_alone;
  run(&ways[0], true);
  if (!newton_alone && !others)
    print_row(&ways[0]);
  b.watching = others;
  for (int i = others ? 1 : 0; i < count && !newton_alone; i++) {
    const way *w = find_way(names[i]);
    if (w == &ways[0] || (w->peer && !peer_name()))
      continue;
    run(w, false);
    if (!others)
      print_row(w);
  }
}

int main(int argc, char **argv) {
  if (argc < 4)
    fail("usage", "campaign FAMILY FIRST COUNT [SOLVER...]");
  const unsigned long long first = strtoull(argv[2], NULL, 10);
  const unsigned long long count = strtoull(argv[3], NULL, 10);
  gv_settings_default(&b.settings);
  print_head();
  for (unsigned long long seed = first; seed < first + count; seed++) {
    if (set_up(argv[1], seed))
      compare(argc - 4, argv + 4);
    else
      printf("%s,%llu,newton,absent,,,,,%s,%s\n", b.d.family, seed, b.d.script, b.d.shape);
  }
  return 0;
}
