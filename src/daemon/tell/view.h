// SPDX-License-Identifier: BSD-3-Clause
// What a person sees on standard output while the daemon runs: a screen of 80 x 24 on a terminal, ten
// times a second; one line a second elsewhere; nothing in a replay as fast as possible. Slow thread only.
#ifndef GLOVED_PROCESS_VIEW_H
#define GLOVED_PROCESS_VIEW_H

#include "gloved/scene.h"
#include "daemon/loop/loop.h"

enum {
  GV_VIEW_RECORDS = 3,  // events on the screen
  GV_VIEW_NOTE = 400,   // characters of what a device has to say
  GV_VIEW_OBJECTS = 4,  // objects that can move on the screen: 23 lines in all
  GV_VIEW_HISTORY = 10  // screens between two compared poses: slip per second at 10 Hz
};

// Of the second hand, in a line.
typedef struct gv_view_hand {
  bool seen;
  gv_safety_state safety;
  uint32_t faults;
  double force_n[GV_FINGERS];
} gv_view_hand;

typedef struct gv_view {
  gv_view_hand second;
  const gv_scene *scene;
  const char *title;
  bool quiet, terminal;
  int64_t next_ns;                                    // CLOCK_MONOTONIC of the next screen or line
  double force_max_n;                                 // full bar
  char record[GV_VIEW_RECORDS][GV_RECORD_TEXT + 16];  // newest last
  gv_pose T_palm_object[GV_VIEW_HISTORY][GV_VIEW_OBJECTS];
  double start_height_m[GV_VIEW_OBJECTS];
  int screens;  // drawn so far
} gv_view;

// `title`: what is running, a few words; must outlive the view. force_max_n: the limiter's maximum.
void gv_view_open(gv_view *view, const char *title, const gv_scene *scene, double force_max_n, bool quiet);
// The scene given to gv_view_open has other objects now.
void gv_view_change_scene(gv_view *view);
void gv_view_record(gv_view *view, const gv_record *record);
// What a device has to say: on standard error, and among the events of the screen.
void gv_view_note(gv_view *view, const char *text);
// Draws when it is time; now_ns of CLOCK_MONOTONIC.
// What the next screen says of the second hand.
void gv_view_second(gv_view *view, const gv_snapshot *snapshot);
void gv_view_snapshot(gv_view *view, int64_t now_ns, const gv_loop *loop, const gv_snapshot *snapshot);
// Gives the terminal back as it was.
void gv_view_close(gv_view *view);

#endif
