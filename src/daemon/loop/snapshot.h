// SPDX-License-Identifier: BSD-3-Clause
// What the real-time thread tells the slow one: the state of one step as plain data, and events as they
// happen. SI units, world frame. Written by the real-time thread, read by view, telemetry and summary.
#ifndef GLOVED_PROCESS_SNAPSHOT_H
#define GLOVED_PROCESS_SNAPSHOT_H

#include "daemon/loop/session.h"

typedef struct gv_snapshot_limb {
  gv_pose T_world_limb, T_world_driver;  // simulated limb, and the skeleton's frame that pulls it
  gv_vec3 force_n, torque_nm;            // coupling on the limb; the person feels the opposite
} gv_snapshot_limb;

typedef struct gv_snapshot_object {
  gv_pose T_world_body;  // origin in the centre of mass
  gv_vec3 velocity_m_s, spin_rad_s;
} gv_snapshot_object;

// About 29 kB full; only the used part of object[], contact[] and polygon[] is written.
// One hand with the world that it is in.
typedef struct gv_snapshot {
  int hand;       // 0, or 1 for the second
  int64_t step;   // engine steps so far, of all scenes
  double time_s;  // step number x period
  int64_t utime;  // us since 1970: wall clock at the loop's start + session time since then
  gv_safety_state safety;
  uint32_t faults;         // gv_fault bits of the present fault
  uint32_t events;         // gv_event bits since the last snapshot
  unsigned limiter_flags;  // gv_limiter_flag bits of this step
  bool glove_seen, hand_seen, head_seen, status_seen;
  bool dead_man;                   // held, as the glove reports it
  double glove_age_s, hand_age_s;  // of the newest sample; infinite before the first
  double desired_n[GV_FINGERS];    // tensions asked for
  double force_n[GV_FINGERS];      // tensions commanded, after the limiter
  double measured_n[GV_FINGERS];   // tensions that the device reports; 0 before its first status
  double energy_j[GV_FINGERS], dissipated_j[GV_FINGERS];  // gv_passivity_port
  double angle_rad[GV_SENSORS];                           // filtered joint angles
  gv_pose T_world_receiver, T_world_head;
  gv_counters counters;
  gv_frame_counters frames;
  uint64_t missed_deadlines, overruns, ring_dropped, heap_calls;
  gv_coupling limb_coupling, palm_coupling;  // in force now
  double mu_hand;
  gv_snapshot_limb limb[GV_LIMBS];
  int object_count, contact_count, polygon_count;
  gv_snapshot_object object[GV_MAX_OBJECTS];
  gv_contact contact[GV_MAX_CONTACTS];  // of objects, and of this hand: its limbs from 0 to 15
  gv_polygon_contact polygon[GV_MAX_POLYGONS];
} gv_snapshot;

// One step with the frames that went into it, for GLOVED_TRACE. A step with more
// frames takes several records.
enum { GV_STEP_FRAMES = 8 };
typedef struct gv_step_record {
  int64_t step, now_ns, utime;  // as in gv_snapshot; session time
  int64_t step_ns;              // step number x period: the stamp of its frames in a recording
  int32_t wake_ns, work_ns;     // deadline to start; start to end
  gv_safety_state safety;
  uint32_t faults;  // gv_fault bits of the present fault
  uint32_t events;
  int contacts;
  double depth_m;  // deepest contact
  double desired_n[GV_FINGERS], force_n[GV_FINGERS];
  int frame_count;
  gv_frame frame[GV_STEP_FRAMES];
} gv_step_record;

typedef enum gv_record_kind {  // the kinds of GLOVED_EVENT: their numbers stay
  GV_RECORD_STATE,             // the safety machine went from `from` to `to`, with its fault bits
  GV_RECORD_ENGINE,            // a gv_event bit came up (at most once a second each)
  GV_RECORD_OVERRUN,           // periods were skipped (at most once a second)
  GV_RECORD_OTHER_HAND,        // once: the glove is for the other hand than the configuration
  GV_RECORD_REQUEST,           // a gv_request was done or refused: bits = kind, + GV_RECORD_REFUSED
  GV_RECORD_SYNC,   // bits 1: the device's frames are the clock; 0: they stay away, the loop's own is
  GV_RECORD_LADDER  // bits: the rung of the deadline ladder that the loop came to (at most once a second)
} gv_record_kind;

enum { GV_RECORD_REFUSED = 256 };

typedef struct gv_record {
  gv_record_kind kind;
  int hand;  // whose state, or glove
  int64_t step;
  double time_s;
  int64_t utime;  // as in gv_snapshot
  gv_safety_state from, to;
  int64_t tag;    // request: gv_request.tag
  uint32_t bits;  // state: gv_fault; engine: one gv_event bit; overrun: periods skipped
} gv_record;

// Everything of `session` and its engine; the loop's own counters are left to the caller. Cost: some 3 us.
void gv_snapshot_fill(const gv_session *session, int object_count, gv_snapshot *out);

// The last step with `count` frames of it; utime and the times of the loop are left to
// the caller. Cost: below 1 us.
void gv_step_record_fill(const gv_session *session, int64_t now_ns, const gv_frame *frame, int count,
                         gv_step_record *out);

// Pose of the object's own frame, as the scene file draws it, from the pose of its body.
gv_pose gv_snapshot_object_pose(const gv_object *object, gv_pose T_world_body);

// The record in words, e.g. "safety: armed -> fault: glove data too old".
enum { GV_RECORD_TEXT = 120 };
void gv_record_text(const gv_record *record, char out[GV_RECORD_TEXT]);

#endif
