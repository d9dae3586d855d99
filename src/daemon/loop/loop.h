// SPDX-License-Identifier: BSD-3-Clause
// The real-time loop: one thread, one absolute deadline per period. It never prints, blocks or
// allocates; what it has to tell goes into three rings that the slow thread empties.
//
//   live   time is CLOCK_MONOTONIC; the devices run by themselves (udp:); with sync_device a step begins
//          with the glove's frame (sync.h)
//   paced  time is step number x period, slept for in real time: a recording or a simulated device gives the
//          same result as in `free`
//   free   the same time, as fast as possible (?speed=0)
#ifndef GLOVED_PROCESS_LOOP_H
#define GLOVED_PROCESS_LOOP_H

#include <pthread.h>

#include "daemon/load/pace.h"
#include "daemon/loop/histogram.h"
#include "daemon/loop/realtime.h"
#include "daemon/loop/ring.h"
#include "daemon/loop/snapshot.h"
#include "daemon/loop/sync.h"

enum {
  GV_LOOP_SNAPSHOTS = 32,  // 0.6 s of snapshots at 50 Hz before the first is dropped; 23 kB each
  GV_LOOP_RECORDS = 256,
  GV_LOOP_STEPS = 2048,  // 2 s of step records at 1 kHz; 0.9 kB each, only while GLOVED_TRACE or a
                         // black box is wanted
  GV_LOOP_REQUESTS = 16,
  GV_LOOP_FRAMES = 256,      // frames taken per period: what a device of 1 kHz sends in 64 ms; the rest waits
  GV_LOOP_RECORDED = 16384,  // frames in and out for --record: 3 s at 5 a period of 1 kHz; 88 B each
  GV_SNAPSHOT_HZ = 50
};

typedef struct gv_loop_config {
  int64_t period_ns;
  int64_t periods_max;  // skipped ones count in live pace; 0: until the driver ends or a signal comes
  gv_pace pace;
  bool sync_device;  // live pace and a driver with a descriptor: its frame is the clock
  bool strict;       // the thread may make no system call but those of strict.h
  bool record;       // every frame goes into the ring `frames`
  bool black_box;    // that, and every step goes into the ring `steps`
  gv_realtime_config realtime;
  unsigned alarm_s;  // SIGALRM so many seconds after the end, for a slow thread that hangs; 0: none
} gv_loop_config;

// GV_EXIT_REFUSED: the kernel refused `strict`, and no step was made.
// GV_EXIT_SCENE: a request for another scene was obeyed; gv_loop_change_scene and gv_loop_start go on.
typedef enum gv_exit {
  GV_EXIT_RUNNING,
  GV_EXIT_END,
  GV_EXIT_DURATION,
  GV_EXIT_SIGNAL,
  GV_EXIT_FAULT,
  GV_EXIT_SCENE,
  GV_EXIT_REFUSED
} gv_exit;

// Parts of a period's work: take frames, session step, send the command, tell the slow thread.
typedef enum gv_stage { GV_STAGE_POLL, GV_STAGE_COMPUTE, GV_STAGE_SEND, GV_STAGE_TELL, GV_STAGES } gv_stage;

// The loop's thread writes everything but `stop`; others read the atomics at any time, and the rest
// after gv_loop_join.
typedef struct gv_loop {
  gv_loop_config cfg;
  gv_session *session;  // of each hand (hands.h)
  gv_driver *driver;
  int object_count;
  pthread_t thread;
  atomic_bool *stop;              // set by a signal handler
  _Atomic int exit;               // gv_exit; other than running: the loop has ended
  _Atomic int refusals;           // gv_refusal bits of the thread's set-up; -1: not known yet
  gv_histogram stage[GV_STAGES];  // parts of `step`
  gv_histogram step, wake;        // work of a period; deadline (sync_device: the frame's stamp) to start of
                                  // work (not in free pace)
  _Atomic uint64_t missed_deadlines;    // steps that were not done within their period
  _Atomic uint64_t overruns;            // whole periods skipped because of them
  _Atomic uint64_t on_rung[GV_RUNGS];   // live pace: periods by the rung of the deadline ladder (ladder.h)
  _Atomic uint64_t on_frame, on_clock;  // with sync_device: steps that began with a glove's frame, and
                                        // without one
  _Atomic uint64_t heap_calls;          // in this thread since the end of its first step
  gv_page_faults page_faults;           // likewise
  gv_safety_state state_before_stop;    // of the safety machine when the loop began to end; of two that
                                        // of the hand in a fault
  uint32_t faults_before_stop;
  gv_ring snapshots, records, steps, frames;  // to the slow thread
  gv_ring requests;                           // from the slow thread
  atomic_bool scene_asked;     // set by the slow thread with a request for another scene; false
                               // again where it is refused
  atomic_bool trace;           // set by the slow thread: step records are wanted
  int starts;                  // gv_loop_start so far: scenes
  uint64_t heap_calls_before;  // of the threads before this one
  gv_page_faults page_faults_before;
  // The loop's own.
  bool scene_accepted;        // the loop is to end for it
  int64_t number;             // of the period, over all scenes
  int strict_errno;           // why the kernel refused `strict`
  unsigned refusals_before;   // of the process, before the thread started
  unsigned overruns_now;      // periods skipped just before this step
  int64_t wall_us;            // us since 1970 when session time was 0
  int commands;               // a period (gv_loop_commands)
  int64_t repeats;            // of the command since the last step
  int64_t sent_ns;            // CLOCK_MONOTONIC of the last command
  int64_t now_ns;             // session time of this step or repeat
  int64_t step_ns;            // its number x period
  uint32_t events[GV_HANDS];  // engine events since the last snapshot
  gv_safety_state state_reported[GV_HANDS];
  bool other_hand_reported[GV_HANDS], following_reported;
  int64_t next_report[GV_HANDS][32];  // step before which an engine event bit is not reported again; 29:
                                      // ladder, 30: sync, 31: overruns
  gv_sync sync;
  gv_ladder ladder;
  gv_rung rung_reported, rung_recorded;
  uint8_t effort_counter;
  uint8_t pull_counter[GV_HANDS];
  gv_frame frame[GV_LOOP_FRAMES + 1 + GV_HANDS];  // of this step; and EFFORT and PULL of recordings
  int frame_count;
  gv_snapshot snapshot_slot[GV_LOOP_SNAPSHOTS];
  gv_record record_slot[GV_LOOP_RECORDS];
  gv_step_record step_slot[GV_LOOP_STEPS];
  gv_request request_slot[GV_LOOP_REQUESTS];
  gv_frame recorded_slot[GV_LOOP_RECORDED];
} gv_loop;

// `loop` zeroed, its memory present (some 4.1 MB). `session`: as many as the engine has hands. `stop` may be
// set from a signal handler.
void gv_loop_init(gv_loop *loop, const gv_loop_config *cfg, gv_session *session, gv_driver *driver,
                  int object_count, atomic_bool *stop);
// Locks memory as configured and starts the thread. 0, or the errno of pthread_create.
int gv_loop_start(gv_loop *loop);
// After gv_loop_join with GV_EXIT_SCENE: the session has got the new scene's engine.
// Times, losses and rings stay.
void gv_loop_change_scene(gv_loop *loop, int object_count);
bool gv_loop_running(const gv_loop *loop);
void gv_loop_join(gv_loop *loop);
// "end of input", "duration", "signal", "fault", "scene", "refused"
const char *gv_exit_name(gv_exit reason);

// Commands that a period of this length takes: one every millisecond where periods
// are 2 ms and longer, else one.
int gv_loop_commands(int64_t period_ns);
// Whole periods to skip so that a deadline that was missed by late_ns lies ahead again; 0 when not late.
int64_t gv_loop_periods_to_skip(int64_t late_ns, int64_t period_ns);

#endif
