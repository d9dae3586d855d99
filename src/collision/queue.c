// SPDX-License-Identifier: BSD-3-Clause
// The pairs of a step by urgency, within a budget. A pair's urgency is its depth at its last answer. Each
// step in which it is left out it counts as twice as deep, and as deeper by how much its surfaces may have
// come nearer: none waits long behind deeper ones (a touch behind overlaps of 50 mm for eight steps). All of
// it is kept with the pair's warm start; no clock is asked, and the same scene gives the same order. Cost: 3
// instructions a pair; in a crowded step 60 a pair more. Real-time thread.
#include "collision/queue.h"

#include <assert.h>

enum { UNKNOWN_OPERATIONS = 200 };  // of a pair that has not been asked yet: two boxes, cold

_Static_assert(GV_MAX_PAIRS <= UINT16_MAX, "pairs are numbered in 16 bits");

static int expected_operations(const gv_candidate *pair) {
  int operations = pair->cache->operations;
  return operations > 0 ? operations : UNKNOWN_OPERATIONS;
}

static bool is_before(const gv_broad *broad, uint16_t i, uint16_t j) {
  const gv_candidate *p = &broad->pair[i];
  const gv_candidate *q = &broad->pair[j];
  bool hand_p = gv_broad_is_limb(broad, p->body_a);
  bool hand_q = gv_broad_is_limb(broad, q->body_a);
  if (hand_p != hand_q)
    return hand_p;
  if (p->cache->urgency_m != q->cache->urgency_m)
    return p->cache->urgency_m > q->cache->urgency_m;
  return i < j;
}

static void sift_down(gv_queue *queue, int at) {
  assert(at >= 0 && at < GV_MAX_PAIRS);
  uint16_t *heap = queue->heap;
  const uint16_t moved = heap[at];
  for (int child = 2 * at + 1; child < queue->count; child = 2 * at + 1) {
    if (child + 1 < queue->count && is_before(queue->broad, heap[child + 1], heap[child]))
      child++;
    if (is_before(queue->broad, moved, heap[child]))
      break;
    heap[at] = heap[child];
    at = child;
  }
  heap[at] = moved;
}

void gv_queue_start(gv_queue *queue, const gv_broad *broad, int budget) {
  assert(broad->pair_count >= 0 && broad->pair_count <= GV_MAX_PAIRS && budget > 0);
  int expected = 0;
  queue->broad = broad;
  queue->budget = budget;
  queue->used = 0;
  queue->next = 0;
  queue->count = broad->pair_count;
  for (int i = 0; i < queue->count; i++)
    expected += expected_operations(&broad->pair[i]);
  queue->crowded = expected > budget;
  if (!queue->crowded)
    return;
  for (int i = 0; i < queue->count; i++)
    queue->heap[i] = (uint16_t)i;
  for (int i = queue->count / 2 - 1; i >= 0; i--)
    sift_down(queue, i);
}

const gv_candidate *gv_queue_next(gv_queue *queue) {
  if (queue->count == 0 || queue->used >= queue->budget)
    return NULL;
  queue->count--;
  if (!queue->crowded)
    return &queue->broad->pair[queue->next++];
  const uint16_t first = queue->heap[0];
  queue->heap[0] = queue->heap[queue->count];
  sift_down(queue, 0);
  return &queue->broad->pair[first];
}

void gv_queue_done(gv_queue *queue, const gv_candidate *pair, const gv_distance *found) {
  assert(found->operations > 0);
  queue->used += found->operations;
  pair->cache->operations = (uint16_t)(found->operations < UINT16_MAX ? found->operations : UINT16_MAX);
  pair->cache->urgency_m = (float)-found->distance;
}

int gv_queue_finish(gv_queue *queue) {
  const gv_broad *broad = queue->broad;
  for (int i = 0; i < queue->count; i++) {
    const gv_candidate *left = &broad->pair[queue->crowded ? queue->heap[i] : queue->next + i];
    const float came_nearer = (float)(broad->margin[left->body_a] + broad->margin[left->body_b]);
    const float urgency = left->cache->urgency_m;
    left->cache->urgency_m = urgency > 0.0f ? 2.0f * urgency + came_nearer : came_nearer;
  }
  return queue->count;
}
