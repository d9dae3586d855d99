// SPDX-License-Identifier: BSD-3-Clause
// Fuzz entry (libFuzzer, `make fuzz`): the bytes say which frames come to a session over a table, when, and
// what is in them; counters and checksums are put right, so that they get past the codec. Whatever comes:
// forces are finite, within the limiter's maximum, rise no faster than its slew, leave only while the safety
// machine lets them (or on its ramp down), and are gone soon after the dead-man switch opened. With two hands
// (half of the inputs) all that holds of each, and a fault in one lets neither feel anything. Layout: bytes
// of operations, each followed by what it needs.
#include "bytes.h"
#include "daemon/loop/hands.h"
#include "support/lab.h"

enum { STEPS_MAX = 400, FRAMES_MAX = 16 };
enum {
  GLOVE,
  POSE,
  STATUS,
  PRESS,
  ANY_FRAME,
  STEP,
  MANY_STEPS,
  STALL,
  REQUEST,
  LOST,
  OTHER_HAND,
  OPERATIONS
};
static const int64_t period_ns = 1000000;
#define ROUNDING_N 1e-9

// A hand as the judge sees it.
typedef struct person {
  uint8_t glove_counter, pose_counter, status_counter;
  int64_t open_ns;  // since when no force may leave; negative: it may
  double force_n[GV_FINGERS];
} person;

typedef struct play {
  gv_session session[GV_HANDS];
  gv_limiter_config limiter;
  fuzz_bytes bytes;
  gv_frame frame[FRAMES_MAX];
  int frame_count, steps;
  int hands, hand;  // whose frames come
  person person[GV_HANDS];
  int64_t now_ns, told_ns;
} play;

static lab world;
static play p;

// ---- frames -------------------------------------------------------------------------------------------

static void put_checksum(gv_frame *frame) {
  const uint8_t head[6] = {
    (uint8_t)frame->id, (uint8_t)(frame->id >> 8), frame->data[0], frame->data[1], 0, 0};
  const uint16_t crc = gv_crc16(gv_crc16(0xffff, head, 6), frame->data + 4, (size_t)frame->len - 4);
  frame->data[2] = (uint8_t)crc;
  frame->data[3] = (uint8_t)(crc >> 8);
}

static void add_frame(gv_frame frame) {
  frame.stamp_ns = p.now_ns;
  frame.flags |= p.hand ? GV_FRAME_SECOND : 0;
  if (p.frame_count < FRAMES_MAX)
    p.frame[p.frame_count++] = frame;
}

// Payload from the bytes, counter the next one, checksum right.
static void add_sound(uint32_t id, uint8_t len, uint8_t *io_counter) {
  gv_frame frame = {.id = id, .len = len, .flags = GV_FRAME_FD};
  fuzz_take(&p.bytes, frame.data + 1, (size_t)len - 1);
  frame.data[0] = (*io_counter)++;
  put_checksum(&frame);
  add_frame(frame);
}

// A hand over the table, its index finger bent by the bytes: what forces come from.
static void add_press(void) {
  const uint8_t bend = fuzz_byte(&p.bytes);
  const uint8_t flags = fuzz_byte(&p.bytes);
  const uint8_t height = fuzz_byte(&p.bytes);
  gv_glove_msg glove = {.counter = p.person[p.hand].glove_counter++,
                        .flags = (uint8_t)((flags & GV_GLOVE_DEAD_MAN) | (p.hand ? GV_GLOVE_LEFT : 0)),
                        .stamp_us = (uint32_t)(p.now_ns / 1000)};
  for (int i = 0; i < GV_SENSORS; i++)
    glove.raw[i] = (uint16_t)gv_calibration_raw(&world.cfg.calibration, i,
                                                i == GV_INDEX_MPJ ? bend / 160.0 : 0.0);
  gv_pose_msg pose = {.counter = p.person[p.hand].pose_counter++,
                      .flags = GV_POSE_VALID,
                      .receiver = GV_RECEIVER_HAND,
                      .stamp_us = (uint32_t)(p.now_ns / 1000),
                      .T_world_receiver = {{1, 0, 0, 0}, {0, 0.3 * p.hand, 0.06 + height * 1e-5}}};
  gv_frame frame;
  gv_fcu_pack_glove(&glove, &frame);
  add_frame(frame);
  gv_fcu_pack_pose(&pose, &frame);
  add_frame(frame);
}

static void add_any(void) {
  gv_frame frame = {0};
  uint8_t head[4];
  fuzz_take(&p.bytes, head, sizeof head);
  frame.id = head[0] | (uint32_t)(head[1] & 7) << 8;
  frame.len = head[2] % 65;
  frame.flags = head[3];
  fuzz_take(&p.bytes, frame.data, frame.len);
  add_frame(frame);
}

// ---- judging ------------------------------------------------------------------------------------------

// Whether some sound frame of this period has the hand's switch open.
static bool switch_seen_open(int hand) {
  for (int i = 0; i < p.frame_count; i++) {
    if (((p.frame[i].flags & GV_FRAME_SECOND) != 0) != (hand > 0))
      continue;
    gv_glove_msg glove;
    gv_status_msg status;
    if (gv_fcu_unpack_glove(&p.frame[i], &glove) == GV_FCU_OK && !(glove.flags & GV_GLOVE_DEAD_MAN))
      return true;
    if (gv_fcu_unpack_status(&p.frame[i], &status) == GV_FCU_OK && !(status.flags & GV_STATUS_DEAD_MAN))
      return true;
  }
  return false;
}

static void judge(int hand, const gv_frame *command) {
  gv_command_msg msg;
  person *who = &p.person[hand];
  const gv_session *session = &p.session[hand];
  const double dt_s = (double)(p.now_ns - p.told_ns) * 1e-9;
  const bool lets = gv_safety_lets_force_out(&session->safety) && !session->other_in_fault;
  REQUIRE(gv_fcu_unpack_command(command, &msg) == GV_FCU_OK);
  if (lets)
    who->open_ns = -1;
  else if (who->open_ns < 0)
    who->open_ns = p.now_ns;
  for (int i = 0; i < GV_FINGERS; i++) {
    // A device that heard nothing for so long has let go.
    const double before_n = dt_s >= GV_DEVICE_WATCHDOG_S ? 0.0 : who->force_n[i];
    const double force_n = session->force_n[i];
    const double rise_n = force_n - before_n;
    REQUIRE(isfinite(force_n) && force_n >= 0.0 && force_n <= p.limiter.max_n);
    REQUIRE(fabs(msg.tension_n[i] - force_n) <= GV_TENSION_LSB_N);
    REQUIRE(rise_n <= p.limiter.slew_n_per_s * fmin(dt_s, 1.5e-9 * (double)period_ns) + ROUNDING_N ||
            rise_n <= p.limiter.pretension_n);
    if (!lets)
      REQUIRE(rise_n <= ROUNDING_N);
    if (who->open_ns >= 0 && (double)(p.now_ns - who->open_ns) * 1e-9 > p.limiter.ramp_s)
      REQUIRE(force_n <= 0.0);
    who->force_n[i] = force_n;
  }
}

static void judge_all(const gv_frame command[GV_HANDS], const bool open[GV_HANDS]) {
  const gv_session *at_fault = gv_hands_at_fault(p.session);
  const uint32_t own = at_fault->safety.faults & ~(uint32_t)GV_FAULT_OTHER_DEVICE;
  const bool fault = at_fault->safety.state == GV_SAFETY_FAULT && own != 0;
  for (int i = 0; i < p.hands; i++) {
    if (open[i])
      REQUIRE(!gv_safety_lets_force_out(&p.session[i].safety));
    if (fault)
      REQUIRE(&p.session[i] == at_fault || p.session[i].other_in_fault);
    judge(i, &command[i]);
  }
  p.told_ns = p.now_ns;
}

static void step(unsigned periods_skipped) {
  gv_frame command[GV_HANDS];
  bool open[GV_HANDS];
  if (++p.steps > STEPS_MAX)
    return;
  p.now_ns += period_ns * (1 + (int64_t)periods_skipped);
  for (int i = 0; i < p.hands; i++)
    open[i] = switch_seen_open(i);
  gv_hands_compute(p.session, p.now_ns, p.frame, p.frame_count, periods_skipped);
  REQUIRE(gv_hands_command(p.session, p.now_ns, command) == p.hands);
  judge_all(command, open);
  p.frame_count = 0;
}

static void request(void) {
  gv_request asked = {.kind = (gv_request_kind)(fuzz_byte(&p.bytes) % GV_REQUEST_KINDS)};
  asked.value = GV_REQUEST_COUPLING_MIN +
                fuzz_byte(&p.bytes) / 255.0 * (GV_REQUEST_COUPLING_MAX - GV_REQUEST_COUPLING_MIN);
  gv_hands_request(p.session, &asked);
}

static void operate(uint8_t operation) {
  switch (operation % OPERATIONS) {
    case GLOVE: add_sound(GV_ID_GLOVE, 48, &p.person[p.hand].glove_counter); break;
    case POSE: add_sound(GV_ID_POSE, 48, &p.person[p.hand].pose_counter); break;
    case STATUS: add_sound(GV_ID_STATUS, 20, &p.person[p.hand].status_counter); break;
    case PRESS:
      for (int i = fuzz_byte(&p.bytes) % 64; i >= 0; i--) {
        const fuzz_bytes here = p.bytes;
        add_press();
        step(0);
        if (i > 0)
          p.bytes = here;
      }
      break;
    case ANY_FRAME: add_any(); break;
    case STEP: step(0); break;
    case MANY_STEPS:
      for (int i = fuzz_byte(&p.bytes) % 64; i >= 0; i--)
        step(0);
      break;
    case STALL: step(fuzz_byte(&p.bytes)); break;
    case REQUEST: request(); break;
    case LOST: p.person[p.hand].glove_counter += fuzz_byte(&p.bytes); break;
    case OTHER_HAND: p.hand = (p.hand + 1) % p.hands; break;
    default: break;
  }
}

static void start(const uint8_t *data, size_t size) {
  gv_session_config cfg = {.limiter = gv_limiter_config_default(),
                           .safety = gv_safety_config_default(),
                           .passivity = {size % 2 ? GV_PASSIVITY_ON : GV_PASSIVITY_OFF, 50.0, 2.0},
                           .period_s = 1e-9 * (double)period_ns};
  if (world.engine)
    gv_engine_close(world.engine);
  lab_start(&world);
  lab_box(&world, gv_v3(1, 1, 0.1), gv_v3(0, 0, -0.05), 0, 0.8);
  world.cfg.second = (gv_second_hand){.present = size % 4 >= 2,
                                      .hand = gv_hand_model_default(GV_LEFT),
                                      .calibration = world.cfg.calibration,
                                      .T_receiver_wrist = world.cfg.T_receiver_wrist};
  lab_run(&world);
  memset(&p, 0, sizeof p);
  p.limiter = cfg.limiter;
  p.bytes = (fuzz_bytes){data, size};
  p.hands = gv_engine_hands(world.engine);
  for (int i = 0; i < p.hands; i++) {
    cfg.hand = i;
    cfg.side = i ? GV_LEFT : GV_RIGHT;
    gv_session_init(&p.session[i], &cfg, world.engine);
  }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
  start(data, size);
  while (p.bytes.rest > 0 && p.steps < STEPS_MAX)
    operate(fuzz_byte(&p.bytes));
  return 0;
}
