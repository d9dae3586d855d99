// SPDX-License-Identifier: BSD-3-Clause
// The doctor on the processor: its frequency, sleep, clock, interrupts, and whether it is one.
// Kernel documentation: admin-guide/pm/cpufreq, cpuidle; core-api/irq/irq-affinity.
#include <stdlib.h>
#include <string.h>

#include "daemon/doctor/tree.h"

// ---- frequency -------------------------------------------------------------------------------------------

typedef struct governors {
  int performance, dynamic, lowest;
  char name[32];
} governors;

// powersave means "as the load asks" with the processors' own drivers, and the lowest frequency with any
// other.
static void count_governor(const gv_doctor *doctor, const char *cpu, void *user) {
  governors *g = user;
  char governor[32], driver[32];
  if (!gv_tree_read(doctor, governor, sizeof governor, "/sys/devices/system/cpu/%s/cpufreq/scaling_governor",
                    cpu))
    return;
  gv_tree_read(doctor, driver, sizeof driver, "/sys/devices/system/cpu/%s/cpufreq/scaling_driver", cpu);
  const bool own_driver = strstr(driver, "pstate") != NULL;
  if (strcmp(governor, "performance") == 0)
    g->performance++;
  else if (strcmp(governor, "powersave") == 0 && !own_driver)
    g->lowest++;
  else
    g->dynamic++;
  if (strcmp(governor, "performance") != 0)
    snprintf(g->name, sizeof g->name, "%s", governor);
}

void gv_examine_governor(const gv_doctor *doctor, gv_finding *out) {
  governors g = {0};
  gv_tree_each(doctor, "/sys/devices/system/cpu", "cpu", count_governor, &g);
  if (g.lowest)
    gv_doctor_finds(out, GV_VERDICT_FAIL, "%d cores stay at their lowest frequency (%s)", g.lowest, g.name);
  else if (g.dynamic)
    gv_doctor_finds(out, GV_VERDICT_WARN,
                    "%d cores follow their load (%s): a step after a pause takes longer", g.dynamic, g.name);
  else if (g.performance)
    gv_doctor_finds(out, GV_VERDICT_PASS, "performance");
  else
    gv_doctor_finds(out, GV_VERDICT_PASS, "the kernel does not change the frequency");
  gv_doctor_mends(out, "echo performance | sudo tee /sys/devices/system/cpu/cpu*/cpufreq/scaling_governor");
}

// ---- sleep -----------------------------------------------------------------------------------------------

typedef struct sleep_states {
  int cpu;
  long slowest_us;
  char name[32];
} sleep_states;

static void look_at_state(const gv_doctor *doctor, const char *state, void *user) {
  sleep_states *s = user;
  long latency_us = 0;
  long disabled = 0;
  gv_tree_number(doctor, &latency_us, "/sys/devices/system/cpu/cpu%d/cpuidle/%s/latency", s->cpu, state);
  gv_tree_number(doctor, &disabled, "/sys/devices/system/cpu/cpu%d/cpuidle/%s/disable", s->cpu, state);
  if (disabled || latency_us <= s->slowest_us)
    return;
  s->slowest_us = latency_us;
  gv_tree_read(doctor, s->name, sizeof s->name, "/sys/devices/system/cpu/cpu%d/cpuidle/%s/name", s->cpu,
               state);
}

void gv_examine_idle(const gv_doctor *doctor, gv_finding *out) {
  sleep_states s = {.cpu = gv_tree_loop_core(doctor)};
  char directory[96];
  snprintf(directory, sizeof directory, "/sys/devices/system/cpu/cpu%d/cpuidle", s.cpu);
  gv_tree_each(doctor, directory, "state", look_at_state, &s);
  const bool held = doctor->settings->cpu_dma_latency && gv_tree_may_write(doctor, "/dev/cpu_dma_latency");
  if (s.slowest_us <= 2)
    gv_doctor_finds(out, GV_VERDICT_PASS, "core %d does not sleep deeply", s.cpu);
  else if (held)
    gv_doctor_finds(out, GV_VERDICT_PASS,
                    "gloved keeps the cores awake while it runs (/dev/cpu_dma_latency)");
  else if (s.slowest_us <= 50)
    gv_doctor_finds(out, GV_VERDICT_WARN, "core %d takes up to %ld us to wake (%s)", s.cpu, s.slowest_us,
                    s.name);
  else
    gv_doctor_finds(out, GV_VERDICT_FAIL, "core %d takes up to %ld us to wake (%s)", s.cpu, s.slowest_us,
                    s.name);
  if (doctor->settings->cpu_dma_latency)
    gv_doctor_mends(out, "sudo setfacl -m u:$USER:w /dev/cpu_dma_latency (or run gloved as root)");
  else
    gv_doctor_mends(out, "set realtime.cpu_dma_latency = true in --config");
}

// ---- clock -----------------------------------------------------------------------------------------------

static bool one_of(const char *word, const char *const *list) {
  for (; *list; list++)
    if (strcmp(word, *list) == 0)
      return true;
  return false;
}

// What the vDSO reads costs 20 to 60 ns, a system call to an old timer chip a microsecond and more.
void gv_examine_clock(const gv_doctor *doctor, gv_finding *out) {
  static const char *const by_vdso[] = {"tsc", "kvm-clock", "arch_sys_counter", "hyperv_clocksource_tsc_page",
                                        NULL};
  static const char *const slow[] = {"acpi_pm", "jiffies", "pit", NULL};
  char source[64], available[128];
  gv_tree_read(doctor, source, sizeof source,
               "/sys/devices/system/clocksource/clocksource0/current_clocksource");
  gv_tree_read(doctor, available, sizeof available,
               "/sys/devices/system/clocksource/clocksource0/available_clocksource");
  if (one_of(source, by_vdso))
    gv_doctor_finds(out, GV_VERDICT_PASS, "%s", source);
  else if (one_of(source, slow))
    gv_doctor_finds(out, GV_VERDICT_FAIL, "%s: reading it takes microseconds", source);
  else
    gv_doctor_finds(out, GV_VERDICT_WARN, "%s: reading it takes a system call", *source ? source : "unknown");
  if (strstr(available, "tsc"))
    gv_doctor_mends(out,
                    "echo tsc | sudo tee /sys/devices/system/clocksource/clocksource0/current_clocksource");
  else
    gv_doctor_mends(out, "boot with tsc=reliable where the processor's counter is sound");
}

// ---- interrupts ------------------------------------------------------------------------------------------

typedef struct interrupts {
  int core, all, here;
} interrupts;

static void count_interrupt(const gv_doctor *doctor, const char *number, void *user) {
  interrupts *i = user;
  char list[256];
  if (!gv_tree_read(doctor, list, sizeof list, "/proc/irq/%s/effective_affinity_list", number) || !*list)
    if (!gv_tree_read(doctor, list, sizeof list, "/proc/irq/%s/smp_affinity_list", number))
      return;
  i->all++;
  i->here += gv_tree_list_has(list, i->core);
}

void gv_examine_interrupts(const gv_doctor *doctor, gv_finding *out) {
  interrupts i = {.core = gv_tree_loop_core(doctor)};
  gv_tree_each(doctor, "/proc/irq", "", count_interrupt, &i);
  if (i.here == 0)
    gv_doctor_finds(out, GV_VERDICT_PASS, "none of %d is served by core %d, the loop's", i.all, i.core);
  else if (i.here < i.all)
    gv_doctor_finds(out, GV_VERDICT_WARN, "%d of %d are served by core %d, the loop's", i.here, i.all,
                    i.core);
  else
    gv_doctor_finds(out, GV_VERDICT_FAIL, "all %d are served by core %d, the loop's", i.all, i.core);
  if (gv_tree_cores(doctor) < 2)
    gv_doctor_mends(out, "give the machine a second core");
  else if (i.here < i.all)
    gv_doctor_mends(
        out,
        "for i in /proc/irq/[0-9]*; do echo 0 | sudo tee $i/smp_affinity_list; done (some cannot be moved)");
  else
    gv_doctor_mends(out, "set realtime.cpu in --config to another core");
}

// ---- a processor of its own ------------------------------------------------------------------------------

void gv_examine_guest(const gv_doctor *doctor, gv_finding *out) {
  char text[TREE_TEXT], hypervisor[64];
  gv_tree_read(doctor, text, sizeof text, "/proc/cpuinfo");
  gv_tree_read(doctor, hypervisor, sizeof hypervisor, "/sys/hypervisor/type");
  const char *model = gv_tree_line(text, "model name");
  const char *flags = gv_tree_line(text, "flags");
  const char *flag = flags ? strstr(flags, " hypervisor") : NULL;
  const bool guest = *hypervisor || (flag && flag < flags + strcspn(flags, "\n"));
  if (model && strncmp(model, "QEMU", 4) == 0)
    gv_doctor_finds(out, GV_VERDICT_FAIL, "an emulated processor: no deadline of its own");
  else if (guest)
    gv_doctor_finds(out, GV_VERDICT_WARN,
                    "a virtual machine: its host can make it stand still for milliseconds");
  else
    gv_doctor_finds(out, GV_VERDICT_PASS, "not a virtual machine");
  gv_doctor_mends(out, "run gloved on the machine itself");
}
