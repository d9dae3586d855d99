// SPDX-License-Identifier: BSD-3-Clause
// The file that knows ODE; joints have one of their own, ode_joint.c (user guide, ode.org/wiki: "Contact",
// "Error and memory handling", "World"). One ODE body for each body number, all disabled. A call enables
// those that a contact names, gives them the problem's positions, velocities without contacts, masses and
// inertias, steps, and reads their velocities. The inertia is given in world axes with the rotation always
// the identity; there is no gravity and no gyroscopic term, for the velocities hold them already; ODE's
// poses after the step are never read. A contact joint's rows are those of the problem:
//
//   normal   dContactMotionN = target_velocity with depth 0, soft_cfm = c_n h
//   tangents dContactFDir1, slip1 = slip2 = c_t h, mu or force limit
//   patch    dContactRolling, rhoN = 2/3 mu R, for ODE stiff
//
// Memory: ODE's allocator is a pool in the arena, its step memory one block of it. ODE ends the process on a
// pivot of zero; its error handler leaves the step by longjmp instead, and the pool goes back to the image
// that was taken of it when the world was new: 2 us and no heap call, where building the world anew would
// take 0.1 ms and many.
#include "dynamics/ode.h"

#include <assert.h>
#include <ode/ode.h>
#include <setjmp.h>
#include <string.h>

#include "base/pool.h"
#include "dynamics/ode_joint.h"

// ODE keeps two step blocks, one for the islands and one for the solver. Dantzig's with 128 contacts (384
// rows) asks for about 3 MB; the new world takes 0.06 MB of the pool, joints 0.2 MB more.
enum { STEP_BLOCKS = 2, STEP_BYTES = 5 << 20, POOL_BYTES = 1 << 20 };

struct gv_ode {
  dWorldID world;
  dThreadingImplementationID threading;
  dJointGroupID contacts;
  dBodyID body[GV_BODIES];
  double mass[GV_BODIES];      // as ODE has it; 0: not yet
  gv_mat3 inertia[GV_BODIES];  // likewise
  dJointFeedback feedback[GV_MAX_CONTACTS];
  pool memory;
  pool memory_new;  // as it was when the world was new,
  uint8_t *image;   // and what was in it
  uint8_t *step_block[STEP_BLOCKS];
  bool step_block_taken[STEP_BLOCKS];
  jmp_buf way_out;  // of a step that ODE gives up
  bool stepping;    // way_out is set
  unsigned messages, failures;
};

static gv_ode *the_ode;

// ---- memory and errors ----------------------------------------------------------------------------

static void *ode_alloc(dsizeint size) { return pool_alloc(&the_ode->memory, size); }
static void ode_free(void *at, dsizeint size) { pool_free(&the_ode->memory, at, size); }

static void *ode_realloc(void *at, dsizeint old_size, dsizeint size) {
  void *fresh = pool_alloc(&the_ode->memory, size);
  if (fresh && at)
    memcpy(fresh, at, old_size < size ? old_size : size);
  if (fresh)
    ode_free(at, old_size);
  return fresh;
}

static void *step_alloc(dsizeint size) {
  if (size > STEP_BYTES)
    return NULL;
  for (int i = 0; i < STEP_BLOCKS; i++) {
    if (the_ode->step_block_taken[i])
      continue;
    the_ode->step_block_taken[i] = true;
    return the_ode->step_block[i];
  }
  return NULL;
}

static void *step_shrink(void *at, dsizeint size, dsizeint smaller) {
  (void)size;
  (void)smaller;
  return at;
}

static void step_free(void *at, dsizeint size) {
  (void)size;
  for (int i = 0; i < STEP_BLOCKS; i++)
    if (at == the_ode->step_block[i])
      the_ode->step_block_taken[i] = false;
}

static void count_message(int number, const char *text, va_list args) {
  (void)number;
  (void)text;
  (void)args;
  the_ode->messages++;
}

// ODE would abort the process when this returns.
static void leave_step(int number, const char *text, va_list args) {
  (void)number;
  (void)text;
  (void)args;
  if (the_ode->stepping)
    longjmp(the_ode->way_out, 1);
}

static void set_handlers(bool ours) {
  dSetAllocHandler(ours ? ode_alloc : NULL);
  dSetReallocHandler(ours ? ode_realloc : NULL);
  dSetFreeHandler(ours ? ode_free : NULL);
  dSetMessageHandler(ours ? count_message : NULL);
  dSetErrorHandler(ours ? leave_step : NULL);
  dSetDebugHandler(ours ? leave_step : NULL);
}

// ---- a new world ----------------------------------------------------------------------------------

static void create_world(gv_ode *o) {
  o->world = dWorldCreate();
  // A job list of its own, in the pool: ODE's shared one would keep the job of a step that was left.
  o->threading = dThreadingAllocateSelfThreadedImplementation();
  const dThreadingFunctionsInfo *functions = dThreadingImplementationGetFunctions(o->threading);
  dWorldSetStepThreadingImplementation(o->world, functions, o->threading);
  // It bounds motionN too, and the problem has bounded that.
  dWorldSetContactMaxCorrectingVel(o->world, dInfinity);
  const dWorldStepMemoryFunctionsInfo memory = {sizeof memory, step_alloc, step_shrink, step_free};
  const dWorldStepReserveInfo reserve = {sizeof reserve, 1.0f, STEP_BYTES};
  dWorldSetStepMemoryManager(o->world, &memory);
  dWorldSetStepMemoryReservationPolicy(o->world, &reserve);
  o->contacts = dJointGroupCreate(0);
  for (int i = 0; i < GV_BODIES; i++) {
    o->body[i] = dBodyCreate(o->world);
    dBodySetGravityMode(o->body[i], 0);
    dBodySetGyroscopicMode(o->body[i], 0);
    dBodySetAutoDisableFlag(o->body[i], 0);
    dBodySetLinearDamping(o->body[i], 0.0);
    dBodySetAngularDamping(o->body[i], 0.0);
    dBodyDisable(o->body[i]);
  }
}

static void take_image(gv_ode *o) {
  o->memory_new = o->memory;
  memcpy(o->image, o->memory.base, o->memory.used);
}

static void restore_image(gv_ode *o) {
  o->memory = o->memory_new;
  memcpy(o->memory.base, o->image, o->memory.used);
  memset(o->step_block_taken, 0, sizeof o->step_block_taken);
  memset(o->mass, 0, sizeof o->mass);
}

gv_ode *gv_ode_open(gv_arena *arena) {
  gv_ode *o = gv_arena_alloc(arena, "ode", sizeof *o);
  uint8_t *pool_block = gv_arena_alloc(arena, "ode pool", POOL_BYTES);
  uint8_t *image = gv_arena_alloc(arena, "ode pool's image", POOL_BYTES / 4);
  uint8_t *step_block = gv_arena_alloc(arena, "ode step", STEP_BLOCKS * STEP_BYTES);
  if (!o || !pool_block || !image || !step_block || the_ode)
    return NULL;
  the_ode = o;
  o->image = image;
  for (int i = 0; i < STEP_BLOCKS; i++)
    o->step_block[i] = step_block + i * STEP_BYTES;
  pool_init(&o->memory, pool_block, POOL_BYTES);
  set_handlers(true);
  dInitODE2(0);
  create_world(o);
  assert(o->memory.used <= POOL_BYTES / 4);
  take_image(o);
  return o;
}

void gv_ode_close(gv_ode *o) {
  if (!o || the_ode != o)
    return;
  dJointGroupDestroy(o->contacts);
  dWorldDestroy(o->world);
  dThreadingFreeImplementation(o->threading);
  dCloseODE();
  set_handlers(false);
  the_ode = NULL;
}

// ---- the problem into the world -------------------------------------------------------------------

static void put_mass(gv_ode *o, int i, const gv_problem_body *b) {
  assert(i >= 0 && i < GV_BODIES && b->mass > 0.0);
  if (b->mass == o->mass[i] && memcmp(&b->inertia, &o->inertia[i], sizeof b->inertia) == 0)
    return;
  dMass m;
  dMassSetZero(&m);
  m.mass = b->mass;
  for (int r = 0; r < 3; r++)
    for (int c = 0; c < 3; c++)
      m.I[4 * r + c] = b->inertia.m[r][c];
  dBodySetMass(o->body[i], &m);
  o->mass[i] = b->mass;
  o->inertia[i] = b->inertia;
}

static void put_body(gv_ode *o, int i, const gv_problem_body *b) {
  static const dQuaternion unturned = {1, 0, 0, 0};
  put_mass(o, i, b);
  dBodySetPosition(o->body[i], b->p.x, b->p.y, b->p.z);
  dBodySetQuaternion(o->body[i], unturned);
  dBodySetLinearVel(o->body[i], b->v.x, b->v.y, b->v.z);
  dBodySetAngularVel(o->body[i], b->w.x, b->w.y, b->w.z);
  dBodyEnable(o->body[i]);
}

static void put_vector(dReal *out, gv_vec3 v) {
  out[0] = v.x;
  out[1] = v.y;
  out[2] = v.z;
}

static void put_contact(gv_ode *o, const gv_problem *problem, const gv_ode_method *method, int i) {
  assert(i >= 0 && i < problem->contact_count);
  const gv_problem_contact *c = &problem->contact[i];
  const double h = problem->step_s;
  dContact k;
  memset(&k, 0, sizeof k);
  k.surface.mode = dContactMotionN | dContactSoftCFM | dContactFDir1 | dContactSlip1 | dContactSlip2;
  k.surface.motionN = c->target_velocity;
  k.surface.soft_cfm = c->normal_compliance * h;
  k.surface.slip1 = k.surface.slip2 = c->tangent_compliance * h;
  if (method->limit && method->limit[i].along[0] >= 0.0) {
    k.surface.mode |= dContactMu2;
    k.surface.mu = method->limit[i].along[0] / h;
    k.surface.mu2 = method->limit[i].along[1] / h;
  } else if (c->friction == GV_FRICTION_FIXED_LIMIT) {
    k.surface.mu = c->friction_limit / h;
  } else {
    k.surface.mode |= dContactApprox1;
    k.surface.mu = c->mu;
  }
  if (c->patch > 0.0) {  // its bound follows the normal force, as dContactApprox1's
    if (!(k.surface.mode & dContactMu2))
      k.surface.mu2 = k.surface.mu;
    k.surface.mode |= dContactRolling | dContactAxisDep | dContactApprox1_N;
    k.surface.rhoN = gv_patch_arm(c);
  }
  put_vector(k.geom.pos, c->point);
  put_vector(k.geom.normal, c->frame[0]);
  put_vector(k.fdir1, c->frame[1]);
  dJointID joint = dJointCreateContact(o->world, o->contacts, &k);
  const bool b_moves = problem->body[c->body_b].mass > 0.0;
  dJointAttach(joint, o->body[c->body_a], b_moves ? o->body[c->body_b] : NULL);
  dJointSetFeedback(joint, &o->feedback[i]);
}

static void find_touched(const gv_problem *problem, bool out_touched[GV_BODIES]) {
  memset(out_touched, 0, GV_BODIES * sizeof *out_touched);
  for (int i = 0; i < problem->contact_count; i++) {
    const gv_problem_contact *c = &problem->contact[i];
    assert(problem->body[c->body_a].mass > 0.0);
    out_touched[c->body_a] = true;
    out_touched[c->body_b] = problem->body[c->body_b].mass > 0.0;
  }
  for (int i = 0; i < problem->joint_count; i++) {
    const gv_problem_joint *j = &problem->joint[i];
    if (j->row_count == 0)
      continue;
    out_touched[j->body_a] = true;
    if (j->body_b != GV_WORLD)
      out_touched[j->body_b] = problem->body[j->body_b].mass > 0.0;
  }
}

static void put_joints(gv_ode *o, const gv_problem *problem, const bool touched[GV_BODIES]) {
  for (int i = 0; i < problem->joint_count; i++) {
    const gv_problem_joint *j = &problem->joint[i];
    if (j->row_count == 0)
      continue;
    const bool b_moves = j->body_b != GV_WORLD && touched[j->body_b];
    dBodyID b = b_moves ? o->body[j->body_b] : NULL;
    gv_ode_put_joint(o->world, o->contacts, o->body[j->body_a], b, problem, j);
  }
}

static bool step_world(gv_ode *o, const gv_problem *problem, const gv_ode_method *method,
                       const bool touched[GV_BODIES]) {
  for (int i = 0; i < problem->body_count; i++)
    if (touched[i])
      put_body(o, i, &problem->body[i]);
  for (int i = 0; i < problem->contact_count; i++)
    put_contact(o, problem, method, i);
  put_joints(o, problem, touched);
  dRandSetSeed(1);  // QuickStep shuffles its rows: the same way in every call
  if (method->iterations == 0)
    return dWorldStep(o->world, problem->step_s);
  dWorldSetQuickStepNumIterations(o->world, method->iterations);
  return dWorldQuickStep(o->world, problem->step_s);
}

// False where ODE gave up. No variable of this function is changed after setjmp.
static bool try_step(gv_ode *o, const gv_problem *problem, const gv_ode_method *method,
                     const bool touched[GV_BODIES]) {
  o->stepping = true;
  const bool done = setjmp(o->way_out) == 0 && step_world(o, problem, method, touched);
  o->stepping = false;
  return done;
}

// ---- the world into the answer --------------------------------------------------------------------

static gv_vec3 from_ode(const dReal *v) { return gv_v3(v[0], v[1], v[2]); }

static void read_answer(gv_ode *o, const gv_problem *problem, const bool touched[GV_BODIES],
                        gv_velocity out_velocity[], gv_vec3 out_impulse[]) {
  for (int i = 0; i < problem->body_count; i++) {
    if (!touched[i])
      continue;
    out_velocity[i].v = from_ode(dBodyGetLinearVel(o->body[i]));
    out_velocity[i].w = from_ode(dBodyGetAngularVel(o->body[i]));
  }
  for (int i = 0; i < problem->contact_count; i++)
    out_impulse[i] = gv_scale(from_ode(o->feedback[i].f1), problem->step_s);
}

static void clear_world(gv_ode *o, const gv_problem *problem, const bool touched[GV_BODIES]) {
  dJointGroupEmpty(o->contacts);
  for (int i = 0; i < problem->body_count; i++)
    if (touched[i])
      dBodyDisable(o->body[i]);
}

bool gv_ode_solve(gv_ode *o, const gv_problem *problem, const gv_ode_method *method,
                  gv_velocity out_velocity[], gv_vec3 out_impulse[]) {
  assert(problem->body_count <= GV_BODIES && problem->contact_count <= GV_MAX_CONTACTS &&
         problem->step_s > 0.0);
  bool touched[GV_BODIES];
  const unsigned messages = o->messages;
  find_touched(problem, touched);
  memset(o->feedback, 0, sizeof *o->feedback * (size_t)problem->contact_count);
  const bool done = try_step(o, problem, method, touched);
  const bool right = done && o->messages == messages;
  if (right)
    read_answer(o, problem, touched, out_velocity, out_impulse);
  else
    o->failures++;
  if (done)
    clear_world(o, problem, touched);
  else
    restore_image(o);
  return right;
}

unsigned gv_ode_failures(const gv_ode *o) { return o->failures; }
