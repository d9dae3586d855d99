// SPDX-License-Identifier: BSD-3-Clause
// Joints: newton's rows against ODE's own joints on random problems, and what moves in a joint
// against closed formulas: pendulums, an incline, springs, limits, a weight that breaks what holds
// it. And every mistake of a scene file.
#include <string.h>

#include "daemon/load/scene_load.h"
#include "support/bones.h"
#include "support/check.h"
#include "support/lab.h"
#include "support/solvers.h"

static unsigned long long seed = 21;
static double draw(double lo, double hi) { return check_uniform(&seed, lo, hi); }
static gv_vec3 draw_vector(double size) {
  return gv_v3(draw(-size, size), draw(-size, size), draw(-size, size));
}
static gv_quat draw_quat(double size) { return gv_quat_exp(draw_vector(size)); }

static const char *const kind_name[] = {"fixed", "ball", "hinge", "slider"};

// ---- one problem, two solvers ---------------------------------------------------------------------

enum { OBJECTS = 4 };

typedef struct world {
  gv_config cfg;
  gv_joint joint[GV_MAX_JOINTS];
  gv_scene scene;
  gv_body_state state[GV_BODIES];
  gv_problem problem;
} world;

// A small error, so that what pulls a joint together counts.
static gv_pose shaken(gv_pose T, double turn_rad) {
  return gv_pose_mul(T, (gv_pose){draw_quat(turn_rad), draw_vector(1e-4)});
}

static void draw_joint(world *w, gv_joint_kind kind, int a, int b) {
  gv_joint *joint = &w->joint[w->scene.joint_count++];
  const gv_pose T_world_joint = {draw_quat(2), draw_vector(0.05)};
  *joint = (gv_joint){.kind = kind, .object_a = a, .object_b = b, .T_b_joint = T_world_joint};
  joint->T_a_joint = gv_pose_mul(gv_pose_inv(w->state[GV_LIMBS + a].T), T_world_joint);
  if (b != GV_WORLD)
    joint->T_b_joint = gv_pose_mul(gv_pose_inv(w->state[GV_LIMBS + b].T), T_world_joint);
  if (kind != GV_JOINT_HINGE && kind != GV_JOINT_SLIDER)
    return;
  if (draw(0, 1) < 0.5)
    joint->friction = draw(0, 1);
  if (draw(0, 1) < 0.5) {
    joint->spring_stiffness = draw(0, 100);
    joint->spring_damping = draw(0.01, 1);
    joint->spring_rest = draw(-0.1, 0.1);
  }
}

// A chain of objects from the world on, as it stands a little off.
static void draw_world(world *w, gv_joint_kind kind, double turn_rad) {
  memset(w, 0, sizeof *w);
  w->cfg = gv_config_default();
  w->scene.joint = w->joint;
  gv_problem *q = &w->problem;
  q->step_s = w->cfg.step_s;
  q->budget_s = 1.0;
  q->body_count = GV_LIMBS + OBJECTS;
  for (int i = GV_LIMBS; i < q->body_count; i++) {
    w->state[i].T = (gv_pose){draw_quat(2), draw_vector(0.05)};
    const double inertia = draw(1e-5, 1e-4);
    q->body[i] = (gv_problem_body){
      .mass = draw(0.05, 0.5), .p = w->state[i].T.p, .v = draw_vector(0.5), .w = draw_vector(3)};
    for (int k = 0; k < 3; k++)
      q->body[i].inertia.m[k][k] = inertia * draw(1, 1.5);
  }
  for (int i = 0; i < OBJECTS; i++)
    draw_joint(w, i == 0 ? kind : (gv_joint_kind)(int)draw(0, 4), i, i - 1);
  for (int i = GV_LIMBS; i < q->body_count; i++) {
    w->state[i].T = shaken(w->state[i].T, turn_rad);
    q->body[i].p = w->state[i].T.p;
  }
  const bool broken[GV_MAX_JOINTS] = {false};
  gv_problem_set_joints(q, &w->cfg, &w->scene, w->state, broken);
}

static double farthest(const gv_velocity a[], const gv_velocity b[], int count) {
  double most = 0;
  for (int i = GV_LIMBS; i < count; i++)
    most = fmax(most, fmax(gv_norm(gv_sub(a[i].v, b[i].v)), 0.05 * gv_norm(gv_sub(a[i].w, b[i].w))));
  return most;
}

static void ask(gv_choice *choice, gv_solver solver, gv_problem *problem, gv_velocity out[GV_BODIES]) {
  gv_vec3 impulse[GV_MAX_CONTACTS];
  gv_choice_forget(choice);
  choice->solver = solver;
  for (int i = 0; i < problem->body_count; i++)
    out[i] = (gv_velocity){problem->body[i].v, problem->body[i].w};
  const gv_solver_report report = gv_choice_solve(choice, problem, out, impulse);
  CHECK(report.solver == solver && report.outcome == GV_OUTCOME_SOLVED, "%s did not solve it",
        gv_solver_name(solver));
}

// turn_rad: error of orientation. ODE reads that of a slider halfway between its bodies,
// and so moves it a little aside.
static void compare_chains(double turn_rad, double within) {
  static world w;
  gv_choice choice = open_solvers();
  choice.period_s = 1.0;
  for (int kind = 0; kind < 4; kind++) {
    double worst = 0;
    for (int i = 0; i < 500; i++) {
      gv_velocity ours[GV_BODIES], ode[GV_BODIES];
      draw_world(&w, (gv_joint_kind)kind, turn_rad);
      ask(&choice, GV_SOLVER_NEWTON, &w.problem, ours);
      ask(&choice, GV_SOLVER_DANTZIG, &w.problem, ode);
      worst = fmax(worst, farthest(ours, ode, w.problem.body_count));
    }
    printf("# %s first: 500 chains of four, velocities within %.1e m/s\n", kind_name[kind], worst);
    CHECK(worst < within, "%s: %g m/s between newton and ODE", kind_name[kind], worst);
  }
  gv_choice_close(&choice);
}

static void test_chains_move_as_with_odes_own_joints(void) {
  compare_chains(0.0, 1e-5);
  compare_chains(1e-4, 5e-3);
}

// ---- motions --------------------------------------------------------------------------------------

static lab l;
static gv_joint joint[GV_MAX_JOINTS];

static void start(gv_solver solver) {
  lab_start(&l);
  memset(joint, 0, sizeof joint);
  l.scene.joint = joint;
  l.cfg.solver = solver;
}

// The frame of a joint at p with its axis along x turned by q.
static gv_joint *hold(gv_joint_kind kind, int a, int b, gv_quat q, gv_vec3 p) {
  gv_joint *j = &joint[l.scene.joint_count++];
  const gv_pose T_world_joint = {q, p};
  *j = (gv_joint){.kind = kind, .object_a = a, .object_b = b, .T_b_joint = T_world_joint};
  j->T_a_joint = gv_pose_mul(gv_pose_inv(l.object[a].T_world_body), T_world_joint);
  if (b != GV_WORLD)
    j->T_b_joint = gv_pose_mul(gv_pose_inv(l.object[b].T_world_body), T_world_joint);
  return j;
}

static gv_quat about_z(double angle) { return gv_quat_axis_angle(gv_v3(0, 0, 1), angle); }
static gv_quat y_axis(void) { return about_z(GV_PI / 2); }
static gv_quat z_axis(void) { return gv_quat_axis_angle(gv_v3(0, 1, 0), -GV_PI / 2); }

static double now(int k) { return gv_engine_joint(l.engine, k).position; }

// A bar on a hinge at its end: period 2 pi sqrt(I / (m g d)), with I = m (l^2 + t^2) / 12
// + m d^2, swinging by 2 degrees.
static void test_a_bar_on_a_hinge_swings_with_its_period(void) {
  for (int s = 0; s < EVERY_SOLVER; s++) {
    start(every_solver[s]);
    const double length = 0.3;
    const double thick = 0.02;
    const double d = length / 2;
    const double tilt = 2 * GV_PI / 180;
    const int bar = lab_box(&l, gv_v3(thick, thick, length), gv_v3(0, 0, 0.5 - d), 0.2, 0.5);
    hold(GV_JOINT_HINGE, bar, GV_WORLD, y_axis(), gv_v3(0, 0, 0.5));
    lab_run(&l);
    const gv_quat q = gv_quat_axis_angle(gv_v3(0, 1, 0), tilt);
    gv_engine_set_object(l.engine, bar, (gv_pose){q, gv_add(gv_v3(0, 0, 0.5), gv_rotate(q, gv_v3(0, 0, -d)))},
                         gv_v3(0, 0, 0), gv_v3(0, 0, 0));
    const double inertia = (length * length + thick * thick) / 12 + d * d;
    const double period = 2 * GV_PI * sqrt(inertia / (9.81 * d));
    int crossings = 0;
    double last = now(0);
    double first_s = 0;
    double last_s = 0;
    CHECK_NEAR(last, tilt, 1e-6);
    for (int i = 1; i < 9000; i++) {
      lab_steps(&l, 1, NULL);
      const double angle = now(0);
      if (last < 0 && angle >= 0) {
        last_s = (i - angle / (angle - last)) * 1e-3;
        if (crossings++ == 0)
          first_s = last_s;
      }
      last = angle;
    }
    const double measured = (last_s - first_s) / (crossings - 1);
    printf("# %s: period %.5f s, by the formula %.5f\n", gv_solver_name(every_solver[s]), measured, period);
    CHECK_NEAR(measured, period, 0.002 * period);
    CHECK(fabs(now(0)) < 1.01 * tilt, "it swings up to %g rad", now(0));
    gv_engine_close(l.engine);
  }
}

// A ball joint keeps its point, whatever happens: ten links, thrown sideways, for three seconds.
static void test_a_chain_of_ball_joints_holds_together(void) {
  for (int s = 0; s < EVERY_SOLVER; s++) {
    start(every_solver[s]);
    enum { LINKS = 10 };
    for (int i = 0; i < LINKS; i++) {
      const int link = lab_box(&l, gv_v3(0.05, 0.01, 0.01), gv_v3(0.05 * i + 0.025, 0, 1), 0.02, 0.5);
      hold(GV_JOINT_BALL, link, i - 1, gv_quat_identity(), gv_v3(0.05 * i, 0, 1));
    }
    lab_run(&l);
    double gap = 0;
    for (int i = 0; i < 3000; i++) {
      lab_steps(&l, 1, NULL);
      for (int k = 1; k < LINKS; k++) {
        const gv_vec3 end = gv_transform(gv_engine_object_pose(l.engine, k - 1), gv_v3(0.025, 0, 0));
        const gv_vec3 begin = gv_transform(gv_engine_object_pose(l.engine, k), gv_v3(-0.025, 0, 0));
        gap = fmax(gap, gv_norm(gv_sub(end, begin)));
      }
    }
    printf("# %s: links come apart by %.1e m at most\n", gv_solver_name(every_solver[s]), gap);
    // A whip: the last link turns by 0.1 rad a step at the end.
    CHECK(gap < 3e-3, "a gap of %g m", gap);
    gv_engine_close(l.engine);
  }
}

// A slider at 30 degrees with friction F: acceleration g sin 30 - F / m, and none
// where F is more than m g sin 30.
static void test_a_slider_slides_against_its_friction(void) {
  for (int s = 0; s < EVERY_SOLVER; s++) {
    for (int holds = 0; holds < 2; holds++) {
      start(every_solver[s]);
      const double mass = 0.4;
      const double along = 9.81 * 0.5;
      const double friction = mass * along * (holds ? 1.01 : 0.4);
      const int block = lab_box(&l, gv_v3(0.05, 0.04, 0.03), gv_v3(0, 0, 1), mass, 0.5);
      hold(GV_JOINT_SLIDER, block, GV_WORLD, gv_quat_axis_angle(gv_v3(0, 1, 0), GV_PI / 6), gv_v3(0, 0, 1))
          ->friction = friction;
      lab_run(&l);
      lab_steps(&l, 500, NULL);
      const double way = holds ? 0 : 0.5 * (along - friction / mass) * 0.25;
      CHECK_NEAR(now(0), way, holds ? 1e-6 : 0.003 * way);
      gv_engine_close(l.engine);
    }
  }
}

// A mass on a spring: comes to rest at m g / k, and swings with 2 pi sqrt(m / k) without damping to speak of.
static void test_a_spring_carries_a_weight(void) {
  for (int s = 0; s < EVERY_SOLVER; s++) {
    start(every_solver[s]);
    const double mass = 0.3;
    const double k = 200;
    const int block = lab_box(&l, gv_v3(0.05, 0.05, 0.05), gv_v3(0, 0, 1), mass, 0.5);
    gv_joint *j = hold(GV_JOINT_SLIDER, block, GV_WORLD, z_axis(), gv_v3(0, 0, 1));
    j->spring_stiffness = k;
    j->spring_damping = 2;
    j->spring_rest = 0.01;
    lab_run(&l);
    lab_steps(&l, 5000, NULL);
    CHECK_NEAR(now(0), 0.01 - mass * 9.81 / k, 1e-6);
    gv_engine_close(l.engine);
  }
}

static void test_a_spring_swings_with_its_frequency(void) {
  start(GV_SOLVER_NEWTON);
  const double mass = 0.3;
  const double k = 50;
  l.cfg.step_s = 1e-4;
  l.scene.gravity_m_s2 = gv_v3(0, 0, 0);
  const int block = lab_box(&l, gv_v3(0.05, 0.05, 0.05), gv_v3(0, 0, 1), mass, 0.5);
  gv_joint *j = hold(GV_JOINT_SLIDER, block, GV_WORLD, gv_quat_identity(), gv_v3(0, 0, 1));
  j->spring_stiffness = k;
  j->spring_rest = 0.01;
  lab_run(&l);
  int steps = 0;
  while (now(0) < 0.01 && steps < 100000) {
    lab_steps(&l, 1, NULL);
    steps++;
  }
  const double quarter = 0.5 * GV_PI * sqrt(mass / k);
  CHECK_NEAR(1e-4 * steps, quarter, 0.01 * quarter);
  gv_engine_close(l.engine);
}

// A lever falls onto its limit and lies there, a drawer runs into its stop: not past it.
static void test_limits_are_not_passed(void) {
  for (int s = 0; s < EVERY_SOLVER; s++) {
    start(every_solver[s]);
    const int lever = lab_box(&l, gv_v3(0.2, 0.02, 0.02), gv_v3(0.1, 0, 1), 0.2, 0.5);
    const int drawer = lab_box(&l, gv_v3(0.1, 0.1, 0.05), gv_v3(0, 1, 1), 0.5, 0.5);
    gv_joint *hinge = hold(GV_JOINT_HINGE, lever, GV_WORLD, y_axis(), gv_v3(0, 0, 1));
    gv_joint *slider = hold(GV_JOINT_SLIDER, drawer, GV_WORLD, gv_quat_identity(), gv_v3(0, 1, 1));
    hinge->has_limits = slider->has_limits = true;
    hinge->low = -0.2;
    hinge->high = 0.5;
    slider->low = -0.01;
    slider->high = 0.15;
    lab_run(&l);
    gv_engine_set_object(l.engine, drawer, gv_engine_object_pose(l.engine, drawer), gv_v3(0.5, 0, 0),
                         gv_v3(0, 0, 0));
    double most_angle = 0;
    double most_way = 0;
    for (int i = 0; i < 2000; i++) {
      lab_steps(&l, 1, NULL);
      most_angle = fmax(most_angle, now(0));
      most_way = fmax(most_way, now(1));
    }
    // ODE sees a stop once it is passed: a step of the way more.
    const double beyond = every_solver[s] == GV_SOLVER_NEWTON ? 1e-6 : 1e-2;
    CHECK(most_angle < 0.5 + beyond, "%s: the lever reaches %g rad", gv_solver_name(every_solver[s]),
          most_angle);
    CHECK(most_way < 0.15 + 0.1 * beyond, "%s: the drawer reaches %g m", gv_solver_name(every_solver[s]),
          most_way);
    CHECK_NEAR(now(0), 0.5, 1e-4);
    CHECK_NEAR(now(1), 0.15, 1e-4);
    gv_engine_close(l.engine);
  }
}

// Two boxes, welded side by side, dropped onto a table with one of them beyond its edge, tip over as one.
static void test_what_is_fixed_moves_as_one(void) {
  for (int s = 0; s < EVERY_SOLVER; s++) {
    start(every_solver[s]);
    lab_box(&l, gv_v3(0.2, 0.2, 0.02), gv_v3(0, 0, -0.01), 0, 0.8);
    const int a = lab_box(&l, gv_v3(0.05, 0.05, 0.05), gv_v3(0.06, 0, 0.03), 0.1, 0.8);
    const int b = lab_box(&l, gv_v3(0.05, 0.05, 0.05), gv_v3(0.11, 0, 0.03), 0.4, 0.8);
    hold(GV_JOINT_FIXED, a, b, gv_quat_identity(), gv_v3(0.085, 0, 0.03));
    lab_run(&l);
    double off = 0;
    for (int i = 0; i < 600; i++) {
      lab_steps(&l, 1, NULL);
      const gv_pose T_a_b = gv_pose_mul(gv_pose_inv(gv_engine_object_pose(l.engine, a)),
                                        gv_engine_object_pose(l.engine, b));
      off = fmax(off, gv_norm(gv_sub(T_a_b.p, gv_v3(0.05, 0, 0))) + 0.05 * gv_norm(gv_quat_log(T_a_b.q)));
    }
    const double fell = gv_engine_object_pose(l.engine, b).p.z;
    CHECK(off < (every_solver[s] == GV_SOLVER_QUICKSTEP ? 1e-3 : 1e-4), "%s: the weld gives %g m",
          gv_solver_name(every_solver[s]), off);
    CHECK(fell < -0.05, "it does not tip over: %g m", fell);
    gv_engine_close(l.engine);
  }
}

// 0.5 kg on a joint that carries 5 N: 4.905 N hold, a push of 0.2 N more breaks it.
// After a reset it holds again.
static void test_a_joint_breaks_at_its_force(void) {
  for (int s = 0; s < EVERY_SOLVER; s++) {
    start(every_solver[s]);
    const int weight = lab_box(&l, gv_v3(0.05, 0.05, 0.05), gv_v3(0, 0, 1), 0.5, 0.5);
    hold(GV_JOINT_BALL, weight, GV_WORLD, gv_quat_identity(), gv_v3(0, 0, 1.025))->break_force_n = 5.0;
    lab_run(&l);
    lab_steps(&l, 500, NULL);
    CHECK_NEAR(gv_engine_joint(l.engine, 0).force_n, 0.5 * 9.81, 0.01);
    CHECK(!gv_engine_joint(l.engine, 0).broken, "broken by less than it carries");
    gv_engine_push_object(l.engine, weight, gv_v3(0, 0, -0.2), gv_v3(0, 0, 0));
    lab_steps(&l, 1, NULL);
    CHECK(gv_engine_joint(l.engine, 0).broken && gv_engine_counters(l.engine)->joints_broken == 1,
          "holds more than it carries");
    lab_steps(&l, 200, NULL);
    CHECK(gv_engine_object_pose(l.engine, weight).p.z < 0.85, "it does not fall");
    gv_engine_reset(l.engine);
    lab_steps(&l, 100, NULL);
    CHECK(!gv_engine_joint(l.engine, 0).broken && gv_engine_object_pose(l.engine, weight).p.z > 0.99,
          "still broken after a reset");
    gv_engine_close(l.engine);
  }
}

// A lid in a box, with and without `collides`.
static void test_what_a_joint_holds_does_not_collide(void) {
  for (int collides = 0; collides < 2; collides++) {
    start(GV_SOLVER_NEWTON);
    lab_box(&l, gv_v3(0.1, 0.1, 0.1), gv_v3(0, 0, 0.05), 0, 0.8);
    const int lid = lab_box(&l, gv_v3(0.1, 0.1, 0.01), gv_v3(0, 0, 0.098), 0.1, 0.8);
    hold(GV_JOINT_HINGE, lid, 0, y_axis(), gv_v3(-0.05, 0, 0.1))->collides = collides;
    lab_run(&l);
    lab_steps(&l, 5, NULL);
    int count;
    gv_engine_contacts(l.engine, &count);
    CHECK((count > 0) == collides, "%d contacts", count);
    gv_engine_close(l.engine);
  }
}

// An object that is thrown out of the world takes what hangs on it back with it.
static void test_what_is_put_back_is_put_back_together(void) {
  start(GV_SOLVER_NEWTON);
  const int a = lab_box(&l, gv_v3(0.05, 0.05, 0.05), gv_v3(0, 0, 1), 0.1, 0.5);
  const int b = lab_box(&l, gv_v3(0.05, 0.05, 0.05), gv_v3(0.1, 0, 1), 0.1, 0.5);
  hold(GV_JOINT_BALL, a, b, gv_quat_identity(), gv_v3(0.05, 0, 1));
  lab_run(&l);
  const gv_pose far_away = {gv_quat_identity(), gv_v3(200, 0, 0)};
  gv_engine_set_object(l.engine, b, far_away, gv_v3(0, 0, 0), gv_v3(0, 0, 0));
  lab_steps(&l, 2, NULL);
  const gv_vec3 p = gv_engine_object_pose(l.engine, a).p;
  const gv_vec3 q = gv_engine_object_pose(l.engine, b).p;
  CHECK(gv_norm(gv_sub(p, gv_v3(0, 0, 1))) < 1e-3 && gv_norm(gv_sub(q, gv_v3(0.1, 0, 1))) < 1e-3,
        "at %g and %g m", p.x, q.x);
  gv_engine_close(l.engine);
}

// ---- scene files ----------------------------------------------------------------------------------

#define OBJECT_LIST                                                                                          \
  "version = 1;\nobjects = ( { name = \"base\"; static = true; box = [0.1, 0.1, 0.1]; },\n"                  \
  "{ name = \"lever\"; mass = 0.2; box = [0.3, 0.02, 0.02]; position = [0.15, 0.0, 0.2]; rotation = [0.0, "  \
  "0.0, 0.0]; } );\n"

static int load(const char *joints, gv_scene *out, char err[512]) {
  static char text[2048];
  gv_arena arena;
  gv_arena_init(&arena, lab_scene_memory, sizeof lab_scene_memory);
  snprintf(text, sizeof text, OBJECT_LIST "joints = ( { %s } );\n", joints);
  err[0] = 0;
  return gv_scene_load_text("text", text, &arena, out, err, 512);
}

// An open hand comes down on an edge under its middle limbs: they stop, and without joints the outer ones go
// on, to where their own springs lead them.
static double press_on_an_edge(gv_solver solver, bool joined) {
  static const double straight[GV_SENSORS];
  lab_start(&l);
  l.cfg.solver = solver;
  l.cfg.finger_joints = joined;
  lab_box(&l, gv_v3(0.01, 0.2, 0.1), gv_v3(0.14, 0, 0.4), 0, 0.8);
  lab_run(&l);
  double apart = 0;
  for (int i = 0; i <= 1500; i++) {
    const double z = 0.5 - 0.06 * fmin(1, i * 1e-3);
    const gv_sample hand = lab_hand(&l, straight, (gv_pose){{1, 0, 0, 0}, {0, 0, z}});
    lab_steps(&l, 1, &hand);
    apart = fmax(apart, bones_apart(l.engine));
  }
  gv_engine_close(l.engine);
  return apart;
}

static void test_joined_fingers_stay_whole(void) {
  for (int s = 0; s < EVERY_SOLVER; s++) {
    const double loose = press_on_an_edge(every_solver[s], false);
    const double joined = press_on_an_edge(every_solver[s], true);
    printf("# %s: bones apart by %.2f mm, %.4f mm with finger_joints\n", gv_solver_name(every_solver[s]),
           1e3 * loose, 1e3 * joined);
    CHECK(loose > 5e-3, "%s: apart by %g m without joints", gv_solver_name(every_solver[s]), loose);
    CHECK(joined < 1e-3, "%s: apart by %g m", gv_solver_name(every_solver[s]), joined);
  }
}

static void test_a_scene_says_what_joints_there_are(void) {
  gv_scene scene;
  char err[512];
  const int result = load(
      "name = \"h\"; kind = \"hinge\"; object = \"lever\"; to = \"base\"; anchor = [0.0, 0.0, 0.2]; axis = "
      "[0.0, -2.0, 0.0];"
      "limits = [-10.0, 90.0]; friction = 0.1; spring = [1.5, 0.02, 45.0]; break_force = 60;",
      &scene, err);
  CHECK(result == 0 && scene.joint_count == 1, "%s", err);
  if (result != 0)
    return;
  const gv_joint *j = &scene.joint[0];
  CHECK(j->kind == GV_JOINT_HINGE && j->object_a == 1 && j->object_b == 0 && j->has_limits && !j->collides,
        "bodies or kind");
  CHECK_NEAR(j->high, GV_PI / 2, 1e-12);
  CHECK_NEAR(j->spring_rest, GV_PI / 4, 1e-12);
  CHECK(j->spring_stiffness == 1.5 && j->spring_damping == 0.02 && j->friction == 0.1 &&
            j->break_force_n == 60,
        "numbers");
  const gv_pose T = gv_pose_mul(scene.object[1].T_world_body, j->T_a_joint);
  CHECK(gv_norm(gv_sub(gv_rotate(T.q, gv_v3(1, 0, 0)), gv_v3(0, -1, 0))) < 1e-12, "axis");
  CHECK(gv_norm(gv_sub(T.p, gv_v3(0, 0, 0.2))) < 1e-12, "anchor");
}

static void test_mistakes_in_a_joint_are_named(void) {
  static const struct {
    const char *text, *says;
  } mistake[] = {
    {"name = \"h\"; kind = \"hing\"; object = \"lever\"; anchor = [0, 0, 0]; axis = [0, 1, 0];", "hing"},
    {"name = \"h\"; kind = \"hinge\"; object = \"leaver\"; anchor = [0, 0, 0]; axis = [0, 1, 0];",
     "no object is named \"leaver\""},
    {"name = \"h\"; kind = \"hinge\"; object = \"base\"; anchor = [0, 0, 0]; axis = [0, 1, 0];", "is static"},
    {"name = \"h\"; kind = \"hinge\"; object = \"lever\"; to = \"lever\"; anchor = [0, 0, 0]; axis = [0, 1, "
     "0];",
     "are the same"},
    {"name = \"h\"; kind = \"hinge\"; object = \"lever\"; axis = [0, 1, 0];", "'anchor' is missing"},
    {"name = \"h\"; kind = \"hinge\"; object = \"lever\"; anchor = [0, 0, 0];", "'axis' is missing"},
    {"name = \"h\"; kind = \"hinge\"; object = \"lever\"; anchor = [0, 0, 0]; axis = [0, 0, 0];",
     "no direction"},
    {"name = \"h\"; kind = \"ball\"; object = \"lever\"; anchor = [0, 0, 0]; limits = [-1, 1];",
     "'limits' belongs to a hinge"},
    {"name = \"h\"; kind = \"hinge\"; object = \"lever\"; anchor = [0, 0, 0]; axis = [0, 1, 0]; limits = "
     "[10, 20];",
     "starts at 0"},
    {"name = \"h\"; kind = \"slider\"; object = \"lever\"; anchor = [0, 0, 0]; axis = [0, 1, 0]; spring = "
     "[-1, 0, 0];",
     "0 or more"},
    {"name = \"h\"; kind = \"slider\"; object = \"lever\"; anchor = [0, 0, 0]; axis = [0, 1, 0]; stop = 1;",
     "stop"},
    {"kind = \"fixed\"; object = \"lever\"; anchor = [0, 0, 0];", "'name' is missing"},
  };
  for (size_t i = 0; i < sizeof mistake / sizeof mistake[0]; i++) {
    gv_scene scene;
    char err[512];
    CHECK(load(mistake[i].text, &scene, err) != 0, "taken: %s", mistake[i].text);
    CHECK(strncmp(err, "text:4:", 7) == 0 && strstr(err, mistake[i].says), "\"%s\" for: %s", err,
          mistake[i].text);
  }
}

int main(void) {
  RUN(test_chains_move_as_with_odes_own_joints);
  RUN(test_a_bar_on_a_hinge_swings_with_its_period);
  RUN(test_a_chain_of_ball_joints_holds_together);
  RUN(test_a_slider_slides_against_its_friction);
  RUN(test_a_spring_carries_a_weight);
  RUN(test_a_spring_swings_with_its_frequency);
  RUN(test_limits_are_not_passed);
  RUN(test_what_is_fixed_moves_as_one);
  RUN(test_a_joint_breaks_at_its_force);
  RUN(test_what_a_joint_holds_does_not_collide);
  RUN(test_what_is_put_back_is_put_back_together);
  RUN(test_joined_fingers_stay_whole);
  RUN(test_a_scene_says_what_joints_there_are);
  RUN(test_mistakes_in_a_joint_are_named);
  return check_done();
}
