// SPDX-License-Identifier: BSD-3-Clause
// A calibration as text, in the format that gv_calibration_load reads. The file appears whole or not at all:
// it is written beside its place and moved there. Set-up and tools only.
#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "daemon/load/config_load.h"

static void put_sensors(FILE *file, const gv_calibration *cal) {
  const double deg = 180.0 / GV_PI;
  fprintf(file, "version = 1;\n\nsensors = {\n");
  for (int i = 0; i < GV_SENSORS; i++)
    fprintf(file, "  %-22s = { raw = [%.1f, %.1f]; deg = [%.2f, %.2f]; };\n", gv_sensor_name(i),
            cal->raw[i][0], cal->raw[i][1], deg * cal->angle_rad[i][0], deg * cal->angle_rad[i][1]);
  fprintf(file, "};\n");
}

// Every line of the comment behind a #; control characters, which may come with an URL, are left out.
static void put_comment(FILE *file, const char *comment) {
  fputs("# ", file);
  for (const char *p = comment; *p; p++) {
    if (*p == '\n')
      fputs("\n# ", file);
    else if ((unsigned char)*p >= ' ')
      fputc(*p, file);
  }
  fputs("\n\n", file);
}

int gv_calibration_save(const char *path, const gv_calibration *cal, const char *comment, char *err,
                        size_t err_size) {
  char beside[GV_SETTING_TEXT + 8];
  const int n = snprintf(beside, sizeof beside, "%s.new", path);
  FILE *file = n < (int)sizeof beside ? fopen(beside, "w") : NULL;
  if (!file) {
    snprintf(err, err_size, "%.200s: cannot be written (%s); choose another place", path, strerror(errno));
    return -1;
  }
  put_comment(file, comment);
  put_sensors(file, cal);
  const int failed = ferror(file);
  if (fclose(file) == 0 && !failed && rename(beside, path) == 0)
    return 0;
  snprintf(err, err_size, "%.200s: not written (%s); make room on the disk", path, strerror(errno));
  remove(beside);
  return -1;
}
