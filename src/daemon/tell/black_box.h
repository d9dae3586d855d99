// SPDX-License-Identifier: BSD-3-Clause
// The black box: the last ten seconds of frames, states, forces and timing, kept in fixed memory
// and written into two new files after a fault: gloved-fault-DATE.log, a candump -L log that
// `--fcu trace:FILE` replays, and gloved-fault-DATE.csv, a row for each step. The loop's rings
// bring what is kept; set-up and slow thread.
#ifndef GLOVED_DAEMON_BLACK_BOX_H
#define GLOVED_DAEMON_BLACK_BOX_H

#include <stdbool.h>
#include <stddef.h>

#include "daemon/load/about.h"
#include "daemon/loop/snapshot.h"

enum {
  GV_BLACK_BOX_BEFORE_S = 10,   // of what is written lies before the fault,
  GV_BLACK_BOX_AFTER_MS = 500,  // and this much after it: the force's way to zero
  GV_BLACK_BOX_MAX = 20         // faults written in a run; a device that fails again and again must
                                // not fill the disk
};

typedef struct gv_black_box gv_black_box;

// The folder: `asked`, or where that is empty the state directory of the service ($STATE_DIRECTORY), of
// the user ($XDG_STATE_HOME/gloved, ~/.local/state/gloved). One that was asked for must be there and be
// writable: otherwise negative with one line in err. 0, and the name in out; the folder of the user is
// made when the first fault is written.
int gv_black_box_folder(const char *asked, char out[512], char *err, size_t err_size);

// Takes all its memory (some 8 MB at 1 kHz). Null: there is none. `about` must outlive it; one that says
// what the run is made of is written beside each log.
gv_black_box *gv_black_box_open(const char *folder, const gv_about *about);

// A frame in or out with the stamp of its step (gv_loop.frames), a step (gv_loop.steps),
// what happened (gv_loop.records).
void gv_black_box_frame(gv_black_box *box, const gv_frame *frame);
void gv_black_box_step(gv_black_box *box, const gv_step_record *step);
void gv_black_box_record(gv_black_box *box, const gv_record *record);
// Writes a part of what is to be written, if anything is: at most some thousand lines, so
// that other slow work goes on.
void gv_black_box_work(gv_black_box *box);
// Writes the rest, and gives the memory back. Null: nothing.
void gv_black_box_close(gv_black_box *box);

#endif
