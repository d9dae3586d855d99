// SPDX-License-Identifier: BSD-3-Clause
// Shared by the files of the simulated device: its step and its force side.
#ifndef DRIVERS_SIM_H
#define DRIVERS_SIM_H

#include "gloved/sim.h"

// A command that has come over the wire, at sim->now_ns.
void gv_sim_take_command(gv_sim *sim, const gv_frame *frame);

// One step of the force side at sim->now_ns: the watchdog, the tension, and the fingers that it pulls.
void gv_sim_force_step(gv_sim *sim);

// What the user does besides the script, onto sim->intent at sim->now_ns.
void gv_sim_user_step(gv_sim *sim);

#endif
