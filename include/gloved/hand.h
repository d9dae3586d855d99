// SPDX-License-Identifier: BSD-3-Clause
// The hand: 22 joint angles and a wrist pose to the 16 driver frames that the coupling pulls on
// (section A of the paper: fifteen finger limbs and a palm, 22 degrees of freedom).
// Pure functions of their arguments; any thread.
//
// Frames, right hand lying palm down: x distal (towards the fingertips), y radial (towards the
// thumb), z dorsal (out of the back of the hand). A left hand is the mirror image in y.
// A limb's frame sits in the middle of its capsule, x along the bone towards the tip; flexion is
// the positive rotation about the limb's y (x towards -z). The wrist frame sits in the wrist joint;
// the palm's frame in the middle of the palm's box.
#ifndef GLOVED_HAND_H
#define GLOVED_HAND_H

#include <stdint.h>

#include "gloved/limits.h"
#include "gloved/math.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum gv_side { GV_RIGHT = 0, GV_LEFT = 1 } gv_side;

// Sensor order of the 22-sensor CyberGlove. MPJ PIJ DIJ: proximal, middle, distal joint flexion.
typedef enum gv_sensor {
  GV_THUMB_ROTATE,
  GV_THUMB_MPJ,
  GV_THUMB_IJ,
  GV_THUMB_ABDUCTION,
  GV_INDEX_MPJ,
  GV_INDEX_PIJ,
  GV_INDEX_DIJ,
  GV_MIDDLE_MPJ,
  GV_MIDDLE_PIJ,
  GV_MIDDLE_DIJ,
  GV_MIDDLE_INDEX_ABDUCTION,
  GV_RING_MPJ,
  GV_RING_PIJ,
  GV_RING_DIJ,
  GV_RING_MIDDLE_ABDUCTION,
  GV_LITTLE_MPJ,
  GV_LITTLE_PIJ,
  GV_LITTLE_DIJ,
  GV_LITTLE_RING_ABDUCTION,
  GV_PALM_ARCH,
  GV_WRIST_PITCH,
  GV_WRIST_YAW
} gv_sensor;

// Limb index = 3 * finger + segment (0 proximal, 1 middle, 2 distal; the thumb's are metacarpal,
// proximal, distal); the palm is the last.
typedef enum gv_limb {
  GV_LIMB_THUMB = 0,
  GV_LIMB_INDEX = 3,
  GV_LIMB_MIDDLE = 6,
  GV_LIMB_RING = 9,
  GV_LIMB_LITTLE = 12,
  GV_LIMB_PALM = 15
} gv_limb;

// Static names, e.g. "thumb_ij", "index_proximal", "palm"; null beyond the range.
const char *gv_sensor_name(int sensor);
const char *gv_limb_name(int limb);
const char *gv_finger_name(int finger);

// Measures of one hand, metres. Defaults: DESIGN.md, "Hand".
typedef struct gv_hand_model {
  gv_side side;
  double segment_m[GV_FINGERS][3];   // bone lengths, proximal to distal
  double radius_m[GV_FINGERS][3];    // capsule radii
  gv_vec3 base_m[GV_FINGERS];        // first joint of each finger in the wrist frame (right hand)
  gv_vec3 palm_center_m;             // middle of the palm's box in the wrist frame (right hand)
  gv_vec3 palm_half_m;               // half extents of the palm's core box
  double palm_radius_m;              // radius of the sphere that rounds it
  double angle_min_rad[GV_SENSORS];  // anatomy: angles are held inside
  double angle_max_rad[GV_SENSORS];
} gv_hand_model;

gv_hand_model gv_hand_model_default(gv_side side);

// Two points per sensor: raw value and the angle it stands for. Linear between and beyond.
typedef struct gv_calibration {
  double raw[GV_SENSORS][2];
  double angle_rad[GV_SENSORS][2];
} gv_calibration;

// 12-bit counts 0..4095 over [-pi/4, 3 pi/4) radians (1024 is straight), the same for every sensor.
gv_calibration gv_calibration_default(void);
// 0, or the (negative) -1 - sensor of the first sensor whose two points coincide or are not finite.
int gv_calibration_check(const gv_calibration *cal);
// Angle of one raw value, radians. Not limited.
static inline double gv_calibration_angle(const gv_calibration *cal, int sensor, double raw) {
  const double *r = cal->raw[sensor];
  const double *a = cal->angle_rad[sensor];
  return a[0] + (raw - r[0]) * (a[1] - a[0]) / (r[1] - r[0]);
}
// Raw value of an angle: the inverse, not rounded, not limited (used by simulated devices).
double gv_calibration_raw(const gv_calibration *cal, int sensor, double angle_rad);

// 16 driver frames in the world from the angles (radians, order gv_sensor) and the wrist pose.
// Cost: about 1 us. Not-a-number in gives not-a-number out (the caller checks its samples).
void gv_hand_frames(const gv_hand_model *model, const gv_pose *T_world_wrist,
                    const double angle_rad[GV_SENSORS], gv_pose out_T_world_limb[GV_LIMBS]);

// Half length of a limb's core segment (along its x), metres; limb < 15.
double gv_hand_half_length(const gv_hand_model *model, int limb);

// The sensors of the three flexion joints of each finger, from its root to its tip.
extern const int gv_flexion[GV_FINGERS][3];

// Geometric Jacobian columns: world position and unit axis of the joint that `sensor` turns, and
// which limbs it moves (bit per limb). Used to map limb wrenches to joint torques:
// tau = axis . (sum over moved limbs of t + (p_limb - p_joint) x f).
typedef struct gv_joint_axis {
  gv_vec3 p_world, axis_world;
  uint32_t limbs;
} gv_joint_axis;
void gv_hand_joints(const gv_hand_model *model, const gv_pose *T_world_wrist,
                    const double angle_rad[GV_SENSORS], gv_joint_axis out_joint[GV_SENSORS]);
// Both at the cost of one; either may be null.
void gv_hand_pose(const gv_hand_model *model, const gv_pose *T_world_wrist,
                  const double angle_rad[GV_SENSORS], gv_pose out_T_world_limb[GV_LIMBS],
                  gv_joint_axis out_joint[GV_SENSORS]);

// What came in since the last step: raw sensor counts and the tracker's receiver pose. The hand is placed
// once both were seen. A flag that is false: nothing new there, the last value holds (the field is not read).
typedef struct gv_sample {
  double raw[GV_SENSORS];
  gv_pose T_world_receiver;
  bool glove_new, pose_new;
  double tension_n[GV_FINGERS];  // what the device was told to pull with since the last step, 0 or more;
                                 // read where the fingers are observed (gv_finger_model)
} gv_sample;

#ifdef __cplusplus
}
#endif

#endif
