// SPDX-License-Identifier: BSD-3-Clause
// The worker of `make zwidth`: is the loop of coupling, wire, device and finger stable? Task `press`: the
// simulated user's index finger presses on a wall that does not move (press.user), taps it, and then holds
// still; `power`: five fingers lift the box and hold it (data/scripts). What the force does in the last two
// seconds decides. Simulated device, session and engine in virtual time, no clock.
//
//   zwidth NAME=VALUE...            a line of CSV for every pair of k and d, after a line of names
//
//     k=LIST, d=LIST     stiffness, N/m, and damping, N s/m, of the limbs' coupling; d=-1: critical
//     upto=1             for each d, the k in their order up to the first that is not stable
//     rate=HZ, glove=HZ  of the loop and its commands (1000); of the glove (perfect: the loop's)
//     delay_ms=MS        of the wire, both ways together (0)
//     device=best|real   (best)
//     finger=relaxed|normal|firm      (normal)
//     filter_hz=HZ, filter_rest_hz=HZ, prediction_s=S   of the engine's sample filter
//     passivity=on|off   the controller (off)
//     config=FILE        any other setting
//     task=press|power, seed=N
//     quantum=RAD        of every joint's sensor
//     anything else      a setting of the simulated device (gloved/sim.h), e.g. quantum_max_rad=0.01
//
// Outcomes, by the standard deviation of the finger's force in the last second:
//   stable      below 0.05 N, what a person notices
//   noisy       above
//   oscillates  above a fifth of the mean force: it pushes the finger off the wall again and again
//   limit       at the limit of force; away: no force; dropped: the box is not in the hand
// Also told: Hz of the oscillation, its growth from one second to the next, the power that the loop feeds
// into the finger's own damper (a passive loop feeds none into a finger at rest), the mean force.
#include <stdlib.h>
#include <string.h>

#include "daemon/load/config_load.h"
#include "daemon/load/scene_load.h"
#include "daemon/loop/session.h"
#include "gloved/sim.h"

enum { MEMORY = 16 << 20, LIST_MAX = 64, FRAMES = 512, BOX = 1 };
static const double quiet_n = 0.05;
static const double bouncing = 0.2;  // of the mean force
static const double window_s = 1.0;  // twice, until the script's end
static _Alignas(64) unsigned char scene_memory[MEMORY], engine_memory[MEMORY];
static gv_sim sim;
static gv_sim_script script;
static gv_session session;
static gv_scene scene;
static gv_settings settings;

typedef struct list {
  double value[LIST_MAX];
  int count;
} list;

typedef struct task {
  const char *name, *script;
  double until_s;  // the end of the last second that is looked at
  double lift_m;   // so high the box is then
} task;
static const task tasks[] = {
  {"press", "test/zwidth/press.user", 4.0, 0.0},
  {"power", "data/scripts/power_box.user", 14.5, 0.1},
};

typedef struct setup {
  list k_n_m, d_n_s_m;
  bool upto, real;
  double rate_hz, glove_hz, delay_ms, quantum_rad;
  const task *task;
  uint64_t seed;
  gv_sim_device device;
} setup;

typedef struct window {
  double sum_n[GV_FINGERS], sum2_n[GV_FINGERS], energy_j;
  int steps, crossings;
  double last_n;  // of the finger that oscillates most: the index
} window;

typedef struct verdict {
  const char *outcome;
  double std_n, growth, hz, power_w, force_n;
} verdict;

static int fail(const char *what, const char *which) {
  fprintf(stderr, "zwidth: %s%s\n", what, which);
  return 2;
}

// ---- one run --------------------------------------------------------------------------------------
static gv_engine *start(const setup *s, double k_n_m, double d_n_s_m) {
  gv_config *cfg = &settings.engine;
  cfg->step_s = 1.0 / s->rate_hz;
  cfg->period_s = 0.0;
  cfg->limb.k_f = k_n_m;
  cfg->limb.d_f = d_n_s_m;
  gv_engine *engine = gv_engine_init(engine_memory, sizeof engine_memory, cfg, &scene);
  const gv_session_config session_cfg = {.limiter = settings.limiter,
                                         .safety = settings.safety,
                                         .passivity = settings.passivity,
                                         .side = cfg->hand.side,
                                         .period_s = cfg->step_s};
  if (!engine)
    return NULL;
  gv_session_init(&session, &session_cfg, engine);
  gv_sim_init(&sim, &script, &s->device, s->seed);
  gv_sim_start(&sim);
  return engine;
}

static void step(int64_t now_ns) {
  static gv_frame frame[FRAMES];
  gv_frame command;
  const int count = gv_sim_advance(&sim, now_ns, frame, FRAMES);
  gv_session_step(&session, now_ns, frame, count, 0, &command);
  gv_sim_receive(&sim, &command);
}

// What the user's dampers take up: all that the loop feeds into fingers that their user holds still.
static double damped_w(void) {
  const gv_sim_device *d = &sim.device;
  const double k[3] = {d->stiffness_0, d->stiffness_1, d->stiffness_2};
  const double inertia[3] = {d->inertia_0, d->inertia_1, d->inertia_2};
  double power_w = 0.0;
  for (int f = 0; f < GV_FINGERS; f++)
    for (int j = 0; j < 3; j++) {
      const double c = 2.0 * d->damping_ratio * sqrt(k[j] * inertia[j]);
      power_w += c * sim.joint[f][j].velocity_rad_s * sim.joint[f][j].velocity_rad_s;
    }
  return power_w;
}

static void look(window *w, double mean_n, double h) {
  const double index_n = session.force_n[1] - mean_n;
  for (int i = 0; i < GV_FINGERS; i++) {
    w->sum_n[i] += session.force_n[i];
    w->sum2_n[i] += session.force_n[i] * session.force_n[i];
  }
  w->crossings += w->steps > 0 && (index_n > 0.0) != (w->last_n > 0.0);
  w->last_n = index_n;
  w->energy_j += h * damped_w();
  w->steps++;
}

static double std_n(const window *w) {
  double most = 0.0;
  for (int i = 0; i < GV_FINGERS; i++) {
    const double mean = w->sum_n[i] / w->steps;
    most = fmax(most, sqrt(fmax(0.0, w->sum2_n[i] / w->steps - mean * mean)));
  }
  return most;
}

static verdict judge(const window *before, const window *last) {
  verdict v = {.std_n = std_n(last), .force_n = last->sum_n[1] / last->steps};
  v.growth = v.std_n / fmax(1e-9, std_n(before));
  v.hz = v.std_n < 1e-6 ? 0.0 : 0.5 * last->crossings / window_s;
  v.power_w = last->energy_j / window_s;
  const bool at_limit = v.force_n > 0.95 * fmin(settings.limiter.max_n, settings.limiter.finger_max_n[1]);
  v.outcome = v.force_n < 1e-3                  ? "away"
              : v.std_n >= bouncing * v.force_n ? "oscillates"
              : at_limit                        ? "limit"
              : v.std_n >= quiet_n              ? "noisy"
                                                : "stable";
  return v;
}

static bool run(const setup *s, double k_n_m, double d_n_s_m, verdict *out) {
  gv_engine *engine = start(s, k_n_m, d_n_s_m);
  window before = {0};
  window last = {0};
  if (!engine)
    return false;
  const double h = settings.engine.step_s;
  const double box_z = gv_engine_object_pose(engine, BOX).p.z;
  const int steps = (int)(s->task->until_s / h + 0.5);
  const int second = (int)(window_s / h + 0.5);
  for (int i = 0; i < steps; i++) {
    step((int64_t)(1e9 * h * i + 0.5));
    if (i >= steps - second)
      look(&last, before.sum_n[1] / before.steps, h);
    else if (i >= steps - 2 * second)
      look(&before, 0.0, h);
  }
  *out = judge(&before, &last);
  if (gv_engine_object_pose(engine, BOX).p.z < box_z + s->task->lift_m - 0.01)
    out->outcome = "dropped";
  gv_engine_close(engine);
  return true;
}

// ---- all that is asked for ------------------------------------------------------------------------
static int read_list(const char *text, list *out) {
  char *end;
  out->count = 0;
  for (const char *at = text; out->count < LIST_MAX; at = end + 1) {
    out->value[out->count++] = strtod(at, &end);
    if (end == at || (*end && *end != ','))
      return -1;
    if (!*end)
      return 0;
  }
  return -1;
}

static int set_device_preset(setup *s, const char *value) {
  char err[256];
  s->real = strcmp(value, "real") == 0;
  if (!s->real && strcmp(value, "best") != 0)
    return fail("device wants best or real, not ", value);
  s->device = s->real ? gv_sim_device_real() : gv_sim_device_best();
  return gv_sim_device_set(&s->device, "finger", "normal", err, sizeof err);
}

// A double among the settings by its name; NULL: another's.
static double *find_number(setup *s, const char *name) {
  if (strcmp(name, "rate") == 0)
    return &s->rate_hz;
  if (strcmp(name, "quantum") == 0)
    return &s->quantum_rad;
  if (strcmp(name, "glove") == 0)
    return &s->glove_hz;
  if (strcmp(name, "delay_ms") == 0)
    return &s->delay_ms;
  if (strcmp(name, "filter_hz") == 0)
    return &settings.engine.filter_hz;
  if (strcmp(name, "filter_rest_hz") == 0)
    return &settings.engine.filter_rest_hz;
  if (strcmp(name, "prediction_s") == 0)
    return &settings.engine.prediction_s;
  return NULL;
}

static int set_task(setup *s, const char *name) {
  for (size_t i = 0; i < sizeof tasks / sizeof tasks[0]; i++)
    if (strcmp(tasks[i].name, name) == 0) {
      s->task = &tasks[i];
      return 0;
    }
  return fail("task wants press or power, not ", name);
}

static int set(setup *s, const char *name, const char *value) {
  char err[256] = "";
  char *end;
  double *number = find_number(s, name);
  if (number) {
    *number = strtod(value, &end);
    return end == value || *end ? fail("no number: ", value) : 0;
  }
  if (strcmp(name, "k") == 0)
    return read_list(value, &s->k_n_m) ? fail("k wants numbers joined by commas, not ", value) : 0;
  if (strcmp(name, "d") == 0)
    return read_list(value, &s->d_n_s_m) ? fail("d wants numbers joined by commas, not ", value) : 0;
  if (strcmp(name, "task") == 0)
    return set_task(s, value);
  if (strcmp(name, "passivity") == 0)
    settings.passivity.controller = strcmp(value, "on") == 0 ? GV_PASSIVITY_ON : GV_PASSIVITY_OFF;
  else if (strcmp(name, "seed") == 0)
    s->seed = strtoull(value, NULL, 10);
  else if (strcmp(name, "upto") == 0)
    s->upto = value[0] == '1';
  else if (gv_sim_device_set(&s->device, name, value, err, sizeof err))
    return fail(err, "");
  return 0;
}

static bool is_read_first(const char *name) {
  return strcmp(name, "config") == 0 || strcmp(name, "device") == 0;
}

// Files and presets first, whatever their place: single settings change what those say.
static int read_arguments(int argc, char **argv, setup *s) {
  for (int pass = 0; pass < 2; pass++)
    for (int i = 1; i < argc; i++) {
      char name[64], err[512] = "";
      const char *equals = strchr(argv[i], '=');
      if (!equals || equals - argv[i] >= (int)sizeof name)
        return fail("NAME=VALUE, not ", argv[i]);
      snprintf(name, sizeof name, "%.*s", (int)(equals - argv[i]), argv[i]);
      if ((pass == 0) != is_read_first(name))
        continue;
      if (strcmp(name, "config") == 0) {
        if (gv_settings_load(equals + 1, &settings, err, sizeof err))
          return fail(err, "");
      } else if (pass == 0 ? set_device_preset(s, equals + 1) : set(s, name, equals + 1))
        return 2;
    }
  return 0;
}

// The wire's delay goes half each way. The device works ten times a millisecond, so that the finger is
// nearly a continuous one, and forgives a loop of 250 Hz; a perfect glove samples as often as the loop runs.
static void finish_device(setup *s) {
  gv_sim_device *d = &s->device;
  d->delay_s = 0.5e-3 * s->delay_ms;
  d->cycle_hz = 10000.0;
  d->watchdog_s = 0.005;
  d->command_hz = s->rate_hz;
  if (s->quantum_rad > 0.0)
    d->quantum_min_rad = d->quantum_max_rad = s->quantum_rad;
  if (!s->real)
    d->tracker_hz = s->rate_hz;
  if (!s->real || s->glove_hz > 0.0)
    d->glove_hz_min = d->glove_hz_max = s->glove_hz > 0.0 ? s->glove_hz : s->rate_hz;
}

static int load(const setup *s) {
  char err[512] = "";
  gv_arena arena;
  gv_arena_init(&arena, scene_memory, sizeof scene_memory);
  if (gv_scene_load("data/scenes/box.scene", &arena, &scene, err, sizeof err) ||
      gv_sim_script_load(s->task->script, &script, err, sizeof err) ||
      gv_sim_device_check(&s->device, err, sizeof err))
    return fail(err, "");
  return 0;
}

static int sweep(const setup *s) {
  printf("k_n_m,d_n_s_m,outcome,std_n,growth,hz,power_w,force_n\n");
  for (int j = 0; j < s->d_n_s_m.count; j++)
    for (int i = 0; i < s->k_n_m.count; i++) {
      verdict v;
      const double d = s->d_n_s_m.value[j];
      if (!run(s, s->k_n_m.value[i], d, &v))
        return fail("the engine does not start", "");
      printf("%g,%g,%s,%.5f,%.3f,%.1f,%.3g,%.3f\n", s->k_n_m.value[i], d, v.outcome, v.std_n, v.growth, v.hz,
             v.power_w, v.force_n);
      if (s->upto && strcmp(v.outcome, "stable") != 0)
        break;
    }
  return 0;
}

int main(int argc, char **argv) {
  static setup s = {
    .rate_hz = 1000.0, .task = &tasks[0], .seed = 1, .k_n_m = {{200.0}, 1}, .d_n_s_m = {{-1.0}, 1}};
  gv_settings_default(&settings);
  set_device_preset(&s, "best");
  if (read_arguments(argc, argv, &s))
    return 2;
  finish_device(&s);
  return load(&s) ? 2 : sweep(&s);
}
