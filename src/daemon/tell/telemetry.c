// SPDX-License-Identifier: BSD-3-Clause
// Telemetry: LCM and its log file opened, sent to, closed. The same bytes go to the network and into a log
// that lcm-logplayer and lcm-spy read. Slow thread: lcm_publish is a mutex and a blocking sendmsg. Messages
// are encoded into a static buffer and never allocate here (the generated *_publish calls malloc for each).
#include "daemon/tell/telemetry_state.h"

// ---- sending ----

void gv_telemetry_write_log(gv_telemetry *telemetry, const char *channel, int64_t utime, int size) {
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
void gv_telemetry_end_log(gv_telemetry *telemetry) {
  if (fflush(telemetry->log->f) != 0)
    telemetry->log_broken = true;
  lcm_eventlog_destroy(telemetry->log);
  telemetry->log = NULL;
}

// The first `size` bytes of telemetry->message; below 0: they did not fit.
void gv_telemetry_send(gv_telemetry *telemetry, const char *channel, int64_t utime, int size) {
  if (size < 0) {
    telemetry->failed++;
    return;
  }
  if (telemetry->lcm && !atomic_load(telemetry->give_up) &&
      lcm_publish(telemetry->lcm, channel, telemetry->message, (unsigned)size) != 0)
    telemetry->failed++;
  if (telemetry->log)
    gv_telemetry_write_log(telemetry, channel, utime, size);
}

void gv_telemetry_want_trace(gv_telemetry *telemetry) {
  atomic_store(&telemetry->loop->trace, telemetry->trace_asked || telemetry->log);
}

// ---- opening and closing ----

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
  gv_drake_init(&telemetry->viewer.drake, telemetry->hand, telemetry->second, telemetry->scene);
  gv_telemetry_point_picture(&telemetry->viewer);
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
  if (telemetry->listens &&
      (commands = lcm_subscribe(lcm, "GLOVED_COMMAND", gv_telemetry_on_command, telemetry)))
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
  telemetry.second = cfg->second;
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
  gv_telemetry_want_trace(telemetry);
  gv_telemetry_send_about(telemetry, true);  // the network may block, and the loop does not run yet
}

void gv_telemetry_change_scene(gv_telemetry *telemetry) {
  gv_telemetry_send_batch(telemetry);
  take_scene(telemetry);
  gv_telemetry_send_about(telemetry, true);
  telemetry->viewer.next_load_us = 0;
  gv_telemetry_answer(telemetry, GV_REQUEST_SCENE, telemetry->scene_request.tag, NULL);
}

uint64_t gv_telemetry_failed(const gv_telemetry *telemetry) { return telemetry->failed; }

int gv_telemetry_close(gv_telemetry *telemetry) {
  gv_telemetry_send_batch(telemetry);
  if (telemetry->log)
    gv_telemetry_end_log(telemetry);
  if (telemetry->lcm)
    lcm_destroy(telemetry->lcm);
  return telemetry->log_broken ? -1 : 0;
}
