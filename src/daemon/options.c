// SPDX-License-Identifier: BSD-3-Clause
// The command line to gv_options, and options and configuration file to gv_settings. Set-up only.
// getopt_long is not used: it prints messages of its own that do not say what to do.
#include "daemon/options.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "gloved/drivers.h"

typedef struct option_row {
  const char *name;
  const char **text;  // one of these three receives it
  double *number;
  bool *flag;
  double min, max;  // of number
} option_row;

static int take_number(const option_row *row, const char *value, char *err, size_t err_size) {
  char *end;
  errno = 0;
  double number = strtod(value, &end);
  if (end == value || *end != '\0' || errno || !isfinite(number)) {
    snprintf(err, err_size, "%s \"%s\" is not a number; give one from %g to %g", row->name, value, row->min,
             row->max);
    return -1;
  }
  if (number < row->min || number > row->max) {
    snprintf(err, err_size, "%s %s is out of range; give a number from %g to %g", row->name, value, row->min,
             row->max);
    return -1;
  }
  *row->number = number;
  return 0;
}

// One option with its value (null: none left). Returns 0 or negative; *out_used: the value was taken.
static int take_option(const option_row *row, const char *value, bool *out_used, char *err, size_t err_size) {
  *out_used = !row->flag;
  if (row->flag) {
    *row->flag = true;
    return 0;
  }
  if (!value || !*value || strncmp(value, "--", 2) == 0) {
    snprintf(err, err_size, "%s needs a value; see gloved --help", row->name);
    return -1;
  }
  if (row->number)
    return take_number(row, value, err, err_size);
  if (strlen(value) >= GV_SETTING_TEXT) {
    snprintf(err, err_size, "%s %.20s... is longer than %d characters; shorten it", row->name, value,
             GV_SETTING_TEXT - 1);
    return -1;
  }
  *row->text = value;
  return 0;
}

static const option_row *find_row(const option_row rows[], size_t count, const char *name) {
  for (size_t i = 0; i < count; i++)
    if (strcmp(rows[i].name, name) == 0)
      return &rows[i];
  return NULL;
}

int gv_options_parse(int argc, char **argv, gv_options *out, char *err, size_t err_size) {
  *out = (gv_options){0};
  const option_row rows[] = {
    {"--config", &out->config, NULL, NULL, 0, 0},
    {"--scene", &out->scene, NULL, NULL, 0, 0},
    {"--fcu", &out->fcu, NULL, NULL, 0, 0},
    {"--fcu2", &out->fcu2, NULL, NULL, 0, 0},
    {"--tracker", &out->tracker, NULL, NULL, 0, 0},
    {"--narrow", &out->narrow, NULL, NULL, 0, 0},
    {"--solver", &out->solver, NULL, NULL, 0, 0},
    {"--rate", NULL, &out->rate_hz, NULL, GV_RATE_MIN_HZ, GV_RATE_MAX_HZ},
    {"--duration", NULL, &out->duration_s, NULL, 0.001, 1e6},
    {"--lcm", &out->lcm, NULL, NULL, 0, 0},
    {"--log", &out->log, NULL, NULL, 0, 0},
    {"--sync", &out->sync, NULL, NULL, 0, 0},
    {"--summary", &out->summary, NULL, NULL, 0, 0},
    {"--record", &out->record, NULL, NULL, 0, 0},
    {"--black-box", &out->black_box, NULL, NULL, 0, 0},
    {"--no-rt", NULL, NULL, &out->no_rt, 0, 0},
    {"--strict", NULL, NULL, &out->strict, 0, 0},
    {"--doctor", NULL, NULL, &out->doctor, 0, 0},
    {"--json", NULL, NULL, &out->json, 0, 0},
    {"--print-config", NULL, NULL, &out->print_config, 0, 0},
    {"--check", NULL, NULL, &out->check, 0, 0},
    {"--help", NULL, NULL, &out->help, 0, 0},
    {"--version", NULL, NULL, &out->version, 0, 0},
  };
  for (int i = 1; i < argc; i++) {
    const option_row *row = find_row(rows, sizeof rows / sizeof *rows, argv[i]);
    bool used = false;
    if (!row) {
      snprintf(err, err_size, "unknown option \"%.100s\"; see gloved --help", argv[i]);
      return -1;
    }
    if (take_option(row, i + 1 < argc ? argv[i + 1] : NULL, &used, err, err_size))
      return -1;
    i += used ? 1 : 0;
  }
  if (out->json && !out->doctor) {
    snprintf(err, err_size, "--json is the form of --doctor's report; give both");
    return -1;
  }
  return 0;
}

static void set_text(char out[GV_SETTING_TEXT], const char *value) {
  if (value)
    snprintf(out, GV_SETTING_TEXT, "%s", value);
}

// As every LCM program: --lcm, else the configuration, else LCM_DEFAULT_URL, else the default.
static const char *lcm_url(const gv_options *options, const gv_settings *settings) {
  gv_settings defaults;
  gv_settings_default(&defaults);
  const bool said = options->lcm || strcmp(settings->lcm, defaults.lcm) != 0;
  return said ? options->lcm : getenv("LCM_DEFAULT_URL");
}

static void set_names(const gv_options *options, gv_settings *out) {
  char found[GV_SETTING_TEXT];
  set_text(out->scene, options->scene);
  if (gv_data_path(out->scene, "scenes", ".scene", found, sizeof found))
    set_text(out->scene, found);
  set_text(out->fcu, options->fcu);
  set_text(out->tracker, options->tracker);
  set_text(out->fcu2, options->fcu2);
  set_text(out->lcm, lcm_url(options, out));
  set_text(out->black_box, options->black_box);
}

// What is one of a few words. 0, or -1 with the words in err.
static int set_choices(const gv_options *options, gv_settings *out, char *err, size_t err_size) {
  if (options->narrow && gv_settings_set_narrow(&out->engine, options->narrow)) {
    snprintf(err, err_size, "--narrow \"%.40s\" is not known; give core or libccd", options->narrow);
    return -1;
  }
  if (options->solver && gv_settings_set_solver(&out->engine, options->solver)) {
    snprintf(err, err_size, "--solver \"%.40s\" is not known; give auto, newton, dantzig or quickstep",
             options->solver);
    return -1;
  }
  if (options->sync && strcmp(options->sync, "device") != 0) {
    snprintf(err, err_size,
             "--sync \"%.40s\" is none; write --sync device, or leave it out for the loop's own clock",
             options->sync);
    return -1;
  }
  return 0;
}

static void set_process(const gv_options *options, gv_settings *out) {
  out->strict = out->strict || options->strict;
  out->sync_device = out->sync_device || options->sync;
  if (options->rate_hz > 0.0) {
    out->rate_hz = options->rate_hz;
    out->engine.step_s = 1.0 / options->rate_hz;
  }
  if (!options->no_rt)
    return;
  out->rt_priority = 0;
  out->mlock = false;
  out->cpu_dma_latency = false;
}

// The name of a setting that is out of its range, of whatever room; null: none.
static const char *unsound(const gv_settings *settings) {
  const char *field = gv_config_check(&settings->engine);
  if (!field)
    field = gv_limiter_check(&settings->limiter);
  if (!field)
    field = gv_safety_check(&settings->safety);
  return field ? field : gv_passivity_check(&settings->passivity);
}

int gv_options_settings(const gv_options *options, gv_settings *out, char *err, size_t err_size) {
  gv_settings_default(out);
  if (options->config && gv_settings_load(options->config, out, err, err_size))
    return -1;
  set_names(options, out);
  set_process(options, out);
  if (set_choices(options, out, err, err_size))
    return -1;
  if (out->rate_hz < GV_RATE_MIN_HZ || out->rate_hz > GV_RATE_MAX_HZ) {
    snprintf(err, err_size, "rate %g Hz is out of range; give a number from %d to %d", out->rate_hz,
             GV_RATE_MIN_HZ, GV_RATE_MAX_HZ);
    return -1;
  }
  out->engine.period_s = 1.0 / out->rate_hz;
  gv_settings_second(out);
  const char *field = unsound(out);
  if (!field)
    return 0;
  snprintf(err, err_size, "configuration: %s is not finite or out of range; correct it in %s", field,
           options->config ? options->config : "the defaults");
  return -1;
}

const char *gv_options_help(void) {
  return "gloved: the daemon for force-feedback gloves. Takes glove and tracker frames, simulates hand and "
         "objects,\n"
         "sends the forces back, and publishes the state over LCM.\n"
         "\n"
         "  --config FILE     settings (command line over this file over the defaults)\n"
         "  --scene FILE      objects of the world (data/scenes/box.scene)\n"
         "  --fcu URL         where the frames come from and the forces go to:\n"
         "                      sim:                        a simulated user in this process (default)\n"
         "                      sim:SCRIPT?device=real      his script and device; see data/scripts\n"
         "                      hand:?listen=PORT           keys or sliders move the hand (gloved-hand); no "
         "force leaves\n"
         "                      trace:FILE                  a recording (candump -L), in real time\n"
         "                      trace:FILE?speed=0          the same as fast as possible\n"
         "                      can:IFACE                   a CAN interface (CAN FD where it can)\n"
         "                      udp://HOST:PORT?listen=PORT  CAN frames in UDP (cannelloni)\n"
         "                      serial:DEV?type=cyberglove  a bare glove, without forces; with --tracker\n"
         "                      serial:DEV?type=lucidglove  a glove with five brakes; with --tracker\n"
         "                      serial:DEV?type=doglove&servos=DEV  five servos; with --tracker\n"
         "  --tracker URL     a tracker of its own; otherwise the poses come with the frames:\n"
         "                      serial:DEV?type=fastrak     Polhemus FASTRAK, receiver 1 head, 2 hand\n"
         "  --fcu2 URL        device of a second hand, the other side's, in the same world (as --fcu; its "
         "tracker:\n"
         "                      tracker2 in --config)\n"
         "  --rate HZ         periods per second, 100 to 10000 (1000)\n"
         "  --narrow core|libccd  narrow phase of the collision detection (core)\n"
         "  --sync device     a step begins with the glove's frame; without one, by the loop's own clock\n"
         "  --solver NAME     contact solver: auto (newton; what it leaves to ODE's), newton, dantzig or "
         "quickstep\n"
         "  --duration S      end after S seconds\n"
         "  --lcm URL|none    where to publish (LCM_DEFAULT_URL, else\n"
         "                    udpm://239.255.76.67:7667?ttl=0)\n"
         "  --log FILE.lcm    write what is published into a log, too\n"
         "  --record FILE     write every frame in and out as a candump -L log; --fcu trace:FILE replays it\n"
         "  --black-box DIR|none  folder for the ten seconds before a fault (~/.local/state/gloved, a "
         "service's own)\n"
         "  --summary FILE    write results and timing as JSON at exit\n"
         "  --strict          any system call of the real-time thread that it does not need ends the program "
         "(seccomp)\n"
         "  --no-rt           ordinary scheduling and memory\n"
         "  --doctor [--json] judge this machine for these settings, with what mends it; exit code: 0 pass, "
         "1 warn, 2 fail\n"
         "  --print-config    write every setting with its default and what it is: a file for --config\n"
         "  --check           load and check everything, say what was found, and end\n"
         "  --help, --version\n"
         "\n"
         "Exit codes: 0 done, 1 fault while running (forces were brought to zero), 2 bad usage or input.\n";
}
