// SPDX-License-Identifier: BSD-3-Clause
// The parts of gloved-trace: each takes its own arguments (argv[0] is its name) and returns an exit code.
#ifndef TRACE_H
#define TRACE_H

enum { EXIT_DONE = 0, EXIT_FAULT = 1, EXIT_BAD_INPUT = 2 };

int trace_info(int argc, char **argv);
int trace_import(int argc, char **argv);
int trace_record(int argc, char **argv);
int trace_align(int argc, char **argv);

// Beside a recording that was written: version, commit, date and command line (FILE.about); nothing beside
// "-". Returns `code`, or EXIT_FAULT where that cannot be written.
int trace_about(int code, const char *path);
// One line on standard error, "gloved-trace: ..."; returns `code`.
int trace_fail(int code, const char *format, ...) __attribute__((format(printf, 2, 3)));
// A number in lo..hi from an option's text, or false.
_Bool trace_number(const char *text, double lo, double hi, double *out);

#endif
