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
    .limb_mass_kg = 0.01,
    .palm_mass_kg = 0.1,
    .limb = {200.0, -1.0, 0.48, -1.0},
    .palm = {1000.0, -1.0, 5.0, -1.0},
    .rotation_law = GV_ROTATION_LOG,
    .limb_gravity = false,
    .filter_hz = 30.0,
    .filter_rest_hz = 1.0,
    .gate_rad_s = 32.0,
    .gate_m_s = 5.0,
    .finger = {false, {1.5, 0.8, 0.4}, {3e-4, 1e-4, 3e-5}, 1.0},
    .operations_per_s = 3e8,  // 2.8 ns each were measured; less on an old machine
    .narrow = GV_NARROW_CORE,
    .mu_hand = 0.8,
    .friction = GV_FRICTION_COULOMB,
    .contact_erp = 0.2,
    .contact_cfm = 1e-3,  // 2e5 N/m and 800 N s/m at 1 ms
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
  // Table 2 with the damping read per 4 ms frame of the 250 Hz loop: 800 -> 3.2 N s/m,
  // 0.06 -> 0.00024 N m s/rad.
  c.limb = c.palm = (gv_coupling){200.0, 800.0 * 0.004, 0.48, 0.06 * 0.004};
  c.rotation_law = GV_ROTATION_PAPER;
  c.limb_gravity = true;
  c.world_cfm = 1e-10;
  c.contact_erp = 0.01;
  c.contact_cfm = 0.01;  // on the normal row; as world values they drop every object
  c.friction = GV_FRICTION_FIXED_LIMIT;
  c.mu_hand = 200.0;
  c.override_gravity_m_s2 = 0.8;
  c.override_mass_kg = 1.0;
  c.override_mu = 200.0;
  c.override_sphere_inertia = true;
  return c;
}

_Static_assert(sizeof(gv_solver) == sizeof(int) && sizeof(gv_friction) == sizeof(int),
               "a choice is read as an int");

static const char *const rotation_laws[] = {[GV_ROTATION_LOG] = "log", [GV_ROTATION_PAPER] = "paper", NULL};
static const char *const narrow_phases[] = {[GV_NARROW_CORE] = "core", [GV_NARROW_LIBCCD] = "libccd", NULL};
static const char *const frictions[] = {
  [GV_FRICTION_COULOMB] = "coulomb", [GV_FRICTION_FIXED_LIMIT] = "fixed_limit", NULL};
static const char *const solvers[] = {[GV_SOLVER_AUTO] = "auto",
                                      [GV_SOLVER_NEWTON] = "newton",
                                      [GV_SOLVER_DANTZIG] = "dantzig",
                                      [GV_SOLVER_QUICKSTEP] = "quickstep",
                                      NULL};

#define NUMBER(group, key, member, min, max, sentence)                                                       \
  {group, key, GV_SETTING_NUMBER, offsetof(gv_config, member), min, max, GV_LAXER_NEVER, NULL, sentence}
#define BOOL(group, key, member, sentence)                                                                   \
  {group, key, GV_SETTING_BOOL, offsetof(gv_config, member), 0, 1, GV_LAXER_NEVER, NULL, sentence}
#define CHOICE(group, key, member, words, sentence)                                                          \
  {group, key, GV_SETTING_CHOICE, offsetof(gv_config, member), 0, 0, GV_LAXER_NEVER, words, sentence}
#define SPRING(group, mass, spring, mass_says, k_f_says, d_f_says, k_t_says, d_t_says)                       \
  NUMBER(group, "mass_kg", mass, 1e-4, 10, mass_says), NUMBER(group, "k_f", spring.k_f, 0, 1e6, k_f_says),   \
      NUMBER(group, "d_f", spring.d_f, -1, 1e5, d_f_says),                                                   \
      NUMBER(group, "k_t", spring.k_t, 0, 1e4, k_t_says),                                                    \
      NUMBER(group, "d_t", spring.d_t, -1, 1e3, d_t_says)

const gv_setting gv_engine_settings[GV_ENGINE_SETTINGS] = {
  NUMBER("filter", "corner_hz", filter_hz, 0, 1000,
         "critically damped low pass; delay 1 / (pi corner_hz); 0: off"),
  NUMBER("filter", "rest_hz", filter_rest_hz, 0, 1000,
         "the corner for what stands still; it goes up with speed, to corner_hz at\n"
         "0.64 rad/s or 0.29 m/s; 0: corner_hz always"),
  NUMBER("filter", "gate_rad_s", gate_rad_s, 0, 1000,
         "a joint that jumps faster in one sample waits for a second sample that agrees; 0: off"),
  NUMBER("filter", "gate_m_s", gate_m_s, 0, 1000,
         "the same for the tracker's position (its orientation goes by gate_rad_s)"),
  NUMBER("filter", "prediction_s", prediction_s, 0, 0.1,
         "lead the hand along its velocity: takes back delay, adds noise; 0.011 undoes 30 Hz;\n"
         "only with the filter"),
  BOOL("finger", "observer", finger.observed,
       "foresee how a tension bends the user's finger: for couplings that are stiffer than the\n"
       "finger, where glove and wire are slow"),
  NUMBER("finger", "stiffness_0", finger.stiffness[0], 0.01, 100,
         "N m/rad, from the knuckle on; a finger held lightly is 184 N/m along its tendon"),
  NUMBER("finger", "stiffness_1", finger.stiffness[1], 0.01, 100, ""),
  NUMBER("finger", "stiffness_2", finger.stiffness[2], 0.01, 100, ""),
  NUMBER("finger", "inertia_0", finger.inertia[0], 1e-06, 1, "kg m^2"),
  NUMBER("finger", "inertia_1", finger.inertia[1], 1e-06, 1, ""),
  NUMBER("finger", "inertia_2", finger.inertia[2], 1e-06, 1, ""),
  NUMBER("finger", "damping_ratio", finger.damping_ratio, 0, 10, "of each joint; 1: critical"),
  CHOICE("coupling", "rotation_law", rotation_law, rotation_laws,
         "torque along the rotation vector; \"paper\": Eqn 3 and 4, fading beyond 90 degrees"),
  BOOL("coupling", "limb_gravity", limb_gravity, "the limbs have weight"),
  BOOL("coupling", "finger_joints", finger_joints,
       "joints between the limbs of a finger: none ends up behind what the finger\n"
       "touches; a step takes up to 2.2 times as long"),
  SPRING("coupling.limb", limb_mass_kg, limb, "", "N/m", "N s/m; below 0: critical damping", "N m/rad",
         "N m s/rad; below 0: critical damping"),
  SPRING("coupling.palm", palm_mass_kg, palm, "", "", "", "", ""),
  CHOICE("contact", "narrow", narrow, narrow_phases,
         "the narrow phase: our own; \"libccd\": the package's, where deep overlaps are seen a bit deeper"),
  NUMBER("contact", "mu_hand", mu_hand, 0, 1e4, "friction of the skin; objects have theirs in the scene"),
  CHOICE("contact", "friction", friction, frictions,
         "its round cone; \"fixed_limit\": mu is a force in newtons (Eqn 10)"),
  {"contact", "patch_mm", GV_SETTING_LENGTH, offsetof(gv_config, patch_m), 0, 20, GV_LAXER_NEVER, NULL,
   "radius of the patch in which the skin touches, as a soft pad does: it holds turns about the\n"
   "normal with up to 2/3 mu patch times the normal force; 0: a point, which holds none"},
  NUMBER("contact", "erp", contact_erp, 0, 1, "share of a penetration that one step takes back"),
  NUMBER("contact", "cfm", contact_cfm, 1e-9, 1, "softness of a contact's normal, m/(N s)"),
  NUMBER("contact", "world_cfm", world_cfm, 1e-14, 1e-2, "softness of everything else; never 0"),
  {"contact", "margin_mm", GV_SETTING_LENGTH, offsetof(gv_config, contact_margin_m), 0, 10, GV_LAXER_NEVER,
   NULL, "gaps below this are contacts already"},
  NUMBER("solver", "step_s", step_s, 1e-5, 0.02,
         "integration step; 1 / rate_hz unless the simulation is to run slower or faster than time"),
  CHOICE(
      "solver", "method", solver, solvers,
      "\"newton\" (ours), \"dantzig\" (ODE's, exact), \"quickstep\" (ODE's, iterative); auto: newton, and\n"
      "what it leaves to dantzig where that fits into the period, else to quickstep"),
  NUMBER("solver", "rest_s", rest_s, 0, 100,
         "an object that lies still for so long is left alone until something comes near; 0: never"),
  NUMBER("override", "gravity_m_s2", override_gravity_m_s2, 0, 100, ""),
  NUMBER("override", "mass_kg", override_mass_kg, 0, 1000, ""),
  NUMBER("override", "mu", override_mu, 0, 1e4, ""),
  BOOL("override", "sphere_inertia", override_sphere_inertia, ""),
};

_Static_assert(sizeof gv_engine_settings / sizeof *gv_engine_settings == GV_ENGINE_SETTINGS,
               "as engine.h says");

// No not-a-number is.
static bool within(double value, double min, double max) { return value >= min && value <= max; }
static bool between(double value, double min, double max) { return value > min && value < max; }

// The first measure of the hand that no hand has; null: none.
static const char *unsound_measure(const gv_hand_model *hand) {
  if (hand->side != GV_RIGHT && hand->side != GV_LEFT)
    return "hand.side";
  for (int i = 0; i < GV_FINGERS; i++) {
    for (int s = 0; s < 3; s++) {
      if (!between(hand->segment_m[i][s], 0.001, 0.2))
        return "hand.segment_m";
      if (!between(hand->radius_m[i][s], 0.001, 0.05))
        return "hand.radius_m";
    }
  }
  if (!between(hand->palm_radius_m, 0.001, 0.05))
    return "hand.palm_radius_m";
  if (!gv_v3_finite(hand->palm_half_m) || !gv_v3_finite(hand->palm_center_m))
    return "hand.palm";
  for (int i = 0; i < GV_SENSORS; i++)
    if (!(hand->angle_min_rad[i] < hand->angle_max_rad[i]))
      return "hand.angle_min_rad";
  return NULL;
}

static const char *unsound_second(const gv_second_hand *second) {
  if (unsound_measure(&second->hand))
    return "second.hand";
  if (!gv_pose_finite(second->T_receiver_wrist))
    return "second.T_receiver_wrist";
  return gv_calibration_check(&second->calibration) ? "second.calibration" : NULL;
}

const char *gv_config_check(const gv_config *c) {
  for (int i = 0; i < GV_ENGINE_SETTINGS; i++)
    if (!gv_setting_sound(&gv_engine_settings[i], c))
      return gv_engine_settings[i].key;
  if (!within(c->period_s, 0, 0.02))
    return "period_s";
  if (!within(c->operations_per_s, 1e6, 1e11))
    return "operations_per_s";
  const char *measure = unsound_measure(&c->hand);
  if (measure)
    return measure;
  if (!gv_pose_finite(c->T_receiver_wrist))
    return "T_receiver_wrist";
  if (gv_calibration_check(&c->calibration))
    return "calibration";
  return c->second.present ? unsound_second(&c->second) : NULL;
}
