// SPDX-License-Identifier: BSD-3-Clause
// How fast this machine is at what the engine counts. Main thread, before the loop starts.
#ifndef GLOVED_DAEMON_MACHINE_H
#define GLOVED_DAEMON_MACHINE_H

#include "gloved/narrow.h"

// Counted operations of collision detection in a second (gv_config.operations_per_s), with a reserve for
// caches that are cold in the loop. Takes 5 ms.
double gv_machine_operations_per_s(gv_narrow narrow);

#endif
