// SPDX-License-Identifier: BSD-3-Clause
// Rows of settings (gloved/setting.h) read from a file, and told where they protect less than the defaults. Set-up only.
#ifndef GLOVED_SETTINGS_TABLE_H
#define GLOVED_SETTINGS_TABLE_H

#include "daemon/load/conf.h"
#include "daemon/load/config_load.h"

// Reads each row's key from the group that is open, into `configuration`; the rows' own group is not looked at.
void gv_settings_read_rows(gv_conf_group *group, const gv_setting rows[], int count, void *configuration);

// Millimetres of a file in metres, with the last bit that the same number written in metres has.
double gv_settings_metres(double mm);

#endif
