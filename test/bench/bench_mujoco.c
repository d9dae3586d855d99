// SPDX-License-Identifier: BSD-3-Clause
// The same hand in MuJoCo, through its C library: sixteen free bodies of the engine's augmented mass, pulled
// by the engine's own spring forces, against the same objects. test/bench/bench.py writes the model and
// drives it as it drives bench_engine.
//
//   bench_mujoco MODEL.xml DRIVERS OBJECT [laws]    answers "FIRST COUNT" on standard input as bench_engine
//                                                   does; laws: each record goes on with GV_BENCH_LAWS
//                                                   residuals
//   bench_mujoco MODEL.xml DRIVERS OBJECT count FIRST COUNT     counts instructions as bench_engine does,
//                                                               under callgrind
#include <math.h>
#include <mujoco/mujoco.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <valgrind/callgrind.h>

#include "bench/bench_drivers.h"

enum { MAX_STEPS = 60000, MAX_ROWS = 4096 };
static gv_bench_header header;
static gv_bench_drivers drivers[MAX_STEPS];
static double gravity_z;

static int64_t now_ns(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

static void fail(const char *why) {
  fprintf(stderr, "bench_mujoco: %s\n", why);
  exit(2);
}

static gv_vec3 vector(const mjtNum *v) { return gv_v3(v[0], v[1], v[2]); }
static void store(mjtNum *to, gv_vec3 v) { to[0] = v.x, to[1] = v.y, to[2] = v.z; }

// A free joint: position, quaternion; linear velocity in the world, angular in the
// body. Limb i is body i + 1.
static gv_body_state limb_state(const mjData *d, int i) {
  const mjtNum *q = &d->qpos[7 * i];
  const mjtNum *v = &d->qvel[6 * i];
  gv_body_state s = {{{q[3], q[4], q[5], q[6]}, vector(q)}, vector(v), {0, 0, 0}};
  s.w = gv_rotate(s.T.q, vector(v + 3));
  return s;
}

static void place_hand(mjData *d, const gv_bench_drivers *now) {
  for (int i = 0; i < GV_LIMBS; i++) {
    const gv_pose *T = &now->limb[i].T;
    const mjtNum q[7] = {T->p.x, T->p.y, T->p.z, T->q.w, T->q.x, T->q.y, T->q.z};
    memcpy(&d->qpos[7 * i], q, sizeof q);
    memset(&d->qvel[6 * i], 0, 6 * sizeof(mjtNum));
  }
}

// Springs as in the engine's step; gravity does not act on limbs.
static void pull_limbs(mjData *d, const gv_bench_drivers *now) {
  gv_body_state sim[GV_LIMBS];
  gv_vec3 f[GV_LIMBS], t[GV_LIMBS];
  for (int i = 0; i < GV_LIMBS; i++)
    sim[i] = limb_state(d, i);
  gv_springs_apply(header.spring, sim, now->limb, f, t);
  for (int i = 0; i < GV_LIMBS; i++) {
    const gv_spring *s = &header.spring[i];
    f[i].z -= (s->mass_kg + s->added_mass_kg) * gravity_z;
    store(&d->xfrc_applied[6 * (i + 1)], f[i]);
    store(&d->xfrc_applied[6 * (i + 1) + 3], t[i]);
  }
}

// ---- residuals of the step that was done ------------------------------------------------------------
// Rows of a contact, in its frame: normal, two tangents. J v of the velocities after the step is the slip;
// MuJoCo's own law of a row is 0 <= f | J a + R f - aref >= 0 (a: accelerations), which times h is the
// velocity by which a contact separates beyond what its softness lets it.
static double larger(double a, double b) { return b <= a ? a : b; }

static void judge_contact(const mjModel *m, const mjData *d, int i, double laws[GV_BENCH_LAWS]) {
  static mjtNum acceleration[MAX_ROWS], velocity[MAX_ROWS];
  const mjContact *c = &d->contact[i];
  if (c->efc_address < 0 || d->nefc > MAX_ROWS)
    return;
  if (i == 0) {
    mj_mulJacVec(m, d, acceleration, d->qacc);
    mj_mulJacVec(m, d, velocity, d->qvel);
  }
  const int row = c->efc_address;
  mjtNum f[6];
  mj_contactForce(m, d, i, f);
  const double too_fast = acceleration[row] + d->efc_R[row] * f[0] - d->efc_aref[row];
  const double w_n = m->opt.timestep * too_fast;
  const double slip = hypot(velocity[row + 1], velocity[row + 2]);
  const double bound = c->friction[0] * fmax(0.0, f[0]);
  const double power = f[1] * velocity[row + 1] + f[2] * velocity[row + 2];
  laws[0] = larger(laws[0], fabs(fmin(w_n, f[0])));
  laws[1] = larger(laws[1], hypot(f[1], f[2]) - bound);
  laws[2] = larger(laws[2], fabs(bound * slip + power));
}

// M a - what acts without contacts - J^T f, of each body that moves, times h; a turn counts at 0.1 m.
static void judge_momentum(const mjModel *m, const mjData *d, double laws[GV_BENCH_LAWS]) {
  static mjtNum rest[MAX_ROWS];
  if (m->nv > MAX_ROWS)
    return;
  mj_mulM(m, d, rest, d->qacc);
  mju_subFrom(rest, d->qfrc_smooth, m->nv);
  mju_subFrom(rest, d->qfrc_constraint, m->nv);
  for (int i = 0; i + 6 <= m->nv; i += 6) {
    const double apart = mju_norm3(&rest[i]) + 10.0 * mju_norm3(&rest[i + 3]);
    laws[3] = larger(laws[3], m->opt.timestep * apart);
  }
}

static void judge(const mjModel *m, const mjData *d, double laws[GV_BENCH_LAWS]) {
  for (int i = 0; i < d->ncon; i++)
    judge_contact(m, d, i, laws);
  judge_momentum(m, d, laws);
}

static void run(const mjModel *m, mjData *d, int object, int step, bool *placed,
                double out[GV_BENCH_VALUES]) {
  const gv_bench_drivers *now = &drivers[step];
  memset(out, 0, GV_BENCH_VALUES * sizeof *out);
  if (!now->placed)
    return;
  if (!*placed)
    place_hand(d, now);
  *placed = true;
  int64_t start = now_ns();
  pull_limbs(d, now);
  mj_step(m, d);
  int64_t whole_ns = now_ns() - start;
  gv_pose palm = limb_state(d, GV_LIMB_PALM).T;
  int at = m->jnt_qposadr[m->body_jntadr[object]];
  gv_vec3 p = vector(&d->qpos[at]);
  gv_vec3 in_palm = gv_transform_inv(palm, p);
  const double values[GV_BENCH_VALUES] = {
    (double)whole_ns * 1e-3, 0, 0, d->ncon, in_palm.x, in_palm.y, in_palm.z, p.z};
  memcpy(out, values, sizeof values);
}

// What callgrind counts: test/support/callgrind.py names this function.
__attribute__((noinline)) void gv_bench_counted_step(const mjModel *m, mjData *d, int object, int step,
                                                     bool *placed);
void gv_bench_counted_step(const mjModel *m, mjData *d, int object, int step, bool *placed) {
  double out[GV_BENCH_VALUES];
  run(m, d, object, step, placed, out);
}

static void count_steps(const mjModel *m, mjData *d, int object, int first, int count) {
  bool placed = false;
  for (int i = 0; i < first + count && i < header.steps; i++) {
    if (i == first)
      CALLGRIND_START_INSTRUMENTATION;
    gv_bench_counted_step(m, d, object, i, &placed);
    if (i >= first)
      (void)VALGRIND_MONITOR_COMMAND("status internal");
  }
}

static void serve(const mjModel *m, mjData *d, int object, bool laws) {
  int first, count;
  bool placed = false;
  static double out[MAX_STEPS * (GV_BENCH_VALUES + GV_BENCH_LAWS)];
  const int width = GV_BENCH_VALUES + (laws ? GV_BENCH_LAWS : 0);
  while (scanf("%d %d", &first, &count) == 2) {
    if (first < 0 || count < 0 || first + count > header.steps)
      fail("asked for steps that are not there");
    if (first == 0) {
      mj_resetData(m, d);
      placed = false;
    }
    memset(out, 0, sizeof *out * (size_t)(width * count));
    for (int i = 0; i < count; i++) {
      run(m, d, object, first + i, &placed, &out[width * i]);
      if (laws && placed)
        judge(m, d, &out[width * i + GV_BENCH_VALUES]);
    }
    fwrite(out, sizeof *out * (size_t)width, (size_t)count, stdout);
    fflush(stdout);
  }
}

static void read_drivers(const char *path) {
  FILE *f = fopen(path, "rb");
  if (!f || fread(&header, sizeof header, 1, f) != 1 || header.steps > MAX_STEPS ||
      fread(drivers, sizeof *drivers, (size_t)header.steps, f) != (size_t)header.steps)
    fail("cannot read the drivers");
  fclose(f);
}

int main(int argc, char **argv) {
  char err[1000] = "";
  const bool laws = argc == 5 && strcmp(argv[4], "laws") == 0;
  const bool counts = argc == 7 && strcmp(argv[4], "count") == 0;
  if (argc != 4 && !laws && !counts)
    fail("usage: bench_mujoco MODEL.xml DRIVERS OBJECT [laws | count FIRST COUNT]");
  read_drivers(argv[2]);
  mjModel *m = mj_loadXML(argv[1], NULL, err, sizeof err);
  if (!m)
    fail(err);
  mjData *d = mj_makeData(m);
  gravity_z = m->opt.gravity[2];
  const int object = mj_name2id(m, mjOBJ_BODY, argv[3]);
  if (object < 0)
    fail("no such object");
  if (counts)
    count_steps(m, d, object, atoi(argv[5]), atoi(argv[6]));
  else
    serve(m, d, object, laws);
  mj_deleteData(d);
  mj_deleteModel(m);
  return 0;
}
