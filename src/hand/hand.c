// SPDX-License-Identifier: BSD-3-Clause
// The hand's skeleton: calibration of raw sensor counts, and forward kinematics from 22 joint angles and
// the wrist's pose to 16 driver frames and the joint axes (section A of the paper). The right hand is
// computed in its wrist frame; a left hand is its mirror image in y. Pure; any thread.
#include "gloved/hand.h"

#include <assert.h>
#include <stddef.h>

#define DEG (GV_PI / 180.0)
// Thumb: the abduction at which its pad faces the finger pads.
#define THUMB_OPPOSED_RAD (45.0 * DEG)

static const char *const sensor_names[GV_SENSORS] = {"thumb_rotate",
                                                     "thumb_mpj",
                                                     "thumb_ij",
                                                     "thumb_abduction",
                                                     "index_mpj",
                                                     "index_pij",
                                                     "index_dij",
                                                     "middle_mpj",
                                                     "middle_pij",
                                                     "middle_dij",
                                                     "middle_index_abduction",
                                                     "ring_mpj",
                                                     "ring_pij",
                                                     "ring_dij",
                                                     "ring_middle_abduction",
                                                     "little_mpj",
                                                     "little_pij",
                                                     "little_dij",
                                                     "little_ring_abduction",
                                                     "palm_arch",
                                                     "wrist_pitch",
                                                     "wrist_yaw"};
static const char *const limb_names[GV_LIMBS] = {
  "thumb_metacarpal", "thumb_proximal", "thumb_distal",    "index_proximal",
  "index_middle",     "index_distal",   "middle_proximal", "middle_middle",
  "middle_distal",    "ring_proximal",  "ring_middle",     "ring_distal",
  "little_proximal",  "little_middle",  "little_distal",   "palm"};
static const char *const finger_names[GV_FINGERS] = {"thumb", "index", "middle", "ring", "little"};

const char *gv_sensor_name(int sensor) {
  return sensor >= 0 && sensor < GV_SENSORS ? sensor_names[sensor] : NULL;
}
const char *gv_limb_name(int limb) { return limb >= 0 && limb < GV_LIMBS ? limb_names[limb] : NULL; }
const char *gv_finger_name(int finger) {
  return finger >= 0 && finger < GV_FINGERS ? finger_names[finger] : NULL;
}

gv_hand_model gv_hand_model_default(gv_side side) {
  gv_hand_model m = {
    .side = side,
    .segment_m = {{0.0466, 0.0314, 0.0269},
                  {0.0403, 0.0222, 0.0202},
                  {0.0470, 0.0280, 0.0210},
                  {0.0433, 0.0262, 0.0231},
                  {0.0342, 0.0177, 0.0209}},
    .radius_m = {{0.0110, 0.0100, 0.0090},
                 {0.0095, 0.0085, 0.0075},
                 {0.0095, 0.0085, 0.0075},
                 {0.0090, 0.0080, 0.0070},
                 {0.0080, 0.0070, 0.0065}},
    // Metacarpals of 70.5 67.0 61.4 56.0 mm fanned out from the carpus, 16 mm distal of the wrist joint.
    .base_m = {{0.0180, 0.0220, -0.0120},
               {0.0851, 0.0250, 0.0},
               {0.0830, 0.0040, 0.0},
               {0.0766, -0.0150, 0.0},
               {0.0683, -0.0320, 0.0}},
    .palm_center_m = {0.0440, -0.0030, 0.0},
    .palm_half_m = {0.0320, 0.0270, 0.0020},
    .palm_radius_m = 0.0100,
  };
  static const double limit_deg[GV_SENSORS][2] = {
    {-25, 35}, {-10, 80}, {-15, 80}, {-30, 60},  // thumb: CMC flexion, MCP, IP, abduction
    {0, 90},   {0, 100},  {-10, 90},             // index: MCP, PIP, DIP
    {0, 90},   {0, 100},  {-10, 90}, {-15, 42},  // middle, and its abduction from the index
    {0, 90},   {0, 100},  {-10, 90}, {-14, 20},  // ring, from the middle
    {0, 90},   {0, 100},  {-10, 90}, {-19, 40},  // little, from the ring
    {0, 40},   {-40, 60}, {-30, 30},             // palm arch, wrist pitch and yaw
  };
  for (int i = 0; i < GV_SENSORS; i++) {
    m.angle_min_rad[i] = limit_deg[i][0] * DEG;
    m.angle_max_rad[i] = limit_deg[i][1] * DEG;
  }
  return m;
}

gv_calibration gv_calibration_default(void) {
  gv_calibration cal;
  for (int i = 0; i < GV_SENSORS; i++) {
    cal.raw[i][0] = 1024.0;
    cal.angle_rad[i][0] = 0.0;
    cal.raw[i][1] = 3072.0;
    cal.angle_rad[i][1] = 0.5 * GV_PI;
  }
  return cal;
}

int gv_calibration_check(const gv_calibration *cal) {
  for (int i = 0; i < GV_SENSORS; i++) {
    double counts = cal->raw[i][1] - cal->raw[i][0];
    double angle = cal->angle_rad[i][1] - cal->angle_rad[i][0];
    if (!isfinite(counts) || !isfinite(angle) || fabs(counts) < 1.0 || fabs(angle) < 1e-6)
      return -1 - i;
  }
  return 0;
}

double gv_calibration_raw(const gv_calibration *cal, int sensor, double angle_rad) {
  assert(sensor >= 0 && sensor < GV_SENSORS);
  const double *r = cal->raw[sensor];
  const double *a = cal->angle_rad[sensor];
  return r[0] + (angle_rad - a[0]) * (r[1] - r[0]) / (a[1] - a[0]);
}

static double half_length(const gv_hand_model *model, int finger, int segment) {
  double length = model->segment_m[finger][segment];
  if (segment == 2)
    length -= model->radius_m[finger][2];  // the cap ends at the fingertip
  return length > 0.0 ? 0.5 * length : 0.0;
}

double gv_hand_half_length(const gv_hand_model *model, int limb) {
  assert(limb >= 0 && limb < GV_LIMBS - 1);
  return half_length(model, limb / 3, limb % 3);
}

const int gv_flexion[GV_FINGERS][3] = {{GV_THUMB_ROTATE, GV_THUMB_MPJ, GV_THUMB_IJ},
                                       {GV_INDEX_MPJ, GV_INDEX_PIJ, GV_INDEX_DIJ},
                                       {GV_MIDDLE_MPJ, GV_MIDDLE_PIJ, GV_MIDDLE_DIJ},
                                       {GV_RING_MPJ, GV_RING_PIJ, GV_RING_DIJ},
                                       {GV_LITTLE_MPJ, GV_LITTLE_PIJ, GV_LITTLE_DIJ}};

// Cosine and sine of half an angle: what a quaternion needs of a turn.
typedef struct turn {
  double c, s;
} turn;
typedef struct turns {
  double c[GV_SENSORS], s[GV_SENSORS];
} turns;

// Of every joint; the thumb's abduction counted from where it is opposed, of the palm arch what the ring has
// of it. Few go beyond GV_NEAR, a right angle.
static void halve_turns(const double angle_rad[GV_SENSORS], turns *out) {
  double half[GV_SENSORS];
  for (int i = 0; i < GV_SENSORS; i++)
    half[i] = 0.5 * angle_rad[i];
  half[GV_THUMB_ABDUCTION] -= 0.5 * THUMB_OPPOSED_RAD;
  half[GV_PALM_ARCH] *= 0.5;
  for (int i = 0; i < GV_SENSORS; i++) {
    out->s[i] = gv_sin_near(half[i]);
    out->c[i] = gv_cos_near(half[i]);
  }
  for (int i = 0; i < GV_SENSORS; i++)
    if (fabs(half[i]) > GV_NEAR)
      gv_sincos(half[i], &out->s[i], &out->c[i]);
}

static turn turn_of(const turns *all, int sensor) {
  assert(sensor >= 0 && sensor < GV_SENSORS);
  return (turn){all->c[sensor], all->s[sensor]};
}

static turn back(turn t) { return (turn){t.c, -t.s}; }
static turn add_turns(turn a, turn b) { return (turn){a.c * b.c - a.s * b.s, a.s * b.c + a.c * b.s}; }

// q, then a turn about its own y or z.
static gv_quat turned_y(gv_quat q, turn t) {
  return (gv_quat){q.w * t.c - q.y * t.s, q.x * t.c - q.z * t.s, q.y * t.c + q.w * t.s,
                   q.z * t.c + q.x * t.s};
}
static gv_quat turned_z(gv_quat q, turn t) {
  return (gv_quat){q.w * t.c - q.z * t.s, q.x * t.c + q.y * t.s, q.y * t.c - q.x * t.s,
                   q.z * t.c + q.w * t.s};
}

// The thumb's metacarpal in the hand frame at abduction THUMB_OPPOSED_RAD and no flexion: x points
// along (0.30, 0.08, -0.95), palmar, and z away from the finger pads, which lie towards (0.87, -0.42,
// 0.24) (test_hand.c works it out).
static const gv_quat thumb_opposed = {0.19781653199797011, -0.7816336659799441, 0.096498539168966363,
                                      0.5836141394905584};

// What each finger stands on, in the hand frame of the right hand: where it starts, and its x and z when
// straight. Index to little: palm arch turns the ring's base by half and the little's whole about x; the
// abduction sensors measure neighbours against each other, the middle finger being straight.
static void find_roots(const gv_hand_model *m, const turns *half, gv_pose root[GV_FINGERS]) {
  const turn arch = turn_of(half, GV_PALM_ARCH);
  const turn whole_arch = add_turns(arch, arch);
  const turn ring = back(turn_of(half, GV_RING_MIDDLE_ABDUCTION));
  const gv_quat none = gv_quat_identity();
  const gv_quat at_ring = {arch.c, arch.s, 0, 0};
  const gv_quat at_little = {whole_arch.c, whole_arch.s, 0, 0};
  root[0] = (gv_pose){turned_z(thumb_opposed, turn_of(half, GV_THUMB_ABDUCTION)), m->base_m[0]};
  root[1] = (gv_pose){turned_z(none, turn_of(half, GV_MIDDLE_INDEX_ABDUCTION)), m->base_m[1]};
  root[2] = (gv_pose){none, m->base_m[2]};
  root[3] = (gv_pose){turned_z(at_ring, ring), gv_rotate(at_ring, m->base_m[3])};
  root[4] = (gv_pose){turned_z(at_little, add_turns(ring, back(turn_of(half, GV_LITTLE_RING_ABDUCTION)))),
                      gv_rotate(at_little, m->base_m[4])};
}

// The hand frame: the wrist's after pitch (flexion) and yaw (towards the thumb).
static gv_pose hand_frame(const gv_pose *T_world_wrist, const turns *half, bool left) {
  turn yaw = turn_of(half, GV_WRIST_YAW);
  gv_quat q = turned_z(turned_y(T_world_wrist->q, turn_of(half, GV_WRIST_PITCH)), left ? back(yaw) : yaw);
  return (gv_pose){gv_quat_normalize(q), T_world_wrist->p};
}

// Mirror image in y. A turn about y is its own image.
static gv_vec3 mirror(gv_vec3 p) { return gv_v3(p.x, -p.y, p.z); }
static gv_pose mirror_pose(gv_pose T) { return (gv_pose){{T.q.w, -T.q.x, T.q.y, -T.q.z}, mirror(T.p)}; }

typedef struct chain {
  gv_pose *limb;         // [16]; may be null
  gv_joint_axis *joint;  // [22]; may be null
} chain;

static void put_joint(const chain *c, int sensor, gv_vec3 p, gv_vec3 axis, uint32_t limbs) {
  if (c->joint)
    c->joint[sensor] = (gv_joint_axis){p, axis, limbs};
}

// A finger bends about the y of its root alone, so it lies in the plane of the root's x and
// z, and its bones' turns add up.
static void put_finger(const gv_hand_model *m, int finger, const gv_pose *root, const gv_mat3 *R,
                       const turns *half, const chain *c) {
  const gv_vec3 x = gv_mat3_column(R, 0);
  const gv_vec3 y = gv_mat3_column(R, 1);
  const gv_vec3 z = gv_mat3_column(R, 2);
  gv_vec3 p = root->p;
  turn bent = {1, 0};
  for (int s = 0; s < 3; s++) {
    put_joint(c, gv_flexion[finger][s], p, y, (7u << s & 7u) << (3 * finger));
    bent = add_turns(bent, turn_of(half, gv_flexion[finger][s]));
    turn whole = add_turns(bent, bent);
    gv_vec3 along = gv_mad(gv_scale(x, whole.c), -whole.s, z);
    if (c->limb)
      c->limb[3 * finger + s] = (gv_pose){turned_y(root->q, bent),
                                          gv_mad(p, half_length(m, finger, s), along)};
    p = gv_mad(p, m->segment_m[finger][s], along);
  }
}

static void put_fingers(const gv_hand_model *m, gv_pose T, const gv_mat3 *R_hand, const turns *half,
                        const chain *c) {
  static const int abduction[GV_FINGERS] = {GV_THUMB_ABDUCTION, GV_MIDDLE_INDEX_ABDUCTION, -1,
                                            GV_RING_MIDDLE_ABDUCTION, GV_LITTLE_RING_ABDUCTION};
  const bool left = m->side == GV_LEFT;
  gv_pose root[GV_FINGERS];
  find_roots(m, half, root);
  for (int f = 0; f < GV_FINGERS; f++) {
    if (left)
      root[f] = mirror_pose(root[f]);
    root[f] = (gv_pose){gv_quat_mul(T.q, root[f].q), gv_add(T.p, gv_mat3_mul(R_hand, root[f].p))};
    gv_mat3 R = gv_mat3_from_quat(root[f].q);
    gv_vec3 up = gv_mat3_column(&R, 2);  // ring and little spread the other way; so does a left hand
    if (abduction[f] >= 0)
      put_joint(c, abduction[f], root[f].p, (f > 2) != left ? gv_neg(up) : up, 7u << (3 * f));
    put_finger(m, f, &root[f], &R, half, c);
  }
}

void gv_hand_pose(const gv_hand_model *model, const gv_pose *T_world_wrist,
                  const double angle_rad[GV_SENSORS], gv_pose out_T_world_limb[GV_LIMBS],
                  gv_joint_axis out_joint[GV_SENSORS]) {
  const bool left = model->side == GV_LEFT;
  const chain c = {out_T_world_limb, out_joint};
  turns half;
  halve_turns(angle_rad, &half);
  const gv_pose T = hand_frame(T_world_wrist, &half, left);
  const gv_mat3 R = gv_mat3_from_quat(T.q);
  const gv_vec3 x = gv_mat3_column(&R, 0);
  const gv_vec3 z = gv_mat3_column(&R, 2);
  const gv_vec3 palm = left ? mirror(model->palm_center_m) : model->palm_center_m;
  put_fingers(model, T, &R, &half, &c);
  put_joint(&c, GV_PALM_ARCH, T.p, left ? gv_neg(x) : x, 63u << 9);
  put_joint(&c, GV_WRIST_PITCH, T.p, gv_rotate(T_world_wrist->q, gv_v3(0, 1, 0)), 0xffffu);
  put_joint(&c, GV_WRIST_YAW, T.p, left ? gv_neg(z) : z, 0xffffu);
  if (out_T_world_limb)
    out_T_world_limb[GV_LIMB_PALM] = (gv_pose){T.q, gv_add(T.p, gv_mat3_mul(&R, palm))};
}

void gv_hand_frames(const gv_hand_model *model, const gv_pose *T_world_wrist,
                    const double angle_rad[GV_SENSORS], gv_pose out_T_world_limb[GV_LIMBS]) {
  gv_hand_pose(model, T_world_wrist, angle_rad, out_T_world_limb, NULL);
}

void gv_hand_joints(const gv_hand_model *model, const gv_pose *T_world_wrist,
                    const double angle_rad[GV_SENSORS], gv_joint_axis out_joint[GV_SENSORS]) {
  gv_hand_pose(model, T_world_wrist, angle_rad, NULL, out_joint);
}
