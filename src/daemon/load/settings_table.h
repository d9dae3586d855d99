// SPDX-License-Identifier: BSD-3-Clause
// Rows of settings (gloved/setting.h) read from a file, and told where they protect less
// than the defaults. Set-up only.
#ifndef GLOVED_SETTINGS_TABLE_H
#define GLOVED_SETTINGS_TABLE_H

#include "daemon/load/conf.h"
#include "daemon/load/config_load.h"

// The rows of one group, from the group of the file that is open.
void gv_settings_read_group(gv_conf_group *open, const char *group, gv_settings *out);
// All groups that consist of rows, below the file's root.
void gv_settings_read_groups(gv_conf_group *root, gv_settings *out);
// A choice of the engine by its word. 0, or negative where there is no such word: nothing has changed then.
int gv_settings_set_word(const char *group, const char *key, gv_config *out, const char *word);

// The rows of a group in their order, with the configuration that each lies in; null:
// no more. *io_at starts at 0.
typedef struct gv_settings_row {
  const gv_setting *setting;
  void *configuration;
} gv_settings_row;
gv_settings_row gv_settings_next(const char *group, gv_settings *settings, int *io_at);

// The value as the file would say it (settings_print.c).
enum { GV_SETTINGS_VALUE = 512 };
void gv_settings_value_text(const gv_setting *setting, const void *configuration,
                            char out[GV_SETTINGS_VALUE]);

// Millimetres of a file in metres, with the last bit that the same number written in metres has.
double gv_settings_metres(double mm);

#endif
