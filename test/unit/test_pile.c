// SPDX-License-Identifier: BSD-3-Clause
// Sixty boxes at once: the default solver does every step of twenty stacks within its share of a
// 1 kHz period, and they come to rest to the last bits; of a heap of thrown ones it does all once the
// heap has settled; what is eliminated again between two solves of a step is what has changed.
#include "dynamics/blocks.h"
#include "support/check.h"
#include "support/lab.h"

enum { BOXES = 60 };

static void stack_boxes(lab *l) {
  const double size = 0.05;
  lab_box(l, gv_v3(4, 4, 0.4), gv_v3(0, 0, -0.2), 0, 0.8);
  for (int i = 0; i < BOXES; i++) {
    const gv_vec3 at = gv_v3(0.06 * (i % 5), 0.06 * (i / 5 % 4), 0.03 + 0.06 * (i / 20));
    lab_box(l, gv_v3(size, size, size), at, 0.2, 0.6);
  }
}

static double fastest(const lab *l) {
  double most = 0;
  for (int i = 1; i <= BOXES; i++) {
    gv_vec3 v, w;
    gv_engine_object_velocity(l->engine, i, &v, &w);
    most = fmax(most, gv_norm(v) + 0.05 * gv_norm(w));
  }
  return most;
}

static void test_sixty_boxes_come_to_rest(void) {
  enum { STEPS = 1000 };
  lab l;
  lab_start(&l);
  l.cfg.rest_s = 0;  // none is taken out
  stack_boxes(&l);
  lab_run(&l);
  lab_steps(&l, STEPS, NULL);
  const gv_counters *c = gv_engine_counters(l.engine);
  printf("# %llu steps by newton, %llu by others, %u contacts at most, fastest box %.1e m/s\n",
         (unsigned long long)c->newton_steps, (unsigned long long)(c->dantzig_steps + c->quickstep_steps),
         c->contacts_max, fastest(&l));
  CHECK(c->contacts_max >= 4 * BOXES && c->contacts_dropped == 0, "%u contacts", c->contacts_max);
  CHECK(c->newton_steps > STEPS - 50 && c->newton_softened == 0, "newton did %llu steps",
        (unsigned long long)c->newton_steps);
  CHECK(c->dantzig_steps + c->quickstep_steps + c->unsolved_steps == 0, "others did some");
  CHECK(fastest(&l) < 1e-9, "a box moves at %g m/s", fastest(&l));
  gv_engine_close(l.engine);
}

// ---- a heap ---------------------------------------------------------------------------------------

static void throw_boxes(lab *l, unsigned long long *draws) {
  lab_box(l, gv_v3(4, 4, 0.4), gv_v3(0, 0, -0.2), 0, 0.8);
  for (int i = 1; i <= BOXES; i++) {
    gv_vec3 d[3];
    for (int k = 0; k < 3; k++)
      d[k] = gv_v3(check_uniform(draws, -1, 1), check_uniform(draws, -1, 1), check_uniform(draws, -1, 1));
    const gv_vec3 size = gv_mad(gv_v3(0.0375, 0.0375, 0.0375), 0.0125, d[0]);
    lab_box(l, size, gv_v3(0.08 * d[1].x, 0.08 * d[1].y, 0.04 + 0.012 * i), 0.2, 0.6);
    l->object[i].T_world_body.q = gv_quat_exp(gv_scale(d[2], 2));
  }
}

static uint64_t steps_by_others(const lab *l) {
  const gv_counters *c = gv_engine_counters(l->engine);
  return c->dantzig_steps + c->quickstep_steps + c->unsolved_steps;
}

// While it tumbles a heap costs more than newton's share, and ODE does most of its steps, with its noise.
// Once it has settled, newton does all of them, and it lies still.
static void test_a_heap_comes_back_to_newton(void) {
  enum { HEAPS = 6, SETTLING = 2500, STEPS = 3000 };
  unsigned long long draws = 1;
  int at_rest = 0;
  for (int heap = 0; heap < HEAPS; heap++) {
    lab l;
    lab_start(&l);
    l.cfg.rest_s = 0;
    throw_boxes(&l, &draws);
    lab_run(&l);
    lab_steps(&l, SETTLING, NULL);
    const uint64_t settling = steps_by_others(&l);
    lab_steps(&l, STEPS - SETTLING, NULL);
    const uint64_t later = steps_by_others(&l) - settling;
    printf("# heap %d: others did %llu of %d steps, %llu of the next %d; fastest box %.1e m/s\n", heap,
           (unsigned long long)settling, SETTLING, (unsigned long long)later, STEPS - SETTLING, fastest(&l));
    at_rest += later == 0 && fastest(&l) < 1e-4;
    gv_engine_close(l.engine);
  }
  CHECK(at_rest >= HEAPS - 2, "%d of %d heaps came to rest", at_rest, HEAPS);
}

// ---- what is kept between two solutions ------------------------------------------------------------

enum { NODES = 20 };
static unsigned long long seed = 9;
static double draw(double lo, double hi) { return check_uniform(&seed, lo, hi); }
static double whole[NODES][NODES][6][6];
static bool linked[NODES][NODES];

// Row of node i, with itself and those it is linked with.
static void draw_row(int i) {
  for (int k = 0; k < NODES; k++)
    for (int e = 0; e < 36 && (linked[i][k] || i == k); e++)
      whole[i][k][e / 6][e % 6] = i == k && e % 7 == 0 ? draw(40, 80) : draw(-1, 1);
}

static void assemble(gv_blocks *b) {
  for (int i = 0; i < NODES; i++)
    for (int k = 0; k < NODES; k++) {
      if ((i != k && !linked[i][k]) || !b->changed[gv_blocks_first(b, i, k)])
        continue;
      const bool upper = gv_blocks_first(b, i, k) == i;
      gv_block *to = upper ? gv_blocks_at(b, i, k) : gv_blocks_mirror(b, i, k);
      for (int e = 0; e < 36; e++)
        to->m[upper ? e / 6 : e % 6][upper ? e % 6 : e / 6] = whole[i][k][e / 6][e % 6];
    }
}

static void check_rows(const gv_six x[], const gv_six y[], int trial) {
  for (int r = 0; r < 6 * NODES; r++) {
    double sum = -y[r / 6].m[r % 6];
    for (int c = 0; c < 6 * NODES; c++)
      sum += whole[r / 6][c / 6][r % 6][c % 6] * x[c / 6].m[c % 6];
    CHECK(fabs(sum) < 1e-11, "trial %d: row %d is off by %g", trial, r, sum);
  }
}

// Only blocks of the node that changes, its column included, and its right-hand side are given anew.
static void test_a_solution_anew_costs_what_has_changed(void) {
  static gv_blocks b;
  gv_six x[NODES], y[NODES];
  gv_blocks_begin(&b, NODES);
  for (int i = 1; i < NODES; i++) {  // two trees that do not touch
    const int k = i < NODES / 2 ? (i - 1) / 2 : i == NODES / 2 ? -1 : NODES / 2 + (i - NODES / 2 - 1) / 2;
    if (k < 0)
      continue;
    gv_blocks_link(&b, i, k);
    linked[i][k] = linked[k][i] = true;
  }
  CHECK(gv_blocks_order(&b), "no room");
  for (int i = 0; i < NODES; i++)
    draw_row(i);
  int done = 0;
  enum { TRIALS = 100 };
  for (int trial = 0; trial < TRIALS; trial++) {
    const int node = (int)draw(0, NODES);
    if (trial > 0)
      draw_row(node);
    for (int k = 0; k < NODES && trial > 0; k++)
      if (linked[node][k] || k == node)
        gv_blocks_change(&b, k);
    gv_blocks_clear(&b, false);
    assemble(&b);
    for (int r = 0; r < 6 * NODES; r++)
      if (b.changed[r / 6])
        x[r / 6].m[r % 6] = y[r / 6].m[r % 6] = draw(-1, 1);
    CHECK(gv_blocks_solve(&b, false, x), "trial %d", trial);
    check_rows(x, y, trial);
    if (trial > 0)
      done += b.work_done;
  }
  CHECK(done < (TRIALS - 1) * b.work * 2 / 3, "%d block operations of %d", done, (TRIALS - 1) * b.work);
}

int main(void) {
  RUN(test_sixty_boxes_come_to_rest);
  RUN(test_a_heap_comes_back_to_newton);
  RUN(test_a_solution_anew_costs_what_has_changed);
  return check_done();
}
