// SPDX-License-Identifier: BSD-3-Clause
// The doctor's eyes (tree.h): files of /proc and /sys are short, and read whole.
#include "daemon/doctor/tree.h"

#include <ctype.h>
#include <dirent.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { PATH_TEXT = 512 };

static bool read_file(const gv_doctor *doctor, char *out, size_t size, const char *path) {
  char whole[PATH_TEXT];
  out[0] = '\0';
  if (snprintf(whole, sizeof whole, "%s%s", doctor->root, path) >= (int)sizeof whole)
    return false;
  FILE *file = fopen(whole, "r");
  if (!file)
    return false;
  size_t length = fread(out, 1, size - 1, file);
  const bool sound = !ferror(file);
  fclose(file);
  while (length > 0 && out[length - 1] == '\n')
    length--;
  out[length] = '\0';
  return sound;
}

bool gv_tree_read(const gv_doctor *doctor, char *out, size_t size, const char *path, ...) {
  char name[PATH_TEXT];
  va_list arguments;
  va_start(arguments, path);
  vsnprintf(name, sizeof name, path, arguments);
  va_end(arguments);
  return read_file(doctor, out, size, name);
}

bool gv_tree_number(const gv_doctor *doctor, long *out, const char *path, ...) {
  char name[PATH_TEXT], text[64], *end;
  va_list arguments;
  va_start(arguments, path);
  vsnprintf(name, sizeof name, path, arguments);
  va_end(arguments);
  if (!read_file(doctor, text, sizeof text, name))
    return false;
  *out = strtol(text, &end, 0);
  return end != text;
}

bool gv_tree_may_write(const gv_doctor *doctor, const char *path) {
  char whole[PATH_TEXT];
  snprintf(whole, sizeof whole, "%s%s", doctor->root, path);
  return access(whole, W_OK) == 0;
}

void gv_tree_each(const gv_doctor *doctor, const char *directory, const char *prefix,
                  void (*visit)(const gv_doctor *doctor, const char *name, void *user), void *user) {
  char whole[PATH_TEXT];
  const size_t n = strlen(prefix);
  snprintf(whole, sizeof whole, "%s%s", doctor->root, directory);
  DIR *open_directory = opendir(whole);
  if (!open_directory)
    return;
  for (const struct dirent *entry; (entry = readdir(open_directory));)
    if (strncmp(entry->d_name, prefix, n) == 0 && isdigit((unsigned char)entry->d_name[n]))
      visit(doctor, entry->d_name, user);
  closedir(open_directory);
}

const char *gv_tree_line(const char *text, const char *name) {
  const size_t n = strlen(name);
  for (const char *line = text; line; line = strchr(line, '\n')) {
    if (*line == '\n')
      line++;
    if (strncmp(line, name, n) != 0)
      continue;
    line += n;
    while (*line == ' ' || *line == '\t' || *line == ':')
      line++;
    return line;
  }
  return NULL;
}

bool gv_tree_list_has(const char *list, int core) {
  while (*list) {
    char *end;
    const long first = strtol(list, &end, 10);
    if (end == list)
      return false;
    const long last = *end == '-' ? strtol(end + 1, &end, 10) : first;
    if (core >= first && core <= last)
      return true;
    list = *end == ',' ? end + 1 : end;
    if (*end != ',')
      return false;
  }
  return false;
}

static int last_online(const gv_doctor *doctor) {
  char list[256];
  int last = 0;
  if (!gv_tree_read(doctor, list, sizeof list, "/sys/devices/system/cpu/online"))
    return 0;
  for (int core = 0; core < 1024; core++)
    if (gv_tree_list_has(list, core))
      last = core;
  return last;
}

int gv_tree_loop_core(const gv_doctor *doctor) {
  return doctor->settings->cpu >= 0 ? doctor->settings->cpu : last_online(doctor);
}

int gv_tree_cores(const gv_doctor *doctor) { return last_online(doctor) + 1; }

void gv_doctor_finds(gv_finding *out, gv_verdict verdict, const char *text, ...) {
  va_list arguments;
  va_start(arguments, text);
  out->verdict = verdict;
  vsnprintf(out->found, sizeof out->found, text, arguments);
  va_end(arguments);
}

void gv_doctor_mends(gv_finding *out, const char *text, ...) {
  va_list arguments;
  va_start(arguments, text);
  if (out->verdict != GV_VERDICT_PASS)
    vsnprintf(out->mend, sizeof out->mend, text, arguments);
  va_end(arguments);
}
