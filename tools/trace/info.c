// SPDX-License-Identifier: BSD-3-Clause
// gloved-trace info: one pass over a log; per message how many, how often, what is missing or damaged, how
// old; and what the glove's samples look like (equal ones, jumps), through the default calibration.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "gloved/drivers.h"
#include "gloved/fcu.h"
#include "trace.h"

enum { KINDS = 5, OTHER = 4, AGES = 65536, BEHIND = 128 };
static const char *const kind_name[KINDS] = {"FORCE_COMMAND", "STATUS", "GLOVE", "POSE", "others"};
static const uint32_t kind_id[OTHER] = {GV_ID_FORCE_COMMAND, GV_ID_STATUS, GV_ID_GLOVE, GV_ID_POSE};
#define JUMP_RAD 0.3

typedef struct kind_info {
  uint64_t frames, refused, lost, behind;  // refused by the codec; counter gaps; counter steps
                                           // backwards or not at all
  uint8_t counter;
  bool counted;
  int64_t first_ns, last_ns, gap_max_ns;
  uint64_t ages[AGES];  // how often each age, in 10 us
  uint64_t aged;
} kind_info;

typedef struct info {
  kind_info kind[KINDS];
  gv_calibration cal;
  gv_glove_msg glove;  // the last sound one
  uint64_t pairs, equal, jumps;
  double jump_max_rad;
  int jump_sensor;
  int64_t jump_ns, first_ns, last_ns;
  uint64_t frames;
  gv_fcu_error refusal;  // the first
  int64_t refusal_ns;
} info;

static int kind_of(const gv_frame *frame) {
  int k = 0;
  while (k < OTHER && (frame->id != kind_id[k] || frame->flags & (GV_FRAME_EXTENDED | GV_FRAME_ERROR)))
    k++;
  return k;
}

static void count_counter(kind_info *k, uint8_t counter) {
  uint8_t gap = (uint8_t)(counter - k->counter - 1);
  if (k->counted && gap >= BEHIND)
    k->behind++;
  else if (k->counted)
    k->lost += gap;
  k->counter = counter;
  k->counted = true;
}

static void count_age(kind_info *k, uint32_t age_us) {
  k->ages[age_us / 10]++;
  k->aged++;
}

// Compare a glove sample with the one before.
static void compare_samples(info *in, const gv_glove_msg *msg, int64_t stamp_ns) {
  bool equal = true;
  bool jumped = false;
  for (int i = 0; i < GV_SENSORS; i++) {
    double before = gv_calibration_angle(&in->cal, i, in->glove.raw[i]);
    double step = fabs(gv_calibration_angle(&in->cal, i, msg->raw[i]) - before);
    equal = equal && step == 0;
    jumped = jumped || step > JUMP_RAD;
    if (step <= in->jump_max_rad)
      continue;
    in->jump_max_rad = step;
    in->jump_sensor = i;
    in->jump_ns = stamp_ns;
  }
  in->pairs++;
  in->equal += equal;
  in->jumps += jumped;
}

// Decode the frame into the statistics of its kind.
static gv_fcu_error count_message(info *in, int kind, const gv_frame *frame) {
  kind_info *k = &in->kind[kind];
  gv_glove_msg glove;
  gv_pose_msg pose;
  gv_status_msg status;
  gv_command_msg command;
  gv_fcu_error error = GV_FCU_OK;
  if (frame->id == GV_ID_GLOVE && (error = gv_fcu_unpack_glove(frame, &glove)) == GV_FCU_OK) {
    if (k->counted)
      compare_samples(in, &glove, frame->stamp_ns);
    in->glove = glove;
    count_age(k, glove.age_us);
  } else if (frame->id == GV_ID_POSE && (error = gv_fcu_unpack_pose(frame, &pose)) == GV_FCU_OK) {
    count_age(k, pose.age_us);
  } else if (frame->id == GV_ID_STATUS) {
    error = gv_fcu_unpack_status(frame, &status);
  } else if (frame->id == GV_ID_FORCE_COMMAND &&
             (error = gv_fcu_unpack_command(frame, &command)) == GV_FCU_OK) {
    count_age(k, command.age_us);
  }
  if (error == GV_FCU_OK)
    count_counter(k, frame->data[0]);
  return error;
}

static void count_frame(info *in, const gv_frame *frame) {
  int kind = kind_of(frame);
  kind_info *k = &in->kind[kind];
  if (in->frames++ == 0)
    in->first_ns = frame->stamp_ns;
  in->last_ns = frame->stamp_ns;
  if (k->frames++ == 0)
    k->first_ns = k->last_ns = frame->stamp_ns;
  if (frame->stamp_ns - k->last_ns > k->gap_max_ns)
    k->gap_max_ns = frame->stamp_ns - k->last_ns;
  k->last_ns = frame->stamp_ns;
  gv_fcu_error error = kind == OTHER ? GV_FCU_OK : count_message(in, kind, frame);
  if (error == GV_FCU_OK)
    return;
  k->refused++;
  if (in->refusal == GV_FCU_OK) {
    in->refusal = error;
    in->refusal_ns = frame->stamp_ns;
  }
}

// Age in ms that `share` of the frames do not exceed.
static double age_ms(const kind_info *k, double share) {
  uint64_t seen = 0;
  uint64_t want = (uint64_t)(share * (double)(k->aged - 1)) + 1;
  int age = 0;
  while (age < AGES - 1 && (seen += k->ages[age]) < want)
    age++;
  return age * 0.01;
}

static void print_kind(const info *in, int kind) {
  const kind_info *k = &in->kind[kind];
  if (k->frames == 0)
    return;
  double span_s = (double)(k->last_ns - k->first_ns) * 1e-9;
  char id[12] = "-";
  char age[64] = "-";
  if (kind < OTHER)
    snprintf(id, sizeof id, "%03X", kind_id[kind]);
  if (k->aged)
    snprintf(age, sizeof age, "%.2f / %.2f / %.2f", age_ms(k, 0), age_ms(k, 0.5), age_ms(k, 1));
  printf("%-4s %-14s %8llu %9.1f %11.3f %6llu %8llu %8llu   %s\n", id, kind_name[kind],
         (unsigned long long)k->frames, span_s > 0 ? (double)(k->frames - 1) / span_s : 0.0,
         (double)k->gap_max_ns * 1e-6, (unsigned long long)k->lost, (unsigned long long)k->behind,
         (unsigned long long)k->refused, age);
}

static void print_info(const info *in, const gv_log *log) {
  printf("%s: %llu frames in %.3f s, stamps %.6f to %.6f\n", log->path, (unsigned long long)in->frames,
         (double)(in->last_ns - in->first_ns) * 1e-9, (double)in->first_ns * 1e-9,
         (double)in->last_ns * 1e-9);
  printf("%-4s %-14s %8s %9s %11s %6s %8s %8s   %s\n", "id", "message", "frames", "rate Hz", "gap max ms",
         "lost", "behind", "refused", "age ms min / median / max");
  for (int k = 0; k < KINDS; k++)
    print_kind(in, k);
  if (in->pairs) {
    printf("glove: %.1f %% of the samples equal the one before, %llu jump by more than %.1f rad",
           100.0 * (double)in->equal / (double)in->pairs, (unsigned long long)in->jumps, JUMP_RAD);
    if (in->jump_max_rad > 0)
      printf("; largest step %.3f rad (%s at %.6f)", in->jump_max_rad, gv_sensor_name(in->jump_sensor),
             (double)in->jump_ns * 1e-9);
    printf("\n");
  }
  if (in->refusal)
    printf("first refused frame at %.6f: %s\n", (double)in->refusal_ns * 1e-9,
           gv_fcu_error_text(in->refusal));
  if (log->late)
    printf("%llu stamps step back by less than 10 ms: the larger one holds\n", (unsigned long long)log->late);
  if (log->truncated)
    printf("the recording broke off after line %llu: the rest was left out\n",
           (unsigned long long)log->line - 1);
}

int trace_info(int argc, char **argv) {
  if (argc != 2)
    return trace_fail(EXIT_BAD_INPUT, "info: give one FILE; see gloved-trace --help");
  gv_log log;
  gv_frame frame;
  char err[400];
  if (gv_log_open(&log, argv[1], err, sizeof err))
    return trace_fail(EXIT_BAD_INPUT, "%s", err);
  info *in = calloc(1, sizeof *in);
  if (!in)
    return trace_fail(EXIT_FAULT, "out of memory; close other programs");
  in->cal = gv_calibration_default();
  int got;
  while ((got = gv_log_next(&log, &frame, err, sizeof err)) > 0)
    count_frame(in, &frame);
  int code = EXIT_DONE;
  if (got < 0)
    code = trace_fail(EXIT_BAD_INPUT, "%s", err);
  else if (in->frames == 0)
    code = trace_fail(EXIT_BAD_INPUT, "%s: no frame in it; record one with gloved-trace record or candump -L",
                      argv[1]);
  else
    print_info(in, &log);
  gv_log_close(&log);
  free(in);
  return code;
}
