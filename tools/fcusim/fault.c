// SPDX-License-Identifier: BSD-3-Clause
// The faults: what each does to the frames that pass.
#include "fault.h"

#include <stdlib.h>
#include <string.h>

static const char *const name[] = {
  "none",  "silence",   "loss",       "corrupt",      "frozen-tracker", "frozen-glove", "equal-glove",
  "clock", "no-status", "bad-status", "sensor-fault", "other-hand",     "tracker-error"};
const char fault_kinds[] =
    "silence, loss, corrupt, frozen-tracker, frozen-glove, equal-glove, clock, no-status, bad-status, "
    "sensor-fault, other-hand or tracker-error";
static const double share = 0.3, clock_back_s = 0.2;
enum { HAND = 2, CLOCK_JUMP_US = 900000000 };

bool fault_parse(const char *text, fault *out) {
  const char *at = strchr(text, '@');
  *out = (fault){.random = 88172645463325252ULL};
  for (size_t i = 1; at && i < sizeof name / sizeof *name; i++)
    if (strlen(name[i]) == (size_t)(at - text) && strncmp(text, name[i], strlen(name[i])) == 0)
      out->kind = (fault_kind)i;
  if (out->kind == FAULT_NONE)
    return false;
  char *end;
  out->at_s = strtod(at + 1, &end);
  return end != at + 1 && !*end && out->at_s >= 0.0;
}

void fault_time(fault *f, double script_s) {
  f->active = f->kind != FAULT_NONE && script_s >= f->at_s;
  f->since_s = script_s - f->at_s;
}

// xorshift64*
static double uniform(fault *f) {
  f->random ^= f->random >> 12;
  f->random ^= f->random << 25;
  f->random ^= f->random >> 27;
  return (double)((f->random * 2685821657736338717ULL) >> 11) / 9007199254740992.0;
}

// The sample as it was before the fault, in a frame with its own counter.
static void freeze_glove(fault *f, gv_frame *frame) {
  gv_glove_msg msg;
  if (gv_fcu_unpack_glove(frame, &msg) != GV_FCU_OK)
    return;
  if (!f->active || !f->glove_seen) {
    f->glove = msg;
    f->glove_seen = true;
    return;
  }
  f->glove.counter = msg.counter;
  if (f->kind == FAULT_EQUAL_GLOVE)
    f->glove.stamp_us = msg.stamp_us;
  gv_fcu_pack_glove(&f->glove, frame);
}

static void freeze_hand(fault *f, gv_frame *frame) {
  gv_pose_msg msg;
  if (gv_fcu_unpack_pose(frame, &msg) != GV_FCU_OK || msg.receiver != HAND)
    return;
  if (!f->active || !f->hand_seen) {
    f->hand = msg;
    f->hand_seen = true;
    return;
  }
  f->hand.counter = msg.counter;
  gv_fcu_pack_pose(&f->hand, frame);
}

static void set_clock(const fault *f, gv_frame *frame) {
  gv_glove_msg glove;
  gv_pose_msg pose;
  if (!f->active || f->since_s > clock_back_s)
    return;
  if (gv_fcu_unpack_glove(frame, &glove) == GV_FCU_OK) {
    glove.stamp_us += CLOCK_JUMP_US;
    gv_fcu_pack_glove(&glove, frame);
  } else if (gv_fcu_unpack_pose(frame, &pose) == GV_FCU_OK) {
    pose.stamp_us += CLOCK_JUMP_US;
    gv_fcu_pack_pose(&pose, frame);
  }
}

// What the frames say of themselves.
static void raise_flags(const fault *f, gv_frame *frame) {
  gv_glove_msg glove;
  gv_pose_msg pose;
  if (!f->active)
    return;
  if (f->kind != FAULT_TRACKER && gv_fcu_unpack_glove(frame, &glove) == GV_FCU_OK) {
    glove.flags ^= f->kind == FAULT_SENSOR ? GV_GLOVE_SENSOR_FAULT : GV_GLOVE_LEFT;
    gv_fcu_pack_glove(&glove, frame);
  } else if (f->kind == FAULT_TRACKER && gv_fcu_unpack_pose(frame, &pose) == GV_FCU_OK &&
             pose.receiver == HAND) {
    pose.flags |= GV_POSE_TRACKER_ERROR;
    gv_fcu_pack_pose(&pose, frame);
  }
}

// False: the frame is lost.
static bool pass(fault *f, gv_frame *frame) {
  switch (f->kind) {
    case FAULT_SILENCE: return !f->active;
    case FAULT_LOSS: return !f->active || uniform(f) >= share;
    case FAULT_CORRUPT:
      if (f->active && frame->len > 0 && uniform(f) < share) {
        const unsigned bit = (unsigned)(uniform(f) * 8.0 * frame->len);
        frame->data[bit / 8] ^= (uint8_t)(1u << bit % 8);
      }
      break;
    case FAULT_FROZEN_TRACKER: freeze_hand(f, frame); break;
    case FAULT_FROZEN_GLOVE:
    case FAULT_EQUAL_GLOVE: freeze_glove(f, frame); break;
    case FAULT_CLOCK: set_clock(f, frame); break;
    case FAULT_NO_STATUS: return !f->active || frame->id != GV_ID_STATUS;
    case FAULT_BAD_STATUS:
      if (f->active && frame->id == GV_ID_STATUS)
        frame->data[9] ^= 1;
      break;
    case FAULT_SENSOR:
    case FAULT_OTHER_HAND:
    case FAULT_TRACKER: raise_flags(f, frame); break;
    case FAULT_NONE: break;
  }
  return true;
}

int fault_apply(fault *f, gv_frame *frame, int count) {
  int left = 0;
  for (int i = 0; i < count; i++)
    if (pass(f, &frame[i]))
      frame[left++] = frame[i];
  return left;
}
