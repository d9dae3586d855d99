// SPDX-License-Identifier: BSD-3-Clause
// One random grasp out of a seed: an object on the table, and what the simulated user does with it. The same
// seed and family give the same grasp. Families:
//
//   boxes   boxes of 45 to 120 mm, 0.03 to 1 kg, mu 0.4 to 1.2; power grasp, pinch or tripod, the wrist off
//           by up to 12 mm and 12 degrees; the perfect device
//   any     boxes, balls and the compiled shapes, likewise, but 0.01 to 2 kg and mu 0.2 to 1.4; the fingers
//           close less or farther than the script says, faster or slower; a third of the users has a real
//           device, a third sways and trembles
#ifndef CAMPAIGN_DRAW_H
#define CAMPAIGN_DRAW_H

#include "gloved/scene.h"
#include "gloved/sim.h"

typedef struct drawn {
  unsigned long long seed;
  const char *family, *script, *shape;  // shape: "box", "ball", or a compiled scene
  gv_vec3 size_m;                       // of the box, or the ball's radius three times; else 0
  double mass_kg, mu;                   // mu: of hand, object and table alike
  gv_vec3 off_m, off_rad;               // of the wrist: along the world's axes; about its own
  double grip, tempo;                   // 1: as the script says
  bool real;                            // device
  double sway_rad, tremor_rad;
  double grasp_s, lifted_s;  // the fingers are closed; the wrist is up
  double lift_m;             // of the wrist
} drawn;

// False where there is no such family.
bool draw(const char *family, unsigned long long seed, drawn *out);
// The grasp's scene (in `arena`, its object number 1) and script. 0; 1 where the shape is not compiled here;
// negative with one line in err.
int draw_build(drawn *d, gv_arena *arena, gv_scene *out_scene, gv_sim_script *out_script, char *err,
               size_t err_size);

#endif
