// SPDX-License-Identifier: BSD-3-Clause
// Force channels: what one finger of a device takes, and how a tension in newtons becomes the device's own
// number. The engine and the limiter know newtons alone; the driver of a device converts. Pure; any thread.
//
//   number = floor(tension / max_n * counts), so that no tension is passed by a count, and 0 is no force.
//
// Another device is another row of the table in channel.c and a driver that calls gv_channel_counts.
#ifndef GLOVED_CHANNEL_H
#define GLOVED_CHANNEL_H

#include "gloved/force.h"

#ifdef __cplusplus
extern "C" {
#endif

// tension: a tendon pulls with it. brake: the number, 0..1 of a full brake, holds a finger that closes
// against it; it cannot be felt by a finger that opens. Both only resist bending: never below 0.
typedef enum gv_channel_kind { GV_CHANNEL_TENSION, GV_CHANNEL_BRAKE } gv_channel_kind;

typedef struct gv_channel {
  const char *device, *unit;  // name; what one count is
  gv_channel_kind kind;
  double max_n;         // tension that stands for `counts`, the most it takes
  double pretension_n;  // pull at rest, so that no tendon hangs slack; 0: none
  double slew_n_per_s;  // fastest rise it is sent
  int counts;           // its number for max_n
  int fingers;          // that it can hold, from the thumb on; the others get no force
} gv_channel;

typedef enum gv_channel_name {
  GV_CHANNEL_CYBERGRASP,     // five tensions of 12 N, as our frames carry them; the default
  GV_CHANNEL_SENSEGLOVE_R1,  // four motors, no little finger: millinewtons, 800 at rest, about 3500
                             // active; no driver
  GV_CHANNEL_LUCIDGLOVE,     // five brakes 0..1000
  GV_CHANNEL_DOGLOVE,        // five servos that pull the finger open with a current, mA
  GV_CHANNELS
} gv_channel_name;

// The channels of a device are alike. Null beyond the table.
const gv_channel *gv_channel_of(gv_channel_name name);
// The device's number for a tension, 0..counts; what is not finite or below 0 is 0.
int gv_channel_counts(const gv_channel *channel, double tension_n);
// The tension that a number stands for, for simulated devices and displays; clamped to 0..max_n.
double gv_channel_tension_n(const gv_channel *channel, int counts);
// Makes a limiter's configuration fit the channel: no higher maximum (0 for fingers it lacks), no
// faster rise, no less pretension. Returns
// whether it changed anything.
bool gv_channel_limit(const gv_channel *channel, gv_limiter_config *cfg);

#ifdef __cplusplus
}
#endif

#endif
