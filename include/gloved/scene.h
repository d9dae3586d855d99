// SPDX-License-Identifier: BSD-3-Clause
// What never changes after loading: objects as compounds of convex pieces, with mass and polygons.
// The same polygons are the visual and the collision mesh.
#ifndef GLOVED_SCENE_H
#define GLOVED_SCENE_H

#include "gloved/shape.h"

#ifdef __cplusplus
extern "C" {
#endif

// coulomb: at most mu x normal force, in any direction (Eqn 9); newton and dantzig solve that round cone,
// quickstep makes a pyramid of it. fixed_limit: at most `mu` newtons, as ODE means Eqn 10.
typedef enum gv_friction { GV_FRICTION_COULOMB, GV_FRICTION_FIXED_LIMIT } gv_friction;

// How two named materials rub against each other, whatever each says alone.
enum { GV_MATERIAL_NONE = 0, GV_MATERIAL_HAND = 1 };  // others count from 2
typedef struct gv_friction_pair {
  int material_a, material_b;
  gv_friction friction;
  double mu;  // coefficient, or newtons
} gv_friction_pair;

typedef struct gv_object {
  char name[GV_MAX_NAME];
  bool is_static;        // never moves (table); mass and inertia unused
  gv_pose T_world_body;  // start pose of the body frame: origin in the centre of mass, axes as in
                         // the file
  gv_vec3 center_m;      // centre of mass in the file's object frame (T_object_body is this
                         // translation)
  double mass_kg;
  gv_mat3 inertia_kg_m2;  // about the centre of mass, body axes
  // Two bodies without a gv_friction_pair use the geometric mean of their mu; a fixed
  // limit goes before Coulomb's.
  gv_friction friction;
  double mu;                           // coefficient, or newtons
  int material;                        // which pairs apply to it
  int piece_first, piece_count;        // into gv_scene.piece
  int vertex_first, vertex_count;      // into gv_scene.mesh_vertex
  int triangle_first, triangle_count;  // into gv_scene.mesh_triangle
} gv_object;

typedef struct gv_triangle {
  uint32_t v[3];
} gv_triangle;  // indices count from the object's vertex_first

// A joint holds an object to another one, or to the world. What is left to move: a ball turns every way, a
// hinge about its axis, a slider along it, what is fixed not at all.
typedef enum gv_joint_kind { GV_JOINT_FIXED, GV_JOINT_BALL, GV_JOINT_HINGE, GV_JOINT_SLIDER } gv_joint_kind;
enum { GV_WORLD = -1 };

// The position of a hinge (rad) or slider (m) is that of a against b, about or along
// the axis, zero at the start.
typedef struct gv_joint {
  char name[GV_MAX_NAME];
  gv_joint_kind kind;
  int object_a, object_b;        // two different objects, a not static; b may be GV_WORLD
  gv_pose T_a_joint, T_b_joint;  // the joint's frame, x its axis, as a and b carry it (b the world: in
                                 // the world)
  bool collides;                 // a and b collide with each other as if there were no joint
  // hinge and slider alone
  bool has_limits;
  double low, high;                         // of the position
  double friction;                          // holds the position with up to so much, N m or N; 0: none
  double spring_stiffness, spring_damping;  // N m/rad, N m s/rad, or N/m, N s/m; both 0: none
  double spring_rest;                       // position where the spring is slack
  double break_force_n;  // across the joint; more of it in one step breaks the joint until the
                         // scene is reset. 0: never
} gv_joint;

// A joint of the scene at the end of the last step.
typedef struct gv_joint_state {
  double position;  // of a hinge (rad, -pi to pi) or a slider (m); 0 of the others
  double force_n;   // across it, in that step
  bool broken;
} gv_joint_state;

typedef struct gv_scene {
  gv_vec3 gravity_m_s2;
  int object_count, piece_count, vertex_count, triangle_count;
  const gv_object *object;           // [object_count]
  const gv_hull *piece;              // [piece_count] vertices in the body frame of their object
  const gv_vec3 *mesh_vertex;        // [vertex_count] body frame
  const gv_triangle *mesh_triangle;  // [triangle_count] counter-clockwise from outside
  int friction_pair_count;
  const gv_friction_pair *friction_pair;  // [friction_pair_count] the first that fits counts
  int joint_count;
  const gv_joint *joint;  // [joint_count]
} gv_scene;

#ifdef __cplusplus
}
#endif

#endif
