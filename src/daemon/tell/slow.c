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
  if (*reported || refusals < 0)
    return;
  *reported = true;
  if (!refusals)
    return;
  gv_realtime_refusal_text((unsigned)refusals, text, sizeof text);
  fprintf(stderr, "gloved: %s\n", text);
}

// What the devices have to say, ten times a second at most.
static void report_devices(const gv_loop *loop, gv_view *view, int64_t *next_ns) {
  char text[GV_VIEW_NOTE];
  const gv_driver *driver = loop->driver;
  const int64_t now_ns = clock_ns();
  if (!driver->tell || now_ns < *next_ns)
    return;
  *next_ns = now_ns + 100000000;
  while (driver->tell(driver->self, now_ns, text, sizeof text))
    gv_view_note(view, text);
}

static void empty_rings(gv_loop *loop, const gv_listeners *to) {
  const gv_frame *frame;
  const gv_record *record;
  const gv_snapshot *snapshot;
  const gv_step_record *step;
  while ((frame = gv_ring_peek(&loop->frames))) {
    gv_recorder_frame(to->recorder, frame);
    gv_black_box_frame(to->black_box, frame);
    gv_ring_release(&loop->frames);
  }
  gv_recorder_flush(to->recorder);
  while ((record = gv_ring_peek(&loop->records))) {
    gv_telemetry_record(to->telemetry, record);
    if (record->kind == GV_RECORD_STATE && record->hand == 0)
      gv_notify_status(to->notify, gv_safety_name(record->to),
                       record->bits ? gv_fault_text(record->bits) : "");
    gv_black_box_record(to->black_box, record);
    gv_view_record(to->view, record);
    gv_ring_release(&loop->records);
  }
  while ((snapshot = gv_ring_peek(&loop->snapshots))) {
    gv_telemetry_snapshot(to->telemetry, snapshot);
    if (snapshot->hand)
      gv_view_second(to->view, snapshot);
    else
      gv_view_snapshot(to->view, clock_ns(), loop, snapshot);
    gv_held_snapshot(&to->held[snapshot->hand], to->scene, snapshot);
    gv_ring_release(&loop->snapshots);
  }
  while ((step = gv_ring_peek(&loop->steps))) {
    gv_telemetry_step(to->telemetry, step);
    gv_black_box_step(to->black_box, step);
    gv_ring_release(&loop->steps);
  }
  gv_black_box_work(to->black_box);
}

void gv_slow_run(gv_loop *loop, const gv_listeners *to) {
  const struct timespec pause = {0, SLEEP_NS};
  bool reported = loop->starts > 1;
  int64_t devices_ns = 0;
  while (gv_loop_running(loop)) {
    report_refusals(loop, &reported);
    empty_rings(loop, to);
    gv_telemetry_listen(to->telemetry, clock_ns());
    report_devices(loop, to->view, &devices_ns);
    gv_notify_alive(to->notify, clock_ns(), atomic_load(&loop->step.count));
    nanosleep(&pause, NULL);
  }
  report_refusals(loop, &reported);
  empty_rings(loop, to);
}
