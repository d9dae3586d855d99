// SPDX-License-Identifier: BSD-3-Clause
// Counts heap calls of the real-time thread. Linking this module replaces malloc and its family in the
// whole process, shared libraries included (heap.c); nothing else changes for threads that do not watch.
#ifndef GLOVED_PROCESS_HEAP_H
#define GLOVED_PROCESS_HEAP_H

#include <stdbool.h>
#include <stdint.h>

// From now on (on) heap calls of the calling thread count; off ends it. Cost: one store.
void gv_heap_watch(bool on);
// Heap calls (malloc, calloc, realloc, free of a block, aligned variants) of the calling thread while
// it watched. Never goes back. Always 0 under an address or thread sanitizer.
uint64_t gv_heap_calls(void);

#endif
