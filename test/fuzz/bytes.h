// SPDX-License-Identifier: BSD-3-Clause
// What the fuzz targets share: the fuzzer's bytes as a file with a path, a refusal looked at,
// bytes taken one after the other.
#ifndef FUZZ_BYTES_H
#define FUZZ_BYTES_H

#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

#define REQUIRE(cond)                                                                                        \
  do {                                                                                                       \
    if (!(cond)) {                                                                                           \
      fprintf(stderr, "%s:%d: not so: %s\n", __FILE__, __LINE__, #cond);                                     \
      abort();                                                                                               \
    }                                                                                                        \
  } while (0)

// A regular file in memory; its path is good until it is closed.
typedef struct fuzz_file {
  int descriptor;
  char path[40];
} fuzz_file;

static inline fuzz_file fuzz_file_open(const uint8_t *data, size_t size) {
  fuzz_file file = {.descriptor = memfd_create("fuzz", 0)};
  REQUIRE(file.descriptor >= 0);
  REQUIRE(write(file.descriptor, data, size) == (ssize_t)size);
  snprintf(file.path, sizeof file.path, "/proc/self/fd/%d", file.descriptor);
  return file;
}

static inline void fuzz_file_close(const fuzz_file *file) { close(file->descriptor); }

// A refusal is one line that names the file.
static inline void fuzz_require_reason(const char *err, const char *path) {
  REQUIRE(strstr(err, path) != NULL);
  REQUIRE(strchr(err, '\n') == NULL);
}

// Bytes from the front; zeros when they are used up.
typedef struct fuzz_bytes {
  const uint8_t *next;
  size_t rest;
} fuzz_bytes;

static inline void fuzz_take(fuzz_bytes *bytes, void *out, size_t count) {
  const size_t there = count < bytes->rest ? count : bytes->rest;
  memset(out, 0, count);
  if (there)
    memcpy(out, bytes->next, there);
  bytes->next += there;
  bytes->rest -= there;
}

static inline uint8_t fuzz_byte(fuzz_bytes *bytes) {
  uint8_t value;
  fuzz_take(bytes, &value, 1);
  return value;
}

#endif
