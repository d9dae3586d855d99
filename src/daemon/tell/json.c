// SPDX-License-Identifier: BSD-3-Clause
// A string with what JSON wants escaped (RFC 8259, section 7).
#include "daemon/tell/json.h"

void gv_json_text(FILE *out, const char *text) {
  fputc('"', out);
  for (; *text; text++) {
    if ((unsigned char)*text < 0x20)
      fprintf(out, "\\u%04x", (unsigned)*text);
    else if (*text == '"' || *text == '\\')
      fprintf(out, "\\%c", *text);
    else
      fputc(*text, out);
  }
  fputc('"', out);
}
