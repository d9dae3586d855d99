// SPDX-License-Identifier: BSD-3-Clause
// How long after a glove's frame the answer to it leaves, over UDP on this machine. Two programs in one:
//
//   bench_latency echo PORT                 a bare echo: every datagram back to whom it came from, and
//   nothing else bench_latency probe URL SECONDS FILE    a glove of 1 kHz (the simulated device and user)
//   that sends all frames of a
//                                           millisecond in one datagram; writes how long each answer took, in
//                                           ns
//
// An answer is a command for the sample that was sent, or the sample itself (the echo's). Its time is the
// kernel's stamp on receiving it minus the clock before sending: the probe's own wake-up is not in it. Both
// run as real-time threads where the machine lets them, the echo on the last core as gloved does, the probe
// on the first. latency.py calls it.
#include <arpa/inet.h>
#include <errno.h>
#include <poll.h>
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include "gloved/drivers.h"
#include "gloved/fcu.h"
#include "gloved/sim.h"

enum { PERIOD_NS = 1000000, PENDING = 1024, BUNDLE = 16, ECHO_PRIORITY = 80, PROBE_PRIORITY = 85 };

static int64_t clock_ns(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

static void run_in_real_time(int priority, long core) {
  const struct sched_param param = {.sched_priority = priority};
  cpu_set_t one;
  CPU_ZERO(&one);
  CPU_SET((size_t)core, &one);
  prctl(PR_SET_TIMERSLACK, 1UL, 0UL, 0UL, 0UL);
  if (mlockall(MCL_CURRENT | MCL_FUTURE) != 0 || sched_setaffinity(0, sizeof one, &one) != 0 ||
      sched_setscheduler(0, SCHED_FIFO, &param) != 0)
    fprintf(stderr,
            "bench_latency: no real-time scheduling here; the figures are those of an ordinary program\n");
}

// ---- echo -------------------------------------------------------------------------------------------------

static int run_echo(const char *port) {
  struct sockaddr_in here = {.sin_family = AF_INET,
                             .sin_port = htons((uint16_t)atoi(port)),
                             .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
  static uint8_t datagram[2048];
  const int fd = socket(AF_INET, SOCK_DGRAM, 0);
  if (fd < 0 || bind(fd, (struct sockaddr *)&here, sizeof here) != 0) {
    fprintf(stderr, "bench_latency: port %s: %s; give a free one\n", port, strerror(errno));
    return 2;
  }
  run_in_real_time(ECHO_PRIORITY, sysconf(_SC_NPROCESSORS_ONLN) - 1);
  for (;;) {
    struct sockaddr_in from;
    socklen_t size = sizeof from;
    const ssize_t n = recvfrom(fd, datagram, sizeof datagram, 0, (struct sockaddr *)&from, &size);
    if (n > 0)
      sendto(fd, datagram, (size_t)n, 0, (struct sockaddr *)&from, size);
  }
}

// ---- probe ------------------------------------------------------------------------------------------------

static struct {
  gv_sim sim;
  gv_sim_script script;
  gv_driver wire;
  int64_t sent_ns[PENDING];  // by the sample's stamp in ms; 0: answered or never sent
  int32_t *answer_ns;
  size_t answers, most;
} probe;

static int64_t *pending(uint32_t stamp_us) { return &probe.sent_ns[stamp_us / 1000 % PENDING]; }

// The stamp of the sample that a frame answers. False: it answers none.
static bool answered(const gv_frame *frame, uint32_t *out_stamp_us) {
  gv_command_msg command;
  gv_glove_msg glove;
  if (frame->id == GV_ID_FORCE_COMMAND && gv_fcu_unpack_command(frame, &command) == 0) {
    *out_stamp_us = command.sample_stamp_us;
    return true;
  }
  if (frame->id != GV_ID_GLOVE || gv_fcu_unpack_glove(frame, &glove) != 0)
    return false;
  *out_stamp_us = glove.stamp_us;
  return true;
}

static void take_answers(void) {
  gv_frame frame[BUNDLE];
  uint32_t stamp_us;
  const int n = probe.wire.poll(probe.wire.self, INT64_MAX, frame, BUNDLE);
  for (int i = 0; i < n; i++) {
    gv_sim_receive(&probe.sim, &frame[i]);
    if (!answered(&frame[i], &stamp_us))
      continue;
    int64_t *sent_ns = pending(stamp_us);
    if (*sent_ns == 0 || probe.answers == probe.most)
      continue;
    probe.answer_ns[probe.answers++] = (int32_t)(frame[i].stamp_ns - *sent_ns);
    *sent_ns = 0;
  }
}

static void answers_until(int64_t end_ns) {
  struct pollfd wait = {.fd = probe.wire.descriptor(probe.wire.self), .events = POLLIN};
  for (int64_t rest_ns; (rest_ns = end_ns - clock_ns()) > 0;) {
    const struct timespec rest = {rest_ns / 1000000000, rest_ns % 1000000000};
    if (ppoll(&wait, 1, &rest, NULL) > 0)
      take_answers();
  }
}

static void send_sample(int64_t device_ns) {
  gv_frame frame[BUNDLE];
  gv_glove_msg glove;
  const int n = gv_sim_advance(&probe.sim, device_ns, frame, BUNDLE);
  for (int i = 0; i < n; i++)
    if (frame[i].id == GV_ID_GLOVE && gv_fcu_unpack_glove(&frame[i], &glove) == 0)
      *pending(glove.stamp_us) = clock_ns();
  if (n > 0)
    probe.wire.send(probe.wire.self, frame, n);
}

static int write_answers(const char *path) {
  FILE *out = fopen(path, "wb");
  const bool written = out &&
                       fwrite(probe.answer_ns, sizeof *probe.answer_ns, probe.answers, out) == probe.answers;
  if (out && fclose(out) == 0 && written)
    return 0;
  fprintf(stderr, "bench_latency: %s: not written; make room\n", path);
  return 2;
}

static int run_probe(const char *url, double seconds, const char *path) {
  char err[512];
  if (gv_sim_script_load("data/scripts/power_box.user", &probe.script, err, sizeof err) ||
      gv_udp_open(url, &probe.wire, err, sizeof err)) {
    fprintf(stderr, "bench_latency: %s\n", err);
    return 2;
  }
  const int64_t periods = (int64_t)(seconds * 1e9 / PERIOD_NS);
  probe.most = (size_t)periods + PENDING;
  probe.answer_ns = calloc(probe.most, sizeof *probe.answer_ns);
  if (!probe.answer_ns)
    return 2;
  gv_sim_init(&probe.sim, &probe.script, NULL, 0);
  gv_sim_start(&probe.sim);
  run_in_real_time(PROBE_PRIORITY, 0);
  int64_t next_ns = clock_ns();
  for (int64_t i = 0; i < periods; i++) {
    send_sample(i * PERIOD_NS);
    next_ns += PERIOD_NS;
    answers_until(next_ns);
  }
  return write_answers(path);
}

int main(int argc, char **argv) {
  if (argc == 3 && strcmp(argv[1], "echo") == 0)
    return run_echo(argv[2]);
  if (argc == 5 && strcmp(argv[1], "probe") == 0)
    return run_probe(argv[2], atof(argv[3]), argv[4]);
  fprintf(stderr, "usage: bench_latency echo PORT | probe URL SECONDS FILE\n");
  return 2;
}
