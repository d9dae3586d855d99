// SPDX-License-Identifier: BSD-3-Clause
// What a user sets for the daemon: the file of --config, and the glove's calibration file.
// Set-up only; may allocate and read files. Errors are one line: file, line, what, what to do.
#ifndef GLOVED_CONFIG_LOAD_H
#define GLOVED_CONFIG_LOAD_H

#include <stddef.h>
#include <stdio.h>

#include "gloved/engine.h"
#include "gloved/force.h"
#include "gloved/passivity.h"
#include "gloved/safety.h"

enum { GV_SETTING_TEXT = 256 };  // bytes of a path or URL with its final zero

typedef struct gv_settings {
  gv_config engine;
  gv_limiter_config limiter;
  gv_safety_config safety;
  gv_passivity_config passivity;
  gv_pose T_world_tracker;  // for a tracker of its own: its transmitter in the world
  // Paths are relative to the directory that the daemon is started in, as on the command line.
  char scene[GV_SETTING_TEXT];         // --scene
  char fcu[GV_SETTING_TEXT];           // --fcu
  char tracker[GV_SETTING_TEXT];       // --tracker; empty: the pose comes with the fcu
  char fcu2[GV_SETTING_TEXT];          // --fcu2, of a second hand; empty: one hand
  char tracker2[GV_SETTING_TEXT];      // of the second hand, as tracker
  char lcm[GV_SETTING_TEXT];           // --lcm; "none": nothing is published
  char black_box[GV_SETTING_TEXT];     // --black-box; "none": nothing is kept; empty: the state directory
  char calibration[GV_SETTING_TEXT];   // file that engine.calibration was read from; empty:
                                       // gv_calibration_default
  char calibration2[GV_SETTING_TEXT];  // of the second hand's glove
  double rate_hz;                      // periods per second of the real-time loop
  int cpu;                  // core the loop is pinned to; -1: the last one, where there are several
  int rt_priority;          // SCHED_FIFO 1..99; 0: no real-time scheduling
  bool sync_device;         // --sync device: the glove's frame begins a step
  bool strict;              // --strict: a list of system calls for the real-time thread
  bool cpu_dma_latency;     // hold /dev/cpu_dma_latency at zero while running
  double operations_per_s;  // of collision detection; 0: measured at the start
  bool operations_given;    // engine.operations_per_s is the file's: nothing is measured
  bool mlock;               // keep all memory in RAM
} gv_settings;

// Settings that protect a person less than their defaults, each with its default, in one line; empty: none.
enum { GV_LAXER_TEXT = 512 };
void gv_settings_laxer(const gv_limiter_config *limiter, const gv_safety_config *safety,
                       const gv_passivity_config *passivity, char out[GV_LAXER_TEXT]);

void gv_settings_default(gv_settings *out);
// data/gloved.conf: every setting with its default and its sentence. 0, or negative
// where the file refused a byte.
int gv_settings_print(FILE *out);
// The defaults, then the file's preset, then everything else that the file sets (the calibration file is
// read too). 0, or negative with the reason in err; *out is then not to be used.
int gv_settings_load(const char *path, gv_settings *out, char *err, size_t err_size);
// engine.second as fcu2 says: absent, or the other side's hand by the same measures. After everything else.
void gv_settings_second(gv_settings *out);
// The narrow phase by its name on the command line. 0, or negative where the name is
// unknown: nothing has changed then.
int gv_settings_set_narrow(gv_config *out, const char *name);
// The contact solver by its name. 0, or negative where the name is unknown: nothing has changed then.
int gv_settings_set_solver(gv_config *out, const char *name);
// Two points per sensor, all 22 by name. 0, or negative with the reason in err; *out is then untouched.
int gv_calibration_load(const char *path, gv_calibration *out, char *err, size_t err_size);
// Writes such a file, with the comment's lines on top: whole or not at all. 0, or
// negative with one line in err.
int gv_calibration_save(const char *path, const gv_calibration *cal, const char *comment, char *err,
                        size_t err_size);

#endif
