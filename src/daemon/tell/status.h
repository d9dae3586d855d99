// SPDX-License-Identifier: BSD-3-Clause
// What is in force in a running daemon, in words, for whoever asks by GLOVED_COMMAND. Slow thread.
#ifndef GLOVED_DAEMON_STATUS_H
#define GLOVED_DAEMON_STATUS_H

#include "daemon/load/about.h"
#include "daemon/load/config_load.h"
#include "daemon/loop/snapshot.h"

enum { GV_STATUS_BYTES = 4000 };

// Of a second hand's newest snapshot.
typedef struct gv_second_told {
  gv_safety_state safety;
  uint32_t faults;
  bool dead_man;
} gv_second_told;

typedef struct gv_status {
  const gv_about *about;
  const gv_settings *settings;  // as the run began
  const gv_snapshot *snapshot;  // the newest; coupling and friction are its
  const gv_second_told *second;
  double received_hz, sent_hz;  // frames, of the last second
  const char *log;              // the LCM log that is being written; empty: none
} gv_status;

// Whether `name` is a value of `gv_status_get`, or a setting GROUP.KEY of the configuration. Empty: "NAME
// VALUE; NAME VALUE; ..." of all but the settings. Otherwise that value alone. False: there is none of that
// name, and out says which there are. No value contains "; " or what a terminal obeys.
bool gv_status_text(const gv_status *status, const char *name, char out[GV_STATUS_BYTES]);

#endif
