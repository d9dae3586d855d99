// SPDX-License-Identifier: BSD-3-Clause
// A scene with its engine in memory of their own. Two worlds may be loaded at a time, one engine may live.
#ifndef GLOVED_PROCESS_WORLD_H
#define GLOVED_PROCESS_WORLD_H

#include <stddef.h>

#include "daemon/load/config_load.h"
#include "gloved/engine.h"
#include "daemon/load/scene_load.h"

typedef struct gv_world {
  void *memory;        // null: no world
  size_t memory_size;  // bytes mapped at `memory`
  gv_arena arena;      // in `memory`: the scene, then the engine
  gv_scene scene;
  void *block;  // the engine's memory
  size_t block_size;
  gv_engine *engine;  // null: not started
} gv_world;

// Scene and room for its engine; another engine may be running. 0, or negative with one line in err and no
// world. Reads files and takes memory: main thread.
// text: the scene itself, where its file is not to be read; else null.
int gv_world_load(gv_world *world, const char *scene, const char *text, const gv_config *cfg, char *err,
                  size_t err_size);
// The engine, where no other one lives; the world must not move any more (the engine
// points into it). 0, or negative.
int gv_world_start(gv_world *world, const gv_config *cfg);
// Ends the engine and gives the memory back. Nothing where there is no world.
void gv_world_close(gv_world *world);

#endif
