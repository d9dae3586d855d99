// SPDX-License-Identifier: BSD-3-Clause
// A recording as a device: a candump -L log, read and checked whole when it is opened, then
// handed out by its own stamps against whatever clock the caller passes. poll and send only
// touch memory that opening allocated.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "gloved/drivers.h"
#include "gloved/fcu.h"

typedef struct trace {
  gv_frame *frame;  // stamps from 0, never decreasing
  size_t count, next, capacity;
  int64_t end_ns;  // stamp of the log's last line
  bool past_end;
  gv_driver_stats stats;
} trace;

static int poll_trace(void *self, int64_t now_ns, gv_frame *out, int max) {
  trace *t = self;
  int n = 0;
  while (n < max && t->next < t->count && t->frame[t->next].stamp_ns <= now_ns)
    out[n++] = t->frame[t->next++];
  t->past_end = now_ns >= t->end_ns;
  t->stats.rx += (uint64_t)n;
  return n;
}

static int send_trace(void *self, const gv_frame *frame, int count) {
  (void)frame;
  ((trace *)self)->stats.tx += (uint64_t)count;
  return 0;
}

static bool trace_ended(void *self) {
  const trace *t = self;
  return t->past_end && t->next == t->count;
}

static gv_driver_stats trace_stats(void *self) { return ((trace *)self)->stats; }

static void close_trace(void *self) {
  trace *t = self;
  free(t->frame);
  free(t);
}

static int append_frame(trace *t, const gv_frame *frame) {
  if (t->count == t->capacity) {
    size_t capacity = t->capacity ? 2 * t->capacity : 4096;
    gv_frame *grown = realloc(t->frame, capacity * sizeof *grown);
    if (!grown)
      return -1;
    t->frame = grown;
    t->capacity = capacity;
  }
  t->frame[t->count++] = *frame;
  return 0;
}

static bool is_id(const gv_frame *frame, uint32_t id) {
  return frame->id == id && !(frame->flags & (GV_FRAME_EXTENDED | GV_FRAME_ERROR));
}

// No step of the engine stands behind this command: it repeats the last one's, or brings the force down after
// it. In a recording it may have a stamp up to a period later, and another step there would be one too many.
static bool is_without_step(const gv_frame *line) {
  gv_command_msg msg;
  return gv_fcu_unpack_command(line, &msg) == GV_FCU_OK &&
         msg.flags & (GV_COMMAND_REPEAT | GV_COMMAND_ENDING);
}

// iface: "": of every interface. All frames of the log but our own commands, classic ones joined. Stamps
// count from the log's first line, and its last one is the end: the engine's steps before the first frame and
// after the last belong to a recording.
static int load_frames(trace *t, gv_log *log, const char *iface, char *err, size_t err_size) {
  gv_frame line, frame;
  gv_classic_join join = {0};
  size_t gloves = 0;
  int64_t start_ns = -1;
  int got;
  while ((got = gv_log_next(log, &line, err, err_size)) > 0) {
    if (start_ns < 0)
      start_ns = line.stamp_ns;
    if (!is_without_step(&line))
      t->end_ns = line.stamp_ns - start_ns;
    if (*iface && strcmp(iface, log->iface) != 0)
      continue;
    if (!gv_classic_take(&join, &line, &frame) || is_id(&frame, GV_ID_FORCE_COMMAND))
      continue;
    frame.stamp_ns -= start_ns;
    gloves += is_id(&frame, GV_ID_GLOVE);
    if (append_frame(t, &frame) == 0)
      continue;
    snprintf(err, err_size, "%s:%llu: out of memory; record a shorter trace", log->path,
             (unsigned long long)log->line);
    return -1;
  }
  if (got < 0)
    return -1;
  if (gloves == 0) {
    snprintf(err, err_size,
             "%s:%llu: no frame of a glove (identifier %03X) in it%s%s; record one with gloved-trace or "
             "candump -L",
             log->path, (unsigned long long)log->line, GV_ID_GLOVE, *iface ? " on " : "", iface);
    return -1;
  }
  t->stats.bad = log->truncated;
  return 0;
}

// The URL's file, and the interface that its parameter names. 0, or negative with one line in err.
static int split(const char *url, char path[1024], char iface[GV_LOG_IFACE], char *err, size_t err_size) {
  const size_t length = strcspn(url, "?");
  iface[0] = '\0';
  snprintf(path, 1024, "%.*s", (int)length, url);
  if (!url[length])
    return 0;
  const char *name = url + length + 7;
  if (strncmp(url + length, "?iface=", 7) == 0 && *name && strlen(name) < GV_LOG_IFACE) {
    snprintf(iface, GV_LOG_IFACE, "%s", name);
    return 0;
  }
  snprintf(err, err_size,
           "trace:%s: no such parameter; write trace:FILE?iface=NAME for one interface's frames", url);
  return -1;
}

int gv_trace_open(const char *url, gv_driver *out, char *err, size_t err_size) {
  gv_log log;
  char path[1024], iface[GV_LOG_IFACE];
  if (split(url, path, iface, err, err_size))
    return -1;
  if (gv_log_open(&log, path, err, err_size))
    return -1;
  trace *t = calloc(1, sizeof *t);
  if (!t)
    snprintf(err, err_size, "%s: out of memory; close other programs", path);
  int error = t ? load_frames(t, &log, iface, err, err_size) : -1;
  gv_log_close(&log);
  if (error) {
    if (t)
      close_trace(t);
    return -1;
  }
  *out = (gv_driver){.self = t,
                     .poll = poll_trace,
                     .send = send_trace,
                     .ended = trace_ended,
                     .stats = trace_stats,
                     .close = close_trace};
  return 0;
}

int64_t gv_trace_length_ns(const gv_driver *driver) {
  return driver->poll == poll_trace ? ((const trace *)driver->self)->end_ns : -1;
}
