// SPDX-License-Identifier: BSD-3-Clause
// The engine's settings: the realistic default, the paper's Tables 1 and 2, and what makes a setting sound.
#include <stddef.h>

#include "gloved/engine.h"

gv_config gv_config_default(void) {
  return (gv_config){
    .step_s = 0.001,
    .hand = gv_hand_model_default(GV_RIGHT),
    .calibration = gv_calibration_default(),
    .T_receiver_wrist = gv_pose_identity(),
    .limb_mass_kg = 0.01, .palm_mass_kg = 0.1,
    .limb = {200.0, -1.0, 0.48, -1.0},
    .palm = {1000.0, -1.0, 5.0, -1.0},
    .rotation_law = GV_ROTATION_LOG,
    .limb_gravity = false,
    .filter_hz = 30.0, .filter_rest_hz = 1.0, .gate_rad_s = 32.0, .gate_m_s = 5.0,
    .operations_per_s = 3e8,   // 2.8 ns each were measured; less on an old machine
    .narrow = GV_NARROW_CORE,
    .mu_hand = 0.8,
    .friction = GV_FRICTION_PYRAMID,
    .contact_erp = 0.2, .contact_cfm = 1e-3,   // 2e5 N/m and 800 N s/m at 1 ms
    .world_cfm = 1e-7,
    .contact_margin_m = 0.0005,
    .solver = GV_SOLVER_AUTO,
    .rest_s = 0.2,
  };
}

gv_config gv_config_stock(void) {
  gv_config c = gv_config_default();
  c.narrow = GV_NARROW_LIBCCD;
  c.solver = GV_SOLVER_DANTZIG;
  return c;
}

gv_config gv_config_paper(void) {
  gv_config c = gv_config_stock();
  c.palm_mass_kg = 0.01;
  // Table 2 with the damping read per 4 ms frame of the 250 Hz loop: 800 -> 3.2 N s/m, 0.06 -> 0.00024 N m s/rad.
  c.limb = c.palm = (gv_coupling){200.0, 800.0 * 0.004, 0.48, 0.06 * 0.004};
  c.rotation_law = GV_ROTATION_PAPER;
  c.limb_gravity = true;
  c.world_cfm = 1e-10;
  c.contact_erp = 0.01; c.contact_cfm = 0.01;  // on the normal row; as world values they drop every object
  c.friction = GV_FRICTION_FIXED_LIMIT;
  c.mu_hand = 200.0;
  c.override_gravity_m_s2 = 0.8;
  c.override_mass_kg = 1.0;
  c.override_mu = 200.0;
  c.override_sphere_inertia = true;
  return c;
}

typedef struct field { const char *name; double value, min, max; } field;

static const char *check_enumerations(const gv_config *c) {
  if ((unsigned)c->solver >= GV_SOLVERS) return "solver";
  if (c->narrow != GV_NARROW_CORE && c->narrow != GV_NARROW_LIBCCD) return "narrow";
  if (c->friction != GV_FRICTION_PYRAMID && c->friction != GV_FRICTION_FIXED_LIMIT) return "friction";
  if (c->rotation_law != GV_ROTATION_LOG && c->rotation_law != GV_ROTATION_PAPER) return "rotation_law";
  if (c->hand.side != GV_RIGHT && c->hand.side != GV_LEFT) return "hand.side";
  return NULL;
}

const char *gv_config_check(const gv_config *c) {
  const field f[] = {
    {"step_s", c->step_s, 1e-5, 0.02}, {"operations_per_s", c->operations_per_s, 1e6, 1e11}, {"period_s", c->period_s, 0, 0.02},
    {"limb_mass_kg", c->limb_mass_kg, 1e-4, 10}, {"palm_mass_kg", c->palm_mass_kg, 1e-4, 10},
    {"limb.k_f", c->limb.k_f, 0, 1e6}, {"limb.d_f", c->limb.d_f, -1, 1e5},
    {"limb.k_t", c->limb.k_t, 0, 1e4}, {"limb.d_t", c->limb.d_t, -1, 1e3},
    {"palm.k_f", c->palm.k_f, 0, 1e6}, {"palm.d_f", c->palm.d_f, -1, 1e5},
    {"palm.k_t", c->palm.k_t, 0, 1e4}, {"palm.d_t", c->palm.d_t, -1, 1e3},
    {"filter_hz", c->filter_hz, 0, 1000}, {"filter_rest_hz", c->filter_rest_hz, 0, 1000},
    {"gate_rad_s", c->gate_rad_s, 0, 1000}, {"gate_m_s", c->gate_m_s, 0, 1000},
    {"prediction_s", c->prediction_s, 0, 0.1},
    {"mu_hand", c->mu_hand, 0, 1e4},
    {"contact_erp", c->contact_erp, 0, 1}, {"contact_cfm", c->contact_cfm, 1e-9, 1},
    {"world_cfm", c->world_cfm, 1e-14, 1e-2}, {"contact_margin_m", c->contact_margin_m, 0, 0.01},
    {"rest_s", c->rest_s, 0, 100},
    {"override_gravity_m_s2", c->override_gravity_m_s2, 0, 100}, {"override_mass_kg", c->override_mass_kg, 0, 1000},
    {"override_mu", c->override_mu, 0, 1e4},
  };
  for (size_t i = 0; i < sizeof f / sizeof *f; i++)
    if (!(f[i].value >= f[i].min && f[i].value <= f[i].max)) return f[i].name;  // a not-a-number fails too
  const char *unknown = check_enumerations(c);
  if (unknown) return unknown;
  for (int i = 0; i < GV_FINGERS; i++)
    for (int s = 0; s < 3; s++) {
      if (!(c->hand.segment_m[i][s] > 0.001 && c->hand.segment_m[i][s] < 0.2)) return "hand.segment_m";
      if (!(c->hand.radius_m[i][s] > 0.001 && c->hand.radius_m[i][s] < 0.05)) return "hand.radius_m";
    }
  if (!(c->hand.palm_radius_m > 0.001 && c->hand.palm_radius_m < 0.05)) return "hand.palm_radius_m";
  if (!gv_v3_finite(c->hand.palm_half_m) || !gv_v3_finite(c->hand.palm_center_m)) return "hand.palm";
  for (int i = 0; i < GV_SENSORS; i++)
    if (!(c->hand.angle_min_rad[i] < c->hand.angle_max_rad[i])) return "hand.angle_min_rad";
  if (!gv_pose_finite(c->T_receiver_wrist)) return "T_receiver_wrist";
  if (gv_calibration_check(&c->calibration)) return "calibration";
  return NULL;
}
