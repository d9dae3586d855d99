// SPDX-License-Identifier: BSD-3-Clause
// The files that the daemon is asked to write, looked at before anything is opened: a start that ends in an
// error leaves what is there alone. Set-up, main thread.
#ifndef GLOVED_DAEMON_OUTPUT_H
#define GLOVED_DAEMON_OUTPUT_H

#include <stdbool.h>
#include <stddef.h>

// A file of the command line or the configuration.
typedef struct gv_named_file {
  const char *option;  // "--record", for messages
  const char *path;    // null or empty: not given
  bool written;        // else read
} gv_named_file;

// Whether those that are written can be: plain files, in a folder that is there, which may be written, and
// none of them the same file as another one of the list (by device and inode, so links count too). Creates
// nothing that stays. 0, or negative with one line (what, what to do) in err.
int gv_output_check(const gv_named_file *file, int count, char *err, size_t err_size);

// Whether the file at `path` lies at or below the working directory when all links are followed.
bool gv_output_is_below_here(const char *path);

#endif
