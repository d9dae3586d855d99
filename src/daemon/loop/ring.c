// SPDX-License-Identifier: BSD-3-Clause
// Single-producer single-consumer ring (Lamport's queue on C11 atomics): each side stores only its own
// counter, with release, and loads the other's with acquire, so that a record is complete before the reader
// sees it and free before the writer fills it again. Writer: the real-time thread. Reader: the slow thread.
#include "daemon/loop/ring.h"

#include <assert.h>

void gv_ring_init(gv_ring *ring, void *slots, size_t slot_size, uint32_t slot_count) {
  assert(slots && slot_size > 0);
  assert(slot_count > 0 && (slot_count & (slot_count - 1)) == 0);
  ring->slot = slots;
  ring->slot_size = slot_size;
  ring->slot_count = slot_count;
  atomic_init(&ring->written, 0);
  atomic_init(&ring->dropped, 0);
  atomic_init(&ring->read, 0);
}

static void *slot_at(const gv_ring *ring, uint32_t number) {
  return ring->slot + (number & (ring->slot_count - 1)) * ring->slot_size;
}

uint32_t gv_ring_space(const gv_ring *ring) {
  uint32_t written = atomic_load_explicit(&ring->written, memory_order_relaxed);
  return ring->slot_count - (written - atomic_load_explicit(&ring->read, memory_order_acquire));
}

void *gv_ring_reserve(gv_ring *ring) {
  if (gv_ring_space(ring) > 0)
    return slot_at(ring, atomic_load_explicit(&ring->written, memory_order_relaxed));
  uint64_t dropped = atomic_load_explicit(&ring->dropped, memory_order_relaxed);
  atomic_store_explicit(&ring->dropped, dropped + 1, memory_order_relaxed);
  return NULL;
}

void gv_ring_commit(gv_ring *ring) {
  assert(gv_ring_space(ring) > 0);
  uint32_t written = atomic_load_explicit(&ring->written, memory_order_relaxed);
  atomic_store_explicit(&ring->written, written + 1, memory_order_release);
}

const void *gv_ring_peek(const gv_ring *ring) {
  uint32_t read = atomic_load_explicit(&ring->read, memory_order_relaxed);
  if (read == atomic_load_explicit(&ring->written, memory_order_acquire))
    return NULL;
  return slot_at(ring, read);
}

void gv_ring_release(gv_ring *ring) {
  uint32_t read = atomic_load_explicit(&ring->read, memory_order_relaxed);
  atomic_store_explicit(&ring->read, read + 1, memory_order_release);
}

uint64_t gv_ring_dropped(const gv_ring *ring) {
  return atomic_load_explicit(&ring->dropped, memory_order_relaxed);
}
