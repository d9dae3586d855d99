// SPDX-License-Identifier: BSD-3-Clause
// What is in force, a value to a row, and each setting by its name in the configuration (status.h).
#include "daemon/tell/status.h"

#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "daemon/load/settings_table.h"
#include "gloved/version.h"

typedef struct line {
  char text[600];
} line;

__attribute__((format(printf, 2, 3))) static void say(line *out, const char *format, ...) {
  va_list arguments;
  va_start(arguments, format);
  vsnprintf(out->text, sizeof out->text, format, arguments);
  va_end(arguments);
  for (char *c = out->text; *c; c++)
    if (*c == ';' || (unsigned char)*c < ' ' || (unsigned char)*c >= 127)
      *c = '?';
}

static void say_state(const gv_status *s, line *out) {
  const uint32_t faults = s->snapshot->faults;
  say(out, "%s%s%s", gv_safety_name(s->snapshot->safety), faults ? ": " : "",
      faults ? gv_fault_text(faults) : "");
}

static void say_switch(const gv_status *s, line *out) {
  const bool again = s->snapshot->safety == GV_SAFETY_READY && s->snapshot->dead_man;
  say(out, "%s%s", s->snapshot->dead_man ? "held" : "open",
      again ? " (let go of it, then press it again, to feel a force)" : "");
}

static void say_second(const gv_status *s, line *out) {
  const gv_second_told *second = s->second;
  if (!*s->about->fcu2)
    say(out, "none");
  else
    say(out, "%s%s%s, switch %s", gv_safety_name(second->safety), second->faults ? ": " : "",
        second->faults ? gv_fault_text(second->faults) : "", second->dead_man ? "held" : "open");
}

static void say_scene(const gv_status *s, line *out) {
  say(out, "%s (%016" PRIx64 ", %d objects)", s->about->scene.name, s->about->scene.hash,
      s->snapshot->object_count);
}

static void say_device(const gv_status *s, line *out) {
  say(out, "%s%s%s", s->about->fcu, s->about->fcu2[0] ? ", second hand " : "", s->about->fcu2);
}

static void say_tracker(const gv_status *s, line *out) {
  say(out, "%s", *s->about->tracker ? s->about->tracker : "the device's own");
}

static void say_hand(const gv_status *s, line *out) { say(out, "%s", s->about->hand); }

static void say_coupling(const gv_status *s, line *out) {
  const gv_coupling *now = &s->snapshot->limb_coupling;
  const gv_coupling *palm = &s->snapshot->palm_coupling;
  const gv_coupling *configured = &s->settings->engine.limb;
  say(out, "%.4g times the configured (limbs %g N/m and %g N m/rad, palm %g N/m and %g N m/rad)",
      configured->k_f > 0.0 ? now->k_f / configured->k_f : 1.0, now->k_f, now->k_t, palm->k_f, palm->k_t);
}

static void say_friction(const gv_status *s, line *out) { say(out, "%g, of the skin", s->snapshot->mu_hand); }

static void say_limits(const gv_status *s, line *out) {
  const gv_limiter_config *l = &s->settings->limiter;
  say(out, "%g N a finger, at least %g N, rising by %g N/s, to zero within %g ms, data at most %g ms old",
      l->max_n, l->pretension_n, l->slew_n_per_s, l->ramp_s * 1e3, l->max_age_s * 1e3);
}

static void say_laxer(const gv_status *s, line *out) {
  char laxer[GV_LAXER_TEXT];
  gv_settings_laxer(&s->settings->limiter, &s->settings->safety, &s->settings->passivity, laxer);
  say(out, "%s", *laxer ? laxer : "nothing");
}

static void say_rates(const gv_status *s, line *out) {
  say(out, "%g Hz the loop, %.0f Hz frames that came, %.0f Hz commands to the device", s->settings->rate_hz,
      s->received_hz, s->sent_hz);
}

static void say_solver(const gv_status *s, line *out) {
  say(out, "%s, narrow phase %s", gv_solver_name(s->settings->engine.solver),
      s->settings->engine.narrow == GV_NARROW_LIBCCD ? "libccd" : "core");
}

static void say_configuration(const gv_status *s, line *out) {
  say(out, "%s", *s->about->settings.name ? s->about->settings.name : "the defaults");
}

static void say_log(const gv_status *s, line *out) { say(out, "%s", *s->log ? s->log : "none"); }

static void say_version(const gv_status *s, line *out) {
  say(out, "%s (%s), running since %s", s->about->version, s->about->commit, s->about->date);
}

static const struct {
  const char *name;
  void (*say)(const gv_status *, line *);
} values[] = {
  {"state", say_state},
  {"switch", say_switch},
  {"scene", say_scene},
  {"device", say_device},
  {"tracker", say_tracker},
  {"hand", say_hand},
  {"second-hand", say_second},
  {"coupling", say_coupling},
  {"friction", say_friction},
  {"limits", say_limits},
  {"laxer-than-default", say_laxer},
  {"rates", say_rates},
  {"solver", say_solver},
  {"configuration", say_configuration},
  {"log", say_log},
  {"version", say_version},
};
enum { VALUES = sizeof values / sizeof values[0] };

static void append(char out[GV_STATUS_BYTES], const char *text) {
  const size_t used = strlen(out);
  snprintf(out + used, GV_STATUS_BYTES - used, "%s", text);
}

static void say_all(const gv_status *status, char out[GV_STATUS_BYTES]) {
  line value;
  for (int i = 0; i < VALUES; i++) {
    values[i].say(status, &value);
    append(out, i ? "; " : "");
    append(out, values[i].name);
    append(out, " ");
    append(out, value.text);
  }
}

// GROUP.KEY of the configuration, with what commands have changed since.
static bool say_setting(const gv_status *status, const char *name, char out[GV_STATUS_BYTES]) {
  char group[64] = "", value[GV_SETTINGS_VALUE];
  gv_settings now = *status->settings;
  now.engine.limb = status->snapshot->limb_coupling;
  now.engine.palm = status->snapshot->palm_coupling;
  now.engine.mu_hand = status->snapshot->mu_hand;
  const char *dot = strrchr(name, '.');
  const char *key = dot ? dot + 1 : name;
  if (dot)
    snprintf(group, sizeof group, "%.*s", (int)(dot - name), name);
  int at = 0;
  for (gv_settings_row row = gv_settings_next(group, &now, &at); row.setting;
       row = gv_settings_next(group, &now, &at)) {
    if (strcmp(row.setting->key, key) != 0)
      continue;
    line plain;
    gv_settings_value_text(row.setting, row.configuration, value);
    say(&plain, "%s", value);
    snprintf(out, GV_STATUS_BYTES, "%s", plain.text);
    return true;
  }
  return false;
}

bool gv_status_text(const gv_status *status, const char *name, char out[GV_STATUS_BYTES]) {
  line value;
  out[0] = '\0';
  if (!*name) {
    say_all(status, out);
    return true;
  }
  for (int i = 0; i < VALUES; i++) {
    if (strcmp(values[i].name, name) != 0)
      continue;
    values[i].say(status, &value);
    append(out, value.text);
    return true;
  }
  if (say_setting(status, name, out))
    return true;
  say(&value, "%.40s", name);
  append(out, value.text);
  append(out, ": no value has such a name; give");
  for (int i = 0; i < VALUES; i++) {
    append(out, i ? ", " : " ");
    append(out, values[i].name);
  }
  append(out, ", or a setting such as limiter.max_n (gloved --print-config)");
  return false;
}
