// SPDX-License-Identifier: BSD-3-Clause
// Scene text to gv_scene: reads the objects, checks that each is a solid filled by its convex pieces, and
// moves every body frame into the centre of mass (mass properties at uniform density unless the file gives
// them). The format is explained in doc/scene.md. Main thread, before the loop starts.
#include "daemon/load/scene_load.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "daemon/load/conf.h"
#include "daemon/load/scene_check.h"
#include "daemon/load/scene_friction.h"
#include "daemon/load/scene_joint.h"
#include "daemon/load/scene_primitive.h"

#define MAX_COORDINATE_M 10.0  // a scene fits a room; more is a file in millimetres
#define MAX_DISTANCE_M                                                                                       \
  40.0  // of an object from the origin along each axis; the engine puts bodies back at 100 m
#define DEFAULT_FIT_M 1e-6  // mesh and pieces agree to the rounding of decimals in a text

// The scene being filled. Counts run up to those of `scene`, which were counted
// before anything was allocated.
typedef struct loader {
  gv_arena *arena;
  gv_scene scene;
  gv_object *object;
  gv_hull *piece;
  gv_vec3 *vertex;
  gv_triangle *triangle;
  int objects, pieces, vertices, triangles;
  gv_materials materials;
  int64_t work;  // left of GV_CHECK_WORK
} loader;

// Where one object's shape stands in the file. A primitive has none of the lists.
typedef struct source {
  gv_conf_node object, vertices, triangles, pieces;
  gv_primitive primitive;
  int vertex_count, triangle_count, piece_count;
} source;

// ---- sizes ----------------------------------------------------------------------------------------

static int need_list(gv_conf_group *group, const char *key, const char *hint, gv_conf_node *out) {
  *out = gv_conf_need(group, key, hint);
  int length = gv_conf_length(*out);
  if (length < 0)
    gv_conf_fail(*out, "'%s' is no list; write %s", key, hint);
  else if (length == 0)
    gv_conf_fail(*out, "'%s' is empty; write %s", key, hint);
  return length < 0 ? 0 : length;
}

// Every key of an object besides its shape, for the message about one that has none.
static const char *const object_keys[] = {
  "name", "static",   "mass",        "friction", "mu",     "material",
  "fit",  "position", "orientation", "rotation", "center", "inertia",
};

// No shape: a key that is none ("sphere") is the likelier mistake, and is named with those that there are.
static void fail_without_shape(gv_conf_group *group) {
  for (size_t i = 0; i < sizeof object_keys / sizeof *object_keys; i++)
    gv_conf_find(group, object_keys[i]);
  gv_conf_leave(group);
  gv_conf_fail(group->node, "the object has no shape; add one of %s", gv_primitive_list());
}

static source find_source(gv_conf_group *group) {
  source src = {.object = group->node, .primitive = gv_primitive_find(group)};
  if (src.primitive.kind) {
    src.vertex_count = src.primitive.vertex_count;
    src.triangle_count = src.primitive.triangle_count;
    src.piece_count = 1;
    return src;
  }
  const char *const list[3] = {"vertices", "triangles", "pieces"};
  bool any = false;
  for (int i = 0; i < 3; i++)
    any = gv_conf_has(gv_conf_find(group, list[i])) || any;
  if (!any) {
    fail_without_shape(group);
    return src;
  }
  src.vertex_count = need_list(group, "vertices", "vertices = ( [x, y, z], ... );", &src.vertices);
  src.triangle_count = need_list(group, "triangles", "triangles = ( [0, 1, 2], ... );", &src.triangles);
  src.piece_count = need_list(group, "pieces", "pieces = ( [0, 1, 2, 3], ... );", &src.pieces);
  return src;
}

static void count_one(int *total, int more, int max, const char *max_name, const char *what,
                      gv_conf_node at) {
  *total += more;
  if (*total > max)
    gv_conf_fail(at, "the scene has %d %s up to here; at most %d (%s): simplify it", *total, what, max,
                 max_name);
}

static void count_points(int *total, const source *src) {
  if (src->primitive.kind)
    count_one(total, src->primitive.point_count, GV_MAX_VERTICES, "GV_MAX_VERTICES", "points of pieces",
              src->primitive.node);
  for (int i = 0; gv_conf_has(src->pieces) && i < src->piece_count; i++) {
    gv_conf_node piece = gv_conf_entry(src->pieces, i);
    int length = gv_conf_length(piece);
    if (length < 0)
      gv_conf_fail(piece, "a piece is a list of vertex numbers or points; write [0, 1, 2, 3]");
    count_one(total, length, GV_MAX_VERTICES, "GV_MAX_VERTICES", "points of pieces", piece);
  }
}

static void count_scene(gv_scene *scene, gv_conf_node objects) {
  int length = gv_conf_length(objects);
  int points = 0;
  count_one(&scene->object_count, length, GV_MAX_OBJECTS, "GV_MAX_OBJECTS", "objects", objects);
  for (int i = 0; i < length && !objects.conf->failed; i++) {
    gv_conf_group group = gv_conf_as_group(gv_conf_entry(objects, i), "an object");
    source src = find_source(&group);
    bool simple = src.primitive.kind != GV_PRIMITIVE_NONE;
    count_one(&scene->vertex_count, src.vertex_count, GV_MAX_VERTICES, "GV_MAX_VERTICES", "vertices",
              simple ? src.object : src.vertices);
    count_one(&scene->triangle_count, src.triangle_count, GV_MAX_MESH_TRIANGLES, "GV_MAX_MESH_TRIANGLES",
              "triangles", simple ? src.object : src.triangles);
    count_one(&scene->piece_count, src.piece_count, GV_MAX_PIECES, "GV_MAX_PIECES", "pieces",
              simple ? src.object : src.pieces);
    count_points(&points, &src);
  }
}

static bool fail_memory(const loader *l, gv_conf_node at) {
  return gv_conf_fail(at, "the scene does not fit into its %zu bytes of memory; simplify it", l->arena->size);
}

static bool allocate(loader *l, gv_conf_node at) {
  const gv_scene *s = &l->scene;
  l->object = gv_arena_alloc(l->arena, "scene objects", sizeof *l->object * (size_t)s->object_count);
  l->piece = gv_arena_alloc(l->arena, "scene pieces", sizeof *l->piece * (size_t)s->piece_count);
  l->vertex = gv_arena_alloc(l->arena, "scene vertices", sizeof *l->vertex * (size_t)s->vertex_count);
  l->triangle = gv_arena_alloc(l->arena, "scene triangles", sizeof *l->triangle * (size_t)s->triangle_count);
  l->scene.object = l->object;
  l->scene.piece = l->piece;
  l->scene.mesh_vertex = l->vertex;
  l->scene.mesh_triangle = l->triangle;
  if (l->object && l->piece && l->vertex && l->triangle)
    return true;
  return fail_memory(l, at);
}

// ---- one object's settings ------------------------------------------------------------------------

static void read_name(loader *l, gv_conf_group *group, gv_object *out) {
  gv_conf_node node = gv_conf_need(group, "name", "name = \"...\";");
  gv_conf_text(group, "name", out->name, sizeof out->name);
  if (!gv_conf_has(node))
    return;
  static const char allowed[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-.";
  if (!out->name[0] || out->name[strspn(out->name, allowed)])
    gv_conf_fail(node, "the name \"%s\" must be letters, digits, '_', '-' or '.'; rename it", out->name);
  for (int i = 0; i < l->objects; i++)
    if (strcmp(l->object[i].name, out->name) == 0)
      gv_conf_fail(node, "two objects are named \"%s\"; rename one", out->name);
}

static gv_quat read_rotation(gv_conf_group *group) {
  double q[4], deg[3];
  gv_conf_node orientation = gv_conf_find(group, "orientation");
  bool angles = gv_conf_numbers(group, "rotation", -360, 360, 3, "[about x, then y, then z] in degrees", deg);
  if (angles && gv_conf_has(orientation))
    gv_conf_fail(orientation, "'orientation' beside 'rotation'; give one of the two");
  if (angles) {
    double rad = GV_PI / 180;
    gv_quat x = gv_quat_axis_angle(gv_v3(1, 0, 0), deg[0] * rad);
    gv_quat y = gv_quat_axis_angle(gv_v3(0, 1, 0), deg[1] * rad);
    return gv_quat_mul(gv_quat_axis_angle(gv_v3(0, 0, 1), deg[2] * rad), gv_quat_mul(y, x));
  }
  if (!gv_conf_numbers(group, "orientation", -1.001, 1.001, 4, "the quaternion [w, x, y, z]", q))
    return gv_quat_identity();
  double length = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  if (fabs(length - 1) > 1e-3)
    gv_conf_fail(orientation, "the quaternion has length %.4g; scale it to 1, or give 'rotation' in degrees",
                 length);
  return gv_quat_normalize((gv_quat){q[0], q[1], q[2], q[3]});
}

static gv_pose read_pose(gv_conf_group *group) {
  double p[3] = {0, 0, 0};
  gv_conf_numbers(group, "position", -MAX_DISTANCE_M, MAX_DISTANCE_M, 3, "[x, y, z] in metres", p);
  return (gv_pose){read_rotation(group), gv_v3(p[0], p[1], p[2])};
}

// An inertia is that of some body when trace/2 - J (its second moments) is positive definite.
static bool is_inertia(const gv_mat3 *J) {
  double half = (J->m[0][0] + J->m[1][1] + J->m[2][2]) / 2;
  double a = half - J->m[0][0];
  double b = half - J->m[1][1];
  double c = half - J->m[2][2];
  double d = -J->m[0][1];
  double e = -J->m[0][2];
  double f = -J->m[1][2];
  return a > 0 && a * b - d * d > 0 && a * (b * c - f * f) - d * (d * c - f * e) + e * (d * f - b * e) > 0;
}

// 'center' and 'inertia' in place of uniform density. True where the file has them.
static bool read_inertia(gv_conf_group *group, gv_vec3 *out_center, gv_mat3 *out_inertia) {
  double c[3], j[6];
  gv_conf_node inertia = gv_conf_find(group, "inertia");
  bool center = gv_conf_numbers(group, "center", -MAX_COORDINATE_M, MAX_COORDINATE_M, 3,
                                "[x, y, z] in metres", c);
  bool both = gv_conf_numbers(group, "inertia", -1e3, 1e3, 6, "[xx, yy, zz, xy, xz, yz] in kg m2", j) &&
              center;
  if (center != gv_conf_has(inertia))
    gv_conf_fail(group->node, "'center' and 'inertia' go together; give both, or none for uniform density");
  if (!both)
    return false;
  *out_center = gv_v3(c[0], c[1], c[2]);
  *out_inertia = (gv_mat3){{{j[0], j[3], j[4]}, {j[3], j[1], j[5]}, {j[4], j[5], j[2]}}};
  if (!is_inertia(out_inertia))
    gv_conf_fail(inertia, "no body has this inertia; check the values, or leave it out");
  return !group->node.conf->failed;
}

// ---- one object's shape ---------------------------------------------------------------------------

static gv_vec3 read_point(gv_conf_node node) {
  double p[3] = {0, 0, 0};
  gv_conf_entry_numbers(node, -MAX_COORDINATE_M, MAX_COORDINATE_M, 3, "[x, y, z] in metres", p);
  return gv_v3(p[0], p[1], p[2]);
}

static void read_triangle(gv_conf_node node, int vertex_count, gv_triangle *out) {
  if (gv_conf_length(node) != 3)
    gv_conf_fail(node, "a triangle has three vertex numbers; write [0, 1, 2]");
  for (int k = 0; k < 3 && !node.conf->failed; k++) {
    int index = 0;
    gv_conf_entry_integer(gv_conf_entry(node, k), 0, vertex_count - 1, "a vertex number", &index);
    out->v[k] = (uint32_t)index;
  }
}

static void read_mesh(const source *src, gv_vec3 *vertex, gv_triangle *triangle) {
  for (int i = 0; i < src->vertex_count && !src->object.conf->failed; i++)
    vertex[i] = read_point(gv_conf_entry(src->vertices, i));
  for (int i = 0; i < src->triangle_count && !src->object.conf->failed; i++)
    read_triangle(gv_conf_entry(src->triangles, i), src->vertex_count, &triangle[i]);
}

// The points of piece i, each a vertex number or a point of its own. Returns their count.
static int read_piece(const source *src, int i, const gv_vec3 *vertex, gv_vec3 point[GV_MAX_HULL_VERTICES]) {
  gv_conf_node node = gv_conf_entry(src->pieces, i);
  int length = gv_conf_length(node);
  if (length > GV_MAX_HULL_VERTICES)
    gv_conf_fail(node, "piece %d has %d points; at most %d (GV_MAX_HULL_VERTICES): split it", i, length,
                 GV_MAX_HULL_VERTICES);
  for (int k = 0; k < length && !node.conf->failed; k++) {
    gv_conf_node entry = gv_conf_entry(node, k);
    int index = 0;
    if (gv_conf_length(entry) >= 0)
      point[k] = read_point(entry);
    else if (gv_conf_entry_integer(entry, 0, src->vertex_count - 1, "a vertex number", &index))
      point[k] = vertex[index];
  }
  return length;
}

static int hull_maximum(int error) {
  if (error == GV_HULL_VERTICES)
    return GV_MAX_HULL_VERTICES;
  if (error == GV_HULL_FACES)
    return GV_MAX_HULL_FACES;
  return error == GV_HULL_POLYGON ? GV_MAX_FACE_VERTICES : 0;
}

static void fail_piece(const loader *l, const source *src, int i, int error) {
  gv_conf_node at = src->primitive.kind ? src->primitive.node : gv_conf_entry(src->pieces, i);
  int most = hull_maximum(error);
  if (error == GV_HULL_MEMORY)
    fail_memory(l, at);
  else if (src->primitive.kind)
    gv_conf_fail(at, "a shape of these sizes has %s; make it less thin", gv_hull_error(error));
  else if (most)
    gv_conf_fail(at, "piece %d has %s; at most %d", i, gv_hull_error(error), most);
  else
    gv_conf_fail(at, "piece %d has %s; change its points", i, gv_hull_error(error));
}

// Convex hulls of all pieces, seen from `origin`.
static void build_pieces(loader *l, const source *src, const gv_vec3 *vertex, gv_vec3 origin, gv_hull *out) {
  gv_vec3 point[GV_MAX_HULL_VERTICES];
  if (src->primitive.kind) {
    int error = gv_primitive_hull(&src->primitive, origin, l->arena, out);
    if (error)
      fail_piece(l, src, 0, error);
    return;
  }
  for (int i = 0; i < src->piece_count && !src->object.conf->failed; i++) {
    int count = read_piece(src, i, vertex, point);
    if (src->object.conf->failed)
      return;
    for (int k = 0; k < count; k++)
      point[k] = gv_sub(point[k], origin);
    int error = gv_hull_build(l->arena, point, count, &out[i]);
    if (error)
      fail_piece(l, src, i, error);
  }
}

static gv_mass_properties sum_pieces(const source *src, const gv_hull *piece) {
  gv_mass_properties part[GV_MAX_PIECES];
  for (int i = 0; i < src->piece_count; i++)
    part[i] = gv_hull_mass_properties(&piece[i]);
  if (src->primitive.kind)
    part[0] = gv_primitive_mass(&src->primitive, piece);
  return gv_mass_properties_sum(part, src->piece_count);
}

static void fail_shape(const source *src, const gv_mesh_fault *fault) {
  gv_conf_node at = src->object;
  if (src->primitive.kind)
    at = src->primitive.node;
  else if (fault->triangle >= 0)
    at = gv_conf_entry(src->triangles, fault->triangle);
  else if (fault->piece >= 0)
    at = gv_conf_entry(src->pieces, fault->piece);
  gv_conf_fail(at, "%s", fault->text);
}

// Checks mesh and pieces in the file's object frame. What the pieces take from the arena is given back.
static gv_mass_properties check_shape(loader *l, const source *src, const gv_mesh *mesh, double fit_m,
                                      gv_hull *scratch) {
  gv_mass_properties whole = {0};
  gv_mesh_fault fault;
  if (!gv_mesh_check(mesh, &fault)) {
    fail_shape(src, &fault);
    return whole;
  }
  gv_arena before = *l->arena;
  build_pieces(l, src, mesh->vertex, gv_v3(0, 0, 0), scratch);
  if (!src->object.conf->failed) {
    const bool simple = src->primitive.kind != GV_PRIMITIVE_NONE;
    whole = sum_pieces(src, scratch);
    if (!simple && !gv_pieces_check(mesh, scratch, src->piece_count, whole.volume, fit_m, &l->work, &fault))
      fail_shape(src, &fault);
  }
  *l->arena = before;
  return whole;
}

// A centre and an inertia that are given belong to a body of this size: in other units they would not.
static void check_inertia(gv_conf_group *group, const gv_object *object, const gv_mesh *mesh) {
  gv_vec3 c = object->center_m;
  gv_vec3 low = mesh->vertex[0];
  gv_vec3 high = low;
  double farthest2 = 0;
  for (int i = 0; i < mesh->vertex_count; i++) {
    gv_vec3 p = mesh->vertex[i];
    low = gv_v3(fmin(low.x, p.x), fmin(low.y, p.y), fmin(low.z, p.z));
    high = gv_v3(fmax(high.x, p.x), fmax(high.y, p.y), fmax(high.z, p.z));
    farthest2 = fmax(farthest2, gv_norm2(gv_sub(p, c)));
  }
  if (c.x < low.x || c.y < low.y || c.z < low.z || c.x > high.x || c.y > high.y || c.z > high.z)
    gv_conf_fail(gv_conf_find(group, "center"),
                 "'center' lies outside of the object (%g..%g, %g..%g, %g..%g m); correct it", low.x, high.x,
                 low.y, high.y, low.z, high.z);
  const gv_mat3 *J = &object->inertia_kg_m2;
  // all mass at the farthest corner
  double trace = J->m[0][0] + J->m[1][1] + J->m[2][2];
  double most = 2 * object->mass_kg * farthest2;
  if (!object->is_static && trace > most)
    gv_conf_fail(gv_conf_find(group, "inertia"),
                 "'inertia' has the trace %.3g; %g kg within this object reach %.3g kg m2 at "
                 "most: correct it",
                 trace, object->mass_kg, most);
}

// ---- objects and scene ----------------------------------------------------------------------------

static void take_range(loader *l, const source *src, gv_object *out) {
  out->piece_first = l->pieces;
  out->vertex_first = l->vertices;
  out->triangle_first = l->triangles;
  l->pieces += out->piece_count = src->piece_count;
  l->vertices += out->vertex_count = src->vertex_count;
  l->triangles += out->triangle_count = src->triangle_count;
}

// What the file says about one object besides its shape.
typedef struct settings {
  gv_pose T_world_object;
  double fit_m;
  bool has_inertia;  // center_m and inertia of the object are given
} settings;

static settings read_settings(loader *l, gv_conf_group *group, gv_object *out) {
  settings set = {.fit_m = DEFAULT_FIT_M};
  read_name(l, group, out);
  gv_conf_bool(group, "static", &out->is_static);
  if (!out->is_static)
    gv_conf_need(group, "mass", "mass = <kilograms>; or static = true;");
  gv_conf_number(group, "mass", 1e-4, 1e3, &out->mass_kg);
  gv_friction_read(&l->materials, group, out);
  gv_conf_number(group, "fit", DEFAULT_FIT_M, 0.01, &set.fit_m);
  set.T_world_object = read_pose(group);
  set.has_inertia = read_inertia(group, &out->center_m, &out->inertia_kg_m2);
  return set;
}

static void take_density(gv_object *object, const gv_mass_properties *whole) {
  object->center_m = whole->center;
  for (int i = 0; i < 9; i++)
    object->inertia_kg_m2.m[i / 3][i % 3] = object->mass_kg * whole->inertia.m[i / 3][i % 3];
}

static void place_body(gv_object *object, gv_pose T_world_object, gv_vec3 *vertex) {
  object->T_world_body = (gv_pose){T_world_object.q, gv_transform(T_world_object, object->center_m)};
  for (int i = 0; i < object->vertex_count; i++)
    vertex[i] = gv_sub(vertex[i], object->center_m);
}

static void read_object(loader *l, gv_conf_node node) {
  gv_object *object = &l->object[l->objects];
  gv_conf_group group = gv_conf_as_group(node, "an object");
  source src = find_source(&group);
  take_range(l, &src, object);
  settings set = read_settings(l, &group, object);
  gv_conf_leave(&group);

  gv_vec3 *vertex = l->vertex + object->vertex_first;
  gv_triangle *triangle = l->triangle + object->triangle_first;
  gv_hull *piece = l->piece + object->piece_first;
  if (src.primitive.kind)
    gv_primitive_mesh(&src.primitive, vertex, triangle);
  else
    read_mesh(&src, vertex, triangle);
  if (node.conf->failed)
    return;

  gv_mesh mesh = {vertex, triangle, object->vertex_count, object->triangle_count};
  gv_mass_properties whole = check_shape(l, &src, &mesh, set.fit_m, piece);
  if (set.has_inertia)
    check_inertia(&group, object, &mesh);
  else
    take_density(object, &whole);
  build_pieces(l, &src, vertex, object->center_m, piece);
  place_body(object, set.T_world_object, vertex);
  l->objects++;
}

static void read_scene(loader *l, gv_conf *conf) {
  gv_conf_group root = gv_conf_root(conf);
  double g[3] = {0, 0, -9.81};
  gv_conf_numbers(&root, "gravity", -100, 100, 3, "[x, y, z] in m/s2", g);
  l->scene.gravity_m_s2 = gv_v3(g[0], g[1], g[2]);
  gv_conf_node objects;
  need_list(&root, "objects", "objects = ( { name = ...; }, ... );", &objects);
  gv_materials_read(&l->materials, &root, l->arena, &l->scene);
  gv_conf_node joints = gv_joints_find(&root);
  gv_conf_leave(&root);
  if (conf->failed)
    return;
  count_scene(&l->scene, objects);
  if (conf->failed || !allocate(l, objects))
    return;
  for (int i = 0; i < l->scene.object_count && !conf->failed; i++)
    read_object(l, gv_conf_entry(objects, i));
  if (!conf->failed)
    gv_joints_read(joints, l->arena, &l->scene);
}

static int load(gv_conf *conf, gv_arena *arena, gv_scene *out) {
  loader l = {.arena = arena, .work = GV_CHECK_WORK};
  read_scene(&l, conf);
  gv_conf_close(conf);
  if (conf->failed)
    return -1;
  *out = l.scene;
  return 0;
}

int gv_scene_load(const char *path, gv_arena *arena, gv_scene *out, char *err, size_t err_size) {
  gv_conf conf;
  return gv_conf_open(&conf, path, err, err_size) ? load(&conf, arena, out) : -1;
}

int gv_scene_load_text(const char *name, const char *text, gv_arena *arena, gv_scene *out, char *err,
                       size_t err_size) {
  gv_conf conf;
  return gv_conf_open_text(&conf, name, text, err, err_size) ? load(&conf, arena, out) : -1;
}
