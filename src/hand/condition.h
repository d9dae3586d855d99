// SPDX-License-Identifier: BSD-3-Clause
// From samples to a smooth hand: jumps held back, then a critically damped second-order filter that turns
// samples at any rate into angles and a wrist pose with a velocity at every step. Pure.
//
// The filter's corner goes up with the speed of what it filters: f = min(filter_hz, filter_rest_hz + slope
// |speed|). A hand that rests is still, although its glove counts in steps of 16 mrad; a hand that moves is
// followed at once. A ramp of speed s comes 1 / (pi f) late: the hand is never more than 1 / (pi slope)
// behind because of a low corner: 7 mrad for a joint and 3.2 mm for the wrist, whatever its speed. Where the
// fingers are observed the corner of a joint that has moved comes down slowly (0.4 s).
#ifndef GLOVED_HAND_CONDITION_H
#define GLOVED_HAND_CONDITION_H

#include "gloved/config.h"
#include "hand/finger.h"

enum { GV_CORNERS = 256 };  // of the filter, evenly from rest to filter_hz; 1 costs 32 B

// One step takes a deviation e from the target and its rate v to ee e + ev v and ve e + vv v.
typedef struct gv_decay {
  double ee, ev, ve, vv;
} gv_decay;

// Why a part of a sample was not taken; bits.
typedef enum gv_sample_refusal {
  GV_SAMPLE_NOT_FINITE = 1,
  GV_SAMPLE_JUMP = 2,    // held back until the next sample says the same
  GV_SAMPLE_NO_POSE = 4  // no unit quaternion, or farther than 100 m
} gv_sample_refusal;

typedef struct gv_condition {
  double angle[GV_SENSORS];   // filtered joint angles, rad
  double rate[GV_SENSORS];    // and their rates, rad/s
  double target[GV_SENSORS];  // last accepted sample
  gv_fingers fingers;         // of the user, where they are observed
  double bend[GV_SENSORS];    // of theirs by the tensions, now; added to what is filtered
  double shown[GV_SENSORS];   // the same as it was when the target was accepted, taken off it
  double held[GV_SENSORS];    // a jump waiting for a second opinion
  bool holding[GV_SENSORS];
  gv_pose wrist;  // filtered T_world_wrist
  gv_vec3 v, w;   // its velocity, m/s and rad/s, world
  gv_pose wrist_target, wrist_held;
  gv_vec3 wrist_step_m;  // the way from the accepted pose before to wrist_target,
  double wrist_step_s;   // and what it took; 0: none
  bool wrist_holding, glove_seen, pose_seen;
  bool smooth;                     // the filter is on
  double glove_age_s, pose_age_s;  // time since the last sample of each
  double pose_news_s;              // and since the last pose that was another than the one before
  double pace[GV_SENSORS];         // rates without their noise: they choose the corners
  gv_vec3 pace_v, pace_w;
  double lively[GV_SENSORS];                // sizes of the joints' paces; with the observer they last a while
  double pace_share;                        // of the way from pace to rate that a step takes
  double lively_share;                      // of such a pace that is left after a step; 0: none
  double corner_per_rad_s, corner_per_m_s;  // corners that a pace of 1 lifts by
  gv_decay corner[GV_CORNERS];
  unsigned why;  // gv_sample_refusal bits of the last sample
} gv_condition;

void gv_condition_init(gv_condition *c, const gv_config *cfg);
// Take a sample in. Returns how many of its parts were held back (joints, pose) or refused; adds to *limited
// the readings beyond the anatomy.
int gv_condition_sample(gv_condition *c, const gv_config *cfg, const gv_sample *sample, uint64_t *limited);
// The tensions of this step act on the observed fingers. Without observer: nothing.
void gv_condition_pull(gv_condition *c, const gv_config *cfg, const double tension_n[GV_FINGERS]);
// One step of cfg->step_s. Nothing moves before both glove and pose were seen.
void gv_condition_step(gv_condition *c, const gv_config *cfg);
// Where the hand is taken to be: the filtered values, led by prediction_s along their velocity.
void gv_condition_output(const gv_condition *c, const gv_config *cfg, double out_angle_rad[GV_SENSORS],
                         gv_pose *out_wrist);
static inline bool gv_condition_ready(const gv_condition *c) { return c->glove_seen && c->pose_seen; }

#endif
