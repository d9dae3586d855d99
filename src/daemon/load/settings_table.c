// SPDX-License-Identifier: BSD-3-Clause
// One table says what a setting is (gloved/setting.h): here it is read from the file, checked by the same
// bounds, and compared with its default where that protects a person. Main thread, before the loop starts.
#include "daemon/load/settings_table.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// Shifts the decimal point, so that 40.3 mm becomes the very number that 0.0403 m is (40.3 / 1000 does not).
double gv_settings_metres(double mm) {
  char text[40];
  snprintf(text, sizeof text, "%.12fe-3", mm);
  return strtod(text, NULL);
}

static void read_choice(gv_conf_group *group, const gv_setting *s, void *at) {
  int word;
  if (gv_conf_choice(group, s->key, s->words, &word))
    memcpy(at, &word, sizeof word);
}

static void read_row(gv_conf_group *group, const gv_setting *s, void *configuration) {
  void *at = (char *)configuration + s->offset;
  double number;
  int integer;
  switch (s->kind) {
    case GV_SETTING_NUMBER: gv_conf_number(group, s->key, s->min, s->max, at); return;
    case GV_SETTING_LENGTH:
      if (gv_conf_number(group, s->key, s->min, s->max, &number))
        *(double *)at = gv_settings_metres(number);
      return;
    case GV_SETTING_FINGERS:
      gv_conf_numbers(group, s->key, s->min, s->max, GV_FINGERS, "[thumb, index, middle, ring, little]", at);
      return;
    case GV_SETTING_COUNT:
      if (gv_conf_integer(group, s->key, (int)s->min, (int)s->max, &integer))
        *(unsigned *)at = (unsigned)integer;
      return;
    case GV_SETTING_INTEGER: gv_conf_integer(group, s->key, (int)s->min, (int)s->max, at); return;
    case GV_SETTING_BOOL: gv_conf_bool(group, s->key, at); return;
    case GV_SETTING_CHOICE: read_choice(group, s, at); return;
    case GV_SETTING_TEXT_OF: gv_conf_text(group, s->key, at, GV_SETTING_TEXT); return;
  }
}

// ---- all tables ------------------------------------------------------------------------------------------

#define PROCESS(group, key, kind, member, min, max, sentence)                                                \
  {group, key, kind, offsetof(gv_settings, member), min, max, GV_LAXER_NEVER, NULL, sentence}

// The daemon's own; those of engine, limiter and safety machine stand in their rooms.
static const gv_setting process[] = {
  PROCESS("", "scene", GV_SETTING_TEXT_OF, scene, 0, 0, ""),
  PROCESS("", "fcu", GV_SETTING_TEXT_OF, fcu, 0, 0,
          "sim: | hand: | trace:FILE | udp://HOST:PORT?listen=PORT | can:IFACE |\n"
          "serial:DEVICE?type=cyberglove|lucidglove|doglove"),
  PROCESS("", "tracker", GV_SETTING_TEXT_OF, tracker, 0, 0,
          "empty: the wrist's pose comes with the fcu; serial:DEVICE?type=fastrak"),
  PROCESS("", "fcu2", GV_SETTING_TEXT_OF, fcu2, 0, 0,
          "device of a second hand, the other side's, in the same world; empty: one hand"),
  PROCESS("", "tracker2", GV_SETTING_TEXT_OF, tracker2, 0, 0, "of the second hand, as tracker"),
  PROCESS("", "lcm", GV_SETTING_TEXT_OF, lcm, 0, 0,
          "ttl=0 stays on this machine; \"none\": publish nothing; LCM_DEFAULT_URL replaces the default"),
  PROCESS("", "black_box", GV_SETTING_TEXT_OF, black_box, 0, 0,
          "folder for the ten seconds before a fault; empty: the state directory; \"none\":\n"
          "they are not kept"),
  PROCESS("", "calibration", GV_SETTING_TEXT_OF, calibration, 0, 0,
          "file with two points per sensor (data/calibration/default.cal); empty: the same values"),
  PROCESS("", "calibration2", GV_SETTING_TEXT_OF, calibration2, 0, 0,
          "of the second hand's glove, as calibration"),
  PROCESS("", "rate_hz", GV_SETTING_NUMBER, rate_hz, 100, 10000,
          "periods of the loop per second; 100 to 10000"),
  PROCESS("realtime", "cpu", GV_SETTING_INTEGER, cpu, -1, 1023,
          "core that the loop is pinned to; -1: the last one, where there are several"),
  PROCESS("realtime", "priority", GV_SETTING_INTEGER, rt_priority, 0, 99,
          "SCHED_FIFO, 1 to 99; 0: ordinary scheduling"),
  PROCESS("realtime", "mlock", GV_SETTING_BOOL, mlock, 0, 1, "keep all memory in RAM"),
  PROCESS("realtime", "cpu_dma_latency", GV_SETTING_BOOL, cpu_dma_latency, 0, 1,
          "processors stay out of deep sleep while gloved runs: wakes sooner, takes more power"),
  PROCESS("realtime", "strict", GV_SETTING_BOOL, strict, 0, 1,
          "a system call that the real-time thread does not need ends the program (--strict)"),
  PROCESS("realtime", "operations_per_s", GV_SETTING_NUMBER, operations_per_s, 0, 1e11,
          "of collision detection, as a summary tells them; 0: measured at the start, in a\n"
          "replay 3e8"),
  PROCESS("realtime", "sync_device", GV_SETTING_BOOL, sync_device, 0, 1,
          "a step begins with the glove's frame (--sync device) and not by the loop's own clock"),
};

enum { PROCESS_SETTINGS = sizeof process / sizeof process[0], TABLES = 5 };

gv_settings_row gv_settings_next(const char *group, gv_settings *settings, int *io_at) {
  const struct {
    const gv_setting *rows;
    int count;
    void *configuration;
  } table[TABLES] = {
    {process, PROCESS_SETTINGS, settings},
    {gv_engine_settings, GV_ENGINE_SETTINGS, &settings->engine},
    {gv_limiter_settings, GV_LIMITER_SETTINGS, &settings->limiter},
    {gv_safety_settings, GV_SAFETY_SETTINGS, &settings->safety},
    {gv_passivity_settings, GV_PASSIVITY_SETTINGS, &settings->passivity},
  };
  for (int t = 0, before = 0; t < TABLES; before += table[t++].count)
    for (; *io_at - before < table[t].count; ++*io_at) {
      const gv_setting *row = &table[t].rows[*io_at - before];
      if (strcmp(row->group, group) != 0)
        continue;
      ++*io_at;
      return (gv_settings_row){row, table[t].configuration};
    }
  return (gv_settings_row){NULL, NULL};
}

void gv_settings_read_group(gv_conf_group *open, const char *group, gv_settings *out) {
  int at = 0;
  for (gv_settings_row row = gv_settings_next(group, out, &at); row.setting;
       row = gv_settings_next(group, out, &at))
    read_row(open, row.setting, row.configuration);
}

static void read_spring(gv_conf_group *coupling, const char *key, const char *group, gv_settings *out) {
  gv_conf_group spring;
  if (!gv_conf_enter(coupling, key, &spring))
    return;
  gv_settings_read_group(&spring, group, out);
  gv_conf_leave(&spring);
}

void gv_settings_read_groups(gv_conf_group *root, gv_settings *out) {
  static const char *const groups[] = {"realtime", "filter",   "finger",  "coupling", "contact",
                                       "solver",   "override", "limiter", "safety",   "passivity"};
  for (size_t i = 0; i < sizeof groups / sizeof *groups; i++) {
    gv_conf_group group;
    if (gv_conf_is_text(gv_conf_find(root, groups[i])) && strcmp(groups[i], "solver") == 0)
      continue;
    if (!gv_conf_enter(root, groups[i], &group))
      continue;
    gv_settings_read_group(&group, groups[i], out);
    if (strcmp(groups[i], "coupling") == 0) {
      read_spring(&group, "limb", "coupling.limb", out);
      read_spring(&group, "palm", "coupling.palm", out);
    }
    gv_conf_leave(&group);
  }
}

int gv_settings_set_word(const char *group, const char *key, gv_config *out, const char *word) {
  for (int i = 0; i < GV_ENGINE_SETTINGS; i++) {
    const gv_setting *s = &gv_engine_settings[i];
    if (strcmp(s->group, group) != 0 || strcmp(s->key, key) != 0)
      continue;
    for (int w = 0; s->words[w]; w++) {
      if (strcmp(s->words[w], word) != 0)
        continue;
      memcpy((char *)out + s->offset, &w, sizeof w);
      return 0;
    }
  }
  return -1;
}

// ---- laxer than the defaults ----------------------------------------------------------------------------

static void tell_laxer(const gv_setting rows[], int count, const void *configuration, const void *defaults,
                       char *out, size_t size) {
  for (int i = 0; i < count; i++) {
    const size_t used = strlen(out);
    if (!gv_setting_laxer(&rows[i], configuration, defaults))
      continue;
    snprintf(out + used, size - used, "%s%s.%s %g (%g)", used ? ", " : "", rows[i].group, rows[i].key,
             gv_setting_value(&rows[i], configuration), gv_setting_value(&rows[i], defaults));
  }
}

void gv_settings_laxer(const gv_limiter_config *limiter, const gv_safety_config *safety,
                       const gv_passivity_config *passivity, char out[GV_LAXER_TEXT]) {
  const gv_limiter_config usual_limiter = gv_limiter_config_default();
  const gv_safety_config usual_safety = gv_safety_config_default();
  const gv_passivity_config usual_passivity = gv_passivity_config_default();
  out[0] = '\0';
  tell_laxer(gv_limiter_settings, GV_LIMITER_SETTINGS, limiter, &usual_limiter, out, GV_LAXER_TEXT);
  tell_laxer(gv_safety_settings, GV_SAFETY_SETTINGS, safety, &usual_safety, out, GV_LAXER_TEXT);
  tell_laxer(gv_passivity_settings, GV_PASSIVITY_SETTINGS, passivity, &usual_passivity, out, GV_LAXER_TEXT);
}
