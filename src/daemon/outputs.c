// SPDX-License-Identifier: BSD-3-Clause
// Every file that the command line and the configuration name, for load/output.c to judge. Set-up only.
#include <stdio.h>
#include <string.h>

#include "daemon/load/output.h"
#include "daemon/options.h"
#include "gloved/drivers.h"

// The files that a device's URL reads; empty: none.
typedef struct url_files {
  char trace[GV_SETTING_TEXT], about[GV_SETTING_TEXT + 16];  // a recording, and what it was made of
  char script[4096];                                         // of the simulated user
} url_files;

// The file behind a scheme, without its options; empty: another scheme, or none is named.
static void file_of(const char *url, const char *scheme, char out[GV_SETTING_TEXT]) {
  const size_t length = strlen(scheme);
  const char *file = strncmp(url, scheme, length) == 0 ? url + length : "";
  snprintf(out, GV_SETTING_TEXT, "%.*s", (int)strcspn(file, "?"), file);
}

static url_files files_of(const char *url) {
  char named[GV_SETTING_TEXT];
  url_files files = {.trace = ""};
  file_of(url, "trace:", files.trace);
  if (*files.trace)
    snprintf(files.about, sizeof files.about, "%s.about", files.trace);
  file_of(url, "sim:", named);
  if (*named)
    gv_data_path(named, "scripts", ".user", files.script, sizeof files.script);
  return files;
}

int gv_options_outputs(const gv_options *options, const gv_settings *settings, char *err, size_t err_size) {
  const url_files first = files_of(settings->fcu);
  const url_files second = files_of(settings->fcu2);
  char about[GV_SETTING_TEXT + 16] = "";
  if (options->record)
    snprintf(about, sizeof about, "%s.about", options->record);
  const gv_named_file file[] = {
    {"--config", options->config, false},
    {"--scene", settings->scene, false},
    {"--fcu trace:", first.trace, false},
    {"--fcu trace:", first.about, false},
    {"--fcu sim:", first.script, false},
    {"--fcu2 trace:", second.trace, false},
    {"--fcu2 trace:", second.about, false},
    {"--fcu2 sim:", second.script, false},
    {"calibration", settings->calibration, false},
    {"calibration2", settings->calibration2, false},
    {"--summary", options->summary, true},
    {"--record", options->record, true},
    {"--record", about, true},
    {"--log", options->log, true},
  };
  return gv_output_check(file, sizeof file / sizeof file[0], err, err_size);
}
