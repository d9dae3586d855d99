// SPDX-License-Identifier: BSD-3-Clause
// A hand for people without a glove, behind the URL "hand:": datagrams on the loopback say where wrist and
// fingers shall be (wire/hand_input.h), drivers/hand_motion.c goes there, and the simulated device (sim.h)
// makes it glove, tracker and status frames. Commands reach the simulated fingers alone, which they hold back
// as they would a person's: no force leaves. Opening reads the way from open to closed; poll and send run in
// the real-time thread, never block and never allocate.
#include <arpa/inet.h>
#include <errno.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "drivers/hand_motion.h"
#include "gloved/drivers.h"

enum { BATCH = 8, MS_NS = 1000000 };
static const int64_t silence_ns = 500000000;    // of the sender: then the switch opens
static const int64_t standstill_ns = 50000000;  // of this process: what was missed is not made up for
static const int64_t patience_ns = 2000000000;  // before the user is told that nobody moves the hand
static const char default_way[] = "data/scripts/hand.user";

typedef struct hand_driver {
  int fd;
  unsigned port;
  gv_sim sim;
  hand_motion motion;
  gv_driver_stats stats;
  // real-time thread
  bool polled, enabled;
  int64_t start_ns;           // the caller's time of the device's zero
  int64_t made_ns;            // device time up to which the hand has moved
  struct sockaddr_in holder;  // who moves the hand
  int64_t heard_ns;           // when the holder was heard last; 0: nobody holds it
  uint16_t number;            // of that datagram
  struct mmsghdr message[BATCH];
  struct iovec part[BATCH];
  struct sockaddr_in source[BATCH];
  uint8_t bytes[BATCH][GV_HAND_INPUT_BYTES + 1];  // one more: what is longer is no datagram of ours
  // for the user
  atomic_bool heard, damaged;
  int64_t opened_ns;
  bool told_nobody, told_damaged;
  gv_sim_script way;  // while opening
} hand_driver;

// ---- datagrams ------------------------------------------------------------------------------------

static bool same(const struct sockaddr_in *a, const struct sockaddr_in *b) {
  return a->sin_port == b->sin_port && a->sin_addr.s_addr == b->sin_addr.s_addr;
}

static bool is_held(const hand_driver *d, int64_t now_ns) {
  return d->heard_ns && now_ns - d->heard_ns < silence_ns;
}

// The sender holds the hand from now on, or goes on holding it; a datagram that was overtaken is none.
static bool accepts(hand_driver *d, const struct sockaddr_in *from, uint16_t number, int64_t now_ns) {
  const bool held = is_held(d, now_ns);
  if (held && !same(from, &d->holder))
    return false;
  if (held && (uint16_t)(number - d->number - 1) >= 0x8000)
    return false;
  d->holder = *from;
  d->heard_ns = now_ns;
  d->number = number;
  return true;
}

static void answer(hand_driver *d, const struct sockaddr_in *to, const gv_hand_input *in, bool other) {
  gv_hand_output out = {.number = in->number, .T_world_wrist = d->motion.T_world_wrist};
  uint8_t bytes[GV_HAND_OUTPUT_BYTES];
  if (d->motion.dead_man)
    out.flags |= GV_HAND_OUTPUT_DEAD_MAN;
  if (d->enabled)
    out.flags |= GV_HAND_OUTPUT_FORCES;
  if (other)
    out.flags |= GV_HAND_OUTPUT_OTHER;
  memcpy(out.grip, d->motion.grip, sizeof out.grip);
  memcpy(out.tension_n, gv_sim_tension(&d->sim), sizeof out.tension_n);
  gv_hand_output_pack(&out, bytes);
  sendto(d->fd, bytes, sizeof bytes, MSG_DONTWAIT | MSG_NOSIGNAL, (const struct sockaddr *)to, sizeof *to);
}

static void take_datagram(hand_driver *d, int i, int64_t now_ns) {
  gv_hand_input in;
  const struct sockaddr_in *from = &d->source[i];
  if (!gv_hand_input_unpack(d->bytes[i], d->message[i].msg_len, &in)) {
    d->stats.bad++;
    atomic_store_explicit(&d->damaged, true, memory_order_relaxed);
    return;
  }
  const bool ask = in.flags & GV_HAND_INPUT_ASK;
  const bool other = is_held(d, now_ns) && !same(from, &d->holder);
  if (!ask && accepts(d, from, in.number, now_ns)) {
    gv_hand_motion_take(&d->motion, &in);
    atomic_store_explicit(&d->heard, true, memory_order_relaxed);
  } else if (!ask) {
    d->stats.foreign++;
  }
  answer(d, from, &in, other);
}

// One system call; a flood waits in the kernel for the next poll.
static void read_datagrams(hand_driver *d, int64_t now_ns) {
  for (int i = 0; i < BATCH; i++)
    d->message[i].msg_hdr.msg_namelen = sizeof d->source[i];
  const int n = recvmmsg(d->fd, d->message, BATCH, MSG_DONTWAIT, NULL);
  for (int i = 0; i < n; i++)
    take_datagram(d, i, now_ns);
  if (!is_held(d, now_ns) && d->heard_ns) {
    gv_hand_motion_leave(&d->motion);
    d->heard_ns = 0;
  }
}

// ---- frames, in the real-time thread --------------------------------------------------------------

static void find_device_time(hand_driver *d, int64_t now_ns) {
  if (!d->polled)
    d->start_ns = now_ns;
  d->polled = true;
  if (now_ns - d->start_ns > d->made_ns + standstill_ns)
    d->start_ns = now_ns - d->made_ns;
}

static int poll_hand(void *self, int64_t now_ns, gv_frame *out, int max) {
  hand_driver *d = self;
  int n = 0;
  find_device_time(d, now_ns);
  read_datagrams(d, now_ns);
  n += gv_sim_advance(&d->sim, d->made_ns, out, max);  // what did not fit the last time
  while (n < max && d->made_ns + MS_NS <= now_ns - d->start_ns) {
    gv_hand_motion_step(&d->motion);
    d->sim.script.keyframe[0] = gv_hand_motion_now(&d->motion);
    d->made_ns += MS_NS;
    n += gv_sim_advance(&d->sim, d->made_ns, out + n, max - n);
  }
  for (int i = 0; i < n; i++)
    out[i].stamp_ns += d->start_ns;
  d->stats.rx += (uint64_t)n;
  return n;
}

static int send_hand(void *self, const gv_frame *frame, int count) {
  hand_driver *d = self;
  gv_command_msg msg;
  for (int i = 0; i < count; i++) {
    gv_sim_receive(&d->sim, &frame[i]);
    if (gv_fcu_unpack_command(&frame[i], &msg) == GV_FCU_OK)
      d->enabled = msg.flags & GV_COMMAND_ENABLE;
  }
  d->stats.tx += (uint64_t)count;
  return 0;
}

static bool hand_ended(void *self) { return (void)self, false; }
static gv_driver_stats hand_stats(void *self) { return ((hand_driver *)self)->stats; }

static void close_hand(void *self) {
  hand_driver *d = self;
  if (d->fd >= 0)
    close(d->fd);
  free(d);
}

static bool tell_hand(void *self, int64_t now_ns, char *out, size_t size) {
  hand_driver *d = self;
  if (!d->opened_ns)
    d->opened_ns = now_ns;
  if (atomic_load_explicit(&d->damaged, memory_order_relaxed) && !d->told_damaged) {
    snprintf(out, size, "hand: datagrams come on port %u that are no input of a hand; see %s", d->port,
             "src/wire/hand_input.h");
    return d->told_damaged = true;
  }
  if (atomic_load_explicit(&d->heard, memory_order_relaxed) || d->told_nobody)
    return false;
  if (now_ns - d->opened_ns < patience_ns)
    return false;
  snprintf(out, size, "hand: nobody moves the hand yet; start gloved-hand --port %u, or open the page",
           d->port);
  return d->told_nobody = true;
}

// ---- opening --------------------------------------------------------------------------------------

// "hand:[WAY][?listen=PORT]" taken apart in place. Null, or what is wrong.
static const char *parse_url(char *text, const char **out_way, unsigned *out_port) {
  char *options = strchr(text, '?');
  char *end = NULL;
  *out_port = GV_HAND_INPUT_PORT;
  if (options) {
    *options++ = '\0';
    if (strncmp(options, "listen=", 7) != 0)
      return "after the ? comes listen=PORT and nothing else";
    const unsigned long port = strtoul(options + 7, &end, 10);
    const bool number = options[7] >= '0' && options[7] <= '9' && !*end;
    if (!number || port < 1 || port > 65535)
      return "listen wants a port, 1 to 65535";
    *out_port = (unsigned)port;
  }
  *out_way = *text ? text : default_way;
  return NULL;
}

static int open_socket(hand_driver *d) {
  const struct sockaddr_in local = {
    .sin_family = AF_INET, .sin_port = htons((uint16_t)d->port), .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
  for (int i = 0; i < BATCH; i++) {
    d->part[i] = (struct iovec){d->bytes[i], sizeof d->bytes[i]};
    d->message[i].msg_hdr.msg_name = &d->source[i];
    d->message[i].msg_hdr.msg_iov = &d->part[i];
    d->message[i].msg_hdr.msg_iovlen = 1;
  }
  d->fd = socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  return d->fd < 0 ? -1 : bind(d->fd, (const struct sockaddr *)&local, sizeof local);
}

static int set_up(hand_driver *d, const char *url, gv_side side, char *err, size_t err_size) {
  char text[512];
  const char *way;
  snprintf(text, sizeof text, "%s", url + 5);
  const char *wrong = strlen(url) - 5 < sizeof text ? parse_url(text, &way, &d->port) : "it is too long";
  if (wrong) {
    snprintf(err, err_size, "--fcu %.80s: %s; write hand: or hand:?listen=PORT", url, wrong);
    return -1;
  }
  if (gv_sim_script_load(way, &d->way, err, err_size))
    return -1;
  if (open_socket(d)) {
    snprintf(err, err_size,
             "--fcu %.80s: cannot listen on port %u (%s); give another with hand:?listen=PORT,"
             " or end the program that holds it",
             url, d->port, strerror(errno));
    return -1;
  }
  gv_hand_motion_init(&d->motion, &d->way);
  d->way.side = side;
  d->way.keyframe_count = 1;
  d->way.end_s = 1e12;  // a person ends it
  gv_sim_init(&d->sim, &d->way, NULL, 0);
  gv_sim_start(&d->sim);
  return 0;
}

int gv_hand_input_open(const char *url, gv_side side, gv_driver *out, char *err, size_t err_size) {
  hand_driver *d = calloc(1, sizeof *d);
  if (!d) {
    snprintf(err, err_size, "hand: no memory for it; close other programs");
    return -1;
  }
  d->fd = -1;
  if (strncmp(url, "hand:", 5) != 0 || set_up(d, url, side, err, err_size)) {
    close_hand(d);
    return -1;
  }
  *out = (gv_driver){.self = d,
                     .poll = poll_hand,
                     .send = send_hand,
                     .ended = hand_ended,
                     .stats = hand_stats,
                     .close = close_hand,
                     .calls = GV_CALLS_SOCKET,
                     .tell = tell_hand};
  return 0;
}
