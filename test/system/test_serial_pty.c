// SPDX-License-Identifier: BSD-3-Clause
// The drivers of serial devices as they run: opened by their URLs on a real pseudo-terminal, at whose other
// end the simulated device answers. What comes out is compared with what the device measured, frame by frame.
#include <time.h>

#include "drivers/serial_sim.h"
#include "support/check.h"
#include "gloved/drivers.h"
#include "support/pty.h"

// The device's time runs four times as fast as the clock, which the drivers do not see.
enum { MS = 1000000, STEP = 4 * MS, TOLD = 4096 };

static const char motion[] = "posture open  thumb_rotate -20  index_mpj 5  index_pij 10  little_dij 3\n"
                             "posture fist  like open  thumb_rotate 30  index_mpj 80  index_pij 95  "
                             "index_dij 60  ring_pij 70  wrist_yaw 20\n"
                             "head -0.4 0.1 0.6  0 45 0\n"
                             "at 0  posture open  wrist 0.1 -0.2 0.15  90 0 30\n"
                             "at 40  posture fist  wrist 0.5 0.3 0.2  0 60 -45\n"
                             "end 600\n";

// The device, its pseudo-terminal under a name that stays, the driver, and what the
// device has measured so far.
static struct rig {
  pty cable;
  serial_sim device;
  gv_sim twin;  // makes the same measurements
  gv_driver driver;
  gv_frame told[TOLD];   // by the twin, GLOVE and POSE
  int told_count, next;  // where the next frame of the driver must be found, or behind it
  int frames, skipped;   // of the driver; left out between them
  int64_t now_ns;
} rig;

static char err[512];
static gv_calibration cal;
static double glove_tolerance;  // counts

static void sleep_ms(int ms) {
  const struct timespec t = {0, ms * MS};
  nanosleep(&t, NULL);
}

// ---- the cable ------------------------------------------------------------------------------------

static void exchange_bytes(void) {
  uint8_t byte[1024];
  ssize_t n;
  while (rig.cable.master >= 0 && (n = read(rig.cable.master, byte, sizeof byte)) > 0)
    gv_serial_sim_receive(&rig.device, byte, (int)n);
  const int count = gv_serial_sim_advance(&rig.device, rig.now_ns, byte, sizeof byte);
  if (rig.cable.master >= 0 && count > 0)
    CHECK(write(rig.cable.master, byte, (size_t)count) == count, "%s", strerror(errno));
}

// ---- what comes out -------------------------------------------------------------------------------

static bool same_glove(const gv_frame *a, const gv_frame *b) {
  gv_glove_msg x, y;
  if (gv_fcu_unpack_glove(a, &x) || gv_fcu_unpack_glove(b, &y))
    return false;
  for (int i = 0; i < GV_SENSORS; i++) {
    const bool distal = i == GV_INDEX_DIJ || i == GV_MIDDLE_DIJ || i == GV_RING_DIJ || i == GV_LITTLE_DIJ;
    const bool filled = distal && rig.device.sensors == 18;
    if (!filled && abs(x.raw[i] - y.raw[i]) > glove_tolerance)
      return false;
  }
  return true;
}

static double pose_tolerance_m, pose_tolerance_rad;
static bool same_pose(const gv_frame *a, const gv_frame *b) {
  gv_pose_msg x, y;
  if (gv_fcu_unpack_pose(a, &x) || gv_fcu_unpack_pose(b, &y) || x.receiver != y.receiver)
    return false;
  const gv_pose X = x.T_world_receiver;
  const gv_pose Y = y.T_world_receiver;
  return gv_norm(gv_sub(X.p, Y.p)) < pose_tolerance_m &&
         gv_norm(gv_quat_log(gv_quat_mul(gv_quat_conj(X.q), Y.q))) < pose_tolerance_rad;
}

static bool same_frame(const gv_frame *a, const gv_frame *b) {
  if (a->id != b->id)
    return false;
  return a->id == GV_ID_GLOVE ? same_glove(a, b) : same_pose(a, b);
}

// The head does not move: its first frame is the newest of many that are alike.
static int last_like(const gv_frame *frame) {
  int i = rig.told_count - 1;
  while (i > 0 && !same_frame(frame, &rig.told[i]))
    i--;
  return i;
}

static void check_frame(const gv_frame *frame) {
  CHECK(frame->stamp_ns == rig.now_ns, "stamp");
  for (int i = rig.next; i < rig.told_count; i++) {
    if (rig.frames == 0)
      i = last_like(frame);
    if (!same_frame(frame, &rig.told[i]))
      continue;
    for (int k = rig.next; rig.frames > 0 && k < i; k++)
      rig.skipped += rig.told[k].id == frame->id ? 1 : 0;
    rig.next = i + 1;
    rig.frames++;
    return;
  }
  CHECK(0, "frame %d (id %03x) was never measured", rig.frames, frame->id);
}

static void one_ms(void) {
  gv_frame frame[64];
  rig.now_ns += STEP;
  rig.told_count += gv_sim_advance(&rig.twin, rig.now_ns, rig.told + rig.told_count, TOLD - rig.told_count);
  exchange_bytes();
  const int n = rig.driver.poll(rig.driver.self, rig.now_ns, frame, 64);
  for (int i = 0; i < n; i++)
    check_frame(&frame[i]);
  sleep_ms(1);
}

static void run_ms(int ms) {
  while (ms-- > 0)
    one_ms();
}

// Until `more` frames came, or for ten seconds. Returns whether they came.
static bool run_frames(int more) {
  const int until = rig.frames + more;
  for (int ms = 0; ms < 10000 && rig.frames < until; ms++)
    one_ms();
  return rig.frames >= until;
}

// ---- set-up ---------------------------------------------------------------------------------------

static void start(serial_sim_kind kind, int sensors, const char *options) {
  static gv_sim_script script;
  const gv_pose T_world_tracker = {gv_quat_axis_angle(gv_v3(0, 0.6, 0.8), 1.0), {0.3, -0.1, 0.7}};
  char url[256];
  memset(&rig, 0, sizeof rig);
  CHECK(gv_sim_script_parse(motion, "motion", &script, err, sizeof err) == 0, "%s", err);
  gv_serial_sim_adapt(&script.device);
  gv_serial_sim_init(&rig.device, kind, &script, &T_world_tracker, 5);
  rig.device.sensors = sensors;
  gv_sim_init(&rig.twin, &script, NULL, 5);
  gv_sim_start(&rig.twin);
  cal = gv_calibration_default();
  glove_tolerance = 8.5;    // half of 1/255, in counts
  pose_tolerance_m = 1e-6;  // float32
  pose_tolerance_rad = 2e-6;
  pty_plug(&rig.cable);
  snprintf(url, sizeof url, "serial:%s?type=%s%s", rig.cable.link,
           kind == SERIAL_SIM_FASTRAK ? "fastrak" : "cyberglove", options);
  const int failed = kind == SERIAL_SIM_FASTRAK
                         ? gv_fastrak_open(url, &T_world_tracker, &rig.driver, err, sizeof err)
                         : gv_cyberglove_open(url, &cal, GV_RIGHT, &rig.driver, err, sizeof err);
  CHECK(!failed, "%s", err);
  if (failed)
    exit(1);
}

static void stop(void) {
  rig.driver.close(rig.driver.self);
  pty_unplug(&rig.cable);
}

static void check_clean(int frames) {
  CHECK(run_frames(frames), "only %d frames", rig.frames);
  const gv_driver_stats stats = rig.driver.stats(rig.driver.self);
  CHECK(rig.skipped == 0, "%d frames were left out", rig.skipped);
  CHECK((int)stats.rx == rig.frames && stats.bad <= 2, "%d of %d, %d bad", (int)stats.rx, rig.frames,
        (int)stats.bad);
  CHECK(gv_serial_report_of(&rig.driver).connections == 1, "%u connections",
        gv_serial_report_of(&rig.driver).connections);
  CHECK(rig.device.refused == 0, "the device refused %d commands", (int)rig.device.refused);
}

// ---- tests ----------------------------------------------------------------------------------------

static void test_fastrak_yields_what_was_measured(void) {
  start(SERIAL_SIM_FASTRAK, 22, "");
  check_clean(60);
  stop();
}

static void test_fastrak_in_ascii(void) {
  start(SERIAL_SIM_FASTRAK, 22, "&format=ascii&hemisphere=-z&baud=57600");
  pose_tolerance_m = 1e-4;
  pose_tolerance_rad = 3e-4;
  check_clean(60);
  stop();
}

static void test_fastrak_hand_alone(void) {
  start(SERIAL_SIM_FASTRAK, 22, "&head=none");
  CHECK(run_frames(30), "only %d frames", rig.frames);
  CHECK(!rig.device.station_on[1] && rig.device.station_on[2] && !rig.device.station_on[3], "stations");
  stop();
}

// One tracker, two hands: station 1 is the second hand's here. Each has counters of its own.
static void test_fastrak_tells_of_two_hands(void) {
  gv_frame frame[64];
  gv_pose_msg pose;
  int frames[2] = {0, 0};
  uint8_t next[2] = {0, 0};
  start(SERIAL_SIM_FASTRAK, 22, "&head=none&hand2=1");
  for (int ms = 0; ms < 10000 && (frames[0] < 30 || frames[1] < 30); ms++) {
    rig.now_ns += STEP;
    exchange_bytes();
    const int n = rig.driver.poll(rig.driver.self, rig.now_ns, frame, 64);
    for (int i = 0; i < n; i++) {
      const int hand = frame[i].flags & GV_FRAME_SECOND ? 1 : 0;
      frames[hand]++;
      CHECK(gv_fcu_unpack_pose(&frame[i], &pose) == GV_FCU_OK && pose.receiver == 2, "receiver %d",
            pose.receiver);
      CHECK(pose.counter == next[hand]++, "hand %d: counter %d", hand, pose.counter);
    }
    sleep_ms(1);
  }
  CHECK(frames[0] >= 30 && frames[1] >= 30, "%d and %d frames", frames[0], frames[1]);
  CHECK(rig.device.station_on[1] && rig.device.station_on[2] && !rig.device.station_on[3], "stations");
  stop();
}

static void test_glove_yields_what_was_measured(void) {
  start(SERIAL_SIM_CYBERGLOVE, 22, "");
  check_clean(60);
  const gv_serial_report r = gv_serial_report_of(&rig.driver);
  CHECK(r.connected && r.sensors == 22 && r.calibrated && r.offset[21] == 81 && r.gain[21] == 143,
        "%d sensors", r.sensors);
  stop();
}

static void test_glove_with_18_sensors(void) {
  start(SERIAL_SIM_CYBERGLOVE, 18, "");
  check_clean(60);
  CHECK(gv_serial_report_of(&rig.driver).sensors == 18, "%d sensors",
        gv_serial_report_of(&rig.driver).sensors);
  stop();
}

static void test_glove_wide(void) {
  start(SERIAL_SIM_CYBERGLOVE, 22, "&wide=yes");
  glove_tolerance = 1;
  check_clean(60);
  stop();
}

// Garbage, gaps and changed bytes: every record that was sent whole comes out, nothing that was not measured
// does (the FASTRAK's marks and quaternion see to that), and the rest is counted.
static void test_disturbed_line(void) {
  start(SERIAL_SIM_FASTRAK, 22, "");
  CHECK(run_frames(1), "no frame");
  rig.device.faults = (serial_sim_faults){.garbage = 0.2, .gap = 0.1, .noise = 0};
  const uint64_t whole = rig.device.whole;
  const int frames = rig.frames;
  run_ms(800);
  rig.device.faults = (serial_sim_faults){0};
  run_ms(50);
  const gv_serial_report r = gv_serial_report_of(&rig.driver);
  CHECK(rig.device.damaged > 10 && rig.device.garbage_bytes > 100, "%d damaged", (int)rig.device.damaged);
  CHECK((int)(rig.device.whole - whole) == rig.frames - frames, "%d sent whole, %d came out",
        (int)(rig.device.whole - whole), rig.frames - frames);
  CHECK(r.bad_bytes >= rig.device.garbage_bytes && r.bad_runs > 20, "%d bad bytes in %d runs",
        (int)r.bad_bytes, (int)r.bad_runs);
  CHECK(rig.driver.stats(rig.driver.self).bad == r.bad_runs, "not in the statistics");
  stop();
}

// Switched off and on, the device has forgotten everything: it is set up anew.
static void test_reset_is_survived(void) {
  start(SERIAL_SIM_FASTRAK, 22, "");
  CHECK(run_frames(20), "only %d frames", rig.frames);
  gv_serial_sim_reset(&rig.device);
  CHECK(run_frames(40), "no frames after the reset");
  CHECK(rig.device.centimetres && rig.device.binary, "not set up");
  CHECK(gv_serial_report_of(&rig.driver).connections == 2, "%u connections",
        gv_serial_report_of(&rig.driver).connections);
  stop();
}

// The cable out (EIO), for a while, and in again under another terminal: no frames, no harm, then frames.
static void test_cable_out_and_in(void) {
  start(SERIAL_SIM_CYBERGLOVE, 22, "");
  CHECK(run_frames(20), "only %d frames", rig.frames);
  pty_unplug(&rig.cable);
  const int before = rig.frames;
  run_ms(400);
  CHECK(rig.frames <= before + 2, "frames from a cable that is out");
  CHECK(!gv_serial_report_of(&rig.driver).connected, "still connected");
  CHECK(!rig.driver.ended(rig.driver.self) && rig.driver.stats(rig.driver.self).link_downs == 1,
        "the driver gave up");
  gv_serial_sim_reset(&rig.device);
  pty_plug(&rig.cable);
  CHECK(run_frames(40), "no frames after it was plugged in");
  CHECK(gv_serial_report_of(&rig.driver).connections == 2, "%u connections",
        gv_serial_report_of(&rig.driver).connections);
  stop();
}

// A device that is silent from the start, then switched on; and closing while it is awaited.
static void test_silent_device(void) {
  start(SERIAL_SIM_CYBERGLOVE, 22, "");
  const int master = rig.cable.master;
  rig.cable.master = -1;  // its bytes go nowhere
  run_ms(600);
  CHECK(rig.frames == 0 && !gv_serial_report_of(&rig.driver).connected, "connected to nothing");
  rig.cable.master = master;
  CHECK(run_frames(10), "no frames after it was switched on");
  rig.cable.master = -1;
  run_ms(50);
  rig.cable.master = master;
  stop();
}

// ---- settings that others left, and what the user is told ----------------------------------------------

// What the tracker's memory kept disagrees, and the first `u` is lost: nothing is measured in inches.
static void test_fastrak_is_set_right(void) {
  start(SERIAL_SIM_FASTRAK, 22, "");
  rig.device.deaf_to_units = 1;
  rig.device.filtered = true;
  for (int i = 1; i <= 2; i++) {
    rig.device.increment[i] = 5;
    rig.device.aligned[i] = rig.device.boresighted[i] = true;
  }
  check_clean(40);
  CHECK(rig.device.centimetres && !rig.device.filtered, "units or filter");
  for (int i = 1; i <= 2; i++)
    CHECK(rig.device.increment[i] == 0 && !rig.device.aligned[i] && !rig.device.boresighted[i], "station %d",
          i);
  stop();
}

static char told[400];
static int64_t told_ns;

// Asks for what there is to tell, `seconds` later. Returns whether there was something.
static bool tells_after(double seconds) {
  told[0] = '\0';
  told_ns += (int64_t)(seconds * 1e9);
  return rig.driver.tell(rig.driver.self, told_ns, told, sizeof told);
}

static void check_told(const char *const words[3]) {
  CHECK(!tells_after(1), "too early: %s", told);
  run_ms(100);
  CHECK(tells_after(2.1), "nothing is told");
  for (int i = 0; i < 3; i++)
    CHECK(strstr(told, words[i]), "no \"%s\" in: %s", words[i], told);
  CHECK(strchr(told, ';') && !strchr(told, '\n'), "%s", told);
  CHECK(!tells_after(10), "told twice: %s", told);
}

static void test_bytes_that_are_no_records_are_told(void) {
  static const char *const words[] = {"bytes came", "seven numbers", "baud"};
  start(SERIAL_SIM_FASTRAK, 22, "");
  rig.device.faults.gap = 1;
  for (int ms = 0; ms < 4000 && !gv_serial_report_of(&rig.driver).connected; ms++)
    one_ms();
  check_told(words);
  rig.device.faults.gap = 0;
  CHECK(run_frames(5), "no frames");
  CHECK(!tells_after(1), "mended: %s", told);
  stop();
}

static void test_inches_for_ever_are_told(void) {
  static const char *const words[] = {"FASTRAK", "another unit", "switch it off and on"};
  start(SERIAL_SIM_FASTRAK, 22, "");
  rig.device.deaf_to_units = 1 << 30;
  for (int ms = 0; ms < 3000; ms++)
    one_ms();
  CHECK(rig.frames == 0, "%d poses in inches came through", rig.frames);
  check_told(words);
  stop();
}

static void test_a_receiver_that_is_not_plugged_in_is_told(void) {
  static const char *const words[] = {"FASTRAK", "switched off", "hand= and head="};
  start(SERIAL_SIM_FASTRAK, 22, "");
  rig.device.unplugged[1] = true;
  for (int ms = 0; ms < 1500; ms++)
    one_ms();
  check_told(words);
  stop();
}

static void test_a_glove_that_does_not_answer_is_told(void) {
  static const char *const words[] = {"CyberGlove", "?S", "baud"};
  start(SERIAL_SIM_CYBERGLOVE, 22, "");
  const int master = rig.cable.master;
  rig.cable.master = -1;
  run_ms(1500);
  check_told(words);
  rig.cable.master = master;
  stop();
}

static unsigned pose_flags;
static int poses_of_a_while(void) {
  gv_frame frame[64];
  int poses = 0;
  pose_flags = 0;
  for (int ms = 0; ms < 60; ms++) {
    rig.now_ns += STEP;
    exchange_bytes();
    const int n = rig.driver.poll(rig.driver.self, rig.now_ns, frame, 64);
    for (int i = 0; i < n; i++)
      pose_flags |= frame[i].data[1];
    poses += n;
    sleep_ms(1);
  }
  return poses;
}

// An error letter is told once, in words; only one that concerns the pose takes it along.
static void test_error_letters_are_told(void) {
  static const struct {
    char letter;
    const char *words;
    unsigned flags;
  } t[] = {{'k', "too low", GV_POSE_TRACKER_ERROR},
           {'m', "memory", GV_POSE_VALID},
           {'l', "zero", GV_POSE_TRACKER_ERROR}};
  start(SERIAL_SIM_FASTRAK, 22, "");
  CHECK(run_frames(5), "no frames");
  for (size_t i = 0; i < sizeof t / sizeof *t; i++) {
    run_ms(30);
    rig.device.error = t[i].letter;
    poses_of_a_while();
    CHECK(poses_of_a_while() > 5 && pose_flags == t[i].flags, "letter %c: flags %x", t[i].letter, pose_flags);
    CHECK(tells_after(0.1) && strstr(told, t[i].words), "letter %c: %s", t[i].letter, told);
    CHECK(!tells_after(0.1), "told twice: %s", told);
    rig.device.error = 0;
    poses_of_a_while();
    CHECK(!tells_after(0.1), "no error any more: %s", told);
  }
  stop();
}

// Another program left the glove with ten of its sensors: all are asked for again.
static void test_glove_mask_is_set_right(void) {
  start(SERIAL_SIM_CYBERGLOVE, 22, "");
  rig.device.number = 10;
  rig.device.mask[0] = 0x5b;
  check_clean(40);
  stop();
}

static void test_glove_out_of_its_box_is_a_sensor_fault(void) {
  start(SERIAL_SIM_CYBERGLOVE, 22, "");
  rig.device.error = 's';
  check_clean(20);
  rig.device.error = 'g';
  poses_of_a_while();
  CHECK(poses_of_a_while() > 5 && pose_flags == GV_GLOVE_SENSOR_FAULT, "flags %x", pose_flags);
  CHECK(tells_after(0.1) && strstr(told, "plug it in"), "%s", told);
  CHECK(!tells_after(0.1), "told twice: %s", told);
  stop();
}

static void test_one_reader_at_a_time(void) {
  char url[128];
  gv_driver second;
  start(SERIAL_SIM_CYBERGLOVE, 22, "");
  snprintf(url, sizeof url, "serial:%s?type=cyberglove", rig.cable.link);
  CHECK(gv_cyberglove_open(url, &cal, GV_RIGHT, &second, err, sizeof err) < 0 &&
            strstr(err, "end the program that holds it"),
        "%s", err);
  check_clean(10);
  stop();
}

static void test_sending_goes_nowhere(void) {
  start(SERIAL_SIM_CYBERGLOVE, 22, "");
  gv_command_msg msg = {.flags = GV_COMMAND_ENABLE, .tension_n = {1, 2, 3, 4, 5}};
  gv_frame frame;
  gv_fcu_pack_command(&msg, &frame);
  CHECK(run_frames(5), "no frames");
  const uint64_t commands = rig.device.commands;
  CHECK(rig.driver.send(rig.driver.self, &frame, 1) == 0, "refused");
  run_ms(20);
  CHECK(rig.driver.stats(rig.driver.self).tx == 0 && rig.device.commands == commands, "something was sent");
  stop();
}

// Tracker and simulated unit as one: the poses are the tracker's, everything else
// the unit's, in order of stamps.
static void test_pair_takes_the_trackers_poses(void) {
  gv_driver unit, both;
  gv_frame frame[64];
  int poses = 0;
  int gloves = 0;
  int64_t last = 0;
  start(SERIAL_SIM_FASTRAK, 22, "");
  CHECK(gv_sim_open("sim:", &unit, err, sizeof err) == 0, "%s", err);
  CHECK(gv_pair_open(unit, rig.driver, &both, err, sizeof err) == 0, "%s", err);
  for (int ms = 0; ms < 600; ms++) {
    rig.now_ns += STEP;
    rig.told_count += gv_sim_advance(&rig.twin, rig.now_ns, rig.told + rig.told_count, TOLD - rig.told_count);
    exchange_bytes();
    const int n = both.poll(both.self, rig.now_ns, frame, 64);
    for (int i = 0; i < n; i++) {
      CHECK(frame[i].stamp_ns >= last, "out of order");
      last = frame[i].stamp_ns;
      gloves += frame[i].id == GV_ID_GLOVE;
      if (frame[i].id != GV_ID_POSE)
        continue;
      check_frame(&frame[i]);
      poses++;
    }
    sleep_ms(1);
  }
  CHECK(poses > 60 && poses < 300 && gloves == 1 + 599 * 4, "%d poses, %d glove frames", poses, gloves);
  const gv_driver_stats stats = both.stats(both.self);
  CHECK(stats.foreign >= 2000, "the unit's own poses are not counted: %d", (int)stats.foreign);
  both.close(both.self);
  pty_unplug(&rig.cable);
}

static void test_wrong_urls(void) {
  static const struct {
    const char *url, *what;
  } wrong[] = {
    {"serial:", "device is missing"},
    {"serial:?type=fastrak", "device is missing"},
    {"serial:/dev/null?type=fastrak", "give a serial device"},
    {"serial:/nonexistent/tty?type=fastrak", "plug it in"},
    {"serial:/tmp?type=fastrak", "cannot be opened"},
    {"serial:/dev/null?baud=115200&type=cyberglove", "type=cyberglove is not known"},
    {"serial:/dev/null?type=fastrak&baud=12345", "no speed"},
    {"serial:/dev/null?type=fastrak&baud=9600x", "no speed"},
    {"serial:/dev/null?type=fastrak&baud=-1", "no speed"},
    {"serial:/dev/null?type=fastrak&baud=", "no name or no value"},
    {"serial:/dev/null?type=fastrak&baud", "no name or no value"},
    {"serial:/dev/null?type=fastrak&hand=5", "hand=5 is not known; write one of 1, 2, 3, 4"},
    {"serial:/dev/null?type=fastrak&hand=1&head=1", "both station 1"},
    {"serial:/dev/null?type=fastrak&hand2=2", "hand2 is station 2"},
    {"serial:/dev/null?type=fastrak&hemisphere=x", "hemisphere=x is not known"},
    {"serial:/dev/null?type=fastrak&baud=9600&baud=9600", "twice"},
    {"serial:/dev/null?type=fastrak&sensors=22", "no parameter of this device"},
    {"serial:/dev/null?a=1&b=2&c=3&d=4&e=5&f=6&g=7&h=8&i=9&j=1&k=1&l=1&m=1", "more than 12 parameters"},
    {"can:vcan0", "no serial device"}};
  const gv_pose T = gv_pose_identity();
  gv_driver driver;
  for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
    err[0] = '\0';
    CHECK(gv_fastrak_open(wrong[i].url, &T, &driver, err, sizeof err) < 0, "opened: %s", wrong[i].url);
    CHECK(strstr(err, wrong[i].what) && strchr(err, ';') && !strchr(err, '\n'), "%s: %s", wrong[i].url, err);
  }
  cal = gv_calibration_default();
  CHECK(gv_cyberglove_open("serial:/dev/null?type=cyberglove&sensors=20", &cal, GV_RIGHT, &driver, err,
                           sizeof err) < 0 &&
            strstr(err, "sensors=20 is not known"),
        "%s", err);
  char endless[400];
  memset(endless, 'x', sizeof endless - 1);
  endless[sizeof endless - 1] = '\0';
  memcpy(endless, "serial:", 7);
  CHECK(gv_fastrak_open(endless, &T, &driver, err, sizeof err) < 0 && strstr(err, "longer than"), "%s", err);
}

int main(void) {
  RUN(test_fastrak_yields_what_was_measured);
  RUN(test_fastrak_in_ascii);
  RUN(test_fastrak_hand_alone);
  RUN(test_fastrak_tells_of_two_hands);
  RUN(test_glove_yields_what_was_measured);
  RUN(test_glove_with_18_sensors);
  RUN(test_glove_wide);
  RUN(test_disturbed_line);
  RUN(test_reset_is_survived);
  RUN(test_cable_out_and_in);
  RUN(test_silent_device);
  RUN(test_fastrak_is_set_right);
  RUN(test_bytes_that_are_no_records_are_told);
  RUN(test_inches_for_ever_are_told);
  RUN(test_a_receiver_that_is_not_plugged_in_is_told);
  RUN(test_a_glove_that_does_not_answer_is_told);
  RUN(test_error_letters_are_told);
  RUN(test_glove_mask_is_set_right);
  RUN(test_glove_out_of_its_box_is_a_sensor_fault);
  RUN(test_one_reader_at_a_time);
  RUN(test_sending_goes_nowhere);
  RUN(test_pair_takes_the_trackers_poses);
  RUN(test_wrong_urls);
  return check_done();
}
