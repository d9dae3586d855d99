// SPDX-License-Identifier: BSD-3-Clause
// gloved-trace align: a log that candump made beside a running engine says when frames passed, but not in
// which step the engine took them. The engine's own commands do: each carries how many frames were taken so
// far and the stamp of the newest glove sample among them (fcu.h). How many frames of the log had passed
// before the engine listened is the one unknown; it is the largest number with which every command speaks of
// the sample that the log has at that place, and of no frame that came after the command.
#include <errno.h>
#include <getopt.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "gloved/drivers.h"
#include "gloved/fcu.h"
#include "trace.h"

typedef struct command {
  gv_frame frame;
  size_t before;  // device frames of the log that passed before it
  size_t taken;   // frames that the engine had taken by then
  uint64_t step;
  uint32_t stamp_us;
} command;

typedef struct align {
  gv_frame *device;    // GLOVE, POSE and STATUS
  uint32_t *stamp_us;  // of the newest glove sample up to and with each
  size_t device_count, device_room;
  command *command;  // of the steps, and after them those of the ramp to zero
  size_t command_count, command_room;
} align;

static void *grow(void *block, size_t count, size_t *room, size_t size) {
  if (count < *room)
    return block;
  *room = *room ? 2 * *room : 4096;
  void *grown = realloc(block, *room * size);
  if (!grown)
    exit(trace_fail(EXIT_FAULT, "out of memory; give a shorter log"));
  return grown;
}

static void add_device(align *a, const gv_frame *frame) {
  gv_glove_msg glove;
  size_t room = a->device_room;
  a->device = grow(a->device, a->device_count, &a->device_room, sizeof *a->device);
  a->stamp_us = grow(a->stamp_us, a->device_count, &room, sizeof *a->stamp_us);
  a->device[a->device_count] = *frame;
  a->stamp_us[a->device_count] = a->device_count ? a->stamp_us[a->device_count - 1] : 0;
  if (gv_fcu_unpack_glove(frame, &glove) == GV_FCU_OK)
    a->stamp_us[a->device_count] = glove.stamp_us;
  a->device_count++;
}

// Counters are unwrapped against the command before; the ramp to zero at the end makes
// no steps, nor does a repeat.
static void add_command(align *a, const gv_frame *frame) {
  gv_command_msg msg;
  if (gv_fcu_unpack_command(frame, &msg) != GV_FCU_OK)
    return;
  a->command = grow(a->command, a->command_count, &a->command_room, sizeof *a->command);
  const command *last = a->command_count ? &a->command[a->command_count - 1] : NULL;
  const uint8_t steps = last ? (uint8_t)(msg.counter - last->frame.data[0]) : msg.counter;
  const uint16_t taken = (uint16_t)(msg.frames_taken - (last ? (uint16_t)last->taken : 0));
  a->command[a->command_count++] = (command){
    .frame = *frame,
    .before = a->device_count,
    .taken = (last ? last->taken : 0) + taken,
    .stamp_us = msg.sample_stamp_us,
    .step = (last ? last->step : 0) + (msg.flags & (GV_COMMAND_ENDING | GV_COMMAND_REPEAT) ? 0 : steps)};
}

static int load(align *a, const char *path) {
  gv_log log;
  gv_frame frame;
  char err[400];
  int got;
  if (gv_log_open(&log, path, err, sizeof err))
    return trace_fail(EXIT_BAD_INPUT, "%s", err);
  while ((got = gv_log_next(&log, &frame, err, sizeof err)) > 0) {
    if (frame.flags & (GV_FRAME_EXTENDED | GV_FRAME_ERROR | GV_FRAME_REMOTE))
      continue;
    if (frame.id == GV_ID_FORCE_COMMAND)
      add_command(a, &frame);
    else if (frame.id == GV_ID_GLOVE || frame.id == GV_ID_POSE || frame.id == GV_ID_STATUS)
      add_device(a, &frame);
  }
  gv_log_close(&log);
  return got < 0 ? trace_fail(EXIT_BAD_INPUT, "%s", err) : EXIT_DONE;
}

// Whether every command can have taken what it says if the engine began to listen after `missed` frames.
static bool fits(const align *a, size_t missed) {
  for (size_t i = 0; i < a->command_count; i++) {
    const command *c = &a->command[i];
    if (c->taken == 0)
      continue;
    if (missed + c->taken > c->before)
      return false;
    // Stamp 0: no sample was taken yet.
    if (c->stamp_us != 0 && a->stamp_us[missed + c->taken - 1] != c->stamp_us)
      return false;
  }
  return true;
}

static bool find_missed(const align *a, size_t *out_missed) {
  for (size_t missed = a->command_count ? a->command[0].before + 1 : 0; missed-- > 0;) {
    *out_missed = missed;
    if (fits(a, missed))
      return true;
  }
  return false;
}

static void put(gv_frame frame, uint64_t step, double rate_hz, int64_t start_ns, FILE *out) {
  char line[GV_LOG_LINE_MAX + 1];
  frame.stamp_ns = start_ns + (int64_t)((double)step * 1e9 / rate_hz);
  gv_log_format(&frame, "can0", line);
  fputs(line, out);
}

// Of the log's first stamp whole seconds are kept, so that rounding to microseconds
// moves no frame into the next step.
static int write_aligned(const align *a, size_t missed, double rate_hz, const char *path) {
  const int64_t start_ns = a->command[0].frame.stamp_ns / 1000000000 * 1000000000;
  const uint64_t first = a->command[0].step;
  size_t next = missed;
  FILE *out = strcmp(path, "-") == 0 ? stdout : fopen(path, "w");
  if (!out)
    return trace_fail(EXIT_BAD_INPUT, "%s: cannot be written (%s); choose another place", path,
                      strerror(errno));
  for (size_t i = 0; i < a->command_count; i++) {
    const command *c = &a->command[i];
    for (; next < missed + c->taken; next++)
      put(a->device[next], c->step - first, rate_hz, start_ns, out);
    put(c->frame, c->step - first, rate_hz, start_ns, out);
  }
  if (fclose(out))
    return trace_fail(EXIT_FAULT, "%s: cannot be written (%s); free the disk", path, strerror(errno));
  fprintf(stderr, "%zu frames in %llu steps; %zu had passed before the engine listened\n", next - missed,
          (unsigned long long)(a->command[a->command_count - 1].step - first + 1), missed);
  return trace_about(EXIT_DONE, path);
}

static int align_log(const char *in, const char *out, double rate_hz) {
  align a = {0};
  size_t missed = 0;
  int code = load(&a, in);
  if (code == EXIT_DONE && (a.command_count == 0 || a.command[0].frame.data[0] != 0 || a.device_count == 0))
    code = trace_fail(EXIT_BAD_INPUT, "%s: it does not begin before the engine; start candump before gloved",
                      in);
  else if (code == EXIT_DONE && !find_missed(&a, &missed))
    code = trace_fail(EXIT_BAD_INPUT,
                      "%s: the commands do not fit the frames; the engine must have seen the same frames as "
                      "candump: one CAN FD interface, none lost",
                      in);
  else if (code == EXIT_DONE)
    code = write_aligned(&a, missed, rate_hz, out);
  free(a.device);
  free(a.stamp_us);
  free(a.command);
  return code;
}

int trace_align(int argc, char **argv) {
  static const struct option options[] = {{"rate", required_argument, NULL, 'r'}, {NULL, 0, NULL, 0}};
  const char *out = NULL;
  double rate_hz = 0.0;
  opterr = 0;
  for (int c; (c = getopt_long(argc, argv, "o:", options, NULL)) != -1;) {
    if (c == 'o')
      out = optarg;
    else if (c != 'r' || !trace_number(optarg, 100, 10000, &rate_hz))
      return trace_fail(EXIT_BAD_INPUT, "align: %s is wrong; give --rate HZ (100 to 10000) and -o FILE",
                        argv[optind - 1]);
  }
  if (!out || rate_hz <= 0.0 || optind + 1 != argc)
    return trace_fail(EXIT_BAD_INPUT, "align: give FILE, -o FILE and --rate HZ; see gloved-trace --help");
  return align_log(argv[optind], out, rate_hz);
}
