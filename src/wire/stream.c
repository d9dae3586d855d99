// SPDX-License-Identifier: BSD-3-Clause
// Counters modulo 256 (stream.h). Pure; real-time thread.
#include "wire/stream.h"

#include <assert.h>
#include <string.h>

#include "gloved/fcu.h"

enum { HALF = GV_STREAM_COUNTERS / 2 };

// ---- gaps -----------------------------------------------------------------------------------------

static void remove_gap(gv_stream *stream, int number) {
  assert(number >= 0 && number < stream->gaps);
  stream->gaps--;
  const size_t behind = (size_t)(stream->gaps - number);
  memmove(&stream->gap[number], &stream->gap[number + 1], behind * sizeof stream->gap[0]);
}

// Counters from `first` on never came so far. Returns the gaps that had to be given up for this one.
static unsigned open_gap(gv_stream *stream, uint8_t first, uint8_t count, int64_t now_ns) {
  assert(count > 0 && count < HALF);
  const bool full = stream->gaps == GV_STREAM_GAPS;
  for (int i = 0; i < count; i++)
    stream->missing[(uint8_t)(first + i)] = true;
  if (full)
    remove_gap(stream, 0);
  stream->gap[stream->gaps++] = (gv_stream_gap){
    .first = first, .count = count, .left = count, .opened_ns = now_ns};
  return full ? 1 : 0;
}

static void fill_gap(gv_stream *stream, uint8_t counter) {
  assert(stream->gaps >= 0 && stream->gaps <= GV_STREAM_GAPS);
  stream->missing[counter] = false;
  for (int i = 0; i < stream->gaps; i++) {
    gv_stream_gap *gap = &stream->gap[i];
    if ((uint8_t)(counter - gap->first) >= gap->count)
      continue;
    if (--gap->left == 0)
      remove_gap(stream, i);
    return;
  }
}

unsigned gv_stream_give_up(gv_stream *stream, int64_t now_ns) {
  unsigned given_up = 0;
  while (stream->gaps > 0 && now_ns - stream->gap[0].opened_ns > GV_STREAM_GRACE_NS) {
    remove_gap(stream, 0);
    given_up++;
  }
  return given_up;
}

// ---- frames ---------------------------------------------------------------------------------------

// What is as far behind as ahead belongs to the next round of the counter.
static void go_on_to(gv_stream *stream, uint8_t counter) {
  while (stream->counter != counter) {
    stream->missing[(uint8_t)(stream->counter + HALF)] = false;
    stream->counter++;
  }
  stream->refused_in_row = 0;
}

static void start_at(gv_stream *stream, uint8_t counter) {
  *stream = (gv_stream){.seen = true, .counter = counter};
}

static gv_stream_verdict take_old(gv_stream *stream, uint8_t counter) {
  if (stream->missing[counter]) {
    fill_gap(stream, counter);
    return (gv_stream_verdict){.lost = -1};
  }
  stream->refused_in_row++;
  if (stream->refused_in_row < GV_STREAM_RESYNC)
    return (gv_stream_verdict){.errors = stream->refused_in_row > 1};
  start_at(stream, counter);
  return (gv_stream_verdict){.is_new = true};
}

gv_stream_verdict gv_stream_take(gv_stream *stream, uint8_t counter, int64_t now_ns) {
  const uint8_t ahead = (uint8_t)(counter - stream->counter);
  gv_stream_verdict verdict = {.is_new = true};
  if (!stream->seen) {
    start_at(stream, counter);
    return verdict;
  }
  if (ahead == 0 || ahead >= HALF)
    return take_old(stream, counter);
  const uint8_t first = (uint8_t)(stream->counter + 1);
  go_on_to(stream, counter);
  verdict.lost = ahead - 1;
  if (verdict.lost > 0)
    verdict.errors = open_gap(stream, first, (uint8_t)verdict.lost, now_ns);
  return verdict;
}

// ---- order ----------------------------------------------------------------------------------------

static bool has_counter(const gv_frame *frame) {
  return (frame->id == GV_ID_GLOVE || frame->id == GV_ID_POSE || frame->id == GV_ID_STATUS) && frame->len > 0;
}

static bool is_before(const gv_frame *a, const gv_frame *b) { return (int8_t)(a->data[0] - b->data[0]) < 0; }

// Insertion among the places of the same identifier: frames that are in order cost one comparison.
static void insert(const gv_frame *frame, uint16_t *order, int at) {
  const gv_frame *one = &frame[order[at]];
  int place = at;
  for (int i = at - 1; i >= 0; i--) {
    const gv_frame *other = &frame[order[i]];
    if (other->id != one->id)
      continue;
    if (!is_before(one, other))
      break;
    const uint16_t moved = order[i];
    order[i] = order[place];
    order[place] = moved;
    place = i;
  }
}

void gv_stream_order(const gv_frame *frame, int count, uint16_t out_order[GV_ORDER_MAX]) {
  assert(count >= 0 && count <= GV_ORDER_MAX);
  for (int i = 0; i < count; i++) {
    out_order[i] = (uint16_t)i;
    if (has_counter(&frame[i]))
      insert(frame, out_order, i);
  }
}
