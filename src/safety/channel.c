// SPDX-License-Identifier: BSD-3-Clause
// The table of force channels and the conversion of newtons into a device's number
// (channel.h). Pure; any thread.
#include "gloved/channel.h"

#include <assert.h>
#include <stddef.h>

// Sources: DESIGN.md, "Forces". How much tension a full brake of a LucidGlove holds is not measured anywhere
// (it depends on servo and spool): it is laid on the limiter's full range.
static const gv_channel table[GV_CHANNELS] = {
  [GV_CHANNEL_CYBERGRASP] = {"CyberGrasp", "0.003 N", GV_CHANNEL_TENSION, 12.0, 0.0, 400.0, 4000, 5},
  [GV_CHANNEL_SENSEGLOVE_R1] = {"SenseGlove R1", "mN", GV_CHANNEL_TENSION, 3.5, 0.8, 400.0, 3500, 4},
  [GV_CHANNEL_LUCIDGLOVE] = {"LucidGlove", "1/1000 of the brake", GV_CHANNEL_BRAKE, 12.0, 0.0, 400.0, 1000,
                             5},
  // A servo turns the first joint, where the tendon's arm is 0.075 m (tendon.c): 0.7 A of an
  // XL330-M288, half of its stall current, are 0.25 N m (e-Manual: 0.52 N m at 1.47 A), or 3.3 N. An
  // XC330-M288 pulls half again as hard.
  [GV_CHANNEL_DOGLOVE] = {"DOGlove", "mA", GV_CHANNEL_TENSION, 3.3, 0.0, 400.0, 700, 5},
};

const gv_channel *gv_channel_of(gv_channel_name name) {
  return (unsigned)name < GV_CHANNELS ? &table[name] : NULL;
}

// The millionth of a count: 3 N of 12 are 250 of 1000 whatever the last bit of the division says.
int gv_channel_counts(const gv_channel *c, double tension_n) {
  assert(c->max_n > 0.0 && c->counts > 0);
  if (!isfinite(tension_n))
    return 0;
  return (int)floor(gv_clamp(tension_n, 0.0, c->max_n) / c->max_n * c->counts + 1e-6);
}

double gv_channel_tension_n(const gv_channel *c, int counts) {
  return c->max_n * gv_clamp((double)counts / c->counts, 0.0, 1.0);
}

static bool lower(double *value, double limit) {
  if (*value <= limit)
    return false;
  *value = limit;
  return true;
}

bool gv_channel_limit(const gv_channel *c, gv_limiter_config *cfg) {
  assert(c->fingers > 0 && c->fingers <= GV_FINGERS);
  bool changed = lower(&cfg->max_n, c->max_n);
  for (int i = 0; i < GV_FINGERS; i++)
    changed |= lower(&cfg->finger_max_n[i], i < c->fingers ? c->max_n : 0.0);
  changed |= lower(&cfg->slew_n_per_s, c->slew_n_per_s);
  if (cfg->pretension_n >= c->pretension_n)
    return changed;
  cfg->pretension_n = c->pretension_n;
  return true;
}
