// SPDX-License-Identifier: BSD-3-Clause
// "serial:DEVICE?NAME=VALUE&..." taken apart. Set-up only. The first error sticks: after it every getter does
// nothing, and gv_serial_url_finish reports it, or the parameter that nobody asked for.
#ifndef DRIVERS_SERIAL_URL_H
#define DRIVERS_SERIAL_URL_H

#include <stdbool.h>
#include <stddef.h>

enum { SERIAL_URL_BYTES = 256, SERIAL_URL_OPTIONS = 12 };

typedef struct serial_url {
  char text[SERIAL_URL_BYTES];
  const char *whole, *device;  // as given; the path
  char *name[SERIAL_URL_OPTIONS], *value[SERIAL_URL_OPTIONS];
  bool used[SERIAL_URL_OPTIONS];
  int count;
  bool failed;
  char *err;
  size_t err_size;
} serial_url;

void gv_serial_url_parse(serial_url *url, const char *text, char *err, size_t err_size);
// Index of the value in `names` (null-terminated), or `otherwise` where the parameter is absent.
int gv_serial_url_choice(serial_url *url, const char *name, const char *const *names, int otherwise);
// A speed that termios knows, or `otherwise` where absent.
int gv_serial_url_baud(serial_url *url, int otherwise);
// The value as it stands; null where the parameter is absent.
const char *gv_serial_url_text(serial_url *url, const char *name);
// One line "URL: what; what to do"; the first one stays. Returns -1.
int gv_serial_url_fail(serial_url *url, const char *format, ...) __attribute__((format(printf, 2, 3)));
// 0 where all went well and no parameter is left over. example: a URL that would be right.
int gv_serial_url_finish(serial_url *url, const char *example);

#endif
