// SPDX-License-Identifier: BSD-3-Clause
// fcusim: the simulated force control unit on the other end of a UDP wire (cannelloni
// v2) or a CAN bus, in real time.
//
//   fcusim --udp udp://HOST:PORT?listen=PORT|--can IFACE [--script FILE] [--device best|real|NAME=VALUE]
//          [--seed N] [--wait S] [--duration S] [--fault KIND@S] [--record FILE] [--report FILE.json]
//          [--forces FILE.csv]
//
// It sends at once, the user holding still, and starts the script with the first FORCE_COMMAND or after
// --wait seconds, so that neither side has to be started first. --record writes every frame, sent and
// received, as candump -L text; --forces a line for each millisecond of the device: what it heard and what
// its tendons pull. --fault spoils device or link from a moment of the script on (fcusim/fault.h). Ends with
// the script (or --duration). Exit code: 0 done, 1 a command broke a limit (maximum, slew, checksum) or they
// came too slowly for the watchdog, 2 bad usage or input. One thread: sleep to the next millisecond, receive,
// step, send. The simulated world takes one step a period: where the host stalls, it stalls with it.
#include "daemon/load/about.h"
#include "daemon/tell/about_json.h"
#include "gloved/drivers.h"
#include "gloved/sim.h"

#include "fcusim/fault.h"
#include "tools/program.h"

static const char help_text[] =
    "fcusim: a simulated force control unit with a scripted user, on the other end of gloved's wire, in real "
    "time.\n"
    "\n"
    "  --udp udp://HOST:PORT?listen=PORT   cannelloni v2 datagrams; or\n"
    "  --can IFACE          a CAN interface\n"
    "  --script FILE        what the user does (power_box; see data/scripts)\n"
    "  --device best|real|NAME=VALUE       the device and its defects; again for each NAME "
    "(include/gloved/sim.h),\n"
    "                       e.g. finger=relaxed|normal|firm, delay_s=0.002 (each way), glove_hz_max=90\n"
    "  --seed N             of the defects\n"
    "  --wait S             start the script after S seconds (10) where no command comes before\n"
    "  --duration S         end after S seconds; otherwise with the script\n"
    "  --fault KIND@S       spoil device or link from S seconds of the script on\n"
    "  --record FILE        every frame, sent and received, as a candump -L log\n"
    "  --report FILE.json   what the device saw\n"
    "  --forces FILE.csv    a line for each millisecond: what it heard and what its tendons pull\n"
    "  --help, --version\n"
    "\n"
    "Exit codes: 0 done, 1 a command broke a limit or they came too slowly, 2 bad usage or input.\n";

#include <errno.h>
#include <inttypes.h>
#include <sched.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { PERIOD_NS = 1000000, BUNDLE = 16 };  // 16 frames fit one datagram
// A recording stays in memory until it is this long (4 minutes): a disk makes a writer wait half a second.
enum { RECORD_BYTES = 64 << 20 };
static char record_buffer[RECORD_BYTES];

typedef struct options {
  const char *udp, *can, *script, *record, *report, *forces;
  double wait_s, duration_s;  // duration 0: the script's
  uint64_t seed;              // 0: the script's
} options;

typedef struct session {
  gv_sim sim;
  gv_sim_script script;
  gv_driver link;
  FILE *record, *forces;
  uint64_t stalls;  // periods left out
  fault fault;
  int64_t start_ns;  // device time at which the script started; negative: not yet
} session;

static session all;  // static: no heap, zeroed
static volatile sig_atomic_t interrupted;
static void on_signal(int number) {
  (void)number;
  interrupted = 1;
}

static int usage(const char *what, const char *which) {
  fprintf(stderr, "fcusim: %s%s; see fcusim --help\n", what, which);
  return 2;
}

static int set_device(gv_sim_device *device, const char *value) {
  char text[128], why[256];
  if (strcmp(value, "best") == 0) {
    *device = gv_sim_device_best();
    return 0;
  }
  if (strcmp(value, "real") == 0) {
    *device = gv_sim_device_real();
    return 0;
  }
  snprintf(text, sizeof text, "%s", value);
  char *equals = strchr(text, '=');
  if (!equals)
    return usage("--device wants best, real or NAME=VALUE, not ", value);
  *equals = '\0';
  if (gv_sim_device_set(device, text, equals + 1, why, sizeof why) == 0)
    return 0;
  fprintf(stderr, "fcusim: --device %s: %s\n", value, why);
  return 2;
}

static int read_number(const char *option, const char *value, double min, double max, double *out) {
  return program_number("fcusim", option, value, min, max, out);
}

// The script first, so that --device changes what it says, whatever their order.
static int load_script(int argc, char **argv, options *o) {
  for (int i = 1; i + 1 < argc; i += 2)
    if (strcmp(argv[i], "--script") == 0)
      o->script = argv[i + 1];
  char err[512];
  if (gv_sim_script_load(o->script, &all.script, err, sizeof err) == 0)
    return 0;
  fprintf(stderr, "fcusim: %s\n", err);
  return 2;
}

static int read_option(const char *name, const char *value, options *o) {
  double number = 0;
  int error = 0;
  if (strcmp(name, "--udp") == 0)
    o->udp = value;
  else if (strcmp(name, "--can") == 0)
    o->can = value;
  else if (strcmp(name, "--script") == 0)
    o->script = value;
  else if (strcmp(name, "--record") == 0)
    o->record = value;
  else if (strcmp(name, "--report") == 0)
    o->report = value;
  else if (strcmp(name, "--forces") == 0)
    o->forces = value;
  else if (strcmp(name, "--fault") == 0)
    error = fault_parse(value, &all.fault) ? 0 : usage("--fault KIND@SECONDS wants as KIND ", fault_kinds);
  else if (strcmp(name, "--device") == 0)
    error = set_device(&all.script.device, value);
  else if (strcmp(name, "--wait") == 0)
    error = read_number(name, value, 0, 3600, &o->wait_s);
  else if (strcmp(name, "--duration") == 0)
    error = read_number(name, value, 0.001, 86400, &o->duration_s);
  else if (strcmp(name, "--seed") == 0) {
    error = read_number(name, value, 1, 4294967295.0, &number);
    o->seed = (uint64_t)number;
  } else
    error = usage("unknown option ", name);
  return error;
}

static int read_options(int argc, char **argv, options *o) {
  *o = (options){.script = "data/scripts/power_box.user", .wait_s = 10};
  int error = load_script(argc, argv, o);
  for (int i = 1; i < argc && !error; i += 2)
    error = i + 1 < argc ? read_option(argv[i], argv[i + 1], o) : usage("no value for ", argv[i]);
  if (error)
    return error;
  if (!o->udp == !o->can)
    return usage("one of --udp and --can is needed", "");
  char why[128];
  if (gv_sim_device_check(&all.script.device, why, sizeof why))
    return usage("--device: ", why);
  return 0;
}

static int open_link(const options *o) {
  char url[64], err[512] = "";
  snprintf(url, sizeof url, "can:%.50s", o->can ? o->can : "");
  const int error = o->can ? gv_can_open(url, &all.link, err, sizeof err)
                           : gv_udp_open(o->udp, &all.link, err, sizeof err);
  if (err[0])
    fprintf(stderr, "fcusim: %s\n", err);
  if (!error && err[0])
    all.script.device.wire_count_n = GV_CLASSIC_TENSION_LSB_N;  // a classic interface
  return error;
}

static void record(const gv_frame *frame, int count) {
  char line[GV_LOG_LINE_MAX + 1];
  for (int i = 0; all.record && i < count; i++)
    fwrite(line, 1, (size_t)gv_log_format(&frame[i], "can0", line), all.record);
}

static int64_t clock_ns(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

static void sleep_until(int64_t ns) {
  struct timespec t = {.tv_sec = ns / 1000000000, .tv_nsec = ns % 1000000000};
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, NULL) == EINTR && !interrupted) {}
}

// Real-time scheduling where the machine lets us, below the engine's: a device does not wait for a desktop.
static void raise_priority(void) {
  struct sched_param p = {.sched_priority = 10};
  sched_setscheduler(0, SCHED_FIFO, &p);
}

static void receive(int64_t device_ns) {
  gv_frame frame[BUNDLE];
  int n;
  while ((n = all.link.poll(all.link.self, INT64_MAX, frame, BUNDLE)) > 0) {
    n = fault_apply(&all.fault, frame, n);
    for (int i = 0; i < n; i++) {
      gv_sim_receive(&all.sim, &frame[i]);
      frame[i].stamp_ns = device_ns;
    }
    record(frame, n);
  }
}

static void start_script(const options *o, int64_t device_ns) {
  bool commanded = gv_sim_report_of(&all.sim)->commands > 0;
  if (gv_sim_started(&all.sim) || (!commanded && (double)device_ns < o->wait_s * 1e9))
    return;
  gv_sim_start(&all.sim);
  all.start_ns = device_ns;
  if (commanded)
    printf("fcusim: the engine speaks; the script starts\n");
  else
    printf("fcusim: no command in %g s; the script starts all the same\n", o->wait_s);
  fflush(stdout);
}

// Device time, time of the script, whether the fault is on, good commands so far, applied tensions.
static void note_forces(int64_t device_ns) {
  if (!all.forces)
    return;
  const double *t = gv_sim_tension(&all.sim);
  fprintf(all.forces, "%.3f,%.3f,%d,%" PRIu64 ",%.4f,%.4f,%.4f,%.4f,%.4f\n", 1e-9 * (double)device_ns,
          all.start_ns < 0 ? -1.0 : 1e-9 * (double)(device_ns - all.start_ns), all.fault.active,
          gv_sim_report_of(&all.sim)->commands, t[0], t[1], t[2], t[3], t[4]);
}

static void run(const options *o) {
  int64_t next_ns = clock_ns();
  int64_t device_ns = 0;
  int64_t end_ns = o->duration_s > 0 ? (int64_t)(o->duration_s * 1e9) : INT64_MAX;
  while (!interrupted && device_ns < end_ns && !gv_sim_ended(&all.sim)) {
    gv_frame frame[BUNDLE];
    fault_time(&all.fault, all.start_ns < 0 ? -1.0 : 1e-9 * (double)(device_ns - all.start_ns));
    receive(device_ns);
    start_script(o, device_ns);
    int n;
    while ((n = gv_sim_advance(&all.sim, device_ns, frame, BUNDLE)) > 0) {
      n = fault_apply(&all.fault, frame, n);
      all.link.send(all.link.self, frame, n);
      record(frame, n);
    }
    note_forces(device_ns);
    device_ns += PERIOD_NS;
    next_ns += PERIOD_NS;
    int64_t late_ns = clock_ns() - next_ns;
    if (late_ns > 0) {
      all.stalls += (uint64_t)(late_ns / PERIOD_NS);
      next_ns += late_ns / PERIOD_NS * PERIOD_NS;
    }
    sleep_until(next_ns);
  }
}

// Where commands flow so slowly that the watchdog trips between them, a finger is pulled and let go all the
// time. A few drops in a second are a machine that stood still.
enum { DROPS_A_SECOND = 5 };
static bool too_slow(const gv_sim_report *r) { return r->drops_a_second > DROPS_A_SECOND; }
static bool limits_broken(const gv_sim_report *r) {
  return r->refused_frames || r->over_max || r->over_slew || too_slow(r);
}

static void print_summary(const gv_sim_report *r, const gv_driver_stats *link) {
  const double *t = r->tension_max_n;
  printf("fcusim: sent %" PRIu64 " frames (%" PRIu64 " lost and %" PRIu64 " late by script), %" PRIu64
         " commands taken, %" PRIu64 " missing, %" PRIu64 " repeated; ",
         r->sent, r->lost, r->late, r->commands, r->counter_gaps, r->repeated);
  printf("refused: %" PRIu64 " broken, %" PRIu64 " above the maximum, %" PRIu64
         " too fast; bad datagrams %" PRIu64 "\n",
         r->refused_frames, r->over_max, r->over_slew, link->bad);
  printf("fcusim: largest tensions %.2f %.2f %.2f %.2f %.2f N, fastest rise %.0f N/s, joints held back up to "
         "%.1f degrees; ",
         t[0], t[1], t[2], t[3], t[4], r->slew_max_n_per_s, r->deviation_max_rad * (180.0 / GV_PI));
  printf("watchdog let go %" PRIu64 " times (%" PRIu64
         " while commands flowed), at most %.1f ms after the last command; host "
         "stalled for %" PRIu64 " periods\n",
         r->watchdog_trips, r->watchdog_drops, 1e3 * r->zero_after_s, all.stalls);
  if (too_slow(r))
    printf("fcusim: commands too far apart: the watchdog let go up to %u times in a second\n",
           r->drops_a_second);
}

static gv_about about;  // what this run is made of

static int write_report(const char *path, const gv_sim_report *r, const gv_driver_stats *link) {
  FILE *file = fopen(path, "w");
  if (!file) {
    fprintf(stderr, "fcusim: %s: %s; give a file that can be written\n", path, strerror(errno));
    return 2;
  }
  const double *t = r->tension_max_n;
  const struct {
    const char *name;
    uint64_t value;
  } count[] = {{"sent", r->sent},
               {"lost", r->lost},
               {"late", r->late},
               {"commands", r->commands},
               {"counter_gaps", r->counter_gaps},
               {"repeated", r->repeated},
               {"refused_frames", r->refused_frames},
               {"over_max", r->over_max},
               {"over_slew", r->over_slew},
               {"foreign", r->foreign},
               {"bad_datagrams", link->bad},
               {"watchdog_trips", r->watchdog_trips},
               {"watchdog_drops", r->watchdog_drops},
               {"drops_a_second", r->drops_a_second},
               {"stalled_periods", all.stalls}};
  fprintf(file, "{\n  \"about\": ");
  gv_about_json(&about, file);
  fputs(",\n", file);
  for (size_t i = 0; i < sizeof count / sizeof count[0]; i++)
    fprintf(file, "  \"%s\": %" PRIu64 ",\n", count[i].name, count[i].value);
  fprintf(file, "  \"tension_max_n\": [%.4f, %.4f, %.4f, %.4f, %.4f],\n", t[0], t[1], t[2], t[3], t[4]);
  fprintf(file,
          "  \"slew_max_n_per_s\": %.2f,\n  \"deviation_max_rad\": %.6f,\n  \"zero_after_s\": %.4f\n}\n",
          r->slew_max_n_per_s, r->deviation_max_rad, r->zero_after_s);
  return fclose(file) == 0 ? 0 : 2;
}

// The scene is the engine's; here the script is what decides.
static void describe(const options *o) {
  gv_about_now(&about);
  snprintf(about.fcu, sizeof about.fcu, "%s%s", o->can ? "can:" : "", o->can ? o->can : o->udp);
  snprintf(about.hand, sizeof about.hand, "%s", all.script.side == GV_LEFT ? "left" : "right");
  if (o->script)
    gv_about_read_file(o->script, &about.settings);
}

int main(int argc, char **argv) {
  gv_keep_standard_files();
  if (program_answers(argc, argv, help_text))
    return 0;
  options o;
  char err[512];
  gv_about_command_line(argc, argv, about.command_line);
  int error = read_options(argc, argv, &o);
  if (error)
    return error;
  if (open_link(&o))
    return 2;
  if (o.record && !(all.record = fopen(o.record, "w"))) {
    fprintf(stderr, "fcusim: %s: %s; give a file that can be written\n", o.record, strerror(errno));
    return 2;
  }
  describe(&o);
  if (o.record && gv_about_write(&about, o.record, err, sizeof err)) {
    fprintf(stderr, "fcusim: %s\n", err);
    return 2;
  }
  if (all.record)
    setvbuf(all.record, record_buffer, _IOFBF, sizeof record_buffer);
  if (o.forces && !(all.forces = fopen(o.forces, "w"))) {
    fprintf(stderr, "fcusim: %s: %s; give a file that can be written\n", o.forces, strerror(errno));
    return 2;
  }
  if (all.forces)
    fputs("device_s,script_s,fault,commands,thumb_n,index_n,middle_n,ring_n,little_n\n", all.forces);
  all.start_ns = -1;
  raise_priority();
  signal(SIGINT, on_signal);
  signal(SIGTERM, on_signal);
  gv_sim_init(&all.sim, &all.script, NULL, o.seed);
  run(&o);
  const gv_sim_report *report = gv_sim_report_of(&all.sim);
  gv_driver_stats link = all.link.stats(all.link.self);
  print_summary(report, &link);
  all.link.close(all.link.self);
  if (all.record && fclose(all.record))
    error = usage("the recording could not be written: ", o.record);
  if (all.forces && fclose(all.forces))
    error = usage("the forces could not be written: ", o.forces);
  if (o.report)
    error = write_report(o.report, report, &link);
  return error ? error : limits_broken(report) ? 1 : 0;
}
