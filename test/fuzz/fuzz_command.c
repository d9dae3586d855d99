// SPDX-License-Identifier: BSD-3-Clause
// Fuzz entry (libFuzzer, `make fuzz`): any bytes as messages on GLOVED_COMMAND. Nothing but a
// sound request within its bounds reaches the loop. The linker hands LCM's subscription to this
// file; LCM itself stays out of it (--wrap).
#include <lcm/lcm.h>
#include <stddef.h>

#include "bytes.h"
#include "daemon/tell/telemetry.h"
#include "support/lab.h"

lcm_t *__wrap_lcm_create(const char *url);
lcm_subscription_t *__wrap_lcm_subscribe(lcm_t *lcm, const char *channel, lcm_msg_handler_t handler,
                                         void *user);
int __wrap_lcm_subscription_set_queue_capacity(lcm_subscription_t *subscription, int messages);
int __wrap_lcm_publish(lcm_t *lcm, const char *channel, const void *data, unsigned size);
int __wrap_lcm_handle_timeout(lcm_t *lcm, int timeout_ms);
lcm_eventlog_t *__wrap_lcm_eventlog_create(const char *path, const char *mode);

static lcm_msg_handler_t on_command;
static void *on_command_user;
static max_align_t no_lcm;

lcm_t *__wrap_lcm_create(const char *url) {
  (void)url;
  return (lcm_t *)(void *)&no_lcm;
}

lcm_subscription_t *__wrap_lcm_subscribe(lcm_t *lcm, const char *channel, lcm_msg_handler_t handler,
                                         void *user) {
  if (strcmp(channel, "GLOVED_COMMAND") == 0) {
    on_command = handler;
    on_command_user = user;
  }
  return (lcm_subscription_t *)(void *)lcm;
}

int __wrap_lcm_subscription_set_queue_capacity(lcm_subscription_t *subscription, int messages) {
  REQUIRE(subscription && messages > 0);
  return 0;
}

int __wrap_lcm_publish(lcm_t *lcm, const char *channel, const void *data, unsigned size) {
  (void)lcm;
  (void)channel;
  (void)data;
  REQUIRE(size < 65000);
  return 0;
}

int __wrap_lcm_handle_timeout(lcm_t *lcm, int timeout_ms) {
  (void)lcm;
  (void)timeout_ms;
  return 0;
}

// No log is written here; its name must be one in the daemon's own directory.
lcm_eventlog_t *__wrap_lcm_eventlog_create(const char *path, const char *mode) {
  (void)mode;
  REQUIRE(*path && strlen(path) < GV_REQUEST_TEXT && !strchr(path, '/') && *path != '.');
  return NULL;
}

static const char *refuse_scene(void *user, const char *file, int64_t now_ns_of_it) {
  (void)user;
  (void)now_ns_of_it;
  REQUIRE(strlen(file) < GV_REQUEST_TEXT && file[0] != '/' && !strstr(file, ".."));
  return "no scene is loaded here";
}

static bool no_scene_ends(void *user, int64_t now_ns_of_it, const char **out_refusal) {
  (void)user;
  (void)now_ns_of_it;
  (void)out_refusal;
  return false;
}

static gv_telemetry *telemetry;
static gv_loop loop;
static int64_t now_ns;

static void start(void) {
  static lab world;
  static gv_session session;
  static gv_driver driver;
  static atomic_bool stop, give_up;
  static gv_about about;
  char err[256];
  gv_about_now(&about);
  lab_start(&world);
  lab_box(&world, gv_v3(1, 1, 0.1), gv_v3(0, 0, -0.05), 0, 0.8);
  lab_run(&world);
  const gv_session_config cfg = {
    .limiter = gv_limiter_config_default(), .safety = gv_safety_config_default(), .period_s = 0.001};
  const gv_loop_config loop_cfg = {.period_ns = 1000000};
  gv_session_init(&session, &cfg, world.engine);
  gv_loop_init(&loop, &loop_cfg, &session, &driver, world.scene.object_count, &stop);
  const gv_telemetry_config telemetry_cfg = {.lcm_url = "udpm://",
                                             .lcm_required = true,
                                             .scene = &world.scene,
                                             .hand = &world.cfg.hand,
                                             .arena = &world.arena,
                                             .begin_scene = refuse_scene,
                                             .scene_ended = no_scene_ends,
                                             .about = &about,
                                             .give_up = &give_up};
  telemetry = gv_telemetry_open(&telemetry_cfg, err, sizeof err);
  REQUIRE(telemetry);
  gv_telemetry_attach(telemetry, &loop);
  REQUIRE(on_command != NULL);
}

static void judge(const gv_request *request) {
  REQUIRE(request->kind < GV_REQUEST_KINDS);
  if (request->kind == GV_REQUEST_COUPLING)
    REQUIRE(request->value >= GV_REQUEST_COUPLING_MIN && request->value <= GV_REQUEST_COUPLING_MAX);
  if (request->kind == GV_REQUEST_FRICTION)
    REQUIRE(request->value >= 0.0 && request->value <= GV_REQUEST_FRICTION_MAX);
}

// Messages of one length byte and so many bytes each.
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
  fuzz_bytes bytes = {data, size};
  if (!telemetry)
    start();
  while (bytes.rest > 0) {
    size_t length = fuzz_byte(&bytes);
    if (length > bytes.rest)
      length = bytes.rest;
    uint8_t *message = malloc(length + 1);  // its own block, so that a byte read behind it is seen
    if (length)
      memcpy(message, bytes.next, length);
    bytes.next += length;
    bytes.rest -= length;
    const lcm_recv_buf_t buffer = {.data = message, .data_size = (uint32_t)length};
    now_ns += 200000000;
    gv_telemetry_listen(telemetry, now_ns);
    on_command(&buffer, "GLOVED_COMMAND", on_command_user);
    free(message);
    for (const gv_request *request; (request = gv_ring_peek(&loop.requests)) != NULL;
         gv_ring_release(&loop.requests))
      judge(request);
  }
  return 0;
}
