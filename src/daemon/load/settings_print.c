// SPDX-License-Identifier: BSD-3-Clause
// The documented configuration, data/gloved.conf: what the tables of settings say (settings_table.h), in the
// order in which a reader meets it, and the hand's measures and poses. Set-up only.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "daemon/load/settings_table.h"

enum { COMMENT_COLUMN = 24, LINE = GV_SETTINGS_VALUE };

// The shortest text that reads as the same number, always as one with a point or an exponent.
static void number_text(double value, char out[40]) {
  for (int digits = 6; digits <= 17; digits++) {
    snprintf(out, 40, "%.*g", digits, value);
    if (strtod(out, NULL) == value)
      break;
  }
  if (!strpbrk(out, ".en"))
    strcat(out, ".0");
}

void gv_settings_value_text(const gv_setting *s, const void *configuration, char out[GV_SETTINGS_VALUE]) {
  const char *at = (const char *)configuration + s->offset;
  char number[40];
  switch (s->kind) {
    case GV_SETTING_NUMBER:
    case GV_SETTING_LENGTH:
      number_text(gv_setting_value(s, configuration), number);
      snprintf(out, GV_SETTINGS_VALUE, "%s", number);
      return;
    case GV_SETTING_FINGERS:
      snprintf(out, GV_SETTINGS_VALUE, "[");
      for (int i = 0; i < GV_FINGERS; i++) {
        number_text(((const double *)(const void *)at)[i], number);
        snprintf(out + strlen(out), GV_SETTINGS_VALUE - strlen(out), "%s%s", i ? ", " : "", number);
      }
      snprintf(out + strlen(out), GV_SETTINGS_VALUE - strlen(out), "]");
      return;
    case GV_SETTING_COUNT:
    case GV_SETTING_INTEGER:
      snprintf(out, GV_SETTINGS_VALUE, "%.0f", gv_setting_value(s, configuration));
      return;
    case GV_SETTING_BOOL:
      snprintf(out, GV_SETTINGS_VALUE, "%s", *(const bool *)(const void *)at ? "true" : "false");
      return;
    case GV_SETTING_CHOICE:
      snprintf(out, GV_SETTINGS_VALUE, "\"%s\"", s->words[*(const int *)(const void *)at]);
      return;
    case GV_SETTING_TEXT_OF: snprintf(out, GV_SETTINGS_VALUE, "\"%s\"", at); return;
  }
}

// "  key = value;        # sentence", the sentence's further lines below its first.
static void print_line(FILE *out, int indent, const char *code, const char *sentence) {
  fprintf(out, "%*s%s", indent, "", code);
  for (int column = indent + (int)strlen(code); *sentence; column = 0) {
    const int length = (int)strcspn(sentence, "\n");
    const int gap = COMMENT_COLUMN - column;
    fprintf(out, "%*s# %.*s", gap > 1 ? gap : 1, "", length, sentence);
    sentence += length;
    if (*sentence == '\n') {
      sentence++;
      fputc('\n', out);
    }
  }
  fputc('\n', out);
}

static void print_rows(FILE *out, int indent, const char *group, gv_settings *settings) {
  int at = 0;
  for (gv_settings_row row = gv_settings_next(group, settings, &at); row.setting;
       row = gv_settings_next(group, settings, &at)) {
    char value[LINE], code[LINE + 64];
    gv_settings_value_text(row.setting, row.configuration, value);
    snprintf(code, sizeof code, "%s = %s;", row.setting->key, value);
    print_line(out, indent, code, row.setting->sentence);
  }
}

static void print_group(FILE *out, const char *group, const char *before, const char *opening,
                        gv_settings *settings) {
  char code[64];
  snprintf(code, sizeof code, "%s = {", group);
  fprintf(out, "\n%s", before);
  print_line(out, 0, code, opening);
  print_rows(out, 2, group, settings);
  if (strcmp(group, "coupling") == 0) {
    fputs("  limb = {\n", out);
    print_rows(out, 4, "coupling.limb", settings);
    fputs("  };\n  palm = {\n", out);
    print_rows(out, 4, "coupling.palm", settings);
    fputs("  };\n", out);
  }
  fputs("};\n", out);
}

// ---- the hand and poses ----------------------------------------------------------------------------------

static void list_text(const double value[], int count, double factor, char out[LINE]) {
  snprintf(out, LINE, "[");
  for (int i = 0; i < count; i++)  // a tenth of a millimetre or degree is more than anybody measures
    snprintf(out + strlen(out), LINE - strlen(out), "%s%.1f", i ? ", " : "", value[i] * factor);
  snprintf(out + strlen(out), LINE - strlen(out), "]");
}

static void print_fingers(FILE *out, const char *key, const double value[GV_FINGERS][3], const char *sentence,
                          bool named) {
  static const char *const finger[GV_FINGERS] = {"thumb", "index", "middle", "ring", "little"};
  char text[LINE], code[LINE + 64];
  snprintf(code, sizeof code, "%s = (", key);
  print_line(out, 2, code, sentence);
  for (int i = 0; i < GV_FINGERS; i++) {
    list_text(value[i], 3, 1e3, text);
    snprintf(code, sizeof code, "%s%s", text, i + 1 < GV_FINGERS ? "," : "");
    print_line(out, 4, code, named ? finger[i] : "");
  }
  fputs("  );\n", out);
}

static void print_hand(FILE *out, const gv_hand_model *hand) {
  char text[LINE], code[LINE + 64];
  double base[GV_FINGERS][3];
  for (int i = 0; i < GV_FINGERS; i++)
    memcpy(base[i], (const double[]){hand->base_m[i].x, hand->base_m[i].y, hand->base_m[i].z},
           sizeof base[i]);
  fputs("\n# Measures of the person's hand. The frame of the wrist, right hand palm down: x towards the "
        "fingertips,\n"
        "# y towards the thumb, z out of the back of the hand. A left hand is given by the same "
        "numbers.\nhand = {\n",
        out);
  print_line(out, 2, "side = \"right\";", "or \"left\"");
  print_fingers(out, "segment_mm", hand->segment_m, "bones from the first joint to the tip", true);
  print_fingers(out, "radius_mm", hand->radius_m, "half the thickness of each segment", false);
  print_fingers(out, "base_mm", (const double (*)[3])base, "first joint of each finger, from the wrist",
                false);
  list_text(&(const double[]){hand->palm_center_m.x, hand->palm_center_m.y, hand->palm_center_m.z}[0], 3, 1e3,
            text);
  fprintf(out, "  palm_center_mm = %s;\n", text);
  list_text(&(const double[]){hand->palm_half_m.x, hand->palm_half_m.y, hand->palm_half_m.z}[0], 3, 1e3,
            text);
  snprintf(code, sizeof code, "palm_half_mm = %s;", text);
  print_line(out, 2, code, "half edges of the box inside the palm,");
  snprintf(code, sizeof code, "palm_radius_mm = %.1f;", hand->palm_radius_m * 1e3);
  print_line(out, 2, code, "rounded by this radius");
  print_line(out, 2, "limits_deg = {", "joint angles are held inside: [least, most]");
  for (int i = 0; i < GV_SENSORS; i++) {
    list_text(&(const double[]){hand->angle_min_rad[i], hand->angle_max_rad[i]}[0], 2, 180.0 / GV_PI, text);
    fprintf(out, "    %s = %s;\n", gv_sensor_name(i), text);
  }
  fputs("  };\n};\n", out);
}

static void print_pose(FILE *out, const char *key, const char *before, const gv_pose *pose,
                       const char *orientation) {
  char p[LINE], q[LINE], code[LINE + 64];
  list_text(&(const double[]){pose->p.x, pose->p.y, pose->p.z}[0], 3, 1e3, p);
  list_text(&(const double[]){pose->q.w, pose->q.x, pose->q.y, pose->q.z}[0], 4, 1.0, q);
  fprintf(out, "\n%s%s = {\n  position_mm = %s;\n", before, key, p);
  snprintf(code, sizeof code, "orientation = %s;", q);
  print_line(out, 2, code, orientation);
  fputs("};\n", out);
}

// ---- all of it -------------------------------------------------------------------------------------------

int gv_settings_print(FILE *out) {
  gv_settings s;
  gv_settings_default(&s);
  fputs("# Every setting of gloved, at its default: this file changes nothing (gloved --print-config writes "
        "it). Copy it, delete\n"
        "# what you do not need, and start `gloved --config FILE`. What is left out keeps its default (or "
        "the preset's value);\n"
        "# options of the command line win over this file. Paths are relative to the directory that gloved "
        "is started in.\n"
        "# Inside one pair of [ ] write all numbers with a decimal point, or none.\n\nversion = 1;\n\n",
        out);
  print_line(out, 0, "preset = \"default\";",
             "\"stock\": the same on the packages as they come, ODE's solvers and libccd; \"paper\":\n"
             "those with Tables 1 and 2 of the paper (DESIGN.md says in which reading). The settings\nbelow "
             "go on top");
  print_rows(out, 0, "", &s);
  print_group(out, "realtime", "", "", &s);
  print_hand(out, &s.engine.hand);
  print_pose(out, "receiver",
             "# The wrist joint seen from the tracker's receiver: where the receiver is mounted. receiver2 = "
             "{ ... }; is the "
             "second\n# hand's; left out, it is the mirror of this one.\n",
             &s.engine.T_receiver_wrist, "quaternion w, x, y, z");
  print_pose(out, "tracker_to_world",
             "# For a tracker of its own (--tracker): its transmitter in the world, whose z points up. By "
             "default it stands\n"
             "# upright in the origin and its cable leaves towards -x: the axes of a FASTRAK are then x "
             "forward, y right, z down.\n",
             &s.T_world_tracker, "quaternion w, x, y, z: half a turn about x");
  print_group(out, "filter", "# What becomes of the samples before the hand follows them.\n", "", &s);
  print_group(out, "finger", "# The user's fingers, as a tension bends them.\n", "", &s);
  print_group(
      out, "coupling",
      "# Spring and damper between the measured hand and the simulated one (Eqn 1 and 2 of the paper).\n", "",
      &s);
  print_group(out, "contact", "", "", &s);
  print_group(out, "solver", "", "solver = \"newton\"; is short for solver = { method = \"newton\"; };", &s);
  print_group(out, "override",
              "# In place of what the scene says (the paper's Table 1); 0 or false: as the scene says.\n", "",
              &s);
  print_group(out, "limiter",
              "# The last gate of every force. Lower these for a first try with a new device.\n", "", &s);
  print_group(out, "safety",
              "# What ends in a fault, with forces ramped to zero until the dead-man switch was let go.\n",
              "", &s);
  print_group(out, "passivity",
              "# Energy at the tendons is watched in any case (energy_j of GLOVED_STATE); this damps a force "
              "that swings.\n",
              "", &s);
  return ferror(out) ? -1 : 0;
}
