// SPDX-License-Identifier: BSD-3-Clause
// Limb wrenches to tendon tensions by virtual work, and how fast these may rise. Real-time thread.
#include "gloved/force.h"

#include <assert.h>

// The exoskeleton lifts the fingertip, square to its pad: the arms are about the distances from the tip to
// the joints of a half-bent finger, so that a tension of 1 N is felt as about 1 N at the tip.
static const double arm_m[GV_FINGERS][3] = {{0.075, 0.050, 0.022},
                                            {0.065, 0.038, 0.018},
                                            {0.075, 0.045, 0.019},
                                            {0.070, 0.045, 0.020},
                                            {0.055, 0.035, 0.018}};

_Static_assert(GV_LIMBS == 3 * GV_FINGERS + 1, "three limbs a finger, then the palm");

int gv_tendon_joints(int finger, int out_sensor[3], double out_arm_m[3]) {
  if (finger < 0 || finger >= GV_FINGERS)
    return 0;
  for (int j = 0; j < 3; j++) {
    out_sensor[j] = gv_flexion[finger][j];
    out_arm_m[j] = arm_m[finger][j];
  }
  return 3;
}

void gv_tendon_way(const double angle_rad[GV_SENSORS], double out_way_m[GV_FINGERS]) {
  for (int finger = 0; finger < GV_FINGERS; finger++) {
    out_way_m[finger] = 0.0;
    for (int j = 0; j < 3; j++)
      out_way_m[finger] += arm_m[finger][j] * angle_rad[gv_flexion[finger][j]];
  }
}

void gv_tendon_map(const gv_joint_axis joint[GV_SENSORS], const gv_pose T_world_limb[GV_LIMBS],
                   const gv_vec3 f_limb[GV_LIMBS], const gv_vec3 t_limb[GV_LIMBS],
                   double out_tension_n[GV_FINGERS]) {
  for (int finger = 0; finger < GV_FINGERS; finger++) {
    // all that acts on the limbs from a joint on, torque about the joint
    gv_vec3 f = gv_v3(0, 0, 0);
    gv_vec3 t = f;
    gv_vec3 at = f;
    double work = 0.0;
    double arms = 0.0;
    for (int j = 2; j >= 0; j--) {
      const gv_joint_axis *a = &joint[gv_flexion[finger][j]];
      const int limb = 3 * finger + j;
      const double arm = arm_m[finger][j];
      if (j < 2)
        t = gv_add(t, gv_cross(gv_sub(at, a->p_world), f));
      at = a->p_world;
      f = gv_add(f, f_limb[limb]);
      t = gv_add(gv_add(t, t_limb[limb]), gv_cross(gv_sub(T_world_limb[limb].p, at), f_limb[limb]));
      work -= arm * gv_dot(a->axis_world, t);  // what bends the joint further, less than nothing
      arms += arm * arm;
    }
    double tension = work / arms;
    out_tension_n[finger] = tension > 0.0 ? tension : 0.0;  // a tendon only pulls; not-a-number becomes 0
  }
}

// The tip's way is asked for where a tension rises by more than it may anyway, which is seldom.
static double follow(double asked_n, double last_n, gv_vec3 tip_moved_m, double k_n_m, double anyway_n) {
  if (!(asked_n - last_n > anyway_n) || !isfinite(asked_n))
    return asked_n;
  return fmin(asked_n, last_n + anyway_n + k_n_m * gv_norm(tip_moved_m));
}

void gv_tendon_follow(const double asked_n[GV_FINGERS], const gv_vec3 tip_moved_m[GV_FINGERS], double k_n_m,
                      double dt_s, double felt_n[GV_FINGERS]) {
  assert(k_n_m >= 0.0 && dt_s > 0.0);
  for (int i = 0; i < GV_FINGERS; i++)
    felt_n[i] = follow(asked_n[i], felt_n[i], tip_moved_m[i], k_n_m, GV_RISE_N_PER_S * dt_s);
}
