// SPDX-License-Identifier: BSD-3-Clause
// Text files in libconfig's syntax, read with errors that name file, line, what and what to do; the only
// file that knows the library. Main thread, before the loop starts.
//
// What libconfig 1.5 gets silently wrong is refused before it sees the text (check_text): integers beyond
// 32 bits (they wrap around), comments without an end, and @include (a directory there ends the process).
#include "daemon/load/conf.h"

#include <ctype.h>
#include <errno.h>
#include <libconfig.h>
#include <limits.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "gloved/limits.h"

// ---- errors ---------------------------------------------------------------------------------------

static bool fail_line(gv_conf *conf, unsigned line, const char *format, va_list args) {
  if (conf->failed)
    return false;
  conf->failed = true;
  int n = line ? snprintf(conf->err, conf->err_size, "%s:%u: ", conf->path, line)
               : snprintf(conf->err, conf->err_size, "%s: ", conf->path);
  if (n >= 0 && (size_t)n < conf->err_size)
    vsnprintf(conf->err + n, conf->err_size - (size_t)n, format, args);
  return false;
}

static bool fail_at(gv_conf *conf, unsigned line, const char *format, ...)
    __attribute__((format(printf, 3, 4)));
static bool fail_at(gv_conf *conf, unsigned line, const char *format, ...) {
  va_list args;
  va_start(args, format);
  fail_line(conf, line, format, args);
  va_end(args);
  return false;
}

bool gv_conf_fail(gv_conf_node at, const char *format, ...) {
  va_list args;
  va_start(args, format);
  fail_line(at.conf, at.setting ? config_setting_source_line(at.setting) : 0, format, args);
  va_end(args);
  return false;
}

// ---- the file -------------------------------------------------------------------------------------

// A pipe would block for ever, a device never end.
static bool is_pipe_or_device(const char *path) {
  struct stat there;
  return stat(path, &there) == 0 && !S_ISREG(there.st_mode) && !S_ISDIR(there.st_mode);
}

// The whole file with a final zero, or null.
static char *read_text(gv_conf *conf) {
  if (is_pipe_or_device(conf->path)) {
    fail_at(conf, 0, "a pipe or a device; give a plain file");
    return NULL;
  }
  FILE *file = fopen(conf->path, "rb");
  if (!file) {
    fail_at(conf, 0, "cannot open: %s; check the path", strerror(errno));
    return NULL;
  }
  size_t size = 0;
  size_t room = 1 << 16;
  char *text = malloc(room);
  while (text && !feof(file) && !ferror(file) && size < GV_CONF_MAX_BYTES) {
    if (size + 1 == room) {
      char *more = realloc(text, room *= 2);
      if (!more)
        free(text);
      text = more;
      if (!text)
        break;
    }
    size += fread(text + size, 1, room - size - 1, file);
  }
  if (!text)
    fail_at(conf, 0, "out of memory while reading");
  else if (ferror(file))
    fail_at(conf, 0, "cannot read: %s; give a text file", strerror(errno));
  else if (size >= GV_CONF_MAX_BYTES)
    fail_at(conf, 0, "larger than %d MB; simplify it", GV_CONF_MAX_BYTES >> 20);
  else if (memchr(text, 0, size))
    fail_at(conf, 0, "holds zero bytes, so it is no text; give a text file");
  else
    text[size] = 0;
  fclose(file);
  if (conf->failed) {
    free(text);
    return NULL;
  }
  return text;
}

static bool is_word(char c) {
  return isalnum((unsigned char)c) || c == '_' || c == '-' || c == '.' || c == '*';
}

// A word that starts with a digit and has no point or exponent: an integer. libconfig keeps 32 bits of it.
static bool check_integer(gv_conf *conf, unsigned line, const char *word, size_t length) {
  bool hex = length > 1 && (word[1] == 'x' || word[1] == 'X');
  for (size_t i = 0; i < length && !hex; i++)
    if (strchr(".eE", word[i]))
      return true;
  errno = 0;
  unsigned long long value = strtoull(word, NULL, hex ? 16 : 10);
  if (errno == 0 && value <= INT_MAX)
    return true;
  return fail_at(conf, line, "the integer %.*s is too large; stay below %d, or write it with a decimal point",
                 length > 40 ? 40 : (int)length, word, INT_MAX);
}

// The end of the comment or string at `at`, or `at` where none starts. Null: it has no end.
static const char *skip_quiet(const char *at) {
  if (at[0] == '#' || (at[0] == '/' && at[1] == '/'))
    return at + strcspn(at, "\n");
  if (at[0] == '/' && at[1] == '*') {
    const char *end = strstr(at + 2, "*/");
    return end ? end + 2 : NULL;
  }
  if (at[0] != '"')
    return at;
  for (at++; *at && *at != '"'; at++)
    if (*at == '\\' && at[1])
      at++;
  return *at ? at + 1 : NULL;
}

static unsigned count_lines(const char *from, const char *to) {
  unsigned lines = 0;
  for (; from < to; from++)
    lines += *from == '\n';
  return lines;
}

static bool check_text(gv_conf *conf, const char *text) {
  unsigned line = 1;
  for (const char *at = text; *at;) {
    const char *end = skip_quiet(at);
    if (!end)
      return fail_at(conf, line, "a comment or text that starts here never ends; close it");
    if (end == at) {
      if (*at == '@')
        return fail_at(conf, line, "'@include' is not supported; put everything into one file");
      while (is_word(*end))
        end++;
      if (isdigit((unsigned char)*at) && !check_integer(conf, line, at, (size_t)(end - at)))
        return false;
      if (end > at && *at == '-' && isdigit((unsigned char)at[1]) &&
          !check_integer(conf, line, at + 1, (size_t)(end - at - 1)))
        return false;
      if (end == at)
        end++;
    }
    line += count_lines(at, end);
    at = end;
  }
  return true;
}

static bool fail_parse(gv_conf *conf, const config_t *config) {
  unsigned line = (unsigned)config_error_line(config);
  const char *text = config_error_text(config);
  if (text && strstr(text, "mismatched element"))
    return fail_at(conf, line,
                   "integers and decimals mixed inside [ ]; write every entry with a decimal point");
  if (text && strstr(text, "duplicate"))
    return fail_at(conf, line, "a setting stands here twice in the same group; remove one");
  return fail_at(conf, line, "%s here or just above; look for a missing ';', '=', quote or bracket",
                 text ? text : "syntax error");
}

static void parse(gv_conf *conf, const char *text) {
  config_t *config = text && check_text(conf, text) ? malloc(sizeof *config) : NULL;
  if (config) {
    config_init(config);
    conf->config = config;
    if (!config_read_string(config, text))
      fail_parse(conf, config);
  } else
    fail_at(conf, 0, "out of memory while reading");
  if (conf->failed)
    gv_conf_close(conf);
}

bool gv_conf_open(gv_conf *conf, const char *path, char *err, size_t err_size) {
  *conf = (gv_conf){.path = path, .err = err, .err_size = err_size};
  char *text = read_text(conf);
  parse(conf, text);
  free(text);
  return !conf->failed;
}

bool gv_conf_open_text(gv_conf *conf, const char *name, const char *text, char *err, size_t err_size) {
  *conf = (gv_conf){.path = name, .err = err, .err_size = err_size};
  parse(conf, text);
  return !conf->failed;
}

void gv_conf_close(gv_conf *conf) {
  if (conf->config)
    config_destroy(conf->config);
  free(conf->config);
  conf->config = NULL;
}

// ---- groups ---------------------------------------------------------------------------------------

gv_conf_group gv_conf_root(gv_conf *conf) {
  gv_conf_group root = {.node = {conf, config_root_setting((config_t *)conf->config)}};
  int version = 0;
  gv_conf_need(&root, "version", "version = 1;");
  if (gv_conf_integer(&root, "version", INT_MIN, INT_MAX, &version) && version != 1)
    gv_conf_fail(gv_conf_find(&root, "version"), "version %d is not known; this program reads version 1",
                 version);
  return root;
}

gv_conf_group gv_conf_as_group(gv_conf_node node, const char *what) {
  if (gv_conf_has(node) && !config_setting_is_group(node.setting))
    gv_conf_fail(node, "%s must be a group; write { key = value; ... }", what);
  return (gv_conf_group){.node = node};
}

bool gv_conf_enter(gv_conf_group *group, const char *key, gv_conf_group *out) {
  gv_conf_node node = gv_conf_find(group, key);
  if (!gv_conf_has(node))
    return false;
  char what[64];
  snprintf(what, sizeof what, "'%s'", key);
  *out = gv_conf_as_group(node, what);
  return !node.conf->failed;
}

// Levenshtein distance of two keys, for "did you mean"; words over 31 bytes are never near.
static int word_distance(const char *a, const char *b) {
  int row[32];
  size_t n = strlen(a);
  size_t m = strlen(b);
  if (n > 31 || m > 31)
    return 99;
  for (size_t j = 0; j <= m; j++)
    row[j] = (int)j;
  for (size_t i = 1; i <= n; i++) {
    int diagonal = row[0];
    row[0] = (int)i;
    for (size_t j = 1; j <= m; j++) {
      int change = diagonal + (a[i - 1] != b[j - 1]);
      int keep = (row[j] < row[j - 1] ? row[j] : row[j - 1]) + 1;
      diagonal = row[j];
      row[j] = change < keep ? change : keep;
    }
  }
  return row[m];
}

static void refuse_unknown(gv_conf_group *group, gv_conf_node node, const char *name) {
  int best = 3;  // more than two wrong letters is no misspelling
  const char *near = NULL;
  char known[512] = "";
  for (int i = 0; i < group->key_count; i++) {
    int distance = word_distance(name, group->key[i]);
    if (distance < best) {
      best = distance;
      near = group->key[i];
    }
    size_t used = strlen(known);
    snprintf(known + used, sizeof known - used, "%s%s", i ? ", " : "", group->key[i]);
  }
  if (near)
    gv_conf_fail(node, "unknown setting '%s'; did you mean '%s'?", name, near);
  else
    gv_conf_fail(node, "unknown setting '%s'; known here: %s", name, known);
}

static bool is_known(const gv_conf_group *group, const char *name) {
  for (int k = 0; k < group->key_count; k++)
    if (strcmp(name, group->key[k]) == 0)
      return true;
  return false;
}

void gv_conf_leave(gv_conf_group *group) {
  gv_conf *conf = group->node.conf;
  if (conf->failed)
    return;
  for (int i = 0; i < config_setting_length(group->node.setting); i++) {
    const config_setting_t *child = config_setting_get_elem(group->node.setting, (unsigned)i);
    const char *name = config_setting_name(child);
    if (!is_known(group, name)) {
      refuse_unknown(group, (gv_conf_node){conf, child}, name);
      return;
    }
  }
}

gv_conf_node gv_conf_find(gv_conf_group *group, const char *key) {
  gv_conf *conf = group->node.conf;
  if (conf->failed || !group->node.setting)
    return (gv_conf_node){conf, NULL};
  if (!is_known(group, key) && group->key_count < GV_CONF_KEYS)
    group->key[group->key_count++] = key;
  return (gv_conf_node){conf, config_setting_get_member(group->node.setting, key)};
}

// A misspelt key is the likelier mistake than a missing one, but it is only known once all keys were asked
// for: so the nearest stranger (no key asked for up to here) in the group is named.
static const char *find_misspelt(const gv_conf_group *group, const char *key) {
  for (int i = 0; i < config_setting_length(group->node.setting); i++) {
    const char *name = config_setting_name(config_setting_get_elem(group->node.setting, (unsigned)i));
    if (!is_known(group, name) && word_distance(name, key) <= 1 + (strlen(key) > 5))
      return name;
  }
  return NULL;
}

gv_conf_node gv_conf_need(gv_conf_group *group, const char *key, const char *hint) {
  gv_conf_node node = gv_conf_find(group, key);
  if (node.setting || node.conf->failed || !group->node.setting)
    return node;
  const char *near = find_misspelt(group, key);
  if (near) {
    const config_setting_t *stranger = config_setting_get_member(group->node.setting, near);
    gv_conf_fail((gv_conf_node){node.conf, stranger}, "unknown setting '%s'; did you mean '%s'?", near, key);
  } else
    gv_conf_fail(group->node, "'%s' is missing; add %s", key, hint);
  return node;
}

// ---- values ---------------------------------------------------------------------------------------

static bool is_number(const config_setting_t *setting) {
  int type = config_setting_type(setting);
  return type == CONFIG_TYPE_INT || type == CONFIG_TYPE_INT64 || type == CONFIG_TYPE_FLOAT;
}

static double number_value(const config_setting_t *setting) {
  switch (config_setting_type(setting)) {
    case CONFIG_TYPE_INT: return config_setting_get_int(setting);
    case CONFIG_TYPE_INT64: return (double)config_setting_get_int64(setting);
    default: return config_setting_get_float(setting);
  }
}

static bool read_number(gv_conf_node node, const char *what, double min, double max, double *out) {
  if (!is_number(node.setting))
    return gv_conf_fail(node, "%s is no number; give one from %g to %g, without quotes", what, min, max);
  double value = number_value(node.setting);
  if (!isfinite(value))
    return gv_conf_fail(node, "%s is not finite; give a number from %g to %g", what, min, max);
  if (value < min || value > max)
    return gv_conf_fail(node, "%s is %g; give a number from %g to %g", what, value, min, max);
  *out = value;
  return true;
}

bool gv_conf_number(gv_conf_group *group, const char *key, double min, double max, double *out) {
  gv_conf_node node = gv_conf_find(group, key);
  char what[64];
  snprintf(what, sizeof what, "'%s'", key);
  return gv_conf_has(node) && read_number(node, what, min, max, out);
}

bool gv_conf_entry_integer(gv_conf_node node, int min, int max, const char *what, int *out) {
  double value = 0;
  if (!gv_conf_has(node) || !read_number(node, what, min, max, &value))
    return false;
  if (value != floor(value))
    return gv_conf_fail(node, "%s is %g; give a whole number", what, value);
  *out = (int)value;
  return true;
}

bool gv_conf_integer(gv_conf_group *group, const char *key, int min, int max, int *out) {
  char what[64];
  snprintf(what, sizeof what, "'%s'", key);
  return gv_conf_entry_integer(gv_conf_find(group, key), min, max, what, out);
}

bool gv_conf_bool(gv_conf_group *group, const char *key, bool *out) {
  gv_conf_node node = gv_conf_find(group, key);
  if (!gv_conf_has(node))
    return false;
  if (config_setting_type(node.setting) != CONFIG_TYPE_BOOL)
    return gv_conf_fail(node, "'%s' is neither true nor false; write one of them, without quotes", key);
  *out = config_setting_get_bool(node.setting) != 0;
  return true;
}

bool gv_conf_text(gv_conf_group *group, const char *key, char *out, size_t size) {
  gv_conf_node node = gv_conf_find(group, key);
  if (!gv_conf_has(node))
    return false;
  const char *text = config_setting_get_string(node.setting);
  if (!text)
    return gv_conf_fail(node, "'%s' is no text; put it into double quotes", key);
  if (strlen(text) >= size)
    return gv_conf_fail(node, "'%s' has %zu bytes; use at most %zu", key, strlen(text), size - 1);
  for (const char *c = text; *c; c++)
    if (iscntrl((unsigned char)*c))
      return gv_conf_fail(node, "'%s' holds a control character; remove it", key);
  memcpy(out, text, strlen(text) + 1);
  return true;
}

const char *gv_conf_long_text(gv_conf_group *group, const char *key) {
  gv_conf_node node = gv_conf_find(group, key);
  if (!gv_conf_has(node))
    return NULL;
  const char *text = config_setting_get_string(node.setting);
  if (!text)
    gv_conf_fail(node, "'%s' is no text; put it into double quotes", key);
  return text;
}

bool gv_conf_is_text(gv_conf_node node) {
  return gv_conf_has(node) && config_setting_get_string(node.setting);
}

int gv_conf_find_name(const gv_conf_names *names, const char *name, int none) {
  for (int i = names->from; i < names->count; i++)
    if (strcmp((const char *)names->entries + (size_t)i * names->size, name) == 0)
      return i;
  return none;
}

int gv_conf_reference(gv_conf_group *group, const char *key, const gv_conf_names *names, int none) {
  char name[GV_MAX_NAME] = "";
  gv_conf_node node = gv_conf_find(group, key);
  gv_conf_text(group, key, name, sizeof name);
  if (!gv_conf_has(node))
    return none;
  const int found = gv_conf_find_name(names, name, none);
  if (found == none)
    gv_conf_fail(node, "no %s is named \"%s\"; %s", names->what, name, names->mend);
  return found;
}

bool gv_conf_choice(gv_conf_group *group, const char *key, const char *const *names, int *out) {
  gv_conf_node node = gv_conf_find(group, key);
  if (!gv_conf_has(node))
    return false;
  const char *text = config_setting_get_string(node.setting);
  char list[128] = "";
  for (int i = 0; names[i]; i++) {
    if (text && strcmp(text, names[i]) == 0) {
      *out = i;
      return true;
    }
    size_t used = strlen(list);
    snprintf(list + used, sizeof list - used, "%s\"%s\"", i ? " or " : "", names[i]);
  }
  return gv_conf_fail(node, "'%s' is none of its choices; write %s", key, list);
}

int gv_conf_length(gv_conf_node node) {
  if (!gv_conf_has(node))
    return -1;
  if (!config_setting_is_array(node.setting) && !config_setting_is_list(node.setting))
    return -1;
  return config_setting_length(node.setting);
}

gv_conf_node gv_conf_entry(gv_conf_node node, int index) {
  return (gv_conf_node){node.conf, config_setting_get_elem(node.setting, (unsigned)index)};
}

static bool read_numbers(gv_conf_node node, const char *what, double min, double max, int count,
                         const char *shape, double *out) {
  int length = gv_conf_length(node);
  if (length < 0)
    return gv_conf_fail(node, "%s is no list of numbers; write %s", what, shape);
  if (length != count)
    return gv_conf_fail(node, "%s has %d number%s; write %d, %s", what, length, length == 1 ? "" : "s", count,
                        shape);
  double value[64];
  char entry[96];
  for (int i = 0; i < count; i++) {
    snprintf(entry, sizeof entry, "entry %d of %s", i + 1, what);
    if (!read_number(gv_conf_entry(node, i), entry, min, max, &value[i]))
      return false;
  }
  memcpy(out, value, sizeof value[0] * (size_t)count);
  return true;
}

bool gv_conf_numbers(gv_conf_group *group, const char *key, double min, double max, int count,
                     const char *shape, double *out) {
  gv_conf_node node = gv_conf_find(group, key);
  char what[64];
  snprintf(what, sizeof what, "'%s'", key);
  return gv_conf_has(node) && read_numbers(node, what, min, max, count, shape, out);
}

bool gv_conf_entry_numbers(gv_conf_node node, double min, double max, int count, const char *shape,
                           double *out) {
  return gv_conf_has(node) && read_numbers(node, "the entry", min, max, count, shape, out);
}
