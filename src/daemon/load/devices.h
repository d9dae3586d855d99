// SPDX-License-Identifier: BSD-3-Clause
// Opens what --fcu, --tracker and --fcu2 name, and says how time runs with it. Set-up only.
#ifndef GLOVED_PROCESS_DEVICES_H
#define GLOVED_PROCESS_DEVICES_H

#include "daemon/load/config_load.h"
#include "gloved/channel.h"
#include "daemon/load/pace.h"
#include "gloved/drivers.h"

// All of them, as one driver. 0 and an open driver with its pace, or negative with one line (what, what to
// do) in err. On success err is empty or holds one line that the user should know (a classic CAN interface).
int gv_device_open(const gv_settings *settings, gv_driver *out, gv_pace *out_pace, char *err,
                   size_t err_size);
// The fcu alone.
int gv_fcu_open(const gv_settings *settings, gv_driver *out, gv_pace *out_pace, char *err, size_t err_size);
// What its fingers take; the CyberGrasp's where the URL does not say.
const gv_channel *gv_fcu_channel(const char *url);

#endif
