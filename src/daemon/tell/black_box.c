// SPDX-License-Identifier: BSD-3-Clause
// Keeps frames and steps in two rings that overwrite their oldest entry, and writes ten seconds of them
// after a fault (black_box.h). Writing goes on beside keeping: the rings hold a second more than is written,
// and what is overwritten before its turn is left out. Slow thread.
#include "daemon/tell/black_box.h"

#include <errno.h>
#include <inttypes.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "gloved/drivers.h"

enum {
  LINES_A_PASS = 1000,  // some 1 ms
  KEPT_MS = GV_BLACK_BOX_BEFORE_S * 1000 + GV_BLACK_BOX_AFTER_MS + 1000,
  DEVICE_FRAMES_HZ = 4000,  // room for what devices send; with more, the time that the ring covers
                            // is shorter
  NAMES = 100               // files of one second before it gives up
};

// What is kept of a step: 96 bytes.
typedef struct box_step {
  int64_t number, now_ns;  // step number x period, as its frames are stamped
  int64_t utime;
  int32_t wake_ns, work_ns;
  uint32_t events, faults;
  int16_t contacts;
  int8_t safety;
  float depth_m, desired_n[GV_FINGERS], force_n[GV_FINGERS];
} box_step;

// A part of a ring that is being written: entries [next, end), counted since the start.
typedef struct range {
  uint64_t next, end;
} range;

struct gv_black_box {
  char folder[512], path[560];    // of the files being written, without their endings
  char iface[2][GV_ABOUT_IFACE];  // of each hand
  const gv_about *about;
  gv_frame *frame;
  box_step *step;
  uint64_t frame_room, step_room;  // entries
  uint64_t frames, steps;          // so far
  int64_t wall_ns;                 // time of day of step 0
  int64_t fault_ns, fault_utime;   // last step before the fault that waits for its aftermath
  bool waiting;
  int written;      // faults
  FILE *log, *csv;  // null: nothing is being written
  range log_range, csv_range;
};

// ---- where ----------------------------------------------------------------------------------------------

int gv_black_box_folder(const char *asked, char out[512], char *err, size_t err_size) {
  const char *service = getenv("STATE_DIRECTORY");
  const char *state = getenv("XDG_STATE_HOME");
  const char *home = getenv("HOME");
  struct stat there;
  if (*asked) {
    snprintf(out, 512, "%s", asked);
    if (stat(asked, &there) == 0 && S_ISDIR(there.st_mode) && access(asked, W_OK | X_OK) == 0)
      return 0;
    snprintf(err, err_size,
             "%s: no folder that can be written into; make one, or choose another for --black-box", asked);
    return -1;
  }
  if (service && *service)
    snprintf(out, 512, "%.*s", (int)strcspn(service, ":"), service);
  else if (state && *state)
    snprintf(out, 512, "%s/gloved", state);
  else if (home && *home)
    snprintf(out, 512, "%s/.local/state/gloved", home);
  else
    snprintf(out, 512, ".");
  return 0;
}

// Every folder of the path that is not there yet.
static void make_folders(const char *folder) {
  char part[512];
  for (const char *slash = strchr(folder + 1, '/'); slash; slash = strchr(slash + 1, '/')) {
    snprintf(part, sizeof part, "%.*s", (int)(slash - folder), folder);
    mkdir(part, 0777);
  }
  mkdir(folder, 0777);
}

// ---- keeping --------------------------------------------------------------------------------------------

gv_black_box *gv_black_box_open(const char *folder, const gv_about *about) {
  const double rate_hz = about->rate_hz;
  gv_black_box *box = calloc(1, sizeof *box);
  if (!box)
    return NULL;
  box->about = about;
  snprintf(box->folder, sizeof box->folder, "%s", folder);
  gv_about_interfaces(about->fcu, about->fcu2, box->iface[0], box->iface[1]);
  box->step_room = (uint64_t)(rate_hz * KEPT_MS / 1000) + 1;
  const int hands = about->fcu2[0] ? 2 : 1;
  box->frame_room = (uint64_t)(hands * (rate_hz + DEVICE_FRAMES_HZ) * KEPT_MS / 1000) + 1;
  box->step = calloc(box->step_room, sizeof *box->step);
  box->frame = calloc(box->frame_room, sizeof *box->frame);
  if (box->step && box->frame)
    return box;
  gv_black_box_close(box);
  return NULL;
}

void gv_black_box_frame(gv_black_box *box, const gv_frame *frame) {
  if (box)
    box->frame[box->frames++ % box->frame_room] = *frame;
}

// A step with many frames comes in several records: the first one counts.
void gv_black_box_step(gv_black_box *box, const gv_step_record *record) {
  if (!box || (box->steps && box->step[(box->steps - 1) % box->step_room].number == record->step))
    return;
  if (box->steps == 0)
    box->wall_ns = (record->utime * 1000 - record->step_ns) / 1000 * 1000;
  box_step *out = &box->step[box->steps++ % box->step_room];
  *out = (box_step){.number = record->step,
                    .now_ns = record->step_ns,
                    .utime = record->utime,
                    .wake_ns = record->wake_ns,
                    .work_ns = record->work_ns,
                    .events = record->events,
                    .faults = record->faults,
                    .contacts = (int16_t)record->contacts,
                    .safety = (int8_t)record->safety,
                    .depth_m = (float)record->depth_m};
  for (int i = 0; i < GV_FINGERS; i++) {
    out->desired_n[i] = (float)record->desired_n[i];
    out->force_n[i] = (float)record->force_n[i];
  }
}

static int64_t newest_ns(const gv_black_box *box) {
  return box->steps ? box->step[(box->steps - 1) % box->step_room].now_ns : 0;
}

// A fault while another one is written, or waits for its aftermath, is part of the same story.
void gv_black_box_record(gv_black_box *box, const gv_record *record) {
  if (!box || record->kind != GV_RECORD_STATE || record->to != GV_SAFETY_FAULT)
    return;
  if (box->waiting || box->log || box->written >= GV_BLACK_BOX_MAX)
    return;
  box->waiting = true;
  box->fault_ns = newest_ns(box);
  box->fault_utime = record->utime;
}

// ---- writing --------------------------------------------------------------------------------------------

static FILE *open_new(const gv_black_box *box, const char *ending) {
  char path[PATH_MAX];
  snprintf(path, sizeof path, "%s%s", box->path, ending);
  return fopen(path, "wx");
}

// Both files or none, under a name that is not taken; box->path says it. 0, or the errno.
static int open_files(gv_black_box *box) {
  char date[32];
  struct tm utc;
  const time_t second = (time_t)(box->fault_utime / 1000000);
  gmtime_r(&second, &utc);
  strftime(date, sizeof date, "%Y%m%dT%H%M%SZ", &utc);
  errno = EEXIST;
  for (int i = 1; i <= NAMES && errno == EEXIST; i++) {
    const int length = snprintf(box->path, sizeof box->path, "%s/gloved-fault-%s", box->folder, date);
    if (i > 1)
      snprintf(box->path + length, sizeof box->path - (size_t)length, "-%d", i);
    box->log = open_new(box, ".log");
    if (!box->log)
      continue;
    box->csv = open_new(box, ".csv");
    if (box->csv)
      return 0;
    const int why = errno;
    fclose(box->log);
    box->log = NULL;
    errno = why;
  }
  return errno;
}

static uint64_t oldest(uint64_t count, uint64_t room) { return count > room ? count - room : 0; }

// The entries of the ten seconds before the fault and of what came after it.
static void find_ranges(gv_black_box *box) {
  const int64_t from_ns = box->fault_ns - (int64_t)GV_BLACK_BOX_BEFORE_S * 1000000000;
  box->log_range = (range){oldest(box->frames, box->frame_room), box->frames};
  box->csv_range = (range){oldest(box->steps, box->step_room), box->steps};
  while (box->log_range.next < box->frames &&
         box->frame[box->log_range.next % box->frame_room].stamp_ns < from_ns)
    box->log_range.next++;
  while (box->csv_range.next < box->steps && box->step[box->csv_range.next % box->step_room].now_ns < from_ns)
    box->csv_range.next++;
}

static void write_about(const gv_black_box *box) {
  char log[600], err[300];
  snprintf(log, sizeof log, "%s.log", box->path);
  if (gv_about_write(box->about, log, err, sizeof err))
    fprintf(stderr, "gloved: black box: %s\n", err);
}

static void begin(gv_black_box *box) {
  box->waiting = false;
  box->written++;
  make_folders(box->folder);
  const int why = open_files(box);
  if (why) {
    fprintf(stderr, "gloved: black box: %s: cannot be written (%s); choose another folder with --black-box\n",
            box->folder, strerror(why));
    return;
  }
  find_ranges(box);
  write_about(box);
  fputs("step,time_s,utime,state,faults,events,wake_us,work_us,contacts,depth_mm", box->csv);
  for (int i = 0; i < GV_FINGERS; i++)
    fprintf(box->csv, ",desired%d_n", i);
  for (int i = 0; i < GV_FINGERS; i++)
    fprintf(box->csv, ",commanded%d_n", i);
  fputc('\n', box->csv);
}

static void write_frame(gv_black_box *box, uint64_t number) {
  char line[GV_LOG_LINE_MAX + 1];
  gv_frame frame = box->frame[number % box->frame_room];
  frame.stamp_ns += box->wall_ns;
  const int length = gv_log_format(&frame, box->iface[frame.flags & GV_FRAME_SECOND ? 1 : 0], line);
  if (length > 0)
    fwrite(line, 1, (size_t)length, box->log);
}

static void write_step(gv_black_box *box, uint64_t number) {
  const box_step *s = &box->step[number % box->step_room];
  fprintf(box->csv, "%" PRId64 ",%.6f,%" PRId64 ",%s,%s,%" PRIu32 ",%.1f,%.1f,%d,%.4f", s->number,
          (double)s->now_ns * 1e-9, s->utime, gv_safety_name((gv_safety_state)s->safety),
          s->faults ? gv_fault_text(s->faults) : "", s->events, s->wake_ns * 1e-3, s->work_ns * 1e-3,
          s->contacts, (double)s->depth_m * 1e3);
  for (int i = 0; i < GV_FINGERS; i++)
    fprintf(box->csv, ",%.4f", (double)s->desired_n[i]);
  for (int i = 0; i < GV_FINGERS; i++)
    fprintf(box->csv, ",%.4f", (double)s->force_n[i]);
  fputc('\n', box->csv);
}

// At most *lines of the range. What was overwritten meanwhile is passed over.
static void write_range(gv_black_box *box, range *part, uint64_t count, uint64_t room, int *lines,
                        void (*write)(gv_black_box *box, uint64_t number)) {
  if (part->next < oldest(count, room))
    part->next = oldest(count, room);
  for (; part->next < part->end && *lines > 0; part->next++, --*lines)
    write(box, part->next);
}

static void end(gv_black_box *box) {
  const bool whole = !ferror(box->log) && !ferror(box->csv);
  const bool log_closed = fclose(box->log) == 0;
  const bool csv_closed = fclose(box->csv) == 0;
  box->log = box->csv = NULL;
  if (whole && log_closed && csv_closed)
    fprintf(stderr,
            "gloved: fault: the time before it is in %s.log (frames, for --fcu trace:) and .csv (steps)\n",
            box->path);
  else
    fprintf(stderr, "gloved: black box: %s.log: not written whole; make room on the disk\n", box->path);
}

void gv_black_box_work(gv_black_box *box) {
  int lines = LINES_A_PASS;
  if (!box)
    return;
  if (box->waiting && newest_ns(box) - box->fault_ns >= (int64_t)GV_BLACK_BOX_AFTER_MS * 1000000)
    begin(box);
  if (!box->log)
    return;
  write_range(box, &box->log_range, box->frames, box->frame_room, &lines, write_frame);
  write_range(box, &box->csv_range, box->steps, box->step_room, &lines, write_step);
  if (lines > 0)
    end(box);
}

void gv_black_box_close(gv_black_box *box) {
  if (!box)
    return;
  if (box->waiting)
    begin(box);
  while (box->log)
    gv_black_box_work(box);
  free(box->frame);
  free(box->step);
  free(box);
}
