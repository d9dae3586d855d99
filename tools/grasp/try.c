// SPDX-License-Identifier: BSD-3-Clause
// One candidate in the simulated user's hand: the device, the safety machine, the limiter and the engine as
// they are, step by step and as fast as possible; and the wrench that the contacts of the held object resist.
#include <string.h>

#include "daemon/load/config_load.h"
#include "daemon/loop/session.h"
#include "tools/grasp/grasp.h"

// Halfway up, the hand has risen by 75 mm.
enum { HALFWAY_MS = (GRASP_LIFT_MS + GRASP_LIFTED_MS) / 2 };
enum { DIRECTIONS = 240, CONE = 8, GENERATORS = GV_MAX_CONTACTS * CONE };

typedef struct wrench {
  double f[6];
} wrench;

static gv_sim sim;
static gv_sim_script script;
static gv_session session;

static gv_engine *open_engine(grasp_search *s) {
  return gv_engine_init(s->memory, s->memory_size, s->config, s->scene);
}

static void bound_object(grasp_search *s) {
  const gv_object *o = &s->scene->object[s->object];
  s->low = gv_v3(HUGE_VAL, HUGE_VAL, HUGE_VAL);
  s->high = gv_neg(s->low);
  for (int i = 0; i < o->vertex_count; i++) {
    const gv_vec3 p = gv_transform(s->T_world_object, s->scene->mesh_vertex[o->vertex_first + i]);
    s->low = gv_v3(fmin(s->low.x, p.x), fmin(s->low.y, p.y), fmin(s->low.z, p.z));
    s->high = gv_v3(fmax(s->high.x, p.x), fmax(s->high.y, p.y), fmax(s->high.z, p.z));
  }
  s->size_m = 0.5 * gv_norm(gv_sub(s->high, s->low));
}

bool grasp_begin(grasp_search *s, const gv_scene *scene, const gv_config *config, void *memory, size_t size,
                 int object) {
  *s = (grasp_search){
    .scene = scene, .config = config, .memory = memory, .memory_size = size, .object = object};
  gv_engine *engine = open_engine(s);
  if (!engine)
    return false;
  const gv_sample nothing = {.glove_new = false};
  gv_step_result result;
  for (int step = 0; step < 500; step++)
    gv_engine_step(engine, &nothing, &result);
  s->T_world_object = gv_engine_object_pose(engine, object);
  gv_engine_close(engine);
  bound_object(s);
  return true;
}

// ---- the wrench ----

// Forces of one newton at a contact along the edges of its friction cone, with their
// torque about the object's centre.
static int add_generators(const grasp_search *s, const gv_engine *engine, const gv_contact *c, double mu,
                          wrench out[CONE]) {
  const gv_vec3 center = gv_engine_object_pose(engine, s->object).p;
  const gv_vec3 n = gv_neg(c->normal_world);  // on the object
  const gv_vec3 u = gv_any_perpendicular(n);
  const gv_vec3 v = gv_cross(n, u);
  for (int k = 0; k < CONE; k++) {
    double sine, cosine;
    gv_sincos(2 * GV_PI * k / CONE, &sine, &cosine);
    const gv_vec3 f = gv_mad(gv_mad(n, mu * cosine, u), mu * sine, v);
    const gv_vec3 t = gv_scale(gv_cross(gv_sub(c->position_world, center), f), 1 / s->size_m);
    out[k] = (wrench){{f.x, f.y, f.z, t.x, t.y, t.z}};
  }
  return CONE;
}

// Unit vectors in six dimensions, the same every time.
static wrench draw_direction(unsigned long long *state) {
  wrench d;
  double length2;
  do {
    length2 = 0;
    for (int i = 0; i < 6; i++) {
      *state = *state * 6364136223846793005ULL + 1442695040888963407ULL;
      d.f[i] = 2 * (double)(*state >> 11) / 9007199254740992.0 - 1;
      length2 += d.f[i] * d.f[i];
    }
  } while (length2 > 1 || length2 < 0.01);
  for (int i = 0; i < 6; i++)
    d.f[i] /= sqrt(length2);
  return d;
}

// The largest ball about zero in the hull of the generators (Ferrari and Canny 1992), over sampled
// directions; below 0: some push is not resisted at all.
static double resisted(const wrench *g, int count) {
  unsigned long long state = 1;
  double least = HUGE_VAL;
  for (int i = 0; i < DIRECTIONS; i++) {
    const wrench d = draw_direction(&state);
    double high = 0;
    for (int k = 0; k < count; k++) {
      double along = 0;
      for (int j = 0; j < 6; j++)
        along += g[k].f[j] * d.f[j];
      high = fmax(high, along);
    }
    least = fmin(least, high);
  }
  return count > 0 ? least : 0;
}

static bool touches_hand(const grasp_search *s, const gv_contact *c) {
  return c->limb >= 0 && c->object == s->object && c->depth_m > -1e-4;
}

static double measure_wrench(const grasp_search *s, const gv_engine *engine, int *out_limbs) {
  static wrench g[GENERATORS];
  int count, generators = 0;
  unsigned limbs = 0;
  const gv_contact *c = gv_engine_contacts(engine, &count);
  const double mu = sqrt(s->config->mu_hand * s->scene->object[s->object].mu);
  for (int i = 0; i < count; i++) {
    if (!touches_hand(s, &c[i]))
      continue;
    generators += add_generators(s, engine, &c[i], mu, &g[generators]);
    limbs |= 1u << c[i].limb;
  }
  *out_limbs = __builtin_popcount(limbs);
  return resisted(g, generators);
}

// ---- the run ----

static gv_engine *start(grasp_search *s, const grasp_candidate *c) {
  static char text[4096];
  char err[300];
  gv_settings settings;
  grasp_script(c, "", text, sizeof text);
  if (gv_sim_script_parse(text, "grasp", &script, err, sizeof err))
    return NULL;
  gv_settings_default(&settings);
  const gv_session_config cfg = {.limiter = settings.limiter,
                                 .safety = settings.safety,
                                 .side = s->config->hand.side,
                                 .period_s = s->config->step_s};
  gv_engine *engine = open_engine(s);
  if (!engine)
    return NULL;
  gv_session_init(&session, &cfg, engine);
  gv_sim_init(&sim, &script, NULL, 1);
  gv_sim_start(&sim);
  return engine;
}

static void step(int ms) {
  static gv_frame frame[256];
  gv_frame command;
  const int count = gv_sim_advance(&sim, ms * 1000000LL, frame, 256);
  gv_session_step(&session, ms * 1000000LL, frame, count, 0, &command);
  gv_sim_receive(&sim, &command);
}

static gv_vec3 place_in_palm(const grasp_search *s, const gv_engine *engine) {
  const gv_pose T_world_palm = gv_engine_limb_pose(engine, GV_LIMB_PALM);
  return gv_transform_inv(T_world_palm, gv_engine_object_pose(engine, s->object).p);
}

static double risen(const grasp_search *s, const gv_engine *engine) {
  return gv_engine_object_pose(engine, s->object).p.z - s->T_world_object.p.z;
}

static void watch(const grasp_search *s, const gv_engine *engine, gv_vec3 held_at, grasp_result *io) {
  int count;
  const gv_contact *c = gv_engine_contacts(engine, &count);
  for (int i = 0; i < count; i++)
    if (touches_hand(s, &c[i]))
      io->depth_m = fmax(io->depth_m, c[i].depth_m);
  io->slip_m = fmax(io->slip_m, gv_norm(gv_sub(place_in_palm(s, engine), held_at)));
  io->lift_m = fmin(io->lift_m, risen(s, engine));
}

void grasp_try(grasp_search *s, const grasp_candidate *c, int until_ms, grasp_result *out) {
  gv_engine *engine = start(s, c);
  gv_vec3 held_at = {0, 0, 0};
  *out = (grasp_result){.lift_m = HUGE_VAL};
  if (!engine)
    return;
  for (int ms = 0; ms < until_ms; ms++) {
    step(ms);
    if (ms == GRASP_LIFT_MS && !(measure_wrench(s, engine, &out->limbs) > 0))
      break;
    if (ms == HALFWAY_MS && risen(s, engine) < 0.04)
      break;
    if (ms == GRASP_SETTLED_MS) {
      held_at = place_in_palm(s, engine);
      out->wrench_n = measure_wrench(s, engine, &out->limbs);
      if (risen(s, engine) < 0.1)
        break;
    }
    if (ms >= GRASP_SETTLED_MS)
      watch(s, engine, held_at, out);
    out->held = ms == until_ms - 1 && out->lift_m > 0.1 && out->slip_m < 1e-3 && out->wrench_n > 0;
  }
  gv_engine_close(engine);
}
