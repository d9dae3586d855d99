// SPDX-License-Identifier: BSD-3-Clause
// The list of calls as a classic BPF program over struct seccomp_data (linux/seccomp.h): processor, number of
// the call, for read and write the descriptor.
#include "daemon/loop/strict.h"

#include <assert.h>
#include <errno.h>
#include <linux/audit.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <stddef.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "gloved/frame.h"

#if defined(__x86_64__)
#define PROCESSOR AUDIT_ARCH_X86_64
#define CALL_ALARM __NR_alarm
#elif defined(__aarch64__)
#define PROCESSOR AUDIT_ARCH_AARCH64
#define CALL_ALARM __NR_setitimer
#endif

#ifdef PROCESSOR

enum { PROGRAM_MAX = 48, LAST_STANDARD_DESCRIPTOR = 2 };

typedef struct program {
  struct sock_filter line[PROGRAM_MAX];
  unsigned short lines;
} program;

static void put(program *p, struct sock_filter line) {
  assert(p->lines < PROGRAM_MAX);
  p->line[p->lines++] = line;
}

static void load(program *p, size_t offset) {
  put(p, (struct sock_filter)BPF_STMT(BPF_LD | BPF_W | BPF_ABS, (unsigned)offset));
}

// Goes on with the next line where the loaded word is so; otherwise leaves out `skipped` lines.
static void go_on_if(program *p, unsigned short comparison, unsigned value, unsigned char skipped) {
  put(p, (struct sock_filter)BPF_JUMP((unsigned short)(BPF_JMP | comparison | BPF_K), value, 0, skipped));
}

static void answer(program *p, unsigned verdict) {
  put(p, (struct sock_filter)BPF_STMT(BPF_RET | BPF_K, verdict));
}

static void allow(program *p, unsigned call) {
  go_on_if(p, BPF_JEQ, call, 1);
  answer(p, SECCOMP_RET_ALLOW);
}

// Both processors are little-endian: the low word of the argument, which is the descriptor, comes first.
static void allow_on_a_line(program *p, unsigned call) {
  go_on_if(p, BPF_JEQ, call, 4);
  load(p, offsetof(struct seccomp_data, args[0]));
  go_on_if(p, BPF_JGT, LAST_STANDARD_DESCRIPTOR, 1);
  answer(p, SECCOMP_RET_ALLOW);
  answer(p, SECCOMP_RET_KILL_PROCESS);
}

static void write_program(program *p, unsigned driver_calls) {
  static const unsigned always[] = {__NR_clock_nanosleep, __NR_ppoll, __NR_clock_gettime,
                                    __NR_getrusage,       CALL_ALARM, __NR_rt_sigprocmask,
                                    __NR_madvise,         __NR_exit};
  load(p, offsetof(struct seccomp_data, arch));
  go_on_if(p, BPF_JEQ, PROCESSOR, 1);
  // On another processor the loaded word stays its name, which is no call's number.
  load(p, offsetof(struct seccomp_data, nr));
  for (size_t i = 0; i < sizeof always / sizeof *always; i++)
    allow(p, always[i]);
  if (driver_calls & GV_CALLS_SOCKET) {
    allow(p, __NR_recvmmsg);
    allow(p, __NR_sendto);
  }
  if (driver_calls & GV_CALLS_LINE) {
    allow_on_a_line(p, __NR_read);
    allow_on_a_line(p, __NR_write);
  }
  answer(p, SECCOMP_RET_KILL_PROCESS);
}

int gv_strict_enter(unsigned driver_calls) {
  program p = {.lines = 0};
  write_program(&p, driver_calls);
  const struct sock_fprog whole = {p.lines, p.line};
  if (prctl(PR_SET_NO_NEW_PRIVS, 1UL, 0UL, 0UL, 0UL) != 0)
    return errno;
  // Without SECCOMP_FILTER_FLAG_TSYNC it is of this thread alone.
  return syscall(SYS_seccomp, SECCOMP_SET_MODE_FILTER, 0U, &whole) == 0 ? 0 : errno;
}

#else

int gv_strict_enter(unsigned driver_calls) {
  (void)driver_calls;
  return ENOSYS;
}

#endif
