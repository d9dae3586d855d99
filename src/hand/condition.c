// SPDX-License-Identifier: BSD-3-Clause
// Sample conditioning: calibration, anatomy, a gate for single-sample jumps, and a critically damped filter
// e'' + 2 w e' + w^2 e = 0 towards the last accepted sample, solved exactly over each step, so that it is
// stable for every corner. Delay for a ramp: 2 / w = 1 / (pi f). Real-time thread.
#include "hand/condition.h"

#include <string.h>

static const double beyond_rad = 0.05;  // readings this far outside the anatomy are worth counting

// exp(-x), x >= 0, from + and * alone: halved until small, Taylor, squared back.
static double exp_neg(double x) {
  int halvings = 0;
  while (x > 0.5 && halvings < 40) { x *= 0.5; halvings++; }
  double term = 1.0, sum = 1.0;
  for (int i = 1; i < 20; i++) { term *= -x / i; sum += term; }
  while (halvings-- > 0) sum *= sum;
  return sum;
}

// e(h) = (e + (v + w e) h) exp(-w h),  v(h) = (v - w (v + w e) h) exp(-w h)
static void make_filter(gv_condition *c, double omega, double h) {
  const double decay = exp_neg(omega * h);
  c->ee = (1.0 + omega * h) * decay;
  c->ev = h * decay;
  c->ve = -omega * omega * h * decay;
  c->vv = (1.0 - omega * h) * decay;
}

void gv_condition_init(gv_condition *c, const gv_config *cfg) {
  memset(c, 0, sizeof *c);
  c->wrist = c->wrist_target = c->wrist_held = gv_pose_identity();
  if (cfg->filter_hz > 0.0) {
    make_filter(c, 2.0 * GV_PI * cfg->filter_hz, cfg->step_s);
    c->smooth = true;
  } else {
    c->ve = -1.0 / cfg->step_s;  // at the target in one step
  }
}

// A jump passes only when the next sample says the same. Returns true where the value was held back.
static bool gate_joint(gv_condition *c, int i, double value, double gate) {
  bool near = !(gate > 0.0) || fabs(value - c->target[i]) <= gate;
  c->holding[i] = !near && !(c->holding[i] && fabs(value - c->held[i]) <= gate);
  c->held[i] = value;
  if (!c->holding[i]) c->target[i] = value;
  return c->holding[i];
}

static int take_glove(gv_condition *c, const gv_config *cfg, const gv_sample *sample, uint64_t *limited) {
  for (int i = 0; i < GV_SENSORS; i++)
    if (!isfinite(sample->raw[i])) return 1;
  int refused = 0;
  for (int i = 0; i < GV_SENSORS; i++) {
    double read = gv_calibration_angle(&cfg->calibration, i, sample->raw[i]);
    double a = gv_clamp(read, cfg->hand.angle_min_rad[i], cfg->hand.angle_max_rad[i]);
    if (fabs(a - read) > beyond_rad) (*limited)++;
    if (!c->glove_seen) c->angle[i] = c->target[i] = c->held[i] = a;
    else refused += gate_joint(c, i, a, cfg->gate_rad);
  }
  c->glove_seen = true;
  return refused;
}

static bool pose_jumps(const gv_pose *T, const gv_pose *from, const gv_config *cfg) {
  bool far = cfg->gate_m > 0.0 && gv_norm(gv_sub(T->p, from->p)) > cfg->gate_m;
  return far || (cfg->gate_rad > 0.0 && gv_norm(gv_quat_log(gv_quat_mul(T->q, gv_quat_conj(from->q)))) > cfg->gate_rad);
}

static int take_pose(gv_condition *c, const gv_config *cfg, const gv_sample *sample) {
  gv_pose T = sample->T_world_receiver;
  double n = T.q.w * T.q.w + T.q.x * T.q.x + T.q.y * T.q.y + T.q.z * T.q.z;
  if (!gv_pose_finite(T) || fabs(n - 1.0) > 0.01 || gv_norm(T.p) > 100.0) return 1;
  T.q = gv_quat_normalize(T.q);
  T = gv_pose_mul(T, cfg->T_receiver_wrist);
  if (!c->pose_seen) {
    c->wrist = c->wrist_target = c->wrist_held = T;
    c->pose_seen = true;
    return 0;
  }
  bool confirmed = c->wrist_holding && !pose_jumps(&T, &c->wrist_held, cfg);
  c->wrist_holding = pose_jumps(&T, &c->wrist_target, cfg) && !confirmed;
  c->wrist_held = T;
  if (!c->wrist_holding) c->wrist_target = T;
  return c->wrist_holding;
}

int gv_condition_sample(gv_condition *c, const gv_config *cfg, const gv_sample *sample, uint64_t *limited) {
  int refused = 0;
  if (sample->glove_new) refused += take_glove(c, cfg, sample, limited);
  if (sample->pose_new) refused += take_pose(c, cfg, sample);
  return refused;
}

static void decay_vector(const gv_condition *c, gv_vec3 *e, gv_vec3 *v) {
  gv_vec3 e0 = *e;
  *e = gv_mad(gv_scale(e0, c->ee), c->ev, *v);
  *v = gv_mad(gv_scale(e0, c->ve), c->vv, *v);
}

void gv_condition_step(gv_condition *c) {
  for (int i = 0; i < GV_SENSORS; i++) {
    double e = c->angle[i] - c->target[i], v = c->rate[i];
    c->angle[i] = c->target[i] + (c->ee * e + c->ev * v);
    c->rate[i] = c->ve * e + c->vv * v;
  }
  gv_vec3 e = gv_sub(c->wrist.p, c->wrist_target.p);
  decay_vector(c, &e, &c->v);
  c->wrist.p = gv_add(c->wrist_target.p, e);
  gv_vec3 r = gv_quat_log(gv_quat_mul(c->wrist.q, gv_quat_conj(c->wrist_target.q)));  // world, target to filtered
  decay_vector(c, &r, &c->w);
  c->wrist.q = gv_quat_normalize(gv_quat_mul(gv_quat_exp(r), c->wrist_target.q));
}

void gv_condition_output(const gv_condition *c, const gv_config *cfg, double out_angle_rad[GV_SENSORS], gv_pose *out_wrist) {
  const double lead = c->smooth ? cfg->prediction_s : 0.0;  // without the filter a rate is a whole sample's step over one period
  for (int i = 0; i < GV_SENSORS; i++)
    out_angle_rad[i] = gv_clamp(c->angle[i] + lead * c->rate[i], cfg->hand.angle_min_rad[i], cfg->hand.angle_max_rad[i]);
  *out_wrist = c->wrist;
  if (!(lead > 0.0)) return;
  out_wrist->p = gv_mad(c->wrist.p, lead, c->v);
  out_wrist->q = gv_quat_normalize(gv_quat_mul(gv_quat_exp(gv_scale(c->w, lead)), c->wrist.q));
}
