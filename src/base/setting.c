// SPDX-License-Identifier: BSD-3-Clause
// Values of settings against their bounds and defaults (setting.h). Pure; any thread.
#include "gloved/setting.h"

#include <assert.h>
#include <math.h>
#include <string.h>

enum { FINGERS = 5 };

// The i-th of several numbers that stand in one setting.
static double number_at(const gv_setting *s, const void *configuration, int i) {
  assert(i >= 0 && i < (s->kind == GV_SETTING_FINGERS ? FINGERS : 1));
  const char *at = (const char *)configuration + s->offset;
  double number = 0.0;
  unsigned count = 0;
  int integer = 0;
  switch (s->kind) {
    case GV_SETTING_NUMBER:
    case GV_SETTING_FINGERS:
    case GV_SETTING_LENGTH:
      memcpy(&number, at + (size_t)i * sizeof number, sizeof number);
      return s->kind == GV_SETTING_LENGTH ? number * 1e3 : number;
    case GV_SETTING_COUNT: memcpy(&count, at, sizeof count); return count;
    case GV_SETTING_INTEGER: memcpy(&integer, at, sizeof integer); return integer;
    case GV_SETTING_BOOL:
    case GV_SETTING_CHOICE:
    case GV_SETTING_TEXT_OF: break;
  }
  return 0.0;
}

static int numbers_of(const gv_setting *s) { return s->kind == GV_SETTING_FINGERS ? FINGERS : 1; }

static bool is_number(const gv_setting *s) {
  return s->kind != GV_SETTING_BOOL && s->kind != GV_SETTING_CHOICE && s->kind != GV_SETTING_TEXT_OF;
}

double gv_setting_value(const gv_setting *s, const void *configuration) {
  double value = number_at(s, configuration, 0);
  for (int i = 1; i < numbers_of(s); i++) {
    const double other = number_at(s, configuration, i);
    value = s->laxer == GV_LAXER_BELOW ? fmin(value, other) : fmax(value, other);
  }
  return value;
}

static bool is_word(const gv_setting *s, const void *configuration) {
  assert(s->words && s->words[0]);
  unsigned word, words = 0;
  memcpy(&word, (const char *)configuration + s->offset, sizeof word);
  while (s->words[words])
    words++;
  return word < words;
}

// A metre that became millimetres may be off by a last bit.
bool gv_setting_sound(const gv_setting *s, const void *configuration) {
  assert(s->min <= s->max);
  if (s->kind == GV_SETTING_CHOICE)
    return is_word(s, configuration);
  if (!is_number(s))
    return true;
  const double slack = s->kind == GV_SETTING_LENGTH ? 1e-12 * fabs(s->max) : 0.0;
  for (int i = 0; i < numbers_of(s); i++) {
    const double value = number_at(s, configuration, i);
    if (!(value >= s->min - slack && value <= s->max + slack))
      return false;
  }
  return true;
}

bool gv_setting_laxer(const gv_setting *s, const void *configuration, const void *defaults) {
  const double value = gv_setting_value(s, configuration);
  const double usual = gv_setting_value(s, defaults);
  switch (s->laxer) {
    case GV_LAXER_NEVER: return false;
    case GV_LAXER_ABOVE: return value > usual;
    case GV_LAXER_BELOW: return value < usual;
  }
  return false;
}
