// SPDX-License-Identifier: BSD-3-Clause
// Ring of plain fixed-size records from one thread to one other, without locks: the real-time thread
// writes in place and never waits; where the reader is behind, the record is dropped and counted.
// Writer: p = reserve, fill *p, commit. Reader: p = peek, use *p, release.
#ifndef GLOVED_PROCESS_RING_H
#define GLOVED_PROCESS_RING_H

#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>

typedef struct gv_ring {
  uint8_t *slot;  // [slot_count][slot_size], the caller's memory
  size_t slot_size;
  uint32_t slot_count;  // a power of two
  // Writer and reader on cache lines of their own. Both counters only grow and may wrap.
  _Alignas(64) _Atomic uint32_t written;
  _Atomic uint64_t dropped;
  _Alignas(64) _Atomic uint32_t read;
} gv_ring;

// slot_count: a power of two. Before both threads start.
void gv_ring_init(gv_ring *ring, void *slots, size_t slot_size, uint32_t slot_count);

// Writer: the next free record, or null when full (counted as dropped). Stays the writer's until commit.
void *gv_ring_reserve(gv_ring *ring);
void gv_ring_commit(gv_ring *ring);
// Writer: records that can be reserved now (more may become free at any time).
uint32_t gv_ring_space(const gv_ring *ring);

// Reader: the oldest record, or null when empty. Stays valid until release.
const void *gv_ring_peek(const gv_ring *ring);
void gv_ring_release(gv_ring *ring);

// Any thread: records dropped so far.
uint64_t gv_ring_dropped(const gv_ring *ring);

#endif
