// SPDX-License-Identifier: BSD-3-Clause
// Doubts about a scene (scene_doubts.h): each object by itself, then each pair. Main
// thread, before the loop starts.
#include "daemon/load/scene_doubts.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>

#include "gloved/narrow.h"

static const double most_sinking_m = 1e-3, least_overlap_m = 1e-4;
static const double most_kg = 20.0, least_kg = 1e-3;                 // what a hand lifts, and what it feels
static const double most_m = 1.0, least_m = 5e-3;                    // longest edge of what a hand grasps
static const double heaviest_kg_m3 = 25000.0, lightest_kg_m3 = 1.0;  // beyond platinum; lighter than air

typedef struct doubts {
  const gv_scene *scene;
  const gv_config *cfg;
  gv_doubt *out;
  int count, max;
} doubts;

__attribute__((format(printf, 2, 3))) static void doubt(doubts *d, const char *format, ...) {
  va_list args;
  va_start(args, format);
  if (d->count < d->max)
    vsnprintf(d->out[d->count].text, sizeof d->out[d->count].text, format, args);
  va_end(args);
  d->count++;
}

static bool within(double x, double lo, double hi) { return x >= lo && x <= hi; }

// ---- one object -------------------------------------------------------------------------------------------

// On so many points it rests at the least: a ball on one, a capsule on two, another object on three or four.
static int resting_points(const gv_scene *scene, const gv_object *o) {
  const int corners = scene->piece[o->piece_first].vertex_count;
  return o->piece_count == 1 && corners < 3 ? corners : 4;
}

static double volume_of(const gv_scene *scene, const gv_object *o) {
  double volume = 0.0;
  for (int i = 0; i < o->piece_count; i++)
    volume += gv_hull_mass_properties(&scene->piece[o->piece_first + i]).volume;
  return volume;
}

// The longest edge of the bounds along its own axes.
static double size_of(const gv_scene *scene, const gv_object *o) {
  gv_vec3 low = gv_v3(HUGE_VAL, HUGE_VAL, HUGE_VAL);
  gv_vec3 high = gv_scale(low, -1.0);
  for (int i = 0; i < o->piece_count; i++) {
    const gv_hull *piece = &scene->piece[o->piece_first + i];
    const gv_vec3 r = gv_v3(piece->radius, piece->radius, piece->radius);
    const gv_vec3 from = gv_sub(piece->aabb_min, r);
    const gv_vec3 to = gv_add(piece->aabb_max, r);
    low = gv_v3(fmin(low.x, from.x), fmin(low.y, from.y), fmin(low.z, from.z));
    high = gv_v3(fmax(high.x, to.x), fmax(high.y, to.y), fmax(high.z, to.z));
  }
  const gv_vec3 edges = gv_sub(high, low);
  return fmax(edges.x, fmax(edges.y, edges.z));
}

static double mass_of(const doubts *d, const gv_object *o) {
  return d->cfg->override_mass_kg > 0.0 ? d->cfg->override_mass_kg : o->mass_kg;
}

// What the number would be in the unit that was likely meant.
static const char *guess_size_unit(double size_m) {
  if (within(size_m * 1e-3, 0.02, 0.5))
    return "; millimetres taken as metres? multiply by 0.001";
  if (within(size_m * 1e-2, 0.01, 0.5))
    return "; centimetres taken as metres? multiply by 0.01";
  if (within(size_m * 1e3, 0.01, 0.5))
    return "; metres taken as millimetres? multiply by 1000";
  if (within(size_m * 1e2, 0.01, 0.5))
    return "; metres taken as centimetres? multiply by 100";
  return "";
}

static const char *guess_mass_unit(double mass_kg, double volume_m3) {
  const double water_kg = 1000.0 * volume_m3;
  if (within(mass_kg * 1e-3, 0.005 * water_kg, 25.0 * water_kg))
    return "; grams taken as kilograms? multiply by 0.001";
  if (within(mass_kg * 1e3, 0.005 * water_kg, 25.0 * water_kg))
    return "; kilograms taken as grams? multiply by 1000";
  return "; or is its size in another unit?";
}

static void doubt_size(doubts *d, const gv_object *o) {
  const double size = size_of(d->scene, o);
  if (size > most_m)
    doubt(d, "'%s' is %.3g m long, which no hand grasps%s", o->name, size, guess_size_unit(size));
  if (size < least_m)
    doubt(d, "'%s' is %.3g mm long, thinner than a fingertip feels%s", o->name, size * 1e3,
          guess_size_unit(size));
}

static void doubt_mass(doubts *d, const gv_object *o) {
  const double mass = mass_of(d, o);
  const double volume = volume_of(d->scene, o);
  const double density = mass / volume;
  const char *unit = guess_mass_unit(mass, volume);
  if (density > heaviest_kg_m3)
    doubt(d, "'%s' has %.3g kg and %.3g times the density of water%s", o->name, mass, density / 1000.0, unit);
  else if (density < lightest_kg_m3)
    doubt(d, "'%s' has %.3g kg and is lighter than air%s", o->name, mass, unit);
  else if (mass > most_kg)
    doubt(d, "'%s' has %.3g kg, which no hand lifts%s", o->name, mass, within(mass, 20.0, 50.0) ? "" : unit);
  else if (mass < least_kg)
    doubt(d, "'%s' has %.3g g, which no glove makes felt; masses are in kilograms", o->name, mass * 1e3);
}

// Each point is a spring of erp / (h cfm).
static void doubt_weight(doubts *d, const gv_object *o) {
  const gv_config *c = d->cfg;
  const double k = c->contact_erp / (c->step_s * c->contact_cfm);
  const double g = c->override_gravity_m_s2 > 0.0 ? c->override_gravity_m_s2
                                                  : gv_norm(d->scene->gravity_m_s2);
  const int points = resting_points(d->scene, o);
  const double sinks = mass_of(d, o) * g / (points * k);
  if (sinks <= most_sinking_m)
    return;
  doubt(d,
        "'%s' has %.3g kg: it sinks by %.2g mm into what it rests on (on %d point%s of %.3g N/m); less mass, "
        "or a smaller contact cfm",
        o->name, mass_of(d, o), sinks * 1e3, points, points == 1 ? "" : "s", k);
}

// ---- a pair -----------------------------------------------------------------------------------------------

// Of two pieces, with the normal from b to a.
static double depth_of(const gv_scene *scene, const gv_object *a, int piece_a, const gv_object *b,
                       int piece_b, gv_vec3 *out_normal) {
  const gv_shape shape_a = gv_shape_hull(&scene->piece[piece_a]);
  const gv_shape shape_b = gv_shape_hull(&scene->piece[piece_b]);
  const gv_pair pair = {&shape_a, &a->T_world_body, &shape_b, &b->T_world_body};
  gv_pair_cache cache = {0};
  gv_distance found;
  gv_distance_pair(GV_NARROW_CORE, &pair, 0.0, &cache, &found);
  if (found.distance >= 0.0 || found.method == GV_DISTANCE_BEYOND)
    return 0.0;
  *out_normal = found.normal_world;
  return -found.distance;
}

// Parts of a mechanism may well stand inside each other.
static bool are_joined(const gv_scene *scene, int i, int k) {
  for (int j = 0; j < scene->joint_count; j++) {
    const gv_joint *joint = &scene->joint[j];
    if (joint->object_a == i && joint->object_b == k)
      return true;
    if (joint->object_a == k && joint->object_b == i)
      return true;
  }
  return false;
}

static void doubt_overlap(doubts *d, const gv_object *a, const gv_object *b) {
  gv_vec3 n = gv_v3(0, 0, 0);
  gv_vec3 deepest_n = n;
  double deepest = 0.0;
  for (int i = 0; i < a->piece_count; i++)
    for (int k = 0; k < b->piece_count; k++) {
      const double depth = depth_of(d->scene, a, a->piece_first + i, b, b->piece_first + k, &n);
      if (depth <= deepest)
        continue;
      deepest = depth;
      deepest_n = n;
    }
  if (deepest <= least_overlap_m)
    return;
  doubt(d, "'%s' starts %.3g mm inside '%s'; move it by %.3g mm along (%.2g, %.2g, %.2g)", a->name,
        deepest * 1e3, b->name, deepest * 1e3, deepest_n.x, deepest_n.y, deepest_n.z);
}

// ---- all --------------------------------------------------------------------------------------------------

int gv_scene_doubts(const gv_scene *scene, const gv_config *cfg, gv_doubt out[], int max) {
  doubts d = {.scene = scene, .cfg = cfg, .out = out, .max = max};
  for (int i = 0; i < scene->object_count; i++) {
    const gv_object *o = &scene->object[i];
    if (o->is_static)
      continue;
    doubt_size(&d, o);
    doubt_mass(&d, o);
    doubt_weight(&d, o);
  }
  for (int i = 0; i < scene->object_count; i++)
    for (int k = 0; k < scene->object_count; k++) {
      const gv_object *a = &scene->object[i];
      const gv_object *b = &scene->object[k];
      const bool once = b->is_static || k < i;  // a moves
      if (i != k && !a->is_static && once && !are_joined(scene, i, k))
        doubt_overlap(&d, a, b);
    }
  return d.count;
}
