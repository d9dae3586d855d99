// SPDX-License-Identifier: BSD-3-Clause
// Device frames to engine sample, engine answer to force command: decode (fcu.h), keep the newest good
// glove and hand pose and their ages, step engine, safety machine and limiter, pack. Pure glue in the
// real-time thread.
//
// Counters (modulo 256, one per id): wire/stream.h. The frames of one period are taken in the
// order of their counters; one that is older than what was used is dropped, since time in the
// simulation never runs backwards.
#include "daemon/loop/session.h"

#include <assert.h>
#include <math.h>
#include <string.h>

void gv_session_init(gv_session *session, const gv_session_config *cfg, gv_engine *engine) {
  assert(cfg->period_s > 0.0 && engine);
  *session = (gv_session){
    .cfg = *cfg, .engine = engine, .glove_age_s = HUGE_VAL, .hand_age_s = HUGE_VAL, .status_age_s = HUGE_VAL};
  session->hand.T_world_receiver = session->sample.T_world_receiver = gv_pose_identity();
  session->limb_configured = gv_engine_config(engine)->limb;
  session->palm_configured = gv_engine_config(engine)->palm;
  gv_safety_init(&session->safety, &cfg->safety);
  gv_limiter_init(&session->limiter, &cfg->limiter);
  gv_passivity_init(&session->passivity, &cfg->passivity);
  session->limiter.longest_rise_s = cfg->command_s > 0.0 ? cfg->command_s : cfg->period_s;
}

void gv_session_change_engine(gv_session *session, gv_engine *engine, uint64_t steps_before) {
  const gv_session before = *session;
  gv_session_init(session, &before.cfg, engine);
  session->steps_before = steps_before;
  session->frames = before.frames;
  session->glove_stream = before.glove_stream;
  session->pose_stream = before.pose_stream;
  session->status_stream = before.status_stream;
  session->command_counter = before.command_counter;
  session->passivity = before.passivity;
  session->passed_ns = before.passed_ns;
  gv_passivity_forget_way(&session->passivity);
  session->faults_seen = before.faults_seen;
  memcpy(session->force_max_n, before.force_max_n, sizeof session->force_max_n);
}

int64_t gv_session_steps(const gv_session *session) {
  return (int64_t)(session->steps_before + gv_engine_counters(session->engine)->steps);
}

// Whether a frame with this counter is new in its stream.
static bool accept_counter(gv_session *session, gv_stream *stream, uint8_t counter, int64_t now_ns) {
  const gv_stream_verdict verdict = gv_stream_take(stream, counter, now_ns);
  session->frames.lost += (uint64_t)(int64_t)verdict.lost;  // one less where a late frame takes its loss back
  session->frames.errors += verdict.errors;
  session->frames.late += verdict.is_new ? 0 : 1;
  return verdict.is_new;
}

// A sample that is too old already counts as late (it still moves the simulated hand).
static void take_source(gv_session *session, gv_source *source, const gv_frame *frame, int64_t now_ns,
                        uint32_t stamp_us, uint32_t age_us) {
  gv_source_take(source, frame->stamp_ns, stamp_us, age_us);
  if ((double)(now_ns - source->time_ns) * 1e-9 > session->cfg.safety.max_age_s)
    session->frames.late++;
}

// ---- what a sound frame says against a force -----------------------------------------------------------

static uint32_t heed_glove(gv_session *session, const gv_glove_msg *msg) {
  const bool other_hand = ((msg->flags & GV_GLOVE_LEFT) != 0) != (session->cfg.side == GV_LEFT);
  const bool sensor_fault = (msg->flags & GV_GLOVE_SENSOR_FAULT) != 0;
  const uint32_t doubts = (other_hand ? GV_FAULT_OTHER_HAND : 0u) | (sensor_fault ? GV_FAULT_SENSOR : 0u);
  session->switch_open |= !(msg->flags & GV_GLOVE_DEAD_MAN);
  session->doubts_heard |= doubts;
  session->other_hand |= other_hand;
  return doubts;
}

// Beyond 100 m the engine refuses the pose: taking it as fresh here would let a force go on from an old one.
static bool heed_pose(gv_session *session, const gv_pose_msg *msg) {
  const bool usable = (msg->flags & GV_POSE_VALID) && !(msg->flags & GV_POSE_TRACKER_ERROR) &&
                      gv_norm(msg->T_world_receiver.p) <= GV_FARTHEST_M;
  if (!usable && msg->receiver == GV_RECEIVER_HAND)
    session->doubts_heard |= GV_FAULT_TRACKER;
  return !usable;
}

static void heed_status(gv_session *session, const gv_status_msg *msg) {
  session->switch_open |= !(msg->flags & GV_STATUS_DEAD_MAN);
  if (msg->flags & GV_STATUS_FAULT)
    session->doubts_heard |= GV_FAULT_DEVICE;
}

void gv_session_heed(gv_session *session, const gv_frame *frame, int count) {
  gv_glove_msg glove;
  gv_pose_msg pose;
  gv_status_msg status;
  for (int i = 0; i < count; i++) {
    if (frame[i].id == GV_ID_GLOVE && gv_fcu_unpack_glove(&frame[i], &glove) == GV_FCU_OK)
      heed_glove(session, &glove);
    if (frame[i].id == GV_ID_POSE && gv_fcu_unpack_pose(&frame[i], &pose) == GV_FCU_OK)
      heed_pose(session, &pose);
    if (frame[i].id == GV_ID_STATUS && gv_fcu_unpack_status(&frame[i], &status) == GV_FCU_OK)
      heed_status(session, &status);
  }
}

static void forget_what_was_heard(gv_session *session) {
  session->switch_open = false;
  session->doubts_heard = 0;
}

// ---- frames of a step ------------------------------------------------------------------------------------

static gv_fcu_error take_glove(gv_session *session, const gv_frame *frame, int64_t now_ns) {
  gv_glove_msg msg;
  gv_fcu_error error = gv_fcu_unpack_glove(frame, &msg);
  if (error)
    return error;
  const uint32_t doubts = heed_glove(session, &msg);
  if (!accept_counter(session, &session->glove_stream, msg.counter, now_ns))
    return GV_FCU_OK;
  session->glove_doubt = doubts;
  if (doubts) {
    session->frames.unusable++;
    return GV_FCU_OK;
  }
  session->glove = msg;
  take_source(session, &session->glove_source, frame, now_ns, msg.stamp_us, msg.age_us);
  session->sample.glove_new = true;
  return GV_FCU_OK;
}

static gv_fcu_error take_pose(gv_session *session, const gv_frame *frame, int64_t now_ns) {
  gv_pose_msg msg;
  gv_fcu_error error = gv_fcu_unpack_pose(frame, &msg);
  if (error)
    return error;
  const bool in_doubt = heed_pose(session, &msg);
  if (!accept_counter(session, &session->pose_stream, msg.counter, now_ns))
    return GV_FCU_OK;
  if (in_doubt) {
    if (msg.receiver == GV_RECEIVER_HAND)
      session->hand_source.doubt = true;
    session->frames.unusable++;
  } else if (msg.receiver == GV_RECEIVER_HEAD) {
    session->head = msg;
    session->head_seen = true;
  } else if (msg.receiver == GV_RECEIVER_HAND) {
    session->hand = msg;
    take_source(session, &session->hand_source, frame, now_ns, msg.stamp_us, msg.age_us);
    session->sample.pose_new = true;
  }
  return GV_FCU_OK;
}

static gv_fcu_error take_status(gv_session *session, const gv_frame *frame, int64_t now_ns) {
  gv_status_msg msg;
  gv_fcu_error error = gv_fcu_unpack_status(frame, &msg);
  if (error)
    return error;
  heed_status(session, &msg);
  if (!accept_counter(session, &session->status_stream, msg.counter, now_ns))
    return GV_FCU_OK;
  session->status = msg;
  gv_source_take(&session->status_source, frame->stamp_ns, msg.stamp_us, 0);
  return GV_FCU_OK;
}

void gv_session_set_rung(gv_session *session, gv_rung rung) {
  assert((unsigned)rung < GV_RUNGS);
  static const gv_effort of_rung[] = {
    [GV_RUNG_FULL] = {1.0, GV_MAX_CONTACTS},
    [GV_RUNG_SOLVER] = {0.25, GV_MAX_CONTACTS},
    [GV_RUNG_CONTACTS] = {0.25, 24},
  };
  const gv_rung least = rung < GV_RUNG_CONTACTS ? rung : GV_RUNG_CONTACTS;
  if (session->rung != least)
    gv_engine_set_effort(session->engine, of_rung[least]);
  session->rung = least;
}

// Only the engine itself writes these; on a wire they are foreign.
static gv_fcu_error take_effort(gv_session *session, const gv_frame *frame) {
  gv_effort_msg msg;
  gv_fcu_error error = gv_fcu_unpack_effort(frame, &msg);
  if (!error)
    gv_session_set_rung(session, (gv_rung)msg.rung);
  return error;
}

static gv_fcu_error take_pull(gv_session *session, const gv_frame *frame) {
  gv_pull_msg msg;
  gv_fcu_error error = gv_fcu_unpack_pull(frame, &msg);
  if (error)
    return error;
  memcpy(session->sample.tension_n, msg.tension_n, sizeof session->sample.tension_n);
  session->pull_recorded = true;
  return GV_FCU_OK;
}

static void take_frame(gv_session *session, const gv_frame *frame, int64_t now_ns) {
  gv_fcu_error error = GV_FCU_OK;
  if (frame->id == GV_ID_EFFORT && session->cfg.replay && take_effort(session, frame) == GV_FCU_OK)
    return;
  if (frame->id == GV_ID_PULL && session->cfg.replay && take_pull(session, frame) == GV_FCU_OK)
    return;
  session->frames.rx++;
  switch (frame->id) {
    case GV_ID_GLOVE: error = take_glove(session, frame, now_ns); break;
    case GV_ID_POSE: error = take_pose(session, frame, now_ns); break;
    case GV_ID_STATUS: error = take_status(session, frame, now_ns); break;
    default: session->frames.foreign++;
  }
  if (error) {
    session->frames.bad++;
    session->frames.errors++;
  }
}

// All frames of a period, and what the gaps in their counters amount to.
static void take_frames(gv_session *session, const gv_frame *frame, int count, int64_t now_ns) {
  assert(count >= 0);
  uint16_t order[GV_ORDER_MAX];
  for (int first = 0; first < count; first += GV_ORDER_MAX) {
    const int here = count - first < GV_ORDER_MAX ? count - first : GV_ORDER_MAX;
    gv_stream_order(&frame[first], here, order);
    for (int i = 0; i < here; i++)
      take_frame(session, &frame[first + order[i]], now_ns);
  }
  session->frames.errors += gv_stream_give_up(&session->glove_stream, now_ns);
  session->frames.errors += gv_stream_give_up(&session->pose_stream, now_ns);
  session->frames.errors += gv_stream_give_up(&session->status_stream, now_ns);
}

static void fill_sample(gv_session *session) {
  for (int i = 0; i < GV_SENSORS; i++)
    session->sample.raw[i] = session->glove.raw[i];
  session->sample.T_world_receiver = session->hand.T_world_receiver;
  if (!session->pull_recorded)
    memcpy(session->sample.tension_n, session->force_n, sizeof session->sample.tension_n);
}

static bool all_finite(const double value[GV_FINGERS]) {
  for (int i = 0; i < GV_FINGERS; i++)
    if (!isfinite(value[i]))
      return false;
  return true;
}

static double largest(const double value[GV_FINGERS]) {
  double max = 0.0;
  for (int i = 0; i < GV_FINGERS; i++)
    max = fmax(max, value[i]);
  return max;
}

// A step that came late is one overrun however late it came: a shared machine stalls for 10 to 30 ms
// now and then, and the device's watchdog has let go of the force by then. A stall beyond the
// largest age of a sample is a fault at once: nobody knows where the hand was meanwhile, and frames
// that waited in a socket look fresh.
static unsigned count_overruns(const gv_session *session, unsigned periods_skipped) {
  const double pause_s = fmax(periods_skipped * session->cfg.period_s, session->pause_s);
  if (pause_s > session->cfg.safety.max_age_s)
    return session->cfg.safety.overrun_limit + 1;
  return periods_skipped > 0 ? 1 : 0;
}

// Held: both who know the switch say so in their newest messages, and no sound frame
// of this step says otherwise.
static bool dead_man_held(const gv_session *session) {
  const bool glove_held = session->glove_source.seen && (session->glove.flags & GV_GLOVE_DEAD_MAN);
  const bool device_held = !session->status_source.seen || (session->status.flags & GV_STATUS_DEAD_MAN);
  return glove_held && device_held && !session->switch_open;
}

static void step_safety(gv_session *session, unsigned frame_errors, unsigned periods_skipped) {
  const bool held = dead_man_held(session);
  session->disarmed = session->disarmed && held;
  const gv_safety_input in = {
    .glove_seen = session->glove_source.seen,
    .tracker_seen = session->hand_source.seen,
    .status_seen = session->status_source.seen,
    .glove_age_s = session->glove_age_s,
    .tracker_age_s = session->hand_age_s,
    .status_age_s = session->status_age_s,
    .glove_interval_s = session->glove_source.interval_s,
    .tracker_interval_s = session->hand_source.interval_s,
    .status_interval_s = session->status_source.interval_s,
    .doubts = session->glove_doubt | (session->hand_source.doubt ? GV_FAULT_TRACKER : 0u) |
              session->doubts_heard | (session->other_in_fault ? GV_FAULT_OTHER_DEVICE : 0u),
    .dead_man = held && !session->disarmed,
    .finite = all_finite(session->result.tension_n),
    .device_fault = (session->status_source.seen && (session->status.flags & GV_STATUS_FAULT)) ||
                    (session->doubts_heard & GV_FAULT_DEVICE),
    .bad_frames = frame_errors,
    .overruns = count_overruns(session, periods_skipped),
    .desired_max_n = largest(session->result.tension_n),
  };
  gv_safety_step(&session->safety, &in, session->cfg.period_s);
  session->faults_seen |= session->safety.faults;
}

// Between two steps, as the safety machine will see it in the next one.
static bool is_older_than_allowed(const gv_source *source, double age_s, double max_age_s) {
  return source->seen && age_s > gv_source_largest_age_s(source->interval_s, max_age_s);
}

// Nothing that came or stayed away since the last step ends the force.
static bool nothing_speaks_against(const gv_session *session) {
  const gv_safety_config *c = &session->cfg.safety;
  return !session->switch_open && !session->doubts_heard && !session->other_in_fault &&
         !is_older_than_allowed(&session->glove_source, session->glove_age_s, c->max_age_s) &&
         !is_older_than_allowed(&session->hand_source, session->hand_age_s, c->max_age_s) &&
         !is_older_than_allowed(&session->status_source, session->status_age_s, c->status_age_s);
}

static uint32_t age_us(double seconds) {
  return seconds < 0.65 ? (uint32_t)fmax(0.0, seconds * 1e6) : 655350u;
}

// The device has pulled with the last command until now, or until its watchdog let go.
static void let_time_pass(gv_session *session, int64_t now_ns) {
  const bool first = session->frames.tx == 0;
  const double passed_s = first ? 0.0 : fmax(0.0, (double)(now_ns - session->passed_ns) * 1e-9);
  session->passed_ns = now_ns;
  gv_passivity_hold(&session->passivity, passed_s, fmin(passed_s, GV_DEVICE_WATCHDOG_S));
}

static void measure_tendons(gv_session *session, int64_t now_ns) {
  double way_m[GV_FINGERS];
  if (!session->sample.glove_new)
    return;
  let_time_pass(session, now_ns);
  gv_tendon_way(gv_engine_measured_of(session->engine, session->cfg.hand), way_m);
  gv_passivity_measure(&session->passivity, way_m);
}

// What the passivity controller makes of the desired forces, limited: what leaves.
static unsigned limit_force(gv_session *session, const double desired_n[GV_FINGERS], bool enabled,
                            double dt_s) {
  double asked_n[GV_FINGERS], sent_n[GV_FINGERS];
  const double age_s = fmax(session->glove_age_s, session->hand_age_s);
  gv_passivity_control(&session->passivity, desired_n, asked_n);
  const unsigned flags = gv_limiter_step(&session->limiter, asked_n, enabled, age_s, dt_s, session->force_n);
  for (int i = 0; i < GV_FINGERS; i++)
    sent_n[i] = gv_fcu_command_tension(session->force_n[i]);
  gv_passivity_command(&session->passivity, desired_n, asked_n, sent_n);
  return flags;
}

// Limits the desired forces and packs what is left of them: the one way of a force out of the daemon.
static void send_force(gv_session *session, const double desired_n[GV_FINGERS], double dt_s,
                       gv_frame *out_command) {
  const bool enabled = gv_safety_lets_force_out(&session->safety) && nothing_speaks_against(session);
  session->limiter_flags = limit_force(session, desired_n, enabled, dt_s);
  gv_command_msg *msg = &session->command;
  // While a fault ramps down the device stays enabled: switching off at full force would be a jerk.
  const int enable = enabled || largest(session->force_n) > 0.0 ? GV_COMMAND_ENABLE : 0;
  const int ending = session->safety.state == GV_SAFETY_STOPPED ? GV_COMMAND_ENDING : 0;
  const int repeat = session->told && !ending ? GV_COMMAND_REPEAT : 0;
  session->told = true;
  *msg = (gv_command_msg){.counter = session->command_counter++,
                          .flags = (uint8_t)(enable | ending | repeat),
                          .sample_stamp_us = session->glove.stamp_us,
                          .age_us = age_us(session->glove_age_s),
                          .frames_taken = (uint16_t)(session->frames.rx - session->frames.foreign)};
  memcpy(msg->tension_n, session->force_n, sizeof msg->tension_n);
  for (int i = 0; i < GV_FINGERS; i++)
    session->force_max_n[i] = fmax(session->force_max_n[i], session->force_n[i]);
  gv_fcu_pack_command(msg, out_command);
  session->frames.tx++;
}

static void update_ages(gv_session *session, int64_t now_ns) {
  const gv_safety_config *safety = &session->cfg.safety;
  session->glove_age_s = gv_source_age_s(&session->glove_source, now_ns, safety->max_age_s);
  session->hand_age_s = gv_source_age_s(&session->hand_source, now_ns, safety->max_age_s);
  session->status_age_s = gv_source_age_s(&session->status_source, now_ns, safety->status_age_s);
}

// Time since the last command. After a pause in which the device let go by itself, forces start from none:
// going on at the old one, and be it on the ramp down, would pull once more.
static double since_command_s(gv_session *session, int64_t now_ns) {
  const bool first = session->frames.tx == 0;
  const double passed_s = first ? session->cfg.period_s
                                : fmax(0.0, (double)(now_ns - session->commanded_ns) * 1e-9);
  session->commanded_ns = now_ns;
  if (passed_s >= fmax(GV_DEVICE_WATCHDOG_S, 1.5 * session->limiter.longest_rise_s))
    memset(session->limiter.out_n, 0, sizeof session->limiter.out_n);
  return passed_s;
}

void gv_session_take(gv_session *session, int64_t now_ns, const gv_frame *frame, int count) {
  session->errors_before = session->frames.errors;
  session->pause_s = gv_engine_counters(session->engine)->steps
                         ? (double)(now_ns - session->stepped_ns) * 1e-9
                         : 0.0;
  session->stepped_ns = now_ns;
  session->sample.glove_new = session->sample.pose_new = session->told = false;
  session->pull_recorded = false;
  forget_what_was_heard(session);
  take_frames(session, frame, count, now_ns);
  fill_sample(session);
  update_ages(session, now_ns);
}

void gv_session_judge(gv_session *session, int64_t now_ns, unsigned periods_skipped) {
  measure_tendons(session, now_ns);
  step_safety(session, (unsigned)(session->frames.errors - session->errors_before), periods_skipped);
}

void gv_session_compute(gv_session *session, int64_t now_ns, const gv_frame *frame, int count,
                        unsigned periods_skipped) {
  gv_session_take(session, now_ns, frame, count);
  gv_engine_step(session->engine, &session->sample, &session->result);
  gv_session_judge(session, now_ns, periods_skipped);
}

void gv_session_hold(gv_session *session, int64_t now_ns, const gv_frame *frame, int count) {
  forget_what_was_heard(session);
  gv_session_heed(session, frame, count);
  update_ages(session, now_ns);
  step_safety(session, 0, 1);
}

void gv_session_command(gv_session *session, int64_t now_ns, gv_frame *out_command) {
  update_ages(session, now_ns);
  let_time_pass(session, now_ns);
  send_force(session, session->result.tension_n, since_command_s(session, now_ns), out_command);
}

void gv_session_step(gv_session *session, int64_t now_ns, const gv_frame *frame, int count,
                     unsigned periods_skipped, gv_frame *out_command) {
  gv_session_compute(session, now_ns, frame, count, periods_skipped);
  gv_session_command(session, now_ns, out_command);
}

static gv_coupling scaled(gv_coupling c, double factor) {
  const double root = sqrt(factor);
  // Damping below 0 means critical, and stays.
  return (gv_coupling){c.k_f * factor, c.d_f < 0.0 ? c.d_f : c.d_f * root, c.k_t * factor,
                       c.d_t < 0.0 ? c.d_t : c.d_t * root};
}

bool gv_session_force_may_flow(const gv_session *session) {
  return gv_safety_lets_force_out(&session->safety) || largest(session->force_n) > 0.0;
}

bool gv_session_request(gv_session *session, const gv_request *request) {
  gv_engine *engine = session->engine;
  const gv_config *cfg = gv_engine_config(engine);
  switch (request->kind) {
    case GV_REQUEST_RESET:
      if (gv_session_force_may_flow(session))
        return false;
      gv_engine_reset(engine);
      return true;
    case GV_REQUEST_COUPLING: {
      const gv_coupling limb = scaled(session->limb_configured, request->value);
      const gv_coupling palm = scaled(session->palm_configured, request->value);
      return gv_engine_adjust(engine, &limb, &palm, cfg->mu_hand) == 0;
    }
    case GV_REQUEST_FRICTION: return gv_engine_adjust(engine, &cfg->limb, &cfg->palm, request->value) == 0;
    case GV_REQUEST_DISARM: session->disarmed = true; return true;
    case GV_REQUEST_SCENE: return !gv_session_force_may_flow(session);
    case GV_REQUEST_START_LOG:
    case GV_REQUEST_STOP_LOG:
    case GV_REQUEST_TRACE:
    case GV_REQUEST_STATUS:
    case GV_REQUEST_KINDS: break;
  }
  return false;
}

bool gv_session_stop(gv_session *session, int64_t now_ns, gv_frame *out_command) {
  static const double no_force[GV_FINGERS];
  const gv_safety_input in = {.stop = true, .finite = true};
  update_ages(session, now_ns);
  gv_safety_step(&session->safety, &in, session->cfg.period_s);
  let_time_pass(session, now_ns);
  send_force(session, no_force, since_command_s(session, now_ns), out_command);
  return largest(session->force_n) <= 0.0;
}
