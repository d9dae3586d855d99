// SPDX-License-Identifier: BSD-3-Clause
// What the files of the telemetry share: its memory and what they ask of each other. telemetry.c opens,
// sends and closes, telemetry_messages.c fills GLOVED_STATE, GLOVED_STATS, GLOVED_TRACE and GLOVED_ABOUT,
// telemetry_picture.c the viewers' messages, telemetry_commands.c takes GLOVED_COMMAND. These four alone
// know LCM. Slow thread.
#ifndef GLOVED_TELEMETRY_STATE_H
#define GLOVED_TELEMETRY_STATE_H

#include "daemon/tell/telemetry.h"

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

#include "daemon/load/config_load.h"
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
typedef struct gv_telemetry_picture {
  gv_drake drake;
  int64_t next_draw_us, next_load_us;  // utime of the next messages
  gloved_viewer_geometry_t geometry[GV_DRAKE_LINKS];
  gloved_viewer_link_t link[GV_DRAKE_LINKS];
  char *name[GV_DRAKE_LINKS];
  int32_t robot[GV_DRAKE_LINKS];
  float position[GV_DRAKE_LINKS][3], quaternion[GV_DRAKE_LINKS][4];
  float *position_row[GV_DRAKE_LINKS], *quaternion_row[GV_DRAKE_LINKS];
} gv_telemetry_picture;

typedef struct gv_telemetry_statistics {
  gloved_stats_t stats;
  gloved_histogram_t histogram[2 + GV_STAGES];
  double upper_us[2 + GV_STAGES][GV_HISTOGRAM_COARSE];
  int64_t in_bin[2 + GV_STAGES][GV_HISTOGRAM_COARSE];
} gv_telemetry_statistics;

// How many frames went each way in the last whole second.
typedef struct gv_telemetry_rates {
  int64_t since_us;         // 0: not begun
  uint64_t received, sent;  // then
  double received_hz, sent_hz;
} gv_telemetry_rates;

typedef struct gv_telemetry_batch {
  gloved_trace_t trace;
  gloved_step_t step[BATCH_STEPS];
  gloved_frame_t frame[BATCH_STEPS][GV_STEP_FRAMES];
  uint8_t data[BATCH_STEPS][GV_STEP_FRAMES][64];
  int bytes;
} gv_telemetry_batch;

struct gv_telemetry {
  lcm_t *lcm;           // null: not published
  lcm_eventlog_t *log;  // null: not logged
  const gv_scene *scene;
  const gv_arena *arena;
  const atomic_bool *give_up;
  const gv_hand_model *hand, *second;
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
  gv_telemetry_rates rates;
  gv_second_told second_told;
  char why[GV_REQUEST_WHY];  // the last refusal
  char log_name[GV_SETTING_TEXT];
  int64_t listened_ns, next_stats_us, next_about_us;
  uint64_t failed, commands_refused;
  int64_t log_events;
  gloved_state_t state;
  gloved_object_t object[GV_MAX_OBJECTS];
  gloved_contact_t contact[GV_MAX_CONTACTS];
  gloved_polygon_t polygon[GV_MAX_POLYGONS];
  gv_telemetry_picture viewer;
  gv_telemetry_statistics statistics;
  gv_telemetry_batch batch;
  uint8_t message[MESSAGE_MAX];
};

// Microseconds since 1970.
static inline int64_t gv_telemetry_now_us(void) {
  struct timespec now;
  clock_gettime(CLOCK_REALTIME, &now);
  return (int64_t)now.tv_sec * 1000000 + now.tv_nsec / 1000;
}

// When `utime` reached *next: true, and *next is moved on by whole periods.
static inline bool gv_telemetry_is_due(int64_t *next, int64_t utime, int64_t period) {
  if (utime < *next)
    return false;
  *next = utime - *next < period ? *next + period : utime + period;
  return true;
}

// telemetry.c
// The first `size` bytes of telemetry->message, to the network and into the log; below 0: they did not fit.
void gv_telemetry_send(gv_telemetry *telemetry, const char *channel, int64_t utime, int size);
void gv_telemetry_write_log(gv_telemetry *telemetry, const char *channel, int64_t utime, int size);
void gv_telemetry_end_log(gv_telemetry *telemetry);
// Whether the loop hands over every step.
void gv_telemetry_want_trace(gv_telemetry *telemetry);

// telemetry_messages.c
void gv_telemetry_send_event(gv_telemetry *telemetry, const gloved_event_t *event);
void gv_telemetry_send_batch(gv_telemetry *telemetry);
void gv_telemetry_send_about(gv_telemetry *telemetry, bool log_alone);

// telemetry_picture.c
void gv_telemetry_point_picture(gv_telemetry_picture *picture);
void gv_telemetry_send_picture(gv_telemetry *telemetry, const gv_snapshot *snapshot);

// telemetry_commands.c
void gv_telemetry_on_command(const lcm_recv_buf_t *buffer, const char *channel, void *user);
// To a command that does not reach the loop. refusal: null, or why not.
void gv_telemetry_answer(gv_telemetry *telemetry, int kind, int64_t tag, const char *refusal);
// From a snapshot that is newer than the questions.
void gv_telemetry_answer_questions(gv_telemetry *telemetry, const gv_snapshot *snapshot);

#endif
