// SPDX-License-Identifier: BSD-3-Clause
// A setting that a user may change: where it lies, its unit, its hard bounds, and what it is, in one row.
// Each room keeps the rows of its own configuration; the loader, the checks and the text of data/gloved.conf
// come from them. The default is what the room's gv_..._default function says. Pure.
#ifndef GLOVED_SETTING_H
#define GLOVED_SETTING_H

#include <stdbool.h>
#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef enum gv_setting_kind {
  GV_SETTING_NUMBER,   // double
  GV_SETTING_LENGTH,   // double in metres, millimetres in the file
  GV_SETTING_FINGERS,  // double[5], thumb to little finger
  GV_SETTING_COUNT,    // unsigned
  GV_SETTING_INTEGER,  // int
  GV_SETTING_BOOL,
  GV_SETTING_CHOICE,  // enumeration; its words
  GV_SETTING_TEXT_OF  // char[GV_SETTING_TEXT]
} gv_setting_kind;

// Which side of the default gives a person less protection; nobody may pass the bounds, and who passes the
// default on this side is told so at every start.
typedef enum gv_laxer { GV_LAXER_NEVER, GV_LAXER_ABOVE, GV_LAXER_BELOW } gv_laxer;

typedef struct gv_setting {
  const char *group;  // of the file, "coupling.limb"; "": the top
  const char *key;
  gv_setting_kind kind;
  size_t offset;    // in the room's configuration
  double min, max;  // hard bounds, in the file's unit
  gv_laxer laxer;
  const char *const *words;  // of a choice, null-terminated
  const char *sentence;      // unit and meaning, as the file says it
} gv_setting;

// The value of a number, length, count or integer in `configuration`, in the file's unit; of fingers the one
// that lies farthest on the laxer side.
double gv_setting_value(const gv_setting *setting, const void *configuration);
// Whether all of it lies within the bounds (what is not finite does not). True for what is no number.
bool gv_setting_sound(const gv_setting *setting, const void *configuration);
bool gv_setting_laxer(const gv_setting *setting, const void *configuration, const void *defaults);

#ifdef __cplusplus
}
#endif

#endif
