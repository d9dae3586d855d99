// SPDX-License-Identifier: BSD-3-Clause
// Writes the recording: frames from the loop's ring to lines of text. Slow thread.
#include "daemon/tell/recorder.h"

#include <errno.h>
#include <string.h>
#include <time.h>

#include "gloved/drivers.h"

int gv_recorder_open(gv_recorder *recorder, const char *path, const char *fcu, const char *fcu2, char *err,
                     size_t err_size) {
  struct timespec now;
  *recorder = (gv_recorder){.path = path, .file = fopen(path, "w")};
  if (!recorder->file) {
    snprintf(err, err_size, "%s: cannot be written (%s); choose another place for --record", path,
             strerror(errno));
    return -1;
  }
  gv_about_interfaces(fcu, fcu2, recorder->iface[0], recorder->iface[1]);
  clock_gettime(CLOCK_REALTIME, &now);
  recorder->start_ns = ((int64_t)now.tv_sec * 1000000 + now.tv_nsec / 1000) * 1000;
  return 0;
}

void gv_recorder_frame(gv_recorder *recorder, const gv_frame *recorded) {
  char line[GV_LOG_LINE_MAX + 1];
  gv_frame frame = *recorded;
  if (!recorder->file || recorder->failed)
    return;
  frame.stamp_ns += recorder->start_ns;
  const size_t length = (size_t)gv_log_format(&frame, recorder->iface[frame.flags & GV_FRAME_SECOND ? 1 : 0],
                                              line);
  if (fwrite(line, 1, length, recorder->file) != length)
    recorder->failed = true;
  recorder->wrote = true;
}

void gv_recorder_flush(gv_recorder *recorder) {
  if (recorder->wrote && !recorder->failed && fflush(recorder->file) != 0)
    recorder->failed = true;
  recorder->wrote = false;
}

int gv_recorder_close(gv_recorder *recorder) {
  if (!recorder->file)
    return 0;
  const bool closed = fclose(recorder->file) == 0;
  recorder->file = NULL;
  return closed && !recorder->failed ? 0 : -1;
}
