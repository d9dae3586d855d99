// SPDX-License-Identifier: BSD-3-Clause
// Two sessions over one engine (hands.h). Pure glue in the real-time thread.
#include "daemon/loop/hands.h"

#include <assert.h>

int gv_hands_count(const gv_session session[]) { return gv_engine_hands(session[0].engine); }

// ---- whose frame ----------------------------------------------------------------------------------------

static int hand_of(const gv_frame *frame) { return frame->flags & GV_FRAME_SECOND ? 1 : 0; }

// The frames of one hand in their order.
static int frames_of(int hand, const gv_frame *frame, int count, gv_frame out[GV_HANDS_FRAMES]) {
  int own = 0;
  assert(count >= 0 && count <= GV_HANDS_FRAMES);
  for (int i = 0; i < count; i++)
    if (hand_of(&frame[i]) == hand)
      out[own++] = frame[i];
  return own;
}

static void mark(int hand, gv_frame *command) {
  if (hand > 0)
    command->flags |= GV_FRAME_SECOND;
}

// ---- a fault in one -------------------------------------------------------------------------------------

// A doubt that waits for the next step, which will be a fault.
static bool is_in_doubt(const gv_session *session) {
  return gv_safety_lets_force_out(&session->safety) && session->doubts_heard != 0;
}

static bool is_in_fault(const gv_session *session) {
  return session->safety.state == GV_SAFETY_FAULT &&
         (session->safety.faults & ~(uint32_t)GV_FAULT_OTHER_DEVICE) != 0;
}

// What follows from another hand's fault is no fault that others follow: else none would ever end.
static void tell_each_other(gv_session session[]) {
  for (int i = 0; i < gv_hands_count(session); i++) {
    session[i].other_in_fault = false;
    for (int k = 0; k < gv_hands_count(session); k++)
      session[i].other_in_fault |= k != i && (is_in_fault(&session[k]) || is_in_doubt(&session[k]));
  }
}

const gv_session *gv_hands_at_fault(const gv_session session[]) {
  for (int i = 0; i < gv_hands_count(session); i++)
    if (is_in_fault(&session[i]))
      return &session[i];
  return session;
}

// ---- a period -------------------------------------------------------------------------------------------

static void take(gv_session session[], int64_t now_ns, const gv_frame *frame, int count) {
  gv_frame own[GV_HANDS_FRAMES];
  for (int i = 0; i < gv_hands_count(session); i++)
    gv_session_take(&session[i], now_ns, own, frames_of(i, frame, count, own));
}

static void step_engine(gv_session session[]) {
  gv_sample sample[GV_HANDS];
  gv_step_result result[GV_HANDS];
  for (int i = 0; i < gv_hands_count(session); i++)
    sample[i] = session[i].sample;
  gv_engine_step_hands(session[0].engine, sample, result);
  for (int i = 0; i < gv_hands_count(session); i++)
    session[i].result = result[i];
}

void gv_hands_compute(gv_session session[], int64_t now_ns, const gv_frame *frame, int count,
                      unsigned periods_skipped) {
  take(session, now_ns, frame, count);
  step_engine(session);
  for (int i = 0; i < gv_hands_count(session); i++)
    gv_session_judge(&session[i], now_ns, periods_skipped);
  tell_each_other(session);
}

void gv_hands_hold(gv_session session[], int64_t now_ns, const gv_frame *frame, int count) {
  gv_frame own[GV_HANDS_FRAMES];
  for (int i = 0; i < gv_hands_count(session); i++)
    gv_session_hold(&session[i], now_ns, own, frames_of(i, frame, count, own));
  tell_each_other(session);
}

void gv_hands_heed(gv_session session[], const gv_frame *frame, int count) {
  gv_frame own[GV_HANDS_FRAMES];
  for (int i = 0; i < gv_hands_count(session); i++)
    gv_session_heed(&session[i], own, frames_of(i, frame, count, own));
  tell_each_other(session);
}

int gv_hands_command(gv_session session[], int64_t now_ns, gv_frame out[GV_HANDS]) {
  for (int i = 0; i < gv_hands_count(session); i++) {
    gv_session_command(&session[i], now_ns, &out[i]);
    mark(i, &out[i]);
  }
  return gv_hands_count(session);
}

bool gv_hands_stop(gv_session session[], int64_t now_ns, gv_frame out[GV_HANDS]) {
  bool none = true;
  for (int i = 0; i < gv_hands_count(session); i++) {
    none = gv_session_stop(&session[i], now_ns, &out[i]) && none;
    mark(i, &out[i]);
  }
  return none;
}

// ---- between two steps ----------------------------------------------------------------------------------

bool gv_hands_request(gv_session session[], const gv_request *request) {
  const bool wants_rest = request->kind == GV_REQUEST_RESET || request->kind == GV_REQUEST_SCENE;
  for (int i = 1; i < gv_hands_count(session); i++) {
    if (wants_rest && gv_session_force_may_flow(&session[i]))
      return false;
    if (request->kind == GV_REQUEST_DISARM)
      gv_session_request(&session[i], request);
  }
  return gv_session_request(&session[0], request);
}

void gv_hands_change_engine(gv_session session[], gv_engine *engine, uint64_t steps_before) {
  for (int i = 0; i < gv_engine_hands(engine); i++)
    gv_session_change_engine(&session[i], engine, steps_before);
}
