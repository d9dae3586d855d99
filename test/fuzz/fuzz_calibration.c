// SPDX-License-Identifier: BSD-3-Clause
// Fuzz entry (libFuzzer, `make fuzz`): any text as a calibration. What is accepted gives a finite angle for
// every count, and is the same when it was written and read again.
#include "bytes.h"
#include "daemon/load/config_load.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
  static gv_calibration calibration, again;
  char err[512] = "", saved[64];
  const fuzz_file file = fuzz_file_open(data, size);
  const int refused = gv_calibration_load(file.path, &calibration, err, sizeof err);
  if (refused)
    fuzz_require_reason(err, file.path);
  fuzz_file_close(&file);
  if (refused)
    return 0;
  for (int i = 0; i < GV_SENSORS; i++)
    for (int raw = 0; raw <= 4095; raw += 4095)
      REQUIRE(isfinite(gv_calibration_angle(&calibration, i, raw)));
  snprintf(saved, sizeof saved, "/dev/shm/fuzz-calibration-%d", (int)getpid());
  REQUIRE(gv_calibration_save(saved, &calibration, "", err, sizeof err) == 0);
  REQUIRE(gv_calibration_load(saved, &again, err, sizeof err) == 0);
  unlink(saved);
  for (int i = 0; i < GV_SENSORS; i++)
    for (int raw = 0; raw <= 4095; raw += 4095) {
      const double a = gv_calibration_angle(&calibration, i, raw);
      const double b = gv_calibration_angle(&again, i, raw);
      REQUIRE(fabs(a - b) <= 1e-6 * (1.0 + fabs(a)));
    }
  return 0;
}
