// SPDX-License-Identifier: BSD-3-Clause
// The interposed allocator: malloc and its family, forwarded to glibc's own (__libc_malloc and so on)
// and counted where the calling thread asked for it. The executable's definitions win over libc's for
// every shared library too, so that a malloc inside ODE, libccd or LCM is caught
// (glibc manual, "Replacing malloc"). Runs in every thread; one thread-local test per call.
#include "daemon/loop/heap.h"

#include <errno.h>
#include <stddef.h>

void *__libc_malloc(size_t size);
void *__libc_calloc(size_t count, size_t size);
void *__libc_realloc(void *block, size_t size);
void *__libc_memalign(size_t alignment, size_t size);
void *__libc_valloc(size_t size);
void *__libc_pvalloc(size_t size);
void __libc_free(void *block);

// <stdlib.h> and <malloc.h> stay out: their attributes contradict definitions of our own.
void *malloc(size_t size);
void *calloc(size_t count, size_t size);
void *realloc(void *block, size_t size);
void *memalign(size_t alignment, size_t size);
void *aligned_alloc(size_t alignment, size_t size);
int posix_memalign(void **out_block, size_t alignment, size_t size);
void *valloc(size_t size);
void *pvalloc(size_t size);
void free(void *block);

static _Thread_local bool watching;
static _Thread_local uint64_t calls;

void gv_heap_watch(bool on) { watching = on; }
uint64_t gv_heap_calls(void) { return calls; }

#if GV_HEAP_COUNTS

static void count_call(void) {
  if (watching)
    calls++;
}

void *malloc(size_t size) {
  count_call();
  return __libc_malloc(size);
}

void *calloc(size_t count, size_t size) {
  count_call();
  return __libc_calloc(count, size);
}

void *realloc(void *block, size_t size) {
  count_call();
  return __libc_realloc(block, size);
}

void *memalign(size_t alignment, size_t size) {
  count_call();
  return __libc_memalign(alignment, size);
}

void *aligned_alloc(size_t alignment, size_t size) {
  count_call();
  return __libc_memalign(alignment, size);
}

int posix_memalign(void **out_block, size_t alignment, size_t size) {
  count_call();
  if (alignment % sizeof(void *) != 0 || alignment == 0 || (alignment & (alignment - 1)) != 0)
    return EINVAL;
  void *block = __libc_memalign(alignment, size);
  if (!block)
    return ENOMEM;
  *out_block = block;
  return 0;
}

void *valloc(size_t size) {
  count_call();
  return __libc_valloc(size);
}

void *pvalloc(size_t size) {
  count_call();
  return __libc_pvalloc(size);
}

void free(void *block) {
  if (block)
    count_call();
  __libc_free(block);
}

#endif
