// SPDX-License-Identifier: BSD-3-Clause
// URLs of serial devices (serial_url.h). Set-up only.
#include "drivers/serial_url.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "drivers/serial_port.h"

int gv_serial_url_fail(serial_url *url, const char *format, ...) {
  if (url->failed)
    return -1;
  url->failed = true;
  int n = snprintf(url->err, url->err_size, "%.80s: ", url->whole);
  if (n < 0 || (size_t)n >= url->err_size)
    return -1;
  va_list args;
  va_start(args, format);
  vsnprintf(url->err + n, url->err_size - (size_t)n, format, args);
  va_end(args);
  return -1;
}

static void take_option(serial_url *url, char *option) {
  char *equals = strchr(option, '=');
  if (!equals || equals == option || !equals[1]) {
    gv_serial_url_fail(url, "\"%.40s\" has no name or no value; write NAME=VALUE, joined by &", option);
    return;
  }
  if (url->count == SERIAL_URL_OPTIONS) {
    gv_serial_url_fail(url, "more than %d parameters; leave some out", SERIAL_URL_OPTIONS);
    return;
  }
  *equals = '\0';
  for (int i = 0; i < url->count; i++)
    if (strcmp(url->name[i], option) == 0)
      gv_serial_url_fail(url, "%s stands there twice; leave one out", option);
  url->name[url->count] = option;
  url->value[url->count++] = equals + 1;
}

void gv_serial_url_parse(serial_url *url, const char *text, char *err, size_t err_size) {
  *url = (serial_url){.whole = text, .device = "", .err = err, .err_size = err_size};
  if (strncmp(text, "serial:", 7) != 0) {
    gv_serial_url_fail(url, "no serial device; write serial:DEVICE?type=...");
    return;
  }
  if (strlen(text) - 7 >= sizeof url->text) {
    gv_serial_url_fail(url, "longer than %d characters; shorten it", SERIAL_URL_BYTES - 1);
    return;
  }
  strcpy(url->text, text + 7);
  url->device = url->text;
  char *options = strchr(url->text, '?');
  char *save = NULL;
  if (options)
    *options++ = '\0';
  if (!*url->device)
    gv_serial_url_fail(url, "the device is missing; write serial:/dev/ttyUSB0?type=...");
  for (char *one = options ? strtok_r(options, "&", &save) : NULL; one; one = strtok_r(NULL, "&", &save))
    take_option(url, one);
}

static const char *take_value(serial_url *url, const char *name) {
  for (int i = 0; i < url->count; i++) {
    if (strcmp(url->name[i], name) != 0)
      continue;
    url->used[i] = true;
    return url->value[i];
  }
  return NULL;
}

int gv_serial_url_choice(serial_url *url, const char *name, const char *const *names, int otherwise) {
  const char *value = take_value(url, name);
  if (!value)
    return otherwise;
  char list[128] = "";
  for (int i = 0; names[i]; i++) {
    if (strcmp(value, names[i]) == 0)
      return i;
    size_t n = strlen(list);
    snprintf(list + n, sizeof list - n, "%s%s", i ? ", " : "", names[i]);
  }
  gv_serial_url_fail(url, "%s=%.40s is not known; write one of %s", name, value, list);
  return otherwise;
}

const char *gv_serial_url_text(serial_url *url, const char *name) { return take_value(url, name); }

int gv_serial_url_baud(serial_url *url, int otherwise) {
  const char *value = take_value(url, "baud");
  if (!value)
    return otherwise;
  char *end;
  long baud = strtol(value, &end, 10);
  if (*end || baud < 0 || baud > 4000000 || !gv_serial_port_knows((int)baud))
    gv_serial_url_fail(
        url,
        "baud=%.20s is no speed of a serial line; write 9600, 19200, 38400, 57600 or 115200 as "
        "set at the device",
        value);
  return (int)baud;
}

int gv_serial_url_finish(serial_url *url, const char *example) {
  for (int i = 0; i < url->count && !url->failed; i++)
    if (!url->used[i])
      gv_serial_url_fail(url, "%.40s is no parameter of this device; write e.g. %s", url->name[i], example);
  return url->failed ? -1 : 0;
}
