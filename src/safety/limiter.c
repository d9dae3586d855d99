// SPDX-License-Identifier: BSD-3-Clause
// The one limiter that every force leaves through. Real-time thread.
#include "gloved/force.h"

#include <assert.h>
#include <string.h>

gv_limiter_config gv_limiter_config_default(void) {
  return (gv_limiter_config){.max_n = 12.0,
                             .finger_max_n = {12.0, 12.0, 12.0, 12.0, 12.0},
                             .slew_n_per_s = 400.0,
                             .ramp_s = 0.015,
                             .max_age_s = 0.05};
}

void gv_limiter_init(gv_limiter *limiter, const gv_limiter_config *cfg) {
  assert(gv_limiter_check(cfg) == NULL);
  memset(limiter, 0, sizeof *limiter);
  limiter->cfg = *cfg;
}

// At least the pretension, at most the channel's maximum, never faster up than the slew limit.
static double limit_channel(const gv_limiter *l, double max_n, double desired, double last, double dt_s,
                            unsigned *flags) {
  assert(max_n >= 0.0 && last >= 0.0 && dt_s >= 0.0);
  const gv_limiter_config *c = &l->cfg;
  const double rise_s = l->longest_rise_s > 0.0 ? fmin(dt_s, l->longest_rise_s) : dt_s;
  double want = desired > c->pretension_n ? desired : c->pretension_n;
  if (want > max_n) {
    want = max_n;
    *flags |= GV_LIMITER_VALUE;
  }
  double rise = c->slew_n_per_s * rise_s;
  if (want > last + rise) {
    want = last + rise;
    *flags |= GV_LIMITER_SLEW;
  }
  return want;
}

unsigned gv_limiter_step(gv_limiter *l, const double desired_n[GV_FINGERS], bool enabled, double age_s,
                         double dt_s, double out_n[GV_FINGERS]) {
  const gv_limiter_config *c = &l->cfg;
  unsigned flags = enabled ? 0 : GV_LIMITER_DISABLED;
  if (!(age_s >= 0.0 && age_s <= c->max_age_s))
    flags |= GV_LIMITER_AGE;
  for (int i = 0; i < GV_FINGERS; i++)
    if (!isfinite(desired_n[i]))
      flags |= GV_LIMITER_NOT_FINITE;
  bool doubt = flags != 0;
  // Full force to zero within ramp_s, whatever the force was.
  double fall = c->ramp_s > 0.0 ? c->max_n * dt_s / c->ramp_s : c->max_n;
  for (int i = 0; i < GV_FINGERS; i++) {
    double last = l->out_n[i];
    double max_n = fmin(c->max_n, c->finger_max_n[i]);
    double next = doubt ? last - fall : limit_channel(l, max_n, desired_n[i], last, dt_s, &flags);
    l->out_n[i] = out_n[i] = next > 0.0 ? fmin(next, max_n) : 0.0;
    assert(out_n[i] >= 0.0 && out_n[i] <= max_n);
  }
  return flags;
}
