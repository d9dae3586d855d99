// SPDX-License-Identifier: BSD-3-Clause
// What makes a narrow phase: how it finds the nearest point of a simplex, and the depth of overlapping cores.
// The walk between, the warm start and the radii are narrow.c's, the same for all. Internal to the narrow
// phase.
#ifndef GLOVED_COLLISION_PHASE_H
#define GLOVED_COLLISION_PHASE_H

#include "collision/cso.h"
#include "collision/simplex.h"

typedef struct gv_phase {
  gv_simplex_solver solve;
  // Along *io_guess, a unit vector, the cores overlap. True where they do along every other direction too:
  // then as depth() answers. False: they are apart, or that is not known; *io_guess may be a better one now.
  // May be null.
  bool (*still_overlap)(const gv_cso *cso, gv_vec3 *io_guess, gv_distance *out);
  // Cores that overlap, or are so close that the walk could not tell: signed distance, normal and the witness
  // point of A (frame of B), method, and what the cache should remember. warm: the guess is the normal of the
  // last time.
  void (*depth)(const gv_cso *cso, gv_vec3 guess, bool warm, gv_distance *out);
} gv_phase;

extern const gv_phase gv_phase_core;    // core.c: ours
extern const gv_phase gv_phase_libccd;  // libccd.c

#endif
