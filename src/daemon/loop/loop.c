// SPDX-License-Identifier: BSD-3-Clause
// The real-time thread: sleep until the deadline (clock_nanosleep, absolute, CLOCK_MONOTONIC), take the
// devices' frames, one session step, send the command, tell the slow thread. A deadline that was missed is
// not caught up with: whole periods are skipped and counted. With sync_device the sleep is ppoll on the
// driver's descriptor, and the glove's frame ends it (sync.h).
#include "daemon/loop/loop.h"

#include <errno.h>
#include <poll.h>
#include <signal.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "daemon/loop/hands.h"
#include "daemon/loop/heap.h"
#include "daemon/loop/strict.h"
#include "gloved/fcu.h"

enum {
  FINAL_ZERO_COMMANDS = 3,
  RECORDS_A_STEP = 48,  // 7 engine events, other hand and state of each hand, overrun, 16 requests, and room
  STEP_RECORDS_A_STEP = GV_LOOP_FRAMES / GV_STEP_FRAMES,
  OVERRUNS_TO_END = 1000000,  // periods: a fault, whatever the limits are
  LOOKS_A_PERIOD = 32,  // at a descriptor that is readable and has no frame of the glove: bounds a flood
  REPORT_LADDER = 29,
  REPORT_SYNC = 30,
  REPORT_OVERRUN = 31
};
_Static_assert(GV_LOOP_FRAMES + 1 <= GV_HANDS_FRAMES, "frames of a period");

int gv_loop_commands(int64_t period_ns) {
  const int64_t every_ns = 1000000;
  return period_ns <= 2 * every_ns ? 1 : (int)((period_ns + every_ns - 1) / every_ns);
}

int64_t gv_loop_periods_to_skip(int64_t late_ns, int64_t period_ns) {
  return late_ns <= 0 ? 0 : (late_ns + period_ns - 1) / period_ns;
}

const char *gv_exit_name(gv_exit reason) {
  switch (reason) {
    case GV_EXIT_RUNNING: return "running";
    case GV_EXIT_END: return "end of input";
    case GV_EXIT_DURATION: return "duration";
    case GV_EXIT_SIGNAL: return "signal";
    case GV_EXIT_FAULT: return "fault";
    case GV_EXIT_SCENE: return "scene";
    case GV_EXIT_REFUSED: return "refused";
  }
  return "unknown";
}

static int64_t clock_ns(clockid_t clock) {
  struct timespec t;
  clock_gettime(clock, &t);
  return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

static void sleep_until(int64_t deadline_ns) {
  const struct timespec t = {deadline_ns / 1000000000, deadline_ns % 1000000000};
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, NULL) == EINTR) {}
}

static void add_relaxed(_Atomic uint64_t *counter, uint64_t amount) {
  atomic_store_explicit(counter, atomic_load_explicit(counter, memory_order_relaxed) + amount,
                        memory_order_relaxed);
}

// ---- telling the slow thread ------------------------------------------------------------------------

// In free pace nothing gets lost: before a step the loop waits until the slow thread has made room for all
// that one step can have to tell.
static void wait_for_space(const gv_loop *loop) {
  while (gv_ring_space(&loop->snapshots) < GV_HANDS || gv_ring_space(&loop->records) < RECORDS_A_STEP ||
         gv_ring_space(&loop->steps) < STEP_RECORDS_A_STEP ||
         gv_ring_space(&loop->frames) < GV_LOOP_FRAMES + GV_HANDS * (unsigned)loop->commands)
    sleep_until(clock_ns(CLOCK_MONOTONIC) + 200000);
}

static void push_of(gv_loop *loop, int hand, gv_record_kind kind, uint32_t bits, int64_t tag) {
  const gv_session *session = &loop->session[hand];
  gv_record *record = gv_ring_reserve(&loop->records);
  if (!record)
    return;
  int64_t step = gv_session_steps(session);
  *record = (gv_record){.kind = kind,
                        .hand = hand,
                        .step = step,
                        .time_s = (double)(step * loop->cfg.period_ns) * 1e-9,
                        .utime = loop->wall_us + loop->now_ns / 1000,
                        .from = loop->state_reported[hand],
                        .to = session->safety.state,
                        .bits = bits,
                        .tag = tag};
  gv_ring_commit(&loop->records);
}

static void push_record(gv_loop *loop, gv_record_kind kind, uint32_t bits) {
  push_of(loop, 0, kind, bits, 0);
}

// At most one report a second for each kind, so that a noisy event cannot fill the ring.
static bool may_report(gv_loop *loop, int hand, int kind) {
  int64_t step = gv_session_steps(loop->session);
  if (step < loop->next_report[hand][kind])
    return false;
  loop->next_report[hand][kind] = step + 1000000000 / loop->cfg.period_ns;
  return true;
}

// What happened to the world stands in the events of every hand, and is told with the first.
static uint32_t events_of(const gv_loop *loop, int hand) {
  static const uint32_t own = GV_EVENT_HAND_PLACED | GV_EVENT_SAMPLE_REFUSED | GV_EVENT_SAMPLE_JUMP |
                              GV_EVENT_SAMPLE_NO_POSE;
  const uint32_t events = loop->session[hand].result.events;
  return hand ? events & own : events;
}

static void report_hand(gv_loop *loop, int hand) {
  const gv_session *session = &loop->session[hand];
  for (uint32_t rest = events_of(loop, hand); rest; rest &= rest - 1)
    if (may_report(loop, hand, __builtin_ctz(rest)))
      push_of(loop, hand, GV_RECORD_ENGINE, rest & (~rest + 1), 0);
  if (session->other_hand && !loop->other_hand_reported[hand]) {
    push_of(loop, hand, GV_RECORD_OTHER_HAND, 0, 0);
    loop->other_hand_reported[hand] = true;
  }
  if (session->safety.state == loop->state_reported[hand])
    return;
  push_of(loop, hand, GV_RECORD_STATE, session->safety.faults, 0);
  loop->state_reported[hand] = session->safety.state;
}

static void report_events(gv_loop *loop) {
  if (loop->overruns_now && may_report(loop, 0, REPORT_OVERRUN))
    push_record(loop, GV_RECORD_OVERRUN, loop->overruns_now);
  if (loop->sync.following != loop->following_reported && may_report(loop, 0, REPORT_SYNC)) {
    push_record(loop, GV_RECORD_SYNC, loop->sync.following);
    loop->following_reported = loop->sync.following;
  }
  if (loop->ladder.rung != loop->rung_reported && may_report(loop, 0, REPORT_LADDER)) {
    push_record(loop, GV_RECORD_LADDER, loop->ladder.rung);
    loop->rung_reported = loop->ladder.rung;
  }
  for (int i = 0; i < gv_hands_count(loop->session); i++)
    report_hand(loop, i);
}

// Where the slow thread is more than 3 s behind, the rest is dropped and counted.
static void record_frames(gv_loop *loop, const gv_frame *frame, int count, int64_t stamp_ns) {
  const bool wanted = loop->cfg.record || loop->cfg.black_box;
  for (int i = 0; wanted && i < count; i++) {
    gv_frame *recorded = gv_ring_reserve(&loop->frames);
    if (!recorded)
      continue;
    *recorded = frame[i];
    recorded->stamp_ns = stamp_ns;
    gv_ring_commit(&loop->frames);
  }
}

static void push_snapshot(gv_loop *loop, int hand) {
  gv_snapshot *snapshot = gv_ring_reserve(&loop->snapshots);
  if (!snapshot)
    return;
  gv_snapshot_fill(&loop->session[hand], loop->object_count, snapshot);
  snapshot->utime = loop->wall_us + loop->now_ns / 1000;
  snapshot->events = loop->events[hand];
  loop->events[hand] = 0;
  snapshot->missed_deadlines = loop->missed_deadlines;
  snapshot->overruns = loop->overruns;
  snapshot->ring_dropped = gv_ring_dropped(&loop->snapshots);
  snapshot->heap_calls = loop->heap_calls;
  gv_ring_commit(&loop->snapshots);
}

// The second hand's first: the picture, which is drawn with the first one's, has both.
static void push_snapshots(gv_loop *loop) {
  for (int i = gv_hands_count(loop->session) - 1; i >= 0; i--)
    push_snapshot(loop, i);
}

static void push_steps(gv_loop *loop, int64_t wake_ns, int64_t work_ns) {
  const int frame_count = loop->frame_count;
  for (int first = 0; first == 0 || first < frame_count; first += GV_STEP_FRAMES) {
    gv_step_record *record = gv_ring_reserve(&loop->steps);
    if (!record)
      return;
    const int rest = frame_count - first;
    gv_step_record_fill(loop->session, loop->now_ns, &loop->frame[first],
                        rest < GV_STEP_FRAMES ? rest : GV_STEP_FRAMES, record);
    record->utime = loop->wall_us + loop->now_ns / 1000;
    record->step_ns = loop->step_ns;
    record->wake_ns = (int32_t)wake_ns;
    record->work_ns = (int32_t)work_ns;
    gv_ring_commit(&loop->steps);
  }
}

// Requests behind one for another scene wait for that scene. Whoever changes the scene tells that it is done.
static void obey_requests(gv_loop *loop) {
  const gv_request *request;
  while (!loop->scene_accepted && (request = gv_ring_peek(&loop->requests))) {
    const bool done = gv_hands_request(loop->session, request);
    const bool scene = request->kind == GV_REQUEST_SCENE;
    if (!scene || !done)
      push_of(loop, 0, GV_RECORD_REQUEST, (uint32_t)request->kind | (done ? 0u : GV_RECORD_REFUSED),
              request->tag);
    if (scene)
      atomic_store(&loop->scene_asked, done);
    loop->scene_accepted = scene && done;
    gv_ring_release(&loop->requests);
  }
}

static void tell(gv_loop *loop, int64_t step) {
  const int64_t every = 1000000000 / GV_SNAPSHOT_HZ / loop->cfg.period_ns;
  for (int i = 0; i < gv_hands_count(loop->session); i++)
    loop->events[i] |= events_of(loop, i);
  report_events(loop);
  if (every <= 1 || step % every == 0)
    push_snapshots(loop);
  atomic_store_explicit(&loop->heap_calls, loop->heap_calls_before + gv_heap_calls(), memory_order_relaxed);
}

// ---- frames --------------------------------------------------------------------------------------------

static void take_frames(gv_loop *loop, int64_t now_ns) {
  const gv_driver *driver = loop->driver;
  gv_frame *first = &loop->frame[loop->frame_count];
  const int count = driver->poll(driver->self, now_ns, first, GV_LOOP_FRAMES - loop->frame_count);
  loop->frame_count += count;
  // The step may be milliseconds away.
  if (loop->commands > 1)
    gv_hands_heed(loop->session, first, count);
}

// The newest frame of the first hand's glove from `first` on; null: none.
static const gv_frame *glove_among(const gv_loop *loop, int first) {
  for (int i = loop->frame_count - 1; i >= first; i--)
    if (loop->frame[i].id == GV_ID_GLOVE && !(loop->frame[i].flags & GV_FRAME_SECOND))
      return &loop->frame[i];
  return NULL;
}

// Until the descriptor is readable, or the time is over.
static void sleep_on_descriptor(const gv_loop *loop, int64_t until_ns) {
  const int64_t rest_ns = until_ns - clock_ns(CLOCK_MONOTONIC);
  struct pollfd wait = {.fd = loop->driver->descriptor(loop->driver->self), .events = POLLIN};
  const struct timespec rest = {rest_ns / 1000000000, rest_ns % 1000000000};
  if (rest_ns > 0)
    ppoll(&wait, 1, &rest, NULL);
}

// ---- commands between steps ------------------------------------------------------------------------------

static void send_command(gv_loop *loop, int64_t stamp_ns) {
  const int64_t now_ns = clock_ns(CLOCK_MONOTONIC);
  gv_frame command[GV_HANDS];
  const int count = gv_hands_command(loop->session, loop->cfg.pace == GV_PACE_LIVE ? now_ns : loop->now_ns,
                                     command);
  loop->driver->send(loop->driver->self, command, count);
  loop->sent_ns = now_ns;
  record_frames(loop, command, count, stamp_ns);
}

static int64_t command_ns(const gv_loop *loop) { return loop->cfg.period_ns / loop->commands; }

// The device hears of the last step again. Frames that came are kept for the step that is due; a
// simulated device lives by being asked for them. In a recording a repeat lies before the next
// step, whenever that really was.
static void repeat_command(gv_loop *loop) {
  const int64_t latest_ns = loop->cfg.period_ns - 2000;
  const int64_t planned_ns = ++loop->repeats * command_ns(loop);
  const int64_t stamp_ns = loop->step_ns + (planned_ns < latest_ns ? planned_ns : latest_ns);
  loop->now_ns = loop->cfg.pace == GV_PACE_LIVE ? clock_ns(CLOCK_MONOTONIC) : stamp_ns;
  take_frames(loop, loop->now_ns);
  send_command(loop, stamp_ns);
}

// The repeats before the step that is due. A replay has as many after every step; a live loop sends the next
// one command_ns after the last, whatever held that up.
static void repeat_until(gv_loop *loop, int64_t due_ns) {
  const int64_t every_ns = command_ns(loop);
  while (loop->cfg.pace == GV_PACE_LIVE && loop->commands > 1 &&
         loop->sent_ns + every_ns <= due_ns - every_ns / 2) {
    sleep_until(loop->sent_ns + every_ns);
    repeat_command(loop);
  }
  while (loop->cfg.pace != GV_PACE_LIVE && loop->repeats + 1 < loop->commands) {
    if (loop->cfg.pace == GV_PACE_PACED)
      sleep_until(due_ns - loop->cfg.period_ns + (loop->repeats + 1) * every_ns);
    repeat_command(loop);
  }
}

// --sync device: sleeps until the glove's frame opens the step that is due, or until its window
// closes. Frames are taken on the way, and commands repeated. *io_due_ns follows the frame;
// returns when the step should have begun.
static int64_t wait_for_device(gv_loop *loop, int64_t *io_due_ns) {
  const int64_t opens_ns = gv_sync_opens_ns(&loop->sync, *io_due_ns);
  const int64_t closes_ns = gv_sync_closes_ns(&loop->sync, *io_due_ns);
  int64_t frame_ns = INT64_MIN;
  int64_t now_ns = clock_ns(CLOCK_MONOTONIC);
  int seen = loop->frame_count;
  for (int looks = 0; frame_ns < opens_ns && now_ns < closes_ns; looks++) {
    const int64_t repeat_ns = loop->commands > 1 ? loop->sent_ns + command_ns(loop) : INT64_MAX;
    const int64_t until_ns = repeat_ns < closes_ns ? repeat_ns : closes_ns;
    if (looks < LOOKS_A_PERIOD)
      sleep_on_descriptor(loop, until_ns);
    else
      sleep_until(until_ns);
    now_ns = clock_ns(CLOCK_MONOTONIC);
    if (now_ns >= repeat_ns)
      repeat_command(loop);
    take_frames(loop, now_ns);
    const gv_frame *glove = glove_among(loop, seen);
    seen = loop->frame_count;
    if (!glove)
      continue;
    frame_ns = glove->stamp_ns;
    gv_sync_note(&loop->sync, frame_ns);
  }
  const bool on_frame = frame_ns >= opens_ns;
  add_relaxed(on_frame ? &loop->on_frame : &loop->on_clock, 1);
  gv_sync_count(&loop->sync, on_frame);
  if (frame_ns != INT64_MIN)
    *io_due_ns = gv_sync_follow(&loop->sync, *io_due_ns, frame_ns);
  return on_frame ? frame_ns : closes_ns;
}

// ---- the loop -----------------------------------------------------------------------------------------

static gv_exit why_to_end(const gv_loop *loop) {
  if (atomic_load_explicit(loop->stop, memory_order_relaxed))
    return GV_EXIT_SIGNAL;
  const int64_t skipped = loop->cfg.pace == GV_PACE_LIVE ? (int64_t)loop->overruns : 0;
  if (loop->cfg.periods_max > 0 && loop->number + skipped >= loop->cfg.periods_max)
    return GV_EXIT_DURATION;
  if (loop->driver->ended(loop->driver->self))
    return GV_EXIT_END;
  return loop->scene_accepted ? GV_EXIT_SCENE : GV_EXIT_RUNNING;
}

// Skips the periods that are already over; returns the next deadline.
static int64_t next_deadline(gv_loop *loop, int64_t deadline_ns, int64_t done_ns) {
  const int64_t next = deadline_ns + loop->cfg.period_ns;
  const int64_t skip = gv_loop_periods_to_skip(done_ns - next, loop->cfg.period_ns);
  loop->overruns_now = (unsigned)skip;
  if (skip) {
    add_relaxed(&loop->missed_deadlines, 1);
    add_relaxed(&loop->overruns, (uint64_t)skip);
  }
  return next + skip * loop->cfg.period_ns;
}

// From the end of the first step on the thread has touched what it needs: nothing more may be allocated
// or faulted in. loop->page_faults holds the count at that time until count_faults.
static void watch_faults(gv_loop *loop) {
  loop->page_faults = gv_realtime_page_faults();
  gv_heap_watch(true);
}

static void count_faults(gv_loop *loop) {
  const gv_page_faults now = gv_realtime_page_faults();
  const gv_page_faults start = loop->page_faults;
  const gv_page_faults before = loop->page_faults_before;
  gv_heap_watch(false);
  loop->page_faults = (gv_page_faults){before.major + now.major - start.major,
                                       before.minor + now.minor - start.minor};
}

// Forces to zero over the limiter's ramp, without engine steps, and then a few commands of zero for a
// lossy link. Bounded: the ramp ends.
static void ramp_down(gv_loop *loop) {
  int64_t deadline_ns = clock_ns(CLOCK_MONOTONIC);
  gv_frame command[GV_HANDS];
  const gv_session *at_fault = gv_hands_at_fault(loop->session);
  loop->state_before_stop = at_fault->safety.state;
  loop->faults_before_stop = at_fault->safety.faults;
  for (int zeros = 0, sent = 0; zeros < FINAL_ZERO_COMMANDS; sent++) {
    loop->now_ns += command_ns(loop);
    loop->number += sent % loop->commands == 0;
    zeros += gv_hands_stop(loop->session, loop->now_ns, command) ? 1 : 0;
    loop->driver->send(loop->driver->self, command, gv_hands_count(loop->session));
    record_frames(loop, command, gv_hands_count(loop->session), loop->step_ns);
    deadline_ns += command_ns(loop);
    if (loop->cfg.pace != GV_PACE_FREE)
      sleep_until(deadline_ns);
  }
}

// t: start and the ends of the stages.
static void add_times(gv_loop *loop, const int64_t t[GV_STAGES + 1]) {
  for (int i = 0; i < GV_STAGES; i++)
    gv_histogram_add(&loop->stage[i], t[i + 1] - t[i]);
  gv_histogram_add(&loop->step, t[GV_STAGES] - t[0]);
}

// ---- the deadline ladder ---------------------------------------------------------------------------------

// How much of a step fits into what is left of its period; in virtual time always all of it. What a stall
// took before is no reason to do less now.
static gv_rung choose_rung(gv_loop *loop, int64_t due_ns, int64_t now_ns) {
  if (loop->cfg.pace != GV_PACE_LIVE)
    return GV_RUNG_FULL;
  const int64_t late_ns = now_ns > due_ns ? (now_ns - due_ns) % loop->cfg.period_ns : 0;
  const gv_rung rung = gv_ladder_choose(&loop->ladder, loop->cfg.period_ns - late_ns);
  add_relaxed(&loop->on_rung[rung], 1);
  return rung;
}

// No step in this period: the frames wait for the next, and the device hears the last forces.
static void hold_period(gv_loop *loop) {
  gv_hands_hold(loop->session, loop->now_ns, loop->frame, loop->frame_count);
  repeat_command(loop);
  report_events(loop);
  add_relaxed(&loop->overruns, 1);
}

// A recording says what the steps from here on leave out.
static void record_rung(gv_loop *loop) {
  const gv_rung rung = loop->session->rung;
  if (rung == loop->rung_recorded)
    return;
  gv_fcu_pack_effort(&(gv_effort_msg){.counter = loop->effort_counter++, .rung = (uint8_t)rung},
                     &loop->frame[loop->frame_count]);
  loop->frame[loop->frame_count++].stamp_ns = loop->now_ns;
  loop->rung_recorded = rung;
}

// And what pulled the fingers, where an observer reckons with it: in a live loop that hangs on the clock.
static void record_pull(gv_loop *loop) {
  if (loop->cfg.pace != GV_PACE_LIVE || !gv_engine_config(loop->session->engine)->finger.observed)
    return;
  for (int i = 0; i < gv_hands_count(loop->session); i++) {
    gv_frame *frame = &loop->frame[loop->frame_count++];
    gv_pull_msg msg = {.counter = loop->pull_counter[i]++};
    memcpy(msg.tension_n, loop->session[i].sample.tension_n, sizeof msg.tension_n);
    gv_fcu_pack_pull(&msg, frame);
    frame->stamp_ns = loop->now_ns;
    frame->flags |= i ? GV_FRAME_SECOND : 0;
  }
}

// ---- a period --------------------------------------------------------------------------------------------

// One step. due_ns: when it should have begun.
static void step_once(gv_loop *loop, gv_rung rung, int64_t due_ns, int64_t start_ns, int64_t polled_ns) {
  const gv_pace pace = loop->cfg.pace;
  // In virtual time nothing is late, and a simulated user must not feel the host's load.
  const unsigned late = pace == GV_PACE_LIVE ? loop->overruns_now : 0;
  const unsigned overruns = rung == GV_RUNG_RAMP ? OVERRUNS_TO_END : late;
  if (pace == GV_PACE_LIVE)
    gv_session_set_rung(loop->session, rung);
  gv_hands_compute(loop->session, loop->now_ns, loop->frame, loop->frame_count, overruns);
  const int64_t computed_ns = clock_ns(CLOCK_MONOTONIC);
  record_rung(loop);
  record_pull(loop);
  record_frames(loop, loop->frame, loop->frame_count, loop->step_ns);
  loop->repeats = 0;
  send_command(loop, loop->step_ns);
  const int64_t sent_ns = clock_ns(CLOCK_MONOTONIC);
  tell(loop, loop->number);
  const int64_t done_ns = clock_ns(CLOCK_MONOTONIC);
  gv_ladder_measure(&loop->ladder, loop->session->rung, done_ns - polled_ns);
  add_times(loop, (const int64_t[]){start_ns, polled_ns, computed_ns, sent_ns, done_ns});
  if (pace != GV_PACE_FREE)
    gv_histogram_add(&loop->wake, start_ns - due_ns);
  if (loop->cfg.black_box || atomic_load_explicit(&loop->trace, memory_order_relaxed))
    push_steps(loop, pace == GV_PACE_FREE ? 0 : start_ns - due_ns, done_ns - start_ns);
  loop->frame_count = 0;
}

// Sleeps until the next step is due, the device hearing of the last one meanwhile.
// Returns when it should have begun.
static int64_t wait_for_period(gv_loop *loop, bool first, int64_t *io_deadline_ns) {
  const gv_pace pace = loop->cfg.pace;
  if (pace == GV_PACE_FREE)
    wait_for_space(loop);
  if (loop->cfg.sync_device)
    return wait_for_device(loop, io_deadline_ns);
  if (!first)
    repeat_until(loop, *io_deadline_ns);
  if (pace != GV_PACE_FREE)
    sleep_until(*io_deadline_ns);
  return *io_deadline_ns;
}

static gv_exit run(gv_loop *loop) {
  const gv_pace pace = loop->cfg.pace;
  int64_t deadline_ns = clock_ns(CLOCK_MONOTONIC) + loop->cfg.period_ns;
  gv_exit reason;
  bool first = true;
  loop->frame_count = 0;
  loop->sent_ns = INT64_MAX / 2;  // nothing to repeat before the first step
  gv_ladder_init(&loop->ladder, loop->cfg.period_ns);
  while ((reason = why_to_end(loop)) == GV_EXIT_RUNNING) {
    const int64_t due_ns = wait_for_period(loop, first, &deadline_ns);
    const int64_t start_ns = clock_ns(CLOCK_MONOTONIC);
    loop->now_ns = pace == GV_PACE_LIVE ? start_ns : loop->number * loop->cfg.period_ns;
    take_frames(loop, loop->now_ns);
    const int64_t polled_ns = clock_ns(CLOCK_MONOTONIC);
    obey_requests(loop);
    const gv_rung rung = choose_rung(loop, due_ns, polled_ns);
    if (rung == GV_RUNG_HOLD) {
      hold_period(loop);
    } else {
      loop->step_ns = loop->number * loop->cfg.period_ns;
      step_once(loop, rung, due_ns, start_ns, polled_ns);
      loop->number++;
      if (first)
        watch_faults(loop);
      first = false;
    }
    if (pace != GV_PACE_FREE)
      deadline_ns = next_deadline(loop, deadline_ns, clock_ns(CLOCK_MONOTONIC));
  }
  return reason;
}

static void *loop_thread(void *argument) {
  gv_loop *loop = argument;
  const unsigned refusals = loop->refusals_before | gv_realtime_enter(&loop->cfg.realtime);
  atomic_store(&loop->refusals, (int)refusals);
  const int64_t session_ns = loop->cfg.pace == GV_PACE_LIVE ? clock_ns(CLOCK_MONOTONIC)
                                                            : loop->number * loop->cfg.period_ns;
  loop->wall_us = (clock_ns(CLOCK_REALTIME) - session_ns) / 1000;
  loop->page_faults = gv_realtime_page_faults();
  loop->strict_errno = loop->cfg.strict ? gv_strict_enter(loop->driver->calls) : 0;
  const gv_exit reason = loop->strict_errno ? GV_EXIT_REFUSED : run(loop);
  count_faults(loop);
  ramp_down(loop);
  if (loop->cfg.pace == GV_PACE_FREE)
    wait_for_space(loop);
  tell(loop, 0);
  atomic_store(&loop->exit, (int)reason);
  if (loop->cfg.alarm_s && reason != GV_EXIT_SCENE)
    alarm(loop->cfg.alarm_s);
  return NULL;
}

void gv_loop_init(gv_loop *loop, const gv_loop_config *cfg, gv_session *session, gv_driver *driver,
                  int object_count, atomic_bool *stop) {
  loop->cfg = *cfg;
  loop->session = session;
  loop->driver = driver;
  gv_sync_init(&loop->sync, cfg->period_ns);
  loop->commands = gv_loop_commands(cfg->period_ns);
  loop->object_count = object_count;
  loop->stop = stop;
  for (int i = 0; i < gv_hands_count(session); i++)
    loop->state_reported[i] = session[i].safety.state;
  atomic_init(&loop->exit, GV_EXIT_RUNNING);
  atomic_init(&loop->refusals, -1);
  gv_ring_init(&loop->snapshots, loop->snapshot_slot, sizeof loop->snapshot_slot[0], GV_LOOP_SNAPSHOTS);
  gv_ring_init(&loop->records, loop->record_slot, sizeof loop->record_slot[0], GV_LOOP_RECORDS);
  gv_ring_init(&loop->steps, loop->step_slot, sizeof loop->step_slot[0], GV_LOOP_STEPS);
  gv_ring_init(&loop->requests, loop->request_slot, sizeof loop->request_slot[0], GV_LOOP_REQUESTS);
  gv_ring_init(&loop->frames, loop->recorded_slot, sizeof loop->recorded_slot[0], GV_LOOP_RECORDED);
}

void gv_loop_change_scene(gv_loop *loop, int object_count) {
  loop->object_count = object_count;
  for (int i = 0; i < gv_hands_count(loop->session); i++)
    loop->state_reported[i] = loop->session[i].safety.state;
  loop->heap_calls_before = atomic_load(&loop->heap_calls);
  loop->page_faults_before = loop->page_faults;
  loop->overruns_now = 0;
  memset(loop->events, 0, sizeof loop->events);
  loop->scene_accepted = false;
  atomic_store(&loop->scene_asked, false);
  atomic_store(&loop->exit, GV_EXIT_RUNNING);
}

// Signals are for the other threads: none interrupts a sleep here, and no handler makes calls of its own.
int gv_loop_start(gv_loop *loop) {
  pthread_attr_t attributes;
  sigset_t all, before;
  sigfillset(&all);
  loop->starts++;
  loop->refusals_before = gv_realtime_prepare(&loop->cfg.realtime);
  pthread_attr_init(&attributes);
  pthread_attr_setstacksize(&attributes, GV_REALTIME_STACK);
  pthread_sigmask(SIG_SETMASK, &all, &before);
  int error = pthread_create(&loop->thread, &attributes, loop_thread, loop);
  pthread_sigmask(SIG_SETMASK, &before, NULL);
  pthread_attr_destroy(&attributes);
  return error;
}

bool gv_loop_running(const gv_loop *loop) { return atomic_load(&loop->exit) == GV_EXIT_RUNNING; }
void gv_loop_join(gv_loop *loop) { pthread_join(loop->thread, NULL); }
