// SPDX-License-Identifier: BSD-3-Clause
// Is this triangle mesh a solid, and do these convex pieces fill it? Both answers in words for the person
// who edits the scene. Set-up only: temporary memory from the heap.
#ifndef GLOVED_SCENE_CHECK_H
#define GLOVED_SCENE_CHECK_H

#include <stdbool.h>

#include "gloved/scene.h"

// One object's mesh, any frame, metres.
typedef struct gv_mesh {
  const gv_vec3 *vertex;
  const gv_triangle *triangle;
  int vertex_count, triangle_count;
} gv_mesh;

// Planes, boxes and corners that the check of a scene may look at.
#define GV_CHECK_WORK 250000000LL

// What is wrong and what to do, with the place in the file it belongs to.
typedef struct gv_mesh_fault {
  int triangle, piece;  // index within the object, -1: none
  char text[240];
} gv_mesh_fault;

// Closed, every edge shared by exactly two triangles that run along it in opposite directions, no triangle
// without area, no vertex unused, counter-clockwise from outside. Needs valid indices. Cost: n log n.
bool gv_mesh_check(const gv_mesh *mesh, gv_mesh_fault *out);
// Volume enclosed by a closed mesh, cubic metres; negative where it is inside out.
double gv_mesh_volume(const gv_mesh *mesh);

// The pieces fill the mesh: each corner and middle of a triangle lies in or on a piece, each corner of a
// piece in or on the mesh, both within fit_m, and the volumes agree within 1 % and fit_m times the surface.
// Cost: triangles x (pieces' faces + pieces' vertices), counted down in *work, which begins at GV_CHECK_WORK
// for a scene: at its end the scene is refused.
bool gv_pieces_check(const gv_mesh *mesh, const gv_hull *piece, int piece_count, double pieces_volume,
                     double fit_m, int64_t *work, gv_mesh_fault *out);

#endif
