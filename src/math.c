// SPDX-License-Identifier: BSD-3-Clause
// Trigonometry from + - * / sqrt alone, so that a replay gives the same bits on every IEEE machine
// whatever C library it has; and the rotation maps built on it. Any thread.
#include "gloved/math.h"

// Taylor series on |x| <= pi/4: the first term left out is below 5e-17.
static double sin_poly(double x) {
  double s = x * x;
  double p = 1.0 / 355687428096000.0;            // 1/17!
  p = 1.0 / -1307674368000.0 + s * p;            // -1/15!
  p = 1.0 / 6227020800.0 + s * p;
  p = 1.0 / -39916800.0 + s * p;
  p = 1.0 / 362880.0 + s * p;
  p = 1.0 / -5040.0 + s * p;
  p = 1.0 / 120.0 + s * p;
  p = 1.0 / -6.0 + s * p;
  return x + x * s * p;
}

static double cos_poly(double x) {
  double s = x * x;
  double p = 1.0 / 20922789888000.0;             // 1/16!
  p = 1.0 / -87178291200.0 + s * p;              // -1/14!
  p = 1.0 / 479001600.0 + s * p;
  p = 1.0 / -3628800.0 + s * p;
  p = 1.0 / 40320.0 + s * p;
  p = 1.0 / -720.0 + s * p;
  p = 1.0 / 24.0 + s * p;
  return 1.0 - 0.5 * s + s * s * p;
}

void gv_sincos(double angle_rad, double *out_sin, double *out_cos) {
  if (fabs(angle_rad) < 0.785) {  // as below with n = 0
    *out_sin = sin_poly(angle_rad);
    *out_cos = cos_poly(angle_rad);
    return;
  }
  // Cody-Waite: pi/2 in three parts, the first two with trailing zeros, so n * part is exact.
  const double part1 = 1.57079632673412561417e+00, part2 = 6.07710050630396597660e-11,
               part3 = 2.02226624879595063154e-21;
  double n = floor(angle_rad * (2.0 / GV_PI) + 0.5);
  double r = ((angle_rad - n * part1) - n * part2) - n * part3;
  double s = sin_poly(r), c = cos_poly(r);
  double quarter = n - 4.0 * floor(n * 0.25);  // 0, 1, 2 or 3
  if (quarter < 0.5) { *out_sin = s; *out_cos = c; }
  else if (quarter < 1.5) { *out_sin = c; *out_cos = -s; }
  else if (quarter < 2.5) { *out_sin = -s; *out_cos = -c; }
  else { *out_sin = -c; *out_cos = s; }
}

// atan on [0, 1]: shifted to the nearest quarter, then Taylor on |u| <= 1/8.
static double atan_unit(double t) {
  static const double atan_quarter[5] = {0.0, 0.24497866312686415417, 0.46364760900080611621,
                                         0.64350110879328438680, 0.78539816339744830962};
  int k = (int)(t * 4.0 + 0.5);
  double c = 0.25 * k, u = (t - c) / (1.0 + t * c), s = u * u;
  double p = 1.0 / 17.0;
  p = 1.0 / -15.0 + s * p;
  p = 1.0 / 13.0 + s * p;
  p = 1.0 / -11.0 + s * p;
  p = 1.0 / 9.0 + s * p;
  p = 1.0 / -7.0 + s * p;
  p = 1.0 / 5.0 + s * p;
  p = 1.0 / -3.0 + s * p;
  return atan_quarter[k] + (u + u * s * p);
}

double gv_atan2(double y, double x) {
  double ax = fabs(x), ay = fabs(y);
  if (!(ax > 0.0) && !(ay > 0.0)) return 0.0;
  double a = ay <= ax ? atan_unit(ay / ax) : 0.5 * GV_PI - atan_unit(ax / ay);
  if (x < 0.0) a = GV_PI - a;
  return y < 0.0 ? -a : a;
}

double gv_cbrt(double x) {
  if (!(x > 0.0) || !isfinite(x)) return 0.0;
  double y = x < 1.0 ? 1.0 : x;  // above the root: Newton falls monotonically
  for (int i = 0; i < 2000; i++) {
    double next = (2.0 * y + x / (y * y)) / 3.0;
    if (!(next < y)) break;
    y = next;
  }
  return y;
}

gv_quat gv_quat_axis_angle(gv_vec3 axis, double angle_rad) {
  double s, c;
  gv_sincos(0.5 * angle_rad, &s, &c);
  return (gv_quat){c, axis.x * s, axis.y * s, axis.z * s};
}

gv_vec3 gv_quat_log(gv_quat q) {
  double sign = q.w < 0.0 ? -1.0 : 1.0;  // q and -q are the same rotation: take the short way
  gv_vec3 v = gv_v3(sign * q.x, sign * q.y, sign * q.z);
  double n = gv_norm(v);
  if (n < 1e-9) return gv_scale(v, 2.0);  // angle = 2 asin(n), relative error n^2 / 6
  return gv_scale(v, 2.0 * gv_atan2(n, sign * q.w) / n);
}

gv_quat gv_quat_exp(gv_vec3 rotation_rad) {
  double a = gv_norm(rotation_rad);
  if (a < 1e-9) return gv_quat_normalize((gv_quat){1.0, 0.5 * rotation_rad.x, 0.5 * rotation_rad.y, 0.5 * rotation_rad.z});
  return gv_quat_axis_angle(gv_scale(rotation_rad, 1.0 / a), a);
}
