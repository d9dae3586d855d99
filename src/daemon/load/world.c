// SPDX-License-Identifier: BSD-3-Clause
// Loads a scene and starts its engine in one block of memory, from the file of --scene or of a command. Main
// thread: at the start, and beside the running loop (gv_world_load alone) when another scene is asked for.
#include "daemon/load/world.h"

#include <stdio.h>
#include <sys/mman.h>
#include <unistd.h>

// Address space for scene and engine: the largest scene allowed takes 32 MB, its engine less than that
// again. What the scene at hand does not need is given back.
static const size_t reserved_size = (size_t)256 << 20;

// Address space for `size` bytes of zeroed memory; null where there is none. A page costs memory
// once it is written. Under mlockall(MCL_FUTURE) a mapping that can be written would at once take
// all of its memory: it becomes so only when it is not locked any more. What is kept of it is
// locked by the next gv_realtime_prepare.
static void *reserve(size_t size) {
  void *memory = mmap(NULL, size, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
  if (memory == MAP_FAILED)
    return NULL;
  if (munlock(memory, size) == 0 && mprotect(memory, size, PROT_READ | PROT_WRITE) == 0)
    return memory;
  munmap(memory, size);
  return NULL;
}

// Gives back what lies beyond `used` bytes; returns how many are left.
static size_t trim(void *memory, size_t size, size_t used) {
  const size_t page = (size_t)sysconf(_SC_PAGESIZE);
  const size_t kept = (used + page - 1) / page * page;
  if (kept >= size)
    return size;
  munmap((uint8_t *)memory + kept, size - kept);
  return kept;
}

static int fill(gv_world *world, const char *scene, const char *text, const gv_config *cfg, char *err,
                size_t err_size) {
  if (text ? gv_scene_load_text(scene, text, &world->arena, &world->scene, err, err_size)
           : gv_scene_load(scene, &world->arena, &world->scene, err, err_size))
    return -1;
  world->block_size = gv_engine_size(cfg, &world->scene);
  world->block = gv_arena_alloc(&world->arena, "engine", world->block_size);
  if (world->block)
    return 0;
  snprintf(err, err_size, "%s: the engine does not start with %zu bytes; use a smaller scene", scene,
           world->block_size);
  return -1;
}

int gv_world_load(gv_world *world, const char *scene, const char *text, const gv_config *cfg, char *err,
                  size_t err_size) {
  *world = (gv_world){.memory = reserve(reserved_size), .memory_size = reserved_size};
  if (!world->memory) {
    snprintf(err, err_size, "no memory for scene and engine; close other programs");
    return -1;
  }
  gv_arena_init(&world->arena, world->memory, reserved_size);
  if (fill(world, scene, text, cfg, err, err_size)) {
    gv_world_close(world);
    return -1;
  }
  world->memory_size = trim(world->memory, reserved_size, world->arena.used);
  world->arena.size = world->arena.used;
  return 0;
}

int gv_world_start(gv_world *world, const gv_config *cfg) {
  world->engine = gv_engine_init(world->block, world->block_size, cfg, &world->scene);
  return world->engine ? 0 : -1;
}

void gv_world_close(gv_world *world) {
  gv_engine_close(world->engine);
  if (world->memory)
    trim(world->memory, world->memory_size, 0);
  *world = (gv_world){0};
}
