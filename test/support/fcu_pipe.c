// SPDX-License-Identifier: BSD-3-Clause
// The frame codec as a filter, for test_fcu.py. One answer per line of input:
//   glove|pose|status|command FIELDS   the frame as a candump line (fields in the order of the struct
//                                      in fcu.h)
//   classic KIND FIELDS                its frames on classic CAN, "111#...", in one line
//   (0.0) can0 110##1...               "glove FIELDS", or "refused: why"
//   join                               from here on classic frames are joined: "-" until the message is whole
//   sensors, fingers, states           the names in their order
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "gloved/drivers.h"
#include "gloved/fcu.h"
#include "gloved/safety.h"

enum { FIELDS_MAX = 32 };

static void pack(const char *kind, const double *v, gv_frame *out) {
  gv_glove_msg g = {(uint8_t)v[0], (uint8_t)v[1], (uint32_t)v[2], (uint32_t)v[3], {0}};
  gv_pose_msg p = {g.counter, g.flags,       g.stamp_us,
                   g.age_us,  (uint8_t)v[4], {{v[8], v[9], v[10], v[11]}, {v[5], v[6], v[7]}}};
  gv_status_msg s = {g.counter, g.flags, g.stamp_us, (uint8_t)v[3], (uint8_t)v[4], {0}, (uint16_t)v[10]};
  gv_command_msg c = {g.counter, g.flags, g.stamp_us, g.age_us, {0}, (uint16_t)v[9]};
  for (int i = 0; i < GV_SENSORS; i++)
    g.raw[i] = (uint16_t)v[4 + i];
  for (int i = 0; i < GV_FINGERS; i++) {
    s.tension_n[i] = v[5 + i];
    c.tension_n[i] = v[4 + i];
  }
  if (strcmp(kind, "glove") == 0)
    gv_fcu_pack_glove(&g, out);
  else if (strcmp(kind, "pose") == 0)
    gv_fcu_pack_pose(&p, out);
  else if (strcmp(kind, "status") == 0)
    gv_fcu_pack_status(&s, out);
  else
    gv_fcu_pack_command(&c, out);
}

static void print_classic(const gv_frame *f) {
  gv_frame part[GV_CLASSIC_FRAMES];
  const int count = gv_classic_split(f, part);
  for (int i = 0; i < count; i++) {
    printf("%03X#", part[i].id);
    for (int k = 0; k < part[i].len; k++)
      printf("%02x", part[i].data[k]);
    printf(" ");
  }
  printf("\n");
}

static void encode(const char *line) {
  char kind[16], text[GV_LOG_LINE_MAX + 1];
  const bool classic = strncmp(line, "classic ", 8) == 0;
  if (classic)
    line += 8;
  double v[FIELDS_MAX] = {0};
  int at = 0;
  if (sscanf(line, "%15s%n", kind, &at) != 1)
    return;
  char *next = NULL;
  for (int i = 0; i < FIELDS_MAX; i++, line = next, at = 0) {
    v[i] = strtod(line + at, &next);
    if (next == line + at)
      break;
  }
  gv_frame f = {0};
  pack(kind, v, &f);
  if (classic) {
    print_classic(&f);
    return;
  }
  gv_log_format(&f, "can0", text);
  fputs(text, stdout);
}

static void print_tensions(const double *tension_n) {
  for (int i = 0; i < GV_FINGERS; i++)
    printf(" %.17g", tension_n[i]);
}

// The message that the identifier stands for; the error where it is none.
static gv_fcu_error print_message(const gv_frame *f) {
  gv_glove_msg g;
  gv_pose_msg p;
  gv_status_msg s;
  gv_command_msg c;
  gv_fcu_error error = GV_FCU_WRONG_ID;
  if (f->id == GV_ID_GLOVE && (error = gv_fcu_unpack_glove(f, &g)) == 0) {
    printf("glove %u %u %u %u", g.counter, g.flags, g.stamp_us, g.age_us);
    for (int i = 0; i < GV_SENSORS; i++)
      printf(" %u", g.raw[i]);
  } else if (f->id == GV_ID_POSE && (error = gv_fcu_unpack_pose(f, &p)) == 0) {
    gv_pose T = p.T_world_receiver;
    printf("pose %u %u %u %u %u %.17g %.17g %.17g %.17g %.17g %.17g %.17g", p.counter, p.flags, p.stamp_us,
           p.age_us, p.receiver, T.p.x, T.p.y, T.p.z, T.q.w, T.q.x, T.q.y, T.q.z);
  } else if (f->id == GV_ID_STATUS && (error = gv_fcu_unpack_status(f, &s)) == 0) {
    printf("status %u %u %u %u %u", s.counter, s.flags, s.stamp_us, s.command_counter, s.mode);
    print_tensions(s.tension_n);
    printf(" %u", s.bad_commands);
  } else if (f->id == GV_ID_FORCE_COMMAND && (error = gv_fcu_unpack_command(f, &c)) == 0) {
    printf("command %u %u %u %u", c.counter, c.flags, c.sample_stamp_us, c.age_us);
    print_tensions(c.tension_n);
    printf(" %u", c.frames_taken);
  }
  return error;
}

static void decode(const char *line, gv_classic_join *join) {
  gv_frame f, whole;
  char err[120];
  gv_fcu_error error = GV_FCU_OK;
  if (gv_log_parse(line, &f, err, sizeof err))
    printf("refused: %s\n", err);
  else if (join && !gv_classic_take(join, &f, &whole))
    printf("-\n");
  else if ((error = print_message(join ? &whole : &f)) != GV_FCU_OK)
    printf("refused: %s\n", gv_fcu_error_text(error));
  else
    printf("\n");
}

int main(void) {
  char line[1000];
  static gv_classic_join join;
  bool joining = false;
  while (fgets(line, sizeof line, stdin)) {
    line[strcspn(line, "\n")] = 0;
    if (line[0] == '(')
      decode(line, joining ? &join : NULL);
    else if (strcmp(line, "join") == 0) {
      joining = true;
      printf("join\n");
    } else if (strcmp(line, "states") == 0) {
      for (int i = 0; i <= GV_SAFETY_STOPPED; i++)
        printf("%s ", gv_safety_name((gv_safety_state)i));
      printf("\n");
    } else if (strcmp(line, "sensors") == 0 || strcmp(line, "fingers") == 0) {
      for (int i = 0; i < (line[0] == 's' ? GV_SENSORS : GV_FINGERS); i++)
        printf("%s ", line[0] == 's' ? gv_sensor_name(i) : gv_finger_name(i));
      printf("\n");
    } else
      encode(line);
  }
  return 0;
}
