// SPDX-License-Identifier: BSD-3-Clause
// Three postures to a calibration (calibrate.h). Limits in 12-bit counts: the step of an 8-bit glove is 16 of
// them; 90 degrees of a real glove's least sensitive joint are 700 (2.07 degrees a step).
#include "daemon/load/calibrate.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define DEG (GV_PI / 180)
enum {
  REST_COUNTS = 80,  // spread of a sensor at rest: noise of 1.8 degrees and the step of 8 bits
                     // leave room
  MOVED_COUNTS = 150,
  MOVED_SENSORS = 3,       // how far, and how many, so that it is another posture
  LEAST_COUNTS = 48,       // three steps of 8 bits
  LEAST_PER_90_DEG = 160,  // ten of them
  LOW_END = 16,
  HIGH_END = 4094  // the last values of 8 and 12 bits: the sensor is at its end
};
static const int64_t window_ns = 1000000000, look_ns = 50000000, needed_rest_ns = 500000000,
                     thin_ns = 1000000;

// ---- the postures ---------------------------------------------------------------------------------

// Degrees; flat is 0 for all. none: this posture says nothing about the sensor.
static const double none = -999.0;
static double fist_deg(int sensor) {
  static const double bent_deg[3] = {90.0, 100.0, 200.0 / 3.0};
  if (sensor == GV_THUMB_MPJ)
    return 45.0;
  if (sensor == GV_THUMB_IJ)
    return 60.0;
  for (int finger = 1; finger < GV_FINGERS; finger++)
    for (int joint = 0; joint < 3; joint++)
      if (gv_flexion[finger][joint] == sensor)
        return bent_deg[joint];
  return none;
}

// The posture that gives the sensor its second point, and the angle there; -1: there is none.
static int second_posture(int sensor, double *out_deg) {
  *out_deg = sensor == GV_THUMB_ROTATE ? 30.0 : sensor == GV_THUMB_ABDUCTION ? 35.0 : fist_deg(sensor);
  if (*out_deg == none)
    return -1;
  return sensor == GV_THUMB_ROTATE || sensor == GV_THUMB_ABDUCTION ? GV_POSTURE_PINCH : GV_POSTURE_FIST;
}

static bool is_finger_flexion(int sensor) {
  return fist_deg(sensor) != none && sensor != GV_THUMB_MPJ && sensor != GV_THUMB_IJ;
}

const char *gv_posture_name(gv_posture posture) {
  static const char *const name[] = {"flat hand", "fist", "pinch"};
  return posture < GV_POSTURES ? name[posture] : "none";
}

const char *gv_posture_how(gv_posture posture) {
  static const char *const how[] = {
    "lay the hand flat on a table: fingers straight and together, the thumb straight beside the index finger",
    "make a fist: every joint bent as far as it goes without force, the thumb across the index and middle "
    "finger",
    "pinch: the tip of the thumb on the tip of the index finger, a round O between them, the other fingers "
    "straight"};
  return posture < GV_POSTURES ? how[posture] : "";
}

// ---- rest -----------------------------------------------------------------------------------------

void gv_calibrator_wait(gv_calibrator *c) {
  c->count = c->newest = 0;
  c->looked_ns = 0;
  c->rest_ns = -1;
  for (int i = 0; i < GV_SENSORS; i++) {
    c->spread[i] = 0.0;
    c->quietest[i] = HUGE_VAL;
  }
}

void gv_calibrator_init(gv_calibrator *c) {
  memset(c, 0, sizeof *c);
  gv_calibrator_wait(c);
}

static int by_value(const void *a, const void *b) { return *(const uint16_t *)a - *(const uint16_t *)b; }

// Samples of the last second: how many, counted from the newest.
static int in_window(const gv_calibrator *c) {
  int n = 0;
  while (n < c->count) {
    const int k = (c->newest - n + GV_CALIBRATE_WINDOW) % GV_CALIBRATE_WINDOW;
    if (c->stamp_ns[c->newest] - c->stamp_ns[k] > window_ns)
      break;
    n++;
  }
  return n;
}

// Mean of the middle 90 % and spread of n sorted values. A glove's single jumps do not count, and the mean
// sees between the steps of a coarse sensor that trembles.
static void middle(const uint16_t *sorted, int n, double *out_mean, double *out_spread) {
  const int from = (n - 1) * 5 / 100;
  const int to = (n - 1) * 95 / 100;
  double sum = 0.0;
  for (int k = from; k <= to; k++)
    sum += sorted[k];
  *out_mean = sum / (to - from + 1);
  *out_spread = sorted[to] - sorted[from];
}

static void look(gv_calibrator *c) {
  const int n = in_window(c);
  uint16_t value[GV_CALIBRATE_WINDOW];
  bool rest = true;
  for (int i = 0; i < GV_SENSORS; i++) {
    for (int k = 0; k < n; k++)
      value[k] = c->window[(c->newest - k + GV_CALIBRATE_WINDOW) % GV_CALIBRATE_WINDOW][i];
    qsort(value, (size_t)n, sizeof value[0], by_value);
    middle(value, n, &c->mean[i], &c->spread[i]);
    c->quietest[i] = fmin(c->quietest[i], c->spread[i]);
    rest &= c->spread[i] <= REST_COUNTS;
  }
  if (!rest)
    c->rest_ns = -1;
  else if (c->rest_ns < 0)
    c->rest_ns = c->stamp_ns[c->newest];
}

// Whether the window reaches over its second (or is full).
static bool window_is_full(const gv_calibrator *c) {
  if (c->count < 20)
    return false;
  const int oldest = (c->newest - c->count + 1 + GV_CALIBRATE_WINDOW) % GV_CALIBRATE_WINDOW;
  return c->count == GV_CALIBRATE_WINDOW || c->stamp_ns[c->newest] - c->stamp_ns[oldest] >= window_ns;
}

void gv_calibrator_sample(gv_calibrator *c, int64_t stamp_ns, const uint16_t raw[GV_SENSORS]) {
  if (c->count > 0 && stamp_ns - c->stamp_ns[c->newest] < thin_ns)
    return;
  c->newest = (c->newest + 1) % GV_CALIBRATE_WINDOW;
  c->stamp_ns[c->newest] = stamp_ns;
  memcpy(c->window[c->newest], raw, sizeof c->window[0]);
  if (c->count < GV_CALIBRATE_WINDOW)
    c->count++;
  if (!window_is_full(c) || stamp_ns - c->looked_ns < look_ns)
    return;
  c->looked_ns = stamp_ns;
  look(c);
}

double gv_calibrator_rest(const gv_calibrator *c) {
  if (c->rest_ns < 0)
    return 0.0;
  return fmin(1.0, (double)(c->stamp_ns[c->newest] - c->rest_ns) / (double)needed_rest_ns);
}

bool gv_calibrator_moved(const gv_calibrator *c) {
  int moved = 0;
  if (c->posture == 0)
    return true;
  for (int i = 0; i < GV_SENSORS; i++)
    moved += fabs(c->mean[i] - c->raw[c->posture - 1][i]) > MOVED_COUNTS ? 1 : 0;
  return moved >= MOVED_SENSORS;
}

int gv_calibrator_restless(const gv_calibrator *c) {
  int most = -1;
  for (int i = 0; i < GV_SENSORS; i++)
    if (c->spread[i] > (most < 0 ? REST_COUNTS : c->spread[most]))
      most = i;
  return most;
}

void gv_calibrator_take(gv_calibrator *c) {
  if (c->posture >= GV_POSTURES)
    return;
  memcpy(c->raw[c->posture], c->mean, sizeof c->mean);
  memcpy(c->noise[c->posture], c->spread, sizeof c->spread);
  c->posture++;
  gv_calibrator_wait(c);
}

// ---- what cannot be right -------------------------------------------------------------------------

int gv_calibrator_complaints(const gv_calibrator *c, char out[GV_CALIBRATE_PROBLEMS][GV_CALIBRATE_TEXT]) {
  const char *posture = gv_posture_name((gv_posture)c->posture);
  int n = 0;
  if (!isfinite(c->quietest[0])) {
    snprintf(out[n++], GV_CALIBRATE_TEXT,
             "%s: fewer than 20 samples in a second came from the glove; switch it on, and check its cable",
             posture);
    return n;
  }
  for (int i = 0; i < GV_SENSORS; i++)
    if (c->quietest[i] > REST_COUNTS)
      snprintf(out[n++], GV_CALIBRATE_TEXT,
               "%s: moves by %.0f counts while the hand is held still (%d are allowed); check the plug of "
               "the glove and the sensor's wire",
               gv_sensor_name(i), c->quietest[i], REST_COUNTS);
  if (n == 0 && gv_calibrator_rest(c) >= 1.0)
    snprintf(out[n++], GV_CALIBRATE_TEXT, "%s: the hand is still where it was in the %s; change the posture",
             posture, gv_posture_name((gv_posture)(c->posture - 1)));
  else if (n == 0)
    snprintf(out[n++], GV_CALIBRATE_TEXT, "%s: the hand did not rest; hold it still for two seconds",
             posture);
  return n;
}

// +1 where most flexion sensors of the fingers rise from the flat hand to the fist, otherwise -1.
static int common_direction(const gv_calibrator *c) {
  int rising = 0;
  for (int i = 0; i < GV_SENSORS; i++)
    if (is_finger_flexion(i))
      rising += c->raw[GV_POSTURE_FIST][i] > c->raw[GV_POSTURE_FLAT][i] ? 1 : -1;
  return rising >= 0 ? 1 : -1;
}

static bool at_end(double raw) { return raw <= LOW_END || raw >= HIGH_END; }

// True, with the reason in out, where the sensor's two points cannot be right.
static bool is_wrong(const gv_calibrator *c, int sensor, int direction, char out[GV_CALIBRATE_TEXT]) {
  double deg;
  const int second = second_posture(sensor, &deg);
  const double flat = c->raw[GV_POSTURE_FLAT][sensor];
  const double other = second < 0 ? flat : c->raw[second][sensor];
  const char *name = gv_sensor_name(sensor);
  const char *posture = second < 0 ? "" : gv_posture_name((gv_posture)second);
  const double least = fmax(LEAST_COUNTS, LEAST_PER_90_DEG * fabs(deg) / 90.0);
  if (at_end(flat) || at_end(other)) {
    snprintf(out, GV_CALIBRATE_TEXT,
             "%s: stands at the end of its range (%.0f with the flat hand, %.0f with the %s); set the "
             "glove's own offset, or wear it further up",
             name, flat, other, second < 0 ? "same" : posture);
    return true;
  }
  if (second < 0)
    return false;
  if (fabs(other - flat) < least) {
    snprintf(out, GV_CALIBRATE_TEXT,
             "%s: did not move (%.0f with the flat hand, %.0f with the %s); bend this joint fully, or check "
             "the sensor's wire",
             name, flat, other, posture);
    return true;
  }
  if (is_finger_flexion(sensor) && (other > flat ? 1 : -1) != direction) {
    snprintf(out, GV_CALIBRATE_TEXT,
             "%s: runs against the other fingers (%.0f with the flat hand, %.0f with the %s); do not bend "
             "this joint backwards in the flat hand, and close the fist",
             name, flat, other, posture);
    return true;
  }
  return false;
}

// The pinch has middle, ring and little finger straight: so it tells the flat hand from the
// fist, whichever way the sensors run. A person who was ahead of the questions has made the fist
// where the flat hand was asked for.
static bool postures_are_exchanged(const gv_calibrator *c) {
  int nearer_fist = 0;
  int sensors = 0;
  for (int i = GV_MIDDLE_MPJ; i < GV_SENSORS; i++) {
    if (!is_finger_flexion(i))
      continue;
    const double pinch = c->raw[GV_POSTURE_PINCH][i];
    nearer_fist += fabs(pinch - c->raw[GV_POSTURE_FIST][i]) < fabs(pinch - c->raw[GV_POSTURE_FLAT][i]) ? 1
                                                                                                       : 0;
    sensors++;
  }
  return 2 * nearer_fist > sensors;
}

// ---- the calibration ------------------------------------------------------------------------------

static void fit_sensor(const gv_calibrator *c, int sensor, const gv_calibration *base, gv_calibration *out) {
  double deg;
  const int second = second_posture(sensor, &deg);
  const double flat = c->raw[GV_POSTURE_FLAT][sensor];
  out->raw[sensor][0] = flat;
  out->angle_rad[sensor][0] = 0.0;
  if (second >= 0) {
    out->raw[sensor][1] = c->raw[second][sensor];
    out->angle_rad[sensor][1] = deg * DEG;
  } else {
    const double *r = base->raw[sensor];
    const double *a = base->angle_rad[sensor];
    out->raw[sensor][1] = flat + (r[1] - r[0]) / (a[1] - a[0]) * 90.0 * DEG;
    out->angle_rad[sensor][1] = 90.0 * DEG;
  }
}

int gv_calibrator_finish(const gv_calibrator *c, const gv_calibration *base, gv_calibration *out,
                         char problem[GV_CALIBRATE_PROBLEMS][GV_CALIBRATE_TEXT]) {
  int n = 0;
  if (c->posture < GV_POSTURES)
    return gv_calibrator_complaints(c, problem);
  const int direction = common_direction(c);
  for (int i = 0; i < GV_SENSORS; i++)
    n += is_wrong(c, i, direction, problem[n]) ? 1 : 0;
  if (n == 0 && postures_are_exchanged(c))
    snprintf(problem[n++], GV_CALIBRATE_TEXT,
             "postures: in the pinch the straight fingers stand as in the fist, not as in the flat hand; "
             "begin again, and go on only when asked");
  if (n > 0)
    return n;
  for (int i = 0; i < GV_SENSORS; i++)
    fit_sensor(c, i, base, out);
  return 0;
}
