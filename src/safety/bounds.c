// SPDX-License-Identifier: BSD-3-Clause
// The settings that protect a person, each with the bounds that no configuration passes. Pure; any thread.
#include "gloved/force.h"
#include "gloved/safety.h"

#define LIMIT(member, kind, min, max, sentence)                                                              \
  {"limiter", #member, kind, offsetof(gv_limiter_config, member), min, max, GV_LAXER_ABOVE, NULL, sentence}
#define SAFETY(member, kind, min, max, laxer, sentence)                                                      \
  {"safety", #member, kind, offsetof(gv_safety_config, member), min, max, laxer, NULL, sentence}

// A wire's count of 0.003 N in 12 bits says at most 12.285 N. At 1000 N/s a finger is at full force in 12
// ms, which nobody answers; 50 ms of ramp is a third of the time in which a person lets go of what hurts. A
// force on data that is 0.2 s old follows a hand that has moved by 0.2 m meanwhile.
const gv_setting gv_limiter_settings[GV_LIMITER_SETTINGS] = {
  LIMIT(max_n, GV_SETTING_NUMBER, 0.0, 12.285, "of each finger; at most 12.285, what the wire can say"),
  LIMIT(finger_max_n, GV_SETTING_FINGERS, 0.0, 12.285, "thumb to little finger, where lower"),
  LIMIT(pretension_n, GV_SETTING_NUMBER, 0.0, 1.0,
        "the least pull while forces may leave, so that no tendon hangs slack; at most 1"),
  LIMIT(slew_n_per_s, GV_SETTING_NUMBER, 1.0, 1000.0, "how fast a force may rise; at most 1000"),
  LIMIT(ramp_s, GV_SETTING_NUMBER, 0.001, 0.05, "from full force to zero when in doubt; at most 0.05"),
  LIMIT(max_age_s, GV_SETTING_NUMBER, 0.001, 0.2, "of the sample behind the force; at most 0.2"),
};

// A window that is shorter than a few periods forgets every event; 100 bad frames
// in it are most of what comes.
const gv_setting gv_safety_settings[GV_SAFETY_SETTINGS] = {
  SAFETY(max_age_s, GV_SETTING_NUMBER, 0.001, 0.2, GV_LAXER_ABOVE,
         "of glove and tracker data, where their rate does not ask for less; at most 0.2"),
  SAFETY(status_age_s, GV_SETTING_NUMBER, 0.001, 0.5, GV_LAXER_ABOVE,
         "of the device's status, likewise; at most 0.5"),
  SAFETY(arm_below_n, GV_SETTING_NUMBER, 0.0, 0.5, GV_LAXER_ABOVE,
         "forces must be this small when the switch is closed; at most 0.5"),
  SAFETY(bad_limit, GV_SETTING_COUNT, 1, 100, GV_LAXER_ABOVE, "bad frames within bad_window_s; at most 100"),
  SAFETY(bad_window_s, GV_SETTING_NUMBER, 0.05, 10.0, GV_LAXER_BELOW, "at least 0.05"),
  SAFETY(overrun_limit, GV_SETTING_COUNT, 1, 100, GV_LAXER_ABOVE,
         "missed periods within the window; at most 100, and never more than three quarters of them"),
};

static const char *unsound(const gv_setting rows[], int count, const void *configuration) {
  for (int i = 0; i < count; i++)
    if (!gv_setting_sound(&rows[i], configuration))
      return rows[i].key;
  return NULL;
}

const char *gv_limiter_check(const gv_limiter_config *cfg) {
  return unsound(gv_limiter_settings, GV_LIMITER_SETTINGS, cfg);
}
const char *gv_safety_check(const gv_safety_config *cfg) {
  return unsound(gv_safety_settings, GV_SAFETY_SETTINGS, cfg);
}
