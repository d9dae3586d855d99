// SPDX-License-Identifier: BSD-3-Clause
// Copies the state of one step out of session and engine (real-time thread), and puts event records into
// words (slow thread).
#include "daemon/loop/snapshot.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static void fill_limbs(const gv_engine *engine, int hand, gv_snapshot_limb out[GV_LIMBS]) {
  for (int i = 0; i < GV_LIMBS; i++) {
    const int limb = hand * GV_LIMBS + i;
    out[i].T_world_limb = gv_engine_limb_pose(engine, limb);
    out[i].T_world_driver = gv_engine_driver_pose(engine, limb);
    gv_engine_coupling(engine, limb, &out[i].force_n, &out[i].torque_nm);
  }
}

// What a hand calls its limb; false: it is another hand's.
static bool own_limb(int hand, int *io_limb) {
  if (*io_limb < 0)
    return true;
  *io_limb -= hand * GV_LIMBS;
  return *io_limb >= 0 && *io_limb < GV_LIMBS;
}

static void fill_contacts(const gv_engine *engine, int hand, gv_snapshot *out) {
  int count;
  const gv_contact *contact = gv_engine_contacts(engine, &count);
  out->contact_count = 0;
  for (int i = 0; i < count; i++) {
    gv_contact *own = &out->contact[out->contact_count];
    *own = contact[i];
    out->contact_count += own_limb(hand, &own->limb);
  }
}

static void fill_polygons(const gv_engine *engine, int hand, gv_snapshot *out) {
  const int count = gv_engine_polygons(engine, out->polygon, GV_MAX_POLYGONS);
  out->polygon_count = 0;
  for (int i = 0; i < count; i++) {
    gv_polygon_contact *own = &out->polygon[out->polygon_count];
    *own = out->polygon[i];
    out->polygon_count += own_limb(hand, &own->limb);
  }
}

static void fill_objects(const gv_engine *engine, int object_count, gv_snapshot *out) {
  out->object_count = object_count;
  for (int i = 0; i < object_count; i++) {
    out->object[i].T_world_body = gv_engine_object_pose(engine, i);
    gv_engine_object_velocity(engine, i, &out->object[i].velocity_m_s, &out->object[i].spin_rad_s);
  }
}

static void fill_devices(const gv_session *session, gv_snapshot *out) {
  out->glove_seen = session->glove_source.seen;
  out->hand_seen = session->hand_source.seen;
  out->head_seen = session->head_seen;
  out->status_seen = session->status_source.seen;
  out->dead_man = (session->glove.flags & GV_GLOVE_DEAD_MAN) != 0;
  out->glove_age_s = session->glove_age_s;
  out->hand_age_s = session->hand_age_s;
  out->T_world_receiver = session->sample.T_world_receiver;
  out->T_world_head = session->head_seen ? session->head.T_world_receiver : gv_pose_identity();
  out->frames = session->frames;
}

static void fill_energy(const gv_passivity *passivity, gv_snapshot *out) {
  for (int i = 0; i < GV_FINGERS; i++) {
    out->energy_j[i] = passivity->port[i].energy_j;
    out->dissipated_j[i] = passivity->port[i].dissipated_j;
  }
}

void gv_snapshot_fill(const gv_session *session, int object_count, gv_snapshot *out) {
  const int hand = out->hand = session->cfg.hand;
  out->counters = *gv_engine_counters(session->engine);
  out->step = gv_session_steps(session);
  out->limb_coupling = gv_engine_config(session->engine)->limb;
  out->palm_coupling = gv_engine_config(session->engine)->palm;
  out->mu_hand = gv_engine_config(session->engine)->mu_hand;
  out->time_s = (double)out->step * session->cfg.period_s;
  out->safety = session->safety.state;
  out->faults = session->safety.faults;
  out->events = session->result.events;
  out->limiter_flags = session->limiter_flags;
  fill_devices(session, out);
  memcpy(out->desired_n, session->result.tension_n, sizeof out->desired_n);
  memcpy(out->force_n, session->force_n, sizeof out->force_n);
  memcpy(out->measured_n, session->status.tension_n, sizeof out->measured_n);
  fill_energy(&session->passivity, out);
  memcpy(out->angle_rad, gv_engine_angles_of(session->engine, hand), sizeof out->angle_rad);
  fill_limbs(session->engine, hand, out->limb);
  fill_objects(session->engine, object_count, out);
  fill_contacts(session->engine, hand, out);
  fill_polygons(session->engine, hand, out);
}

void gv_step_record_fill(const gv_session *session, int64_t now_ns, const gv_frame *frame, int count,
                         gv_step_record *out) {
  const gv_contact *contact = gv_engine_contacts(session->engine, &out->contacts);
  out->step = gv_session_steps(session);
  out->now_ns = now_ns;
  out->safety = session->safety.state;
  out->faults = session->safety.faults;
  out->events = session->result.events;
  out->depth_m = 0.0;
  for (int i = 0; i < out->contacts; i++)
    out->depth_m = fmax(out->depth_m, contact[i].depth_m);
  memcpy(out->desired_n, session->result.tension_n, sizeof out->desired_n);
  memcpy(out->force_n, session->force_n, sizeof out->force_n);
  out->frame_count = count;
  memcpy(out->frame, frame, (size_t)count * sizeof *frame);
}

gv_pose gv_snapshot_object_pose(const gv_object *object, gv_pose T_world_body) {
  return (gv_pose){T_world_body.q, gv_transform(T_world_body, gv_neg(object->center_m))};
}

static const char *engine_event_text(uint32_t bit) {
  switch ((gv_event)bit) {
    case GV_EVENT_HAND_PLACED: return "hand placed at the first sample";
    case GV_EVENT_SAMPLE_REFUSED: return "sample refused: not a finite number";
    case GV_EVENT_SAMPLE_JUMP:
      return "sample held back: a jump faster than a hand moves (gate_rad_s, gate_m_s)";
    case GV_EVENT_SAMPLE_NO_POSE: return "sample refused: no unit quaternion, or farther than 100 m";
    case GV_EVENT_CONTACTS_DROPPED: return "more contacts than GV_MAX_CONTACTS: the shallowest dropped";
    case GV_EVENT_PAIRS_DROPPED: return "more pairs than GV_MAX_PAIRS: the last dropped";
    case GV_EVENT_BODY_RESET: return "a body's state was not finite or ran away: put back";
    case GV_EVENT_OVERLAP: return "penetration beyond a limb's radius";
    case GV_EVENT_PAIRS_LEFT_OVER:
      return "too many pairs for the period: the least urgent left for the next step";
    case GV_EVENT_JOINT_BROKEN: return "a joint broke: it carried more than its break_force";
    case GV_EVENT_QUICKSTEP: return "a hard contact problem: quickstep did the step";
  }
  return "unknown event";
}

static const char *refusal_text(int kind) {
  switch (kind) {
    case GV_REQUEST_COUPLING:
      return "coupling.limb or coupling.palm would leave its bounds; give one nearer to 1";
    case GV_REQUEST_FRICTION: return "out of the bounds of contact.mu_hand; give one nearer to 0.8";
    default: return "not while a force may flow; disarm first";
  }
}

static void request_text(uint32_t bits, char out[GV_RECORD_TEXT]) {
  const int kind = (int)(bits & 0xff);
  const bool refused = (bits & GV_RECORD_REFUSED) != 0;
  snprintf(out, GV_RECORD_TEXT, "command %s: %s%s", gv_request_name(kind), refused ? "refused: " : "done",
           refused ? refusal_text(kind) : "");
}

static void record_text(const gv_record *record, char out[GV_RECORD_TEXT]) {
  switch (record->kind) {
    case GV_RECORD_STATE:
      snprintf(out, GV_RECORD_TEXT, "safety: %s -> %s%s%s", gv_safety_name(record->from),
               gv_safety_name(record->to), record->bits ? ": " : "",
               record->bits ? gv_fault_text(record->bits) : "");
      return;
    case GV_RECORD_ENGINE:
      snprintf(out, GV_RECORD_TEXT, "engine: %s", engine_event_text(record->bits));
      return;
    case GV_RECORD_OVERRUN: snprintf(out, GV_RECORD_TEXT, "loop: %u periods skipped", record->bits); return;
    case GV_RECORD_OTHER_HAND:
      snprintf(out, GV_RECORD_TEXT, "glove: made for the other hand; set hand.side in --config");
      return;
    case GV_RECORD_LADDER:
      snprintf(out, GV_RECORD_TEXT, "loop: deadline ladder: %s", gv_rung_name((gv_rung)record->bits));
      return;
    case GV_RECORD_SYNC:
      snprintf(out, GV_RECORD_TEXT, "sync: %s",
               record->bits ? "the glove's frames are the clock"
                            : "the glove's frames stay away: on by the loop's own clock");
      return;
    case GV_RECORD_REQUEST: request_text(record->bits, out); return;
  }
  snprintf(out, GV_RECORD_TEXT, "unknown record");
}

void gv_record_text(const gv_record *record, char out[GV_RECORD_TEXT]) {
  char text[GV_RECORD_TEXT];
  record_text(record, text);
  snprintf(out, GV_RECORD_TEXT, "%s%.100s", record->hand ? "second hand: " : "", text);
}
