// SPDX-License-Identifier: BSD-3-Clause
// The thread that loads a scene (scene_thread.h). It is never waited for and never cancelled: its work is
// bounded (scene_check.c counts it), and at the end of the program it goes with the process.
#include "daemon/load/scene_thread.h"

#include <signal.h>
#include <stdio.h>

enum { STACK_BYTES = 4 << 20 };  // masses of all pieces lie on it

static void *load(void *argument) {
  gv_scene_thread *loader = argument;
  loader->failed = gv_world_load(&loader->world, loader->file, NULL, &loader->cfg, loader->err,
                                 sizeof loader->err) != 0;
  atomic_store_explicit(&loader->busy, 0, memory_order_release);
  return NULL;
}

// Signals are for the other threads.
static int start(gv_scene_thread *loader) {
  pthread_attr_t attributes;
  pthread_t thread;
  sigset_t all, before;
  sigfillset(&all);
  pthread_attr_init(&attributes);
  pthread_attr_setstacksize(&attributes, STACK_BYTES);
  pthread_attr_setdetachstate(&attributes, PTHREAD_CREATE_DETACHED);
  pthread_sigmask(SIG_SETMASK, &all, &before);
  const int error = pthread_create(&thread, &attributes, load, loader);
  pthread_sigmask(SIG_SETMASK, &before, NULL);
  pthread_attr_destroy(&attributes);
  return error;
}

const char *gv_scene_thread_begin(gv_scene_thread *loader, const char *file, const gv_config *cfg,
                                  int64_t now_ns) {
  if (atomic_load_explicit(&loader->busy, memory_order_acquire))
    return "another scene is still being loaded; wait for it";
  if (loader->given_up)
    gv_world_close(&loader->world);
  loader->given_up = false;
  loader->cfg = *cfg;
  loader->asked_ns = now_ns;
  snprintf(loader->file, sizeof loader->file, "%s", file);
  atomic_store(&loader->busy, 1);
  loader->pending = start(loader) == 0;
  if (loader->pending)
    return NULL;
  atomic_store(&loader->busy, 0);
  return "there is no thread for it; close other programs";
}

bool gv_scene_thread_ended(gv_scene_thread *loader, int64_t now_ns, gv_world *out, const char **out_refusal) {
  if (!loader->pending)
    return false;
  if (atomic_load_explicit(&loader->busy, memory_order_acquire)) {
    if (now_ns - loader->asked_ns < (int64_t)GV_SCENE_LOAD_S * 1000000000)
      return false;
    loader->pending = false;
    loader->given_up = true;
    *out_refusal = "it takes longer than 10 s to load; simplify it";
    return true;
  }
  loader->pending = false;
  *out_refusal = loader->failed ? loader->err : NULL;
  if (!loader->failed)
    *out = loader->world;
  loader->world = (gv_world){0};
  return true;
}
