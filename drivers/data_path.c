// SPDX-License-Identifier: BSD-3-Clause
// Where programs find what comes with them, wherever they are started: in a clone,
// installed, or in a package. Set-up only.
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "gloved/drivers.h"

enum { PLACES = 3, PLACE_MAX = 2048, FOUND_MAX = 8192 };

// The folder of the running program, without its last slash. False where the system does not say.
static bool find_program(char out[PLACE_MAX - 32]) {
  const ssize_t length = readlink("/proc/self/exe", out, PLACE_MAX - 33);
  if (length <= 0)
    return false;
  out[length] = '\0';
  char *slash = strrchr(out, '/');
  if (!slash)
    return false;
  *slash = '\0';
  return true;
}

// $GLOVED_DATA; share/gloved beside bin of an installed program; data of the clone that build/KIND/ lies in.
static int list_places(char out[PLACES][PLACE_MAX]) {
  char program[PLACE_MAX - 32];
  int count = 0;
  const char *asked = getenv("GLOVED_DATA");
  if (asked && *asked)
    snprintf(out[count++], sizeof out[0], "%s", asked);
  if (!find_program(program))
    return count;
  snprintf(out[count++], sizeof out[0], "%s/../share/gloved", program);
  snprintf(out[count++], sizeof out[0], "%s/../../data", program);
  return count;
}

// The file by this name in one place, with all links followed, or false.
static bool look_in(const char *place, const char *path, const char *kind, const char *ending, char *out,
                    size_t size) {
  char asked[FOUND_MAX], real[PATH_MAX];
  int length;
  if (strncmp(path, "data/", 5) == 0)
    length = snprintf(asked, sizeof asked, "%s/%s", place, path + 5);
  else
    length = snprintf(asked, sizeof asked, "%s/%s/%s%s", place, kind, path, ending);
  if (length < 0 || (size_t)length >= sizeof asked)
    return false;
  if (!realpath(asked, real) || strlen(real) >= size)
    return false;
  snprintf(out, size, "%s", real);
  return true;
}

bool gv_data_path(const char *path, const char *kind, const char *ending, char *out, size_t size) {
  char place[PLACES][PLACE_MAX];
  const size_t length = strlen(path);
  const size_t tail = strlen(ending);
  const bool ends = length > tail && strcmp(path + length - tail, ending) == 0;
  snprintf(out, size, "%s", path);
  if (access(path, F_OK) == 0)
    return true;
  if (*path == '/')
    return false;
  const int places = list_places(place);
  for (int i = 0; i < places; i++)
    if (look_in(place[i], path, kind, ends ? "" : ending, out, size))
      return true;
  return false;
}
