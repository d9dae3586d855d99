// SPDX-License-Identifier: BSD-3-Clause
// Text as a JSON string. Slow thread and set-up.
#ifndef GLOVED_DAEMON_JSON_H
#define GLOVED_DAEMON_JSON_H

#include <stdio.h>

void gv_json_text(FILE *out, const char *text);

#endif
