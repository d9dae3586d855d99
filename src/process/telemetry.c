// SPDX-License-Identifier: BSD-3-Clause
// Snapshots to LCM messages (data/lcm/*.lcm): channels GLOVED_STATE and GLOVED_EVENT, the picture for Drake's
// viewer (DRAKE_VIEWER_LOAD_ROBOT, DRAKE_VIEWER_DRAW), and the same bytes into a log file that lcm-logplayer
// and lcm-spy read. The only file that knows LCM. Slow thread: lcm_publish is a mutex and a blocking sendmsg.
// Messages are encoded into a static buffer and never allocate here (the generated *_publish calls malloc for each).
#include "telemetry.h"

#include <fcntl.h>
#include <lcm/lcm.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "drake.h"
#include "gloved_event_t.h"
#include "gloved_state_t.h"
#include "gloved_viewer_draw_t.h"
#include "gloved_viewer_load_t.h"

// LCM's fragments get lost above 65 kB. The largest state: 16 limbs, 64 objects, 128 contacts, 128 polygons.
enum { MESSAGE_MAX = 64000, DRAW_US = 50000, LOAD_US = 1000000 };
_Static_assert(1200 + GV_LIMBS * 160 + GV_MAX_OBJECTS * (4 + GV_MAX_NAME + 1 + 104) + GV_MAX_CONTACTS * 92 + GV_MAX_POLYGONS * 48 < MESSAGE_MAX,
               "GLOVED_STATE does not fit its buffer");
_Static_assert(GV_DRAKE_LINKS * 56 + GV_DRAKE_LINKS * 16 + 4 * GV_DRAKE_NUMBERS < MESSAGE_MAX,
               "DRAKE_VIEWER_LOAD_ROBOT does not fit its buffer");

// The viewer's messages: they point into gv_drake and into these arrays.
typedef struct viewer {
  gv_drake drake;
  int64_t next_draw_us, next_load_us; // utime of the next messages
  gloved_viewer_geometry_t geometry[GV_DRAKE_LINKS];
  gloved_viewer_link_t link[GV_DRAKE_LINKS];
  char *name[GV_DRAKE_LINKS];
  int32_t robot[GV_DRAKE_LINKS];
  float position[GV_DRAKE_LINKS][3], quaternion[GV_DRAKE_LINKS][4];
  float *position_row[GV_DRAKE_LINKS], *quaternion_row[GV_DRAKE_LINKS];
} viewer;

struct gv_telemetry {
  lcm_t *lcm;                // null: not published
  lcm_eventlog_t *log;       // null: not logged
  const gv_scene *scene;
  uint64_t failed;
  int64_t log_events;
  gloved_state_t state;
  gloved_object_t object[GV_MAX_OBJECTS];
  gloved_contact_t contact[GV_MAX_CONTACTS];
  gloved_polygon_t polygon[GV_MAX_POLYGONS];
  viewer viewer;
  uint8_t message[MESSAGE_MAX];
};

// ---- sending ------------------------------------------------------------------------------------------

static void write_log(gv_telemetry *telemetry, const char *channel, int64_t utime, int size) {
  char name[32];
  snprintf(name, sizeof name, "%s", channel);
  lcm_eventlog_event_t event = {.eventnum = telemetry->log_events++, .timestamp = utime,
                                .channellen = (int32_t)strlen(name), .datalen = size, .channel = name,
                                .data = telemetry->message};
  if (lcm_eventlog_write_event(telemetry->log, &event) != 0) telemetry->failed++;
}

// The first `size` bytes of telemetry->message; below 0: they did not fit.
static void send_message(gv_telemetry *telemetry, const char *channel, int64_t utime, int size) {
  if (size < 0) {
    telemetry->failed++;
    return;
  }
  if (telemetry->lcm && lcm_publish(telemetry->lcm, channel, telemetry->message, (unsigned)size) != 0)
    telemetry->failed++;
  if (telemetry->log) write_log(telemetry, channel, utime, size);
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
    put_pose(gv_snapshot_object_pose(object, snapshot->object[i].T_world_body), out->position_m, out->quaternion);
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
    *out = (gloved_polygon_t){.limb = polygon->limb, .object = polygon->object, .piece = polygon->piece, .face = polygon->face,
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
    v->geometry[i] = (gloved_viewer_geometry_t){.type = (int8_t)link->type, .string_data = no_file, .num_float_data = link->number_count,
                                                .float_data = &v->drake.number[link->number_first]};
    put_quat(link->q_link_shape, v->geometry[i].quaternion);
    memcpy(v->geometry[i].color, link->color, sizeof link->color);
    v->link[i] = (gloved_viewer_link_t){.name = link->name, .num_geom = link->number_count > 0, .geom = &v->geometry[i]};
    v->name[i] = link->name;
    v->position_row[i] = v->position[i];
    v->quaternion_row[i] = v->quaternion[i];
  }
}

static void send_load(gv_telemetry *telemetry, int64_t utime) {
  viewer *v = &telemetry->viewer;
  const gloved_viewer_load_t load = {.num_links = v->drake.link_count, .link = v->link};
  send_message(telemetry, "DRAKE_VIEWER_LOAD_ROBOT", utime, gloved_viewer_load_t_encode(telemetry->message, 0, MESSAGE_MAX, &load));
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
  const gloved_viewer_draw_t draw = {.timestamp = (int64_t)(snapshot->time_s * 1e3), .num_links = v->drake.link_count,
                                     .link_name = v->name, .robot_num = v->robot, .position = v->position_row,
                                     .quaternion = v->quaternion_row};
  send_message(telemetry, "DRAKE_VIEWER_DRAW", snapshot->utime, gloved_viewer_draw_t_encode(telemetry->message, 0, MESSAGE_MAX, &draw));
}

// When `utime` reached *next: true, and *next is moved on by whole periods.
static bool is_due(int64_t *next, int64_t utime, int64_t period) {
  if (utime < *next) return false;
  *next = utime - *next < period ? *next + period : utime + period;
  return true;
}

// A viewer that starts later shows nothing before it gets the shapes, and then poses: in this order.
static void send_picture(gv_telemetry *telemetry, const gv_snapshot *snapshot) {
  viewer *v = &telemetry->viewer;
  if (!is_due(&v->next_draw_us, snapshot->utime, DRAW_US)) return;
  if (is_due(&v->next_load_us, snapshot->utime, LOAD_US)) send_load(telemetry, snapshot->utime);
  send_draw(telemetry, snapshot);
}

// ---- public ------------------------------------------------------------------------------------------

void gv_telemetry_snapshot(gv_telemetry *telemetry, const gv_loop *loop, const gv_snapshot *snapshot) {
  gloved_state_t *state = &telemetry->state;
  if (!telemetry->lcm && !telemetry->log) return;
  state->utime = snapshot->utime;
  state->step = snapshot->step;
  state->time_s = snapshot->time_s;
  state->safety_state = (int8_t)snapshot->safety;
  state->faults = (int32_t)snapshot->faults;
  state->limiter_flags = (int32_t)snapshot->limiter_flags;
  put_devices(snapshot, state);
  put_loop(loop, snapshot, state);
  put_engine(snapshot, state);
  put_objects(telemetry, snapshot);
  put_contacts(telemetry, snapshot);
  put_polygons(telemetry, snapshot);
  send_message(telemetry, "GLOVED_STATE", state->utime, gloved_state_t_encode(telemetry->message, 0, MESSAGE_MAX, state));
  send_picture(telemetry, snapshot);
}

void gv_telemetry_record(gv_telemetry *telemetry, const gv_record *record) {
  char text[GV_RECORD_TEXT];
  if (!telemetry->lcm && !telemetry->log) return;
  gv_record_text(record, text);
  const gloved_event_t event = {.utime = record->utime, .step = record->step, .time_s = record->time_s,
                                .kind = (int8_t)record->kind, .bits = (int32_t)record->bits, .text = text};
  send_message(telemetry, "GLOVED_EVENT", event.utime, gloved_event_t_encode(telemetry->message, 0, MESSAGE_MAX, &event));
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

// lcm_create with its own messages kept off standard error: there is one line for one error, and it is ours.
static lcm_t *create_quietly(const char *url) {
  fflush(stderr);
  const int kept = dup(STDERR_FILENO), nowhere = open("/dev/null", O_WRONLY | O_CLOEXEC);
  if (kept >= 0 && nowhere >= 0) dup2(nowhere, STDERR_FILENO);
  lcm_t *lcm = lcm_create(url);
  fflush(stderr);
  if (kept >= 0) dup2(kept, STDERR_FILENO);
  if (kept >= 0) close(kept);
  if (nowhere >= 0) close(nowhere);
  return lcm;
}

gv_telemetry *gv_telemetry_open(const char *lcm_url, bool lcm_required, const char *log_path, const gv_scene *scene,
                                const gv_hand_model *hand, char *err, size_t err_size) {
  static gv_telemetry telemetry;
  telemetry = (gv_telemetry){.scene = scene};
  point_into(&telemetry);
  gv_drake_init(&telemetry.viewer.drake, hand, scene);
  point_viewer(&telemetry.viewer);
  *err = '\0';
  if (log_path && !(telemetry.log = lcm_eventlog_create(log_path, "w"))) {
    snprintf(err, err_size, "%s: the log file cannot be written; choose another place for --log", log_path);
    return NULL;
  }
  if (strcmp(lcm_url, "none") == 0 || (telemetry.lcm = create_quietly(lcm_url))) return &telemetry;
  snprintf(err, err_size, "LCM does not start on \"%s\"; check the URL, give this machine a multicast route "
           "(ip link set lo up; ip route add 224.0.0.0/4 dev lo), or leave LCM out with --lcm none", lcm_url);
  if (!lcm_required) return &telemetry;
  gv_telemetry_close(&telemetry);
  return NULL;
}

uint64_t gv_telemetry_failed(const gv_telemetry *telemetry) { return telemetry->failed; }

void gv_telemetry_close(gv_telemetry *telemetry) {
  if (telemetry->log) lcm_eventlog_destroy(telemetry->log);
  if (telemetry->lcm) lcm_destroy(telemetry->lcm);
}
