// SPDX-License-Identifier: BSD-3-Clause
// The doctor's list, and his report in words and in JSON (doctor.h).
#include "daemon/doctor/doctor.h"

#include <string.h>

#include "daemon/tell/json.h"

static const struct {
  const char *name;
  gv_examine *examine;
} checks[] = {
  {"kernel", gv_examine_kernel},
  {"real-time priority", gv_examine_priority},
  {"locked memory", gv_examine_memory},
  {"CPU budget", gv_examine_cgroup},
  {"RT throttling", gv_examine_throttling},
  {"frequency", gv_examine_governor},
  {"sleep states", gv_examine_idle},
  {"clock", gv_examine_clock},
  {"interrupts", gv_examine_interrupts},
  {"virtual machine", gv_examine_guest},
  {"strict", gv_examine_strict},
  {"CAN link", gv_examine_can},
  {"LCM route", gv_examine_lcm},
  {"socket buffers", gv_examine_buffers},
  {"serial lines", gv_examine_serial},
};

static const char *const verdict_name[] = {"PASS", "WARN", "FAIL"};

int gv_doctor_checks(void) { return (int)(sizeof checks / sizeof *checks); }

gv_finding gv_doctor_check(const gv_doctor *doctor, int i) {
  gv_finding out = {.check = checks[i].name};
  checks[i].examine(doctor, &out);
  return out;
}

static void print_words(const gv_finding *finding, FILE *out) {
  fprintf(out, "%s  %-18s  %s\n", verdict_name[finding->verdict], finding->check, finding->found);
  if (*finding->mend)
    fprintf(out, "%26s%s\n", "", finding->mend);
}

static void print_member(const char *name, const char *value, const char *end, FILE *out) {
  fprintf(out, "\"%s\": ", name);
  gv_json_text(out, value);
  fputs(end, out);
}

static void print_json(const gv_finding *finding, bool first, FILE *out) {
  fputs(first ? "  {" : ",\n  {", out);
  print_member("check", finding->check, ", ", out);
  print_member("verdict", verdict_name[finding->verdict], ", ", out);
  print_member("found", finding->found, ", ", out);
  print_member("mend", finding->mend, "}", out);
}

gv_verdict gv_doctor_report(const gv_doctor *doctor, bool json, FILE *out) {
  gv_verdict worst = GV_VERDICT_PASS;
  if (json)
    fputs("{\"checks\": [\n", out);
  for (int i = 0; i < gv_doctor_checks(); i++) {
    const gv_finding finding = gv_doctor_check(doctor, i);
    if (finding.verdict > worst)
      worst = finding.verdict;
    if (json)
      print_json(&finding, i == 0, out);
    else
      print_words(&finding, out);
  }
  if (json)
    fprintf(out, "\n], \"worst\": \"%s\"}\n", verdict_name[worst]);
  return worst;
}
