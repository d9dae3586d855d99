// SPDX-License-Identifier: BSD-3-Clause
// What a recording was made of: version and commit, date, command line, scene, settings, hand. It stands in
// a file of its own beside the recording (NAME.about, libconfig's syntax; other programs that read candump
// logs do not know comments), in the summary, and on channel GLOVED_ABOUT, so in every LCM log. Main
// thread; takes memory from the heap.
#ifndef GLOVED_DAEMON_ABOUT_H
#define GLOVED_DAEMON_ABOUT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum {
  GV_ABOUT_TEXT_MAX = 1 << 20,  // bytes of a scene or settings file that are kept with it
  GV_ABOUT_SMALL = 24000
};  // and in the summary and the message

// A text file: name, FNV-1a 64 of its bytes, and the bytes.
typedef struct gv_about_file {
  char name[256];  // empty: none
  uint64_t hash;
  size_t size;
  char *text;  // null: larger than GV_ABOUT_TEXT_MAX, or no text
} gv_about_file;

typedef struct gv_about {
  char version[64], commit[64], date[32];  // date: UTC, ISO 8601
  char command_line[1024];
  char fcu[256], tracker[256], hand[8];  // hand: "right" or "left"
  char fcu2[256];                        // of a second hand, the other one; empty: none
  double rate_hz;
  gv_about_file scene, settings;  // settings.name empty: the defaults
} gv_about;

// The interfaces that the frames of the two hands have in a recording: those of CAN, else can0 and can1.
enum { GV_ABOUT_IFACE = 16 };
void gv_about_interfaces(const char *fcu, const char *fcu2, char out_first[GV_ABOUT_IFACE],
                         char out_second[GV_ABOUT_IFACE]);
// The file as it is now; a name alone where it cannot be read.
void gv_about_read_file(const char *name, gv_about_file *out);
// The words of the command line, those with spaces or quotes in quotes.
void gv_about_command_line(int argc, char **argv, char out[1024]);
// Version, commit and the time of day.
void gv_about_now(gv_about *out);
void gv_about_free(gv_about *about);

// Beside the recording at `path`. 0, or negative with one line in err.
int gv_about_write(const gv_about *about, const char *path, char *err, size_t err_size);
// 1, or 0 where there is none beside the recording (FILE.about; of FILE.gz also FILE.about),
// or negative with one line in err.
int gv_about_read(const char *path, gv_about *out, char *err, size_t err_size);
// The text where it is small, else "".
const char *gv_about_small_text(const gv_about_file *file);

#endif
