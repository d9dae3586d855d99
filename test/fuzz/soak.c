// SPDX-License-Identifier: BSD-3-Clause
// The soak (`make soak`): random grasps for as long as SOAK_S says, in one process and as fast as it can:
// scenes changed while devices are there, requests, faults of device and link, stalls, foreign and broken
// frames, and garbage for everything that reads a file. Judged in every step, by the limiter's own promises
// and by the device of the simulator (gv_sim_report: maximum, slew, checksums, watchdog); after every
// round, whether objects are where they can be and memory is what it was. A failure prints the seed of its
// round: SOAK_SEED=N plays that one again.
#include <errno.h>
#include <malloc.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>
#include <unistd.h>

#include "daemon/load/config_load.h"
#include "daemon/loop/heap.h"
#include "daemon/loop/session.h"
#include "daemon/load/world.h"
#include "gloved/drivers.h"
#include "gloved/sim.h"
#include "support/check.h"
#include "tools/fcusim/fault.h"

enum {
  PERIOD_NS = 1000000,
  BETWEEN_NS = 1000 * PERIOD_NS,
  FRAMES = 256,
  TEXT = 16384,
  WARM_ROUNDS = 12,
  GARBAGE_EVERY = 400,
  LOOK_EVERY = 50
};
// What may be in use after a round beyond what was after the warm-up: libconfig keeps the text that it was
// reading when a file ends inside of it, up to so much a refused file (of ours nothing).
enum { KEPT_A_FILE = 4096, DRIFT = 65536 };

typedef struct soak {
  gv_world world;
  gv_settings settings;
  gv_session session;
  gv_sim sim;
  gv_sim_script script;
  fault fault;
  gv_request_rate rate;
  unsigned long long random;
  int64_t now_ns, told_ns, shut_ns;  // shut_ns: since when the safety machine lets no force out;
                                     // negative: it does
  double force_n[GV_FINGERS];
  gv_vec3 before[GV_MAX_OBJECTS];  // where objects were at the last look
  uint64_t resets_before, heap_calls, steps, grasps, requests, scenes, files, refused_files, with_force;
  size_t memory_first;
} soak;

static soak s;
static char text[TEXT], err[512];

static double uniform(double lo, double hi) { return check_uniform(&s.random, lo, hi); }
static int any(int count) { return (int)uniform(0.0, count) % count; }
static bool chance(double p) { return uniform(0.0, 1.0) < p; }

#define DEMAND(cond, ...) CHECK(cond, __VA_ARGS__)

// ---- a round's scene and user ---------------------------------------------------------------------

static const char *memory_file(const char *data, size_t size, int *out_descriptor) {
  static char path[40];
  *out_descriptor = memfd_create("soak", 0);
  if (*out_descriptor < 0 || write(*out_descriptor, data, size) != (ssize_t)size) {
    perror("soak: memory file");
    exit(2);
  }
  snprintf(path, sizeof path, "/proc/self/fd/%d", *out_descriptor);
  return path;
}

// A table with one to six boxes and balls beside each other.
static void write_scene(void) {
  int n = snprintf(text, TEXT,
                   "version = 1;\nobjects = (\n  { name = \"table\"; static = true; mu = 0.8; box = [1.2, "
                   "0.8, 0.04]; position = [0.0, 0.0, -0.02]; }");
  const int count = 1 + any(6);
  for (int i = 0; i < count; i++) {
    const double x = 0.1 * (i % 3);
    const double y = 0.1 * (i / 3);
    const double mass = uniform(0.02, 0.8);
    const double mu = uniform(0.2, 1.2);
    const double half = 1e-3 * (15 + any(26));
    n += snprintf(text + n, TEXT - (size_t)n, ",\n  { name = \"o%d\"; mass = %.6f; mu = %.6f; ", i, mass, mu);
    if (chance(0.4))
      n += snprintf(text + n, TEXT - (size_t)n, "ball = %.6f; ", half);
    else
      n += snprintf(text + n, TEXT - (size_t)n, "box = [%.6f, %.6f, %.6f]; ", uniform(0.02, 0.08),
                    uniform(0.02, 0.08), 2.0 * half);
    n += snprintf(text + n, TEXT - (size_t)n, "position = [%.6f, %.6f, %.6f]; }", x, y, half);
  }
  snprintf(text + n, TEXT - (size_t)n, "\n);\n");
}

static int load_scene(gv_world *out) {
  static const char *const known[] = {"data/scenes/box.scene", "data/scenes/frame.scene"};
  if (chance(0.6))
    return gv_world_load(out, known[any(2)], NULL, &s.settings.engine, err, sizeof err);
  int descriptor;
  write_scene();
  const char *path = memory_file(text, strlen(text), &descriptor);
  const int error = gv_world_load(out, path, NULL, &s.settings.engine, err, sizeof err);
  close(descriptor);
  return error;
}

static const char *const grasp_scripts[] = {"power_box",   "pinch_box", "tripod_box",
                                            "regrasp_box", "bar_frame", "finger_frame"};

// Postures and wrist at random, above the table; the dead-man switch now and then let go.
static void write_script(void) {
  int n = snprintf(text, TEXT,
                   "posture a index_mpj 0\nposture b index_mpj 60 index_pij 50 middle_mpj 60 middle_pij 50 "
                   "thumb_abduction 40 ring_mpj 50 little_mpj 40\n");
  n += snprintf(text + n, TEXT - (size_t)n,
                "at 0 posture a wrist -0.15 -0.1 0.1 0 0 0 dead_man off\nat 0.2 dead_man on\n");
  double time_s = 0.4;
  for (int i = 0; i < 12; i++) {
    time_s += uniform(0.2, 0.8);
    n += snprintf(text + n, TEXT - (size_t)n, "at %g posture %c wrist %g %g %g %g %g %g dead_man %s\n",
                  time_s, "ab"[any(2)], uniform(-0.2, 0.1), uniform(-0.15, 0.1), uniform(0.05, 0.15),
                  uniform(0, 90), uniform(-20, 20), uniform(-20, 20), chance(0.85) ? "on" : "off");
  }
  snprintf(text + n, TEXT - (size_t)n, "end %g\n", time_s + 0.3);
}

static void choose_user(void) {
  static const char *const faults[] = {"silence",      "loss",         "corrupt",    "frozen-tracker",
                                       "frozen-glove", "equal-glove",  "clock",      "no-status",
                                       "bad-status",   "sensor-fault", "other-hand", "tracker-error"};
  int error;
  if (chance(0.5)) {
    snprintf(text, TEXT, "data/scripts/%s.user", grasp_scripts[any(6)]);
    error = gv_sim_script_load(text, &s.script, err, sizeof err);
  } else {
    write_script();
    error = gv_sim_script_parse(text, "soak.user", &s.script, err, sizeof err);
  }
  DEMAND(!error, "%s", err);
  s.script.device = chance(0.5) ? gv_sim_device_best() : gv_sim_device_real();
  if (chance(0.3))
    gv_sim_device_set(&s.script.device, "loss_chance", "0.01", err, sizeof err);
  if (chance(0.3))
    gv_sim_device_set(&s.script.device, "jump_chance", "0.01", err, sizeof err);
  s.fault = (fault){.kind = FAULT_NONE};
  if (chance(0.5)) {
    snprintf(text, TEXT, "%s@%g", faults[any((int)(sizeof faults / sizeof *faults))],
             uniform(0.5, s.script.end_s));
    DEMAND(fault_parse(text, &s.fault), "%s", text);
  }
}

// ---- garbage --------------------------------------------------------------------------------------

// Some bytes of the text changed, doubled, cut.
static size_t mutate(size_t size) {
  for (int i = any(8); i >= 0 && size > 1; i--) {
    const size_t at = (size_t)any((int)size);
    switch (any(4)) {
      case 0: text[at] = (char)any(256); break;
      case 1: text[at] = "(){}[]=;,\"0-9e\n"[any(15)]; break;
      case 2: size = chance(0.2) ? at + 1 : size; break;
      default: memmove(text + at, text + any((int)size), size - at > 16 && at + 32 < size ? 16 : 0); break;
    }
  }
  return size;
}

static size_t read_text(const char *path) {
  FILE *file = fopen(path, "rb");
  if (!file)
    return 0;
  const size_t size = fread(text, 1, TEXT - 1, file);
  fclose(file);
  text[size] = '\0';
  return size;
}

static void read_garbage(void) {
  static const char *const source[] = {"data/scenes/box.scene", "data/gloved.conf",
                                       "data/calibration/default.cal", "data/scripts/power_box.user",
                                       "data/traces/power_box/input.log.gz"};
  static gv_settings settings;
  static gv_calibration calibration;
  static gv_sim_script script;
  static gv_world world;
  const int kind = any(5);
  const size_t size = mutate(read_text(source[kind]));
  gv_driver trace;
  int descriptor, error = 0;
  text[size] = '\0';
  if (kind == 3)
    error = gv_sim_script_parse(text, "garbage.user", &script, err, sizeof err);
  const char *path = memory_file(text, size, &descriptor);
  if (kind == 0 && (error = gv_world_load(&world, path, NULL, &s.settings.engine, err, sizeof err)) == 0)
    gv_world_close(&world);
  if (kind == 1)
    error = gv_settings_load(path, &settings, err, sizeof err);
  if (kind == 2)
    error = gv_calibration_load(path, &calibration, err, sizeof err);
  if (kind == 4 && (error = gv_trace_open(path, &trace, err, sizeof err)) == 0)
    trace.close(trace.self);
  close(descriptor);
  s.files++;
  s.refused_files += error ? 1 : 0;
}

// Frames that are none: any bytes under any identifier, and sound ones with a byte
// changed or out of their turn.
static int add_garbage(gv_frame frame[FRAMES], int count) {
  gv_frame *added = &frame[count];
  if (count == 0 || count == FRAMES || !chance(0.002))
    return count;
  *added = frame[any(count)];
  if (chance(0.5))
    added->data[any(64)] ^= (uint8_t)(1 + any(255));
  if (chance(0.3))
    added->id = (uint32_t)any(2048);
  if (chance(0.3))
    added->len = (uint8_t)any(65);
  added->stamp_ns = s.now_ns;
  return count + 1;
}

// ---- requests, and another scene ------------------------------------------------------------------

static void look_at_start(void) {
  s.resets_before = gv_engine_counters(s.world.engine)->body_resets;
  for (int i = 0; i < s.world.scene.object_count; i++)
    s.before[i] = gv_engine_object_pose(s.world.engine, i).p;
}

static void change_scene(void) {
  gv_world next;
  const gv_request request = {.kind = GV_REQUEST_SCENE};
  if (load_scene(&next)) {
    DEMAND(0, "%s", err);
    return;
  }
  if (!gv_session_request(&s.session, &request)) {  // a force may flow
    gv_world_close(&next);
    return;
  }
  const uint64_t steps = (uint64_t)gv_session_steps(&s.session);
  gv_world_close(&s.world);
  s.world = next;
  DEMAND(gv_world_start(&s.world, &s.settings.engine) == 0, "the engine does not start");
  gv_session_change_engine(&s.session, s.world.engine, steps);
  look_at_start();
  s.scenes++;
}

static void ask(void) {
  gv_request request;
  const double value = chance(0.2) ? uniform(-1e9, 1e9) : chance(0.1) ? NAN : uniform(0, 2.5);
  const gv_request_message message = {any(13) - 2, value,
                                      chance(0.5) ? "data/scenes/box.scene" : "../x\x1b[2J", 0};
  char why[GV_REQUEST_WHY];
  s.requests++;
  if (!gv_request_check(&message, &s.rate, s.now_ns, &request, why))
    return;
  if (request.kind == GV_REQUEST_SCENE)
    change_scene();
  else
    gv_session_request(&s.session, &request);
  if (request.kind == GV_REQUEST_RESET)
    look_at_start();
}

// ---- judging --------------------------------------------------------------------------------------

static void judge_force(const gv_frame *command) {
  const gv_limiter_config *limiter = &s.settings.limiter;
  const double dt_s = (double)(s.now_ns - s.told_ns) * 1e-9;
  const bool lets = gv_safety_lets_force_out(&s.session.safety);
  gv_command_msg msg;
  DEMAND(gv_fcu_unpack_command(command, &msg) == GV_FCU_OK, "a command that does not decode");
  if (lets)
    s.shut_ns = -1;
  else if (s.shut_ns < 0)
    s.shut_ns = s.now_ns;
  for (int i = 0; i < GV_FINGERS; i++) {
    // A device that heard nothing for so long has let go: its force is none, whatever it was told before.
    const double before_n = dt_s >= GV_DEVICE_WATCHDOG_S ? 0.0 : s.force_n[i];
    const double force_n = s.session.force_n[i];
    const double rise_n = force_n - before_n;
    DEMAND(isfinite(force_n) && force_n >= 0.0 && force_n <= limiter->max_n, "%g N", force_n);
    DEMAND(rise_n <= limiter->slew_n_per_s * fmin(dt_s, 1e-9 * PERIOD_NS) + 1e-9 ||
               force_n <= limiter->pretension_n,
           "rises by %g N in %g s", rise_n, dt_s);
    DEMAND(lets || rise_n <= 1e-9, "rises by %g N in state %s", rise_n,
           gv_safety_name(s.session.safety.state));
    DEMAND(s.shut_ns < 0 || (double)(s.now_ns - s.shut_ns) * 1e-9 <= limiter->ramp_s || force_n <= 0.0,
           "%g N after the ramp", force_n);
    s.force_n[i] = force_n;
    s.with_force += force_n > 0.5;
  }
  s.told_ns = s.now_ns;
}

// Lost: not finite, put back by the engine, or through the table's top, where it
// was above it at the last look.
static void judge_objects(void) {
  DEMAND(gv_engine_counters(s.world.engine)->body_resets == s.resets_before, "a body ran away");
  for (int i = 0; i < s.world.scene.object_count; i++) {
    if (s.world.scene.object[i].is_static)
      continue;
    const gv_pose T = gv_engine_object_pose(s.world.engine, i);
    const bool over = fabs(T.p.x) < 0.55 && fabs(T.p.y) < 0.35;
    DEMAND(gv_pose_finite(T), "object %d is not finite", i);
    DEMAND(!(over && s.before[i].z > 0.0 && T.p.z < -0.002),
           "object %d went through the table: z %g m after %g m", i, T.p.z, s.before[i].z);
    s.before[i] = T.p;
  }
}

// Below the table's edge it falls for ever, and is put back far away: then the scene starts anew.
static void pick_up_what_fell(void) {
  for (int i = 0; i < s.world.scene.object_count; i++) {
    const gv_request reset = {.kind = GV_REQUEST_RESET};
    const gv_request disarm = {.kind = GV_REQUEST_DISARM};
    if (s.before[i].z > -5.0)
      continue;
    if (gv_session_request(&s.session, &reset)) {
      look_at_start();
      return;
    }
    gv_session_request(&s.session, &disarm);
  }
}

// ---- a round --------------------------------------------------------------------------------------

static void step(unsigned skipped) {
  static gv_frame frame[FRAMES];
  gv_frame command;
  int count = 0, more;
  const double script_s = (double)s.sim.now_ns * 1e-9;
  const int64_t device_ns = (s.sim.now_ns < 0 ? 0 : s.sim.now_ns) + PERIOD_NS * (1 + (int64_t)skipped);
  while (count < FRAMES - 16 && (more = gv_sim_advance(&s.sim, device_ns, &frame[count], 16)) > 0)
    count += more;
  s.now_ns += PERIOD_NS * (1 + (int64_t)skipped);
  fault_time(&s.fault, script_s);
  count = fault_apply(&s.fault, frame, count);
  for (int i = 0; i < count; i++)
    frame[i].stamp_ns = s.now_ns;
  count = add_garbage(frame, count);
  const uint64_t calls = gv_heap_calls();
  gv_heap_watch(true);
  gv_session_step(&s.session, s.now_ns, frame, count, skipped, &command);
  gv_heap_watch(false);
  s.heap_calls += gv_heap_calls() - calls;
  judge_force(&command);
  if (!(s.fault.active && s.fault.kind == FAULT_SILENCE) && !chance(0.001))
    gv_sim_receive(&s.sim, &command);
  s.steps++;
}

static void judge_device(void) {
  const gv_sim_report *report = gv_sim_report_of(&s.sim);
  DEMAND(report->over_max == 0, "%d commands above the maximum", (int)report->over_max);
  DEMAND(report->over_slew == 0, "%d commands too fast", (int)report->over_slew);
  DEMAND(report->refused_frames == 0, "%d broken commands", (int)report->refused_frames);
  DEMAND(report->zero_after_s <= 0.0051, "the device let go after %g s", report->zero_after_s);
  DEMAND(s.heap_calls == 0, "%d heap calls in a step", (int)s.heap_calls);
}

static void round_of(unsigned long long seed) {
  s.random = seed * 2654435761ULL + 88172645463325252ULL;
  choose_user();
  gv_sim_init(&s.sim, &s.script, NULL, seed);
  gv_sim_start(&s.sim);
  s.now_ns += BETWEEN_NS;  // another device: nothing comes while it is plugged in
  change_scene();
  for (int i = 0; !gv_sim_ended(&s.sim) && check_in_test == 0; i++) {
    step(chance(0.002) ? (unsigned)any(60) : 0);
    if (chance(0.002))
      ask();
    if (i % LOOK_EVERY == 0) {
      judge_objects();
      pick_up_what_fell();
    }
    if (i % GARBAGE_EVERY == 0)
      read_garbage();
  }
  judge_device();
  s.grasps++;
}

static size_t memory_in_use(void) {
  malloc_trim(0);
  return mallinfo2().uordblks;
}

static void judge_memory(void) {
  const size_t now = memory_in_use();
  const size_t most = s.memory_first + DRIFT + KEPT_A_FILE * s.refused_files;
  DEMAND(now <= most, "%zu bytes in use, %zu after the first %d rounds", now, s.memory_first, WARM_ROUNDS);
}

static double clock_s(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void start(void) {
  gv_settings_default(&s.settings);
  s.settings.passivity.controller = GV_PASSIVITY_ON;  // beside every promise of the limiter
  const gv_session_config cfg = {.limiter = s.settings.limiter,
                                 .safety = s.settings.safety,
                                 .passivity = s.settings.passivity,
                                 .side = GV_RIGHT,
                                 .period_s = 1e-9 * PERIOD_NS};
  if (gv_world_load(&s.world, "data/scenes/box.scene", NULL, &s.settings.engine, err, sizeof err) ||
      gv_world_start(&s.world, &s.settings.engine)) {
    fprintf(stderr, "soak: %s\n", err);
    exit(2);
  }
  gv_session_init(&s.session, &cfg, s.world.engine);
  s.shut_ns = 0;
  look_at_start();
}

static void test_soak(void) {
  const char *seconds = getenv("SOAK_S");
  const char *one = getenv("SOAK_SEED");
  const double end_s = clock_s() + (seconds ? atof(seconds) : 1800.0);
  unsigned long long seed = one ? strtoull(one, NULL, 10) : (unsigned long long)time(NULL);
  start();
  printf("# the first seed is %llu\n", seed);
  do {
    round_of(seed);
    if (s.grasps == WARM_ROUNDS)
      s.memory_first = memory_in_use();
    if (s.grasps > WARM_ROUNDS)
      judge_memory();
    if (check_in_test)
      printf("# SOAK_SEED=%llu, %g s of the simulation\n", seed, 1e-9 * (double)s.now_ns);
    seed++;
  } while (!one && !check_in_test && clock_s() < end_s);
  printf("figure %d grasps, %.0f s simulated, %.0f s of a finger's force; %d scenes, %d requests, %d files "
         "of garbage; %.0f kB more memory in use\n",
         (int)s.grasps, (double)s.steps * 1e-3, (double)s.with_force * 1e-3, (int)s.scenes, (int)s.requests,
         (int)s.files, s.memory_first ? ((double)memory_in_use() - (double)s.memory_first) / 1e3 : 0.0);
  gv_world_close(&s.world);
}

int main(void) {
  RUN(test_soak);
  return check_done();
}
