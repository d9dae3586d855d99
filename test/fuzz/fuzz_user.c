// SPDX-License-Identifier: BSD-3-Clause
// Fuzz entry (libFuzzer, `make fuzz`): any text as the script of a simulated user. What is accepted must be
// finite at every time, and the device that plays it must send sound frames.
#include "bytes.h"
#include "gloved/fcu.h"
#include "gloved/sim.h"

enum { PLAY_MS = 50, LOOKS = 20, FRAMES = 16 };

static void play(const gv_sim_script *script) {
  static gv_sim sim;
  gv_frame frame[FRAMES];
  gv_sim_init(&sim, script, NULL, 0);
  gv_sim_start(&sim);
  for (int64_t ms = 0; ms < PLAY_MS && !gv_sim_ended(&sim); ms++) {
    int count;
    while ((count = gv_sim_advance(&sim, ms * 1000000, frame, FRAMES)) > 0)
      for (int i = 0; i < count; i++) {
        gv_pose_msg pose;
        gv_glove_msg glove;
        if (frame[i].id == GV_ID_POSE)
          REQUIRE(gv_fcu_unpack_pose(&frame[i], &pose) == GV_FCU_OK);
        if (frame[i].id == GV_ID_GLOVE)
          REQUIRE(gv_fcu_unpack_glove(&frame[i], &glove) == GV_FCU_OK);
      }
  }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
  static gv_sim_script script;
  char err[512] = "";
  char *text = malloc(size + 1);
  memcpy(text, data, size);
  text[size] = '\0';
  if (gv_sim_script_parse(text, "fuzz.user", &script, err, sizeof err) == 0) {
    REQUIRE(isfinite(script.end_s) && script.end_s >= 0.0);
    for (int i = 0; i <= LOOKS; i++) {
      const gv_sim_keyframe at = gv_sim_script_at(&script, script.end_s * i / LOOKS);
      REQUIRE(gv_pose_finite(at.T_world_wrist));
      for (int k = 0; k < GV_SENSORS; k++)
        REQUIRE(isfinite(at.angle_rad[k]));
    }
    play(&script);
  } else {
    fuzz_require_reason(err, "fuzz.user");
  }
  free(text);
  return 0;
}
