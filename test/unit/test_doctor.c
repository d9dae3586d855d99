// SPDX-License-Identifier: BSD-3-Clause
// gloved --doctor on machines made of files: one on which everything passes, and from it, one file changed at
// a time, a machine on which the check that reads it warns, and one on which it fails; no other check may
// change its mind.
#include <errno.h>
#include <ftw.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "daemon/doctor/doctor.h"
#include "support/check.h"

static char root[] = "/tmp/test_doctor.XXXXXX";
static gv_settings settings;
static const gv_doctor doctor = {root, &settings};

// ---- machines of files ------------------------------------------------------------------------------------

typedef struct file {
  const char *path, *text;
} file;

#define CPU(n) "/sys/devices/system/cpu/cpu" n "/"
#define ROUTE "Iface\tDestination\tGateway\tFlags\tRefCnt\tUse\tMetric\tMask\tMTU\tWindow\tIRTT\n"

static const file good[] = {
  {"/proc/version", "Linux version 6.1.0-rt9 (gcc) #1 SMP PREEMPT_RT Debian\n"},
  {"/sys/kernel/realtime", "1\n"},
  {"/proc/self/status", "Name:\tgloved\nCapEff:\t0000000000000000\nSeccomp:\t0\n"},
  {"/proc/self/limits", "Limit                     Soft Limit           Hard Limit           Units     \n"
                        "Max locked memory         1000000000           1000000000           bytes     \n"
                        "Max realtime priority     95                   95                   \n"},
  {"/proc/self/cgroup", "3:cpuset:/\n1:cpu:/old\n0::/user.slice/one\n"},
  {"/sys/fs/cgroup/user.slice/one/cpu.max", "max 100000\n"},
  {"/sys/fs/cgroup/user.slice/cpu.max", "max 100000\n"},
  {"/sys/fs/cgroup/cpu/old/cpu.cfs_quota_us", "-1\n"},
  {"/sys/fs/cgroup/cpu/old/cpu.cfs_period_us", "100000\n"},
  {"/proc/sys/kernel/sched_rt_runtime_us", "950000\n"},
  {"/proc/sys/kernel/sched_rt_period_us", "1000000\n"},
  {"/sys/devices/system/cpu/online", "0-3\n"},
  {CPU("0") "cpufreq/scaling_governor", "performance\n"},
  {CPU("3") "cpufreq/scaling_governor", "performance\n"},
  {CPU("3") "cpufreq/scaling_driver", "acpi-cpufreq\n"},
  {CPU("3") "cpuidle/state0/latency", "0\n"},
  {CPU("3") "cpuidle/state1/latency", "133\n"},
  {CPU("3") "cpuidle/state1/name", "C6\n"},
  {CPU("3") "cpuidle/state1/disable", "0\n"},
  {"/dev/cpu_dma_latency", ""},
  {"/sys/devices/system/clocksource/clocksource0/current_clocksource", "tsc\n"},
  {"/sys/devices/system/clocksource/clocksource0/available_clocksource", "tsc hpet acpi_pm \n"},
  {"/proc/irq/24/effective_affinity_list", "0-1\n"},
  {"/proc/irq/25/effective_affinity_list", "\n"},
  {"/proc/irq/25/smp_affinity_list", "0,2\n"},
  {"/proc/cpuinfo",
   "processor\t: 0\nmodel name\t: Intel(R) Core(TM) i7\nflags\t\t: fpu vme\nbugs\t\t: hypervisor\n"},
  {"/proc/sys/kernel/seccomp/actions_avail", "kill_process kill_thread trap errno\n"},
  {"/sys/class/net/can0/mtu", "72\n"},
  {"/sys/class/net/can0/flags", "0x40c1\n"},
  {"/sys/class/net/can0/tx_queue_len", "10\n"},
  {"/sys/class/net/can0/operstate", "up\n"},
  {"/proc/net/route", ROUTE "eth0\t00000000\t010200C0\t0003\t0\t0\t0\t00000000\t0\t0\t0\nlo\t000000E0\t0000"
                            "0000\t0001\t0\t0\t0\t000000F0\t0\t0\t0\n"},
  {"/sys/class/net/lo/flags", "0x1009\n"},
  {"/sys/class/net/eth0/flags", "0x3\n"},
  {"/proc/sys/net/core/rmem_max", "2097152\n"},
  {"/sys/bus/usb-serial/devices/ttyUSB0/latency_timer", "1\n"},
};

// Writes the file below the root; no text: removes it.
static void put_file(const char *path, const char *text) {
  char whole[512];
  snprintf(whole, sizeof whole, "%s%s", root, path);
  if (!text) {
    CHECK(remove(whole) == 0, "%s: %s", whole, strerror(errno));
    return;
  }
  for (char *slash = whole + sizeof root; (slash = strchr(slash, '/')); slash++) {
    *slash = '\0';
    mkdir(whole, 0777);
    *slash = '/';
  }
  FILE *out = fopen(whole, "w");
  CHECK(out && fputs(text, out) >= 0 && fclose(out) == 0, "%s: %s", whole, strerror(errno));
}

static const char *good_text(const char *path) {
  for (size_t i = 0; i < sizeof good / sizeof *good; i++)
    if (strcmp(good[i].path, path) == 0)
      return good[i].text;
  return NULL;
}

static void make_good_machine(void) {
  for (size_t i = 0; i < sizeof good / sizeof *good; i++)
    put_file(good[i].path, good[i].text);
  gv_settings_default(&settings);
  snprintf(settings.fcu, sizeof settings.fcu, "can:can0");
  snprintf(settings.tracker, sizeof settings.tracker, "serial:/dev/ttyUSB0?type=fastrak");
}

static const char *const verdict_name[] = {"PASS", "WARN", "FAIL"};

// Every check passes but the one named, which says `verdict` and how to mend it.
static void check_machine(const char *check, gv_verdict verdict, const char *why) {
  int seen = 0;
  for (int i = 0; i < gv_doctor_checks(); i++) {
    const gv_finding f = gv_doctor_check(&doctor, i);
    const bool meant = strcmp(f.check, check) == 0;
    const gv_verdict expected = meant ? verdict : GV_VERDICT_PASS;
    seen += meant;
    CHECK(f.verdict == expected, "%s: %s: %s: %s", why, f.check, verdict_name[f.verdict], f.found);
    CHECK(f.found[0], "%s: %s says nothing", why, f.check);
    CHECK((f.mend[0] != '\0') == (f.verdict != GV_VERDICT_PASS), "%s: %s: mend: \"%s\"", why, f.check,
          f.mend);
  }
  CHECK(seen == 1, "%d checks are called %s", seen, check);
}

// The machine with one file changed, and with it as it was.
static void change(const char *check, gv_verdict verdict, const char *path, const char *text) {
  char why[256];
  snprintf(why, sizeof why, "%s is \"%.60s\"", path, text ? text : "away");
  put_file(path, text);
  check_machine(check, verdict, why);
  const char *before = good_text(path);
  if (before || text)
    put_file(path, before);
}

static void warns(const char *check, const char *path, const char *text) {
  change(check, GV_VERDICT_WARN, path, text);
}
static void fails(const char *check, const char *path, const char *text) {
  change(check, GV_VERDICT_FAIL, path, text);
}
static void passes(const char *check, const char *path, const char *text) {
  change(check, GV_VERDICT_PASS, path, text);
}

// ---- one test a check -------------------------------------------------------------------------------------

static void test_a_good_machine_passes(void) { check_machine("kernel", GV_VERDICT_PASS, "good"); }

static void test_kernel(void) {
  passes("kernel", "/sys/kernel/realtime", NULL);  // /proc/version says it too
  put_file("/sys/kernel/realtime", NULL);
  warns("kernel", "/proc/version", "Linux version 6.1.0 #1 SMP PREEMPT_DYNAMIC Debian\n");
  fails("kernel", "/proc/version", "Linux version 6.1.0 #1 SMP Debian\n");
  put_file("/sys/kernel/realtime", "1\n");
}

static void limits(char *out, size_t size, const char *locked, const char *priority) {
  snprintf(out, size, "Max locked memory         %-20s %-20s bytes\nMax realtime priority     %-20s %-20s\n",
           locked, locked, priority, priority);
}

static void test_priority(void) {
  char text[512];
  limits(text, sizeof text, "unlimited", "50");
  warns("real-time priority", "/proc/self/limits", text);
  limits(text, sizeof text, "unlimited", "0");
  fails("real-time priority", "/proc/self/limits", text);
  put_file("/proc/self/limits", text);
  passes("real-time priority", "/proc/self/status", "CapEff:\t0000000000800000\n");
  put_file("/proc/self/limits", good_text("/proc/self/limits"));
  settings.rt_priority = 0;
  check_machine("real-time priority", GV_VERDICT_WARN, "priority 0 configured");
  settings.rt_priority = 80;
}

static void test_locked_memory(void) {
  char text[512];
  limits(text, sizeof text, "67108864", "95");
  warns("locked memory", "/proc/self/limits", text);
  limits(text, sizeof text, "8388608", "95");
  fails("locked memory", "/proc/self/limits", text);
  put_file("/proc/self/limits", text);
  passes("locked memory", "/proc/self/status", "CapEff:\t0000000000004000\n");
  put_file("/proc/self/limits", good_text("/proc/self/limits"));
  settings.mlock = false;
  check_machine("locked memory", GV_VERDICT_WARN, "no mlock configured");
  settings.mlock = true;
}

static void test_cpu_budget(void) {
  warns("CPU budget", "/sys/fs/cgroup/user.slice/one/cpu.max", "150000 100000\n");
  fails("CPU budget", "/sys/fs/cgroup/user.slice/one/cpu.max", "50000 100000\n");
  fails("CPU budget", "/sys/fs/cgroup/user.slice/cpu.max", "20000 100000\n");  // of a group above
  warns("CPU budget", "/sys/fs/cgroup/cpu/old/cpu.cfs_quota_us", "200000\n");
  fails("CPU budget", "/sys/fs/cgroup/cpu/old/cpu.cfs_quota_us", "50000\n");
}

static void test_throttling(void) {
  passes("RT throttling", "/proc/sys/kernel/sched_rt_runtime_us", "-1\n");
  warns("RT throttling", "/proc/sys/kernel/sched_rt_runtime_us", "700000\n");
  fails("RT throttling", "/proc/sys/kernel/sched_rt_runtime_us", "0\n");
}

static void test_frequency(void) {
  warns("frequency", CPU("0") "cpufreq/scaling_governor", "schedutil\n");
  fails("frequency", CPU("3") "cpufreq/scaling_governor", "powersave\n");
  put_file(CPU("3") "cpufreq/scaling_driver", "intel_pstate\n");
  warns("frequency", CPU("3") "cpufreq/scaling_governor", "powersave\n");
  put_file(CPU("3") "cpufreq/scaling_driver", good_text(CPU("3") "cpufreq/scaling_driver"));
}

static void test_sleep_states(void) {
  fails("sleep states", "/dev/cpu_dma_latency", NULL);
  settings.cpu_dma_latency = false;
  check_machine("sleep states", GV_VERDICT_FAIL, "not to be held");
  warns("sleep states", CPU("3") "cpuidle/state1/latency", "10\n");
  passes("sleep states", CPU("3") "cpuidle/state1/disable", "1\n");
  settings.cpu_dma_latency = true;
}

static void test_clock(void) {
  passes("clock", "/sys/devices/system/clocksource/clocksource0/current_clocksource", "kvm-clock\n");
  warns("clock", "/sys/devices/system/clocksource/clocksource0/current_clocksource", "hpet\n");
  fails("clock", "/sys/devices/system/clocksource/clocksource0/current_clocksource", "acpi_pm\n");
}

static void test_interrupts(void) {
  warns("interrupts", "/proc/irq/24/effective_affinity_list", "3\n");
  put_file("/proc/irq/25/smp_affinity_list", "0-3\n");
  fails("interrupts", "/proc/irq/24/effective_affinity_list", "2,3\n");
  put_file("/proc/irq/25/smp_affinity_list", good_text("/proc/irq/25/smp_affinity_list"));
  settings.cpu = 2;
  check_machine("interrupts", GV_VERDICT_WARN, "the loop on core 2, which serves 25");
  settings.cpu = -1;
}

static void test_virtual_machine(void) {
  warns("virtual machine", "/proc/cpuinfo", "model name\t: AMD EPYC\nflags\t\t: fpu hypervisor\nbugs\t\t:\n");
  fails("virtual machine", "/proc/cpuinfo",
        "model name\t: QEMU Virtual CPU version 2.5+\nflags\t\t: fpu hypervisor\n");
  warns("virtual machine", "/sys/hypervisor/type", "xen\n");
}

static void test_strict(void) {
  warns("strict", "/proc/sys/kernel/seccomp/actions_avail", NULL);
  settings.strict = true;
  fails("strict", "/proc/sys/kernel/seccomp/actions_avail", NULL);
  settings.strict = false;
}

static void test_can_link(void) {
  warns("CAN link", "/sys/class/net/can0/mtu", "16\n");
  warns("CAN link", "/sys/class/net/can0/tx_queue_len", "1000\n");
  warns("CAN link", "/sys/class/net/can0/tx_queue_len", "1\n");
  fails("CAN link", "/sys/class/net/can0/flags", "0x40c0\n");
  fails("CAN link", "/sys/class/net/can0/operstate", "down\n");
  fails("CAN link", "/sys/class/net/can0/mtu", NULL);
  snprintf(settings.fcu, sizeof settings.fcu, "sim:");
  passes("CAN link", "/sys/class/net/can0/flags", "0x40c0\n");
  // The second hand's link counts as well.
  snprintf(settings.fcu2, sizeof settings.fcu2, "can:can0");
  fails("CAN link", "/sys/class/net/can0/flags", "0x40c0\n");
  snprintf(settings.fcu, sizeof settings.fcu, "can:can0");
  snprintf(settings.fcu2, sizeof settings.fcu2, "can:can9");
  fails("CAN link", "/sys/class/net/can0/operstate", "up\n");
  settings.fcu2[0] = '\0';
}

static void test_lcm_route(void) {
  warns("LCM route", "/sys/class/net/lo/flags", "0x9\n");
  fails("LCM route", "/proc/net/route", ROUTE);
  fails("LCM route", "/proc/net/route", ROUTE "eth0\t000200C0\t00000000\t0001\t0\t0\t0\t00FFFFFF\t0\t0\t0\n");
  fails("LCM route", "/proc/net/route",
        ROUTE "lo\t000000E0\t00000000\t0000\t0\t0\t0\t000000F0\t0\t0\t0\n");  // not up
  // The narrower route counts, whatever their order.
  passes("LCM route", "/proc/net/route",
         ROUTE "lo\t000000E0\t00000000\t0001\t0\t0\t0\t000000F0\t0\t0\t0\n"
               "eth0\t00000000\t010200C0\t0003\t0\t0\t0\t00000000\t0\t0\t0\n");
  snprintf(settings.lcm, sizeof settings.lcm, "none");
  passes("LCM route", "/proc/net/route", ROUTE);
}

static void test_socket_buffers(void) {
  warns("socket buffers", "/proc/sys/net/core/rmem_max", "212992\n");
  fails("socket buffers", "/proc/sys/net/core/rmem_max", "65536\n");
}

static void test_serial_lines(void) {
  warns("serial lines", "/sys/bus/usb-serial/devices/ttyUSB0/latency_timer", "4\n");
  fails("serial lines", "/sys/bus/usb-serial/devices/ttyUSB0/latency_timer", "16\n");
  warns("serial lines", "/sys/bus/usb-serial/devices/ttyUSB1/latency_timer", "16\n");  // of somebody else
  passes("serial lines", "/sys/bus/usb-serial/devices/ttyUSB0/latency_timer", NULL);
}

// ---- the report -------------------------------------------------------------------------------------------

static gv_verdict report(bool json, char out[], size_t size) {
  FILE *stream = tmpfile();
  const gv_verdict worst = gv_doctor_report(&doctor, json, stream);
  rewind(stream);
  out[fread(out, 1, size - 1, stream)] = '\0';
  fclose(stream);
  return worst;
}

static void test_the_report_returns_the_worst_verdict(void) {
  static char text[16384];
  CHECK(report(false, text, sizeof text) == GV_VERDICT_PASS && !strstr(text, "WARN") && !strstr(text, "FAIL"),
        "%s", text);
  put_file("/proc/sys/net/core/rmem_max", "212992\n");
  CHECK(report(false, text, sizeof text) == GV_VERDICT_WARN && strstr(text, "WARN  socket buffers") &&
            strstr(text, "sysctl -w"),
        "%s", text);
  put_file("/sys/class/net/can0/mtu", NULL);
  CHECK(report(false, text, sizeof text) == GV_VERDICT_FAIL, "%s", text);
  CHECK(report(true, text, sizeof text) == GV_VERDICT_FAIL && strstr(text, "\"worst\": \"FAIL\"}"), "%s",
        text);
  CHECK(strstr(text, "{\"check\": \"CAN link\", \"verdict\": \"FAIL\", \"found\": \"can0: no such "
                     "interface\", \"mend\": \"sudo"),
        "%s", text);
  make_good_machine();
}

static void test_an_empty_machine_crashes_nobody(void) {
  static char text[16384];
  const gv_doctor nothing = {"/nonexistent", &settings};
  for (int i = 0; i < gv_doctor_checks(); i++)
    CHECK(gv_doctor_check(&nothing, i).found[0], "check %d says nothing", i);
  CHECK(report(false, text, sizeof text) == GV_VERDICT_PASS, "%s", text);
}

static int remove_one(const char *path, const struct stat *status, int kind, struct FTW *walk) {
  (void)status;
  (void)kind;
  (void)walk;
  return remove(path);
}

int main(void) {
  if (!mkdtemp(root))
    return 1;
  make_good_machine();
  RUN(test_a_good_machine_passes);
  RUN(test_kernel);
  RUN(test_priority);
  RUN(test_locked_memory);
  RUN(test_cpu_budget);
  RUN(test_throttling);
  RUN(test_frequency);
  RUN(test_sleep_states);
  RUN(test_clock);
  RUN(test_interrupts);
  RUN(test_virtual_machine);
  RUN(test_strict);
  RUN(test_can_link);
  RUN(test_lcm_route);
  make_good_machine();
  RUN(test_socket_buffers);
  RUN(test_serial_lines);
  RUN(test_the_report_returns_the_worst_verdict);
  RUN(test_an_empty_machine_crashes_nobody);
  nftw(root, remove_one, 16, FTW_DEPTH | FTW_PHYS);
  return check_done();
}
