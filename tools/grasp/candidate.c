// SPDX-License-Identifier: BSD-3-Clause
// Where a hand may take an object: a sequence of candidates that covers directions, heights and
// postures evenly (Halton 1960), each brought up to the object with open fingers, as far as distances
// allow, and clear of what does not move.
#include <stdio.h>

#include "tools/grasp/grasp.h"

static const double clearance_m = 0.0015;  // of the open hand from the object
static const double table_m = 0.002;       // of the open hand from what does not move
static const double reach_m = 0.20;        // the hand comes from so far

// The postures that close: a fist around a thing, one around a handle with the
// thumb along it, and fingertips.
typedef struct posture {
  const char *name;
  int count;
  struct {
    int sensor;
    double open_deg, closed_deg;
  } joint[GV_SENSORS];
} posture;

static const posture postures[GRASP_POSTURES] = {
  {"fist",
   18,
   {{GV_THUMB_ROTATE, -25, -25},
    {GV_THUMB_ABDUCTION, 60, 60},
    {GV_THUMB_MPJ, 10, 80},
    {GV_THUMB_IJ, 10, 60},
    {GV_INDEX_MPJ, 0, 75},
    {GV_INDEX_PIJ, 10, 100},
    {GV_INDEX_DIJ, 0, 70},
    {GV_MIDDLE_MPJ, 0, 75},
    {GV_MIDDLE_PIJ, 10, 100},
    {GV_MIDDLE_DIJ, 0, 70},
    {GV_RING_MPJ, 0, 75},
    {GV_RING_PIJ, 10, 100},
    {GV_RING_DIJ, 0, 70},
    {GV_LITTLE_MPJ, 0, 75},
    {GV_LITTLE_PIJ, 5, 100},
    {GV_LITTLE_DIJ, 0, 70},
    {GV_PALM_ARCH, 0, 0},
    {GV_WRIST_PITCH, 0, 0}}},
  {"clasp",
   16,
   {{GV_THUMB_ROTATE, -25, -25},
    {GV_THUMB_ABDUCTION, 60, 60},
    {GV_THUMB_MPJ, 10, 80},
    {GV_THUMB_IJ, 10, 30},
    {GV_INDEX_MPJ, 0, 25},
    {GV_INDEX_PIJ, 10, 100},
    {GV_INDEX_DIJ, 0, 65},
    {GV_MIDDLE_MPJ, 0, 25},
    {GV_MIDDLE_PIJ, 10, 100},
    {GV_MIDDLE_DIJ, 0, 65},
    {GV_RING_MPJ, 0, 20},
    {GV_RING_PIJ, 10, 90},
    {GV_RING_DIJ, 0, 60},
    {GV_LITTLE_MPJ, 0, 10},
    {GV_LITTLE_PIJ, 5, 70},
    {GV_LITTLE_DIJ, 0, 90}}},
  {"tips",
   16,
   {{GV_THUMB_ROTATE, -15, 15},
    {GV_THUMB_ABDUCTION, 55, 45},
    {GV_THUMB_MPJ, 0, 20},
    {GV_THUMB_IJ, 5, 30},
    {GV_INDEX_MPJ, 5, 45},
    {GV_INDEX_PIJ, 20, 70},
    {GV_INDEX_DIJ, 5, 10},
    {GV_MIDDLE_MPJ, 5, 45},
    {GV_MIDDLE_PIJ, 20, 70},
    {GV_MIDDLE_DIJ, 5, 10},
    {GV_RING_MPJ, 5, 45},
    {GV_RING_PIJ, 20, 70},
    {GV_RING_DIJ, 5, 10},
    {GV_LITTLE_MPJ, 5, 45},
    {GV_LITTLE_PIJ, 20, 70},
    {GV_LITTLE_DIJ, 5, 10}}},
};

static double halton(unsigned index, unsigned base) {
  double value = 0;
  double digit = 1;
  for (; index > 0; index /= base) {
    digit /= base;
    value += digit * (index % base);
  }
  return value;
}

static gv_quat turn(gv_vec3 axis, double degrees) {
  return gv_quat_axis_angle(axis, degrees * (GV_PI / 180));
}

static void open_angles(int kind, double out_rad[GV_SENSORS]) {
  for (int i = 0; i < GV_SENSORS; i++)
    out_rad[i] = 0;
  for (int i = 0; i < postures[kind].count; i++)
    out_rad[postures[kind].joint[i].sensor] = postures[kind].joint[i].open_deg * (GV_PI / 180);
}

static gv_shape limb_shape(const gv_hand_model *hand, int limb) {
  if (limb == GV_LIMB_PALM)
    return gv_shape_rounded_box(hand->palm_half_m, hand->palm_radius_m);
  return gv_shape_capsule(gv_hand_half_length(hand, limb), hand->radius_m[limb / 3][limb % 3]);
}

// Least distance of the open hand at the wrist's pose to the pieces of an object at T.
static double hand_distance(const grasp_search *s, const grasp_candidate *c, int object, gv_pose T) {
  const gv_hand_model *hand = &s->config->hand;
  const gv_object *o = &s->scene->object[object];
  double angle_rad[GV_SENSORS], least = HUGE_VAL;
  gv_pose T_world_limb[GV_LIMBS];
  open_angles(c->posture, angle_rad);
  gv_hand_frames(hand, &c->T_world_wrist, angle_rad, T_world_limb);
  for (int limb = 0; limb < GV_LIMBS; limb++) {
    const gv_shape a = limb_shape(hand, limb);
    for (int i = o->piece_first; i < o->piece_first + o->piece_count; i++) {
      const gv_shape b = gv_shape_hull(&s->scene->piece[i]);
      gv_pair_cache cache = {.corners = 0};
      gv_distance d;
      gv_distance_pair(GV_NARROW_CORE, &(gv_pair){&a, &T_world_limb[limb], &b, &T}, fmax(fmin(least, 0.5), 0),
                       &cache, &d);
      least = fmin(least, d.distance);
    }
  }
  return least;
}

static double static_distance(const grasp_search *s, const grasp_candidate *c) {
  double least = HUGE_VAL;
  for (int i = 0; i < s->scene->object_count; i++)
    if (s->scene->object[i].is_static)
      least = fmin(least, hand_distance(s, c, i, s->scene->object[i].T_world_body));
  return least;
}

// Up until it is clear of the table. False where that takes more than a hand's width.
static bool raise_hand(const grasp_search *s, grasp_candidate *io) {
  for (int i = 0; i < 20; i++) {
    const double d = static_distance(s, io);
    if (d >= table_m)
      return true;
    io->T_world_wrist.p.z += fmax(table_m - d, 0.001) + 1e-4;
  }
  return false;
}

// From far along `ahead`, by steps no longer than the distance, until the open hand nearly touches.
static bool bring_up(const grasp_search *s, gv_vec3 ahead, grasp_candidate *io) {
  double gone = 0;
  for (int i = 0; i < 60; i++) {
    const double d = hand_distance(s, io, s->object, s->T_world_object);
    if (d <= clearance_m + 5e-4)
      return true;
    io->T_world_wrist.p = gv_mad(io->T_world_wrist.p, d - clearance_m, ahead);
    gone += d - clearance_m;
    if (gone > 2 * reach_m + 2 * s->size_m)
      return false;
  }
  return true;
}

bool grasp_candidate_make(const grasp_search *s, unsigned seed, int number, grasp_candidate *out) {
  static const double rolls_deg[] = {90, 90, 60, 30, 0, 0};
  static const double tight[] = {1.0, 0.8, 0.9, 0.7};
  const unsigned i = seed * 1009u + (unsigned)number + 1;
  const int posture_of[] = {0, 1, 0, 1, 2};
  *out = (grasp_candidate){
    .number = number,
    .yaw_deg = 360 * halton(i, 2),
    .roll_deg = rolls_deg[(int)(6 * halton(i, 3))],
    .height = 0.25 + 0.6 * halton(i, 5),
    .along_m = 0.055 + 0.06 * halton(i, 7),
    .posture = posture_of[(int)(5 * halton(i, 11))],
    .tightness = tight[(int)(4 * halton(i, 13))],
  };
  const gv_quat roll = turn(gv_v3(1, 0, 0), out->roll_deg);
  const gv_quat q = gv_quat_mul(turn(gv_v3(0, 0, 1), out->yaw_deg), roll);
  const gv_vec3 ahead = gv_rotate(q, gv_v3(0, 0, -1));  // where the palm looks
  const gv_vec3 fingers = gv_rotate(q, gv_v3(1, 0, 0));
  gv_vec3 middle = s->T_world_object.p;  // the centre of mass, at the height that was drawn
  middle.z = s->low.z + out->height * (s->high.z - s->low.z);
  out->T_world_wrist.q = q;
  out->T_world_wrist.p = gv_mad(gv_mad(middle, -out->along_m, fingers), -(reach_m + s->size_m), ahead);
  if (!raise_hand(s, out) || !bring_up(s, ahead, out) || static_distance(s, out) < table_m)
    return false;
  out->back_m = gv_scale(ahead, -reach_m);
  return true;
}

static int put_posture(const grasp_candidate *c, const char *name, double share, char *out, size_t size) {
  const posture *p = &postures[c->posture];
  size_t at = 0;
  for (int i = 0; i < p->count && at < size; i++) {
    const double angle = p->joint[i].open_deg + share * (p->joint[i].closed_deg - p->joint[i].open_deg);
    if (i % 6 == 0)
      at += (size_t)snprintf(out + at, size - at, "%sposture %s", i ? "\n" : "", name);
    if (at < size)
      at += (size_t)snprintf(out + at, size - at, "  %s %.1f", gv_sensor_name(p->joint[i].sensor), angle);
  }
  if (at < size)
    at += (size_t)snprintf(out + at, size - at, "\n");
  return (int)at;
}

static int put_pose(gv_vec3 p, const grasp_candidate *c, char *out, size_t size) {
  const gv_vec3 w = gv_add(c->T_world_wrist.p, p);
  return snprintf(out, size, "wrist %.4f %.4f %.4f  %.1f 0.0 %.1f", w.x, w.y, w.z, c->roll_deg, c->yaw_deg);
}

int grasp_script(const grasp_candidate *c, const char *comment, char *out, size_t size) {
  char from[120], there[120], lifted[120], open[800], closed[800];
  put_pose(c->back_m, c, from, sizeof from);
  put_pose(gv_v3(0, 0, 0), c, there, sizeof there);
  put_pose(gv_v3(0, 0, 0.15), c, lifted, sizeof lifted);
  put_posture(c, "open", 0, open, sizeof open);
  put_posture(c, "grip", c->tightness, closed, sizeof closed);
  return snprintf(
      out, size,
      "%s# Angles in degrees, lengths in metres, times in seconds; format: include/gloved/sim.h.\n"
      "%s%s\n"
      "at 0.0  posture open  %s  dead_man off\n"
      "at %.1f  dead_man on\n"
      "at %.1f  %s\n"
      "at %.1f  posture grip\n"
      "at %.1f\n"
      "at %.1f  %s\n"
      "at %.1f  dead_man off\n"
      "end %.1f\n",
      comment, open, closed, from, GRASP_ARMED_MS / 1e3, GRASP_THERE_MS / 1e3, there, GRASP_CLOSED_MS / 1e3,
      GRASP_LIFT_MS / 1e3, GRASP_LIFTED_MS / 1e3, lifted, GRASP_END_MS / 1e3 + 1, GRASP_END_MS / 1e3 + 1.3);
}
