// SPDX-License-Identifier: BSD-3-Clause
// Opens what an URL of --fcu or --tracker names, and says how time runs with it. Set-up only.
#ifndef GLOVED_PROCESS_DEVICES_H
#define GLOVED_PROCESS_DEVICES_H

#include "gloved/drivers.h"
#include "loop.h"

// 0 and an open driver with its pace, or negative with one line (what, what to do) in err.
int gv_device_open(const char *url, gv_driver *out, gv_pace *out_pace, char *err, size_t err_size);
// 0 for "" (poses come with the fcu); otherwise negative with one line in err.
int gv_tracker_check(const char *url, char *err, size_t err_size);

#endif
