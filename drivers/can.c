// SPDX-License-Identifier: BSD-3-Clause
// The force control unit on a CAN interface of Linux: one raw, non-blocking socket (the kernel's can.rst).
// Opening resolves the name and allocates; poll and send run in the real-time thread, never block and never
// allocate. What may wait for a lock of the kernel, binding, is done by a thread of the driver's own, the
// keeper: when the interface was down or is gone, it makes a new socket as soon as that is of use, and the
// real-time thread takes it over with one atomic exchange.
//
// What the kernel answers (measured): an interface that goes down gives ENETDOWN once on reading
// and on every write, and works by itself when it is up again; a removed one ENODEV once on
// reading, then ENXIO on writing, for ever; an FD frame on an interface whose MTU became that of
// classic CAN EINVAL; a full queue ENOBUFS.
#include <errno.h>
#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <net/if_arp.h>
#include <pthread.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include "gloved/drivers.h"
#include "gloved/fcu.h"
#include "drivers/stamp.h"

#ifndef CANFD_FDF
#define CANFD_FDF 0x04  // newer kernels mark FD frames with it
#endif

enum {
  BATCH = 32,                // frames in one system call
  POLL_FRAMES = 256,         // read at most in one poll: bounds its time under a flood
  RECEIVE_BUFFER = 1 << 20,  // bytes asked for: some 0.3 s of classic frames on a full bus
  // Bytes that may wait to be sent (the kernel doubles it; a frame takes some 0.8 kB): a bundle fits, and a
  // bus that comes back to life is not flooded with old forces.
  SEND_BUFFER = 16384,
  KEEPER_PAUSE_NS = 50000000
};

// A bound socket and whether it carries CAN FD, in one word for the exchange between the threads.
enum { NO_SOCKET = -1 };
static int socket_word(int fd, bool with_fd) { return fd << 1 | with_fd; }

typedef enum need { NEED_NOTHING, NEED_LOOK, NEED_SOCKET } need;  // LOOK: was down, its MTU may have changed

typedef struct can {
  char iface[IFNAMSIZ];
  int socket;  // the real-time thread's, as socket_word
  gv_driver_stats stats;
  uint32_t overflow;  // frames dropped by this socket so far
  bool down;
  int64_t last_ns;  // stamp of the newest frame
  gv_classic_join join;
  // Frames of one system call.
  struct mmsghdr message[BATCH];
  struct iovec part[BATCH];
  struct canfd_frame bytes[BATCH];
  _Alignas(struct cmsghdr)
      uint8_t control[BATCH][CMSG_SPACE(sizeof(struct timespec)) + CMSG_SPACE(sizeof(uint32_t))];
  int batch_count, batch_next;
  // Between the threads. The keeper fills `spare` when something is needed and `retired` is empty.
  pthread_t keeper;
  _Atomic int needed, spare, retired;
  atomic_bool keeper_in_use, end;
} can;

// ---- sockets: set-up and the keeper ----------------------------------------------------------------

static void allow_ids(struct can_filter *filter, int *count, uint32_t first, int ids) {
  for (int i = 0; i < ids; i++)
    filter[(*count)++] = (struct can_filter){first + (uint32_t)i, CAN_SFF_MASK | CAN_EFF_FLAG | CAN_RTR_FLAG};
}

// Ids of ours alone, error frames, stamps, and the count of dropped frames. Refusals of
// the last three are no error.
static int set_options(int fd, bool with_fd) {
  struct can_filter filter[32];
  const int on = 1;
  const int receive = RECEIVE_BUFFER;
  const int transmit = SEND_BUFFER;
  const can_err_mask_t errors = CAN_ERR_MASK;
  int n = 0;
  allow_ids(filter, &n, GV_ID_FORCE_COMMAND, 2);  // and its classic one
  allow_ids(filter, &n, GV_ID_STATUS, 1 + 3);
  allow_ids(filter, &n, GV_ID_GLOVE, 1 + 6);
  allow_ids(filter, &n, GV_ID_POSE, 1 + 8);
  setsockopt(fd, SOL_SOCKET, SO_RCVBUF, &receive, sizeof receive);
  setsockopt(fd, SOL_SOCKET, SO_SNDBUF, &transmit, sizeof transmit);
  setsockopt(fd, SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof on);
  setsockopt(fd, SOL_SOCKET, SO_RXQ_OVFL, &on, sizeof on);
  setsockopt(fd, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, &errors, sizeof errors);
  if (with_fd && setsockopt(fd, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof on))
    return -1;
  return setsockopt(fd, SOL_CAN_RAW, CAN_RAW_FILTER, filter, (socklen_t)((size_t)n * sizeof *filter));
}

// Asks the kernel one thing about the interface. 0, or negative with errno set.
static int ask_interface(int fd, const char *iface, unsigned long what, struct ifreq *out) {
  memset(out, 0, sizeof *out);
  memcpy(out->ifr_name, iface, strlen(iface) + 1);
  return ioctl(fd, what, out);
}

// A socket bound to the interface, or NO_SOCKET with errno set (ENODEV: no such interface; EPFNOSUPPORT and
// the like: no CAN in this kernel; EMEDIUMTYPE: it is no CAN interface).
static int bind_interface(const char *iface) {
  struct ifreq request;
  int fd = socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW);
  if (fd < 0)
    return NO_SOCKET;
  int error = ask_interface(fd, iface, SIOCGIFHWADDR, &request);
  if (!error && request.ifr_hwaddr.sa_family != ARPHRD_CAN) {
    errno = EMEDIUMTYPE;
    error = -1;
  }
  if (!error)
    error = ask_interface(fd, iface, SIOCGIFMTU, &request);
  const bool with_fd = !error && request.ifr_mtu >= (int)CANFD_MTU;
  if (!error)
    error = set_options(fd, with_fd);
  if (!error)
    error = ask_interface(fd, iface, SIOCGIFINDEX, &request);
  struct sockaddr_can address = {.can_family = AF_CAN, .can_ifindex = request.ifr_ifindex};
  if (!error)
    error = bind(fd, (struct sockaddr *)&address, sizeof address);
  if (!error)
    return socket_word(fd, with_fd);
  const int why = errno;
  close(fd);
  errno = why;
  return NO_SOCKET;
}

// A new socket where it is of use: always for a removed interface, after it was down only with another MTU.
static void keep(can *c) {
  const int retired = atomic_exchange(&c->retired, NO_SOCKET);
  if (retired != NO_SOCKET)
    close(retired >> 1);
  const int needed = atomic_load(&c->needed);
  if (needed == NEED_NOTHING || atomic_load(&c->spare) != NO_SOCKET)
    return;
  const int made = bind_interface(c->iface);
  if (made == NO_SOCKET)
    return;
  struct ifreq request;
  const bool up = ask_interface(made >> 1, c->iface, SIOCGIFFLAGS, &request) == 0 &&
                  request.ifr_flags & IFF_UP;
  if (!up || (needed == NEED_LOOK && (made & 1) == (atomic_load(&c->keeper_in_use) ? 1 : 0))) {
    close(made >> 1);
    if (!up)
      return;
  } else {
    atomic_store(&c->spare, made);
  }
  int seen = needed;  // what was asked for since then stays asked for
  atomic_compare_exchange_strong(&c->needed, &seen, NEED_NOTHING);
}

static void *keeper_thread(void *argument) {
  can *c = argument;
  const struct timespec pause = {0, KEEPER_PAUSE_NS};
  while (!atomic_load(&c->end)) {
    keep(c);
    nanosleep(&pause, NULL);
  }
  return NULL;
}

// ---- the real-time thread --------------------------------------------------------------------------

static void note_down(can *c, need needed) {
  if (!c->down)
    c->stats.link_downs++;
  c->down = true;
  const bool under_way = atomic_load(&c->spare) != NO_SOCKET;
  if (!under_way && atomic_load(&c->needed) < (int)needed)
    atomic_store(&c->needed, (int)needed);
}

// ENETDOWN: it will be back; what a removed or changed interface answers needs a new
// socket; others are passing.
static void note_error(can *c, int error) {
  if (error == ENETDOWN)
    note_down(c, NEED_LOOK);
  if (error == ENODEV || error == ENXIO || error == EINVAL || error == EMSGSIZE)
    note_down(c, NEED_SOCKET);
}

// The keeper's new socket in place of the old one.
static void take_spare(can *c) {
  const int spare = atomic_load(&c->spare);
  if (spare == NO_SOCKET || atomic_load(&c->retired) != NO_SOCKET)
    return;
  atomic_store(&c->retired, c->socket);
  c->socket = spare;
  c->overflow = 0;
  c->batch_count = c->batch_next = 0;
  atomic_store(&c->keeper_in_use, spare & 1);
  atomic_store(&c->spare, NO_SOCKET);
}

static int read_batch(can *c) {
  for (int i = 0; i < BATCH; i++) {
    c->message[i].msg_hdr.msg_controllen = sizeof c->control[i];
    c->message[i].msg_hdr.msg_flags = 0;
  }
  int n = recvmmsg(c->socket >> 1, c->message, BATCH, MSG_DONTWAIT, NULL);
  if (n < 0)
    note_error(c, errno);
  c->batch_next = 0;
  c->batch_count = n > 0 ? n : 0;
  return c->batch_count;
}

static void count_overflow(can *c, struct msghdr *h) {
  for (struct cmsghdr *m = CMSG_FIRSTHDR(h); m; m = CMSG_NXTHDR(h, m)) {
    if (m->cmsg_level != SOL_SOCKET || m->cmsg_type != SO_RXQ_OVFL)
      continue;
    uint32_t dropped;
    memcpy(&dropped, CMSG_DATA(m), sizeof dropped);
    c->stats.lost += dropped - c->overflow;
    c->overflow = dropped;
  }
}

// The frame in the kernel's form; false where it is an error frame (counted) or of no known size.
static bool take_frame(can *c, const struct canfd_frame *f, size_t size, gv_frame *out) {
  if ((size != CAN_MTU && size != CANFD_MTU) || f->len > (size == CAN_MTU ? CAN_MAX_DLEN : CANFD_MAX_DLEN)) {
    c->stats.bad++;
    return false;
  }
  if (f->can_id & CAN_ERR_FLAG) {
    c->stats.bus_errors++;
    return false;
  }
  unsigned flags = f->can_id & CAN_RTR_FLAG ? GV_FRAME_REMOTE : 0u;
  if (size == CANFD_MTU) {  // CANFD_FDF and whatever comes after it is masked out
    flags = GV_FRAME_FD | (f->flags & CANFD_BRS ? GV_FRAME_BRS : 0u) |
            (f->flags & CANFD_ESI ? GV_FRAME_ESI : 0u);
  }
  if (f->can_id & CAN_EFF_FLAG)
    flags |= GV_FRAME_EXTENDED;
  *out = (gv_frame){.id = f->can_id & CAN_EFF_MASK, .flags = (uint8_t)flags, .len = f->len};
  memcpy(out->data, f->data, f->len);
  return true;
}

// The next message of the batch. True where it completes a frame for the caller.
static bool take_message(can *c, int64_t now_ns, gv_frame *out) {
  const int i = c->batch_next++;
  struct msghdr *h = &c->message[i].msg_hdr;
  gv_frame frame;
  c->down = false;
  count_overflow(c, h);
  if (!take_frame(c, &c->bytes[i], c->message[i].msg_len, &frame))
    return false;
  frame.stamp_ns = c->last_ns = gv_receive_stamp(h, c->last_ns, now_ns);
  return gv_classic_take(&c->join, &frame, out) != 0;
}

static int poll_can(void *self, int64_t now_ns, gv_frame *out, int max) {
  can *c = self;
  int n = 0;
  int budget = POLL_FRAMES;
  bool drained = false;
  take_spare(c);
  while (n < max && budget > 0) {
    if (c->batch_next < c->batch_count) {
      budget--;
      if (take_message(c, now_ns, &out[n]))
        n++;
    } else {
      if (drained || read_batch(c) == 0)
        break;
      drained = c->batch_count < BATCH;
    }
  }
  c->stats.rx += (uint64_t)n;
  return n;
}

// One frame to the interface. An FD frame is padded with zeros to a length that FD has.
static bool send_frame(can *c, const gv_frame *frame) {
  const bool fd = (frame->flags & GV_FRAME_FD) != 0;
  struct canfd_frame f = {.can_id = frame->id, .len = fd ? gv_frame_fd_length(frame->len) : frame->len};
  if (frame->len > (fd ? CANFD_MAX_DLEN : CAN_MAX_DLEN))
    return false;
  if (frame->flags & GV_FRAME_EXTENDED)
    f.can_id |= CAN_EFF_FLAG;
  if (frame->flags & GV_FRAME_REMOTE)
    f.can_id |= CAN_RTR_FLAG;
  if (frame->flags & GV_FRAME_BRS)
    f.flags |= CANFD_BRS;
  memcpy(f.data, frame->data, frame->len);
  const size_t size = fd ? CANFD_MTU : CAN_MTU;
  if (send(c->socket >> 1, &f, size, MSG_DONTWAIT | MSG_NOSIGNAL) == (ssize_t)size)
    return true;
  note_error(c, errno);
  return false;
}

// One of our messages on a classic interface; what has no classic form is refused.
static bool send_classic(can *c, const gv_frame *frame) {
  gv_frame part[GV_CLASSIC_FRAMES];
  const int count = gv_classic_split(frame, part);
  bool sent = count > 0;
  for (int i = 0; sent && i < count; i++)
    sent = send_frame(c, &part[i]);
  return sent;
}

static int send_can(void *self, const gv_frame *frame, int count) {
  can *c = self;
  int sent = 0;
  take_spare(c);
  const bool cut = !(c->socket & 1);
  while (sent < count && (cut && frame[sent].flags & GV_FRAME_FD ? send_classic(c, &frame[sent])
                                                                 : send_frame(c, &frame[sent])))
    sent++;
  c->stats.tx += (uint64_t)sent;
  c->stats.tx_failed += (uint64_t)(count - sent);
  if (sent > 0)
    c->down = false;
  return sent == count ? 0 : -1;
}

static bool can_ended(void *self) {
  (void)self;
  return false;
}
static int can_descriptor(void *self) { return ((can *)self)->socket >> 1; }
static gv_driver_stats can_stats(void *self) { return ((can *)self)->stats; }

static void close_can(void *self) {
  can *c = self;
  atomic_store(&c->end, true);
  pthread_join(c->keeper, NULL);
  const int spare = atomic_load(&c->spare);
  const int retired = atomic_load(&c->retired);
  if (spare != NO_SOCKET)
    close(spare >> 1);
  if (retired != NO_SOCKET)
    close(retired >> 1);
  close(c->socket >> 1);
  free(c);
}

// ---- opening ------------------------------------------------------------------------------------------

static void say_why(const char *url, const char *iface, int error, char *err, size_t err_size) {
  if (error == ENODEV)
    snprintf(err, err_size,
             "%s: there is no interface %s; see `ip link`, or make one: ip link add dev %s type vcan", url,
             iface, iface);
  else if (error == EMEDIUMTYPE)
    snprintf(err, err_size,
             "%s: %s is no CAN interface; name one of `ip link show type can` or `... type vcan`", url,
             iface);
  else if (error == EAFNOSUPPORT || error == EPROTONOSUPPORT)
    snprintf(err, err_size,
             "%s: this kernel has no CAN; load it (modprobe can-raw), or use udp:// and cannelloni", url);
  else
    snprintf(err, err_size, "%s: %s cannot be used (%s); see `ip -details link show %s`", url, iface,
             strerror(error), iface);
}

// The keeper takes no signal: those belong to the main thread.
static int start_keeper(can *c) {
  sigset_t all, before;
  sigfillset(&all);
  pthread_sigmask(SIG_SETMASK, &all, &before);
  const int error = pthread_create(&c->keeper, NULL, keeper_thread, c);
  pthread_sigmask(SIG_SETMASK, &before, NULL);
  return error;
}

static can *make_can(const char *iface, int socket) {
  can *c = calloc(1, sizeof *c);
  if (!c)
    return NULL;
  memcpy(c->iface, iface, strlen(iface) + 1);
  c->socket = socket;
  atomic_init(&c->needed, NEED_NOTHING);
  atomic_init(&c->spare, NO_SOCKET);
  atomic_init(&c->retired, NO_SOCKET);
  atomic_init(&c->keeper_in_use, socket & 1);
  atomic_init(&c->end, false);
  for (int i = 0; i < BATCH; i++) {
    c->part[i] = (struct iovec){&c->bytes[i], sizeof c->bytes[i]};
    c->message[i].msg_hdr = (struct msghdr){
      .msg_iov = &c->part[i], .msg_iovlen = 1, .msg_control = c->control[i]};
  }
  return c;
}

int gv_can_open(const char *url, gv_driver *out, char *err, size_t err_size) {
  const char *iface = url + 4;
  if (strncmp(url, "can:", 4) != 0 || *iface == 0 || strlen(iface) >= IFNAMSIZ || strpbrk(iface, "/?& ")) {
    snprintf(err, err_size, "%s: no interface is named; write can:IFACE, as `ip link` shows it", url);
    return -1;
  }
  const int socket = bind_interface(iface);
  if (socket == NO_SOCKET) {
    say_why(url, iface, errno, err, err_size);
    return -1;
  }
  can *c = make_can(iface, socket);
  if (!c || start_keeper(c)) {
    snprintf(err, err_size, "%s: out of memory or threads; close other programs", url);
    free(c);
    close(socket >> 1);
    return -1;
  }
  err[0] = 0;
  if (!(socket & 1))
    snprintf(err, err_size,
             "%s: %s is classic CAN: a command takes 1 frame, a glove sample 6, a pose 8, a status 3, and at "
             "1 Mbit/s "
             "about 8 fit a millisecond (1 kHz of forces with a glove at 150 Hz and a tracker at 60 Hz; "
             "faster ones need CAN FD)",
             url, iface);
  *out = (gv_driver){.self = c,
                     .poll = poll_can,
                     .send = send_can,
                     .ended = can_ended,
                     .stats = can_stats,
                     .close = close_can,
                     .descriptor = can_descriptor,
                     .calls = GV_CALLS_SOCKET};
  return 0;
}
