// SPDX-License-Identifier: BSD-3-Clause
// Every recorded trace (a folder in data/traces) through the whole engine: the state's hash of every step
// against the golden one, and what a user cares about while the object is held: slip and tilt against the
// palm, penetration, ripple of the coupling force, and the forces that leave.
//
//   test_replay                  all traces, both presets
//   test_replay --hashes NAME... hashes only (other compilers and levels)
//   test_replay --update NAME... write the golden hashes anew (say in the commit why they changed)
#include <dirent.h>
#include <inttypes.h>
#include <string.h>

#include "daemon/load/config_load.h"
#include "daemon/load/scene_load.h"
#include "daemon/loop/session.h"
#include "support/check.h"
#include "gloved/drivers.h"

enum { MAX_STEPS = 60000, MEMORY = 48 << 20 };
static _Alignas(64) unsigned char scene_memory[MEMORY], engine_memory[MEMORY];

// What a trace's file `expected` says. Keys before the hashes are written by hand.
typedef struct expectation {
  char name[64], scene[128], object[GV_MAX_NAME];
  double hold_from_s, hold_to_s;         // window in which the object is held in the air
  double slip_mm, tilt_deg, depth_mm, ripple_n; // limits in that window, default preset
  int steps;
  uint64_t hash_default, hash_paper;
  int chain_length;
  uint16_t chain[MAX_STEPS];             // low 16 bits of FNV over the hashes so far, one per step, default preset
} expectation;
static expectation expected;

typedef struct measures {
  int steps;
  uint64_t hash;
  double slip_m, tilt_rad, depth_m, ripple_n;  // while held
  double lift_m;                               // least height above the start while held
  double force_max_n, rise_max_n;              // of what left through the limiter, any time
  uint16_t chain[MAX_STEPS];
} measures;
static measures measured;

static int read_expected(const char *name, expectation *x) {
  char path[256], line[512];
  memset(x, 0, sizeof *x);
  snprintf(x->name, sizeof x->name, "%s", name);
  snprintf(path, sizeof path, "data/traces/%s/expected", name);
  FILE *f = fopen(path, "r");
  if (!f) return -1;
  while (fgets(line, sizeof line, f)) {
    if (sscanf(line, "scene %127s", x->scene) == 1 || sscanf(line, "object %31s", x->object) == 1) continue;
    if (sscanf(line, "hold_s %lf %lf", &x->hold_from_s, &x->hold_to_s) == 2) continue;
    if (sscanf(line, "limits slip_mm %lf tilt_deg %lf depth_mm %lf ripple_n %lf", &x->slip_mm, &x->tilt_deg, &x->depth_mm, &x->ripple_n) == 4) continue;
    if (sscanf(line, "steps %d", &x->steps) == 1) continue;
    if (sscanf(line, "hash_default %" SCNx64, &x->hash_default) == 1 || sscanf(line, "hash_paper %" SCNx64, &x->hash_paper) == 1) continue;
    if (strncmp(line, "chain ", 6)) continue;
    unsigned value;
    int used;
    for (char *at = line + 6; x->chain_length < MAX_STEPS && sscanf(at, "%4x%n", &value, &used) == 1; at += used)
      x->chain[x->chain_length++] = (uint16_t)value;
  }
  fclose(f);
  return x->scene[0] && x->object[0] ? 0 : -1;
}

static void write_expected(const expectation *x, const measures *m, uint64_t hash_paper) {
  char path[256];
  snprintf(path, sizeof path, "data/traces/%s/expected", x->name);
  FILE *f = fopen(path, "w");
  if (!f) { perror(path); exit(2); }
  fprintf(f, "# What this trace must give; read by test/replay/test_replay.c. The first four lines are written by hand,\n"
             "# the rest by `make golden`.\n");
  fprintf(f, "scene %s\nobject %s\nhold_s %g %g\nlimits slip_mm %g tilt_deg %g depth_mm %g ripple_n %g\n", x->scene, x->object,
          x->hold_from_s, x->hold_to_s, x->slip_mm, x->tilt_deg, x->depth_mm, x->ripple_n);
  fprintf(f, "steps %d\nhash_default %016" PRIx64 "\nhash_paper %016" PRIx64, m->steps, m->hash, hash_paper);
  for (int i = 0; i < m->steps; i++) fprintf(f, "%s%04x", i % 24 ? "" : "\nchain ", m->chain[i]);
  fprintf(f, "\n");
  fclose(f);
}

static int find_object(const gv_scene *scene, const char *name) {
  for (int i = 0; i < scene->object_count; i++)
    if (!strcmp(scene->object[i].name, name)) return i;
  return -1;
}

typedef struct watch {        // what has to be remembered from step to step
  gv_pose held_at;            // object in the palm at the window's start
  gv_vec3 last_f[GV_LIMBS];
  double ripple2[GV_LIMBS], last_out_n[GV_FINGERS];
  int held_steps;
} watch;

static void watch_hold(const expectation *x, const gv_engine *engine, int object, double start_z, double t, watch *w, measures *m) {
  bool held = t >= x->hold_from_s && t <= x->hold_to_s;
  gv_pose T_palm_object = gv_pose_mul(gv_pose_inv(gv_engine_limb_pose(engine, GV_LIMB_PALM)), gv_engine_object_pose(engine, object));
  if (held && !w->held_steps) { w->held_at = T_palm_object; m->lift_m = 1e9; }
  for (int i = 0; i < GV_LIMBS; i++) {
    gv_vec3 f, torque;
    gv_engine_coupling(engine, i, &f, &torque);
    if (held && w->held_steps) w->ripple2[i] += gv_norm2(gv_sub(f, w->last_f[i]));
    w->last_f[i] = f;
  }
  if (!held) return;
  int count;
  const gv_contact *c = gv_engine_contacts(engine, &count);
  for (int i = 0; i < count; i++) m->depth_m = fmax(m->depth_m, c[i].depth_m);
  m->slip_m = fmax(m->slip_m, gv_norm(gv_sub(T_palm_object.p, w->held_at.p)));
  m->tilt_rad = fmax(m->tilt_rad, gv_norm(gv_quat_log(gv_quat_mul(T_palm_object.q, gv_quat_conj(w->held_at.q)))));
  m->lift_m = fmin(m->lift_m, gv_engine_object_pose(engine, object).p.z - start_z);
  w->held_steps++;
}

static uint64_t chain_hash(uint64_t chain, uint64_t hash) { return (chain ^ hash) * 1099511628211ULL; }

// Runs one trace. Returns 0, or negative with a message printed.
static int replay(const expectation *x, const gv_config *engine_cfg, bool every_step, measures *m) {
  char path[256], err[512];
  gv_driver trace;
  gv_scene scene;
  gv_arena arena;
  gv_settings settings;
  memset(m, 0, sizeof *m);
  gv_settings_default(&settings);
  settings.engine = *engine_cfg;
  gv_arena_init(&arena, scene_memory, sizeof scene_memory);
  snprintf(path, sizeof path, "data/traces/%s/input.log.gz", x->name);
  if (gv_scene_load(x->scene, &arena, &scene, err, sizeof err) || gv_trace_open(path, &trace, err, sizeof err)) {
    printf("  %s\n", err);
    return -1;
  }
  int object = find_object(&scene, x->object);
  gv_engine *engine = gv_engine_init(engine_memory, sizeof engine_memory, &settings.engine, &scene);
  if (!engine || object < 0) { printf("  %s: no object '%s', or the scene is too large\n", x->scene, x->object); return -1; }
  static gv_session session;
  const gv_session_config cfg = {.limiter = settings.limiter, .safety = settings.safety, .side = settings.engine.hand.side,
                                 .period_s = settings.engine.step_s};
  gv_session_init(&session, &cfg, engine);
  const int64_t period_ns = 1000000;
  double start_z = gv_engine_object_pose(engine, object).p.z;
  watch w = {0};
  uint64_t chain = 14695981039346656037ULL;
  for (int step = 0; step < MAX_STEPS && !trace.ended(trace.self); step++) {
    static gv_frame frame[256];
    gv_frame command;
    int count = trace.poll(trace.self, step * period_ns, frame, 256);
    gv_session_step(&session, step * period_ns, frame, count, 0, &command);
    for (int i = 0; i < GV_FINGERS; i++) {
      m->force_max_n = fmax(m->force_max_n, session.force_n[i]);
      m->rise_max_n = fmax(m->rise_max_n, session.force_n[i] - w.last_out_n[i]);
      w.last_out_n[i] = session.force_n[i];
    }
    watch_hold(x, engine, object, start_z, step * 1e-3, &w, m);
    if (every_step) m->chain[step] = (uint16_t)(chain = chain_hash(chain, gv_engine_hash(engine)));
    m->steps = step + 1;
  }
  for (int i = 0; i < GV_LIMBS; i++) m->ripple_n = fmax(m->ripple_n, sqrt(w.ripple2[i] / fmax(1, w.held_steps - 1)));
  m->hash = gv_engine_hash(engine);
  trace.close(trace.self);
  gv_engine_close(engine);
  return 0;
}

// A compiled scene (make scenes) is no part of the repository, and its pieces may differ in the last bits from one
// processor to another: no golden hashes, but two replays must agree.
static bool is_compiled(const expectation *x) { return !strncmp(x->scene, "build/", 6); }
static bool is_missing(const expectation *x) {
  FILE *f = fopen(x->scene, "r");
  if (f) fclose(f);
  return !f;
}
static void check_twice(const expectation *x, const gv_config *engine_cfg, const measures *m) {
  static measures again;
  CHECK(replay(x, engine_cfg, false, &again) == 0 && again.hash == m->hash, "%s: two replays differ", x->name);
}

static void check_hashes(const expectation *x, const measures *m) {
  CHECK(m->steps == x->steps, "%s: %d steps, expected %d", x->name, m->steps, x->steps);
  int first = 0;
  while (first < m->steps && first < x->chain_length && m->chain[first] == x->chain[first]) first++;
  CHECK(first == x->steps, "%s: the first step that differs is %d", x->name, first);
  CHECK(m->hash == x->hash_default, "%s: state %016" PRIx64 ", expected %016" PRIx64, x->name, m->hash, x->hash_default);
}

static void check_hold(const expectation *x, const measures *m) {
  gv_limiter_config limits = gv_limiter_config_default();
  printf("figure %-16s slip %.4f mm, tilt %.4f deg, depth %.4f mm, ripple %.5f N rms, lifted %.0f mm, force at most %.2f N\n", x->name,
         m->slip_m * 1e3, m->tilt_rad * 180 / GV_PI, m->depth_m * 1e3, m->ripple_n, m->lift_m * 1e3, m->force_max_n);
  CHECK(x->hold_to_s - x->hold_from_s >= 9.0 && m->steps * 1e-3 >= x->hold_to_s, "%s: holds for 9 s", x->name);
  CHECK(m->slip_m * 1e3 < x->slip_mm, "%s slips %g mm", x->name, m->slip_m * 1e3);
  CHECK(m->tilt_rad * 180 / GV_PI < x->tilt_deg, "%s tilts %g deg", x->name, m->tilt_rad * 180 / GV_PI);
  CHECK(m->depth_m * 1e3 < x->depth_mm, "%s sinks in by %g mm", x->name, m->depth_m * 1e3);
  CHECK(m->ripple_n < x->ripple_n, "%s: force ripple %g N rms", x->name, m->ripple_n);
  CHECK(m->lift_m > 0.05, "%s: lifted by %g m", x->name, m->lift_m);
  CHECK(m->force_max_n <= limits.max_n && m->rise_max_n <= limits.slew_n_per_s * 1e-3 + 1e-9, "%s: %g N, rising %g N a step", x->name,
        m->force_max_n, m->rise_max_n);
  CHECK(m->force_max_n > 0.2, "%s: the person feels %g N", x->name, m->force_max_n);
}

static void test_trace_default(void) {
  const gv_config cfg = gv_config_default();
  if (is_compiled(&expected) && is_missing(&expected)) { SKIP("its scene is not compiled here; make scenes"); return; }
  if (replay(&expected, &cfg, true, &measured)) { CHECK(0, "%s did not run", expected.name); return; }
  if (is_compiled(&expected)) check_twice(&expected, &cfg, &measured);
  else check_hashes(&expected, &measured);
  check_hold(&expected, &measured);
}
// The other narrow phase holds what ours holds, within the same limits.
static void test_trace_libccd(void) {
  gv_config cfg = gv_config_default();
  cfg.narrow = GV_NARROW_LIBCCD;
  if (is_compiled(&expected) && is_missing(&expected)) { SKIP("its scene is not compiled here; make scenes"); return; }
  if (replay(&expected, &cfg, false, &measured)) { CHECK(0, "%s did not run", expected.name); return; }
  check_twice(&expected, &cfg, &measured);
  check_hold(&expected, &measured);
}
static void test_trace_hashes(void) {
  const gv_config cfg = gv_config_default();
  if (replay(&expected, &cfg, true, &measured)) { CHECK(0, "%s did not run", expected.name); return; }
  check_hashes(&expected, &measured);
}
// The paper's own parameters: softer, so the limits are wider, but the object stays in the hand.
static void test_trace_paper(void) {
  const gv_config cfg = gv_config_paper();
  if (is_compiled(&expected) && is_missing(&expected)) { SKIP("its scene is not compiled here; make scenes"); return; }
  if (replay(&expected, &cfg, false, &measured)) { CHECK(0, "%s did not run", expected.name); return; }
  printf("figure %-16s slip %.3f mm, lifted %.0f mm (preset paper)\n", expected.name, measured.slip_m * 1e3, measured.lift_m * 1e3);
  if (is_compiled(&expected)) check_twice(&expected, &cfg, &measured);
  else CHECK(measured.hash == expected.hash_paper, "%s: state %016" PRIx64 ", expected %016" PRIx64, expected.name, measured.hash, expected.hash_paper);
  CHECK(measured.lift_m > 0.05, "%s: lifted by %g m", expected.name, measured.lift_m);
  CHECK(measured.slip_m < 0.005, "%s: slips %g m", expected.name, measured.slip_m);
}

static void update(void) {
  static measures m;
  const gv_config cfg = gv_config_default(), paper_cfg = gv_config_paper();
  if (replay(&expected, &paper_cfg, false, &m)) exit(2);
  uint64_t paper = m.hash;
  if (replay(&expected, &cfg, true, &m)) exit(2);
  write_expected(&expected, &m, paper);
  printf("%s: %d steps, %016" PRIx64 "\n", expected.name, m.steps, m.hash);
}

static int is_trace(const struct dirent *d) { return d->d_name[0] != '.' && !strchr(d->d_name, '.'); }

int main(int argc, char **argv) {
  bool hashes = argc > 1 && !strcmp(argv[1], "--hashes"), updating = argc > 1 && !strcmp(argv[1], "--update");
  int first = hashes || updating ? 2 : 1, ran = 0;
  struct dirent **entry;
  int count = scandir("data/traces", &entry, is_trace, alphasort);
  for (int i = 0; i < count; i++) {
    bool wanted = argc <= first;
    for (int a = first; a < argc; a++) wanted = wanted || !strcmp(argv[a], entry[i]->d_name);
    if (!wanted) continue;
    ran++;
    if (read_expected(entry[i]->d_name, &expected)) { printf("FAIL %s: no sound file 'expected'\n", entry[i]->d_name); check_failures++; continue; }
    if ((updating || hashes) && is_compiled(&expected)) continue;
    if (updating) { update(); continue; }
    if (hashes) { RUN(test_trace_hashes); continue; }
    RUN(test_trace_default);
    RUN(test_trace_libccd);
    RUN(test_trace_paper);
  }
  if (!ran) { printf("FAIL no trace in data/traces\n"); return 1; }
  return check_done();
}
