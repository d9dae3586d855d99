// SPDX-License-Identifier: BSD-3-Clause
// The serial line and its keeper (serial_port.h): termios, raw, 8N1, no flow control, non-blocking.
#include "drivers/serial_port.h"

#include <errno.h>
#include <fcntl.h>
#include <linux/serial.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

enum { KEEPER_STACK = 256 << 10, LOOK_MS = 20, QUICK_LOOK_MS = 1, DRAIN_MS = 200 };

// ---- the line -------------------------------------------------------------------------------------

static const struct {
  int baud;
  speed_t speed;
} speeds[] = {{2400, B2400},      {4800, B4800},     {9600, B9600},       {19200, B19200},
              {38400, B38400},    {57600, B57600},   {115200, B115200},   {230400, B230400},
              {460800, B460800},  {921600, B921600}, {1000000, B1000000}, {2000000, B2000000},
              {3000000, B3000000}};

static int find_speed(int baud) {
  for (int i = 0; i < (int)(sizeof speeds / sizeof *speeds); i++)
    if (speeds[i].baud == baud)
      return i;
  return -1;
}
bool gv_serial_port_knows(int baud) { return find_speed(baud) >= 0; }

// USB converters hold bytes back for up to 16 ms unless asked not to; others refuse
// the request, which is as well.
static void ask_for_low_latency(int fd) {
  struct serial_struct line;
  if (ioctl(fd, TIOCGSERIAL, &line) != 0)
    return;
  line.flags = (int)((unsigned)line.flags | ASYNC_LOW_LATENCY);
  ioctl(fd, TIOCSSERIAL, &line);
}

static int set_line(int fd, int baud) {
  struct termios t;
  if (tcgetattr(fd, &t) != 0)
    return -1;
  cfmakeraw(&t);
  t.c_cflag |= CLOCAL | CREAD;
  t.c_cflag &= ~(tcflag_t)(CSTOPB | CRTSCTS);
  t.c_cc[VMIN] = 1;  // nothing there is EAGAIN, and an end is an end
  t.c_cc[VTIME] = 0;
  const speed_t speed = speeds[find_speed(baud)].speed;
  if (cfsetispeed(&t, speed) != 0 || cfsetospeed(&t, speed) != 0 || tcsetattr(fd, TCSANOW, &t) != 0)
    return -1;
  ask_for_low_latency(fd);
  return tcflush(fd, TCIOFLUSH);
}

// The descriptor, or -1 with errno. O_NONBLOCK: without it, opening waits for the modem's carrier. The lock
// keeps a second reader of ours away, and goes with the process, however it ends.
static int open_line(const serial_port *port) {
  int fd = open(port->path, O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  if (fd < 0)
    return -1;
  if (flock(fd, LOCK_EX | LOCK_NB) == 0 && set_line(fd, port->baud) == 0)
    return fd;
  const int error = errno;
  close(fd);
  errno = error;
  return -1;
}

static const char *what_to_do(int error) {
  switch (error) {
    case ENOENT:
    case ENXIO:
    case ENODEV: return "plug it in, or give its name (ls /dev/tty*)";
    case EACCES:
    case EPERM: return "add yourself to its group: sudo adduser $USER dialout, then log in anew";
    case EBUSY:
    case EWOULDBLOCK: return "end the program that holds it";
    case ENOTTY: return "give a serial device such as /dev/ttyUSB0";
    default: return "check the device and its cable";
  }
}

// ---- waiting, for set_up --------------------------------------------------------------------------

static int64_t now_ms(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (int64_t)t.tv_sec * 1000 + t.tv_nsec / 1000000;
}

static void sleep_ms(int ms) {
  const struct timespec t = {ms / 1000, ms % 1000 * 1000000L};
  nanosleep(&t, NULL);
}

int gv_serial_write(int fd, const void *data, size_t size, int timeout_ms) {
  const char *p = data;
  const int64_t end = now_ms() + timeout_ms;
  while (size > 0) {
    struct pollfd wait = {fd, POLLOUT, 0};
    ssize_t n = write(fd, p, size);
    if (n < 0 && errno != EAGAIN && errno != EINTR)
      return -1;
    if (n > 0) {
      p += n;
      size -= (size_t)n;
    } else if (now_ms() >= end || poll(&wait, 1, (int)(end - now_ms())) < 0) {
      return -1;
    }
  }
  return 0;
}

int gv_serial_read(int fd, uint8_t *out, int size, int quiet_ms, int timeout_ms) {
  const int64_t end = now_ms() + timeout_ms;
  int count = 0;
  while (count < size && now_ms() < end) {
    struct pollfd wait = {fd, POLLIN, 0};
    if (poll(&wait, 1, quiet_ms) <= 0)
      break;
    ssize_t n = read(fd, out + count, (size_t)(size - count));
    if (n == 0 || (n < 0 && errno != EAGAIN && errno != EINTR))
      break;
    if (n > 0)
      count += (int)n;
  }
  return count;
}

// ---- the keeper -----------------------------------------------------------------------------------

static bool stopping(const serial_port *port) { return atomic_load(&port->stop); }

static void pause_for(const serial_port *port, int ms) {
  for (int64_t end = now_ms() + ms; !stopping(port) && now_ms() < end;)
    sleep_ms(LOOK_MS);
}

// Until the reader gave the descriptor back, no record came for too long, or the port is closed.
static void watch(serial_port *port, int fd) {
  unsigned long seen = atomic_load(&port->records);
  int64_t seen_ms = now_ms();
  while (!stopping(port) && atomic_load(&port->fd) >= 0 && now_ms() - seen_ms < SERIAL_SILENCE_MS) {
    sleep_ms(port->look ? QUICK_LOOK_MS : LOOK_MS);
    if (port->look)
      port->look(port->self, fd, now_ms());
    const unsigned long records = atomic_load(&port->records);
    if (records == seen)
      continue;
    seen = records;
    seen_ms = now_ms();
  }
}

// After this the reader does not use the descriptor any more: it says that it reads before it takes the
// descriptor, and this looks after it was withdrawn.
static void take_back(serial_port *port) {
  atomic_store(&port->fd, -1);
  while (atomic_load(&port->reading))
    sleep_ms(1);
}

// What let_go wrote may leave before close_line throws the rest away: until the queue is empty, and one look
// more for the bytes that the queue no longer counts.
static void let_go(const serial_port *port, int fd) {
  int queued = 0;
  if (!port->let_go)
    return;
  port->let_go(port->self, fd);
  const int64_t end = now_ms() + DRAIN_MS;
  while (ioctl(fd, TIOCOUTQ, &queued) == 0 && queued > 0 && now_ms() < end)
    sleep_ms(1);
  sleep_ms(LOOK_MS);
}

static void serve(serial_port *port, int fd) {
  const int setting = port->set_up(port->self, fd);
  if (setting < 0 || stopping(port))
    return;
  atomic_store(&port->setting, setting);
  atomic_fetch_add(&port->connections, 1);
  atomic_store(&port->fd, fd);
  watch(port, fd);
  take_back(port);
}

// Closing would otherwise wait for bytes that an unplugged device never takes.
static void close_line(int fd) {
  tcflush(fd, TCIOFLUSH);
  close(fd);
}

static void *keep(void *argument) {
  serial_port *port = argument;
  int fd = port->first_fd;
  for (;;) {
    atomic_store(&port->opened, fd >= 0);
    if (fd >= 0) {
      serve(port, fd);
      let_go(port, fd);
      close_line(fd);
    }
    pause_for(port, SERIAL_RETRY_MS);
    if (stopping(port))
      return NULL;
    fd = open_line(port);
  }
}

// The process's signals belong to its other threads.
static int start_keeper(serial_port *port) {
  pthread_attr_t attributes;
  sigset_t all, before;
  sigfillset(&all);
  pthread_attr_init(&attributes);
  pthread_attr_setstacksize(&attributes, KEEPER_STACK);
  pthread_sigmask(SIG_SETMASK, &all, &before);
  int error = pthread_create(&port->keeper, &attributes, keep, port);
  pthread_sigmask(SIG_SETMASK, &before, NULL);
  pthread_attr_destroy(&attributes);
  return error;
}

int gv_serial_port_open(serial_port *port, char *why, size_t why_size) {
  atomic_init(&port->fd, -1);
  atomic_init(&port->reading, false);
  atomic_init(&port->stop, false);
  atomic_init(&port->opened, true);
  atomic_init(&port->setting, 0);
  atomic_init(&port->records, 0);
  atomic_init(&port->connections, 0);
  port->first_fd = open_line(port);
  if (port->first_fd < 0) {
    snprintf(why, why_size, "cannot be opened as a serial line (%s); %s", strerror(errno), what_to_do(errno));
    return -1;
  }
  if (start_keeper(port) == 0)
    return 0;
  snprintf(why, why_size, "no thread for it; close other programs");
  close(port->first_fd);
  return -1;
}

void gv_serial_port_close(serial_port *port) {
  atomic_store(&port->stop, true);
  pthread_join(port->keeper, NULL);
}

// ---- the reader -----------------------------------------------------------------------------------

// The descriptor to use at once, or -1; give_back after it.
static int borrow(serial_port *port) {
  atomic_store(&port->reading, true);
  return atomic_load(&port->fd);
}

// n and errno as read() or write() left them. Returns the bytes, 0: nothing for now, -1: the line is gone.
static int give_back(serial_port *port, int fd, ssize_t n) {
  const bool gone = fd < 0 || n == 0 || (n < 0 && errno != EAGAIN && errno != EINTR);
  if (gone && fd >= 0)
    atomic_store(&port->fd, -1);
  atomic_store(&port->reading, false);
  return gone ? -1 : n < 0 ? 0 : (int)n;
}

int gv_serial_port_read(serial_port *port, uint8_t *out, int size, int *out_setting) {
  const int fd = borrow(port);
  const ssize_t n = fd >= 0 ? read(fd, out, (size_t)size) : 0;
  if (fd >= 0)
    *out_setting = atomic_load(&port->setting);
  const int count = give_back(port, fd, n);
  return count > 0 ? count : 0;
}

int gv_serial_port_write(serial_port *port, const void *data, int size) {
  const int fd = borrow(port);
  return give_back(port, fd, fd >= 0 ? write(fd, data, (size_t)size) : 0);
}
