// SPDX-License-Identifier: BSD-3-Clause
// Age and rate of a source (source.h). Real-time thread; pure.
#include "safety/source.h"

#include <assert.h>
#include <math.h>

// A shared machine stalls for up to 30 ms now and then, and a real tracker's records come up to 30 ms late.
static const double jitter_s = 0.03;
static const double longest_gap_s = 0.5;  // a longer one is an outage and says nothing about the rate
static const double share_of_new = 1.0 / 16;

void gv_source_take(gv_source *s, int64_t came_ns, uint32_t stamp_us, uint32_t age_us) {
  const double gap_s = (double)(came_ns - s->came_ns) * 1e-9;
  if (s->seen && gap_s >= 0.0 && gap_s <= longest_gap_s)
    s->interval_s = s->interval_s > 0.0 ? s->interval_s + share_of_new * (gap_s - s->interval_s) : gap_s;
  if (!s->seen || stamp_us != s->stamp_us)
    s->moved_ns = came_ns;
  s->came_ns = came_ns;
  s->stamp_us = stamp_us;
  s->time_ns = came_ns - (int64_t)age_us * 1000;
  s->seen = true;
  s->doubt = false;
}

double gv_source_age_s(const gv_source *s, int64_t now_ns, double max_age_s) {
  if (!s->seen)
    return HUGE_VAL;
  const double age_s = (double)(now_ns - s->time_ns) * 1e-9;
  const double standing_s = (double)(now_ns - s->moved_ns) * 1e-9;
  return standing_s > 2.0 * max_age_s ? fmax(age_s, standing_s) : age_s;
}

double gv_source_largest_age_s(double interval_s, double max_age_s) {
  assert(max_age_s > 0.0);
  if (!(interval_s > 0.0))
    return max_age_s;
  return fmin(max_age_s, jitter_s + 2.0 * interval_s);
}
