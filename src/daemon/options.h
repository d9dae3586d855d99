// SPDX-License-Identifier: BSD-3-Clause
// The command line (DESIGN.md, "Interfaces"). What it says wins over --config, and that over the defaults.
#ifndef GLOVED_PROCESS_OPTIONS_H
#define GLOVED_PROCESS_OPTIONS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "daemon/load/config_load.h"

typedef struct gv_options {
  // null: not given
  const char *config, *scene, *fcu, *tracker, *fcu2, *narrow, *solver, *lcm, *log, *record, *summary, *sync,
      *black_box;
  double rate_hz;     // 0: not given
  double duration_s;  // 0: not given, without end
  bool no_rt, strict, doctor, json, check, print_config, help, version;
} gv_options;

enum { GV_RATE_MIN_HZ = 100, GV_RATE_MAX_HZ = 10000 };

// 0, or negative with one line (what, what to do) in err.
int gv_options_parse(int argc, char **argv, gv_options *out, char *err, size_t err_size);
// Defaults, --config, then the options. 0, or negative with one line in err.
int gv_options_settings(const gv_options *options, gv_settings *out, char *err, size_t err_size);
// Whether what is to be written can be, and overwrites nothing that is read (load/output.h). Before anything
// is opened: what is there stays as it is until nothing can fail any more. 0, or negative with one line in
// err.
int gv_options_outputs(const gv_options *options, const gv_settings *settings, char *err, size_t err_size);
// The text of --help.
const char *gv_options_help(void);

#endif
