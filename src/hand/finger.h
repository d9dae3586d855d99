// SPDX-License-Identifier: BSD-3-Clause
// The user's fingers as the device's tensions bend them, foreseen: a coarse, late glove shows this movement
// some 20 ms after the tension that made it. Pure.
#ifndef GLOVED_HAND_FINGER_H
#define GLOVED_HAND_FINGER_H

#include "gloved/config.h"

typedef struct gv_finger_joint {
  double bend_rad, rate_rad_s;  // off where the user means it to be; below 0: held back
} gv_finger_joint;

typedef struct gv_fingers {
  gv_finger_joint joint[GV_FINGERS][3];
} gv_fingers;

// One step of h seconds under the tensions that the device was told.
void gv_fingers_step(gv_fingers *fingers, const gv_finger_model *model, const double tension_n[GV_FINGERS],
                     double h);
// The bend of each sensor's joint; 0 where no tendon reaches.
void gv_fingers_bend(const gv_fingers *fingers, double out_bend_rad[GV_SENSORS]);

#endif
