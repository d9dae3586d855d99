// SPDX-License-Identifier: BSD-3-Clause
// A candump -L log as a file, plain or gzip (zlib reads both), frame by frame with every line checked.
// A recording that a crash cut short is read up to the cut. Set-up and tools only: it blocks and allocates.
#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <zlib.h>

#include "gloved/drivers.h"

// Logs of several interfaces tick back by microseconds; more than this is another recording appended.
static const int64_t step_back_max_ns = 10000000;

int gv_log_open(gv_log *log, const char *path, char *err, size_t err_size) {
  *log = (gv_log){.path = path};
  errno = 0;
  log->file = gzopen(path, "rb");
  if (log->file)
    return 0;
  snprintf(err, err_size, "%s: cannot be opened (%s); check the path", path,
           strerror(errno ? errno : ENOMEM));
  return -1;
}

void gv_log_close(gv_log *log) {
  if (log->file)
    gzclose_r(log->file);
  log->file = NULL;
}

static int refuse_line(const gv_log *log, const char *what, const char *what_to_do, char *err,
                       size_t err_size) {
  snprintf(err, err_size, "%s:%llu: %s; %s", log->path, (unsigned long long)log->line, what, what_to_do);
  return -1;
}

// At the end of the data: 0, or -1 where the file cannot be read. A gzip stream that breaks off is an end.
static int read_end(gv_log *log, char *err, size_t err_size) {
  int code;
  const char *text = gzerror(log->file, &code);
  if (code == Z_BUF_ERROR)
    log->truncated = 1;
  if (code == Z_OK || code == Z_STREAM_END || code == Z_BUF_ERROR)
    return 0;
  if (code == Z_ERRNO)
    text = strerror(errno);
  return refuse_line(log, text, "the file cannot be read: record or copy it again", err, err_size);
}

// The next line that is neither empty nor a comment, without its newline: 1, or 0 at the
// end. *out_whole: it had a newline.
static int read_line(gv_log *log, char line[GV_LOG_LINE_MAX + 3], bool *out_whole, char *err,
                     size_t err_size) {
  for (;;) {
    if (!gzgets(log->file, line, GV_LOG_LINE_MAX + 3))
      return read_end(log, err, err_size);
    log->line++;
    size_t len = strlen(line);
    *out_whole = len > 0 && line[len - 1] == '\n';
    if (*out_whole)
      line[--len] = 0;
    if (len > 0 && line[len - 1] == '\r')
      line[--len] = 0;
    if (len > GV_LOG_LINE_MAX)
      return refuse_line(log, "a line of more than 200 characters", "give a log as candump -L writes it", err,
                         err_size);
    if (line[0] != '#' && (len > 0 || !*out_whole))
      return 1;
  }
}

// A line that parsed has one.
static void take_iface(gv_log *log, const char *line) {
  if (sscanf(line, " %*s %15s", log->iface) != 1)
    log->iface[0] = '\0';
}

int gv_log_next(gv_log *log, gv_frame *out, char *err, size_t err_size) {
  char line[GV_LOG_LINE_MAX + 3], why[120];
  bool whole = true;
  int got = read_line(log, line, &whole, err, err_size);
  if (got <= 0)
    return got;
  if (gv_log_parse(line, out, why, sizeof why)) {
    if (whole)
      return refuse_line(log, why, "give a log as candump -L writes it", err, err_size);
    if (!gzeof(log->file))
      return refuse_line(log, "a zero byte", "give a text log as candump -L writes it", err, err_size);
    log->truncated = 1;
    return read_end(log, err, err_size);
  }
  if (log->last_ns - out->stamp_ns > step_back_max_ns)
    return refuse_line(log, "the stamp is more than 10 ms before the line above",
                       "give one recording per file, in order", err, err_size);
  if (out->stamp_ns < log->last_ns) {
    log->late++;
    out->stamp_ns = log->last_ns;
  }
  log->last_ns = out->stamp_ns;
  take_iface(log, line);
  return 1;
}
