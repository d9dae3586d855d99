// SPDX-License-Identifier: BSD-3-Clause
// --strict: the system calls that the real-time thread may make, as a seccomp list of that thread alone
// (seccomp(2)). Any other call ends the process at once with SIGSYS; the device then lets go by its watchdog.
// A list can never be taken off or widened again, so it also holds what a thread needs to end.
//
//   sleeping       clock_nanosleep, ppoll
//   counting       clock_gettime (where the vDSO cannot read the clock), getrusage (page faults)
//   its devices    sockets: recvmmsg, sendto; serial lines: read, write, but never descriptors 0 to 2
//   ending         alarm or setitimer, rt_sigprocmask, madvise, exit
#ifndef GLOVED_DAEMON_STRICT_H
#define GLOVED_DAEMON_STRICT_H

// Installs the list for the calling thread; driver_calls: GV_CALLS_... of the driver. Takes no privilege: the
// thread gives up ever getting new ones (PR_SET_NO_NEW_PRIVS). 0, or the errno of the kernel that refused;
// the thread is then as it was, but for that.
int gv_strict_enter(unsigned driver_calls);

#endif
