// SPDX-License-Identifier: BSD-3-Clause
// The configuration and the calibration: the examples in data/ equal the built-in defaults bit by bit, every
// setting arrives where it belongs, and every mistake gets its one line with file, line, what and what to do.
// Runs in the project's top folder.
#include <string.h>
#include <unistd.h>

#include "daemon/options.h"
#include "support/check.h"

static char err[1024];

// Writes the text to a temporary file whose name is left in path.
static void write_file(char path[64], const char *text, size_t size) {
  snprintf(path, 64, "/tmp/gloved-test-XXXXXX");
  int fd = mkstemp(path);
  CHECK(fd >= 0 && write(fd, text, size) == (ssize_t)size, "cannot write %s", path);
  close(fd);
}

static int load_settings(const char *text, gv_settings *out) {
  char path[64];
  write_file(path, text, strlen(text));
  err[0] = 0;
  int result = gv_settings_load(path, out, err, sizeof err);
  unlink(path);
  return result;
}

static int load_calibration(const char *text, gv_calibration *out) {
  char path[64];
  write_file(path, text, strlen(text));
  err[0] = 0;
  int result = gv_calibration_load(path, out, err, sizeof err);
  unlink(path);
  return result;
}

// ---- defaults -------------------------------------------------------------------------------------

#define SAME(field)                                                                                          \
  CHECK(memcmp(&a.field, &b.field, sizeof a.field) == 0, "%s differs from its default", #field)

static void test_example_equals_the_defaults(void) {
  gv_settings a, b;
  CHECK(gv_settings_load("data/gloved.conf", &a, err, sizeof err) == 0, "%s", err);
  gv_settings_default(&b);
  SAME(engine.step_s);
  SAME(engine.hand.side);
  SAME(engine.hand.segment_m);
  SAME(engine.hand.radius_m);
  SAME(engine.hand.base_m);
  SAME(engine.hand.palm_center_m);
  SAME(engine.hand.palm_half_m);
  SAME(engine.hand.palm_radius_m);
  SAME(engine.hand.angle_min_rad);
  SAME(engine.hand.angle_max_rad);
  SAME(engine.calibration);
  SAME(engine.T_receiver_wrist);
  SAME(engine.limb_mass_kg);
  SAME(engine.palm_mass_kg);
  SAME(engine.limb);
  SAME(engine.palm);
  SAME(engine.rotation_law);
  SAME(engine.limb_gravity);
  SAME(engine.finger_joints);
  SAME(engine.filter_hz);
  SAME(engine.filter_rest_hz);
  SAME(engine.finger);
  SAME(engine.gate_rad_s);
  SAME(engine.gate_m_s);
  SAME(engine.prediction_s);
  SAME(engine.mu_hand);
  SAME(engine.patch_m);
  SAME(engine.friction);
  SAME(engine.contact_erp);
  SAME(engine.contact_cfm);
  SAME(engine.world_cfm);
  SAME(engine.contact_margin_m);
  SAME(engine.solver);
  SAME(engine.period_s);
  SAME(engine.rest_s);
  SAME(engine.override_gravity_m_s2);
  SAME(engine.override_mass_kg);
  SAME(engine.override_mu);
  SAME(engine.override_sphere_inertia);
  SAME(limiter.max_n);
  SAME(limiter.finger_max_n);
  SAME(limiter.pretension_n);
  SAME(limiter.slew_n_per_s);
  SAME(limiter.ramp_s);
  SAME(limiter.max_age_s);
  SAME(safety.max_age_s);
  SAME(safety.status_age_s);
  SAME(safety.arm_below_n);
  SAME(safety.bad_limit);
  SAME(safety.bad_window_s);
  SAME(safety.overrun_limit);
  SAME(T_world_tracker);
  SAME(scene);
  SAME(fcu);
  SAME(tracker);
  SAME(lcm);
  SAME(calibration);
  SAME(rate_hz);
  SAME(cpu);
  SAME(rt_priority);
  SAME(mlock);
}

// data/gloved.conf is what --print-config writes: one table says what a setting is (`gloved
// --print-config > data/gloved.conf`).
static void test_the_documented_configuration_comes_from_the_table(void) {
  char *written = NULL;
  size_t size = 0;
  FILE *out = open_memstream(&written, &size);
  CHECK(gv_settings_print(out) == 0, "not written");
  fclose(out);
  static char file[65536];
  FILE *in = fopen("data/gloved.conf", "rb");
  const size_t length = in ? fread(file, 1, sizeof file, in) : 0;
  if (in)
    fclose(in);
  size_t same = 0;
  size_t line = 1;
  while (same < length && same < size && file[same] == written[same])
    line += file[same++] == '\n';
  CHECK(same == length && same == size, "data/gloved.conf differs from --print-config in line %zu", line);
  free(written);
}

static void test_empty_file_is_the_default(void) {
  gv_settings a, b;
  CHECK(load_settings("version = 1;\n", &a) == 0, "%s", err);
  gv_settings_default(&b);
  SAME(engine.hand.segment_m);
  SAME(engine.limb);
  SAME(limiter);
  SAME(rate_hz);
  SAME(scene);
}

static void test_defaults_are_sound(void) {
  gv_settings s;
  gv_settings_default(&s);
  CHECK(gv_config_check(&s.engine) == NULL, "%s", gv_config_check(&s.engine));
  CHECK(s.limiter.max_n <= 12.0, "more than a CyberGrasp pulls: %g", s.limiter.max_n);
  CHECK(access(s.scene, R_OK) == 0, "the default scene %s is not there", s.scene);
}

static void test_unknown_narrow_phase_is_refused(void) {
  gv_config c = gv_config_default();
  c.narrow = (gv_narrow)7;
  const char *field = gv_config_check(&c);
  CHECK(field && !strcmp(field, "narrow"), "%s", field ? field : "passes as sound");
}

static void test_calibration_example_equals_the_default(void) {
  gv_calibration a, b = gv_calibration_default();
  CHECK(gv_calibration_load("data/calibration/default.cal", &a, err, sizeof err) == 0, "%s", err);
  CHECK(memcmp(&a, &b, sizeof a) == 0, "default.cal differs from gv_calibration_default");
}

// ---- values ---------------------------------------------------------------------------------------

static void test_paper_preset_comes_first(void) {
  gv_settings s;
  gv_config paper = gv_config_paper();
  CHECK(load_settings("version = 1;\ncoupling = { limb = { k_f = 250; }; };\npreset = \"paper\";\n", &s) == 0,
        "%s", err);
  CHECK(s.engine.limb.k_f == 250.0, "%g", s.engine.limb.k_f);
  CHECK(s.engine.limb.d_f == paper.limb.d_f && s.engine.override_mass_kg == paper.override_mass_kg,
        "not the paper's");
  CHECK(s.engine.rotation_law == GV_ROTATION_PAPER && s.engine.friction == GV_FRICTION_FIXED_LIMIT,
        "not the paper's");
}

static void test_friction_over_a_preset(void) {
  gv_settings s;
  const char *text = "version = 1;\npreset = \"paper\";\ncontact = { friction = \"coulomb\"; };\n";
  CHECK(load_settings(text, &s) == 0 && s.engine.friction == GV_FRICTION_COULOMB, "%s", err);
}

static void test_settings_arrive(void) {
  gv_settings s;
  CHECK(load_settings(
            "version = 1;\n"
            "scene = \"a.scene\"; fcu = \"trace:b.log\"; tracker = \"serial:/dev/ttyS0?type=fastrak\"; lcm = "
            "\"none\";\n"
            "rate_hz = 500; realtime = { cpu = 1; priority = 0; mlock = false; };\n"
            "hand = { side = \"left\"; palm_radius_mm = 9; palm_half_mm = (30, 25.5, 2);\n"
            "  segment_mm = ([50,30,25],[40,22,20],[47,28,21],[43,26,23],[34,18,20]);\n"
            "  limits_deg = { index_pij = [5, 95]; }; };\n"
            "receiver = { position_mm = [10, 20, -30]; orientation = [0.0, 0.0, 0.0, 1.0]; };\n"
            "tracker_to_world = { position_mm = [-1500, 0, 900]; orientation = [0.6, 0.0, 0.0, 0.8]; };\n"
            "filter = { corner_hz = 0; gate_rad_s = 0.5; gate_m_s = 0.1; };\n"
            "coupling = { rotation_law = \"paper\"; limb_gravity = true; finger_joints = true; "
            "palm = { mass_kg = 0.2; d_t = 3; }; "
            "};\n"
            "contact = { narrow = \"libccd\"; mu_hand = 1; friction = \"fixed_limit\"; erp = 0.5; cfm = "
            "0.01; world_cfm = 1e-9; margin_mm = 1; };\n"
            "solver = { step_s = 0.002; method = \"quickstep\"; rest_s = 1.5; };\n"
            "override = { gravity_m_s2 = 1.5; mass_kg = 2; mu = 3; sphere_inertia = true; };\n"
            "limiter = { max_n = 3.5; slew_n_per_s = 100; ramp_s = 0.04; max_age_s = 0.02; };\n"
            "safety = { max_age_s = 0.03; arm_below_n = 0.2; bad_limit = 3; bad_window_s = 0.5; "
            "overrun_limit = 7; };\n"
            "passivity = { controller = \"on\"; damping_max = 7; add_max_n = 0.25; };\n",
            &s) == 0,
        "%s", err);
  CHECK(!strcmp(s.scene, "a.scene") && !strcmp(s.fcu, "trace:b.log") && !strcmp(s.lcm, "none"), "texts");
  CHECK(!strcmp(s.tracker, "serial:/dev/ttyS0?type=fastrak"), "%s", s.tracker);
  CHECK(s.rate_hz == 500 && s.cpu == 1 && s.rt_priority == 0 && !s.mlock, "process");
  const gv_hand_model *h = &s.engine.hand;
  CHECK(h->side == GV_LEFT && h->palm_radius_m == 0.009 && h->palm_half_m.y == 0.0255, "hand");
  CHECK(h->segment_m[0][0] == 0.05 && h->segment_m[4][1] == 0.018, "segments");
  CHECK_NEAR(h->angle_min_rad[GV_INDEX_PIJ], 5 * GV_PI / 180, 1e-15);
  CHECK_NEAR(h->angle_max_rad[GV_INDEX_PIJ], 95 * GV_PI / 180, 1e-15);
  CHECK(s.engine.T_receiver_wrist.p.z == -0.03 && s.engine.T_receiver_wrist.q.z == 1, "receiver");
  CHECK(s.T_world_tracker.p.x == -1.5 && s.T_world_tracker.p.z == 0.9 && s.T_world_tracker.q.z == 0.8,
        "tracker_to_world");
  CHECK(s.engine.filter_hz == 0 && s.engine.gate_rad_s == 0.5 && s.engine.gate_m_s == 0.1, "filter");
  CHECK(s.engine.rotation_law == GV_ROTATION_PAPER && s.engine.limb_gravity && s.engine.finger_joints,
        "coupling");
  CHECK(s.engine.palm_mass_kg == 0.2 && s.engine.palm.d_t == 3, "palm");
  CHECK(s.engine.narrow == GV_NARROW_LIBCCD, "narrow phase");
  CHECK(s.engine.mu_hand == 1 && s.engine.friction == GV_FRICTION_FIXED_LIMIT && s.engine.contact_erp == 0.5,
        "contact");
  CHECK(s.engine.contact_cfm == 0.01 && s.engine.world_cfm == 1e-9 && s.engine.contact_margin_m == 0.001,
        "contact");
  CHECK(s.engine.step_s == 0.002 && s.engine.solver == GV_SOLVER_QUICKSTEP, "solver");
  CHECK(s.engine.rest_s == 1.5, "solver");
  CHECK(s.engine.override_gravity_m_s2 == 1.5 && s.engine.override_mass_kg == 2 &&
            s.engine.override_mu == 3 && s.engine.override_sphere_inertia,
        "override");
  CHECK(s.limiter.max_n == 3.5 && s.limiter.slew_n_per_s == 100 && s.limiter.ramp_s == 0.04 &&
            s.limiter.max_age_s == 0.02,
        "limiter");
  CHECK(s.safety.max_age_s == 0.03 && s.safety.arm_below_n == 0.2 && s.safety.bad_limit == 3 &&
            s.safety.bad_window_s == 0.5 && s.safety.overrun_limit == 7,
        "safety");
  CHECK(s.passivity.controller == GV_PASSIVITY_ON && s.passivity.damping_max == 7.0 &&
            s.passivity.add_max_n == 0.25,
        "passivity");
}

static void test_named_calibration_is_read(void) {
  char path[64], text[4096] = "version = 1;\nsensors = {\n", conf[256];
  for (int i = 0; i < GV_SENSORS; i++) {
    size_t n = strlen(text);
    snprintf(text + n, sizeof text - n, "%s = { raw = [%d, 200]; deg = [-10, 80]; };\n", gv_sensor_name(i),
             i);
  }
  strcat(text, "};\n");
  write_file(path, text, strlen(text));
  snprintf(conf, sizeof conf, "version = 1;\ncalibration = \"%s\";\npreset = \"paper\";\n", path);
  gv_settings s;
  CHECK(load_settings(conf, &s) == 0, "%s", err);
  CHECK_NEAR(gv_calibration_angle(&s.engine.calibration, 7, 200), 80 * GV_PI / 180, 1e-12);
  CHECK_NEAR(gv_calibration_angle(&s.engine.calibration, 7, 7), -10 * GV_PI / 180, 1e-12);
  unlink(path);
  CHECK(load_settings(conf, &s) < 0 && strstr(err, ":2: ") && strstr(err, "cannot open"), "%s", err);
}

// ---- mistakes -------------------------------------------------------------------------------------

typedef struct mistake {
  const char *text, *line, *what;
} mistake;

// One line, naming the file, the line, what is wrong and (after a ; or "did you mean") what to do.
static void check_message(const mistake *m, int result) {
  CHECK(result < 0, "accepted: %s", m->text);
  CHECK(strncmp(err, "/tmp/gloved-test-", 17) == 0, "no file in: %s", err);
  CHECK(strstr(err, m->line), "no '%s' in: %s", m->line, err);
  CHECK(strstr(err, m->what), "no '%s' in: %s", m->what, err);
  CHECK(strstr(err, ";") || strstr(err, "did you mean") || strstr(err, "known here"), "no remedy in: %s",
        err);
  CHECK(!strchr(err, '\n') && strlen(err) < 500, "not one line: %s", err);
}

#define V "version = 1;\n"
static const mistake settings_mistakes[] = {
  {"", ": ", "'version' is missing"},
  {"\nversion = 2;\n", ":2: ", "version 2 is not known"},
  {"verson = 1;\n", ":1: ", "did you mean 'version'"},
  {V "limitr = { };\n", ":2: ", "unknown setting 'limitr'; did you mean 'limiter'?"},
  {V "bananas = 3;\n", ":2: ", "unknown setting 'bananas'; known here: version, preset"},
  {V "limiter = {\n  max_n = 5;\n  slew_n_per_sec = 3;\n};\n", ":4: ", "did you mean 'slew_n_per_s'"},
  {V "limiter = 3;\n", ":2: ", "'limiter' must be a group"},
  {V "limiter = { max_n = 13; };\n", ":2: ", "'max_n' is 13; give a number from 0 to 12.285"},
  {V "limiter = { max_n = -1; };\n", ":2: ", "'max_n' is -1"},
  {V "limiter = { max_n = \"3\"; };\n", ":2: ", "'max_n' is no number"},
  {V "limiter = { max_n = 1e999; };\n", ":2: ", "'max_n' is not finite"},
  {V "limiter = { max_n = 4294967299; };\n", ":2: ", "the integer 4294967299 is too large"},
  {V "limiter = { max_n = -4294967299; };\n", ":2: ", "too large"},
  {V "limiter = { max_n = 0x100000003; };\n", ":2: ", "too large"},
  {V "limiter = { max_n = nan; };\n", ":2: ", "syntax error"},
  {V "rate_hz = true;\n", ":2: ", "'rate_hz' is no number"},
  {V "rate_hz = 0;\n", ":2: ", "'rate_hz' is 0"},
  {V "rate_hz = 500\nrate_hz = 600;\n", ":3: ", "twice"},
  {V "realtime = { priority = 100; };\n", ":2: ", "'priority' is 100"},
  {V "realtime = { priority = 10.5; };\n", ":2: ", "whole number"},
  {V "realtime = { mlock = 1; };\n", ":2: ", "'mlock' is neither true nor false"},
  {V "scene = box;\n", ":2: ", "syntax error"},
  {V "scene = 5;\n", ":2: ", "'scene' is no text"},
  {V "scene = \"a\\nb\";\n", ":2: ", "control character"},
  {V "preset = \"papers\";\n", ":2: ", "\"default\" or \"stock\" or \"paper\""},
  {V "contact = { friction = \"pyramid\"; };\n", ":2: ", "is none of its choices; write \"coulomb\""},
  {V "hand = { side = \"both\"; };\n", ":2: ", "\"right\" or \"left\""},
  {V "hand = {\n segment_mm = ([46.6, 31.4, 26.9]);\n};\n", ":3: ", "5 rows"},
  {V "hand = {\n radius_mm = ([11,10,9],\n [9,8,7],\n [9,8],\n [9,8,7],[8,7,6]);\n};\n",
   ":5: ", "has 2 numbers; write 3"},
  {V "hand = { segment_mm = ([0.0466,1.0,1.0],[1,1,1],[1,1,1],[1,1,1],[1,1,1]); };\n", ":2: ", "is 0.0466"},
  {V "hand = { palm_center_mm = [1, 2.5, 3]; };\n", ":2: ", "every entry with a decimal point"},
  {V "hand = { palm_center_mm = 3; };\n", ":2: ", "[x, y, z] in millimetres"},
  {V "hand = { limits_deg = {\n index_pij = [90, 10]; }; };\n", ":3: ", "smaller angle first"},
  {V "hand = { limits_deg = {\n index_pip = [0, 10]; }; };\n", ":3: ", "did you mean 'index_pij'"},
  {V "receiver = { orientation = [0.5, 0.0, 0.0, 0.0]; };\n", ":2: ", "length 0.5"},
  {V "coupling = { limb = { k_f = -5; }; };\n", ":2: ", "'k_f' is -5"},
  {V "coupling = { rotation_law = \"exp\"; };\n", ":2: ", "\"log\" or \"paper\""},
  {V "contact = { world_cfm = 0; };\n", ":2: ", "'world_cfm' is 0"},
  {V "contact = { narrow = \"gjk\"; };\n", ":2: ", "\"core\" or \"libccd\""},
  {V "solver = { method = 1; };\n", ":2: ", "\"auto\" or \"newton\" or \"dantzig\" or \"quickstep\""},
  {V "solver = { method = \"quick\"; };\n", ":2: ", "\"auto\" or \"newton\" or \"dantzig\" or \"quickstep\""},
  {V "solver = { method = \"direct\"; };\n",
   ":2: ", "\"auto\" or \"newton\" or \"dantzig\" or \"quickstep\""},
  {V "solver = \"quick\";\n", ":2: ", "\"auto\" or \"newton\" or \"dantzig\" or \"quickstep\""},
  {V "solver = 3;\n", ":2: ", "'solver'"},
  {V "solver = { dantzig_contacts = 5; };\n", ":2: ", "dantzig_contacts"},
  {V "safety = { bad_limit = 0; };\n", ":2: ", "'bad_limit' is 0"},
  {V "calibration = \"/nonexistent.cal\";\n", ":2: ", "/nonexistent.cal: cannot open"},
  {V "@include \"other.conf\"\n", ":2: ", "'@include' is not supported"},
  {V "/* rate_hz = 3;\n", ":2: ", "never ends"},
  {V "scene = \"box;\n", ":2: ", "never ends"},
  {V "limiter = { max_n = 3;\n", ":", "bracket"},
  {"\xff\xfe garbage", ":1: ", "syntax error"},
};

// No configuration makes forces rise, last or go on for longer than the bounds in the code.
static void test_no_file_passes_the_bounds_of_safety(void) {
  static const char *const refused[] = {
    "limiter = { ramp_s = 1.0; };",           "limiter = { max_age_s = 1.0; };",
    "limiter = { slew_n_per_s = 10000.0; };", "limiter = { max_n = 13.0; };",
    "limiter = { pretension_n = 2.0; };",     "limiter = { finger_max_n = [12, 12, 12, 12, 13]; };",
    "safety = { max_age_s = 1.0; };",         "safety = { status_age_s = 1.0; };",
    "safety = { arm_below_n = 12.0; };",      "safety = { bad_limit = 10000; };",
    "safety = { overrun_limit = 10000; };",   "safety = { bad_window_s = 0.001; };",
  };
  char text[200];
  gv_settings s;
  for (size_t i = 0; i < sizeof refused / sizeof *refused; i++) {
    snprintf(text, sizeof text, V "%s\n", refused[i]);
    CHECK(load_settings(text, &s) != 0, "%s passes as sound", refused[i]);
    CHECK(strstr(err, ":2: ") && strstr(err, "give a number from"), "%s: %s", refused[i], err);
  }
}

static bool has_row(const gv_setting rows[], int count, size_t offset) {
  for (int i = 0; i < count; i++)
    if (rows[i].offset == offset)
      return true;
  return false;
}

// Every row's default lies within its bounds and is not laxer than itself; every member has its row.
static void test_every_setting_of_safety_has_bounds(void) {
  const gv_limiter_config limiter = gv_limiter_config_default();
  const gv_safety_config safety = gv_safety_config_default();
  CHECK(gv_limiter_check(&limiter) == NULL && gv_safety_check(&safety) == NULL, "a default is out of bounds");
  for (size_t at = 0; at < sizeof limiter; at += sizeof(double))
    CHECK(has_row(gv_limiter_settings, GV_LIMITER_SETTINGS, at) ||
              (at > offsetof(gv_limiter_config, finger_max_n) &&
               at < offsetof(gv_limiter_config, pretension_n)),
          "limiter at %zu", at);
  CHECK(GV_SAFETY_SETTINGS == 6 && sizeof safety == 4 * sizeof(double) + 4 * sizeof(unsigned),
        "a member without a row");
}

static void test_what_protects_less_than_the_default_is_told(void) {
  char laxer[GV_LAXER_TEXT];
  gv_settings s;
  gv_settings_default(&s);
  gv_settings_laxer(&s.limiter, &s.safety, &s.passivity, laxer);
  CHECK(!*laxer, "the defaults: %s", laxer);
  CHECK(load_settings(V "limiter = { ramp_s = 0.01; max_n = 3.0; }; safety = { bad_window_s = 0.2; };\n",
                      &s) == 0,
        "%s", err);
  gv_settings_laxer(&s.limiter, &s.safety, &s.passivity, laxer);
  CHECK(!*laxer, "stricter: %s", laxer);
  CHECK(load_settings(V "limiter = { ramp_s = 0.03; finger_max_n = [12.0, 12.0, 12.0, 12.1, 1.0]; }; safety "
                        "= { bad_window_s = 0.05; "
                        "bad_limit = 12; };\n",
                      &s) == 0,
        "%s", err);
  gv_settings_laxer(&s.limiter, &s.safety, &s.passivity, laxer);
  CHECK(!strcmp(laxer,
                "limiter.finger_max_n 12.1 (12), limiter.ramp_s 0.03 (0.015), safety.bad_limit 12 (10), "
                "safety.bad_window_s 0.05 (0.1)"),
        "%s", laxer);
  CHECK(load_settings(V "passivity = { controller = \"on\"; add_max_n = 2.0; };\n", &s) == 0, "%s", err);
  gv_settings_laxer(&s.limiter, &s.safety, &s.passivity, laxer);
  CHECK(!strcmp(laxer, "passivity.add_max_n 2 (1)"), "%s", laxer);
  CHECK(load_settings(V "passivity = { add_max_n = 2.1; };\n", &s) != 0, "2.1 N passes");
  CHECK(load_settings(V "passivity = { controller = \"yes\"; };\n", &s) != 0, "\"yes\" passes");
}

// A word alone names the solver; presets set it, and a later word wins.
static void test_solver_by_its_name(void) {
  static const struct {
    const char *text;
    gv_solver solver;
  } said[] = {{V, GV_SOLVER_AUTO},
              {V "solver = \"newton\";\n", GV_SOLVER_NEWTON},
              {V "solver = { method = \"dantzig\"; };\n", GV_SOLVER_DANTZIG},
              {V "preset = \"stock\";\n", GV_SOLVER_DANTZIG},
              {V "preset = \"paper\";\n", GV_SOLVER_DANTZIG},
              {V "preset = \"stock\"; solver = \"quickstep\";\n", GV_SOLVER_QUICKSTEP}};
  gv_settings s;
  for (size_t i = 0; i < sizeof said / sizeof *said; i++) {
    CHECK(load_settings(said[i].text, &s) == 0, "%s", err);
    CHECK(s.engine.solver == said[i].solver, "%s gave %s", said[i].text, gv_solver_name(s.engine.solver));
  }
}

// The solvers' time is a share of the loop's period, whatever the integration step is.
static void test_period_is_the_loops(void) {
  gv_settings s;
  const gv_options by_rate = {.rate_hz = 500.0};
  CHECK(gv_options_settings(&by_rate, &s, err, sizeof err) == 0 && s.engine.period_s == 0.002, "%g s",
        s.engine.period_s);
  static const char text[] = V "rate_hz = 250.0; solver = { step_s = 0.0005; };\n";
  char path[64];
  write_file(path, text, sizeof text - 1);
  const gv_options by_file = {.config = path};
  CHECK(gv_options_settings(&by_file, &s, err, sizeof err) == 0, "%s", err);
  unlink(path);
  CHECK(s.engine.period_s == 0.004 && s.engine.step_s == 0.0005, "%g s, step %g s", s.engine.period_s,
        s.engine.step_s);
}

// An enumeration is checked like a number.
static void test_unknown_enumerations_are_refused(void) {
  gv_config c = gv_config_default();
  CHECK(gv_config_check(&c) == NULL, "the default is sound");
  c.solver = (gv_solver)7;
  CHECK(gv_config_check(&c) && !strcmp(gv_config_check(&c), "method"), "solver 7");
  c = gv_config_default();
  c.solver = (gv_solver)-1;
  CHECK(gv_config_check(&c) && !strcmp(gv_config_check(&c), "method"), "solver -1");
  c = gv_config_default();
  c.friction = (gv_friction)5;
  CHECK(gv_config_check(&c) && !strcmp(gv_config_check(&c), "friction"), "friction 5");
  c = gv_config_default();
  c.rotation_law = (gv_rotation_law)2;
  CHECK(gv_config_check(&c) && !strcmp(gv_config_check(&c), "rotation_law"), "rotation law 2");
  c = gv_config_default();
  c.hand.side = (gv_side)2;
  CHECK(gv_config_check(&c) && !strcmp(gv_config_check(&c), "hand.side"), "side 2");
}

static void test_wrong_settings_are_refused(void) {
  gv_settings s;
  for (size_t i = 0; i < sizeof settings_mistakes / sizeof *settings_mistakes; i++)
    check_message(&settings_mistakes[i], load_settings(settings_mistakes[i].text, &s));
}

#define S V "sensors = {\n"
#define R(name) name " = { raw = [0, 9]; deg = [0, 90]; };\n"
static const mistake calibration_mistakes[] = {
  {V, ": ", "'sensors' is missing"},
  {S "};\n", ":2: ", "'thumb_rotate' is missing"},
  {S "thumb_rotat = { raw = [0, 1]; deg = [0, 90]; };\n};\n", ":3: ", "did you mean 'thumb_rotate'"},
  {S "thumb_mpj = { raw = [0, 9]; deg = [0, 90]; };\n};\n", ":2: ", "'thumb_rotate' is missing"},
  {S R("thumb_rotate") R("thumb_mpj") R("thumb_ij") R("thumb_abduction") R("index_pij") "};\n",
   ":2: ", "'index_mpj' is missing"},
  {S "thumb_rotate = { raw = [5, 5]; deg = [0, 90]; };\n};\n",
   ":3: ", "two points of 'thumb_rotate' coincide"},
  {S "thumb_rotate = { raw = [5, 50]; deg = [90, 90]; };\n};\n", ":3: ", "coincide"},
  {S "thumb_rotate = { raw = [5, 50, 6]; deg = [0, 90]; };\n};\n", ":3: ", "'raw' has 3 numbers; write 2"},
  {S "thumb_rotate = { raw = [5, 50]; };\n};\n", ":3: ", "'deg' is missing"},
  {S "thumb_rotate = { raw = [5, 50]; deg = [0.0, 1e999]; };\n};\n", ":3: ", "not finite"},
  {S "thumb_rotate = [5, 50];\n};\n", ":3: ", "must be a group"},
};

static void test_wrong_calibrations_are_refused(void) {
  gv_calibration before, cal;
  memset(&cal, 0x5a, sizeof cal);
  before = cal;
  for (size_t i = 0; i < sizeof calibration_mistakes / sizeof *calibration_mistakes; i++)
    check_message(&calibration_mistakes[i], load_calibration(calibration_mistakes[i].text, &cal));
  CHECK(memcmp(&cal, &before, sizeof cal) == 0, "a refused calibration was written to");
}

static void test_files_that_are_no_text(void) {
  gv_settings s;
  char path[64];
  CHECK(gv_settings_load("/nonexistent/gloved.conf", &s, err, sizeof err) < 0 && strstr(err, "cannot open"),
        "%s", err);
  CHECK(gv_settings_load("/tmp", &s, err, sizeof err) < 0 && strstr(err, "cannot read"), "%s", err);
  write_file(path, "version = 1;\0\0", 14);
  CHECK(gv_settings_load(path, &s, err, sizeof err) < 0 && strstr(err, "zero bytes"), "%s", err);
  unlink(path);
}

// A small buffer for the reason is filled, never overrun.
static void test_reason_fits_its_buffer(void) {
  gv_settings s;
  char small[16];
  memset(small, 'x', sizeof small);
  CHECK(gv_settings_load("/nonexistent/gloved.conf", &s, small, 8) < 0, "accepted");
  CHECK(strlen(small) == 7 && small[8] == 'x', "wrote beyond 8 bytes");
}

int main(void) {
  RUN(test_example_equals_the_defaults);
  RUN(test_the_documented_configuration_comes_from_the_table);
  RUN(test_empty_file_is_the_default);
  RUN(test_defaults_are_sound);
  RUN(test_unknown_narrow_phase_is_refused);
  RUN(test_calibration_example_equals_the_default);
  RUN(test_paper_preset_comes_first);
  RUN(test_friction_over_a_preset);
  RUN(test_settings_arrive);
  RUN(test_named_calibration_is_read);
  RUN(test_solver_by_its_name);
  RUN(test_period_is_the_loops);
  RUN(test_unknown_enumerations_are_refused);
  RUN(test_no_file_passes_the_bounds_of_safety);
  RUN(test_every_setting_of_safety_has_bounds);
  RUN(test_what_protects_less_than_the_default_is_told);
  RUN(test_wrong_settings_are_refused);
  RUN(test_wrong_calibrations_are_refused);
  RUN(test_files_that_are_no_text);
  RUN(test_reason_fits_its_buffer);
  return check_done();
}
