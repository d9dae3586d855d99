// SPDX-License-Identifier: BSD-3-Clause
// Fuzz entry (libFuzzer, `make fuzz`): any text as a configuration. What is accepted must be sound for the
// engine, the limiter and the safety machine.
#include "bytes.h"
#include "daemon/load/config_load.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
  static gv_settings settings;
  char err[512] = "";
  const fuzz_file file = fuzz_file_open(data, size);
  if (gv_settings_load(file.path, &settings, err, sizeof err) == 0) {
    const gv_limiter_config *limiter = &settings.limiter;
    const gv_safety_config *safety = &settings.safety;
    REQUIRE(gv_config_check(&settings.engine) == NULL);
    REQUIRE(limiter->max_n >= 0.0 && limiter->max_n <= 12.285 && limiter->pretension_n <= limiter->max_n);
    REQUIRE(limiter->slew_n_per_s > 0.0 && isfinite(limiter->slew_n_per_s));
    REQUIRE(limiter->ramp_s >= 0.0 && isfinite(limiter->ramp_s) && limiter->max_age_s > 0.0 &&
            isfinite(limiter->max_age_s));
    REQUIRE(safety->max_age_s > 0.0 && isfinite(safety->max_age_s) && safety->bad_window_s > 0.0 &&
            isfinite(safety->bad_window_s));
    REQUIRE(settings.rate_hz >= 10.0 && settings.rate_hz <= 10000.0);
  } else {
    REQUIRE(err[0] != '\0' && strchr(err, '\n') == NULL);
  }
  fuzz_file_close(&file);
  return 0;
}
