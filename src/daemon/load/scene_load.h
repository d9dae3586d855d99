// SPDX-License-Identifier: BSD-3-Clause
// A scene file (data/scenes/*.scene, text for people to edit) to the gv_scene that the engine takes.
#ifndef GLOVED_SCENE_LOAD_H
#define GLOVED_SCENE_LOAD_H

#include <stddef.h>

#include "gloved/arena.h"
#include "gloved/scene.h"

// Reads and checks the scene; what it points to lies in the arena (box, frame: under 16 kB; the largest scene
// allowed: about 12 MB). 0, or negative with one line (file, line, what, what to do) in err.
// Set-up only: reads a file, takes temporary memory from the heap.
int gv_scene_load(const char *path, gv_arena *arena, gv_scene *out, char *err, size_t err_size);
// The same from the text of such a file; `name` stands in messages.
int gv_scene_load_text(const char *name, const char *text, gv_arena *arena, gv_scene *out, char *err, size_t err_size);

#endif
