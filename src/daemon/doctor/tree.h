// SPDX-License-Identifier: BSD-3-Clause
// Reading /proc, /sys and /dev below the doctor's root, and saying what was found. Main thread, set-up.
#ifndef GLOVED_DAEMON_DOCTOR_TREE_H
#define GLOVED_DAEMON_DOCTOR_TREE_H

#include "daemon/doctor/doctor.h"

enum { TREE_TEXT = 16384 };  // of a file; the rest is cut off

// The file's text without its last newline. False where it cannot be read; out is then "".
__attribute__((format(printf, 4, 5))) bool gv_tree_read(const gv_doctor *doctor, char *out, size_t size,
                                                        const char *path, ...);
// Its number. False where there is none.
__attribute__((format(printf, 3, 4))) bool gv_tree_number(const gv_doctor *doctor, long *out,
                                                          const char *path, ...);
bool gv_tree_may_write(const gv_doctor *doctor, const char *path);
// Calls `visit` with each name in a directory that starts with `prefix` and a digit goes on; "" means digits
// alone.
void gv_tree_each(const gv_doctor *doctor, const char *directory, const char *prefix,
                  void (*visit)(const gv_doctor *doctor, const char *name, void *user), void *user);
// The text after "name:" or "name" and blanks on a line of its own; null: no such line.
const char *gv_tree_line(const char *text, const char *name);

// The loop's core: the configured one, or the last that is online.
int gv_tree_loop_core(const gv_doctor *doctor);
int gv_tree_cores(const gv_doctor *doctor);
// Whether a list such as "0-2,5" names the core.
bool gv_tree_list_has(const char *list, int core);

__attribute__((format(printf, 3, 4))) void gv_doctor_finds(gv_finding *out, gv_verdict verdict,
                                                           const char *text, ...);
__attribute__((format(printf, 2, 3))) void gv_doctor_mends(gv_finding *out, const char *text, ...);

#endif
