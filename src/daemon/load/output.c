// SPDX-License-Identifier: BSD-3-Clause
// Checks of files that will be written (output.h).
#include "daemon/load/output.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static bool is_given(const gv_named_file *file) { return file->path && *file->path; }

static const char *kind_of(mode_t mode) {
  if (S_ISDIR(mode))
    return "a folder";
  if (S_ISFIFO(mode))
    return "a pipe";
  if (S_ISSOCK(mode))
    return "a socket";
  if (S_ISCHR(mode) || S_ISBLK(mode))
    return "a device";
  return "no plain file";
}

// A pipe would block, a device never end or take what is no file.
static int check_kind(const gv_named_file *file, char *err, size_t err_size) {
  struct stat there;
  if (stat(file->path, &there) != 0 || S_ISREG(there.st_mode))
    return 0;
  snprintf(err, err_size, "%s %s: this is %s; name a plain file", file->option, file->path,
           kind_of(there.st_mode));
  return -1;
}

static int check_writable(const gv_named_file *file, char *err, size_t err_size) {
  struct stat there;
  const bool exists = stat(file->path, &there) == 0;
  if (!exists && lstat(file->path, &there) == 0) {
    snprintf(err, err_size, "%s %s: a link to a file that is not there; name the file", file->option,
             file->path);
    return -1;
  }
  // Opened as it will be, without emptying it; what this makes goes again.
  const int fd = open(file->path, O_WRONLY | O_CREAT | O_CLOEXEC | O_NONBLOCK, 0666);
  if (fd < 0) {
    snprintf(err, err_size, "%s: cannot be written (%s); choose another place for %s", file->path,
             strerror(errno), file->option);
    return -1;
  }
  close(fd);
  if (!exists)
    unlink(file->path);
  return 0;
}

// The path with all links followed; of a file that is not there yet, its folder's with its
// name behind. False: no folder.
static bool real_path(const char *path, char out[PATH_MAX]) {
  char folder[PATH_MAX];
  if (realpath(path, out))
    return true;
  const char *slash = strrchr(path, '/');
  const char *name = slash ? slash + 1 : path;
  snprintf(folder, sizeof folder, "%.*s", slash ? (int)(slash - path) + 1 : 1, slash ? path : ".");
  if (!realpath(folder, out) || strlen(out) + strlen(name) + 2 > PATH_MAX)
    return false;
  strcat(out, "/");
  strcat(out, name);
  return true;
}

static bool is_same_file(const char *a, const char *b) {
  struct stat of_a, of_b;
  if (stat(a, &of_a) == 0 && stat(b, &of_b) == 0)
    return of_a.st_dev == of_b.st_dev && of_a.st_ino == of_b.st_ino;
  char path_a[PATH_MAX], path_b[PATH_MAX];
  return real_path(a, path_a) && real_path(b, path_b) && strcmp(path_a, path_b) == 0;
}

static int check_apart(const gv_named_file *file, int count, int i, char *err, size_t err_size) {
  for (int k = 0; k < count; k++) {
    if (k == i || !is_given(&file[k]) || !is_same_file(file[i].path, file[k].path))
      continue;
    snprintf(err, err_size, "%s and %s name the same file, %s; it would be written over: give each its own",
             file[k].option, file[i].option, file[i].path);
    return -1;
  }
  return 0;
}

int gv_output_check(const gv_named_file *file, int count, char *err, size_t err_size) {
  for (int i = 0; i < count; i++) {
    if (!is_given(&file[i]))
      continue;
    if (check_kind(&file[i], err, err_size))
      return -1;
    if (!file[i].written)
      continue;
    if (check_apart(file, count, i, err, err_size))
      return -1;
    if (check_writable(&file[i], err, err_size))
      return -1;
  }
  return 0;
}

bool gv_output_is_below_here(const char *path) {
  char here[PATH_MAX], there[PATH_MAX];
  if (!realpath(".", here) || !realpath(path, there))
    return false;
  const size_t length = strlen(here);
  return strcmp(here, "/") == 0 || (strncmp(here, there, length) == 0 && there[length] == '/');
}
