// SPDX-License-Identifier: BSD-3-Clause
// The simulated serial devices (serial_sim.h). Pure; deterministic for a seed and the bytes it receives.
#include "drivers/serial_sim.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "gloved/channel.h"

enum { CTRL_Y = 0x19 };
static const int64_t lucid_patience_ns = 1000000000;  // readBytesUntil's

static double uniform(serial_sim *s) {
  s->random ^= s->random >> 12;
  s->random ^= s->random << 25;
  s->random ^= s->random >> 27;
  return (double)((s->random * 2685821657736338717ULL) >> 11) / 9007199254740992.0;
}
static bool chance(serial_sim *s, double p) { return p > 0.0 && uniform(s) < p; }
static int below(serial_sim *s, int n) { return (int)(n * uniform(s)); }

// ---- bytes out, with the line's faults ------------------------------------------------------------

static void put_byte(serial_sim *s, uint8_t byte) {
  if (s->out_count < SERIAL_SIM_OUT)
    s->out[s->out_count++] = byte;
}

static void put_bytes(serial_sim *s, const void *bytes, int count) {
  for (int i = 0; i < count; i++)
    put_byte(s, ((const uint8_t *)bytes)[i]);
}

static void put_garbage(serial_sim *s, int count) {
  s->garbage_bytes += (uint64_t)count;
  while (count-- > 0)
    put_byte(s, (uint8_t)below(s, 256));
}

static void put_record(serial_sim *s, const uint8_t *byte, int count) {
  int from = count;
  int missing = 0;
  bool changed = false;
  if (chance(s, s->faults.garbage))
    put_garbage(s, 1 + below(s, 20));
  if (chance(s, s->faults.gap)) {
    from = below(s, count);
    missing = 1 + below(s, count - from);
  }
  for (int i = 0; i < count; i++) {
    if (i >= from && i < from + missing)
      continue;
    const uint8_t sent = chance(s, s->faults.noise) ? (uint8_t)below(s, 256) : byte[i];
    changed |= sent != byte[i];
    put_byte(s, sent);
  }
  if (changed || missing)
    s->damaged++;
  else
    s->whole++;
}

// ---- FASTRAK --------------------------------------------------------------------------------------

static void send_pose(serial_sim *s, const gv_pose_msg *msg) {
  const int station = msg->receiver;
  if (!s->streaming || !s->station_on[station] || !s->listed[station])
    return;
  const char error = s->error ? s->error : ' ';
  gv_fastrak_record record = {station, error, true, gv_pose_mul(s->T_tracker_world, msg->T_world_receiver)};
  if (!s->centimetres)
    record.T_tracker_receiver.p = gv_scale(record.T_tracker_receiver.p, 1.0 / 2.54);
  uint8_t byte[GV_FASTRAK_ASCII_BYTES];
  put_record(s, byte, gv_fastrak_encode(s->binary ? GV_FASTRAK_BINARY : GV_FASTRAK_ASCII, &record, byte));
}

static void refuse(serial_sim *s) {
  char text[96];
  s->refused++;
  const int n = snprintf(text, sizeof text, "2 E*ERROR*%.*s*ERROR* EC -99 *PS 0 *FL 0 *ST 0\r\n",
                         (int)s->command_length, s->command);
  put_bytes(s, text, n);
}

// Manual, page 69: flags 3F0 and the bits of format, units and continuous output.
static void put_status(serial_sim *s) {
  char text[80];
  const int flags = 0x3f0 | s->binary | s->centimetres << 1 | s->streaming << 3;
  const int n = snprintf(text, sizeof text, "21S%03X    F3F  2.52  %-32s\r\n", (unsigned)flags, "simulated");
  put_bytes(s, text, n);
}

static void put_stations(serial_sim *s) {
  char text[16];
  const int n = snprintf(text, sizeof text, "21l%d%d%d%d\r\n", s->station_on[1], s->station_on[2],
                         s->station_on[3], s->station_on[4]);
  put_bytes(s, text, n);
}

static void set_station(serial_sim *s, int station, const char *rest) {
  if (rest[0] == '\0')
    put_stations(s);
  else
    s->station_on[station] = rest[1] == '1' && !s->unplugged[station];
}

// A command that ends with CR.
static void run_fastrak_line(serial_sim *s) {
  const char *c = s->command;
  const char *rest = c + 2;
  const int station = s->command_length > 1 ? c[1] - '0' : 0;
  if (memchr("vx", c[0], 2)) {
    s->filtered = s->filtered && strcmp(c + 1, ",1") != 0;
    return;
  }
  if (station < 1 || station > GV_FASTRAK_STATIONS) {
    refuse(s);
    return;
  }
  switch (c[0]) {
    case 'l': set_station(s, station, rest); break;
    case 'O': s->listed[station] = strcmp(rest, s->binary ? ",2,11,0" : ",2,11,1") == 0; break;
    case 'I': s->increment[station] = strtod(rest + 1, NULL); break;
    case 'R': s->aligned[station] = false; break;
    case 'b': s->boresighted[station] = false; break;
    case 'H': break;
    default: refuse(s);
  }
}

static void set_centimetres(serial_sim *s) {
  if (s->deaf_to_units > 0)
    s->deaf_to_units--;
  else
    s->centimetres = true;
}

static void receive_fastrak(serial_sim *s, char c) {
  if (s->command_length > 0 && c != '\r') {
    if (s->command_length < SERIAL_SIM_COMMAND - 1)
      s->command[s->command_length++] = c;
    return;
  }
  s->commands++;
  switch (s->command_length ? '\r' : c) {
    case 'c': s->streaming = false; break;
    case 'C': s->streaming = true; break;
    case 'S': put_status(s); break;
    case 'u': set_centimetres(s); break;
    case 'U': s->centimetres = false; break;
    case 'f': s->binary = true; break;
    case 'F': s->binary = false; break;
    case CTRL_Y: gv_serial_sim_reset(s); break;
    case 'l':
    case 'H':
    case 'O':
    case 'I':
    case 'R':
    case 'b':
    case 'v':
    case 'x': s->command[s->command_length++] = c; break;
    case '\r':
      if (s->command_length > 0)
        run_fastrak_line(s);
      memset(s->command, 0, sizeof s->command);
      s->command_length = 0;
      break;
    default: refuse(s);
  }
}

// ---- CyberGlove -----------------------------------------------------------------------------------

// The echo and those sensors of an 8-bit frame that number and mask let through; returns their count.
static int leave_masked_out(const serial_sim *s, uint8_t *byte) {
  int count = 1;
  for (int i = 0; i < s->sensors && count <= s->number; i++)
    if (s->mask[i / 8] >> i % 8 & 1)
      byte[count++] = byte[1 + i];
  return count;
}

static void send_glove(serial_sim *s, char echo) {
  const gv_cyberglove_format format = {s->sensors, s->wide && echo == 'S'};
  uint8_t byte[GV_CYBERGLOVE_MAX_BYTES];
  int count = gv_cyberglove_encode(&format, s->glove.raw, echo, 1e-9 * (double)s->sim.now_ns, byte);
  if (!format.wide) {
    count = leave_masked_out(s, byte);
    if (s->error)
      byte[count++] = 'e';
    if (s->error)
      byte[count++] = (uint8_t)s->error;
    byte[count++] = 0;
  }
  put_record(s, byte, count);
}

static void put_mask(serial_sim *s, const uint8_t mask[3]) { put_bytes(s, mask, 3); }

static void answer_query(serial_sim *s, char query) {
  const uint8_t right = s->sim.script.side == GV_RIGHT;
  put_byte(s, '?');
  put_byte(s, (uint8_t)query);
  switch (query) {
    case 'S': put_byte(s, (uint8_t)s->sensors); break;
    case 'R': put_byte(s, right); break;
    case 'N': put_byte(s, s->number); break;
    case 'M': put_mask(s, s->mask); break;
    case 'K':
      put_mask(s, s->sensors == GV_SENSORS ? (const uint8_t[]){0xff, 0xff, 0x3f}
                                           : (const uint8_t[]){0xff, 0xff, 0x03});
      break;
    case 'C':
      for (int i = 0; i < 2 * s->sensors; i++)
        put_byte(s, (uint8_t)(i < s->sensors ? 60 + i : 100 + i));
      break;
    default: s->refused++;
  }
  put_byte(s, 0);
}

static void start_glove(serial_sim *s, bool wide) {
  s->streaming = true;
  s->wide = wide;
}

static bool begun_with(const serial_sim *s, const char *text) {
  return s->command_length == strlen(text) && memcmp(s->command, text, strlen(text)) == 0;
}

static uint8_t take_setting(serial_sim *s, uint8_t value) {
  put_bytes(s, (const uint8_t[]){(uint8_t)s->command[0], 0}, 2);
  return value;
}

// Three bytes; returns true where more are to come.
static bool take_mask(serial_sim *s, uint8_t byte) {
  s->mask[s->command_length - 1] = byte;
  if (s->command_length < 3)
    return true;
  take_setting(s, byte);
  return false;
}

// Returns true where the command needs more bytes.
static bool receive_glove_begun(serial_sim *s, char c) {
  if (begun_with(s, "?"))
    answer_query(s, c);
  else if (begun_with(s, "D") || begun_with(s, "U"))
    put_bytes(s, (const uint8_t[]){(uint8_t)s->command[0], 0}, 2);
  else if (s->command[0] == 'N')
    s->number = take_setting(s, (uint8_t)c);
  else if (s->command[0] == 'M')
    return take_mask(s, (uint8_t)c);
  else if (begun_with(s, "1") && c == 'e')
    return true;
  else if (begun_with(s, "1") && c == 'S')
    start_glove(s, true);
  else if (!begun_with(s, "1e") || c != 'u')
    put_bytes(s, "e?", 3);
  return false;
}

static void receive_cyberglove(serial_sim *s, char c) {
  bool more = false;
  if (s->command_length > 0)
    more = receive_glove_begun(s, c);
  else if (c == 'G')
    send_glove(s, 'G');
  else if (c == 'S')
    start_glove(s, false);
  else if (c == GV_CYBERGLOVE_STOP)
    s->streaming = false;
  else if (memchr("?DU1NM", c, 6))
    more = true;
  else
    put_bytes(s, "e?", 3);
  s->commands += more ? 0 : 1;
  if (more)
    s->command[s->command_length++] = c;
  else
    s->command_length = 0;
}

// ---- LucidGlove -----------------------------------------------------------------------------------

static const gv_lucid_format lucid = {4095};

static void send_bends(serial_sim *s) {
  gv_lucid_sample sample = {.letters = s->glove.flags & GV_GLOVE_DEAD_MAN ? gv_lucid_bit('J') : 0};
  double angle_rad[GV_SENSORS];
  uint8_t line[GV_LUCID_LINE_BYTES];
  if (s->waits_since_ns >= 0 && s->sim.now_ns - s->waits_since_ns < lucid_patience_ns)
    return;
  s->waits_since_ns = s->brakes_early > 0 ? -1 : s->sim.now_ns;
  s->brakes_early -= s->brakes_early > 0;
  for (int i = 0; i < GV_SENSORS; i++)
    angle_rad[i] = gv_calibration_angle(&s->sim.calibration, i, s->glove.raw[i]);
  gv_lucid_bend(&lucid, angle_rad, sample.bend);
  put_record(s, line, gv_lucid_encode(&lucid, &sample, line));
}

// The brakes as a command of tensions, so that they pull at the fingers of the model.
static void apply_brakes(serial_sim *s) {
  gv_command_msg msg = {.counter = (uint8_t)(s->sim.command_counter + 1), .flags = GV_COMMAND_ENABLE};
  gv_frame frame;
  for (int f = 0; f < GV_FINGERS; f++) {
    msg.tension_n[f] = gv_channel_tension_n(gv_channel_of(GV_CHANNEL_LUCIDGLOVE), s->brake[f]);
    if (s->brake[f] > s->brake_max[f])
      s->brake_max[f] = s->brake[f];
  }
  gv_fcu_pack_command(&msg, &frame);
  gv_sim_receive(&s->sim, &frame);
}

static void receive_lucidglove(serial_sim *s, char c) {
  if (c != '\n') {
    if (s->command_length < SERIAL_SIM_COMMAND)
      s->command[s->command_length++] = c;
    return;
  }
  s->commands++;
  if (gv_lucid_decode_brakes(s->command, (int)s->command_length, s->brake)) {
    for (int f = 0; s->flip && f < GV_FINGERS; f++)
      s->brake[f] = GV_LUCID_BRAKE_MAX - s->brake[f];
    s->brake_lines++;
    s->brakes_unasked += s->waits_since_ns < 0;
    s->brakes_early += s->waits_since_ns < 0;
    s->waits_since_ns = -1;
    apply_brakes(s);
  } else {
    s->refused++;
  }
  s->command_length = 0;
}

// ---- DOGlove --------------------------------------------------------------------------------------

static void find_angles(const serial_sim *s, double encoder_deg[GV_DOGLOVE_ENCODERS],
                        double servo_deg[GV_FINGERS]) {
  double angle_rad[GV_SENSORS];
  gv_sim_angles(&s->sim, angle_rad);
  gv_doglove_encoders(angle_rad, encoder_deg, servo_deg);
}

static void send_block(serial_sim *s) {
  gv_doglove_block block = {.time_ms = (uint16_t)(s->sim.now_ns / 1000000)};
  double servo_deg[GV_FINGERS];
  uint8_t byte[GV_DOGLOVE_BYTES];
  find_angles(s, block.encoder_deg, servo_deg);
  gv_doglove_encode(&block, byte);
  put_record(s, byte, sizeof byte);
}

// The servos' currents as a command of tensions, so that they pull at the fingers of the model.
static void pull_fingers(serial_sim *s) {
  const gv_channel *channel = gv_channel_of(GV_CHANNEL_DOGLOVE);
  gv_command_msg msg = {.counter = (uint8_t)(s->sim.command_counter + 1), .flags = GV_COMMAND_ENABLE};
  gv_frame frame;
  for (int f = 0; f < GV_FINGERS; f++)
    msg.tension_n[f] = gv_channel_tension_n(channel, gv_doglove_sim_current(&s->servos, f));
  gv_fcu_pack_command(&msg, &frame);
  gv_sim_receive(&s->sim, &frame);
}

static void advance_servos(serial_sim *s, int64_t now_ns) {
  double encoder_deg[GV_DOGLOVE_ENCODERS];
  double servo_deg[GV_FINGERS];
  find_angles(s, encoder_deg, servo_deg);
  gv_doglove_sim_advance(&s->servos, servo_deg, now_ns);
  pull_fingers(s);
}

static void receive_servos(serial_sim *s, uint8_t byte) {
  uint8_t out[DOGLOVE_SIM_ANSWER];
  const uint64_t packets = s->servos.packets;
  const int count = gv_doglove_sim_receive(&s->servos, byte, s->sim.now_ns, out);
  s->commands += s->servos.packets - packets;
  if (count > 0)
    put_record(s, out, count);
}

static void loosen_lucidglove(gv_sim_device *device) { device->watchdog_s = device->slew_n_per_s = 1e9; }

// ---- all ------------------------------------------------------------------------------------------

void gv_serial_sim_receive(serial_sim *s, const uint8_t *byte, int count) {
  for (int i = 0; i < count; i++) {
    if (s->kind == SERIAL_SIM_FASTRAK)
      receive_fastrak(s, (char)byte[i]);
    else if (s->kind == SERIAL_SIM_CYBERGLOVE)
      receive_cyberglove(s, (char)byte[i]);
    else if (s->kind == SERIAL_SIM_LUCIDGLOVE)
      receive_lucidglove(s, (char)byte[i]);
    else if (s->kind == SERIAL_SIM_DOGLOVE_SERVOS)
      receive_servos(s, byte[i]);
  }
}

void gv_serial_sim_reset(serial_sim *s) {
  s->streaming = s->binary = s->centimetres = s->wide = false;
  memset(s->mask, 0xff, sizeof s->mask);
  s->number = GV_SENSORS;
  memset(s->station_on, 0, sizeof s->station_on);
  memset(s->listed, 0, sizeof s->listed);
  s->station_on[1] = s->station_on[2] = true;  // the receivers that are plugged in
  s->command_length = 0;
  s->waits_since_ns = -1;
  s->brakes_early = 0;
  memset(s->brake, 0, sizeof s->brake);
  gv_doglove_sim_init(&s->servos);
  put_garbage(s, 7);
}

static void take_frame(serial_sim *s, const gv_frame *frame) {
  gv_pose_msg pose;
  if (s->kind == SERIAL_SIM_FASTRAK) {
    if (gv_fcu_unpack_pose(frame, &pose) == GV_FCU_OK)
      send_pose(s, &pose);
  } else if (gv_fcu_unpack_glove(frame, &s->glove) == GV_FCU_OK) {
    if (s->kind == SERIAL_SIM_DOGLOVE)
      send_block(s);
    else if (s->kind == SERIAL_SIM_LUCIDGLOVE)
      send_bends(s);
    else if (s->streaming)
      send_glove(s, 'S');
  }
}

int gv_serial_sim_advance(serial_sim *s, int64_t now_ns, uint8_t *out, int max) {
  gv_frame frame[16];
  int n;
  // Full: what a real device would go on sending is lost.
  while ((n = gv_sim_advance(&s->sim, now_ns, frame, 16)) > 0)
    for (int i = 0; i < n; i++)
      take_frame(s, &frame[i]);
  if (s->kind == SERIAL_SIM_DOGLOVE_SERVOS)
    advance_servos(s, now_ns);
  n = s->out_count < max ? s->out_count : max;
  memcpy(out, s->out, (size_t)n);
  s->out_count -= n;
  memmove(s->out, s->out + n, (size_t)s->out_count);
  return n;
}

void gv_serial_sim_adapt(gv_sim_device *device) {
  device->tracker_hz = device->head_hz = 60;
  device->glove_hz_min = 90;
  device->glove_hz_max = 150;
  device->late_chance = device->loss_chance = 0;
}

void gv_serial_sim_init(serial_sim *s, serial_sim_kind kind, const gv_sim_script *script,
                        const gv_pose *T_world_tracker, uint64_t seed) {
  memset(s, 0, sizeof *s);
  s->kind = kind;
  s->sensors = GV_SENSORS;
  s->T_tracker_world = gv_pose_inv(*T_world_tracker);
  s->random = 0x2545f4914f6cdd1dULL * (seed ? seed : 1);
  gv_sim_init(&s->sim, script, NULL, seed);
  if (kind == SERIAL_SIM_LUCIDGLOVE || kind == SERIAL_SIM_DOGLOVE_SERVOS)
    loosen_lucidglove(&s->sim.device);
  gv_sim_start(&s->sim);
  memcpy(s->glove.raw, s->sim.raw, sizeof s->glove.raw);
  gv_serial_sim_reset(s);
}
