// SPDX-License-Identifier: BSD-3-Clause
// The safety state machine (drawn in gloved/safety.h). Real-time thread; pure.
#include "gloved/safety.h"

#include <assert.h>
#include <math.h>
#include <stddef.h>

#include "safety/source.h"

gv_safety_config gv_safety_config_default(void) {
  return (gv_safety_config){
    .max_age_s = 0.05,
    .status_age_s = 0.1,
    .arm_below_n = 0.1,
    .bad_limit = 10,
    .bad_window_s = 0.1,
    .overrun_limit = 20,
  };
}

void gv_safety_init(gv_safety *s, const gv_safety_config *cfg) {
  assert(gv_safety_check(cfg) == NULL);
  *s = (gv_safety){.cfg = *cfg, .state = GV_SAFETY_START};
}

static bool fresh(double age_s, double interval_s, double max_age_s) {
  return age_s >= 0.0 && age_s <= gv_source_largest_age_s(interval_s, max_age_s);
}

// Causes that are waited out where no force flows.
static const uint32_t passing = GV_FAULT_GLOVE_STALE | GV_FAULT_TRACKER_STALE | GV_FAULT_STATUS_STALE |
                                GV_FAULT_SENSOR | GV_FAULT_OTHER_HAND | GV_FAULT_TRACKER |
                                GV_FAULT_OTHER_DEVICE;

// Events leak away over the window: the level is about their count within it.
static double leak(double level, unsigned events, double dt_s, double window_s) {
  assert(level >= 0.0 && dt_s > 0.0);
  double kept = window_s > dt_s ? level * (1.0 - dt_s / window_s) : 0.0;
  return kept + events;
}

// Three quarters of the window's periods: where few fit into it, a limit above their
// number would never be passed.
static double most_overruns(const gv_safety_config *c, double dt_s) {
  return fmax(2.0, 0.75 * c->bad_window_s / dt_s);
}

static uint32_t present_faults(gv_safety *s, const gv_safety_input *in, double dt_s) {
  const gv_safety_config *c = &s->cfg;
  uint32_t f = in->doubts & passing;
  if (!in->glove_seen || !fresh(in->glove_age_s, in->glove_interval_s, c->max_age_s))
    f |= GV_FAULT_GLOVE_STALE;
  if (!in->tracker_seen || !fresh(in->tracker_age_s, in->tracker_interval_s, c->max_age_s))
    f |= GV_FAULT_TRACKER_STALE;
  if (in->status_seen && !fresh(in->status_age_s, in->status_interval_s, c->status_age_s))
    f |= GV_FAULT_STATUS_STALE;
  if (s->bad_level > c->bad_limit)
    f |= GV_FAULT_FRAMES;
  if (!in->finite)
    f |= GV_FAULT_NOT_FINITE;
  if (s->overrun_level > fmin(c->overrun_limit, most_overruns(c, dt_s)))
    f |= GV_FAULT_OVERRUN;
  if (in->device_fault)
    f |= GV_FAULT_DEVICE;
  return f;
}

static gv_safety_state next_state(gv_safety *s, const gv_safety_input *in, uint32_t faults) {
  bool near_zero = in->desired_max_n <= s->cfg.arm_below_n;
  switch (s->state) {
    case GV_SAFETY_START: return GV_SAFETY_WAIT;
    case GV_SAFETY_WAIT:
      if (faults & ~passing)
        return GV_SAFETY_FAULT;
      return faults ? GV_SAFETY_WAIT : GV_SAFETY_READY;
    case GV_SAFETY_READY:
      if (faults & ~passing)
        return GV_SAFETY_FAULT;
      if (faults)
        return GV_SAFETY_WAIT;
      return in->dead_man && s->released && near_zero ? GV_SAFETY_ARMED : GV_SAFETY_READY;
    case GV_SAFETY_ARMED:
    case GV_SAFETY_ACTIVE:
      if (faults)
        return GV_SAFETY_FAULT;  // a force may be flowing: stale data and doubt are faults here
      if (!in->dead_man)
        return GV_SAFETY_READY;
      return near_zero && s->state == GV_SAFETY_ARMED ? GV_SAFETY_ARMED : GV_SAFETY_ACTIVE;
    case GV_SAFETY_FAULT: return !(faults & ~passing) && s->released ? GV_SAFETY_WAIT : GV_SAFETY_FAULT;
    case GV_SAFETY_STOPPED: break;
  }
  return GV_SAFETY_STOPPED;
}

gv_safety_state gv_safety_step(gv_safety *s, const gv_safety_input *in, double dt_s) {
  s->bad_level = leak(s->bad_level, in->bad_frames, dt_s, s->cfg.bad_window_s);
  s->overrun_level = leak(s->overrun_level, in->overruns, dt_s, s->cfg.bad_window_s);
  uint32_t faults = present_faults(s, in, dt_s);
  if (!in->dead_man && in->glove_seen)
    s->released = true;
  gv_safety_state next = in->stop ? GV_SAFETY_STOPPED : next_state(s, in, faults);
  if (next == GV_SAFETY_FAULT) {
    if (s->state != GV_SAFETY_FAULT) {
      s->faults = 0;
      s->released = false;
    }
    s->faults |= faults;
  } else {
    s->faults = 0;
  }
  assert(next != GV_SAFETY_FAULT || s->faults != 0);
  s->state = next;
  return next;
}

const char *gv_safety_name(gv_safety_state state) {
  static const char *const name[] = {"start", "wait", "ready", "armed", "active", "fault", "stopped"};
  return (unsigned)state < sizeof name / sizeof *name ? name[state] : "?";
}

const char *gv_fault_text(uint32_t faults) {
  static const char *const text[] = {"glove data too old",
                                     "tracker data too old",
                                     "too many bad or lost frames",
                                     "a number was not finite",
                                     "the step overran repeatedly",
                                     "the device reports a fault",
                                     "the device's status too old",
                                     "the glove reports a sensor fault",
                                     "the glove is for the other hand",
                                     "the tracker reports an error",
                                     "the other hand's device is in a fault"};
  for (size_t i = 0; i < sizeof text / sizeof *text; i++)
    if (faults >> i & 1)
      return text[i];
  return "none";
}
