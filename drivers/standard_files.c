// SPDX-License-Identifier: BSD-3-Clause
// Descriptors 0 to 2 of a program that was started with one of them closed (a service manager, `>&-` in a
// script). The next file or device that is opened would get the free number, and what the program prints
// would go to it: the terminal view to a glove, a status line into a recording. Called first in main.
#include <fcntl.h>
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
