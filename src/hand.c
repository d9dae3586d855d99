// SPDX-License-Identifier: BSD-3-Clause
// The hand's skeleton: calibration of raw sensor counts, and forward kinematics from 22 joint angles and
// the wrist's pose to 16 driver frames and the joint axes (section A of the paper). The right hand is
// computed in its wrist frame; a left hand is its mirror image in y. Pure; any thread.
#include "gloved/hand.h"

#include <stddef.h>

#define DEG (GV_PI / 180.0)
// Thumb: the abduction at which its pad faces the finger pads.
#define THUMB_OPPOSED_RAD (45.0 * DEG)

static const char *const sensor_names[GV_SENSORS] = {
  "thumb_rotate", "thumb_mpj", "thumb_ij", "thumb_abduction", "index_mpj", "index_pij", "index_dij",
  "middle_mpj", "middle_pij", "middle_dij", "middle_index_abduction", "ring_mpj", "ring_pij", "ring_dij",
  "ring_middle_abduction", "little_mpj", "little_pij", "little_dij", "little_ring_abduction",
  "palm_arch", "wrist_pitch", "wrist_yaw"};
static const char *const limb_names[GV_LIMBS] = {
  "thumb_metacarpal", "thumb_proximal", "thumb_distal", "index_proximal", "index_middle", "index_distal",
  "middle_proximal", "middle_middle", "middle_distal", "ring_proximal", "ring_middle", "ring_distal",
  "little_proximal", "little_middle", "little_distal", "palm"};
static const char *const finger_names[GV_FINGERS] = {"thumb", "index", "middle", "ring", "little"};

const char *gv_sensor_name(int sensor) { return sensor >= 0 && sensor < GV_SENSORS ? sensor_names[sensor] : NULL; }
const char *gv_limb_name(int limb) { return limb >= 0 && limb < GV_LIMBS ? limb_names[limb] : NULL; }
const char *gv_finger_name(int finger) { return finger >= 0 && finger < GV_FINGERS ? finger_names[finger] : NULL; }

gv_hand_model gv_hand_model_default(gv_side side) {
  gv_hand_model m = {
    .side = side,
    .segment_m = {{0.0466, 0.0314, 0.0269}, {0.0403, 0.0222, 0.0202}, {0.0470, 0.0280, 0.0210},
                  {0.0433, 0.0262, 0.0231}, {0.0342, 0.0177, 0.0209}},
    .radius_m = {{0.0110, 0.0100, 0.0090}, {0.0095, 0.0085, 0.0075}, {0.0095, 0.0085, 0.0075},
                 {0.0090, 0.0080, 0.0070}, {0.0080, 0.0070, 0.0065}},
    // Metacarpals of 70.5 67.0 61.4 56.0 mm fanned out from the carpus, 16 mm distal of the wrist joint.
    .base_m = {{0.0180, 0.0220, -0.0120}, {0.0851, 0.0250, 0.0}, {0.0830, 0.0040, 0.0},
               {0.0766, -0.0150, 0.0}, {0.0683, -0.0320, 0.0}},
    .palm_center_m = {0.0440, -0.0030, 0.0},
    .palm_half_m = {0.0320, 0.0270, 0.0020},
    .palm_radius_m = 0.0100,
  };
  static const double limit_deg[GV_SENSORS][2] = {
    {-25, 35}, {-10, 80}, {-15, 80}, {-30, 60},               // thumb: CMC flexion, MCP, IP, abduction
    {0, 90}, {0, 100}, {-10, 90}, {0, 90}, {0, 100}, {-10, 90}, {-15, 42},
    {0, 90}, {0, 100}, {-10, 90}, {-14, 20}, {0, 90}, {0, 100}, {-10, 90}, {-19, 40},
    {0, 40}, {-40, 60}, {-30, 30}};                           // palm arch, wrist pitch and yaw
  for (int i = 0; i < GV_SENSORS; i++) {
    m.angle_min_rad[i] = limit_deg[i][0] * DEG;
    m.angle_max_rad[i] = limit_deg[i][1] * DEG;
  }
  return m;
}

gv_calibration gv_calibration_default(void) {
  gv_calibration cal;
  for (int i = 0; i < GV_SENSORS; i++) {
    cal.raw[i][0] = 1024.0; cal.angle_rad[i][0] = 0.0;
    cal.raw[i][1] = 3072.0; cal.angle_rad[i][1] = 0.5 * GV_PI;
  }
  return cal;
}

int gv_calibration_check(const gv_calibration *cal) {
  for (int i = 0; i < GV_SENSORS; i++) {
    double counts = cal->raw[i][1] - cal->raw[i][0], angle = cal->angle_rad[i][1] - cal->angle_rad[i][0];
    if (!isfinite(counts) || !isfinite(angle) || fabs(counts) < 1.0 || fabs(angle) < 1e-6) return -1 - i;
  }
  return 0;
}

double gv_calibration_angle(const gv_calibration *cal, int sensor, double raw) {
  const double *r = cal->raw[sensor], *a = cal->angle_rad[sensor];
  return a[0] + (raw - r[0]) * (a[1] - a[0]) / (r[1] - r[0]);
}

double gv_calibration_raw(const gv_calibration *cal, int sensor, double angle_rad) {
  const double *r = cal->raw[sensor], *a = cal->angle_rad[sensor];
  return r[0] + (angle_rad - a[0]) * (r[1] - r[0]) / (a[1] - a[0]);
}

double gv_hand_half_length(const gv_hand_model *model, int limb) {
  int finger = limb / 3, segment = limb % 3;
  double length = model->segment_m[finger][segment];
  if (segment == 2) length -= model->radius_m[finger][2];  // the cap ends at the fingertip
  return length > 0.0 ? 0.5 * length : 0.0;
}

static gv_quat turn_x(double a) { return gv_quat_axis_angle(gv_v3(1, 0, 0), a); }
static gv_quat turn_y(double a) { return gv_quat_axis_angle(gv_v3(0, 1, 0), a); }
static gv_quat turn_z(double a) { return gv_quat_axis_angle(gv_v3(0, 0, 1), a); }

// Unit quaternion of the rotation with the orthonormal columns x, y, z (w is not near 0 for the thumb).
static gv_quat quat_from_axes(gv_vec3 x, gv_vec3 y, gv_vec3 z) {
  double w = 0.5 * sqrt(fmax(0.0, 1.0 + x.x + y.y + z.z));
  return gv_quat_normalize((gv_quat){w, (y.z - z.y) / (4 * w), (z.x - x.z) / (4 * w), (x.y - y.x) / (4 * w)});
}

// The thumb's metacarpal in the hand frame at abduction THUMB_OPPOSED_RAD and no flexion: it points
// palmar (x) and bends towards the finger pads (-z).
static gv_quat thumb_opposed(void) {
  gv_vec3 x = gv_normalize_or(gv_v3(0.30, 0.08, -0.95), gv_v3(0, 0, -1));
  gv_vec3 pad = gv_v3(0.87, -0.42, 0.24);
  gv_vec3 z = gv_neg(gv_normalize_or(gv_mad(pad, -gv_dot(pad, x), x), gv_v3(1, 0, 0)));
  return quat_from_axes(x, gv_cross(z, x), z);
}

typedef struct chain {
  gv_pose *limb;          // [16] in the hand frame; may be null
  gv_joint_axis *joint;   // [22] in the hand frame; may be null
} chain;

static void put_joint(chain *c, int sensor, gv_vec3 p, gv_vec3 axis, uint32_t limbs) {
  if (c->joint) c->joint[sensor] = (gv_joint_axis){p, axis, limbs};
}

// One finger: flexion about y at three joints, starting in frame T (x along the proximal bone when straight).
static void finger_chain(const gv_hand_model *m, int finger, gv_pose T, const int sensor[3], const double *angle, chain *c) {
  for (int s = 0; s < 3; s++) {
    int limb = 3 * finger + s;
    uint32_t moved = (7u << s & 7u) << (3 * finger);
    put_joint(c, sensor[s], T.p, gv_rotate(T.q, gv_v3(0, 1, 0)), moved);
    T.q = gv_quat_mul(T.q, turn_y(angle[sensor[s]]));
    if (c->limb) c->limb[limb] = (gv_pose){T.q, gv_transform(T, gv_v3(gv_hand_half_length(m, limb), 0, 0))};
    T.p = gv_transform(T, gv_v3(m->segment_m[finger][s], 0, 0));
  }
}

static void thumb_chain(const gv_hand_model *m, const double *angle, chain *c) {
  static const int sensor[3] = {GV_THUMB_ROTATE, GV_THUMB_MPJ, GV_THUMB_IJ};
  gv_quat opposed = thumb_opposed();
  put_joint(c, GV_THUMB_ABDUCTION, m->base_m[0], gv_rotate(opposed, gv_v3(0, 0, 1)), 7u);
  gv_quat q = gv_quat_mul(opposed, turn_z(angle[GV_THUMB_ABDUCTION] - THUMB_OPPOSED_RAD));
  finger_chain(m, 0, (gv_pose){q, m->base_m[0]}, sensor, angle, c);
}

// Index to little: palm arch turns the ring's base by half and the little's whole about x; the abduction
// sensors measure neighbours against each other, the middle finger being straight.
static void finger_chains(const gv_hand_model *m, const double *angle, chain *c) {
  static const int sensor[GV_FINGERS][3] = {{0, 0, 0},
    {GV_INDEX_MPJ, GV_INDEX_PIJ, GV_INDEX_DIJ}, {GV_MIDDLE_MPJ, GV_MIDDLE_PIJ, GV_MIDDLE_DIJ},
    {GV_RING_MPJ, GV_RING_PIJ, GV_RING_DIJ}, {GV_LITTLE_MPJ, GV_LITTLE_PIJ, GV_LITTLE_DIJ}};
  const double ring = -angle[GV_RING_MIDDLE_ABDUCTION];
  const double spread[GV_FINGERS] = {0, angle[GV_MIDDLE_INDEX_ABDUCTION], 0, ring, ring - angle[GV_LITTLE_RING_ABDUCTION]};
  const double arch[GV_FINGERS] = {0, 0, 0, 0.5 * angle[GV_PALM_ARCH], angle[GV_PALM_ARCH]};
  for (int f = 1; f < GV_FINGERS; f++) {
    gv_quat base = turn_x(arch[f]);
    gv_pose T = {gv_quat_mul(base, turn_z(spread[f])), gv_rotate(base, m->base_m[f])};
    gv_vec3 up = gv_rotate(base, gv_v3(0, 0, 1));
    if (f == 1) put_joint(c, GV_MIDDLE_INDEX_ABDUCTION, T.p, up, 7u << 3);
    if (f == 3) put_joint(c, GV_RING_MIDDLE_ABDUCTION, T.p, gv_neg(up), 7u << 9);
    if (f == 4) put_joint(c, GV_LITTLE_RING_ABDUCTION, T.p, gv_neg(up), 7u << 12);
    finger_chain(m, f, T, sensor[f], angle, c);
  }
  put_joint(c, GV_PALM_ARCH, gv_v3(0, 0, 0), gv_v3(1, 0, 0), 63u << 9);
}

// The hand frame: the wrist's after pitch (flexion) and yaw (towards the thumb).
static gv_pose hand_frame(const gv_pose *T_world_wrist, const double *angle, bool left) {
  double yaw = left ? -angle[GV_WRIST_YAW] : angle[GV_WRIST_YAW];
  gv_quat q = gv_quat_mul(turn_y(angle[GV_WRIST_PITCH]), turn_z(yaw));
  return (gv_pose){gv_quat_mul(T_world_wrist->q, q), T_world_wrist->p};
}

// Mirror image in y: of a point, of a rotation, of an axis of rotation.
static gv_vec3 mirror_point(gv_vec3 p) { return gv_v3(p.x, -p.y, p.z); }
static gv_quat mirror_turn(gv_quat q) { return (gv_quat){q.w, -q.x, q.y, -q.z}; }
static gv_vec3 mirror_axis(gv_vec3 a) { return gv_v3(-a.x, a.y, -a.z); }

static void place_limbs(const gv_hand_model *model, gv_pose T, bool left, gv_pose limb[GV_LIMBS]) {
  limb[GV_LIMB_PALM] = (gv_pose){gv_quat_identity(), model->palm_center_m};
  for (int i = 0; i < GV_LIMBS; i++) {
    if (left) limb[i] = (gv_pose){mirror_turn(limb[i].q), mirror_point(limb[i].p)};
    limb[i] = gv_pose_mul(T, limb[i]);
    limb[i].q = gv_quat_normalize(limb[i].q);
  }
}

static void place_joints(const gv_pose *T_world_wrist, gv_pose T, bool left, gv_joint_axis out_joint[GV_SENSORS]) {
  gv_quat unturn = gv_quat_conj(gv_quat_mul(gv_quat_conj(T_world_wrist->q), T.q));
  out_joint[GV_WRIST_PITCH] = (gv_joint_axis){{0, 0, 0}, gv_rotate(unturn, gv_v3(0, 1, 0)), 0xffffu};
  out_joint[GV_WRIST_YAW] = (gv_joint_axis){{0, 0, 0}, gv_v3(0, 0, 1), 0xffffu};
  for (int i = 0; i < GV_SENSORS; i++) {
    gv_joint_axis *j = &out_joint[i];
    bool wrist_pitch = i == GV_WRIST_PITCH;  // already in the true (unmirrored) hand frame
    if (left) { j->p_world = mirror_point(j->p_world); if (!wrist_pitch) j->axis_world = mirror_axis(j->axis_world); }
    j->p_world = gv_transform(T, j->p_world);
    j->axis_world = gv_rotate(T.q, j->axis_world);
  }
}

void gv_hand_pose(const gv_hand_model *model, const gv_pose *T_world_wrist, const double angle_rad[GV_SENSORS],
                  gv_pose out_T_world_limb[GV_LIMBS], gv_joint_axis out_joint[GV_SENSORS]) {
  bool left = model->side == GV_LEFT;
  chain c = {out_T_world_limb, out_joint};
  gv_pose T = hand_frame(T_world_wrist, angle_rad, left);
  thumb_chain(model, angle_rad, &c);
  finger_chains(model, angle_rad, &c);
  if (out_T_world_limb) place_limbs(model, T, left, out_T_world_limb);
  if (out_joint) place_joints(T_world_wrist, T, left, out_joint);
}

void gv_hand_frames(const gv_hand_model *model, const gv_pose *T_world_wrist, const double angle_rad[GV_SENSORS],
                    gv_pose out_T_world_limb[GV_LIMBS]) {
  gv_hand_pose(model, T_world_wrist, angle_rad, out_T_world_limb, NULL);
}

void gv_hand_joints(const gv_hand_model *model, const gv_pose *T_world_wrist, const double angle_rad[GV_SENSORS],
                    gv_joint_axis out_joint[GV_SENSORS]) {
  gv_hand_pose(model, T_world_wrist, angle_rad, NULL, out_joint);
}
