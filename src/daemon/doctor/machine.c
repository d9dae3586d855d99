// SPDX-License-Identifier: BSD-3-Clause
// The doctor on kernel and limits: what this process may ask of the scheduler, and who may take it away
// again. proc(5), sched(7), cgroups(7), capabilities(7).
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "daemon/doctor/tree.h"

enum { CAP_IPC_LOCK_BIT = 14, CAP_SYS_NICE_BIT = 23 };
// Measured: 31 MB locked with a box, some 100 MB with meshes of 70,000 triangles.
enum { LOCKED_LEAST_MB = 40, LOCKED_ENOUGH_MB = 128 };

static const char setcap[] = "sudo setcap cap_sys_nice,cap_ipc_lock=ep build/gcc-O2/gloved";

static bool has_capability(const gv_doctor *doctor, int bit) {
  char text[TREE_TEXT];
  gv_tree_read(doctor, text, sizeof text, "/proc/self/status");
  const char *effective = gv_tree_line(text, "CapEff");
  return effective && strtoull(effective, NULL, 16) >> bit & 1;
}

// The soft limit of a line in /proc/self/limits; unlimited: -1, unknown: 0.
static long long soft_limit(const gv_doctor *doctor, const char *name) {
  char text[TREE_TEXT];
  gv_tree_read(doctor, text, sizeof text, "/proc/self/limits");
  const char *limit = gv_tree_line(text, name);
  if (!limit)
    return 0;
  return strncmp(limit, "unlimited", 9) == 0 ? -1 : atoll(limit);
}

void gv_examine_kernel(const gv_doctor *doctor, gv_finding *out) {
  char version[512];
  long realtime = 0;
  gv_tree_read(doctor, version, sizeof version, "/proc/version");
  gv_tree_number(doctor, &realtime, "/sys/kernel/realtime");
  if (realtime == 1 || strstr(version, "PREEMPT_RT"))
    gv_doctor_finds(out, GV_VERDICT_PASS, "PREEMPT_RT");
  else if (strstr(version, "PREEMPT"))
    gv_doctor_finds(out, GV_VERDICT_WARN,
                    "preemptible, but not PREEMPT_RT: a driver can hold the loop up for milliseconds");
  else
    gv_doctor_finds(out, GV_VERDICT_FAIL,
                    "not preemptible: any system call of another program can hold the loop up");
  gv_doctor_mends(out, "sudo apt-get install linux-image-rt-amd64, then boot it");
}

void gv_examine_priority(const gv_doctor *doctor, gv_finding *out) {
  const int wanted = doctor->settings->rt_priority;
  const long long limit = soft_limit(doctor, "Max realtime priority");
  if (wanted == 0)
    gv_doctor_finds(out, GV_VERDICT_WARN, "the settings ask for ordinary scheduling");
  else if (has_capability(doctor, CAP_SYS_NICE_BIT))
    gv_doctor_finds(out, GV_VERDICT_PASS, "SCHED_FIFO %d is allowed (CAP_SYS_NICE)", wanted);
  else if (limit < 0 || limit >= wanted)
    gv_doctor_finds(out, GV_VERDICT_PASS, "SCHED_FIFO %d is allowed", wanted);
  else if (limit > 0)
    gv_doctor_finds(out, GV_VERDICT_WARN, "SCHED_FIFO only up to %lld, and %d is configured", limit, wanted);
  else
    gv_doctor_finds(out, GV_VERDICT_FAIL, "no real-time priority is allowed");
  if (wanted == 0)
    gv_doctor_mends(out, "set realtime.priority = 80 in --config, and leave --no-rt out");
  else
    gv_doctor_mends(out, "%s", setcap);
}

void gv_examine_memory(const gv_doctor *doctor, gv_finding *out) {
  const long long bytes = soft_limit(doctor, "Max locked memory");
  const long long mb = bytes / 1000000;
  if (!doctor->settings->mlock)
    gv_doctor_finds(out, GV_VERDICT_WARN, "the settings do not lock memory");
  else if (bytes < 0 || has_capability(doctor, CAP_IPC_LOCK_BIT))
    gv_doctor_finds(out, GV_VERDICT_PASS, "any amount may be locked");
  else if (mb >= LOCKED_ENOUGH_MB)
    gv_doctor_finds(out, GV_VERDICT_PASS, "%lld MB may be locked", mb);
  else if (mb >= LOCKED_LEAST_MB)
    gv_doctor_finds(out, GV_VERDICT_WARN, "%lld MB may be locked: enough for small scenes", mb);
  else
    gv_doctor_finds(out, GV_VERDICT_FAIL, "%lld MB may be locked, a box needs some 31", mb);
  if (!doctor->settings->mlock)
    gv_doctor_mends(out, "set realtime.mlock = true in --config, and leave --no-rt out");
  else
    gv_doctor_mends(out, "%s", setcap);
}

// ---- the CPU budget of control groups -------------------------------------------------------------------

typedef struct budget {
  double cores;
  char file[256];
} budget;  // cores: HUGE_VAL without a budget

static void keep_smaller(budget *least, double cores, const char *file) {
  if (cores >= least->cores)
    return;
  least->cores = cores;
  snprintf(least->file, sizeof least->file, "%s", file);
}

// cpu.max of version 2 ("max 100000" or "50000 100000"), cpu.cfs_quota_us of version 1 (-1: none).
static void look_into_group(const gv_doctor *doctor, const char *mount, const char *group, budget *least) {
  char file[256], text[64];
  double quota = 0;
  double period = 100000;
  snprintf(file, sizeof file, "%s%.200s/cpu.max", mount, group);
  if (gv_tree_read(doctor, text, sizeof text, "%s", file) && sscanf(text, "%lf %lf", &quota, &period) == 2 &&
      period > 0)
    keep_smaller(least, quota / period, file);
  snprintf(file, sizeof file, "%s%.200s/cpu.cfs_quota_us", mount, group);
  if (gv_tree_read(doctor, text, sizeof text, "%s", file) && (quota = atof(text)) > 0) {
    gv_tree_read(doctor, text, sizeof text, "%s%.200s/cpu.cfs_period_us", mount, group);
    keep_smaller(least, quota / (atof(text) > 0 ? atof(text) : 100000), file);
  }
}

// The group named by a line of /proc/self/cgroup ("0::/user.slice", "1:cpu:/a/b") and all above it.
static void look_upwards(const gv_doctor *doctor, const char *mount, const char *group, budget *least) {
  char path[200];
  snprintf(path, sizeof path, "%.*s", (int)strcspn(group, "\n"), group);
  for (char *end = path + strlen(path); end; end = strrchr(path, '/')) {
    *end = '\0';
    look_into_group(doctor, mount, path, least);
  }
}

void gv_examine_cgroup(const gv_doctor *doctor, gv_finding *out) {
  char groups[4096];
  budget least = {HUGE_VAL, ""};
  gv_tree_read(doctor, groups, sizeof groups, "/proc/self/cgroup");
  for (const char *line = groups; line && *line; line = strchr(line, '\n') ? strchr(line, '\n') + 1 : NULL) {
    const char *controllers = strchr(line, ':');
    const char *group = controllers ? strchr(controllers + 1, ':') : NULL;
    if (!group)
      continue;
    if (controllers[1] == ':')
      look_upwards(doctor, "/sys/fs/cgroup", group + 1, &least);
    else if (strncmp(controllers, ":cpu:", 5) == 0)
      look_upwards(doctor, "/sys/fs/cgroup/cpu", group + 1, &least);
    else if (strncmp(controllers, ":cpu,cpuacct:", 13) == 0)
      look_upwards(doctor, "/sys/fs/cgroup/cpu,cpuacct", group + 1, &least);
  }
  if (least.cores == HUGE_VAL)
    gv_doctor_finds(out, GV_VERDICT_PASS, "no CPU budget");
  else if (least.cores >= 1.0)
    gv_doctor_finds(out, GV_VERDICT_WARN, "a budget of %.2f cores: spent by others, it stops the slow thread",
                    least.cores);
  else
    gv_doctor_finds(out, GV_VERDICT_FAIL,
                    "a budget of %.2f cores: spent, it stops the program for the rest of 100 ms",
                    least.cores);
  gv_doctor_mends(out, strstr(least.file, "cpu.max") ? "echo max | sudo tee %s" : "echo -1 | sudo tee %s",
                  least.file);
}

// The kernel takes the processor away from real-time threads that use more than this. The loop sleeps most of
// the time, so the default (95 %) is a net against a loop that runs away, and not in its way.
void gv_examine_throttling(const gv_doctor *doctor, gv_finding *out) {
  long runtime_us = 0;
  long period_us = 1000000;
  const bool known = gv_tree_number(doctor, &runtime_us, "/proc/sys/kernel/sched_rt_runtime_us");
  gv_tree_number(doctor, &period_us, "/proc/sys/kernel/sched_rt_period_us");
  const double share = period_us > 0 ? 100.0 * (double)runtime_us / (double)period_us : 0;
  if (!known || runtime_us < 0)
    gv_doctor_finds(out, GV_VERDICT_PASS, "no throttling");
  else if (share >= 90)
    gv_doctor_finds(out, GV_VERDICT_PASS, "real-time threads may use %.0f %%, the loop uses a few", share);
  else if (share >= 50)
    gv_doctor_finds(out, GV_VERDICT_WARN, "real-time threads may use %.0f %% only", share);
  else
    gv_doctor_finds(out, GV_VERDICT_FAIL, "real-time threads may use %.0f %% only", share);
  gv_doctor_mends(out, "sudo sysctl -w kernel.sched_rt_runtime_us=950000 kernel.sched_rt_period_us=1000000");
}

void gv_examine_strict(const gv_doctor *doctor, gv_finding *out) {
  char actions[256];
  gv_tree_read(doctor, actions, sizeof actions, "/proc/sys/kernel/seccomp/actions_avail");
  if (strstr(actions, "kill_process"))
    gv_doctor_finds(out, GV_VERDICT_PASS, "lists of system calls are available");
  else
    gv_doctor_finds(out, doctor->settings->strict ? GV_VERDICT_FAIL : GV_VERDICT_WARN,
                    "no lists of system calls: --strict does not start");
  gv_doctor_mends(out, doctor->settings->strict
                           ? "start without --strict, or boot a kernel with CONFIG_SECCOMP_FILTER"
                           : "boot a kernel with CONFIG_SECCOMP_FILTER");
}
