// SPDX-License-Identifier: BSD-3-Clause
// Counts heap calls of the real-time thread. Linking this module replaces malloc and its family in the
// whole process, shared libraries included (heap.c); nothing else changes for threads that do not watch.
#ifndef GLOVED_PROCESS_HEAP_H
#define GLOVED_PROCESS_HEAP_H

#include <stdbool.h>
#include <stdint.h>

// 0 under an address or thread sanitizer: they bring allocators of their own, and nothing is counted.
#define GV_HEAP_COUNTS 1
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#undef GV_HEAP_COUNTS
#define GV_HEAP_COUNTS 0
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#undef GV_HEAP_COUNTS
#define GV_HEAP_COUNTS 0
#endif
#endif

// From now on (on) heap calls of the calling thread count; off ends it. Cost: one store.
void gv_heap_watch(bool on);
// Heap calls (malloc, calloc, realloc, free of a block, aligned variants) of the calling thread while
// it watched. Never goes back.
uint64_t gv_heap_calls(void);

#endif
