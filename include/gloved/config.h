// SPDX-License-Identifier: BSD-3-Clause
// What an engine is set to: plain data that every part of it reads and none writes. Defaults, presets and
// checks are in engine.h.
#ifndef GLOVED_CONFIG_H
#define GLOVED_CONFIG_H

#include "gloved/hand.h"
#include "gloved/narrow.h"
#include "gloved/scene.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum gv_rotation_law { GV_ROTATION_LOG, GV_ROTATION_PAPER } gv_rotation_law;
// newton: ours, exact. dantzig: ODE's exact one, solved again until its friction is Coulomb's. quickstep:
// ODE's iterative one. Where the one that was asked for has no answer within its share of the period,
// quickstep does the step. auto: newton; what it leaves goes to dantzig where that fits, else to quickstep.
typedef enum gv_solver {
  GV_SOLVER_AUTO,
  GV_SOLVER_NEWTON,
  GV_SOLVER_DANTZIG,
  GV_SOLVER_QUICKSTEP,
  GV_SOLVERS
} gv_solver;
const char *gv_solver_name(gv_solver solver);  // "auto", "newton", ...

// Spring-damper of one limb (Eqn 1, 2), integrated by backward Euler.
typedef struct gv_coupling {
  double k_f;  // N/m
  double d_f;  // N s/m; below 0: critical damping 2 sqrt(k m)
  double k_t;  // N m/rad in the log law; in the paper's law the small-angle stiffness is 2 k_t
  double d_t;  // N m s/rad; below 0: critical damping of the mean inertia
} gv_coupling;

// A second hand in the same world: couplings, masses, filter and skin are the first one's.
typedef struct gv_second_hand {
  bool present;
  gv_hand_model hand;
  gv_calibration calibration;
  gv_pose T_receiver_wrist;
} gv_second_hand;

// The user's fingers between intention and glove: springs with mass at the three flexion joints of each,
// from proximal to distal. Observed: the bend that the commanded tension makes is added at once, and what the
// glove shows of it later is taken off again. At rest the angle is the glove's, however wrong these are.
typedef struct gv_finger_model {
  bool observed;
  double stiffness[3];  // N m/rad
  double inertia[3];    // kg m^2
  double damping_ratio;
} gv_finger_model;

typedef struct gv_config {
  double step_s;    // integration step h
  double period_s;  // of the loop that calls the step: the solvers' time is a share of it;
                    // 0: step_s
  gv_hand_model hand;
  gv_calibration calibration;
  gv_pose T_receiver_wrist;  // wrist joint seen from the tracker's receiver
  gv_second_hand second;
  double limb_mass_kg, palm_mass_kg;
  gv_coupling limb, palm;
  gv_rotation_law rotation_law;
  bool limb_gravity;        // gravity acts on the limbs' own mass (the paper's world has it)
  bool finger_joints;       // ball joints between the limbs of a finger hold its bones' ends together; the
                            // paper's limbs have none, and a far one can end up behind an object
  double filter_hz;         // highest corner of the critically damped sample filter; 0: off. Delay 1
                            // / (pi corner)
  double filter_rest_hz;    // corner for what stands still; it goes up with speed, to filter_hz at
                            // 0.64 rad/s or 0.29 m/s. 0: filter_hz always
  double gate_rad_s;        // a joint that is faster than this from one sample to the next (10 ms at
                            // the least) is held back until a second sample agrees; 0: off
  double gate_m_s;          // the same for the tracker's position (its orientation goes by gate_rad_s)
  double prediction_s;      // extrapolate the filtered hand by this much along its velocity; 0: off,
                            // as without the filter
  gv_finger_model finger;   // what is known of the user's fingers
  double operations_per_s;  // counted operations of collision detection that this machine does in a
                            // second: the process measures it at start, a replay takes the default,
                            // so that it does not depend on the machine
  // contact
  gv_narrow narrow;                 // which narrow phase finds distances and depths
  gv_friction friction;             // of the hand's skin
  double mu_hand;                   // coefficient, or newtons
  double patch_m;                   // radius of the patch in which the skin touches: friction against turning
                                    // about the normal, up to 2/3 mu patch_m times the normal force (evenly
                                    // pressed; Howe and Cutkosky 1996); 0: a point, which holds no turn
  double contact_erp, contact_cfm;  // on the normal row alone
  double world_cfm;                 // of friction rows, and of ODE's world; never 0
  double contact_margin_m;          // gaps below this get a row that lets them close, but not overshoot
  // dynamics
  gv_solver solver;
  double rest_s;  // an object that lies still for so long and touches no limb is not
                  // simulated, and has no contacts, until something that moves comes near;
                  // 0: off
  // the paper's Table 1 in place of the scene's own values; 0 or false: as the scene says
  double override_gravity_m_s2, override_mass_kg;
  double override_mu;  // for every contact, in the model `friction`
  bool override_sphere_inertia;
} gv_config;

#ifdef __cplusplus
}
#endif

#endif
