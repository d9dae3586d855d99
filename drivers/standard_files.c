// SPDX-License-Identifier: BSD-3-Clause
// Descriptors 0 to 2 of a program that was started with one of them closed (a service manager, `>&-` in a
// script). The next file or device that is opened would get the free number, and what the program prints
// would go to it: the terminal view to a glove, a status line into a recording. Called first in main.
#include <fcntl.h>
#include <poll.h>
#include <stdio.h>
#include <sys/stat.h>
#include <unistd.h>

#include "gloved/drivers.h"

void gv_keep_standard_files(void) {
  int fd;
  do
    fd = open("/dev/null", O_RDWR);
  while (fd >= 0 && fd <= STDERR_FILENO);
  if (fd > STDERR_FILENO)
    close(fd);
}

// ---- a reader that does not read ----------------------------------------------------------------------

// What blocks on a reader is opened anew through /proc, so that the flag is ours alone and not the shell's or
// the other programs' that share the terminal. Nobody else writes to a socket that a service manager gave us.
static void unblock(int fd) {
  struct stat there;
  char name[32];
  if (fstat(fd, &there) != 0)
    return;
  if (S_ISSOCK(there.st_mode))
    fcntl(fd, F_SETFL, fcntl(fd, F_GETFL) | O_NONBLOCK);
  if (!S_ISFIFO(there.st_mode) && !isatty(fd))
    return;
  snprintf(name, sizeof name, "/proc/self/fd/%d", fd);
  const int own = open(name, O_WRONLY | O_NONBLOCK | O_NOCTTY | O_CLOEXEC);
  if (own < 0)
    return;
  dup2(own, fd);
  close(own);
}

void gv_unblock_standard_files(void) {
  unblock(STDOUT_FILENO);
  unblock(STDERR_FILENO);
}

void gv_block_standard_files(int wait_ms) {
  for (int fd = STDOUT_FILENO; fd <= STDERR_FILENO; fd++) {
    struct pollfd ready = {.fd = fd, .events = POLLOUT};
    const int flags = fcntl(fd, F_GETFL);
    if (flags >= 0 && flags & O_NONBLOCK && poll(&ready, 1, wait_ms) == 1)
      fcntl(fd, F_SETFL, flags & ~O_NONBLOCK);
  }
}
