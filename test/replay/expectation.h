// SPDX-License-Identifier: BSD-3-Clause
// What a recorded trace must give: its file data/traces/NAME/expected. Lines before `steps` are written by
// hand, the rest by `make golden`:
//
//   scene FILE
//   object NAME
//   hold_s FROM TO             window in which the object is held in the air
//   limits VARIANT slip_mm A tilt_deg B depth_mm C ripple_n D    in that window; `default` also holds for
//                              variants without a line
//   steps N
//   hash_VARIANT HEX           of the last step's state
//   chain HEX...               low 16 bits of FNV over the hashes so far, one per step, variant default
#ifndef TEST_REPLAY_EXPECTATION_H
#define TEST_REPLAY_EXPECTATION_H

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "gloved/engine.h"

enum { MAX_STEPS = 60000 };

// The engine in the ways that it can be set up: each solver and narrow phase, and the presets.
typedef enum variant {
  VARIANT_DEFAULT,
  VARIANT_NEWTON,
  VARIANT_DANTZIG,
  VARIANT_QUICKSTEP,
  VARIANT_LIBCCD,
  VARIANT_STOCK,
  VARIANT_PAPER,
  VARIANT_FINGER_JOINTS,
  VARIANT_PADS,
  VARIANTS
} variant;
static const char *const variant_name[VARIANTS] = {
  "default", "newton", "dantzig", "quickstep", "libccd", "stock", "paper", "finger_joints", "pads"};

static inline gv_config variant_config(variant v) {
  gv_config c = v == VARIANT_PAPER   ? gv_config_paper()
                : v == VARIANT_STOCK ? gv_config_stock()
                                     : gv_config_default();
  if (v == VARIANT_NEWTON)
    c.solver = GV_SOLVER_NEWTON;
  if (v == VARIANT_DANTZIG)
    c.solver = GV_SOLVER_DANTZIG;
  if (v == VARIANT_QUICKSTEP)
    c.solver = GV_SOLVER_QUICKSTEP;
  if (v == VARIANT_LIBCCD)
    c.narrow = GV_NARROW_LIBCCD;
  c.finger_joints = v == VARIANT_FINGER_JOINTS;
  c.patch_m = v == VARIANT_PADS ? 0.006 : 0.0;
  return c;
}

static inline int variant_of_name(const char *name) {
  for (int v = 0; v < VARIANTS; v++)
    if (strcmp(variant_name[v], name) == 0)
      return v;
  return -1;
}

typedef struct hold_limits {
  double slip_mm, tilt_deg, depth_mm, ripple_n;
} hold_limits;

typedef struct expectation {
  char name[64], scene[128], script[128], object[GV_MAX_NAME];
  double hold_from_s, hold_to_s;
  bool limited[VARIANTS];
  hold_limits limits[VARIANTS];
  int steps;
  uint64_t hash[VARIANTS];
  int chain_length;
  uint16_t chain[MAX_STEPS];
} expectation;

static inline void read_chain(expectation *x, const char *at) {
  unsigned value;
  int used;
  while (x->chain_length < MAX_STEPS && sscanf(at, "%4x%n", &value, &used) == 1) {
    x->chain[x->chain_length++] = (uint16_t)value;
    at += used;
  }
}

static inline void read_limits(expectation *x, const char *line) {
  char name[16];
  hold_limits l;
  const int found = sscanf(line, "limits %15s slip_mm %lf tilt_deg %lf depth_mm %lf ripple_n %lf", name,
                           &l.slip_mm, &l.tilt_deg, &l.depth_mm, &l.ripple_n);
  const int v = found == 5 ? variant_of_name(name) : -1;
  if (v < 0)
    return;
  x->limited[v] = true;
  x->limits[v] = l;
}

static inline void read_line(expectation *x, const char *line) {
  char name[16];
  uint64_t hash;
  if (strncmp(line, "chain ", 6) == 0)
    read_chain(x, line + 6);
  if (strncmp(line, "limits ", 7) == 0)
    read_limits(x, line);
  sscanf(line, "scene %127s", x->scene);
  sscanf(line, "script %127s", x->script);
  sscanf(line, "object %31s", x->object);
  sscanf(line, "hold_s %lf %lf", &x->hold_from_s, &x->hold_to_s);
  sscanf(line, "steps %d", &x->steps);
  if (sscanf(line, "hash_%15s %" SCNx64, name, &hash) == 2 && variant_of_name(name) >= 0)
    x->hash[variant_of_name(name)] = hash;
}

// 0, or negative where the file is not there or says too little.
static inline int expectation_read(const char *trace, expectation *x) {
  char path[256], line[512];
  memset(x, 0, sizeof *x);
  snprintf(x->name, sizeof x->name, "%s", trace);
  snprintf(path, sizeof path, "data/traces/%s/expected", trace);
  FILE *f = fopen(path, "r");
  if (!f)
    return -1;
  while (fgets(line, sizeof line, f))
    read_line(x, line);
  fclose(f);
  for (int v = 0; v < VARIANTS; v++)
    if (!x->limited[v])
      x->limits[v] = x->limits[VARIANT_DEFAULT];
  return x->scene[0] && x->object[0] && x->limited[VARIANT_DEFAULT] ? 0 : -1;
}

static inline void expectation_write(const expectation *x) {
  char path[256];
  snprintf(path, sizeof path, "data/traces/%s/expected", x->name);
  FILE *f = fopen(path, "w");
  if (!f) {
    perror(path);
    exit(2);
  }
  fprintf(f, "# What this trace must give (test/replay/expectation.h). Lines before `steps` are written by "
             "hand, the rest\n"
             "# by `make golden`.\n");
  fprintf(f, "scene %s\n", x->scene);
  if (x->script[0])
    fprintf(f, "script %s\n", x->script);
  fprintf(f, "object %s\nhold_s %g %g\n", x->object, x->hold_from_s, x->hold_to_s);
  for (int v = 0; v < VARIANTS; v++) {
    const hold_limits *l = &x->limits[v];
    if (x->limited[v])
      fprintf(f, "limits %s slip_mm %g tilt_deg %g depth_mm %g ripple_n %g\n", variant_name[v], l->slip_mm,
              l->tilt_deg, l->depth_mm, l->ripple_n);
  }
  fprintf(f, "steps %d", x->steps);
  for (int v = 0; v < VARIANTS; v++)
    fprintf(f, "\nhash_%s %016" PRIx64, variant_name[v], x->hash[v]);
  for (int i = 0; i < x->chain_length; i++)
    fprintf(f, "%s%04x", i % 24 ? "" : "\nchain ", x->chain[i]);
  fprintf(f, "\n");
  fclose(f);
}

#endif
