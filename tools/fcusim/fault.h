// SPDX-License-Identifier: BSD-3-Clause
// Faults of device and link that fcusim plays from a moment of the script on, as a filter
// between the simulated device and the wire: the device itself stays sound, and goes on judging
// what reaches it. Deterministic.
#ifndef FCUSIM_FAULT_H
#define FCUSIM_FAULT_H

#include "gloved/fcu.h"

typedef enum fault_kind {
  FAULT_NONE,
  FAULT_SILENCE,         // nothing passes in either direction: the cable is out
  FAULT_LOSS,            // 30 % of the frames of each direction are lost
  FAULT_CORRUPT,         // 30 % of the frames of each direction have one bit of their payload wrong
  FAULT_FROZEN_TRACKER,  // POSE frames keep coming, with counter and checksum, but with one measurement
                         // and stamp
  FAULT_FROZEN_GLOVE,    // GLOVE frames likewise
  FAULT_EQUAL_GLOVE,     // GLOVE frames with stamps that go on but always the same angles: a hand held
                         // still looks so
  FAULT_CLOCK,           // the device's clock jumps a quarter of an hour ahead, and back after 0.2 s
  FAULT_NO_STATUS,       // STATUS frames do not come any more
  FAULT_BAD_STATUS,      // every STATUS frame has a wrong bit
  FAULT_SENSOR,          // GLOVE frames say that a sensor does not answer
  FAULT_OTHER_HAND,      // GLOVE frames come from a glove for the other hand
  FAULT_TRACKER          // POSE frames of the hand say that the tracker has an error
} fault_kind;

typedef struct fault {
  fault_kind kind;
  double at_s;  // of the script
  bool active;
  double since_s;  // how long it has been active
  uint64_t random;
  gv_glove_msg glove;  // the last before the fault
  gv_pose_msg hand;
  bool glove_seen, hand_seen;
} fault;

// "KIND@SECONDS", e.g. "frozen-tracker@1.5". False where it is none.
bool fault_parse(const char *text, fault *out);
// The kinds in words, for messages.
extern const char fault_kinds[];
// Time of the script (negative: not started); before the frames of each period.
void fault_time(fault *fault, double script_s);
// What becomes of `count` frames, in place; returns how many are left.
int fault_apply(fault *fault, gv_frame *frame, int count);

#endif
