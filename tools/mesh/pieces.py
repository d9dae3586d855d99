# SPDX-License-Identifier: BSD-3-Clause
"""Convex pieces for a solid, from CoACD (Wei et al. 2022), thinned out, and how far they are from it.

CoACD cuts where a concavity would be felt. It gets the mesh simplified to a few thousand triangles (the cut is the
same and takes seconds); everything is then measured against the mesh itself.
"""
import os
import re
import sys
import threading
from dataclasses import replace

import coacd
import igl
import numpy as np
from scipy.spatial import ConvexHull, QhullError, cKDTree

from read import Fault, Mesh
from solid import extent, parts, spread

SEED = 1
CUT_TRIANGLES = 2000     # CoACD sees no more: the bunny takes 15 s at 2000, minutes at 69,666
CUT_ITERATIONS = 60      # of its tree search; 150 (its default) takes three times as long for the same count
CUT_RESOLUTION = 1000    # its sampling of surfaces
MAX_CORNERS = 96         # of a piece, far below GV_MAX_HULL_VERTICES: corners cost support climbing and small faces
MAX_POLYGON = 60         # corners of one face; GV_MAX_FACE_VERTICES is 64
SAME = 1e-3              # of the extent: a corner that juts out less is left out, a piece thinner than this too
SNAP = 5e-4              # of the extent: a cut corner this near to the mesh lies on it


class Piece:
    """A convex hull: its corners, planes n . x = d with outward normals, and outward triangles."""

    def __init__(self, points):
        hull = ConvexHull(points)
        keep = np.sort(hull.vertices)
        self.corner = points[keep]
        number = np.full(len(points), -1)
        number[keep] = np.arange(len(keep))
        self.normal, self.offset = hull.equations[:, :3], -hull.equations[:, 3]
        triangle = number[hull.simplices]
        a, b, c = (self.corner[triangle[:, k]] for k in range(3))
        inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), self.normal) < 0
        triangle[inward] = triangle[inward][:, ::-1]
        self.triangle = triangle
        self.volume = hull.volume
        self.low, self.high = self.corner.min(axis=0), self.corner.max(axis=0)

    def height(self, points):
        """Of points over the nearest plane from outside: 0 or less is inside."""
        return (points @ self.normal.T - self.offset).max(axis=1)

    def thickness(self):
        spread = self.corner @ self.normal.T
        return (spread.max(axis=0) - spread.min(axis=0)).min()

    def largest_polygon(self, tolerance):
        return int((np.abs(self.corner @ self.normal.T - self.offset) < tolerance).sum(axis=0).max())


# ---- progress -------------------------------------------------------------------------------------

class Progress:
    """What CoACD prints on descriptor 1 while it works, as one line that moves (a terminal) or a line per round."""

    def __init__(self, stream):
        self.stream, self.tty = stream, stream.isatty()

    def say(self, text):
        self.stream.write(f"\r  {text:<60}" if self.tty else f"  {text}\n")
        self.stream.flush()

    def end(self):
        if self.tty:
            self.stream.write("\r" + 62 * " " + "\r")
            self.stream.flush()

    def follow(self, pipe):
        parts = 0
        for line in os.fdopen(pipe, "r", errors="replace"):
            found = re.search(r"iter (\d+) ---- waiting pool: (\d+)", line)
            percent = re.search(r"Processing \[([\d.]+)%\]", line)
            if found:
                parts = int(found[2])
                self.say(f"cutting: round {int(found[1]) + 1}, {parts} parts still to look at")
            elif percent and self.tty:
                self.say(f"cutting: {parts} parts, {float(percent[1]):.0f} % of this round")
            elif "Merge" in line:
                self.say("cutting: joining what is convex together")

    def __enter__(self):
        sys.stdout.flush()
        reader, writer = os.pipe()
        self.saved = os.dup(1)
        os.dup2(writer, 1)
        os.close(writer)
        self.thread = threading.Thread(target=self.follow, args=(reader,))
        self.thread.start()

    def __exit__(self, *_):
        os.dup2(self.saved, 1)   # closes the pipe's last writer: the thread ends
        os.close(self.saved)
        self.thread.join()
        self.end()


# ---- simplification and cutting -------------------------------------------------------------------

def simplify(mesh, triangles):
    """Quadric edge collapse that stays closed and manifold; the count is met exactly or refused."""
    if triangles >= len(mesh.triangle):
        return mesh
    vertex, triangle, birth, _ = igl.qslim(mesh.vertex, mesh.triangle.astype(np.int32), triangles)
    triangle = np.asarray(triangle, dtype=np.int64)
    if len(triangle) != triangles:
        raise Fault(f"{mesh.path}: cannot be simplified to {triangles} triangles, only to {len(triangle)}; ask for an even number, or more")
    used = np.unique(triangle)
    number = np.full(len(vertex), -1)
    number[used] = np.arange(len(used))
    return Mesh(mesh.path, np.asarray(vertex)[used], number[triangle], mesh.face[birth], mesh.line[birth],
                np.zeros(len(used), dtype=int), mesh.note)


def cut(mesh, threshold, max_pieces, stream):
    """Point sets of convex pieces."""
    coarse = mesh
    if len(mesh.triangle) > CUT_TRIANGLES:
        try:
            coarse = simplify(mesh, CUT_TRIANGLES)
        except Fault:
            pass  # it stays as it came: slower, not worse
    coacd.set_log_level("info")
    with Progress(stream):
        found = coacd.run_coacd(coacd.Mesh(coarse.vertex, coarse.triangle.astype(np.int32)), threshold=threshold,
                                max_convex_hull=max_pieces, preprocess_mode="off", resolution=CUT_RESOLUTION,
                                mcts_iterations=CUT_ITERATIONS, merge=True, seed=SEED)
    return [np.asarray(points, dtype=float) for points, _ in found]


def cut_parts(mesh, threshold, max_pieces, stream):
    """The same for parts that overlap, one by one: what crosses itself, CoACD cannot cut."""
    part = parts(mesh)
    count = part.max() + 1
    if count == 1 or count > max_pieces:
        raise Fault(f"{mesh.path}: the surface crosses itself; unite its parts where it comes from (boolean union)")
    found = []
    for p in range(count):
        triangle = mesh.triangle[part == p]
        used, triangle = np.unique(triangle, return_inverse=True)
        one = replace(mesh, vertex=mesh.vertex[used], triangle=triangle.reshape(-1, 3))
        share = extent(mesh) / extent(one)  # CoACD measures concavity by the extent of what it gets
        found += cut(one, min(1.0, threshold * share), max_pieces // count, stream)
    return found


def snap(points, mesh):
    """CoACD's corners are off by some 5e-5 of the extent. Those that should be on the mesh go back onto it: to a vertex,
    an edge or a face, in this order, so that what is flat in the mesh is flat in the pieces."""
    reach = SNAP * extent(mesh)
    d2, face, nearest = igl.point_mesh_squared_distance(points, mesh.vertex, mesh.triangle)
    corner = mesh.vertex[mesh.triangle[face]]
    out = np.where(d2[:, None] < reach ** 2, nearest, points)
    for k in range(3):
        a, along = corner[:, k], corner[:, (k + 1) % 3] - corner[:, k]
        s = np.clip(np.einsum("ij,ij->i", points - a, along) / np.einsum("ij,ij->i", along, along), 0, 1)
        on_edge = a + s[:, None] * along
        out = np.where(np.linalg.norm(points - on_edge, axis=1)[:, None] < reach, on_edge, out)
    distance, vertex = cKDTree(mesh.vertex).query(points)
    return np.where(distance[:, None] < reach, mesh.vertex[vertex], out)


def first_four(points):
    """Indices of four points far from one plane."""
    pick = [int(points[:, 0].argmin())]
    d = np.linalg.norm(points - points[pick[0]], axis=1)
    pick.append(int(d.argmax()))
    along = (points[pick[1]] - points[pick[0]]) / d.max()
    off = points - points[pick[0]]
    off = off - np.outer(off @ along, along)
    pick.append(int(np.linalg.norm(off, axis=1).argmax()))
    normal = np.cross(along, off[pick[2]])
    pick.append(int(np.abs((points - points[pick[0]]) @ normal).argmax()))
    return pick


def thin(points, limit, tolerance):
    """The piece with few corners: the farthest point joins until no other one juts out by more than the tolerance."""
    whole = Piece(points)
    rest = whole.corner
    pick = first_four(rest)
    while True:
        piece = Piece(rest[pick])
        height = piece.height(rest)
        height[pick] = -np.inf
        far = int(height.argmax())
        if height[far] <= tolerance or len(pick) == limit:
            return piece
        pick.append(far)


def shape(points, size):
    """A piece within all limits, or None for a sliver."""
    try:
        if Piece(points).thickness() < SAME * size:
            return None
        for limit in (MAX_CORNERS, 80, MAX_POLYGON):
            piece = thin(points, limit, SAME / 4 * size)
            if piece.largest_polygon(1e-7 * size) <= MAX_POLYGON:
                return piece
    except QhullError:
        return None
    return piece


def convex_pieces(mesh, threshold, max_pieces, overlapping, stream):
    size = extent(mesh)
    found = (cut_parts if overlapping else cut)(mesh, threshold, max_pieces, stream)
    pieces = [p for p in (shape(snap(points, mesh), size) for points in found) if p]
    if not pieces:
        raise Fault(f"{mesh.path}: nothing left but slivers thinner than {SAME * size * 1e3:.2g} mm; gloved needs a solid "
                    "of some thickness")
    return pieces


# ---- error ----------------------------------------------------------------------------------------

def sample(vertex, triangle, step):
    """Every corner, and points spread over the triangles."""
    return np.concatenate([vertex, spread(vertex, triangle, step)[0]])


def beyond_pieces(points, pieces):
    """Distance of each point to the union of the pieces, 0 inside."""
    least = np.full(len(points), np.inf)
    for piece in pieces:
        box = np.linalg.norm(np.maximum(0, np.maximum(piece.low - points, points - piece.high)), axis=1)
        near = np.flatnonzero(box < least)
        inside = piece.height(points[near]) <= 0
        least[near[inside]] = 0
        out = near[~inside]
        if len(out):
            d2 = igl.point_mesh_squared_distance(points[out], piece.corner, piece.triangle)[0]
            least[out] = np.minimum(least[out], np.sqrt(d2))
    return least


def beyond_mesh(points, mesh):
    """Distance of each point to the solid, 0 inside."""
    turns = np.asarray(igl.fast_winding_number(mesh.vertex, mesh.triangle, points)).reshape(-1)
    out = np.flatnonzero(turns < 0.5)
    least = np.zeros(len(points))
    if len(out):
        least[out] = np.sqrt(igl.point_mesh_squared_distance(points[out], mesh.vertex, mesh.triangle)[0])
    return least


def errors(mesh, pieces, step):
    """(how far the mesh stands out of the pieces, how far the pieces stand out of the mesh): maxima over samples."""
    missing = beyond_pieces(sample(mesh.vertex, mesh.triangle, step), pieces).max()
    points = np.concatenate([sample(p.corner, p.triangle, step) for p in pieces])
    return float(missing), float(beyond_mesh(points, mesh).max())
