// SPDX-License-Identifier: BSD-3-Clause
// Coupling of a limb to its driver frame. Backward Euler of m v' = k x_d - d v_d turns into an
// explicit step of a body with m' = m + h d + h^2 k under f = k x_d - d v_d - h k v_d (v_d: sim
// relative to driver): stable at any stiffness and no solver rows. The same holds for rotation with an
// augmented inertia. A pull beyond its bound softens the spring for a step, and what it adds to the limb with
// it: by the bound alone, on the mass that a stiff spring adds, a limb would swing about its driver for
// seconds. Real-time thread.
#include "hand/coupling.h"

#include <assert.h>

gv_spring gv_spring_make(const gv_coupling *coupling, double mass_kg, double mean_inertia, double h,
                         gv_rotation_law law) {
  assert(coupling->k_f >= 0.0 && coupling->k_t >= 0.0 && mass_kg > 0.0 && mean_inertia > 0.0 && h > 0.0);
  gv_spring s = {.k_f = coupling->k_f,
                 .d_f = coupling->d_f,
                 .k_t = coupling->k_t,
                 .d_t = coupling->d_t,
                 .mass_kg = mass_kg,
                 .h = h,
                 .most_n = GV_PULL_N,
                 .most_n_m = GV_PULL_N_M,
                 .law = law};
  s.k_small = law == GV_ROTATION_PAPER ? 2.0 * s.k_t : s.k_t;
  if (s.d_f < 0.0)
    s.d_f = 2.0 * sqrt(s.k_f * mass_kg);
  if (s.d_t < 0.0)
    s.d_t = 2.0 * sqrt(s.k_small * mean_inertia);
  s.d_f_implicit = s.d_f + h * s.k_f;
  s.d_t_implicit = s.d_t + h * s.k_small;
  s.added_mass_kg = h * s.d_f + h * h * s.k_f;
  s.added_inertia = h * s.d_t + h * h * s.k_small;
  return s;
}

// Eqn 3 and 4: t_d = sum over axes of e_sim x e_driver (l_i = e_sim - e_driver, l_i
// x e_sim = e_sim x e_driver).
static gv_vec3 deviation_paper(gv_quat sim, gv_quat driver) {
  gv_mat3 S = gv_mat3_from_quat(sim);
  gv_mat3 D = gv_mat3_from_quat(driver);
  gv_vec3 t = gv_v3(0, 0, 0);
  for (int i = 0; i < 3; i++)
    t = gv_add(t, gv_cross(gv_v3(S.m[0][i], S.m[1][i], S.m[2][i]), gv_v3(D.m[0][i], D.m[1][i], D.m[2][i])));
  return t;
}

static gv_vec3 deviation(const gv_spring *s, gv_quat sim, gv_quat driver) {
  if (s->law == GV_ROTATION_PAPER)
    return deviation_paper(sim, driver);
  return gv_quat_log(gv_quat_mul(driver, gv_quat_conj(sim)));
}

// A limb that goes on as it goes is pulled by f, one that is stopped in this step, by what it runs against,
// by f + d v. Neither is more than a bound, surely: |f + d v| is at most |f| + |d v|, and no root is needed.
static inline bool is_below(gv_vec3 f, double d, gv_vec3 v, double most) {
  return gv_norm2(f) + d * d * gv_norm2(v) <= 0.5 * most * most;
}

bool gv_springs_apply(const gv_spring s[GV_LIMBS], const gv_body_state sim[GV_LIMBS],
                      const gv_body_state driver[GV_LIMBS], gv_vec3 out_f[GV_LIMBS],
                      gv_vec3 out_t[GV_LIMBS]) {
  bool below = true;
  for (int i = 0; i < GV_LIMBS; i++) {
    gv_vec3 x_d = gv_sub(driver[i].T.p, sim[i].T.p);
    gv_vec3 t_d = deviation(&s[i], sim[i].T.q, driver[i].T.q);
    const gv_vec3 f = gv_mad(gv_scale(x_d, s[i].k_f), s[i].d_f_implicit,
                             gv_sub(driver[i].v, sim[i].v));  // Eqn 1
    const gv_vec3 t = gv_mad(gv_scale(t_d, s[i].k_t), s[i].d_t_implicit,
                             gv_sub(driver[i].w, sim[i].w));  // Eqn 2
    below &= is_below(f, s[i].d_f_implicit, sim[i].v, s[i].most_n);
    below &= is_below(t, s[i].d_t_implicit, sim[i].w, s[i].most_n_m);
    out_f[i] = f;
    out_t[i] = t;
  }
  return !below;
}

gv_spring gv_spring_soften(const gv_spring *spring, double of_force, double of_torque) {
  assert(of_force >= 0.0 && of_force <= 1.0 && of_torque >= 0.0 && of_torque <= 1.0);
  gv_spring s = *spring;
  s.k_f *= of_force;
  s.d_f *= of_force;
  s.d_f_implicit *= of_force;
  s.added_mass_kg *= of_force;
  s.k_t *= of_torque;
  s.d_t *= of_torque;
  s.k_small *= of_torque;
  s.d_t_implicit *= of_torque;
  s.added_inertia *= of_torque;
  return s;
}

// What may be left of a pull, as a share. Not-a-number is left alone: it is nobody's force.
static double share_left(gv_vec3 f, double d, gv_vec3 v, double most) {
  const double size2 = fmax(gv_norm2(f), gv_norm2(gv_mad(f, d, v)));
  return size2 > most * most ? most / sqrt(size2) : 1.0;
}

uint32_t gv_springs_bound(const gv_spring s[GV_LIMBS], const gv_body_state sim[GV_LIMBS], gv_vec3 f[GV_LIMBS],
                          gv_vec3 t[GV_LIMBS], gv_spring acting[GV_LIMBS]) {
  uint32_t softer = 0;
  for (int i = 0; i < GV_LIMBS; i++) {
    const double of_f = share_left(f[i], s[i].d_f_implicit, sim[i].v, s[i].most_n);
    const double of_t = share_left(t[i], s[i].d_t_implicit, sim[i].w, s[i].most_n_m);
    if (of_f >= 1.0 && of_t >= 1.0)
      continue;
    acting[i] = gv_spring_soften(&s[i], of_f, of_t);
    f[i] = gv_scale(f[i], of_f);
    t[i] = gv_scale(t[i], of_t);
    softer |= 1u << i;
  }
  return softer;
}

void gv_springs_feel(const gv_spring s[GV_LIMBS], const gv_body_state sim[GV_LIMBS],
                     const gv_body_state driver[GV_LIMBS], const gv_pose T_ahead[GV_LIMBS],
                     gv_vec3 out_f[GV_LIMBS], gv_vec3 out_t[GV_LIMBS]) {
  for (int i = 0; i < GV_LIMBS; i++) {
    // seen the other way
    gv_vec3 x_d = gv_sub(sim[i].T.p, T_ahead[i].p);
    gv_vec3 t_d = deviation(&s[i], T_ahead[i].q, sim[i].T.q);
    out_f[i] = gv_mad(gv_scale(x_d, s[i].k_f), s[i].d_f, gv_sub(sim[i].v, driver[i].v));
    out_t[i] = gv_mad(gv_scale(t_d, s[i].k_t), s[i].d_t, gv_sub(sim[i].w, driver[i].w));
  }
}
