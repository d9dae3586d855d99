// SPDX-License-Identifier: BSD-3-Clause
// How far objects moved in the hand while it held them: what a grasp is judged by. Fed
// with snapshots; slow thread.
#ifndef GLOVED_DAEMON_HELD_H
#define GLOVED_DAEMON_HELD_H

#include "daemon/loop/snapshot.h"
#include "gloved/scene.h"

// A grasp counts from when the hand has come to rest above the object's place, and half a second later,
// until half a second before it lets go: closing and opening fingers move what they touch.
#define GV_HELD_MARGIN_S 0.5
#define GV_HELD_LIFT_M 0.02
#define GV_HELD_REST_M_S 0.02

enum { GV_HELD_RECENT = 64 };  // snapshots within the margin: 50 a second

typedef struct gv_held_recent {
  double time_s;
  gv_vec3 p_palm;
  double lift_m;
} gv_held_recent;

typedef struct gv_held_object {
  bool started, holds;  // the start is known; in the hand and above its start now
  double start_m;       // height
  double since_s;       // from when on the hand holds it, at rest
  double before_s;      // time and palm of the snapshot before
  gv_vec3 palm_before;
  bool counts;    // this grasp is older than the margin
  gv_vec3 first;  // where in the palm's frame it was then
  gv_held_recent recent[GV_HELD_RECENT];
  int recent_count;
  double seconds;    // of all grasps, without the margins
  double counted_s;  // time of the newest pose that counts
  double moved_m;    // farthest from the first pose, of all grasps
  double lift_m;     // highest while it counted
} gv_held_object;

typedef struct gv_held {
  gv_held_object object[GV_MAX_OBJECTS];
} gv_held;

void gv_held_snapshot(gv_held *held, const gv_scene *scene, const gv_snapshot *snapshot);

#endif
