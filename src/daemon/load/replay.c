// SPDX-License-Identifier: BSD-3-Clause
// Finds the scene that a recording was made on (replay.h): scenes are the same when their bytes are.
#include "daemon/load/replay.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

static bool is_same(const gv_about_file *a, const gv_about_file *b) { return a->hash == b->hash; }

static int refuse_other(const char *trace, const gv_about_file *recorded, const gv_about_file *chosen,
                        char *err, size_t err_size) {
  snprintf(err, err_size,
           "%s was recorded on the scene %s (%016" PRIx64 "), and %s (%016" PRIx64
           ") is another one; leave the scene out to "
           "replay on the recorded one, or move %s.about away",
           trace, recorded->name, recorded->hash, chosen->name, chosen->hash, trace);
  return -1;
}

static int choose(gv_settings *settings, bool chosen, const char *trace, const gv_about_file *recorded,
                  const char **out_text, char *err, size_t err_size) {
  gv_about_file here = {0};
  gv_about_read_file(chosen ? settings->scene : recorded->name, &here);
  const bool same = is_same(&here, recorded);
  free(here.text);
  if (chosen)
    return same ? 0 : refuse_other(trace, recorded, &here, err, err_size);
  if (same || recorded->text) {
    snprintf(settings->scene, sizeof settings->scene, "%s", recorded->name);
    *out_text = same ? NULL : recorded->text;
    return 0;
  }
  snprintf(err, err_size,
           "%s was recorded on the scene %s (%016" PRIx64
           "), which is not there any more, or has changed; get it back and give it "
           "as --scene in place of %s",
           trace, recorded->name, recorded->hash, settings->scene);
  return -1;
}

// A recording of two hands has two interfaces in one file: each hand gets its own.
static void choose_hands(gv_settings *settings, const char *trace, const gv_about *recorded) {
  char first[GV_ABOUT_IFACE], second[GV_ABOUT_IFACE];
  const char *speed = strstr(settings->fcu, "speed=0") ? "&speed=0" : "";
  if (!recorded->fcu2[0] || settings->fcu2[0] || strstr(settings->fcu, "iface="))
    return;
  gv_about_interfaces(recorded->fcu, recorded->fcu2, first, second);
  char file[GV_SETTING_TEXT];
  snprintf(file, sizeof file, "%s", trace);
  snprintf(settings->fcu, sizeof settings->fcu, "trace:%.200s?iface=%s%s", file, first, speed);
  snprintf(settings->fcu2, sizeof settings->fcu2, "trace:%.200s?iface=%s%s", file, second, speed);
  gv_settings_second(settings);
}

static void compare_settings(const gv_settings *settings, const gv_about *recorded, char out[300]) {
  const char *hand = settings->engine.hand.side == GV_LEFT ? "left" : "right";
  if (recorded->rate_hz > 0 && recorded->rate_hz != settings->rate_hz)
    snprintf(out, 300, "recorded at %g Hz, replayed at %g Hz: the result will differ; give --rate %g",
             recorded->rate_hz, settings->rate_hz, recorded->rate_hz);
  else if (recorded->hand[0] && strcmp(recorded->hand, hand) != 0)
    snprintf(out, 300, "recorded with a %s hand, replayed with a %s one; set hand.side in --config",
             recorded->hand, hand);
}

int gv_replay_scene(gv_settings *settings, bool scene_chosen, gv_about *recorded, const char **out_text,
                    char out_warning[300], char *err, size_t err_size) {
  char trace[GV_SETTING_TEXT];
  *out_text = NULL;
  out_warning[0] = '\0';
  if (strncmp(settings->fcu, "trace:", 6) != 0)
    return 0;
  snprintf(trace, sizeof trace, "%s", settings->fcu + 6);
  trace[strcspn(trace, "?")] = '\0';
  const int there = gv_about_read(trace, recorded, err, err_size);
  if (there <= 0)
    return there;
  choose_hands(settings, trace, recorded);
  compare_settings(settings, recorded, out_warning);
  if (!recorded->scene.name[0])
    return 0;
  return choose(settings, scene_chosen, trace, &recorded->scene, out_text, err, err_size);
}
