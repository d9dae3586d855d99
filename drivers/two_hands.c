// SPDX-License-Identifier: BSD-3-Clause
// The devices of two hands as one driver: the second one's frames are marked, and what carries the mark goes
// to it. Neither waits for the other, and a flood of one leaves the other's half of a poll alone. poll and
// send run in the real-time thread; opening allocates.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "gloved/drivers.h"
#include "gloved/fcu.h"

enum { HANDS = 2, FIRST = 0, SECOND = 1 };

typedef struct two_hands {
  gv_driver device[HANDS];
  bool one_tracker;   // the first one's tells of both hands
  uint64_t left_out;  // poses of the second device
} two_hands;

static int poll_one(gv_driver *device, int64_t now_ns, gv_frame *out, int max) {
  return max > 0 ? device->poll(device->self, now_ns, out, max) : 0;
}

static int poll_both(void *self, int64_t now_ns, gv_frame *out, int max) {
  two_hands *t = self;
  const int polled = poll_one(&t->device[SECOND], now_ns, out, max / HANDS);
  int second = 0;
  for (int i = 0; i < polled; i++) {
    if (t->one_tracker && out[i].id == GV_ID_POSE)
      continue;
    out[second] = out[i];
    out[second++].flags |= GV_FRAME_SECOND;
  }
  t->left_out += (uint64_t)(polled - second);
  return second + poll_one(&t->device[FIRST], now_ns, &out[second], max - second);
}

// As one bundle each: 0, or negative where a link refused.
static int send_to(gv_driver *device, bool is_second, const gv_frame *frame, int count) {
  int refused = 0;
  for (int i = 0; i < count; i++) {
    gv_frame own = frame[i];
    if (((own.flags & GV_FRAME_SECOND) != 0) != is_second)
      continue;
    own.flags &= (uint8_t)~GV_FRAME_SECOND;
    if (device->send(device->self, &own, 1) < 0)
      refused = -1;
  }
  return refused;
}

static int send_both(void *self, const gv_frame *frame, int count) {
  two_hands *t = self;
  const int first = send_to(&t->device[FIRST], false, frame, count);
  const int second = send_to(&t->device[SECOND], true, frame, count);
  return first < 0 ? first : second;
}

static bool one_ended(void *self) {
  const two_hands *t = self;
  return t->device[FIRST].ended(t->device[FIRST].self) || t->device[SECOND].ended(t->device[SECOND].self);
}

static gv_driver_stats stats_of_both(void *self) {
  const two_hands *t = self;
  gv_driver_stats a = t->device[FIRST].stats(t->device[FIRST].self);
  const gv_driver_stats b = t->device[SECOND].stats(t->device[SECOND].self);
  a.rx += b.rx - t->left_out;
  a.tx += b.tx;
  a.bad += b.bad;
  a.lost += b.lost;
  a.foreign += b.foreign + t->left_out;
  a.tx_failed += b.tx_failed;
  a.bus_errors += b.bus_errors;
  a.link_downs += b.link_downs;
  return a;
}

// The first hand's glove is the clock where a device is one.
static int descriptor_of_first(void *self) {
  const gv_driver *first = &((two_hands *)self)->device[FIRST];
  return first->descriptor(first->self);
}

static bool tell_of(const gv_driver *device, int64_t now_ns, char *out, size_t size) {
  return device->tell && device->tell(device->self, now_ns, out, size);
}

static bool tell_of_both(void *self, int64_t now_ns, char *out, size_t size) {
  static const char whose[] = "second hand: ";
  const size_t length = sizeof whose - 1;
  const two_hands *t = self;
  if (tell_of(&t->device[FIRST], now_ns, out, size))
    return true;
  if (size <= length || !tell_of(&t->device[SECOND], now_ns, out + length, size - length))
    return false;
  memcpy(out, whose, length);
  return true;
}

static void close_both(void *self) {
  two_hands *t = self;
  for (int i = 0; i < HANDS; i++)
    t->device[i].close(t->device[i].self);
  free(t);
}

int gv_two_hands_open(gv_driver first, gv_driver second, bool one_tracker, gv_driver *out, char *err,
                      size_t err_size) {
  two_hands *t = malloc(sizeof *t);
  if (!t) {
    snprintf(err, err_size, "out of memory; close other programs");
    first.close(first.self);
    second.close(second.self);
    return -1;
  }
  *t = (two_hands){.device = {first, second}, .one_tracker = one_tracker};
  *out = (gv_driver){t,
                     poll_both,
                     send_both,
                     one_ended,
                     stats_of_both,
                     close_both,
                     first.descriptor ? descriptor_of_first : NULL,
                     first.calls | second.calls,
                     tell_of_both};
  return 0;
}
