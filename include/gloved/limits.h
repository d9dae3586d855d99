// SPDX-License-Identifier: BSD-3-Clause
// Every maximum of the engine, with its reason and what one unit costs. Nothing grows at run time:
// a scene beyond a maximum is refused by name when it is loaded, and a step beyond one drops the
// least important item and counts it.
#ifndef GLOVED_LIMITS_H
#define GLOVED_LIMITS_H

#ifdef __cplusplus
extern "C" {
#endif

enum {
  GV_SENSORS = 22,      // joint sensors of one glove (DESIGN.md, "Devices")
  GV_FINGERS = 5,       // force channels, thumb to little finger
  GV_LIMBS = 16,        // 15 finger limbs and the palm; the palm is the last
  GV_MAX_OBJECTS = 64,  // bodies in a scene, static ones included; 1 costs about 0.5 kB
  GV_HANDS = 2,         // of one engine
  GV_BODIES = GV_HANDS * GV_LIMBS + GV_MAX_OBJECTS,  // rigid bodies of the dynamics: the first hand's limbs,
                                                     // the scene's objects, the second hand's limbs
  GV_MAX_PIECES = 256,          // convex pieces in a scene, all objects; 1 costs 0.3 kB besides its polygons
  GV_MAX_HULL_VERTICES = 1024,  // of one piece; 1 costs 24 B and about 6 neighbours of 2 B
  GV_MAX_HULL_FACES = 2048,     // polygons of one piece (Euler: below 2 vertices)
  GV_MAX_FACE_VERTICES = 64,    // of one polygon: bounds the clipping of a manifold
  GV_MAX_VERTICES = 65536,      // vertices of all pieces of a scene
  GV_MAX_MESH_TRIANGLES = 131072,  // visual triangles of a scene (published, never collided with)
  GV_MAX_CONTACTS = 256,           // in one step: 60 boxes on a table; 1 costs 0.5 kB and 3 solver rows
  GV_MAX_PAIR_CONTACTS = 8,        // of one pair of convex pieces, after reduction
  GV_MAX_POLYGONS = 128,           // touched polygons in a snapshot; 1 costs 48 B
  GV_MAX_PAIRS = 1024,             // pairs that the broad phase may pass on in one step
  GV_MAX_MATERIALS = 32,           // named in a scene, the hand's among them
  GV_MAX_JOINTS = 32,              // of a scene; 1 costs up to 8 rows of the solver
  GV_MAX_FRICTION_PAIRS = 64,      // of a scene; looked through for each pair of bodies in contact
  GV_MAX_NAME = 32,                // bytes of an object's name with its final zero
  GV_FARTHEST_M = 100,             // from the origin: poses beyond are refused, bodies beyond put back

  // of a search of the narrow phase; what it has found by then is the answer
  GV_GJK_MAX_ITERATIONS = 64,   // one or two from a warm simplex, 8 from none
  GV_EPA_MAX_ITERATIONS = 128,  // each adds a point at most
  GV_EPA_MAX_DESCENT = 48,      // then downhill alone, where the bounds did not meet
  GV_EPA_MAX_VERTICES = 192,    // seeds and a point an iteration; 1 costs 100 B of stack
  GV_EPA_MAX_FACES = 384        // twice the vertices (Euler); 1 costs 100 B of stack
};

#ifdef __cplusplus
}
#endif

#endif
