// SPDX-License-Identifier: BSD-3-Clause
// gloved, from the command line to the exit code. Set-up reads everything and takes all memory; then two
// threads run until the end: the real-time loop (loop.c: frames in, engine step, forces out) and this
// one, the slow one (slow.c: LCM, log, view); then the summary is written. For another scene by command
// the loop ends, and a new one goes on with the same devices. Start reading here, then loop.c,
// session.c, and src/engine/engine.c.
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "gloved/drivers.h"
#include "daemon/doctor/doctor.h"
#include "daemon/load/about.h"
#include "daemon/load/devices.h"
#include "daemon/load/replay.h"
#include "daemon/load/scene_doubts.h"
#include "daemon/load/scene_thread.h"
#include "daemon/loop/hands.h"
#include "daemon/loop/machine.h"
#include "daemon/options.h"
#include "daemon/tell/slow.h"
#include "daemon/tell/summary.h"
#include "daemon/load/world.h"
#include "gloved/version.h"

enum { OK = 0, FAULT = 1, BAD_INPUT = 2, ERROR_TEXT = 512, GIVE_UP_S = 2, READER_MS = 500 };

typedef struct program {
  gv_options options;
  gv_settings settings;
  gv_world world;
  gv_world next;  // the scene that a command asked for, without an engine; no memory: none
  gv_driver driver;
  gv_pace pace;
  gv_telemetry *telemetry;
  gv_recorder recorder;
  gv_black_box *black_box;           // null: none
  gv_about about;                    // what this run is made of
  gv_about recorded;                 // what the recording was made of that is replayed
  const char *scene_text;            // of the recording's scene, where its file is not as it was; else null
  gv_scene_thread loader;            // of `next`
  char next_scene[GV_SETTING_TEXT];  // file of `next`
  FILE *summary_file;                // null: not asked for
  gv_session session[GV_HANDS];
  gv_loop loop;
  gv_view view;
  gv_notify notify;
  gv_held held[GV_HANDS];
  char err[ERROR_TEXT];
} program;

static atomic_bool stop_requested, give_up;
static _Atomic(const gv_loop *) watched_loop;

static void on_signal(int number) {
  (void)number;
  atomic_store(&stop_requested, true);
  alarm(GIVE_UP_S);
}

// The loop has ended or is about to, and the slow thread may hang in a send that nobody takes: two
// seconds later the signal itself breaks that off, and nothing more is sent. An alarm from outside
// before that is a request to end.
static void on_alarm(int number) {
  const gv_loop *loop = atomic_load(&watched_loop);
  if (!atomic_load(&stop_requested) && loop && gv_loop_running(loop)) {
    on_signal(number);
    return;
  }
  atomic_store(&give_up, true);
  alarm(1);
}

// Every signal that would end the process without bringing the forces down. Left alone: those
// of a broken program (its device lets go by its watchdog), those that stop a process, and
// those that do nothing by default.
static bool ends_unasked(int number) {
  static const int left_alone[] = {SIGKILL, SIGSTOP, SIGSEGV, SIGBUS,   SIGFPE,  SIGILL,
                                   SIGTRAP, SIGABRT, SIGSYS,  SIGTSTP,  SIGTTIN, SIGTTOU,
                                   SIGCHLD, SIGCONT, SIGURG,  SIGWINCH, SIGPIPE, SIGALRM};
  for (size_t i = 0; i < sizeof left_alone / sizeof left_alone[0]; i++)
    if (number == left_alone[i])
      return false;
  return true;
}

static void catch_signals(void) {
  struct sigaction action;
  memset(&action, 0, sizeof action);
  action.sa_handler = on_signal;
  for (int number = 1; number <= SIGRTMAX; number++)
    if (ends_unasked(number))
      sigaction(number, &action, NULL);  // the two that the C library keeps for itself are refused
  action.sa_handler = on_alarm;
  sigaction(SIGALRM, &action, NULL);
  signal(SIGPIPE, SIG_IGN);  // a reader of our output that goes away must not end a running force loop
}

// ---- set-up: 0, or negative with one line in p->err ---------------------------------------------------

// Collision detection's share of the period, in operations of this machine; in a replay those of the
// default, so that it does not depend on the machine.
static void set_budget(program *p) {
  gv_settings *settings = &p->settings;
  const bool replay = strncmp(settings->fcu, "trace:", 6) == 0 || strstr(settings->fcu, "speed=0");
  if (!replay && !settings->operations_given)
    settings->engine.operations_per_s = gv_clamp(gv_machine_operations_per_s(settings->engine.narrow), 1e6,
                                                 1e11);
}

static int open_world(program *p) {
  set_budget(p);
  if (gv_world_load(&p->world, p->settings.scene, p->scene_text, &p->settings.engine, p->err, sizeof p->err))
    return -1;
  if (gv_world_start(&p->world, &p->settings.engine) == 0)
    return 0;
  snprintf(p->err, sizeof p->err, "%s: the engine does not start; use a smaller scene", p->settings.scene);
  return -1;
}

// Called in this thread while the loop runs. Null, or the reason, valid until the next call.
static const char *begin_scene(void *user, const char *file, int64_t now_ns) {
  program *p = user;
  if (p->pace == GV_PACE_FREE || strncmp(p->settings.fcu, "trace:", 6) == 0 || p->recorder.file)
    return "a recording is of one scene; start gloved with --scene";
  gv_world_close(&p->next);  // what the loop refused last time
  snprintf(p->next_scene, sizeof p->next_scene, "%s", file);
  return gv_scene_thread_begin(&p->loader, file, &p->settings.engine, now_ns);
}

static bool scene_ended(void *user, int64_t now_ns, const char **out_refusal) {
  program *p = user;
  return gv_scene_thread_ended(&p->loader, now_ns, &p->next, out_refusal);
}

// Where nobody asked for a certain LCM, a machine without multicast is told so, and
// the hand works all the same.
static int open_telemetry(program *p) {
  gv_settings defaults;
  gv_settings_default(&defaults);
  const bool required = p->options.lcm || strcmp(p->settings.lcm, defaults.lcm) != 0;
  const gv_telemetry_config telemetry = {
    .lcm_url = p->settings.lcm,
    .lcm_required = required,
    .scene = &p->world.scene,
    .hand = &p->settings.engine.hand,
    .second = p->settings.engine.second.present ? &p->settings.engine.second.hand : NULL,
    .arena = &p->world.arena,
    .about = &p->about,
    .settings = &p->settings,
    .begin_scene = begin_scene,
    .scene_ended = scene_ended,
    .user = p,
    .give_up = &give_up};
  p->telemetry = gv_telemetry_open(&telemetry, p->err, sizeof p->err);
  if (p->telemetry && p->err[0])
    fprintf(stderr, "gloved: going on without LCM: %s\n", p->err);
  return p->telemetry ? 0 : -1;
}

static int open_summary(program *p) {
  if (!p->options.summary || p->options.check)
    return 0;
  p->summary_file = fopen(p->options.summary, "w");
  if (p->summary_file)
    return 0;
  snprintf(p->err, sizeof p->err, "%s: cannot be written; choose another place for --summary",
           p->options.summary);
  return -1;
}

static int open_recorder(program *p) {
  if (!p->options.record || p->options.check)
    return 0;
  if (gv_about_write(&p->about, p->options.record, p->err, sizeof p->err))
    return -1;
  return gv_recorder_open(&p->recorder, p->options.record, p->settings.fcu, p->settings.fcu2, p->err,
                          sizeof p->err);
}

// Nothing that is there is emptied before all else stands; the recording's words, which a
// full disk may refuse, come first.
static int open_outputs(program *p) {
  if (open_recorder(p) || open_summary(p))
    return -1;
  if (!p->options.log || p->options.check)
    return 0;
  return gv_telemetry_log(p->telemetry, p->options.log, p->err, sizeof p->err);
}

// For a hand: a replay has its recording already.
static int open_black_box(program *p) {
  char folder[512];
  const bool replay = p->pace == GV_PACE_FREE || strncmp(p->settings.fcu, "trace:", 6) == 0;
  if (replay || strcmp(p->settings.black_box, "none") == 0)
    return 0;
  if (gv_black_box_folder(p->settings.black_box, folder, p->err, sizeof p->err))
    return -1;
  if (p->options.check)
    return 0;
  p->black_box = gv_black_box_open(folder, &p->about);
  if (p->black_box)
    return 0;
  snprintf(p->err, sizeof p->err,
           "no memory for the black box; close other programs, or leave it out with --black-box none");
  return -1;
}

// The limiter never asks for more than the device takes.
static void fit_limiter(program *p) {
  const gv_channel *channel = gv_fcu_channel(p->settings.fcu);
  if (!gv_channel_limit(channel, &p->settings.limiter))
    return;
  fprintf(stderr, "gloved: limiter set to what a %s takes: %g N, at least %g N, %g N/s\n", channel->device,
          p->settings.limiter.max_n, p->settings.limiter.pretension_n, p->settings.limiter.slew_n_per_s);
}

// Within the bounds of the code, but laxer than the default: nobody shall wear the glove without knowing it.
static void tell_laxer(const program *p) {
  char laxer[GV_LAXER_TEXT];
  gv_settings_laxer(&p->settings.limiter, &p->settings.safety, &p->settings.passivity, laxer);
  if (*laxer)
    fprintf(stderr, "gloved: protects less than the defaults (in brackets): %s\n", laxer);
}

// A recording is replayed on the scene that it was made on.
static int choose_scene(program *p) {
  char warning[300];
  gv_settings defaults;
  gv_settings_default(&defaults);
  const bool chosen = p->options.scene || strcmp(p->settings.scene, defaults.scene) != 0;
  if (gv_replay_scene(&p->settings, chosen, &p->recorded, &p->scene_text, warning, p->err, sizeof p->err))
    return -1;
  if (warning[0])
    fprintf(stderr, "gloved: %s\n", warning);
  return 0;
}

static void describe(program *p) {
  gv_about *about = &p->about;
  const gv_settings *settings = &p->settings;
  gv_about_now(about);
  snprintf(about->fcu, sizeof about->fcu, "%s", settings->fcu);
  snprintf(about->fcu2, sizeof about->fcu2, "%s", settings->fcu2);
  snprintf(about->tracker, sizeof about->tracker, "%s", settings->tracker);
  snprintf(about->hand, sizeof about->hand, "%s", settings->engine.hand.side == GV_LEFT ? "left" : "right");
  about->rate_hz = settings->rate_hz;
  if (p->options.config)
    gv_about_read_file(p->options.config, &about->settings);
  gv_about_read_file(settings->scene, &about->scene);
  if (!p->scene_text)
    return;
  free(about->scene.text);
  about->scene = p->recorded.scene;
  about->scene.text = strdup(p->scene_text);
}

static int set_up(program *p) {
  if (gv_options_settings(&p->options, &p->settings, p->err, sizeof p->err))
    return -1;
  if (gv_options_outputs(&p->options, &p->settings, p->err, sizeof p->err))
    return -1;
  fit_limiter(p);
  tell_laxer(p);
  if (choose_scene(p) || open_world(p))
    return -1;
  describe(p);
  if (gv_device_open(&p->settings, &p->driver, &p->pace, p->err, sizeof p->err))
    return -1;
  if (p->err[0])
    fprintf(stderr, "gloved: %s\n", p->err);
  if (p->settings.sync_device && !p->driver.descriptor) {
    snprintf(p->err, sizeof p->err,
             "--fcu %s: its frames come when they are asked for; --sync device is for a device on a wire",
             p->settings.fcu);
    return -1;
  }
  if (open_black_box(p) || open_telemetry(p))
    return -1;
  return open_outputs(p);
}

// ---- run ------------------------------------------------------------------------------------------------

static int64_t period_ns(const gv_settings *settings) { return (int64_t)(1e9 / settings->rate_hz + 0.5); }

static void start_sessions(program *p) {
  const gv_settings *settings = &p->settings;
  gv_session_config session = {
    .limiter = settings->limiter,
    .safety = settings->safety,
    .passivity = settings->passivity,
    .replay = p->pace != GV_PACE_LIVE,
    .period_s = 1.0 / settings->rate_hz,
    .command_s = 1.0 / settings->rate_hz / gv_loop_commands(period_ns(settings)),
  };
  for (int i = 0; i < gv_engine_hands(p->world.engine); i++) {
    session.hand = i;
    session.side = i ? settings->engine.second.hand.side : settings->engine.hand.side;
    gv_session_init(&p->session[i], &session, p->world.engine);
  }
}

static void start_loop(program *p) {
  const gv_settings *settings = &p->settings;
  const gv_realtime_config none = {.cpu = GV_CPU_ANY};
  const gv_realtime_config realtime = {.priority = settings->rt_priority,
                                       .lock_memory = settings->mlock,
                                       .stay_awake = settings->cpu_dma_latency,
                                       .cpu = settings->cpu};
  const gv_loop_config loop = {
    .period_ns = period_ns(settings),
    .periods_max = (int64_t)(p->options.duration_s * settings->rate_hz + 0.5),
    .pace = p->pace,
    .alarm_s = GIVE_UP_S,
    .strict = settings->strict,
    .sync_device = settings->sync_device,
    .record = p->recorder.file != NULL,
    .black_box = p->black_box != NULL,
    .realtime = p->pace == GV_PACE_FREE ? none : realtime,
  };
  gv_loop_init(&p->loop, &loop, p->session, &p->driver, p->world.scene.object_count, &stop_requested);
  gv_telemetry_attach(p->telemetry, &p->loop);
  atomic_store(&watched_loop, &p->loop);
}

// Between two loops: the new scene's engine in the place of the old one. 0, or negative with no engine left.
static int change_scene(program *p) {
  const uint64_t steps = (uint64_t)gv_session_steps(p->session);
  gv_world_close(&p->world);
  p->world = p->next;
  gv_about_read_file(p->next_scene, &p->about.scene);
  p->next = (gv_world){0};
  if (gv_world_start(&p->world, &p->settings.engine))
    return -1;
  gv_hands_change_engine(p->session, p->world.engine, steps);
  gv_loop_change_scene(&p->loop, p->world.scene.object_count);
  gv_telemetry_change_scene(p->telemetry);
  gv_view_change_scene(&p->view);
  memset(p->held, 0, sizeof p->held);
  return 0;
}

// 0 when it has ended, negative where it does not start.
static int run_loop(program *p) {
  if (gv_loop_start(&p->loop) != 0)
    return -1;
  const gv_listeners to = {p->telemetry, &p->recorder, p->black_box,   &p->view,
                           &p->notify,   p->held,      &p->world.scene};
  gv_slow_run(&p->loop, &to);
  gv_loop_join(&p->loop);
  return 0;
}

static int run(program *p) {
  start_sessions(p);
  start_loop(p);
  catch_signals();
  fflush(stdout);
  gv_unblock_standard_files();
  gv_notify_open(&p->notify);
  gv_notify_ready(&p->notify);
  gv_view_open(&p->view, p->settings.fcu, &p->world.scene, p->settings.limiter.max_n,
               p->pace == GV_PACE_FREE);
  int failed;
  do {
    failed = run_loop(p);
  } while (!failed && atomic_load(&p->loop.exit) == GV_EXIT_SCENE && (failed = change_scene(p)) == 0);
  alarm(0);
  gv_notify_close(&p->notify);
  gv_view_close(&p->view);
  gv_block_standard_files(READER_MS);
  if (!failed && p->loop.strict_errno) {
    fprintf(stderr,
            "gloved: --strict: this kernel takes no list of system calls for a thread (seccomp: %s); start "
            "without --strict, "
            "or with a kernel that has CONFIG_SECCOMP_FILTER\n",
            strerror(p->loop.strict_errno));
    return BAD_INPUT;
  }
  if (!failed)
    return OK;
  fprintf(stderr, "gloved: the %s does not start; close other programs\n",
          p->world.engine ? "real-time thread" : "new scene's engine");
  return BAD_INPUT;
}

static int report(program *p) {
  const bool fault = p->loop.state_before_stop == GV_SAFETY_FAULT;
  const gv_summary summary = {.loop = &p->loop,
                              .scene = &p->world.scene,
                              .arena = &p->world.arena,
                              .title = p->settings.fcu,
                              .about = &p->about,
                              .held = p->held,
                              .reason = fault ? GV_EXIT_FAULT : (gv_exit)atomic_load(&p->loop.exit),
                              .telemetry_failed = gv_telemetry_failed(p->telemetry),
                              .driver = p->driver.stats(p->driver.self)};
  gv_summary_print(&summary, stdout);
  if (fault)
    fprintf(stderr, "gloved: fault: %s; forces were brought to zero\n",
            gv_fault_text(p->loop.faults_before_stop));
  if (!p->summary_file)
    return fault ? FAULT : OK;
  const bool written = gv_summary_json(&summary, p->summary_file) == 0;
  if (fclose(p->summary_file) == 0 && written)
    return fault ? FAULT : OK;
  fprintf(stderr, "gloved: %s: not written; make room on the disk\n", p->options.summary);
  return fault ? FAULT : BAD_INPUT;
}

// What is possible, but hardly meant.
static void say_doubts(const program *p) {
  enum { MOST = 16 };
  gv_doubt doubt[MOST];
  const int count = gv_scene_doubts(&p->world.scene, &p->settings.engine, doubt, MOST);
  for (int i = 0; i < count && i < MOST; i++)
    printf("warning    %s\n", doubt[i].text);
  if (count == 0)
    printf("all sound\n");
  else
    printf("sound, with %d warning%s\n", count, count == 1 ? "" : "s");
}

static void say_what_was_found(const program *p) {
  const char *const pace[] = {"live", "in real time", "as fast as possible"};
  printf("settings   %s; %g Hz, step %g ms\n", p->options.config ? p->options.config : "defaults",
         p->settings.rate_hz, p->settings.engine.step_s * 1e3);
  printf("scene      %s; %d objects, %d pieces, %d triangles\n", p->settings.scene,
         p->world.scene.object_count, p->world.scene.piece_count, p->world.scene.triangle_count);
  printf("fcu        %s; %s", p->settings.fcu, pace[p->pace]);
  const int64_t long_ns = strncmp(p->settings.fcu, "trace:", 6) == 0 ? gv_trace_length_ns(&p->driver) : -1;
  if (long_ns >= 0)
    printf(", %.3f s long", (double)long_ns * 1e-9);
  putchar('\n');
  if (*p->settings.tracker)
    printf("tracker    %s\n", p->settings.tracker);
  if (*p->settings.fcu2)
    printf("fcu2       %s; the %s hand\n", p->settings.fcu2,
           p->settings.engine.second.hand.side == GV_LEFT ? "left" : "right");
  if (*p->settings.tracker2)
    printf("tracker2   %s\n", p->settings.tracker2);
  printf("lcm        %s\n", p->settings.lcm);
  printf("contact    solver %s, narrow phase %s\n", gv_solver_name(p->settings.engine.solver),
         p->settings.engine.narrow == GV_NARROW_LIBCCD ? "libccd" : "core");
  printf("memory     %.1f MB for scene and engine\n", (double)p->world.arena.used / 1e6);
  say_doubts(p);
}

// 0, or negative where frames are missing in the recording.
static int close_recorder(program *p) {
  const uint64_t dropped = gv_ring_dropped(&p->loop.frames);
  if (!p->recorder.file)
    return 0;
  if (gv_recorder_close(&p->recorder) == 0 && dropped == 0)
    return 0;
  fprintf(stderr, "gloved: %s: %s; make room on a faster disk\n", p->options.record,
          dropped ? "frames are missing" : "not written");
  return -1;
}

// 0, or negative where messages are missing in the log.
static int close_telemetry(program *p) {
  gv_telemetry *telemetry = p->telemetry;
  p->telemetry = NULL;
  if (gv_telemetry_close(telemetry) == 0)
    return 0;
  fprintf(stderr, "gloved: %s: not written whole; make room on the disk\n",
          p->options.log ? p->options.log : "the LCM log");
  return -1;
}

static void tear_down(program *p) {
  gv_black_box_close(p->black_box);
  if (p->telemetry)
    gv_telemetry_close(p->telemetry);
  if (p->driver.close)
    p->driver.close(p->driver.self);
  gv_world_close(&p->next);
  gv_world_close(&p->world);
  gv_about_free(&p->about);
  gv_about_free(&p->recorded);
}

// The machine alone: nothing is opened, so that it can be asked beside a running gloved.
static int examine(program *p) {
  if (gv_options_settings(&p->options, &p->settings, p->err, sizeof p->err)) {
    fprintf(stderr, "gloved: %s\n", p->err);
    return BAD_INPUT;
  }
  const gv_doctor doctor = {.root = "", .settings = &p->settings};
  return (int)gv_doctor_report(&doctor, p->options.json, stdout);
}

int main(int argc, char **argv) {
  gv_keep_standard_files();
  signal(
      SIGXFSZ,
      SIG_IGN);  // a file that may not grow is an error of the set-up; later it ends the run (catch_signals)
  static program p;  // 4 MB
  int code = BAD_INPUT;
  if (gv_options_parse(argc, argv, &p.options, p.err, sizeof p.err)) {
    fprintf(stderr, "gloved: %s\n", p.err);
    return BAD_INPUT;
  }
  if (p.options.print_config)
    return gv_settings_print(stdout) == 0 ? OK : BAD_INPUT;
  if (p.options.help || p.options.version) {
    if (p.options.help)
      fputs(gv_options_help(), stdout);
    else
      printf("gloved %s\n", gv_version_text());
    return OK;
  }
  gv_about_command_line(argc, argv, p.about.command_line);
  if (p.options.doctor)
    return examine(&p);
  if (set_up(&p)) {
    fprintf(stderr, "gloved: %s\n", p.err);
  } else if (p.options.check) {
    say_what_was_found(&p);
    code = OK;
  } else if ((code = run(&p)) == OK) {
    code = report(&p);
    if (close_recorder(&p) && code == OK)
      code = BAD_INPUT;
    if (close_telemetry(&p) && code == OK)
      code = BAD_INPUT;
  }
  tear_down(&p);
  return code;
}
