// SPDX-License-Identifier: BSD-3-Clause
// Fuzz entry (libFuzzer, `make fuzz`): any text as a scene. What is refused is refused in one
// line; what is accepted must live through thirty steps with a hand in it, finite, in the memory
// that the engine asked for to the byte.
#include "bytes.h"
#include "daemon/load/scene_load.h"
#include "gloved/engine.h"

enum { SCENE_BYTES = 64 << 20, STEPS = 30 };

static _Alignas(64) unsigned char memory[SCENE_BYTES];

static void require_finite(const gv_engine *engine, const gv_scene *scene, const gv_step_result *result) {
  for (int i = 0; i < GV_FINGERS; i++)
    REQUIRE(isfinite(result->tension_n[i]) && result->tension_n[i] >= 0.0);
  for (int i = 0; i < scene->object_count; i++)
    REQUIRE(gv_pose_finite(gv_engine_object_pose(engine, i)));
  for (int i = 0; i < GV_LIMBS; i++)
    REQUIRE(gv_pose_finite(gv_engine_limb_pose(engine, i)));
}

static void run(const gv_scene *scene) {
  const gv_config cfg = gv_config_default();
  const size_t size = gv_engine_size(&cfg, scene);
  void *block = malloc(size);
  REQUIRE(block != NULL);
  gv_engine *engine = gv_engine_init(block, size, &cfg, scene);
  REQUIRE(engine != NULL);
  gv_sample sample = {
    .T_world_receiver = {{1, 0, 0, 0}, {-0.1, 0, 0.05}}, .glove_new = true, .pose_new = true};
  for (int i = 0; i < GV_SENSORS; i++)
    sample.raw[i] = gv_calibration_raw(&cfg.calibration, i, 0.3);
  for (int i = 0; i < STEPS; i++) {
    gv_step_result result;
    sample.T_world_receiver.p.x += 0.002;
    gv_engine_step(engine, &sample, &result);
    require_finite(engine, scene, &result);
  }
  gv_engine_close(engine);
  free(block);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
  gv_arena arena;
  gv_scene scene;
  char err[512] = "";
  const fuzz_file file = fuzz_file_open(data, size);
  gv_arena_init(&arena, memory, sizeof memory);
  if (gv_scene_load(file.path, &arena, &scene, err, sizeof err) == 0)
    run(&scene);
  else
    fuzz_require_reason(err, file.path);
  fuzz_file_close(&file);
  return 0;
}
