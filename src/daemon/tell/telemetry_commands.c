// SPDX-License-Identifier: BSD-3-Clause
// GLOVED_COMMAND to requests for the loop, and the answers. Length, range and rate are checked before
// anything is decoded; the moment is the loop's to judge. Slow thread.
#include "daemon/tell/telemetry_state.h"

// The answer to a command that does not reach the loop.
static void answer_with(gv_telemetry *telemetry, int kind, int64_t tag, const char *refusal,
                        const char *value) {
  char text[ANSWER_TEXT];
  snprintf(text, sizeof text, "command %s: %s%s", gv_request_name(kind), refusal ? "refused: " : "done",
           refusal ? refusal : value);
  telemetry->commands_refused += refusal ? 1 : 0;
  gv_telemetry_send_event(telemetry,
                          &(gloved_event_t){.utime = gv_telemetry_now_us(),
                                            .step = telemetry->state.step,
                                            .time_s = telemetry->state.time_s,
                                            .kind = EVENT_COMMAND,
                                            .bits = (kind & 0xff) | (refusal ? GV_RECORD_REFUSED : 0),
                                            .answers = tag,
                                            .text = text});
}

void gv_telemetry_answer(gv_telemetry *telemetry, int kind, int64_t tag, const char *refusal) {
  answer_with(telemetry, kind, tag, refusal, "");
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
  gv_telemetry_want_trace(telemetry);
  if (!telemetry->log)
    return because(telemetry, "%s: cannot be written (%s); look at the daemon's directory", path,
                   strerror(errno));
  snprintf(telemetry->log_name, sizeof telemetry->log_name, "%s", path);
  gv_telemetry_send_about(telemetry, true);
  return NULL;
}

static const char *stop_log(gv_telemetry *telemetry) {
  if (!telemetry->log)
    return "no log is being written";
  gv_telemetry_send_batch(telemetry);
  gv_telemetry_end_log(telemetry);
  gv_telemetry_want_trace(telemetry);
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

void gv_telemetry_answer_questions(gv_telemetry *telemetry, const gv_snapshot *snapshot) {
  static char text[2 + GV_STATUS_BYTES];
  const gv_status status = {.about = telemetry->about,
                            .settings = telemetry->settings,
                            .snapshot = snapshot,
                            .second = &telemetry->second_told,
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
  gv_telemetry_answer(telemetry, GV_REQUEST_SCENE, telemetry->scene_request.tag, refusal);
}

// Those for the loop are answered by the loop, when they are done.
static void obey(gv_telemetry *telemetry, const gv_request *request) {
  const char *refusal = NULL;
  switch (request->kind) {
    case GV_REQUEST_START_LOG: refusal = start_log(telemetry, request->text); break;
    case GV_REQUEST_STOP_LOG:
      // into the log as well
      gv_telemetry_answer(telemetry, (int)request->kind, request->tag,
                          telemetry->log ? NULL : "no log is being written");
      stop_log(telemetry);
      return;
    case GV_REQUEST_TRACE:
      telemetry->trace_asked = request->value >= 0.5;
      gv_telemetry_want_trace(telemetry);
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
  gv_telemetry_answer(telemetry, (int)request->kind, request->tag, refusal);
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
    gv_telemetry_answer(telemetry, kind, tag, refusal);
  else
    telemetry->commands_refused++;
}

void gv_telemetry_on_command(const lcm_recv_buf_t *buffer, const char *channel, void *user) {
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
