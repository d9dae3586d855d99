// SPDX-License-Identifier: BSD-3-Clause
// Receive stamps of sockets: SCM_TIMESTAMPNS is CLOCK_REALTIME (socket(7)), the
// loop's clock is CLOCK_MONOTONIC.
#include "drivers/stamp.h"

#include <string.h>

static int64_t clock_ns(clockid_t clock) {
  struct timespec t;
  clock_gettime(clock, &t);
  return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

int64_t gv_receive_stamp(struct msghdr *message, int64_t last_ns, int64_t now_ns) {
  int64_t mono = clock_ns(CLOCK_MONOTONIC);
  int64_t stamp = mono;
  for (struct cmsghdr *c = CMSG_FIRSTHDR(message); c; c = CMSG_NXTHDR(message, c)) {
    if (c->cmsg_level != SOL_SOCKET || c->cmsg_type != SCM_TIMESTAMPNS)
      continue;
    struct timespec t;
    memcpy(&t, CMSG_DATA(c), sizeof t);
    stamp = (int64_t)t.tv_sec * 1000000000 + t.tv_nsec + (mono - clock_ns(CLOCK_REALTIME));
  }
  if (stamp < last_ns)
    stamp = last_ns;
  return stamp > now_ns ? now_ns : stamp;
}
