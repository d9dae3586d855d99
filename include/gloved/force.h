// SPDX-License-Identifier: BSD-3-Clause
// The way of a force to the person: limb coupling wrenches to tendon tensions, and the one limiter
// that every force leaves through. Pure; the real-time thread calls both.
#ifndef GLOVED_FORCE_H
#define GLOVED_FORCE_H

#include "gloved/hand.h"
#include "gloved/setting.h"

#ifdef __cplusplus
extern "C" {
#endif

// Tension of each finger's tendon, newtons, from the wrenches that the person's limbs should feel
// (the opposite of the coupling's force and torque on the simulated limbs).
// Joint torques tau_j = a_j . sum(t + (p_limb - p_j) x f) over the finger's flexion joints; a tendon along
// the back of the finger extends joint j with moment arm r_j; the tension that does the same work, least
// squares over the joints, is T = sum(r_j tau_ext_j) / sum(r_j^2), and a tendon only pulls: max(0, T).
void gv_tendon_map(const gv_joint_axis joint[GV_SENSORS], const gv_pose T_world_limb[GV_LIMBS],
                   const gv_vec3 f_limb[GV_LIMBS], const gv_vec3 t_limb[GV_LIMBS],
                   double out_tension_n[GV_FINGERS]);
// What a person may feel of them: a tension rises in a step of dt_s by at most k_n_m (the coupling's k_f)
// times the way of the fingertip's driver in that step and by GV_RISE_N_PER_S dt_s, and falls at once. So
// what no motion explains is no jolt: a touch's damper, an edge that a finger slides over, another solver,
// another coupling. felt_n: of the last step, then of this one, never above asked_n; what is not finite is
// passed on. Cost: 100 instructions.
#define GV_RISE_N_PER_S 50.0  // 0.05 N in a millisecond: a change that a person just notices at rest
void gv_tendon_follow(const double asked_n[GV_FINGERS], const gv_vec3 tip_moved_m[GV_FINGERS], double k_n_m,
                      double dt_s, double felt_n[GV_FINGERS]);
// The flexion joints of a finger (sensor numbers) and the tendon's moment arms there, metres.
int gv_tendon_joints(int finger, int out_sensor[3], double out_arm_m[3]);

// How far each finger's tendon is drawn out by its joints, metres: sum(r_j q_j) of 22 angles, rad. It grows
// as the finger bends; a tension T does the work -T dx on the person.
void gv_tendon_way(const double angle_rad[GV_SENSORS], double out_way_m[GV_FINGERS]);

typedef struct gv_limiter_config {
  double max_n;                     // of every channel (CyberGrasp: 12)
  double finger_max_n[GV_FINGERS];  // of each channel, where lower
  double pretension_n;  // the least pull while forces may leave, so that no tendon hangs slack; 0: none
  double slew_n_per_s;  // the fastest a force may rise; falling is never slowed except by ramp_s
  double ramp_s;        // full force to zero when doubt arises
  double max_age_s;     // of the newest sample behind the force
} gv_limiter_config;

gv_limiter_config gv_limiter_config_default(void);
// The members with their hard bounds (src/safety/bounds.c). Null when all are within, else the first name.
enum { GV_LIMITER_SETTINGS = 6 };
extern const gv_setting gv_limiter_settings[GV_LIMITER_SETTINGS];
const char *gv_limiter_check(const gv_limiter_config *cfg);

typedef enum gv_limiter_flag {
  GV_LIMITER_VALUE = 1 << 0,
  GV_LIMITER_SLEW = 1 << 1,
  GV_LIMITER_AGE = 1 << 2,
  GV_LIMITER_NOT_FINITE = 1 << 3,
  GV_LIMITER_DISABLED = 1 << 4
} gv_limiter_flag;

typedef struct gv_limiter {
  gv_limiter_config cfg;
  double longest_rise_s;  // a command that comes later rises by no more than this time allows; 0: no
                          // such bound
  double out_n[GV_FINGERS];
} gv_limiter;

void gv_limiter_init(gv_limiter *limiter, const gv_limiter_config *cfg);
// One command, dt_s after the last. enabled false, an age over its limit or not finite, or any
// not-finite force: all five ramp to zero within ramp_s. Returns gv_limiter_flag bits. out is in [0,
// min(max_n, finger_max_n)], always finite.
unsigned gv_limiter_step(gv_limiter *limiter, const double desired_n[GV_FINGERS], bool enabled, double age_s,
                         double dt_s, double out_n[GV_FINGERS]);

#ifdef __cplusplus
}
#endif

#endif
