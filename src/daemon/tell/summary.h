// SPDX-License-Identifier: BSD-3-Clause
// What a run came to: one JSON object (--summary) and a few lines for a person. After the loop has ended.
#ifndef GLOVED_PROCESS_SUMMARY_H
#define GLOVED_PROCESS_SUMMARY_H

#include <stdio.h>

#include "gloved/scene.h"
#include "daemon/load/about.h"
#include "daemon/loop/loop.h"
#include "daemon/tell/held.h"

typedef struct gv_summary {
  const gv_loop *loop;
  const gv_scene *scene;
  gv_exit reason;  // fault: forces were brought to zero
  gv_driver_stats driver;
  uint64_t telemetry_failed;  // messages that LCM or the disk refused
  const gv_arena *arena;
  const char *title;  // what ran
  const gv_about *about;
  const gv_held *held;  // grasps of the scene's objects
} gv_summary;

// The keys are listed in DESIGN.md, "Interfaces". An object's position and quaternion are those of its own
// frame, as the scene file draws it. Returns 0, or negative where the file refused a byte.
int gv_summary_json(const gv_summary *summary, FILE *out);
void gv_summary_print(const gv_summary *summary, FILE *out);

#endif
