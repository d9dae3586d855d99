// SPDX-License-Identifier: BSD-3-Clause
// The law of joints: what a joint of the scene fixes of two bodies' velocities after the step, as rows of
// the problem. A row that holds takes GV_JOINT_ERP of its error back in a step, as ODE's joints do (user
// guide, "Joint error and the error reduction parameter"); a limit may close its gap within the step and
// not pass it, as a contact does; a spring is integrated by backward Euler, k = erp / (h cfm) and d = (1 -
// erp) / cfm. Pure; real-time thread.
#include <assert.h>

#include "dynamics/problem.h"

static const double no_bound = HUGE_VAL;
// Bodies that were torn apart come together again, they are not shot.
static const double most_m_s = 1.0;
static const double most_rad_s = 10.0;

// Which row of a joint: its place among GV_JOINT_ROWS.
enum { SLOT_ALONG = 0, SLOT_ABOUT = 3, SLOT_LIMIT = GV_JOINT_HELD, SLOT_FRICTION, SLOT_SPRING };

// ---- where a joint stands -------------------------------------------------------------------------

static gv_vec3 axis_of(gv_quat q) { return gv_rotate(q, gv_v3(1, 0, 0)); }

double gv_joint_position(const gv_joint *joint, gv_pose T_world_a, gv_pose T_world_b) {
  if (joint->kind == GV_JOINT_SLIDER)
    return gv_dot(axis_of(T_world_b.q), gv_sub(T_world_a.p, T_world_b.p));
  if (joint->kind != GV_JOINT_HINGE)
    return 0.0;
  const gv_quat q = gv_quat_mul(gv_quat_conj(T_world_b.q), T_world_a.q);
  const double angle = 2.0 * gv_atan2(q.x, q.w);
  if (angle > GV_PI)
    return angle - 2.0 * GV_PI;
  return angle < -GV_PI ? angle + 2.0 * GV_PI : angle;
}

static gv_problem_joint place_joint(const gv_joint *joint, int body_a, int body_b,
                                    const gv_body_state state[]) {
  gv_problem_joint j = {.joint = joint, .body_a = body_a, .body_b = body_b};
  j.T_world_a = gv_pose_mul(state[body_a].T, joint->T_a_joint);
  j.T_world_b = joint->T_b_joint;
  if (body_b != GV_WORLD)
    j.T_world_b = gv_pose_mul(state[body_b].T, joint->T_b_joint);
  j.position = gv_joint_position(joint, j.T_world_a, j.T_world_b);
  return j;
}

// ---- rows -----------------------------------------------------------------------------------------

static gv_problem_row *add_row(gv_problem *problem, gv_problem_joint *j, int place, gv_vec3 direction) {
  assert(place >= 0 && problem->row_count >= 0);
  assert(problem->row_count < GV_MAX_ROWS && place < GV_JOINT_ROWS);
  gv_problem_row *row = &problem->row[problem->row_count++];
  const int number = (int)(j - problem->joint);
  j->row_count++;
  *row = (gv_problem_row){.body_a = j->body_a,
                          .body_b = j->body_b,
                          .direction = direction,
                          .low = -no_bound,
                          .high = no_bound,
                          .slot = number * GV_JOINT_ROWS + place};
  return row;
}

static gv_vec3 centre_of(const gv_problem *problem, int body) {
  return body == GV_WORLD ? gv_v3(0, 0, 0) : problem->body[body].p;
}

// Along a direction, of the material points of a and b that lie at these places.
static gv_problem_row *add_along(gv_problem *problem, gv_problem_joint *j, int place, gv_vec3 direction,
                                 gv_vec3 point_a, gv_vec3 point_b) {
  gv_problem_row *row = add_row(problem, j, place, direction);
  row->arm_a = gv_sub(point_a, centre_of(problem, j->body_a));
  row->arm_b = gv_sub(point_b, centre_of(problem, j->body_b));
  return row;
}

static gv_problem_row *add_about(gv_problem *problem, gv_problem_joint *j, int place, gv_vec3 direction) {
  gv_problem_row *row = add_row(problem, j, place, direction);
  row->turns = true;
  return row;
}

// The row takes back a part of its error (m or rad).
static void hold(gv_problem_row *row, const gv_config *cfg, double error) {
  const double most = row->turns ? most_rad_s : most_m_s;
  row->target_velocity = gv_clamp(GV_JOINT_ERP * error / cfg->step_s, -most, most);
  row->compliance = cfg->world_cfm / cfg->step_s;
}

// ---- what holds a joint together ------------------------------------------------------------------

static const gv_vec3 world_axis[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};

static void hold_point(gv_problem *problem, const gv_config *cfg, gv_problem_joint *j) {
  const gv_vec3 error = gv_sub(j->T_world_b.p, j->T_world_a.p);
  for (int k = 0; k < 3; k++) {
    gv_problem_row *row = add_along(problem, j, SLOT_ALONG + k, world_axis[k], j->T_world_a.p,
                                    j->T_world_b.p);
    hold(row, cfg, gv_dot(error, world_axis[k]));
  }
}

static void hold_orientation(gv_problem *problem, const gv_config *cfg, gv_problem_joint *j) {
  const gv_vec3 error = gv_quat_log(gv_quat_mul(j->T_world_b.q, gv_quat_conj(j->T_world_a.q)));
  for (int k = 0; k < 3; k++)
    hold(add_about(problem, j, SLOT_ABOUT + k, world_axis[k]), cfg, gv_dot(error, world_axis[k]));
}

// a's axis turns to b's.
static void hold_axis(gv_problem *problem, const gv_config *cfg, gv_problem_joint *j) {
  const gv_vec3 error = gv_cross(axis_of(j->T_world_a.q), axis_of(j->T_world_b.q));
  for (int k = 1; k < 3; k++) {
    const gv_vec3 across = gv_rotate(j->T_world_a.q, world_axis[k]);
    hold(add_about(problem, j, SLOT_ABOUT + k, across), cfg, gv_dot(error, across));
  }
}

// a's point stays on b's axis.
static void hold_line(gv_problem *problem, const gv_config *cfg, gv_problem_joint *j) {
  const gv_vec3 error = gv_sub(j->T_world_b.p, j->T_world_a.p);
  for (int k = 1; k < 3; k++) {
    const gv_vec3 across = gv_rotate(j->T_world_b.q, world_axis[k]);
    gv_problem_row *row = add_along(problem, j, SLOT_ALONG + k, across, j->T_world_a.p, j->T_world_a.p);
    hold(row, cfg, gv_dot(error, across));
  }
}

// ---- along or about the axis ----------------------------------------------------------------------

static gv_problem_row *add_on_axis(gv_problem *problem, gv_problem_joint *j, int place) {
  const gv_vec3 axis = axis_of(j->T_world_b.q);
  if (j->joint->kind == GV_JOINT_HINGE)
    return add_about(problem, j, place, axis);
  return add_along(problem, j, place, axis, j->T_world_a.p, j->T_world_a.p);
}

// The nearer limit alone: a step does not reach both.
static void limit_position(gv_problem *problem, const gv_config *cfg, gv_problem_joint *j) {
  const double above_low = j->position - j->joint->low;
  const double below_high = j->joint->high - j->position;
  const bool is_low = above_low < below_high;
  const double gap = is_low ? above_low : below_high;
  gv_problem_row *row = add_on_axis(problem, j, SLOT_LIMIT);
  hold(row, cfg, -gap);
  if (gap > 0.0)
    row->target_velocity = -gap / cfg->step_s;
  if (is_low) {
    row->low = 0.0;
  } else {
    row->target_velocity = -row->target_velocity;
    row->high = 0.0;
  }
}

static void rub(gv_problem *problem, const gv_config *cfg, gv_problem_joint *j) {
  gv_problem_row *row = add_on_axis(problem, j, SLOT_FRICTION);
  hold(row, cfg, 0.0);
  row->high = j->joint->friction * cfg->step_s;
  row->low = -row->high;
}

static void pull_by_spring(gv_problem *problem, const gv_config *cfg, gv_problem_joint *j) {
  const double h = cfg->step_s;
  const double stiffness = j->joint->spring_stiffness;
  const double all = h * stiffness + j->joint->spring_damping;  // impulse of a step for 1 m/s, over h
  gv_problem_row *row = add_on_axis(problem, j, SLOT_SPRING);
  row->compliance = 1.0 / (h * all);
  row->target_velocity = stiffness / all * (j->joint->spring_rest - j->position);
}

static void state_axis(gv_problem *problem, const gv_config *cfg, gv_problem_joint *j) {
  const gv_joint *joint = j->joint;
  if (joint->has_limits)
    limit_position(problem, cfg, j);
  if (joint->friction > 0.0)
    rub(problem, cfg, j);
  if (joint->spring_stiffness > 0.0 || joint->spring_damping > 0.0)
    pull_by_spring(problem, cfg, j);
}

// ---- all together ---------------------------------------------------------------------------------

static void state_joint(gv_problem *problem, const gv_config *cfg, gv_problem_joint *j) {
  j->row_first = problem->row_count;
  switch (j->joint->kind) {
    case GV_JOINT_FIXED:
      hold_point(problem, cfg, j);
      hold_orientation(problem, cfg, j);
      return;
    case GV_JOINT_BALL: hold_point(problem, cfg, j); return;
    case GV_JOINT_HINGE:
      hold_point(problem, cfg, j);
      hold_axis(problem, cfg, j);
      state_axis(problem, cfg, j);
      return;
    case GV_JOINT_SLIDER:
      hold_line(problem, cfg, j);
      hold_orientation(problem, cfg, j);
      state_axis(problem, cfg, j);
      return;
  }
}

void gv_problem_set_joints(gv_problem *problem, const gv_config *cfg, const gv_scene *scene,
                           const gv_body_state state[], const bool broken[GV_MAX_JOINTS]) {
  assert(scene->joint_count <= GV_MAX_JOINTS);
  problem->joint_count = scene->joint_count;
  problem->row_count = 0;
  for (int i = 0; i < scene->joint_count; i++) {
    gv_problem_joint *j = &problem->joint[i];
    const gv_joint *joint = &scene->joint[i];
    const int other = joint->object_b == GV_WORLD ? GV_WORLD : GV_LIMBS + joint->object_b;
    *j = place_joint(joint, GV_LIMBS + joint->object_a, other, state);
    if (!broken[i] && problem->body[j->body_a].mass > 0.0)
      state_joint(problem, cfg, j);
  }
}

// ---- the fingers ----------------------------------------------------------------------------------

// The ends of two bones in their limbs' frames, x distal.
void gv_finger_joints_init(const gv_hand_model *hand, gv_joint out_joint[GV_FINGER_JOINTS]) {
  for (int i = 0; i < GV_FINGER_JOINTS; i++) {
    const int near = 3 * (i / 2) + i % 2;
    const double end = hand->segment_m[i / 2][i % 2] - gv_hand_half_length(hand, near);
    gv_joint *joint = &out_joint[i];
    *joint = (gv_joint){.kind = GV_JOINT_BALL};
    joint->T_a_joint = (gv_pose){gv_quat_identity(), {-gv_hand_half_length(hand, near + 1), 0, 0}};
    joint->T_b_joint = (gv_pose){gv_quat_identity(), {end, 0, 0}};
  }
}

// The limbs of a finger follow each other in number.
void gv_problem_add_finger_joints(gv_problem *problem, const gv_config *cfg,
                                  const gv_joint joint[GV_FINGER_JOINTS], int first,
                                  const gv_body_state state[]) {
  for (int i = 0; i < GV_FINGER_JOINTS; i++) {
    assert(problem->joint_count < GV_PROBLEM_JOINTS);
    const int near = first + 3 * (i / 2) + i % 2;
    gv_problem_joint *j = &problem->joint[problem->joint_count++];
    *j = place_joint(&joint[i], near + 1, near, state);
    if (problem->body[near].mass > 0.0)
      state_joint(problem, cfg, j);
  }
}

// ---- the answer -----------------------------------------------------------------------------------

static double row_velocity(const gv_problem_row *row, const gv_velocity velocity[]) {
  static const gv_velocity none;
  const gv_velocity *a = &velocity[row->body_a];
  const gv_velocity *b = row->body_b == GV_WORLD ? &none : &velocity[row->body_b];
  if (row->turns)
    return gv_dot(row->direction, gv_sub(a->w, b->w));
  const gv_vec3 at_a = gv_add(a->v, gv_cross(a->w, row->arm_a));
  const gv_vec3 at_b = gv_add(b->v, gv_cross(b->w, row->arm_b));
  return gv_dot(row->direction, gv_sub(at_a, at_b));
}

double gv_problem_joint_force(const gv_problem *problem, int joint, const gv_velocity velocity[]) {
  const gv_problem_joint *j = &problem->joint[joint];
  double sum = 0.0;
  for (int i = j->row_first; i < j->row_first + j->row_count; i++) {
    const gv_problem_row *row = &problem->row[i];
    if (row->slot % GV_JOINT_ROWS >= SLOT_ABOUT)
      continue;
    const double impulse = (row->target_velocity - row_velocity(row, velocity)) / row->compliance;
    sum += impulse * impulse;
  }
  return sqrt(sum) / problem->step_s;
}
