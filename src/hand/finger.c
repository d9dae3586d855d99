// SPDX-License-Identifier: BSD-3-Clause
// Each flexion joint of the user is a mass on a spring and a damper about where the user means it to be
// (Hajian and Howe, J. Biomech. Eng. 119, 1997), and the tendon pulls it open:
//   I d'' + c d' + k d = -r T      (T tension, r moment arm, c = 2 damping_ratio sqrt(k I))
// by backward Euler, which takes energy out at every stiffness and step. Real-time thread; pure.
#include "hand/finger.h"

#include <assert.h>
#include <math.h>

#include "gloved/force.h"

static void step_joint(gv_finger_joint *joint, double k, double inertia, double damping_ratio,
                       double torque_nm, double h) {
  const double c = 2.0 * damping_ratio * sqrt(k * inertia);
  const double impulse = inertia * joint->rate_rad_s + h * (torque_nm - k * joint->bend_rad);
  joint->rate_rad_s = impulse / (inertia + h * c + h * h * k);
  joint->bend_rad += h * joint->rate_rad_s;
}

void gv_fingers_step(gv_fingers *fingers, const gv_finger_model *model, const double tension_n[GV_FINGERS],
                     double h) {
  assert(h > 0.0);
  for (int f = 0; f < GV_FINGERS; f++) {
    int sensor[3];
    double arm_m[3];
    const int joints = gv_tendon_joints(f, sensor, arm_m);
    assert(tension_n[f] >= 0.0);
    for (int j = 0; j < joints; j++)
      step_joint(&fingers->joint[f][j], model->stiffness[j], model->inertia[j], model->damping_ratio,
                 -arm_m[j] * tension_n[f], h);
  }
}

void gv_fingers_bend(const gv_fingers *fingers, double out_bend_rad[GV_SENSORS]) {
  for (int i = 0; i < GV_SENSORS; i++)
    out_bend_rad[i] = 0.0;
  for (int f = 0; f < GV_FINGERS; f++)
    for (int j = 0; j < 3; j++)
      out_bend_rad[gv_flexion[f][j]] = fingers->joint[f][j].bend_rad;
}
