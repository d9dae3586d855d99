// SPDX-License-Identifier: BSD-3-Clause
// Text files for an engine: scenes (data/scenes/*.scene) and the engine's part of a configuration
// (data/gloved.conf). Set-up only: reads files, takes temporary memory from the heap. Errors are one
// line: file, line, what, what to do.
#ifndef GLOVED_LOAD_H
#define GLOVED_LOAD_H

#include <stddef.h>

#include "gloved/arena.h"
#include "gloved/engine.h"
#include "gloved/scene.h"

#ifdef __cplusplus
extern "C" {
#endif

// Reads and checks the scene; what it points to lies in the arena (box, frame: under 16 kB; the largest scene
// allowed: about 12 MB) and must outlive it. 0, or negative with one line in err.
int gv_scene_load(const char *path, gv_arena *arena, gv_scene *out, char *err, size_t err_size);

// The defaults, then the file's preset, then what the file sets of hand, coupling, contact and solver (its
// calibration file is read too); what is the daemon's is checked and left out. 0, or negative with one
// line in err; *out is then untouched.
int gv_config_load(const char *path, gv_config *out, char *err, size_t err_size);

#ifdef __cplusplus
}
#endif

#endif
