// SPDX-License-Identifier: BSD-3-Clause
// Snapshots to LCM messages (data/lcm/*.lcm): GLOVED_STATE, GLOVED_STATS, GLOVED_EVENT, GLOVED_TRACE, the
// picture for Drake's viewer (DRAKE_VIEWER_LOAD_ROBOT, DRAKE_VIEWER_DRAW), and the same bytes into a log
// file that lcm-logplayer and lcm-spy read; GLOVED_COMMAND to requests for the loop. The only file that
// knows LCM. Slow thread: lcm_publish is a mutex and a blocking sendmsg. Messages are encoded into a static
// buffer and never allocate here (the generated *_publish calls malloc for each).
#include "daemon/tell/telemetry.h"

#include "daemon/load/config_load.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <lcm/lcm.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "daemon/tell/drake.h"
#include "daemon/tell/status.h"
#include "gloved_about_t.h"
#include "gloved_command_t.h"
#include "gloved_event_t.h"
#include "gloved_state_t.h"
#include "gloved_stats_t.h"
#include "gloved_trace_t.h"
#include "gloved_viewer_draw_t.h"
#include "gloved_viewer_load_t.h"

// LCM's fragments get lost above 65 kB. The largest state: 16 limbs, 64 objects, 128 contacts, 128 polygons.
enum { MESSAGE_MAX = 64000, DRAW_US = 50000, LOAD_US = 1000000, STATS_US = 1000000, ABOUT_US = 10000000 };
// A batch of steps is sent at 100 ms or when it grows too large; a step takes at most 790 bytes.
enum { BATCH_STEPS = 100, BATCH_BYTES = 60000, STEP_BYTES = 86, FRAME_BYTES = 14 };
// What is known of a command before its text: fingerprint, utime, kind, value, length of the text.
enum { COMMAND_HEAD = 8 + 8 + 1 + 8 + 4, COMMAND_TEXT_AT = COMMAND_HEAD - 4 };
_Static_assert(GV_RECORD_REQUEST == 4, "programs that send commands wait for events of kind 4");
enum {
  EVENT_COMMAND = GV_RECORD_REQUEST,
  COMMANDS_A_PASS = 1000,  // some 2 ms; LCM keeps as many, so that a disarm finds room in a burst of others
  ANSWER_TEXT = GV_STATUS_BYTES + 100,
  QUESTIONS = GV_REQUEST_PER_SECOND
};
_Static_assert(1200 + GV_LIMBS * 160 + GV_MAX_OBJECTS * (4 + GV_MAX_NAME + 1 + 104) + GV_MAX_CONTACTS * 92 +
                       GV_MAX_POLYGONS * 48 <
                   MESSAGE_MAX,
               "GLOVED_STATE does not fit its buffer");
_Static_assert(GV_DRAKE_LINKS * 56 + GV_DRAKE_LINKS * 16 + 4 * GV_DRAKE_NUMBERS < MESSAGE_MAX,
               "DRAKE_VIEWER_LOAD_ROBOT does not fit its buffer");

// The viewer's messages: they point into gv_drake and into these arrays.
typedef struct viewer {
  gv_drake drake;
  int64_t next_draw_us, next_load_us;  // utime of the next messages
  gloved_viewer_geometry_t geometry[GV_DRAKE_LINKS];
  gloved_viewer_link_t link[GV_DRAKE_LINKS];
  char *name[GV_DRAKE_LINKS];
  int32_t robot[GV_DRAKE_LINKS];
  float position[GV_DRAKE_LINKS][3], quaternion[GV_DRAKE_LINKS][4];
  float *position_row[GV_DRAKE_LINKS], *quaternion_row[GV_DRAKE_LINKS];
} viewer;

typedef struct statistics {
  gloved_stats_t stats;
  gloved_histogram_t histogram[2 + GV_STAGES];
  double upper_us[2 + GV_STAGES][GV_HISTOGRAM_COARSE];
  int64_t in_bin[2 + GV_STAGES][GV_HISTOGRAM_COARSE];
} statistics;

// How many frames went each way in the last whole second.
typedef struct rates {
  int64_t since_us;         // 0: not begun
  uint64_t received, sent;  // then
  double received_hz, sent_hz;
} rates;

typedef struct batch {
  gloved_trace_t trace;
  gloved_step_t step[BATCH_STEPS];
  gloved_frame_t frame[BATCH_STEPS][GV_STEP_FRAMES];
  uint8_t data[BATCH_STEPS][GV_STEP_FRAMES][64];
  int bytes;
} batch;

struct gv_telemetry {
  lcm_t *lcm;           // null: not published
  lcm_eventlog_t *log;  // null: not logged
  const gv_scene *scene;
  const gv_arena *arena;
  const atomic_bool *give_up;
  const gv_hand_model *hand;
  const gv_about *about;
  const gv_settings *settings;
  const char *(*begin_scene)(void *user, const char *file, int64_t now_ns);
  bool (*scene_ended)(void *user, int64_t now_ns, const char **out_refusal);
  bool scene_loading;  // `scene` waits for it
  gv_request scene_request;
  void *user;
  gv_loop *loop;                   // null: not attached yet
  bool log_broken;                 // the disk refused a part of a log
  bool trace_asked;                // by command
  bool listens;                    // to commands
  gv_request_rate rate;            // of commands
  gv_request_rate complaints;      // about messages that are none
  gv_request question[QUESTIONS];  // what is in force: answered from the next snapshot
  int questions;
  rates rates;
  char why[GV_REQUEST_WHY];  // the last refusal
  char log_name[GV_SETTING_TEXT];
  int64_t listened_ns, next_stats_us, next_about_us;
  uint64_t failed, commands_refused;
  int64_t log_events;
  gloved_state_t state;
  gloved_object_t object[GV_MAX_OBJECTS];
  gloved_contact_t contact[GV_MAX_CONTACTS];
  gloved_polygon_t polygon[GV_MAX_POLYGONS];
  viewer viewer;
  statistics statistics;
  batch batch;
  uint8_t message[MESSAGE_MAX];
};

// ---- sending ------------------------------------------------------------------------------------------

static void write_log(gv_telemetry *telemetry, const char *channel, int64_t utime, int size) {
  char name[32];
  snprintf(name, sizeof name, "%s", channel);
  lcm_eventlog_event_t event = {.eventnum = telemetry->log_events++,
                                .timestamp = utime,
                                .channellen = (int32_t)strlen(name),
                                .datalen = size,
                                .channel = name,
                                .data = telemetry->message};
  if (lcm_eventlog_write_event(telemetry->log, &event) == 0)
    return;
  telemetry->failed++;
  telemetry->log_broken = true;
}

// What the C library still holds goes to the disk first: only then is it known whether the log is whole.
static void end_log(gv_telemetry *telemetry) {
  if (fflush(telemetry->log->f) != 0)
    telemetry->log_broken = true;
  lcm_eventlog_destroy(telemetry->log);
  telemetry->log = NULL;
}

// The first `size` bytes of telemetry->message; below 0: they did not fit.
static void send_message(gv_telemetry *telemetry, const char *channel, int64_t utime, int size) {
  if (size < 0) {
    telemetry->failed++;
    return;
  }
  if (telemetry->lcm && !atomic_load(telemetry->give_up) &&
      lcm_publish(telemetry->lcm, channel, telemetry->message, (unsigned)size) != 0)
    telemetry->failed++;
  if (telemetry->log)
    write_log(telemetry, channel, utime, size);
}

// ---- filling ------------------------------------------------------------------------------------------

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

// ---- the viewer's picture -------------------------------------------------------------------------------

static void put_quat(gv_quat q, float out[4]) {
  out[0] = (float)q.w;
  out[1] = (float)q.x;
  out[2] = (float)q.y;
  out[3] = (float)q.z;
}

static void point_viewer(viewer *v) {
  static char no_file[] = "";
  for (int i = 0; i < v->drake.link_count; i++) {
    gv_drake_link *link = &v->drake.link[i];
    v->geometry[i] = (gloved_viewer_geometry_t){.type = (int8_t)link->type,
                                                .string_data = no_file,
                                                .num_float_data = link->number_count,
                                                .float_data = &v->drake.number[link->number_first]};
    v->geometry[i].position[0] = (float)link->p_link_shape.x;
    v->geometry[i].position[1] = (float)link->p_link_shape.y;
    v->geometry[i].position[2] = (float)link->p_link_shape.z;
    put_quat(link->q_link_shape, v->geometry[i].quaternion);
    memcpy(v->geometry[i].color, link->color, sizeof link->color);
    v->link[i] = (gloved_viewer_link_t){
      .name = link->name, .num_geom = link->number_count > 0, .geom = &v->geometry[i]};
    v->name[i] = link->name;
    v->position_row[i] = v->position[i];
    v->quaternion_row[i] = v->quaternion[i];
  }
}

static void send_load(gv_telemetry *telemetry, int64_t utime) {
  viewer *v = &telemetry->viewer;
  const gloved_viewer_load_t load = {.num_links = v->drake.link_count, .link = v->link};
  send_message(telemetry, "DRAKE_VIEWER_LOAD_ROBOT", utime,
               gloved_viewer_load_t_encode(telemetry->message, 0, MESSAGE_MAX, &load));
}

static void send_draw(gv_telemetry *telemetry, const gv_snapshot *snapshot) {
  viewer *v = &telemetry->viewer;
  gv_drake_update(&v->drake, snapshot);
  for (int i = 0; i < v->drake.link_count; i++) {
    const gv_pose *T = &v->drake.T_world_link[i];
    v->position[i][0] = (float)T->p.x;
    v->position[i][1] = (float)T->p.y;
    v->position[i][2] = (float)T->p.z;
    put_quat(T->q, v->quaternion[i]);
  }
  const gloved_viewer_draw_t draw = {.timestamp = (int64_t)(snapshot->time_s * 1e3),
                                     .num_links = v->drake.link_count,
                                     .link_name = v->name,
                                     .robot_num = v->robot,
                                     .position = v->position_row,
                                     .quaternion = v->quaternion_row};
  send_message(telemetry, "DRAKE_VIEWER_DRAW", snapshot->utime,
               gloved_viewer_draw_t_encode(telemetry->message, 0, MESSAGE_MAX, &draw));
}

// When `utime` reached *next: true, and *next is moved on by whole periods.
static bool is_due(int64_t *next, int64_t utime, int64_t period) {
  if (utime < *next)
    return false;
  *next = utime - *next < period ? *next + period : utime + period;
  return true;
}

// A viewer that starts later shows nothing before it gets the shapes, and then poses: in this order.
static void send_picture(gv_telemetry *telemetry, const gv_snapshot *snapshot) {
  viewer *v = &telemetry->viewer;
  if (!is_due(&v->next_draw_us, snapshot->utime, DRAW_US))
    return;
  if (is_due(&v->next_load_us, snapshot->utime, LOAD_US))
    send_load(telemetry, snapshot->utime);
  send_draw(telemetry, snapshot);
}

// ---- statistics ---------------------------------------------------------------------------------------

static void put_histogram(statistics *s, int number, const char *name, const gv_histogram *histogram) {
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

static void put_histograms(statistics *s, const gv_loop *loop) {
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
  gv_settings_laxer(&session->limiter, &session->safety, laxer);
  out->laxer_than_default = laxer;
  for (int i = 0; i < GV_RUNGS; i++)
    out->ladder[i] = (int64_t)telemetry->loop->on_rung[i];
  put_counters(telemetry, snapshot, out);
  put_histograms(&telemetry->statistics, telemetry->loop);
  send_message(telemetry, "GLOVED_STATS", out->utime,
               gloved_stats_t_encode(telemetry->message, 0, MESSAGE_MAX, out));
}

// ---- steps --------------------------------------------------------------------------------------------

static void send_batch(gv_telemetry *telemetry) {
  gloved_trace_t *trace = &telemetry->batch.trace;
  if (trace->num_steps == 0)
    return;
  trace->period_s = (double)telemetry->loop->cfg.period_ns * 1e-9;
  trace->dropped = (int64_t)gv_ring_dropped(&telemetry->loop->steps);
  trace->step = telemetry->batch.step;
  send_message(telemetry, "GLOVED_TRACE", trace->utime,
               gloved_trace_t_encode(telemetry->message, 0, MESSAGE_MAX, trace));
  trace->num_steps = 0;
  telemetry->batch.bytes = 0;
}

static void put_frames(batch *b, int number, const gv_step_record *record) {
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
  batch *b = &telemetry->batch;
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
    send_batch(telemetry);
}

// ---- what runs here -------------------------------------------------------------------------------------

static int64_t now_us(void) {
  struct timespec now;
  clock_gettime(CLOCK_REALTIME, &now);
  return (int64_t)now.tv_sec * 1000000 + now.tv_nsec / 1000;
}

// The generated types have no const.
static char *text_of(const char *text) { return (char *)(uintptr_t)text; }

static void send_about(gv_telemetry *telemetry, bool log_alone) {
  const gv_about *about = telemetry->about;
  char scene_hash[24], settings_hash[24];
  const int64_t utime = now_us();
  if (!about || (!telemetry->lcm && !telemetry->log))
    return;
  snprintf(scene_hash, sizeof scene_hash, "%016" PRIx64, about->scene.hash);
  snprintf(settings_hash, sizeof settings_hash, "%016" PRIx64, about->settings.hash);
  const gloved_about_t message = {.utime = utime,
                                  .version = text_of(about->version),
                                  .commit = text_of(about->commit),
                                  .date = text_of(about->date),
                                  .command_line = text_of(about->command_line),
                                  .fcu = text_of(about->fcu),
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
    send_message(telemetry, "GLOVED_ABOUT", utime, size);
  else if (telemetry->log && size > 0)
    write_log(telemetry, "GLOVED_ABOUT", utime, size);
  telemetry->next_about_us = log_alone ? 0 : utime + ABOUT_US;
}

// ---- commands -----------------------------------------------------------------------------------------

static void send_event(gv_telemetry *telemetry, const gloved_event_t *event) {
  if (!telemetry->lcm && !telemetry->log)
    return;
  send_message(telemetry, "GLOVED_EVENT", event->utime,
               gloved_event_t_encode(telemetry->message, 0, MESSAGE_MAX, event));
}

// The answer to a command that does not reach the loop.
static void answer_with(gv_telemetry *telemetry, int kind, int64_t tag, const char *refusal,
                        const char *value) {
  char text[ANSWER_TEXT];
  snprintf(text, sizeof text, "command %s: %s%s", gv_request_name(kind), refusal ? "refused: " : "done",
           refusal ? refusal : value);
  telemetry->commands_refused += refusal ? 1 : 0;
  send_event(telemetry, &(gloved_event_t){.utime = now_us(),
                                          .step = telemetry->state.step,
                                          .time_s = telemetry->state.time_s,
                                          .kind = EVENT_COMMAND,
                                          .bits = (kind & 0xff) | (refusal ? GV_RECORD_REFUSED : 0),
                                          .answers = tag,
                                          .text = text});
}

static void answer(gv_telemetry *telemetry, int kind, int64_t tag, const char *refusal) {
  answer_with(telemetry, kind, tag, refusal, "");
}

static void want_trace(gv_telemetry *telemetry) {
  atomic_store(&telemetry->loop->trace, telemetry->trace_asked || telemetry->log);
}

__attribute__((format(printf, 2, 3))) static const char *because(gv_telemetry *telemetry, const char *format,
                                                                 ...) {
  va_list arguments;
  va_start(arguments, format);
  vsnprintf(telemetry->why, sizeof telemetry->why, format, arguments);
  va_end(arguments);
  return telemetry->why;
}

static const char *start_log(gv_telemetry *telemetry, const char *path) {
  struct stat there;
  if (telemetry->log)
    return because(telemetry, "%s is being written; stop that log first", telemetry->log_name);
  if (lstat(path, &there) == 0)
    return because(telemetry, "%s: there is such a file; choose another name", path);
  telemetry->log = lcm_eventlog_create(path, "w");
  telemetry->log_events = 0;
  want_trace(telemetry);
  if (!telemetry->log)
    return because(telemetry, "%s: cannot be written (%s); look at the daemon's directory", path,
                   strerror(errno));
  snprintf(telemetry->log_name, sizeof telemetry->log_name, "%s", path);
  send_about(telemetry, true);
  return NULL;
}

static const char *stop_log(gv_telemetry *telemetry) {
  if (!telemetry->log)
    return "no log is being written";
  send_batch(telemetry);
  end_log(telemetry);
  want_trace(telemetry);
  return NULL;
}

// What is in force is answered from a snapshot that is newer than every answer before:
// who has set a value reads it.
static const char *ask_for_status(gv_telemetry *telemetry, const gv_request *request) {
  if (telemetry->questions == QUESTIONS)
    return "the loop tells nothing now; try again";
  telemetry->question[telemetry->questions++] = *request;
  return NULL;
}

static void answer_questions(gv_telemetry *telemetry, const gv_snapshot *snapshot) {
  static char text[2 + GV_STATUS_BYTES];
  const gv_status status = {.about = telemetry->about,
                            .settings = telemetry->settings,
                            .snapshot = snapshot,
                            .received_hz = telemetry->rates.received_hz,
                            .sent_hz = telemetry->rates.sent_hz,
                            .log = telemetry->log ? telemetry->log_name : ""};
  for (int i = 0; i < telemetry->questions; i++) {
    const gv_request *question = &telemetry->question[i];
    memcpy(text, ": ", 2);
    const bool known = gv_status_text(&status, question->text, text + 2);
    answer_with(telemetry, GV_REQUEST_STATUS, question->tag, known ? NULL : text + 2, text);
  }
  telemetry->questions = 0;
}

static void count_rates(rates *r, const gv_snapshot *snapshot) {
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

static const char *pass_on(gv_telemetry *telemetry, const gv_request *request) {
  gv_request *slot = gv_ring_reserve(&telemetry->loop->requests);
  if (!slot)
    return "the loop does not take commands now; try again";
  *slot = *request;
  gv_ring_commit(&telemetry->loop->requests);
  return NULL;
}

// Loaded beside everything else, so that a bad file changes nothing and a slow one holds nothing up; then
// the loop decides whether the moment fits, and ends for it.
static const char *ask_for_scene(gv_telemetry *telemetry, const gv_request *request) {
  const int state = telemetry->state.safety_state;
  if (!telemetry->begin_scene)
    return "a scene is chosen at the start; start gloved with --scene";
  if (atomic_load(&telemetry->loop->scene_asked))
    return "another scene is coming; wait for it";
  if (state == GV_SAFETY_ARMED || state == GV_SAFETY_ACTIVE)
    return "not while a force may flow; disarm first";
  const char *refusal = telemetry->begin_scene(telemetry->user, request->text, telemetry->listened_ns);
  if (refusal)
    return refusal;
  telemetry->scene_loading = true;
  telemetry->scene_request = *request;
  atomic_store(&telemetry->loop->scene_asked, true);
  return NULL;
}

// Every pass, while a scene is being loaded.
static void follow_scene(gv_telemetry *telemetry) {
  const char *refusal = NULL;
  if (!telemetry->scene_loading || !telemetry->scene_ended(telemetry->user, telemetry->listened_ns, &refusal))
    return;
  telemetry->scene_loading = false;
  if (!refusal && !(refusal = pass_on(telemetry, &telemetry->scene_request)))
    return;
  atomic_store(&telemetry->loop->scene_asked, false);
  answer(telemetry, GV_REQUEST_SCENE, telemetry->scene_request.tag, refusal);
}

// Those for the loop are answered by the loop, when they are done.
static void obey(gv_telemetry *telemetry, const gv_request *request) {
  const char *refusal = NULL;
  switch (request->kind) {
    case GV_REQUEST_START_LOG: refusal = start_log(telemetry, request->text); break;
    case GV_REQUEST_STOP_LOG:
      // into the log as well
      answer(telemetry, (int)request->kind, request->tag, telemetry->log ? NULL : "no log is being written");
      stop_log(telemetry);
      return;
    case GV_REQUEST_TRACE:
      telemetry->trace_asked = request->value >= 0.5;
      want_trace(telemetry);
      break;
    case GV_REQUEST_RESET:
    case GV_REQUEST_COUPLING:
    case GV_REQUEST_FRICTION:
    case GV_REQUEST_DISARM:
      if (!(refusal = pass_on(telemetry, request)))
        return;
      break;
    case GV_REQUEST_SCENE:
      if (!(refusal = ask_for_scene(telemetry, request)))
        return;
      break;
    case GV_REQUEST_STATUS:
      if (!(refusal = ask_for_status(telemetry, request)))
        return;
      break;
    case GV_REQUEST_KINDS: return;  // refused by gv_request_check
  }
  answer(telemetry, (int)request->kind, request->tag, refusal);
}

// Exactly as long as the length of its text says, with its final zero: the generated decoder would take
// memory for whatever length the bytes claim.
static bool has_sound_length(const uint8_t *data, size_t size) {
  if (size <= COMMAND_HEAD || size >= COMMAND_HEAD + 1000)
    return false;
  const uint8_t *n = &data[COMMAND_TEXT_AT];
  const uint32_t length = (uint32_t)n[0] << 24 | (uint32_t)n[1] << 16 | (uint32_t)n[2] << 8 | n[3];
  return length == size - COMMAND_HEAD && data[size - 1] == 0;
}

// Whoever floods the channel, be it with sound commands, must not fill network and log with answers.
static void complain(gv_telemetry *telemetry, int kind, int64_t tag, const char *refusal) {
  if (gv_request_may_complain(&telemetry->complaints, telemetry->listened_ns))
    answer(telemetry, kind, tag, refusal);
  else
    telemetry->commands_refused++;
}

static void on_command(const lcm_recv_buf_t *buffer, const char *channel, void *user) {
  gv_telemetry *telemetry = user;
  gloved_command_t command;
  gv_request request;
  (void)channel;
  if (!telemetry->loop)
    return;
  if (!has_sound_length(buffer->data, buffer->data_size) ||
      gloved_command_t_decode(buffer->data, 0, (int)buffer->data_size, &command) < 0) {
    complain(telemetry, -1, 0, "not a gloved_command_t; use the type in data/lcm");
    return;
  }
  const gv_request_message message = {command.kind, command.value, command.text, command.utime};
  char why[GV_REQUEST_WHY];
  if (gv_request_check(&message, &telemetry->rate, telemetry->listened_ns, &request, why))
    obey(telemetry, &request);
  else
    complain(telemetry, command.kind, command.utime, why);
  gloved_command_t_decode_cleanup(&command);
}

void gv_telemetry_listen(gv_telemetry *telemetry, int64_t now_ns) {
  telemetry->listened_ns = now_ns;
  if (!telemetry->listens)
    return;
  follow_scene(telemetry);
  for (int i = 0; i < COMMANDS_A_PASS && lcm_handle_timeout(telemetry->lcm, 0) > 0; i++) {}
}

// ---- public ------------------------------------------------------------------------------------------

void gv_telemetry_snapshot(gv_telemetry *telemetry, const gv_snapshot *snapshot) {
  gloved_state_t *state = &telemetry->state;
  if (!telemetry->lcm && !telemetry->log)
    return;
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
  send_message(telemetry, "GLOVED_STATE", state->utime,
               gloved_state_t_encode(telemetry->message, 0, MESSAGE_MAX, state));
  if (is_due(&telemetry->next_stats_us, state->utime, STATS_US))
    send_stats(telemetry, snapshot);
  send_picture(telemetry, snapshot);
  count_rates(&telemetry->rates, snapshot);
  answer_questions(telemetry, snapshot);
  if (now_us() >= telemetry->next_about_us)
    send_about(telemetry, false);
}

void gv_telemetry_record(gv_telemetry *telemetry, const gv_record *record) {
  char text[GV_RECORD_TEXT];
  gv_record_text(record, text);
  if (record->kind == GV_RECORD_REQUEST && (record->bits & GV_RECORD_REFUSED))
    telemetry->commands_refused++;
  send_event(telemetry, &(gloved_event_t){.utime = record->utime,
                                          .step = record->step,
                                          .time_s = record->time_s,
                                          .kind = (int8_t)record->kind,
                                          .bits = (int32_t)record->bits,
                                          .answers = record->tag,
                                          .text = text});
}

static void point_into(gv_telemetry *telemetry) {
  static char names[GV_MAX_OBJECTS][GV_MAX_NAME];
  telemetry->state.object = telemetry->object;
  telemetry->state.contact = telemetry->contact;
  telemetry->state.polygon = telemetry->polygon;
  for (int i = 0; i < telemetry->scene->object_count; i++) {
    memcpy(names[i], telemetry->scene->object[i].name, GV_MAX_NAME);
    telemetry->object[i].name = names[i];
    telemetry->object[i].is_static = telemetry->scene->object[i].is_static;
  }
}

static void take_scene(gv_telemetry *telemetry) {
  point_into(telemetry);
  gv_drake_init(&telemetry->viewer.drake, telemetry->hand, telemetry->scene);
  point_viewer(&telemetry->viewer);
}

// lcm_create with its own messages kept off standard error: there is one line for one error, and it is ours.
// Subscribing starts LCM's receiving thread, which inherits the priority: this must come before the loop's.
static lcm_t *create_quietly(const char *url, gv_telemetry *telemetry) {
  fflush(stderr);
  const int kept = dup(STDERR_FILENO);
  const int nowhere = open("/dev/null", O_WRONLY | O_CLOEXEC);
  if (kept >= 0 && nowhere >= 0)
    dup2(nowhere, STDERR_FILENO);
  lcm_t *lcm = lcm_create(url);
  // Over udpm: alone: LCM's tcpq: connects anew whenever it is asked for messages, blocks for as long as the
  // server pleases, and ends the process where that failed. Null: LCM sent itself a message and did not get
  // it back (after up to ten seconds).
  telemetry->listens = lcm && strncmp(url, "udpm:", 5) == 0;
  lcm_subscription_t *commands = NULL;
  if (telemetry->listens && (commands = lcm_subscribe(lcm, "GLOVED_COMMAND", on_command, telemetry)))
    lcm_subscription_set_queue_capacity(commands, COMMANDS_A_PASS);
  if (telemetry->listens && !commands) {
    telemetry->listens = false;
    lcm_destroy(lcm);
    lcm = NULL;
  }
  fflush(stderr);
  if (kept >= 0)
    dup2(kept, STDERR_FILENO);
  if (kept >= 0)
    close(kept);
  if (nowhere >= 0)
    close(nowhere);
  return lcm;
}

gv_telemetry *gv_telemetry_open(const gv_telemetry_config *cfg, char *err, size_t err_size) {
  static gv_telemetry telemetry;
  memset(&telemetry, 0, sizeof telemetry);
  telemetry.scene = cfg->scene;
  telemetry.arena = cfg->arena;
  telemetry.give_up = cfg->give_up;
  telemetry.hand = cfg->hand;
  telemetry.about = cfg->about;
  telemetry.settings = cfg->settings;
  telemetry.begin_scene = cfg->begin_scene;
  telemetry.scene_ended = cfg->scene_ended;
  telemetry.user = cfg->user;
  take_scene(&telemetry);
  *err = '\0';
  if (strcmp(cfg->lcm_url, "none") != 0 && !(telemetry.lcm = create_quietly(cfg->lcm_url, &telemetry))) {
    snprintf(err, err_size,
             "LCM does not start on \"%s\"; check the URL, give this machine a multicast route "
             "(ip link set lo up; ip route add 224.0.0.0/4 dev lo), or leave LCM out with --lcm none",
             cfg->lcm_url);
    if (cfg->lcm_required)
      return NULL;
  }
  return &telemetry;
}

int gv_telemetry_log(gv_telemetry *telemetry, const char *path, char *err, size_t err_size) {
  snprintf(telemetry->log_name, sizeof telemetry->log_name, "%s", path);
  telemetry->log = lcm_eventlog_create(path, "w");
  if (telemetry->log)
    return 0;
  snprintf(err, err_size, "%s: the log file cannot be written; choose another place for --log", path);
  return -1;
}

void gv_telemetry_attach(gv_telemetry *telemetry, gv_loop *loop) {
  telemetry->loop = loop;
  want_trace(telemetry);
  send_about(telemetry, true);  // the network may block, and the loop does not run yet
}

void gv_telemetry_change_scene(gv_telemetry *telemetry) {
  send_batch(telemetry);
  take_scene(telemetry);
  send_about(telemetry, true);
  telemetry->viewer.next_load_us = 0;
  answer(telemetry, GV_REQUEST_SCENE, telemetry->scene_request.tag, NULL);
}

uint64_t gv_telemetry_failed(const gv_telemetry *telemetry) { return telemetry->failed; }

int gv_telemetry_close(gv_telemetry *telemetry) {
  send_batch(telemetry);
  if (telemetry->log)
    end_log(telemetry);
  if (telemetry->lcm)
    lcm_destroy(telemetry->lcm);
  return telemetry->log_broken ? -1 : 0;
}
