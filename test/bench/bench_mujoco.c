// SPDX-License-Identifier: BSD-3-Clause
// The same hand in MuJoCo, through its C library: sixteen free bodies of the engine's augmented mass, pulled
// by the engine's own spring forces, against the same objects. test/bench/bench.py writes the model and
// drives it as it drives bench_engine.
//
//   bench_mujoco MODEL.xml DRIVERS OBJECT    answers "FIRST COUNT" on standard input as bench_engine does
#include <mujoco/mujoco.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "bench/bench_drivers.h"

enum { MAX_STEPS = 60000 };
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

int main(int argc, char **argv) {
  char err[1000] = "";
  if (argc != 4)
    fail("usage: bench_mujoco MODEL.xml DRIVERS OBJECT");
  FILE *f = fopen(argv[2], "rb");
  if (!f || fread(&header, sizeof header, 1, f) != 1 || header.steps > MAX_STEPS ||
      fread(drivers, sizeof *drivers, (size_t)header.steps, f) != (size_t)header.steps)
    fail("cannot read the drivers");
  fclose(f);
  mjModel *m = mj_loadXML(argv[1], NULL, err, sizeof err);
  if (!m)
    fail(err);
  mjData *d = mj_makeData(m);
  gravity_z = m->opt.gravity[2];
  int object = mj_name2id(m, mjOBJ_BODY, argv[3]);
  if (object < 0)
    fail("no such object");
  int first, count;
  bool placed = false;
  static double out[MAX_STEPS][GV_BENCH_VALUES];
  while (scanf("%d %d", &first, &count) == 2) {
    if (first < 0 || count < 0 || first + count > header.steps)
      fail("asked for steps that are not there");
    if (first == 0) {
      mj_resetData(m, d);
      placed = false;
    }
    for (int i = 0; i < count; i++)
      run(m, d, object, first + i, &placed, out[i]);
    fwrite(out, sizeof out[0], (size_t)count, stdout);
    fflush(stdout);
  }
  mj_deleteData(d);
  mj_deleteModel(m);
  return 0;
}
