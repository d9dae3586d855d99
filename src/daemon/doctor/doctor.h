// SPDX-License-Identifier: BSD-3-Clause
// gloved --doctor: what this machine does to deadlines, forces and messages, judged from /proc and /sys
// without changing anything, each finding with the command that mends it. doc/real-time.md says what each
// check means. Set-up only, main thread. Reads below a root of the caller's, so that a test can show it any
// machine.
#ifndef GLOVED_DAEMON_DOCTOR_H
#define GLOVED_DAEMON_DOCTOR_H

#include <stdio.h>

#include "daemon/load/config_load.h"

typedef enum gv_verdict { GV_VERDICT_PASS, GV_VERDICT_WARN, GV_VERDICT_FAIL } gv_verdict;

enum { GV_FINDING_TEXT = 200 };

typedef struct gv_finding {
  const char *check;  // its name, for people and for --json
  gv_verdict verdict;
  char found[GV_FINDING_TEXT];  // what it is on this machine
  char mend[GV_FINDING_TEXT];   // the command that mends it; empty with PASS
} gv_finding;

typedef struct gv_doctor {
  const char *root;             // in front of /proc, /sys and /dev; "" on a real machine
  const gv_settings *settings;  // which core, priority, CAN interface, LCM group and serial lines are meant
} gv_doctor;

typedef void gv_examine(const gv_doctor *doctor, gv_finding *out);

// How many checks there are, and number i of them.
int gv_doctor_checks(void);
gv_finding gv_doctor_check(const gv_doctor *doctor, int i);
// All of them, one a line or as one JSON object. Returns the worst verdict, which is the program's exit code.
gv_verdict gv_doctor_report(const gv_doctor *doctor, bool json, FILE *out);

// The checks, by file. machine.c:
gv_examine gv_examine_kernel, gv_examine_priority, gv_examine_memory, gv_examine_cgroup,
    gv_examine_throttling, gv_examine_strict;
// processor.c:
gv_examine gv_examine_governor, gv_examine_idle, gv_examine_clock, gv_examine_interrupts, gv_examine_guest;
// links.c:
gv_examine gv_examine_can, gv_examine_lcm, gv_examine_buffers, gv_examine_serial;

#endif
