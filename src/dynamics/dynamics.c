// SPDX-License-Identifier: BSD-3-Clause
// One step of the dynamics: bodies move freely, their contacts become a problem, a solver corrects the
// velocities, and the bodies move with them. Real-time thread.
//
// Nothing that is not finite passes gv_bodies_add_force, gv_bodies_set_state or the contact law; the engine
// checks states after each step.
#include "dynamics/dynamics.h"

#include <assert.h>
#include <string.h>

#include "dynamics/bodies.h"

struct gv_dynamics {
  const gv_config *cfg;
  const gv_scene *scene;
  bool broken[GV_MAX_JOINTS];
  gv_joint finger_joint[GV_HANDS][GV_FINGER_JOINTS];
  gv_bodies bodies;
  gv_choice choice;
  gv_problem problem;               // of this step
  int index[GV_MAX_CONTACTS];       // of the problem's contacts among those given
  gv_velocity velocity[GV_BODIES];  // after the step, first without contacts
  gv_vec3 impulse[GV_MAX_CONTACTS];
  int joints_broken;        // in the last step
  unsigned warm_up_errors;  // the warm-up's contacts make no sense to a solver
};

gv_dynamics *gv_dynamics_create(gv_arena *arena, const gv_config *cfg, const gv_scene *scene,
                                const gv_spring spring[GV_LIMBS], const double limb_inertia[GV_LIMBS]) {
  gv_choice choice;
  gv_dynamics *dyn = gv_arena_alloc(arena, "dynamics", sizeof *dyn);
  const bool opened = gv_choice_open(&choice, arena, cfg);
  if (!dyn || !opened) {
    gv_choice_close(&choice);
    return NULL;
  }
  dyn->cfg = cfg;
  dyn->scene = scene;
  dyn->choice = choice;
  gv_finger_joints_init(&cfg->hand, dyn->finger_joint[0]);
  if (cfg->second.present)
    gv_finger_joints_init(&cfg->second.hand, dyn->finger_joint[1]);
  gv_bodies_init(&dyn->bodies, cfg, scene, spring, limb_inertia);
  return dyn;
}

void gv_dynamics_destroy(gv_dynamics *dyn) {
  if (dyn)
    gv_choice_close(&dyn->choice);
}

void gv_dynamics_warm_up(gv_dynamics *dyn) {
  gv_choice_warm_up(&dyn->choice, &dyn->problem);
  dyn->warm_up_errors = gv_ode_failures(dyn->choice.ode);
}

const gv_body_state *gv_dynamics_state(const gv_dynamics *dyn, int body) {
  assert(body >= 0 && body < dyn->bodies.count);
  return &dyn->bodies.state[body];
}

void gv_dynamics_set_state(gv_dynamics *dyn, int body, const gv_body_state *s) {
  gv_bodies_set_state(&dyn->bodies, body, s);
}

void gv_dynamics_set_limb(gv_dynamics *dyn, int limb, const gv_spring *spring, double inertia) {
  gv_bodies_set_limb(&dyn->bodies, limb, spring, inertia);
}

void gv_dynamics_park_limbs(gv_dynamics *dyn, int first, bool parked) {
  assert(first >= 0 && first + GV_LIMBS <= dyn->bodies.count);
  for (int i = first; i < first + GV_LIMBS; i++)
    dyn->bodies.body[i].stands = parked;
}

void gv_dynamics_set_rest(gv_dynamics *dyn, int body, bool rest) {
  assert(body >= GV_LIMBS && body < dyn->bodies.second_hand);
  gv_body_state *s = &dyn->bodies.state[body];
  if (rest)
    s->v = s->w = gv_v3(0, 0, 0);
  dyn->bodies.body[body].stands = rest;
}

bool gv_dynamics_pushed(const gv_dynamics *dyn, int body) {
  assert(body >= 0 && body < dyn->bodies.count);
  const gv_body *b = &dyn->bodies.body[body];
  return gv_norm2(b->force) > 0.0 || gv_norm2(b->torque) > 0.0;
}

gv_vec3 gv_dynamics_gravity(const gv_dynamics *dyn) { return dyn->bodies.gravity; }

void gv_dynamics_predict(const gv_dynamics *dyn, int body, gv_body_state *out) {
  gv_bodies_predict(&dyn->bodies, dyn->cfg->step_s, body, out);
}

void gv_dynamics_add_force(gv_dynamics *dyn, int body, gv_vec3 f, gv_vec3 t) {
  gv_bodies_add_force(&dyn->bodies, body, f, t);
}

void gv_dynamics_set_share(gv_dynamics *dyn, double share) {
  assert(share > 0.0 && share <= 1.0);
  dyn->choice.effort = share;
}

void gv_dynamics_forget(gv_dynamics *dyn) { gv_choice_forget(&dyn->choice); }

void gv_dynamics_mend_joints(gv_dynamics *dyn) { memset(dyn->broken, 0, sizeof dyn->broken); }

int gv_dynamics_joints_broken(const gv_dynamics *dyn) { return dyn->joints_broken; }

gv_joint_state gv_dynamics_joint(const gv_dynamics *dyn, int joint) {
  assert(joint >= 0 && joint < dyn->scene->joint_count);
  const gv_joint *k = &dyn->scene->joint[joint];
  const gv_body_state *object = &dyn->bodies.state[GV_LIMBS];
  gv_pose T_world_b = k->T_b_joint;
  if (k->object_b != GV_WORLD)
    T_world_b = gv_pose_mul(object[k->object_b].T, k->T_b_joint);
  const gv_pose T_world_a = gv_pose_mul(object[k->object_a].T, k->T_a_joint);
  gv_joint_state out = {.position = gv_joint_position(k, T_world_a, T_world_b), .broken = dyn->broken[joint]};
  if (!out.broken && joint < dyn->problem.joint_count)
    out.force_n = gv_problem_joint_force(&dyn->problem, joint, dyn->velocity);
  return out;
}

unsigned gv_dynamics_solver_errors(const gv_dynamics *dyn) {
  return gv_ode_failures(dyn->choice.ode) - dyn->warm_up_errors;
}

double gv_dynamics_object_energy(const gv_dynamics *dyn) { return gv_bodies_object_energy(&dyn->bodies); }

static void state_fingers(gv_dynamics *dyn) {
  const int first[GV_HANDS] = {0, dyn->bodies.second_hand};
  for (int h = 0; h < (dyn->cfg->second.present ? 2 : 1); h++)
    gv_problem_add_finger_joints(&dyn->problem, dyn->cfg, dyn->finger_joint[h], first[h], dyn->bodies.state);
}

static void state_problem(gv_dynamics *dyn, const gv_dynamics_contact contact[], int count) {
  gv_problem *problem = &dyn->problem;
  problem->step_s = dyn->cfg->step_s;
  problem->body_count = dyn->bodies.count;
  problem->second_hand = dyn->bodies.second_hand;
  gv_bodies_move_freely(&dyn->bodies, problem->step_s, problem->body);
  for (int i = 0; i < problem->body_count; i++) {
    dyn->velocity[i].v = problem->body[i].v;
    dyn->velocity[i].w = problem->body[i].w;
  }
  gv_problem_set_contacts(problem, dyn->cfg, contact, count, dyn->index);
  gv_problem_set_joints(problem, dyn->cfg, dyn->scene, dyn->bodies.state, dyn->broken);
  if (dyn->cfg->finger_joints)
    state_fingers(dyn);
}

// No solver has an answer: what touches something stays where it is for this step.
static void stop_touched(gv_dynamics *dyn) {
  static const gv_velocity none;
  for (int i = 0; i < dyn->problem.contact_count; i++) {
    dyn->velocity[dyn->problem.contact[i].body_a] = none;
    dyn->velocity[dyn->problem.contact[i].body_b] = none;
  }
  for (int i = 0; i < dyn->problem.joint_count; i++) {
    const gv_problem_joint *j = &dyn->problem.joint[i];
    if (j->row_count == 0)
      continue;
    dyn->velocity[j->body_a] = none;
    if (j->body_b != GV_WORLD)
      dyn->velocity[j->body_b] = none;
  }
}

// A joint that carried more than it can is gone in the next step. Returns how many broke.
static int break_joints(gv_dynamics *dyn) {
  int count = 0;
  for (int i = 0; i < dyn->scene->joint_count; i++) {
    const double most = dyn->scene->joint[i].break_force_n;
    if (!(most > 0.0) || dyn->broken[i])
      continue;
    if (!(gv_problem_joint_force(&dyn->problem, i, dyn->velocity) > most))
      continue;
    dyn->broken[i] = true;
    count++;
  }
  return count;
}

gv_solver_report gv_dynamics_step(gv_dynamics *dyn, const gv_dynamics_contact contact[], int count,
                                  gv_vec3 out_force[]) {
  const double h = dyn->cfg->step_s;
  state_problem(dyn, contact, count);
  const gv_solver_report report = gv_choice_solve(&dyn->choice, &dyn->problem, dyn->velocity, dyn->impulse);
  if (report.outcome == GV_OUTCOME_NONE)
    stop_touched(dyn);
  memset(out_force, 0, sizeof *out_force * (size_t)count);
  for (int i = 0; i < dyn->problem.contact_count && report.outcome != GV_OUTCOME_NONE; i++)
    out_force[dyn->index[i]] = gv_scale(dyn->impulse[i], 1.0 / h);
  dyn->joints_broken = break_joints(dyn);
  gv_bodies_advance(&dyn->bodies, h, dyn->velocity);
  return report;
}
