// SPDX-License-Identifier: BSD-3-Clause
// The simulated device: 22 sensors, two tracker receivers and a status, sampled from the scripted user and
// his fingers, with the defects of real devices (quantum, noise, repeats, jumps, coarse stamps, late and
// lost frames), as frames with their stamps, over a wire that holds them up. Steps of its own (cycle_hz); no
// clock, no heap after init.
#include "drivers/sim.h"

#include <string.h>

// xorshift64*: uniform in [0, 1).
static double uniform(gv_sim *sim) {
  sim->random ^= sim->random >> 12;
  sim->random ^= sim->random << 25;
  sim->random ^= sim->random >> 27;
  return (double)((sim->random * 2685821657736338717ULL) >> 11) / 9007199254740992.0;
}
static double between(gv_sim *sim, double lo, double hi) { return lo + (hi - lo) * uniform(sim); }
static bool chance(gv_sim *sim, double p) { return p > 0.0 && uniform(sim) < p; }

// Standard normal from twelve uniforms (Irwin-Hall): no libm, tails end at 6.
static double normal(gv_sim *sim) {
  double sum = -6.0;
  for (int i = 0; i < 12; i++)
    sum += uniform(sim);
  return sum;
}

// ---- sensors --------------------------------------------------------------------------------------
static uint16_t quantize(const gv_sim *sim, int sensor, double angle_rad) {
  double quantum = sim->quantum_rad[sensor];
  if (quantum > 0.0)
    angle_rad = quantum * floor(angle_rad / quantum + 0.5);
  double raw = floor(gv_calibration_raw(&sim->calibration, sensor, angle_rad) + 0.5);
  return (uint16_t)gv_clamp(raw, 0.0, 4095.0);
}

static void measure(gv_sim *sim) {
  double angle_rad[GV_SENSORS];
  gv_sim_angles(sim, angle_rad);
  int jumping = chance(sim, sim->device.jump_chance) ? (int)between(sim, 0, GV_SENSORS) : -1;
  sim->jumped = jumping >= 0;
  for (int i = 0; i < GV_SENSORS; i++) {
    double read = sim->gain[i] * angle_rad[i] + sim->offset_rad[i];
    if (sim->device.noise_rad > 0.0)
      read += sim->device.noise_rad * normal(sim);
    if (i == jumping) {
      double size = between(sim, sim->device.jump_min_rad, sim->device.jump_max_rad);
      read += chance(sim, 0.5) ? size : -size;
    }
    sim->raw[i] = quantize(sim, i, read);
  }
}

static gv_pose blur_pose(gv_sim *sim, gv_pose T) {
  double p = sim->device.position_noise_m;
  double r = sim->device.rotation_noise_rad;
  if (p > 0.0)
    T.p = gv_add(T.p, gv_v3(p * normal(sim), p * normal(sim), p * normal(sim)));
  if (r > 0.0) {
    gv_quat turn = gv_quat_exp(gv_v3(r * normal(sim), r * normal(sim), r * normal(sim)));
    T.q = gv_quat_normalize(gv_quat_mul(T.q, turn));
  }
  return T;
}

// ---- stamps and streams ---------------------------------------------------------------------------
// The coarse clock ticks 15 or 16 ms, and one time in forty misses a tick (32).
static void tick_stamp_clock(gv_sim *sim) {
  while (sim->now_ns >= sim->stamp_tick_ns) {
    sim->stamp_clock_ns = sim->stamp_tick_ns;
    double pick = uniform(sim);
    int64_t tick_ms = pick < 0.025 ? 32 : pick < 0.4 ? 15 : 16;
    sim->stamp_tick_ns += tick_ms * 1000000;
  }
}

static uint32_t stamp_us(const gv_sim *sim) {
  int64_t now_ns = sim->device.coarse_stamps != 0.0 ? sim->stamp_clock_ns : sim->now_ns;
  return (uint32_t)((uint64_t)(now_ns / 1000) + (uint64_t)(sim->device.clock_start_s * 1e6));
}

static bool stream_due(gv_sim *sim, gv_sim_stream *stream, double hz) {
  if (sim->now_ns < stream->next_ns)
    return false;
  stream->next_ns += (int64_t)(1e9 / hz);
  return true;
}

// When the frame now being made will leave. A stream never overtakes itself.
static int64_t leaves_at(gv_sim *sim, gv_sim_stream *stream) {
  int64_t due_ns = sim->now_ns;
  if (chance(sim, sim->device.late_chance))
    due_ns += sim->step_ns * (int64_t)(1e9 / (double)sim->step_ns * between(sim, 0, sim->device.late_max_s));
  if (due_ns < stream->last_due_ns)
    due_ns = stream->last_due_ns;
  stream->last_due_ns = due_ns;
  return due_ns;
}

static uint32_t age_us(const gv_sim *sim, int64_t due_ns) {
  return (uint32_t)((due_ns - sim->now_ns) / 1000);
}

static int64_t wire_ns(const gv_sim *sim) { return (int64_t)(1e9 * sim->device.delay_s + 0.5); }

static void enqueue(gv_sim *sim, int64_t due_ns, const gv_frame *frame) {
  if (due_ns > sim->now_ns)
    sim->report.late++;
  if (chance(sim, sim->device.loss_chance) || sim->queue_count == GV_SIM_QUEUE) {
    sim->report.lost++;
    return;
  }
  due_ns += wire_ns(sim);
  int at = sim->queue_count++;
  for (; at > 0 && sim->queue[at - 1].due_ns > due_ns; at--)
    sim->queue[at] = sim->queue[at - 1];
  sim->queue[at] = (gv_sim_pending){due_ns, *frame};
  sim->queue[at].frame.stamp_ns = due_ns;
}

// ---- frames ---------------------------------------------------------------------------------------
static void make_glove(gv_sim *sim) {
  if (sim->jumped || !chance(sim, sim->device.equal_share))
    measure(sim);  // jumps are single samples
  int64_t due_ns = leaves_at(sim, &sim->glove);
  gv_glove_msg msg = {
    .counter = sim->glove.counter++, .stamp_us = stamp_us(sim), .age_us = age_us(sim, due_ns)};
  if (sim->intent.dead_man)
    msg.flags |= GV_GLOVE_DEAD_MAN;
  if (sim->script.side == GV_LEFT)
    msg.flags |= GV_GLOVE_LEFT;
  memcpy(msg.raw, sim->raw, sizeof msg.raw);
  gv_frame frame;
  gv_fcu_pack_glove(&msg, &frame);
  enqueue(sim, due_ns, &frame);
}

// Both receivers share one id, its counter and its order.
static void make_pose(gv_sim *sim, uint8_t receiver, gv_pose T_world_receiver) {
  int64_t due_ns = leaves_at(sim, &sim->hand);
  gv_pose_msg msg = {.counter = sim->hand.counter++,
                     .flags = GV_POSE_VALID,
                     .stamp_us = stamp_us(sim),
                     .age_us = age_us(sim, due_ns),
                     .receiver = receiver,
                     .T_world_receiver = blur_pose(sim, T_world_receiver)};
  gv_frame frame;
  gv_fcu_pack_pose(&msg, &frame);
  enqueue(sim, due_ns, &frame);
}

static void make_status(gv_sim *sim) {
  sim->status_due = false;
  uint64_t bad = sim->report.refused_frames + sim->report.over_max + sim->report.over_slew;
  gv_status_msg msg = {.counter = sim->status.counter++,
                       .stamp_us = stamp_us(sim),
                       .command_counter = sim->command_counter,
                       .bad_commands = (uint16_t)(bad < 65535 ? bad : 65535)};
  bool on = !sim->watchdog && (sim->command_flags & GV_COMMAND_ENABLE);
  msg.mode = on ? GV_FCU_MODE_FORCE : GV_FCU_MODE_IDLE;
  if (sim->intent.dead_man)
    msg.flags |= GV_STATUS_DEAD_MAN;
  if (sim->watchdog)
    msg.flags |= GV_STATUS_WATCHDOG;
  memcpy(msg.tension_n, sim->tension_n, sizeof msg.tension_n);
  gv_frame frame;
  gv_fcu_pack_status(&msg, &frame);
  enqueue(sim, sim->now_ns, &frame);
}

// ---- commands over the wire -----------------------------------------------------------------------
void gv_sim_receive(gv_sim *sim, const gv_frame *frame) {
  if (!(sim->device.delay_s > 0.0)) {
    gv_sim_take_command(sim, frame);
    return;
  }
  if (sim->coming_count == GV_SIM_COMING) {
    sim->report.refused_frames++;  // more than the wire takes
    return;
  }
  const int at = (sim->coming_first + sim->coming_count++) % GV_SIM_COMING;
  sim->coming[at] = (gv_sim_pending){sim->now_ns + wire_ns(sim), *frame};
}

static void take_commands(gv_sim *sim) {
  while (sim->coming_count > 0 && sim->coming[sim->coming_first].due_ns <= sim->now_ns) {
    gv_sim_take_command(sim, &sim->coming[sim->coming_first].frame);
    sim->coming_first = (sim->coming_first + 1) % GV_SIM_COMING;
    sim->coming_count--;
  }
}

static double script_time(const gv_sim *sim) {
  return sim->start_ns < 0 ? 0.0 : 1e-9 * (double)(sim->now_ns - sim->start_ns);
}

static void step(gv_sim *sim) {
  take_commands(sim);
  sim->now_ns += sim->step_ns;
  sim->intent = gv_sim_script_at(&sim->script, script_time(sim));
  gv_sim_user_step(sim);
  gv_sim_force_step(sim);
  if (gv_sim_ended(sim))
    return;
  tick_stamp_clock(sim);
  const gv_sim_device *d = &sim->device;
  if (stream_due(sim, &sim->hand, d->tracker_hz))
    make_pose(sim, 2, sim->intent.T_world_wrist);
  if (stream_due(sim, &sim->head, d->head_hz))
    make_pose(sim, 1, sim->script.T_world_head);
  if (stream_due(sim, &sim->glove, between(sim, d->glove_hz_min, d->glove_hz_max)))
    make_glove(sim);
  if (stream_due(sim, &sim->status, d->status_hz) || sim->status_due)
    make_status(sim);
}

static int take_due(gv_sim *sim, gv_frame *out, int max) {
  int n = 0;
  while (n < max && n < sim->queue_count && sim->queue[n].due_ns <= sim->now_ns) {
    out[n] = sim->queue[n].frame;
    n++;
  }
  sim->queue_count -= n;
  memmove(sim->queue, sim->queue + n, (size_t)sim->queue_count * sizeof sim->queue[0]);
  sim->report.sent += (uint64_t)n;
  return n;
}

int gv_sim_advance(gv_sim *sim, int64_t now_ns, gv_frame *out, int max) {
  int n = take_due(sim, out, max);
  while (n < max && sim->now_ns + sim->step_ns <= now_ns) {
    step(sim);
    n += take_due(sim, out + n, max - n);
  }
  return n;
}

bool gv_sim_ended(const gv_sim *sim) { return script_time(sim) > sim->script.end_s; }
bool gv_sim_started(const gv_sim *sim) { return sim->start_ns >= 0; }

void gv_sim_start(gv_sim *sim) {
  if (sim->start_ns < 0)
    sim->start_ns = sim->now_ns < 0 ? 0 : sim->now_ns;
}

static void draw_sensor_errors(gv_sim *sim) {
  const gv_sim_device *d = &sim->device;
  for (int i = 0; i < GV_SENSORS; i++) {
    sim->quantum_rad[i] = between(sim, d->quantum_min_rad, d->quantum_max_rad);
    sim->offset_rad[i] = between(sim, -d->offset_rad, d->offset_rad);
    sim->gain[i] = 1.0 + between(sim, -d->gain_error, d->gain_error);
  }
}

void gv_sim_init(gv_sim *sim, const gv_sim_script *script, const gv_sim_device *device, uint64_t seed) {
  memset(sim, 0, sizeof *sim);
  sim->script = *script;
  sim->device = device ? *device : script->device;
  sim->calibration = gv_calibration_default();
  sim->seed = seed ? seed : script->seed;
  sim->random = 0x9e3779b97f4a7c15ULL * sim->seed;
  if (sim->random == 0)
    sim->random = 1;
  sim->step_ns = (int64_t)(1e9 / sim->device.cycle_hz + 0.5);
  sim->now_ns = -sim->step_ns;
  sim->start_ns = -1;
  sim->watchdog = true;  // no command yet: no force
  sim->intent = gv_sim_script_at(script, 0.0);
  draw_sensor_errors(sim);
  measure(sim);
}
