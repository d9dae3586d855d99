// SPDX-License-Identifier: BSD-3-Clause
// Publishes snapshots, events and steps over LCM and into an LCM log file, and takes
// commands. Slow thread only.
#ifndef GLOVED_PROCESS_TELEMETRY_H
#define GLOVED_PROCESS_TELEMETRY_H

#include <stddef.h>

#include "daemon/load/about.h"
#include "daemon/load/config_load.h"
#include "gloved/arena.h"
#include "gloved/scene.h"
#include "daemon/loop/loop.h"

typedef struct gv_telemetry gv_telemetry;

typedef struct gv_telemetry_config {
  const char *lcm_url;          // "none": no network
  bool lcm_required;            // an LCM that does not start is an error
  const gv_scene *scene;        // must outlive the telemetry
  const gv_hand_model *hand;    // drawn
  const gv_hand_model *second;  // likewise; null: none
  const gv_arena *arena;        // its figures are published; must outlive the telemetry
  // Begins to load the scene in this file beside the loop. Null, or why not and what to do.
  // Null here: no scene by command.
  const char *(*begin_scene)(void *user, const char *file, int64_t now_ns);
  // Whether there is an end of it: *out_refusal is null, or why not and what to do.
  bool (*scene_ended)(void *user, int64_t now_ns, const char **out_refusal);
  void *user;                   // of these two
  const gv_about *about;        // must outlive the telemetry
  const gv_settings *settings;  // the same
  const atomic_bool *give_up;   // from when on nothing is sent any more (the log goes on)
} gv_telemetry_config;

// One at a time per process. Null with one line (what, what to do) in err where LCM does not start
// although it is required; where it is not, err says so and the rest works. err is empty when all is well.
gv_telemetry *gv_telemetry_open(const gv_telemetry_config *cfg, char *err, size_t err_size);
// Logs into this file, which is emptied: the last thing before gv_telemetry_attach. 0,
// or negative with a line in err.
int gv_telemetry_log(gv_telemetry *telemetry, const char *path, char *err, size_t err_size);
// Before the loop starts: it is the one that commands are for. A log wants every step from the first.
void gv_telemetry_attach(gv_telemetry *telemetry, gv_loop *loop);
// The scene given to gv_telemetry_open has other objects now; answers the command that asked
// for it. Before the loop goes on.
void gv_telemetry_change_scene(gv_telemetry *telemetry);
// GLOVED_STATE or GLOVED_STATE2, and when it is time GLOVED_STATS and the viewer's messages. Encodes into a
// static buffer; may block as long as the network does (130 ms were seen).
void gv_telemetry_snapshot(gv_telemetry *telemetry, const gv_snapshot *snapshot);
// GLOVED_EVENT.
void gv_telemetry_record(gv_telemetry *telemetry, const gv_record *record);
// GLOVED_TRACE, sent when a batch is full.
void gv_telemetry_step(gv_telemetry *telemetry, const gv_step_record *step);
// Takes the commands that came in (GLOVED_COMMAND); now_ns of CLOCK_MONOTONIC.
void gv_telemetry_listen(gv_telemetry *telemetry, int64_t now_ns);
// Messages that LCM or the disk refused so far.
uint64_t gv_telemetry_failed(const gv_telemetry *telemetry);
// Sends what is left of a batch. 0, or negative where a log is not whole: the disk refused.
int gv_telemetry_close(gv_telemetry *telemetry);

#endif
