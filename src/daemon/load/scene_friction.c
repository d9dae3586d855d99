// SPDX-License-Identifier: BSD-3-Clause
// Friction in a scene file: `mu` and `friction` of an object, or the name of a material, and a
// table of how two materials rub against each other. Explained in data/scenes/frame.scene. Main
// thread, before the loop starts.
#include "daemon/load/scene_friction.h"

#define DEFAULT_MU 0.8
#define MAX_COEFFICIENT 10.0
#define MAX_LIMIT_N 1000.0

static void read_law(gv_conf_group *group, gv_friction *out_friction, double *out_mu) {
  static const char *const laws[] = {"coulomb", "fixed_limit", NULL};
  int law = 0;
  gv_conf_choice(group, "friction", laws, &law);
  const bool fixed = law == 1;
  *out_friction = fixed ? GV_FRICTION_FIXED_LIMIT : GV_FRICTION_COULOMB;
  if (fixed)
    gv_conf_need(group, "mu", "mu = <newtons>: the most that a contact holds");
  *out_mu = DEFAULT_MU;
  gv_conf_number(group, "mu", 0, fixed ? MAX_LIMIT_N : MAX_COEFFICIENT, out_mu);
}

static gv_conf_names names_of(const gv_materials *m) {
  return (gv_conf_names){.entries = m->material,
                         .size = sizeof *m->material,
                         .from = GV_MATERIAL_HAND,
                         .count = m->count,
                         .what = "material",
                         .mend = "list it in 'materials' (\"hand\" is the hand's skin)"};
}

static int read_reference(const gv_materials *m, gv_conf_group *group, const char *key) {
  const gv_conf_names names = names_of(m);
  return gv_conf_reference(group, key, &names, GV_MATERIAL_NONE);
}

static void read_material(gv_materials *m, gv_conf_node node) {
  gv_conf_group group = gv_conf_as_group(node, "a material");
  gv_material fresh = {.name = ""};
  const gv_conf_names names = names_of(m);
  gv_conf_node name = gv_conf_need(&group, "name", "name = \"...\";");
  gv_conf_text(&group, "name", fresh.name, sizeof fresh.name);
  read_law(&group, &fresh.friction, &fresh.mu);
  gv_conf_leave(&group);
  if (node.conf->failed)
    return;
  if (!fresh.name[0])
    gv_conf_fail(name, "the name is empty; name the material");
  else if (gv_conf_find_name(&names, fresh.name, GV_MATERIAL_NONE))
    gv_conf_fail(name, "two materials are named \"%s\"; rename one", fresh.name);
  else
    m->material[m->count++] = fresh;
}

static void read_pair(const gv_materials *m, gv_conf_node node, gv_friction_pair *out) {
  gv_conf_group group = gv_conf_as_group(node, "a pair");
  gv_conf_need(&group, "a", "a = \"<material>\";");
  gv_conf_need(&group, "b", "b = \"<material>\";");
  gv_conf_need(&group, "mu", "mu = <coefficient>");
  out->material_a = read_reference(m, &group, "a");
  out->material_b = read_reference(m, &group, "b");
  read_law(&group, &out->friction, &out->mu);
  gv_conf_leave(&group);
}

// Entries of the list at `key`; 0 where it is absent.
static int list_length(gv_conf_group *root, const char *key, int max, const char *max_name,
                       gv_conf_node *out) {
  *out = gv_conf_find(root, key);
  if (!gv_conf_has(*out))
    return 0;
  int length = gv_conf_length(*out);
  if (length < 0)
    gv_conf_fail(*out, "'%s' is no list; write %s = ( { ... }, ... );", key, key);
  if (length > max)
    gv_conf_fail(*out, "'%s' has %d entries; at most %d (%s)", key, length, max, max_name);
  return out->conf->failed ? 0 : length;
}

void gv_materials_read(gv_materials *out, gv_conf_group *root, gv_arena *arena, gv_scene *out_scene) {
  gv_conf_node list;
  *out = (gv_materials){.material = {{.name = ""}, {.name = "hand"}}, .count = 2};
  int count = list_length(root, "materials", GV_MAX_MATERIALS - 2, "GV_MAX_MATERIALS, less the hand's",
                          &list);
  for (int i = 0; i < count && !list.conf->failed; i++)
    read_material(out, gv_conf_entry(list, i));
  count = list_length(root, "pairs", GV_MAX_FRICTION_PAIRS, "GV_MAX_FRICTION_PAIRS", &list);
  if (count == 0)
    return;
  gv_friction_pair *pair = gv_arena_alloc(arena, "scene friction", sizeof *pair * (size_t)count);
  if (!pair) {
    gv_conf_fail(list, "the scene does not fit into its %zu bytes of memory; simplify it", arena->size);
    return;
  }
  for (int i = 0; i < count && !list.conf->failed; i++)
    read_pair(out, gv_conf_entry(list, i), &pair[i]);
  out_scene->friction_pair = pair;
  out_scene->friction_pair_count = count;
}

void gv_friction_read(const gv_materials *materials, gv_conf_group *group, gv_object *out) {
  out->material = read_reference(materials, group, "material");
  read_law(group, &out->friction, &out->mu);
  if (out->material == GV_MATERIAL_NONE)
    return;
  gv_conf_node mu = gv_conf_find(group, "mu");
  gv_conf_node friction = gv_conf_find(group, "friction");
  if (gv_conf_has(mu))
    gv_conf_fail(mu, "'mu' beside 'material'; give one of the two");
  if (gv_conf_has(friction))
    gv_conf_fail(friction, "'friction' beside 'material'; give one of the two");
  out->friction = materials->material[out->material].friction;
  out->mu = materials->material[out->material].mu;
}
