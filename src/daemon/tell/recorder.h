// SPDX-License-Identifier: BSD-3-Clause
// --record FILE: every frame in and out as a candump -L log. The real-time thread hands the frames over
// in a ring (loop.h), stamped with the time of their step (step number x period), so that a replay
// feeds each to the same step and ends with the same state; commands of the ramp to zero at the end
// carry the stamp of the last step. What is written here is that, plus the time of day when the file
// was opened. Set-up and slow thread.
#ifndef GLOVED_PROCESS_RECORDER_H
#define GLOVED_PROCESS_RECORDER_H

#include <stdbool.h>
#include <stdio.h>

#include "daemon/load/about.h"
#include "gloved/frame.h"

typedef struct gv_recorder {
  FILE *file;                     // null: nothing is recorded
  const char *path;               // the caller's
  char iface[2][GV_ABOUT_IFACE];  // of each hand, as the log names it
  int64_t start_ns;               // time of day of step 0, whole microseconds
  bool failed;                    // the disk refused
  bool wrote;                     // since the last flush
} gv_recorder;

// fcu, fcu2: the URLs, for the interfaces' names. 0, or negative with one line in err.
int gv_recorder_open(gv_recorder *recorder, const char *path, const char *fcu, const char *fcu2, char *err,
                     size_t err_size);
// A line of the file; nothing where there is none.
void gv_recorder_frame(gv_recorder *recorder, const gv_frame *recorded);
// Hands what was written to the kernel: a crash after that loses nothing of it.
void gv_recorder_flush(gv_recorder *recorder);
// 0, or negative where the file is not whole.
int gv_recorder_close(gv_recorder *recorder);

#endif
