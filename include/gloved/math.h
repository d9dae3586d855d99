// SPDX-License-Identifier: BSD-3-Clause
// Vectors, quaternions, poses. Double precision, SI units, right-handed, quaternions w first and of
// unit length. `T_a_b` (gv_pose) is the pose of frame b in frame a: p_a = T_a_b * p_b.
//
// Trigonometry is our own (+ - * / sqrt only): the C library picks other code for it on other
// processors, and a recorded grasp must replay to the same bits everywhere.
#ifndef GLOVED_MATH_H
#define GLOVED_MATH_H

#include <math.h>
#include <stdbool.h>

#ifdef __cplusplus
extern "C" {
#endif

#define GV_PI 3.14159265358979323846

typedef struct gv_vec3 {
  double x, y, z;
} gv_vec3;
typedef struct gv_quat {
  double w, x, y, z;
} gv_quat;
typedef struct gv_pose {
  gv_quat q;
  gv_vec3 p;
} gv_pose;
typedef struct gv_mat3 {
  double m[3][3];
} gv_mat3;  // row-major

static inline gv_vec3 gv_v3(double x, double y, double z) { return (gv_vec3){x, y, z}; }
static inline gv_vec3 gv_add(gv_vec3 a, gv_vec3 b) { return gv_v3(a.x + b.x, a.y + b.y, a.z + b.z); }
static inline gv_vec3 gv_sub(gv_vec3 a, gv_vec3 b) { return gv_v3(a.x - b.x, a.y - b.y, a.z - b.z); }
static inline gv_vec3 gv_scale(gv_vec3 a, double s) { return gv_v3(a.x * s, a.y * s, a.z * s); }
static inline gv_vec3 gv_neg(gv_vec3 a) { return gv_v3(-a.x, -a.y, -a.z); }
static inline gv_vec3 gv_mad(gv_vec3 a, double s, gv_vec3 b) {  // a + s b
  return gv_v3(a.x + s * b.x, a.y + s * b.y, a.z + s * b.z);
}
static inline double gv_dot(gv_vec3 a, gv_vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
static inline gv_vec3 gv_cross(gv_vec3 a, gv_vec3 b) {
  return gv_v3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
}
static inline double gv_norm2(gv_vec3 a) { return gv_dot(a, a); }
static inline double gv_norm(gv_vec3 a) { return sqrt(gv_dot(a, a)); }
static inline double gv_clamp(double v, double lo, double hi) {  // two selections, no branch
  double above = v < lo ? lo : v;
  return above > hi ? hi : above;
}
static inline bool gv_v3_finite(gv_vec3 a) { return isfinite(a.x) && isfinite(a.y) && isfinite(a.z); }

// a / |a|, or `fallback` where |a| is below 1e-300 or not finite.
static inline gv_vec3 gv_normalize_or(gv_vec3 a, gv_vec3 fallback) {
  double n = gv_norm(a);
  return n > 1e-300 && isfinite(n) ? gv_scale(a, 1.0 / n) : fallback;
}
// Some unit vector at right angles to the unit vector n (deterministic).
static inline gv_vec3 gv_any_perpendicular(gv_vec3 n) {
  gv_vec3 a = fabs(n.x) < 0.6 ? gv_v3(1, 0, 0) : gv_v3(0, 1, 0);
  return gv_normalize_or(gv_cross(n, a), gv_v3(0, 0, 1));
}

static inline gv_quat gv_quat_identity(void) { return (gv_quat){1, 0, 0, 0}; }
static inline gv_quat gv_quat_conj(gv_quat q) { return (gv_quat){q.w, -q.x, -q.y, -q.z}; }
static inline gv_quat gv_quat_mul(gv_quat a, gv_quat b) {
  return (gv_quat){
    a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z, a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
    a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x, a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w};
}
static inline gv_vec3 gv_rotate(gv_quat q, gv_vec3 v) {
  gv_vec3 u = gv_v3(q.x, q.y, q.z);
  gv_vec3 t = gv_scale(gv_cross(u, v), 2.0);
  return gv_add(gv_mad(v, q.w, t), gv_cross(u, t));
}
static inline gv_vec3 gv_rotate_inv(gv_quat q, gv_vec3 v) { return gv_rotate(gv_quat_conj(q), v); }
static inline bool gv_quat_finite(gv_quat q) {
  return isfinite(q.w) && isfinite(q.x) && isfinite(q.y) && isfinite(q.z);
}
// q / |q|; the identity where q has no direction (zero or not finite).
static inline gv_quat gv_quat_normalize(gv_quat q) {
  double n = sqrt(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z);
  if (!(n > 1e-300) || !isfinite(n))
    return gv_quat_identity();
  return (gv_quat){q.w / n, q.x / n, q.y / n, q.z / n};
}

static inline gv_pose gv_pose_identity(void) { return (gv_pose){{1, 0, 0, 0}, {0, 0, 0}}; }
static inline gv_vec3 gv_transform(gv_pose T_a_b, gv_vec3 p_b) {
  return gv_add(gv_rotate(T_a_b.q, p_b), T_a_b.p);
}
static inline gv_vec3 gv_transform_inv(gv_pose T_a_b, gv_vec3 p_a) {
  return gv_rotate_inv(T_a_b.q, gv_sub(p_a, T_a_b.p));
}
static inline gv_pose gv_pose_mul(gv_pose T_a_b, gv_pose T_b_c) {
  return (gv_pose){gv_quat_mul(T_a_b.q, T_b_c.q), gv_transform(T_a_b, T_b_c.p)};
}
static inline gv_pose gv_pose_inv(gv_pose T_a_b) {
  gv_quat c = gv_quat_conj(T_a_b.q);
  return (gv_pose){c, gv_neg(gv_rotate(c, T_a_b.p))};
}
static inline bool gv_pose_finite(gv_pose T) { return gv_quat_finite(T.q) && gv_v3_finite(T.p); }

static inline gv_mat3 gv_mat3_from_quat(gv_quat q) {
  double xx = q.x * q.x;
  double yy = q.y * q.y;
  double zz = q.z * q.z;
  double xy = q.x * q.y;
  double xz = q.x * q.z;
  double yz = q.y * q.z;
  double wx = q.w * q.x;
  double wy = q.w * q.y;
  double wz = q.w * q.z;
  return (gv_mat3){{{1 - 2 * (yy + zz), 2 * (xy - wz), 2 * (xz + wy)},
                    {2 * (xy + wz), 1 - 2 * (xx + zz), 2 * (yz - wx)},
                    {2 * (xz - wy), 2 * (yz + wx), 1 - 2 * (xx + yy)}}};
}
static inline gv_vec3 gv_mat3_mul(const gv_mat3 *R, gv_vec3 v) {
  return gv_v3(R->m[0][0] * v.x + R->m[0][1] * v.y + R->m[0][2] * v.z,
               R->m[1][0] * v.x + R->m[1][1] * v.y + R->m[1][2] * v.z,
               R->m[2][0] * v.x + R->m[2][1] * v.y + R->m[2][2] * v.z);
}
static inline gv_vec3 gv_mat3_mul_t(const gv_mat3 *R, gv_vec3 v) {  // R^T v
  return gv_v3(R->m[0][0] * v.x + R->m[1][0] * v.y + R->m[2][0] * v.z,
               R->m[0][1] * v.x + R->m[1][1] * v.y + R->m[2][1] * v.z,
               R->m[0][2] * v.x + R->m[1][2] * v.y + R->m[2][2] * v.z);
}
static inline gv_vec3 gv_mat3_column(const gv_mat3 *K, int k) {
  return gv_v3(K->m[0][k], K->m[1][k], K->m[2][k]);
}
static inline gv_mat3 gv_mat3_transposed(const gv_mat3 *K) {
  return (gv_mat3){{{K->m[0][0], K->m[1][0], K->m[2][0]},
                    {K->m[0][1], K->m[1][1], K->m[2][1]},
                    {K->m[0][2], K->m[1][2], K->m[2][2]}}};
}
static inline gv_mat3 gv_mat3_times(const gv_mat3 *A, const gv_mat3 *B) {
  gv_mat3 out;
  for (int r = 0; r < 3; r++)
    for (int c = 0; c < 3; c++)
      out.m[r][c] = A->m[r][0] * B->m[0][c] + A->m[r][1] * B->m[1][c] + A->m[r][2] * B->m[2][c];
  return out;
}
// Inverse of a matrix that has one.
static inline gv_mat3 gv_mat3_inverse(const gv_mat3 *K) {
  gv_vec3 x = gv_v3(K->m[0][0], K->m[0][1], K->m[0][2]);
  gv_vec3 y = gv_v3(K->m[1][0], K->m[1][1], K->m[1][2]);
  gv_vec3 z = gv_v3(K->m[2][0], K->m[2][1], K->m[2][2]);
  gv_vec3 a = gv_cross(y, z);
  gv_vec3 b = gv_cross(z, x);
  gv_vec3 c = gv_cross(x, y);
  double f = 1.0 / gv_dot(x, a);
  return (gv_mat3){{{f * a.x, f * b.x, f * c.x}, {f * a.y, f * b.y, f * c.y}, {f * a.z, f * b.z, f * c.z}}};
}

// Sine and cosine on |x| <= pi/4: Taylor series, the first term left out is below 5e-17. No branch:
// a loop over them is done in pairs.
#define GV_NEAR 0.785
static inline double gv_sin_near(double x) {
  double s = x * x;
  double p = 1.0 / 355687428096000.0;  // 1/17!
  p = 1.0 / -1307674368000.0 + s * p;  // -1/15!
  p = 1.0 / 6227020800.0 + s * p;
  p = 1.0 / -39916800.0 + s * p;
  p = 1.0 / 362880.0 + s * p;
  p = 1.0 / -5040.0 + s * p;
  p = 1.0 / 120.0 + s * p;
  p = 1.0 / -6.0 + s * p;
  return x + x * s * p;
}

static inline double gv_cos_near(double x) {
  double s = x * x;
  double p = 1.0 / 20922789888000.0;  // 1/16!
  p = 1.0 / -87178291200.0 + s * p;   // -1/14!
  p = 1.0 / 479001600.0 + s * p;
  p = 1.0 / -3628800.0 + s * p;
  p = 1.0 / 40320.0 + s * p;
  p = 1.0 / -720.0 + s * p;
  p = 1.0 / 24.0 + s * p;
  return 1.0 - 0.5 * s + s * s * p;
}

// Sine and cosine of angle_rad, absolute error below 1e-15 for |angle| up to 1e4; bit-identical on
// every IEEE machine. Cost: about 20 ns.
void gv_sincos(double angle_rad, double *out_sin, double *out_cos);
// atan2, absolute error below 1e-15; (0, 0) gives 0. Bit-identical on every IEEE machine.
double gv_atan2(double y, double x);

// Cube root of x >= 0, relative error below 1e-15; bit-identical on every IEEE machine. Set-up.
double gv_cbrt(double x);

// Rotation angle over the sine of its half: of a unit quaternion whose vector part is s2 > 0 long, squared.
double gv_angle_per_sine(double s2, double w);
// Rotation by angle_rad about the unit axis.
gv_quat gv_quat_axis_angle(gv_vec3 axis, double angle_rad);
// Rotation vector (log map): axis times angle, |.| <= pi, of the unit quaternion q; q and -q are the same
// rotation. Up to 14 degrees 2 asin(n) / n as a series in n^2, whose first term left out is below 5e-17.
static inline gv_vec3 gv_quat_log(gv_quat q) {
  gv_vec3 v = gv_v3(q.x, q.y, q.z);
  double s = gv_norm2(v), angle;  // angle per |v|
  if (s < 1.0 / 64.0) {
    angle = 231.0 / 6656.0 + s * (143.0 / 5120.0);
    angle = 63.0 / 1408.0 + s * angle;
    angle = 35.0 / 576.0 + s * angle;
    angle = 5.0 / 56.0 + s * angle;
    angle = 3.0 / 20.0 + s * angle;
    angle = 1.0 / 3.0 + s * angle;
    angle = 2.0 + s * angle;
  } else {
    angle = gv_angle_per_sine(s, q.w);
  }
  return gv_scale(v, q.w < 0.0 ? -angle : angle);
}
// Inverse of gv_quat_log.
gv_quat gv_quat_exp(gv_vec3 rotation_rad);

#ifdef __cplusplus
}
#endif

#endif
