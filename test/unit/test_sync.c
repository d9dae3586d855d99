// SPDX-License-Identifier: BSD-3-Clause
// The clock that follows a device's frames, against devices that are played in virtual time: exact, drifting,
// jittering, late once, half or twice as fast, absent for a while. What must hold of every one: the
// simulation keeps real time within 2 %, no two steps are nearer than a quarter of a period or farther than
// one and three quarters, and every frame of a device of the right rate begins exactly one step.
#include <string.h>

#include "daemon/loop/sync.h"
#include "support/check.h"

enum { PERIOD = 1000000, FRAMES_MAX = 20000 };

typedef struct played {
  int64_t frame_ns[FRAMES_MAX];  // when the device's frames come, ascending
  int frames;
} played;

typedef struct outcome {
  int steps, on_frame, changes;
  bool following;
  int64_t gap_min_ns, gap_max_ns, last_ns;
  int64_t waited_max_ns;  // of a frame that began a step: from its coming to the step
} outcome;

static played device;

static void play_frames(double rate_hz, double jitter_ns, int64_t first_ns, int64_t end_ns) {
  unsigned long long random = 5;
  for (int64_t k = 0; device.frames < FRAMES_MAX; k++) {
    const double at_ns = (double)first_ns + (double)k * 1e9 / rate_hz +
                         check_uniform(&random, -jitter_ns, jitter_ns);
    if ((int64_t)at_ns >= end_ns)
      return;
    device.frame_ns[device.frames++] = (int64_t)at_ns;
  }
}

// The loop as loop.c runs it, in virtual time: steps take none.
static outcome run_clock(int64_t end_ns) {
  gv_sync sync;
  gv_sync_init(&sync, PERIOD);
  outcome o = {.gap_min_ns = INT64_MAX};
  int next = 0;
  int64_t due_ns = 3 * PERIOD;
  int64_t now_ns = 2 * PERIOD;
  while (now_ns < end_ns) {
    const int64_t opens_ns = gv_sync_opens_ns(&sync, due_ns);
    const int64_t closes_ns = gv_sync_closes_ns(&sync, due_ns);
    int64_t frame_ns = INT64_MIN;
    while (next < device.frames && device.frame_ns[next] <= closes_ns && frame_ns < opens_ns) {
      frame_ns = device.frame_ns[next++];
      gv_sync_note(&sync, frame_ns);
    }
    const bool on_frame = frame_ns >= opens_ns;
    const int64_t start_ns = !on_frame ? closes_ns : frame_ns > now_ns ? frame_ns : now_ns;
    if (on_frame && start_ns - frame_ns > o.waited_max_ns)
      o.waited_max_ns = start_ns - frame_ns;
    if (o.steps > 0 && start_ns - o.last_ns < o.gap_min_ns)
      o.gap_min_ns = start_ns - o.last_ns;
    if (o.steps > 0 && start_ns - o.last_ns > o.gap_max_ns)
      o.gap_max_ns = start_ns - o.last_ns;
    o.changes += gv_sync_count(&sync, on_frame);
    o.on_frame += on_frame;
    o.steps++;
    o.last_ns = now_ns = start_ns;
    due_ns = (frame_ns == INT64_MIN ? due_ns : gv_sync_follow(&sync, due_ns, frame_ns)) + PERIOD;
  }
  o.following = sync.following;
  return o;
}

static void check_bounds(const outcome *o, int64_t end_ns, const char *name) {
  const double expected = (double)(end_ns - 2 * PERIOD) / PERIOD;
  CHECK(o->steps > 0.98 * expected - 2 && o->steps < 1.02 * expected + 4, "%s: %d steps in %g periods", name,
        o->steps, expected);
  CHECK(o->gap_min_ns >= PERIOD / 4 - PERIOD / 50, "%s: two steps within %d ns", name, (int)o->gap_min_ns);
  CHECK(o->gap_max_ns <= PERIOD * 7 / 4 + PERIOD / 50, "%s: %d ns between two steps", name,
        (int)o->gap_max_ns);
}

static outcome play(double rate_hz, double jitter_ns, int64_t first_ns, double seconds, const char *name) {
  const int64_t end_ns = (int64_t)(seconds * 1e9);
  device.frames = 0;
  play_frames(rate_hz, jitter_ns, first_ns, end_ns);
  const outcome o = run_clock(end_ns);
  check_bounds(&o, end_ns, name);
  return o;
}

static void test_every_frame_of_a_good_device_begins_a_step(void) {
  for (int phase = 0; phase < 10; phase++) {
    const outcome o = play(1000.0, 0.0, phase * PERIOD / 10 + 17, 4.0, "exact");
    CHECK(o.following && o.changes == 1, "phase %d: %d changes", phase, o.changes);
    CHECK(o.steps - o.on_frame <= 16, "phase %d: %d of %d steps on a frame", phase, o.on_frame, o.steps);
    CHECK(o.waited_max_ns == 0, "phase %d: a frame waited %d ns", phase, (int)o.waited_max_ns);
  }
}

static void test_a_drifting_device_is_followed(void) {
  for (int sign = -1; sign <= 1; sign += 2) {
    const outcome o = play(1000.0 + sign * 5.0, 0.0, 300000, 10.0, "5000 ppm off");
    CHECK(o.following && o.steps - o.on_frame <= 16, "%d of %d steps on a frame", o.on_frame, o.steps);
    CHECK(abs(o.steps - device.frames) <= 20, "%d steps for %d frames", o.steps, device.frames);
  }
}

static void test_jitter_costs_no_frame_its_step(void) {
  const outcome o = play(1000.0, 100000.0, 100, 10.0, "jitter");
  CHECK(o.following && o.steps - o.on_frame <= 16, "%d of %d steps on a frame", o.on_frame, o.steps);
}

static void test_one_late_frame_costs_one_step_on_the_clock(void) {
  const int64_t end_ns = 2000000000;
  device.frames = 0;
  play_frames(1000.0, 0.0, 100, end_ns);
  device.frame_ns[1000] += 400000;
  const outcome o = run_clock(end_ns);
  check_bounds(&o, end_ns, "late once");
  CHECK(o.changes == 1 && o.waited_max_ns == 0, "%d changes, a frame waited %d ns", o.changes,
        (int)o.waited_max_ns);
  CHECK(o.steps - o.on_frame <= 17 && abs(o.steps - device.frames) <= 4, "%d of %d steps on a frame",
        o.on_frame, o.steps);
}

static void test_a_slow_device_leaves_the_rate_to_the_clock(void) {
  const outcome o = play(100.0, 0.0, 100, 4.0, "100 Hz");
  CHECK(!o.following && o.changes == 0, "followed: %d changes", o.changes);
  CHECK(o.on_frame > 0.9 * device.frames, "%d frames, %d began a step", device.frames, o.on_frame);
}

static void test_a_fast_device_does_not_hasten_the_simulation(void) {
  const struct {
    double rate_hz, jitter_ns;
    const char *name;
  } fast[] = {{2000.0, 0.0, "2 kHz"},
              {5000.0, 0.0, "5 kHz"},
              {8000.0, 20000.0, "8 kHz"},
              {1430.0, 50000.0, "1430 Hz with jitter"}};
  for (int i = 0; i < 4; i++) {
    const outcome o = play(fast[i].rate_hz, fast[i].jitter_ns, 100, 2.0, fast[i].name);
    CHECK(o.steps > 1980 && o.steps < 2016, "%s: %d steps in 1998 periods", fast[i].name, o.steps);
    CHECK(o.on_frame > 0.8 * o.steps, "%s: %d of %d steps on a frame", fast[i].name, o.on_frame, o.steps);
  }
}

static void test_frames_that_stay_away_are_told_and_time_goes_on(void) {
  const int64_t end_ns = 3000000000;
  device.frames = 0;
  play_frames(1000.0, 0.0, 100, 1000000000);
  play_frames(1000.0, 0.0, 2000300000, end_ns);
  const outcome o = run_clock(end_ns);
  check_bounds(&o, end_ns, "a second without");
  CHECK(o.following && o.changes == 3, "%d changes: to the device, to the clock, back", o.changes);
  CHECK(o.steps - o.on_frame > 950 && o.steps - o.on_frame < 1050, "%d steps without a frame",
        o.steps - o.on_frame);
}

static void test_a_frame_before_the_window_was_late_for_the_step_before(void) {
  gv_sync sync;
  gv_sync_init(&sync, PERIOD);
  const int64_t due_ns = 10 * PERIOD;
  CHECK(gv_sync_follow(&sync, due_ns, due_ns - PERIOD * 6 / 10) > due_ns, "the clock waits for it");
  CHECK(gv_sync_follow(&sync, due_ns, due_ns - PERIOD * 4 / 10) < due_ns, "one inside the window was early");
}

int main(void) {
  RUN(test_every_frame_of_a_good_device_begins_a_step);
  RUN(test_a_drifting_device_is_followed);
  RUN(test_jitter_costs_no_frame_its_step);
  RUN(test_one_late_frame_costs_one_step_on_the_clock);
  RUN(test_a_slow_device_leaves_the_rate_to_the_clock);
  RUN(test_a_fast_device_does_not_hasten_the_simulation);
  RUN(test_frames_that_stay_away_are_told_and_time_goes_on);
  RUN(test_a_frame_before_the_window_was_late_for_the_step_before);
  return check_done();
}
