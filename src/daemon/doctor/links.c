// SPDX-License-Identifier: BSD-3-Clause
// The doctor on what gloved is connected to: CAN interface, LCM's multicast group, socket buffers, serial
// lines. can.rst of the kernel, route(8), LCM's "UDP multicast setup".
#include <arpa/inet.h>
#include <net/if.h>
#include <stdlib.h>
#include <string.h>

#include "daemon/doctor/tree.h"

enum { MTU_CLASSIC = 16, MTU_FD = 72, QUEUE_LEAST = 5, QUEUE_MOST = 100 };

// ---- CAN -------------------------------------------------------------------------------------------------

static void judge_can(const gv_doctor *doctor, const char *iface, gv_finding *out) {
  long mtu = 0;
  long flags = 0;
  long queue = QUEUE_LEAST;
  char state[32];
  const bool there = gv_tree_number(doctor, &mtu, "/sys/class/net/%s/mtu", iface);
  gv_tree_number(doctor, &flags, "/sys/class/net/%s/flags", iface);
  gv_tree_number(doctor, &queue, "/sys/class/net/%s/tx_queue_len", iface);
  gv_tree_read(doctor, state, sizeof state, "/sys/class/net/%s/operstate", iface);
  if (!there) {
    gv_doctor_finds(out, GV_VERDICT_FAIL, "%s: no such interface", iface);
    gv_doctor_mends(
        out, "sudo modprobe can-dev, and see ip link (to try things: sudo ip link add dev %s type vcan)",
        iface);
  } else if (!(flags & IFF_UP) || strcmp(state, "down") == 0) {
    gv_doctor_finds(out, GV_VERDICT_FAIL, "%s is down (%s)", iface, *state ? state : "no state");
    gv_doctor_mends(
        out, "sudo ip link set %s up type can bitrate 1000000 dbitrate 5000000 fd on restart-ms 100", iface);
  } else if (mtu < MTU_FD) {
    gv_doctor_finds(out, GV_VERDICT_WARN, "%s carries classic CAN (mtu %ld): some 150 samples a second",
                    iface, mtu);
    gv_doctor_mends(
        out,
        "sudo ip link set %s down; sudo ip link set %s up type can bitrate 1000000 dbitrate 5000000 fd on",
        iface, iface);
  } else if (queue < QUEUE_LEAST || queue > QUEUE_MOST) {
    gv_doctor_finds(out, GV_VERDICT_WARN, "%s has a queue of %ld frames: %s", iface, queue,
                    queue < QUEUE_LEAST ? "a bundle does not fit" : "old forces wait in it");
    gv_doctor_mends(out, "sudo ip link set %s txqueuelen 10", iface);
  } else {
    gv_doctor_finds(out, GV_VERDICT_PASS, "%s: CAN FD (mtu %ld), queue %ld, %s", iface, mtu, queue, state);
  }
}

// Of two hands' interfaces the worse one.
void gv_examine_can(const gv_doctor *doctor, gv_finding *out) {
  char iface[IFNAMSIZ], iface2[IFNAMSIZ];
  const bool first = sscanf(doctor->settings->fcu, "can:%15s", iface) == 1;
  const bool second = sscanf(doctor->settings->fcu2, "can:%15s", iface2) == 1;
  gv_finding other = *out;
  if (first)
    judge_can(doctor, iface, out);
  if (second)
    judge_can(doctor, iface2, &other);
  if (second && (!first || other.verdict > out->verdict))
    *out = other;
  if (first || second)
    return;
  gv_doctor_finds(out, GV_VERDICT_PASS, "not used (--fcu can:IFACE)");
}

// ---- LCM -------------------------------------------------------------------------------------------------

// The interface of the most specific route of /proc/net/route that leads to the group. False: there is none.
static bool find_route(const gv_doctor *doctor, uint32_t group, char out_iface[IFNAMSIZ]) {
  char table[TREE_TEXT];
  unsigned long best_mask = 0;
  bool found = false;
  gv_tree_read(doctor, table, sizeof table, "/proc/net/route");
  for (const char *line = strchr(table, '\n'); line; line = strchr(line + 1, '\n')) {
    char iface[IFNAMSIZ];
    unsigned long destination, mask;
    unsigned flags;
    // Numbers are in hexadecimal, addresses as the wire has them, read as a number of this machine.
    if (sscanf(line + 1, "%15s %lx %*s %x %*s %*s %*s %lx", iface, &destination, &flags, &mask) != 4)
      continue;
    if (!(flags & 1) || (group & mask) != destination ||
        (found && ntohl((uint32_t)mask) <= ntohl((uint32_t)best_mask)))
      continue;
    found = true;
    best_mask = mask;
    memcpy(out_iface, iface, sizeof iface);
  }
  return found;
}

void gv_examine_lcm(const gv_doctor *doctor, gv_finding *out) {
  char host[64] = "239.255.76.67", iface[IFNAMSIZ];
  struct in_addr group;
  long flags = 0;
  if (strncmp(doctor->settings->lcm, "udpm:", 5) != 0) {
    gv_doctor_finds(out, GV_VERDICT_PASS, "no multicast (%.40s)", doctor->settings->lcm);
    return;
  }
  sscanf(doctor->settings->lcm, "udpm://%63[0-9.]", host);
  if (inet_aton(host, &group) == 0 || !find_route(doctor, group.s_addr, iface)) {
    gv_doctor_finds(out, GV_VERDICT_FAIL, "no route to %s: gloved publishes nothing", host);
    gv_doctor_mends(out, "sudo ip link set lo up multicast on; sudo ip route add 224.0.0.0/4 dev lo");
    return;
  }
  gv_tree_number(doctor, &flags, "/sys/class/net/%s/flags", iface);
  const bool multicast = (flags & IFF_MULTICAST) != 0;
  gv_doctor_finds(out, multicast ? GV_VERDICT_PASS : GV_VERDICT_WARN, "%s goes out by %s%s", host, iface,
                  multicast ? "" : ", which is not marked for multicast");
  gv_doctor_mends(out, "sudo ip link set %s multicast on", iface);
}

void gv_examine_buffers(const gv_doctor *doctor, gv_finding *out) {
  enum { WANTED = 1 << 20, LEAST = 200000 };
  long most = 0;
  gv_tree_number(doctor, &most, "/proc/sys/net/core/rmem_max");
  if (most >= WANTED)
    gv_doctor_finds(out, GV_VERDICT_PASS, "a socket may hold %ld kB", most / 1000);
  else if (most >= LEAST)
    gv_doctor_finds(out, GV_VERDICT_WARN,
                    "a socket may hold %ld kB: a stall of 0.3 s loses frames, large LCM messages arrive torn",
                    most / 1000);
  else
    gv_doctor_finds(out, GV_VERDICT_FAIL, "a socket may hold %ld kB: a short stall loses frames",
                    most / 1000);
  gv_doctor_mends(out, "sudo sysctl -w net.core.rmem_max=2097152 net.core.rmem_default=2097152");
}

// ---- serial lines ----------------------------------------------------------------------------------------

typedef struct timers {
  int lines;
  long slowest_ms;
  char name[32];
} timers;

static void look_at_line(const gv_doctor *doctor, const char *name, void *user) {
  timers *t = user;
  long ms = 0;
  if (!gv_tree_number(doctor, &ms, "/sys/bus/usb-serial/devices/%s/latency_timer", name))
    return;
  t->lines++;
  if (ms <= t->slowest_ms)
    return;
  t->slowest_ms = ms;
  snprintf(t->name, sizeof t->name, "%s", name);
}

// A converter holds bytes back until its timer is over: at 16 ms, the default of many, a glove of 1 kHz is a
// glove of 60 Hz. gloved asks for 1 ms when it opens the line, which not every driver heeds.
void gv_examine_serial(const gv_doctor *doctor, gv_finding *out) {
  timers t = {0};
  gv_tree_each(doctor, "/sys/bus/usb-serial/devices", "ttyUSB", look_at_line, &t);
  const bool used = t.lines &&
                    (strstr(doctor->settings->fcu, t.name) || strstr(doctor->settings->tracker, t.name) ||
                     strstr(doctor->settings->fcu2, t.name) || strstr(doctor->settings->tracker2, t.name));
  if (t.lines == 0)
    gv_doctor_finds(out, GV_VERDICT_PASS, "no converter with a latency timer");
  else if (t.slowest_ms <= 1)
    gv_doctor_finds(out, GV_VERDICT_PASS, "%d lines, latency timers at 1 ms", t.lines);
  else
    gv_doctor_finds(out, used && t.slowest_ms >= 16 ? GV_VERDICT_FAIL : GV_VERDICT_WARN,
                    "%s holds bytes back for %ld ms", t.name, t.slowest_ms);
  gv_doctor_mends(out, "echo 1 | sudo tee /sys/bus/usb-serial/devices/%s/latency_timer", t.name);
}
