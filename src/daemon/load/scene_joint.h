// SPDX-License-Identifier: BSD-3-Clause
// Joints in a scene file: what holds two objects together. Explained in
// data/scenes/joints.scene. Set-up only.
#ifndef GLOVED_SCENE_JOINT_H
#define GLOVED_SCENE_JOINT_H

#include "daemon/load/conf.h"
#include "gloved/arena.h"
#include "gloved/scene.h"

// The list `joints` of the file's root, absent or not; the key counts as known.
gv_conf_node gv_joints_find(gv_conf_group *root);
// Reads the list once the scene's objects are there. What is wrong is the conf's error.
void gv_joints_read(gv_conf_node list, gv_arena *arena, gv_scene *io_scene);

#endif
