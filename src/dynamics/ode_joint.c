// SPDX-License-Identifier: BSD-3-Clause
// Joints of a scene as ODE's own (user guide, "Joint types", "Stops and motor parameters"): fixed, ball,
// hinge, slider, with stops for limits, a motor of velocity 0 for friction, and beside it a motor without
// a limit of force for the spring, whose CFM is the spring's. ODE finds a joint's errors from what it
// keeps when the joint is made. So body a is led to where the joint has none, the joint is made there,
// and a is led back. Real-time thread.
#include "dynamics/ode_joint.h"

typedef void set_parameter(dJointID joint, int parameter, dReal value);

static dQuaternion *put_quat(dQuaternion *out, gv_quat q) {
  (*out)[0] = q.w;
  (*out)[1] = q.x;
  (*out)[2] = q.y;
  (*out)[3] = q.z;
  return out;
}

static void place(dBodyID body, gv_quat q, gv_vec3 p) {
  dQuaternion turn;
  dBodySetQuaternion(body, *put_quat(&turn, q));
  dBodySetPosition(body, p.x, p.y, p.z);
}

// Where a would be if the joint stood at zero.
static void lead_to_zero(dBodyID a, gv_vec3 centre, const gv_problem_joint *j) {
  const gv_quat turn = gv_quat_mul(j->T_world_b.q, gv_quat_conj(j->T_world_a.q));
  const gv_vec3 arm = gv_rotate(turn, gv_sub(centre, j->T_world_a.p));
  place(a, gv_quat_normalize(turn), gv_add(j->T_world_b.p, arm));
}

static void set_axis(dJointID made, const gv_joint *joint, double cfm, set_parameter *set) {
  set(made, dParamStopERP, GV_JOINT_ERP);
  set(made, dParamStopCFM, cfm);
  set(made, dParamVel, 0.0);
  set(made, dParamFMax, joint->friction);
  if (!joint->has_limits)
    return;
  set(made, dParamLoStop, joint->low);
  set(made, dParamHiStop, joint->high);
}

static void make(dWorldID world, dJointGroupID group, dBodyID a, dBodyID b, const gv_problem_joint *j,
                 double cfm) {
  const gv_vec3 p = j->T_world_b.p;
  const gv_vec3 axis = gv_rotate(j->T_world_b.q, gv_v3(1, 0, 0));
  dJointID made;
  switch (j->joint->kind) {
    case GV_JOINT_FIXED:
      made = dJointCreateFixed(world, group);
      dJointAttach(made, a, b);
      dJointSetFixed(made);
      return;
    case GV_JOINT_BALL:
      made = dJointCreateBall(world, group);
      dJointAttach(made, a, b);
      dJointSetBallAnchor(made, p.x, p.y, p.z);
      return;
    case GV_JOINT_HINGE:
      made = dJointCreateHinge(world, group);
      dJointAttach(made, a, b);
      dJointSetHingeAnchor(made, p.x, p.y, p.z);
      dJointSetHingeAxis(made, axis.x, axis.y, axis.z);
      set_axis(made, j->joint, cfm, dJointSetHingeParam);
      return;
    case GV_JOINT_SLIDER:
      made = dJointCreateSlider(world, group);
      dJointAttach(made, a, b);
      dJointSetSliderAxis(made, axis.x, axis.y, axis.z);
      set_axis(made, j->joint, cfm, dJointSetSliderParam);
      return;
  }
}

static void put_spring(dWorldID world, dJointGroupID group, dBodyID a, dBodyID b, const gv_problem *problem,
                       const gv_problem_joint *j) {
  // The spring's is the joint's last row.
  const gv_problem_row *row = &problem->row[j->row_first + j->row_count - 1];
  const gv_vec3 d = row->direction;
  const bool turns = row->turns;
  dJointID motor = turns ? dJointCreateAMotor(world, group) : dJointCreateLMotor(world, group);
  set_parameter *set = turns ? dJointSetAMotorParam : dJointSetLMotorParam;
  dJointAttach(motor, a, b);
  if (turns) {
    dJointSetAMotorNumAxes(motor, 1);
    dJointSetAMotorAxis(motor, 0, 0, d.x, d.y, d.z);
  } else {
    dJointSetLMotorNumAxes(motor, 1);
    dJointSetLMotorAxis(motor, 0, 0, d.x, d.y, d.z);
  }
  set(motor, dParamVel, row->target_velocity);
  set(motor, dParamFMax, dInfinity);
  set(motor, dParamCFM, row->compliance * problem->step_s);
}

void gv_ode_put_joint(dWorldID world, dJointGroupID group, dBodyID a, dBodyID b, const gv_problem *problem,
                      const gv_problem_joint *j) {
  const gv_vec3 centre = problem->body[j->body_a].p;
  const double cfm = problem->row[j->row_first].compliance * problem->step_s;
  dWorldSetERP(world, GV_JOINT_ERP);
  dWorldSetCFM(world, cfm);
  lead_to_zero(a, centre, j);
  make(world, group, a, b, j, cfm);
  place(a, gv_quat_identity(), centre);
  if (j->joint->spring_stiffness > 0.0 || j->joint->spring_damping > 0.0)
    put_spring(world, group, a, b, problem, j);
}
