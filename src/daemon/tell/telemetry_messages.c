// SPDX-License-Identifier: BSD-3-Clause
// Snapshots, events and steps to LCM messages (data/lcm/*.lcm): GLOVED_STATE, GLOVED_STATS, GLOVED_EVENT,
// GLOVED_TRACE, GLOVED_ABOUT. Slow thread.
#include "daemon/tell/telemetry_state.h"

// ---- GLOVED_STATE ----

static void put_vec3(gv_vec3 v, double out[3]) {
  out[0] = v.x;
  out[1] = v.y;
  out[2] = v.z;
}

static void put_pose(gv_pose T, double out_position[3], double out_quaternion[4]) {
  put_vec3(T.p, out_position);
  out_quaternion[0] = T.q.w;
  out_quaternion[1] = T.q.x;
  out_quaternion[2] = T.q.y;
  out_quaternion[3] = T.q.z;
}

static void put_devices(const gv_snapshot *snapshot, gloved_state_t *out) {
  out->dead_man = snapshot->dead_man;
  out->glove_age_s = isfinite(snapshot->glove_age_s) ? snapshot->glove_age_s : -1.0;
  out->tracker_age_s = isfinite(snapshot->hand_age_s) ? snapshot->hand_age_s : -1.0;
  out->frames_received = (int64_t)snapshot->frames.rx;
  out->frames_sent = (int64_t)snapshot->frames.tx;
  out->frames_lost = (int64_t)snapshot->frames.lost;
  out->frames_bad = (int64_t)snapshot->frames.bad;
  out->frames_late = (int64_t)snapshot->frames.late;
  memcpy(out->force_measured_n, snapshot->measured_n, sizeof out->force_measured_n);
  memcpy(out->angle_rad, snapshot->angle_rad, sizeof out->angle_rad);
  put_pose(snapshot->T_world_receiver, out->wrist_position_m, out->wrist_quaternion);
  put_pose(snapshot->T_world_head, out->head_position_m, out->head_quaternion);
}

static void put_loop(const gv_loop *loop, const gv_snapshot *snapshot, gloved_state_t *out) {
  const gv_quantiles step = gv_histogram_quantiles(&loop->step);
  out->step_p50_us = step.p50_us;
  out->step_p99_us = step.p99_us;
  out->step_max_us = step.max_us;
  out->wake_p99_us = gv_histogram_quantiles(&loop->wake).p99_us;
  out->missed_deadlines = (int64_t)snapshot->missed_deadlines;
  out->overruns = (int64_t)snapshot->overruns;
  out->heap_calls = (int64_t)snapshot->heap_calls;
  out->snapshots_dropped = (int64_t)snapshot->ring_dropped;
}

static void put_engine(const gv_snapshot *snapshot, gloved_state_t *out) {
  out->events = (int32_t)snapshot->events;
  out->contacts_dropped = (int64_t)snapshot->counters.contacts_dropped;
  out->depth_max_m = snapshot->counters.depth_max_m;
  memcpy(out->force_desired_n, snapshot->desired_n, sizeof out->force_desired_n);
  memcpy(out->force_commanded_n, snapshot->force_n, sizeof out->force_commanded_n);
  memcpy(out->energy_j, snapshot->energy_j, sizeof out->energy_j);
  memcpy(out->energy_dissipated_j, snapshot->dissipated_j, sizeof out->energy_dissipated_j);
  for (int i = 0; i < GV_LIMBS; i++) {
    const gv_snapshot_limb *limb = &snapshot->limb[i];
    put_pose(limb->T_world_limb, out->limb[i].position_m, out->limb[i].quaternion);
    put_pose(limb->T_world_driver, out->limb[i].driver_position_m, out->limb[i].driver_quaternion);
    put_vec3(limb->force_n, out->limb[i].force_n);
    put_vec3(limb->torque_nm, out->limb[i].torque_nm);
  }
}

static void put_objects(gv_telemetry *telemetry, const gv_snapshot *snapshot) {
  telemetry->state.num_objects = snapshot->object_count;
  for (int i = 0; i < snapshot->object_count; i++) {
    const gv_object *object = &telemetry->scene->object[i];
    gloved_object_t *out = &telemetry->object[i];
    put_pose(gv_snapshot_object_pose(object, snapshot->object[i].T_world_body), out->position_m,
             out->quaternion);
    put_vec3(snapshot->object[i].velocity_m_s, out->velocity_m_s);
    put_vec3(snapshot->object[i].spin_rad_s, out->spin_rad_s);
  }
}

static void put_contacts(gv_telemetry *telemetry, const gv_snapshot *snapshot) {
  telemetry->state.num_contacts = snapshot->contact_count;
  for (int i = 0; i < snapshot->contact_count; i++) {
    const gv_contact *contact = &snapshot->contact[i];
    gloved_contact_t *out = &telemetry->contact[i];
    out->limb = contact->limb;
    out->object = contact->object;
    out->face = contact->face == 0xffff ? -1 : contact->face;
    out->depth_m = contact->depth_m;
    put_vec3(contact->position_world, out->position_m);
    put_vec3(contact->normal_world, out->normal);
    put_vec3(contact->force_world, out->force_n);
  }
}

static void put_polygons(gv_telemetry *telemetry, const gv_snapshot *snapshot) {
  telemetry->state.num_polygons = snapshot->polygon_count;
  for (int i = 0; i < snapshot->polygon_count; i++) {
    const gv_polygon_contact *polygon = &snapshot->polygon[i];
    gloved_polygon_t *out = &telemetry->polygon[i];
    *out = (gloved_polygon_t){.limb = polygon->limb,
                              .object = polygon->object,
                              .piece = polygon->piece,
                              .face = polygon->face,
                              .depth_m = polygon->depth_m};
    put_vec3(polygon->position_world, out->position_m);
  }
}

// ---- GLOVED_STATS ----

static void put_histogram(gv_telemetry_statistics *s, int number, const char *name,
                          const gv_histogram *histogram) {
  static char names[2 + GV_STAGES][8];
  int64_t upper_ns[GV_HISTOGRAM_COARSE];
  uint64_t count[GV_HISTOGRAM_COARSE];
  const gv_quantiles q = gv_histogram_quantiles(histogram);
  const int bins = gv_histogram_coarse(histogram, upper_ns, count);
  snprintf(names[number], sizeof names[number], "%s", name);
  s->histogram[number] = (gloved_histogram_t){.name = names[number],
                                              .count = (int64_t)atomic_load(&histogram->count),
                                              .p50_us = q.p50_us,
                                              .p99_us = q.p99_us,
                                              .p999_us = q.p999_us,
                                              .max_us = q.max_us,
                                              .num_bins = bins,
                                              .upper_us = s->upper_us[number],
                                              .in_bin = s->in_bin[number]};
  for (int i = 0; i < bins; i++) {
    s->upper_us[number][i] = (double)upper_ns[i] * 1e-3;
    s->in_bin[number][i] = (int64_t)count[i];
  }
}

static void put_histograms(gv_telemetry_statistics *s, const gv_loop *loop) {
  static const char *const stage[GV_STAGES] = {"poll", "compute", "send", "tell"};
  put_histogram(s, 0, "wake", &loop->wake);
  put_histogram(s, 1, "step", &loop->step);
  for (int i = 0; i < GV_STAGES; i++)
    put_histogram(s, 2 + i, stage[i], &loop->stage[i]);
  s->stats.num_histograms = 2 + GV_STAGES;
  s->stats.histogram = s->histogram;
}

static void put_counters(const gv_telemetry *telemetry, const gv_snapshot *snapshot, gloved_stats_t *out) {
  const gv_counters *c = &snapshot->counters;
  out->snapshots_dropped = (int64_t)gv_ring_dropped(&telemetry->loop->snapshots);
  out->events_dropped = (int64_t)gv_ring_dropped(&telemetry->loop->records);
  out->trace_dropped = (int64_t)gv_ring_dropped(&telemetry->loop->steps);
  out->messages_failed = (int64_t)telemetry->failed;
  out->commands_refused = (int64_t)telemetry->commands_refused;
  out->samples = (int64_t)c->samples;
  out->samples_refused = (int64_t)c->samples_refused;
  out->contacts = snapshot->contact_count;
  out->contacts_max = (int64_t)c->contacts_max;
  out->contacts_dropped = (int64_t)c->contacts_dropped;
  out->pairs_dropped = (int64_t)c->pairs_dropped;
  out->pairs_left_over = (int64_t)c->pairs_left_over;
  out->body_resets = (int64_t)c->body_resets;
  out->overlaps = (int64_t)c->overlaps;
  out->newton_steps = (int64_t)c->newton_steps;
  out->newton_softened = (int64_t)c->newton_softened;
  out->dantzig_steps = (int64_t)c->dantzig_steps;
  out->dantzig_lagged = (int64_t)c->dantzig_lagged;
  out->quickstep_steps = (int64_t)c->quickstep_steps;
  out->unsolved_steps = (int64_t)c->unsolved_steps;
  out->solver_errors = (int64_t)c->solver_errors;
  out->depth_max_m = c->depth_max_m;
}

// After put_devices and put_loop: what GLOVED_STATE has as well is taken from there.
static void send_stats(gv_telemetry *telemetry, const gv_snapshot *snapshot) {
  const gloved_state_t *state = &telemetry->state;
  gloved_stats_t *out = &telemetry->statistics.stats;
  *out = (gloved_stats_t){.utime = state->utime,
                          .step = state->step,
                          .time_s = state->time_s,
                          .period_s = (double)telemetry->loop->cfg.period_ns * 1e-9,
                          .missed_deadlines = state->missed_deadlines,
                          .overruns = state->overruns,
                          .heap_calls = state->heap_calls,
                          .steps_on_frame = (int64_t)atomic_load(&telemetry->loop->on_frame),
                          .steps_on_clock = (int64_t)atomic_load(&telemetry->loop->on_clock),
                          .glove_age_s = state->glove_age_s,
                          .tracker_age_s = state->tracker_age_s,
                          .frames_received = state->frames_received,
                          .frames_sent = state->frames_sent,
                          .frames_lost = state->frames_lost,
                          .frames_bad = state->frames_bad,
                          .frames_late = state->frames_late,
                          .memory_used = (int64_t)telemetry->arena->used,
                          .memory_peak = (int64_t)telemetry->arena->peak,
                          .limb_k_f = snapshot->limb_coupling.k_f,
                          .limb_k_t = snapshot->limb_coupling.k_t,
                          .palm_k_f = snapshot->palm_coupling.k_f,
                          .palm_k_t = snapshot->palm_coupling.k_t,
                          .mu_hand = snapshot->mu_hand,
                          .force_limit_n = telemetry->loop->session->cfg.limiter.max_n};
  static char laxer[GV_LAXER_TEXT];
  const gv_session_config *session = &telemetry->loop->session->cfg;
  gv_settings_laxer(&session->limiter, &session->safety, &session->passivity, laxer);
  out->laxer_than_default = laxer;
  for (int i = 0; i < GV_RUNGS; i++)
    out->ladder[i] = (int64_t)telemetry->loop->on_rung[i];
  put_counters(telemetry, snapshot, out);
  put_histograms(&telemetry->statistics, telemetry->loop);
  gv_telemetry_send(telemetry, "GLOVED_STATS", out->utime,
                    gloved_stats_t_encode(telemetry->message, 0, MESSAGE_MAX, out));
}

static void count_rates(gv_telemetry_rates *r, const gv_snapshot *snapshot) {
  const double seconds = (double)(snapshot->utime - r->since_us) * 1e-6;
  if (r->since_us && seconds < 1.0)
    return;
  if (r->since_us) {
    r->received_hz = (double)(snapshot->frames.rx - r->received) / seconds;
    r->sent_hz = (double)(snapshot->frames.tx - r->sent) / seconds;
  }
  r->since_us = snapshot->utime;
  r->received = snapshot->frames.rx;
  r->sent = snapshot->frames.tx;
}

// ---- GLOVED_TRACE ----

void gv_telemetry_send_batch(gv_telemetry *telemetry) {
  gloved_trace_t *trace = &telemetry->batch.trace;
  if (trace->num_steps == 0)
    return;
  trace->period_s = (double)telemetry->loop->cfg.period_ns * 1e-9;
  trace->dropped = (int64_t)gv_ring_dropped(&telemetry->loop->steps);
  trace->step = telemetry->batch.step;
  gv_telemetry_send(telemetry, "GLOVED_TRACE", trace->utime,
                    gloved_trace_t_encode(telemetry->message, 0, MESSAGE_MAX, trace));
  trace->num_steps = 0;
  telemetry->batch.bytes = 0;
}

static void put_frames(gv_telemetry_batch *b, int number, const gv_step_record *record) {
  for (int i = 0; i < record->frame_count; i++) {
    const gv_frame *frame = &record->frame[i];
    memcpy(b->data[number][i], frame->data, sizeof frame->data);
    b->frame[number][i] = (gloved_frame_t){.stamp_ns = frame->stamp_ns,
                                           .id = (int32_t)frame->id,
                                           .flags = (int8_t)frame->flags,
                                           .len = (int8_t)frame->len,
                                           .data = b->data[number][i]};
    b->bytes += FRAME_BYTES + frame->len;
  }
}

void gv_telemetry_step(gv_telemetry *telemetry, const gv_step_record *record) {
  if (!telemetry->trace_asked && !telemetry->log)
    return;  // for the black box alone
  gv_telemetry_batch *b = &telemetry->batch;
  const int number = b->trace.num_steps++;
  gloved_step_t *out = &b->step[number];
  *out = (gloved_step_t){.step = record->step,
                         .now_ns = record->now_ns,
                         .wake_ns = record->wake_ns,
                         .work_ns = record->work_ns,
                         .safety_state = (int8_t)record->safety,
                         .events = (int32_t)record->events,
                         .contacts = record->contacts,
                         .depth_m = (float)record->depth_m,
                         .num_frames = (int8_t)record->frame_count,
                         .frame = b->frame[number]};
  for (int i = 0; i < GV_FINGERS; i++) {
    out->force_desired_n[i] = (float)record->desired_n[i];
    out->force_commanded_n[i] = (float)record->force_n[i];
  }
  put_frames(b, number, record);
  b->bytes += STEP_BYTES;
  b->trace.utime = record->utime;
  if (b->trace.num_steps == BATCH_STEPS || b->bytes > BATCH_BYTES - 1000)
    gv_telemetry_send_batch(telemetry);
}

// ---- GLOVED_ABOUT ----

// The generated types have no const.
static char *text_of(const char *text) { return (char *)(uintptr_t)text; }

void gv_telemetry_send_about(gv_telemetry *telemetry, bool log_alone) {
  const gv_about *about = telemetry->about;
  char scene_hash[24], settings_hash[24], fcu[2 * sizeof about->fcu + 8];
  const int64_t utime = gv_telemetry_now_us();
  if (!about || (!telemetry->lcm && !telemetry->log))
    return;
  snprintf(scene_hash, sizeof scene_hash, "%016" PRIx64, about->scene.hash);
  snprintf(fcu, sizeof fcu, "%s%s%s", about->fcu, about->fcu2[0] ? " and " : "", about->fcu2);
  snprintf(settings_hash, sizeof settings_hash, "%016" PRIx64, about->settings.hash);
  const gloved_about_t message = {.utime = utime,
                                  .version = text_of(about->version),
                                  .commit = text_of(about->commit),
                                  .date = text_of(about->date),
                                  .command_line = text_of(about->command_line),
                                  .fcu = fcu,
                                  .tracker = text_of(about->tracker),
                                  .hand = text_of(about->hand),
                                  .rate_hz = about->rate_hz,
                                  .scene = text_of(about->scene.name),
                                  .scene_hash = scene_hash,
                                  .scene_text = text_of(gv_about_small_text(&about->scene)),
                                  .settings = text_of(about->settings.name),
                                  .settings_hash = settings_hash,
                                  .settings_text = text_of(gv_about_small_text(&about->settings))};
  const int size = gloved_about_t_encode(telemetry->message, 0, MESSAGE_MAX, &message);
  if (!log_alone)
    gv_telemetry_send(telemetry, "GLOVED_ABOUT", utime, size);
  else if (telemetry->log && size > 0)
    gv_telemetry_write_log(telemetry, "GLOVED_ABOUT", utime, size);
  telemetry->next_about_us = log_alone ? 0 : utime + ABOUT_US;
}

// ---- GLOVED_EVENT ----

void gv_telemetry_send_event(gv_telemetry *telemetry, const gloved_event_t *event) {
  if (!telemetry->lcm && !telemetry->log)
    return;
  gv_telemetry_send(telemetry, "GLOVED_EVENT", event->utime,
                    gloved_event_t_encode(telemetry->message, 0, MESSAGE_MAX, event));
}

void gv_telemetry_record(gv_telemetry *telemetry, const gv_record *record) {
  char text[GV_RECORD_TEXT];
  gv_record_text(record, text);
  if (record->kind == GV_RECORD_REQUEST && (record->bits & GV_RECORD_REFUSED))
    telemetry->commands_refused++;
  gv_telemetry_send_event(telemetry, &(gloved_event_t){.utime = record->utime,
                                                       .step = record->step,
                                                       .time_s = record->time_s,
                                                       .kind = (int8_t)record->kind,
                                                       .bits = (int32_t)record->bits,
                                                       .answers = record->tag,
                                                       .text = text});
}

// ---- a snapshot, all of it ----

// GLOVED_STATE, and GLOVED_STATE2 of a second hand: the same message, the same world, its own hand.
static void send_state(gv_telemetry *telemetry, const gv_snapshot *snapshot) {
  gloved_state_t *state = &telemetry->state;
  state->utime = snapshot->utime;
  state->step = snapshot->step;
  state->time_s = snapshot->time_s;
  state->safety_state = (int8_t)snapshot->safety;
  state->faults = (int32_t)snapshot->faults;
  state->limiter_flags = (int32_t)snapshot->limiter_flags;
  put_devices(snapshot, state);
  put_loop(telemetry->loop, snapshot, state);
  put_engine(snapshot, state);
  put_objects(telemetry, snapshot);
  put_contacts(telemetry, snapshot);
  put_polygons(telemetry, snapshot);
  gv_telemetry_send(telemetry, snapshot->hand ? "GLOVED_STATE2" : "GLOVED_STATE", state->utime,
                    gloved_state_t_encode(telemetry->message, 0, MESSAGE_MAX, state));
}

// The first hand's snapshot comes last, and the rest with it.
void gv_telemetry_snapshot(gv_telemetry *telemetry, const gv_snapshot *snapshot) {
  if (!telemetry->lcm && !telemetry->log)
    return;
  send_state(telemetry, snapshot);
  if (snapshot->hand) {
    gv_drake_update_second(&telemetry->viewer.drake, snapshot);
    telemetry->second_told = (gv_second_told){snapshot->safety, snapshot->faults, snapshot->dead_man};
    return;
  }
  if (gv_telemetry_is_due(&telemetry->next_stats_us, snapshot->utime, STATS_US))
    send_stats(telemetry, snapshot);
  gv_telemetry_send_picture(telemetry, snapshot);
  count_rates(&telemetry->rates, snapshot);
  gv_telemetry_answer_questions(telemetry, snapshot);
  if (gv_telemetry_now_us() >= telemetry->next_about_us)
    gv_telemetry_send_about(telemetry, false);
}
