// SPDX-License-Identifier: BSD-3-Clause
// A simulated force control unit with a scripted user: it sends the frames that a glove, a tracker and a
// force exoskeleton would send, and the tension it receives really holds its fingers back. No socket, no
// clock, no engine: the caller hands in frames and the time. tools/fcusim.c puts it behind UDP,
// gv_sim_open behind the URL "sim:". Deterministic: the same script, device, seed, commands and times
// give the same frames, bit by bit.
#ifndef GLOVED_SIM_H
#define GLOVED_SIM_H

#include "gloved/fcu.h"
#include "gloved/frame.h"
#include "gloved/hand.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
  GV_SIM_KEYFRAMES = 256,  // of one script; 1 costs 256 B
  GV_SIM_POSTURES = 32,    // of one script; 1 costs 208 B
  GV_SIM_QUEUE = 512,      // frames on their way out: five streams, the late ones wait here, and those on
                           // the wire (20 ms of two streams at 10 kHz)
  GV_SIM_COMING = 256      // commands on the wire: 20 ms at 10 kHz
};
#define GV_SIM_DELAY_MAX_S 0.02

// ---- device ---------------------------------------------------------------------------------------
// Every number of the device, its defects and the user's fingers. All are set by name, from a script's
// line `device NAME VALUE ...` or from the URL; the names, ranges and both presets stand in one table
// (sim_device.c). `best`: 12 bits, 1 kHz, no noise. `real`: what recordings look like (DESIGN.md, "Devices").
typedef struct gv_sim_device {
  // glove
  double glove_hz_min, glove_hz_max;        // each pause between samples is drawn from this range of rates
  double quantum_min_rad, quantum_max_rad;  // each sensor's step is drawn from this range; 0: the 12-bit
                                            // count alone
  double noise_rad;                         // standard deviation of each reading
  double equal_share;                       // chance that a sample repeats the last one
  double jump_chance;  // chance that one sensor of a sample is off by jump_min_rad..jump_max_rad
  double jump_min_rad, jump_max_rad;
  double offset_rad, gain_error;  // calibration error of each sensor, drawn once from +-these: angles
                                  // beyond anatomy
  // tracker: receiver 2 hand, receiver 1 head
  double tracker_hz, head_hz;
  double position_noise_m, rotation_noise_rad;
  // transport
  double status_hz;
  double coarse_stamps;            // 1: stamps come from a clock that ticks 15, 16 and sometimes 32 ms
  double clock_start_s;            // device clock at the start (it wraps at 4294.967296 s)
  double late_chance, late_max_s;  // a frame held back, and with it those of its stream behind it
  double loss_chance;              // a frame that never comes (its counter is used up)
  // force side
  double max_n;         // a command above is refused
  double slew_n_per_s;  // a command that rises faster is refused
  double wire_count_n;  // smallest step of a tension on the wire (0.012 on classic CAN)
  double command_hz;    // nominal rate of commands
  double watchdog_s;    // no good command for this long: tension zero
  // the user's fingers: joints of a finger from proximal to distal
  double stiffness_0, stiffness_1, stiffness_2;  // N m/rad
  double inertia_0, inertia_1, inertia_2;        // kg m^2
  double damping_ratio;                          // 1: critical
  // what the user's hand does besides the script: every joint and the wrist, each with a
  // phase of its own (by the seed)
  double sway_rad, sway_m, sway_hz;  // amplitude of a slow movement: of each flexion joint, of the
                                     // wrist along each axis
  double tremor_rad, tremor_hz;      // likewise of physiological tremor, flexion joints alone
  double delay_s;                    // of the wire, each way: no stamp or age tells it
  double cycle_hz;                   // of the device: it samples, takes commands and moves the fingers so
                                     // often; above the rates of its streams
} gv_sim_device;

gv_sim_device gv_sim_device_best(void);
gv_sim_device gv_sim_device_real(void);
// One setting by its name, or `finger` with `relaxed`, `normal` or `firm`: all seven numbers of the user's
// fingers as people were measured (sources: sim_device.c). 0, or negative with one line in err (what, what
// to do).
int gv_sim_device_set(gv_sim_device *device, const char *name, const char *value, char *err, size_t err_size);
// 0, or negative with one line in err where a range is upside down.
int gv_sim_device_check(const gv_sim_device *device, char *err, size_t err_size);

// ---- script ---------------------------------------------------------------------------------------
// A text, one item a line, `#` starts a comment. Times in seconds, angles in degrees, lengths in metres.
//   device best|real                  preset (best where none is named)
//   device NAME VALUE ...             single settings of gv_sim_device
//   seed N
//   hand right|left                   (right)
//   head X Y Z ROLL PITCH YAW         pose of the head's receiver
//   posture NAME [like OTHER] [SENSOR ANGLE ...]   starts a posture, or adds to the one of this name
//   at TIME [posture NAME] [wrist X Y Z ROLL PITCH YAW] [dead_man on|off] [SENSOR ANGLE ...]
//   end TIME                          (the last keyframe)
// What a keyframe does not mention keeps its value; from one keyframe to the next everything moves along
// a minimum-jerk curve. Orientation is Rz(yaw) Ry(pitch) Rx(roll) of the wrist frame of hand.h.
typedef struct gv_sim_keyframe {
  double time_s;
  double angle_rad[GV_SENSORS];
  gv_pose T_world_wrist;
  bool dead_man;  // from this time on
} gv_sim_keyframe;

typedef struct gv_sim_script {
  gv_sim_device device;
  uint64_t seed;
  gv_side side;
  gv_pose T_world_head;
  double end_s;
  int keyframe_count;
  gv_sim_keyframe keyframe[GV_SIM_KEYFRAMES];
} gv_sim_script;

// Parse `text`; `name` is used in messages. 0, or negative with "NAME:LINE: what; what to do" in err.
int gv_sim_script_parse(const char *text, const char *name, gv_sim_script *out, char *err, size_t err_size);
// Read and parse a file (set-up: allocates, blocks).
int gv_sim_script_load(const char *path, gv_sim_script *out, char *err, size_t err_size);
// What the user means to do at `time_s` (clamped to the script's ends).
gv_sim_keyframe gv_sim_script_at(const gv_sim_script *script, double time_s);

// ---- model ----------------------------------------------------------------------------------------
// What the device saw. Counters never go back.
typedef struct gv_sim_report {
  uint64_t commands;             // accepted
  uint64_t refused_frames;       // FORCE_COMMAND that does not decode: length, checksum, reserved bits
  uint64_t repeated;             // counter equal to or behind the last one: ignored
  uint64_t counter_gaps;         // commands missing between accepted ones
  uint64_t over_max, over_slew;  // refused: a force beyond the limit, or rising too fast
  uint64_t foreign;              // other ids
  uint64_t watchdog_trips;       // times the force went to zero because commands stayed away
  uint64_t watchdog_drops;       // of these, while commands flow: the next one came within 0.1 s, and none
                                 // was lost before it
  unsigned drops_a_second;       // the most of them within one second
  uint64_t sent, lost, late;     // frames of ours
  double tension_max_n[GV_FINGERS];  // largest accepted
  double slew_max_n_per_s;           // fastest rise of all commands, refused ones too
  double zero_after_s;               // longest time from the last good command to zero force
  double deviation_max_rad;          // furthest that a joint was held back
} gv_sim_report;

typedef struct gv_sim_joint {
  double deviation_rad, velocity_rad_s;
} gv_sim_joint;
typedef struct gv_sim_stream {
  int64_t next_ns, last_due_ns;
  uint8_t counter;
} gv_sim_stream;
typedef struct gv_sim_pending {
  int64_t due_ns;
  gv_frame frame;
} gv_sim_pending;

// The whole model; members are private. About 140 kB; no heap, no pointer to the outside.
typedef struct gv_sim {
  gv_sim_script script;
  gv_sim_device device;
  gv_calibration calibration;
  uint64_t random, seed;
  int64_t step_ns;   // a cycle of the device
  int64_t now_ns;    // device time since init: whole cycles (-1 before the first step)
  int64_t start_ns;  // device time at which the script starts, negative: not yet
  // sensors
  double quantum_rad[GV_SENSORS], offset_rad[GV_SENSORS], gain[GV_SENSORS];
  uint16_t raw[GV_SENSORS];               // the last sample, for repeats
  bool jumped;                            // one of its sensors is off
  int64_t stamp_clock_ns, stamp_tick_ns;  // coarse clock: now, and its next tick
  // user
  gv_sim_keyframe intent;
  gv_sim_joint joint[GV_FINGERS][3];
  // force side
  double tension_n[GV_FINGERS];  // applied now
  double command_n[GV_FINGERS];  // of the last good command
  int64_t command_ns;            // its time
  int command_steps;             // counter steps since then
  int64_t drops_since_ns;        // the second in which drops are counted now
  unsigned drops;
  uint8_t command_counter, command_flags;
  bool command_seen, watchdog, status_due;
  // frames on their way out
  gv_sim_stream glove, hand, head, status;
  gv_sim_pending queue[GV_SIM_QUEUE];
  int queue_count;
  gv_sim_pending coming[GV_SIM_COMING];  // commands on their way in, a ring
  int coming_first, coming_count;
  gv_sim_report report;
} gv_sim;

// `device` null: the script's. The script is copied. seed 0: the script's.
void gv_sim_init(gv_sim *sim, const gv_sim_script *script, const gv_sim_device *device, uint64_t seed);
// Start the script at the present device time. Before that the user holds the first keyframe.
void gv_sim_start(gv_sim *sim);
bool gv_sim_started(const gv_sim *sim);
// A frame from the engine, at the present device time; it acts after delay_s. Anything but a sound
// FORCE_COMMAND is counted and has no effect. Never fails.
void gv_sim_receive(gv_sim *sim, const gv_frame *frame);
// Advance the device in its cycles (1 ms by default) up to now_ns (since init) and take up to `max` frames
// due by then, in order, stamp_ns on the same clock. Where `max` is reached it stops; call again. Cost: 1 us
// a cycle.
int gv_sim_advance(gv_sim *sim, int64_t now_ns, gv_frame *out, int max);
bool gv_sim_ended(const gv_sim *sim);  // the script is over; no frame comes any more
const gv_sim_report *gv_sim_report_of(const gv_sim *sim);
// For tests and plots: actual joint angles (the intention plus what the tension held back), applied tension.
void gv_sim_angles(const gv_sim *sim, double out_rad[GV_SENSORS]);
const double *gv_sim_tension(const gv_sim *sim);

#ifdef __cplusplus
}
#endif

#endif
