// SPDX-License-Identifier: BSD-3-Clause
// The parts around the engine that keep time and count: heap calls seen through shared libraries too,
// the snapshot ring in one and in two threads, histogram quantiles against a sorted array, skipped
// periods, and the loop itself on a scripted driver.
#include <pthread.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>
#include <unistd.h>
#include <zlib.h>

#include "daemon/loop/heap.h"
#include "daemon/loop/loop.h"
#include "support/check.h"
#include "support/lab.h"

// ---- heap ---------------------------------------------------------------------------------------------

static uint64_t calls_of(void (*work)(void)) {
  uint64_t before = gv_heap_calls();
  gv_heap_watch(true);
  work();
  gv_heap_watch(false);
  return gv_heap_calls() - before;
}

static void *volatile kept;  // keeps the compiler from leaving a malloc out

static void do_nothing(void) {}
static void allocate_and_free(void) {
  kept = malloc(10);
  kept = realloc(kept, 100);
  free(kept);
}
static void allocate_aligned(void) {
  void *block = NULL;
  if (posix_memalign(&block, 64, 100) == 0)
    kept = block;
  free(kept);
}
static void duplicate_in_libc(void) {
  kept = strdup("a string");
  free(kept);
}
static void allocate_in_zlib(void) {
  z_stream stream;
  memset(&stream, 0, sizeof stream);
  if (deflateInit(&stream, 1) == Z_OK)
    deflateEnd(&stream);
}

static void test_heap_calls_are_counted(void) {
  if (!GV_HEAP_COUNTS) {
    SKIP("a sanitizer has the heap");
    return;
  }
  CHECK(calls_of(do_nothing) == 0, "counted without a call");
  CHECK(calls_of(allocate_and_free) == 3, "malloc, realloc and free");
  CHECK(calls_of(allocate_aligned) == 2, "posix_memalign and free");
  CHECK(calls_of(duplicate_in_libc) == 2, "strdup inside libc and free");
  CHECK(calls_of(allocate_in_zlib) >= 2, "calls inside another shared library");
}

static void test_heap_calls_of_others_are_not_counted(void) {
  uint64_t before = gv_heap_calls();
  allocate_and_free();
  CHECK(gv_heap_calls() == before, "counted while nobody watched");
}

// ---- ring ---------------------------------------------------------------------------------------------

typedef struct item {
  uint64_t number, check[7];
} item;

static void fill_item(item *out, uint64_t number) {
  out->number = number;
  for (unsigned i = 0; i < 7; i++)
    out->check[i] = number * (i + 3);
}

static bool item_is_whole(const item *in) {
  for (unsigned i = 0; i < 7; i++)
    if (in->check[i] != in->number * (i + 3))
      return false;
  return true;
}

static void test_ring_keeps_order_and_drops_when_full(void) {
  static gv_ring ring;
  static item slot[8];
  gv_ring_init(&ring, slot, sizeof slot[0], 8);
  CHECK(gv_ring_peek(&ring) == NULL, "empty at the start");
  for (uint64_t i = 0; i < 11; i++) {
    item *free_slot = gv_ring_reserve(&ring);
    CHECK((free_slot != NULL) == (i < 8), "item %d", (int)i);
    if (!free_slot)
      continue;
    fill_item(free_slot, i);
    gv_ring_commit(&ring);
  }
  CHECK(gv_ring_dropped(&ring) == 3, "%d dropped", (int)gv_ring_dropped(&ring));
  for (uint64_t i = 0; i < 8; i++) {
    const item *oldest = gv_ring_peek(&ring);
    CHECK(oldest && oldest->number == i, "item %d", (int)i);
    gv_ring_release(&ring);
  }
  CHECK(gv_ring_peek(&ring) == NULL && gv_ring_space(&ring) == 8, "empty at the end");
}

enum { PUSHED = 300000 };

static void *push_items(void *argument) {
  gv_ring *ring = argument;
  for (uint64_t i = 1; i <= PUSHED; i++) {
    item *slot = gv_ring_reserve(ring);
    if (!slot)
      continue;
    fill_item(slot, i);
    gv_ring_commit(ring);
  }
  return NULL;
}

static void test_ring_between_two_threads(void) {
  static gv_ring ring;
  static item slot[16];
  pthread_t writer;
  uint64_t seen = 0;
  uint64_t last = 0;
  gv_ring_init(&ring, slot, sizeof slot[0], 16);
  ring.written = ring.read = UINT32_MAX - 1000;  // the counters wrap soon
  CHECK(pthread_create(&writer, NULL, push_items, &ring) == 0, "no thread");
  while (last < PUSHED && seen + gv_ring_dropped(&ring) < PUSHED) {
    const item *oldest = gv_ring_peek(&ring);
    if (!oldest)
      continue;
    CHECK(oldest->number > last, "%d after %d", (int)oldest->number, (int)last);
    CHECK(item_is_whole(oldest), "item %d is torn", (int)oldest->number);
    last = oldest->number;
    seen++;
    gv_ring_release(&ring);
  }
  pthread_join(writer, NULL);
  while (gv_ring_peek(&ring)) {
    gv_ring_release(&ring);
    seen++;
  }
  CHECK(seen + gv_ring_dropped(&ring) == PUSHED, "%d seen, %d dropped", (int)seen,
        (int)gv_ring_dropped(&ring));
}

// ---- histogram ----------------------------------------------------------------------------------------

static int compare_ns(const void *a, const void *b) {
  int64_t x = *(const int64_t *)a;
  int64_t y = *(const int64_t *)b;
  return x < y ? -1 : x > y;
}

static void test_histogram_against_sorting(void) {
  enum { COUNT = 20000 };
  static gv_histogram histogram;
  static int64_t duration[COUNT];
  unsigned long long random = 7;
  for (int i = 0; i < COUNT; i++) {
    // From nanoseconds to seconds, evenly in the exponent.
    duration[i] = (int64_t)pow(10.0, check_uniform(&random, 0.0, 9.0));
    gv_histogram_add(&histogram, duration[i]);
  }
  qsort(duration, COUNT, sizeof duration[0], compare_ns);
  const double fraction[] = {0.001, 0.1, 0.5, 0.9, 0.99, 0.999};
  for (int i = 0; i < 6; i++) {
    double exact = (double)duration[(int)ceil(fraction[i] * COUNT) - 1];
    double got = (double)gv_histogram_quantile_ns(&histogram, fraction[i]);
    CHECK(got >= exact && got <= exact * (1.0 + 1.0 / 64.0), "fraction %g: %.0f against %.0f", fraction[i],
          got, exact);
  }
  CHECK(gv_histogram_quantile_ns(&histogram, 1.0) == duration[COUNT - 1], "the largest is exact");
}

static void test_histogram_ends(void) {
  static gv_histogram histogram;
  CHECK(gv_histogram_quantile_ns(&histogram, 0.5) == 0, "empty");
  gv_histogram_add(&histogram, -5);
  CHECK(gv_histogram_quantile_ns(&histogram, 0.5) == 0, "negative counts as zero");
  gv_histogram_add(&histogram, INT64_MAX);
  CHECK(gv_histogram_quantile_ns(&histogram, 1.0) == INT64_MAX, "beyond the last bin");
  CHECK_NEAR(gv_histogram_quantiles(&histogram).max_us, (double)INT64_MAX * 1e-3, 1.0);
}

// ---- loop ---------------------------------------------------------------------------------------------

static void test_skipped_periods(void) {
  const int64_t period = 1000000;
  CHECK(gv_loop_periods_to_skip(-1, period) == 0 && gv_loop_periods_to_skip(0, period) == 0, "in time");
  CHECK(gv_loop_periods_to_skip(1, period) == 1, "a nanosecond late");
  CHECK(gv_loop_periods_to_skip(period, period) == 1 && gv_loop_periods_to_skip(period + 1, period) == 2,
        "whole periods");
  for (int64_t late = 1; late < 5 * period; late += 77777) {
    int64_t next = -late + gv_loop_periods_to_skip(late, period) * period;
    CHECK(next >= 0 && next < period, "late by %d: next deadline in %d", (int)late, (int)next);
  }
}

// A driver without a device: ends after `polls`, and does `mischief` in one of them.
typedef struct fake {
  int polls, polled, mischief_at, sent, readable;
  void (*mischief)(void);
  gv_frame last;
} fake;

static int poll_fake(void *self, int64_t now_ns, gv_frame *out, int max) {
  fake *f = self;
  (void)now_ns, (void)out, (void)max;
  if (++f->polled == f->mischief_at)
    f->mischief();
  return 0;
}
static int send_fake(void *self, const gv_frame *frame, int count) {
  fake *f = self;
  f->sent += count;
  f->last = frame[count - 1];
  return 0;
}
static bool fake_ended(void *self) { return ((fake *)self)->polled >= ((fake *)self)->polls; }
static gv_driver_stats fake_stats(void *self) { return (void)self, (gv_driver_stats){0}; }
static void close_fake(void *self) { (void)self; }
static int fake_descriptor(void *self) { return ((fake *)self)->readable; }

static gv_loop loop;
static gv_session session;

// One run of the loop on an empty world. Returns the number of engine steps.
static uint64_t run_loop(fake *device, gv_pace pace, int64_t periods_max, bool stopped) {
  gv_driver driver = {device,
                      poll_fake,
                      send_fake,
                      fake_ended,
                      fake_stats,
                      close_fake,
                      device->readable ? fake_descriptor : NULL,
                      0,
                      NULL};
  gv_config config = gv_config_default();
  const gv_scene nothing = {.gravity_m_s2 = {0, 0, -9.81}};
  const gv_session_config session_config = {.limiter = gv_limiter_config_default(),
                                            .safety = gv_safety_config_default(),
                                            .side = GV_RIGHT,
                                            .period_s = 0.001};
  const gv_loop_config loop_config = {.period_ns = 1000000,
                                      .periods_max = periods_max,
                                      .pace = pace,
                                      .sync_device = device->readable > 0,
                                      .realtime = {.cpu = GV_CPU_ANY}};
  const size_t size = gv_engine_size(&config, &nothing);
  void *memory = calloc(1, size);
  atomic_bool stop;
  atomic_init(&stop, stopped);
  gv_engine *engine = gv_engine_init(memory, size, &config, &nothing);
  CHECK(engine != NULL, "no engine");
  if (!engine)
    return 0;
  memset(&loop, 0, sizeof loop);
  gv_session_init(&session, &session_config, engine);
  gv_loop_init(&loop, &loop_config, &session, &driver, 0, &stop);
  CHECK(gv_loop_start(&loop) == 0, "no thread");
  while (gv_loop_running(&loop)) {  // the slow thread's part
    while (gv_ring_peek(&loop.snapshots))
      gv_ring_release(&loop.snapshots);
    while (gv_ring_peek(&loop.records))
      gv_ring_release(&loop.records);
  }
  gv_loop_join(&loop);
  uint64_t steps = gv_engine_counters(engine)->steps;
  gv_engine_close(engine);
  free(memory);
  return steps;
}

static void test_loop_ends_with_its_input(void) {
  fake device = {.polls = 100};
  CHECK(run_loop(&device, GV_PACE_FREE, 0, false) == 100, "%d polls", device.polled);
  CHECK(loop.exit == GV_EXIT_END, "%s", gv_exit_name((gv_exit)loop.exit));
  CHECK(device.sent >= 103, "%d commands: one a step, and zeros at the end", device.sent);
  CHECK(loop.step.count == 100 && loop.wake.count == 0, "every step is measured, no sleep");
  CHECK(loop.missed_deadlines == 0 && loop.heap_calls == 0, "nothing missed, nothing allocated");
  if (GV_HEAP_COUNTS)
    CHECK(loop.page_faults.major == 0 && loop.page_faults.minor == 0, "%d page faults",
          (int)loop.page_faults.minor);
}

static void test_loop_ends_with_duration_and_signal(void) {
  fake device = {.polls = 1000};
  CHECK(run_loop(&device, GV_PACE_PACED, 30, false) == 30, "%d polls", device.polled);
  CHECK(loop.exit == GV_EXIT_DURATION && loop.wake.count == 30, "%s", gv_exit_name((gv_exit)loop.exit));
  fake other = {.polls = 1000};
  CHECK(run_loop(&other, GV_PACE_LIVE, 0, true) == 0, "%d polls after the signal", other.polled);
  CHECK(loop.exit == GV_EXIT_SIGNAL && other.sent >= 3, "%s", gv_exit_name((gv_exit)loop.exit));
}

static void test_loop_counts_a_heap_call(void) {
  if (!GV_HEAP_COUNTS) {
    SKIP("a sanitizer has the heap");
    return;
  }
  fake device = {.polls = 20, .mischief_at = 10, .mischief = allocate_and_free};
  run_loop(&device, GV_PACE_FREE, 0, false);
  CHECK(loop.heap_calls == 3, "%d calls counted", (int)loop.heap_calls);
}

static void touch_new_pages(void) {
  enum { PAGES = 4, PAGE = 4096 };
  static volatile char *memory;
  memory = mmap(NULL, PAGES * PAGE, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  for (int i = 0; memory != MAP_FAILED && i < PAGES; i++)
    memory[i * PAGE] = 1;
}

static void test_loop_counts_a_page_fault(void) {
  fake device = {.polls = 20, .mischief_at = 10, .mischief = touch_new_pages};
  run_loop(&device, GV_PACE_FREE, 0, false);
  CHECK(loop.page_faults.minor >= 1, "%d faults counted", (int)loop.page_faults.minor);
}

static void sleep_in_the_loop(void) {
  const struct timespec pause = {0, 3500000};
  nanosleep(&pause, NULL);
}

static void test_loop_skips_whole_periods(void) {
  fake device = {.polls = 20, .mischief_at = 10, .mischief = sleep_in_the_loop};
  CHECK(run_loop(&device, GV_PACE_PACED, 0, false) == 20, "a paced run loses no step");
  CHECK(loop.missed_deadlines >= 1 && loop.overruns >= 3, "3.5 ms: %d missed, %d skipped",
        (int)loop.missed_deadlines, (int)loop.overruns);
}

// A heap of boxes whose step takes longer than its period, by the machine's own clock: the ladder takes of
// the step what fits, and counts it. As fast as possible it never acts.
static uint64_t run_heap(gv_pace pace, int64_t period_ns, int64_t periods) {
  static lab heap;
  fake device = {.polls = 1000000};
  gv_driver driver = {.self = &device,
                      .poll = poll_fake,
                      .send = send_fake,
                      .ended = fake_ended,
                      .stats = fake_stats,
                      .close = close_fake};
  const gv_session_config session_config = {.limiter = gv_limiter_config_default(),
                                            .safety = gv_safety_config_default(),
                                            .side = GV_RIGHT,
                                            .period_s = (double)period_ns * 1e-9};
  const gv_loop_config loop_config = {
    .period_ns = period_ns, .periods_max = periods, .pace = pace, .realtime = {.cpu = GV_CPU_ANY}};
  atomic_bool stop;
  atomic_init(&stop, false);
  lab_start(&heap);
  lab_box(&heap, gv_v3(4, 4, 0.1), gv_v3(0, 0, -0.05), 0, 0.8);
  for (int i = 0; i < 48; i++)
    lab_box(&heap, gv_v3(0.1, 0.1, 0.1), gv_v3(0.09 * (i % 4), 0.09 * (i / 4 % 4), 0.05 + 0.09 * (i / 16)),
            0.5, 0.8);
  heap.cfg.rest_s = 0.0;
  lab_run(&heap);
  memset(&loop, 0, sizeof loop);
  gv_session_init(&session, &session_config, heap.engine);
  gv_loop_init(&loop, &loop_config, &session, &driver, 0, &stop);
  CHECK(gv_loop_start(&loop) == 0, "no thread");
  while (gv_loop_running(&loop)) {
    while (gv_ring_peek(&loop.snapshots))
      gv_ring_release(&loop.snapshots);
    while (gv_ring_peek(&loop.records))
      gv_ring_release(&loop.records);
  }
  gv_loop_join(&loop);
  const uint64_t steps = gv_engine_counters(heap.engine)->steps;
  gv_engine_close(heap.engine);
  return steps;
}

static void test_the_ladder_acts_under_load_and_in_live_pace_alone(void) {
  const uint64_t free_steps = run_heap(GV_PACE_FREE, 1000000, 300);
  const int64_t step_ns = gv_histogram_quantile_ns(&loop.step, 0.5);
  CHECK(free_steps == 300, "%d steps", (int)free_steps);
  for (int i = 0; i < GV_RUNGS; i++)
    CHECK(loop.on_rung[i] == 0, "as fast as possible: %d on %s", (int)loop.on_rung[i],
          gv_rung_name((gv_rung)i));
  const uint64_t live_steps = run_heap(GV_PACE_LIVE, step_ns, 1500);
  const uint64_t *rung = (const uint64_t *)(const void *)loop.on_rung;
  printf("figure a step of %.0f us in a period as long: %d full, %d with less solving, %d with fewer "
         "contacts, %d held, %d ramped\n",
         (double)step_ns * 1e-3, (int)rung[0], (int)rung[1], (int)rung[2], (int)rung[3], (int)rung[4]);
  CHECK(rung[GV_RUNG_SOLVER] + rung[GV_RUNG_CONTACTS] + rung[GV_RUNG_HOLD] + rung[GV_RUNG_RAMP] > 100,
        "the ladder does not act");
  CHECK(rung[GV_RUNG_FULL] + rung[GV_RUNG_SOLVER] + rung[GV_RUNG_CONTACTS] + rung[GV_RUNG_RAMP] == live_steps,
        "%d steps", (int)live_steps);
}

static void test_live_duration_is_time(void) {
  fake device = {.polls = 1000, .mischief_at = 10, .mischief = sleep_in_the_loop};
  int64_t steps = (int64_t)run_loop(&device, GV_PACE_LIVE, 30, false);
  CHECK(loop.exit == GV_EXIT_DURATION, "%s", gv_exit_name((gv_exit)loop.exit));
  CHECK(steps <= 27 && steps + (int64_t)loop.overruns >= 30, "%d steps and %d skipped periods", (int)steps,
        (int)loop.overruns);
}

// A device that floods with what is no frame of the glove, or whose descriptor is in an error for good.
static void test_a_descriptor_that_stays_readable_does_not_spin_the_loop(void) {
  int end[2];
  CHECK(pipe(end) == 0 && write(end[1], "x", 1) == 1, "no pipe");
  fake device = {.polls = 100000, .readable = end[0]};
  const int64_t steps = (int64_t)run_loop(&device, GV_PACE_LIVE, 30, false);
  CHECK(steps + (int64_t)loop.overruns >= 30 && loop.on_frame == 0 && (int64_t)loop.on_clock == steps,
        "%d steps", (int)steps);
  CHECK(device.polled > steps && device.polled <= 34 * steps, "%d looks in %d steps", device.polled,
        (int)steps);
  close(end[0]);
  close(end[1]);
}

int main(void) {
  RUN(test_heap_calls_are_counted);
  RUN(test_heap_calls_of_others_are_not_counted);
  RUN(test_ring_keeps_order_and_drops_when_full);
  RUN(test_ring_between_two_threads);
  RUN(test_histogram_against_sorting);
  RUN(test_histogram_ends);
  RUN(test_skipped_periods);
  RUN(test_loop_ends_with_its_input);
  RUN(test_loop_ends_with_duration_and_signal);
  RUN(test_loop_counts_a_heap_call);
  RUN(test_loop_counts_a_page_fault);
  RUN(test_loop_skips_whole_periods);
  RUN(test_the_ladder_acts_under_load_and_in_live_pace_alone);
  RUN(test_live_duration_is_time);
  RUN(test_a_descriptor_that_stays_readable_does_not_spin_the_loop);
  return check_done();
}
