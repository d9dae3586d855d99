// SPDX-License-Identifier: BSD-3-Clause
// Reads a scene file. Main thread, before the loop starts.
#include "scene_load.h"

#include <stdio.h>

int gv_scene_load(const char *path, gv_arena *arena, gv_scene *out, char *err, size_t err_size) {
  (void)arena;
  (void)out;
  snprintf(err, err_size, "%s: scene files are not built yet", path);
  return -1;
}
