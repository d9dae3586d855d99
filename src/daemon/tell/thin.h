// SPDX-License-Identifier: BSD-3-Clause
// Fewer triangles for a picture of a mesh. Set-up only: temporary memory from the heap.
#ifndef GLOVED_PROCESS_THIN_H
#define GLOVED_PROCESS_THIN_H

#include "gloved/shape.h"
#include "daemon/load/scene_check.h"

// Writes V, T, 3 V coordinates and 3 T corners as the viewer's messages have them: the mesh itself where that
// takes at most `max` floats, otherwise thinned until it does. Returns the floats written; 0: nothing is left
// of it, or no memory.
int gv_thin_mesh(const gv_mesh *mesh, float *out, int max);
// Floats that the whole mesh takes.
int gv_thin_size(const gv_mesh *mesh);

#endif
