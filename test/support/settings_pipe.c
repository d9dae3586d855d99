// SPDX-License-Identifier: BSD-3-Clause
// The one table of settings as lines of tab-separated fields, for tools/doc_pages.py and its
// test: group, key, kind, default, least, most, laxer (0 never, 1 above the default, 2
// below), words of a choice, sentence.
#include <stdio.h>

#include "daemon/load/settings_table.h"

static void print_row(const gv_setting *s, const void *configuration) {
  static const char *const kind[] = {"number",  "mm",   "fingers", "integer",
                                     "integer", "bool", "choice",  "text"};
  char value[GV_SETTINGS_VALUE];
  gv_settings_value_text(s, configuration, value);
  printf("%s\t%s\t%s\t%s\t%.9g\t%.9g\t%d\t", s->group, s->key, kind[s->kind], value, s->min, s->max,
         (int)s->laxer);
  for (int i = 0; s->words && s->words[i]; i++)
    printf("%s\"%s\"", i ? ", " : "", s->words[i]);
  putchar('\t');
  for (const char *c = s->sentence; *c; c++)
    putchar(*c == '\n' ? ' ' : *c);
  putchar('\n');
}

int main(void) {
  static const char *const groups[] = {
    "",        "realtime", "filter",   "finger",  "coupling", "coupling.limb", "coupling.palm",
    "contact", "solver",   "override", "limiter", "safety",   "passivity"};
  static gv_settings settings;
  gv_settings_default(&settings);
  for (size_t i = 0; i < sizeof groups / sizeof *groups; i++) {
    int at = 0;
    for (gv_settings_row row = gv_settings_next(groups[i], &settings, &at); row.setting;
         row = gv_settings_next(groups[i], &settings, &at))
      print_row(row.setting, row.configuration);
  }
  return 0;
}
