// SPDX-License-Identifier: BSD-3-Clause
// MuJoCo as the other engine (peer.h): sixteen free bodies of the engine's augmented mass, pulled by the
// engine's own spring forces, against the same objects, as in test/bench/bench_mujoco.c. Elliptic cones,
// impratio 10, noslip 3, solref .002: the settings at which MuJoCo slips least. Refined: impratio 100,
// twenty rounds without slip, and solref as short as the step allows.
#include "campaign/peer.h"

#include <mujoco/mujoco.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { OBJECT = 1 };  // of the scene

struct peer {
  mjModel *model;
  mjData *data;
  int object_at;  // in qpos
  bool placed;
};

const char *peer_name(void) { return "mujoco"; }

// ---- model ------------------------------------------------------------------------------------------------

static void write_friction(FILE *f, const gv_engine *e) {
  fprintf(f, "friction='%.17g 0 0' contype='2' conaffinity='1'/>\n", e->cfg.mu_hand);
}

static double along(gv_vec3 v, int axis) { return axis == 0 ? v.x : axis == 1 ? v.y : v.z; }

// The palm is a box rounded by r: three boxes, each thicker along one axis, and a
// capsule along each of its edges.
static void write_palm(FILE *f, const gv_engine *e, gv_vec3 half, double r) {
  for (int axis = 0; axis < 3; axis++) {
    const double more[3] = {axis == 0 ? r : 0.0, axis == 1 ? r : 0.0, axis == 2 ? r : 0.0};
    fprintf(f, "<geom type='box' size='%.17g %.17g %.17g' ", half.x + more[0], half.y + more[1],
            half.z + more[2]);
    write_friction(f, e);
  }
  for (int edge = 0; edge < 12; edge++) {
    const int axis = edge / 4;
    double from[3], to[3];
    for (int k = 0; k < 3; k++) {
      const int bit = k == (axis + 1) % 3 ? edge & 1 : edge >> 1 & 1;
      from[k] = k == axis ? -along(half, k) : bit ? along(half, k) : -along(half, k);
      to[k] = k == axis ? along(half, k) : from[k];
    }
    fprintf(f, "<geom type='capsule' size='%.17g' fromto='%.17g %.17g %.17g %.17g %.17g %.17g' ", r, from[0],
            from[1], from[2], to[0], to[1], to[2]);
    write_friction(f, e);
  }
}

static void write_limb(FILE *f, const gv_engine *e, int i) {
  const gv_spring *s = &e->hand[0].spring[i];
  const gv_shape *shape = &e->broad.limb_shape[i];
  const double inertia = e->hand[0].limb_inertia[i] + s->added_inertia;
  const double mass = s->mass_kg + s->added_mass_kg;
  fprintf(f,
          "<body name='limb%d' pos='0 0 %d'><freejoint/><inertial pos='0 0 0' mass='%.17g' "
          "diaginertia='%.17g %.17g %.17g'/>",
          i, 10 + i, mass, inertia, inertia, inertia);
  if (shape->kind == GV_CORE_SEGMENT) {
    fprintf(f, "<geom type='capsule' size='%.17g %.17g' euler='0 90 0' ", shape->radius, shape->half.x);
    write_friction(f, e);
  } else {
    write_palm(f, e, shape->half, shape->radius);
  }
  fprintf(f, "</body>\n");
}

static bool is_box(const gv_hull *hull) {
  const gv_vec3 most = hull->aabb_max;
  bool box = hull->vertex_count == 8 && gv_norm(gv_add(hull->aabb_min, most)) < 1e-12;
  for (int i = 0; i < hull->vertex_count; i++) {
    const gv_vec3 p = hull->vertex[i];
    const gv_vec3 corner = gv_v3(fabs(p.x), fabs(p.y), fabs(p.z));
    box = box && gv_norm(gv_sub(corner, most)) < 1e-12;
  }
  return box;
}

static void write_piece(FILE *f, const gv_hull *hull, const char *object, int piece, double mu) {
  const gv_vec3 c = hull->center;
  const gv_vec3 most = hull->aabb_max;
  if (hull->vertex_count == 1)
    fprintf(f, "<geom type='sphere' size='%.17g' pos='%.17g %.17g %.17g' ", hull->radius, c.x, c.y, c.z);
  else if (is_box(hull))
    fprintf(f, "<geom type='box' size='%.17g %.17g %.17g' ", most.x, most.y, most.z);
  else
    fprintf(f, "<geom type='mesh' mesh='%s%d' ", object, piece);
  fprintf(f, "friction='%.17g 0 0' contype='1' conaffinity='3'/>\n", mu);
}

static void write_asset(FILE *f, const gv_hull *hull, const char *object, int piece) {
  if (hull->vertex_count == 1 || is_box(hull))
    return;
  fprintf(f, "<mesh name='%s%d' inertia='convex' vertex='", object, piece);
  for (int i = 0; i < hull->vertex_count; i++)
    fprintf(f, "%.17g %.17g %.17g ", hull->vertex[i].x, hull->vertex[i].y, hull->vertex[i].z);
  fprintf(f, "'/>\n");
}

static void write_object(FILE *f, const gv_scene *scene, const gv_object *o) {
  const gv_pose *T = &o->T_world_body;
  const double (*I)[3] = o->inertia_kg_m2.m;
  fprintf(f, "<body name='%s' pos='%.17g %.17g %.17g' quat='%.17g %.17g %.17g %.17g'>", o->name, T->p.x,
          T->p.y, T->p.z, T->q.w, T->q.x, T->q.y, T->q.z);
  if (!o->is_static)
    fprintf(
        f,
        "<freejoint/><inertial pos='0 0 0' mass='%.17g' fullinertia='%.17g %.17g %.17g %.17g %.17g %.17g'/>",
        o->mass_kg, I[0][0], I[1][1], I[2][2], I[0][1], I[0][2], I[1][2]);
  for (int p = 0; p < o->piece_count; p++)
    write_piece(f, &scene->piece[o->piece_first + p], o->name, p, o->mu);
  fprintf(f, "</body>\n");
}

static void write_model(FILE *f, const gv_engine *e, bool refined) {
  const gv_scene *scene = e->scene;
  const gv_vec3 g = scene->gravity_m_s2;
  fprintf(f,
          "<mujoco><compiler angle='degree' balanceinertia='true'/><option timestep='%.17g' gravity='%.17g "
          "%.17g %.17g' cone='elliptic' "
          "impratio='%d' noslip_iterations='%d'/><default><geom condim='3' solref='%.17g "
          "1'/></default>\n<asset>\n",
          e->cfg.step_s, g.x, g.y, g.z, refined ? 100 : 10, refined ? 20 : 3, 2.0 * e->cfg.step_s);
  for (int o = 0; o < scene->object_count; o++)
    for (int p = 0; p < scene->object[o].piece_count; p++)
      write_asset(f, &scene->piece[scene->object[o].piece_first + p], scene->object[o].name, p);
  fprintf(f, "</asset>\n<worldbody>\n");
  for (int i = 0; i < GV_LIMBS; i++)
    write_limb(f, e, i);
  for (int o = 0; o < scene->object_count; o++)
    write_object(f, scene, &scene->object[o]);
  fprintf(f, "</worldbody></mujoco>\n");
}

static mjModel *compile(const gv_engine *e, bool refined, char *err, size_t err_size) {
  char *text = NULL;
  size_t length = 0;
  FILE *f = open_memstream(&text, &length);
  if (!f)
    return NULL;
  write_model(f, e, refined);
  fclose(f);
  mjSpec *spec = mj_parseXMLString(text, NULL, err, (int)err_size);
  mjModel *model = spec ? mj_compile(spec, NULL) : NULL;
  if (spec && !model)
    snprintf(err, err_size, "mujoco: %s", mjs_getError(spec));
  mj_deleteSpec(spec);
  free(text);
  return model;
}

peer *peer_open(const gv_engine *e, bool refined, char *err, size_t err_size) {
  peer *p = calloc(1, sizeof *p);
  if (!p)
    return NULL;
  p->model = compile(e, refined, err, err_size);
  p->data = p->model ? mj_makeData(p->model) : NULL;
  const int object = p->data ? mj_name2id(p->model, mjOBJ_BODY, e->scene->object[OBJECT].name) : -1;
  if (object < 0) {
    peer_close(p);
    return NULL;
  }
  p->object_at = p->model->jnt_qposadr[p->model->body_jntadr[object]];
  return p;
}

void peer_close(peer *p) {
  if (!p)
    return;
  if (p->data)
    mj_deleteData(p->data);
  if (p->model)
    mj_deleteModel(p->model);
  free(p);
}

// ---- step -------------------------------------------------------------------------------------------------

static gv_vec3 vector(const mjtNum *v) { return gv_v3(v[0], v[1], v[2]); }

static void store(mjtNum *to, gv_vec3 v) {
  to[0] = v.x;
  to[1] = v.y;
  to[2] = v.z;
}

static gv_pose pose_at(const mjData *d, int at) {
  const mjtNum *q = &d->qpos[at];
  return (gv_pose){{q[3], q[4], q[5], q[6]}, vector(q)};
}

// A free joint: position, quaternion; linear velocity in the world, angular in the body.
static gv_body_state limb_state(const mjData *d, int i) {
  const mjtNum *v = &d->qvel[6 * i];
  gv_body_state s = {pose_at(d, 7 * i), vector(v), {0, 0, 0}};
  s.w = gv_rotate(s.T.q, vector(v + 3));
  return s;
}

static void place_body(mjData *d, int body, const gv_body_state *s) {
  const gv_pose *T = &s->T;
  const mjtNum q[7] = {T->p.x, T->p.y, T->p.z, T->q.w, T->q.x, T->q.y, T->q.z};
  memcpy(&d->qpos[7 * body], q, sizeof q);
  store(&d->qvel[6 * body], s->v);
  store(&d->qvel[6 * body + 3], gv_rotate(gv_quat_conj(T->q), s->w));
}

static void place_hand(mjData *d, const gv_engine *e) {
  for (int i = 0; i < GV_LIMBS; i++) {
    const gv_body_state at_rest = {e->hand[0].driver[i].T, {0, 0, 0}, {0, 0, 0}};
    place_body(d, i, &at_rest);
  }
}

// Springs as in the engine's step; gravity does not act on limbs.
static void pull_limbs(const peer *p, const gv_engine *e) {
  gv_body_state sim[GV_LIMBS];
  gv_vec3 f[GV_LIMBS], t[GV_LIMBS];
  for (int i = 0; i < GV_LIMBS; i++)
    sim[i] = limb_state(p->data, i);
  gv_springs_apply(e->hand[0].spring, sim, e->hand[0].driver, f, t);
  for (int i = 0; i < GV_LIMBS; i++) {
    f[i].z -= (e->hand[0].spring[i].mass_kg + e->hand[0].spring[i].added_mass_kg) * p->model->opt.gravity[2];
    store(&p->data->xfrc_applied[6 * (i + 1)], f[i]);
    store(&p->data->xfrc_applied[6 * (i + 1) + 3], t[i]);
  }
}

void peer_step(peer *p, const gv_engine *e) {
  if (!gv_engine_hand_placed(e))
    return;
  if (!p->placed)
    place_hand(p->data, e);
  p->placed = true;
  pull_limbs(p, e);
  mj_step(p->model, p->data);
}

void peer_take_over(peer *p, const gv_engine *e) {
  gv_body_state s;
  for (int i = 0; i < GV_LIMBS; i++) {
    s.T = gv_engine_limb_pose(e, i);
    gv_engine_limb_velocity(e, i, &s.v, &s.w);
    place_body(p->data, i, &s);
  }
  s.T = gv_engine_object_pose(e, OBJECT);
  gv_engine_object_velocity(e, OBJECT, &s.v, &s.w);
  place_body(p->data, GV_LIMBS, &s);
  p->placed = true;
}

gv_pose peer_palm(const peer *p) { return pose_at(p->data, 7 * GV_LIMB_PALM); }
gv_pose peer_object(const peer *p) { return pose_at(p->data, p->object_at); }
