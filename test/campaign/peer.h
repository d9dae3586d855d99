// SPDX-License-Identifier: BSD-3-Clause
// Another engine that gets the same hand, objects and finger motions as ours. MuJoCo, where it is installed
// (peer_mujoco.c); else none (peer_none.c).
#ifndef CAMPAIGN_PEER_H
#define CAMPAIGN_PEER_H

#include "engine/engine_state.h"

typedef struct peer peer;

// "mujoco", or null where none is built in.
const char *peer_name(void);
// The scene of `e` at its start, with the step of `e`; null with one line in err.
// refined: as exact as it goes.
peer *peer_open(const gv_engine *e, bool refined, char *err, size_t err_size);
// One step, limbs drawn by the springs to the drivers of `e`; nothing before its hand is placed.
void peer_step(peer *p, const gv_engine *e);
// All bodies where those of `e` are, as fast.
void peer_take_over(peer *p, const gv_engine *e);
gv_pose peer_palm(const peer *p);
gv_pose peer_object(const peer *p);  // number 1
void peer_close(peer *p);

#endif
