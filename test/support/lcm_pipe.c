// SPDX-License-Identifier: BSD-3-Clause
// A stock LCM subscriber in C for test_channels.py: listens on URL for SECONDS, prints "ready", then for
// every message a line "CHANNEL BYTES ..." with some of its content, flushed at the end.
#include <lcm/lcm.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "gloved_event_t.h"
#include "gloved_state_t.h"
#include "gloved_stats_t.h"

static void on_state(const lcm_recv_buf_t *buffer, const char *channel, const gloved_state_t *s, void *user) {
  (void)user;
  printf("%s %u %lld %d %d %.17g\n", channel, buffer->data_size, (long long)s->step, s->safety_state,
         s->num_objects, s->limb[15].position_m[2]);
}

static void on_stats(const lcm_recv_buf_t *buffer, const char *channel, const gloved_stats_t *s, void *user) {
  (void)user;
  printf("%s %u %lld %d\n", channel, buffer->data_size, (long long)s->step, s->num_histograms);
}

static void on_event(const lcm_recv_buf_t *buffer, const char *channel, const gloved_event_t *e, void *user) {
  (void)user;
  printf("%s %u %s\n", channel, buffer->data_size, e->text);
}

static void on_other(const lcm_recv_buf_t *buffer, const char *channel, void *user) {
  (void)user;
  printf("%s %u\n", channel, buffer->data_size);
}

int main(int argc, char **argv) {
  if (argc != 3)
    return 2;
  lcm_t *lcm = lcm_create(argv[1]);
  if (!lcm)
    return 1;
  gloved_state_t_subscription_set_queue_capacity(
      gloved_state_t_subscribe(lcm, "GLOVED_STATE", on_state, NULL), 1000);
  gloved_stats_t_subscribe(lcm, "GLOVED_STATS", on_stats, NULL);
  gloved_event_t_subscribe(lcm, "GLOVED_EVENT", on_event, NULL);
  lcm_subscription_set_queue_capacity(lcm_subscribe(lcm, "DRAKE_VIEWER_.*", on_other, NULL), 1000);
  puts("ready");
  fflush(stdout);
  const time_t end = time(NULL) + atoi(argv[2]);
  while (time(NULL) < end)
    lcm_handle_timeout(lcm, 100);
  lcm_destroy(lcm);
  return 0;
}
