// SPDX-License-Identifier: BSD-3-Clause
// The simulated device as a driver in the engine's own process, behind the URL "sim:": poll advances the
// model to the caller's time, send hands it the commands. Opening reads the script; after that nothing
// allocates or blocks.
#include "gloved/drivers.h"
#include "gloved/sim.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char default_script[] = "data/scripts/power_box.user";

typedef struct sim_driver {
  gv_sim sim;
  gv_sim_script script;  // while opening
  bool polled;
  int64_t start_ns;  // the caller's time of the first poll
  uint64_t received;
} sim_driver;

static int sim_poll(void *self, int64_t now_ns, gv_frame *out, int max) {
  sim_driver *d = self;
  if (!d->polled) {
    d->polled = true;
    d->start_ns = now_ns;
  }
  int n = gv_sim_advance(&d->sim, now_ns - d->start_ns, out, max);
  for (int i = 0; i < n; i++)
    out[i].stamp_ns += d->start_ns;
  return n;
}

static int sim_send(void *self, const gv_frame *frame, int count) {
  sim_driver *d = self;
  for (int i = 0; i < count; i++)
    gv_sim_receive(&d->sim, &frame[i]);
  d->received += (uint64_t)count;
  return 0;
}

static bool sim_ended(void *self) { return gv_sim_ended(&((sim_driver *)self)->sim); }

static gv_driver_stats sim_stats(void *self) {
  const sim_driver *d = self;
  return (gv_driver_stats){.rx = d->sim.report.sent, .tx = d->received};
}

static void sim_close(void *self) { free(self); }

// One "NAME=VALUE" of the URL, in place.
static int apply_option(sim_driver *d, char *option, uint64_t *seed, char *err, size_t err_size) {
  char *value = strchr(option, '=');
  if (!value) {
    snprintf(err, err_size, "sim: \"%.40s\" has no value; write NAME=VALUE, joined by &", option);
    return -1;
  }
  *value++ = '\0';
  if (strcmp(option, "device") != 0 && strcmp(option, "seed") != 0)
    return gv_sim_device_set(&d->script.device, option, value, err, err_size);
  char *end = value;
  if (option[0] == 's')
    *seed = strtoull(value, &end, 10);
  else if (strcmp(value, "best") == 0) {
    d->script.device = gv_sim_device_best();
    end = value + 4;
  } else if (strcmp(value, "real") == 0) {
    d->script.device = gv_sim_device_real();
    end = value + 4;
  }
  if (*value && *end == '\0' && (option[0] == 'd' || *seed > 0))
    return 0;
  snprintf(err, err_size, "sim: %s=%.40s; write device=best, device=real or seed=N with N above 0", option,
           value);
  return -1;
}

static int set_up(sim_driver *d, char *url, char *err, size_t err_size) {
  char *options = strchr(url, '?');
  char *save = NULL;
  uint64_t seed = 0;
  if (options)
    *options++ = '\0';
  if (gv_sim_script_load(*url ? url : default_script, &d->script, err, err_size))
    return -1;
  for (char *one = options ? strtok_r(options, "&", &save) : NULL; one; one = strtok_r(NULL, "&", &save))
    if (apply_option(d, one, &seed, err, err_size))
      return -1;
  if (gv_sim_device_check(&d->script.device, err, err_size))
    return -1;
  gv_sim_init(&d->sim, &d->script, NULL, seed);
  gv_sim_start(&d->sim);
  return 0;
}

int gv_sim_open(const char *url, gv_driver *out, char *err, size_t err_size) {
  char text[1024];
  if (strncmp(url, "sim:", 4) != 0 || strlen(url) >= sizeof text) {
    snprintf(err, err_size,
             "\"%.80s\" is no simulated device; write sim:, sim:SCRIPT or sim:SCRIPT?device=real&seed=3",
             url);
    return -1;
  }
  snprintf(text, sizeof text, "%s", url + 4);
  sim_driver *d = calloc(1, sizeof *d);
  if (!d) {
    snprintf(err, err_size, "sim: no memory for the simulated device; free some");
    return -1;
  }
  if (set_up(d, text, err, err_size)) {
    free(d);
    return -1;
  }
  *out = (gv_driver){d, sim_poll, sim_send, sim_ended, sim_stats, sim_close, NULL, 0, NULL};
  return 0;
}
