// SPDX-License-Identifier: BSD-3-Clause
// The arena: a bump pointer over the caller's buffer with a table of named blocks. Set-up only.
#include "gloved/arena.h"

#include <assert.h>
#include <string.h>

void gv_arena_init(gv_arena *arena, void *mem, size_t size) {
  memset(arena, 0, sizeof *arena);
  arena->base = mem;
  arena->size = size;
}

_Static_assert((GV_ARENA_ALIGN & (GV_ARENA_ALIGN - 1)) == 0, "an alignment is a power of two");

static size_t aligned_offset(const gv_arena *arena) {
  uintptr_t at = (uintptr_t)arena->base + arena->used;
  uintptr_t up = (at + GV_ARENA_ALIGN - 1) & ~(uintptr_t)(GV_ARENA_ALIGN - 1);
  return up - (uintptr_t)arena->base;
}

void *gv_arena_alloc(gv_arena *arena, const char *name, size_t size) {
  assert(arena->base == NULL || arena->used <= arena->size);
  assert(arena->block_count >= 0 && arena->block_count <= GV_ARENA_BLOCKS);
  // In a dry run `used` also plays the part of `peak`, plus one alignment for a crooked buffer.
  size_t offset = aligned_offset(arena);
  size_t end = offset + size;
  if (end < offset)
    return NULL;
  size_t need = end + GV_ARENA_ALIGN;
  if (need > arena->peak)
    arena->peak = need;
  if (arena->base && end > arena->size)
    return NULL;
  arena->used = end;
  if (arena->block_count < GV_ARENA_BLOCKS)
    arena->blocks[arena->block_count++] = (gv_arena_block){name, offset, size};
  if (!arena->base)
    return NULL;
  memset(arena->base + offset, 0, size);
  return arena->base + offset;
}
