// SPDX-License-Identifier: BSD-3-Clause
// When the kernel received a message (SO_TIMESTAMPNS), on CLOCK_MONOTONIC. Real-time thread.
#ifndef DRIVERS_STAMP_H
#define DRIVERS_STAMP_H

#include <stdint.h>
#include <sys/socket.h>
#include <time.h>

// Of a message just read: not after now_ns, not before last_ns. The kernel stamps with the
// time of day: if that is set between receiving and reading, the bounds are what is left.
// Without a stamp: the time of reading.
int64_t gv_receive_stamp(struct msghdr *message, int64_t last_ns, int64_t now_ns);

#endif
