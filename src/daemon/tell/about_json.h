// SPDX-License-Identifier: BSD-3-Clause
// What a recording was made of (load/about.h) as a JSON object: --summary, and fcusim's report.
#ifndef GLOVED_DAEMON_ABOUT_JSON_H
#define GLOVED_DAEMON_ABOUT_JSON_H

#include <stdio.h>

#include "daemon/load/about.h"

void gv_about_json(const gv_about *about, FILE *out);

#endif
