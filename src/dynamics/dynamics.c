// SPDX-License-Identifier: BSD-3-Clause
// Rigid-body dynamics: time stepping with contact and friction as a linear complementarity problem (Eqn 11 to 18). The
// direct solver (direct.c) does what it suits; the rest goes to ODE, whose bodies are kept in step: Dantzig's solver
// for few contacts and QuickStep above. ODE's memory comes from the arena: its allocator is set to a pool, its step
// memory to one block. Real-time thread.
//
// ODE aborts the process on a not-a-number: nothing that is not finite passes gv_dynamics_add_force, _set_state
// or a contact; the engine checks states after each step. It aborts on a pivot of zero as well, which Dantzig's
// solver meets in hopeless piles: its error handler leaves the step by longjmp, the world is built anew from the
// states before the step, and QuickStep, which has no pivots, does the step.
#include "dynamics/dynamics.h"

#include <ode/ode.h>
#include <setjmp.h>
#include <string.h>

#include "dynamics/direct.h"
#include "base/pool.h"

// ODE keeps two step blocks, one for the islands and one for the solver. Dantzig with 128 contacts (384 rows)
// asks for about 3 MB; set-up and joints take 0.2 MB of the pool.
enum { STEP_BLOCKS = 2, STEP_BYTES = 5 << 20, POOL_BYTES = 1 << 20 };
// The most contacts of one island that Dantzig's memory is made for, and the fewest iterations that QuickStep is worth.
enum { DANTZIG_MOST = 128, QUICK_LEAST = 10 };

struct gv_dynamics {
  dWorldID world;
  dThreadingImplementationID threading;
  dJointGroupID contacts;
  dBodyID body[GV_BODIES];           // null: static or unused
  bool in_ode[GV_BODIES];            // simulated by ODE; else at rest, parked, or a limb that touches nothing
  bool parked;                       // the limbs have no driver yet
  gv_body_state state[GV_BODIES];    // copy after each step
  gv_vec3 force[GV_BODIES], torque[GV_BODIES]; // applied in the coming step, gravity apart
  double mass[GV_BODIES];            // without what the coupling adds
  double inv_mass[GV_BODIES];        // of the body as ODE sees it
  gv_mat3 inertia[GV_BODIES], inv_inertia[GV_BODIES]; // likewise, body axes
  gv_direct newton;
  gv_problem problem;
  gv_velocity velocity[GV_BODIES];   // after the step, first without contacts
  bool ahead_of_ode;                 // bodies have moved since ODE last saw them
  int body_count;
  gv_vec3 gravity;
  const gv_config *cfg;
  dJointFeedback feedback[GV_MAX_CONTACTS];
  pool memory;
  pool memory_bare;                  // before anything of a world was in it: building anew starts here
  uint8_t *step_block[STEP_BLOCKS];
  bool step_block_taken[STEP_BLOCKS];
  jmp_buf way_out;                   // of a step that ODE gives up
  bool stepping;                     // way_out is set
  unsigned solver_errors;            // messages, and steps that a solver gave up
};

// ODE keeps its handlers in globals, so one world at a time.
static gv_dynamics *the_world;

static void *ode_alloc(dsizeint size) { return pool_alloc(&the_world->memory, size); }
static void ode_free(void *at, dsizeint size) { pool_free(&the_world->memory, at, size); }
static void *ode_realloc(void *at, dsizeint old_size, dsizeint size) {
  void *fresh = pool_alloc(&the_world->memory, size);
  if (fresh && at) memcpy(fresh, at, old_size < size ? old_size : size);
  if (fresh) ode_free(at, old_size);
  return fresh;
}
static void *step_alloc(dsizeint size) {
  if (size > STEP_BYTES) return NULL;
  for (int i = 0; i < STEP_BLOCKS; i++)
    if (!the_world->step_block_taken[i]) {
      the_world->step_block_taken[i] = true;
      return the_world->step_block[i];
    }
  return NULL;
}
static void *step_shrink(void *at, dsizeint size, dsizeint smaller) { (void)size; (void)smaller; return at; }
static void step_free(void *at, dsizeint size) {
  (void)size;
  for (int i = 0; i < STEP_BLOCKS; i++)
    if (at == the_world->step_block[i]) the_world->step_block_taken[i] = false;
}
static void count_message(int number, const char *text, va_list args) {
  (void)number; (void)text; (void)args;
  if (the_world) the_world->solver_errors++;
}

// ODE would abort the process when this returns.
static void leave_step(int number, const char *text, va_list args) {
  (void)number; (void)text; (void)args;
  if (the_world && the_world->stepping) longjmp(the_world->way_out, 1);
}

static gv_vec3 from_ode(const dReal *v) { return gv_v3(v[0], v[1], v[2]); }

static void write_state(gv_dynamics *dyn, int i) {
  const gv_body_state *s = &dyn->state[i];
  const dQuaternion q = {s->T.q.w, s->T.q.x, s->T.q.y, s->T.q.z};
  dBodySetPosition(dyn->body[i], s->T.p.x, s->T.p.y, s->T.p.z);
  dBodySetQuaternion(dyn->body[i], q);
  dBodySetLinearVel(dyn->body[i], s->v.x, s->v.y, s->v.z);
  dBodySetAngularVel(dyn->body[i], s->w.x, s->w.y, s->w.z);
}

// Takes a body into ODE's simulation with the state that it has here, or out of it.
static void put_in_ode(gv_dynamics *dyn, int i, bool in) {
  if (!dyn->body[i] || dyn->in_ode[i] == in) return;
  dyn->in_ode[i] = in;
  if (!in) { dBodyDisable(dyn->body[i]); return; }
  write_state(dyn, i);
  dBodyEnable(dyn->body[i]);
}

static void read_back(gv_dynamics *dyn, int i) {
  dBodyID b = dyn->body[i];
  const dReal *q = dBodyGetQuaternion(b);
  dyn->state[i] = (gv_body_state){{{q[0], q[1], q[2], q[3]}, from_ode(dBodyGetPosition(b))},
                                  from_ode(dBodyGetLinearVel(b)), from_ode(dBodyGetAngularVel(b))};
}

static void set_mass(gv_dynamics *dyn, int i, double mass, double added_mass, const gv_mat3 *inertia, double added_inertia) {
  dMass m;
  dMassSetZero(&m);
  m.mass = mass + added_mass;
  for (int r = 0; r < 3; r++)
    for (int c = 0; c < 3; c++) m.I[4 * r + c] = inertia->m[r][c] + (r == c ? added_inertia : 0.0);
  dBodySetMass(dyn->body[i], &m);
  dyn->mass[i] = mass;
  dyn->inv_mass[i] = 1.0 / m.mass;
  dyn->inertia[i] = *inertia;
  for (int k = 0; k < 3; k++) dyn->inertia[i].m[k][k] += added_inertia;
  dyn->inv_inertia[i] = gv_mat3_inverse(&dyn->inertia[i]);
}

static void create_body(gv_dynamics *dyn, int i, double mass, const gv_mat3 *inertia) {
  dyn->body[i] = dBodyCreate(dyn->world);
  set_mass(dyn, i, mass, 0.0, inertia, 0.0);
}

void gv_dynamics_set_limb(gv_dynamics *dyn, int limb, const gv_spring *spring, double inertia) {
  const gv_mat3 own = {{{inertia, 0, 0}, {0, inertia, 0}, {0, 0, inertia}}};
  set_mass(dyn, limb, spring->mass_kg, spring->added_mass_kg, &own, spring->added_inertia);
}

// I / m = 2/5 r^2 with 4/3 pi r^3 = volume.
double gv_sphere_inertia_of_box(gv_vec3 size_m) {
  double r = gv_cbrt(size_m.x * size_m.y * size_m.z * 3.0 / (4.0 * GV_PI));
  return 0.4 * r * r;
}

static double sphere_inertia_per_mass(const gv_scene *scene, const gv_object *o) {
  gv_vec3 lo = gv_v3(1e9, 1e9, 1e9), hi = gv_v3(-1e9, -1e9, -1e9);
  for (int i = 0; i < o->piece_count; i++) {
    const gv_hull *h = &scene->piece[o->piece_first + i];
    gv_vec3 r = gv_v3(h->radius, h->radius, h->radius), min = gv_sub(h->aabb_min, r), max = gv_add(h->aabb_max, r);
    lo = gv_v3(fmin(lo.x, min.x), fmin(lo.y, min.y), fmin(lo.z, min.z));
    hi = gv_v3(fmax(hi.x, max.x), fmax(hi.y, max.y), fmax(hi.z, max.z));
  }
  return gv_sphere_inertia_of_box(gv_sub(hi, lo));
}

static void create_object(gv_dynamics *dyn, const gv_scene *scene, int index) {
  const gv_object *o = &scene->object[index];
  if (o->is_static) return;
  double mass = dyn->cfg->override_mass_kg > 0.0 ? dyn->cfg->override_mass_kg : o->mass_kg;
  gv_mat3 inertia = o->inertia_kg_m2;
  double sphere = dyn->cfg->override_sphere_inertia ? mass * sphere_inertia_per_mass(scene, o) : 0.0;
  for (int r = 0; r < 3; r++)
    for (int c = 0; c < 3; c++)
      inertia.m[r][c] = sphere > 0.0 ? (r == c ? sphere : 0.0) : inertia.m[r][c] * mass / o->mass_kg;
  create_body(dyn, GV_LIMBS + index, mass, &inertia);
  dyn->in_ode[GV_LIMBS + index] = true;
}

static gv_vec3 choose_gravity(const gv_config *cfg, const gv_scene *scene) {
  if (!(cfg->override_gravity_m_s2 > 0.0)) return scene->gravity_m_s2;
  return gv_scale(gv_normalize_or(scene->gravity_m_s2, gv_v3(0, 0, -1)), cfg->override_gravity_m_s2);
}

static void create_world(gv_dynamics *dyn) {
  const gv_config *cfg = dyn->cfg;
  dyn->world = dWorldCreate();
  // A job list of its own: ODE's shared one would keep the job of a step that was left.
  dyn->threading = dThreadingAllocateSelfThreadedImplementation();
  dWorldSetStepThreadingImplementation(dyn->world, dThreadingImplementationGetFunctions(dyn->threading), dyn->threading);
  dWorldSetGravity(dyn->world, dyn->gravity.x, dyn->gravity.y, dyn->gravity.z);
  dWorldSetCFM(dyn->world, cfg->world_cfm);
  dWorldSetQuickStepNumIterations(dyn->world, cfg->quick_iterations);
  // A limb that finds itself deep inside an object is let out gently, not shot.
  dWorldSetContactMaxCorrectingVel(dyn->world, 0.25);
  dWorldSetContactSurfaceLayer(dyn->world, 0.0);
  dWorldSetAutoDisableFlag(dyn->world, 0);
  const dWorldStepMemoryFunctionsInfo memory = {sizeof memory, step_alloc, step_shrink, step_free};
  const dWorldStepReserveInfo reserve = {sizeof reserve, 1.0f, STEP_BYTES};
  dWorldSetStepMemoryManager(dyn->world, &memory);
  dWorldSetStepMemoryReservationPolicy(dyn->world, &reserve);
  dyn->contacts = dJointGroupCreate(0);
}

static void create_limb(gv_dynamics *dyn, int i) {
  dyn->body[i] = dBodyCreate(dyn->world);
  dBodySetGravityMode(dyn->body[i], 0);          // gravity acts on m, not on m': the engine adds it
  dBodySetGyroscopicMode(dyn->body[i], 0);
}

// After a step that ODE gave up: nothing of its world can be trusted. The bodies as they were before the step.
// Some 0.1 ms, and the one case of heap calls after set-up: dBodyCreate has C++ members.
static void build_anew(gv_dynamics *dyn) {
  dMass mass[GV_BODIES];
  bool enabled[GV_BODIES];
  for (int i = 0; i < dyn->body_count; i++) {
    if (!dyn->body[i]) continue;
    dBodyGetMass(dyn->body[i], &mass[i]);
    enabled[i] = dBodyIsEnabled(dyn->body[i]);
  }
  dyn->memory = dyn->memory_bare;
  memset(dyn->step_block_taken, 0, sizeof dyn->step_block_taken);
  create_world(dyn);
  for (int i = 0; i < dyn->body_count; i++) {
    if (!dyn->body[i]) continue;
    if (i < GV_LIMBS) create_limb(dyn, i);
    else dyn->body[i] = dBodyCreate(dyn->world);
    dBodySetMass(dyn->body[i], &mass[i]);
    const gv_body_state before = dyn->state[i];
    gv_dynamics_set_state(dyn, i, &before);
    if (!enabled[i]) dBodyDisable(dyn->body[i]);
  }
}

gv_dynamics *gv_dynamics_create(gv_arena *arena, const gv_config *cfg, const gv_scene *scene,
                                const gv_spring spring[GV_LIMBS], const double limb_inertia[GV_LIMBS]) {
  gv_dynamics *dyn = gv_arena_alloc(arena, "dynamics", sizeof *dyn);
  void *pool_block = gv_arena_alloc(arena, "ode pool", POOL_BYTES);
  void *step_block = gv_arena_alloc(arena, "ode step", STEP_BLOCKS * STEP_BYTES);
  if (!dyn || !pool_block || !step_block || the_world) return NULL;
  the_world = dyn;
  dyn->cfg = cfg;
  for (int i = 0; i < STEP_BLOCKS; i++) dyn->step_block[i] = (uint8_t *)step_block + i * STEP_BYTES;
  dyn->body_count = GV_LIMBS + scene->object_count;
  pool_init(&dyn->memory, pool_block, POOL_BYTES);
  dSetAllocHandler(ode_alloc);
  dSetReallocHandler(ode_realloc);
  dSetFreeHandler(ode_free);
  dSetMessageHandler(count_message);
  dSetErrorHandler(leave_step);
  dSetDebugHandler(leave_step);
  dInitODE2(0);
  dyn->memory_bare = dyn->memory;
  dyn->gravity = choose_gravity(cfg, scene);
  create_world(dyn);
  for (int i = 0; i < GV_LIMBS; i++) {
    create_limb(dyn, i);
    gv_dynamics_set_limb(dyn, i, &spring[i], limb_inertia[i]);
    dyn->in_ode[i] = true;
    read_back(dyn, i);
  }
  for (int i = 0; i < scene->object_count; i++) {
    create_object(dyn, scene, i);
    dyn->state[GV_LIMBS + i].T = scene->object[i].T_world_body;
    gv_dynamics_set_state(dyn, GV_LIMBS + i, &dyn->state[GV_LIMBS + i]);
  }
  return dyn;
}

void gv_dynamics_destroy(gv_dynamics *dyn) {
  if (!dyn || the_world != dyn) return;
  dJointGroupDestroy(dyn->contacts);
  dWorldDestroy(dyn->world);
  dThreadingFreeImplementation(dyn->threading);
  dCloseODE();
  dSetAllocHandler(NULL);
  dSetReallocHandler(NULL);
  dSetFreeHandler(NULL);
  dSetMessageHandler(NULL);
  dSetErrorHandler(NULL);
  dSetDebugHandler(NULL);
  the_world = NULL;
}

const gv_body_state *gv_dynamics_state(const gv_dynamics *dyn, int body) { return &dyn->state[body]; }

void gv_dynamics_set_state(gv_dynamics *dyn, int body, const gv_body_state *s) {
  if (!dyn->body[body] || !gv_pose_finite(s->T) || !gv_v3_finite(s->v) || !gv_v3_finite(s->w)) return;
  dyn->state[body] = *s;
  dyn->state[body].T.q = gv_quat_normalize(s->T.q);
  write_state(dyn, body);
  read_back(dyn, body);  // ODE normalizes once more
}

void gv_dynamics_park_limbs(gv_dynamics *dyn, bool parked) {
  dyn->parked = parked;
  for (int i = 0; i < GV_LIMBS; i++) put_in_ode(dyn, i, false);
}

void gv_dynamics_set_rest(gv_dynamics *dyn, int body, bool rest) {
  if (rest) dyn->state[body].v = dyn->state[body].w = gv_v3(0, 0, 0);
  put_in_ode(dyn, body, !rest);
}

bool gv_dynamics_pushed(const gv_dynamics *dyn, int body) {
  return gv_norm2(dyn->force[body]) > 0.0 || gv_norm2(dyn->torque[body]) > 0.0;
}

gv_vec3 gv_dynamics_gravity(const gv_dynamics *dyn) { return dyn->gravity; }

double gv_dynamics_mass(const gv_dynamics *dyn, int body) { return dyn->body[body] ? dyn->mass[body] : 0.0; }

void gv_dynamics_predict(const gv_dynamics *dyn, int body, gv_body_state *out) {
  double h = dyn->cfg->step_s;
  *out = dyn->state[body];
  if (!dyn->body[body] || (body >= GV_LIMBS && !dyn->in_ode[body])) { out->v = out->w = gv_v3(0, 0, 0); return; }
  out->v = gv_mad(out->v, h * dyn->inv_mass[body], dyn->force[body]);
  if (body >= GV_LIMBS) out->v = gv_mad(out->v, h, dyn->gravity);
}

void gv_dynamics_add_force(gv_dynamics *dyn, int body, gv_vec3 f, gv_vec3 t) {
  if (!dyn->body[body] || !gv_v3_finite(f) || !gv_v3_finite(t)) return;
  dyn->force[body] = gv_add(dyn->force[body], f);
  dyn->torque[body] = gv_add(dyn->torque[body], t);
}

static bool contact_sound(const gv_dynamics_contact *c) {
  return gv_v3_finite(c->position) && gv_v3_finite(c->normal) && gv_v3_finite(c->friction_dir) && isfinite(c->depth) &&
         isfinite(c->mu) && fabs(gv_norm2(c->normal) - 1.0) < 1e-6;
}

// Softness on the normal row alone: friction rows that inherit a large CFM creep and drop the object.
static void create_contact(gv_dynamics *dyn, const gv_dynamics_contact *c, dJointFeedback *feedback) {
  const gv_config *cfg = dyn->cfg;
  dContact k;
  memset(&k, 0, sizeof k);
  k.surface.mode = dContactSoftERP | dContactSoftCFM | dContactFDir1;
  if (c->friction == GV_FRICTION_PYRAMID) k.surface.mode |= dContactApprox1;
  k.surface.mu = c->mu;
  k.surface.soft_erp = cfg->contact_erp;
  k.surface.soft_cfm = cfg->contact_cfm;
  if (c->depth < 0.0) {  // a gap: the normal velocity may close it within this step, no more
    k.surface.mode |= dContactMotionN;
    k.surface.motionN = c->depth / cfg->step_s;
  } else {
    k.geom.depth = c->depth;
  }
  const gv_vec3 v[3] = {c->position, c->normal, c->friction_dir};
  dReal *to[3] = {k.geom.pos, k.geom.normal, k.fdir1};
  for (int i = 0; i < 3; i++) { to[i][0] = v[i].x; to[i][1] = v[i].y; to[i][2] = v[i].z; }
  dJointID joint = dJointCreateContact(dyn->world, dyn->contacts, &k);
  dJointAttach(joint, dyn->body[c->body_a], dyn->in_ode[c->body_b] ? dyn->body[c->body_b] : NULL);
  dJointSetFeedback(joint, feedback);
}

static int find_root(uint8_t *parent, int i) {
  for (; parent[i] != i; i = parent[i]) parent[i] = parent[parent[i]];
  return i;
}

// Contacts of the largest group of bodies that touch each other: ODE solves each group alone. Union by path halving.
static int largest_island(const gv_dynamics *dyn, const gv_dynamics_contact *contact, int count) {
  uint8_t parent[GV_BODIES];
  int contacts[GV_BODIES] = {0};
  int largest = 0;
  for (int i = 0; i < GV_BODIES; i++) parent[i] = (uint8_t)i;
  for (int i = 0; i < count; i++) {
    int a = find_root(parent, contact[i].body_a);
    if (dyn->in_ode[contact[i].body_b]) parent[a] = (uint8_t)find_root(parent, contact[i].body_b);
  }
  for (int i = 0; i < count; i++) {
    int at = find_root(parent, contact[i].body_a);
    if (++contacts[at] > largest) largest = contacts[at];
  }
  return largest;
}

// Dantzig's exact solver where its cost, the cube of an island's rows, fits into the share of the period that the
// solver has; else QuickStep with as many iterations as fit, and where the direct solver found no way (Dantzig's then
// runs into a pivot of nearly zero now and then, `LCP internal error`). Costs as measured by `make bench`.
static bool choose_solver(gv_dynamics *dyn, const gv_dynamics_contact *contact, int count, bool knotted) {
  const gv_config *cfg = dyn->cfg;
  const double share_ns = 0.4e9 * cfg->step_s;
  int island = largest_island(dyn, contact, count), most = cfg->solver == GV_SOLVER_DANTZIG ? DANTZIG_MOST : cfg->dantzig_contacts;
  double rows = 3.0 * island, dantzig_ns = 0.5 * rows * rows * rows;
  bool fits = island <= most && (cfg->solver == GV_SOLVER_DANTZIG || dantzig_ns <= share_ns);
  if (cfg->solver != GV_SOLVER_QUICK && fits && !knotted) return false;
  double iterations = share_ns / (15.0 * 3.0 * fmax(count, 1));
  dWorldSetQuickStepNumIterations(dyn->world, (int)gv_clamp(iterations, fmin(QUICK_LEAST, cfg->quick_iterations), cfg->quick_iterations));
  return true;
}

// Limbs join ODE's world while they touch something.
static void sort_limbs(gv_dynamics *dyn, const gv_dynamics_contact *contact, int count) {
  bool touches[GV_BODIES] = {false};
  for (int i = 0; i < count; i++) touches[contact[i].body_a] = touches[contact[i].body_b] = true;
  for (int i = 0; i < GV_LIMBS; i++) put_in_ode(dyn, i, touches[i]);
}

// False where ODE has no memory for the step, or gave it up: the bodies are where they were.
static bool try_step(gv_dynamics *dyn, const gv_dynamics_contact *contact, int count, bool quick) {
  memset(dyn->feedback, 0, sizeof *dyn->feedback * (size_t)count);
  for (int i = 0; i < count; i++)
    if (contact_sound(&contact[i])) create_contact(dyn, &contact[i], &dyn->feedback[i]);
  for (int i = 0; i < dyn->body_count; i++) {
    if (!dyn->in_ode[i]) continue;
    dBodyAddForce(dyn->body[i], dyn->force[i].x, dyn->force[i].y, dyn->force[i].z);
    dBodyAddTorque(dyn->body[i], dyn->torque[i].x, dyn->torque[i].y, dyn->torque[i].z);
  }
  dRandSetSeed(1);  // QuickStep shuffles its rows: the same way in every replay
  dyn->stepping = true;
  if (setjmp(dyn->way_out)) {
    dyn->stepping = false;
    build_anew(dyn);
    memset(dyn->feedback, 0, sizeof *dyn->feedback * (size_t)count);
    return false;
  }
  const int done = quick ? dWorldQuickStep(dyn->world, dyn->cfg->step_s) : dWorldStep(dyn->world, dyn->cfg->step_s);
  dyn->stepping = false;
  dJointGroupEmpty(dyn->contacts);
  return done;
}

// ---- without ODE ----------------------------------------------------------------------------------

// R K R^T.
static gv_mat3 in_world(gv_quat q, const gv_mat3 *K) {
  gv_mat3 R = gv_mat3_from_quat(q), out;
  for (int r = 0; r < 3; r++) {
    gv_vec3 row = gv_mat3_mul_t(K, gv_v3(R.m[r][0], R.m[r][1], R.m[r][2])), of_world = gv_mat3_mul(&R, row);
    out.m[r][0] = of_world.x, out.m[r][1] = of_world.y, out.m[r][2] = of_world.z;
  }
  return out;
}

// Spin w (body axes) after a step without torque: I (w1 - w) + h w1 x I w1 = 0, one Newton step from w (Catto 2015).
static gv_vec3 turn_freely(const gv_mat3 *I, gv_vec3 w, double h) {
  gv_vec3 L = gv_mat3_mul(I, w), f = gv_scale(gv_cross(w, L), h);
  gv_mat3 J;
  for (int c = 0; c < 3; c++) {
    gv_vec3 e = gv_v3(c == 0, c == 1, c == 2), Ie = gv_mat3_mul(I, e);
    gv_vec3 column = gv_mad(Ie, h, gv_add(gv_cross(w, Ie), gv_cross(e, L)));
    J.m[0][c] = column.x, J.m[1][c] = column.y, J.m[2][c] = column.z;
  }
  J = gv_mat3_inverse(&J);
  return gv_sub(w, gv_mat3_mul(&J, f));
}

// Does not move: static, at rest, or a limb without a driver.
static bool stands(const gv_dynamics *dyn, int i) { return !dyn->body[i] || (i < GV_LIMBS ? dyn->parked : !dyn->in_ode[i]); }

// A limb's inertia is the same about every axis.
static void move_limb_freely(const gv_dynamics *dyn, int i, gv_problem_body *out) {
  const gv_body_state *s = &dyn->state[i];
  const double h = dyn->cfg->step_s;
  out->inertia = dyn->inertia[i];
  out->v = gv_mad(s->v, h * dyn->inv_mass[i], dyn->force[i]);
  out->w = gv_mad(s->w, h * dyn->inv_inertia[i].m[0][0], dyn->torque[i]);
}

static void move_object_freely(const gv_dynamics *dyn, int i, gv_problem_body *out) {
  const gv_body_state *s = &dyn->state[i];
  const double h = dyn->cfg->step_s;
  out->inertia = in_world(s->T.q, &dyn->inertia[i]);
  out->v = gv_mad(gv_mad(s->v, h, dyn->gravity), h * dyn->inv_mass[i], dyn->force[i]);
  gv_vec3 torque = gv_mat3_mul(&dyn->inv_inertia[i], gv_rotate_inv(s->T.q, dyn->torque[i]));
  gv_vec3 w = gv_mad(turn_freely(&dyn->inertia[i], gv_rotate_inv(s->T.q, s->w), h), h, torque);
  out->w = gv_rotate(s->T.q, w);
}

static void move_freely(gv_dynamics *dyn) {
  for (int i = 0; i < dyn->body_count; i++) {
    gv_problem_body *b = &dyn->problem.body[i];
    b->p = dyn->state[i].T.p;
    b->mass = stands(dyn, i) ? 0.0 : 1.0 / dyn->inv_mass[i];
    if (b->mass <= 0.0) b->v = b->w = gv_v3(0, 0, 0);
    else if (i < GV_LIMBS) move_limb_freely(dyn, i, b);
    else move_object_freely(dyn, i, b);
    dyn->velocity[i] = (gv_velocity){b->v, b->w};
  }
}

// The same semi-implicit step as ODE's: positions follow the new velocities.
static void move_body(gv_dynamics *dyn, int i, const gv_velocity *b) {
  gv_body_state *s = &dyn->state[i];
  const double h = dyn->cfg->step_s;
  s->v = b->v;
  s->w = b->w;
  s->T.p = gv_mad(s->T.p, h, s->v);
  gv_quat q = s->T.q, d = gv_quat_mul((gv_quat){0, s->w.x, s->w.y, s->w.z}, q);
  s->T.q = gv_quat_normalize((gv_quat){q.w + 0.5 * h * d.w, q.x + 0.5 * h * d.x, q.y + 0.5 * h * d.y, q.z + 0.5 * h * d.z});
}

static bool solve_newton(gv_dynamics *dyn, const gv_dynamics_contact *contact, int count, gv_vec3 force_on_a[]) {
  gv_vec3 impulse[GV_MAX_CONTACTS];
  int index[GV_MAX_CONTACTS];
  move_freely(dyn);
  dyn->problem.step_s = dyn->cfg->step_s;
  dyn->problem.budget_s = 0.5 * dyn->cfg->step_s;
  dyn->problem.body_count = dyn->body_count;
  gv_problem_set_contacts(&dyn->problem, dyn->cfg, contact, count, index);
  if (!gv_solver_newton.solve(&dyn->newton, &dyn->problem, dyn->velocity, impulse)) return false;
  memset(force_on_a, 0, sizeof *force_on_a * (size_t)count);
  for (int i = 0; i < dyn->problem.contact_count; i++) force_on_a[index[i]] = gv_scale(impulse[i], 1.0 / dyn->cfg->step_s);
  for (int i = 0; i < dyn->body_count; i++)
    if (!stands(dyn, i)) move_body(dyn, i, &dyn->velocity[i]);
  dyn->ahead_of_ode = true;
  return true;
}

// ---- the step -------------------------------------------------------------------------------------

static void write_states(gv_dynamics *dyn) {
  for (int i = 0; i < dyn->body_count && dyn->ahead_of_ode; i++)
    if (dyn->in_ode[i]) write_state(dyn, i);
  dyn->ahead_of_ode = false;
}

static gv_solver solve_in_ode(gv_dynamics *dyn, const gv_dynamics_contact *contact, int count, bool knotted, gv_vec3 force_on_a[]) {
  move_freely(dyn);
  write_states(dyn);
  sort_limbs(dyn, contact, count);
  bool quick = choose_solver(dyn, contact, count, knotted), done = try_step(dyn, contact, count, quick);
  if (!done) dyn->solver_errors++;
  if (!done && !quick) {
    quick = true;
    if (!try_step(dyn, contact, count, true)) dyn->solver_errors++;
  }
  for (int i = 0; i < count; i++) force_on_a[i] = from_ode(dyn->feedback[i].f1);
  for (int i = 0; i < dyn->body_count; i++) {
    if (dyn->in_ode[i]) read_back(dyn, i);
    else if (!stands(dyn, i)) move_body(dyn, i, &dyn->velocity[i]);
  }
  return quick ? GV_SOLVER_QUICK : GV_SOLVER_DANTZIG;
}

static bool all_coulomb(const gv_dynamics_contact *contact, int count) {
  for (int i = 0; i < count; i++)
    if (contact[i].friction != GV_FRICTION_PYRAMID) return false;
  return true;
}

gv_solver gv_dynamics_step(gv_dynamics *dyn, const gv_dynamics_contact *contact, int count, gv_vec3 force_on_a[]) {
  bool suits = dyn->cfg->solver == GV_SOLVER_AUTO && all_coulomb(contact, count);
  bool solved = suits && solve_newton(dyn, contact, count, force_on_a);
  gv_solver used = solved ? GV_SOLVER_DIRECT : solve_in_ode(dyn, contact, count, suits, force_on_a);
  for (int i = 0; i < dyn->body_count; i++) dyn->force[i] = dyn->torque[i] = gv_v3(0, 0, 0);
  return used;
}

void gv_dynamics_forget(gv_dynamics *dyn) { gv_solver_newton.forget(&dyn->newton); }

void gv_dynamics_warm_up(gv_dynamics *dyn) {
  static const gv_dynamics_contact floor = {.body_a = 0, .body_b = 1, .normal = {0, 0, 1}, .friction_dir = {1, 0, 0}, .mu = 1};
  gv_body_state kept[GV_BODIES];
  gv_vec3 unused[GV_MAX_CONTACTS];
  gv_dynamics_contact contact[GV_MAX_CONTACTS];
  memcpy(kept, dyn->state, sizeof kept);
  for (int i = 0; i < GV_MAX_CONTACTS; i++) {
    contact[i] = floor;
    contact[i].body_a = i % GV_LIMBS;
    contact[i].body_b = (i + 1) % GV_LIMBS;
    contact[i].position = gv_v3(0.01 * i, 0.02 * (i % 7), 0);
  }
  gv_config asked = *dyn->cfg, *warm = &asked;
  const gv_config *own = dyn->cfg;
  dyn->cfg = warm;
  warm->solver = GV_SOLVER_DANTZIG;
  gv_dynamics_step(dyn, contact, DANTZIG_MOST, unused);
  warm->solver = GV_SOLVER_QUICK;
  gv_dynamics_step(dyn, contact, GV_MAX_CONTACTS, unused);
  dyn->cfg = own;
  for (int i = 0; i < dyn->body_count; i++) gv_dynamics_set_state(dyn, i, &kept[i]);
  dyn->solver_errors = 0;  // the warm-up's contacts make no sense to a solver
}

unsigned gv_dynamics_solver_errors(const gv_dynamics *dyn) { return dyn->solver_errors; }

double gv_dynamics_object_energy(const gv_dynamics *dyn) {
  double sum = 0.0;
  for (int i = GV_LIMBS; i < dyn->body_count; i++) {
    if (!dyn->body[i]) continue;
    const gv_body_state *s = &dyn->state[i];
    gv_vec3 w = gv_rotate_inv(s->T.q, s->w);
    sum += 0.5 * dyn->mass[i] * gv_norm2(s->v) + 0.5 * gv_dot(w, gv_mat3_mul(&dyn->inertia[i], w));
    sum -= dyn->mass[i] * gv_dot(dyn->gravity, s->T.p);
  }
  return sum;
}
