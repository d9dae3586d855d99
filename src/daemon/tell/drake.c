// SPDX-License-Identifier: BSD-3-Clause
// Hand model and scene to the viewer's shapes (once), snapshot to their poses (20 times a second). The viewer
// dies of a quaternion that is not of unit length, of a radius of zero and of a wrong count of numbers: none
// of them leaves here. Slow thread.
#include "daemon/tell/drake.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "daemon/tell/thin.h"

// Order of the links.
enum {
  HAND = 0,
  GLOVE = GV_LIMBS,
  HEAD = 2 * GV_LIMBS,
  CONTACTS = HEAD + 1,
  PER_CONTACT = 2 + GV_DRAKE_SHAFTS,                   // dot, arrow head, shafts
  SECOND = CONTACTS + GV_DRAKE_CONTACTS * PER_CONTACT  // of a second hand, then the objects
};

// Rounded box: 12 meridians and 6 parallels of a sphere, none of them in a plane of symmetry, so that each
// vertex belongs to one corner of the box.
enum { MERIDIANS = 12, PARALLELS = 6, TIP_SIDES = 6 };

static const double tiny_m = 1e-4;  // instead of zero
static const double dot_radius_m = 0.0022, shaft_radius_m = 0.0011, tip_radius_m = 0.0028,
                    tip_length_m = 0.008;
// each at most as long as those before it together
static const double shaft_m[GV_DRAKE_SHAFTS] = {0.02, 0.02, 0.04, 0.08};
static const double force_scale_m_per_n = 0.025, arrow_max_m = 0.168;
static const double head_depth_m = 0.12, head_half_m = 0.05;

static const float hand_color[4] = {0.93f, 0.72f, 0.58f, 0.65f},
                   glove_color[4] = {0.35f, 0.55f, 0.95f, 0.15f},
                   static_color[4] = {0.55f, 0.57f, 0.62f, 1.0f}, dot_color[4] = {0.85f, 0.10f, 0.10f, 1.0f},
                   force_color[4] = {0.10f, 0.45f, 0.10f, 1.0f}, head_color[4] = {0.30f, 0.30f, 0.35f, 0.35f};
static const float object_color[4][4] = {{0.25f, 0.60f, 0.75f, 1.0f},
                                         {0.60f, 0.70f, 0.25f, 1.0f},
                                         {0.55f, 0.45f, 0.75f, 1.0f},
                                         {0.85f, 0.55f, 0.20f, 1.0f}};

static const gv_quat z_to_x = {0.70710678118654752, 0.0, 0.70710678118654752, 0.0};  // a quarter turn about y
static const gv_pose hidden = {{1.0, 0.0, 0.0, 0.0}, {0.0, 0.0, -100.0}};

// ---- shapes -------------------------------------------------------------------------------------------

static gv_drake_link *add_link(gv_drake *drake, gv_drake_type type, const float color[4], const char *folder,
                               const char *name) {
  gv_drake_link *link = &drake->link[drake->link_count++];
  snprintf(link->name, sizeof link->name, "%s::%s", folder, name);
  link->type = type;
  link->p_link_shape = gv_v3(0, 0, 0);
  link->q_link_shape = gv_quat_identity();
  memcpy(link->color, color, sizeof link->color);
  link->number_first = drake->number_count;
  link->number_count = 0;
  return link;
}

// What does not fit leaves the link without a shape.
static void add_numbers(gv_drake *drake, gv_drake_link *link, const float *number, int count) {
  if (drake->number_count + count > GV_DRAKE_NUMBERS)
    return;
  memcpy(&drake->number[drake->number_count], number, (size_t)count * sizeof *number);
  drake->number_count += count;
  link->number_count = count;
}

static int put_point(float *out, gv_vec3 v) {
  out[0] = (float)v.x;
  out[1] = (float)v.y;
  out[2] = (float)v.z;
  return 3;
}

static int put_triangle(float *out, int a, int b, int c) {
  out[0] = (float)a;
  out[1] = (float)b;
  out[2] = (float)c;
  return 3;
}

static gv_vec3 rounded_box_vertex(gv_vec3 half, double radius, int parallel, int meridian) {
  double sin_lat, cos_lat, sin_lon, cos_lon;
  gv_sincos(GV_PI * ((parallel + 0.5) / PARALLELS - 0.5), &sin_lat, &cos_lat);
  gv_sincos(2.0 * GV_PI * (meridian + 0.5) / MERIDIANS, &sin_lon, &cos_lon);
  const gv_vec3 n = gv_v3(cos_lat * cos_lon, cos_lat * sin_lon, sin_lat);
  return gv_mad(gv_v3(copysign(half.x, n.x), copysign(half.y, n.y), copysign(half.z, n.z)), radius, n);
}

static void add_rounded_box(gv_drake *drake, gv_drake_link *link, gv_vec3 half, double radius) {
  enum {
    VERTICES = MERIDIANS * PARALLELS,
    TRIANGLES = 2 * MERIDIANS * (PARALLELS - 1) + 2 * (MERIDIANS - 2)
  };
  float number[2 + 3 * VERTICES + 3 * TRIANGLES] = {VERTICES, TRIANGLES};
  const int top = (PARALLELS - 1) * MERIDIANS;
  int n = 2;
  for (int i = 0; i < PARALLELS; i++)
    for (int k = 0; k < MERIDIANS; k++)
      n += put_point(&number[n], rounded_box_vertex(half, radius, i, k));
  for (int i = 0; i + 1 < PARALLELS; i++) {
    for (int k = 0; k < MERIDIANS; k++) {
      const int a = i * MERIDIANS + k;
      const int b = i * MERIDIANS + (k + 1) % MERIDIANS;
      n += put_triangle(&number[n], a, b, b + MERIDIANS);
      n += put_triangle(&number[n], a, b + MERIDIANS, a + MERIDIANS);
    }
  }
  for (int k = 1; k + 1 < MERIDIANS; k++) {
    n += put_triangle(&number[n], 0, k + 1, k);
    n += put_triangle(&number[n], top, top + k, top + k + 1);
  }
  add_numbers(drake, link, number, n);
}

// A cone with `sides` corners of its base, tip at the origin, axis from -z.
static void add_cone(gv_drake *drake, gv_drake_link *link, int sides, double radius_x, double radius_y,
                     double length, double first_corner) {
  float number[2 + 3 * (1 + 8) + 3 * (2 * 8 - 2)] = {(float)(sides + 1), (float)(2 * sides - 2)};
  int n = 2;
  n += put_point(&number[n], gv_v3(0, 0, 0));
  for (int i = 0; i < sides; i++) {
    double s, c;
    gv_sincos(2.0 * GV_PI * (i + first_corner) / sides, &s, &c);
    n += put_point(&number[n], gv_v3(radius_x * c, radius_y * s, -length));
  }
  for (int i = 0; i < sides; i++)
    n += put_triangle(&number[n], 0, 1 + i, 1 + (i + 1) % sides);
  for (int i = 1; i + 1 < sides; i++)
    n += put_triangle(&number[n], 1, 1 + i + 1, 1 + i);
  add_numbers(drake, link, number, n);
}

static void add_limbs(gv_drake *drake, const gv_hand_model *hand, const char *folder, const float color[4]) {
  for (int i = 0; i < GV_LIMB_PALM; i++) {
    gv_drake_link *link = add_link(drake, GV_DRAKE_CAPSULE, color, folder, gv_limb_name(i));
    link->q_link_shape = z_to_x;
    const float size[2] = {(float)fmax(hand->radius_m[i / 3][i % 3], tiny_m),
                           (float)fmax(2.0 * gv_hand_half_length(hand, i), tiny_m)};
    add_numbers(drake, link, size, 2);
  }
  gv_drake_link *palm = add_link(drake, GV_DRAKE_MESH, color, folder, gv_limb_name(GV_LIMB_PALM));
  add_rounded_box(drake, palm, hand->palm_half_m, fmax(hand->palm_radius_m, tiny_m));
}

// What the head sees begins at its receiver and widens along its x.
static void add_head(gv_drake *drake) {
  gv_drake_link *link = add_link(drake, GV_DRAKE_MESH, head_color, "head", "view");
  link->q_link_shape = gv_quat_axis_angle(gv_v3(0, 1, 0), -0.5 * GV_PI);
  add_cone(drake, link, 4, head_half_m, head_half_m * 1.4, head_depth_m, 0.5);
}

static void add_contact(gv_drake *drake, int number) {
  char name[16];
  snprintf(name, sizeof name, "%d", number);
  add_numbers(drake, add_link(drake, GV_DRAKE_SPHERE, dot_color, "contacts", name),
              &(const float){(float)dot_radius_m}, 1);
  snprintf(name, sizeof name, "%d-tip", number);
  add_cone(drake, add_link(drake, GV_DRAKE_MESH, force_color, "forces", name), TIP_SIDES, tip_radius_m,
           tip_radius_m, tip_length_m, 0.0);
  for (int i = 0; i < GV_DRAKE_SHAFTS; i++) {
    snprintf(name, sizeof name, "%d-%d", number, i);
    const float size[2] = {(float)shaft_radius_m, (float)shaft_m[i]};
    add_numbers(drake, add_link(drake, GV_DRAKE_CYLINDER, force_color, "forces", name), size, 2);
  }
}

static gv_mesh mesh_of(const gv_scene *scene, int object) {
  const gv_object *o = &scene->object[object];
  if (o->triangle_count == 0)
    return (gv_mesh){0};
  return (gv_mesh){&scene->mesh_vertex[o->vertex_first], &scene->mesh_triangle[o->triangle_first],
                   o->vertex_count, o->triangle_count};
}

// The most floats that one object may take so that all of them fit into `room`.
static int fair_share(const gv_scene *scene, int room) {
  for (int share = room;; share -= 1 + share / 50) {
    int sum = 0;
    for (int i = 0; i < scene->object_count; i++) {
      const gv_mesh mesh = mesh_of(scene, i);
      const int own = gv_thin_size(&mesh);
      sum += own < share ? own : share;
    }
    if (sum <= room)
      return share;
  }
}

static void add_objects(gv_drake *drake, const gv_scene *scene) {
  int color = 0;
  const int share = fair_share(scene, GV_DRAKE_NUMBERS - drake->number_count);
  for (int i = 0; i < scene->object_count; i++) {
    const gv_object *object = &scene->object[i];
    const gv_mesh mesh = mesh_of(scene, i);
    gv_drake_link *link = add_link(drake, GV_DRAKE_MESH,
                                   object->is_static ? static_color : object_color[color++ % 4], "objects",
                                   object->name);
    link->p_link_shape = object->center_m;
    link->number_count = gv_thin_mesh(&mesh, &drake->number[drake->number_count], share);
    drake->number_count += link->number_count;
  }
}

void gv_drake_init(gv_drake *drake, const gv_hand_model *hand, const gv_hand_model *second,
                   const gv_scene *scene) {
  drake->scene = scene;
  drake->link_count = drake->number_count = 0;
  add_limbs(drake, hand, "hand", hand_color);
  add_limbs(drake, hand, "glove", glove_color);
  add_head(drake);
  for (int i = 0; i < GV_DRAKE_CONTACTS; i++)
    add_contact(drake, i);
  drake->second_first = second ? drake->link_count : -1;
  drake->second_contacts = 0;
  if (second) {
    add_limbs(drake, second, "hand2", hand_color);
    add_limbs(drake, second, "glove2", glove_color);
  }
  drake->objects_first = drake->link_count;
  add_objects(drake, scene);
  for (int i = SECOND; i < drake->objects_first; i++)
    drake->T_world_link[i] = hidden;
}

// ---- poses --------------------------------------------------------------------------------------------

static gv_pose sound(gv_pose T) {
  if (!gv_pose_finite(T) || gv_norm(T.p) > 1e6)
    return hidden;
  return (gv_pose){gv_quat_normalize(T.q), T.p};
}

// The shortest rotation that turns z onto the unit vector n.
static gv_quat turn_z_onto(gv_vec3 n) {
  if (n.z < -0.999999)
    return (gv_quat){0.0, 1.0, 0.0, 0.0};
  return gv_quat_normalize((gv_quat){1.0 + n.z, -n.y, n.x, 0.0});
}

// A force from p on: shafts that reach from p to the arrow's head. One that would be longer than the whole is
// left away; the rest covers it, since each shaft is at most as long as all before it together.
static void place_arrow(gv_pose *part, gv_vec3 p, gv_vec3 force_n) {
  const double length = fmin(gv_norm(force_n) * force_scale_m_per_n, arrow_max_m);
  const double shaft = length - tip_length_m;
  const gv_vec3 n = gv_normalize_or(force_n, gv_v3(0, 0, 1));
  const gv_quat q = turn_z_onto(n);
  double end = 0.0;
  for (int i = 0; i <= GV_DRAKE_SHAFTS; i++)
    part[i] = hidden;
  if (!(length > 0.5 * tip_length_m))
    return;
  part[0] = (gv_pose){q, gv_mad(p, fmax(length, tip_length_m), n)};
  for (int i = 0; i < GV_DRAKE_SHAFTS; i++) {
    if (i > 0 && shaft < shaft_m[i])
      continue;
    end = fmin(end + shaft_m[i], shaft);
    if (shaft > 0.0)
      part[1 + i] = (gv_pose){q, gv_mad(p, end - 0.5 * shaft_m[i], n)};
  }
}

// The strongest contacts, strongest first, equal ones in their order; returns how many.
static int choose_contacts(const gv_contact *of, int of_count, int count,
                           const gv_contact *out[GV_DRAKE_CONTACTS]) {
  for (int i = 0; i < of_count; i++) {
    const gv_contact *contact = &of[i];
    int place = count;
    for (; place > 0 && gv_norm2(out[place - 1]->force_world) < gv_norm2(contact->force_world); place--)
      if (place < GV_DRAKE_CONTACTS)
        out[place] = out[place - 1];
    if (place < GV_DRAKE_CONTACTS)
      out[place] = contact;
    if (count < GV_DRAKE_CONTACTS)
      count++;
  }
  return count;
}

static void place_contacts(gv_drake *drake, const gv_snapshot *snapshot) {
  const gv_contact *contact[GV_DRAKE_CONTACTS];
  int count = choose_contacts(snapshot->contact, snapshot->contact_count, 0, contact);
  count = choose_contacts(drake->second_contact, drake->second_contacts, count, contact);
  for (int i = 0; i < GV_DRAKE_CONTACTS; i++) {
    gv_pose *part = &drake->T_world_link[CONTACTS + i * PER_CONTACT];
    for (int k = 0; k < PER_CONTACT; k++)
      part[k] = hidden;
    if (i >= count)
      continue;
    part[0].p = contact[i]->position_world;
    place_arrow(&part[1], contact[i]->position_world, contact[i]->force_world);
  }
}

static void place_limbs(gv_pose T[2 * GV_LIMBS], bool hand_seen, const gv_snapshot *snapshot) {
  for (int i = 0; i < GV_LIMBS; i++) {
    T[i] = hand_seen ? snapshot->limb[i].T_world_limb : hidden;
    T[GLOVE + i] = hand_seen ? snapshot->limb[i].T_world_driver : hidden;
  }
}

// Contacts between objects are drawn with the first hand.
void gv_drake_update_second(gv_drake *drake, const gv_snapshot *snapshot) {
  const gv_contact *contact[GV_DRAKE_CONTACTS];
  int count = choose_contacts(snapshot->contact, snapshot->contact_count, 0, contact);
  drake->second_contacts = 0;
  for (int i = 0; i < count; i++)
    if (contact[i]->limb >= 0)
      drake->second_contact[drake->second_contacts++] = *contact[i];
  if (drake->second_first >= 0)
    place_limbs(&drake->T_world_link[drake->second_first], snapshot->hand_seen, snapshot);
}

void gv_drake_update(gv_drake *drake, const gv_snapshot *snapshot) {
  gv_pose *T = drake->T_world_link;
  const bool hand_seen = snapshot->counters.samples > 0;
  place_limbs(&T[HAND], hand_seen, snapshot);
  T[HEAD] = snapshot->head_seen ? snapshot->T_world_head : hidden;
  place_contacts(drake, snapshot);
  for (int i = 0; i < snapshot->object_count; i++)
    T[drake->objects_first + i] = gv_snapshot_object_pose(&drake->scene->object[i],
                                                          snapshot->object[i].T_world_body);
  for (int i = 0; i < drake->link_count; i++)
    T[i] = sound(T[i]);
}
