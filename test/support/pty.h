// SPDX-License-Identifier: BSD-3-Clause
// A pseudo-terminal as a serial cable for tests: the device's end, the computer's end under a name that
// stays, plug and unplug. The computer's end is held open here, as a plugged cable holds the line.
#ifndef PTY_H
#define PTY_H

#include <errno.h>
#include <fcntl.h>
#include <stdint.h>
#include <string.h>
#include <sys/stat.h>
#include <termios.h>
#include <unistd.h>

#include "support/check.h"

typedef struct pty {
  char link[64];
  int master, slave;  // -1: unplugged
} pty;

static inline void pty_plug(pty *p) {
  struct termios t;
  snprintf(p->link, sizeof p->link, "/tmp/gloved-pty-%d-%d", (int)getpid(), (int)((uintptr_t)p % 1000003));
  p->master = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK);
  CHECK(p->master >= 0 && grantpt(p->master) == 0 && unlockpt(p->master) == 0, "no pseudo-terminal");
  const char *name = ptsname(p->master);
  p->slave = open(name, O_RDWR | O_NOCTTY | O_NONBLOCK);
  CHECK(p->slave >= 0 && tcgetattr(p->slave, &t) == 0, "%s", strerror(errno));
  cfmakeraw(&t);
  tcsetattr(p->slave, TCSANOW, &t);
  unlink(p->link);
  CHECK(symlink(name, p->link) == 0, "%s", strerror(errno));
}

static inline void pty_unplug(pty *p) {
  close(p->slave);
  close(p->master);
  unlink(p->link);
  p->master = p->slave = -1;
}

#endif
