// SPDX-License-Identifier: BSD-3-Clause
// gloved-command NAME [VALUE|FILE] - one command to a running gloved over LCM (GLOVED_COMMAND), and its answer.
// Exit code 0 done, 1 refused or no answer, 2 bad usage. Nothing here arms: a person does that at the device.
#include <lcm/lcm.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>
#include <time.h>

#include "gloved/drivers.h"
#include "daemon/loop/request.h"
#include "gloved_command_t.h"
#include "gloved_event_t.h"
#include "tools/program.h"

static const char help_text[] =
  "gloved-command: one command to a running gloved over LCM, and its answer.\n"
  "\n"
  "  reset               objects back to their start; not while a force may flow\n"
  "  scene FILE          another scene, FILE.scene at or below the daemon's directory; not while a force may flow\n"
  "  coupling MULTIPLE   stiffness, 0.1 to 2 times the configured one\n"
  "  friction MU         of the hand's skin, 0 to 2\n"
  "  start-log FILE      a new LCM log in the daemon's directory\n"
  "  stop-log\n"
  "  disarm              no force until the dead-man switch was let go and pressed again\n"
  "  trace 1|0           publish GLOVED_TRACE or not\n"
  "  --help, --version\n"
  "\n"
  "LCM_DEFAULT_URL as gloved --lcm. Exit codes: 0 done, 1 refused or no answer, 2 bad usage. Nothing here arms.\n";

enum { EVENT_COMMAND = 4, REFUSED = 256, ANSWER_S = 3, SCENE_S = 15 };  // a large scene takes seconds to load

typedef struct answer {
  int kind;
  int64_t tag;            // of the command: an answer to another one, or one that somebody made up, does not have it
  bool came, refused;
  char text[600];
} answer;

static void on_event(const lcm_recv_buf_t *buffer, const char *channel, const gloved_event_t *event, void *user) {
  (void)buffer, (void)channel;
  answer *a = user;
  if (event->kind != EVENT_COMMAND || (event->bits & 0xff) != a->kind || event->answers != a->tag || a->came) return;
  a->came = true;
  a->refused = (event->bits & REFUSED) != 0;
  snprintf(a->text, sizeof a->text, "%s", event->text);
  // From the network: nothing that a terminal obeys.
  for (char *c = a->text; *c; c++)
    if ((unsigned char)*c < ' ' || (unsigned char)*c >= 127) *c = '?';
}

static int usage(void) {
  fputs("gloved-command: no such command, or its argument is missing; see gloved-command --help\n", stderr);
  return 2;
}

static int find_kind(const char *name) {
  char spaced[32];
  snprintf(spaced, sizeof spaced, "%s", name);
  for (char *c = spaced; *c; c++)
    if (*c == '-') *c = ' ';
  for (int kind = 0; kind < GV_REQUEST_KINDS; kind++)
    if (strcmp(spaced, gv_request_name(kind)) == 0) return kind;
  return -1;
}

// The argument that the kind needs. 0, or negative where it is missing or not a number.
static int take_argument(gloved_command_t *command, char *argument) {
  char *end = NULL;
  switch ((gv_request_kind)command->kind) {
    case GV_REQUEST_COUPLING: case GV_REQUEST_FRICTION: case GV_REQUEST_TRACE:
      if (!argument) return -1;
      command->value = strtod(argument, &end);
      return end == argument || *end ? -1 : 0;
    case GV_REQUEST_SCENE: case GV_REQUEST_START_LOG:
      if (!argument) return -1;
      command->text = argument;
      return 0;
    case GV_REQUEST_RESET: case GV_REQUEST_STOP_LOG: case GV_REQUEST_DISARM: case GV_REQUEST_KINDS: break;
  }
  return argument ? -1 : 0;
}

int main(int argc, char **argv) {
  gv_keep_standard_files();
  if (program_answers(argc, argv, help_text)) return 0;
  static char no_text[] = "";
  if (argc < 2 || argc > 3) return usage();
  gloved_command_t command = {.kind = (int8_t)find_kind(argv[1]), .text = no_text};
  if (command.kind < 0 || take_argument(&command, argc > 2 ? argv[2] : NULL)) return usage();
  const char *url = getenv("LCM_DEFAULT_URL") ? getenv("LCM_DEFAULT_URL") : "udpm://239.255.76.67:7667?ttl=0";
  lcm_t *lcm = lcm_create(url);
  if (!lcm) {
    fprintf(stderr, "gloved-command: LCM does not start on \"%s\"; check LCM_DEFAULT_URL\n", url);
    return 1;
  }
  if (getrandom(&command.utime, sizeof command.utime, 0) != sizeof command.utime) command.utime = (int64_t)time(NULL);
  answer a = {.kind = command.kind, .tag = command.utime};
  gloved_event_t_subscribe(lcm, "GLOVED_EVENT", on_event, &a);
  gloved_command_t_publish(lcm, "GLOVED_COMMAND", &command);
  const time_t end = time(NULL) + (command.kind == GV_REQUEST_SCENE ? SCENE_S : ANSWER_S);
  while (!a.came && time(NULL) < end) lcm_handle_timeout(lcm, 100);
  lcm_destroy(lcm);
  if (a.came) printf("%s\n", a.text);
  else fprintf(stderr, "gloved-command: no answer; is gloved running, with the same --lcm?\n");
  return a.came && !a.refused ? 0 : 1;
}
