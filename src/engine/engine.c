// SPDX-License-Identifier: BSD-3-Clause
// The engine: one step is the paper's Figure 3, from a hand sample to what the hand should feel. Real-time
// thread; set-up and views apart. Pure: no clock, no descriptor, no heap.
#include "gloved/engine.h"

#include <assert.h>
#include <string.h>

#include "engine/engine_state.h"
#include "gloved/force.h"

// A body beyond these is not simulated any more but put back: it fell off the world or blew up.
#define FAST_M_S 500.0
#define SPIN_RAD_S 1e5

// What the pairs of a step may take of the loop's period, and what they may in any case: those
// of a hand that holds something.
#define COLLISION_SHARE 0.25
#define LEAST_OPERATIONS 10000

static void set_config(gv_engine *e, const gv_config *cfg) {
  e->cfg = e->second_cfg = *cfg;
  e->second_cfg.hand = cfg->second.hand;
  e->second_cfg.calibration = cfg->second.calibration;
  e->second_cfg.T_receiver_wrist = cfg->second.T_receiver_wrist;
}

static bool put_engine(gv_arena *arena, const gv_config *cfg, const gv_scene *scene, gv_engine **out) {
  gv_engine *e = gv_arena_alloc(arena, "engine", sizeof *e);
  const int hands = cfg->second.present ? 2 : 1;
  if (!gv_broad_alloc(e ? &e->broad : NULL, arena, scene, hands) || !e)
    return false;
  e->scene = scene;
  e->hands = hands;
  e->hand[0].cfg = &e->cfg;
  e->hand[1].cfg = &e->second_cfg;
  e->hand[1].first_body = gv_body_of_second_hand(scene->object_count);
  set_config(e, cfg);
  *out = e;
  return true;
}

static gv_spring make_limb_spring(const gv_engine *e, const gv_engine_hand *hand, int limb) {
  return gv_spring_make(&e->cfg.limb, e->cfg.limb_mass_kg, hand->limb_inertia[limb], e->cfg.step_s,
                        e->cfg.rotation_law);
}

static gv_spring make_palm_spring(const gv_engine *e, const gv_engine_hand *hand) {
  gv_spring s = gv_spring_make(&e->cfg.palm, e->cfg.palm_mass_kg, hand->limb_inertia[GV_LIMB_PALM],
                               e->cfg.step_s, e->cfg.rotation_law);
  s.most_n = GV_PALM_N;
  s.most_n_m = GV_PALM_N_M;
  return s;
}

static gv_spring make_spring(const gv_engine *e, const gv_engine_hand *hand, int limb) {
  return limb == GV_LIMB_PALM ? make_palm_spring(e, hand) : make_limb_spring(e, hand, limb);
}

static void make_limbs(gv_engine *e, int h) {
  gv_engine_hand *made = &e->hand[h];
  const gv_hand_model *hand = &made->cfg->hand;
  gv_shape *shape = &e->broad.limb_shape[h * GV_LIMBS];
  for (int i = 0; i < GV_LIMBS; i++) {
    bool palm = i == GV_LIMB_PALM;
    double r = palm ? hand->palm_radius_m : hand->radius_m[i / 3][i % 3];
    shape[i] = palm ? gv_shape_rounded_box(hand->palm_half_m, r)
                    : gv_shape_capsule(gv_hand_half_length(hand, i), r);
    gv_vec3 half = shape[i].half;
    double mass = palm ? e->cfg.palm_mass_kg : e->cfg.limb_mass_kg;
    made->limb_inertia[i] = mass * gv_sphere_inertia_of_box(gv_scale(gv_add(half, gv_v3(r, r, r)), 2.0));
    made->spring[i] = make_spring(e, made, i);
  }
}

size_t gv_engine_size(const gv_config *cfg, const gv_scene *scene) {
  gv_arena dry;
  gv_engine *e;
  gv_arena_init(&dry, NULL, 0);
  put_engine(&dry, cfg, scene, &e);
  gv_dynamics_create(&dry, cfg, scene, NULL, NULL);
  return dry.peak;
}

static void note_joints(gv_engine *e) {
  for (int i = 0; i < e->scene->joint_count; i++) {
    const gv_joint *joint = &e->scene->joint[i];
    e->in_joint[joint->object_a] = true;
    if (joint->object_b != GV_WORLD)
      e->in_joint[joint->object_b] = true;
  }
}

static void tell_springs(gv_engine *e) {
  for (int h = 0; h < e->hands; h++) {
    gv_engine_hand *hand = &e->hand[h];
    for (int i = 0; i < GV_LIMBS; i++)
      gv_dynamics_set_limb(e->dyn, hand->first_body + i, &hand->spring[i], hand->limb_inertia[i]);
    memcpy(hand->acting, hand->spring, sizeof hand->acting);
    hand->softer = 0;
  }
}

// A share of the loop's period, in counted operations.
static int budget_of(const gv_config *cfg) {
  const double period_s = cfg->period_s > 0.0 ? cfg->period_s : cfg->step_s;
  return (int)fmax(LEAST_OPERATIONS, COLLISION_SHARE * period_s * cfg->operations_per_s);
}

gv_engine *gv_engine_init(void *mem, size_t size, const gv_config *cfg, const gv_scene *scene) {
  if (gv_config_check(cfg))
    return NULL;
  gv_arena arena;
  gv_engine *e;
  gv_arena_init(&arena, mem, size);
  if (!put_engine(&arena, cfg, scene, &e))
    return NULL;
  for (int h = 0; h < e->hands; h++)
    make_limbs(e, h);
  note_joints(e);
  gv_broad_init(&e->broad, cfg->step_s, cfg->contact_margin_m);
  e->collision_budget = budget_of(cfg);
  e->effort = (gv_effort){1.0, GV_MAX_CONTACTS};
  e->dyn = gv_dynamics_create(&arena, &e->cfg, scene, e->hand[0].spring, e->hand[0].limb_inertia);
  if (!e->dyn)
    return NULL;
  tell_springs(e);
  e->arena = arena;
  gv_dynamics_warm_up(e->dyn);
  gv_engine_reset(e);
  memset(&e->counters, 0, sizeof e->counters);
  return e;
}

void gv_engine_set_effort(gv_engine *e, gv_effort effort) {
  assert(effort.share > 0.0 && effort.share <= 1.0 && effort.contacts_max > 0 &&
         effort.contacts_max <= GV_MAX_CONTACTS);
  e->effort = effort;
  e->collision_budget = (int)fmax(LEAST_OPERATIONS, effort.share * budget_of(&e->cfg));
  gv_dynamics_set_share(e->dyn, effort.share);
}

void gv_engine_close(gv_engine *engine) {
  if (engine)
    gv_dynamics_destroy(engine->dyn);
}

static void reset_hand(gv_engine *e, gv_engine_hand *hand) {
  gv_condition_init(&hand->condition, hand->cfg);
  hand->placed = false;
  memset(hand->felt_f, 0, sizeof hand->felt_f);
  memset(hand->felt_t, 0, sizeof hand->felt_t);
  memset(hand->tension_n, 0, sizeof hand->tension_n);
  gv_dynamics_park_limbs(e->dyn, hand->first_body, true);
}

void gv_engine_reset(gv_engine *e) {
  gv_broad_forget(&e->broad);  // a warm start must not remember the last life
  e->contact_count = 0;
  for (int h = 0; h < e->hands; h++)
    reset_hand(e, &e->hand[h]);
  gv_dynamics_forget(e->dyn);
  gv_dynamics_mend_joints(e->dyn);
  for (int o = 0; o < e->scene->object_count; o++)
    gv_engine_wake_object(e, o);
  for (int o = 0; o < e->scene->object_count; o++)
    gv_dynamics_set_state(e->dyn, GV_LIMBS + o, &(gv_body_state){.T = e->scene->object[o].T_world_body});
}

int gv_engine_adjust(gv_engine *e, const gv_coupling *limb, const gv_coupling *palm, double mu_hand) {
  gv_config cfg = e->cfg;
  cfg.limb = *limb;
  cfg.palm = *palm;
  cfg.mu_hand = mu_hand;
  if (gv_config_check(&cfg))
    return -1;
  set_config(e, &cfg);
  for (int h = 0; h < e->hands; h++)
    for (int i = 0; i < GV_LIMBS; i++)
      e->hand[h].spring[i] = make_spring(e, &e->hand[h], i);
  tell_springs(e);
  return 0;
}

const gv_config *gv_engine_config(const gv_engine *e) { return &e->cfg; }

// First sample: the limbs appear on their driver frames, at rest.
static void place_hand(gv_engine *e, gv_engine_hand *hand) {
  for (int i = 0; i < GV_LIMBS; i++)
    gv_dynamics_set_state(e->dyn, hand->first_body + i, &hand->driver[i]);
  gv_dynamics_park_limbs(e->dyn, hand->first_body, false);
  hand->placed = true;
  hand->events |= GV_EVENT_HAND_PLACED;
}

// The skeleton's frames of this step, and their velocities since the last.
static void move_driver(gv_engine_hand *e) {
  gv_condition_output(&e->condition, e->cfg, e->angle, &e->wrist);
  gv_hand_pose(&e->cfg->hand, &e->wrist, e->angle, e->skeleton, e->joint);
  double rate = 1.0 / e->cfg->step_s;
  for (int i = 0; i < GV_LIMBS; i++) {
    const gv_pose *now = &e->skeleton[i];
    gv_body_state *d = &e->driver[i];
    if (!e->placed)
      d->T = *now;
    gv_vec3 moved = gv_sub(now->p, d->T.p);
    gv_quat q = now->q;
    gv_quat last = d->T.q;
    gv_quat turned = gv_quat_mul(q, gv_quat_conj(last));
    double k = 2.0 * turned.w;  // turned * q is `last` mirrored in q
    e->ahead[i] = (gv_pose){{k * q.w - last.w, k * q.x - last.x, k * q.y - last.y, k * q.z - last.z},
                            gv_add(now->p, moved)};
    d->T = *now;
    d->v = gv_scale(moved, rate);
    d->w = gv_scale(gv_quat_log(turned), rate);
  }
}

static uint32_t refusal_events(unsigned why) {
  return (why & GV_SAMPLE_NOT_FINITE ? GV_EVENT_SAMPLE_REFUSED : 0u) |
         (why & GV_SAMPLE_JUMP ? GV_EVENT_SAMPLE_JUMP : 0u) |
         (why & GV_SAMPLE_NO_POSE ? GV_EVENT_SAMPLE_NO_POSE : 0u);
}

static void take_sample(gv_engine *e, gv_engine_hand *hand, const gv_sample *sample) {
  hand->events = 0;
  gv_condition_pull(&hand->condition, hand->cfg, sample->tension_n);
  if (sample->glove_new || sample->pose_new) {
    e->counters.samples++;
    int refused = gv_condition_sample(&hand->condition, hand->cfg, sample, &e->counters.angles_limited);
    if (refused) {
      hand->events |= refusal_events(hand->condition.why);
      e->counters.samples_refused += (uint64_t)refused;
    }
  }
  if (!gv_condition_ready(&hand->condition))
    return;
  gv_condition_step(&hand->condition, hand->cfg);
  move_driver(hand);
  if (!hand->placed)
    place_hand(e, hand);
}

// Bodies of limbs whose springs are softer in this step, or were in the last. What backward Euler adds to a
// limb is its spring's: a softer one weighs less.
static void change_springs(gv_engine *e, gv_engine_hand *hand, uint32_t softer) {
  const uint32_t changed = softer | hand->softer;
  hand->softer = softer;
  for (int i = 0; changed >> i; i++) {
    if (!(changed >> i & 1))
      continue;
    if (!(softer >> i & 1))
      hand->acting[i] = hand->spring[i];
    gv_dynamics_set_limb(e->dyn, hand->first_body + i, &hand->acting[i], hand->limb_inertia[i]);
  }
}

static void pull_limbs(gv_engine *e, gv_engine_hand *hand) {
  gv_vec3 f[GV_LIMBS], t[GV_LIMBS];
  if (!hand->placed)
    return;
  const gv_body_state *limb = gv_dynamics_state(e->dyn, hand->first_body);
  uint32_t softer = 0;
  if (gv_springs_apply(hand->spring, limb, hand->driver, f, t))
    softer = gv_springs_bound(hand->spring, limb, f, t, hand->acting);
  if (softer | hand->softer)
    change_springs(e, hand, softer);
  for (int i = 0; i < GV_LIMBS; i++) {
    if (e->cfg.limb_gravity)
      f[i] = gv_mad(f[i], hand->spring[i].mass_kg, gv_dynamics_gravity(e->dyn));
    gv_dynamics_add_force(e->dyn, hand->first_body + i, f[i], t[i]);
  }
}

static void count_step(gv_engine *e, gv_solver_report report) {
  gv_counters *c = &e->counters;
  const bool joined = e->scene->joint_count > 0 || (e->cfg.finger_joints && gv_engine_any_placed(e));
  switch (report.solver) {
    case GV_SOLVER_NEWTON: c->newton_steps++; break;
    case GV_SOLVER_DANTZIG: c->dantzig_steps++; break;
    case GV_SOLVER_QUICKSTEP: c->quickstep_steps++; break;
    case GV_SOLVER_AUTO:
    case GV_SOLVERS: c->unsolved_steps += e->contact_count > 0 || joined; break;
  }
  c->newton_softened += report.outcome == GV_OUTCOME_SOFTENED;
  c->dantzig_lagged += report.outcome == GV_OUTCOME_LAGGED;
  if (report.solver == GV_SOLVER_QUICKSTEP && e->cfg.solver != GV_SOLVER_QUICKSTEP)
    e->events |= GV_EVENT_QUICKSTEP;
}

static void solve(gv_engine *e) {
  gv_vec3 force[GV_MAX_CONTACTS];
  count_step(e, gv_dynamics_step(e->dyn, e->solver_contact, e->contact_count, force));
  for (int i = 0; i < e->contact_count; i++)
    e->contact[i].force_world = force[i];
  e->counters.solver_errors = gv_dynamics_solver_errors(e->dyn);
  const int broken = gv_dynamics_joints_broken(e->dyn);
  e->counters.joints_broken += (uint64_t)broken;
  if (broken > 0)
    e->events |= GV_EVENT_JOINT_BROKEN;
}

static bool state_sound(const gv_body_state *s) {  // what is not finite is not less
  gv_quat q = s->T.q;
  return q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z < 2.0 &&
         gv_norm2(s->T.p) < (double)GV_FARTHEST_M * GV_FARTHEST_M && gv_norm2(s->v) < FAST_M_S * FAST_M_S &&
         gv_norm2(s->w) < SPIN_RAD_S * SPIN_RAD_S;
}

static void put_back(gv_engine *e, int body, const gv_pose *T_start) {
  gv_dynamics_set_state(e->dyn, body, &(gv_body_state){.T = *T_start});
  e->events |= GV_EVENT_BODY_RESET;
  e->counters.body_resets++;
}

// An object, and all that joints hold to it: one of them at its start and the other
// elsewhere would be thrown together.
static void put_back_object(gv_engine *e, int object) {
  bool goes_back[GV_MAX_OBJECTS] = {false};
  goes_back[object] = true;
  for (int round = 0; round < e->scene->joint_count; round++) {
    for (int i = 0; i < e->scene->joint_count; i++) {
      const gv_joint *joint = &e->scene->joint[i];
      if (joint->object_b == GV_WORLD)
        continue;
      if (goes_back[joint->object_a] || goes_back[joint->object_b])
        goes_back[joint->object_a] = goes_back[joint->object_b] = true;
    }
  }
  for (int o = 0; o < e->scene->object_count; o++)
    if (goes_back[o])
      put_back(e, GV_LIMBS + o, &e->scene->object[o].T_world_body);
}

static void guard_states(gv_engine *e) {
  const gv_body_state *state = gv_dynamics_state(e->dyn, 0);
  for (int h = 0; h < e->hands; h++) {
    const int first = e->hand[h].first_body;
    for (int i = 0; i < GV_LIMBS; i++)
      if (!state_sound(&state[first + i]))
        put_back(e, first + i, &e->hand[h].driver[i].T);
  }
  for (int i = 0; i < e->rest.moving_count; i++) {
    const int o = e->rest.moving[i];
    if (!state_sound(&state[GV_LIMBS + o]))
      put_back_object(e, o);
  }
}

// What the person should feel: the opposite of the coupling on the limbs, as five tendon tensions that rise
// no faster than the fingertips' drivers explain.
static void feel_coupling(const gv_engine *e, gv_engine_hand *hand, double out_tension_n[GV_FINGERS]) {
  double asked_n[GV_FINGERS];
  gv_vec3 tip_moved_m[GV_FINGERS];
  memset(out_tension_n, 0, GV_FINGERS * sizeof *out_tension_n);
  if (!hand->placed)
    return;
  gv_springs_feel(hand->acting, gv_dynamics_state(e->dyn, hand->first_body), hand->driver, hand->ahead,
                  hand->felt_f, hand->felt_t);
  gv_tendon_map(hand->joint, hand->skeleton, hand->felt_f, hand->felt_t, asked_n);
  for (int i = 0; i < GV_FINGERS; i++)
    tip_moved_m[i] = gv_scale(hand->driver[3 * i + 2].v, e->cfg.step_s);
  gv_tendon_follow(asked_n, tip_moved_m, e->cfg.limb.k_f, e->cfg.step_s, hand->tension_n);
  memcpy(out_tension_n, hand->tension_n, sizeof hand->tension_n);
}

void gv_engine_step_hands(gv_engine *e, const gv_sample sample[], gv_step_result out[]) {
  assert(e && sample && out);
  e->events = 0;
  for (int h = 0; h < e->hands; h++) {
    take_sample(e, &e->hand[h], &sample[h]);  // device driver update: skeleton to driver frames
    pull_limbs(e, &e->hand[h]);               // coupling, Eqn 1 to 4
  }
  gv_engine_collide(e);  // collision detection, Eqn 5 to 8; contact definition, Eqn 9, 10
  solve(e);              // equations of motion, Eqn 11 to 18
  guard_states(e);
  gv_engine_put_to_rest(e);
  e->counters.steps++;
  for (int h = 0; h < e->hands; h++) {
    feel_coupling(e, &e->hand[h], out[h].tension_n);  // constraint forces to the haptic hand interface
    out[h].events = e->events | e->hand[h].events;
    out[h].contact_count = e->contact_count;
  }
}

void gv_engine_step(gv_engine *e, const gv_sample *sample, gv_step_result *out) {
  assert(e->hands == 1);
  gv_engine_step_hands(e, sample, out);
}
