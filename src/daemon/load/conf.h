// SPDX-License-Identifier: BSD-3-Clause
// Reading text files in libconfig's syntax so that a mistake gets one line: file, line, what, what to do.
//
// The first error sticks: after it every getter does nothing, so a reader is written straight down and
// asks gv_conf.failed once at the end. A getter leaves its output alone where the key is absent: what was
// there is the default. Keys are known by being asked for; gv_conf_leave refuses the others.
// Set-up only: reads files and takes memory from the heap.
#ifndef GLOVED_CONF_H
#define GLOVED_CONF_H

#include <stdbool.h>
#include <stddef.h>

enum { GV_CONF_KEYS = 40, GV_CONF_MAX_BYTES = 64 << 20 };

typedef struct gv_conf {
  void *config;      // the library's parsed file
  const char *path;  // the caller's
  char *err;
  size_t err_size;
  bool failed;  // err holds the reason
} gv_conf;

// One value in the file; setting null: absent.
typedef struct gv_conf_node {
  gv_conf *conf;
  const struct config_setting_t *setting;
} gv_conf_node;

// A { } group (or the whole file) being read.
typedef struct gv_conf_group {
  gv_conf_node node;
  const char *key[GV_CONF_KEYS];  // asked for so far
  int key_count;
} gv_conf_group;

// Parse the file. On an error the file is closed, err written and false returned.
bool gv_conf_open(gv_conf *conf, const char *path, char *err, size_t err_size);
// The same for text that is no file; `name` stands in messages.
bool gv_conf_open_text(gv_conf *conf, const char *name, const char *text, char *err, size_t err_size);
void gv_conf_close(gv_conf *conf);
// Refuse the file at this value (null setting: at the file as a whole). The first error wins. Returns false.
bool gv_conf_fail(gv_conf_node at, const char *format, ...) __attribute__((format(printf, 2, 3)));

// The file as a group. `version` must be there and be 1.
gv_conf_group gv_conf_root(gv_conf *conf);
// Take a node as a group; refuses anything else than { }. what: "an object", for the message.
gv_conf_group gv_conf_as_group(gv_conf_node node, const char *what);
// The group below `key`; false where it is absent.
bool gv_conf_enter(gv_conf_group *group, const char *key, gv_conf_group *out);
// Refuse every key that nobody asked for, naming the nearest known one.
void gv_conf_leave(gv_conf_group *group);

// The node at `key`, absent or not; the key counts as known.
gv_conf_node gv_conf_find(gv_conf_group *group, const char *key);
// The same, refusing absence. hint: what to write, "mass = <kilograms>".
gv_conf_node gv_conf_need(gv_conf_group *group, const char *key, const char *hint);
static inline bool gv_conf_has(gv_conf_node node) { return node.setting && !node.conf->failed; }

// Typed getters. Numbers may be written as integers and must lie in [min, max]; true where a value was read.
bool gv_conf_number(gv_conf_group *group, const char *key, double min, double max, double *out);
bool gv_conf_integer(gv_conf_group *group, const char *key, int min, int max, int *out);
bool gv_conf_bool(gv_conf_group *group, const char *key, bool *out);
// Text of at most size - 1 bytes, no control characters.
bool gv_conf_text(gv_conf_group *group, const char *key, char *out, size_t size);
// The name of something that the file lists elsewhere. entries: structures whose first member is their name.
typedef struct gv_conf_names {
  const void *entries;
  size_t size;  // of one
  int from, count;
  const char *what, *mend;  // "no WHAT is named ...; MEND"
} gv_conf_names;
// Its number; `none` where there is none.
int gv_conf_find_name(const gv_conf_names *names, const char *name, int none);
// Of the name at `key`; `none` where the key is absent, or the file was refused.
int gv_conf_reference(gv_conf_group *group, const char *key, const gv_conf_names *names, int none);
// Text of any length, as it is; null where there is none. Valid until gv_conf_close.
const char *gv_conf_long_text(gv_conf_group *group, const char *key);
// Is it there, and text in quotes?
bool gv_conf_is_text(gv_conf_node node);
// One of `names` (null-terminated); the index goes to out.
bool gv_conf_choice(gv_conf_group *group, const char *key, const char *const *names, int *out);
// Exactly `count` numbers, [ ] or ( ). shape: "[x, y, z] in metres", for the message.
bool gv_conf_numbers(gv_conf_group *group, const char *key, double min, double max, int count,
                     const char *shape, double *out);

// Nodes without a key: entries of lists.
int gv_conf_length(gv_conf_node node);  // entries of [ ] or ( ); -1 for anything else
gv_conf_node gv_conf_entry(gv_conf_node node, int index);
bool gv_conf_entry_numbers(gv_conf_node node, double min, double max, int count, const char *shape,
                           double *out);
bool gv_conf_entry_integer(gv_conf_node node, int min, int max, const char *what, int *out);

#endif
