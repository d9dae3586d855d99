// SPDX-License-Identifier: BSD-3-Clause
// gloved-trace import: joint angles and wrist poses over time to a log of GLOVE and POSE frames, through the
// default calibration, so that a recording from anywhere can be replayed by the daemon.
#include <errno.h>
#include <getopt.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "gloved/drivers.h"
#include "gloved/fcu.h"
#include "table.h"
#include "trace.h"

enum { ROWS_MAX = 4000000 };  // over an hour at 1 kHz; 0.7 GB while it is made

typedef struct job {
  const char *csv, *wrist, *out;
  double rate_hz, wrist_rate_hz;  // rate 0: the file's own times
  bool left;
  table_format format;
  series hand, pose;
} job;

static double last_time(const series *s) { return series_row(s, s->count - 1)[0]; }

// The same curve at times 0, 1 / rate, 2 / rate, ...
static void resample(series *s, double rate_hz) {
  series even = {.width = s->width};
  size_t count = (size_t)(last_time(s) * rate_hz + 1e-9) + 1;
  for (size_t i = 0, at = 0; i < count; i++)
    series_at(s, (double)i / rate_hz, &at, series_add(&even));
  free(s->row);
  *s = even;
}

// Nearest count of each angle; returns how many were beyond the sensor's range.
static unsigned fill_glove(const job *j, const gv_calibration *cal, const double *row, gv_glove_msg *out) {
  unsigned beyond = 0;
  out->flags = (uint8_t)(GV_GLOVE_DEAD_MAN | (j->left ? GV_GLOVE_LEFT : 0));
  out->stamp_us = (uint32_t)(int64_t)(row[0] * 1e6 + 0.5);
  for (int i = 0; i < GV_SENSORS; i++) {
    double raw = floor(gv_calibration_raw(cal, i, row[1 + i]) + 0.5);
    double held = gv_clamp(raw, 0, 4095);
    beyond += raw != held;
    out->raw[i] = (uint16_t)held;
  }
  return beyond;
}

static void fill_pose(const double *row, gv_pose_msg *out) {
  out->flags = GV_POSE_VALID;
  out->stamp_us = (uint32_t)(int64_t)(row[0] * 1e6 + 0.5);
  out->receiver = GV_RECEIVER_HAND;
  out->T_world_receiver = (gv_pose){{row[4], row[5], row[6], row[7]}, {row[1], row[2], row[3]}};
}

static void write_line(FILE *out, gv_frame *frame, double time_s) {
  char line[GV_LOG_LINE_MAX + 1];
  frame->stamp_ns = (int64_t)(time_s * 1e9 + 0.5);
  gv_log_format(frame, "import", line);
  fputs(line, out);
}

// Both series in order of time; at equal times the pose first, so that glove and
// pose of a row belong together.
static unsigned write_frames(const job *j, FILE *out) {
  gv_calibration cal = gv_calibration_default();
  gv_glove_msg glove = {0};
  gv_pose_msg pose = {0};
  gv_frame frame;
  unsigned beyond = 0;
  for (size_t h = 0, p = 0; h < j->hand.count || p < j->pose.count;) {
    bool pose_next = p < j->pose.count &&
                     (h == j->hand.count || series_row(&j->pose, p)[0] <= series_row(&j->hand, h)[0]);
    const double *row = pose_next ? series_row(&j->pose, p++) : series_row(&j->hand, h++);
    if (pose_next) {
      fill_pose(row, &pose);
      gv_fcu_pack_pose(&pose, &frame);
      pose.counter++;
    } else {
      beyond += fill_glove(j, &cal, row, &glove);
      gv_fcu_pack_glove(&glove, &frame);
      glove.counter++;
    }
    write_line(out, &frame, row[0]);
  }
  return beyond;
}

static void print_beyond(unsigned beyond) {
  const gv_calibration cal = gv_calibration_default();
  const double deg = 180 / GV_PI;
  if (beyond)
    fprintf(stderr, "%u angles were beyond the sensors' range (%.0f to %.0f degrees) and held there\n",
            beyond, gv_calibration_angle(&cal, 0, 0) * deg, gv_calibration_angle(&cal, 0, 4095) * deg);
}

static int write_log(const job *j) {
  FILE *out = strcmp(j->out, "-") == 0 ? stdout : fopen(j->out, "w");
  if (!out)
    return trace_fail(EXIT_BAD_INPUT, "%s: cannot be written (%s); choose another place", j->out,
                      strerror(errno));
  unsigned beyond = write_frames(j, out);
  bool bad = ferror(out);
  if (fclose(out) || bad)
    return trace_fail(EXIT_FAULT, "%s: cannot be written (%s); free the disk", j->out, strerror(errno));
  print_beyond(beyond);
  fprintf(stderr, "%zu glove and %zu pose frames, %.3f s\n", j->hand.count, j->pose.count,
          fmax(last_time(&j->hand), last_time(&j->pose)));
  return trace_about(EXIT_DONE, j->out);
}

static int read_wrist(job *j) {
  series wrist;
  int code = table_read_matrices(j->wrist, j->wrist_rate_hz, &wrist);
  free(j->pose.row);
  j->pose = wrist;
  if (code)
    return code;
  double difference_s = last_time(&wrist) - last_time(&j->hand);
  if (fabs(difference_s) > 0.1)
    fprintf(stderr, "the wrist's recording is %.2f s %s than the hand's\n", fabs(difference_s),
            difference_s > 0 ? "longer" : "shorter");
  return EXIT_DONE;
}

static int import(job *j) {
  int code = table_read_csv(j->csv, &j->format, &j->hand, &j->pose);
  if (!code && j->wrist)
    code = read_wrist(j);
  if (!code && j->rate_hz * fmax(last_time(&j->hand), last_time(&j->pose)) > ROWS_MAX)
    code = trace_fail(EXIT_BAD_INPUT, "%s: too long (%.0f s); cut it, or check that t_s is in seconds",
                      j->csv, last_time(&j->hand));
  if (!code && j->rate_hz > 0) {
    resample(&j->hand, j->rate_hz);
    resample(&j->pose, j->rate_hz);
  }
  if (!code)
    code = write_log(j);
  free(j->hand.row);
  free(j->pose.row);
  return code;
}

int trace_import(int argc, char **argv) {
  static const struct option options[] = {
    {"wrist", required_argument, NULL, 'w'},   {"wrist-rate", required_argument, NULL, 'W'},
    {"rate", required_argument, NULL, 'r'},    {"left", no_argument, NULL, 'l'},
    {"columns", required_argument, NULL, 'c'}, {"rows", required_argument, NULL, 'R'},
    {"degrees", no_argument, NULL, 'd'},       {"counts", required_argument, NULL, 'C'},
    {"virtualhand", no_argument, NULL, 'v'},   {NULL, 0, NULL, 0}};
  job j = {.wrist_rate_hz = 100, .format = {.unit_rad = 1}};
  opterr = 0;
  for (int c; (c = getopt_long(argc, argv, "o:", options, NULL)) != -1;) {
    bool good = true;
    if (c == 'o')
      j.out = optarg;
    else if (c == 'w')
      j.wrist = optarg;
    else if (c == 'l')
      j.left = true;
    else if (c == 'c')
      j.format.columns = optarg;
    else if (c == 'd')
      j.format.unit_rad = GV_PI / 180;
    else if (c == 'v')
      j.format.virtualhand = true;
    else if (c == 'R')
      good = trace_number(optarg, 0.1, 10000, &j.format.rows_hz);
    else if (c == 'C') {
      j.format.unit_rad = 0;
      if (!trace_number(optarg, 1, 65535, &j.format.counts))
        return trace_fail(EXIT_BAD_INPUT, "import: --counts %s; give the largest count, such as 255 or 4095",
                          optarg);
    } else if (c == 'W')
      good = trace_number(optarg, 0.1, 10000, &j.wrist_rate_hz);
    else if (c == 'r')
      good = trace_number(optarg, 0.1, 10000, &j.rate_hz);
    else
      return trace_fail(EXIT_BAD_INPUT, "import: %s is no option or lacks its value; see gloved-trace --help",
                        argv[optind - 1]);
    if (!good)
      return trace_fail(EXIT_BAD_INPUT, "import: %s is no rate; give 0.1 to 10000 Hz", optarg);
  }
  if (!j.out || optind + 1 != argc)
    return trace_fail(EXIT_BAD_INPUT, "import: give one CSV and -o FILE; see gloved-trace --help");
  if (j.format.unit_rad == 0 && j.format.virtualhand)
    return trace_fail(EXIT_BAD_INPUT,
                      "import: --virtualhand is about angles, and counts are none; leave one of them out");
  j.csv = argv[optind];
  return import(&j);
}
