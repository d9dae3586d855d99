// SPDX-License-Identifier: BSD-3-Clause
// Skeleton and trigonometry: against hand-computed poses, the C library, and finite differences.
#include <string.h>

#include "support/check.h"
#include "gloved/hand.h"

static void test_trigonometry_equals_libm(void) {
  double worst_s = 0;
  double worst_a = 0;
  for (int i = -200000; i <= 200000; i++) {
    double a = i * 0.00137, s, c;
    gv_sincos(a, &s, &c);
    worst_s = fmax(worst_s, fmax(fabs(s - sin(a)), fabs(c - cos(a))));
    double y = sin(i * 0.31) * (1 + abs(i) % 7);
    double x = cos(i * 0.17) * (1 + abs(i) % 5);
    worst_a = fmax(worst_a, fabs(gv_atan2(y, x) - atan2(y, x)));
  }
  CHECK(worst_s < 1e-15, "sin, cos off by %g", worst_s);
  CHECK(worst_a < 1e-15, "atan2 off by %g", worst_a);
  CHECK(gv_atan2(0, 0) == 0 && gv_atan2(0, -1) > 3.14, "special values");
}

static void test_rotation_maps_invert(void) {
  unsigned long long r = 7;
  for (int i = 0; i < 10000; i++) {
    gv_vec3 v = gv_v3(check_uniform(&r, -1, 1), check_uniform(&r, -1, 1), check_uniform(&r, -1, 1));
    v = gv_scale(gv_normalize_or(v, gv_v3(1, 0, 0)),
                 i % 3 ? check_uniform(&r, 0, 3.14) : check_uniform(&r, 0, 1e-8));
    gv_vec3 w = gv_quat_log(gv_quat_exp(v));
    CHECK(gv_norm(gv_sub(v, w)) < 1e-13, "log(exp(v)) - v = %g at |v| = %g", gv_norm(gv_sub(v, w)),
          gv_norm(v));
  }
}

static void test_straight_hand(void) {
  gv_hand_model m = gv_hand_model_default(GV_RIGHT);
  gv_pose wrist = gv_pose_identity(), T[GV_LIMBS];
  double angle[GV_SENSORS] = {0};
  gv_hand_frames(&m, &wrist, angle, T);
  // The middle fingertip of a straight hand: base + 47 + 28 + 21 mm along x.
  gv_vec3 tip = gv_transform(T[GV_LIMB_MIDDLE + 2],
                             gv_v3(gv_hand_half_length(&m, GV_LIMB_MIDDLE + 2) + 0.0075, 0, 0));
  CHECK_NEAR(tip.x, 0.0830 + 0.0960, 1e-12);
  CHECK_NEAR(tip.y, 0.0040, 1e-12);
  CHECK_NEAR(tip.z, 0.0, 1e-12);
}

static void test_bent_finger_points_to_the_palm(void) {
  gv_hand_model m = gv_hand_model_default(GV_RIGHT);
  gv_pose wrist = gv_pose_identity(), T[GV_LIMBS];
  double angle[GV_SENSORS] = {0};
  angle[GV_INDEX_MPJ] = 0.5 * GV_PI;
  gv_hand_frames(&m, &wrist, angle, T);
  gv_vec3 along = gv_rotate(T[GV_LIMB_INDEX + 2].q, gv_v3(1, 0, 0));
  CHECK_NEAR(along.z, -1.0, 1e-12);  // -z is palmar
  angle[GV_INDEX_PIJ] = 0.5 * GV_PI;
  gv_hand_frames(&m, &wrist, angle, T);
  gv_vec3 p = T[GV_LIMB_INDEX + 1].p;
  CHECK_NEAR(p.x, 0.0851 - 0.0222 / 2, 1e-12);  // the middle bone runs back towards the wrist
  CHECK_NEAR(p.z, -0.0403, 1e-12);
}

// The straight thumb at 45 degrees of abduction points along x and bends towards
// the finger pads, square to x.
static void test_opposed_thumb(void) {
  gv_hand_model m = gv_hand_model_default(GV_RIGHT);
  gv_pose wrist = gv_pose_identity(), T[GV_LIMBS];
  double angle[GV_SENSORS] = {[GV_THUMB_ABDUCTION] = 0.25 * GV_PI};
  gv_hand_frames(&m, &wrist, angle, T);
  gv_vec3 x = gv_normalize_or(gv_v3(0.30, 0.08, -0.95), gv_v3(1, 0, 0));
  gv_vec3 pads = gv_v3(0.87, -0.42, 0.24);
  gv_vec3 z = gv_neg(gv_normalize_or(gv_mad(pads, -gv_dot(pads, x), x), gv_v3(1, 0, 0)));
  for (int i = 0; i < 3; i++) {
    CHECK(gv_norm(gv_sub(gv_rotate(T[i].q, gv_v3(1, 0, 0)), x)) < 1e-15, "bone %d", i);
    CHECK(gv_norm(gv_sub(gv_rotate(T[i].q, gv_v3(0, 0, 1)), z)) < 1e-15, "back of bone %d", i);
  }
}

// The palm hollows: the little finger's base goes palmar, the ring's half as far, the index stays.
static void test_palm_arch_and_spread(void) {
  gv_hand_model m = gv_hand_model_default(GV_RIGHT);
  gv_pose wrist = gv_pose_identity(), flat[GV_LIMBS], T[GV_LIMBS];
  double angle[GV_SENSORS] = {0};
  gv_hand_frames(&m, &wrist, angle, flat);
  angle[GV_PALM_ARCH] = 0.4;
  gv_hand_frames(&m, &wrist, angle, T);
  CHECK_NEAR(T[GV_LIMB_LITTLE].p.z, -0.0320 * sin(0.4), 1e-12);  // -z is palmar
  CHECK_NEAR(T[GV_LIMB_RING].p.z, -0.0150 * sin(0.2), 1e-12);
  CHECK_NEAR(T[GV_LIMB_INDEX].p.z, flat[GV_LIMB_INDEX].p.z, 1e-12);
  angle[GV_PALM_ARCH] = 0;
  angle[GV_MIDDLE_INDEX_ABDUCTION] = angle[GV_RING_MIDDLE_ABDUCTION] = angle[GV_LITTLE_RING_ABDUCTION] = 0.2;
  // spread: the index towards the thumb (y), ring and little away from it
  gv_hand_frames(&m, &wrist, angle, T);
  CHECK(T[GV_LIMB_INDEX + 2].p.y > flat[GV_LIMB_INDEX + 2].p.y + 0.005, "index");
  CHECK(T[GV_LIMB_RING + 2].p.y < flat[GV_LIMB_RING + 2].p.y - 0.005, "ring");
  CHECK(T[GV_LIMB_LITTLE + 2].p.y < flat[GV_LIMB_LITTLE + 2].p.y - 0.005, "little");
  CHECK_NEAR(T[GV_LIMB_MIDDLE + 2].p.y, flat[GV_LIMB_MIDDLE + 2].p.y, 1e-12);
}

static void test_left_is_the_mirror_image(void) {
  gv_hand_model right = gv_hand_model_default(GV_RIGHT);
  gv_hand_model left = gv_hand_model_default(GV_LEFT);
  gv_pose wrist = gv_pose_identity(), R[GV_LIMBS], L[GV_LIMBS];
  double angle[GV_SENSORS];
  for (int i = 0; i < GV_SENSORS; i++)
    angle[i] = 0.1 + 0.03 * i;
  gv_hand_frames(&right, &wrist, angle, R);
  gv_hand_frames(&left, &wrist, angle, L);
  for (int i = 0; i < GV_LIMBS; i++) {
    gv_vec3 a = gv_transform(R[i], gv_v3(0.01, 0, 0.005));
    gv_vec3 b = gv_transform(L[i], gv_v3(0.01, 0, 0.005));
    CHECK(gv_norm(gv_sub(gv_v3(a.x, -a.y, a.z), b)) < 1e-14, "limb %d", i);
  }
}

// The joint axes are the derivative of the frames: compare with central differences, both hands.
static void check_jacobian(gv_side side) {
  gv_hand_model m = gv_hand_model_default(side);
  gv_pose wrist = {gv_quat_exp(gv_v3(0.3, -0.7, 0.2)), {0.1, 0.2, 0.3}}, A[GV_LIMBS], B[GV_LIMBS];
  gv_joint_axis joint[GV_SENSORS];
  double angle[GV_SENSORS];
  for (int i = 0; i < GV_SENSORS; i++)
    angle[i] = 0.05 + 0.04 * i;
  gv_hand_joints(&m, &wrist, angle, joint);
  const double e = 1e-6;
  for (int s = 0; s < GV_SENSORS; s++) {
    double plus[GV_SENSORS], minus[GV_SENSORS];
    memcpy(plus, angle, sizeof angle);
    memcpy(minus, angle, sizeof angle);
    plus[s] += e;
    minus[s] -= e;
    gv_hand_frames(&m, &wrist, plus, A);
    gv_hand_frames(&m, &wrist, minus, B);
    if (s == GV_PALM_ARCH)
      continue;  // turns the ring by half: not one axis for all its limbs
    for (int l = 0; l < GV_LIMBS; l++) {
      // turns about its own base
      if (s == GV_RING_MIDDLE_ABDUCTION && l >= GV_LIMB_LITTLE && l < GV_LIMB_PALM)
        continue;
      gv_vec3 mid = gv_scale(gv_add(A[l].p, B[l].p), 0.5);
      gv_vec3 v = gv_scale(gv_sub(A[l].p, B[l].p), 0.5 / e);
      gv_vec3 expect = joint[s].limbs >> l & 1 ? gv_cross(joint[s].axis_world, gv_sub(mid, joint[s].p_world))
                                               : gv_v3(0, 0, 0);
      CHECK(gv_norm(gv_sub(v, expect)) < 1e-8, "side %d sensor %s limb %s off by %g", side, gv_sensor_name(s),
            gv_limb_name(l), gv_norm(gv_sub(v, expect)));
    }
  }
}
static void test_joint_axes_are_the_jacobian(void) {
  check_jacobian(GV_RIGHT);
  check_jacobian(GV_LEFT);
}

static void test_calibration_two_points(void) {
  gv_calibration cal = gv_calibration_default();
  CHECK(gv_calibration_check(&cal) == 0, "default is sound");
  CHECK_NEAR(gv_calibration_angle(&cal, 3, 2048), GV_PI / 4, 1e-15);
  CHECK_NEAR(gv_calibration_raw(&cal, 3, gv_calibration_angle(&cal, 3, 77)), 77, 1e-9);
  cal.raw[5][1] = cal.raw[5][0];
  CHECK(gv_calibration_check(&cal) == -6, "two equal points are refused and named");
}

// precision grasps, with the thumb where an import of VirtualHand's roll puts it (tools/trace/table.c)

typedef struct pinch {
  double roll_deg, thumb_deg[2], index_deg[3];  // VirtualHand's roll; MPJ and IJ; MPJ, PIJ, DIJ
} pinch;

// Rotation 25 and abduction 30 at a roll of 99 degrees, 0 and 0 at 39.
static void pose_pinch(const pinch *grasp, gv_pose out_T[GV_LIMBS]) {
  const gv_hand_model m = gv_hand_model_default(GV_RIGHT);
  const gv_pose wrist = gv_pose_identity();
  const double deg = GV_PI / 180;
  const double share = (grasp->roll_deg - 39.0) / 60.0;
  double angle[GV_SENSORS] = {[GV_THUMB_ROTATE] = 25 * share * deg,
                              [GV_THUMB_ABDUCTION] = 30 * share * deg,
                              [GV_THUMB_MPJ] = grasp->thumb_deg[0] * deg,
                              [GV_THUMB_IJ] = grasp->thumb_deg[1] * deg};
  for (int j = 0; j < 3; j++)
    angle[GV_INDEX_MPJ + j] = grasp->index_deg[j] * deg;
  angle[GV_MIDDLE_INDEX_ABDUCTION] = m.angle_min_rad[GV_MIDDLE_INDEX_ABDUCTION];
  gv_hand_frames(&m, &wrist, angle, out_T);
}

// How far the tips are from each other, and how far the pads are from facing each other, degrees.
static void measure_pinch(const pinch *grasp, double *out_apart_m, double *out_pads_deg) {
  const gv_hand_model m = gv_hand_model_default(GV_RIGHT);
  gv_pose T[GV_LIMBS];
  gv_vec3 tip[2], pad[2];
  pose_pinch(grasp, T);
  for (int k = 0; k < 2; k++) {
    const int limb = 3 * k + 2;
    tip[k] = gv_transform(T[limb], gv_v3(gv_hand_half_length(&m, limb) + m.radius_m[k][2], 0, 0));
    pad[k] = gv_rotate(T[limb].q, gv_v3(0, 0, -1));
  }
  *out_apart_m = gv_norm(gv_sub(tip[0], tip[1]));
  *out_pads_deg = acos(gv_clamp(-gv_dot(pad[0], pad[1]), -1, 1)) * 180 / GV_PI;
}

// Tip to tip, at the median roll of recorded grasps: both fingers are bent, so the pads look past each other.
static void test_tips_meet_in_a_tip_pinch(void) {
  static const pinch grasp[] = {
    {99, {10, 10}, {50, 40, 10}}, {99, {10, 10}, {60, 35, 10}}, {99, {10, 10}, {45, 45, 20}}};
  for (int g = 0; g < 3; g++) {
    double apart_m, pads_deg;
    measure_pinch(&grasp[g], &apart_m, &pads_deg);
    printf("# tip pinch %d: tips %.1f mm apart, pads %.0f degrees\n", g, 1e3 * apart_m, pads_deg);
    CHECK(apart_m < 0.025, "grasp %d: tips %.1f mm apart", g, 1e3 * apart_m);
  }
}

// Pad to pad: the last bones straight, within the roll of recordings (39 to 122 degrees).
static void test_pads_meet_in_a_pulp_pinch(void) {
  static const pinch grasp[] = {
    {108, {-10, -15}, {70, 15, 0}}, {106, {-10, -15}, {73, 14, 0}}, {105, {-10, -15}, {75, 12, 0}}};
  for (int g = 0; g < 3; g++) {
    double apart_m, pads_deg;
    measure_pinch(&grasp[g], &apart_m, &pads_deg);
    printf("# pulp pinch %d: tips %.1f mm apart, pads %.0f degrees\n", g, 1e3 * apart_m, pads_deg);
    CHECK(apart_m < 0.025 && pads_deg < 20, "grasp %d: %.1f mm, %.0f degrees", g, 1e3 * apart_m, pads_deg);
  }
}

int main(void) {
  RUN(test_trigonometry_equals_libm);
  RUN(test_rotation_maps_invert);
  RUN(test_straight_hand);
  RUN(test_bent_finger_points_to_the_palm);
  RUN(test_opposed_thumb);
  RUN(test_palm_arch_and_spread);
  RUN(test_left_is_the_mirror_image);
  RUN(test_joint_axes_are_the_jacobian);
  RUN(test_calibration_two_points);
  RUN(test_tips_meet_in_a_tip_pinch);
  RUN(test_pads_meet_in_a_pulp_pinch);
  return check_done();
}
