// SPDX-License-Identifier: BSD-3-Clause
// gloved-command NAME [VALUE|FILE] - one command to a running gloved over LCM (GLOVED_COMMAND),
// and its answer. Exit code 0 done, 1 refused or no answer, 2 bad usage. Nothing here arms: a
// person does that at the device.
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
    "  scene FILE          another scene, FILE.scene at or below the daemon's directory; not while a force "
    "may flow\n"
    "  coupling MULTIPLE   stiffness, 0.1 to 2 times the configured one\n"
    "  friction MU         of the hand's skin, 0 to 2\n"
    "  start-log FILE      a new LCM log in the daemon's directory\n"
    "  stop-log            ends it\n"
    "  disarm              no force until the dead-man switch was let go and pressed again\n"
    "  trace 1|0           publish GLOVED_TRACE or not\n"
    "  status              what is in force now: state, scene, device, coupling, friction, limits, rates, "
    "...\n"
    "  get NAME            one of these alone, or a setting of the configuration: get limiter.max_n\n"
    "  --help, --version\n"
    "\n"
    "LCM_DEFAULT_URL as gloved --lcm. Nothing here arms.\n"
    "Exit codes: 0 done, 1 refused or no answer, 2 bad usage.\n";

enum { EVENT_COMMAND = 4, REFUSED = 256, ANSWER_S = 3, SCENE_S = 15 };  // a large scene takes seconds to load

typedef struct answer {
  int kind;
  int64_t tag;  // of the command: an answer to another one, or one that somebody made up,
                // does not have it
  bool came, refused;
  char text[5000];
} answer;

static void on_event(const lcm_recv_buf_t *buffer, const char *channel, const gloved_event_t *event,
                     void *user) {
  (void)buffer, (void)channel;
  answer *a = user;
  if (event->kind != EVENT_COMMAND || (event->bits & 0xff) != a->kind || event->answers != a->tag || a->came)
    return;
  a->came = true;
  a->refused = (event->bits & REFUSED) != 0;
  snprintf(a->text, sizeof a->text, "%s", event->text);
  // From the network: nothing that a terminal obeys.
  for (char *c = a->text; *c; c++)
    if ((unsigned char)*c < ' ' || (unsigned char)*c >= 127)
      *c = '?';
}

static int find_kind(const char *name) {
  char spaced[32];
  if (strcmp(name, "get") == 0)
    return GV_REQUEST_STATUS;
  snprintf(spaced, sizeof spaced, "%s", name);
  for (char *c = spaced; *c; c++)
    if (*c == '-')
      *c = ' ';
  for (int kind = 0; kind < GV_REQUEST_KINDS; kind++)
    if (strcmp(spaced, gv_request_name(kind)) == 0)
      return kind;
  return -1;
}

// Null, or what the command wants after its name.
static const char *argument_of(const char *name) {
  static const char *const wants[][2] = {{"scene", "a file, NAME.scene"},
                                         {"coupling", "a multiple, 0.1 to 2"},
                                         {"friction", "a coefficient, 0 to 2"},
                                         {"start-log", "a file name"},
                                         {"trace", "1 or 0"},
                                         {"get", "a name; status lists them"}};
  for (size_t i = 0; i < sizeof wants / sizeof *wants; i++)
    if (strcmp(name, wants[i][0]) == 0)
      return wants[i][1];
  return NULL;
}

static bool takes_number(int kind) {
  return kind == GV_REQUEST_COUPLING || kind == GV_REQUEST_FRICTION || kind == GV_REQUEST_TRACE;
}

// The words of the command line to a command. 0, or negative, told on standard error.
static int take_words(gloved_command_t *command, int count, char **word) {
  const char *wants = argument_of(word[0]);
  char *end = NULL;
  command->kind = (int8_t)find_kind(word[0]);
  if (command->kind < 0) {
    fprintf(stderr,
            "gloved-command: %.40s: no such command; give reset, scene, coupling, friction, start-log, "
            "stop-log, disarm, trace, status or get\n",
            word[0]);
    return -1;
  }
  if (wants && count < 2) {
    fprintf(stderr, "gloved-command: %s needs %s\n", word[0], wants);
    return -1;
  }
  if (count > (wants ? 2 : 1)) {
    fprintf(stderr, "gloved-command: %s: nothing more was expected after %s; see gloved-command --help\n",
            word[wants ? 2 : 1], word[wants ? 1 : 0]);
    return -1;
  }
  if (!wants)
    return 0;
  if (!takes_number(command->kind)) {
    command->text = word[1];
    return 0;
  }
  command->value = strtod(word[1], &end);
  if (end != word[1] && !*end)
    return 0;
  fprintf(stderr, "gloved-command: %s %.40s: not a number; give %s\n", word[0], word[1], wants);
  return -1;
}

// What is in force comes as "NAME VALUE; NAME VALUE; ...": a line for each.
static void print_status(const char *values) {
  while (*values) {
    const char *end = strstr(values, "; ");
    const int length = end ? (int)(end - values) : (int)strlen(values);
    const int name = (int)strcspn(values, " ");
    printf("%-19.*s %.*s\n", name, values, length - name > 0 ? length - name - 1 : 0, values + name + 1);
    values += length + (end ? 2 : 0);
  }
}

static void print_answer(const answer *a, bool whole) {
  const char *value = strstr(a->text, "done: ");
  if (a->refused || a->kind != GV_REQUEST_STATUS || !value)
    puts(a->text);
  else if (whole)
    print_status(value + 6);
  else
    puts(value + 6);
}

int main(int argc, char **argv) {
  gv_keep_standard_files();
  if (program_answers(argc, argv, help_text))
    return 0;
  static char no_text[] = "";
  gloved_command_t command = {.text = no_text};
  if (argc < 2) {
    fputs("gloved-command: say which command; see gloved-command --help\n", stderr);
    return 2;
  }
  if (take_words(&command, argc - 1, argv + 1))
    return 2;
  const char *url = getenv("LCM_DEFAULT_URL") ? getenv("LCM_DEFAULT_URL") : "udpm://239.255.76.67:7667?ttl=0";
  lcm_t *lcm = lcm_create(url);
  if (!lcm) {
    fprintf(stderr, "gloved-command: LCM does not start on \"%s\"; check LCM_DEFAULT_URL\n", url);
    return 1;
  }
  if (getrandom(&command.utime, sizeof command.utime, 0) != sizeof command.utime)
    command.utime = (int64_t)time(NULL);
  answer a = {.kind = command.kind, .tag = command.utime};
  gloved_event_t_subscribe(lcm, "GLOVED_EVENT", on_event, &a);
  gloved_command_t_publish(lcm, "GLOVED_COMMAND", &command);
  const time_t end = time(NULL) + (command.kind == GV_REQUEST_SCENE ? SCENE_S : ANSWER_S);
  while (!a.came && time(NULL) < end)
    lcm_handle_timeout(lcm, 100);
  lcm_destroy(lcm);
  if (a.came)
    print_answer(&a, !*command.text);
  else
    fprintf(stderr, "gloved-command: no answer; is gloved running, with the same --lcm?\n");
  return a.came && !a.refused ? 0 : 1;
}
