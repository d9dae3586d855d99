// SPDX-License-Identifier: BSD-3-Clause
// The whole test framework: a test program calls RUN(test_...) for each test function and ends with `return
// check_done();`. CHECK fails the running test with file, line and a message, and goes on. Output: TAP
// (testanything.org), one line per test ("ok - name", "not ok - name", "ok - name # SKIP why"), for prove.
#ifndef CHECK_H
#define CHECK_H

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

// C has these as floats, and clang reports each promotion to double.
#undef INFINITY
#undef NAN
#define INFINITY HUGE_VAL
#define NAN __builtin_nan("")

static int check_failures, check_in_test, check_skipped, check_tests;

#define CHECK(cond, ...)                                                                                     \
  do {                                                                                                       \
    if (!(cond)) {                                                                                           \
      if (check_in_test++ < 5) {                                                                             \
        printf("# %s:%d: %s: ", __FILE__, __LINE__, #cond);                                                  \
        printf(__VA_ARGS__);                                                                                 \
        printf("\n");                                                                                        \
      }                                                                                                      \
    }                                                                                                        \
  } while (0)

#define CHECK_NEAR(a, b, tol)                                                                                \
  CHECK(fabs((a) - (b)) <= (tol), "%.12g against %.12g, off by %.3g, allowed %.3g", (double)(a),             \
        (double)(b), (double)(a) - (double)(b), (double)(tol))

// Skip the running test, in words: SKIP("no recordings beside the project"); return;
#define SKIP(why)                                                                                            \
  do {                                                                                                       \
    check_skipped = 1;                                                                                       \
    printf("ok - %s # SKIP %s\n", __func__, (why));                                                          \
  } while (0)

#define RUN(test)                                                                                            \
  do {                                                                                                       \
    check_in_test = check_skipped = 0;                                                                       \
    test();                                                                                                  \
    check_tests++;                                                                                           \
    if (check_in_test) {                                                                                     \
      check_failures++;                                                                                      \
      printf("not ok - %s (%d checks)\n", #test, check_in_test);                                             \
    } else if (!check_skipped)                                                                               \
      printf("ok - %s\n", #test);                                                                            \
    fflush(stdout);                                                                                          \
  } while (0)

static inline int check_done(void) {
  printf("1..%d\n", check_tests);
  return check_failures ? 1 : 0;
}

// Deterministic random numbers for tests (xorshift64*): uniform in [lo, hi).
static inline double check_uniform(unsigned long long *state, double lo, double hi) {
  *state ^= *state >> 12;
  *state ^= *state << 25;
  *state ^= *state >> 27;
  return lo + (hi - lo) * (double)((*state * 2685821657736338717ULL) >> 11) / 9007199254740992.0;
}

#endif
