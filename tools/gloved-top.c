// SPDX-License-Identifier: BSD-3-Clause
// gloved-top [LCM-URL] - a running gloved on a terminal: state, force and limit of each finger, joint
// angles, contacts, timing, ages, losses, events. An LCM client like any other (GLOVED_STATE, GLOVED_STATE2,
// GLOVED_STATS, GLOVED_EVENT); one thread. The screen is built in one buffer, cut to the window as it
// is now, and written at once. q ends.
#include <lcm/lcm.h>
#include <poll.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#include "gloved/drivers.h"
#include "gloved/hand.h"
#include "gloved/safety.h"
#include "gloved_event_t.h"
#include "gloved_state_t.h"
#include "gloved_stats_t.h"
#include "tools/program.h"

static const char help_text[] = "gloved-top: a running gloved on a terminal: forces, joint angles, contacts, "
                                "timing, losses, events; q ends.\n"
                                "\n"
                                "  gloved-top [LCM-URL]   as of gloved --lcm\n"
                                "  --help, --version\n";

enum {
  SCREEN_BYTES = 32768,
  LINE_MAX_BYTES = 512,
  EVENTS = 8,
  EVENT_BYTES = 160,
  DRAW_MS = 100,
  SHOWN_CONTACTS = 6
};

typedef struct top {
  const char *url;
  gloved_state_t *state;   // newest; null: none yet
  gloved_state_t *second;  // of a second hand; null: none heard
  gloved_stats_t *stats;
  int64_t heard_ns;                 // when the newest state came
  uint64_t states;                  // so far
  double rate_hz;                   // of states, over the last second
  char event[EVENTS][EVENT_BYTES];  // newest last
  int columns, rows;
  char text[SCREEN_BYTES];
  size_t length;
  int lines;
} top;

static volatile sig_atomic_t ended;
static struct termios terminal_before;
static bool terminal_changed;

static void on_signal(int number) {
  (void)number;
  ended = 1;
}

static int64_t now_ns(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

// ---- messages -----------------------------------------------------------------------------------------

static void keep_state(const gloved_state_t *message, gloved_state_t **io_kept) {
  gloved_state_t *copy = gloved_state_t_copy(message);
  if (*io_kept)
    gloved_state_t_destroy(*io_kept);
  *io_kept = copy;
}

static void on_state(const lcm_recv_buf_t *buffer, const char *channel, const gloved_state_t *message,
                     void *user) {
  (void)buffer, (void)channel;
  top *t = user;
  keep_state(message, &t->state);
  t->heard_ns = now_ns();
  t->states++;
}

static void on_second(const lcm_recv_buf_t *buffer, const char *channel, const gloved_state_t *message,
                      void *user) {
  (void)buffer, (void)channel;
  keep_state(message, &((top *)user)->second);
}

static void on_stats(const lcm_recv_buf_t *buffer, const char *channel, const gloved_stats_t *message,
                     void *user) {
  (void)buffer, (void)channel;
  top *t = user;
  gloved_stats_t *copy = gloved_stats_t_copy(message);
  if (t->stats)
    gloved_stats_t_destroy(t->stats);
  t->stats = copy;
}

static void on_event(const lcm_recv_buf_t *buffer, const char *channel, const gloved_event_t *message,
                     void *user) {
  (void)buffer, (void)channel;
  top *t = user;
  memmove(t->event[0], t->event[1], sizeof t->event - sizeof t->event[0]);
  snprintf(t->event[EVENTS - 1], EVENT_BYTES, "%10.3f s  %s", message->time_s, message->text);
}

// ---- drawing ------------------------------------------------------------------------------------------

// One line, cut to the window; lines below the window are left out.
__attribute__((format(printf, 2, 3))) static void put(top *t, const char *format, ...) {
  char line[LINE_MAX_BYTES];
  va_list arguments;
  va_start(arguments, format);
  vsnprintf(line, sizeof line, format, arguments);
  va_end(arguments);
  if (t->lines >= t->rows || t->length + LINE_MAX_BYTES + 8 > SCREEN_BYTES)
    return;
  for (char *c = line; *c; c++)
    if ((unsigned char)*c < ' ' || *c == 127)
      *c = '?';  // a text from the network does not steer the terminal
  if (t->columns < LINE_MAX_BYTES)
    line[t->columns] = '\0';
  t->length += (size_t)snprintf(t->text + t->length, SCREEN_BYTES - t->length, "%s%s\033[K",
                                t->lines ? "\r\n" : "", line);
  t->lines++;
}

static void put_head(top *t) {
  const gloved_state_t *s = t->state;
  const double silent_s = (double)(now_ns() - t->heard_ns) * 1e-9;
  put(t, "gloved-top  %-8s %10.3f s   step %lld   %.0f messages/s%s",
      gv_safety_name((gv_safety_state)s->safety_state), s->time_s, (long long)s->step, t->rate_hz,
      silent_s > 0.5 ? "   SILENT" : "");
  if (silent_s > 0.5)
    put(t, "no message for %.0f s: gloved has ended, or it is not reached from here", silent_s);
  else if (s->faults)
    put(t, "fault: %s", gv_fault_text((uint32_t)s->faults));
  else if (s->dead_man && s->safety_state == GV_SAFETY_READY)
    put(t, "let go of the dead-man switch, then press it again");
  else
    put(t, "dead-man switch %s", s->dead_man ? "held" : "open");
}

static void put_forces(top *t) {
  const gloved_state_t *s = t->state;
  const double limit_n = t->stats ? t->stats->force_limit_n : 12.0;
  enum { BAR = 24 };
  put(t, "%s", "");
  put(t, "force     0%*s%4.1f N   sent  wanted  measured  energy mJ", BAR - 2, "", limit_n);
  for (int i = 0; i < GV_FINGERS; i++) {
    char bar[BAR + 1];
    for (int k = 0; k < BAR; k++) {
      const double at = (k + 0.5) / BAR * limit_n;
      bar[k] = at < s->force_commanded_n[i] ? '#' : at < s->force_desired_n[i] ? '-' : ' ';
    }
    bar[BAR] = '\0';
    put(t, "%-8s |%s| %8.2f %7.2f %9.2f %10.1f", gv_finger_name(i), bar, s->force_commanded_n[i],
        s->force_desired_n[i], s->force_measured_n[i], 1e3 * s->energy_j[i]);
  }
}

// Two lines: what the first hand has a table for. One that gloved no longer has is not shown.
static void put_second(top *t) {
  const gloved_state_t *s = t->second;
  if (!s || s->step + 2000 < t->state->step || s->step > t->state->step + 2000)
    return;
  const double *n = s->force_commanded_n;
  put(t, "second hand  %-8s dead-man switch %s   glove %.1f ms old   lost %lld bad %lld%s%s",
      gv_safety_name((gv_safety_state)s->safety_state), s->dead_man ? "held" : "open", s->glove_age_s * 1e3,
      (long long)s->frames_lost, (long long)s->frames_bad, s->faults ? "   fault: " : "",
      s->faults ? gv_fault_text((uint32_t)s->faults) : "");
  put(t, "         thumb to little sent %.2f %.2f %.2f %.2f %.2f N", n[0], n[1], n[2], n[3], n[4]);
}

static double degrees(double angle_rad) { return angle_rad * 180.0 / GV_PI; }

static void put_angles(top *t) {
  const double *a = t->state->angle_rad;
  put(t, "%s", "");
  put(t, "degrees    proximal  middle  distal  abduction");
  put(t, "thumb      %8.1f %7.1f %7.1f %10.1f   (rotate, mpj, ij)", degrees(a[GV_THUMB_ROTATE]),
      degrees(a[GV_THUMB_MPJ]), degrees(a[GV_THUMB_IJ]), degrees(a[GV_THUMB_ABDUCTION]));
  put(t, "index      %8.1f %7.1f %7.1f", degrees(a[GV_INDEX_MPJ]), degrees(a[GV_INDEX_PIJ]),
      degrees(a[GV_INDEX_DIJ]));
  put(t, "middle     %8.1f %7.1f %7.1f %10.1f", degrees(a[GV_MIDDLE_MPJ]), degrees(a[GV_MIDDLE_PIJ]),
      degrees(a[GV_MIDDLE_DIJ]), degrees(a[GV_MIDDLE_INDEX_ABDUCTION]));
  put(t, "ring       %8.1f %7.1f %7.1f %10.1f", degrees(a[GV_RING_MPJ]), degrees(a[GV_RING_PIJ]),
      degrees(a[GV_RING_DIJ]), degrees(a[GV_RING_MIDDLE_ABDUCTION]));
  put(t, "little     %8.1f %7.1f %7.1f %10.1f", degrees(a[GV_LITTLE_MPJ]), degrees(a[GV_LITTLE_PIJ]),
      degrees(a[GV_LITTLE_DIJ]), degrees(a[GV_LITTLE_RING_ABDUCTION]));
  put(t, "palm arch %.1f   wrist pitch %.1f yaw %.1f", degrees(a[GV_PALM_ARCH]), degrees(a[GV_WRIST_PITCH]),
      degrees(a[GV_WRIST_YAW]));
}

static const char *body_name(const gloved_state_t *s, int number) {
  if (number >= 0 && number < GV_LIMBS)
    return gv_limb_name(number);
  const int object = -1 - number;
  return object >= 0 && object < s->num_objects ? s->object[object].name : "?";
}

static void put_contacts(top *t) {
  const gloved_state_t *s = t->state;
  put(t, "%s", "");
  put(t, "contacts %d   deepest so far %.3f mm   dropped %lld", s->num_contacts, s->depth_max_m * 1e3,
      (long long)s->contacts_dropped);
  for (int i = 0; i < s->num_contacts && i < SHOWN_CONTACTS; i++) {
    const gloved_contact_t *c = &s->contact[i];
    const double f = gv_norm(gv_v3(c->force_n[0], c->force_n[1], c->force_n[2]));
    put(t, "  %-16s on %-16s %7.3f mm %7.2f N", body_name(s, c->limb), body_name(s, -1 - c->object),
        c->depth_m * 1e3, f);
  }
  if (s->num_contacts > SHOWN_CONTACTS)
    put(t, "  and %d more", s->num_contacts - SHOWN_CONTACTS);
}

static void put_timing(top *t) {
  const gloved_stats_t *s = t->stats;
  put(t, "%s", "");
  if (!s) {
    put(t, "timing: waiting for GLOVED_STATS");
    return;
  }
  put(t, "us           p50      p99    p99.9       max");
  for (int i = 0; i < s->num_histograms; i++) {
    const gloved_histogram_t *h = &s->histogram[i];
    put(t, "%-8s %7.1f %8.1f %8.1f %9.1f", h->name, h->p50_us, h->p99_us, h->p999_us, h->max_us);
  }
  put(t, "missed deadlines %lld   periods skipped %lld   heap calls %lld   memory %.1f MB",
      (long long)s->missed_deadlines, (long long)s->overruns, (long long)s->heap_calls,
      (double)s->memory_used * 1e-6);
  if (s->steps_on_frame + s->steps_on_clock > 0)
    put(t, "steps begun by the glove's frame %lld, by the own clock %lld", (long long)s->steps_on_frame,
        (long long)s->steps_on_clock);
  put(t, "lost on the way out: snapshots %lld, events %lld, trace steps %lld, messages %lld",
      (long long)s->snapshots_dropped, (long long)s->events_dropped, (long long)s->trace_dropped,
      (long long)s->messages_failed);
}

static void put_devices(top *t) {
  const gloved_state_t *s = t->state;
  put(t, "glove %.1f ms old   tracker %.1f ms old", s->glove_age_s * 1e3, s->tracker_age_s * 1e3);
  put(t, "frames in %lld out %lld lost %lld bad %lld late %lld", (long long)s->frames_received,
      (long long)s->frames_sent, (long long)s->frames_lost, (long long)s->frames_bad,
      (long long)s->frames_late);
}

static void put_objects(top *t) {
  const gloved_state_t *s = t->state;
  for (int i = 0; i < s->num_objects; i++)
    if (!s->object[i].is_static)
      put(t, "%-16s at %8.1f %8.1f %8.1f mm", s->object[i].name, s->object[i].position_m[0] * 1e3,
          s->object[i].position_m[1] * 1e3, s->object[i].position_m[2] * 1e3);
}

static void find_window(top *t) {
  struct winsize size;
  t->columns = 80;
  t->rows = 24;
  if (ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) || !size.ws_col || !size.ws_row)
    return;
  t->columns = size.ws_col;
  t->rows = size.ws_row;
}

// The most wanted first: a small window shows the beginning.
static void draw(top *t) {
  find_window(t);
  t->lines = 0;
  t->length = (size_t)snprintf(t->text, SCREEN_BYTES, "\033[H");
  if (!t->state) {
    put(t, "gloved-top: waiting for GLOVED_STATE on %s (q ends)", t->url);
  } else {
    put_head(t);
    put_forces(t);
    put_second(t);
    put_devices(t);
    put_objects(t);
    put_timing(t);
    put_contacts(t);
    put_angles(t);
    put(t, "%s", "");
    for (int i = 0; i < EVENTS; i++)
      if (t->event[i][0])
        put(t, "%s", t->event[i]);
  }
  t->length += (size_t)snprintf(t->text + t->length, SCREEN_BYTES - t->length, "\033[J");
  fwrite(t->text, 1, t->length, stdout);
  fflush(stdout);
}

// ---- terminal -----------------------------------------------------------------------------------------

// Keys come at once and are not shown; the screen of before comes back at the end.
static void enter_terminal(void) {
  if (tcgetattr(STDIN_FILENO, &terminal_before) == 0) {
    struct termios raw = terminal_before;
    raw.c_lflag &= ~(tcflag_t)(ICANON | ECHO);
    terminal_changed = tcsetattr(STDIN_FILENO, TCSANOW, &raw) == 0;
  }
  fputs("\033[?1049h\033[?25l", stdout);
}

static void leave_terminal(void) {
  fputs("\033[?25h\033[?1049l", stdout);
  fflush(stdout);
  if (terminal_changed)
    tcsetattr(STDIN_FILENO, TCSANOW, &terminal_before);
}

static void read_key(struct pollfd *input) {
  char key;
  if (!(input->revents & (POLLIN | POLLHUP)))
    return;
  if (read(STDIN_FILENO, &key, 1) != 1)
    input->fd = -1;  // no keyboard any more
  else if (key == 'q' || key == 'Q')
    ended = 1;
}

static void watch(top *t, lcm_t *lcm) {
  struct pollfd wait[2] = {{.fd = lcm_get_fileno(lcm), .events = POLLIN},
                           {.fd = STDIN_FILENO, .events = POLLIN}};
  int64_t next_ns = 0;
  int64_t second_ns = now_ns();
  uint64_t states = 0;
  while (!ended) {
    poll(wait, 2, DRAW_MS / 2);
    for (int i = 0; i < 100 && lcm_handle_timeout(lcm, 0) > 0; i++) {}
    read_key(&wait[1]);
    const int64_t now = now_ns();
    if (now - second_ns >= 1000000000) {
      t->rate_hz = (double)(t->states - states) * 1e9 / (double)(now - second_ns);
      states = t->states;
      second_ns = now;
    }
    if (now < next_ns)
      continue;
    next_ns = now + (int64_t)DRAW_MS * 1000000;
    draw(t);
  }
}

int main(int argc, char **argv) {
  gv_keep_standard_files();
  if (program_answers(argc, argv, help_text))
    return 0;
  static top t;
  t.url = argc > 1                    ? argv[1]
          : getenv("LCM_DEFAULT_URL") ? getenv("LCM_DEFAULT_URL")
                                      : "udpm://239.255.76.67:7667?ttl=0";
  if (argc > 2 || t.url[0] == '-') {
    fprintf(stderr, "gloved-top: give one LCM-URL at most; see gloved-top --help\n");
    return 2;
  }
  if (!isatty(STDOUT_FILENO)) {
    fprintf(stderr, "gloved-top: standard output is no terminal; run it in one, or read the channels with "
                    "another LCM program\n");
    return 2;
  }
  lcm_t *lcm = lcm_create(t.url);
  if (!lcm) {
    fprintf(stderr,
            "gloved-top: LCM does not start on \"%s\"; check the URL, or give this machine a multicast route "
            "(ip link set lo up; ip route add 224.0.0.0/4 dev lo)\n",
            t.url);
    return 2;
  }
  gloved_state_t_subscribe(lcm, "GLOVED_STATE", on_state, &t);
  gloved_state_t_subscribe(lcm, "GLOVED_STATE2", on_second, &t);
  gloved_stats_t_subscribe(lcm, "GLOVED_STATS", on_stats, &t);
  gloved_event_t_subscribe(lcm, "GLOVED_EVENT", on_event, &t);
  signal(SIGINT, on_signal);
  signal(SIGTERM, on_signal);
  signal(SIGHUP, on_signal);
  enter_terminal();
  watch(&t, lcm);
  leave_terminal();
  lcm_destroy(lcm);
  return 0;
}
