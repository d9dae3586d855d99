// SPDX-License-Identifier: BSD-3-Clause
// What may be asked over LCM, and how often: everything at most ten times a second, but disarm always.
#include "daemon/loop/request.h"
#include "support/check.h"

static void test_disarm_is_never_limited(void) {
  gv_request_rate rate = {0};
  gv_request out;
  int obeyed = 0, refused = 0;
  for (int i = 0; i < 1000; i++) {
    const int64_t now_ns = 1000000LL * i;
    refused += gv_request_check(GV_REQUEST_FRICTION, 9.0, "", &rate, now_ns, &out) != NULL;
    obeyed += gv_request_check(GV_REQUEST_DISARM, 0.0, "", &rate, now_ns, &out) == NULL && out.kind == GV_REQUEST_DISARM;
  }
  CHECK(refused == 1000 && obeyed == 1000, "%d refused, %d disarmed", refused, obeyed);
}

static void test_ten_a_second_are_taken(void) {
  gv_request_rate rate = {0};
  gv_request out;
  int taken = 0;
  for (int i = 0; i < 1000; i++) taken += gv_request_check(GV_REQUEST_RESET, 0.0, "", &rate, 1000000LL * i, &out) == NULL;
  CHECK(taken == GV_REQUEST_PER_SECOND, "%d in a second", taken);
  CHECK(gv_request_check(GV_REQUEST_RESET, 0.0, "", &rate, 1000000000LL, &out) == NULL, "a new second");
}

static void test_messages_that_are_none_are_answered_ten_times_a_second(void) {
  gv_request_rate rate = {0};
  int answered = 0;
  for (int i = 0; i < 5000; i++) answered += gv_request_may_complain(&rate, 1000000LL * i);
  CHECK(answered == 5 * GV_REQUEST_PER_SECOND, "%d in five seconds", answered);
}

int main(void) {
  RUN(test_disarm_is_never_limited);
  RUN(test_ten_a_second_are_taken);
  RUN(test_messages_that_are_none_are_answered_ten_times_a_second);
  return check_done();
}
