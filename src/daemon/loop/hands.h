// SPDX-License-Identifier: BSD-3-Clause
// One period for all hands of a world: a session, a limiter and a safety machine to each hand and its device,
// one engine step for all of them. `session` is an array with as many as the engine has hands
// (gv_engine_hands). With one hand this is session.h, bit for bit. Real-time thread; pure as session.h.
//
// A fault in one lets all go: a device in a fault ends the forces of the others with the same command, and is
// a fault of theirs (GV_FAULT_OTHER_DEVICE) from the next step on. An open dead-man switch is no fault: it
// ends its own hand's forces alone.
//
// Frames of the second hand's device carry GV_FRAME_SECOND, and so do the commands to it.
#ifndef GLOVED_PROCESS_HANDS_H
#define GLOVED_PROCESS_HANDS_H

#include "daemon/loop/session.h"

enum { GV_HANDS_FRAMES = 257 };  // at most, of all hands together, in one call

int gv_hands_count(const gv_session session[]);
// As gv_session_compute, _hold, _heed.
void gv_hands_compute(gv_session session[], int64_t now_ns, const gv_frame *frame, int count,
                      unsigned periods_skipped);
void gv_hands_hold(gv_session session[], int64_t now_ns, const gv_frame *frame, int count);
void gv_hands_heed(gv_session session[], const gv_frame *frame, int count);
// As gv_session_command, one to each device. Returns how many.
int gv_hands_command(gv_session session[], int64_t now_ns, gv_frame out[GV_HANDS]);
// As gv_session_request: what must not be while a force flows is refused while any hand's may; disarm is for
// all of them.
bool gv_hands_request(gv_session session[], const gv_request *request);
// As gv_session_stop: true when no command carries a force any more.
bool gv_hands_stop(gv_session session[], int64_t now_ns, gv_frame out[GV_HANDS]);
// As gv_session_change_engine; the engine has as many hands.
void gv_hands_change_engine(gv_session session[], gv_engine *engine, uint64_t steps_before);
// Of the hand that a safety machine has in a fault of its own, else of the first.
const gv_session *gv_hands_at_fault(const gv_session session[]);

#endif
