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
import solid
from read import Fault, read

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
WOOD_KG_M3 = 700.0
MAX_EXTENT_M, MIN_EXTENT_M = 2.0, 0.002   # what a hand can do something with
MAX_FIT_M = 0.01                          # of the loader
STEPS = 150                               # samples of the difference along the extent


def limits():
    """GV_MAX_... as the loader has them."""
    with open(os.path.join(ROOT, "include/gloved/limits.h")) as f:
        return {name: int(value) for name, value in re.findall(r"(GV_MAX_\w+) = (\d+)", f.read())}


def options(argv):
    p = argparse.ArgumentParser(prog="gloved-scene", description="A triangle mesh to a scene that gloved can load: convex pieces, "
                                "mass properties and the mesh itself, on a table.")
    p.add_argument("mesh", metavar="MESH", help="a closed surface in .obj, .stl or .ply")
    p.add_argument("-o", dest="out", metavar="OUT.scene", required=True, help="the scene; its name is the object's")
    p.add_argument("--mass", type=float, metavar="KG", help="of the object")
    p.add_argument("--density", type=float, metavar="KG_M3", help=f"in place of --mass (default {WOOD_KG_M3:.0f}, wood)")
    p.add_argument("--mu", type=float, default=0.8, help="friction coefficient (default 0.8)")
    p.add_argument("--scale", type=float, metavar="S", help="metres per unit of the mesh (default 1; 0.001 for millimetres)")
    p.add_argument("--size", type=float, metavar="M", help="in place of --scale: the longest side in metres")
    p.add_argument("--up", choices="yz", default="z", help="axis of the mesh that points up (default z)")
    p.add_argument("--place-on-table", action="store_true", help="move it over the origin and onto the table (z = 0)")
    p.add_argument("--simplify", type=int, metavar="N", help="to exactly N triangles first")
    p.add_argument("--max-pieces", type=int, default=64, metavar="N", help="convex pieces at most (default 64)")
    p.add_argument("--threshold", type=float, default=0.05, metavar="T",
                   help="concavity that CoACD leaves, of half the longest side: 0.01 fine to 1 coarse (default 0.05)")
    o = p.parse_args(argv)
    check_options(p, o)
    return o


def check_options(p, o):
    for name in ("mass", "density", "scale", "size"):
        value = getattr(o, name)
        if value is not None and not (value > 0 and math.isfinite(value)):
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

def to_metres(mesh, o):
    if o.up == "y":
        x, y, z = mesh.vertex.T
        mesh.vertex = np.column_stack([x, -z + 0.0, y])
    scale = o.scale or (o.size / solid.extent(mesh) if o.size else 1.0)
    mesh.vertex = mesh.vertex * scale
    extent = solid.extent(mesh)
    if not MIN_EXTENT_M <= extent <= MAX_EXTENT_M:
        raise Fault(f"{mesh.path}: {extent:.4g} m long; give --scale (0.001 for a mesh in millimetres), or --size in metres")
    return scale


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


def compile_mesh(o, stream):
    mesh = read(o.mesh)
    solid.check(mesh)
    if mesh.note:
        print(f"gloved-scene: {mesh.note}", file=stream)
    original = len(mesh.triangle)
    if o.simplify:
        mesh = cutting.simplify(mesh, o.simplify)
        solid.check(mesh)
    scale = to_metres(mesh, o)
    check_counts(mesh)
    inside = solid.overlap(mesh)
    if inside is not None:
        print(f"gloved-scene: {mesh.where(inside)} lies inside another part; where parts overlap the mass counts twice", file=stream)
    pieces = cutting.convex_pieces(mesh, o.threshold, o.max_pieces, inside is not None, stream)
    volume, center, inertia = solid.mass_properties(mesh)
    mass = o.mass or volume * (o.density or WOOD_KG_M3)
    low, high = mesh.vertex.min(axis=0), mesh.vertex.max(axis=0)
    position = (-(low[0] + high[0]) / 2, -(low[1] + high[1]) / 2, -low[2]) if o.place_on_table else (0, 0, 0)
    with open(o.mesh, "rb") as f:
        sha256 = hashlib.sha256(f.read()).hexdigest()[:16]
    changes = "".join([f", simplified from {original}" if o.simplify else "", ", y turned up" if o.up == "y" else "",
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
