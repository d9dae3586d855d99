// SPDX-License-Identifier: BSD-3-Clause
// Passivity observer and controller (gloved/passivity.h): the observed energy against closed formulas of
// sampled springs, what the controller may and may not do to a force, and a finger on a stiff surface
// behind a slow glove: it swings without the controller and rests with it, and what that costs in stiffness.
//
//   test_passivity               the tests
//   test_passivity map           a line a stiffness, with a glove of 1 mm: how far the force swings, and
//                                what a slow press feels, without and with it
#include <string.h>

#include "gloved/force.h"
#include "gloved/passivity.h"
#include "support/check.h"

static const gv_passivity_config on = {GV_PASSIVITY_ON, 20.0, 1.0};
static const gv_passivity_config off = {GV_PASSIVITY_OFF, 20.0, 1.0};

// One period of all five tendons with the same way and force.
static void measure(gv_passivity *p, double way_m) {
  const double way[GV_FINGERS] = {way_m, way_m, way_m, way_m, way_m};
  gv_passivity_measure(p, way);
}

// A command and the time that it holds; returns what it would be with the controller.
static double command(gv_passivity *p, double desired_n, double dt_s) {
  const double desired[GV_FINGERS] = {desired_n, desired_n, desired_n, desired_n, desired_n};
  double asked[GV_FINGERS];
  gv_passivity_control(p, desired, asked);
  gv_passivity_command(p, desired, asked, asked);
  gv_passivity_hold(p, dt_s, dt_s);
  return asked[1];
}

// ---- the observer against closed formulas ------------------------------------------------------------

// A spring of K that is sampled n times a cycle of amplitude A, each force d samples old, gives out
//   sum_k K A^2 sin(k - d) (sin(k + 1) - sin(k)) = K A^2 n / 2 (cos((d + 1) a) - cos(d a)),  a = 2 pi / n
// in each cycle: for d = 0 and many samples pi / 2 K A^2 w T, the half sample of Colgate's K T / 2.
static void test_energy_of_a_sampled_spring_in_closed_form(void) {
  const double k = 1300.0, amplitude_m = 0.0043, mean_m = 0.02, dt_s = 0.001;
  for (int n = 10; n <= 1000; n *= 10) {
    for (int delay = 0; delay <= 3; delay++) {
      gv_passivity p;
      gv_passivity_init(&p, &off);
      double begun_j = 0.0;
      const double a = 2.0 * GV_PI / n;
      for (int i = 0; i <= 4 * n; i++) {
        measure(&p, mean_m + amplitude_m * sin(a * i));
        if (i == n)
          begun_j = p.port[1].energy_j;
        command(&p, k * (mean_m + amplitude_m * sin(a * (i - delay))), dt_s);
      }
      const double cycles_j = p.port[1].energy_j - begun_j;
      const double cycle_j = 0.5 * k * amplitude_m * amplitude_m * n *
                             (cos((delay + 1) * a) - cos(delay * a));
      CHECK(fabs(cycles_j - 3.0 * cycle_j) <= 1e-9 * fabs(3.0 * cycle_j), "n %d, delay %d: %.15g of %.15g J",
            n, delay, cycles_j, 3.0 * cycle_j);
      CHECK(cycle_j < 0.0, "a sampled spring gives energy out");
      CHECK(p.port[1].energy_least_j <= p.port[1].energy_j, "least");
    }
  }
}

// Colgate's wall: a mass runs into a sampled spring and is thrown back faster than it came. What the mass
// gains is what the observer says, and K / 2 sum dx^2.
static void test_a_sampled_wall_gives_what_the_mass_gains(void) {
  const double k = 2000.0, mass_kg = 0.1, dt_s = 0.002, speed_m_s = 0.3;
  gv_passivity p;
  gv_passivity_init(&p, &off);
  double x = -0.001;
  double v = speed_m_s;
  double sampled_j = 0.0;
  bool touched = false;
  while (!touched || x > 0.0) {
    touched = touched || x > 0.0;
    measure(&p, x);
    const double force_n = command(&p, x > 0.0 ? k * x : 0.0, dt_s);
    const double moved_m = v * dt_s - 0.5 * force_n / mass_kg * dt_s * dt_s;
    sampled_j += force_n * moved_m;
    x += moved_m;
    v -= force_n / mass_kg * dt_s;
  }
  measure(&p, x);
  const double gained_j = 0.5 * mass_kg * (v * v - speed_m_s * speed_m_s);
  CHECK(gained_j > 0.0 && v < -speed_m_s, "thrown back at %g m/s of %g", v, speed_m_s);
  CHECK(fabs(p.port[1].energy_j + gained_j) <= 1e-9 * gained_j, "%.15g of %.15g J", p.port[1].energy_j,
        -gained_j);
  CHECK(fabs(p.port[1].energy_j - sampled_j) <= 1e-9 * gained_j, "%.15g", sampled_j);
}

// Commands between two measurements count by their time; a device that let go by itself pulls no more; a
// pause without a way does not count.
static void test_energy_of_several_commands_and_of_pauses(void) {
  gv_passivity p;
  gv_passivity_init(&p, &off);
  measure(&p, 0.010);
  command(&p, 1.0, 0.001);
  command(&p, 4.0, 0.003);
  measure(&p, 0.012);
  CHECK_NEAR(p.port[4].energy_j, 0.002 * (1.0 * 1.0 + 4.0 * 3.0) / 4.0, 1e-15);
  gv_passivity_hold(&p, 0.016, 0.004);  // still 4 N, for a quarter of the time
  measure(&p, 0.008);
  CHECK_NEAR(p.port[4].energy_j, 0.0065 - 0.004 * 1.0, 1e-15);
  gv_passivity_forget_way(&p);
  command(&p, 4.0, 0.001);
  measure(&p, 0.1);
  CHECK_NEAR(p.port[4].energy_j, 0.0025, 1e-15);
  measure(&p, 0.2);  // at the same time: the way of both comes with the next
  command(&p, 2.0, 0.001);
  measure(&p, 0.2);
  CHECK_NEAR(p.port[4].energy_j, 0.0025 + 2.0 * 0.1, 1e-15);
}

// ---- what the controller may do ------------------------------------------------------------------------

static void test_the_controller_never_pushes_and_adds_little(void) {
  gv_passivity p;
  gv_passivity_init(&p, &on);
  unsigned long long r = 5;
  double phase = 0.0;
  int changed = 0;
  for (int i = 0; i < 100000; i++) {
    const double desired[GV_FINGERS] = {0.0, fmax(0.0, check_uniform(&r, -2.0, 12.0)), 0.02, NAN, INFINITY};
    double out[GV_FINGERS], sent[GV_FINGERS];
    phase += check_uniform(&r, 0.0, 0.6);
    measure(&p, 0.02 + 0.01 * sin(phase) + check_uniform(&r, -1e-3, 1e-3));
    gv_passivity_control(&p, desired, out);
    CHECK(out[0] == 0.0, "a force of %g N where none is asked for", out[0]);
    CHECK(out[1] >= 0.0 && out[1] <= desired[1] + fmin(1.0, desired[1]), "%g of %g N", out[1], desired[1]);
    CHECK(out[2] >= 0.0 && out[2] <= 0.04, "%g of 0.02 N", out[2]);
    CHECK(!isfinite(out[3]) && !isfinite(out[4]), "what is not finite is left to the limiter");
    changed += fabs(out[1] - desired[1]) > 0.01;
    for (int f = 0; f < GV_FINGERS; f++)
      sent[f] = f == 1 ? fmin(out[1], 6.0) : 0.0;
    gv_passivity_command(&p, desired, out, sent);
    gv_passivity_hold(&p, 0.01, 0.01);
    for (int f = 0; f < GV_FINGERS; f++)
      CHECK(isfinite(p.port[f].energy_j) && isfinite(p.port[f].damping) && p.port[f].damping <= 20.0, "%d",
            f);
  }
  CHECK(changed > 1000, "it did something in %d steps only", changed);
}

// Energy of a hundred cycles of a spring whose force is an eighth of a cycle old.
static double given_out(const gv_passivity_config *cfg) {
  const double amplitude_m = 0.002, a = 2.0 * GV_PI / 80.0;
  gv_passivity p;
  double begun_j = 0.0;
  gv_passivity_init(&p, cfg);
  for (int i = 0; i <= 80 * 120; i++) {
    measure(&p, 0.02 + amplitude_m * sin(a * i));
    if (i == 80 * 20)
      begun_j = p.port[1].energy_j;
    command(&p, 3.0 + 300.0 * amplitude_m * sin(a * (i - 10)), 0.001);
  }
  return begun_j - p.port[1].energy_j;
}

// Not half of it, as a damper would that is made after its own success.
static void test_the_damper_takes_what_the_spring_gives(void) {
  const double without_j = given_out(&off);
  const double with_j = given_out(&on);
  CHECK(without_j > 0.2 && fabs(with_j) < 0.15 * without_j, "%g J without, %g J with it", without_j, with_j);
}

// Pressed against the limiter's maximum: what does not leave is not counted as taken out.
static void test_what_the_limiter_keeps_back_was_not_dissipated(void) {
  gv_passivity p;
  gv_passivity_init(&p, &on);
  int asked_more = 0;
  for (int i = 0; i <= 8000; i++) {
    const double all[GV_FINGERS] = {3.0, 3.0, 3.0 + 30.0 * sin(0.08 * (i - 10)), 3.0, 3.0};
    double asked[GV_FINGERS];
    measure(&p, 0.02 + 0.002 * sin(0.08 * i));
    gv_passivity_control(&p, all, asked);
    asked_more += asked[2] > all[2];
    const double sent[GV_FINGERS] = {3.0, 3.0, fmin(fmax(all[2], 0.0), 2.0), 3.0, 3.0};
    gv_passivity_command(&p, all, asked, sent);
    gv_passivity_hold(&p, 0.001, 0.001);
    CHECK(p.port[2].damping <= 20.0 && !(p.port[2].added_n > 0.0), "%g N s/m, %g N added", p.port[2].damping,
          p.port[2].added_n);
  }
  CHECK(asked_more > 500, "asked for more in %d steps", asked_more);
}

// Counts of 0.05 mm at 1 kHz: a speed from one to the next would be 50 mm/s or none.
static void test_counts_of_a_fine_glove_are_not_felt(void) {
  gv_passivity p;
  double last_n = 0.0, jump_n = 0.0;
  gv_passivity_init(&p, &on);
  for (int i = 0; i <= 8000; i++) {
    measure(&p, 5e-5 * floor(20.0 * (20.0 + sin(0.08 * i))));
    const double desired_n = 3.0 + 0.4 * sin(0.08 * (i - 10));
    const double added_n = command(&p, desired_n, 0.001) - desired_n;
    if (i > 1000)
      jump_n = fmax(jump_n, fabs(added_n - last_n));
    last_n = added_n;
  }
  CHECK(p.port[1].damping > 1.0, "%g N s/m", p.port[1].damping);
  printf("figure a count of a fine glove: jumps by %.3f N at %.1f N s/m\n", jump_n, p.port[1].damping);
  CHECK(jump_n < 0.05 * p.port[1].damping, "jumps by %g N", jump_n);
}

static void test_the_damper_has_a_bound(void) {
  gv_passivity p;
  gv_passivity_init(&p, &off);
  for (int i = 0; i <= 8000; i++) {
    measure(&p, 0.02 + 0.0001 * sin(0.08 * i));
    command(&p, 3.0 + 3.0 * sin(0.08 * (i - 10)), 0.001);
  }
  CHECK_NEAR(p.port[3].damping, 20.0, 0.0);
}

static void test_switched_off_it_changes_no_bit(void) {
  gv_passivity p;
  gv_passivity_init(&p, &off);
  for (int i = 0; i < 1000; i++) {
    measure(&p, 0.02 + 0.01 * sin(0.5 * i));
    const double desired_n = 2.0 + sin(0.5 * i - 1.5);
    CHECK(command(&p, desired_n, 0.01) == desired_n, "step %d", i);
  }
  CHECK(p.port[1].damping > 0.1 && p.port[1].energy_j < -0.1, "but the observer sees it");
  CHECK(!(fabs(p.port[1].dissipated_j) > 0.0), "nothing was taken out");
}

static void test_a_silent_glove_ends_the_damping(void) {
  gv_passivity p;
  gv_passivity_init(&p, &on);
  int damped = 0;
  for (int i = 0; i < 100; i++) {
    measure(&p, 0.02 + 0.01 * sin(0.5 * i));
    const double desired_n = 2.0 + sin(0.5 * i - 1.5);
    damped += fabs(command(&p, desired_n, 0.01) - desired_n) > 0.0;
  }
  CHECK(damped > 80, "damped in %d steps", damped);
  gv_passivity_hold(&p, 0.0101, 0.0101);
  CHECK(command(&p, 2.0, 0.01) == 2.0, "on the speed of an old measurement");
}

static void test_bounds(void) {
  const gv_passivity_config usual = gv_passivity_config_default();
  CHECK(usual.controller == GV_PASSIVITY_OFF && gv_passivity_check(&usual) == NULL, "default");
  const gv_passivity_config bad[] = {{GV_PASSIVITY_ON, 51.0, 1.0}, {GV_PASSIVITY_ON, -1.0, 1.0},
                                     {GV_PASSIVITY_ON, NAN, 1.0},  {GV_PASSIVITY_ON, 20.0, 2.1},
                                     {GV_PASSIVITY_ON, 20.0, NAN}, {(gv_passivity_mode)2, 20.0, 1.0}};
  for (size_t i = 0; i < sizeof bad / sizeof *bad; i++)
    CHECK(gv_passivity_check(&bad[i]) != NULL, "row %d passes", (int)i);
}

// ---- a finger on a surface -----------------------------------------------------------------------------
// An index finger, held lightly, along its tendon (sim_device.c: 1 / sum(r^2 / k) = 184 N/m, 38 g, critically
// damped) is drawn towards a goal 20 mm inside a surface at way 0. The surface answers with K times the way
// in it, as a glove tells it at 90 Hz, 4 ms on the wire, through a filter of 20 Hz; the force leaves through
// the limiter.
static const double finger_n_m = 184.0, finger_kg = 0.038, goal_m = 0.02, filter_rad_s = 40.0 * GV_PI;
enum { GLOVE_MS = 11, WIRE_MS = 4, FROM_MS = 4000, TO_MS = 8000 };

typedef struct press_setting {
  double k_n_m;
  const gv_passivity_config *passivity;
  double quantum_m;  // of the glove; 0: exact
  double sway_m;     // of the goal, at 0.5 Hz
} press_setting;

typedef struct pressed {
  double swing_n[2];  // largest less smallest force, in the first and the second half
  double felt_n_m;    // slope of force against the finger's way: the stiffness that is felt
  double energy_j, dissipated_j;
} pressed;

typedef struct finger {
  double x_m, v_m_s;
  double on_the_wire_m[WIRE_MS];
  double seen_m, filtered_m, rate_m_s;
} finger;

typedef struct fit {
  double n, x, y, xx, xy, low[2], high[2];
} fit;

static double surface_force(finger *f, const press_setting *s, gv_passivity *p, int ms) {
  if (ms % GLOVE_MS == 0) {
    const double way_m = f->on_the_wire_m[ms % WIRE_MS];
    f->seen_m = s->quantum_m > 0.0 ? s->quantum_m * floor(way_m / s->quantum_m + 0.5) : way_m;
    measure(p, f->seen_m);
  }
  f->on_the_wire_m[ms % WIRE_MS] = f->x_m;
  f->rate_m_s += 0.001 * filter_rad_s * (filter_rad_s * (f->seen_m - f->filtered_m) - 2.0 * f->rate_m_s);
  f->filtered_m += 0.001 * f->rate_m_s;
  return fmax(0.0, s->k_n_m * f->filtered_m);
}

static double send(gv_limiter *limiter, gv_passivity *p, double wall_n) {
  const double desired[GV_FINGERS] = {0.0, wall_n, 0.0, 0.0, 0.0};
  double asked[GV_FINGERS], sent[GV_FINGERS];
  gv_passivity_control(p, desired, asked);
  gv_limiter_step(limiter, asked, true, 0.0, 0.001, sent);
  gv_passivity_command(p, desired, asked, sent);
  gv_passivity_hold(p, 0.001, 0.001);
  return sent[1];
}

static void move_finger(finger *f, double goal, double force_n) {
  const double damping = 2.0 * sqrt(finger_n_m * finger_kg);
  f->v_m_s += 0.001 / finger_kg * (finger_n_m * (goal - f->x_m) - damping * f->v_m_s - force_n);
  f->x_m += 0.001 * f->v_m_s;
}

static void add_to_fit(fit *sums, int half, double x, double y) {
  sums->n += 1.0;
  sums->x += x;
  sums->y += y;
  sums->xx += x * x;
  sums->xy += x * y;
  sums->low[half] = fmin(sums->low[half], y);
  sums->high[half] = fmax(sums->high[half], y);
}

static pressed press(press_setting s) {
  const gv_limiter_config limits = gv_limiter_config_default();
  gv_limiter limiter;
  gv_passivity p;
  finger f = {0};
  fit sums = {.low = {HUGE_VAL, HUGE_VAL}};
  gv_limiter_init(&limiter, &limits);
  gv_passivity_init(&p, s.passivity);
  for (int ms = 0; ms < TO_MS; ms++) {
    const double force_n = send(&limiter, &p, surface_force(&f, &s, &p, ms));
    move_finger(&f, goal_m + s.sway_m * sin(2.0 * GV_PI * 0.5e-3 * ms), force_n);
    if (ms >= FROM_MS)
      add_to_fit(&sums, ms >= (FROM_MS + TO_MS) / 2, f.x_m, force_n);
  }
  const double spread = sums.n * sums.xx - sums.x * sums.x;
  return (pressed){.swing_n = {sums.high[0] - sums.low[0], sums.high[1] - sums.low[1]},
                   .felt_n_m = spread > 0.0 ? (sums.n * sums.xy - sums.x * sums.y) / spread : 0.0,
                   .energy_j = p.port[1].energy_j,
                   .dissipated_j = p.port[1].dissipated_j};
}

// A limit cycle: as large in the second half as in the first.
static void test_a_stiff_surface_oscillates_without_and_rests_with_it(void) {
  const pressed without = press((press_setting){600.0, &off, 0.0, 0.0});
  const pressed with = press((press_setting){600.0, &on, 0.0, 0.0});
  printf(
      "figure 600 N/m, glove of 90 Hz: the force swings by %.2f N without the controller, by %.6f N with it; "
      "energy given out %.3f J, %.3f J\n",
      without.swing_n[1], with.swing_n[1], -without.energy_j, -with.energy_j);
  CHECK(without.swing_n[1] > 5.0 && fabs(without.swing_n[1] - without.swing_n[0]) < 0.05, "%g, then %g N",
        without.swing_n[0], without.swing_n[1]);
  CHECK(with.swing_n[1] < 0.001, "with it %g N", with.swing_n[1]);
  CHECK(without.energy_j < -5.0 && with.energy_j > -0.1, "%g and %g J", without.energy_j, with.energy_j);
  CHECK(with.dissipated_j > 0.0, "%g J", with.dissipated_j);
}

// A glove's step of 1 mm is felt as K times 1 mm, and not as an oscillation.
static void test_a_coarse_glove_is_felt_and_not_amplified(void) {
  const pressed without = press((press_setting){700.0, &off, 0.001, 0.0});
  const pressed with = press((press_setting){700.0, &on, 0.001, 0.0});
  printf("figure 700 N/m, steps of 1 mm: the force swings by %.2f N without, by %.2f N with it\n",
         without.swing_n[1], with.swing_n[1]);
  CHECK(without.swing_n[1] > 5.0, "%g N", without.swing_n[1]);
  CHECK(with.swing_n[1] < 1.5 * 0.7, "%g N", with.swing_n[1]);
}

// A person notices a change of 0.05 N at rest.
static const double noticed_n = 0.05;

static double stiffest_quiet(const gv_passivity_config *cfg) {
  double k = 100.0;
  while (k < 3000.0 && press((press_setting){k, cfg, 0.0, 0.0}).swing_n[1] < noticed_n)
    k += 10.0;
  return k - 10.0;
}

// Where nothing swings it takes a few percent of a slow press, and it lets a stiffer surface be.
static void test_what_it_costs_in_stiffness(void) {
  for (double k = 200.0; k <= 400.0; k += 100.0) {
    const double without = press((press_setting){k, &off, 0.0, 0.005}).felt_n_m;
    const double with = press((press_setting){k, &on, 0.0, 0.005}).felt_n_m;
    printf("figure %g N/m, pressed slowly: felt as %.1f N/m without the controller, as %.1f N/m with it\n", k,
           without, with);
    CHECK(fabs(with - without) < 0.05 * without, "%g N/m: felt %g and %g N/m", k, without, with);
  }
  const double without = stiffest_quiet(&off);
  const double with = stiffest_quiet(&on);
  printf("figure quiet up to %g N/m without the controller, up to %g N/m with it\n", without, with);
  CHECK(with > 1.4 * without, "%g and %g N/m", without, with);
}

static void map(void) {
  for (double k = 100.0; k <= 3000.0; k += k < 1000.0 ? 100.0 : 500.0)
    for (int mode = 0; mode < 2; mode++) {
      const pressed still = press((press_setting){k, mode ? &on : &off, 0.001, 0.0});
      const pressed slow = press((press_setting){k, mode ? &on : &off, 0.001, 0.005});
      printf("%5.0f N/m, controller %-3s: swings by %6.3f N, felt as %6.1f N/m, energy %8.4f J, taken out "
             "%.4f J\n",
             k, mode ? "on" : "off", still.swing_n[1], slow.felt_n_m, still.energy_j, still.dissipated_j);
    }
}

int main(int argc, char **argv) {
  if (argc > 1 && strcmp(argv[1], "map") == 0) {
    map();
    return 0;
  }
  RUN(test_energy_of_a_sampled_spring_in_closed_form);
  RUN(test_a_sampled_wall_gives_what_the_mass_gains);
  RUN(test_energy_of_several_commands_and_of_pauses);
  RUN(test_the_controller_never_pushes_and_adds_little);
  RUN(test_the_damper_takes_what_the_spring_gives);
  RUN(test_what_the_limiter_keeps_back_was_not_dissipated);
  RUN(test_counts_of_a_fine_glove_are_not_felt);
  RUN(test_the_damper_has_a_bound);
  RUN(test_switched_off_it_changes_no_bit);
  RUN(test_a_silent_glove_ends_the_damping);
  RUN(test_bounds);
  RUN(test_a_stiff_surface_oscillates_without_and_rests_with_it);
  RUN(test_a_coarse_glove_is_felt_and_not_amplified);
  RUN(test_what_it_costs_in_stiffness);
  return check_done();
}
