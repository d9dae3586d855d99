// SPDX-License-Identifier: BSD-3-Clause
// Benchmark of the engine, driven by test/bench/bench.py. Records the samples of a whole grasp once (a
// trace, or a simulated user), then steps the engine through them in blocks and tells how long each step
// took, and its two large parts: the linker leads gv_engine_collide and gv_dynamics_step through the clocks
// here, so the core itself knows no clock.
//
//   bench_engine URL SCENE OBJECT DRIVERS   writes DRIVERS (for the peers: bench_drivers.h) and prints one
//                                           line of JSON with the scene; then answers each line "FIRST
//                                           COUNT" on standard input with COUNT records of GV_BENCH_VALUES
//                                           doubles
//   bench_engine URL SCENE OBJECT - FIRST COUNT   counts the instructions of these steps, under callgrind,
//                                                 and ends
//                                           (test/support/callgrind.py)
//
// GV_VARIANT=dantzig, stock, ...: not the default's settings but those (test/replay/expectation.h).
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <valgrind/callgrind.h>

#include "engine/engine_state.h"
#include "daemon/load/config_load.h"
#include "daemon/load/devices.h"
#include "daemon/load/scene_load.h"
#include "daemon/loop/session.h"
#include "bench/bench_drivers.h"
#include "replay/expectation.h"

enum { MEMORY = 64 << 20 };
static _Alignas(64) unsigned char scene_memory[MEMORY], engine_memory[MEMORY];
static gv_sample sample[MAX_STEPS];
static gv_bench_drivers drivers[MAX_STEPS];
static int64_t collide_ns, dynamics_ns;

static int64_t now_ns(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

// ---- the linker's detour --------------------------------------------------------------------------
void __real_gv_engine_collide(gv_engine *engine);
void __wrap_gv_engine_collide(gv_engine *engine);
void __wrap_gv_engine_collide(gv_engine *engine) {
  int64_t start = now_ns();
  __real_gv_engine_collide(engine);
  collide_ns = now_ns() - start;
}

gv_solver_report __real_gv_dynamics_step(gv_dynamics *dyn, const gv_dynamics_contact contact[], int count,
                                         gv_vec3 out_force[]);
gv_solver_report __wrap_gv_dynamics_step(gv_dynamics *dyn, const gv_dynamics_contact contact[], int count,
                                         gv_vec3 out_force[]);
gv_solver_report __wrap_gv_dynamics_step(gv_dynamics *dyn, const gv_dynamics_contact contact[], int count,
                                         gv_vec3 out_force[]) {
  int64_t start = now_ns();
  gv_solver_report used = __real_gv_dynamics_step(dyn, contact, count, out_force);
  dynamics_ns = now_ns() - start;
  return used;
}

// ---- one grasp ------------------------------------------------------------------------------------
static void fail(const char *why) {
  fprintf(stderr, "bench_engine: %s\n", why);
  exit(2);
}

static void keep_step(const gv_engine *e, const gv_sample *s, int step) {
  sample[step] = *s;
  drivers[step].placed = gv_engine_hand_placed(e);
  memcpy(drivers[step].limb, e->hand[0].driver, sizeof e->hand[0].driver);
}

// Runs the whole grasp through the session, as the daemon does, and keeps what the engine was given.
static int record(const gv_settings *settings, gv_engine *engine, int max) {
  static gv_session session;
  static gv_frame frame[256];
  gv_driver driver;
  gv_pace pace;
  char err[512];
  if (gv_fcu_open(settings, &driver, &pace, err, sizeof err))
    fail(err);
  const gv_session_config cfg = {.limiter = settings->limiter,
                                 .safety = settings->safety,
                                 .side = settings->engine.hand.side,
                                 .period_s = settings->engine.step_s};
  gv_session_init(&session, &cfg, engine);
  int steps = 0;
  for (; steps < max && !driver.ended(driver.self); steps++) {
    gv_frame command;
    int64_t now = steps * (int64_t)1000000;
    int count = driver.poll(driver.self, now, frame, 256);
    gv_session_step(&session, now, frame, count, 0, &command);
    driver.send(driver.self, &command, 1);
    keep_step(engine, &session.sample, steps);
  }
  driver.close(driver.self);
  return steps;
}

static void write_drivers(const char *path, const gv_engine *e, int steps) {
  FILE *f = fopen(path, "wb");
  gv_bench_header header = {.steps = steps, .h = e->cfg.step_s};
  memcpy(header.spring, e->hand[0].spring, sizeof header.spring);
  memcpy(header.shape, e->broad.limb_shape, sizeof header.shape);
  memcpy(header.inertia, e->hand[0].limb_inertia, sizeof header.inertia);
  if (!f || fwrite(&header, sizeof header, 1, f) != 1 ||
      fwrite(drivers, sizeof *drivers, (size_t)steps, f) != (size_t)steps)
    fail(path);
  fclose(f);
}

static void print_vector(gv_vec3 v) { printf("[%.17g,%.17g,%.17g]", v.x, v.y, v.z); }

static void print_limbs(const gv_engine *e) {
  printf("\"limbs\":[");
  for (int i = 0; i < GV_LIMBS; i++) {
    const gv_spring *s = &e->hand[0].spring[i];
    printf("%s{\"mass\":%.17g,\"inertia\":%.17g,\"radius\":%.17g,\"half\":", i ? "," : "",
           s->mass_kg + s->added_mass_kg, e->hand[0].limb_inertia[i] + s->added_inertia,
           e->broad.limb_shape[i].radius);
    print_vector(e->broad.limb_shape[i].half);
    printf("}");
  }
  printf("]");
}

static void print_object(const gv_scene *scene, const gv_object *o) {
  const gv_quat q = o->T_world_body.q;
  const double (*I)[3] = o->inertia_kg_m2.m;
  printf("{\"name\":\"%s\",\"static\":%s,\"mass\":%.17g,\"mu\":%.17g,\"position\":", o->name,
         o->is_static ? "true" : "false", o->mass_kg, o->mu);
  print_vector(o->T_world_body.p);
  printf(",\"quaternion\":[%.17g,%.17g,%.17g,%.17g],\"inertia\":[%.17g,%.17g,%.17g,%.17g,%.17g,%.17g],"
         "\"pieces\":[",
         q.w, q.x, q.y, q.z, I[0][0], I[1][1], I[2][2], I[0][1], I[0][2], I[1][2]);
  for (int p = 0; p < o->piece_count; p++) {
    const gv_hull *hull = &scene->piece[o->piece_first + p];
    printf("%s[", p ? "," : "");
    for (int v = 0; v < hull->vertex_count; v++) {
      if (v)
        printf(",");
      print_vector(hull->vertex[v]);
    }
    printf("]");
  }
  printf("]}");
}

static void print_scene(const gv_engine *e, int steps) {
  printf("{\"steps\":%d,\"values\":%d,\"spring_bytes\":%zu,\"mu_hand\":%.17g,\"gravity\":", steps,
         GV_BENCH_VALUES, sizeof(gv_spring), e->cfg.mu_hand);
  print_vector(e->scene->gravity_m_s2);
  printf(",");
  print_limbs(e);
  printf(",\"objects\":[");
  for (int o = 0; o < e->scene->object_count; o++) {
    if (o)
      printf(",");
    print_object(e->scene, &e->scene->object[o]);
  }
  printf("]}\n");
  fflush(stdout);
}

static int find_object(const gv_scene *scene, const char *name) {
  for (int i = 0; i < scene->object_count; i++)
    if (!strcmp(scene->object[i].name, name))
      return i;
  fail("no such object in the scene");
  return -1;
}

static void run(gv_engine *e, int object, int step, double out[GV_BENCH_VALUES]) {
  gv_step_result result;
  int64_t start = now_ns();
  gv_engine_step(e, &sample[step], &result);
  int64_t whole_ns = now_ns() - start;
  gv_pose T = gv_pose_mul(gv_pose_inv(gv_engine_limb_pose(e, GV_LIMB_PALM)),
                          gv_engine_object_pose(e, object));
  const double values[GV_BENCH_VALUES] = {(double)whole_ns * 1e-3,
                                          (double)collide_ns * 1e-3,
                                          (double)dynamics_ns * 1e-3,
                                          result.contact_count,
                                          T.p.x,
                                          T.p.y,
                                          T.p.z,
                                          gv_engine_object_pose(e, object).p.z};
  memcpy(out, values, sizeof values);
}

// What callgrind counts: bench.py names this function.
__attribute__((noinline)) void gv_bench_counted_step(gv_engine *e, int step);
void gv_bench_counted_step(gv_engine *e, int step) {
  gv_step_result result;
  gv_engine_step(e, &sample[step], &result);
}

// Callgrind says after each step how many instructions it has counted so far (events-1).
static void count_steps(gv_engine *e, int first, int end) {
  for (int i = 0; i < first && i < end; i++)
    gv_bench_counted_step(e, i);
  CALLGRIND_START_INSTRUMENTATION;
  for (int i = first; i < end; i++) {
    gv_bench_counted_step(e, i);
    (void)VALGRIND_MONITOR_COMMAND("status internal");
  }
}

static void serve(gv_engine *e, int object, int steps) {
  int first, count;
  static double out[MAX_STEPS][GV_BENCH_VALUES];
  while (scanf("%d %d", &first, &count) == 2) {
    if (first < 0 || count < 0 || first + count > steps)
      fail("asked for steps that are not there");
    if (first == 0)
      gv_engine_reset(e);
    for (int i = 0; i < count; i++)
      run(e, object, first + i, out[i]);
    fwrite(out, sizeof out[0], (size_t)count, stdout);
    fflush(stdout);
  }
}

int main(int argc, char **argv) {
  gv_settings settings;
  gv_arena arena;
  gv_scene scene;
  char err[512];
  if (argc != 5 && argc != 7)
    fail("usage: bench_engine URL SCENE OBJECT DRIVERS, or ... - FIRST COUNT");
  gv_settings_default(&settings);
  const char *asked = getenv("GV_VARIANT");
  if (asked && variant_of_name(asked) < 0)
    fail("GV_VARIANT is none of the replays' variants");
  if (asked)
    settings.engine = variant_config((variant)variant_of_name(asked));
  snprintf(settings.fcu, sizeof settings.fcu, "%s", argv[1]);
  gv_arena_init(&arena, scene_memory, sizeof scene_memory);
  if (gv_scene_load(argv[2], &arena, &scene, err, sizeof err))
    fail(err);
  int object = find_object(&scene, argv[3]);
  gv_engine *engine = gv_engine_init(engine_memory, sizeof engine_memory, &settings.engine, &scene);
  if (!engine)
    fail("the scene does not fit");
  int first = argc == 7 ? atoi(argv[5]) : 0;
  int last = argc == 7 ? first + atoi(argv[6]) : MAX_STEPS;
  int steps = record(&settings, engine, last < MAX_STEPS ? last : MAX_STEPS);
  gv_engine_close(engine);
  engine = gv_engine_init(engine_memory, sizeof engine_memory, &settings.engine, &scene);
  if (argc == 7) {
    count_steps(engine, first, steps);
  } else {
    write_drivers(argv[4], engine, steps);
    print_scene(engine, steps);
    serve(engine, object, steps);
  }
  gv_engine_close(engine);
  return 0;
}
