// SPDX-License-Identifier: BSD-3-Clause
// Loads another scene beside everything else, in a thread of its own: a large file, or one that
// is made to be slow, holds up neither commands nor the published state nor the end of the
// program. One at a time. Slow thread.
#ifndef GLOVED_DAEMON_SCENE_THREAD_H
#define GLOVED_DAEMON_SCENE_THREAD_H

#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

#include "daemon/load/world.h"

// then the scene is refused; what is still being loaded is thrown away when it is done
enum { GV_SCENE_LOAD_S = 10 };

typedef struct gv_scene_thread {
  _Atomic int busy;  // the thread runs: everything below but `asked_ns` and `given_up` is its own
  bool pending;      // a result is waited for
  bool given_up;     // whoever asked was told no
  int64_t asked_ns;
  gv_config cfg;
  char file[256];
  gv_world world;
  bool failed;
  char err[512];
} gv_scene_thread;

// Null, or why not. now_ns: a clock that runs on.
const char *gv_scene_thread_begin(gv_scene_thread *loader, const char *file, const gv_config *cfg,
                                  int64_t now_ns);
// Whether there is an end of it: *out_refusal null and the world in *out, or why not
// (valid until the next begin).
bool gv_scene_thread_ended(gv_scene_thread *loader, int64_t now_ns, gv_world *out, const char **out_refusal);

#endif
