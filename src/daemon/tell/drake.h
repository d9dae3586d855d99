// SPDX-License-Identifier: BSD-3-Clause
// The picture for Drake's viewer (Meldis) as plain numbers: which shapes there are, and where they are in a
// snapshot. telemetry_picture.c puts them into messages. Slow thread; gv_drake_init belongs to set-up.
//
// Folders in the viewer: hand (simulated limbs), glove (the measured hand: it may lie inside objects), hand2
// and glove2 of a second hand, objects, contacts (a dot each), forces (an arrow each, on the limb or object A
// of the contact), head.
//
// The viewer cannot change a shape once it is loaded. An arrow's shaft is a telescope of four cylinders
// that are pushed into each other: 25 mm a newton, up to 6.7 N.
#ifndef GLOVED_PROCESS_DRAKE_H
#define GLOVED_PROCESS_DRAKE_H

#include "gloved/hand.h"
#include "gloved/scene.h"
#include "daemon/loop/snapshot.h"

enum {
  GV_DRAKE_CONTACTS = 24,  // dots and arrows: the strongest contacts of a snapshot
  GV_DRAKE_SHAFTS = 4,
  GV_DRAKE_LINKS = GV_HANDS * 2 * GV_LIMBS + 1 + GV_MAX_OBJECTS + GV_DRAKE_CONTACTS * (2 + GV_DRAKE_SHAFTS),
  GV_DRAKE_NAME = 48,
  GV_DRAKE_NUMBERS = 11000  // floats of all shapes: 44 kB, so that the whole message stays below 64 kB
};

typedef enum gv_drake_type {  // as on the wire
  GV_DRAKE_BOX = 1,
  GV_DRAKE_SPHERE = 2,
  GV_DRAKE_CYLINDER = 3,
  GV_DRAKE_MESH = 4,
  GV_DRAKE_CAPSULE = 5
} gv_drake_type;

typedef struct gv_drake_link {
  char name[GV_DRAKE_NAME];
  gv_drake_type type;
  gv_vec3 p_link_shape;  // objects: the mesh is about the centre of mass, the link is the scene file's frame
  gv_quat q_link_shape;  // the viewer's capsules lie along z, ours along x
  float color[4];
  int number_first, number_count;  // into gv_drake.number; count 0: no shape
} gv_drake_link;

typedef struct gv_drake {
  const gv_scene *scene;
  int link_count, objects_first, second_first;  // links; second_first -1: one hand
  gv_drake_link link[GV_DRAKE_LINKS];
  gv_pose T_world_link[GV_DRAKE_LINKS];
  int second_contacts;  // of the second hand's newest snapshot, strongest first
  gv_contact second_contact[GV_DRAKE_CONTACTS];
  int number_count;
  float number[GV_DRAKE_NUMBERS];
} gv_drake;

// Every shape. The scene must outlive it. Meshes that do not fit are thinned: vertices that lie
// close together become one. Takes temporary memory from the heap; where there is none the
// object is left out of the picture.
// second: null, one hand.
void gv_drake_init(gv_drake *drake, const gv_hand_model *hand, const gv_hand_model *second,
                   const gv_scene *scene);
// T_world_link of every link. Poses are finite, quaternions of unit length, whatever the snapshot holds.
// From the first hand's snapshot, after the second one's.
void gv_drake_update(gv_drake *drake, const gv_snapshot *snapshot);
void gv_drake_update_second(gv_drake *drake, const gv_snapshot *snapshot);

#endif
