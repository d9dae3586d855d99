// SPDX-License-Identifier: BSD-3-Clause
// What `gloved --check` doubts about a scene: weights that sink in, objects that start inside each other,
// masses and sizes out of proportion to a hand, with the unit that was likely meant; and nothing about
// the scenes that come with the project.
#include <glob.h>
#include <string.h>

#include "daemon/load/scene_doubts.h"
#include "daemon/load/scene_load.h"
#include "support/check.h"

enum { MEMORY = 48 << 20, MOST = 8 };
static char memory[MEMORY], err[512];
static gv_doubt found[MOST];
static int count;

static void look_at(const gv_scene *scene) {
  const gv_config cfg = gv_config_default();
  memset(found, 0, sizeof found);
  count = gv_scene_doubts(scene, &cfg, found, MOST);
}

// A table, and what stands in `objects`.
static void look(const char *objects) {
  char text[2048];
  gv_arena arena;
  gv_scene scene;
  gv_arena_init(&arena, memory, sizeof memory);
  snprintf(text, sizeof text,
           "version = 1;\nobjects = (\n { name = \"table\"; static = true; box = [1.2, 0.8, 0.04]; position "
           "= [0.0, 0.0, -0.02]; },\n%s);\n",
           objects);
  count = -1;
  if (gv_scene_load_text("scene", text, &arena, &scene, err, sizeof err))
    CHECK(0, "%s", err);
  else
    look_at(&scene);
}

static void expect(int wanted, const char *says, const char *advises) {
  CHECK(count == wanted, "%d doubts: %s; %s", count, found[0].text, found[1].text);
  CHECK(strstr(found[0].text, says) && strstr(found[0].text, advises), "%s", found[0].text);
}

#define BOX(name, kg, edges, at)                                                                             \
  "{ name = \"" name "\"; mass = " kg "; box = [" edges "]; position = [" at "]; }"

static void test_nothing_about_a_sound_scene(void) {
  look(BOX("box", "0.2", "0.06, 0.06, 0.08", "0.0, 0.0, 0.04"));
  CHECK(count == 0, "%s", found[0].text);
  look(BOX("low", "0.2", "0.06, 0.06, 0.08", "0.0, 0.0, 0.04") "," BOX("high", "0.2", "0.06, 0.06, 0.08",
                                                                       "0.0, 0.0, 0.12"));
  CHECK(count == 0, "a stack: %s", found[0].text);
}

static void test_a_weight_that_sinks_in(void) {
  look(BOX("anvil", "100.0", "0.5, 0.5, 0.5", "0.0, 0.0, 0.25"));
  expect(2, "which no hand lifts", "");
  CHECK(strstr(found[1].text, "sinks by 1.2 mm"), "%s", found[1].text);
  look(BOX("less", "19.0", "0.3, 0.3, 0.3", "0.0, 0.0, 0.15"));
  CHECK(count == 0, "%s", found[0].text);
  look("{ name = \"shot\"; mass = 30.0; ball = 0.1; position = [0.0, 0.0, 0.1]; }");  // on a single point
  CHECK(count == 2 && strstr(found[1].text, "sinks by 1.5 mm"), "%s", found[1].text);
}

static void test_objects_inside_each_other(void) {
  look(BOX("deep", "0.2", "0.06, 0.06, 0.08", "0.0, 0.0, 0.03"));
  expect(1, "'deep' starts 10 mm inside 'table'", "move it by 10 mm along (0, 0, 1)");
  look(BOX("a", "0.2", "0.06, 0.06, 0.08", "0.0, 0.0, 0.04") "," BOX("b", "0.2", "0.06, 0.06, 0.08",
                                                                     "0.055, 0.0, 0.04"));
  expect(1, "'b' starts 5 mm inside 'a'", "along (1, 0, 0)");
  look(BOX("touching", "0.2", "0.06, 0.06, 0.08", "0.0, 0.0, 0.03999"));
  CHECK(count == 0, "10 um are rounding: %s", found[0].text);
}

static void test_units(void) {
  look(BOX("cm", "0.2", "6.0, 6.0, 8.0", "0.0, 0.0, 4.0"));
  expect(2, "'cm' is 8 m long", "centimetres taken as metres? multiply by 0.01");
  look(BOX("grams", "200.0", "0.06, 0.06, 0.08", "0.0, 0.0, 0.04"));
  expect(2, "694 times the density of water", "grams taken as kilograms? multiply by 0.001");
  look(BOX("kilograms", "0.0002", "0.06, 0.06, 0.08", "0.0, 0.0, 0.04"));
  expect(1, "is lighter than air", "kilograms taken as grams? multiply by 1000");
  look(BOX("light", "0.0005", "0.06, 0.06, 0.08", "0.0, 0.0, 0.04"));
  expect(1, "0.5 g", "masses are in kilograms");
  look("{ name = \"speck\"; mass = 0.002; ball = 0.002; position = [0.0, 0.0, 0.002]; }");
  CHECK(count >= 1 && strstr(found[0].text, "'speck' is 4 mm long"), "%s", found[0].text);
}

// More than there is room for are counted.
static void test_the_count_goes_on(void) {
  gv_scene scene;
  gv_arena arena;
  gv_doubt one[1];
  const gv_config cfg = gv_config_default();
  gv_arena_init(&arena, memory, sizeof memory);
  CHECK(gv_scene_load_text(
            "scene",
            "version = 1; objects = (" BOX("a", "200.0", "0.06, 0.06, 0.08", "0.0, 0.0, 0.04") "," BOX(
                "b", "200.0", "0.06, 0.06, 0.08", "0.0, 0.0, 0.04") ");",
            &arena, &scene, err, sizeof err) == 0,
        "%s", err);
  CHECK(gv_scene_doubts(&scene, &cfg, one, 1) == 5, "two masses, two weights, one overlap");
}

static void test_nothing_about_the_projects_scenes(void) {
  glob_t files;
  glob("data/scenes/*.scene", 0, NULL, &files);
  glob("build/scenes/*.scene", GLOB_APPEND, NULL, &files);
  CHECK(files.gl_pathc >= 2, "no scenes here");
  for (size_t i = 0; i < files.gl_pathc; i++) {
    gv_arena arena;
    gv_scene scene;
    gv_arena_init(&arena, memory, sizeof memory);
    if (gv_scene_load(files.gl_pathv[i], &arena, &scene, err, sizeof err))
      CHECK(0, "%s", err);
    else
      look_at(&scene);
    CHECK(count == 0, "%s: %s", files.gl_pathv[i], found[0].text);
  }
  globfree(&files);
}

int main(void) {
  RUN(test_nothing_about_a_sound_scene);
  RUN(test_a_weight_that_sinks_in);
  RUN(test_objects_inside_each_other);
  RUN(test_units);
  RUN(test_the_count_goes_on);
  RUN(test_nothing_about_the_projects_scenes);
  return check_done();
}
