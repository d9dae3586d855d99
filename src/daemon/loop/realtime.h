// SPDX-License-Identifier: BSD-3-Clause
// What a thread needs to keep its deadlines on Linux. Where the machine refuses something, the rest is
// still done and the refusal is reported: a replay or a try-out needs none of it.
#ifndef GLOVED_PROCESS_REALTIME_H
#define GLOVED_PROCESS_REALTIME_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct gv_realtime_config {
  int priority;      // SCHED_FIFO 1..99; 0: the ordinary scheduler
  bool lock_memory;  // mlockall
  bool stay_awake;   // hold /dev/cpu_dma_latency at zero: no core sleeps deeply while the program runs
  int cpu;           // core to run on; or one of:
} gv_realtime_config;

enum {
  GV_CPU_LAST = -1,  // the last one allowed, where there are several
  GV_CPU_ANY = -2
};

typedef enum gv_refusal {  // bits
  GV_REFUSED_MEMORY = 1 << 0,
  GV_REFUSED_PRIORITY = 1 << 1,
  GV_REFUSED_CPU = 1 << 2,
  GV_REFUSED_AWAKE = 1 << 3
} gv_refusal;

// Bytes of stack that the loop's thread has (thread-local data lies in it, too), and how many of them it
// touches beforehand; a step uses below 96 kB.
enum { GV_REALTIME_STACK = 2 << 20, GV_REALTIME_STACK_TOUCHED = 1 << 19 };

// Whole process, before the loop's thread starts: touches all code and data that is mapped, locks memory, and
// keeps the processors awake until the process ends. Returns gv_refusal bits.
unsigned gv_realtime_prepare(const gv_realtime_config *cfg);
// In the loop's thread: stack, timer slack, core, priority. Returns gv_refusal bits.
unsigned gv_realtime_enter(const gv_realtime_config *cfg);
// The refusals in one line, with what to do about them.
void gv_realtime_refusal_text(unsigned refusals, char *out, size_t size);

// Page faults of the calling thread so far.
typedef struct gv_page_faults {
  int64_t major, minor;
} gv_page_faults;
gv_page_faults gv_realtime_page_faults(void);

#endif
