// SPDX-License-Identifier: BSD-3-Clause
// Publishes snapshots and events over LCM and into an LCM log file. Slow thread only.
#ifndef GLOVED_PROCESS_TELEMETRY_H
#define GLOVED_PROCESS_TELEMETRY_H

#include <stddef.h>

#include "gloved/scene.h"
#include "loop.h"

typedef struct gv_telemetry gv_telemetry;

// lcm_url "none": no network. log_path null: no log. The scene must outlive it; `hand` is drawn. One at a time per process.
// Null with one line (what, what to do) in err where the log cannot be written, or LCM does not start
// although it is required; where it is not, err says so and the rest works. err is empty when all is well.
gv_telemetry *gv_telemetry_open(const char *lcm_url, bool lcm_required, const char *log_path, const gv_scene *scene,
                                const gv_hand_model *hand, char *err, size_t err_size);
// GLOVED_STATE, and when it is time the viewer's messages. Encodes into a static buffer; may block as long as the network does (130 ms were seen).
void gv_telemetry_snapshot(gv_telemetry *telemetry, const gv_loop *loop, const gv_snapshot *snapshot);
// GLOVED_EVENT.
void gv_telemetry_record(gv_telemetry *telemetry, const gv_record *record);
// Messages that LCM or the disk refused so far.
uint64_t gv_telemetry_failed(const gv_telemetry *telemetry);
void gv_telemetry_close(gv_telemetry *telemetry);

#endif
