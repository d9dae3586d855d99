// SPDX-License-Identifier: BSD-3-Clause
// gloved-trace: what is in a recording, a recording from a table of angles, a recording from the wire,
// and one that a bus monitor made put into step with the engine.
// Recordings are candump -L logs, so candump, canplayer, python-can and `gloved --fcu trace:FILE` share them.
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "gloved/drivers.h"
#include "daemon/load/about.h"
#include "trace/trace.h"
#include "tools/program.h"

static const char help[] =
    "gloved-trace: recordings of the glove's wire, in the form of candump -L.\n"
    "\n"
    "  gloved-trace info FILE\n"
    "      Frames, rates, gaps, losses, checksum errors, ages and the kind of samples in a log (plain or "
    "gzip).\n"
    "  gloved-trace import TABLE -o FILE [OPTION...]\n"
    "      A log of GLOVE and POSE frames from a table: column t_s (seconds) and any of the 22 sensors "
    "(radians:\n"
    "      thumb_rotate, thumb_mpj, ..., wrist_yaw), px py pz (metres) and qw qx qy qz of the tracker's "
    "receiver;\n"
    "      or the columns FFJ3, FFJ2, ... of a simulated hand. --wrist takes the pose from a file of 4x4 "
    "matrices\n"
    "      (row by row, metres; 100 Hz unless --wrist-rate says otherwise). --rate interpolates to that "
    "rate.\n"
    "      Cells are parted by comma, semicolon, tab or blanks. --columns names them in order where the "
    "table does not:\n"
    "      t_s,cyberglove22 or cyberglove18,-,px,... (- is not used; NAME*FACTOR+OFFSET, and A&B for two of "
    "one column).\n"
    "      graspdb14 (with --rows), vmg30 (with --degrees): the columns of those recordings, whole.\n"
    "      --rows: the rate of rows without a time. --degrees, --counts 255: the sensors' unit. "
    "--virtualhand: angles as\n"
    "      VirtualHand has them. --left: a left hand. Without a wrist the hand stands beside the table.\n"
    "  gloved-trace record --udp udp://HOST:PORT?listen=PORT -o FILE [--duration S]\n"
    "      Records what the device sends (cannelloni over UDP) until S seconds went by or Ctrl-C; - is "
    "standard output.\n"
    "  gloved-trace align FILE -o FILE --rate HZ\n"
    "      Takes a log that candump made while gloved ran at HZ on the same CAN FD bus, and stamps each "
    "frame with the\n"
    "      step that took it, so that a replay ends with the state of that run, bit by bit.\n"
    "  --help, --version\n"
    "\n"
    "Exit codes: 0 done, 1 nothing came or the log could not be written, 2 bad usage or bad input.\n";

int trace_fail(int code, const char *format, ...) {
  va_list args;
  va_start(args, format);
  fputs("gloved-trace: ", stderr);
  vfprintf(stderr, format, args);
  fputc('\n', stderr);
  va_end(args);
  return code;
}

_Bool trace_number(const char *text, double lo, double hi, double *out) {
  char *end;
  double v = strtod(text, &end);
  if (end == text || *end || !(v >= lo && v <= hi))
    return 0;
  *out = v;
  return 1;
}

static gv_about about;

int trace_about(int code, const char *path) {
  char err[512];
  if (code != EXIT_DONE || strcmp(path, "-") == 0)
    return code;
  gv_about_now(&about);
  return gv_about_write(&about, path, err, sizeof err) ? trace_fail(EXIT_FAULT, "%s", err) : code;
}

int main(int argc, char **argv) {
  gv_keep_standard_files();
  gv_about_command_line(argc, argv, about.command_line);
  const char *verb = argc > 1 ? argv[1] : "";
  if (program_answers(argc, argv, help))
    return EXIT_DONE;
  if (strcmp(verb, "info") == 0)
    return trace_info(argc - 1, argv + 1);
  if (strcmp(verb, "import") == 0)
    return trace_import(argc - 1, argv + 1);
  if (strcmp(verb, "record") == 0)
    return trace_record(argc - 1, argv + 1);
  if (strcmp(verb, "align") == 0)
    return trace_align(argc - 1, argv + 1);
  return trace_fail(EXIT_BAD_INPUT, "%s%s; use info, import, record or align (gloved-trace --help)",
                    argc > 1 ? "no such job: " : "no job given", verb);
}
