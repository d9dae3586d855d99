// SPDX-License-Identifier: BSD-3-Clause
// Every recorded trace (a folder in data/traces) through the whole engine, with each contact solver, each
// narrow phase and each preset: the object is held within the limits that stand beside the trace, and the
// state's hash is the golden one, for the default after every step.
//
//   test_replay                     all traces, all variants
//   test_replay --hashes NAME...    hashes only (other compilers and levels)
//   test_replay --update NAME...    write the golden hashes anew (say in the commit why they changed)
//   test_replay --measure VARIANT NAME...   one line of CSV for each: what the table of solvers is made of
#include <dirent.h>

#include "replay/replay.h"
#include "support/check.h"

static expectation expected;
static measures measured;
static variant now;

// A compiled scene (make scenes) is no part of the repository, and its pieces may differ in the last bits
// from one processor to another: no golden hashes, but two replays must agree.
static bool is_compiled(const expectation *x) { return !strncmp(x->scene, "build/", 6); }
static bool is_missing(const expectation *x) {
  FILE *f = fopen(x->scene, "r");
  if (f)
    fclose(f);
  return !f;
}

static void check_twice(const expectation *x, const measures *m) {
  static measures again;
  CHECK(replay(x, now, false, &again) == 0 && again.hash == m->hash, "%s, %s: two replays differ", x->name,
        variant_name[now]);
}

static void check_hash(const expectation *x, const measures *m) {
  CHECK(m->hash == x->hash[now], "%s, %s: state %016" PRIx64 ", expected %016" PRIx64, x->name,
        variant_name[now], m->hash, x->hash[now]);
}

static void check_chain(const expectation *x, const measures *m) {
  CHECK(m->steps == x->steps, "%s: %d steps, expected %d", x->name, m->steps, x->steps);
  int first = 0;
  while (first < m->steps && first < x->chain_length && m->chain[first] == x->chain[first])
    first++;
  CHECK(first == x->steps, "%s: the first step that differs is %d", x->name, first);
}

static void check_forces(const expectation *x, const measures *m) {
  const gv_limiter_config limits = gv_limiter_config_default();
  CHECK(m->force_max_n <= limits.max_n && m->rise_max_n <= limits.slew_n_per_s * 1e-3 + 1e-9,
        "%s: %g N, rising %g N a step", x->name, m->force_max_n, m->rise_max_n);
  CHECK(m->force_max_n > 0.2, "%s: the person feels %g N", x->name, m->force_max_n);
}

static void check_hold(const expectation *x, const measures *m) {
  const hold_limits *l = &x->limits[now];
  const double tilt_deg = m->tilt_rad * 180 / GV_PI;
  printf("figure %-14s %-9s slip %.4f mm, tilt %.4f deg, depth %.4f mm, ripple %.5f N rms, lifted %.0f mm, "
         "bones apart by %.2f mm, force at most %.2f N\n",
         x->name, variant_name[now], m->slip_m * 1e3, tilt_deg, m->depth_m * 1e3, m->ripple_n,
         m->lift_m * 1e3, m->apart_m * 1e3, m->force_max_n);
  CHECK(x->hold_to_s - x->hold_from_s >= 9.0 && m->steps * 1e-3 >= x->hold_to_s, "%s: holds for 9 s",
        x->name);
  CHECK(m->slip_m * 1e3 < l->slip_mm, "%s, %s: slips %g mm", x->name, variant_name[now], m->slip_m * 1e3);
  CHECK(tilt_deg < l->tilt_deg, "%s, %s: tilts %g deg", x->name, variant_name[now], tilt_deg);
  CHECK(m->depth_m * 1e3 < l->depth_mm, "%s, %s: sinks in by %g mm", x->name, variant_name[now],
        m->depth_m * 1e3);
  CHECK(m->ripple_n < l->ripple_n, "%s, %s: force ripple %g N rms", x->name, variant_name[now], m->ripple_n);
  CHECK(m->lift_m > 0.05, "%s, %s: lifted by %g m", x->name, variant_name[now], m->lift_m);
  CHECK(m->apart_m < 1e-3 || now != VARIANT_FINGER_JOINTS, "%s: bones apart by %g mm", x->name,
        m->apart_m * 1e3);
}

// The solver that was asked for did the steps.
static void check_solver(const expectation *x, const measures *m) {
  const gv_counters *c = &m->counters;
  const gv_solver asked = variant_config(now).solver;
  const uint64_t all = c->newton_steps + c->dantzig_steps + c->quickstep_steps;
  const uint64_t own = asked == GV_SOLVER_DANTZIG     ? c->dantzig_steps
                       : asked == GV_SOLVER_QUICKSTEP ? c->quickstep_steps
                                                      : c->newton_steps;
  CHECK(all > 5000 && own >= all - all / 100,
        "%s, %s: newton did %" PRIu64 ", dantzig %" PRIu64 ", quickstep %" PRIu64, x->name, variant_name[now],
        c->newton_steps, c->dantzig_steps, c->quickstep_steps);
  CHECK(c->unsolved_steps == 0, "%s, %s: %" PRIu64 " steps without a solution", x->name, variant_name[now],
        c->unsolved_steps);
}

static void test_trace(void) {
  if (is_compiled(&expected) && is_missing(&expected)) {
    SKIP("its scene is not compiled here; make scenes");
    return;
  }
  const bool every_step = now == VARIANT_DEFAULT && !is_compiled(&expected);
  if (replay(&expected, now, every_step, &measured)) {
    CHECK(0, "%s did not run", expected.name);
    return;
  }
  if (is_compiled(&expected))
    check_twice(&expected, &measured);
  else
    check_hash(&expected, &measured);
  if (every_step)
    check_chain(&expected, &measured);
  check_hold(&expected, &measured);
  check_forces(&expected, &measured);
  check_solver(&expected, &measured);
}

static void test_trace_hashes(void) {
  if (replay(&expected, VARIANT_DEFAULT, true, &measured)) {
    CHECK(0, "%s did not run", expected.name);
    return;
  }
  check_chain(&expected, &measured);
  check_hash(&expected, &measured);
}

static void update(void) {
  for (int v = 0; v < VARIANTS; v++) {
    if (replay(&expected, (variant)v, v == VARIANT_DEFAULT, &measured))
      exit(2);
    expected.hash[v] = measured.hash;
    if (v != VARIANT_DEFAULT)
      continue;
    expected.steps = expected.chain_length = measured.steps;
    memcpy(expected.chain, measured.chain, sizeof measured.chain);
  }
  expectation_write(&expected);
  printf("%s: %d steps, %016" PRIx64 "\n", expected.name, expected.steps, expected.hash[VARIANT_DEFAULT]);
}

static void measure(void) {
  if (is_missing(&expected) || replay(&expected, now, false, &measured))
    return;
  const measures *m = &measured;
  printf("%s,%s,%.4f,%.4f,%.4f,%ld,%ld,%.3f,%" PRIu64 ",%" PRIu64 ",%" PRIu64 ",%.2f\n", expected.name,
         variant_name[now], m->slip_m * 1e3, m->tilt_rad * 180 / GV_PI, m->depth_m * 1e3, m->loaded,
         m->outside, m->worst_friction, m->counters.newton_steps, m->counters.dantzig_steps,
         m->counters.quickstep_steps, m->apart_m * 1e3);
}

static int is_trace(const struct dirent *d) { return d->d_name[0] != '.' && !strchr(d->d_name, '.'); }

typedef enum task { TEST, HASHES, UPDATE, MEASURE } task;

static void do_trace(const char *name, task what) {
  if (expectation_read(name, &expected)) {
    printf("not ok - %s: no sound file 'expected'\n", name);
    check_failures++;
    return;
  }
  if ((what == UPDATE || what == HASHES) && is_compiled(&expected))
    return;
  if (what == UPDATE)
    update();
  if (what == MEASURE)
    measure();
  if (what == HASHES)
    RUN(test_trace_hashes);
  for (int v = 0; v < VARIANTS && what == TEST; v++) {
    now = (variant)v;
    RUN(test_trace);
  }
}

int main(int argc, char **argv) {
  static const char *const word[] = {"", "--hashes", "--update", "--measure"};
  task what = TEST;
  for (int i = HASHES; i <= MEASURE; i++)
    if (argc > 1 && !strcmp(argv[1], word[i]))
      what = (task)i;
  int first = what == TEST ? 1 : 2;
  int ran = 0;
  if (what == MEASURE) {
    const int v = argc > 2 ? variant_of_name(argv[2]) : -1;
    if (v < 0) {
      fprintf(stderr, "test_replay: --measure needs a variant\n");
      return 2;
    }
    now = (variant)v;
    first = 3;
  }
  static struct dirent **entry;  // kept until the end
  const int count = scandir("data/traces", &entry, is_trace, alphasort);
  for (int i = 0; i < count; i++) {
    bool wanted = argc <= first;
    for (int a = first; a < argc; a++)
      wanted = wanted || !strcmp(argv[a], entry[i]->d_name);
    if (!wanted)
      continue;
    ran++;
    do_trace(entry[i]->d_name, what);
  }
  if (!ran) {
    printf("not ok - no trace in data/traces\n");
    return 1;
  }
  return what == MEASURE || what == UPDATE ? 0 : check_done();
}
