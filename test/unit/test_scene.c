// SPDX-License-Identifier: BSD-3-Clause
// Scenes from text: the two that come with the project against their geometry worked out by hand, poses and
// mass properties against closed forms, and one line with file, line, what and what to do for every mistake.
// Runs in the project's top folder.
#include <string.h>
#include <unistd.h>

#include "daemon/load/scene_load.h"
#include "support/check.h"

enum { MEMORY = 1 << 26 };
static char memory[MEMORY], err[1024];
static gv_arena arena;

static int load_file(const char *path, gv_scene *out) {
  gv_arena_init(&arena, memory, sizeof memory);
  err[0] = 0;
  return gv_scene_load(path, &arena, out, err, sizeof err);
}

static int load_text(const char *text, gv_scene *out) {
  char path[] = "/tmp/gloved-test-XXXXXX";
  int fd = mkstemp(path);
  CHECK(fd >= 0 && write(fd, text, strlen(text)) == (ssize_t)strlen(text), "cannot write %s", path);
  close(fd);
  int result = load_file(path, out);
  unlink(path);
  return result;
}

static gv_vec3 mesh_corner(const gv_scene *s, const gv_object *o, int triangle, int k) {
  return s->mesh_vertex[o->vertex_first + (int)s->mesh_triangle[o->triangle_first + triangle].v[k]];
}

// ---- the scenes of the project --------------------------------------------------------------------

// V - E + F, the edges counted by brute force; -99 where an edge has not exactly one twin.
static int euler_characteristic(const gv_scene *s, const gv_object *o) {
  int twins = 0;
  int n = o->triangle_count;
  const gv_triangle *t = s->mesh_triangle + o->triangle_first;
  for (int i = 0; i < 3 * n; i++) {
    int found = 0;
    for (int j = 0; j < 3 * n; j++)
      found += t[i / 3].v[i % 3] == t[j / 3].v[(j + 1) % 3] && t[i / 3].v[(i + 1) % 3] == t[j / 3].v[j % 3];
    if (found != 1)
      return -99;
    twins++;
  }
  return o->vertex_count - twins / 2 + n;
}

static double pieces_volume(const gv_scene *s, const gv_object *o) {
  double volume = 0;
  for (int i = 0; i < o->piece_count; i++)
    volume += gv_hull_mass_properties(&s->piece[o->piece_first + i]).volume;
  return volume;
}

static double lowest_z(const gv_scene *s, const gv_object *o) {
  double z = HUGE_VAL;
  for (int i = 0; i < o->vertex_count; i++)
    z = fmin(z, gv_transform(o->T_world_body, s->mesh_vertex[o->vertex_first + i]).z);
  return z;
}

static void check_table(const gv_scene *s) {
  const gv_object *table = &s->object[0];
  CHECK(table->is_static && strcmp(table->name, "table") == 0 && table->triangle_count == 12, "no table");
  const gv_hull *hull = &s->piece[table->piece_first];
  // not turned
  gv_vec3 min = gv_transform(table->T_world_body, hull->aabb_min);
  gv_vec3 max = gv_transform(table->T_world_body, hull->aabb_max);
  CHECK_NEAR(max.z, 0, 1e-12);
  CHECK_NEAR(max.x - min.x, 1.2, 1e-12);
  CHECK_NEAR(max.y - min.y, 0.8, 1e-12);
}

static void check_inertia(const gv_object *o, double xx, double yy, double zz, double xy, double xz,
                          double yz) {
  const double want[3][3] = {{xx, xy, xz}, {xy, yy, yz}, {xz, yz, zz}};
  for (int i = 0; i < 9; i++)
    CHECK_NEAR(o->inertia_kg_m2.m[i / 3][i % 3], want[i / 3][i % 3], 1e-9 * (xx + yy + zz));
}

static void test_box_scene(void) {
  gv_scene s;
  CHECK(load_file("data/scenes/box.scene", &s) == 0, "%s", err);
  if (err[0])
    return;
  check_table(&s);
  const gv_object *box = &s.object[1];
  CHECK(s.object_count == 2 && box->triangle_count == 12 && box->piece_count == 1 && box->vertex_count == 8,
        "sizes");
  CHECK(!box->is_static && box->mass_kg == 0.2 && box->mu == 0.8 && s.gravity_m_s2.z == -9.81, "values");
  CHECK_NEAR(pieces_volume(&s, box), 0.06 * 0.06 * 0.08, 1e-15);
  check_inertia(box, 0.2 / 12 * (0.0036 + 0.0064), 0.2 / 12 * (0.0036 + 0.0064), 0.2 / 12 * 0.0072, 0, 0, 0);
  CHECK_NEAR(lowest_z(&s, box), 0, 1e-12);
  CHECK(euler_characteristic(&s, box) == 2, "%d", euler_characteristic(&s, box));
  CHECK(arena.used < 16384, "%zu bytes", arena.used);
}

// Moments at density 1 about the object's origin: volume, first, second (int r r^T).
typedef struct moments {
  double volume, first[3], second[3][3];
} moments;

static void add_block(moments *m, double sign, double a, double b, double c) {
  double v = sign * a * b * c;
  double square[3] = {a * a, b * b, c * c};
  m->volume += v;
  for (int i = 0; i < 3; i++)
    m->second[i][i] += v * square[i] / 12;
}

// A tetrahedron: volume / 20 (sum of r r^T + sum r sum r^T).
static void add_tetrahedron(moments *m, double sign, double r[4][3]) {
  double u[3][3], sum[3] = {0};
  for (int k = 0; k < 4; k++)
    for (int i = 0; i < 3; i++) {
      sum[i] += r[k][i];
      if (k)
        u[k - 1][i] = r[k][i] - r[0][i];
    }
  double det = u[0][0] * (u[1][1] * u[2][2] - u[1][2] * u[2][1]) -
               u[0][1] * (u[1][0] * u[2][2] - u[1][2] * u[2][0]) +
               u[0][2] * (u[1][0] * u[2][1] - u[1][1] * u[2][0]);
  double v = sign * fabs(det) / 6;
  m->volume += v;
  for (int i = 0; i < 3; i++) {
    m->first[i] += v * sum[i] / 4;
    for (int j = 0; j < 3; j++) {
      double squares = sum[i] * sum[j];
      for (int k = 0; k < 4; k++)
        squares += r[k][i] * r[k][j];
      m->second[i][j] += v * squares / 20;
    }
  }
}

static const double cut_corner[3][2] = {
  {-0.07, 0.06}, {0.07, 0.06}, {0.07, -0.06}};  // y, z of the frame's cut corners

// A block less its window less three corners: nothing of this comes from polygons or pieces.
static moments frame_moments(void) {
  moments m = {0};
  add_block(&m, 1, 0.02, 0.14, 0.12);
  add_block(&m, -1, 0.02, 0.096, 0.076);
  for (int i = 0; i < 3; i++) {
    double y = cut_corner[i][0];
    double z = cut_corner[i][1];
    double r[4][3] = {
      {-0.01, y, z}, {-0.01, y - copysign(0.012, y), z}, {-0.01, y, z - copysign(0.012, z)}, {0.01, y, z}};
    add_tetrahedron(&m, -1, r);
  }
  return m;
}

static void test_frame_scene(void) {
  gv_scene s;
  CHECK(load_file("data/scenes/frame.scene", &s) == 0, "%s", err);
  if (err[0])
    return;
  check_table(&s);
  const gv_object *frame = &s.object[1];
  CHECK(s.object_count == 2 && frame->triangle_count == 38 && frame->vertex_count == 19 &&
            frame->piece_count == 4,
        "sizes");
  CHECK(euler_characteristic(&s, frame) == 0, "%d: not a ring", euler_characteristic(&s, frame));
  moments m = frame_moments();
  CHECK_NEAR(pieces_volume(&s, frame), m.volume, 1e-12 * m.volume);
  double c[3], J[3][3];
  for (int i = 0; i < 3; i++)
    c[i] = m.first[i] / m.volume;
  CHECK_NEAR(frame->center_m.x, c[0], 1e-12);
  CHECK_NEAR(frame->center_m.y, c[1], 1e-12);
  CHECK_NEAR(frame->center_m.z, c[2], 1e-12);
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++)
      J[i][j] = 0.2 * (m.second[i][j] / m.volume - c[i] * c[j]);
  check_inertia(frame, J[1][1] + J[2][2], J[0][0] + J[2][2], J[0][0] + J[1][1], -J[0][1], -J[0][2], -J[1][2]);
  CHECK_NEAR(lowest_z(&s, frame), 0, 1e-12);
  CHECK(arena.used < 16384, "%zu bytes", arena.used);
}

// In the frame as its description has it; p in the object's frame.
static bool in_frame(gv_vec3 p) {
  if (fabs(p.x) > 0.01 || fabs(p.y) > 0.07 || fabs(p.z) > 0.06)
    return false;
  if (fabs(p.y) < 0.048 && fabs(p.z) < 0.038)
    return false;
  for (int i = 0; i < 3; i++) {
    double y = cut_corner[i][0];
    double z = cut_corner[i][1];
    if (fabs(p.y - y) / 0.012 + fabs(p.z - z) / 0.012 + (p.x + 0.01) / 0.02 < 1)
      return false;
  }
  return true;
}

static int count_pieces_around(const gv_scene *s, const gv_object *o, gv_vec3 p) {
  int around = 0;
  for (int i = 0; i < o->piece_count; i++) {
    const gv_hull *h = &s->piece[o->piece_first + i];
    bool inside = true;
    for (int f = 0; f < h->face_count; f++)
      inside = inside && gv_dot(h->face_normal[f], p) < h->face_offset[f];
    around += inside;
  }
  return around;
}

// Every point of the ring is in exactly one piece, every other point in none.
static void test_frame_pieces_fill_it_once(void) {
  gv_scene s;
  unsigned long long seed = 7;
  if (load_file("data/scenes/frame.scene", &s)) {
    CHECK(0, "%s", err);
    return;
  }
  const gv_object *frame = &s.object[1];
  int wrong = 0;
  int inside = 0;
  for (int i = 0; i < 200000; i++) {
    gv_vec3 p = gv_v3(check_uniform(&seed, -0.012, 0.012), check_uniform(&seed, -0.075, 0.075),
                      check_uniform(&seed, -0.065, 0.065));
    wrong += count_pieces_around(&s, frame, gv_sub(p, frame->center_m)) != (in_frame(p) ? 1 : 0);
    inside += in_frame(p);
  }
  CHECK(wrong == 0, "%d of 200000 points", wrong);
  CHECK(inside > 50000 && inside < 150000, "the sample does not cover the frame: %d", inside);
}

// Just inside every polygon is a piece, just outside is none: what is seen is what is touched.
static void test_frame_polygons_are_the_pieces_surface(void) {
  gv_scene s;
  unsigned long long seed = 9;
  if (load_file("data/scenes/frame.scene", &s)) {
    CHECK(0, "%s", err);
    return;
  }
  const gv_object *frame = &s.object[1];
  for (int t = 0; t < frame->triangle_count; t++)
    for (int i = 0; i < 500; i++) {
      gv_vec3 a = mesh_corner(&s, frame, t, 0);
      gv_vec3 u = gv_sub(mesh_corner(&s, frame, t, 1), a);
      gv_vec3 v = gv_sub(mesh_corner(&s, frame, t, 2), a);
      double x = check_uniform(&seed, 0.001, 0.998);
      double y = check_uniform(&seed, 0.0005, 0.999 - x);
      gv_vec3 p = gv_mad(gv_mad(a, x, u), y, v);
      gv_vec3 n = gv_normalize_or(gv_cross(u, v), gv_v3(0, 0, 0));
      int in = count_pieces_around(&s, frame, gv_mad(p, -1e-6, n));
      int out = count_pieces_around(&s, frame, gv_mad(p, 1e-6, n));
      // On a seam of two pieces the point may be in neither by rounding; a random point never is.
      CHECK(in == 1 && out == 0, "triangle %d: %d pieces below, %d above", t, in, out);
    }
}

// ---- poses and mass -------------------------------------------------------------------------------

#define V "version = 1;\n"
#define TETRA_V "vertices = ([0,0,0], [0.1,0.0,0.0], [0.0,0.1,0.0], [0.0,0.0,0.1]);\n"
#define TETRA_T "triangles = ([0,2,1], [0,1,3], [0,3,2], [1,2,3]);\n"
#define TETRA_P "pieces = ([0,1,2,3]);\n"
#define TETRA TETRA_V TETRA_T TETRA_P

// A tetrahedron with three right angles: the centre is at a / 4, inertia per mass .075 a^2 and a^2 / 80 off
// the diagonal. The file's pose is that of the corner, the body's that of the centre of mass.
static void test_corner_tetrahedron(void) {
  gv_scene s;
  CHECK(load_text(
            V
            "gravity = (0, 0, -1.5);\nobjects = ({ name = \"t\"; mass = 3; mu = 0.25; position = (1, 2, 3);\n"
            "rotation = (0, 0, 90);\n" TETRA "});\n",
            &s) == 0,
        "%s", err);
  if (err[0])
    return;
  const gv_object *o = &s.object[0];
  CHECK(s.gravity_m_s2.z == -1.5 && o->mass_kg == 3 && o->mu == 0.25, "values");
  CHECK_NEAR(o->center_m.x, 0.025, 1e-15);
  CHECK_NEAR(o->center_m.z, 0.025, 1e-15);
  double d = 3 * 0.075 * 0.01;
  double e = 3 * 0.01 / 80;
  check_inertia(o, d, d, d, e, e, e);
  gv_vec3 corner = gv_transform(o->T_world_body, s.mesh_vertex[0]);
  gv_vec3 x = gv_transform(o->T_world_body, s.mesh_vertex[1]);
  CHECK_NEAR(gv_norm(gv_sub(corner, gv_v3(1, 2, 3))), 0, 1e-14);
  CHECK_NEAR(gv_norm(gv_sub(x, gv_v3(1, 2.1, 3))), 0, 1e-14);
}

static void test_rotation_is_about_fixed_axes(void) {
  gv_scene a, b;
  gv_pose angles, quaternion;
  CHECK(load_text(V
                  "objects = ({ name = \"t\"; mass = 1; rotation = (90, 90, 0); box = [0.1, 0.2, 0.3]; });\n",
                  &a) == 0,
        "%s", err);
  if (err[0])
    return;
  angles = a.object[0].T_world_body;
  CHECK_NEAR(gv_norm(gv_sub(gv_rotate(angles.q, gv_v3(0, 1, 0)), gv_v3(1, 0, 0))), 0, 1e-14);  // y -> z -> x
  CHECK(load_text(V "objects = ({ name = \"t\"; mass = 1; orientation = (0.5, 0.5, 0.5, -0.5); box = [0.1, "
                    "0.2, 0.3]; });\n",
                  &b) == 0,
        "%s", err);
  if (err[0])
    return;
  quaternion = b.object[0].T_world_body;
  CHECK_NEAR(gv_norm(gv_quat_log(gv_quat_mul(gv_quat_conj(angles.q), quaternion.q))), 0, 1e-12);
}

static void test_given_inertia_replaces_uniform_density(void) {
  gv_scene s;
  CHECK(load_text(V "objects = ({ name = \"t\"; mass = 1; center = [0.0, 0.0, 0.01]; inertia = [3e-3, 4e-3, "
                    "5e-3, 1e-4, 2e-4, 3e-4];\n"
                    "box = [0.1, 0.2, 0.3]; position = (0, 0, 1); });\n",
                  &s) == 0,
        "%s", err);
  if (err[0])
    return;
  check_inertia(&s.object[0], 3e-3, 4e-3, 5e-3, 1e-4, 2e-4, 3e-4);
  CHECK_NEAR(s.object[0].T_world_body.p.z, 1.01, 1e-15);
  CHECK_NEAR(s.mesh_vertex[0].z, -0.16, 1e-15);
  CHECK_NEAR(s.piece[0].aabb_min.z, -0.16, 1e-15);
}

// ---- mistakes -------------------------------------------------------------------------------------

typedef struct mistake {
  const char *text, *line, *what;
} mistake;

static void check_message(const char *line, const char *what, int result) {
  CHECK(result < 0, "accepted; wanted: %s", what);
  CHECK(strncmp(err, "/tmp/gloved-test-", 17) == 0, "no file in: %s", err);
  CHECK(strstr(err, line), "no '%s' in: %s", line, err);
  CHECK(strstr(err, what), "no '%s' in: %s", what, err);
  CHECK(strstr(err, ";") || strstr(err, "did you mean") || strstr(err, "known here"), "no remedy in: %s",
        err);
  CHECK(!strchr(err, '\n') && strlen(err) < 500, "not one line: %s", err);
}

#define O V "objects = (\n{ "  // line 3
#define BOX "box = [0.1, 0.1, 0.1]; "
#define E " }\n);\n"
#define NM "name = \"a\"; mass = 1; "
static const mistake mistakes[] = {
  {"", ": ", "'version' is missing"},
  {V, ": ", "'objects' is missing"},
  {V "objects = ();\n", ":2: ", "'objects' is empty"},
  {V "objects = { };\n", ":2: ", "'objects' is no list"},
  {V "objects = ( 3 );\n", ":2: ", "an object must be a group"},
  {V "gravity = [0.0, -9.81];\n"
     "objects = ({" NM BOX "});\n",
   ":2: ", "'gravity' has 2 numbers; write 3"},
  {V "gravity = [0, 0, -9.81];\n", ":2: ", "mixed inside [ ]"},
  {V "gravity = [0.0, 0.0, 1e999];\nobjects = ({" NM BOX "});\n", ":2: ", "not finite"},
  {V "gravty = [0.0, 0.0, 1.0];\nobjects = ({" NM BOX "});\n", ":2: ", "did you mean 'gravity'"},
  // settings of an object
  {O "mass = 1; " BOX E, ":3: ", "'name' is missing"},
  {O "name = \"\"; mass = 1; " BOX E, ":3: ", "the name \"\""},
  {O "name = \"a b\"; mass = 1; " BOX E, ":3: ", "the name \"a b\""},
  {O "name = 7; mass = 1; " BOX E, ":3: ", "'name' is no text"},
  {O "name = \"abcdefghijklmnopqrstuvwxyzabcdef\"; mass = 1; " BOX E,
   ":3: ", "'name' has 32 bytes; use at most 31"},
  {O NM BOX "},\n{ " NM BOX E, ":4: ", "two objects are named \"a\""},
  {O "name = \"a\"; mas = 1; " BOX E, ":3: ", "unknown setting 'mas'; did you mean 'mass'?"},
  {O "name = \"a\";\n" BOX E, ":3: ", "'mass' is missing; add mass = <kilograms>"},
  {O "name = \"a\";\nmass = 0; " BOX E, ":4: ", "'mass' is 0"},
  {O "name = \"a\";\nmass = -0.2; " BOX E, ":4: ", "'mass' is -0.2"},
  {O "name = \"a\";\nmass = \"heavy\"; " BOX E, ":4: ", "'mass' is no number"},
  {O "name = \"a\";\nmass = 1e999; " BOX E, ":4: ", "'mass' is not finite"},
  {O "name = \"a\";\nmass = 4294967297; " BOX E, ":4: ", "too large"},
  {O NM "mu = -0.1; " BOX E, ":3: ", "'mu' is -0.1"},
  {O NM "static = 1; " BOX E, ":3: ", "'static' is neither true nor false"},
  {O NM "colour = 3; " BOX E, ":3: ", "unknown setting 'colour'; known here: box"},
  {O NM "position = [0.0, 0.0]; " BOX E, ":3: ", "'position' has 2 numbers; write 3, [x, y, z] in metres"},
  {O NM "position = [0.0, 0.0, 400.0]; " BOX E, ":3: ", "entry 3 of 'position' is 400"},
  {O NM "orientation = [0.7, 0.0, 0.0, 0.0]; " BOX E, ":3: ", "the quaternion has length 0.7"},
  {O NM "orientation = [0.0, 0.0, 0.0, 0.0]; " BOX E, ":3: ", "the quaternion has length 0"},
  {O NM "rotation = [0, 0, 9]; orientation = [1, 0, 0, 0]; " BOX E,
   ":3: ", "'orientation' beside 'rotation'"},
  {O NM "center = [0, 0, 0]; " BOX E, ":3: ", "'center' and 'inertia' go together"},
  {O NM "center = [0, 0, 0]; inertia = [1, 1, 3, 0, 0, 0]; " BOX E, ":3: ", "no body has this inertia"},
  {O NM "center = [0, 0, 0]; inertia = [1, 1, 1, 2, 0, 0]; " BOX E, ":3: ", "no body has this inertia"},
  {O NM "center = [0.0, 0.0, 60.0]; inertia = [1, 1, 1, 0, 0, 0]; " BOX E, ":3: ", "'center' is"},
  {O NM "center = [0.0, 0.0, 6.0]; inertia = [1, 1, 1, 0, 0, 0]; " BOX E,
   ":3: ", "'center' lies outside of the object"},
  {O NM "center = [0, 0, 0]; inertia = [40, 40, 40, 0, 0, 0]; " BOX E, ":3: ", "'inertia' has the trace 120"},
  {O NM "friction = \"sticky\"; " BOX E, ":3: ", "'friction' is none of its choices"},
  {O NM "friction = \"fixed_limit\"; " BOX E, ":3: ", "'mu' is missing; add mu = <newtons>"},
  {O NM "material = \"felt\"; " BOX E, ":3: ", "no material is named \"felt\"; list it in 'materials'"},
  {V "materials = ({ name = \"felt\"; });\n"
     "objects = ({" NM "mu = 1;\nmaterial = \"felt\"; " BOX "});\n",
   ":3: ", "'mu' beside 'material'"},
  {V "materials = (\n{ name = \"felt\"; }, { name = \"felt\"; });\nobjects = ({" NM BOX "});\n",
   ":3: ", "two materials are named \"felt\""},
  {V "materials = ({ name = \"hand\"; });\nobjects = ({" NM BOX "});\n",
   ":2: ", "two materials are named \"hand\""},
  {V "pairs = ({ a = \"hand\"; b = \"felt\"; mu = 1; });\nobjects = ({" NM BOX "});\n",
   ":2: ", "no material is named \"felt\""},
  {V "pairs = ({ a = \"hand\"; b = \"hand\"; });\nobjects = ({" NM BOX "});\n", ":2: ", "'mu' is missing"},
  {V "pairs = 3;\nobjects = ({" NM BOX "});\n", ":2: ", "'pairs' is no list"},
  // shapes
  {O NM "ball = 0; " E, ":3: ", "'ball' is 0"},
  {O NM "ball = \"big\"; " E, ":3: ", "'ball' is no number"},
  {O NM "ball = 0.1;\n" BOX E, ":3: ", "'ball' beside 'box'"},
  {O NM "ball = 0.1;\n" TETRA E, ":4: ", "'vertices' beside 'ball'"},
  {O NM E, ":3: ", "the object has no shape; add one of box = [x, y, z]; ball = radius; capsule = "},
  {O NM "sphere = 0.04;\n" E,
   ":3: ", "unknown setting 'sphere'; known here: box, ball, capsule, cylinder, cone, ellipsoid, vertices"},
  {O NM "\nradius = 0.04; " E, ":4: ", "unknown setting 'radius'; known here: box, ball"},
  {O NM "capsul = [0.02, 0.1]; " E, ":3: ", "unknown setting 'capsul'; did you mean 'capsule'?"},
  {O NM "ball = 0.04; radius = 0.04; " E, ":3: ", "unknown setting 'radius'; known here: box, ball"},
  {O NM "vertice = ( [0,0,0] ); " E, ":3: ", "unknown setting 'vertice'; did you mean 'vertices'?"},
  {O NM "capsule = 0.1; " E,
   ":3: ", "'capsule' is no list of numbers; write [radius, length from tip to tip] in metres"},
  {O NM "capsule = [0.02, 0.03]; " E, ":3: ", "a capsule of radius 0.02 is longer than 0.04"},
  {O NM "cylinder = [0.02]; " E, ":3: ", "'cylinder' has 1 number; write 2, [radius, height] in metres"},
  {O NM "cylinder = [0.02, 0.0]; " E, ":3: ", "entry 2 of 'cylinder' is 0"},
  {O NM "cone = [-0.02, 0.1]; " E, ":3: ", "entry 1 of 'cone' is -0.02"},
  {O NM "cone = [0.02, 0.1];\n" TETRA E, ":4: ", "'vertices' beside 'cone'"},
  {O NM "ellipsoid = [0.02, 0.1, 70.0]; " E, ":3: ", "entry 3 of 'ellipsoid' is 70"},
  {O NM "ellipsoid = [0.02, 0.1, 0.1];\ncone = [0.02, 0.1]; " E, ":3: ", "'ellipsoid' beside 'cone'"},
  {O NM "box = [0.1, 0.0, 0.1]; " E, ":3: ", "entry 2 of 'box' is 0"},
  {O NM "box = [60, 60, 80]; " E, ":3: ", "entry 1 of 'box' is 60"},
  {O NM BOX "\n" TETRA E, ":4: ", "'vertices' beside 'box'"},
  {O NM TETRA_V TETRA_P E, ":3: ", "'triangles' is missing"},
  {O NM TETRA_V TETRA_T E, ":3: ", "'pieces' is missing"},
  {O NM "vertices = 3;\n" TETRA_T TETRA_P E, ":3: ", "'vertices' is no list"},
  {O NM "vertices = ([0,0,0],\n[1,0],[0,1,0],[0,0,1]);\n" TETRA_T TETRA_P E,
   ":4: ", "has 2 numbers; write 3"},
  {O NM "vertices = ([0,0,0],\n[100,0,0],[0,1,0],[0,0,1]);\n" TETRA_T TETRA_P E,
   ":4: ", "is 100; give a number from -10 to 10"},
  {O NM TETRA_V "triangles = ([0,2,1],\n[0,1,4],[0,3,2],[1,2,3]);\n" TETRA_P E,
   ":5: ", "a vertex number is 4; give a number from 0 to 3"},
  {O NM TETRA_V "triangles = ([0,2,1],\n[0,1,-3],[0,3,2],[1,2,3]);\n" TETRA_P E,
   ":5: ", "a vertex number is -3"},
  {O NM TETRA_V "triangles = ([0,2,1],\n[0.0,1.5,3.0],[0,3,2],[1,2,3]);\n" TETRA_P E,
   ":5: ", "a vertex number is 1.5; give a whole number"},
  {O NM TETRA_V "triangles = ([0,2,1],\n[0,1,3,2],[0,3,2],[1,2,3]);\n" TETRA_P E,
   ":5: ", "a triangle has three vertex numbers"},
  {O NM TETRA_V "triangles = ([0,2,1],\n[0,1,1],[0,3,2],[1,2,3]);\n" TETRA_P E,
   ":5: ", "triangle 1 has no area"},
  {O NM TETRA_V "triangles = ([0,2,1],\n[0,1,3],[0,3,2]);\n" TETRA_P E, ":", "the mesh is open: the edge "},
  {O NM TETRA_V "triangles = ([0,2,1],\n[0,1,3],\n[0,2,3],[1,2,3]);\n" TETRA_P E,
   ":6: ", "triangle 2 is flipped against its neighbours; write [0, 3, 2]"},
  {O NM TETRA_V "triangles = ([0,1,2], [0,3,1], [0,2,3], [1,3,2]);\n" TETRA_P E, ":4: ", "inside out"},
  {O NM TETRA_V "triangles = ([0,2,1], [0,1,3], [0,3,2], [1,2,3],\n [1,2,3]);\n" TETRA_P E, ":",
   "the edge 1-2 belongs to 3 triangles"},
  {O NM "vertices = ([0,0,0],[0.1,0.0,0.0],[0.0,0.1,0.0],[0.0,0.0,0.1],[1,1,1]);\n" TETRA_T TETRA_P E,
   ":3: ", "vertex 4 belongs to no triangle"},
  {O NM TETRA_V TETRA_T "pieces = (3);\n" E, ":5: ", "a piece is a list"},
  {O NM TETRA_V TETRA_T "pieces = ([0,1,2]);\n" E, ":5: ", "piece 0 has fewer than 4 points"},
  {O NM TETRA_V TETRA_T "pieces = ([0,1,2,9]);\n" E, ":5: ", "a vertex number is 9"},
  {O NM TETRA_V TETRA_T "pieces = ([0,1,2,3],\n(0,1,2,[0.05,0.05,0.0]));\n" E,
   ":6: ", "piece 1 has no volume"},
  {O NM TETRA_V TETRA_T "pieces = ((0,1,2,[0.0,0.0,0.05]));\n" E, ":4: ", "outside of every piece"},
  {O NM TETRA_V TETRA_T "pieces = (\n(0,1,2,3,[-0.01,0.0,0.0]));\n" E,
   ":6: ", "sticks out of the mesh by 10 mm"},
  {O NM TETRA_V TETRA_T "pieces = ([0,1,2,3],\n[0,1,2,3]);\n" E,
   ":3: ", "the pieces add up to 333.3 cm3, the mesh encloses 166.7 cm3: they overlap"},
  {V "objects = ( { " NM BOX "}\n", ":", "syntax error"},
};

static void test_ball(void) {
  gv_scene s;
  if (load_text(O "name = \"b\"; mass = 0.5; ball = 0.04; position = [0.0, 0.0, 1.0];" E, &s)) {
    CHECK(0, "%s", err);
    return;
  }
  const gv_object *o = &s.object[0];
  check_inertia(o, 0.5 * 0.4 * 0.0016, 0.5 * 0.4 * 0.0016, 0.5 * 0.4 * 0.0016, 0, 0, 0);
  CHECK(s.piece_count == 1 && s.piece[0].vertex_count == 1 && s.piece[0].radius == 0.04, "no ball");
  CHECK_NEAR(lowest_z(&s, o), 0.96, 1e-12);
  CHECK(euler_characteristic(&s, o) == 2, "the ball's polygons leave holes");
  for (int i = 0; i < s.vertex_count; i++)
    CHECK_NEAR(gv_norm(s.mesh_vertex[i]), 0.04, 1e-12);
}

// ---- shapes by name --------------------------------------------------------------------------------

static const gv_object *load_shape(const char *shape, gv_scene *s) {
  char text[300];
  snprintf(text, sizeof text, "%sname = \"b\"; mass = 0.5; %s; position = [0.0, 0.0, 1.0];%s", O, shape, E);
  int error = load_text(text, s);
  CHECK(error == 0, "%s: %s", shape, err);
  if (error)
    return NULL;
  CHECK(s->piece_count == 1 && euler_characteristic(s, s->object) == 2, "%s leaves holes", shape);
  return s->object;
}

static void test_capsule_by_name(void) {
  gv_scene s;
  // volumes over pi r^2 / 3
  const double r = 0.02;
  const double l = 0.06;
  const double body = 3 * l;
  const double ends = 4 * r;
  const gv_object *o = load_shape("capsule = [0.02, 0.10]", &s);
  if (!o)
    return;
  double along = 0.5 * (body / 2 * r * r + ends * 0.4 * r * r) / (body + ends);
  double of_ends = 0.4 * r * r + l * l / 4 + 3 * l * r / 8;
  double across = 0.5 * (body * (l * l / 12 + r * r / 4) + ends * of_ends) / (body + ends);
  check_inertia(o, across, across, along, 0, 0, 0);
  CHECK(s.piece[0].vertex_count == 2 && s.piece[0].radius == r, "no capsule");
  CHECK_NEAR(gv_hull_mass_properties(s.piece).volume, GV_PI * r * r * l + 4.0 / 3 * GV_PI * r * r * r, 1e-15);
  CHECK_NEAR(lowest_z(&s, o), 0.95, 1e-12);
  for (int i = 0; i < s.vertex_count; i++) {
    gv_vec3 p = s.mesh_vertex[i];
    CHECK_NEAR(gv_norm(gv_v3(p.x, p.y, fmax(0, fabs(p.z) - l / 2))), r, 1e-12);
  }
}

static void test_cylinder_and_cone_by_name(void) {
  gv_scene s;
  const double r = 0.03;
  const double h = 0.08;
  const double m = 0.5;
  const gv_object *o = load_shape("cylinder = [0.03, 0.08]", &s);
  if (o)
    check_inertia(o, m * (r * r / 4 + h * h / 12), m * (r * r / 4 + h * h / 12), m * r * r / 2, 0, 0, 0);
  if (o)
    CHECK_NEAR(lowest_z(&s, o), 0.96, 1e-12);
  o = load_shape("cone = [0.03, 0.08]", &s);
  if (!o)
    return;
  check_inertia(o, m * (0.15 * r * r + 3.0 / 80 * h * h), m * (0.15 * r * r + 3.0 / 80 * h * h),
                m * 0.3 * r * r, 0, 0, 0);
  CHECK_NEAR(o->center_m.z, -h / 4, 1e-15);  // a quarter of the height above the base
  CHECK_NEAR(lowest_z(&s, o), 0.96, 1e-12);
  CHECK_NEAR(s.piece[0].aabb_max.z, 0.75 * h, 1e-12);
}

static void test_ellipsoid_by_name(void) {
  gv_scene s;
  const double a = 0.02;
  const double b = 0.03;
  const double c = 0.05;
  const double m = 0.5;
  const gv_object *o = load_shape("ellipsoid = [0.02, 0.03, 0.05]", &s);
  if (o)
    check_inertia(o, m / 5 * (b * b + c * c), m / 5 * (a * a + c * c), m / 5 * (a * a + b * b), 0, 0, 0);
  if (o)
    CHECK_NEAR(lowest_z(&s, o), 0.95, 1e-12);
  load_shape("ellipsoid = [0.04, 0.04, 0.04]", &s);  // a ball, exactly
  CHECK(s.piece[0].vertex_count == 1 && s.piece[0].radius == 0.04,
        "an ellipsoid with three equal axes is no ball");
}

// The sizes' ends: what the file may say is built, or refused with a reason.
static void test_thin_shapes_are_built_or_refused(void) {
  const char *const shape[] = {"capsule", "cylinder", "cone"};
  const double size[] = {0.0005, 0.01, 0.1, 5, 0.001, 1, 10};
  gv_scene s;
  char text[200];
  int built = 0;
  for (int k = 0; k < 3 * 49; k++) {
    snprintf(text, sizeof text, "%s%s%s = [%.4f, %.4f];%s", O, NM, shape[k % 3], size[k / 3 % 7],
             size[k / 21], E);
    built += load_text(text, &s) == 0;
    CHECK(!err[0] || strchr(err, ';'), "%s: %s", text, err);
  }
  CHECK(built > 100, "%d built", built);
  for (int k = built = 0; k < 4 * 4 * 4; k++) {
    snprintf(text, sizeof text, "%s%sellipsoid = [%.4f, %.4f, %.4f];%s", O, NM, size[k % 4], size[k / 4 % 4],
             size[k / 16], E);
    built += load_text(text, &s) == 0;
    CHECK(!err[0] || strchr(err, ';'), "%s: %s", text, err);
  }
  CHECK(built > 50, "%d ellipsoids built", built);
}

static void test_materials(void) {
  gv_scene s;
  const char *text = V "materials = ( { name = \"felt\"; mu = 0.9; }, { name = \"ice\"; mu = 2; friction = "
                       "\"fixed_limit\"; } );\n"
                       "pairs = ( { a = \"ice\"; b = \"hand\"; mu = 0.3; } );\n"
                       "objects = ({ name = \"a\"; mass = 1; material = \"ice\"; " BOX
                       "}, { name = \"b\"; mass = 1; material = \"felt\"; " BOX
                       "}, { name = \"c\"; mass = 1; " BOX "});\n";
  if (load_text(text, &s)) {
    CHECK(0, "%s", err);
    return;
  }
  CHECK(s.object[0].material == 3 && s.object[0].friction == GV_FRICTION_FIXED_LIMIT && s.object[0].mu == 2,
        "ice");
  CHECK(s.object[1].material == 2 && s.object[1].friction == GV_FRICTION_COULOMB && s.object[1].mu == 0.9,
        "felt");
  CHECK(s.object[2].material == GV_MATERIAL_NONE && s.object[2].mu == 0.8, "no material");
  CHECK(s.friction_pair_count == 1 && s.friction_pair[0].material_a == 3 &&
            s.friction_pair[0].material_b == GV_MATERIAL_HAND && s.friction_pair[0].mu == 0.3 &&
            s.friction_pair[0].friction == GV_FRICTION_COULOMB,
        "pair");
}

static void test_mistakes_are_refused(void) {
  gv_scene s;
  for (size_t i = 0; i < sizeof mistakes / sizeof *mistakes; i++)
    check_message(mistakes[i].line, mistakes[i].what, load_text(mistakes[i].text, &s));
}

// A hollow that the pieces fill is found by volume alone: all corners agree.
static void test_filled_window_is_refused(void) {
  static char text[20000], changed[20000];
  FILE *file = fopen("data/scenes/frame.scene", "r");
  size_t n = file ? fread(text, 1, sizeof text - 1, file) : 0;
  if (file)
    fclose(file);
  text[n] = 0;
  char *at = strstr(text, "pieces = (\n");
  CHECK(at, "frame.scene has no pieces");
  if (!at)
    return;
  snprintf(changed, sizeof changed, "%.*spieces = ( (0,1,2,3,4,5,6,11,12,13,14) ); } );\n", (int)(at - text),
           text);
  gv_scene s;
  check_message(":", "they overlap or fill a hollow", load_text(changed, &s));
}

// A small mismatch is refused by default and allowed by `fit`.
static void test_fit_allows_a_mismatch(void) {
  gv_scene s;
  const char *piece = TETRA_V TETRA_T "pieces = ((0,1,2,[0.0,0.0,0.0999]));\n";
  char text[1000];
  snprintf(text, sizeof text, "%s%s%s", O NM, piece, E);
  check_message(":4: ", "0.0578 mm outside of every piece", load_text(text, &s));
  snprintf(text, sizeof text, "%sfit = 2e-4; %s%s", O NM, piece, E);
  CHECK(load_text(text, &s) == 0, "%s", err);
}

// ---- maxima ---------------------------------------------------------------------------------------

static char *big, *big_at;
static void big_start(void) {
  big = big_at = malloc(1 << 24);
  big_at += sprintf(big_at, V "objects = (\n");
}
#define ADD(...) (big_at += sprintf(big_at, __VA_ARGS__))

static void check_too_big(const char *name, int maximum) {
  gv_scene s;
  char number[32];
  ADD(");\n");
  snprintf(number, sizeof number, "%d", maximum);
  check_message(":", name, load_text(big, &s));
  CHECK(strstr(err, number), "no %s in: %s", number, err);
  free(big);
}

static void test_too_many_objects(void) {
  big_start();
  for (int i = 0; i <= GV_MAX_OBJECTS; i++)
    ADD("%s{ name = \"o%d\"; mass = 1; " BOX "}\n", i ? ", " : "", i);
  check_too_big("GV_MAX_OBJECTS", GV_MAX_OBJECTS);
}

static void test_too_many_pieces(void) {
  big_start();
  ADD("{ " NM TETRA_V TETRA_T "pieces = (");
  for (int i = 0; i <= GV_MAX_PIECES; i++)
    ADD("%s[0,1,2,3]", i ? ",\n" : "");
  ADD(");\n}");
  check_too_big("GV_MAX_PIECES", GV_MAX_PIECES);
}

static void test_too_many_vertices(void) {
  big_start();
  ADD("{ " NM "vertices = (");
  for (int i = 0; i <= GV_MAX_VERTICES; i++)
    ADD("%s[%d,0,0]", i ? ",\n" : "", i % 7);
  ADD(");\n" TETRA_T TETRA_P "}");
  check_too_big("GV_MAX_VERTICES", GV_MAX_VERTICES);
}

static void test_too_many_triangles(void) {
  big_start();
  ADD("{ " NM TETRA_V "triangles = (");
  for (int i = 0; i <= GV_MAX_MESH_TRIANGLES; i++)
    ADD("%s[0,2,1]", i ? ",\n" : "");
  ADD(");\n" TETRA_P "}");
  check_too_big("GV_MAX_MESH_TRIANGLES", GV_MAX_MESH_TRIANGLES);
}

static void add_piece(int points) {
  ADD("(");
  for (int i = 0; i < points; i++)
    ADD("%s%d", i ? "," : "", i % 4);
  ADD(")");
}

static void test_too_many_points_in_a_piece(void) {
  big_start();
  ADD("{ " NM TETRA "},\n{ name = \"b\"; mass = 1; " TETRA_V TETRA_T "pieces = (\n");
  add_piece(GV_MAX_HULL_VERTICES + 1);
  ADD(");\n}");
  check_too_big("GV_MAX_HULL_VERTICES", GV_MAX_HULL_VERTICES);
}

static void test_too_many_points_in_all_pieces(void) {
  big_start();
  ADD("{ " NM TETRA_V TETRA_T "pieces = (");
  for (int i = 0; i <= GV_MAX_VERTICES / GV_MAX_HULL_VERTICES; i++) {
    if (i)
      ADD(",\n");
    add_piece(GV_MAX_HULL_VERTICES);
  }
  ADD(");\n}");
  check_too_big("GV_MAX_VERTICES", GV_MAX_VERTICES);
}

// An upright prism with n sides: 2 n vertices, fans at the bottom and top.
static void add_prism(int n) {
  ADD("{ name = \"prism\"; mass = 1; vertices = (");
  for (int i = 0; i < 2 * n; i++) {
    double angle = 2 * GV_PI * (i % n) / n;
    ADD("%s[%.9f, %.9f, %.1f]", i ? ",\n" : "", 0.1 * cos(angle), 0.1 * sin(angle), i < n ? 0.0 : 0.1);
  }
  ADD(");\ntriangles = (");
  for (int i = 0; i < n; i++)
    ADD("%s[%d,%d,%d],[%d,%d,%d]", i ? ",\n" : "", i, (i + 1) % n, n + (i + 1) % n, i, n + (i + 1) % n,
        n + i);
  for (int i = 1; i + 1 < n; i++)
    ADD(",\n[0,%d,%d],[%d,%d,%d]", i + 1, i, n, n + i, n + i + 1);
  ADD(");\npieces = ((");
  for (int i = 0; i < 2 * n; i++)
    ADD("%s%d", i ? "," : "", i);
  ADD("));\n}");
}

static void test_too_many_corners_of_a_face(void) {
  big_start();
  add_prism(GV_MAX_FACE_VERTICES + 1);
  check_too_big("GV_MAX_FACE_VERTICES", GV_MAX_FACE_VERTICES);
}

static void test_exactly_the_maxima_load(void) {
  gv_scene s;
  big_start();
  add_prism(GV_MAX_FACE_VERTICES);
  for (int i = 1; i < GV_MAX_OBJECTS; i++)
    ADD(", { name = \"o%d\"; mass = 1; " BOX "}\n", i);
  ADD(");\n");
  CHECK(load_text(big, &s) == 0, "%s", err);
  CHECK(err[0] || (s.object_count == GV_MAX_OBJECTS && s.piece_count == GV_MAX_OBJECTS), "sizes");
  free(big);
}

// With every smaller memory the frame is refused; with what it needs it loads.
static void test_too_little_memory(void) {
  gv_scene s;
  if (load_file("data/scenes/frame.scene", &s)) {
    CHECK(0, "%s", err);
    return;
  }
  size_t need = arena.used;
  for (size_t size = 0; size < need; size += 61) {
    gv_arena_init(&arena, memory, size);
    CHECK(gv_scene_load("data/scenes/frame.scene", &arena, &s, err, sizeof err) < 0,
          "loaded into %zu of %zu bytes", size, need);
    CHECK(strstr(err, "does not fit into its"), "%s", err);
  }
  gv_arena_init(&arena, memory, need);
  CHECK(gv_scene_load("data/scenes/frame.scene", &arena, &s, err, sizeof err) == 0, "%s", err);
}

int main(void) {
  RUN(test_box_scene);
  RUN(test_frame_scene);
  RUN(test_frame_pieces_fill_it_once);
  RUN(test_frame_polygons_are_the_pieces_surface);
  RUN(test_corner_tetrahedron);
  RUN(test_rotation_is_about_fixed_axes);
  RUN(test_given_inertia_replaces_uniform_density);
  RUN(test_ball);
  RUN(test_capsule_by_name);
  RUN(test_cylinder_and_cone_by_name);
  RUN(test_ellipsoid_by_name);
  RUN(test_thin_shapes_are_built_or_refused);
  RUN(test_materials);
  RUN(test_mistakes_are_refused);
  RUN(test_filled_window_is_refused);
  RUN(test_fit_allows_a_mismatch);
  RUN(test_too_many_objects);
  RUN(test_too_many_pieces);
  RUN(test_too_many_vertices);
  RUN(test_too_many_triangles);
  RUN(test_too_many_points_in_a_piece);
  RUN(test_too_many_points_in_all_pieces);
  RUN(test_too_many_corners_of_a_face);
  RUN(test_exactly_the_maxima_load);
  RUN(test_too_little_memory);
  return check_done();
}
