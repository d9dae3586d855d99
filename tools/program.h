// SPDX-License-Identifier: BSD-3-Clause
// What every program does with its command line. It answers --help (or -h) and --version on standard output:
// its text opens with "NAME: what it is".
#ifndef GLOVED_TOOLS_PROGRAM_H
#define GLOVED_TOOLS_PROGRAM_H

#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "gloved/version.h"

// True where the program was only asked that; it ends then with 0.
static inline bool program_answers(int argc, char **argv, const char *help) {
  if (argc != 2)
    return false;
  if (strcmp(argv[1], "--version") == 0) {
    printf("%.*s %s\n", (int)strcspn(help, ":"), help, gv_version_text());
    return true;
  }
  if (strcmp(argv[1], "--help") != 0 && strcmp(argv[1], "-h") != 0)
    return false;
  fputs(help, stdout);
  return true;
}

// The number that an option wants. 0, or 2 with a line on standard error.
static inline int program_number(const char *program, const char *option, const char *value, double min,
                                 double max, double *out) {
  char *end;
  *out = strtod(value, &end);
  if (end != value && !*end && *out >= min && *out <= max)
    return 0;
  fprintf(stderr, "%s: %s is \"%s\"; give a number from %g to %g\n", program, option, value, min, max);
  return 2;
}

#endif
