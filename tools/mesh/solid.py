# SPDX-License-Identifier: BSD-3-Clause
"""Is a triangle mesh the surface of a solid? And if so, its volume, centre of mass and inertia, exactly.

Closed and manifold: two triangles at every edge, running along it in opposite directions; one fan of triangles around
every vertex. Mass: integrals over the signed tetrahedra between a point and the triangles, as in src/collision/hull.c.
"""
import igl
import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

NO_AREA = 2e-9     # of the longest edge squared; the loader refuses 1e-9
NO_VOLUME = 1e-12  # of the extent cubed
OVERLAP = 1e-3     # of the surface


def corners(mesh):
    return (mesh.vertex[mesh.triangle[:, k]] for k in range(3))


def extent(mesh):
    return float((mesh.vertex.max(axis=0) - mesh.vertex.min(axis=0)).max())


def check_areas(mesh):
    a, b, c = corners(mesh)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    longest = np.max([((b - a) ** 2).sum(1), ((c - b) ** 2).sum(1), ((a - c) ** 2).sum(1)], axis=0)
    flat = area <= NO_AREA * longest
    if flat.any():
        raise mesh.fault(int(flat.argmax()), "no area: its corners lie on one line; move one, or remove the face and close the gap")


def place(mesh, v):
    return "(" + ", ".join(f"{x:.6g}" for x in mesh.vertex[v]) + ")"


def check_edges(mesh):
    """Every edge twice, once in each direction."""
    start, end = mesh.triangle.reshape(-1), np.roll(mesh.triangle, -1, axis=1).reshape(-1)
    owner = np.repeat(np.arange(len(mesh.triangle)), 3)
    low, high = np.minimum(start, end), np.maximum(start, end)
    _, edge, count = np.unique(low * len(mesh.vertex) + high, return_inverse=True, return_counts=True)
    at = count[edge]

    def name(i):
        return f"between {place(mesh, start[i])} and {place(mesh, end[i])}"

    if (at == 1).any():
        i = int((at == 1).argmax())
        raise mesh.fault(owner[i], f"a hole: its edge {name(i)} has no face on the other side ({(at == 1).sum()} such edges "
                         "in all); close the mesh, or let --repair do it")
    if (at > 2).any():
        i = int((at > 2).argmax())
        others = ", ".join(str(mesh.face[t]) for t in owner[edge == edge[i]] if t != owner[i])
        raise mesh.fault(owner[i], f"not manifold: its edge {name(i)} also belongs to faces {others}; two must meet at an edge: mend it, or let --repair do it")
    forward = np.bincount(edge, weights=np.where(start < end, 1, 0))
    clash = forward[edge] != 1
    if clash.any():
        flips = np.bincount(owner[clash], minlength=len(mesh.triangle))
        t = int(flips.argmax())
        i = int(np.flatnonzero(clash & (owner == t))[0])
        other = next(u for u in owner[edge == edge[i]] if u != t)
        raise mesh.fault(t, f"its corners run against those of its neighbour, face {mesh.face[other]} ({clash.sum() // 2} such "
                         "edges in all); turn the faces so that all run counter-clockwise seen from outside, or let --repair do it")


def check_vertices(mesh):
    good = igl.is_vertex_manifold(mesh.triangle)
    good = np.asarray(good[0] if isinstance(good, tuple) else good).reshape(-1)
    if not good.all():
        v = int((~good.astype(bool)).argmax())
        t = int((mesh.triangle == v).any(axis=1).argmax())
        raise mesh.fault(t, f"not manifold: parts of the surface touch in its corner {place(mesh, v)} alone; move them apart, or let --repair do it")


def volumes(mesh):
    """Of each triangle's signed tetrahedron."""
    origin = mesh.vertex.mean(axis=0)
    a, b, c = (p - origin for p in corners(mesh))
    return np.einsum("ij,ij->i", a, np.cross(b, c)) / 6


def parts(mesh):
    """The connected part of each triangle."""
    t, n = mesh.triangle, len(mesh.vertex)
    pairs = coo_matrix((np.ones(2 * len(t)), (np.r_[t[:, 0], t[:, 1]], np.r_[t[:, 1], t[:, 2]])), shape=(n, n))
    return connected_components(pairs, directed=False)[1][t[:, 0]]


def check_outward(mesh):
    """No part without volume, and none inside out; a part that bounds a hollow inside another one may be."""
    part = parts(mesh)
    total = np.bincount(part, weights=volumes(mesh))
    for p in np.flatnonzero(total <= NO_VOLUME * extent(mesh) ** 3):
        t = int((part == p).argmax())
        joined = f"it and the {(part == p).sum() - 1} faces joined with it"
        if abs(total[p]) <= NO_VOLUME * extent(mesh) ** 3:
            raise mesh.fault(t, f"{joined} enclose no volume: a sheet, not a solid; give it a thickness")
        outer = mesh.triangle[part != p]
        inside = len(outer) and igl.winding_number(mesh.vertex, outer, mesh.vertex[mesh.triangle[t, :1]])[0] > 0.5
        if not inside:
            raise mesh.fault(t, f"{joined} are inside out; turn all of them, so that their corners run counter-clockwise "
                             "seen from outside")


def check(mesh):
    """Raises the first fault, with its face."""
    check_areas(mesh)
    check_edges(mesh)
    check_vertices(mesh)
    check_outward(mesh)


def spread(vertex, triangle, step):
    """The middle of every triangle, and as many points over it as it has squares of step x step (the R2 sequence, folded
    into the triangle). Returns the points and the triangle of each."""
    a, b, c = (vertex[triangle[:, k]] for k in range(3))
    count = (np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2 / step ** 2).astype(int)
    t = np.repeat(np.arange(len(triangle)), count)
    k = np.arange(len(t)) + 1.0
    u, v = 0.7548776662466927 * k % 1, 0.5698402909980532 * k % 1
    over = u + v > 1
    u, v = np.where(over, 1 - u, u)[:, None], np.where(over, 1 - v, v)[:, None]
    points = np.concatenate([(a + b + c) / 3, a[t] + u * (b - a)[t] + v * (c - a)[t]])
    return points, np.concatenate([np.arange(len(triangle)), t])


def overlap(mesh):
    """A triangle that lies inside another part of the mesh, or None: just inside of it the surface winds twice. A few
    folded triangles (scans have them where holes were filled) do not count."""
    points, t = spread(mesh.vertex, mesh.triangle, extent(mesh) / 50)
    a, b, c = corners(mesh)
    normal = np.cross(b - a, c - a)
    area = np.linalg.norm(normal, axis=1)
    inside = points - 1e-6 * extent(mesh) * (normal / area[:, None])[t]
    double = np.asarray(igl.fast_winding_number(mesh.vertex, mesh.triangle, inside)).reshape(-1) > 1.5
    share = area[t] / np.bincount(t)[t]
    return int(t[double].min()) if share[double].sum() > OVERLAP * area.sum() else None


def mass_properties(mesh):
    """(volume, centre of mass, inertia about it per mass): units of the mesh to the 3rd, 1st and 2nd power."""
    origin = mesh.vertex.mean(axis=0)
    p = [q - origin for q in corners(mesh)]
    v = volumes(mesh)
    total = v.sum()
    whole = sum(p)
    first = np.einsum("i,ij->j", v, whole) / 4 / total
    # Integral of x_i x_k over a tetrahedron with one corner in the origin: v / 20 (sum over corners + (sum)(sum)).
    second = sum(np.einsum("i,ij,ik->jk", v, q, q) for q in (*p, whole)) / 20 / total - np.outer(first, first)
    return total, origin + first, np.trace(second) * np.eye(3) - second
