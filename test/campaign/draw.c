// SPDX-License-Identifier: BSD-3-Clause
// Random grasps (draw.h): scripts and scenes of the project, varied.
#include "campaign/draw.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "daemon/load/scene_load.h"
#include "support/shapes.h"

static const double deg = GV_PI / 180.0;
static const double hold_s = 4.0;                      // from the lift's end to the script's
static const gv_vec3 scripted_m = {0.06, 0.06, 0.08};  // the box that the scripts are made for

// xorshift64*
static double uniform(unsigned long long *random, double lo, double hi) {
  *random ^= *random >> 12;
  *random ^= *random << 25;
  *random ^= *random >> 27;
  return lo + (hi - lo) * (double)((*random * 2685821657736338717ULL) >> 11) / 9007199254740992.0;
}

static bool chance(unsigned long long *random, double p) { return uniform(random, 0.0, 1.0) < p; }
static int any(unsigned long long *random, int count) { return (int)uniform(random, 0.0, count) % count; }

// As many light ones as heavy ones.
static double uniform_log(unsigned long long *random, double lo, double hi) {
  return lo * exp(uniform(random, 0.0, log(hi / lo)));
}

// Any direction, any length up to `most`.
static gv_vec3 draw_off(unsigned long long *random, double most) {
  const double z = uniform(random, -1.0, 1.0);
  const double turn = uniform(random, 0.0, 2.0 * GV_PI);
  const double r = sqrt(1.0 - z * z);
  return gv_scale(gv_v3(r * cos(turn), r * sin(turn), z), uniform(random, 0.0, most));
}

static void draw_box(unsigned long long *random, drawn *out) {
  static const char *const script[] = {"power_box", "pinch_box", "tripod_box"};
  out->shape = "box";
  out->script = script[any(random, 3)];
  out->size_m.x = uniform(random, 0.045, 0.12);
  out->size_m.y = uniform(random, 0.045, 0.12);
  out->size_m.z = uniform(random, 0.045, 0.12);
}

static void draw_shape(unsigned long long *random, drawn *out) {
  const double kind = uniform(random, 0.0, 1.0);
  if (kind < 0.4) {
    draw_box(random, out);
    return;
  }
  if (kind < 0.6) {
    const double radius = uniform(random, 0.02, 0.05);
    out->shape = "ball";
    out->script = chance(random, 0.7) ? "power_box" : "tripod_box";
    out->size_m = gv_v3(radius, radius, radius);
    return;
  }
  const shape_grasp *grasp = &shape_grasps[any(random, SHAPE_GRASPS)];
  out->shape = grasp->scene;
  out->script = grasp->script;
}

static void draw_user(unsigned long long *random, drawn *out) {
  out->grip = uniform(random, 0.8, 1.2);
  out->tempo = uniform(random, 0.6, 1.5);
  out->real = chance(random, 1.0 / 3.0);
  if (!chance(random, 1.0 / 3.0))
    return;
  out->sway_rad = uniform(random, 0.0, 0.03);
  out->tremor_rad = uniform(random, 0.0, 0.002);
}

bool draw(const char *family, unsigned long long seed, drawn *out) {
  const bool boxes = strcmp(family, "boxes") == 0;
  unsigned long long random = seed * 0x9e3779b97f4a7c15ULL + 0x2545f4914f6cdd1dULL;
  for (int i = 0; i < 8; i++)
    uniform(&random, 0.0, 1.0);  // seeds that are neighbours part
  *out = (drawn){.seed = seed, .family = boxes ? "boxes" : "any", .grip = 1.0, .tempo = 1.0};
  if (boxes)
    draw_box(&random, out);
  else
    draw_shape(&random, out);
  out->mass_kg = boxes ? uniform_log(&random, 0.03, 1.0) : uniform_log(&random, 0.01, 2.0);
  out->mu = boxes ? uniform(&random, 0.4, 1.2) : uniform(&random, 0.2, 1.4);
  out->off_m = draw_off(&random, 0.012);
  out->off_rad = draw_off(&random, 12.0 * deg);
  if (!boxes)
    draw_user(&random, out);
  return boxes || strcmp(family, "any") == 0;
}

// ---- scene ------------------------------------------------------------------------------------------------

static int load_simple(const drawn *d, gv_arena *arena, gv_scene *out, char *err, size_t err_size) {
  char text[1024], what[128];
  const bool ball = strcmp(d->shape, "ball") == 0;
  const double middle = ball ? d->size_m.x : 0.5 * d->size_m.z;
  if (ball)
    snprintf(what, sizeof what, "ball = %.9f;", d->size_m.x);
  else
    snprintf(what, sizeof what, "box = [%.9f, %.9f, %.9f];", d->size_m.x, d->size_m.y, d->size_m.z);
  snprintf(text, sizeof text,
           "version = 1;\nobjects = (\n"
           "  { name = \"table\"; static = true; mu = 0.8; box = [1.2, 0.8, 0.04]; position = [0.0, 0.0, "
           "-0.02]; },\n"
           "  { name = \"%s\"; mass = 0.2; mu = 0.8; %s position = [0.0, 0.0, %.9f]; }\n);\n",
           d->shape, what, middle);
  return gv_scene_load_text("drawn", text, arena, out, err, err_size);
}

// Another mass and another friction than the file says.
static void change_object(gv_object *o, const drawn *d) {
  const double factor = d->mass_kg / o->mass_kg;
  for (int i = 0; i < 9; i++)
    o->inertia_kg_m2.m[i / 3][i % 3] *= factor;
  o->mass_kg = d->mass_kg;
}

static int build_scene(const drawn *d, gv_arena *arena, gv_scene *out, char *err, size_t err_size) {
  char path[128];
  snprintf(path, sizeof path, "build/scenes/%s.scene", d->shape);
  if (d->size_m.x > 0.0) {
    if (load_simple(d, arena, out, err, err_size))
      return -1;
  } else if (access(path, R_OK))
    return 1;
  else if (gv_scene_load(path, arena, out, err, err_size))
    return -1;
  gv_object *object = gv_arena_alloc(arena, "drawn objects", sizeof *object * (size_t)out->object_count);
  if (!object || out->object_count != 2 || out->friction_pair_count) {
    snprintf(err, err_size, "%s: no table and one object", d->shape);
    return -1;
  }
  memcpy(object, out->object, sizeof *object * (size_t)out->object_count);
  for (int i = 0; i < out->object_count; i++)
    object[i].mu = d->mu;
  change_object(&object[1], d);
  out->object = object;
  return 0;
}

// ---- script -----------------------------------------------------------------------------------------------

// The hand comes along y: it meets the object's side where it met the scripted box's.
static gv_vec3 fit_to_size(const drawn *d) {
  if (!(d->size_m.x > 0.0))
    return gv_v3(0, 0, 0);
  const double half = strcmp(d->shape, "ball") == 0 ? d->size_m.x : 0.5 * d->size_m.y;
  return gv_v3(0, 0.5 * scripted_m.y - half, 0);
}

static bool is_same_posture(const gv_sim_keyframe *a, const gv_sim_keyframe *b) {
  return memcmp(a->angle_rad, b->angle_rad, sizeof a->angle_rad) == 0;
}

// Of all scripts here: ..., posture shape, posture grip (the same from then on),
// wrist up, dead-man switch off.
static int find_parts(gv_sim_script *s, int *out_shape, drawn *d) {
  int grip = s->keyframe_count - 2, up;
  if (grip < 2)
    return -1;
  up = grip;
  while (grip > 0 && is_same_posture(&s->keyframe[grip - 1], &s->keyframe[up]))
    grip--;
  if (grip < 1 || grip >= up)
    return -1;
  *out_shape = grip - 1;
  d->grasp_s = d->tempo * s->keyframe[grip].time_s;
  d->lifted_s = d->tempo * s->keyframe[up].time_s;
  d->lift_m = s->keyframe[up].T_world_wrist.p.z - s->keyframe[grip].T_world_wrist.p.z;
  s->keyframe_count = up + 1;
  return 0;
}

// arrived: the hand is where it grasps. Before, it is level and 30 mm higher: no
// finger starts inside the table.
static void change_keyframe(gv_sim_keyframe *key, const gv_sim_keyframe *shape, bool arrived,
                            const drawn *d) {
  const gv_vec3 off = gv_add(gv_add(d->off_m, fit_to_size(d)), gv_v3(0, 0, arrived ? 0.0 : 0.03));
  key->time_s *= d->tempo;
  key->T_world_wrist.p = gv_add(key->T_world_wrist.p, off);
  if (arrived)
    key->T_world_wrist.q = gv_quat_normalize(gv_quat_mul(key->T_world_wrist.q, gv_quat_exp(d->off_rad)));
  for (int i = 0; shape && i < GV_SENSORS; i++)
    key->angle_rad[i] = shape->angle_rad[i] + d->grip * (key->angle_rad[i] - shape->angle_rad[i]);
}

static int build_script(drawn *d, gv_sim_script *s, char *err, size_t err_size) {
  char path[128];
  int shape;
  snprintf(path, sizeof path, "data/scripts/%s.user", d->script);
  if (gv_sim_script_load(path, s, err, err_size))
    return -1;
  if (find_parts(s, &shape, d)) {
    snprintf(err, err_size, "%s: no grip that is lifted", path);
    return -1;
  }
  const gv_sim_keyframe from = s->keyframe[shape];
  const gv_vec3 away = s->keyframe[0].T_world_wrist.p;
  bool arrived = false;
  for (int i = 0; i < s->keyframe_count; i++) {
    arrived = arrived || gv_norm(gv_sub(s->keyframe[i].T_world_wrist.p, away)) > 0.0;
    change_keyframe(&s->keyframe[i], i > shape ? &from : NULL, arrived, d);
  }
  s->end_s = d->lifted_s + hold_s;
  s->device = d->real ? gv_sim_device_real() : gv_sim_device_best();
  s->device.sway_rad = d->sway_rad;
  s->device.sway_m = d->sway_rad > 0.0 ? 0.002 : 0.0;
  s->device.tremor_rad = d->tremor_rad;
  s->seed = d->seed;
  return 0;
}

int draw_build(drawn *d, gv_arena *arena, gv_scene *out_scene, gv_sim_script *out_script, char *err,
               size_t err_size) {
  if (build_script(d, out_script, err, err_size))
    return -1;
  return build_scene(d, arena, out_scene, err, err_size);
}
