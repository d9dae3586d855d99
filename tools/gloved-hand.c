// SPDX-License-Identifier: BSD-3-Clause
// gloved-hand: keys move the hand of a running `gloved --fcu hand:` - for people without a glove, also over
// ssh.
//
//   gloved-hand [--port N]
//
// Keys change targets (src/wire/hand_input.h), which are sent 50 times a second; each answer says where the
// hand is and what a glove would pull with. A terminal does not tell when a key is let go, so the dead-man
// switch is pressed half a second after the start and let go by `g`, by `r` and by the end of the program;
// nothing is held by it but simulated fingers.
#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#include "gloved/drivers.h"
#include "wire/hand_input.h"
#include "tools/program.h"

static const char help_text[] =
    "gloved-hand: keys move the hand of a running gloved --fcu hand:, no glove needed.\n"
    "\n"
    "  --port N            as gloved's --fcu hand:?listen=N (20500)\n"
    "  --help, --version\n"
    "\n"
    "  arrows or w a s d   the wrist 1 cm forward, left, back, right     e c, Page Up, Page Down   up, down\n"
    "  i k   j l   u o     turn it by 5 degrees: pitch, yaw, roll        space   close the hand, or open it\n"
    "  + -                 close or open by a tenth                      1 to 5  thumb to little finger "
    "alone\n"
    "  r                   hand and objects back to the start\n"
    "  g                   let go of the dead-man switch, or press it\n"
    "  q                   end\n"
    "\n"
    "Exit codes: 0 done, 1 no gloved answers, 2 bad usage.\n";

enum { DOUBT_MS = 1500 };  // held for so long, and no force may flow: it is let go and pressed anew
enum { EVERY_MS = 20, WAIT_ANSWER_MS = 15000, PRESS_AFTER_MS = 500, RESET_AFTER_MS = 800, KEYS = 64 };
static const double shift_m = 0.01, turn_rad = 5.0 * GV_PI / 180.0, tenth = 0.1, reach_m = 1.0;

typedef struct client {
  int fd;
  gv_hand_input want;
  gv_hand_output now;
  bool answered;       // at least once
  bool grasping;       // where space has left the fingers
  int64_t answer_ms;   // of the newest answer
  int64_t press_ms;    // when the switch is to be pressed; 0: it is, or was let go on purpose
  int64_t flowing_ms;  // when forces might flow last, or the switch was pressed
  int64_t reset_ms;    // when objects are to be put back; 0: not
  pid_t reset;         // gloved-command at work; 0: none
  const char *said;    // newest line for the person
} client;

static volatile sig_atomic_t interrupted;
static void on_signal(int number) {
  (void)number;
  interrupted = 1;
}

static int64_t now_ms(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (int64_t)t.tv_sec * 1000 + t.tv_nsec / 1000000;
}

// ---- datagrams ------------------------------------------------------------------------------------

static int connect_to(client *c, unsigned port) {
  const struct sockaddr_in to = {
    .sin_family = AF_INET, .sin_port = htons((uint16_t)port), .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
  c->fd = socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  return c->fd < 0 ? -1 : connect(c->fd, (const struct sockaddr *)&to, sizeof to);
}

static void send_wish(client *c, uint8_t more_flags) {
  uint8_t bytes[GV_HAND_INPUT_BYTES];
  gv_hand_input in = c->want;
  in.flags |= more_flags;
  c->want.number++;
  gv_hand_input_pack(&in, bytes);
  (void)!send(c->fd, bytes, sizeof bytes, MSG_NOSIGNAL);  // gloved not there (yet): the silence is told
}

static void read_answers(client *c) {
  uint8_t bytes[GV_HAND_OUTPUT_BYTES + 1];
  ssize_t n;
  while ((n = recv(c->fd, bytes, sizeof bytes, 0)) > 0) {
    if (!gv_hand_output_unpack(bytes, (size_t)n, &c->now))
      continue;
    c->answered = true;
    c->answer_ms = now_ms();
  }
}

// Until gloved answers: where the hand is, the keys go on from.
static int find_hand(client *c) {
  const int64_t end = now_ms() + WAIT_ANSWER_MS;
  while (!c->answered && !interrupted && now_ms() < end) {
    send_wish(c, GV_HAND_INPUT_ASK);
    poll(&(struct pollfd){c->fd, POLLIN, 0}, 1, EVERY_MS);
    read_answers(c);
    if (!c->answered)
      nanosleep(&(struct timespec){0, EVERY_MS * 1000000L}, NULL);
  }
  c->want.T_world_wrist = c->now.T_world_wrist;
  return c->answered ? 0 : -1;
}

// ---- keys -----------------------------------------------------------------------------------------

static void shift(client *c, double x, double y, double z) {
  gv_vec3 *p = &c->want.T_world_wrist.p;
  *p = gv_add(*p, gv_scale(gv_v3(x, y, z), shift_m));
  p->x = gv_clamp(p->x, -reach_m, reach_m);
  p->y = gv_clamp(p->y, -reach_m, reach_m);
  p->z = gv_clamp(p->z, -reach_m, reach_m);
}

// About an axis of the world.
static void turn(client *c, double x, double y, double z) {
  const gv_quat q = gv_quat_axis_angle(gv_v3(x, y, z), turn_rad);
  c->want.T_world_wrist.q = gv_quat_normalize(gv_quat_mul(q, c->want.T_world_wrist.q));
}

static void grip_all(client *c, double grip) {
  for (int f = 0; f < GV_FINGERS; f++)
    c->want.grip[f] = gv_clamp(grip, 0.0, 1.0);
}

static void grip_more(client *c, double more) {
  for (int f = 0; f < GV_FINGERS; f++)
    c->want.grip[f] = gv_clamp(c->want.grip[f] + more, 0.0, 1.0);
}

static void turn_over(double *grip) { *grip = *grip < 0.5 ? 1.0 : 0.0; }

static void let_go(client *c) {
  c->want.flags = 0;
  c->press_ms = 0;
}

static void toggle_switch(client *c) {
  if (c->want.flags & GV_HAND_INPUT_DEAD_MAN)
    let_go(c);
  else
    c->press_ms = 1;
}

// The hand lets go and goes home; then, with no force left, the objects are put back and the switch is
// pressed again.
static void go_home(client *c) {
  let_go(c);
  grip_all(c, 0.0);
  c->grasping = false;
  send_wish(c, GV_HAND_INPUT_HOME);
  c->reset_ms = now_ms() + RESET_AFTER_MS;
  c->said = "back to the start ...";
}

// One key; escape sequences came as a whole (take_keys). False: the end.
static bool obey(client *c, char key) {
  switch (key) {
    case 'w': shift(c, 0, 1, 0); break;
    case 's': shift(c, 0, -1, 0); break;
    case 'a': shift(c, -1, 0, 0); break;
    case 'd': shift(c, 1, 0, 0); break;
    case 'e': shift(c, 0, 0, 1); break;
    case 'c': shift(c, 0, 0, -1); break;
    case 'i': turn(c, 1, 0, 0); break;
    case 'k': turn(c, -1, 0, 0); break;
    case 'j': turn(c, 0, 0, 1); break;
    case 'l': turn(c, 0, 0, -1); break;
    case 'u': turn(c, 0, 1, 0); break;
    case 'o': turn(c, 0, -1, 0); break;
    case ' ':
      c->grasping = !c->grasping;
      grip_all(c, c->grasping ? 1.0 : 0.0);
      break;
    case '+':
    case '=': grip_more(c, tenth); break;
    case '-': grip_more(c, -tenth); break;
    case '1':
    case '2':
    case '3':
    case '4':
    case '5': turn_over(&c->want.grip[key - '1']); break;
    case 'g': toggle_switch(c); break;
    case 'r': go_home(c); break;
    case 'q':
    case 3: return false;
    default: break;
  }
  return true;
}

// The letter for an escape sequence, 0 where it is none of ours; *length: its bytes.
static char letter_of(const char *key, int count, int *length) {
  static const struct {
    const char *sequence;
    char letter;
  } known[] = {{"\033[A", 'w'}, {"\033[B", 's'}, {"\033[D", 'a'}, {"\033[C", 'd'},  {"\033OA", 'w'},
               {"\033OB", 's'}, {"\033OD", 'a'}, {"\033OC", 'd'}, {"\033[5~", 'e'}, {"\033[6~", 'c'}};
  for (size_t i = 0; i < sizeof known / sizeof *known; i++) {
    *length = (int)strlen(known[i].sequence);
    if (*length <= count && memcmp(key, known[i].sequence, (size_t)*length) == 0)
      return known[i].letter;
  }
  *length = count;  // unknown: the rest of what was read belongs to it
  return 0;
}

// False: the end, or the terminal is gone.
static bool take_keys(client *c) {
  char key[KEYS];
  const ssize_t n = read(STDIN_FILENO, key, sizeof key);
  if (n <= 0)
    return n < 0 && (errno == EINTR || errno == EAGAIN);
  for (int i = 0, length = 1; i < n; i += length) {
    length = 1;
    const char letter = key[i] == '\033' ? letter_of(key + i, (int)n - i, &length) : key[i];
    if (!obey(c, letter))
      return false;
  }
  return true;
}

// ---- objects back to their start ------------------------------------------------------------------

// gloved-command lies beside this program; it speaks over LCM (LCM_DEFAULT_URL), which a gloved may be
// without.
static void start_reset(client *c) {
  extern char **environ;
  char path[4096];
  char *arguments[] = {path, (char[]){"reset"}, NULL};
  const ssize_t n = readlink("/proc/self/exe", path, sizeof path - sizeof "/gloved-command");
  posix_spawn_file_actions_t quiet;
  c->reset_ms = 0;
  if (n <= 0)
    return;
  path[n] = '\0';
  snprintf(strrchr(path, '/'), sizeof "/gloved-command", "/gloved-command");
  posix_spawn_file_actions_init(&quiet);
  for (int fd = 0; fd <= 2; fd++)
    posix_spawn_file_actions_addopen(&quiet, fd, "/dev/null", O_RDWR, 0);
  if (posix_spawn(&c->reset, path, &quiet, NULL, arguments, environ) != 0)
    c->reset = 0;
  posix_spawn_file_actions_destroy(&quiet);
}

static void look_at_reset(client *c, int64_t ms) {
  int status;
  if (c->reset_ms && ms >= c->reset_ms) {
    c->want.T_world_wrist = c->now.T_world_wrist;
    start_reset(c);
    c->press_ms = ms + PRESS_AFTER_MS;
  }
  if (c->reset <= 0 || waitpid(c->reset, &status, WNOHANG) != c->reset)
    return;
  c->reset = 0;
  c->said = status == 0 ? "objects back at their start" : "the objects stay: gloved-command reset says why";
}

// ---- what the person sees -------------------------------------------------------------------------

static const char *state_of(const client *c, int64_t ms) {
  if (ms - c->answer_ms > 500)
    return "gloved is silent";
  if (c->now.flags & GV_HAND_OUTPUT_OTHER)
    return "somebody else moves the hand";
  if (!(c->now.flags & GV_HAND_OUTPUT_DEAD_MAN))
    return "switch open: no forces";
  return c->now.flags & GV_HAND_OUTPUT_FORCES ? "forces shown, none leave" : "switch held";
}

static void draw(const client *c, int64_t ms) {
  const gv_vec3 p = c->now.T_world_wrist.p;
  printf("\r\033[Kwrist %+4.0f %+4.0f %+4.0f mm  grip", 1e3 * p.x, 1e3 * p.y, 1e3 * p.z);
  for (int i = 0; i < GV_FINGERS; i++)
    printf(" %3.0f", 100 * c->now.grip[i]);
  printf(" %%  force");
  for (int i = 0; i < GV_FINGERS; i++)
    printf(" %4.1f", c->now.tension_n[i]);
  printf(" N  %s%s%s", state_of(c, ms), c->said ? "; " : "", c->said ? c->said : "");
  fflush(stdout);
}

// ---- run ------------------------------------------------------------------------------------------

// Pressed when its time has come. After a fault (a machine that stood still) the safety machine wants the
// switch let go first; nobody's hand is in it, so that is done here.
static void look_at_switch(client *c, int64_t ms) {
  if (c->press_ms && ms >= c->press_ms) {
    c->want.flags = GV_HAND_INPUT_DEAD_MAN;
    c->press_ms = 0;
    c->flowing_ms = ms;
  }
  if (c->now.flags & GV_HAND_OUTPUT_FORCES)
    c->flowing_ms = ms;
  if (!(c->want.flags & GV_HAND_INPUT_DEAD_MAN) || ms - c->flowing_ms < DOUBT_MS)
    return;
  c->want.flags = 0;
  c->press_ms = ms + PRESS_AFTER_MS;
}

static void run(client *c) {
  c->press_ms = now_ms() + PRESS_AFTER_MS;
  int64_t next_ms = now_ms();
  while (!interrupted) {
    struct pollfd wait[] = {{STDIN_FILENO, POLLIN, 0}, {c->fd, POLLIN, 0}};
    const int64_t left_ms = next_ms - now_ms();
    poll(wait, 2, left_ms > 0 ? (int)left_ms : 0);
    if (wait[0].revents && !take_keys(c))
      return;
    read_answers(c);
    const int64_t ms = now_ms();
    if (ms < next_ms)
      continue;
    next_ms = ms + EVERY_MS;
    look_at_switch(c, ms);
    look_at_reset(c, ms);
    send_wish(c, c->reset_ms ? GV_HAND_INPUT_HOME : 0);
    draw(c, ms);
  }
}

static int read_port(int argc, char **argv, unsigned *out) {
  char *end;
  *out = GV_HAND_INPUT_PORT;
  if (argc == 1)
    return 0;
  const unsigned long port = argc == 3 && strcmp(argv[1], "--port") == 0 ? strtoul(argv[2], &end, 10) : 0;
  if (port < 1 || port > 65535 || *end)
    return -1;
  *out = (unsigned)port;
  return 0;
}

static int play(client *c) {
  struct termios before, raw;
  if (tcgetattr(STDIN_FILENO, &before) != 0) {
    fputs("gloved-hand: no terminal to read keys from; run it in one\n", stderr);
    return 2;
  }
  raw = before;
  cfmakeraw(&raw);
  raw.c_oflag |= OPOST;
  tcsetattr(STDIN_FILENO, TCSANOW, &raw);
  run(c);
  let_go(c);
  send_wish(c, 0);
  tcsetattr(STDIN_FILENO, TCSANOW, &before);
  puts("");
  return 0;
}

int main(int argc, char **argv) {
  static client c;
  unsigned port;
  gv_keep_standard_files();
  if (program_answers(argc, argv, help_text))
    return 0;
  if (read_port(argc, argv, &port)) {
    fputs("gloved-hand: only --port N, 1 to 65535; see gloved-hand --help\n", stderr);
    return 2;
  }
  struct sigaction action = {.sa_handler = on_signal};
  sigaction(SIGINT, &action, NULL);
  sigaction(SIGTERM, &action, NULL);
  sigaction(SIGHUP, &action, NULL);
  c.want.T_world_wrist = gv_pose_identity();
  if (connect_to(&c, port) || find_hand(&c)) {
    fprintf(stderr, "gloved-hand: no gloved answers on port %u; start gloved --fcu 'hand:?listen=%u'\n", port,
            port);
    return 1;
  }
  return play(&c);
}
