// SPDX-License-Identifier: BSD-3-Clause
// The contact problem of one step: all that a contact solver may know. Find the velocities v of the bodies
// and the impulses x of the contacts, on body a, with
//
//   M (v - v_free) = J^T x + G^T y         each body by the impulses on it
//   u = J v                                of a over b at each contact, in the contact's frame (n, t1, t2)
//   0 <= x_n | u_n + c_n x_n - target >= 0 one of the two is zero
//   c_t x_t + u_t = 0                      where friction holds (sticking); else (sliding) x_t is at its
//                                          bound and opposes c_t x_t + u_t
//
//   low <= y <= high, g = G v              rows of joints: g + c y = target where y is inside its bounds,
//                                          no less than target at low, no more at high
//
//   |t| <= 2/3 mu R x_n                    torque about n, N m s, against the turn of a over b, in a patch
//                                          of radius R that is pressed evenly; none where R is 0
//
// Bound of friction: |x_t| <= mu x_n (Coulomb's law), or |x_t1|, |x_t2| <= limit (a fixed limit, Eqn 10 as
// ODE means it). With target = erp depth / h and c = cfm / h a row is the one that ODE calls by its ERP and
// CFM; 1 / (c h) is the stiffness of an implicit spring. Contacts become the problem in problem.c, which
// alone knows the contact law.
#ifndef DYNAMICS_PROBLEM_H
#define DYNAMICS_PROBLEM_H

#include <stdbool.h>

#include "base/body_state.h"
#include "gloved/config.h"

// A body in world axes. Numbers 0 to GV_LIMBS - 1, and those of a second hand, are limbs, whose inertia is
// the same about every axis.
typedef struct gv_problem_body {
  double mass;      // kg; 0: does not move (then inertia is not read, and v = w = 0)
  gv_mat3 inertia;  // kg m^2, about the centre of mass, world axes
  gv_vec3 p;        // centre of mass, m
  gv_vec3 v, w;     // m/s and rad/s after the step, if there were no contacts
} gv_problem_body;

typedef struct gv_problem_contact {
  int body_a, body_b;         // two different ones; a moves
  gv_vec3 point;              // world, m
  gv_vec3 frame[3];           // orthonormal: normal, from b to a; tangents, the first along the coming slip
  double target_velocity;     // along the normal, m/s: above 0 out of a penetration, below 0 lets a gap close
  double normal_compliance;   // c_n: m/s that an impulse of 1 N s yields; above 0
  double tangent_compliance;  // c_t, of both tangents; above 0
  gv_friction friction;       // law
  double mu;                  // Coulomb's coefficient; 0 with a fixed limit
  double friction_limit;      // of each tangent, N s, with a fixed limit; else 0
  double patch;               // R, m; 0: a point
} gv_problem_contact;

// One scalar condition between two bodies: velocity of a against b along a direction at a point, or about it.
typedef struct gv_problem_row {
  int body_a, body_b;      // a moves; b: GV_WORLD, or any other
  bool turns;              // about the direction, else along it
  gv_vec3 direction;       // unit, world
  gv_vec3 arm_a, arm_b;    // from each body's centre to the point, m; not of one that turns
  double target_velocity;  // m/s or rad/s
  double compliance;       // m/s for 1 N s, or rad/s for 1 N m s; above 0
  double low, high;        // bounds of the impulse on a, N s or N m s; may be infinite
  int slot;                // the same row has the same number in every step: below GV_MAX_ROWS
} gv_problem_row;

// A joint as it stands in this step, for whoever has joints of their own; its rows say the same.
typedef struct gv_problem_joint {
  const gv_joint *joint;
  int body_a, body_b;            // b: or GV_WORLD
  gv_pose T_world_a, T_world_b;  // the joint's frame as each body carries it
  double position;               // of hinge and slider
  int row_first, row_count;
} gv_problem_joint;

enum {
  GV_JOINT_HELD = 6,                  // rows that hold a joint together, at most
  GV_JOINT_ROWS = 9,                  // with limit, friction and spring
  GV_FINGER_JOINTS = 2 * GV_FINGERS,  // of a hand, where its limbs are joined
  GV_PROBLEM_JOINTS = GV_MAX_JOINTS + GV_HANDS * GV_FINGER_JOINTS,
  GV_MAX_ROWS = GV_PROBLEM_JOINTS * GV_JOINT_ROWS
};

typedef struct gv_problem {
  double step_s;    // h
  double budget_s;  // time that one solver may take, reckoned in operations, never by a clock
  int body_count, contact_count;
  int second_hand;  // where its limbs begin, the last bodies; 0 or body_count: there is none
  gv_problem_body body[GV_BODIES];
  gv_problem_contact contact[GV_MAX_CONTACTS];
  int joint_count, row_count;
  gv_problem_joint joint[GV_PROBLEM_JOINTS];  // the scene's, then the fingers'
  gv_problem_row row[GV_MAX_ROWS];
} gv_problem;

// Torque about the normal for a normal force, m; and of the patch's shear, what the tangents' compliance is
// to its turn, 1/m^2: the mean square of a radius in the patch is half of R^2.
static inline double gv_patch_arm(const gv_problem_contact *c) { return 2.0 / 3.0 * c->mu * c->patch; }
static inline double gv_patch_give(const gv_problem_contact *c) { return 2.0 / (c->patch * c->patch); }

// Of one body after the step.
typedef struct gv_velocity {
  gv_vec3 v, w;
} gv_velocity;

// A contact as collision detection finds it.
typedef struct gv_dynamics_contact {
  int body_a, body_b;                      // normal points from b to a; a is never static
  gv_vec3 position, normal, friction_dir;  // world; friction_dir unit, at right angles to the normal
  double depth;                            // metres; negative: gap, which the step may close but not pass
  gv_friction friction;
  double mu;     // coefficient, or newtons with GV_FRICTION_FIXED_LIMIT
  double patch;  // radius, m; 0: a point
} gv_dynamics_contact;

// The contact law: states contacts[] as a problem whose bodies, step and budget are there already. What is
// not finite, has no unit normal, or whose body a does not move, is left out. out_index[i]: which of
// `contact` became the problem's i-th.
void gv_problem_set_contacts(gv_problem *problem, const gv_config *cfg, const gv_dynamics_contact contact[],
                             int count, int out_index[]);

// The law of joints (joint.c): states those of the scene that are not broken as rows. state: of every body,
// with poses of this step; the problem's bodies and step are there already.
void gv_problem_set_joints(gv_problem *problem, const gv_config *cfg, const gv_scene *scene,
                           const gv_body_state state[], const bool broken[GV_MAX_JOINTS]);
// Adds the ball joints between the limbs of each finger, as the hand's bones have them. first: the hand's
// first body.
void gv_finger_joints_init(const gv_hand_model *hand, gv_joint out_joint[GV_FINGER_JOINTS]);
void gv_problem_add_finger_joints(gv_problem *problem, const gv_config *cfg,
                                  const gv_joint joint[GV_FINGER_JOINTS], int first,
                                  const gv_body_state state[]);
// The part of a position error that a step takes back, as ODE has it.
#define GV_JOINT_ERP 0.2
// Force across a joint of this step, N: of the rows that hold its bodies together,
// from the answer's velocities.
double gv_problem_joint_force(const gv_problem *problem, int joint, const gv_velocity velocity[]);
// Position of a hinge (rad, -pi to pi) or slider (m); 0 of the others.
double gv_joint_position(const gv_joint *joint, gv_pose T_world_a, gv_pose T_world_b);

#endif
