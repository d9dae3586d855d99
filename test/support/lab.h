// SPDX-License-Identifier: BSD-3-Clause
// A small laboratory for tests: scenes of boxes made in memory, an engine on a static buffer, hand samples
// from angles.
#ifndef LAB_H
#define LAB_H

#include <string.h>

#include "gloved/engine.h"

enum { LAB_BYTES = 24 << 20 };

typedef struct lab {
  gv_object object[GV_MAX_OBJECTS];
  gv_hull piece[GV_MAX_OBJECTS];
  gv_scene scene;
  gv_arena arena;
  gv_engine *engine;
  gv_config cfg;
} lab;

static _Alignas(64) unsigned char lab_scene_memory[LAB_BYTES], lab_engine_memory[LAB_BYTES];

static inline void lab_start(lab *l) {
  memset(l, 0, sizeof *l);
  gv_arena_init(&l->arena, lab_scene_memory, sizeof lab_scene_memory);
  l->scene = (gv_scene){.gravity_m_s2 = {0, 0, -9.81}, .object = l->object, .piece = l->piece};
  l->cfg = gv_config_default();
}

// A box of full sizes `size` with its middle at `at`; mass 0: static. Returns the object's index.
static inline int lab_box(lab *l, gv_vec3 size, gv_vec3 at, double mass, double mu) {
  int i = l->scene.object_count;
  gv_vec3 corner[8];
  for (int c = 0; c < 8; c++)
    corner[c] = gv_v3((c & 1 ? 0.5 : -0.5) * size.x, (c & 2 ? 0.5 : -0.5) * size.y,
                      (c & 4 ? 0.5 : -0.5) * size.z);
  if (gv_hull_build(&l->arena, corner, 8, &l->piece[i]))
    abort();
  double xx = size.x * size.x;
  double yy = size.y * size.y;
  double zz = size.z * size.z;
  l->object[i] = (gv_object){.name = "box",
                             .is_static = mass <= 0,
                             .T_world_body = {{1, 0, 0, 0}, at},
                             .mass_kg = mass,
                             .inertia_kg_m2 = {{{mass * (yy + zz) / 12, 0, 0},
                                                {0, mass * (xx + zz) / 12, 0},
                                                {0, 0, mass * (xx + yy) / 12}}},
                             .mu = mu,
                             .piece_first = i,
                             .piece_count = 1};
  l->scene.object_count = l->scene.piece_count = i + 1;
  return i;
}

static inline void lab_run(lab *l) {
  l->engine = gv_engine_init(lab_engine_memory, sizeof lab_engine_memory, &l->cfg, &l->scene);
  if (!l->engine)
    abort();
}

static inline gv_sample lab_hand(const lab *l, const double angle_rad[GV_SENSORS], gv_pose wrist) {
  gv_sample s = {.T_world_receiver = wrist, .glove_new = true, .pose_new = true};
  for (int i = 0; i < GV_SENSORS; i++)
    s.raw[i] = gv_calibration_raw(&l->cfg.calibration, i, angle_rad[i]);
  return s;
}

static inline void lab_steps(lab *l, int count, const gv_sample *sample) {
  static const gv_sample nothing;
  gv_step_result r;
  for (int i = 0; i < count; i++)
    gv_engine_step(l->engine, sample ? sample : &nothing, &r);
}

#endif
