// SPDX-License-Identifier: BSD-3-Clause
// Linux set-up for a thread with deadlines, each call with its reason; see sched(7), mlockall(2),
// prctl(2), madvise(2). Set-up only, apart from the page fault counters.
#include "daemon/loop/realtime.h"

#include <errno.h>
#include <fcntl.h>
#include <link.h>
#include <pthread.h>
#include <sched.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <unistd.h>

#ifndef MADV_POPULATE_READ  // Linux 5.14; glibc 2.36 has no name for them
#define MADV_POPULATE_READ 22
#define MADV_POPULATE_WRITE 23
#endif

// The end of the part that the dynamic linker made read-only after relocating (it touched those pages).
static uintptr_t relocated_end(const struct dl_phdr_info *info) {
  for (int i = 0; i < info->dlpi_phnum; i++) {
    const ElfW(Phdr) *segment = &info->dlpi_phdr[i];
    if (segment->p_type == PT_GNU_RELRO)
      return info->dlpi_addr + segment->p_vaddr + segment->p_memsz;
  }
  return 0;
}

// Maps every page of one loaded object: code that runs for the first time in the middle of a grasp must
// not wait for the disk. An older kernel refuses; mlockall does the same where it is allowed.
static int populate_object(struct dl_phdr_info *info, size_t size, void *data) {
  (void)size;
  (void)data;
  const uintptr_t page = (uintptr_t)sysconf(_SC_PAGESIZE);
  const uintptr_t relocated = relocated_end(info);
  for (int i = 0; i < info->dlpi_phnum; i++) {
    const ElfW(Phdr) *segment = &info->dlpi_phdr[i];
    if (segment->p_type != PT_LOAD)
      continue;
    const bool writable = (segment->p_flags & PF_W) != 0;
    uintptr_t start = info->dlpi_addr + segment->p_vaddr;
    uintptr_t end = start + segment->p_memsz;
    if (writable && relocated > start && relocated < end)
      start = relocated;
    start &= ~(page - 1);
    madvise((void *)start, end - start, writable ? MADV_POPULATE_WRITE : MADV_POPULATE_READ);
  }
  return 0;
}

// The kernel keeps the promise "wake within 0 us" for as long as the file is open (its
// Documentation/power/pm_qos_interface.rst).
// One that has no such file has no sleep states to keep out of.
static bool hold_awake(void) {
  static int held = -1;
  const int32_t within_us = 0;
  if (held >= 0)
    return true;
  held = open("/dev/cpu_dma_latency", O_WRONLY | O_CLOEXEC);
  if (held < 0)
    return errno == ENOENT;
  if (write(held, &within_us, sizeof within_us) == (ssize_t)sizeof within_us)
    return true;
  close(held);
  held = -1;
  return false;
}

unsigned gv_realtime_prepare(const gv_realtime_config *cfg) {
  unsigned refusals = 0;
  dl_iterate_phdr(populate_object, NULL);
  if (cfg->stay_awake && !hold_awake())
    refusals |= GV_REFUSED_AWAKE;
  // No page of ours is ever written out to swap.
  if (cfg->lock_memory && mlockall(MCL_CURRENT | MCL_FUTURE) != 0)
    refusals |= GV_REFUSED_MEMORY;
  return refusals;
}

// Touches the stack once, so that the loop never meets a page of it that is not there yet.
static void touch_stack(void) {
  volatile uint8_t stack[GV_REALTIME_STACK_TOUCHED];
  for (size_t i = 0; i < sizeof stack; i += 1024)
    stack[i] = 0;
}

static bool pin(int cpu) {
  cpu_set_t allowed, one;
  if (pthread_getaffinity_np(pthread_self(), sizeof allowed, &allowed) != 0)
    return false;
  // The kernel puts interrupts and housekeeping onto the first core by preference: take the last one.
  if (cpu == GV_CPU_ANY || (cpu < 0 && CPU_COUNT(&allowed) < 2))
    return true;
  size_t core = cpu < 0 ? CPU_SETSIZE - 1 : (size_t)cpu;
  while (cpu < 0 && core > 0 && !CPU_ISSET(core, &allowed))
    core--;
  if (core >= CPU_SETSIZE)
    return false;
  CPU_ZERO(&one);
  CPU_SET(core, &one);
  return pthread_setaffinity_np(pthread_self(), sizeof one, &one) == 0;
}

unsigned gv_realtime_enter(const gv_realtime_config *cfg) {
  unsigned refusals = 0;
  touch_stack();
  // Without it an ordinary thread's sleeps end up to 50 us late so that the kernel can bundle wake-ups.
  prctl(PR_SET_TIMERSLACK, 1UL, 0UL, 0UL, 0UL);
  if (!pin(cfg->cpu))
    refusals |= GV_REFUSED_CPU;
  const struct sched_param param = {.sched_priority = cfg->priority};
  if (cfg->priority > 0 && pthread_setschedparam(pthread_self(), SCHED_FIFO, &param) != 0)
    refusals |= GV_REFUSED_PRIORITY;
  return refusals;
}

void gv_realtime_refusal_text(unsigned refusals, char *out, size_t size) {
  snprintf(out, size, "this machine refuses%s%s%s%s; going on without (gloved --doctor says what to do)",
           refusals & GV_REFUSED_PRIORITY ? " SCHED_FIFO" : "",
           refusals & GV_REFUSED_MEMORY ? " mlockall" : "", refusals & GV_REFUSED_CPU ? " this CPU" : "",
           refusals & GV_REFUSED_AWAKE ? " /dev/cpu_dma_latency" : "");
}

gv_page_faults gv_realtime_page_faults(void) {
  struct rusage usage;
  memset(&usage, 0, sizeof usage);
  getrusage(RUSAGE_THREAD, &usage);
  return (gv_page_faults){usage.ru_majflt, usage.ru_minflt};
}
