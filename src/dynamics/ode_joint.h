// SPDX-License-Identifier: BSD-3-Clause
// The problem's joints as joints of ODE's own; for ode.c alone, which includes ODE first. Real-time thread.
#ifndef DYNAMICS_ODE_JOINT_H
#define DYNAMICS_ODE_JOINT_H

#include <ode/ode.h>

#include "dynamics/problem.h"

// What a joint becomes: body b is null for the world or one that does not move. Both bodies stand at the
// problem's positions, unturned, and do so again afterwards. The joints go with the group.
void gv_ode_put_joint(dWorldID world, dJointGroupID group, dBodyID a, dBodyID b, const gv_problem *problem,
                      const gv_problem_joint *joint);

#endif
