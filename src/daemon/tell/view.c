// SPDX-License-Identifier: BSD-3-Clause
// The live view: snapshots to text. A screen is built in one buffer and written at once (ANSI: home,
// clear to end of line), so that it does not flicker. Slow thread only.
#include "daemon/tell/view.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

enum { SCREEN_BYTES = 8192, COLUMNS = 79, BAR = 30 };

typedef struct screen {
  char text[SCREEN_BYTES];
  size_t length;
} screen;

// One line of the screen, cut to the terminal's width.
__attribute__((format(printf, 2, 3))) static void put_line(screen *out, const char *format, ...) {
  char line[COLUMNS + 1];
  va_list arguments;
  va_start(arguments, format);
  vsnprintf(line, sizeof line, format, arguments);
  va_end(arguments);
  int written = snprintf(out->text + out->length, SCREEN_BYTES - out->length, "%s\033[K\r\n", line);
  if (written > 0 && out->length + (size_t)written < SCREEN_BYTES)
    out->length += (size_t)written;
}

static double in_ms(double age_s) { return age_s < 99.0 ? age_s * 1e3 : 99000.0; }

static void put_head(screen *out, const gv_view *view, const gv_loop *loop, const gv_snapshot *s) {
  put_line(out, "gloved  %-8s %9.3f s  %4.0f Hz   %s", gv_safety_name(s->safety), s->time_s,
           1e9 / (double)loop->cfg.period_ns, view->title);
  if (s->faults)
    put_line(out, "%s; open the dead-man switch when it is mended", gv_fault_text(s->faults));
  else if (s->safety == GV_SAFETY_WAIT)
    put_line(out, "waiting for%s%s", s->glove_seen ? "" : " the glove", s->hand_seen ? "" : " the tracker");
  else if (s->safety == GV_SAFETY_READY && s->dead_man)
    put_line(out, "let go of the dead-man switch, then press it again");
  else if (s->safety == GV_SAFETY_READY)
    put_line(out, "close the dead-man switch, with no force on the hand, to feel it");
  else
    put_line(out, "%s", "");
}

static void put_forces(screen *out, const gv_view *view, const gv_snapshot *s) {
  put_line(out, "force                                      commanded  wanted  measured");
  for (int i = 0; i < GV_FINGERS; i++) {
    char bar[BAR + 1];
    int filled = (int)(gv_clamp(s->force_n[i] / view->force_max_n, 0.0, 1.0) * BAR + 0.5);
    memset(bar, ' ', BAR);
    memset(bar, '#', (size_t)filled);
    bar[BAR] = '\0';
    put_line(out, "  %-7s |%s|  %7.2f N %7.2f  %8.2f", gv_finger_name(i), bar, s->force_n[i], s->desired_n[i],
             s->measured_n[i]);
  }
}

// One line: what the first hand has a screen for.
static void put_second(screen *out, const gv_view *view) {
  const gv_view_hand *h = &view->second;
  const double *n = h->force_n;
  if (!h->seen)
    return;
  put_line(out, "second hand: %s%s%s, commanded %.2f %.2f %.2f %.2f %.2f N", gv_safety_name(h->safety),
           h->faults ? ", " : "", h->faults ? gv_fault_text(h->faults) : "", n[0], n[1], n[2], n[3], n[4]);
}

static void put_numbers(screen *out, const gv_loop *loop, const gv_snapshot *s) {
  const gv_quantiles step = gv_histogram_quantiles(&loop->step);
  const gv_quantiles wake = gv_histogram_quantiles(&loop->wake);
  put_line(out, "contacts %3d (most %u)   deepest so far %.3f mm   dropped %llu", s->contact_count,
           s->counters.contacts_max, s->counters.depth_max_m * 1e3,
           (unsigned long long)s->counters.contacts_dropped);
  put_line(out, "step p50 %.0f p99 %.0f max %.0f us   wake p50 %.0f p99 %.0f max %.0f us", step.p50_us,
           step.p99_us, step.max_us, wake.p50_us, wake.p99_us, wake.max_us);
  put_line(out, "missed deadlines %llu   periods skipped %llu   heap calls %llu",
           (unsigned long long)s->missed_deadlines, (unsigned long long)s->overruns,
           (unsigned long long)s->heap_calls);
  put_line(out, "frames in %llu out %llu lost %llu bad %llu late %llu", (unsigned long long)s->frames.rx,
           (unsigned long long)s->frames.tx, (unsigned long long)s->frames.lost,
           (unsigned long long)s->frames.bad, (unsigned long long)s->frames.late);
  put_line(out, "glove %.1f ms old   tracker %.1f ms old   dead-man switch %s", in_ms(s->glove_age_s),
           in_ms(s->hand_age_s), s->dead_man ? "held" : "open");
}

static bool in_hand(const gv_snapshot *s, int object) {
  for (int i = 0; i < s->contact_count; i++)
    if (s->contact[i].object == object && s->contact[i].limb >= 0)
      return true;
  return false;
}

// One object: height over the start, and how far it moved against the palm in the last second.
static void put_object(screen *out, gv_view *view, const gv_snapshot *s, int object, int row) {
  const char *name = view->scene->object[object].name;
  const gv_pose T_world_object = gv_snapshot_object_pose(&view->scene->object[object],
                                                         s->object[object].T_world_body);
  const gv_pose T_palm_object = gv_pose_mul(gv_pose_inv(s->limb[GV_LIMB_PALM].T_world_limb), T_world_object);
  gv_pose *then = &view->T_palm_object[view->screens % GV_VIEW_HISTORY][row];  // of the oldest screen kept
  const double slip_m = view->screens < GV_VIEW_HISTORY ? 0.0 : gv_norm(gv_sub(T_palm_object.p, then->p));
  char held[64] = "";
  if (view->screens == 0)
    view->start_height_m[row] = T_world_object.p.z;
  *then = T_palm_object;
  if (in_hand(s, object))
    snprintf(held, sizeof held, "touched, moved %.3f mm in the hand in 1 s", slip_m * 1e3);
  const double lifted_m = T_world_object.p.z - view->start_height_m[row];
  // never -0.0
  put_line(out, "%-16.16s lifted %7.1f mm   %s", name, round(lifted_m * 1e4) / 10.0 + 0.0, held);
}

static void put_objects(screen *out, gv_view *view, const gv_snapshot *s) {
  int row = 0;
  for (int i = 0; i < s->object_count && row < GV_VIEW_OBJECTS; i++)
    if (!view->scene->object[i].is_static)
      put_object(out, view, s, i, row++);
}

static void draw_screen(gv_view *view, const gv_loop *loop, const gv_snapshot *snapshot) {
  static screen out;
  out.length = (size_t)snprintf(out.text, SCREEN_BYTES, "\033[H");
  put_head(&out, view, loop, snapshot);
  put_forces(&out, view, snapshot);
  put_second(&out, view);
  put_line(&out, "%s", "");
  put_numbers(&out, loop, snapshot);
  put_line(&out, "%s", "");
  put_objects(&out, view, snapshot);
  put_line(&out, "%s", "");
  for (int i = 0; i < GV_VIEW_RECORDS; i++)
    put_line(&out, "%s", view->record[i]);
  fwrite(out.text, 1, out.length, stdout);
  fputs("\033[J", stdout);
  fflush(stdout);
}

static void print_line(const gv_view *view, const gv_loop *loop, const gv_snapshot *s) {
  const gv_quantiles step = gv_histogram_quantiles(&loop->step);
  printf("%8.1f s  %-7s contacts %3d  force %5.2f %5.2f %5.2f %5.2f %5.2f N  step p50 %.0f p99 %.0f us  "
         "missed %llu\n",
         s->time_s, gv_safety_name(s->safety), s->contact_count, s->force_n[0], s->force_n[1], s->force_n[2],
         s->force_n[3], s->force_n[4], step.p50_us, step.p99_us, (unsigned long long)s->missed_deadlines);
  const double *n = view->second.force_n;
  if (view->second.seen)
    printf("     second  %-7s               force %5.2f %5.2f %5.2f %5.2f %5.2f N\n",
           gv_safety_name(view->second.safety), n[0], n[1], n[2], n[3], n[4]);
  fflush(stdout);
}

void gv_view_open(gv_view *view, const char *title, const gv_scene *scene, double force_max_n, bool quiet) {
  *view = (gv_view){.scene = scene,
                    .title = title,
                    .quiet = quiet,
                    .terminal = isatty(STDOUT_FILENO) == 1,
                    .force_max_n = force_max_n};
  // hide the cursor, cut long lines, clear
  if (!quiet && view->terminal)
    fputs("\033[?25l\033[?7l\033[2J", stdout);
}

void gv_view_change_scene(gv_view *view) { view->screens = 0; }

static char *push_line(gv_view *view) {
  memmove(view->record[0], view->record[1], sizeof view->record - sizeof view->record[0]);
  return view->record[GV_VIEW_RECORDS - 1];
}

void gv_view_note(gv_view *view, const char *text) {
  if (view->terminal && !view->quiet)
    snprintf(push_line(view), sizeof view->record[0], "%s", text);
  fprintf(stderr, "gloved: %s\n", text);
}

void gv_view_record(gv_view *view, const gv_record *record) {
  char text[GV_RECORD_TEXT];
  gv_record_text(record, text);
  snprintf(push_line(view), sizeof view->record[0], "%10.3f s  %s", record->time_s, text);
  if (!view->quiet && !view->terminal)
    printf("%s\n", view->record[GV_VIEW_RECORDS - 1]);
}

void gv_view_second(gv_view *view, const gv_snapshot *snapshot) {
  view->second = (gv_view_hand){.seen = true, .safety = snapshot->safety, .faults = snapshot->faults};
  memcpy(view->second.force_n, snapshot->force_n, sizeof view->second.force_n);
}

void gv_view_snapshot(gv_view *view, int64_t now_ns, const gv_loop *loop, const gv_snapshot *snapshot) {
  if (view->quiet || now_ns < view->next_ns)
    return;
  view->next_ns = now_ns + (view->terminal ? 100000000 : 1000000000);
  if (view->terminal)
    draw_screen(view, loop, snapshot);
  else
    print_line(view, loop, snapshot);
  view->screens++;
}

void gv_view_close(gv_view *view) {
  if (!view->quiet && view->terminal)
    fputs("\033[?7h\033[?25h", stdout);
  fflush(stdout);
}
