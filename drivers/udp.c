// SPDX-License-Identifier: BSD-3-Clause
// The force control unit over UDP: cannelloni v2 datagrams on one non-blocking socket. Opening resolves names
// and allocates; poll and send run in the real-time thread, never block and never allocate. Two sockets share
// the port. One is connected to the peer, so that the kernel keeps everybody else's datagrams out of its
// buffer: a flood of 160,000 a second starves nobody. The other gets those, a few in each poll, to be counted
// and told (and the peer's own where it answers to another address of this machine than the kernel expects).
#include <arpa/inet.h>
#include <errno.h>
#include <netdb.h>
#include <netinet/in.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "gloved/drivers.h"
#include "gloved/fcu.h"
#include "drivers/stamp.h"

enum {
  BATCH = 16,                  // datagrams in one system call
  POLL_DATAGRAMS = 64,         // read at most in one poll: bounds its time under a flood
  STRANGERS = 4,               // of them from the other socket
  STRANGERS_BUFFER = 1 << 14,  // bytes: what does not fit is lost
  RECEIVE_BUFFER = 1 << 20,    // bytes asked for: over a second of 1 kHz frames; the kernel may give less
  SEQ_BEHIND = 128,            // a step of 128 and more is taken as one backwards
  RESTART_GAP = 16             // sequence 0 after a larger gap: the peer started anew
};
// at 1 kHz the sequence wraps in 256 ms: a longer gap says nothing
static const int64_t silence_ns = 250000000;

typedef union address {
  struct sockaddr any;
  struct sockaddr_in v4;
  struct sockaddr_in6 v6;
  struct sockaddr_storage room;
} address;

typedef struct udp {
  int fd;         // connected to the peer
  int strangers;  // the same port, for everybody else; -1: none
  address peer;
  socklen_t peer_size;
  gv_driver_stats stats;
  uint8_t send_seq, next_seq;  // next_seq: expected from the peer
  bool heard;
  int64_t last_ns;  // stamp of the newest datagram of the peer
  // For the user, between the threads: bits of what went wrong, and from where foreign datagrams come (IPv4
  // address and port; 0: IPv6). What was told is the asking thread's.
  atomic_uint trouble;
  _Atomic uint64_t foreign_from;
  unsigned told;
  // Frames of one datagram that the caller had no room for yet.
  gv_frame pending[GV_CANNELLONI_TAKEN_FRAMES];
  int pending_count, pending_next;
  gv_classic_join join;
  bool classic;  // the peer speaks classic CAN
  // Datagrams of one system call.
  struct mmsghdr message[BATCH];
  struct iovec part[BATCH];
  address source[BATCH];
  uint8_t bytes[BATCH][GV_CANNELLONI_TAKEN_BYTES];
  _Alignas(struct cmsghdr) uint8_t control[BATCH][CMSG_SPACE(sizeof(struct timespec))];
  int batch_count, batch_next;
  uint8_t out[GV_CANNELLONI_MAX_BYTES];
  gv_frame split[GV_CANNELLONI_MAX_FRAMES];
} udp;

enum { TROUBLE_FOREIGN = 1, TROUBLE_BAD = 2, TROUBLE_LARGE = 4 };

static void note_trouble(udp *u, unsigned bit) {
  atomic_fetch_or_explicit(&u->trouble, bit, memory_order_relaxed);
}

static void note_foreign(udp *u, const address *from) {
  const uint64_t v4 = (uint64_t)ntohl(from->v4.sin_addr.s_addr) << 16 | ntohs(from->v4.sin_port);
  u->stats.foreign++;
  atomic_store_explicit(&u->foreign_from, from->any.sa_family == AF_INET ? v4 : 0, memory_order_relaxed);
  note_trouble(u, TROUBLE_FOREIGN);
}

static bool same_address(const address *a, const address *b) {
  if (a->any.sa_family != b->any.sa_family)
    return false;
  if (a->any.sa_family == AF_INET)
    return a->v4.sin_port == b->v4.sin_port && a->v4.sin_addr.s_addr == b->v4.sin_addr.s_addr;
  return a->v6.sin6_port == b->v6.sin6_port &&
         memcmp(&a->v6.sin6_addr, &b->v6.sin6_addr, sizeof a->v6.sin6_addr) == 0;
}

// Fill the batch from a socket. Returns the datagrams read. A peer that was not up when something was sent
// to it leaves an error behind (ICMP), which is taken here and says nothing.
static int read_batch(udp *u, int fd, unsigned most) {
  u->batch_next = 0;
  u->batch_count = 0;
  if (fd < 0)
    return 0;
  for (int i = 0; i < BATCH; i++) {
    struct msghdr *h = &u->message[i].msg_hdr;
    h->msg_namelen = sizeof u->source[i];
    h->msg_controllen = sizeof u->control[i];
    h->msg_flags = 0;
  }
  int n = recvmmsg(fd, u->message, most, MSG_DONTWAIT, NULL);
  if (n < 0 && errno == ECONNREFUSED)
    n = recvmmsg(fd, u->message, most, MSG_DONTWAIT, NULL);
  u->batch_count = n > 0 ? n : 0;
  return u->batch_count;
}

static void count_lost(udp *u, uint8_t seq, int64_t stamp_ns) {
  uint8_t gap = (uint8_t)(seq - u->next_seq);
  bool anew = !u->heard || stamp_ns - u->last_ns > silence_ns || (seq == 0 && gap > RESTART_GAP);
  if (!anew && gap < SEQ_BEHIND)
    u->stats.lost += gap;
  // A datagram a little behind was doubled or swapped: the count goes on where it was.
  if (anew || gap < 256 - RESTART_GAP)
    u->next_seq = (uint8_t)(seq + 1);
  u->heard = true;
  u->last_ns = stamp_ns;
}

// Decode the next datagram of the batch into `pending`.
static void take_datagram(udp *u, int64_t now_ns) {
  int i = u->batch_next++;
  uint8_t seq;
  if (!same_address(&u->source[i], &u->peer)) {
    note_foreign(u, &u->source[i]);
    return;
  }
  bool whole = !(u->message[i].msg_hdr.msg_flags & MSG_TRUNC);
  size_t size = whole ? u->message[i].msg_len : 0;
  int count = gv_cannelloni_unpack(u->bytes[i], size, &seq, u->pending, GV_CANNELLONI_TAKEN_FRAMES);
  if (count < 0) {
    u->stats.bad++;
    note_trouble(u, whole ? TROUBLE_BAD : TROUBLE_LARGE);
    return;
  }
  int64_t stamp = gv_receive_stamp(&u->message[i].msg_hdr, u->last_ns, now_ns);
  count_lost(u, seq, stamp);
  for (int k = 0; k < count; k++)
    u->pending[k].stamp_ns = stamp;
  u->pending_next = 0;
  u->pending_count = count;
}

// The next frame of the datagram. True where it is, or completes, one for the caller.
static bool take_frame(udp *u, gv_frame *out) {
  const gv_frame *frame = &u->pending[u->pending_next++];
  if (gv_classic_is_part(frame))
    u->classic = true;
  else if (frame->flags & GV_FRAME_FD)
    u->classic = false;
  return gv_classic_take(&u->join, frame, out) != 0;
}

static int poll_udp(void *self, int64_t now_ns, gv_frame *out, int max) {
  udp *u = self;
  int n = 0;
  int budget = POLL_DATAGRAMS;
  bool drained = false;
  bool asked = false;
  while (n < max) {
    if (u->pending_next < u->pending_count) {
      n += take_frame(u, &out[n]) ? 1 : 0;
    } else if (u->batch_next < u->batch_count) {
      if (budget-- == 0)
        break;
      take_datagram(u, now_ns);
    } else {
      if (drained && asked)
        break;
      asked = drained;
      drained = read_batch(u, asked ? u->strangers : u->fd, asked ? STRANGERS : BATCH) < BATCH;
    }
  }
  u->stats.rx += (uint64_t)n;
  return n;
}

// The frames as the peer's bus can carry them; returns their count, -1 where one has no classic form.
static int split_frames(const gv_frame *frame, int count, gv_frame out[GV_CANNELLONI_MAX_FRAMES]) {
  int n = 0;
  for (int i = 0; i < count; i++) {
    if (n + GV_CLASSIC_FRAMES > GV_CANNELLONI_MAX_FRAMES)
      return -1;
    const bool fd = frame[i].flags & GV_FRAME_FD;
    const int parts = fd ? gv_classic_split(&frame[i], &out[n]) : 1;
    if (!fd)
      out[n] = frame[i];
    if (parts == 0)
      return -1;
    n += parts;
  }
  return n;
}

static int pack(udp *u, const gv_frame *frame, int count) {
  if (u->classic) {
    count = split_frames(frame, count, u->split);
    frame = u->split;
  }
  return gv_cannelloni_pack(u->send_seq, frame, count, u->out, sizeof u->out);
}

// The error of an earlier datagram that the peer refused (ICMP) would keep this one back: again, once.
static bool send_whole(udp *u, size_t bytes) {
  ssize_t sent = send(u->fd, u->out, bytes, MSG_DONTWAIT | MSG_NOSIGNAL);
  if (sent < 0 && errno == ECONNREFUSED)
    sent = send(u->fd, u->out, bytes, MSG_DONTWAIT | MSG_NOSIGNAL);
  return sent == (ssize_t)bytes;
}

static int send_udp(void *self, const gv_frame *frame, int count) {
  udp *u = self;
  if (count <= 0)
    return 0;
  const int bytes = pack(u, frame, count);
  bool sent = bytes > 0;
  if (sent)
    sent = send_whole(u, (size_t)bytes);
  u->send_seq++;  // also where it failed: the peer then sees what it missed
  if (sent)
    u->stats.tx += (uint64_t)count;
  else
    u->stats.tx_failed += (uint64_t)count;
  return sent ? 0 : -1;
}

static bool udp_ended(void *self) {
  (void)self;
  return false;
}
static int udp_descriptor(void *self) { return ((udp *)self)->fd; }
static gv_driver_stats udp_stats(void *self) { return ((udp *)self)->stats; }
static void tell_foreign(udp *u, char *out, size_t size) {
  const uint64_t from = atomic_load_explicit(&u->foreign_from, memory_order_relaxed);
  const struct in_addr host = {.s_addr = htonl((uint32_t)(from >> 16))};
  char name[INET6_ADDRSTRLEN + 8] = "another address";
  if (from && inet_ntop(AF_INET, &host, name, INET6_ADDRSTRLEN))
    snprintf(name + strlen(name), sizeof name - strlen(name), ":%d", (int)(from & 65535));
  snprintf(out, size,
           "udp: datagrams come from %s, which is not the HOST:PORT given, and are not used; "
           "give that one, or start its cannelloni with -l PORT",
           name);
}

// Each kind of trouble once.
static bool tell_udp(void *self, int64_t now_ns, char *out, size_t size) {
  udp *u = self;
  (void)now_ns;
  const unsigned news = atomic_load_explicit(&u->trouble, memory_order_relaxed) & ~u->told;
  const unsigned bit = news & (~news + 1);
  u->told |= bit;
  switch (bit) {
    case TROUBLE_FOREIGN: tell_foreign(u, out, size); return true;
    case TROUBLE_BAD:
      snprintf(
          out, size,
          "udp: datagrams come that are no cannelloni version 2 (UDP); start that version, without -S or -C");
      return true;
    case TROUBLE_LARGE:
      snprintf(
          out, size,
          "udp: datagrams of more than %d bytes come and are not used; start cannelloni with -m 9000 or less",
          (int)GV_CANNELLONI_TAKEN_BYTES);
      return true;
    default: return false;
  }
}

static void close_udp(void *self) {
  udp *u = self;
  if (u->fd >= 0)
    close(u->fd);
  if (u->strangers >= 0)
    close(u->strangers);
  free(u);
}

typedef struct udp_url {
  char host[256], port[6], listen[6];
} udp_url;

// A decimal port 1..65535 up to one of the characters in `end`; null where it is none.
static const char *read_port(const char *p, const char *end, char out[6]) {
  size_t n = strspn(p, "0123456789");
  if (n == 0 || n > 5 || !strchr(end, p[n]))
    return NULL;
  memcpy(out, p, n);
  out[n] = 0;
  long port = strtol(out, NULL, 10);
  return port >= 1 && port <= 65535 ? p + n : NULL;
}

// Null, or what is wrong.
static const char *parse_url(const char *url, udp_url *out) {
  if (strncmp(url, "udp://", 6) != 0)
    return "it must open with udp://";
  const char *p = url + 6;
  const char *host = p;
  size_t n;
  if (*p == '[') {
    host++;
    n = strcspn(host, "]");
    p = host + n + (host[n] == ']');
  } else {
    n = strcspn(p, ":?/");
    p += n;
  }
  if (n == 0 || n >= sizeof out->host)
    return "the host is missing or too long";
  memcpy(out->host, host, n);
  out->host[n] = 0;
  if (*p != ':' || !(p = read_port(p + 1, "?", out->port)))
    return "after the host comes :PORT, 1 to 65535";
  if (strncmp(p, "?listen=", 8) != 0 || !read_port(p + 8, "", out->listen))
    return "it ends with ?listen=PORT, 1 to 65535, and nothing else";
  return NULL;
}

static bool is_loopback(const address *a) {
  if (a->any.sa_family == AF_INET)
    return ntohl(a->v4.sin_addr.s_addr) >> 24 == 127;
  return IN6_IS_ADDR_LOOPBACK(&a->v6.sin6_addr);
}

// Resolve the peer, by IPv4 where it has both (so that "localhost" means the same on both ends).
// Returns 0 or getaddrinfo's error.
static int resolve_peer(udp *u, const udp_url *url) {
  struct addrinfo hints = {.ai_family = AF_INET, .ai_socktype = SOCK_DGRAM, .ai_flags = AI_NUMERICSERV},
                  *found;
  int code = getaddrinfo(url->host, url->port, &hints, &found);
  if (code) {
    hints.ai_family = AF_INET6;
    code = getaddrinfo(url->host, url->port, &hints, &found);
  }
  if (code)
    return code;
  memcpy(&u->peer, found->ai_addr, found->ai_addrlen);
  u->peer_size = found->ai_addrlen;
  freeaddrinfo(found);
  return 0;
}

// Bind to the listening port: on the loopback alone for a peer there, on every address otherwise.
static int bind_socket(const udp *u, int fd, const char *listen_port) {
  uint16_t port = htons((uint16_t)strtol(listen_port, NULL, 10));
  address local;
  memset(&local, 0, sizeof local);
  local.any.sa_family = u->peer.any.sa_family;
  if (local.any.sa_family == AF_INET) {
    local.v4.sin_port = port;
    local.v4.sin_addr.s_addr = htonl(is_loopback(&u->peer) ? INADDR_LOOPBACK : INADDR_ANY);
  } else {
    local.v6.sin6_port = port;
    local.v6.sin6_addr = is_loopback(&u->peer) ? in6addr_loopback : in6addr_any;
  }
  return bind(fd, &local.any, u->peer_size);
}

// The same port again, for everybody but the peer. Only while it is bound do both sockets share
// it, so that a second daemon is still refused. Without this socket foreign datagrams are
// dropped by the kernel without a word.
static void open_strangers(udp *u, const char *listen_port) {
  const int on = 1;
  const int off = 0;
  const int room = STRANGERS_BUFFER;
  const int fd = socket(u->peer.any.sa_family, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (fd < 0)
    return;
  setsockopt(u->fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
  setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
  setsockopt(fd, SOL_SOCKET, SO_RCVBUF, &room, sizeof room);
  setsockopt(fd, SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof on);
  const bool bound = bind_socket(u, fd, listen_port) == 0;
  setsockopt(u->fd, SOL_SOCKET, SO_REUSEADDR, &off, sizeof off);
  setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &off, sizeof off);
  if (bound)
    u->strangers = fd;
  else
    close(fd);
}

static int open_socket(udp *u, const char *listen_port) {
  const int on = 1;
  const int room = RECEIVE_BUFFER;
  u->fd = socket(u->peer.any.sa_family, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (u->fd < 0)
    return -1;
  // Both are wishes: with less room a burst is lost and counted, without stamps the
  // time of reading stands in.
  setsockopt(u->fd, SOL_SOCKET, SO_RCVBUF, &room, sizeof room);
  setsockopt(u->fd, SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof on);
  for (int i = 0; i < BATCH; i++) {
    u->part[i] = (struct iovec){u->bytes[i], sizeof u->bytes[i]};
    u->message[i].msg_hdr = (struct msghdr){
      .msg_name = &u->source[i], .msg_iov = &u->part[i], .msg_iovlen = 1, .msg_control = u->control[i]};
  }
  if (bind_socket(u, u->fd, listen_port))
    return -1;
  if (connect(u->fd, &u->peer.any, u->peer_size))
    return -1;
  open_strangers(u, listen_port);
  return 0;
}

// Every page is there before the real-time thread meets the first large datagram.
static void touch_pages(udp *u) {
  volatile uint8_t *byte = (volatile uint8_t *)u;
  for (size_t at = 0; at < sizeof *u; at += 4096)
    byte[at] = 0;
}

int gv_udp_open(const char *url, gv_driver *out, char *err, size_t err_size) {
  udp_url parts;
  const char *wrong = parse_url(url, &parts);
  if (wrong) {
    snprintf(err, err_size, "%s: %s; write udp://HOST:PORT?listen=PORT", url, wrong);
    return -1;
  }
  udp *u = calloc(1, sizeof *u);
  if (!u) {
    snprintf(err, err_size, "%s: out of memory; close other programs", url);
    return -1;
  }
  touch_pages(u);
  u->fd = -1;
  u->strangers = -1;
  int code = resolve_peer(u, &parts);
  if (code)
    snprintf(err, err_size, "%s: the host %s is not known (%s); check its name or give its address", url,
             parts.host, gai_strerror(code));
  else if (open_socket(u, parts.listen))
    snprintf(err, err_size,
             "%s: cannot listen on port %s (%s); choose another port, or end the program that holds it", url,
             parts.listen, strerror(errno));
  else {
    *out = (gv_driver){.self = u,
                       .poll = poll_udp,
                       .send = send_udp,
                       .ended = udp_ended,
                       .stats = udp_stats,
                       .close = close_udp,
                       .descriptor = udp_descriptor,
                       .tell = tell_udp,
                       .calls = GV_CALLS_SOCKET};
    return 0;
  }
  close_udp(u);
  return -1;
}
