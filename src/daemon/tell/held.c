// SPDX-License-Identifier: BSD-3-Clause
// Grasps in the stream of snapshots: two limbs or more touch an object that is above where it stood (held.h).
#include "daemon/tell/held.h"

#include <math.h>
#include <string.h>

static bool is_between_limbs(const gv_snapshot *s, int object) {
  uint32_t limbs = 0;
  for (int i = 0; i < s->contact_count; i++)
    if (s->contact[i].object == object && s->contact[i].limb >= 0)
      limbs |= 1u << s->contact[i].limb;
  return (limbs & (limbs - 1)) != 0;
}

// What has waited for the margin counts.
static void count(gv_held_object *o, const gv_held_recent *pose) {
  if (!o->counts) {
    o->counts = true;
    o->first = pose->p_palm;
    o->counted_s = pose->time_s;
  }
  o->seconds += pose->time_s - o->counted_s;
  o->counted_s = pose->time_s;
  o->moved_m = fmax(o->moved_m, gv_norm(gv_sub(pose->p_palm, o->first)));
  o->lift_m = fmax(o->lift_m, pose->lift_m);
}

static void take(gv_held_object *o, const gv_held_recent *pose) {
  int old = 0;
  if (pose->time_s - o->since_s < GV_HELD_MARGIN_S)
    return;
  while (old < o->recent_count &&
         (pose->time_s - o->recent[old].time_s > GV_HELD_MARGIN_S || o->recent_count - old == GV_HELD_RECENT))
    count(o, &o->recent[old++]);
  memmove(o->recent, o->recent + old, (size_t)(o->recent_count - old) * sizeof o->recent[0]);
  o->recent_count -= old;
  o->recent[o->recent_count++] = *pose;
}

static void watch(gv_held_object *o, const gv_object *object, const gv_snapshot *s, int number) {
  const gv_pose T_world_object = gv_snapshot_object_pose(object, s->object[number].T_world_body);
  const gv_pose T_palm_object = gv_pose_mul(gv_pose_inv(s->limb[GV_LIMB_PALM].T_world_limb), T_world_object);
  if (!o->started)
    o->start_m = T_world_object.p.z;
  o->started = true;
  const double lift_m = T_world_object.p.z - o->start_m;
  const bool holds = lift_m > GV_HELD_LIFT_M && is_between_limbs(s, number);
  const gv_vec3 palm = s->limb[GV_LIMB_PALM].T_world_limb.p;
  const bool rests = gv_norm(gv_sub(palm, o->palm_before)) <= GV_HELD_REST_M_S * (s->time_s - o->before_s);
  const bool begins = holds && !o->holds;
  if (begins)
    o->counts = false;
  if (begins || (holds && !o->counts && !rests)) {
    o->since_s = s->time_s;
    o->recent_count = 0;
  }
  o->holds = holds;
  o->palm_before = palm;
  o->before_s = s->time_s;
  if (holds)
    take(o, &(gv_held_recent){s->time_s, T_palm_object.p, lift_m});
}

void gv_held_snapshot(gv_held *held, const gv_scene *scene, const gv_snapshot *snapshot) {
  for (int i = 0; i < snapshot->object_count; i++)
    if (!scene->object[i].is_static)
      watch(&held->object[i], &scene->object[i], snapshot, i);
}
