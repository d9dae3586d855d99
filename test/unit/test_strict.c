// SPDX-License-Identifier: BSD-3-Clause
// The list of system calls of the real-time thread, in child processes: one call of a thread under the list
// either is let through, or ends the whole process with SIGSYS. Other threads may do what they like. And a
// kernel that takes no such list is told in words, before any step.
#include <errno.h>
#include <fcntl.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "daemon/loop/strict.h"
#include "gloved/frame.h"
#include "support/check.h"

// ---- one call under the list --------------------------------------------------------------------------

static int line[2], pair_of_sockets[2];  // both ends at descriptors above 2

static void sleep_until_past(void) {
  const struct timespec past = {0, 1};
  clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &past, NULL);
}
static void poll_a_descriptor(void) {
  struct pollfd wait = {.fd = line[0], .events = POLLIN};
  const struct timespec no_time = {0, 0};
  ppoll(&wait, 1, &no_time, NULL);
}
static void read_the_clock(void) {
  struct timespec t;
  syscall(SYS_clock_gettime, CLOCK_MONOTONIC, &t);
}
static void count_faults(void) {
  struct rusage usage;
  getrusage(RUSAGE_THREAD, &usage);
}
static void receive(void) {
  struct mmsghdr message;
  memset(&message, 0, sizeof message);
  recvmmsg(pair_of_sockets[0], &message, 1, MSG_DONTWAIT, NULL);
}
static void send_bytes(void) { send(pair_of_sockets[0], "x", 1, MSG_DONTWAIT); }
static void read_a_line(void) {
  char byte;
  CHECK(read(line[0], &byte, 1) == 1, "nothing read");
}
static void write_a_line(void) { CHECK(write(line[1], "x", 1) == 1, "not written"); }

static void write_to_standard_error(void) { CHECK(write(2, "", 0) == 0, "not written"); }
static void read_standard_input(void) {
  char byte;
  CHECK(read(0, &byte, 0) == 0, "read");
}
static void open_a_file(void) { close(open("/dev/null", O_RDONLY)); }
static void map_memory(void) { mmap(NULL, 4096, PROT_READ, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0); }
static void move_the_break(void) { syscall(SYS_brk, 0); }
static void make_a_socket(void) { socket(AF_INET, SOCK_DGRAM, 0); }
static void wait_on_a_futex(void) {
  static int word;
  syscall(SYS_futex, &word, 1, 1, NULL, NULL, 0);  // FUTEX_WAKE: nobody waits
}
static void sleep_relative(void) {
  const struct timespec short_time = {0, 1000};
  syscall(SYS_nanosleep, &short_time, NULL);
}
static void start_a_program(void) { execl("/bin/true", "true", (char *)NULL); }
static void raise_a_signal(void) { kill(getppid(), 0); }
static void yield(void) { syscall(SYS_sched_yield); }

typedef struct request {
  unsigned driver_calls;
  void (*call)(void);
} request;

static void *call_under_the_list(void *argument) {
  const request *r = argument;
  if (gv_strict_enter(r->driver_calls) != 0)
    syscall(SYS_exit_group, 3);
  r->call();
  return NULL;
}

// Waits for the child: its exit code, or minus the signal that ended it.
static int outcome_of(pid_t child) {
  int status = 0;
  waitpid(child, &status, 0);
  return WIFSIGNALED(status) ? -WTERMSIG(status) : WEXITSTATUS(status);
}

static int make_call(unsigned driver_calls, void (*call)(void)) {
  fflush(stdout);
  const pid_t child = fork();
  if (child == 0) {
    request r = {driver_calls, call};
    pthread_t thread;
    prctl(PR_SET_DUMPABLE, 0UL, 0UL, 0UL, 0UL);
    if (pthread_create(&thread, NULL, call_under_the_list, &r) != 0)
      _exit(4);
    pthread_join(thread, NULL);
    open_a_file();  // this thread may
    _exit(0);
  }
  return outcome_of(child);
}

static void test_what_the_loop_needs_is_let_through(void) {
  void (*const calls[])(void) = {sleep_until_past, poll_a_descriptor, read_the_clock, count_faults};
  for (int i = 0; i < 4; i++)
    CHECK(make_call(0, calls[i]) == 0, "call %d: %d", i, make_call(0, calls[i]));
}

static void test_a_drivers_own_calls_are_let_through(void) {
  CHECK(make_call(GV_CALLS_SOCKET, receive) == 0 && make_call(GV_CALLS_SOCKET, send_bytes) == 0,
        "a socket's");
  CHECK(make_call(GV_CALLS_LINE, write_a_line) == 0 && make_call(GV_CALLS_LINE, read_a_line) == 0,
        "a serial line's");
}

static void test_another_drivers_calls_kill(void) {
  CHECK(make_call(0, receive) == -SIGSYS && make_call(GV_CALLS_LINE, send_bytes) == -SIGSYS, "a socket's");
  CHECK(make_call(0, read_a_line) == -SIGSYS && make_call(GV_CALLS_SOCKET, write_a_line) == -SIGSYS,
        "a serial line's");
}

static void test_a_serial_driver_cannot_reach_the_standard_descriptors(void) {
  CHECK(make_call(GV_CALLS_LINE, write_to_standard_error) == -SIGSYS, "standard error");
  CHECK(make_call(GV_CALLS_LINE, read_standard_input) == -SIGSYS, "standard input");
}

static void test_any_other_call_kills(void) {
  void (*const calls[])(void) = {open_a_file,     map_memory,      move_the_break,
                                 make_a_socket,   wait_on_a_futex, sleep_relative,
                                 start_a_program, raise_a_signal,  yield};
  for (int i = 0; i < (int)(sizeof calls / sizeof *calls); i++) {
    const int code = make_call(GV_CALLS_SOCKET | GV_CALLS_LINE, calls[i]);
    CHECK(code == -SIGSYS, "call %d: %d", i, code);
  }
}

// ---- a kernel that refuses ----------------------------------------------------------------------------

// seccomp(2) answers EINVAL from now on, as a kernel without CONFIG_SECCOMP_FILTER does.
static void refuse_lists(void) {
  struct sock_filter lines[] = {
    BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(struct seccomp_data, nr)),
    BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, SYS_seccomp, 0, 1),
    BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ERRNO | EINVAL),
    BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW),
  };
  const struct sock_fprog program = {4, lines};
  prctl(PR_SET_NO_NEW_PRIVS, 1UL, 0UL, 0UL, 0UL);
  prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program);
}

static void test_a_kernel_that_refuses_is_told_in_words(void) {
  char gloved[512], text[512] = "";
  int words[2];
  snprintf(gloved, sizeof gloved, "%s/gloved", getenv("B") ? getenv("B") : "build/gcc-O2");
  CHECK(pipe(words) == 0, "no pipe");
  fflush(stdout);
  const pid_t child = fork();
  if (child == 0) {
    dup2(words[1], 2);
    dup2(words[1], 1);
    refuse_lists();
    execl(gloved, gloved, "--strict", "--fcu", "sim:", "--duration", "0.2", "--lcm", "none", (char *)NULL);
    _exit(5);
  }
  close(words[1]);
  size_t length = 0;  // it says its words in several writes
  for (ssize_t got; (got = read(words[0], text + length, sizeof text - 1 - length)) > 0;)
    length += (size_t)got;
  const int code = outcome_of(child);
  CHECK(code == 2, "exit code %d", code);
  CHECK(!strstr(text, "start -> wait"), "a step was made: %s", text);
  CHECK(length > 0 && strstr(text, "--strict: this kernel takes no list") &&
            strstr(text, "start without --strict"),
        "said: %s", text);
  close(words[0]);
}

int main(void) {
  if (syscall(SYS_seccomp, SECCOMP_GET_ACTION_AVAIL, 0, &(unsigned){SECCOMP_RET_KILL_PROCESS}) != 0) {
    SKIP("this kernel has no seccomp lists");
    return check_done();
  }
  CHECK(pipe(line) == 0 && line[0] > 2 && write(line[1], "y", 1) == 1, "no pipe");
  CHECK(socketpair(AF_UNIX, SOCK_DGRAM, 0, pair_of_sockets) == 0, "no sockets");
  RUN(test_what_the_loop_needs_is_let_through);
  RUN(test_a_drivers_own_calls_are_let_through);
  RUN(test_another_drivers_calls_kill);
  RUN(test_a_serial_driver_cannot_reach_the_standard_descriptors);
  RUN(test_any_other_call_kills);
  RUN(test_a_kernel_that_refuses_is_told_in_words);
  return check_done();
}
