// SPDX-License-Identifier: BSD-3-Clause
// A recorded trace through session and engine, and what a user cares about while the object is held: slip and
// tilt against the palm, penetration, ripple of the coupling force, friction beyond Coulomb's law, and the
// forces that leave.
#ifndef TEST_REPLAY_REPLAY_H
#define TEST_REPLAY_REPLAY_H

#include "daemon/load/config_load.h"
#include "daemon/load/scene_load.h"
#include "daemon/loop/session.h"
#include "engine/engine_state.h"
#include "gloved/drivers.h"
#include "replay/expectation.h"
#include "support/bones.h"

enum { REPLAY_MEMORY = 48 << 20 };

typedef struct measures {
  int steps;
  uint64_t hash;
  double slip_m, tilt_rad, depth_m, ripple_n;  // while held
  double lift_m;                               // least height above the start while held
  long loaded, outside;                        // contacts with a force while held, and those beyond
                                               // Coulomb's cone
  double worst_friction;                       // friction / (mu x normal force) of those
  double apart_m;                              // between the ends of a finger's bones, any time
  double force_max_n, rise_max_n;              // of what left through the limiter, any time
  gv_counters counters;
  uint16_t chain[MAX_STEPS];
} measures;

typedef struct watch {  // what has to be remembered from step to step
  gv_pose held_at;      // object in the palm at the window's start
  gv_vec3 last_f[GV_LIMBS];
  double ripple2[GV_LIMBS], last_out_n[GV_FINGERS];
  int held_steps;
} watch;

typedef struct replay_run {
  gv_driver trace;
  gv_scene scene;
  gv_settings settings;
  gv_engine *engine;
  int object;
  double start_z;
} replay_run;

static inline int find_object(const gv_scene *scene, const char *name) {
  for (int i = 0; i < scene->object_count; i++)
    if (!strcmp(scene->object[i].name, name))
      return i;
  return -1;
}

static inline int replay_open(const expectation *x, variant v, replay_run *r) {
  static _Alignas(64) unsigned char scene_memory[REPLAY_MEMORY], engine_memory[REPLAY_MEMORY];
  char path[256], err[512];
  gv_arena arena;
  gv_settings_default(&r->settings);
  r->settings.engine = variant_config(v);
  gv_arena_init(&arena, scene_memory, sizeof scene_memory);
  snprintf(path, sizeof path, "data/traces/%s/input.log.gz", x->name);
  if (gv_scene_load(x->scene, &arena, &r->scene, err, sizeof err) ||
      gv_trace_open(path, &r->trace, err, sizeof err)) {
    printf("  %s\n", err);
    return -1;
  }
  r->object = find_object(&r->scene, x->object);
  r->engine = gv_engine_init(engine_memory, sizeof engine_memory, &r->settings.engine, &r->scene);
  if (!r->engine || r->object < 0) {
    printf("  %s: no object '%s', or the scene is too large\n", x->scene, x->object);
    return -1;
  }
  r->start_z = gv_engine_object_pose(r->engine, r->object).p.z;
  return 0;
}

// Coulomb's law, with a thousandth and a tenth of a millinewton to spare.
static inline void watch_friction(const gv_engine *e, measures *m) {
  for (int i = 0; i < e->contact_count; i++) {
    const gv_vec3 f = e->contact[i].force_world;
    if (e->solver_contact[i].friction == GV_FRICTION_FIXED_LIMIT || gv_norm(f) < 0.001)
      continue;
    const double normal = gv_dot(f, e->contact[i].normal_world);
    const double mu = e->solver_contact[i].mu;
    const double tangent = gv_norm(gv_mad(f, -normal, e->contact[i].normal_world));
    m->loaded++;
    if (tangent <= mu * normal * 1.001 + 1e-4)
      continue;
    m->outside++;
    m->worst_friction = fmax(m->worst_friction, tangent / fmax(mu * normal, 1e-4));
  }
}

static inline void watch_coupling(const gv_engine *e, bool held, watch *w) {
  for (int i = 0; i < GV_LIMBS; i++) {
    gv_vec3 f, torque;
    gv_engine_coupling(e, i, &f, &torque);
    if (held && w->held_steps)
      w->ripple2[i] += gv_norm2(gv_sub(f, w->last_f[i]));
    w->last_f[i] = f;
  }
}

static inline void watch_hold(const expectation *x, const replay_run *r, double t, watch *w, measures *m) {
  const gv_engine *e = r->engine;
  const bool held = t >= x->hold_from_s && t <= x->hold_to_s;
  const gv_pose T_world_object = gv_engine_object_pose(e, r->object);
  const gv_pose T_palm_object = gv_pose_mul(gv_pose_inv(gv_engine_limb_pose(e, GV_LIMB_PALM)),
                                            T_world_object);
  watch_coupling(e, held, w);
  if (!held)
    return;
  if (!w->held_steps) {
    w->held_at = T_palm_object;
    m->lift_m = 1e9;
  }
  watch_friction(e, m);
  for (int i = 0; i < e->contact_count; i++)
    m->depth_m = fmax(m->depth_m, e->contact[i].depth_m);
  m->slip_m = fmax(m->slip_m, gv_norm(gv_sub(T_palm_object.p, w->held_at.p)));
  m->tilt_rad = fmax(m->tilt_rad,
                     gv_norm(gv_quat_log(gv_quat_mul(T_palm_object.q, gv_quat_conj(w->held_at.q)))));
  m->lift_m = fmin(m->lift_m, T_world_object.p.z - r->start_z);
  w->held_steps++;
}

static inline void watch_forces(const gv_session *session, watch *w, measures *m) {
  for (int i = 0; i < GV_FINGERS; i++) {
    m->force_max_n = fmax(m->force_max_n, session->force_n[i]);
    m->rise_max_n = fmax(m->rise_max_n, session->force_n[i] - w->last_out_n[i]);
    w->last_out_n[i] = session->force_n[i];
  }
}

// Runs one trace. every_step: fill the chain. Returns 0, or negative with a message printed.
static inline int replay(const expectation *x, variant v, bool every_step, measures *m) {
  static gv_session session;
  static gv_frame frame[256];
  const int64_t period_ns = 1000000;
  replay_run r;
  watch w = {0};
  uint64_t chain = 14695981039346656037ULL;
  memset(m, 0, sizeof *m);
  if (replay_open(x, v, &r))
    return -1;
  const gv_session_config cfg = {.limiter = r.settings.limiter,
                                 .safety = r.settings.safety,
                                 .side = r.settings.engine.hand.side,
                                 .period_s = r.settings.engine.step_s};
  gv_session_init(&session, &cfg, r.engine);
  for (int step = 0; step < MAX_STEPS && !r.trace.ended(r.trace.self); step++) {
    gv_frame command;
    int count = r.trace.poll(r.trace.self, step * period_ns, frame, 256);
    gv_session_step(&session, step * period_ns, frame, count, 0, &command);
    watch_forces(&session, &w, m);
    m->apart_m = fmax(m->apart_m, bones_apart(r.engine));
    watch_hold(x, &r, step * 1e-3, &w, m);
    if (every_step)
      m->chain[step] = (uint16_t)(chain = (chain ^ gv_engine_hash(r.engine)) * 1099511628211ULL);
    m->steps = step + 1;
  }
  for (int i = 0; i < GV_LIMBS; i++)
    m->ripple_n = fmax(m->ripple_n, sqrt(w.ripple2[i] / fmax(1, w.held_steps - 1)));
  m->hash = gv_engine_hash(r.engine);
  m->counters = *gv_engine_counters(r.engine);
  r.trace.close(r.trace.self);
  gv_engine_close(r.engine);
  return 0;
}

#endif
