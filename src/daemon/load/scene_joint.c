// SPDX-License-Identifier: BSD-3-Clause
// Joints in a scene file. Anchor and axis are given in the world, as the objects stand at the start. Main
// thread, or that of a scene by command; before the loop starts.
#include "daemon/load/scene_joint.h"

#include <string.h>

#define MAX_ANCHOR_M 40.0
#define MAX_TRAVEL_M 10.0
#define MAX_FORCE 1e4      // N or N m
#define MAX_STIFFNESS 1e6  // N/m or N m/rad
#define MAX_DAMPING 1e5
#define DEGREE (GV_PI / 180)

gv_conf_node gv_joints_find(gv_conf_group *root) { return gv_conf_find(root, "joints"); }

static int read_object(const gv_scene *scene, gv_conf_group *group, const char *key) {
  const gv_conf_names names = {.entries = scene->object,
                               .size = sizeof *scene->object,
                               .count = scene->object_count,
                               .what = "object",
                               .mend = "give the name of one in 'objects'"};
  return gv_conf_reference(group, key, &names, GV_WORLD);
}

static void read_bodies(const gv_scene *scene, gv_conf_group *group, gv_joint *out) {
  gv_conf_node object = gv_conf_need(group, "object", "object = \"<name>\";");
  out->object_a = read_object(scene, group, "object");
  out->object_b = read_object(scene, group, "to");
  gv_conf_bool(group, "collide", &out->collides);
  if (group->node.conf->failed)
    return;
  if (out->object_a == out->object_b)
    gv_conf_fail(object, "'object' and 'to' are the same; name two objects, or leave 'to' out for the world");
  else if (scene->object[out->object_a].is_static)
    gv_conf_fail(object, "\"%s\" is static; exchange 'object' and 'to'", scene->object[out->object_a].name);
}

// The turn that takes x to the axis.
static gv_quat turn_to(gv_vec3 axis) {
  const gv_vec3 x = gv_v3(1, 0, 0);
  if (gv_dot(x, axis) < -1 + 1e-12)
    return gv_quat_axis_angle(gv_v3(0, 0, 1), GV_PI);
  const gv_vec3 turn = gv_cross(x, axis);
  return gv_quat_normalize((gv_quat){1 + gv_dot(x, axis), turn.x, turn.y, turn.z});
}

static bool has_axis(const gv_joint *joint) {
  return joint->kind == GV_JOINT_HINGE || joint->kind == GV_JOINT_SLIDER;
}

static void refuse_key(gv_conf_group *group, const char *key) {
  gv_conf_node node = gv_conf_find(group, key);
  if (gv_conf_has(node))
    gv_conf_fail(node, "'%s' belongs to a hinge or a slider; leave it out", key);
}

static void read_frame(const gv_scene *scene, gv_conf_group *group, gv_joint *out) {
  double p[3] = {0, 0, 0};
  double a[3] = {1, 0, 0};
  gv_conf_need(group, "anchor", "anchor = [x, y, z]; in the world, metres");
  gv_conf_numbers(group, "anchor", -MAX_ANCHOR_M, MAX_ANCHOR_M, 3, "[x, y, z] in metres", p);
  if (has_axis(out))
    gv_conf_need(group, "axis", "axis = [x, y, z]; in the world");
  else
    refuse_key(group, "axis");
  gv_conf_numbers(group, "axis", -1e3, 1e3, 3, "[x, y, z], a direction", a);
  const gv_vec3 axis = gv_v3(a[0], a[1], a[2]);
  if (!(gv_norm(axis) > 1e-6))
    gv_conf_fail(gv_conf_find(group, "axis"), "the axis has no direction; give one, as [0, 0, 1]");
  if (group->node.conf->failed)
    return;
  const gv_pose T_world_joint = {turn_to(gv_normalize_or(axis, gv_v3(1, 0, 0))), gv_v3(p[0], p[1], p[2])};
  out->T_a_joint = gv_pose_mul(gv_pose_inv(scene->object[out->object_a].T_world_body), T_world_joint);
  out->T_b_joint = T_world_joint;
  if (out->object_b == GV_WORLD)
    return;
  out->T_b_joint = gv_pose_mul(gv_pose_inv(scene->object[out->object_b].T_world_body), T_world_joint);
}

static void read_limits(gv_conf_group *group, gv_joint *out) {
  const bool turns = out->kind == GV_JOINT_HINGE;
  const double unit = turns ? DEGREE : 1.0;
  const double most = turns ? 179.0 : MAX_TRAVEL_M;
  double v[2];
  out->has_limits = gv_conf_numbers(group, "limits", -most, most, 2,
                                    turns ? "[low, high] in degrees" : "[low, high] in metres", v);
  if (!out->has_limits)
    return;
  out->low = unit * v[0];
  out->high = unit * v[1];
  if (!(v[0] < v[1]) || v[0] > 0 || v[1] < 0)
    gv_conf_fail(gv_conf_find(group, "limits"),
                 "limits [%g, %g]: the joint starts at 0, so give one below and one above", v[0], v[1]);
}

static void read_spring(gv_conf_group *group, gv_joint *out) {
  const bool turns = out->kind == GV_JOINT_HINGE;
  double v[3];
  const char *shape = turns ? "[N m/rad, N m s/rad, rest in degrees]" : "[N/m, N s/m, rest in metres]";
  if (!gv_conf_numbers(group, "spring", -MAX_STIFFNESS, MAX_STIFFNESS, 3, shape, v))
    return;
  out->spring_stiffness = v[0];
  out->spring_damping = v[1];
  out->spring_rest = turns ? v[2] * DEGREE : v[2];
  if (v[0] < 0 || v[1] < 0 || v[1] > MAX_DAMPING)
    gv_conf_fail(gv_conf_find(group, "spring"),
                 "stiffness and damping of a spring are 0 or more (damping at most %g)", MAX_DAMPING);
}

static void read_axis(gv_conf_group *group, gv_joint *out) {
  if (!has_axis(out)) {
    refuse_key(group, "limits");
    refuse_key(group, "friction");
    refuse_key(group, "spring");
    return;
  }
  read_limits(group, out);
  read_spring(group, out);
  gv_conf_number(group, "friction", 0, MAX_FORCE, &out->friction);
}

static void read_joint(gv_conf_node node, const gv_scene *scene, int index, gv_joint *out) {
  static const char *const kinds[] = {"fixed", "ball", "hinge", "slider", NULL};
  gv_conf_group group = gv_conf_as_group(node, "a joint");
  int kind = 0;
  *out = (gv_joint){.object_a = 0, .object_b = GV_WORLD};
  gv_conf_node name = gv_conf_need(&group, "name", "name = \"...\";");
  gv_conf_text(&group, "name", out->name, sizeof out->name);
  gv_conf_need(&group, "kind", "kind = \"fixed\", \"ball\", \"hinge\" or \"slider\";");
  gv_conf_choice(&group, "kind", kinds, &kind);
  out->kind = (gv_joint_kind)kind;
  read_bodies(scene, &group, out);
  if (!node.conf->failed)
    read_frame(scene, &group, out);
  if (!node.conf->failed)
    read_axis(&group, out);
  gv_conf_number(&group, "break_force", 1e-3, MAX_FORCE, &out->break_force_n);
  gv_conf_leave(&group);
  for (int i = 0; i < index; i++)
    if (strcmp(scene->joint[i].name, out->name) == 0)
      gv_conf_fail(name, "two joints are named \"%s\"; rename one", out->name);
}

void gv_joints_read(gv_conf_node list, gv_arena *arena, gv_scene *io_scene) {
  if (!gv_conf_has(list))
    return;
  const int count = gv_conf_length(list);
  if (count < 0)
    gv_conf_fail(list, "'joints' is no list; write joints = ( { ... }, ... );");
  if (count > GV_MAX_JOINTS)
    gv_conf_fail(list, "'joints' has %d entries; at most %d (GV_MAX_JOINTS)", count, GV_MAX_JOINTS);
  if (count <= 0 || list.conf->failed)
    return;
  gv_joint *joint = gv_arena_alloc(arena, "scene joints", sizeof *joint * (size_t)count);
  if (!joint) {
    gv_conf_fail(list, "the scene does not fit into its %zu bytes of memory; simplify it", arena->size);
    return;
  }
  io_scene->joint = joint;
  for (int i = 0; i < count && !list.conf->failed; i++)
    read_joint(gv_conf_entry(list, i), io_scene, i, &joint[i]);
  io_scene->joint_count = count;
}
