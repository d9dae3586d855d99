// SPDX-License-Identifier: BSD-3-Clause
// A scene file (data/scenes/*.scene, text for people to edit) to the gv_scene that the engine takes.
#ifndef GLOVED_SCENE_LOAD_H
#define GLOVED_SCENE_LOAD_H

#include "gloved/load.h"  // gv_scene_load

// The same from the text of such a file; `name` stands in messages.
int gv_scene_load_text(const char *name, const char *text, gv_arena *arena, gv_scene *out, char *err,
                       size_t err_size);

#endif
