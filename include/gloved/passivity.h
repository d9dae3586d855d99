// SPDX-License-Identifier: BSD-3-Clause
// Energy at the five tendons, and a damper that gives none away: time-domain passivity observer and
// controller (Hannaford and Ryu, "Time-domain passivity control of haptic interfaces", IEEE Trans.
// Robotics and Automation 18, 2002). Pure, no heap; the real-time thread calls it. Cost: 550 instructions
// a step with a glove of 1 kHz.
//
// The port. x is the way of a finger's tendon, metres: x = sum r_j q_j over the finger's joints as the glove
// measured them, jumps held back and within anatomy (gv_tendon_way, gv_engine_measured). It grows as the
// finger bends. T is the tension on the wire, after limiter and rounding. A tendon pulls against bending, so
// T dx > 0 is work that the person does on gloved, and T dx < 0 is work that gloved does on the person. Step
// k of the measurements, at which the glove was read again, adds
//   E += T(k-1) (x(k) - x(k-1))             exact where T is held between two measurements (zero-order hold);
// where several commands went out between two measurements, T(k-1) is their mean over time, which is exact
// for a finger that went evenly. A spring or damper that answers at once never has E < 0; a sampled spring
// loses K dx^2 / 2 in each step, and a delay loses more.
//
// It is the port as gloved sees it: what the glove's sampling, the filter and gloved's period delay is in it;
// what the wire delays, both ways, is not. And the wrist is no port: a hand that presses a finger onto the
// table from the shoulder, or two fingers that press against each other, are paid work here that another
// part of the hand did, so E goes far below zero in a grasp that is quiet, or far above, and then hides for
// long what an oscillation gives out. Hence the reference (Ryu, Preusche, Hannaford and Hirzinger, "Time
// domain passivity control with reference energy following", 2005): the controller looks at the swinging part
// alone, T and dx/dt less their means over GV_PASSIVITY_SWING_S, and at its mean power over
// GV_PASSIVITY_POWER_S. In a swing at a steady amplitude what is stored comes back in each cycle and cancels;
// what stays is what the coupling gives out.
//
// The controller: where that power P is below zero, a damper of alpha = -P / mean(v^2), at most
// damping_max, on the swinging speed v (over at least 4 ms: a count of the glove is no speed): T = desired
// + alpha v. With it the port's mean power is zero. It is put before the limiter, which judges its sum as
// it judges any force. It adds at most add_max_n and no more than what is desired, nothing where nothing
// is desired, and takes away at most all of it; where the glove is silent for twice the time that v was
// taken over it does nothing.
#ifndef GLOVED_PASSIVITY_H
#define GLOVED_PASSIVITY_H

#include <stdbool.h>

#include "gloved/limits.h"
#include "gloved/setting.h"

#ifdef __cplusplus
extern "C" {
#endif

#define GV_PASSIVITY_SWING_S 0.1  // slower than this is the person's own movement
#define GV_PASSIVITY_POWER_S 0.2  // two to three cycles of 10 to 14 Hz

typedef enum gv_passivity_mode { GV_PASSIVITY_OFF, GV_PASSIVITY_ON } gv_passivity_mode;

typedef struct gv_passivity_config {
  gv_passivity_mode controller;  // the observer is always on
  double damping_max;            // largest damper, N s/m of the tendon's way
  double add_max_n;              // the most that it adds to a tension
} gv_passivity_config;

gv_passivity_config gv_passivity_config_default(void);
// The members with their hard bounds. Null when all are within, else the first name.
enum { GV_PASSIVITY_SETTINGS = 3 };
extern const gv_setting gv_passivity_settings[GV_PASSIVITY_SETTINGS];
const char *gv_passivity_check(const gv_passivity_config *cfg);

// One tendon. Written by the functions below alone.
typedef struct gv_passivity_port {
  double energy_j;        // E: what the person has put in, less what came back; below zero: given out
  double energy_least_j;  // the least so far, at most 0
  double dissipated_j;    // what the controller took out, in energy_j too; below zero: it gave
  double damping;         // alpha now, N s/m
  double speed_m_s;       // of the tendon's way, between the last two measurements, less its mean
  double power_w;         // mean of the swinging tension without the controller, times that speed
  double speed2_m2_s2;    // mean of its square
  double way_m;           // as measured last
  double mean_tension_n, mean_speed_m_s;
  double look_moved_m, look_naked_n_s;  // since the swing was judged last
  double sent_n, added_n;               // on the wire now, and what the controller has to do with it
  double sent_n_s, added_n_s;           // both over the time since the last measurement
} gv_passivity_port;

typedef struct gv_passivity {
  gv_passivity_config cfg;
  gv_passivity_port port[GV_FINGERS];
  bool measured;    // a way is known
  double since_s;   // the last measurement
  double look_s;    // measured since the swing was judged last
  double looked_s;  // what went into that
} gv_passivity;

void gv_passivity_init(gv_passivity *passivity, const gv_passivity_config *cfg);
// dt_s went by with the last command; it pulled for pulled_s of them (a device lets go where commands stay
// away). Before a measurement, and before another command.
void gv_passivity_hold(gv_passivity *passivity, double dt_s, double pulled_s);
// The glove was read: where each tendon is now. Finite.
void gv_passivity_measure(gv_passivity *passivity, const double way_m[GV_FINGERS]);
// The ways are not comparable with the next (another engine): the energies stay.
void gv_passivity_forget_way(gv_passivity *passivity);
// What the limiter is asked for in place of `desired_n`: the same, bit by bit, with the controller off.
void gv_passivity_control(const gv_passivity *passivity, const double desired_n[GV_FINGERS],
                          double out_n[GV_FINGERS]);
// What went out on the wire for it. asked_n: as gv_passivity_control made it of desired_n.
void gv_passivity_command(gv_passivity *passivity, const double desired_n[GV_FINGERS],
                          const double asked_n[GV_FINGERS], const double sent_n[GV_FINGERS]);

#ifdef __cplusplus
}
#endif

#endif
