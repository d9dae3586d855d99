// SPDX-License-Identifier: BSD-3-Clause
// In which order the pairs of a step are asked, and when to stop: a step has a budget of counted operations.
// Where what the pairs cost in their last step fits, they are asked in the order of the list. Else those of
// the hand come first, then the deepest; what is left over becomes more urgent with every step. Memory of the
// caller; real-time thread.
#ifndef GLOVED_COLLISION_QUEUE_H
#define GLOVED_COLLISION_QUEUE_H

#include "collision/broad.h"

typedef struct gv_queue {
  const gv_broad *broad;
  int budget, used;             // operations
  int count, next;              // pairs not asked yet; the next of the list
  bool crowded;                 // by urgency, from the heap
  uint16_t heap[GV_MAX_PAIRS];  // numbers of pairs, the most urgent first
} gv_queue;

// An operation is a vertex looked at or the like, about 10 instructions (narrow.h, gv_distance.operations).
void gv_queue_start(gv_queue *queue, const gv_broad *broad, int budget);
// The next pair to ask, or null: none is left, or the budget is spent.
const gv_candidate *gv_queue_next(gv_queue *queue);
// What it cost and how deep it was; for the next step's order, too.
void gv_queue_done(gv_queue *queue, const gv_candidate *pair, const gv_distance *found);
// Pairs that the budget did not reach; they are more urgent from now on. Returns how many.
int gv_queue_finish(gv_queue *queue);

#endif
