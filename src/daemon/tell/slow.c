// SPDX-License-Identifier: BSD-3-Clause
// Everything that may block or take long: publishing, the logs, the view. It sleeps 2 ms between looks at
// the rings (a futex would cost the real-time thread a system call for each snapshot).
#include "daemon/tell/slow.h"

#include <stdio.h>
#include <time.h>

enum { SLEEP_NS = 2000000 };

static int64_t clock_ns(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

// Once, when the loop's thread has set itself up.
static void report_refusals(const gv_loop *loop, bool *reported) {
  char text[200];
  int refusals = atomic_load(&loop->refusals);
  if (*reported || refusals < 0) return;
  *reported = true;
  if (!refusals) return;
  gv_realtime_refusal_text((unsigned)refusals, text, sizeof text);
  fprintf(stderr, "gloved: %s\n", text);
}

static void empty_rings(gv_loop *loop, gv_telemetry *telemetry, gv_recorder *recorder, gv_view *view) {
  const gv_record *record;
  const gv_snapshot *snapshot;
  const gv_step_record *step;
  gv_recorder_drain(recorder, &loop->frames);
  while ((record = gv_ring_peek(&loop->records))) {
    gv_telemetry_record(telemetry, record);
    gv_view_record(view, record);
    gv_ring_release(&loop->records);
  }
  while ((snapshot = gv_ring_peek(&loop->snapshots))) {
    gv_telemetry_snapshot(telemetry, snapshot);
    gv_view_snapshot(view, clock_ns(), loop, snapshot);
    gv_ring_release(&loop->snapshots);
  }
  while ((step = gv_ring_peek(&loop->steps))) {
    gv_telemetry_step(telemetry, step);
    gv_ring_release(&loop->steps);
  }
}

void gv_slow_run(gv_loop *loop, gv_telemetry *telemetry, gv_recorder *recorder, gv_view *view) {
  const struct timespec pause = {0, SLEEP_NS};
  bool reported = loop->starts > 1;
  while (gv_loop_running(loop)) {
    report_refusals(loop, &reported);
    empty_rings(loop, telemetry, recorder, view);
    gv_telemetry_listen(telemetry, clock_ns());
    nanosleep(&pause, NULL);
  }
  report_refusals(loop, &reported);
  empty_rings(loop, telemetry, recorder, view);
}
