// SPDX-License-Identifier: BSD-3-Clause
// The engine: one call per period takes the newest hand sample and returns what the hand should feel.
// Pure and deterministic: the same config, scene and samples give the same bits. All memory is the
// caller's. One engine at a time per process (ODE keeps its allocator in globals); one thread at a time.
#ifndef GLOVED_ENGINE_H
#define GLOVED_ENGINE_H

#include <stddef.h>
#include <stdint.h>

#include "gloved/config.h"
#include "gloved/setting.h"

#ifdef __cplusplus
extern "C" {
#endif

// Realistic: log map, critically damped, world gravity, mu 0.8, stiff contact.
gv_config gv_config_default(void);
// The default on the two packages as they come: ODE's solvers, Dantzig's where it fits into the period.
gv_config gv_config_stock(void);
// The same with the paper's Tables 1 and 2 in the reading of DESIGN.md ("Preset paper").
gv_config gv_config_paper(void);
// What a user may set of it, but for the hand's measures and poses (src/engine/config.c).
enum { GV_ENGINE_SETTINGS = 41 };
extern const gv_setting gv_engine_settings[GV_ENGINE_SETTINGS];
// Null when sound, otherwise the name of the first field that is not finite or out of range.
const char *gv_config_check(const gv_config *cfg);

typedef enum gv_event {                // bits of gv_step_result.events
  GV_EVENT_HAND_PLACED = 1 << 0,       // first sample: the limbs were put onto the driver frames
  GV_EVENT_SAMPLE_REFUSED = 1 << 1,    // a sample that is no finite number: not taken
  GV_EVENT_CONTACTS_DROPPED = 1 << 2,  // more than GV_MAX_CONTACTS: the shallowest left out
  GV_EVENT_PAIRS_DROPPED = 1 << 3,     // more than GV_MAX_PAIRS: the last of the list left out
  GV_EVENT_BODY_RESET = 1 << 4,        // a body's state was not finite or ran away: put back, velocity zero
  GV_EVENT_OVERLAP = 1 << 5,           // cores overlapped (penetration beyond the radius)
  GV_EVENT_PAIRS_LEFT_OVER = 1 << 7,   // collision detection was over its budget: the least urgent pairs
                                       // not asked
  GV_EVENT_QUICKSTEP = 1 << 6,         // quickstep did a step that another solver was asked for
  GV_EVENT_SAMPLE_JUMP = 1 << 8,       // faster than a hand: held back until the next sample says the same
  GV_EVENT_JOINT_BROKEN = 1 << 10,     // a joint carried more than its break force: it is gone until the
                                       // scene is reset
  GV_EVENT_SAMPLE_NO_POSE = 1 << 9     // no unit quaternion, or farther than 100 m: not taken
} gv_event;

typedef struct gv_contact {
  int limb;                              // 0..15, 16..31 of a second hand, or -1 - object index of body A
  int object, piece;                     // object index of body B, and its piece (gv_scene.piece)
  gv_vec3 position_world, normal_world;  // normal from B to A
  double depth_m;                        // negative: gap
  gv_vec3 force_world;                   // on A, newtons, of this step
  uint16_t face;                         // polygon of B, 0xffff none
} gv_contact;

// One polygon that a limb touches (the paper's "penetration depth of every single polygon").
typedef struct gv_polygon_contact {
  int limb, object, piece, face;
  double depth_m;          // along the polygon's own normal, positive
  gv_vec3 position_world;  // on the polygon
} gv_polygon_contact;

// Counters since init; they never go back.
typedef struct gv_counters {
  uint64_t steps, samples,
      samples_refused,  // joints and poses held back or refused: jumps, not finite
      angles_limited,   // joint readings beyond the anatomy by more than 0.05 rad, held at its limit
      contacts_dropped, pairs_dropped,
      pairs_left_over,  // that the step's budget did not reach, shallow ones of objects first
      body_resets, overlaps, newton_steps, dantzig_steps,
      quickstep_steps,  // steps with contacts, by the solver that did them
      newton_softened,  // of newton_steps: with softer friction than asked
      dantzig_lagged,   // of dantzig_steps: friction was bounded by the normal forces of an
                        // earlier round
      unsolved_steps,   // with contacts that no solver could do: the bodies in contact stood still
      joints_broken,
      solver_errors;  // answers that ODE gave up, or said to be wrong: another solver did the step
  uint32_t contacts_max, pairs_max;
  double depth_max_m;  // largest penetration of any step
} gv_counters;

typedef struct gv_step_result {
  uint32_t events;               // gv_event bits
  double tension_n[GV_FINGERS];  // what each tendon should pull, before the limiter (gv_tendon_map, then
                                 // gv_tendon_follow)
  int contact_count;
} gv_step_result;

// How much of what a step may cost it is to use. Less costs time no hand feels at once: friction gets less
// exact, shallow contacts are left out.
typedef struct gv_effort {
  double share;      // of the budgets of solvers and of collision detection: above 0, at most 1
  int contacts_max;  // the deepest; at most GV_MAX_CONTACTS
} gv_effort;

typedef struct gv_engine gv_engine;

// Bytes of memory gv_engine_init needs for this config and scene.
size_t gv_engine_size(const gv_config *cfg, const gv_scene *scene);
// Returns null where `size` is too small, the config unsound, or another engine is alive. The scene must
// outlive the engine. Cost: milliseconds; set-up only (ODE's own set-up memory comes from `mem` too).
gv_engine *gv_engine_init(void *mem, size_t size, const gv_config *cfg, const gv_scene *scene);
// Gives ODE's objects back; the memory is the caller's again.
void gv_engine_close(gv_engine *engine);
// One step of step_s: the paper's Figure 3. Never fails, never allocates. Cost: see `make bench`.
void gv_engine_step(gv_engine *engine, const gv_sample *sample, gv_step_result *out);
// The same for as many hands as the engine has (gv_config.second: two): a sample and a result of each. What
// happened to the world stands in the events of both. Limbs do not collide with limbs, be they of one hand
// or of two.
void gv_engine_step_hands(gv_engine *engine, const gv_sample sample[], gv_step_result out[]);
// From the next step on; all of it after gv_engine_init. What it does depends on the
// numbers alone, not on a clock.
void gv_engine_set_effort(gv_engine *engine, gv_effort effort);
// Objects back to their start poses, hand placed anew by the next sample.
void gv_engine_reset(gv_engine *engine);
// Other couplings and another friction of the skin from the next step on. Returns 0, or negative where one
// is out of range (gv_config_check): nothing has changed then. Never allocates.
int gv_engine_adjust(gv_engine *engine, const gv_coupling *limb, const gv_coupling *palm, double mu_hand);

// Views, valid until the next step.
const gv_config *gv_engine_config(const gv_engine *engine);  // as it is in force now
const gv_counters *gv_engine_counters(const gv_engine *engine);
const gv_contact *gv_engine_contacts(const gv_engine *engine, int *out_count);
// Every polygon that a limb touches at the end of the last step, at most `max`.
// Returns the count. Cost: about
// 1 us for each limb in contact, plus 10 ns a polygon of the pieces it touches.
int gv_engine_polygons(const gv_engine *engine, gv_polygon_contact out[], int max);
int gv_engine_hands(const gv_engine *engine);
// Limbs of a second hand are numbered from GV_LIMBS on; what is told without a limb is of the first hand.
bool gv_engine_hand_placed(const gv_engine *engine);
gv_pose gv_engine_limb_pose(const gv_engine *engine, int limb);    // T_world_limb, simulated
gv_pose gv_engine_driver_pose(const gv_engine *engine, int limb);  // T_world_limb, skeleton
void gv_engine_limb_velocity(const gv_engine *engine, int limb, gv_vec3 *out_v, gv_vec3 *out_w);
// Coupling force and torque on the limb in the last step, world, newtons (Eqn 1, 2).
// The person feels the opposite.
void gv_engine_coupling(const gv_engine *engine, int limb, gv_vec3 *out_f, gv_vec3 *out_t);
gv_pose gv_engine_object_pose(const gv_engine *engine, int object);  // T_world_body
void gv_engine_object_velocity(const gv_engine *engine, int object, gv_vec3 *out_v, gv_vec3 *out_w);
gv_joint_state gv_engine_joint(const gv_engine *engine, int joint);
// 22 joint angles as the glove measured them last, rad: calibrated, jumps held back, not filtered.
const double *gv_engine_measured(const gv_engine *engine);
const double *gv_engine_angles(const gv_engine *engine);  // 22 joint angles of the skeleton, rad
// The same of any of its hands: 0, or 1 for the second.
const double *gv_engine_measured_of(const gv_engine *engine, int hand);
const double *gv_engine_angles_of(const gv_engine *engine, int hand);
void gv_engine_memory(const gv_engine *engine, size_t *out_used, size_t *out_peak, size_t *out_size);
// FNV-1a 64 over the whole simulated state (poses, velocities, filters, step count). Cost: 3 us.
uint64_t gv_engine_hash(const gv_engine *engine);
// Kinetic energy plus potential energy of objects in gravity, joules (tests).
double gv_engine_energy(const gv_engine *engine);
// Push an object in the coming step: force (newtons) at its centre of mass and torque (N m), world; pushes
// add up. Not finite is ignored, a static object does not move.
void gv_engine_push_object(gv_engine *engine, int object, gv_vec3 f_world, gv_vec3 t_world);
// Set an object's state (tests, scripted scenes). Not finite is ignored.
void gv_engine_set_object(gv_engine *engine, int object, gv_pose T_world_body, gv_vec3 v, gv_vec3 w);

#ifdef __cplusplus
}
#endif

#endif
