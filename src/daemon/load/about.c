// SPDX-License-Identifier: BSD-3-Clause
// What a recording was made of, written beside it and read again (about.h). Main thread.
#include "daemon/load/about.h"

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "daemon/load/conf.h"
#include "gloved/version.h"

static uint64_t hash_bytes(uint64_t hash, const char *bytes, size_t size) {
  for (size_t i = 0; i < size; i++)
    hash = (hash ^ (unsigned char)bytes[i]) * 0x100000001b3ULL;
  return hash;
}

static const uint64_t hash_start = 0xcbf29ce484222325ULL;

void gv_about_read_file(const char *name, gv_about_file *out) {
  char part[4096];
  free(out->text);
  *out = (gv_about_file){.hash = hash_start};
  snprintf(out->name, sizeof out->name, "%s", name);
  struct stat there;
  if (stat(name, &there) != 0 || !S_ISREG(there.st_mode))
    return;
  FILE *file = fopen(name, "rb");
  if (!file)
    return;
  const bool small = there.st_size < GV_ABOUT_TEXT_MAX;
  char *text = small ? calloc(1, (size_t)there.st_size + 1) : NULL;
  for (size_t got; (got = fread(part, 1, sizeof part, file)) > 0; out->size += got) {
    out->hash = hash_bytes(out->hash, part, got);
    if (text && out->size + got <= (size_t)there.st_size)
      memcpy(text + out->size, part, got);
  }
  fclose(file);
  if (text && out->size == (size_t)there.st_size && !memchr(text, 0, out->size))
    out->text = text;
  else
    free(text);
}

void gv_about_command_line(int argc, char **argv, char out[1024]) {
  size_t used = 0;
  out[0] = '\0';
  for (int i = 0; i < argc && used < 1000; i++) {
    const char *quote = argv[i][strcspn(argv[i], " \t\n\"'\\$?*&;|<>()")] || !argv[i][0] ? "'" : "";
    used += (size_t)snprintf(out + used, 1024 - used, "%s%s%s%s", i ? " " : "", quote, argv[i], quote);
  }
}

void gv_about_now(gv_about *out) {
  struct tm utc;
  const time_t now = time(NULL);
  gmtime_r(&now, &utc);
  strftime(out->date, sizeof out->date, "%Y-%m-%dT%H:%M:%SZ", &utc);
  snprintf(out->version, sizeof out->version, "%s", gv_version());
  snprintf(out->commit, sizeof out->commit, "%s", gv_commit());
}

static void name_interface(const char *fcu, const char *otherwise, char out[GV_ABOUT_IFACE]) {
  const bool can = strncmp(fcu, "can:", 4) == 0;
  snprintf(out, GV_ABOUT_IFACE, "%.15s", can ? fcu + 4 : otherwise);
}

void gv_about_interfaces(const char *fcu, const char *fcu2, char out_first[GV_ABOUT_IFACE],
                         char out_second[GV_ABOUT_IFACE]) {
  name_interface(fcu, "can0", out_first);
  name_interface(fcu2, "can1", out_second);
  if (strcmp(out_first, out_second) == 0)
    snprintf(out_second, GV_ABOUT_IFACE, "%.12s-2", out_first);
}

void gv_about_free(gv_about *about) {
  free(about->scene.text);
  free(about->settings.text);
  about->scene.text = about->settings.text = NULL;
}

const char *gv_about_small_text(const gv_about_file *file) {
  return file->text && file->size <= GV_ABOUT_SMALL ? file->text : "";
}

// ---- the file -------------------------------------------------------------------------------------------

// In quotes, a line of the text on a line of its own: libconfig puts neighbours together.
static void put_text(FILE *out, const char *key, const char *text) {
  fprintf(out, "%s = \"", key);
  for (const char *c = text; *c; c++) {
    if (*c == '\n')
      fputs(c[1] ? "\\n\"\n  \"" : "\\n", out);
    else if (*c == '\t')
      fputs("\\t", out);
    else if (*c == '\r')
      fputs("\\r", out);
    else if (*c == '"' || *c == '\\')
      fprintf(out, "\\%c", *c);
    else if ((unsigned char)*c < ' ' || *c == 127)
      fprintf(out, "\\x%02x", (unsigned char)*c);
    else
      fputc(*c, out);
  }
  fputs("\";\n", out);
}

static void put_file(FILE *out, const char *key, const gv_about_file *file) {
  char hash[24];
  if (!file->name[0])
    return;
  snprintf(hash, sizeof hash, "%016" PRIx64, file->hash);
  fprintf(out, "%s = {\n", key);
  put_text(out, "name", file->name);
  put_text(out, "hash", hash);
  if (file->text)
    put_text(out, "text", file->text);
  fputs("};\n", out);
}

static int write_whole(const gv_about *about, const char *path, const char *name) {
  FILE *out = fopen(name, "w");
  if (!out)
    return -1;
  fprintf(out, "# What %s was made of; gloved reads it when the recording is replayed.\nversion = 1;\n",
          path);
  put_text(out, "program", about->version);
  put_text(out, "commit", about->commit);
  put_text(out, "date", about->date);
  put_text(out, "command_line", about->command_line);
  put_text(out, "fcu", about->fcu);
  if (about->fcu2[0])
    put_text(out, "fcu2", about->fcu2);
  put_text(out, "tracker", about->tracker);
  put_text(out, "hand", about->hand);
  fprintf(out, "rate_hz = %.9f;\n", about->rate_hz);
  put_file(out, "scene", &about->scene);
  put_file(out, "settings", &about->settings);
  const bool whole = !ferror(out);
  return fclose(out) == 0 && whole ? 0 : -1;
}

// Beside it first, so that a disk that is full leaves the words of an older recording whole.
int gv_about_write(const gv_about *about, const char *path, char *err, size_t err_size) {
  char name[4200];
  char beside[4210];
  snprintf(name, sizeof name, "%s.about", path);
  snprintf(beside, sizeof beside, "%s.part", name);
  if (write_whole(about, path, beside) == 0 && rename(beside, name) == 0)
    return 0;
  snprintf(err, err_size, "%s: cannot be written (%s); choose another place for the recording", name,
           strerror(errno));
  unlink(beside);
  return -1;
}

static void take_text(gv_conf_group *group, const char *key, char *out, size_t size) {
  const char *text = gv_conf_long_text(group, key);
  if (text)
    snprintf(out, size, "%s", text);
}

static void take_file(gv_conf_group *root, const char *key, gv_about_file *out) {
  gv_conf_group group;
  char hash[24] = "";
  if (!gv_conf_enter(root, key, &group))
    return;
  take_text(&group, "name", out->name, sizeof out->name);
  take_text(&group, "hash", hash, sizeof hash);
  out->hash = strtoull(hash, NULL, 16);
  const char *text = gv_conf_long_text(&group, "text");
  gv_conf_leave(&group);
  if (!text)
    return;
  out->size = strlen(text);
  if (hash_bytes(hash_start, text, out->size) != out->hash) {
    gv_conf_fail(gv_conf_find(&group, "text"),
                 "the text of '%s' does not belong to its hash; it was changed: move this file away, "
                 "or take it from where the recording came from",
                 key);
    return;
  }
  out->text = strdup(text);
}

static void take_all(gv_conf_group *root, gv_about *out) {
  take_text(root, "program", out->version, sizeof out->version);
  take_text(root, "commit", out->commit, sizeof out->commit);
  take_text(root, "date", out->date, sizeof out->date);
  take_text(root, "command_line", out->command_line, sizeof out->command_line);
  take_text(root, "fcu", out->fcu, sizeof out->fcu);
  take_text(root, "fcu2", out->fcu2, sizeof out->fcu2);
  take_text(root, "tracker", out->tracker, sizeof out->tracker);
  take_text(root, "hand", out->hand, sizeof out->hand);
  gv_conf_number(root, "rate_hz", 0, 1e6, &out->rate_hz);
  take_file(root, "scene", &out->scene);
  take_file(root, "settings", &out->settings);
  gv_conf_leave(root);
}

// The name of the file beside the recording; false: there is none.
static bool find(const char *path, char out[4200]) {
  const size_t length = strlen(path);
  snprintf(out, 4200, "%s.about", path);
  if (access(out, F_OK) == 0)
    return true;
  if (length < 3 || strcmp(path + length - 3, ".gz") != 0)
    return false;
  snprintf(out, 4200, "%.*s.about", (int)length - 3, path);
  return access(out, F_OK) == 0;
}

int gv_about_read(const char *path, gv_about *out, char *err, size_t err_size) {
  char name[4200];
  gv_conf conf;
  *out = (gv_about){0};
  if (!find(path, name))
    return 0;
  if (!gv_conf_open(&conf, name, err, err_size))
    return -1;
  gv_conf_group root = gv_conf_root(&conf);
  take_all(&root, out);
  gv_conf_close(&conf);
  if (!conf.failed)
    return 1;
  gv_about_free(out);
  return -1;
}
