// SPDX-License-Identifier: BSD-3-Clause
// H = L U by blocks, in the order of elimination: U on and above the diagonal, L (transposed) in the mirror
// images, where a symmetric matrix has nothing new, since then L = U^T D^-1.
#include "dynamics/blocks.h"

#include <assert.h>
#include <math.h>
#include <string.h>

_Static_assert(GV_NODES <= UINT8_MAX, "nodes are numbered in 8 bits");
_Static_assert(GV_BLOCKS < UINT16_MAX, "blocks in 16, 0 being none");

static bool take_block(gv_blocks *b, int i, int k) {
  assert(i >= 0 && i < b->nodes && k >= 0 && k < b->nodes);
  if (b->at[i][k])
    return true;
  if (b->used == GV_BLOCKS)
    b->full = true;
  if (b->full)
    return false;
  b->at[i][k] = b->at[k][i] = (uint16_t)++b->used;
  if (i == k)
    return true;
  b->degree[i]++;
  b->degree[k]++;
  return true;
}

void gv_blocks_begin(gv_blocks *b, int nodes) {
  assert(nodes >= 0 && nodes <= GV_NODES);
  b->nodes = nodes;
  b->used = b->work = 0;
  b->full = false;
  memset(b->degree, 0, sizeof b->degree);
  for (int i = 0; i < nodes; i++)
    memset(b->at[i], 0, sizeof b->at[i][0] * (size_t)nodes);
  for (int i = 0; i < nodes; i++)
    take_block(b, i, i);
}

void gv_blocks_link(gv_blocks *b, int i, int k) { take_block(b, i, k); }

static int least_degree(const gv_blocks *b, const bool *gone) {
  int least = 0;
  for (int i = 1; i < b->nodes; i++)
    if (!gone[i] && (gone[least] || b->degree[i] < b->degree[least]))
      least = i;
  return least;
}

// What is left after node i has gone: its neighbours are all linked with each other.
static bool eliminate_node(gv_blocks *b, int i, bool *gone) {
  uint8_t *later = b->later[i];
  uint8_t count = 0;
  for (int k = 0; k < b->nodes; k++)
    if (!gone[k] && k != i && b->at[i][k])
      later[count++] = (uint8_t)k;
  b->later_count[i] = count;
  b->work += (count + 1) * (count + 2) / 2;
  gone[i] = true;
  for (int r = 0; r < count; r++) {
    b->degree[later[r]]--;
    for (int c = r + 1; c < count; c++)
      if (!take_block(b, later[r], later[c]))
        return false;
  }
  return true;
}

bool gv_blocks_order(gv_blocks *b) {
  if (b->full)
    return false;
  bool gone[GV_NODES] = {false};
  for (int k = 0; k < b->nodes; k++) {
    int i = least_degree(b, gone);
    b->order[k] = (uint8_t)i;
    b->place[i] = (uint8_t)k;
    b->changed[i] = true;
    if (!eliminate_node(b, i, gone))
      return false;
  }
  return true;
}

static void clear_block(gv_blocks *b, int i, int k, bool symmetric) {
  static const gv_block zero;
  *gv_blocks_at(b, i, k) = zero;
  if (!symmetric)
    *gv_blocks_mirror(b, i, k) = zero;
}

void gv_blocks_clear(gv_blocks *b, bool symmetric) {
  for (int n = 0; n < b->nodes; n++) {
    const int i = b->order[n];
    if (!b->changed[i])
      continue;
    clear_block(b, i, i, symmetric);
    for (int k = 0; k < b->later_count[i]; k++) {
      b->changed[b->later[i][k]] = true;
      clear_block(b, i, b->later[i][k], symmetric);
    }
  }
}

// ---- one block ------------------------------------------------------------------------------------

bool gv_block_factor(gv_block *H) {
  for (int r = 0; r < 6; r++) {
    double *row = H->m[r];
    for (int k = 0; k < r; k++) {
      row[k] *= H->m[k][k];
      for (int c = k + 1; c < 6; c++)
        row[c] -= row[k] * H->m[k][c];
    }
    if (!(fabs(row[r]) > 1e-9))
      return false;
    row[r] = 1.0 / row[r];
  }
  return true;
}

void gv_block_divide_by_lower(const gv_block *LU, gv_block *p) {
  for (int r = 1; r < 6; r++)
    gv_six_subtract(p->m[r], LU->m[r], 1, p->m, r);
}

void gv_block_divide_by_upper(const gv_block *LU, gv_block *p) {
  for (int r = 0; r < 6; r++) {
    gv_six_subtract(p->m[r], &LU->m[0][r], 6, p->m, r);
    for (int c = 0; c < 6; c++)
      p->m[r][c] *= LU->m[r][r];
  }
}

void gv_block_scale_by_pivots(const gv_block *LU, const gv_block *by_lower, gv_block *out) {
  for (int r = 0; r < 6; r++)
    for (int c = 0; c < 6; c++)
      out->m[r][c] = LU->m[r][r] * by_lower->m[r][c];
}

void gv_block_subtract_product(gv_block *out, const gv_block *p, gv_block *q) {
  for (int r = 0; r < 6; r++)
    gv_six_subtract(out->m[r], &p->m[0][r], 6, q->m, 6);
}

void gv_block_forward(const gv_block *LU, gv_six *x) {
  for (int r = 1; r < 6; r++)
    for (int k = 0; k < r; k++)
      x->m[r] -= LU->m[r][k] * x->m[k];
}

void gv_block_back(const gv_block *LU, gv_six *x) {
  for (int k = 5; k >= 0; k--) {
    for (int c = k + 1; c < 6; c++)
      x->m[k] -= LU->m[k][c] * x->m[c];
    x->m[k] *= LU->m[k][k];
  }
}

// ---- the matrix -----------------------------------------------------------------------------------

// L^-1 H_ik for each later neighbour k, and U^-T H_ki^T in the mirror image.
static void divide(gv_blocks *b, int i, bool symmetric) {
  const gv_block *LU = gv_blocks_at(b, i, i);
  for (int n = 0; n < b->later_count[i]; n++) {
    gv_block *P = gv_blocks_at(b, i, b->later[i][n]);
    gv_block *Q = gv_blocks_mirror(b, i, b->later[i][n]);
    gv_block_divide_by_lower(LU, P);
    if (symmetric)
      gv_block_scale_by_pivots(LU, P, Q);
    else
      gv_block_divide_by_upper(LU, Q);
  }
}

// What node i leaves behind between two of its later neighbours.
static void update(gv_blocks *b, int i, int j, int k, bool symmetric) {
  const int first = gv_blocks_first(b, j, k);
  const int second = j + k - first;
  gv_block_subtract_product(gv_blocks_at(b, j, k), gv_blocks_mirror(b, i, first), gv_blocks_at(b, i, second));
  if (symmetric || j == k)
    return;
  gv_block_subtract_product(gv_blocks_mirror(b, j, k), gv_blocks_at(b, i, first),
                            gv_blocks_mirror(b, i, second));
}

// What node i leaves on those of its later neighbours that change; all of them where it changed itself.
static void update_later(gv_blocks *b, int i, bool symmetric, gv_six x[]) {
  const uint8_t *later = b->later[i];
  const int count = b->later_count[i];
  for (int n = 0; n < count; n++)
    if (b->changed[later[n]])
      gv_six_subtract(x[later[n]].m, b->forward[i].m, 1, gv_blocks_mirror(b, i, later[n])->m, 6);
  for (int n = 0; n < count; n++)
    for (int m = n; m < count; m++)
      if (b->changed[gv_blocks_first(b, later[n], later[m])]) {
        update(b, i, later[n], later[m], symmetric);
        b->work_done++;
      }
}

static bool eliminate(gv_blocks *b, int i, bool symmetric, gv_six x[]) {
  gv_block *LU = gv_blocks_at(b, i, i);
  if (!gv_block_factor(LU))
    return false;
  divide(b, i, symmetric);
  b->work_done += 1 + b->later_count[i];
  b->forward[i] = x[i];
  gv_block_forward(LU, &b->forward[i]);
  return true;
}

static void substitute(gv_blocks *b, int i, gv_six x[]) {
  x[i] = b->forward[i];
  for (int n = 0; n < b->later_count[i]; n++) {
    const int j = b->later[i][n];
    const gv_block *P = gv_blocks_at(b, i, j);
    for (int k = 0; k < 6; k++)
      for (int c = 0; c < 6; c++)
        x[i].m[k] -= P->m[k][c] * x[j].m[c];
  }
  gv_block_back(gv_blocks_at(b, i, i), &x[i]);
}

bool gv_blocks_solve(gv_blocks *b, bool symmetric, gv_six io_x[]) {
  b->work_done = 0;
  for (int k = 0; k < b->nodes; k++) {
    const int i = b->order[k];
    if (b->changed[i] && !eliminate(b, i, symmetric, io_x))
      return false;
    update_later(b, i, symmetric, io_x);
  }
  for (int k = b->nodes - 1; k >= 0; k--)
    substitute(b, b->order[k], io_x);
  memset(b->changed, 0, sizeof b->changed);
  return true;
}
