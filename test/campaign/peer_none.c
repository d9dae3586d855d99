// SPDX-License-Identifier: BSD-3-Clause
// No other engine is built in (peer.h).
#include "campaign/peer.h"

#include <stdio.h>

const char *peer_name(void) { return NULL; }

peer *peer_open(const gv_engine *e, bool refined, char *err, size_t err_size) {
  (void)e, (void)refined;
  snprintf(err, err_size, "built without another engine");
  return NULL;
}

void peer_step(peer *p, const gv_engine *e) { (void)p, (void)e; }

void peer_take_over(peer *p, const gv_engine *e) { (void)p, (void)e; }

gv_pose peer_palm(const peer *p) {
  (void)p;
  return gv_pose_identity();
}

gv_pose peer_object(const peer *p) {
  (void)p;
  return gv_pose_identity();
}

void peer_close(peer *p) { (void)p; }
