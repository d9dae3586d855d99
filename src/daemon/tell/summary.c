// SPDX-License-Identifier: BSD-3-Clause
// The summary of a run as JSON and as words, from session, engine, loop and driver. Slow thread, after the
// loop has ended. Numbers are finite by construction (JSON has no not-a-number); one that is not is null.
#include "daemon/tell/summary.h"

#include <inttypes.h>
#include <math.h>

#include "daemon/load/config_load.h"
#include "daemon/loop/hands.h"
#include "daemon/tell/about_json.h"
#include "daemon/tell/json.h"

static void put_number(FILE *out, double value) {
  if (isfinite(value))
    fprintf(out, "%.17g", value);
  else
    fputs("null", out);
}

static void put_numbers(FILE *out, const double *value, int count) {
  fputc('[', out);
  for (int i = 0; i < count; i++) {
    if (i)
      fputs(", ", out);
    put_number(out, value[i]);
  }
  fputc(']', out);
}

static void put_quantiles(FILE *out, const char *key, const gv_histogram *histogram) {
  const gv_quantiles q = gv_histogram_quantiles(histogram);
  fprintf(out, "  \"%s\": {\"p50\": %.3f, \"p99\": %.3f, \"p999\": %.3f, \"max\": %.3f},\n", key, q.p50_us,
          q.p99_us, q.p999_us, q.max_us);
}

// Of each tendon: what is left, the most that gloved has given out beyond what it got, what the controller
// took.
static void put_energy(FILE *out, const gv_passivity *passivity) {
  double energy_j[GV_FINGERS], given_max_j[GV_FINGERS], dissipated_j[GV_FINGERS];
  for (int i = 0; i < GV_FINGERS; i++) {
    energy_j[i] = passivity->port[i].energy_j;
    given_max_j[i] = -passivity->port[i].energy_least_j + 0.0;
    dissipated_j[i] = passivity->port[i].dissipated_j;
  }
  fputs(",\n  \"energy_j\": ", out);
  put_numbers(out, energy_j, GV_FINGERS);
  fputs(",\n  \"energy_given_max_j\": ", out);
  put_numbers(out, given_max_j, GV_FINGERS);
  fputs(",\n  \"energy_dissipated_j\": ", out);
  put_numbers(out, dissipated_j, GV_FINGERS);
}

static void put_engine(FILE *out, const gv_session *session) {
  const gv_counters *c = gv_engine_counters(session->engine);
  fprintf(out, "  \"steps\": %" PRId64 ",\n  \"state_hash\": \"%016" PRIx64 "\",\n",
          gv_session_steps(session), gv_engine_hash(session->engine));
  fprintf(out, "  \"contacts_max\": %" PRIu32 ",\n  \"contacts_dropped\": %" PRIu64 ",\n", c->contacts_max,
          c->contacts_dropped);
  fputs("  \"depth_max_m\": ", out);
  put_number(out, c->depth_max_m);
  fputs(",\n  \"force_max_n\": ", out);
  put_numbers(out, session->force_max_n, GV_FINGERS);
  put_energy(out, &session->passivity);
  fprintf(out,
          ",\n  \"samples\": %" PRIu64 ",\n  \"samples_refused\": %" PRIu64
          ",\n  \"angles_limited\": %" PRIu64 ",\n  \"body_resets\": %" PRIu64
          ",\n  \"pairs_dropped\": %" PRIu64 ",\n  \"pairs_left_over\": %" PRIu64
          ",\n  \"overlaps\": %" PRIu64 ",\n",
          c->samples, c->samples_refused, c->angles_limited, c->body_resets, c->pairs_dropped,
          c->pairs_left_over, c->overlaps);
  fprintf(out, "  \"operations_per_s\": %.4g,\n", gv_engine_config(session->engine)->operations_per_s);
  fprintf(out,
          "  \"solver_steps\": {\"newton\": %" PRIu64 ", \"newton_softened\": %" PRIu64
          ", \"dantzig\": %" PRIu64 ", \"dantzig_lagged\": %" PRIu64 ", \"quickstep\": %" PRIu64
          ", \"none\": %" PRIu64 "},\n  \"solver_errors\": %" PRIu64 ",\n",
          c->newton_steps, c->newton_softened, c->dantzig_steps, c->dantzig_lagged, c->quickstep_steps,
          c->unsolved_steps, c->solver_errors);
}

static void put_ladder(FILE *out, const gv_loop *loop) {
  fputs("  \"ladder\": {", out);
  for (int i = 0; i < GV_RUNGS; i++)
    fprintf(out, "%s\"%s\": %" PRIu64, i ? ", " : "", gv_rung_name((gv_rung)i), loop->on_rung[i]);
  fputs("},\n", out);
}

static void put_loop(FILE *out, const gv_loop *loop) {
  fprintf(out, "  \"missed_deadlines\": %" PRIu64 ",\n  \"overruns\": %" PRIu64 ",\n", loop->missed_deadlines,
          loop->overruns);
  if (loop->cfg.sync_device)
    fprintf(out, "  \"sync\": {\"on_frame\": %" PRIu64 ", \"on_clock\": %" PRIu64 "},\n", loop->on_frame,
            loop->on_clock);
  put_ladder(out, loop);
  put_quantiles(out, "step_us", &loop->step);
  put_quantiles(out, "wake_us", &loop->wake);
  fprintf(out,
          "  \"rt_heap_calls\": %" PRIu64 ",\n  \"rt_page_faults\": {\"major\": %" PRId64
          ", \"minor\": %" PRId64 "},\n",
          loop->heap_calls, loop->page_faults.major, loop->page_faults.minor);
}

static void put_telemetry(FILE *out, const gv_summary *s) {
  fprintf(out, "  \"snapshots_dropped\": %" PRIu64 ",\n  \"telemetry_failed\": %" PRIu64 ",\n",
          gv_ring_dropped(&s->loop->snapshots), s->telemetry_failed);
}

static void put_frames(FILE *out, const gv_frame_counters *f, const gv_driver_stats *d) {
  fprintf(out,
          "  \"frames\": {\"rx\": %" PRIu64 ", \"tx\": %" PRIu64 ", \"lost\": %" PRIu64 ", \"bad\": %" PRIu64
          ", \"late\": %" PRIu64 ", \"unusable\": %" PRIu64 ", \"foreign\": %" PRIu64
          ", \"tx_failed\": %" PRIu64 ", \"overflow\": %" PRIu64 ", \"bus_errors\": %" PRIu64
          ", \"link_downs\": %" PRIu64 "},\n",
          f->rx, f->tx, f->lost, f->bad + d->bad, f->late, f->unusable, f->foreign + d->foreign, d->tx_failed,
          d->lost, d->bus_errors, d->link_downs);
}

static void put_objects(FILE *out, const gv_session *session, const gv_scene *scene, const gv_held *held) {
  fputs("  \"objects\": [", out);
  for (int i = 0; i < scene->object_count; i++) {
    const gv_object *object = &scene->object[i];
    const gv_pose T = gv_snapshot_object_pose(object, gv_engine_object_pose(session->engine, i));
    fputs(i ? ",\n    {\"name\": " : "\n    {\"name\": ", out);
    gv_json_text(out, object->name);
    fputs(", \"position\": ", out);
    put_numbers(out, &(const double[]){T.p.x, T.p.y, T.p.z}[0], 3);
    fputs(", \"quaternion\": ", out);
    put_numbers(out, &(const double[]){T.q.w, T.q.x, T.q.y, T.q.z}[0], 4);
    fprintf(out, ", \"static\": %s, \"held_s\": %.3f", object->is_static ? "true" : "false",
            held->object[i].seconds);
    fputs(", \"moved_in_hand_m\": ", out);
    put_number(out, held->object[i].moved_m);
    fputc('}', out);
  }
  fputs(scene->object_count ? "\n  ],\n" : "],\n", out);
}

static void put_second(FILE *out, const gv_session *session) {
  const gv_frame_counters *f = &session->frames;
  fputs("  \"second_hand\": {\"faults\": ", out);
  gv_json_text(out, gv_fault_text(session->faults_seen));
  fputs(", \"force_max_n\": ", out);
  put_numbers(out, session->force_max_n, GV_FINGERS);
  fputs(", \"force_final_n\": ", out);
  put_numbers(out, session->force_n, GV_FINGERS);
  fprintf(out,
          ", \"frames\": {\"rx\": %" PRIu64 ", \"tx\": %" PRIu64 ", \"lost\": %" PRIu64 ", \"bad\": %" PRIu64
          ", \"late\": %" PRIu64 "}},\n",
          f->rx, f->tx, f->lost, f->bad, f->late);
}

int gv_summary_json(const gv_summary *s, FILE *out) {
  const gv_session *session = s->loop->session;
  fputs("{\n  \"about\": ", out);
  gv_about_json(s->about, out);
  fputs(",\n  \"exit_reason\": ", out);
  gv_json_text(out, gv_exit_name(s->reason));
  fputs(",\n  \"state\": ", out);
  gv_json_text(out, gv_safety_name(s->loop->state_before_stop));
  fputs(",\n  \"faults\": ", out);
  gv_json_text(out, gv_fault_text(session->faults_seen));
  fputs(",\n  \"laxer_than_default\": ", out);
  char laxer[GV_LAXER_TEXT];
  gv_settings_laxer(&session->cfg.limiter, &session->cfg.safety, &session->cfg.passivity, laxer);
  gv_json_text(out, laxer);
  fputs(",\n  \"period_s\": ", out);
  put_number(out, session->cfg.period_s);
  fputs(",\n", out);
  put_engine(out, session);
  put_loop(out, s->loop);
  put_telemetry(out, s);
  put_frames(out, &session->frames, &s->driver);
  put_objects(out, session, s->scene, s->held);
  if (gv_hands_count(session) > 1)
    put_second(out, &session[1]);
  fputs("  \"force_final_n\": ", out);
  put_numbers(out, session->force_n, GV_FINGERS);
  fprintf(out, ",\n  \"memory\": {\"used\": %zu, \"peak\": %zu, \"size\": %zu}\n}\n", s->arena->used,
          s->arena->peak, s->arena->size);
  return ferror(out) ? -1 : 0;
}

// Millimetres, rounded to tenths; nothing is "-0.0".
static double tenths_mm(double metres) { return round(metres * 1e4) / 10.0 + 0.0; }

static void print_places(const gv_summary *s, FILE *out) {
  for (int i = 0; i < s->scene->object_count; i++) {
    const gv_object *object = &s->scene->object[i];
    if (object->is_static)
      continue;
    const gv_pose T = gv_snapshot_object_pose(object, gv_engine_object_pose(s->loop->session->engine, i));
    fprintf(out, "  %s ends at %.1f %.1f %.1f mm\n", object->name, tenths_mm(T.p.x), tenths_mm(T.p.y),
            tenths_mm(T.p.z));
  }
}

// What matters, last.
static void print_grasps(const gv_summary *s, int hand, FILE *out) {
  for (int i = 0; i < s->scene->object_count; i++) {
    const gv_held_object *held = &s->held[hand].object[i];
    if (held->seconds > 0.0)
      fprintf(out,
              "  %s was held for %.1f s, up to %.0f mm above its place: it moved %.4f mm in the %shand\n",
              s->scene->object[i].name, held->seconds, held->lift_m * 1e3, held->moved_m * 1e3,
              hand ? "second " : "");
  }
}

static void print_second(const gv_session *session, FILE *out) {
  const double *force = session->force_max_n;
  fprintf(out,
          "  second hand: largest forces %.2f %.2f %.2f %.2f %.2f N%s%s; frames in %" PRIu64 ", out %" PRIu64
          ", lost %" PRIu64 ", bad %" PRIu64 ", late %" PRIu64 "\n",
          force[0], force[1], force[2], force[3], force[4],
          session->faults_seen ? "; faults on the way: " : "",
          session->faults_seen ? gv_fault_text(session->faults_seen) : "", session->frames.rx,
          session->frames.tx, session->frames.lost, session->frames.bad, session->frames.late);
}

static void print_time(const gv_loop *loop, FILE *out) {
  const gv_quantiles step = gv_histogram_quantiles(&loop->step);
  const gv_quantiles wake = gv_histogram_quantiles(&loop->wake);
  fprintf(out, "  step p50 %.0f p99 %.0f p99.9 %.0f max %.0f us; wake-up p50 %.0f p99 %.0f max %.0f us\n",
          step.p50_us, step.p99_us, step.p999_us, step.max_us, wake.p50_us, wake.p99_us, wake.max_us);
  fprintf(out,
          "  missed deadlines %" PRIu64 ", periods skipped %" PRIu64 "; in the real-time thread %" PRIu64
          " heap calls, %" PRId64 " page faults\n",
          loop->missed_deadlines, loop->overruns, loop->heap_calls,
          loop->page_faults.major + loop->page_faults.minor);
  const uint64_t less = loop->on_rung[GV_RUNG_SOLVER] + loop->on_rung[GV_RUNG_CONTACTS];
  if (less || loop->on_rung[GV_RUNG_HOLD] || loop->on_rung[GV_RUNG_RAMP])
    fprintf(out,
            "  deadline ladder: %" PRIu64 " steps with less effort, %" PRIu64
            " periods with forces held, %" PRIu64 " ramped\n",
            less, loop->on_rung[GV_RUNG_HOLD], loop->on_rung[GV_RUNG_RAMP]);
  if (loop->cfg.sync_device)
    fprintf(out, "  steps begun by the glove's frame %" PRIu64 ", by the own clock %" PRIu64 "\n",
            loop->on_frame, loop->on_clock);
}

static void print_energy(const gv_passivity *passivity, FILE *out) {
  double mj[GV_FINGERS];
  for (int i = 0; i < GV_FINGERS; i++)
    mj[i] = -1e3 * passivity->port[i].energy_least_j + 0.0;
  fprintf(out,
          "  most energy given out beyond what the hand put in, each tendon: %.1f %.1f %.1f %.1f %.1f mJ\n",
          mj[0], mj[1], mj[2], mj[3], mj[4]);
}

static void print_warnings(const gv_summary *s, FILE *out) {
  const gv_session *session = s->loop->session;
  char laxer[GV_LAXER_TEXT];
  gv_settings_laxer(&session->cfg.limiter, &session->cfg.safety, &session->cfg.passivity, laxer);
  if (*laxer)
    fprintf(out, "  protected less than by the defaults (in brackets): %s\n", laxer);
  if (s->telemetry_failed)
    fprintf(out, "  %" PRIu64 " messages were refused by LCM or the disk\n", s->telemetry_failed);
}

void gv_summary_print(const gv_summary *s, FILE *out) {
  const gv_session *session = s->loop->session;
  const gv_counters *c = gv_engine_counters(session->engine);
  const gv_frame_counters *frames = &session->frames;
  const double *force = session->force_max_n;
  fprintf(out, "gloved: %s: %" PRId64 " steps of %g ms; ended (%s) with the safety machine in %s%s%s\n",
          s->title, gv_session_steps(session), session->cfg.period_s * 1e3, gv_exit_name(s->reason),
          gv_safety_name(s->loop->state_before_stop), session->faults_seen ? "; faults on the way: " : "",
          session->faults_seen ? gv_fault_text(session->faults_seen) : "");
  print_places(s, out);
  fprintf(out, "  contacts at most %" PRIu32 ", deepest %.3f mm; largest forces %.2f %.2f %.2f %.2f %.2f N\n",
          c->contacts_max, c->depth_max_m * 1e3, force[0], force[1], force[2], force[3], force[4]);
  print_energy(&session->passivity, out);
  print_time(s->loop, out);
  fprintf(out,
          "  frames in %" PRIu64 ", out %" PRIu64 ", lost %" PRIu64 ", bad %" PRIu64 ", late %" PRIu64 "\n",
          frames->rx, frames->tx, frames->lost, frames->bad + s->driver.bad, frames->late);
  if (gv_hands_count(session) > 1)
    print_second(&session[1], out);
  print_warnings(s, out);
  fprintf(out, "  state hash %016" PRIx64 "\n", gv_engine_hash(session->engine));
  for (int i = 0; i < gv_hands_count(session); i++)
    print_grasps(s, i, out);
}
