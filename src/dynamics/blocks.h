// SPDX-License-Identifier: BSD-3-Clause
// A matrix of 6 x 6 blocks, one row of blocks for each body, and its linear equations solved by
// elimination without exchange of rows. Bodies that do not touch have no block in common, and those
// with the fewest neighbours go first (Tinney and Walker 1967): a hand around an object costs one
// small elimination for each limb. Pure.
#ifndef BLOCKS_H
#define BLOCKS_H

#include <stdbool.h>
#include <stdint.h>

#include "gloved/limits.h"

enum { GV_NODES = GV_BODIES, GV_BLOCKS = 1024 };

typedef struct gv_block {
  double m[6][6];
} gv_block;
typedef struct gv_six {
  double m[6];
} gv_six;  // of one body: linear, then angular

typedef struct gv_blocks {
  int nodes, used;  // blocks that are taken
  int work;         // block operations of a solution where everything changes
  int work_done;    // of the last solution
  bool full;
  uint8_t order[GV_NODES];            // of elimination
  uint8_t place[GV_NODES];            // of a node in it
  uint8_t later[GV_NODES][GV_NODES];  // the neighbours that are eliminated after a node
  uint8_t later_count[GV_NODES];
  uint8_t degree[GV_NODES];
  bool changed[GV_NODES];           // since the last solution: its row of blocks is assembled and
                                    // eliminated anew
  gv_six forward[GV_NODES];         // right-hand side of a node after elimination, L^-1 of it
  uint16_t at[GV_NODES][GV_NODES];  // the block of two nodes, 1 + its number; 0: none
  gv_block block[GV_BLOCKS];        // of two nodes: rows belong to the one that goes first
  gv_block mirror[GV_BLOCKS];       // the same below the diagonal, transposed; where the matrix is
                                    // symmetric, not used
} gv_blocks;

// A matrix of `nodes` diagonal blocks. Then gv_blocks_link each pair that has a block of its own, then
// gv_blocks_order once: false where the elimination would need more than GV_BLOCKS blocks.
void gv_blocks_begin(gv_blocks *b, int nodes);
void gv_blocks_link(gv_blocks *b, int i, int k);
bool gv_blocks_order(gv_blocks *b);

// A node whose diagonal, right-hand side, or block with a node that goes later will be another one in the
// next solution. After gv_blocks_order all are.
static inline void gv_blocks_change(gv_blocks *b, int node) { b->changed[node] = true; }
// Marks what follows from nodes that change, those that are eliminated after them and have a block in common,
// and makes the blocks of all these nodes with themselves and later ones zero: add to them, and to no others.
void gv_blocks_clear(gv_blocks *b, bool symmetric);
// The block of two linked nodes, or of one with itself, and its mirror image. Rows belong to
// whichever of the two goes first.
static inline gv_block *gv_blocks_at(gv_blocks *b, int i, int k) { return &b->block[b->at[i][k] - 1]; }
static inline gv_block *gv_blocks_mirror(gv_blocks *b, int i, int k) { return &b->mirror[b->at[i][k] - 1]; }
static inline int gv_blocks_first(const gv_blocks *b, int i, int k) {
  return b->place[i] <= b->place[k] ? i : k;
}

// row -= sum of f[step k] other[k] over k < n. Written out, since compilers then keep the row in registers
// and make two of these operations one instruction, with the same bits.
static inline void gv_six_subtract(double *row, const double *f, int step, double (*other)[6], int n) {
  double a = row[0];
  double b = row[1];
  double c = row[2];
  double d = row[3];
  double e = row[4];
  double g = row[5];
  for (int k = 0; k < n; k++) {
    const double by = f[step * k];
    const double *o = other[k];
    a -= by * o[0];
    b -= by * o[1];
    c -= by * o[2];
    d -= by * o[3];
    e -= by * o[4];
    g -= by * o[5];
  }
  row[0] = a;
  row[1] = b;
  row[2] = c;
  row[3] = d;
  row[4] = e;
  row[5] = g;
}

// One block by itself. L U = H in place of H, the diagonal of L ones, that of U
// inverted; false where a pivot is zero.
bool gv_block_factor(gv_block *H);
// p = L^-1 p; p = U^-T p; p = U^-T p where H is symmetric and L^-1 p is known.
void gv_block_divide_by_lower(const gv_block *LU, gv_block *p);
void gv_block_divide_by_upper(const gv_block *LU, gv_block *p);
void gv_block_scale_by_pivots(const gv_block *LU, const gv_block *by_lower, gv_block *out);
// out -= p^T q.
void gv_block_subtract_product(gv_block *out, const gv_block *p, gv_block *q);
// x = L^-1 x; x = U^-1 x.
void gv_block_forward(const gv_block *LU, gv_six *x);
void gv_block_back(const gv_block *LU, gv_six *x);

// Solves for x in place of the right-hand side, of which those of nodes that did not change
// are not read: their elimination is kept from the solution before. False where a pivot is
// zero; then all nodes have to change.
bool gv_blocks_solve(gv_blocks *b, bool symmetric, gv_six io_x[]);

#endif
