// SPDX-License-Identifier: BSD-3-Clause
// gloved-grasp: a grasp for any object. Tries candidates with the simulated user, keeps the one whose
// contacts resist the most, and writes its script.
#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "gloved/drivers.h"

#include "daemon/load/config_load.h"
#include "daemon/load/scene_load.h"
#include "tools/grasp/grasp.h"
#include "tools/program.h"

static const char help[] =
    "gloved-grasp: finds a posture and a place for the hand that hold an object, and writes the user's "
    "script.\n"
    "\n"
    "  gloved-grasp SCENE [-o FILE] [OPTION...]        (SCENE: a file, or the name of a scene that comes "
    "with gloved)\n"
    "      The simulated user takes the object from directions and heights all around it, with a fist, a "
    "clasp or\n"
    "      fingertips, lifts it by 150 mm and holds it: device, safety machine, limiter and engine as they "
    "are, as fast\n"
    "      as possible. Of the first that hold, the one whose contacts resist the largest push from any "
    "direction is\n"
    "      held for three seconds more and written. The same scene, seed and version give the same script.\n"
    "  -o FILE        the script (default: standard output), for --fcu sim:FILE and fcusim --script FILE\n"
    "  --object NAME  which one (default: the first that is neither static nor on a joint)\n"
    "  --seed N       of the sequence of candidates, 0 to 999 (default 0)\n"
    "  --tries N      candidates that are simulated at most, 1 to 10000 (default 300)\n"
    "  --enough N     grasps that hold to choose from, 1 to 100 (default 3)\n"
    "  --help, --version\n"
    "\n"
    "Exit codes: 0 done, 1 none of the candidates holds it, 2 bad usage or bad input.\n";

// One that holds is enough where so many more tries find no other.
enum { FIT_TESTS_PER_TRY = 40, FOUND_MAX = 100, PATIENCE = 25 };
static const double creeps_m = 1e-4;  // in the second that a try lasts
static const size_t scene_memory = 64u << 20;

typedef struct options {
  const char *scene, *out, *object;
  int seed, tries, enough;
} options;

typedef struct found {
  grasp_candidate candidate;
  grasp_result result;
  bool failed_proof;
} found;

__attribute__((format(printf, 2, 3))) static int fail(int code, const char *format, ...) {
  va_list args;
  va_start(args, format);
  fputs("gloved-grasp: ", stderr);
  vfprintf(stderr, format, args);
  fputc('\n', stderr);
  va_end(args);
  return code;
}

static bool read_count(const char *name, const char *text, int low, int high, int *out) {
  char *end;
  errno = 0;
  const long value = text ? strtol(text, &end, 10) : 0;
  if (!text || end == text || *end || errno || value < low || value > high) {
    fail(2, "%s wants a whole number from %d to %d, not %s; see --help", name, low, high,
         text ? text : "nothing");
    return false;
  }
  *out = (int)value;
  return true;
}

static bool read_options(int argc, char **argv, options *out) {
  *out = (options){.seed = 0, .tries = 300, .enough = 3};
  for (int i = 1; i < argc; i++) {
    const char *word = argv[i];
    const char *next = i + 1 < argc ? argv[i + 1] : NULL;
    bool good = true;
    if (word[0] != '-' && !out->scene) {
      out->scene = word;
      continue;
    }
    if (strcmp(word, "-o") == 0)
      good = (out->out = next) != NULL;
    else if (strcmp(word, "--object") == 0)
      good = (out->object = next) != NULL;
    else if (strcmp(word, "--seed") == 0) {
      if (!read_count(word, next, 0, 999, &out->seed))
        return false;
    } else if (strcmp(word, "--tries") == 0) {
      if (!read_count(word, next, 1, 10000, &out->tries))
        return false;
    } else if (strcmp(word, "--enough") == 0) {
      if (!read_count(word, next, 1, FOUND_MAX, &out->enough))
        return false;
    } else
      good = false;
    if (!good) {
      fail(2, "\"%s\" is not understood%s; see --help", word, next ? "" : ", or its value is missing");
      return false;
    }
    i++;
  }
  if (!out->scene)
    fail(2, "which scene? gloved-grasp SCENE -o FILE; see --help");
  return out->scene != NULL;
}

static bool hangs_on_a_joint(const gv_scene *scene, int object) {
  for (int i = 0; i < scene->joint_count; i++)
    if (scene->joint[i].object_a == object || scene->joint[i].object_b == object)
      return true;
  return false;
}

// The object to grasp; -1, and it was said why, where there is none.
static int choose_object(const gv_scene *scene, const options *o) {
  for (int i = 0; i < scene->object_count; i++) {
    const bool fixed = scene->object[i].is_static || hangs_on_a_joint(scene, i);
    const bool named = o->object && strcmp(scene->object[i].name, o->object) == 0;
    if (fixed && named) {
      const char *why = scene->object[i].is_static ? "is static" : "hangs on a joint";
      fail(2, "%s: \"%s\" %s and cannot be lifted; give another --object", o->scene, o->object, why);
      return -1;
    }
    if (named || (!o->object && !fixed))
      return i;
  }
  if (o->object)
    fail(2, "%s: no object is named \"%s\"; give one of its names", o->scene, o->object);
  else
    fail(2, "%s: all its objects are static or hang on joints; add one with a mass", o->scene);
  return -1;
}

// Tries candidates until enough hold. Returns how many did.
static int look_for(grasp_search *search, const options *o, found out[FOUND_MAX], int *out_tries) {
  int count = 0;
  int tries = 0;
  int last = 0;
  for (int number = 0; number < FIT_TESTS_PER_TRY * o->tries && tries < o->tries && count < o->enough;
       number++) {
    if (count > 0 && tries - last >= PATIENCE)
      break;
    found *f = &out[count];
    if (!grasp_candidate_make(search, (unsigned)o->seed, number, &f->candidate))
      continue;
    tries++;
    grasp_try(search, &f->candidate, GRASP_TRIED_MS, &f->result);
    if (!f->result.held)
      continue;
    fprintf(stderr,
            "gloved-grasp: candidate %d holds (%d tried): resists %.2f of a contact's force from any side, "
            "slip %.4f mm, %d limbs\n",
            number, tries, f->result.wrench_n, f->result.slip_m * 1e3, f->result.limbs);
    f->failed_proof = false;
    last = tries;
    count++;
  }
  *out_tries = tries;
  return count;
}

// What it resists; one that creeps comes after all that do not.
static double worth(const found *f) { return f->result.wrench_n - (f->result.slip_m > creeps_m ? 10 : 0); }

// The best that also holds for as long as the script goes; null where none does.
static const found *prove_best(grasp_search *search, found all[], int count) {
  for (int round = 0; round < count; round++) {
    found *best = NULL;
    for (int i = 0; i < count; i++)
      if (!all[i].failed_proof && (!best || worth(&all[i]) > worth(best)))
        best = &all[i];
    grasp_try(search, &best->candidate, GRASP_END_MS, &best->result);
    if (best->result.held)
      return best;
    best->failed_proof = true;
  }
  return NULL;
}

static int write_script(const options *o, const found *best, const char *object, int tries) {
  static char text[6000], comment[600];
  const grasp_result *r = &best->result;
  snprintf(comment, sizeof comment,
           "# %s of %s, found by gloved-grasp %s (seed %d, candidate %d, %d tried).\n"
           "# Lifted by %.0f mm and held for %.0f s: slip %.4f mm, %d limbs touch it.\n",
           object, o->scene, gv_version_text(), o->seed, best->candidate.number, tries, r->lift_m * 1e3,
           (GRASP_END_MS - GRASP_SETTLED_MS) / 1e3, r->slip_m * 1e3, r->limbs);
  grasp_script(&best->candidate, comment, text, sizeof text);
  FILE *file = o->out ? fopen(o->out, "w") : stdout;
  if (!file)
    return fail(2, "%s: cannot write: %s; give a place that can be written", o->out, strerror(errno));
  const bool good = fputs(text, file) >= 0;
  if ((file != stdout ? fclose(file) : fflush(file)) || !good)
    return fail(2, "%s: cannot write: %s; is the disk full?", o->out ? o->out : "standard output",
                strerror(errno));
  return 0;
}

static int search_and_write(const options *o, const gv_scene *scene, const gv_config *config, int object) {
  static found all[FOUND_MAX + 1];
  static grasp_search search;
  int tries = 0;
  const size_t size = gv_engine_size(config, scene);
  void *memory = aligned_alloc(64, (size + 63) & ~(size_t)63);
  if (!memory)
    return fail(2, "%s: %zu bytes of memory are not there; close other programs", o->scene, size);
  const char *name = scene->object[object].name;
  int code = 0;
  if (!grasp_begin(&search, scene, config, memory, size, object)) {
    code = fail(2, "%s: the engine does not take it; see gloved --check --scene %s", o->scene, o->scene);
  } else {
    const int count = look_for(&search, o, all, &tries);
    const found *best = prove_best(&search, all, count);
    if (best) {
      fprintf(stderr,
              "gloved-grasp: %s is lifted by %.0f mm and held for %.0f s: slip %.4f mm, %d limbs (seed %d, "
              "candidate %d of %d tried)\n",
              name, best->result.lift_m * 1e3, (GRASP_END_MS - GRASP_SETTLED_MS) / 1e3,
              best->result.slip_m * 1e3, best->result.limbs, o->seed, best->candidate.number, tries);
      code = write_script(o, best, name, tries);
    } else {
      code = fail(1,
                  "%s: none of %d tries holds \"%s\" (seed %d); try another --seed or more --tries, or make "
                  "it lighter, rougher, "
                  "or of a size for a hand",
                  o->scene, tries, name, o->seed);
    }
  }
  free(memory);
  return code;
}

int main(int argc, char **argv) {
  options o;
  gv_scene scene;
  gv_arena arena;
  gv_settings settings;
  char err[1024];
  if (program_answers(argc, argv, help))
    return 0;
  if (!read_options(argc, argv, &o))
    return 2;
  void *memory = malloc(scene_memory);
  if (!memory)
    return fail(2, "%zu bytes of memory are not there; close other programs", scene_memory);
  gv_arena_init(&arena, memory, scene_memory);
  gv_settings_default(&settings);
  char path[GV_SETTING_TEXT];
  if (gv_data_path(o.scene, "scenes", ".scene", path, sizeof path))
    o.scene = path;
  int code = 2;
  if (gv_scene_load(o.scene, &arena, &scene, err, sizeof err)) {
    fail(2, "%s", err);
  } else {
    const int object = choose_object(&scene, &o);
    code = object >= 0 ? search_and_write(&o, &scene, &settings.engine, object) : 2;
  }
  free(memory);
  return code;
}
