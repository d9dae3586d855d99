// SPDX-License-Identifier: BSD-3-Clause
// What the black box writes after a fault: the ten seconds before it and half a second after, frames that a
// trace replays and a row for each step, never over a file that is there.
#include <dirent.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "daemon/tell/black_box.h"
#include "gloved/drivers.h"
#include "gloved/fcu.h"
#include "support/check.h"

enum { STEP_NS = 1000000 };

static char folder[] = "/tmp/gloved-black-box-XXXXXX";
static const gv_about about = {.fcu = "sim:", .rate_hz = 1000.0};
static const int64_t start_us = 1700000000000000;  // 2023-11-14 22:13:20 UTC

static gv_frame glove_frame(int64_t step) {
  gv_glove_msg msg = {.counter = (uint8_t)step, .stamp_us = (uint32_t)(step * 1000)};
  gv_frame frame;
  gv_fcu_pack_glove(&msg, &frame);
  frame.stamp_ns = step * STEP_NS;
  return frame;
}

static void keep_step(gv_black_box *box, int64_t step) {
  const gv_frame frame = glove_frame(step);
  gv_step_record record = {.step = step + 1,
                           .step_ns = step * STEP_NS,
                           .utime = start_us + step * 1000,
                           .safety = GV_SAFETY_ACTIVE,
                           .force_n = {0.001 * (double)(step % 1000)},
                           .frame_count = 9};
  gv_black_box_frame(box, &frame);
  gv_black_box_step(box, &record);
  gv_black_box_step(box, &record);  // a step with many frames comes in two
}

static void fault_at(gv_black_box *box, int64_t step) {
  const gv_record record = {.kind = GV_RECORD_STATE,
                            .from = GV_SAFETY_ACTIVE,
                            .to = GV_SAFETY_FAULT,
                            .utime = start_us + step * 1000};
  gv_black_box_record(box, &record);
}

static void run_steps(gv_black_box *box, int64_t from, int64_t to) {
  for (int64_t step = from; step < to; step++) {
    keep_step(box, step);
    gv_black_box_work(box);
  }
}

static int files(void) {
  DIR *d = opendir(folder);
  int count = 0;
  while (d && readdir(d))
    count++;
  if (d)
    closedir(d);
  return count - 2;
}

// Lines of the file; the first and the last number in its column `at` (0: before the first comma).
static int rows(const char *name, double *out_first, double *out_last) {
  char path[300], line[500];
  int count = 0;
  snprintf(path, sizeof path, "%s/%s", folder, name);
  FILE *file = fopen(path, "r");
  if (!file)
    return -1;
  if (!fgets(line, sizeof line, file))
    count = -1;
  while (fgets(line, sizeof line, file)) {
    const double time_s = strtod(strchr(line, ',') + 1, NULL);
    if (count++ == 0)
      *out_first = time_s;
    *out_last = time_s;
  }
  fclose(file);
  return count;
}

static void test_ten_seconds_before_a_fault(void) {
  double first = 0;
  double last = 0;
  gv_black_box *box = gv_black_box_open(folder, &about);
  run_steps(box, 0, 15000);
  CHECK(files() == 0, "written without a fault");
  fault_at(box, 15000);
  run_steps(box, 15000, 15450);
  CHECK(files() == 0, "written before the force can have gone to zero");
  run_steps(box, 15450, 16500);
  gv_black_box_close(box);
  CHECK(files() == 3, "%d files", files());
  const int count = rows("gloved-fault-20231114T221335Z.csv", &first, &last);
  CHECK(count >= 10490 && count <= 10510, "%d rows", count);
  CHECK_NEAR(first, 5.0, 0.01);
  CHECK_NEAR(last, 15.5, 0.01);
}

static void test_frames_are_a_trace(void) {
  char url[300], err[200] = "";
  gv_driver driver;
  static gv_frame frame[20000];
  snprintf(url, sizeof url, "%s/gloved-fault-20231114T221335Z.log", folder);
  if (gv_trace_open(url, &driver, err, sizeof err)) {
    CHECK(0, "%s", err);
    return;
  }
  const int count = driver.poll(driver.self, gv_trace_length_ns(&driver), frame, 20000);
  CHECK(count >= 10490 && count <= 10510, "%d frames", count);
  const gv_frame sent = glove_frame(4999);
  CHECK(frame[0].id == sent.id && frame[0].len == sent.len && memcmp(frame[0].data, sent.data, sent.len) == 0,
        "another frame");
  CHECK(frame[100].stamp_ns - frame[0].stamp_ns == 100 * STEP_NS, "stamps");
  driver.close(driver.self);
}

static void test_no_file_is_overwritten(void) {
  char path[300];
  struct stat before, after;
  double first, last;
  snprintf(path, sizeof path, "%s/gloved-fault-20231114T221335Z.log", folder);
  stat(path, &before);
  gv_black_box *box = gv_black_box_open(folder, &about);
  run_steps(box, 0, 100);
  fault_at(box, 15000);
  gv_black_box_close(box);  // the end of the program comes before the aftermath
  stat(path, &after);
  CHECK(before.st_size == after.st_size && before.st_mtime == after.st_mtime && before.st_ino == after.st_ino,
        "written over");
  CHECK(files() == 6 && rows("gloved-fault-20231114T221335Z-2.csv", &first, &last) == 100, "%d files",
        files());
}

static void test_a_device_that_flaps_does_not_fill_the_disk(void) {
  const gv_about slow = {.fcu = "sim:", .rate_hz = 100.0};
  gv_black_box *box = gv_black_box_open(folder, &slow);
  const int before = files();
  for (int fault = 0; fault < 3 * GV_BLACK_BOX_MAX; fault++) {
    fault_at(box, fault * 1000);
    run_steps(box, fault * 1000, fault * 1000 + 1000);
  }
  gv_black_box_close(box);
  CHECK(files() - before == 3 * GV_BLACK_BOX_MAX, "%d files", files() - before);
}

static void test_folder(void) {
  char out[512], err[300] = "";
  CHECK(gv_black_box_folder("/no/such", out, err, sizeof err) < 0 && strstr(err, "/no/such") &&
            strstr(err, ";"),
        "%s", err);
  CHECK(gv_black_box_folder("/proc/self/status", out, err, sizeof err) < 0, "a file is no folder");
  CHECK(gv_black_box_folder(folder, out, err, sizeof err) == 0 && strcmp(out, folder) == 0, "%s", out);
  setenv("XDG_STATE_HOME", "/tmp/state", 1);
  unsetenv("STATE_DIRECTORY");
  CHECK(gv_black_box_folder("", out, err, sizeof err) == 0 && strcmp(out, "/tmp/state/gloved") == 0, "%s",
        out);
  setenv("STATE_DIRECTORY", "/var/lib/gloved:/var/lib/more", 1);
  CHECK(gv_black_box_folder("", out, err, sizeof err) == 0 && strcmp(out, "/var/lib/gloved") == 0, "%s", out);
}

static void test_folders_are_made(void) {
  char deep[300];
  double first, last;
  snprintf(deep, sizeof deep, "%s/a/b", folder);
  gv_black_box *box = gv_black_box_open(deep, &about);
  run_steps(box, 0, 100);
  fault_at(box, 15000);
  gv_black_box_close(box);
  CHECK(rows("a/b/gloved-fault-20231114T221335Z.csv", &first, &last) == 100, "no file");
}

int main(void) {
  char command[300];
  if (!mkdtemp(folder))
    return 1;
  if (!freopen("/dev/null", "w", stderr))
    return 1;
  RUN(test_ten_seconds_before_a_fault);
  RUN(test_frames_are_a_trace);
  RUN(test_no_file_is_overwritten);
  RUN(test_a_device_that_flaps_does_not_fill_the_disk);
  RUN(test_folder);
  RUN(test_folders_are_made);
  snprintf(command, sizeof command, "rm -rf %s", folder);
  return check_done() | (system(command) != 0);
}
