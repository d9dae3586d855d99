// SPDX-License-Identifier: BSD-3-Clause
// One grasp of the simulated user on several seeds, under any configuration, in virtual time: session, engine
// and simulated device as the daemon has them. Prints a head and a line of CSV for each seed:
// whether the object is held, how far it slips and tilts, how deep the limbs are in it, what the person
// feels, and energy from nowhere. test/report/Snakefile calls it.
//
//   report_grasp CONFIG SCRIPT SCENE OBJECT best|real|moving FIRST COUNT [SERIES]
//                         moving: real, and a user who sways and trembles
//                         SERIES: a file for force of the thumb over time, of the first seed
#include <stdlib.h>
#include <string.h>

#include "daemon/load/config_load.h"
#include "daemon/load/scene_load.h"
#include "daemon/loop/session.h"
#include "engine/engine_state.h"
#include "gloved/sim.h"

enum { MEMORY = 64 << 20 };
static const int64_t hold_ns = 9000000000;  // until 0.7 s before the script's end
static const int64_t series_ns = 20000000;  // between points of the series
static const double lifted_m = 0.05;        // less: not held
static const double slid_m = 0.005;         // more, of the point that the hand holds: not held
static const double deg = 180.0 / GV_PI;
static _Alignas(64) unsigned char scene_memory[MEMORY], engine_memory[MEMORY];
static gv_settings settings;
static gv_scene scene;
static gv_sim_script script;
static gv_sim sim;
static gv_session session;

typedef struct measures {
  int held_steps;
  gv_pose held_at;                // in the palm, as the window begins
  gv_vec3 grip;                   // the object's point that the hand holds, in its own frame
  gv_vec3 grip_first, grip_last;  // its mean place in the palm, in the first and the last second
  double way_m, tilt_rad;         // from held_at at most
  double lift_m;                  // least height above the start
  double depth_m;                 // deepest contact of a limb
  double sum_n[GV_FINGERS], sum2_n2[GV_FINGERS];
  double force_max_n;            // of any finger at any time
  double energy_j, energy_up_j;  // least mechanical energy so far, and the largest rise above it
  double given_j;                // the most that a tendon gave out (gloved/passivity.h)
} measures;

static void fail(const char *why) {
  fprintf(stderr, "report_grasp: %s\n", why);
  exit(2);
}

static int find_object(const char *name) {
  for (int i = 0; i < scene.object_count; i++)
    if (strcmp(scene.object[i].name, name) == 0)
      return i;
  fail("no such object in the scene");
  return -1;
}

static gv_sim_device make_device(const char *name) {
  if (strcmp(name, "best") == 0)
    return gv_sim_device_best();
  gv_sim_device device = gv_sim_device_real();
  if (strcmp(name, "moving") == 0) {  // as in test_real
    device.sway_rad = 0.03;
    device.sway_m = 0.002;
    device.tremor_rad = 0.001;
  }
  return device;
}

static gv_engine *start(const char *device_name, uint64_t seed) {
  const gv_sim_device device = make_device(device_name);
  gv_engine *engine = gv_engine_init(engine_memory, sizeof engine_memory, &settings.engine, &scene);
  if (!engine)
    fail("the scene does not fit");
  const gv_session_config cfg = {.limiter = settings.limiter,
                                 .safety = settings.safety,
                                 .passivity = settings.passivity,
                                 .side = settings.engine.hand.side,
                                 .period_s = settings.engine.step_s};
  gv_session_init(&session, &cfg, engine);
  gv_sim_init(&sim, &script, &device, seed);
  gv_sim_start(&sim);
  return engine;
}

static void step(int64_t now_ns) {
  static gv_frame frame[256];
  gv_frame command;
  const int count = gv_sim_advance(&sim, now_ns, frame, 256);
  gv_session_step(&session, now_ns, frame, count, 0, &command);
  gv_sim_receive(&sim, &command);
}

static gv_pose object_in_palm(const gv_engine *e, int object) {
  return gv_pose_mul(gv_pose_inv(gv_engine_limb_pose(e, GV_LIMB_PALM)), gv_engine_object_pose(e, object));
}

// Where the hand holds it: of its contacts with the hand, weighed by force.
static gv_vec3 find_grip(const gv_engine *e, int object) {
  gv_vec3 sum = {0, 0, 0};
  double forces = 0.0;
  for (int i = 0; i < e->contact_count; i++) {
    const gv_contact *c = &e->contact[i];
    const double force = c->limb >= 0 && c->object == object ? gv_norm(c->force_world) : 0.0;
    sum = gv_mad(sum, force, c->position_world);
    forces += force;
  }
  const gv_pose T = gv_engine_object_pose(e, object);
  return forces > 0.0 ? gv_transform_inv(T, gv_scale(sum, 1.0 / forces)) : gv_v3(0, 0, 0);
}

// Springs of the coupling under Eqn 1 and 2, limbs (with the mass that the implicit step adds: it stands for
// the springs' own) and objects, in gravity.
static double mechanical_energy(const gv_engine *e) {
  const gv_engine_hand *hand = &e->hand[0];
  double energy = gv_engine_energy(e);
  for (int i = 0; i < GV_LIMBS; i++) {
    const gv_spring *s = &hand->spring[i];
    const gv_pose sim_pose = gv_engine_limb_pose(e, i);
    const gv_vec3 stretch = gv_sub(hand->driver[i].T.p, sim_pose.p);
    const gv_vec3 turn = gv_quat_log(gv_quat_mul(hand->driver[i].T.q, gv_quat_conj(sim_pose.q)));
    gv_vec3 v, w;
    gv_engine_limb_velocity(e, i, &v, &w);
    energy += 0.5 * s->k_f * gv_dot(stretch, stretch) + 0.5 * s->k_small * gv_dot(turn, turn);
    energy += 0.5 * s->mass_kg * gv_dot(v, v) + 0.5 * hand->limb_inertia[i] * gv_dot(w, w);
  }
  return energy;
}

static void watch_energy(const gv_engine *e, measures *m) {
  const double energy = mechanical_energy(e);
  if (m->held_steps == 0)
    m->energy_j = energy;
  m->energy_j = fmin(m->energy_j, energy);
  m->energy_up_j = fmax(m->energy_up_j, energy - m->energy_j);
}

static void watch_forces(measures *m) {
  for (int i = 0; i < GV_FINGERS; i++) {
    m->sum_n[i] += session.force_n[i];
    m->sum2_n2[i] += session.force_n[i] * session.force_n[i];
  }
}

static void watch_hold(const gv_engine *e, int object, double start_z, int second, measures *m) {
  const gv_pose T = object_in_palm(e, object);
  if (m->held_steps == 0) {
    m->held_at = T;
    m->grip = find_grip(e, object);
  }
  if (m->held_steps < second)
    m->grip_first = gv_mad(m->grip_first, 1.0 / second, gv_transform(T, m->grip));
  if (m->held_steps >= 8 * second)
    m->grip_last = gv_mad(m->grip_last, 1.0 / second, gv_transform(T, m->grip));
  const gv_vec3 turn = gv_quat_log(gv_quat_mul(T.q, gv_quat_conj(m->held_at.q)));
  m->way_m = fmax(m->way_m, gv_norm(gv_sub(T.p, m->held_at.p)));
  m->tilt_rad = fmax(m->tilt_rad, gv_norm(turn));
  m->lift_m = fmin(m->lift_m, gv_engine_object_pose(e, object).p.z - start_z);
  for (int i = 0; i < e->contact_count; i++)
    if (e->contact[i].limb >= 0)
      m->depth_m = fmax(m->depth_m, e->contact[i].depth_m);
  watch_energy(e, m);
  watch_forces(m);
  m->held_steps++;
}

static void run(const char *device, uint64_t seed, int object, FILE *series, measures *m) {
  gv_engine *e = start(device, seed);
  const double start_z = gv_engine_object_pose(e, object).p.z;
  const int64_t period_ns = (int64_t)(1e9 * settings.engine.step_s + 0.5);
  const int64_t held_to_ns = (int64_t)(1e9 * (script.end_s - 0.7));
  const int second = (int)(1.0 / settings.engine.step_s + 0.5);
  *m = (measures){.lift_m = 1e9};
  for (int64_t now_ns = 0; now_ns < held_to_ns; now_ns += period_ns) {
    step(now_ns);
    for (int i = 0; i < GV_FINGERS; i++)
      m->force_max_n = fmax(m->force_max_n, session.force_n[i]);
    if (series && now_ns % series_ns == 0)
      fprintf(series, "%.2f,%.4f\n", (double)now_ns * 1e-9, session.force_n[0]);
    if (now_ns >= held_to_ns - hold_ns)
      watch_hold(e, object, start_z, second, m);
  }
  for (int i = 0; i < GV_FINGERS; i++)
    m->given_j = fmax(m->given_j, -session.passivity.port[i].energy_least_j);
  gv_engine_close(e);
}

static double deviation(const measures *m, int finger) {
  const double mean = m->sum_n[finger] / m->held_steps;
  return sqrt(fmax(0.0, m->sum2_n2[finger] / m->held_steps - mean * mean));
}

static void print(uint64_t seed, const measures *m) {
  const double slip_m = gv_norm(gv_sub(m->grip_last, m->grip_first));
  const bool held = m->lift_m > lifted_m && slip_m < slid_m;
  double worst_n = 0.0;
  for (int i = 0; i < GV_FINGERS; i++)
    worst_n = fmax(worst_n, deviation(m, i));
  printf("%d,%d,%.4f,%.4f,%.4f,%.4f,%.3f,%.5f,%.5f,%.3f,%.3g,%.3f\n", (int)seed, held, slip_m * 1e3,
         m->way_m * 1e3, m->tilt_rad * deg, m->depth_m * 1e3, m->sum_n[0] / m->held_steps, deviation(m, 0),
         worst_n, m->force_max_n, m->energy_up_j, m->given_j);
}

int main(int argc, char **argv) {
  char err[512];
  gv_arena arena;
  if (argc < 8)
    fail("usage: report_grasp CONFIG SCRIPT SCENE OBJECT best|real|moving FIRST COUNT [SERIES]");
  gv_arena_init(&arena, scene_memory, sizeof scene_memory);
  if (gv_settings_load(argv[1], &settings, err, sizeof err) ||
      gv_sim_script_load(argv[2], &script, err, sizeof err) ||
      gv_scene_load(argv[3], &arena, &scene, err, sizeof err))
    fail(err);
  const int object = find_object(argv[4]);
  const int first = atoi(argv[6]);
  FILE *series = argc > 8 ? fopen(argv[8], "w") : NULL;
  if (argc > 8 && !series)
    fail(argv[8]);
  printf("seed,held,slip_mm,way_mm,tilt_deg,depth_mm,mean_n,std_n,worst_std_n,max_n,energy_up_j,given_j\n");
  for (int seed = first; seed < first + atoi(argv[7]); seed++) {
    measures m;
    run(argv[5], (uint64_t)seed, object, seed == first ? series : NULL, &m);
    print((uint64_t)seed, &m);
    fflush(stdout);
  }
  if (series)
    fclose(series);
  return 0;
}
