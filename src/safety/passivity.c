// SPDX-License-Identifier: BSD-3-Clause
// Passivity observer and controller of the five tendons (gloved/passivity.h: signs, equations and sources).
// Real-time thread; pure.
#include "gloved/passivity.h"

#include <assert.h>
#include <math.h>
#include <string.h>

static const double least_speed2 = 1e-6;  // (1 mm/s)^2: below it there is no swing to be damped
// A glove of 12 bits counts in 0.05 mm of a tendon's way: over a millisecond a speed of 50 mm/s, which a
// damper would turn into 0.3 N of noise at 6 N s/m.
static const double look_least_s = 0.004;
static const double silent_intervals = 2;  // a speed that is older says nothing

#define ROW(member, kind, min, max, laxer, words, sentence)                                                  \
  {"passivity", #member, kind, offsetof(gv_passivity_config, member), min, max, laxer, words, sentence}

static const char *const modes[] = {"off", "on", NULL};

// A finger held lightly is a damper of some 1.5 N s/m along its tendon, one held firmly of 6: 50 is beyond
// what the delay of a glove at 90 Hz leaves stable.
const gv_setting gv_passivity_settings[GV_PASSIVITY_SETTINGS] = {
  ROW(controller, GV_SETTING_CHOICE, 0, 0, GV_LAXER_NEVER, modes,
      "\"on\": a force that swings, and gives out more energy than the hand put in, is damped"),
  ROW(damping_max, GV_SETTING_NUMBER, 0.0, 50.0, GV_LAXER_NEVER, NULL,
      "N s/m along the tendon; the largest damper, at most 50"),
  ROW(add_max_n, GV_SETTING_NUMBER, 0.0, 2.0, GV_LAXER_ABOVE, NULL,
      "the most that it adds to a force, and never more than the force; at most 2"),
};

gv_passivity_config gv_passivity_config_default(void) {
  return (gv_passivity_config){.controller = GV_PASSIVITY_OFF, .damping_max = 20.0, .add_max_n = 1.0};
}

const char *gv_passivity_check(const gv_passivity_config *cfg) {
  for (int i = 0; i < GV_PASSIVITY_SETTINGS; i++)
    if (!gv_setting_sound(&gv_passivity_settings[i], cfg))
      return gv_passivity_settings[i].key;
  return NULL;
}

void gv_passivity_init(gv_passivity *p, const gv_passivity_config *cfg) {
  assert(gv_passivity_check(cfg) == NULL);
  memset(p, 0, sizeof *p);
  p->cfg = *cfg;
}

void gv_passivity_hold(gv_passivity *p, double dt_s, double pulled_s) {
  assert(dt_s >= 0.0 && pulled_s >= 0.0 && pulled_s <= dt_s);
  p->since_s += dt_s;
  for (int i = 0; i < GV_FINGERS; i++) {
    gv_passivity_port *port = &p->port[i];
    port->sent_n_s += port->sent_n * pulled_s;
    port->added_n_s += port->added_n * pulled_s;
  }
}

static void observe(gv_passivity_port *port, double moved_m, double dt_s) {
  port->energy_j += port->sent_n_s / dt_s * moved_m;
  port->dissipated_j += port->added_n_s / dt_s * moved_m;
  port->energy_least_j = fmin(port->energy_least_j, port->energy_j);
  port->look_moved_m += moved_m;
  port->look_naked_n_s += port->sent_n_s - port->added_n_s;
}

// A mean over `over_s` moves by this share of the way to what was so for dt_s.
static double share(double dt_s, double over_s) { return dt_s / (over_s + dt_s); }

// The swinging part without the controller: its mean power, and the damper that takes it up.
static void judge_swing(gv_passivity_port *port, double dt_s, double damping_max) {
  const double slow = share(dt_s, GV_PASSIVITY_SWING_S);
  const double mean = share(dt_s, GV_PASSIVITY_POWER_S);
  const double speed_m_s = port->look_moved_m / dt_s;
  const double naked_n = port->look_naked_n_s / dt_s;
  port->mean_tension_n += slow * (naked_n - port->mean_tension_n);
  port->mean_speed_m_s += slow * (speed_m_s - port->mean_speed_m_s);
  port->speed_m_s = speed_m_s - port->mean_speed_m_s;
  const double power_w = (naked_n - port->mean_tension_n) * port->speed_m_s;
  port->power_w += mean * (power_w - port->power_w);
  port->speed2_m2_s2 += mean * (port->speed_m_s * port->speed_m_s - port->speed2_m2_s2);
  const double lost_w = fmax(0.0, -port->power_w);
  port->damping = fmin(damping_max, lost_w / (port->speed2_m2_s2 + least_speed2));
  port->look_moved_m = 0.0;
  port->look_naked_n_s = 0.0;
}

static void judge_swings(gv_passivity *p, double dt_s) {
  p->look_s += dt_s;
  if (p->look_s < look_least_s)
    return;
  for (int i = 0; i < GV_FINGERS; i++)
    judge_swing(&p->port[i], p->look_s, p->cfg.damping_max);
  p->looked_s = p->look_s;
  p->look_s = 0.0;
}

void gv_passivity_measure(gv_passivity *p, const double way_m[GV_FINGERS]) {
  const double dt_s = p->since_s;
  const bool compared = p->measured && dt_s > 0.0;
  if (p->measured && !compared)
    return;  // twice at one time: the next one has the way of both
  for (int i = 0; i < GV_FINGERS; i++) {
    gv_passivity_port *port = &p->port[i];
    assert(isfinite(way_m[i]));
    if (compared)
      observe(port, way_m[i] - port->way_m, dt_s);
    port->way_m = way_m[i];
    port->sent_n_s = 0.0;
    port->added_n_s = 0.0;
  }
  if (compared)
    judge_swings(p, dt_s);
  p->since_s = 0.0;
  p->measured = true;
}

void gv_passivity_forget_way(gv_passivity *p) { p->measured = false; }

// What is not finite is left to the limiter.
static double damp(const gv_passivity *p, const gv_passivity_port *port, double desired_n) {
  if (!(desired_n > 0.0 && isfinite(desired_n)))
    return desired_n;
  const double most_n = fmin(p->cfg.add_max_n, desired_n);
  return fmax(0.0, desired_n + fmin(most_n, port->damping * port->speed_m_s));
}

void gv_passivity_control(const gv_passivity *p, const double desired_n[GV_FINGERS],
                          double out_n[GV_FINGERS]) {
  const bool silent = p->look_s + p->since_s > silent_intervals * p->looked_s;
  const bool on = p->cfg.controller == GV_PASSIVITY_ON && !silent;
  for (int i = 0; i < GV_FINGERS; i++)
    out_n[i] = on ? damp(p, &p->port[i], desired_n[i]) : desired_n[i];
}

// Of what the controller asked for, what the limiter let through.
static double part_sent(double desired_n, double asked_n, double sent_n) {
  const double asked = asked_n - desired_n;
  const double part = fmin(fmax(sent_n - desired_n, fmin(asked, 0.0)), fmax(asked, 0.0));
  return isfinite(part) ? part : 0.0;
}

void gv_passivity_command(gv_passivity *p, const double desired_n[GV_FINGERS],
                          const double asked_n[GV_FINGERS], const double sent_n[GV_FINGERS]) {
  for (int i = 0; i < GV_FINGERS; i++) {
    gv_passivity_port *port = &p->port[i];
    const bool damped = p->cfg.controller == GV_PASSIVITY_ON;
    port->sent_n = sent_n[i];
    port->added_n = damped ? part_sent(desired_n[i], asked_n[i], sent_n[i]) : 0.0;
  }
}
