// SPDX-License-Identifier: BSD-3-Clause
// Finding a grasp for an object: candidates (where from, which posture, how tight) are tried by the simulated
// user on the engine itself, and those that hold are compared by the wrench that their contacts resist. The
// same scene and seed give the same grasp: no clock decides. Memory is the caller's; one search at a time.
#ifndef GLOVED_TOOLS_GRASP_H
#define GLOVED_TOOLS_GRASP_H

#include "gloved/engine.h"
#include "gloved/sim.h"

// The timeline of every grasp, milliseconds.
enum {
  GRASP_ARMED_MS = 300,
  GRASP_THERE_MS = 1000,  // the open hand is where it will close
  GRASP_CLOSED_MS = 2200,
  GRASP_LIFT_MS = 2500,
  GRASP_LIFTED_MS = 3500,
  GRASP_SETTLED_MS = 4000,  // held from here on
  GRASP_TRIED_MS = 5000,    // so far goes a try
  GRASP_END_MS = 8000       // so far the proof, and what is written
};

enum { GRASP_POSTURES = 3 };

typedef struct grasp_candidate {
  int number;                // of the sequence
  double yaw_deg, roll_deg;  // of the wrist: where the palm looks
  double height;             // 0 to 1: at which part of the object's height
  double along_m;            // from the wrist to the object's middle, along the straight fingers
  int posture;
  double tightness;       // of the closed fist: 1 all of it
  gv_pose T_world_wrist;  // where the hand closes
  gv_vec3 back_m;         // from there to where it comes from
} grasp_candidate;

typedef struct grasp_result {
  bool held;
  double wrench_n;  // least force, over all directions, that a newton at each contact resists (torque:
                    // over the size)
  double lift_m, slip_m, depth_m;  // while held
  int limbs;                       // that touch it while held
} grasp_result;

typedef struct grasp_search {
  const gv_scene *scene;
  const gv_config *config;
  void *memory;  // of the engine
  size_t memory_size;
  int object;
  gv_pose T_world_object;  // where it lies, once it has come to rest
  gv_vec3 low, high;       // box around it, world
  double size_m;           // of the box, half its diagonal
} grasp_search;

// Lets the scene come to rest. False where the engine does not take it.
bool grasp_begin(grasp_search *search, const gv_scene *scene, const gv_config *config, void *memory,
                 size_t size, int object);
// Candidate `number` of the sequence, brought up to the object. False where the hand does not fit there.
bool grasp_candidate_make(const grasp_search *search, unsigned seed, int number, grasp_candidate *out);
// The user script of a candidate, as text.
int grasp_script(const grasp_candidate *candidate, const char *comment, char *out, size_t size);
// Runs the simulated user through the script up to `until_ms`; a grasp that cannot hold ends early.
void grasp_try(grasp_search *search, const grasp_candidate *candidate, int until_ms, grasp_result *out);

#endif
