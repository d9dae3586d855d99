# SPDX-License-Identifier: BSD-3-Clause
"""gloved-scene: a triangle mesh to a scene file (data/scenes/frame.scene explains the format).

The mesh that is shown stays the input's triangles to the last bit; convex pieces, mass properties and the measured
difference between pieces and mesh are written beside it. The same mesh and options give the same file.
"""
import argparse
import hashlib
import math
import os
import re
import sys

import numpy as np

import pieces as cutting
import repair as mending
import solid
from read import Fault, read

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
WOOD_KG_M3 = 700.0
MAX_EXTENT_M, MIN_EXTENT_M = 2.0, 0.002   # what a hand can do something with
HANDY_M, HANDY_KG = (0.03, 0.4), 3.0      # what fits into one, and can be held up
UNITS = (("millimetres", 0.001), ("centimetres", 0.01), ("metres", 1.0), ("inches", 0.0254))
MAX_FIT_M = 0.01                          # of the loader
STEPS = 150                               # samples of the difference along the extent


def limits():
    """GV_MAX_... as the loader has them."""
    with open(os.path.join(ROOT, "include/gloved/limits.h")) as f:
        return {name: int(value) for name, value in re.findall(r"(GV_MAX_\w+) = (\d+)", f.read())}


def options(argv):
    p = argparse.ArgumentParser(prog="gloved-scene", description="A triangle mesh to a scene that gloved can load: convex pieces, "
                                "mass properties and the mesh itself, on a table.")
    p.add_argument("mesh", metavar="MESH", help="a closed surface in .obj, .stl, .ply, .off, .gltf, .glb or .3ds")
    p.add_argument("-o", dest="out", metavar="OUT.scene", required=True, help="the scene; its name is the object's")
    p.add_argument("--mass", type=float, metavar="KG", help="of the object")
    p.add_argument("--density", type=float, metavar="KG_M3", help=f"in place of --mass (default {WOOD_KG_M3:.0f}, wood)")
    p.add_argument("--mu", type=float, default=0.8, help="friction coefficient (default 0.8)")
    p.add_argument("--scale", type=scale_of, metavar="S", help="metres per unit of the mesh (default 1; 0.001 for millimetres), "
                   "or guess: the unit that makes it a thing for a hand")
    p.add_argument("--size", type=float, metavar="M", help="in place of --scale: the longest side in metres")
    p.add_argument("--up", choices=list(UPWARD), help="axis of the mesh that points up (default z; y for glTF), as in --up=-y")
    p.add_argument("--repair", nargs="?", choices=("largest", "all"), const="largest", help="first close holes and mend doubled "
                   "faces and edges where three meet, of the largest part (default) or of all parts, and say what was done")
    p.add_argument("--hull", action="store_true", help="take the convex hull of the mesh in its place")
    p.add_argument("--place-on-table", action="store_true", help="move it over the origin and onto the table (z = 0)")
    p.add_argument("--simplify", type=int, metavar="N", help="to exactly N triangles first")
    p.add_argument("--max-pieces", type=int, default=64, metavar="N", help="convex pieces at most (default 64)")
    p.add_argument("--threshold", type=float, default=0.05, metavar="T",
                   help="concavity that CoACD leaves, of half the longest side: 0.01 fine to 1 coarse (default 0.05)")
    o = p.parse_args(argv)
    check_options(p, o)
    return o


def scale_of(word):
    return word if word == "guess" else float(word)


def check_options(p, o):
    if o.repair and o.hull:
        p.error("--repair beside --hull; give one of the two (a hull needs no repair)")
    for name in ("mass", "density", "scale", "size"):
        value = getattr(o, name)
        if value is not None and value != "guess" and not (value > 0 and math.isfinite(value)):
            p.error(f"--{name} {value:g} must be above 0")
    if o.mass is not None and o.density is not None:
        p.error("--mass beside --density; give one of the two")
    if o.scale is not None and o.size is not None:
        p.error("--scale beside --size; give one of the two")
    if not 0 <= o.mu <= 10:
        p.error(f"--mu {o.mu:g} must be from 0 to 10")
    if not 0.01 <= o.threshold <= 1:
        p.error(f"--threshold {o.threshold:g} must be from 0.01 to 1")
    if not 1 <= o.max_pieces <= limits()["GV_MAX_PIECES"] - 1:
        p.error(f"--max-pieces {o.max_pieces} must be from 1 to {limits()['GV_MAX_PIECES'] - 1}")
    if o.simplify is not None and o.simplify < 4:
        p.error(f"--simplify {o.simplify} must be 4 or more")


# ---- from the file to metres ----------------------------------------------------------------------

# Rotations that turn an axis of the mesh up: rows are the new x, y, z.
UPWARD = {"z": ((1, 0, 0), (0, 1, 0), (0, 0, 1)), "y": ((1, 0, 0), (0, 0, -1), (0, 1, 0)), "x": ((0, 0, -1), (0, 1, 0), (1, 0, 0)),
          "-z": ((1, 0, 0), (0, -1, 0), (0, 0, -1)), "-y": ((1, 0, 0), (0, 0, 1), (0, -1, 0)), "-x": ((0, 0, 1), (0, 1, 0), (-1, 0, 0))}


def likely_unit(extent):
    """(name, metres) of the unit in which a mesh of this extent is a thing for a hand; None where none does."""
    low, high = HANDY_M
    return next(((name, metres) for name, metres in UNITS if low <= extent * metres <= high), None)


def to_metres(mesh, o, stream):
    up = o.up or ("y" if mesh.path.lower().endswith((".gltf", ".glb")) else "z")
    if up != "z":
        mesh.vertex = mesh.vertex @ np.array(UPWARD[up], dtype=float).T + 0.0
    size = solid.extent(mesh)
    unit = likely_unit(size)
    scale = o.scale or (o.size / size if o.size else 1.0)
    if scale == "guess":
        if not unit:
            raise Fault(f"{mesh.path}: {size:.4g} units long, which is no thing for a hand in mm, cm, m or inches; give --size in metres")
        scale = unit[1]
        print(f"gloved-scene: --scale guess: {unit[0]} ({scale:g}), it is then {size * scale * 1e3:.0f} mm long", file=stream)
    mesh.vertex = mesh.vertex * scale
    extent = solid.extent(mesh)
    if not MIN_EXTENT_M <= extent <= MAX_EXTENT_M:
        likely = f"likely in {unit[0]}: give --scale {unit[1]:g}" if unit else "give --scale (0.001 for a mesh in millimetres)"
        raise Fault(f"{mesh.path}: {extent:.4g} m long; {likely}, or --size in metres")
    return scale


def warn_of_size(mesh, scale, mass, given, stream):
    """A thing that no hand holds is mostly a mesh in another unit. given: the mass is its owner's."""
    extent = solid.extent(mesh)
    if HANDY_M[0] / 3 <= extent <= HANDY_M[1] * 1.5 and (given or mass <= HANDY_KG):
        return
    text = f"{extent:.3g} m long and {mass:.3g} kg: "
    unit = likely_unit(extent / scale)
    if unit and unit[1] != scale:
        times = unit[1] / scale
        then = "" if given else f" and {mass * times ** 3:.2g} kg"
        text += f"likely the mesh is in {unit[0]} (--scale {unit[1]:g}: {extent * times * 1e3:.0f} mm{then})"
    elif not given and mass > HANDY_KG:
        text += f"more than a hand holds up; give --mass, or a smaller --size or --density"
    else:
        text += "no thing for a hand; give --size in metres"
    print(f"gloved-scene: {text}", file=stream)


def tell_parts(mesh, stream):
    part = np.bincount(solid.parts(mesh))
    if len(part) > 1:
        listed = ", ".join(map(str, sorted(part, reverse=True)[:6])) + (", ..." if len(part) > 6 else "")
        print(f"gloved-scene: {len(part)} separate parts ({listed} faces) become one rigid body; --repair keeps the largest alone", file=stream)


def check_counts(mesh):
    most = limits()
    for what, count, name in (("triangles", len(mesh.triangle), "GV_MAX_MESH_TRIANGLES"), ("vertices", len(mesh.vertex), "GV_MAX_VERTICES")):
        if count + 12 > most[name]:
            raise Fault(f"{mesh.path}: {count} {what}; at most {most[name] - 12} ({name}): give --simplify N")


# ---- the scene's text -----------------------------------------------------------------------------

def vector(values):
    """Shortest decimals that read back as the same bits."""
    return "[" + ", ".join(repr(float(x)) for x in values) + "]"


def piece_text(piece, number):
    """Corners that are vertices by their number, others by their place."""
    return "(" + ", ".join(str(number[key]) if (key := tuple(p)) in number else vector(p) for p in piece.corner) + ")"


def listing(key, rows, comment):
    return [f"    # {comment}", f"    {key} = (", *(f"      {row}{',' if i + 1 < len(rows) else ''}" for i, row in enumerate(rows)), "    );"]


def scene_text(c):
    """c: everything that was found, by name."""
    mesh, number = c["mesh"], {tuple(v): i for i, v in enumerate(c["mesh"].vertex)}
    J = c["inertia"]
    head = [f"# {c['name']}: compiled by gloved-scene from {c['source']} (sha256 {c['sha256']}).",
            f"# Options: {c['options']}",
            f"# {len(mesh.triangle)} triangles, {len(mesh.vertex)} vertices: the mesh as it came{c['changes']}.",
            f"# {len(c['pieces'])} convex pieces of {c['fewest']} to {c['most']} corners. Measured at points {c['step'] * 1e3:.2f} mm apart: "
            f"the mesh stands at most {c['missing'] * 1e3:.3f} mm",
            f"# out of the pieces, the pieces {c['extra'] * 1e3:.3f} mm out of the mesh. Volume: mesh {c['volume'] * 1e6:.3f} cm3, pieces together "
            f"{c['ratio']:.4f} times that.",
            "# Centre of mass and inertia are those of the mesh at uniform density.", "", "version = 1;", "", "objects = (", "  {",
            '    name = "table";', "    static = true;", "    mu = 0.8;", "    box = [1.2, 0.8, 0.04];",
            "    position = [0.0, 0.0, -0.02];", "  },", "  {",
            f'    name = "{c["name"]}";', f"    mass = {float(c['mass'])!r};", f"    mu = {float(c['mu'])!r};",
            f"    position = {vector(c['position'])};", f"    fit = {c['fit']!r};                 # m, the measured difference rounded up",
            f"    center = {vector(c['center'])};",
            f"    inertia = {vector((J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2]))};"]
    return "\n".join(head + listing("vertices", [vector(v) for v in mesh.vertex], "m")
                     + listing("triangles", ["[%d, %d, %d]" % tuple(t) for t in mesh.triangle], "counter-clockwise from outside")
                     + listing("pieces", [piece_text(p, number) for p in c["pieces"]], "corners of convex pieces: a vertex or a point")
                     + ["  }", ");", ""])


def write(path, text):
    """All or nothing."""
    partial = f"{path}.{os.getpid()}.part"
    try:
        with open(partial, "w") as f:
            f.write(text)
        os.replace(partial, path)
    except OSError as error:
        raise Fault(f"{path}: {error.strerror}; give a place that can be written") from None


# ---- one mesh -------------------------------------------------------------------------------------

def object_name(path):
    name = re.sub(r"[^A-Za-z0-9_.-]", "_", os.path.basename(path).removesuffix(".scene"))
    return name[:limits()["GV_MAX_NAME"] - 1] or "object"


def measure(mesh, pieces, step):
    """Errors, and whether the loader will take them."""
    volume = solid.mass_properties(mesh)[0]
    missing, extra = cutting.errors(mesh, pieces, step)
    fit = max(math.ceil((max(missing, extra) + 1e-6) * 1e5) / 1e5, 1e-5)
    if fit > MAX_FIT_M:
        raise Fault(f"{mesh.path}: pieces and mesh differ by {fit * 1e3:.1f} mm; give a smaller --threshold or more --max-pieces")
    a, b, c = solid.corners(mesh)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
    together = sum(p.volume for p in pieces)
    if abs(together - volume) > 0.01 * volume + fit * area:
        raise Fault(f"{mesh.path}: the pieces together have {together / volume:.2f} times its volume; give a smaller --threshold "
                    "or more --max-pieces")
    return {"missing": missing, "extra": extra, "fit": fit, "ratio": together / volume, "step": step}


def say(text, stream):
    if text:
        print(f"gloved-scene: {text}", file=stream)


def compile_mesh(o, stream):
    mesh = read(o.mesh)
    original = len(mesh.triangle)
    say(mesh.note, stream)
    if o.repair or o.hull:
        mesh = mending.hull(mesh) if o.hull else mending.repair(mesh, o.repair)
        say(mesh.note, stream)
    changed = mesh.note
    solid.check(mesh)
    tell_parts(mesh, stream)
    if o.simplify:
        mesh = cutting.simplify(mesh, o.simplify)
        solid.check(mesh)
    scale = to_metres(mesh, o, stream)
    check_counts(mesh)
    inside = solid.overlap(mesh)
    if inside is not None:
        print(f"gloved-scene: {mesh.where(inside)} lies inside another part; where parts overlap the mass counts twice", file=stream)
    if o.hull:
        pieces = [cutting.shape(mesh.vertex, solid.extent(mesh))]
    else:
        pieces = cutting.convex_pieces(mesh, o.threshold, o.max_pieces, inside is not None, stream)
    volume, center, inertia = solid.mass_properties(mesh)
    mass = o.mass or volume * (o.density or WOOD_KG_M3)
    warn_of_size(mesh, scale, mass, o.mass is not None, stream)
    low, high = mesh.vertex.min(axis=0), mesh.vertex.max(axis=0)
    position = (-(low[0] + high[0]) / 2, -(low[1] + high[1]) / 2, -low[2]) if o.place_on_table else (0, 0, 0)
    with open(o.mesh, "rb") as f:
        sha256 = hashlib.sha256(f.read()).hexdigest()[:16]
    changes = "".join([f", {changed}" if o.repair or o.hull else "", f", simplified from {original}" if o.simplify else "",
                       f", {o.up} turned up" if o.up and o.up != "z" else "",
                       f", times {scale:.6g}" if scale != 1 else ""])
    corners = [len(p.corner) for p in pieces]
    return {"mesh": mesh, "pieces": pieces, "name": object_name(o.out), "source": os.path.basename(o.mesh), "sha256": sha256,
            "options": describe(o), "changes": changes, "fewest": min(corners), "most": max(corners), "volume": volume,
            "center": center, "inertia": inertia * mass, "mass": mass, "mu": o.mu, "position": position,
            **measure(mesh, pieces, solid.extent(mesh) / STEPS)}


def describe(o):
    """The options that decide the result, without the names of files."""
    given = {k: v for k, v in vars(o).items() if k not in ("mesh", "out") and v is not None and v is not False}
    return " ".join(f"--{k.replace('_', '-')}" + ("" if v is True else f" {v:g}" if isinstance(v, float) else f" {v}") for k, v in given.items())


def main(argv):
    o = options(argv)
    try:
        c = compile_mesh(o, sys.stderr)
        write(o.out, scene_text(c))
    except Fault as fault:
        print(f"gloved-scene: {fault}", file=sys.stderr)
        return 2
    print(f"{o.out}: {len(c['mesh'].triangle)} triangles, {len(c['pieces'])} pieces of {c['fewest']} to {c['most']} corners, "
          f"{c['mass']:.3f} kg, {c['volume'] * 1e6:.1f} cm3; mesh out of pieces {c['missing'] * 1e3:.2f} mm, pieces out of mesh "
          f"{c['extra'] * 1e3:.2f} mm")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
