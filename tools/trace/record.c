// SPDX-License-Identifier: BSD-3-Clause
// gloved-trace record: listens in the daemon's place and writes every frame as a candump -L line, flushed
// each millisecond, so that a crash leaves a log that can be read. Stamps are the kernel's, as time of day.
#include <errno.h>
#include <getopt.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#include "gloved/drivers.h"
#include "trace.h"

static volatile sig_atomic_t stop;
static void on_signal(int number) {
  (void)number;
  stop = 1;
}

static int64_t clock_ns(clockid_t clock) {
  struct timespec t;
  clock_gettime(clock, &t);
  return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

// Write what came since the last call. False where the file cannot be written.
static bool write_frames(gv_driver *link, int64_t day_offset_ns, FILE *out) {
  gv_frame frame[64];
  char line[GV_LOG_LINE_MAX + 1];
  int n;
  while ((n = link->poll(link->self, clock_ns(CLOCK_MONOTONIC), frame, 64)) > 0) {
    for (int i = 0; i < n; i++) {
      frame[i].stamp_ns += day_offset_ns;
      gv_log_format(&frame[i], "udp0", line);
      fputs(line, out);
    }
  }
  return fflush(out) == 0 && !ferror(out);
}

static int record(gv_driver *link, FILE *out, const char *path, double duration_s) {
  const struct timespec pause = {.tv_nsec = 1000000};
  int64_t start = clock_ns(CLOCK_MONOTONIC);
  int64_t day_offset_ns = clock_ns(CLOCK_REALTIME) - start;
  bool good = true;
  while (good && !stop && (double)(clock_ns(CLOCK_MONOTONIC) - start) < duration_s * 1e9) {
    nanosleep(&pause, NULL);
    good = write_frames(link, day_offset_ns, out);
  }
  gv_driver_stats s = link->stats(link->self);
  double took_s = (double)(clock_ns(CLOCK_MONOTONIC) - start) * 1e-9;
  if (!good)
    return trace_fail(EXIT_FAULT, "%s: cannot be written (%s); free the disk or choose another place", path,
                      strerror(errno));
  if (s.rx == 0)
    return trace_fail(EXIT_FAULT,
                      "no frame came in %.1f s (%llu datagrams of others, %llu broken); "
                      "check that the device sends to this port",
                      took_s, (unsigned long long)s.foreign, (unsigned long long)s.bad);
  fprintf(stderr, "%llu frames in %.1f s, %llu datagrams lost, %llu broken, %llu of others\n",
          (unsigned long long)s.rx, took_s, (unsigned long long)s.lost, (unsigned long long)s.bad,
          (unsigned long long)s.foreign);
  return EXIT_DONE;
}

int trace_record(int argc, char **argv) {
  static const struct option options[] = {
    {"udp", required_argument, NULL, 'u'}, {"duration", required_argument, NULL, 'd'}, {NULL, 0, NULL, 0}};
  const char *url = NULL;
  const char *path = NULL;
  double duration_s = HUGE_VAL;
  char err[400];
  opterr = 0;
  for (int c; (c = getopt_long(argc, argv, "o:", options, NULL)) != -1;) {
    if (c == 'u')
      url = optarg;
    else if (c == 'o')
      path = optarg;
    else if (c != 'd')
      return trace_fail(EXIT_BAD_INPUT, "record: %s is no option or lacks its value; see gloved-trace --help",
                        argv[optind - 1]);
    else if (!trace_number(optarg, 1e-3, 1e9, &duration_s))
      return trace_fail(EXIT_BAD_INPUT, "record: --duration %s is no time; give seconds above 0", optarg);
  }
  if (!url || !path || optind != argc)
    return trace_fail(EXIT_BAD_INPUT,
                      "record: give --udp URL and -o FILE and nothing else; see gloved-trace --help");
  gv_driver link;
  if (gv_udp_open(url, &link, err, sizeof err))
    return trace_fail(EXIT_BAD_INPUT, "%s", err);
  FILE *out = strcmp(path, "-") == 0 ? stdout : fopen(path, "w");
  int code = EXIT_BAD_INPUT;
  if (!out) {
    trace_fail(code, "%s: cannot be written (%s); choose another place", path, strerror(errno));
  } else {
    signal(SIGINT, on_signal);
    signal(SIGTERM, on_signal);
    code = record(&link, out, path, duration_s);
    if (fclose(out) && code == EXIT_DONE)
      code = trace_fail(EXIT_FAULT, "%s: cannot be written (%s); free the disk", path, strerror(errno));
  }
  link.close(link.self);
  return trace_about(code, path);
}
