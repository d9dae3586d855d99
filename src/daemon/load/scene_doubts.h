// SPDX-License-Identifier: BSD-3-Clause
// What a scene says that is possible, but hardly meant: a weight that sinks in, objects inside each
// other, a mass or a size that is out of all proportion to a hand. `gloved --check` tells them; nothing
// else depends on them. Set-up only.
#ifndef GLOVED_SCENE_DOUBTS_H
#define GLOVED_SCENE_DOUBTS_H

#include "gloved/engine.h"

typedef struct gv_doubt {
  char text[256];  // object, what, what to do
} gv_doubt;

// At most `max` into out. Returns how many there are. Cost: pairs of pieces whose
// bounds meet, 1 to 300 us each.
int gv_scene_doubts(const gv_scene *scene, const gv_config *cfg, gv_doubt out[], int max);

#endif
