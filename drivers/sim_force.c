// SPDX-License-Identifier: BSD-3-Clause
// The force side of the simulated device: what it accepts as a command, its watchdog, and the user's
// fingers. Each flexion joint deviates from what the user intends by d with
//   I d'' + c d' + k d = -T r        (T tension of the finger's tendon, r its moment arm at the joint)
// integrated semi-implicitly (spring and damper at the new velocity), so that any stiffness is stable and
// the deviation at rest is exactly -T r / k. Pure; no engine.
#include "drivers/sim.h"

#include "gloved/force.h"

#include <string.h>

// A restarted engine counts from anywhere: after this long a counter behind the last is a new start.
enum { RESTART_NS = 100000000, SECOND_NS = 1000000000 };

static double largest_rise(const double from[GV_FINGERS], const double to[GV_FINGERS]) {
  double rise = 0.0;
  for (int i = 0; i < GV_FINGERS; i++)
    rise = fmax(rise, to[i] - from[i]);
  return rise;
}

// Commands follow each other by their counter; on a jittery link they may arrive in a bunch, on a slow
// one late: the longer of both times counts. One count of the wire on either side is rounding.
static bool rises_too_fast(gv_sim *sim, const double tension_n[GV_FINGERS], int steps) {
  double elapsed_s = 1e-9 * (double)(sim->now_ns - sim->command_ns);
  double dt_s = fmax(steps / sim->device.command_hz, elapsed_s);
  double rise_n = largest_rise(sim->command_n, tension_n);
  sim->report.slew_max_n_per_s = fmax(sim->report.slew_max_n_per_s, rise_n / dt_s);
  return rise_n > sim->device.slew_n_per_s * dt_s + 1.5 * sim->device.wire_count_n;
}

static bool above_max(const gv_sim *sim, const double tension_n[GV_FINGERS]) {
  for (int i = 0; i < GV_FINGERS; i++)
    if (!(tension_n[i] <= sim->device.max_n + 0.5 * sim->device.wire_count_n))
      return true;  // not-a-number too
  return false;
}

// A machine that stands still makes a single drop; a sender that is too slow makes them again and again.
static void count_drop(gv_sim *sim) {
  if (sim->now_ns - sim->drops_since_ns >= SECOND_NS) {
    sim->drops_since_ns = sim->now_ns;
    sim->drops = 0;
  }
  sim->drops++;
  sim->report.watchdog_drops++;
  if (sim->drops > sim->report.drops_a_second)
    sim->report.drops_a_second = sim->drops;
}

static void accept_command(gv_sim *sim, const gv_command_msg *msg, const double tension_n[GV_FINGERS]) {
  const bool flowing = sim->report.commands > 0 && sim->command_steps == 1 &&
                       sim->now_ns - sim->command_ns < RESTART_NS;
  if (sim->watchdog && flowing)
    count_drop(sim);
  memcpy(sim->command_n, tension_n, sizeof sim->command_n);
  sim->command_ns = sim->now_ns;
  sim->command_flags = msg->flags;
  sim->command_steps = 0;
  sim->watchdog = false;
  sim->report.commands++;
  for (int i = 0; i < GV_FINGERS; i++)
    sim->report.tension_max_n[i] = fmax(sim->report.tension_max_n[i], tension_n[i]);
}

// Commands since the last one by the counter; 0: repeated or overtaken.
static int counter_steps(const gv_sim *sim, uint8_t counter) {
  if (!sim->command_seen)
    return 1;
  uint8_t ahead = (uint8_t)(counter - sim->command_counter);
  if (sim->now_ns - sim->command_ns >= RESTART_NS)
    return 1;
  return ahead < 128 ? ahead : 0;
}

void gv_sim_take_command(gv_sim *sim, const gv_frame *frame) {
  gv_command_msg msg;
  if (frame->id != GV_ID_FORCE_COMMAND) {
    sim->report.foreign++;
    return;
  }
  if (gv_fcu_unpack_command(frame, &msg) != GV_FCU_OK) {
    sim->report.refused_frames++;
    return;
  }
  int steps = counter_steps(sim, msg.counter);
  if (steps == 0) {
    sim->report.repeated++;
    return;
  }
  sim->report.counter_gaps += (uint64_t)(steps - 1);
  sim->command_counter = msg.counter;
  sim->command_seen = true;
  sim->command_steps += steps;
  double tension_n[GV_FINGERS] = {0};
  if (msg.flags & GV_COMMAND_ENABLE)
    memcpy(tension_n, msg.tension_n, sizeof tension_n);
  if (above_max(sim, tension_n))
    sim->report.over_max++;
  else if (rises_too_fast(sim, tension_n, sim->command_steps))
    sim->report.over_slew++;
  else
    accept_command(sim, &msg, tension_n);
}

// The tension goes to zero, but command_n stays: the engine has not lowered it, so it is what the next
// command's rise is judged by; pull_tendons brings the tension back slowly.
static void check_watchdog(gv_sim *sim) {
  double silent_s = 1e-9 * (double)(sim->now_ns - sim->command_ns);
  if (sim->watchdog || silent_s < sim->device.watchdog_s)
    return;
  sim->watchdog = true;
  sim->status_due = true;
  sim->report.watchdog_trips++;
  sim->report.zero_after_s = fmax(sim->report.zero_after_s, silent_s);
}

// Up no faster than the slew limit (after the watchdog or the switch let go), down at once.
static void pull_tendons(gv_sim *sim) {
  bool on = !sim->watchdog && sim->intent.dead_man && (sim->command_flags & GV_COMMAND_ENABLE);
  double rise_n = sim->device.slew_n_per_s * 1e-9 * (double)sim->step_ns + 1.5 * sim->device.wire_count_n;
  for (int i = 0; i < GV_FINGERS; i++)
    sim->tension_n[i] = on ? fmin(sim->command_n[i], sim->tension_n[i] + rise_n) : 0.0;
}

static void step_joint(gv_sim_joint *joint, double h, double torque_nm, double k, double inertia,
                       double damping_ratio) {
  double c = 2.0 * damping_ratio * sqrt(k * inertia);
  double v = (inertia * joint->velocity_rad_s + h * (torque_nm - k * joint->deviation_rad)) /
             (inertia + h * c + h * h * k);
  joint->velocity_rad_s = v;
  joint->deviation_rad += h * v;
}

static void step_fingers(gv_sim *sim) {
  const gv_sim_device *d = &sim->device;
  const double k[3] = {d->stiffness_0, d->stiffness_1, d->stiffness_2};
  const double inertia[3] = {d->inertia_0, d->inertia_1, d->inertia_2};
  const double h = 1e-9 * (double)sim->step_ns;
  for (int f = 0; f < GV_FINGERS; f++) {
    int sensor[3];
    double arm_m[3];
    int joints = gv_tendon_joints(f, sensor, arm_m);
    for (int j = 0; j < joints; j++) {
      gv_sim_joint *joint = &sim->joint[f][j];
      step_joint(joint, h, -sim->tension_n[f] * arm_m[j], k[j], inertia[j], d->damping_ratio);
      sim->report.deviation_max_rad = fmax(sim->report.deviation_max_rad, fabs(joint->deviation_rad));
    }
  }
}

void gv_sim_force_step(gv_sim *sim) {
  check_watchdog(sim);
  pull_tendons(sim);
  step_fingers(sim);
}

void gv_sim_angles(const gv_sim *sim, double out_rad[GV_SENSORS]) {
  memcpy(out_rad, sim->intent.angle_rad, sizeof sim->intent.angle_rad);
  for (int f = 0; f < GV_FINGERS; f++) {
    int sensor[3];
    double arm_m[3];
    int joints = gv_tendon_joints(f, sensor, arm_m);
    for (int j = 0; j < joints; j++)
      out_rad[sensor[j]] += sim->joint[f][j].deviation_rad;
  }
}

const double *gv_sim_tension(const gv_sim *sim) { return sim->tension_n; }
const gv_sim_report *gv_sim_report_of(const gv_sim *sim) { return &sim->report; }
