// SPDX-License-Identifier: BSD-3-Clause
// The objects that `make scenes` compiles into build/scenes, each with the script of
// data/scripts that grasps it.
#ifndef TEST_SUPPORT_SHAPES_H
#define TEST_SUPPORT_SHAPES_H

typedef struct shape_grasp {
  const char *scene, *script;
  int min_pieces, triangles;  // of the object, 0: any
} shape_grasp;

static const shape_grasp shape_grasps[] = {
  {"bunny250", "power_box", 9, 250},     {"bunny", "power_box", 64, 69666},  {"bottle", "power_box", 2, 0},
  {"bowl", "power_box", 20, 0},          {"cone", "power_handle", 1, 0},     {"cup", "power_box", 8, 0},
  {"dice", "power_box", 1, 0},           {"dumbbell", "power_handle", 3, 0}, {"hammer", "power_handle", 2, 0},
  {"mug", "power_box", 10, 0},           {"pawn", "power_handle", 3, 0},     {"ring", "power_box", 8, 0},
  {"screwdriver", "power_handle", 2, 0}, {"star_knob", "power_box", 3, 0},   {"torus", "hook_torus", 8, 0},
  {"wrench", "power_handle", 3, 0},
};
enum { SHAPE_GRASPS = sizeof shape_grasps / sizeof shape_grasps[0] };

#endif
