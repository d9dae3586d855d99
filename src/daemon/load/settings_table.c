// SPDX-License-Identifier: BSD-3-Clause
// One table says what a setting is (gloved/setting.h): here it is read from the file, checked by the same bounds, and
// compared with its default where that protects a person. Main thread, before the loop starts.
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
  if (gv_conf_choice(group, s->key, s->words, &word)) memcpy(at, &word, sizeof word);
}

static void read_row(gv_conf_group *group, const gv_setting *s, void *configuration) {
  void *at = (char *)configuration + s->offset;
  double number;
  int integer;
  switch (s->kind) {
    case GV_SETTING_NUMBER: gv_conf_number(group, s->key, s->min, s->max, at); return;
    case GV_SETTING_LENGTH:
      if (gv_conf_number(group, s->key, s->min, s->max, &number)) *(double *)at = gv_settings_metres(number);
      return;
    case GV_SETTING_FINGERS:
      gv_conf_numbers(group, s->key, s->min, s->max, GV_FINGERS, "[thumb, index, middle, ring, little]", at);
      return;
    case GV_SETTING_COUNT:
      if (gv_conf_integer(group, s->key, (int)s->min, (int)s->max, &integer)) *(unsigned *)at = (unsigned)integer;
      return;
    case GV_SETTING_INTEGER: gv_conf_integer(group, s->key, (int)s->min, (int)s->max, at); return;
    case GV_SETTING_BOOL: gv_conf_bool(group, s->key, at); return;
    case GV_SETTING_CHOICE: read_choice(group, s, at); return;
    case GV_SETTING_TEXT_OF: gv_conf_text(group, s->key, at, GV_SETTING_TEXT); return;
  }
}

void gv_settings_read_rows(gv_conf_group *group, const gv_setting rows[], int count, void *configuration) {
  for (int i = 0; i < count; i++) read_row(group, &rows[i], configuration);
}

// ---- laxer than the defaults ----------------------------------------------------------------------------

static void tell_laxer(const gv_setting rows[], int count, const void *configuration, const void *defaults, char *out, size_t size) {
  for (int i = 0; i < count; i++) {
    const size_t used = strlen(out);
    if (!gv_setting_laxer(&rows[i], configuration, defaults)) continue;
    snprintf(out + used, size - used, "%s%s.%s %g (%g)", used ? ", " : "", rows[i].group, rows[i].key,
             gv_setting_value(&rows[i], configuration), gv_setting_value(&rows[i], defaults));
  }
}

void gv_settings_laxer(const gv_limiter_config *limiter, const gv_safety_config *safety, char out[GV_LAXER_TEXT]) {
  const gv_limiter_config usual_limiter = gv_limiter_config_default();
  const gv_safety_config usual_safety = gv_safety_config_default();
  out[0] = '\0';
  tell_laxer(gv_limiter_settings, GV_LIMITER_SETTINGS, limiter, &usual_limiter, out, GV_LAXER_TEXT);
  tell_laxer(gv_safety_settings, GV_SAFETY_SETTINGS, safety, &usual_safety, out, GV_LAXER_TEXT);
}
