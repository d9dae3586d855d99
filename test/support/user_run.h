// SPDX-License-Identifier: BSD-3-Clause
// A script of the simulated user through session and engine, in virtual time: no clock, no descriptor.
//
//   user_load(&run, scene, script)   settings are the defaults; change them, the scene or the script
//   user_start(&run)
//   user_step(&run)                  a millisecond
//   user_finish(&run)
#ifndef TEST_SUPPORT_USER_RUN_H
#define TEST_SUPPORT_USER_RUN_H

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "daemon/load/config_load.h"
#include "daemon/load/scene_load.h"
#include "daemon/loop/session.h"
#include "gloved/sim.h"

enum { USER_MEMORY = 48 << 20 };

typedef struct user_run {
  gv_settings settings;
  gv_scene scene;
  gv_sim_script script;
  gv_sim sim;
  gv_session session;
  gv_engine *engine;
  int time_ms;
} user_run;

// False with a message printed. A scene whose text begins with "version" is taken as it is.
static inline bool user_load(user_run *r, const char *scene, const char *script) {
  static _Alignas(64) unsigned char memory[USER_MEMORY];
  char err[512] = "";
  gv_arena arena;
  gv_settings_default(&r->settings);
  gv_arena_init(&arena, memory, sizeof memory);
  const bool is_text = strncmp(scene, "version", 7) == 0;
  const int loaded = is_text ? gv_scene_load_text("text", scene, &arena, &r->scene, err, sizeof err)
                             : gv_scene_load(scene, &arena, &r->scene, err, sizeof err);
  const bool good = loaded == 0 && gv_sim_script_load(script, &r->script, err, sizeof err) == 0;
  if (!good)
    fprintf(stderr, "# %s\n", err);
  return good;
}

static inline void user_start(user_run *r) {
  static _Alignas(64) unsigned char memory[USER_MEMORY];
  r->engine = gv_engine_init(memory, sizeof memory, &r->settings.engine, &r->scene);
  if (!r->engine)
    abort();
  const gv_session_config cfg = {.limiter = r->settings.limiter,
                                 .safety = r->settings.safety,
                                 .side = r->settings.engine.hand.side,
                                 .period_s = r->settings.engine.step_s};
  gv_session_init(&r->session, &cfg, r->engine);
  gv_sim_init(&r->sim, &r->script, NULL, 1);
  gv_sim_start(&r->sim);
  r->time_ms = 0;
}

static inline void user_step(user_run *r) {
  static gv_frame frame[256];
  gv_frame command;
  const int64_t now = r->time_ms++ * 1000000LL;
  const int count = gv_sim_advance(&r->sim, now, frame, 256);
  gv_session_step(&r->session, now, frame, count, 0, &command);
  gv_sim_receive(&r->sim, &command);
}

static inline void user_finish(user_run *r) { gv_engine_close(r->engine); }

// The force that the couplings put on all limbs: what the person carries, N.
static inline gv_vec3 user_carries(const user_run *r) {
  gv_vec3 sum = gv_v3(0, 0, 0);
  for (int i = 0; i < GV_LIMBS; i++) {
    gv_vec3 f, t;
    gv_engine_coupling(r->engine, i, &f, &t);
    sum = gv_add(sum, f);
  }
  return sum;
}

#endif
