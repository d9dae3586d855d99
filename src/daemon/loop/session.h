// SPDX-License-Identifier: BSD-3-Clause
// One period of the daemon without clock or descriptor: device frames in, one force command out. The
// real-time loop and the replay tests run the same code.
//
// What the engine gets depends on the frames alone (their order, counters and payload). Ages, stamps and
// now_ns decide only whether and how much force leaves.
#ifndef GLOVED_PROCESS_SESSION_H
#define GLOVED_PROCESS_SESSION_H

#include "gloved/engine.h"
#include "gloved/fcu.h"
#include "gloved/force.h"
#include "gloved/passivity.h"
#include "gloved/safety.h"
#include "daemon/loop/ladder.h"
#include "daemon/loop/request.h"
#include "safety/source.h"
#include "wire/stream.h"

enum {
  // An older counter is dropped; after so many in a row the device has restarted, and counting starts anew.
  GV_SESSION_RESYNC = GV_STREAM_RESYNC
};

// A device lets go when no command came for so long.
#define GV_DEVICE_WATCHDOG_S 0.005

typedef struct gv_session_config {
  gv_limiter_config limiter;
  gv_safety_config safety;
  gv_passivity_config passivity;
  gv_side side;      // a glove for the other hand is not used
  int hand;          // of the engine's: 0, or 1 for the second
  bool replay;       // frames of a recording: its EFFORT and PULL frames are obeyed
  double period_s;   // of one gv_session_step
  double command_s;  // between two commands, where they are sent more often than the engine steps; 0:
                     // period_s
} gv_session_config;

// Since the start; none but `lost` ever goes back.
typedef struct gv_frame_counters {
  uint64_t rx;        // frames taken from the driver
  uint64_t tx;        // commands handed to the driver
  uint64_t lost;      // gaps in the counters, all ids together; one that comes late after all takes its
                      // loss back
  uint64_t bad;       // wrong length, checksum or value: dropped
  uint64_t late;      // doubled or overtaken (older counter): dropped; and samples older than max_age_s
                      // on arrival
  uint64_t unusable;  // sound frames without a measurement: sensor fault, other hand, tracker error
  uint64_t foreign;   // ids that are not ours
  uint64_t errors;    // as events, for the safety machine: broken frames, gaps that nobody filled in
                      // time, frames that repeat
} gv_frame_counters;

typedef struct gv_session {
  gv_session_config cfg;
  gv_engine *engine;
  uint64_t steps_before;  // of the engines before this one
  gv_safety safety;
  gv_limiter limiter;
  gv_passivity passivity;  // of the tensions on the wire and the tendons' ways as measured
  int64_t passed_ns;       // up to here it knows what pulled
  gv_frame_counters frames;
  gv_stream glove_stream, pose_stream, status_stream;
  // Newest good message of each kind, and the age and rate of those that a force depends on.
  gv_glove_msg glove;
  gv_pose_msg hand, head;
  gv_status_msg status;
  gv_source glove_source, hand_source, status_source;
  bool head_seen;
  uint32_t glove_doubt;  // GV_FAULT_SENSOR, GV_FAULT_OTHER_HAND: why the glove's newest sound frame
                         // was no sample
  // Of any sound frame since the last step began, whatever its counter says and whatever came after it:
  bool switch_open;        // it has the dead-man switch open
  uint32_t doubts_heard;   // gv_fault bits: it says that glove, tracker or device are in doubt
  int64_t stepped_ns;      // now_ns of the last step
  double pause_s;          // between the last two steps; 0 before the second
  uint64_t errors_before;  // frames.errors when this step began
  int64_t commanded_ns;    // now_ns of the last command
  bool other_hand;         // a glove of the other hand was seen
  bool disarmed;           // by request: the dead-man switch counts as open until it really is
  bool other_in_fault;     // of two hands: the other one's device is (hands.h)
  gv_sample sample;        // what the engine got last
  bool pull_recorded;      // in a replay, for this step: sample.tension_n is the recording's
  gv_step_result result;   // what it answered
  double glove_age_s, hand_age_s, status_age_s;  // at the last command; infinite before the first message
  double force_n[GV_FINGERS];                    // what left through the limiter
  double force_max_n[GV_FINGERS];                // largest so far
  unsigned limiter_flags;                        // of the last step (gv_limiter_flag)
  uint32_t faults_seen;                          // every gv_fault bit so far
  gv_coupling limb_configured, palm_configured;
  gv_rung rung;  // of the deadline ladder: what the engine does of a step (full, solver, contacts)
  uint8_t command_counter;
  bool told;               // a command went out for the last step: the next one repeats it
  gv_command_msg command;  // last one sent
} gv_session;

void gv_session_init(gv_session *session, const gv_session_config *cfg, gv_engine *engine);

// Goes on with another engine (another scene): counters, streams and the largest forces stay; devices are
// waited for anew, and the dead-man switch must be let go before it can arm.
// steps_before: gv_session_steps with the engine before.
void gv_session_change_engine(gv_session *session, gv_engine *engine, uint64_t steps_before);
// Steps of all engines so far.
int64_t gv_session_steps(const gv_session *session);

// Both in one: the step, and its command at the same time. Tests, replays.
void gv_session_step(gv_session *session, int64_t now_ns, const gv_frame *frame, int count,
                     unsigned periods_skipped, gv_frame *out_command);

// The two sides of an engine's step, for whoever steps it for several hands (hands.h): frames into
// session->sample before it, and after it, with session->result, the safety machine.
void gv_session_take(gv_session *session, int64_t now_ns, const gv_frame *frame, int count);
void gv_session_judge(gv_session *session, int64_t now_ns, unsigned periods_skipped);
// Both with the step between them, for an engine of one hand: one period at now_ns with the frames that came
// since the last one, and the number of periods that the loop had to skip before it. Cost: the engine's step
// and below 2 us.
void gv_session_compute(gv_session *session, int64_t now_ns, const gv_frame *frame, int count,
                        unsigned periods_skipped);
// From the next step on the engine does what this rung of the deadline ladder leaves of a step.
void gv_session_set_rung(gv_session *session, gv_rung rung);
// A period without a step: safety goes on, and an open dead-man switch or a doubt in the frames
// that wait for the next step counts.
void gv_session_hold(gv_session *session, int64_t now_ns, const gv_frame *frame, int count);
// Frames that wait for the next step: an open dead-man switch, or a doubt, ends the
// force from the next command on.
void gv_session_heed(gv_session *session, const gv_frame *frame, int count);
// What the device is told at now_ns, when it is sent: after a step, and again between two steps where they
// are far apart. The limiter reckons with the time since the last command. Always writes one.
void gv_session_command(gv_session *session, int64_t now_ns, gv_frame *out_command);

// A force flows, or may from the next command on.
bool gv_session_force_may_flow(const gv_session *session);
// Reset, scene (whether it may be changed now: the caller does it), coupling, friction or disarm, between
// two steps. False: not now (a force may flow), nothing has changed.
bool gv_session_request(gv_session *session, const gv_request *request);

// One period of ending: no engine step, forces ramp to zero. Returns true when the
// command carries none any more.
bool gv_session_stop(gv_session *session, int64_t now_ns, gv_frame *out_command);

#endif
