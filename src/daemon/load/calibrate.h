// SPDX-License-Identifier: BSD-3-Clause
// Calibration of a glove from three postures that everybody can make: flat hand, fist, pinch. Samples
// in; when the hand rests, the means of the last second, jumps left out, are the posture's raw values;
// two postures at known angles give each sensor its line. What cannot be right is refused by the
// sensor's name. Pure; any one thread.
//
// Angles of the postures (degrees): flat 0 everywhere. Fist: MPJ 90, PIJ 100, DIJ 67 (two thirds), thumb
// MPJ 45, IJ 60. Pinch, tip of the thumb on the tip of the index finger: thumb rotation 30, abduction 35;
// with the index at 55 50 33 and the thumb's joints at 20 these bring the tips of the default hand
// together (3 um). People make these postures to within some 10 degrees, which is what the calibration is
// worth. The sensors that none of the three moves (finger abduction, palm arch, wrist) get their zero from
// the flat hand and keep the slope they had.
#ifndef GLOVED_PROCESS_CALIBRATE_H
#define GLOVED_PROCESS_CALIBRATE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "gloved/hand.h"

typedef enum gv_posture { GV_POSTURE_FLAT, GV_POSTURE_FIST, GV_POSTURE_PINCH, GV_POSTURES } gv_posture;

enum {
  GV_CALIBRATE_WINDOW = 1024,  // samples, thinned to 1 ms; 2 bytes a sensor
  GV_CALIBRATE_PROBLEMS = GV_SENSORS + 1,
  GV_CALIBRATE_TEXT = 200
};

typedef struct gv_calibrator {
  // the last second
  uint16_t window[GV_CALIBRATE_WINDOW][GV_SENSORS];
  int64_t stamp_ns[GV_CALIBRATE_WINDOW];
  int newest, count;
  int64_t looked_ns, rest_ns;   // last look at the window; since when it has been at rest, -1: it is not
  double mean[GV_SENSORS];      // of the middle 90 % of the window, counts
  double spread[GV_SENSORS];    // 5th to 95th percentile, counts
  double quietest[GV_SENSORS];  // smallest spread while waiting for this posture
  // postures
  int posture;  // the next to be taken; GV_POSTURES: all are there
  double raw[GV_POSTURES][GV_SENSORS];
  double noise[GV_POSTURES][GV_SENSORS];
} gv_calibrator;

const char *gv_posture_name(gv_posture posture);  // "flat hand"
const char *gv_posture_how(gv_posture posture);   // what to do, one sentence

void gv_calibrator_init(gv_calibrator *c);
// One sample. Cost: 0.1 us, and 20 times a second 1 ms.
void gv_calibrator_sample(gv_calibrator *c, int64_t stamp_ns, const uint16_t raw[GV_SENSORS]);
// How much of the rest that is needed is there, 0..1.
double gv_calibrator_rest(const gv_calibrator *c);
// Whether the resting hand is another than that of the posture taken last.
bool gv_calibrator_moved(const gv_calibrator *c);
// The most restless sensor now, or -1.
int gv_calibrator_restless(const gv_calibrator *c);
// Take the resting hand as the next posture.
void gv_calibrator_take(gv_calibrator *c);
// Wait for this posture anew (the window is emptied).
void gv_calibrator_wait(gv_calibrator *c);
// Why a posture does not come about: a line for each sensor that never rested, or one
// for the hand. Returns how many.
int gv_calibrator_complaints(const gv_calibrator *c, char out[GV_CALIBRATE_PROBLEMS][GV_CALIBRATE_TEXT]);
// The calibration, where all postures are there. `base` gives the slopes that they do not. Returns how many
// problems there are, one line (sensor, what, what to do) each; 0: *out is written.
int gv_calibrator_finish(const gv_calibrator *c, const gv_calibration *base, gv_calibration *out,
                         char problem[GV_CALIBRATE_PROBLEMS][GV_CALIBRATE_TEXT]);

#endif
