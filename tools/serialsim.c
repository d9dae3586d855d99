// SPDX-License-Identifier: BSD-3-Clause
// serialsim: a simulated FASTRAK, CyberGlove or LucidGlove behind a pseudo-terminal, in real time.
//
//   serialsim fastrak|cyberglove|lucidglove|doglove|doglove_servos [--script FILE]
//             [--device best|real|NAME=VALUE] [--sensors 18|22] [--seed N] [--garbage P] [--gap P]
//             [--noise P] [--reset S] [--unplug S]
//             [--link PATH] [--config FILE] [--duration S]
//
// It prints the terminal's name (with --link a symbolic link of that name, which stays the same when the
// cable is out and in): that is the DEVICE of gloved's URLs. P: chance per record (noise: per byte).
// --reset: power off and on every S seconds; --unplug: the cable out every S seconds, for half a second.
// --config: where the tracker's transmitter stands (tracker_to_world). The script starts at once and
// begins anew when it ends. 16-bit frames come when the driver asks for them (wide=yes). One thread:
// sleep a millisecond, read, step, write.
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#include "gloved/drivers.h"
#include "drivers/serial_sim.h"
#include "daemon/load/config_load.h"
#include "tools/program.h"

static const char help_text[] =
    "serialsim: a simulated FASTRAK, CyberGlove or LucidGlove behind a pseudo-terminal, in real time.\n"
    "\n"
    "  serialsim fastrak|cyberglove|lucidglove|doglove|doglove_servos [OPTION VALUE...]\n"
    "  --script FILE        what the user does (power_box), over and over\n"
    "  --device best|real|NAME=VALUE       the device and its defects (include/gloved/sim.h)\n"
    "  --sensors 18|22      of the CyberGlove\n"
    "  --seed N             of the defects\n"
    "  --garbage P, --gap P chance per record;  --noise P  chance per byte\n"
    "  --reset S            power off and on every S seconds\n"
    "  --unplug S           the cable out every S seconds, for half a second\n"
    "  --link PATH          a symbolic link to the terminal that stays the same\n"
    "  --config FILE        where the tracker's transmitter stands (tracker_to_world)\n"
    "  --duration S         end after S seconds\n"
    "  --help, --version\n"
    "\n"
    "Prints the terminal's name, the DEVICE of gloved's URL serial:DEVICE?type=...\n"
    "Exit codes: 0 done, 2 bad usage or input.\n";

enum { PERIOD_NS = 1000000, OUT_NS = 500000000, BYTES = 4096 };

static const char *const kinds[SERIAL_SIM_KINDS] = {[SERIAL_SIM_FASTRAK] = "fastrak",
                                                    [SERIAL_SIM_CYBERGLOVE] = "cyberglove",
                                                    [SERIAL_SIM_LUCIDGLOVE] = "lucidglove",
                                                    [SERIAL_SIM_DOGLOVE] = "doglove",
                                                    [SERIAL_SIM_DOGLOVE_SERVOS] = "doglove_servos"};

typedef struct options {
  serial_sim_kind kind;
  const char *script, *link, *config;
  int sensors;
  double seed, reset_s, unplug_s, duration_s;  // 0: never, without end
  serial_sim_faults faults;
} options;

static struct {
  serial_sim device;
  gv_sim_script script;
  gv_settings settings;
  int master, slave;  // -1: the cable is out
  char err[512];
} all = {.master = -1, .slave = -1};

static volatile sig_atomic_t interrupted;
static void on_signal(int number) {
  (void)number;
  interrupted = 1;
}

// ---- command line ---------------------------------------------------------------------------------

static int fail(const char *what, const char *which) {
  fprintf(stderr, "serialsim: %s%s; see serialsim --help\n", what, which);
  return 2;
}

static int read_number(const char *option, const char *value, double min, double max, double *out) {
  return program_number("serialsim", option, value, min, max, out);
}

static int set_device(const char *value) {
  char text[128];
  gv_sim_device *device = &all.script.device;
  snprintf(text, sizeof text, "%s", value);
  char *equals = strchr(text, '=');
  if (strcmp(value, "best") == 0)
    *device = gv_sim_device_best();
  else if (strcmp(value, "real") == 0)
    *device = gv_sim_device_real();
  else if (!equals)
    return fail("--device wants best, real or NAME=VALUE, not ", value);
  if (!equals) {
    gv_serial_sim_adapt(device);
    return 0;
  }
  *equals = '\0';
  if (gv_sim_device_set(device, text, equals + 1, all.err, sizeof all.err) == 0)
    return 0;
  fprintf(stderr, "serialsim: --device %s: %s\n", value, all.err);
  return 2;
}

static int read_option(const char *name, const char *value, options *o) {
  double sensors;
  if (strcmp(name, "--script") == 0 || strcmp(name, "--config") == 0)
    return 0;  // read before the others
  if (strcmp(name, "--link") == 0)
    o->link = value;
  else if (strcmp(name, "--device") == 0)
    return set_device(value);
  else if (strcmp(name, "--garbage") == 0)
    return read_number(name, value, 0, 1, &o->faults.garbage);
  else if (strcmp(name, "--gap") == 0)
    return read_number(name, value, 0, 1, &o->faults.gap);
  else if (strcmp(name, "--noise") == 0)
    return read_number(name, value, 0, 1, &o->faults.noise);
  else if (strcmp(name, "--seed") == 0)
    return read_number(name, value, 1, 4294967295.0, &o->seed);
  else if (strcmp(name, "--reset") == 0)
    return read_number(name, value, 0.1, 86400, &o->reset_s);
  else if (strcmp(name, "--unplug") == 0)
    return read_number(name, value, 1, 86400, &o->unplug_s);
  else if (strcmp(name, "--duration") == 0)
    return read_number(name, value, 0.001, 86400, &o->duration_s);
  else if (strcmp(name, "--sensors") == 0) {
    if (read_number(name, value, 18, 22, &sensors))
      return 2;
    if (sensors != 18 && sensors != 22)
      return fail("--sensors wants 18 or 22, not ", value);
    o->sensors = (int)sensors;
  } else
    return fail("unknown option ", name);
  return 0;
}

// Script and configuration first, so that --device changes what the script says, whatever their order.
static int load_files(int argc, char **argv, options *o) {
  for (int i = 2; i + 1 < argc; i += 2) {
    if (strcmp(argv[i], "--script") == 0)
      o->script = argv[i + 1];
    if (strcmp(argv[i], "--config") == 0)
      o->config = argv[i + 1];
  }
  gv_settings_default(&all.settings);
  if (gv_sim_script_load(o->script, &all.script, all.err, sizeof all.err) ||
      (o->config && gv_settings_load(o->config, &all.settings, all.err, sizeof all.err))) {
    fprintf(stderr, "serialsim: %s\n", all.err);
    return 2;
  }
  gv_serial_sim_adapt(&all.script.device);
  return 0;
}

static int read_options(int argc, char **argv, options *o) {
  *o = (options){.script = "data/scripts/power_box.user", .sensors = GV_SENSORS, .seed = 1};
  if (argc < 2)
    return fail("which device?", "");
  while (o->kind < SERIAL_SIM_KINDS && strcmp(argv[1], kinds[o->kind]) != 0)
    o->kind++;
  if (o->kind == SERIAL_SIM_KINDS)
    return fail("unknown device ", argv[1]);
  int error = load_files(argc, argv, o);
  for (int i = 2; i < argc && !error; i += 2)
    error = i + 1 < argc ? read_option(argv[i], argv[i + 1], o) : fail("no value for ", argv[i]);
  if (error)
    return error;
  if (gv_sim_device_check(&all.script.device, all.err, sizeof all.err))
    return fail("--device: ", all.err);
  return 0;
}

// ---- the cable ------------------------------------------------------------------------------------

// The slave stays open here: the line then outlives a driver that closes it and opens it again.
static int plug(const char *link) {
  struct termios t;
  all.master = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  const char *name = all.master >= 0 && grantpt(all.master) == 0 && unlockpt(all.master) == 0
                         ? ptsname(all.master)
                         : NULL;
  all.slave = name ? open(name, O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC) : -1;
  if (all.slave < 0 || tcgetattr(all.slave, &t) != 0) {
    fprintf(stderr, "serialsim: no pseudo-terminal (%s); mount /dev/pts\n", strerror(errno));
    return 2;
  }
  cfmakeraw(&t);
  tcsetattr(all.slave, TCSANOW, &t);
  if (link)
    unlink(link);
  if (link && symlink(name, link) != 0) {
    fprintf(stderr, "serialsim: --link %s: %s; give a name in a folder of yours\n", link, strerror(errno));
    return 2;
  }
  printf("%s\n", link ? link : name);
  fflush(stdout);
  return 0;
}

static void unplug(const char *link) {
  close(all.slave);
  close(all.master);
  all.master = all.slave = -1;
  if (link)
    unlink(link);
}

// ---- run ------------------------------------------------------------------------------------------

static void exchange_bytes(int64_t now_ns) {
  static uint8_t byte[BYTES];
  ssize_t n;
  while (all.master >= 0 && (n = read(all.master, byte, sizeof byte)) > 0)
    gv_serial_sim_receive(&all.device, byte, (int)n);
  const int count = gv_serial_sim_advance(&all.device, now_ns, byte, sizeof byte);
  // Nobody reads: what does not fit is lost, as on a real line.
  if (all.master >= 0 && count > 0 && write(all.master, byte, (size_t)count) < 0 && errno != EAGAIN)
    interrupted = 1;
}

static bool due(double every_s, int64_t ms) {
  return every_s > 0 && ms > 0 && ms % (int64_t)(every_s * 1000) == 0;
}

// The device again from the start of its script, as the driver has set it up.
static void begin_anew(const options *o, int64_t *start_ns, int64_t ms) {
  static serial_sim fresh;
  gv_serial_sim_init(&fresh, o->kind, &all.script, &all.settings.T_world_tracker, (uint64_t)o->seed);
  all.device.sim = fresh.sim;
  all.device.waits_since_ns = fresh.waits_since_ns;
  *start_ns = ms * PERIOD_NS;
}

static int run(const options *o) {
  struct timespec next;
  int64_t start_ns = 0;
  int64_t out_until_ms = 0;
  clock_gettime(CLOCK_MONOTONIC, &next);
  for (int64_t ms = 0; !interrupted && (o->duration_s <= 0 || (double)ms < o->duration_s * 1000); ms++) {
    next.tv_nsec += PERIOD_NS;
    if (next.tv_nsec >= 1000000000)
      next = (struct timespec){next.tv_sec + 1, next.tv_nsec - 1000000000};
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &next, NULL);
    if (gv_sim_ended(&all.device.sim))
      begin_anew(o, &start_ns, ms);
    if (due(o->reset_s, ms))
      gv_serial_sim_reset(&all.device);
    if (due(o->unplug_s, ms) && all.master >= 0) {
      unplug(o->link);
      out_until_ms = ms + OUT_NS / PERIOD_NS;
    }
    if (all.master < 0 && ms >= out_until_ms && plug(o->link))
      return 2;
    exchange_bytes(ms * PERIOD_NS - start_ns);
  }
  return 0;
}

static void report(const serial_sim *s) {
  fprintf(stderr,
          "serialsim: %llu records whole, %llu damaged, %llu bytes of garbage, %llu commands, %llu refused\n",
          (unsigned long long)s->whole, (unsigned long long)s->damaged, (unsigned long long)s->garbage_bytes,
          (unsigned long long)s->commands, (unsigned long long)s->refused);
  if (s->kind == SERIAL_SIM_DOGLOVE_SERVOS) {
    const int *most = s->servos.current_max_ma;
    fprintf(stderr, "serialsim: largest currents %d %d %d %d %d mA, %llu watchdogs, %llu writes refused\n",
            most[0], most[1], most[2], most[3], most[4], (unsigned long long)s->servos.trips,
            (unsigned long long)s->servos.refused);
  }
  if (s->kind != SERIAL_SIM_LUCIDGLOVE)
    return;
  const int *max = s->brake_max;
  const int *now = s->brake;
  fprintf(
      stderr,
      "serialsim: %llu lines of brakes, %llu unasked, largest %d %d %d %d %d, at the end %d %d %d %d %d\n",
      (unsigned long long)s->brake_lines, (unsigned long long)s->brakes_unasked, max[0], max[1], max[2],
      max[3], max[4], now[0], now[1], now[2], now[3], now[4]);
}

int main(int argc, char **argv) {
  gv_keep_standard_files();
  if (program_answers(argc, argv, help_text))
    return 0;
  options o;
  int error = read_options(argc, argv, &o);
  if (error)
    return error;
  struct sigaction action;
  memset(&action, 0, sizeof action);
  action.sa_handler = on_signal;
  sigaction(SIGINT, &action, NULL);
  sigaction(SIGTERM, &action, NULL);
  gv_serial_sim_init(&all.device, o.kind, &all.script, &all.settings.T_world_tracker, (uint64_t)o.seed);
  all.device.sensors = o.sensors;
  all.device.faults = o.faults;
  error = plug(o.link);
  if (!error)
    error = run(&o);
  if (all.master >= 0)
    unplug(o.link);
  report(&all.device);
  return error;
}
