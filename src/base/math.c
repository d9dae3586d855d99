// SPDX-License-Identifier: BSD-3-Clause
// Trigonometry from + - * / sqrt alone, so that a replay gives the same bits on every IEEE machine
// whatever C library it has; and the rotation maps built on it. Any thread.
#include "gloved/math.h"

void gv_sincos(double angle_rad, double *out_sin, double *out_cos) {
  if (fabs(angle_rad) < GV_NEAR) {  // as below with n = 0
    *out_sin = gv_sin_near(angle_rad);
    *out_cos = gv_cos_near(angle_rad);
    return;
  }
  // Cody-Waite: pi/2 in three parts, the first two with trailing zeros, so n * part is exact.
  const double part1 = 1.57079632673412561417e+00;
  const double part2 = 6.07710050630396597660e-11;
  const double part3 = 2.02226624879595063154e-21;
  double n = floor(angle_rad * (2.0 / GV_PI) + 0.5);
  double r = ((angle_rad - n * part1) - n * part2) - n * part3;
  double s = gv_sin_near(r);
  double c = gv_cos_near(r);
  double quarter = n - 4.0 * floor(n * 0.25);  // 0, 1, 2 or 3
  if (quarter < 0.5) {
    *out_sin = s;
    *out_cos = c;
  } else if (quarter < 1.5) {
    *out_sin = c;
    *out_cos = -s;
  } else if (quarter < 2.5) {
    *out_sin = -s;
    *out_cos = -c;
  } else {
    *out_sin = -c;
    *out_cos = s;
  }
}

// atan on [0, 1]: shifted to the nearest quarter, then Taylor on |u| <= 1/8.
static double atan_unit(double t) {
  static const double atan_quarter[5] = {0.0, 0.24497866312686415417, 0.46364760900080611621,
                                         0.64350110879328438680, 0.78539816339744830962};
  int k = (int)(t * 4.0 + 0.5);
  double c = 0.25 * k;
  double u = (t - c) / (1.0 + t * c);
  double s = u * u;
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
  double ax = fabs(x);
  double ay = fabs(y);
  if (!(ax > 0.0) && !(ay > 0.0))
    return 0.0;
  double a = ay <= ax ? atan_unit(ay / ax) : 0.5 * GV_PI - atan_unit(ax / ay);
  if (x < 0.0)
    a = GV_PI - a;
  return y < 0.0 ? -a : a;
}

double gv_cbrt(double x) {
  if (!(x > 0.0) || !isfinite(x))
    return 0.0;
  double y = x < 1.0 ? 1.0 : x;  // above the root: Newton falls monotonically
  for (int i = 0; i < 2000; i++) {
    double next = (2.0 * y + x / (y * y)) / 3.0;
    if (!(next < y))
      break;
    y = next;
  }
  return y;
}

gv_quat gv_quat_axis_angle(gv_vec3 axis, double angle_rad) {
  double s, c;
  gv_sincos(0.5 * angle_rad, &s, &c);
  return (gv_quat){c, axis.x * s, axis.y * s, axis.z * s};
}

double gv_angle_per_sine(double s2, double w) {
  double n = sqrt(s2);
  return 2.0 * gv_atan2(n, fabs(w)) / n;
}

gv_quat gv_quat_exp(gv_vec3 rotation_rad) {
  double a = gv_norm(rotation_rad);
  if (a < 1e-9)
    return gv_quat_normalize(
        (gv_quat){1.0, 0.5 * rotation_rad.x, 0.5 * rotation_rad.y, 0.5 * rotation_rad.z});
  return gv_quat_axis_angle(gv_scale(rotation_rad, 1.0 / a), a);
}
