// SPDX-License-Identifier: BSD-3-Clause
// The slow thread: empties the loop's rings into telemetry, recording, black box and
// view until the loop has ended.
#ifndef GLOVED_PROCESS_SLOW_H
#define GLOVED_PROCESS_SLOW_H

#include "daemon/tell/black_box.h"
#include "daemon/tell/held.h"
#include "daemon/tell/notify.h"
#include "daemon/tell/recorder.h"
#include "daemon/tell/telemetry.h"
#include "daemon/tell/view.h"

// Who hears what the loop tells.
typedef struct gv_listeners {
  gv_telemetry *telemetry;
  gv_recorder *recorder;
  gv_black_box *black_box;  // null: none
  gv_view *view;
  gv_notify *notify;      // the service manager
  gv_held *held;          // objects in the hand
  const gv_scene *scene;  // theirs
} gv_listeners;

// Returns when the loop has ended and its rings are empty. Runs in the caller's thread (main).
void gv_slow_run(gv_loop *loop, const gv_listeners *to);

#endif
