// SPDX-License-Identifier: BSD-3-Clause
// From samples to a smooth hand: jumps held back, then a critically damped second-order filter that turns
// samples at any rate into angles and a wrist pose with a velocity at every step. Pure.
#ifndef CONDITION_H
#define CONDITION_H

#include "gloved/engine.h"

typedef struct gv_condition {
  double angle[GV_SENSORS], rate[GV_SENSORS]; // filtered joint angles, rad and rad/s
  double target[GV_SENSORS];    // last accepted sample
  double held[GV_SENSORS];      // a jump waiting for a second opinion
  bool holding[GV_SENSORS];
  gv_pose wrist;                // filtered T_world_wrist
  gv_vec3 v, w;                 // its velocity, m/s and rad/s, world
  gv_pose wrist_target, wrist_held;
  bool wrist_holding, glove_seen, pose_seen;
  bool smooth;                  // the filter is on
  // One step takes a deviation e and its rate v to ee e + ev v and ve e + vv v.
  double ee, ev, ve, vv;
} gv_condition;

void gv_condition_init(gv_condition *c, const gv_config *cfg);
// Take a sample in. Returns how many of its parts were held back (joints, pose) or refused; adds to *limited
// the readings beyond the anatomy.
int gv_condition_sample(gv_condition *c, const gv_config *cfg, const gv_sample *sample, uint64_t *limited);
// One step of cfg->step_s. Nothing moves before both glove and pose were seen.
void gv_condition_step(gv_condition *c);
// Where the hand is taken to be: the filtered values, led by prediction_s along their velocity.
void gv_condition_output(const gv_condition *c, const gv_config *cfg, double out_angle_rad[GV_SENSORS], gv_pose *out_wrist);
static inline bool gv_condition_ready(const gv_condition *c) { return c->glove_seen && c->pose_seen; }

#endif
