// SPDX-License-Identifier: BSD-3-Clause
// The three solvers, opened in memory of their own with the default settings.
#ifndef TEST_SUPPORT_SOLVERS_H
#define TEST_SUPPORT_SOLVERS_H

#include <stdlib.h>

#include "dynamics/choice.h"
#include "gloved/arena.h"
#include "gloved/engine.h"

static const gv_solver every_solver[] = {GV_SOLVER_NEWTON, GV_SOLVER_DANTZIG, GV_SOLVER_QUICKSTEP};
enum { EVERY_SOLVER = 3 };

// One at a time: the memory is the same.
static inline gv_choice open_solvers(void) {
  static _Alignas(64) unsigned char memory[24 << 20];
  gv_choice choice;
  gv_arena arena;
  const gv_config cfg = gv_config_default();
  gv_arena_init(&arena, memory, sizeof memory);
  if (!gv_choice_open(&choice, &arena, &cfg))
    abort();
  return choice;
}

#endif
