// SPDX-License-Identifier: BSD-3-Clause
// What a service manager is told (sd_notify(3)): datagrams to $NOTIFY_SOCKET. Slow thread; never blocks.
#ifndef GLOVED_DAEMON_NOTIFY_H
#define GLOVED_DAEMON_NOTIFY_H

#include <stdint.h>

typedef struct gv_notify {
  int socket;        // below 0: nobody wants to know
  int64_t every_ns;  // between signs of life; 0: none wanted
  int64_t told_ns;   // the last one
  uint64_t count;    // the loop's steps then
} gv_notify;

// Takes $NOTIFY_SOCKET and $WATCHDOG_USEC. Set-up.
void gv_notify_open(gv_notify *notify);
// The loop runs: READY=1.
void gv_notify_ready(gv_notify *notify);
// A sign of life at half of the watchdog's time, but only where the loop has stepped since the
// last one: a real-time thread that stands still must be ended by the manager although this thread
// runs. now_ns of CLOCK_MONOTONIC.
void gv_notify_alive(gv_notify *notify, int64_t now_ns, uint64_t steps);
// What `systemctl status` shows: the safety machine's state, and why.
void gv_notify_status(const gv_notify *notify, const char *state, const char *why);
// The end has begun: STOPPING=1.
void gv_notify_close(gv_notify *notify);

#endif
