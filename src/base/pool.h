// SPDX-License-Identifier: BSD-3-Clause
// A small allocator over one fixed block, for a library that wants alloc and free: a bump pointer with
// free lists by size class. Constant time; not thread-safe.
#ifndef POOL_H
#define POOL_H

#include <assert.h>
#include <stddef.h>
#include <stdint.h>

enum { POOL_CLASSES = 64, POOL_UNIT = 32 };  // classes of 32 B up to 2 kB; larger blocks are never reused
_Static_assert(POOL_UNIT >= sizeof(void *), "a free block holds the link to the next");

typedef struct pool {
  uint8_t *base;
  size_t size, used;
  void *free_list[POOL_CLASSES];
  unsigned failed;  // requests that did not fit
} pool;

static inline void pool_init(pool *p, void *base, size_t size) { *p = (pool){.base = base, .size = size}; }

static inline void *pool_alloc(pool *p, size_t size) {
  assert(p->used <= p->size);
  size_t units = (size + POOL_UNIT - 1) / POOL_UNIT;
  if (units < POOL_CLASSES && p->free_list[units]) {
    void **head = p->free_list[units];
    p->free_list[units] = *head;
    return head;
  }
  if (units * POOL_UNIT > p->size - p->used) {
    p->failed++;
    return NULL;
  }
  void *at = p->base + p->used;
  p->used += units * POOL_UNIT;
  return at;
}

static inline void pool_free(pool *p, void *at, size_t size) {
  assert(!at || ((uint8_t *)at >= p->base && (uint8_t *)at + size <= p->base + p->size));
  size_t units = (size + POOL_UNIT - 1) / POOL_UNIT;
  if (!at || units == 0 || units >= POOL_CLASSES)
    return;
  *(void **)at = p->free_list[units];
  p->free_list[units] = at;
}

#endif
