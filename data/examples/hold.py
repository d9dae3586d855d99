# SPDX-License-Identifier: BSD-3-Clause
"""hold.c in Python: cffi compiles the few lines that it needs against the installed headers (pip install cffi).
    python3 hold.py box.scene"""
import subprocess
import sys

import cffi

ffi = cffi.FFI()
ffi.cdef("""
typedef struct { double w, x, y, z; } gv_quat;
typedef struct { double x, y, z; } gv_vec3;
typedef struct { gv_quat q; gv_vec3 p; } gv_pose;
typedef struct { double raw[22]; gv_pose T_world_receiver; bool glove_new, pose_new; ...; } gv_sample;
typedef struct { double tension_n[5]; ...; } gv_step_result;
typedef struct { ...; } gv_calibration;
typedef struct { gv_calibration calibration; ...; } gv_config;
typedef struct { int object_count; ...; } gv_scene;
typedef struct { ...; } gv_arena;
typedef struct gv_engine gv_engine;
void gv_arena_init(gv_arena *arena, void *memory, size_t size);
int gv_scene_load(const char *path, gv_arena *arena, gv_scene *out, char *err, size_t err_size);
gv_config gv_config_default(void);
double gv_calibration_raw(const gv_calibration *cal, int sensor, double angle_rad);
size_t gv_engine_size(const gv_config *cfg, const gv_scene *scene);
gv_engine *gv_engine_init(void *mem, size_t size, const gv_config *cfg, const gv_scene *scene);
void gv_engine_step(gv_engine *engine, const gv_sample *sample, gv_step_result *out);
uint64_t gv_engine_hash(const gv_engine *engine);
""")
flags = subprocess.run(["pkg-config", "--cflags", "--libs", "gloved"], capture_output=True, text=True, check=True).stdout.split()
ffi.set_source("_gloved", "#include <gloved/engine.h>\n#include <gloved/load.h>", extra_compile_args=flags, extra_link_args=flags)
ffi.compile()
sys.path.insert(0, ".")  # where it was compiled to
from _gloved import ffi, lib  # noqa: E402

memory, err = ffi.new("char[]", 32 << 20), ffi.new("char[512]")
arena, scene, sample, result = (ffi.new(f"gv_{kind} *") for kind in ("arena", "scene", "sample", "step_result"))
lib.gv_arena_init(arena, memory, 32 << 20)
if lib.gv_scene_load(sys.argv[1].encode(), arena, scene, err, 512):
    sys.exit(ffi.string(err).decode())
cfg = ffi.new("gv_config *", lib.gv_config_default())
block = ffi.new("char[]", lib.gv_engine_size(cfg, scene))
engine = lib.gv_engine_init(block, len(block), cfg, scene)
sample.raw = [lib.gv_calibration_raw(ffi.addressof(cfg.calibration), i, 0.0) for i in range(22)]
sample.T_world_receiver = ((1, 0, 0, 0), (-0.1, 0, 0.085))
sample.glove_new = sample.pose_new = True
for _ in range(1000):
    lib.gv_engine_step(engine, sample, result)
print(f"{scene.object_count} objects, tensions", *(f"{n:.3f}" for n in result.tension_n), f"N, state {lib.gv_engine_hash(engine):016x}")
