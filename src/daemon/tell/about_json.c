// SPDX-License-Identifier: BSD-3-Clause
// What a recording was made of (load/about.h) as a JSON object. Set-up, and after the loop has ended.
#include "daemon/tell/about_json.h"

#include <inttypes.h>

#include "daemon/tell/json.h"

static void json_text(FILE *out, const char *key, const char *text) {
  fprintf(out, "\"%s\": ", key);
  gv_json_text(out, text);
  fputs(", ", out);
}

static void json_file(FILE *out, const char *key, const gv_about_file *file) {
  fprintf(out, "\"%s\": {", key);
  json_text(out, "name", file->name);
  fprintf(out, "\"hash\": \"%016" PRIx64 "\", \"text\": ", file->hash);
  gv_json_text(out, gv_about_small_text(file));
  fputs("}, ", out);
}

void gv_about_json(const gv_about *about, FILE *out) {
  fputc('{', out);
  json_text(out, "version", about->version);
  json_text(out, "commit", about->commit);
  json_text(out, "date", about->date);
  json_text(out, "command_line", about->command_line);
  json_text(out, "fcu", about->fcu);
  if (about->fcu2[0])
    json_text(out, "fcu2", about->fcu2);
  json_text(out, "tracker", about->tracker);
  json_text(out, "hand", about->hand);
  json_file(out, "scene", &about->scene);
  json_file(out, "settings", &about->settings);
  fprintf(out, "\"rate_hz\": %.9g}", about->rate_hz);
}
