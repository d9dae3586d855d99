// SPDX-License-Identifier: BSD-3-Clause
// One arena from the caller's buffer: blocks are named, 64-byte aligned, zeroed, handed out in order
// and never given back. Not thread-safe: only set-up allocates.
#ifndef GLOVED_ARENA_H
#define GLOVED_ARENA_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum { GV_ARENA_BLOCKS = 32, GV_ARENA_ALIGN = 64 };

typedef struct gv_arena_block {
  const char *name;  // static string
  size_t offset;     // bytes from the arena's start
  size_t size;       // bytes asked for
} gv_arena_block;

typedef struct gv_arena {
  uint8_t *base;  // null in a dry run: sizes are counted, nothing is handed out
  size_t size;    // bytes in the buffer
  size_t used;    // bytes handed out, alignment included
  size_t peak;    // largest `used` so far, counting what did not fit: what a big enough buffer needs
  int block_count;
  gv_arena_block blocks[GV_ARENA_BLOCKS];
} gv_arena;

// Start on `size` bytes at `mem` (any alignment; the first block may skip up to 63 bytes).
// mem null: a dry run that only measures.
void gv_arena_init(gv_arena *arena, void *mem, size_t size);
// A zeroed block, or null where it does not fit (and always in a dry run). Cost: the zeroing.
void *gv_arena_alloc(gv_arena *arena, const char *name, size_t size);

#ifdef __cplusplus
}
#endif

#endif
