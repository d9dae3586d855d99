# SPDX-License-Identifier: BSD-3-Clause
"""Makes a solid of a mesh that is none: holes are closed, faces that are doubled, cross each other or meet at an edge in
threes are mended (MeshFix, Attene 2010), part by part; or its convex hull. Every change is said in words."""
import numpy as np
from scipy.spatial import ConvexHull, QhullError

import apart
import solid
from read import Fault, Mesh


def make_mesh(like, vertex, triangle, note):
    """Faces are numbered anew: those of the file are gone."""
    used, number = np.unique(triangle, return_inverse=True)
    count = len(triangle)
    return Mesh(like.path, np.asarray(vertex, dtype=float)[used], number.reshape(-1, 3), np.arange(1, count + 1),
                np.zeros(count, dtype=int), np.zeros(len(used), dtype=int), note)


def faults(mesh):
    """In words: what stands against a solid, counted."""
    edge = np.sort(np.stack([mesh.triangle, np.roll(mesh.triangle, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    meets = np.unique(edge, axis=0, return_counts=True)[1]
    doubled = len(mesh.triangle) - len(np.unique(np.sort(mesh.triangle, axis=1), axis=0))
    told = [((meets == 1).sum(), "open edges"), ((meets > 2).sum(), "edges of three or more faces"), (doubled, "doubled faces")]
    return ", ".join(f"{count} {what}" for count, what in told if count)


def mend(vertex, triangle):
    """One part, in a child process."""
    import pymeshfix
    fix = pymeshfix.MeshFix(vertex, triangle.astype(np.int32))
    fix.repair()
    return np.asarray(fix.points, dtype=float), np.asarray(fix.faces, dtype=np.int64).reshape(-1, 3)


def mend_part(mesh, triangle):
    """(vertices, triangles) of a part turned outward; None where nothing solid is left of it."""
    used, number = np.unique(triangle, return_inverse=True)
    vertex, faces = apart.call(mesh.path, mend, mesh.vertex[used], number.reshape(-1, 3))
    if len(faces) < 4:
        return None
    made = make_mesh(mesh, vertex, faces, "")
    volume = solid.volumes(made).sum()
    if abs(volume) <= solid.NO_VOLUME * solid.extent(mesh) ** 3:
        return None
    return made.vertex, made.triangle if volume > 0 else made.triangle[:, ::-1]


def repair(mesh, keep):
    """keep: "largest", the part with the most surface, or "all" parts."""
    part = solid.parts(mesh)
    a, b, c = solid.corners(mesh)
    surface = np.bincount(part, weights=np.linalg.norm(np.cross(b - a, c - a), axis=1))
    order = np.argsort(-surface, kind="stable")
    found = [mend_part(mesh, mesh.triangle[part == p]) for p in (order[:1] if keep == "largest" else order)]
    solids = [f for f in found if f]
    if not solids:
        raise Fault(f"{mesh.path}: nothing solid is left after the repair: its faces enclose no volume; give it a thickness, "
                    "or take --hull")
    first = np.cumsum([0] + [len(v) for v, _ in solids])
    told = [f"{faults(mesh) or 'nothing'} mended"]
    if len(order) > 1:
        told.append(f"the largest of {len(order)} parts kept ({(part == order[0]).sum()} of {len(part)} faces)" if keep == "largest"
                    else f"{len(solids)} of {len(order)} parts kept")
    out = make_mesh(mesh, np.concatenate([v for v, _ in solids]),
                    np.concatenate([t + n for (_, t), n in zip(solids, first)]), "")
    out.note = f"repaired: {', '.join(told)}; {len(out.triangle)} faces now, {len(mesh.triangle)} before"
    return out


def hull(mesh):
    """The convex hull's triangles, counter-clockwise from outside."""
    try:
        found = ConvexHull(mesh.vertex)
    except (QhullError, ValueError):
        raise Fault(f"{mesh.path}: all of it lies in one plane, so it has no hull; give it a thickness") from None
    triangle = found.simplices.astype(np.int64)
    a, b, c = (mesh.vertex[triangle[:, k]] for k in range(3))
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), found.equations[:, :3]) < 0
    triangle[inward] = triangle[inward][:, ::-1]
    note = f"convex hull: {len(triangle)} faces in place of {len(mesh.triangle)}"
    volume = solid.volumes(mesh).sum()
    if volume > 0 and not faults(mesh):
        note += f", {found.volume / volume:.2f} times the volume"
    return make_mesh(mesh, mesh.vertex, triangle, note)
