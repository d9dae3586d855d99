// SPDX-License-Identifier: BSD-3-Clause
// What a scene says about friction: an object's own, its material's, and how two materials rub against each
// other. Part of the scene loader; set-up only.
#ifndef GLOVED_SCENE_FRICTION_H
#define GLOVED_SCENE_FRICTION_H

#include "daemon/load/conf.h"
#include "gloved/scene.h"

typedef struct gv_material {
  char name[GV_MAX_NAME];
  gv_friction friction;
  double mu;
} gv_material;

// Numbered as gv_object.material: the first two are GV_MATERIAL_NONE and GV_MATERIAL_HAND.
typedef struct gv_materials {
  gv_material material[GV_MAX_MATERIALS];
  int count;
} gv_materials;

// 'materials' and 'pairs' of the scene; both may be absent. The pairs go to the arena.
void gv_materials_read(gv_materials *out, gv_conf_group *root, gv_arena *arena, gv_scene *out_scene);
// 'material', or 'mu' and 'friction', of an object.
void gv_friction_read(const gv_materials *materials, gv_conf_group *group, gv_object *out);

#endif
