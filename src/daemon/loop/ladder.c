// SPDX-License-Identifier: BSD-3-Clause
// Which rung of the deadline ladder a step stands on (ladder.h). Costs are means that follow a change
// within a few steps; one step in which the machine stood still moves none of them by more than half
// a period. Rungs above the present one are thought to become cheaper with time, so that they are
// tried again, a few times a second.
#include "daemon/loop/ladder.h"

#include <assert.h>

enum { FOLLOW = 4, FORGET = 1024, FORGET_HELD = 8 };  // parts of a difference by which a cost moves

static int64_t room_ns(int64_t cost_ns) { return cost_ns + cost_ns / 4; }

void gv_ladder_init(gv_ladder *l, int64_t period_ns) {
  assert(period_ns > 0);
  *l = (gv_ladder){.period_ns = period_ns};
}

static int64_t longest_hold_ns(const gv_ladder *l) {
  return l->period_ns > GV_LADDER_HOLD_NS ? l->period_ns : GV_LADDER_HOLD_NS;
}

static gv_rung cheapest_that_fits(const gv_ladder *l, int64_t left_ns) {
  for (int i = GV_RUNG_FULL; i < GV_RUNG_HOLD; i++)
    if (room_ns(l->cost_ns[i]) <= left_ns)
      return (gv_rung)i;
  return GV_RUNG_HOLD;
}

gv_rung gv_ladder_choose(gv_ladder *l, int64_t left_ns) {
  l->rung = cheapest_that_fits(l, left_ns);
  if (l->rung != GV_RUNG_HOLD) {
    l->held_ns = 0;
    return l->rung;
  }
  if (l->held_ns + l->period_ns > longest_hold_ns(l))
    l->rung = GV_RUNG_RAMP;
  l->held_ns += l->period_ns;
  // Without a step nothing is measured: the last rung is thought cheaper, to be tried again soon.
  l->cost_ns[GV_RUNG_CONTACTS] -= l->cost_ns[GV_RUNG_CONTACTS] / FORGET_HELD;
  return l->rung;
}

static void follow(int64_t *cost_ns, int64_t took_ns, int parts) { *cost_ns += (took_ns - *cost_ns) / parts; }

void gv_ladder_measure(gv_ladder *l, gv_rung rung, int64_t took_ns) {
  assert(rung >= GV_RUNG_FULL && took_ns >= 0);
  assert(rung < GV_RUNG_HOLD);
  const int64_t most_ns = 2 * l->period_ns;
  const int64_t counted_ns = took_ns < most_ns ? took_ns : most_ns;
  follow(&l->cost_ns[rung], counted_ns, FOLLOW);
  for (int i = (int)rung - 1; i >= GV_RUNG_FULL; i--)
    follow(&l->cost_ns[i], counted_ns, FORGET);
  // A lower rung never costs more than a higher one.
  for (int i = (int)rung + 1; i < GV_RUNG_HOLD; i++)
    if (l->cost_ns[i] > l->cost_ns[rung])
      l->cost_ns[i] = l->cost_ns[rung];
}

const char *gv_rung_name(gv_rung rung) {
  static const char *const name[GV_RUNGS] = {"full", "solver", "contacts", "hold", "ramp"};
  return (unsigned)rung < GV_RUNGS ? name[rung] : "?";
}
