// SPDX-License-Identifier: BSD-3-Clause
// The daemon's configuration and the glove's calibration, from text. People write millimetres and degrees
// where they measure them; metres and radians are made here. data/gloved.conf explains every setting.
// Main thread, before the loop starts.
#include "daemon/load/config_load.h"

#include "gloved/load.h"

#include <stdio.h>
#include <string.h>

#include "daemon/load/conf.h"
#include "daemon/load/settings_table.h"
#include "gloved/drivers.h"

#define DEG (GV_PI / 180)

// Across the plane between a left and a right hand's frame.
static gv_pose mirrored(gv_pose T) {
  return (gv_pose){{T.q.w, 0.0 - T.q.x, T.q.y, 0.0 - T.q.z}, {T.p.x, 0.0 - T.p.y, T.p.z}};
}

// A second hand is the same person's other one, its receiver mounted likewise.
static void default_second(gv_config *out) {
  out->second.calibration = gv_calibration_default();
  out->second.T_receiver_wrist = mirrored(out->T_receiver_wrist);
}

void gv_settings_second(gv_settings *out) {
  gv_second_hand *second = &out->engine.second;
  second->present = out->fcu2[0] != '\0';
  second->hand = out->engine.hand;
  second->hand.side = out->engine.hand.side == GV_LEFT ? GV_RIGHT : GV_LEFT;
}

void gv_settings_default(gv_settings *out) {
  memset(out, 0, sizeof *out);
  out->engine = gv_config_default();
  default_second(&out->engine);
  out->limiter = gv_limiter_config_default();
  out->safety = gv_safety_config_default();
  out->passivity = gv_passivity_config_default();
  out->T_world_tracker = gv_fastrak_upright();
  snprintf(out->scene, sizeof out->scene, "data/scenes/box.scene");
  snprintf(out->fcu, sizeof out->fcu, "sim:");
  snprintf(out->lcm, sizeof out->lcm, "udpm://239.255.76.67:7667?ttl=0");
  out->rate_hz = 1000.0;
  out->cpu = -1;
  out->rt_priority = 80;
  out->mlock = true;
  out->cpu_dma_latency = true;
}

// ---- numbers in the units of the file -------------------------------------------------------------

static void read_mm(gv_conf_group *group, const char *key, double min, double max, double *out) {
  double value;
  if (gv_conf_number(group, key, min, max, &value))
    *out = gv_settings_metres(value);
}

static void read_vector_mm(gv_conf_group *group, const char *key, double min, double max, gv_vec3 *out) {
  double v[3];
  if (gv_conf_numbers(group, key, min, max, 3, "[x, y, z] in millimetres", v))
    *out = gv_v3(gv_settings_metres(v[0]), gv_settings_metres(v[1]), gv_settings_metres(v[2]));
}

// Five rows of three, thumb to little finger. True where they were read.
static bool read_fingers_mm(gv_conf_group *group, const char *key, double min, double max,
                            double out[GV_FINGERS][3]) {
  gv_conf_node rows = gv_conf_find(group, key);
  if (!gv_conf_has(rows))
    return false;
  if (gv_conf_length(rows) != GV_FINGERS)
    return gv_conf_fail(rows, "'%s' must be 5 rows, thumb to little finger; write ( [a, b, c], ... )", key);
  for (int i = 0; i < GV_FINGERS; i++) {
    if (!gv_conf_entry_numbers(gv_conf_entry(rows, i), min, max, 3, "[a, b, c] in millimetres", out[i]))
      return false;
    for (int k = 0; k < 3; k++)
      out[i][k] = gv_settings_metres(out[i][k]);
  }
  return true;
}

// ---- the hand -------------------------------------------------------------------------------------

static void read_limits(gv_conf_group *hand, gv_hand_model *out) {
  gv_conf_group limits;
  if (!gv_conf_enter(hand, "limits_deg", &limits))
    return;
  for (int i = 0; i < GV_SENSORS; i++) {
    double v[2];
    if (!gv_conf_numbers(&limits, gv_sensor_name(i), -180, 180, 2, "[least, most] in degrees", v))
      continue;
    if (!(v[0] < v[1]))
      gv_conf_fail(gv_conf_find(&limits, gv_sensor_name(i)),
                   "'%s' runs from %g to %g; write the smaller angle first", gv_sensor_name(i), v[0], v[1]);
    out->angle_min_rad[i] = v[0] * DEG;
    out->angle_max_rad[i] = v[1] * DEG;
  }
  gv_conf_leave(&limits);
}

static void read_hand(gv_conf_group *root, gv_hand_model *out) {
  static const char *const sides[] = {"right", "left", NULL};
  gv_conf_group hand;
  if (!gv_conf_enter(root, "hand", &hand))
    return;
  int side = (int)out->side;
  if (gv_conf_choice(&hand, "side", sides, &side))
    *out = gv_hand_model_default(side ? GV_LEFT : GV_RIGHT);
  double base[GV_FINGERS][3];
  read_fingers_mm(&hand, "segment_mm", 5, 150, out->segment_m);
  read_fingers_mm(&hand, "radius_mm", 2, 30, out->radius_m);
  if (read_fingers_mm(&hand, "base_mm", -200, 200, base))
    for (int i = 0; i < GV_FINGERS; i++)
      out->base_m[i] = gv_v3(base[i][0], base[i][1], base[i][2]);
  read_vector_mm(&hand, "palm_center_mm", -200, 200, &out->palm_center_m);
  read_vector_mm(&hand, "palm_half_mm", 0.1, 100, &out->palm_half_m);
  read_mm(&hand, "palm_radius_mm", 2, 30, &out->palm_radius_m);
  read_limits(&hand, out);
  gv_conf_leave(&hand);
}

static void read_pose(gv_conf_group *root, const char *key, double limit_mm, gv_pose *out) {
  gv_conf_group pose;
  if (!gv_conf_enter(root, key, &pose))
    return;
  double q[4];
  read_vector_mm(&pose, "position_mm", -limit_mm, limit_mm, &out->p);
  if (gv_conf_numbers(&pose, "orientation", -1.001, 1.001, 4, "the quaternion [w, x, y, z]", q)) {
    double length = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    if (fabs(length - 1) > 1e-3)
      gv_conf_fail(gv_conf_find(&pose, "orientation"), "the quaternion has length %.4g; scale it to 1",
                   length);
    out->q = gv_quat_normalize((gv_quat){q[0], q[1], q[2], q[3]});
  }
  gv_conf_leave(&pose);
}

int gv_settings_set_narrow(gv_config *out, const char *name) {
  return gv_settings_set_word("contact", "narrow", out, name);
}
int gv_settings_set_solver(gv_config *out, const char *name) {
  return gv_settings_set_word("solver", "method", out, name);
}

// A word names the solver alone.
static void read_solver_word(gv_conf_group *root, gv_config *out) {
  gv_conf_node node = gv_conf_find(root, "solver");
  const char *words[GV_SOLVERS + 1] = {NULL};
  int method;
  for (int i = 0; i < GV_SOLVERS; i++)
    words[i] = gv_solver_name((gv_solver)i);
  if (gv_conf_is_text(node) && gv_conf_choice(root, "solver", words, &method))
    out->solver = (gv_solver)method;
}

static void read_preset(gv_conf_group *root, gv_config *out) {
  static const char *const presets[] = {"default", "stock", "paper", NULL};
  static gv_config (*const make[])(void) = {gv_config_default, gv_config_stock, gv_config_paper};
  int preset;
  if (gv_conf_choice(root, "preset", presets, &preset))
    *out = make[preset]();
}

static void load_calibration(gv_conf_group *root, const char *key, const char *file, gv_calibration *out) {
  char reason[GV_SETTING_TEXT + 256];
  if (!gv_conf_has(gv_conf_find(root, key)) || !file[0])
    return;
  if (gv_calibration_load(file, out, reason, sizeof reason))
    gv_conf_fail(gv_conf_find(root, key), "%s", reason);
}

static void read_settings(gv_conf_group *root, gv_settings *out) {
  read_preset(root, &out->engine);  // first: everything else changes what it sets
  gv_settings_read_group(root, "", out);
  default_second(&out->engine);
  load_calibration(root, "calibration", out->calibration, &out->engine.calibration);
  load_calibration(root, "calibration2", out->calibration2, &out->engine.second.calibration);
  // The simulation keeps up with time unless solver.step_s, read later, says otherwise.
  if (gv_conf_has(gv_conf_find(root, "rate_hz")))
    out->engine.step_s = 1.0 / out->rate_hz;
  read_hand(root, &out->engine.hand);
  read_pose(root, "receiver", 500, &out->engine.T_receiver_wrist);
  out->engine.second.T_receiver_wrist = mirrored(out->engine.T_receiver_wrist);
  read_pose(root, "receiver2", 500, &out->engine.second.T_receiver_wrist);
  read_pose(root, "tracker_to_world", 10000, &out->T_world_tracker);
  read_solver_word(root, &out->engine);
  gv_settings_read_groups(root, out);
  out->operations_given = out->operations_per_s > 0.0;
  if (out->operations_given)
    out->engine.operations_per_s = out->operations_per_s;
  gv_conf_leave(root);
}

int gv_settings_load(const char *path, gv_settings *out, char *err, size_t err_size) {
  gv_conf conf;
  gv_settings_default(out);
  if (!gv_conf_open(&conf, path, err, err_size))
    return -1;
  gv_conf_group root = gv_conf_root(&conf);
  read_settings(&root, out);
  const char *unsound = conf.failed ? NULL : gv_config_check(&out->engine);
  if (unsound)
    gv_conf_fail(root.node, "the settings do not work together: %s is out of range; change it", unsound);
  gv_conf_close(&conf);
  return conf.failed ? -1 : 0;
}

int gv_config_load(const char *path, gv_config *out, char *err, size_t err_size) {
  gv_settings settings;
  if (gv_settings_load(path, &settings, err, err_size))
    return -1;
  *out = settings.engine;
  return 0;
}

// ---- calibration ----------------------------------------------------------------------------------

static void read_sensor(gv_conf_group *sensors, int i, gv_calibration *out) {
  gv_conf_group sensor;
  double deg[2] = {0, 0};
  const char *name = gv_sensor_name(i);
  gv_conf_need(sensors, name, "{ raw = [a, b]; deg = [a, b]; } for this sensor");
  if (!gv_conf_enter(sensors, name, &sensor))
    return;
  gv_conf_need(&sensor, "raw", "raw = [a, b]; the raw values at two angles");
  gv_conf_need(&sensor, "deg", "deg = [a, b]; the angles at the two raw values");
  gv_conf_numbers(&sensor, "raw", -65535, 65535, 2, "[a, b], raw values at two angles", out->raw[i]);
  gv_conf_numbers(&sensor, "deg", -360, 360, 2, "[a, b], degrees at the two raw values", deg);
  gv_conf_leave(&sensor);
  if (fabs(out->raw[i][1] - out->raw[i][0]) < 1 || fabs(deg[1] - deg[0]) < 0.1)
    gv_conf_fail(sensor.node, "the two points of '%s' coincide; measure two different angles", name);
  for (int k = 0; k < 2; k++)
    out->angle_rad[i][k] = deg[k] * DEG;
}

int gv_calibration_load(const char *path, gv_calibration *out, char *err, size_t err_size) {
  gv_conf conf;
  gv_calibration cal = gv_calibration_default();
  if (!gv_conf_open(&conf, path, err, err_size))
    return -1;
  gv_conf_group root = gv_conf_root(&conf), sensors;
  gv_conf_need(&root, "sensors", "sensors = { thumb_rotate = { raw = [a, b]; deg = [a, b]; }; ... };");
  if (gv_conf_enter(&root, "sensors", &sensors)) {
    for (int i = 0; i < GV_SENSORS; i++)
      gv_conf_find(&sensors, gv_sensor_name(i));  // all are known by now
    for (int i = 0; i < GV_SENSORS; i++)
      read_sensor(&sensors, i, &cal);
    gv_conf_leave(&sensors);
  }
  gv_conf_leave(&root);
  gv_conf_close(&conf);
  if (conf.failed)
    return -1;
  *out = cal;
  return 0;
}
