// SPDX-License-Identifier: BSD-3-Clause
// Sample conditioning: calibration, anatomy, a gate for jumps, and a critically damped filter e'' + 2
// w e' + w^2 e = 0 towards the last accepted sample, solved exactly over each step, so that it is
// stable for every corner. Its corner goes up with the speed of each joint, of the wrist's position
// and of its orientation (the idea of the 1 Euro Filter: Casiez, Roussel, Vogel 2012; here of second
// order). The speed that chooses it is the filter's own rate behind a low pass of 3 Hz: one step of
// the sensor is no movement. Real-time thread.
#include "hand/condition.h"

#include <assert.h>
#include <string.h>

static const double beyond_rad = 0.05;  // readings this far outside the anatomy are worth counting
// What a speed lifts the corner by: a joint is at 30 Hz from 0.64 rad/s on. Tried on 16 seeds of an 8-bit
// glove and on a recorded hand (test_real, test_condition): 30 is 3 ms slower on the recording, 60 and 1 ms
// faster loses more grasps of a user who moves; a rest at 0.5 Hz closes so slowly that tripods are lost, one
// at 2 Hz doubles the noise of the force.
static const double hz_per_rad_s = 45.0;
static const double hz_per_m_s = 100.0;
static const double pace_hz = 3.0;
// With the fingers observed, a joint's corner comes down no faster than with this time constant: a hand that
// sways stands still twice a swing, and a corner that falls there makes it late. On 16 seeds of a user who
// sways by 30 mrad at 2 Hz, 1000 N/m (test_real), 0, 0.2, 0.4 and 0.8 s give a pinch a mean error of 0.27,
// 0.17, 0.17 and 0.16 N, and at rest a deviation of up to 0.017, 0.018, 0.018 and 0.021 N. A filter
// that leads a hand on by its speed does no better: what is left is the sensor's noise.
static const double pace_lasts_s = 0.4;
// Samples come in bunches: the way that a gate lets pass is that of this time at the least.
static const double gate_least_s = 0.01;
// Of a tracker whose poses are repeated: what is waited for a new one at most.
static const double repeats_s = 0.03;
// And two receivers of a FASTRAK are measured 60 times a second each, however often a log writes them down:
// of poses that come less often than 200 times a second, the way that a gate lets pass is that of this time
// at the least.
static const double slow_tracker_s = 0.005;
static const double pose_least_s = 1.0 / 60.0;

// exp(-x), x >= 0, from + and * alone: halved until small, Taylor, squared back.
static double exp_neg(double x) {
  int halvings = 0;
  while (x > 0.5 && halvings < 40) {
    x *= 0.5;
    halvings++;
  }
  double term = 1.0;
  double sum = 1.0;
  for (int i = 1; i < 20; i++) {
    term *= -x / i;
    sum += term;
  }
  while (halvings-- > 0)
    sum *= sum;
  return sum;
}

// e(h) = (e + (v + w e) h) exp(-w h),  v(h) = (v - w (v + w e) h) exp(-w h)
static gv_decay make_decay(double omega, double h) {
  assert(omega >= 0.0 && h > 0.0);
  const double decay = exp_neg(omega * h);
  return (gv_decay){
    .ee = (1.0 + omega * h) * decay,
    .ev = h * decay,
    .ve = -omega * omega * h * decay,
    .vv = (1.0 - omega * h) * decay,
  };
}

static void make_corners(gv_condition *c, const gv_config *cfg) {
  const double top_hz = cfg->filter_hz;
  const double rest_hz = cfg->filter_rest_hz > 0.0 ? fmin(cfg->filter_rest_hz, top_hz) : top_hz;
  const double spacing_hz = (top_hz - rest_hz) / (GV_CORNERS - 1);
  for (int i = 0; i < GV_CORNERS; i++) {
    const double hz = i == GV_CORNERS - 1 ? top_hz : rest_hz + i * spacing_hz;
    c->corner[i] = make_decay(2.0 * GV_PI * hz, cfg->step_s);
  }
  c->corner_per_rad_s = spacing_hz > 0.0 ? hz_per_rad_s / spacing_hz : 0.0;
  c->corner_per_m_s = spacing_hz > 0.0 ? hz_per_m_s / spacing_hz : 0.0;
  c->pace_share = 1.0 - exp_neg(2.0 * GV_PI * pace_hz * cfg->step_s);
  c->lively_share = cfg->finger.observed ? exp_neg(cfg->step_s / pace_lasts_s) : 0.0;
}

// Without a filter: at the target in one step.
static void make_no_filter(gv_condition *c, const gv_config *cfg) {
  for (int i = 0; i < GV_CORNERS; i++)
    c->corner[i].ve = -1.0 / cfg->step_s;
}

void gv_condition_init(gv_condition *c, const gv_config *cfg) {
  assert(cfg->step_s > 0.0);
  memset(c, 0, sizeof *c);
  c->wrist = gv_pose_identity();
  c->wrist_target = gv_pose_identity();
  c->wrist_held = gv_pose_identity();
  c->smooth = cfg->filter_hz > 0.0;
  if (c->smooth)
    make_corners(c, cfg);
  else
    make_no_filter(c, cfg);
}

// A jump passes only when the next sample says the same. Returns true where the value was held back.
static bool gate_joint(gv_condition *c, int i, double value, double gate) {
  const bool agrees = !(gate > 0.0) || fabs(value - c->target[i]) <= gate;
  c->holding[i] = !agrees && !(c->holding[i] && fabs(value - c->held[i]) <= gate);
  c->held[i] = value;
  if (!c->holding[i]) {
    c->target[i] = value;
    c->shown[i] = c->bend[i];
  }
  return c->holding[i];
}

// What a gate in units a second lets pass in one sample that came age_s after the last.
static double gate_of(double per_s, double age_s) {
  assert(age_s >= 0.0);
  return per_s * fmax(age_s, gate_least_s);
}

static int refuse(gv_condition *c, gv_sample_refusal why) {
  c->why |= why;
  return 1;
}

static int take_glove(gv_condition *c, const gv_config *cfg, const gv_sample *sample, uint64_t *limited) {
  for (int i = 0; i < GV_SENSORS; i++)
    if (!isfinite(sample->raw[i]))
      return refuse(c, GV_SAMPLE_NOT_FINITE);
  const double gate = gate_of(cfg->gate_rad_s, c->glove_age_s);
  int refused = 0;
  c->glove_age_s = 0.0;
  for (int i = 0; i < GV_SENSORS; i++) {
    double read = gv_calibration_angle(&cfg->calibration, i, sample->raw[i]);
    double a = gv_clamp(read, cfg->hand.angle_min_rad[i], cfg->hand.angle_max_rad[i]);
    if (fabs(a - read) > beyond_rad)
      (*limited)++;
    if (!c->glove_seen)
      c->angle[i] = c->target[i] = c->held[i] = a;
    else if (gate_joint(c, i, a, gate))
      refused += refuse(c, GV_SAMPLE_JUMP);
  }
  c->glove_seen = true;
  return refused;
}

static bool pose_jumps(const gv_pose *T, const gv_pose *from, double gate_m, double gate_rad) {
  if (gate_m > 0.0 && gv_norm(gv_sub(T->p, from->p)) > gate_m)
    return true;
  return gate_rad > 0.0 && gv_norm(gv_quat_log(gv_quat_mul(T->q, gv_quat_conj(from->q)))) > gate_rad;
}

// A log that is faster than its tracker holds poses twice, and what comes then has had the time of both; a
// tracker that stands still for longer says nothing about how far the hand may have got.
static double pose_age(const gv_condition *c) {
  const double age_s = c->pose_age_s < slow_tracker_s ? c->pose_age_s : fmax(c->pose_age_s, pose_least_s);
  return fmax(age_s, fmin(c->pose_news_s, repeats_s));
}

// Where a hand that goes on as it went would be now; its orientation is that of the last pose.
static gv_pose led_on(const gv_condition *c, double age_s) {
  const double share = c->wrist_step_s > 0.0 ? fmin(age_s / c->wrist_step_s, 2.0) : 0.0;
  return (gv_pose){c->wrist_target.q, gv_mad(c->wrist_target.p, share, c->wrist_step_m)};
}

static void accept_pose(gv_condition *c, const gv_pose *T, double age_s) {
  c->wrist_step_m = gv_sub(T->p, c->wrist_target.p);
  c->wrist_step_s = age_s;
  c->wrist_target = *T;
}

static bool same_pose(const gv_pose *a, const gv_pose *b) { return memcmp(a, b, sizeof *a) == 0; }

static int take_pose(gv_condition *c, const gv_config *cfg, const gv_sample *sample) {
  gv_pose T = sample->T_world_receiver;
  double n = T.q.w * T.q.w + T.q.x * T.q.x + T.q.y * T.q.y + T.q.z * T.q.z;
  if (!gv_pose_finite(T))
    return refuse(c, GV_SAMPLE_NOT_FINITE);
  if (fabs(n - 1.0) > 0.01 || gv_norm(T.p) > GV_FARTHEST_M)
    return refuse(c, GV_SAMPLE_NO_POSE);
  const double age_s = pose_age(c);
  const double gate_m = gate_of(cfg->gate_m_s, age_s);
  const double gate_rad = gate_of(cfg->gate_rad_s, age_s);
  c->pose_age_s = 0.0;
  T.q = gv_quat_normalize(T.q);
  T = gv_pose_mul(T, cfg->T_receiver_wrist);
  if (!c->pose_seen) {
    c->wrist = c->wrist_target = c->wrist_held = T;
    c->pose_seen = true;
    c->pose_news_s = 0.0;
    return 0;
  }
  const bool repeated = same_pose(&T, &c->wrist_held);
  const bool confirmed = c->wrist_holding && !pose_jumps(&T, &c->wrist_held, gate_m, gate_rad);
  const gv_pose ahead = led_on(c, age_s);
  const bool jumps = pose_jumps(&T, &c->wrist_target, gate_m, gate_rad) &&
                     pose_jumps(&T, &ahead, gate_m, gate_rad);
  c->wrist_holding = jumps && !confirmed;
  c->wrist_held = T;
  if (!c->wrist_holding && !repeated)
    accept_pose(c, &T, age_s);
  else if (!c->wrist_holding)
    c->wrist_target = T;
  if (!repeated)
    c->pose_news_s = 0.0;
  return c->wrist_holding ? refuse(c, GV_SAMPLE_JUMP) : 0;
}

int gv_condition_sample(gv_condition *c, const gv_config *cfg, const gv_sample *sample, uint64_t *limited) {
  int refused = 0;
  c->why = 0;
  if (sample->glove_new)
    refused += take_glove(c, cfg, sample, limited);
  if (sample->pose_new)
    refused += take_pose(c, cfg, sample);
  return refused;
}

static const gv_decay *corner_at(const gv_condition *c, double corner) {
  assert(corner >= 0.0);
  return &c->corner[corner < GV_CORNERS - 1 ? (int)(corner + 0.5) : GV_CORNERS - 1];
}

static void step_joint(gv_condition *c, int i) {
  const double target = c->target[i] - c->shown[i];
  const double e = c->angle[i] - target;
  const double v = c->rate[i];
  c->pace[i] += c->pace_share * (v - c->pace[i]);
  c->lively[i] = fmax(fabs(c->pace[i]), c->lively_share * c->lively[i]);
  const gv_decay *d = corner_at(c, c->corner_per_rad_s * c->lively[i]);
  c->angle[i] = target + (d->ee * e + d->ev * v);
  c->rate[i] = d->ve * e + d->vv * v;
}

// One step of a deviation e and its velocity v.
static void step_vector(const gv_condition *c, double corner_per_speed, gv_vec3 *pace, gv_vec3 *e,
                        gv_vec3 *v) {
  const gv_vec3 e0 = *e;
  *pace = gv_mad(*pace, c->pace_share, gv_sub(*v, *pace));
  const gv_decay *d = corner_at(c, corner_per_speed * gv_norm(*pace));
  *e = gv_mad(gv_scale(e0, d->ee), d->ev, *v);
  *v = gv_mad(gv_scale(e0, d->ve), d->vv, *v);
}

void gv_condition_pull(gv_condition *c, const gv_config *cfg, const double tension_n[GV_FINGERS]) {
  if (!cfg->finger.observed)
    return;
  gv_fingers_step(&c->fingers, &cfg->finger, tension_n, cfg->step_s);
  gv_fingers_bend(&c->fingers, c->bend);
}

void gv_condition_step(gv_condition *c, const gv_config *cfg) {
  assert(cfg->step_s > 0.0);
  c->glove_age_s += cfg->step_s;
  c->pose_age_s += cfg->step_s;
  c->pose_news_s += cfg->step_s;
  for (int i = 0; i < GV_SENSORS; i++)
    step_joint(c, i);
  gv_vec3 e = gv_sub(c->wrist.p, c->wrist_target.p);
  step_vector(c, c->corner_per_m_s, &c->pace_v, &e, &c->v);
  c->wrist.p = gv_add(c->wrist_target.p, e);
  // world, target to filtered
  gv_vec3 r = gv_quat_log(gv_quat_mul(c->wrist.q, gv_quat_conj(c->wrist_target.q)));
  step_vector(c, c->corner_per_rad_s, &c->pace_w, &r, &c->w);
  c->wrist.q = gv_quat_normalize(gv_quat_mul(gv_quat_exp(r), c->wrist_target.q));
}

void gv_condition_output(const gv_condition *c, const gv_config *cfg, double out_angle_rad[GV_SENSORS],
                         gv_pose *out_wrist) {
  // without the filter a rate is a whole sample's step over one period
  const double lead = c->smooth ? cfg->prediction_s : 0.0;
  for (int i = 0; i < GV_SENSORS; i++)
    out_angle_rad[i] = gv_clamp(c->angle[i] + lead * c->rate[i] + c->bend[i], cfg->hand.angle_min_rad[i],
                                cfg->hand.angle_max_rad[i]);
  *out_wrist = c->wrist;
  if (!(lead > 0.0))
    return;
  out_wrist->p = gv_mad(c->wrist.p, lead, c->v);
  out_wrist->q = gv_quat_normalize(gv_quat_mul(gv_quat_exp(gv_scale(c->w, lead)), c->wrist.q));
}
