// SPDX-License-Identifier: BSD-3-Clause
// What may be asked over LCM, and how often: everything at most ten times a second, but disarm always.
#include "daemon/loop/request.h"
#include "support/check.h"

#include <math.h>
#include <string.h>

static bool asked(int kind, double value, const char *text, gv_request_rate *rate, int64_t now_ns) {
  char why[GV_REQUEST_WHY];
  gv_request out;
  const gv_request_message message = {kind, value, text, 7};
  return gv_request_check(&message, rate, now_ns, &out, why) && (int)out.kind == kind && out.tag == 7;
}

static void check_why(int kind, double value, const char *text, const char *wanted) {
  char why[GV_REQUEST_WHY];
  gv_request_rate rate = {0};
  gv_request out;
  const gv_request_message message = {kind, value, text, 0};
  const bool taken = gv_request_check(&message, &rate, 0, &out, why);
  CHECK(!taken && strcmp(why, wanted) == 0, "%d: \"%s\", not \"%s\"", taken, why, wanted);
}

static void test_a_refusal_says_what_is_wrong_with_the_value(void) {
  check_why(GV_REQUEST_COUPLING, 2.5, "", "2.5 is above 2; give a multiple from 0.1 to 2");
  check_why(GV_REQUEST_COUPLING, -1.0, "", "-1 is below 0.1; give a multiple from 0.1 to 2");
  check_why(GV_REQUEST_FRICTION, NAN, "", "not a number; give a coefficient from 0 to 2");
  check_why(GV_REQUEST_TRACE, 0.5, "", "0.5 is neither; give 1 or 0");
  check_why(GV_REQUEST_START_LOG, 0.0, "a/b",
            "a/b: give a file name of letters, digits, . _ - and no folder");
  check_why(
      GV_REQUEST_SCENE, 0.0, "x\x1b[2J",
      "x?[2J: give a file NAME.scene at or below the daemon's directory, of letters, digits, . _ - and /");
  check_why(GV_REQUEST_SCENE, 0.0, "nowhere.scene",
            "nowhere.scene: there is no such file in the daemon's directory");
  check_why(GV_REQUEST_STATUS, 0.0, "a b", "a b: no value has such a name; gloved-command status lists them");
  check_why(99, 0.0, "", "no command has the number 99; see data/lcm/gloved_command_t.lcm");
}

static void test_disarm_is_never_limited(void) {
  gv_request_rate rate = {0};
  int obeyed = 0;
  int refused = 0;
  for (int i = 0; i < 1000; i++) {
    const int64_t now_ns = 1000000LL * i;
    refused += !asked(GV_REQUEST_FRICTION, 9.0, "", &rate, now_ns);
    obeyed += asked(GV_REQUEST_DISARM, 0.0, "", &rate, now_ns);
  }
  CHECK(refused == 1000 && obeyed == 1000, "%d refused, %d disarmed", refused, obeyed);
}

static void test_ten_a_second_are_taken(void) {
  gv_request_rate rate = {0};
  int taken = 0;
  for (int i = 0; i < 1000; i++)
    taken += asked(GV_REQUEST_RESET, 0.0, "", &rate, 1000000LL * i);
  CHECK(taken == GV_REQUEST_PER_SECOND, "%d in a second", taken);
  CHECK(asked(GV_REQUEST_RESET, 0.0, "", &rate, 1000000000LL), "a new second");
}

static void test_messages_that_are_none_are_answered_ten_times_a_second(void) {
  gv_request_rate rate = {0};
  int answered = 0;
  for (int i = 0; i < 5000; i++)
    answered += gv_request_may_complain(&rate, 1000000LL * i);
  CHECK(answered == 5 * GV_REQUEST_PER_SECOND, "%d in five seconds", answered);
}

int main(void) {
  RUN(test_a_refusal_says_what_is_wrong_with_the_value);
  RUN(test_disarm_is_never_limited);
  RUN(test_ten_a_second_are_taken);
  RUN(test_messages_that_are_none_are_answered_ten_times_a_second);
  return check_done();
}
