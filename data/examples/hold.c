// SPDX-License-Identifier: BSD-3-Clause
// The engine without the daemon: a flat hand lies on the box for a second, and what
// each finger feels is printed.
//   cc hold.c $(pkg-config --cflags --libs gloved) -o hold && ./hold box.scene
#include <stdio.h>
#include <stdlib.h>

#include <gloved/engine.h>
#include <gloved/load.h>

int main(int argc, char **argv) {
  static _Alignas(64) unsigned char memory[32 << 20];
  char err[512];
  gv_arena arena;
  gv_scene scene;
  gv_arena_init(&arena, memory, sizeof memory);
  if (argc != 2 || gv_scene_load(argv[1], &arena, &scene, err, sizeof err)) {
    fprintf(stderr, "hold: %s\n", argc == 2 ? err : "give one scene file");
    return 2;
  }
  const gv_config cfg = gv_config_default();
  const size_t size = gv_engine_size(&cfg, &scene);
  void *block = malloc(size);
  gv_engine *engine = block ? gv_engine_init(block, size, &cfg, &scene) : NULL;
  if (!engine)
    return 2;
  gv_sample sample = {
    .T_world_receiver = {{1, 0, 0, 0}, {-0.1, 0, 0.085}}, .glove_new = true, .pose_new = true};
  for (int i = 0; i < GV_SENSORS; i++)
    sample.raw[i] = gv_calibration_raw(&cfg.calibration, i, 0.0);
  gv_step_result result;
  for (int step = 0; step < 1000; step++)
    gv_engine_step(engine, &sample, &result);
  printf("%d objects, tensions", scene.object_count);
  for (int i = 0; i < GV_FINGERS; i++)
    printf(" %.3f", result.tension_n[i]);
  printf(" N, state %016llx\n", (unsigned long long)gv_engine_hash(engine));
  gv_engine_close(engine);
  free(block);
  return 0;
}
