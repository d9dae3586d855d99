// SPDX-License-Identifier: BSD-3-Clause
// The simulated servos of a DOGlove (doglove_sim.h). Pure.
#include "drivers/doglove_sim.h"

#include <string.h>

enum {
  WATCHDOG_STOPPED = 255,
  GOALS_FROM = 100,
  GOALS_TO = 120,
  FIRST_KEPT = 0,
  LAST_KEPT = 63,
  ACCESS_ERROR = 7,
  RANGE_ERROR = 4
};
static const int64_t watchdog_unit_ns = 20000000;

void gv_doglove_sim_init(doglove_sim *d) {
  memset(d, 0, sizeof *d);
  for (int f = 0; f < GV_FINGERS; f++) {
    d->table[f][GV_DYNAMIXEL_RETURN_DELAY] = 250;
    d->table[f][GV_DYNAMIXEL_MODE] = 3;
    d->table[f][GV_DYNAMIXEL_STATUS_LEVEL] = 2;
  }
}

static void put(uint8_t *table, int address, int size, uint32_t value) {
  for (int i = 0; i < size; i++)
    table[address + i] = (uint8_t)(value >> (8 * i));
}

static bool stopped(const uint8_t *table) { return table[GV_DYNAMIXEL_WATCHDOG] == WATCHDOG_STOPPED; }

// The error byte of the answer; what is refused changes nothing.
static uint8_t write_table(doglove_sim *d, int id, int address, const uint8_t *value, int count) {
  uint8_t *table = d->table[id];
  const bool goal = address >= GOALS_FROM && address < GOALS_TO;
  const bool kept = address >= FIRST_KEPT && address <= LAST_KEPT;
  uint8_t error = 0;
  if (address + count > DOGLOVE_SIM_TABLE || (kept && table[GV_DYNAMIXEL_TORQUE]))
    error = ACCESS_ERROR;
  else if (goal && stopped(table))
    error = RANGE_ERROR;
  else
    memcpy(table + address, value, (size_t)count);
  d->refused += error != 0;
  return error;
}

static int answer(int id, uint8_t error, const uint8_t *value, int count, uint8_t *out) {
  gv_dynamixel_packet p = {
    .id = (uint8_t)id, .instruction = GV_DYNAMIXEL_STATUS, .error = error, .count = count};
  memcpy(p.parameter, value, (size_t)count);
  return gv_dynamixel_encode(&p, out);
}

static int read_table(const doglove_sim *d, int id, int address, int count, uint8_t *out) {
  if (count > GV_DYNAMIXEL_PARAMETERS || address + count > DOGLOVE_SIM_TABLE)
    return answer(id, ACCESS_ERROR, d->table[id], 0, out);
  return answer(id, 0, d->table[id] + address, count, out);
}

static int run_sync(doglove_sim *d, const gv_dynamixel_packet *p, uint8_t *out) {
  const int address = (int)gv_dynamixel_value(p->parameter, 2);
  const int size = (int)gv_dynamixel_value(p->parameter + 2, 2);
  const bool write = p->instruction == GV_DYNAMIXEL_SYNC_WRITE;
  int n = 0;
  for (int at = 4; at + 1 + (write ? size : 0) <= p->count; at += 1 + (write ? size : 0)) {
    const int id = p->parameter[at];
    if (id >= GV_FINGERS)
      continue;
    if (write)
      write_table(d, id, address, p->parameter + at + 1, size);
    else
      n += read_table(d, id, address, size, out + n);
  }
  return n;
}

static int run_packet(doglove_sim *d, const gv_dynamixel_packet *p, uint8_t *out) {
  const int address = p->count >= 2 ? (int)gv_dynamixel_value(p->parameter, 2) : 0;
  if (p->count >= 4 &&
      (p->instruction == GV_DYNAMIXEL_SYNC_READ || p->instruction == GV_DYNAMIXEL_SYNC_WRITE))
    return run_sync(d, p, out);
  if (p->id >= GV_FINGERS || p->count < 3)
    return 0;
  const int level = d->table[p->id][GV_DYNAMIXEL_STATUS_LEVEL];
  if (p->instruction == GV_DYNAMIXEL_READ && level >= 1)
    return read_table(d, p->id, address, (int)gv_dynamixel_value(p->parameter + 2, p->count - 2), out);
  if (p->instruction != GV_DYNAMIXEL_WRITE)
    return 0;
  const uint8_t error = write_table(d, p->id, address, p->parameter + 2, p->count - 2);
  return level >= 2 ? answer(p->id, error, p->parameter, 0, out) : 0;
}

int gv_doglove_sim_receive(doglove_sim *d, uint8_t byte, int64_t now_ns, uint8_t out[DOGLOVE_SIM_ANSWER]) {
  gv_dynamixel_packet p;
  const int length = gv_framer_push(&d->line, byte, gv_dynamixel_scan, NULL);
  if (length == 0)
    return 0;
  gv_dynamixel_decode(d->line.byte, length, &p);
  d->heard_ns = now_ns;
  d->packets++;
  const int n = run_packet(d, &p, out);
  for (int f = 0; f < GV_FINGERS; f++) {
    const int now_ma = gv_doglove_sim_current(d, f);
    if (now_ma > d->current_max_ma[f])
      d->current_max_ma[f] = now_ma;
  }
  return n;
}

void gv_doglove_sim_advance(doglove_sim *d, const double servo_deg[GV_FINGERS], int64_t now_ns) {
  for (int f = 0; f < GV_FINGERS; f++) {
    uint8_t *table = d->table[f];
    const int patience = table[GV_DYNAMIXEL_WATCHDOG];
    put(table, GV_DYNAMIXEL_POSITION, 4, (uint32_t)(servo_deg[f] / 360.0 * GV_DYNAMIXEL_TURN + 0.5));
    if (!table[GV_DYNAMIXEL_TORQUE] || patience == 0 || patience == WATCHDOG_STOPPED)
      continue;
    if (now_ns - d->heard_ns <= patience * watchdog_unit_ns)
      continue;
    table[GV_DYNAMIXEL_WATCHDOG] = WATCHDOG_STOPPED;
    d->trips++;
  }
}

int gv_doglove_sim_current(const doglove_sim *d, int finger) {
  const uint8_t *table = d->table[finger];
  const bool on = table[GV_DYNAMIXEL_TORQUE] &&
                  table[GV_DYNAMIXEL_MODE] == GV_DYNAMIXEL_MODE_CURRENT_POSITION;
  const uint32_t goal = gv_dynamixel_value(table + GV_DYNAMIXEL_GOAL_POSITION, 4);
  if (!on || stopped(table) || goal >= gv_dynamixel_value(table + GV_DYNAMIXEL_POSITION, 4))
    return 0;
  return (int)gv_dynamixel_value(table + GV_DYNAMIXEL_GOAL_CURRENT, 2);
}
