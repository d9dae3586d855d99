// SPDX-License-Identifier: BSD-3-Clause
// gloved-calibrate: walks a person through flat hand, fist and pinch, and writes
// the calibration of the glove.
//
//   gloved-calibrate --fcu URL [--out FILE] [--from FILE] [--side right|left] [--auto]
//
// URL: any of gloved's (serial:DEVICE?type=cyberglove, udp:, can:, sim:SCRIPT, trace:FILE). FILE (glove.cal)
// is then named in the configuration as `calibration`; a file that is there already becomes FILE.old.
// --from: the calibration whose slopes the sensors keep that no posture moves (the built-in one). --auto: no
// questions; each new posture in which the hand rests is the next one; a recording or a simulated user runs
// as fast as it can. What it does and refuses: src/daemon/calibrate.h. Exit code: 0 written, 1 refused
// (nothing written), 2 bad usage or input.
#include <errno.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "gloved/drivers.h"
#include "daemon/load/calibrate.h"
#include "daemon/load/devices.h"
#include "gloved/fcu.h"
#include "tools/program.h"

static const char help_text[] =
    "gloved-calibrate: walks a person through flat hand, fist and pinch, and writes the calibration of the "
    "glove.\n"
    "\n"
    "  --fcu URL            as of gloved: serial:DEVICE?type=cyberglove, udp:, can:, sim:SCRIPT, trace:FILE\n"
    "  --out FILE           the calibration (glove.cal); one that is there becomes FILE.old\n"
    "  --from FILE          whose slopes the sensors keep that no posture moves (the built-in one)\n"
    "  --side right|left    hand (right)\n"
    "  --auto               no questions: each new posture in which the hand rests is the next one\n"
    "  --help, --version\n"
    "\n"
    "Name the file in the configuration as calibration.\n"
    "Exit codes: 0 written, 1 refused (nothing written), 2 bad usage or input.\n";

enum { FRAMES = 64, WAIT_S = 20, SILENCE_S = 3, TRIES = 3 };

typedef struct tool {
  gv_settings settings;
  const char *out;
  bool automatic;
  gv_driver driver;
  gv_pace pace;
  gv_calibrator calibrator;
  int64_t start_ns, now_ns;  // of the clock that the driver gets
  uint64_t samples, bad;
  bool left;  // the newest sample's hand
  char err[1024];
} tool;

static tool all;

// ---- time and samples -----------------------------------------------------------------------------

static int64_t clock_ns(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

// A millisecond on: of the clock, or, where nobody waits, of the recording.
static void next_ms(void) {
  const struct timespec ms = {0, 1000000};
  if (all.automatic && all.pace != GV_PACE_LIVE) {
    all.now_ns += 1000000;
    return;
  }
  nanosleep(&ms, NULL);
  all.now_ns = clock_ns() - (all.pace == GV_PACE_LIVE ? 0 : all.start_ns);
}

static void take_samples(void) {
  gv_frame frame[FRAMES];
  const int n = all.driver.poll(all.driver.self, all.now_ns, frame, FRAMES);
  for (int i = 0; i < n; i++) {
    gv_glove_msg msg;
    if (frame[i].id != GV_ID_GLOVE)
      continue;
    if (gv_fcu_unpack_glove(&frame[i], &msg) || (msg.flags & GV_GLOVE_SENSOR_FAULT)) {
      all.bad++;
      continue;
    }
    all.samples++;
    all.left = (msg.flags & GV_GLOVE_LEFT) != 0;
    gv_calibrator_sample(&all.calibrator, frame[i].stamp_ns, msg.raw);
  }
}

// Nothing came in the last `idle` milliseconds in which this program ran: a machine that
// stands still is no silent glove.
static bool silent(int idle_ms) { return idle_ms > SILENCE_S * 1000 || all.driver.ended(all.driver.self); }

// ---- one posture ----------------------------------------------------------------------------------

static void show_progress(void) {
  const int restless = gv_calibrator_restless(&all.calibrator);
  if (all.automatic || !isatty(STDOUT_FILENO))
    return;
  if (restless < 0)
    printf("\r  hold still %3.0f %%\033[K", 100 * gv_calibrator_rest(&all.calibrator));
  else
    printf("\r  not yet still: %s moves by %.0f counts\033[K", gv_sensor_name(restless),
           all.calibrator.spread[restless]);
  fflush(stdout);
}

// Until the hand rests in a new posture. False after WAIT_S, or when nothing comes any more.
static bool wait_for_rest(void) {
  int idle_ms = 0;
  for (int ms = 0; ms < WAIT_S * 1000 && !silent(idle_ms); ms++) {
    const uint64_t samples = all.samples;
    next_ms();
    take_samples();
    idle_ms = all.samples == samples ? idle_ms + 1 : 0;
    if (gv_calibrator_rest(&all.calibrator) >= 1.0 && gv_calibrator_moved(&all.calibrator))
      return true;
    if (ms % 100 == 0)
      show_progress();
  }
  return false;
}

static void complain(void) {
  char line[GV_CALIBRATE_PROBLEMS][GV_CALIBRATE_TEXT];
  const int n = gv_calibrator_complaints(&all.calibrator, line);
  for (int i = 0; i < n; i++)
    fprintf(stderr, "gloved-calibrate: %s\n", line[i]);
}

// The person presses Enter; the samples of the meantime are let go. False at the end of input.
static bool wait_for_enter(void) {
  struct pollfd in = {STDIN_FILENO, POLLIN, 0};
  char text[256];
  for (;;) {
    next_ms();
    take_samples();
    if (poll(&in, 1, 0) > 0)
      return fgets(text, sizeof text, stdin) != NULL;
  }
}

static int ask_for_posture(gv_posture posture) {
  printf("\n%d of %d, %s: %s.\n  Press Enter when you are there, and hold still.\n", (int)posture + 1,
         (int)GV_POSTURES, gv_posture_name(posture), gv_posture_how(posture));
  fflush(stdout);
  if (wait_for_enter())
    return 0;
  fprintf(stderr, "gloved-calibrate: no answer; nothing was written\n");
  return 2;
}

static int take_posture(gv_posture posture) {
  for (int tries = 0; tries < (all.automatic ? 1 : TRIES); tries++) {
    if (!all.automatic && ask_for_posture(posture))
      return 2;
    gv_calibrator_wait(&all.calibrator);
    const bool rested = wait_for_rest();
    if (!all.automatic)
      printf("\r\033[K");
    if (rested) {
      gv_calibrator_take(&all.calibrator);
      printf("  %s: taken\n", gv_posture_name(posture));
      return 0;
    }
    complain();
  }
  return 1;
}

// ---- result ---------------------------------------------------------------------------------------

static void show_table(void) {
  const gv_calibrator *c = &all.calibrator;
  printf("\n  %-22s %9s %9s %9s %7s\n", "counts", "flat hand", "fist", "pinch", "noise");
  for (int i = 0; i < GV_SENSORS; i++)
    printf("  %-22s %9.1f %9.1f %9.1f %7.0f\n", gv_sensor_name(i), c->raw[0][i], c->raw[1][i], c->raw[2][i],
           fmax(c->noise[0][i], fmax(c->noise[1][i], c->noise[2][i])));
  printf("\n");
}

// What the file says of itself on top.
static void describe(char *out, size_t size) {
  const bool serial = strncmp(all.settings.fcu, "serial:", 7) == 0;
  int n = snprintf(out, size,
                   "Two points per sensor of a %s glove, taken by gloved-calibrate from %s\n"
                   "(flat hand, fist, pinch). Finger abduction, palm arch and wrist: zero from the flat "
                   "hand, slope as before.",
                   all.left ? "left" : "right", all.settings.fcu);
  if (!serial || n < 0 || (size_t)n >= size)
    return;
  const gv_serial_report r = gv_serial_report_of(&all.driver);
  n += snprintf(out + n, size - (size_t)n, "\nThe glove has %d sensors%s.", r.sensors,
                r.sensors < GV_SENSORS ? "; the distal joints are two thirds of the middle ones" : "");
  for (int i = 0; r.calibrated && i < r.sensors && (size_t)n < size; i++)
    n += snprintf(out + n, size - (size_t)n, "%s %d/%d", i ? "" : " Its own offset/gain:", r.offset[i],
                  r.gain[i]);
}

// What stands at --out stays as FILE.old. 1: it does, 0: there was nothing, -1: it cannot.
static int keep_old(char *old, size_t size) {
  snprintf(old, size, "%s.old", all.out);
  unlink(old);
  if (link(all.out, old) == 0)
    return 1;
  return errno == ENOENT ? 0 : -1;
}

static int write_file(const gv_calibration *cal) {
  char comment[2048], old[GV_SETTING_TEXT + 8];
  gv_calibration back;
  const int kept = keep_old(old, sizeof old);
  describe(comment, sizeof comment);
  if (kept < 0)
    snprintf(all.err, sizeof all.err, "%s cannot be kept as %s; move it away", all.out, old);
  if (kept < 0 || gv_calibration_save(all.out, cal, comment, all.err, sizeof all.err) ||
      gv_calibration_load(all.out, &back, all.err, sizeof all.err)) {
    fprintf(stderr, "gloved-calibrate: %s\n", all.err);
    return 2;
  }
  printf("%s written%s%s; name it in the configuration: calibration = \"%s\";\n", all.out,
         kept ? ", what was there is now " : "", kept ? old : "", all.out);
  return 0;
}

static int finish(void) {
  char problem[GV_CALIBRATE_PROBLEMS][GV_CALIBRATE_TEXT];
  gv_calibration cal;
  show_table();
  const int n = gv_calibrator_finish(&all.calibrator, &all.settings.engine.calibration, &cal, problem);
  for (int i = 0; i < n; i++)
    fprintf(stderr, "gloved-calibrate: %s\n", problem[i]);
  if (n == 0)
    return write_file(&cal);
  fprintf(stderr, "gloved-calibrate: refused, nothing was written; put that right and begin again\n");
  return 1;
}

// ---- command line ---------------------------------------------------------------------------------

static int usage(const char *what, const char *which) {
  fprintf(stderr, "gloved-calibrate: %s%s; see gloved-calibrate --help\n", what, which);
  return 2;
}

// Before the walk and not after it: can the file be written?
static int check_place(void) {
  char beside[GV_SETTING_TEXT + 8];
  snprintf(beside, sizeof beside, "%s.new", all.out);
  FILE *file = fopen(beside, "w");
  if (!file) {
    fprintf(stderr, "gloved-calibrate: --out %s: cannot be written (%s); choose another place\n", all.out,
            strerror(errno));
    return -1;
  }
  fclose(file);
  unlink(beside);
  return 0;
}

static int read_options(int argc, char **argv) {
  const char *from = NULL;
  const char *fcu = NULL;
  gv_settings *s = &all.settings;
  gv_settings_default(s);
  all.out = "glove.cal";
  for (int i = 1; i < argc; i++) {
    const char *name = argv[i];
    const char *value = i + 1 < argc ? argv[i + 1] : NULL;
    if (strcmp(name, "--auto") == 0) {
      all.automatic = true;
      continue;
    }
    if (!value)
      return usage("unknown option or no value: ", name);
    if (strlen(value) >= GV_SETTING_TEXT)
      return usage("too long: ", name);
    if (strcmp(name, "--fcu") == 0)
      fcu = value;
    else if (strcmp(name, "--out") == 0)
      all.out = value;
    else if (strcmp(name, "--from") == 0)
      from = value;
    else if (strcmp(name, "--side") == 0 && strcmp(value, "left") == 0)
      s->engine.hand.side = GV_LEFT;
    else if (strcmp(name, "--side") != 0 || strcmp(value, "right") != 0)
      return usage("unknown option or value: ", name);
    i++;
  }
  if (!fcu)
    return usage("--fcu is missing", "");
  snprintf(s->fcu, sizeof s->fcu, "%s", fcu);
  if (!all.automatic && !isatty(STDIN_FILENO))
    return usage("nobody is at the keyboard to press Enter; add --auto", "");
  if (check_place())
    return 2;
  if (from && gv_calibration_load(from, &s->engine.calibration, all.err, sizeof all.err))
    return usage(all.err, "");
  return 0;
}

// A LucidGlove whose firmware turns the servos the other way round brakes where it should
// be free. Only a hand can tell.
static int ask_for_free_fingers(void) {
  struct pollfd in = {STDIN_FILENO, POLLIN, 0};
  char answer[256] = "";
  if (gv_fcu_channel(all.settings.fcu)->kind != GV_CHANNEL_BRAKE)
    return 0;
  if (all.automatic) {
    printf(
        "  brakes: nobody was asked whether the fingers are free; see flip= in include/gloved/drivers.h\n");
    return 0;
  }
  printf("\nBrakes: they are let go now. Bend every finger. Do all of them move freely? [y/n]\n");
  fflush(stdout);
  while (poll(&in, 1, 0) == 0) {
    next_ms();
    take_samples();
  }
  if (!fgets(answer, sizeof answer, stdin))
    return 2;
  if (answer[0] == 'y' || answer[0] == 'Y')
    return 0;
  const bool flipped = strstr(all.settings.fcu, "flip=yes") != NULL;
  fprintf(stderr,
          "gloved-calibrate: the firmware's FLIP_FORCE_FEEDBACK does not fit the glove; give flip=%s in the "
          "URL, and begin again\n",
          flipped ? "no" : "yes");
  return 1;
}

static int calibrate(void) {
  int error = 0;
  gv_calibrator_init(&all.calibrator);
  error = ask_for_free_fingers();
  for (int i = 0; i < GV_POSTURES && !error; i++)
    error = take_posture((gv_posture)i);
  if (!error)
    error = finish();
  else if (error == 1)
    fprintf(stderr, "gloved-calibrate: refused, nothing was written (%llu samples came, %llu were bad)\n",
            (unsigned long long)all.samples, (unsigned long long)all.bad);
  return error;
}

int main(int argc, char **argv) {
  gv_keep_standard_files();
  if (program_answers(argc, argv, help_text))
    return 0;
  int error = read_options(argc, argv);
  if (error)
    return error;
  if (gv_fcu_open(&all.settings, &all.driver, &all.pace, all.err, sizeof all.err)) {
    fprintf(stderr, "gloved-calibrate: %s\n", all.err);
    return 2;
  }
  all.start_ns = clock_ns();
  all.now_ns = all.pace == GV_PACE_LIVE ? all.start_ns : 0;
  error = calibrate();
  all.driver.close(all.driver.self);
  return error;
}
