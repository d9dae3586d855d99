// SPDX-License-Identifier: BSD-3-Clause
// A force control unit (or glove) and a tracker of its own as one driver: their frames by their stamps. The
// unit's own POSE frames are left out, so that the hand has one pose and its counter one source. poll and
// send run in the real-time thread; opening allocates.
#include <stdio.h>
#include <stdlib.h>

#include "gloved/drivers.h"
#include "gloved/fcu.h"

enum {
  QUEUE = 64,  // frames of each side that wait for the other's
  REFILLS = 4  // of each queue in one poll: bounds its time under a flood of frames
               // that are left out
};

typedef struct side {
  gv_driver driver;
  gv_frame frame[QUEUE];
  int next, count;
  int refills;  // left in this poll
} side;

typedef struct pair {
  side fcu, tracker;
  uint64_t left_out;  // poses of the fcu
} pair;

static const gv_frame *first_of(side *s, int64_t now_ns) {
  if (s->next == s->count && s->refills-- > 0) {
    s->next = 0;
    s->count = s->driver.poll(s->driver.self, now_ns, s->frame, QUEUE);
  }
  return s->next < s->count ? &s->frame[s->next] : NULL;
}

static const gv_frame *first_of_fcu(pair *p, int64_t now_ns) {
  const gv_frame *frame;
  while ((frame = first_of(&p->fcu, now_ns)) && frame->id == GV_ID_POSE) {
    p->fcu.next++;
    p->left_out++;
  }
  return frame;
}

static int poll_pair(void *self, int64_t now_ns, gv_frame *out, int max) {
  pair *p = self;
  int n = 0;
  p->fcu.refills = p->tracker.refills = REFILLS;
  while (n < max) {
    const gv_frame *a = first_of_fcu(p, now_ns);
    const gv_frame *b = first_of(&p->tracker, now_ns);
    if (!a && !b)
      break;
    const bool take_a = a && (!b || a->stamp_ns <= b->stamp_ns);
    out[n++] = take_a ? *a : *b;
    if (take_a)
      p->fcu.next++;
    else
      p->tracker.next++;
  }
  return n;
}

static int send_pair(void *self, const gv_frame *frame, int count) {
  pair *p = self;
  return p->fcu.driver.send(p->fcu.driver.self, frame, count);
}

static bool pair_ended(void *self) {
  pair *p = self;
  return p->fcu.next == p->fcu.count && p->fcu.driver.ended(p->fcu.driver.self);
}

static gv_driver_stats pair_stats(void *self) {
  pair *p = self;
  gv_driver_stats a = p->fcu.driver.stats(p->fcu.driver.self);
  const gv_driver_stats b = p->tracker.driver.stats(p->tracker.driver.self);
  a.rx += b.rx - p->left_out;
  a.bad += b.bad;
  a.lost += b.lost;
  a.foreign += b.foreign + p->left_out;
  a.link_downs += b.link_downs;
  return a;
}

// The glove's frames are the clock where a device is one; the tracker's wait for them.
static int pair_descriptor(void *self) {
  const gv_driver *fcu = &((pair *)self)->fcu.driver;
  return fcu->descriptor ? fcu->descriptor(fcu->self) : -1;
}

static bool tell_of(const gv_driver *driver, int64_t now_ns, char *out, size_t size) {
  return driver->tell && driver->tell(driver->self, now_ns, out, size);
}

static bool tell_pair(void *self, int64_t now_ns, char *out, size_t size) {
  const pair *p = self;
  return tell_of(&p->fcu.driver, now_ns, out, size) || tell_of(&p->tracker.driver, now_ns, out, size);
}

static void close_pair(void *self) {
  pair *p = self;
  p->fcu.driver.close(p->fcu.driver.self);
  p->tracker.driver.close(p->tracker.driver.self);
  free(p);
}

int gv_pair_open(gv_driver fcu, gv_driver tracker, gv_driver *out, char *err, size_t err_size) {
  pair *p = calloc(1, sizeof *p);
  if (!p) {
    snprintf(err, err_size, "out of memory; close other programs");
    fcu.close(fcu.self);
    tracker.close(tracker.self);
    return -1;
  }
  p->fcu.driver = fcu;
  p->tracker.driver = tracker;
  *out = (gv_driver){p,          poll_pair,  send_pair,       pair_ended,
                     pair_stats, close_pair, pair_descriptor, fcu.calls | tracker.calls,
                     tell_pair};
  return 0;
}
