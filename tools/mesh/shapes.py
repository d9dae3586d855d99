# SPDX-License-Identifier: BSD-3-Clause
"""gloved-shapes: meshes of things to grasp. Closed surfaces by construction, without booleans: rings of vertices lofted
one to the next (surfaces of revolution, sweeps), polygons extruded, and openings in a loft that a tube grows out of.

Metres, z up, standing on z = 0 or to be placed on the table; triangles run counter-clockwise seen from outside.
"""
import os
import sys

import numpy as np


class Surface:
    """Vertices and polygons; quads of a loft are found again by (row, column)."""

    def __init__(self):
        self.vertex, self.face, self.quad = [], [], {}

    def add_ring(self, points):
        first = len(self.vertex)
        self.vertex += [np.asarray(p, dtype=float) for p in points]
        return list(range(first, len(self.vertex)))

    def join(self, low, high, row=None):
        """Walls between two rings of the same length, or a fan where one of them is a single point. Rings run
        counter-clockwise seen from the side of `high`."""
        n = max(len(low), len(high))
        for i in range(n):
            k = (i + 1) % n
            if len(low) == 1:
                self.face.append((low[0], high[k], high[i]))
            elif len(high) == 1:
                self.face.append((low[i], low[k], high[0]))
            else:
                self.quad[row, i] = len(self.face)
                self.face.append((low[i], low[k], high[k], high[i]))

    def loft(self, rings, closed=False):
        ids = [self.add_ring(r) for r in rings]
        for row in range(len(ids) - 1):
            self.join(ids[row], ids[row + 1], row)
        if closed:
            self.join(ids[-1], ids[0], len(ids) - 1)
        return self

    def open(self, rows, columns):
        """Takes quads out; returns the edge of the opening, as these quads ran around it."""
        gone = [self.quad[r, c] for r in rows for c in columns]
        edges = {}
        for f in gone:
            for a, b in zip(self.face[f], self.face[f][1:] + self.face[f][:1]):
                edges[a, b] = True
        after = {a: b for a, b in edges if (b, a) not in edges}
        for f in gone:
            self.face[f] = None
        loop = [min(after)]
        while after[loop[-1]] != loop[0]:
            loop.append(after[loop[-1]])
        return loop

    def turn(self, loop, ring):
        """The ring's vertices in the order that lies nearest to the loop."""
        place = np.array([self.vertex[v] for v in loop])
        return min((ring[k:] + ring[:k] for k in range(len(ring))),
                   key=lambda r: ((np.array([self.vertex[v] for v in r]) - place).sum(axis=0) ** 2).sum()
                   + ((np.array([self.vertex[v] for v in r]) - place) ** 2).sum())

    def grow(self, loop, rings, end):
        """A tube out of an opening through the rings into `end`: another opening, or a single point."""
        for points in rings:
            ring = self.turn(loop, self.add_ring(points))
            self.join(loop, ring)
            loop = ring
        if isinstance(end, list):
            self.join(loop, self.turn(loop, end[::-1]))
        else:
            self.join(loop, self.add_ring([end]))
        return self

    def triangles(self):
        """(vertices, triangles), unused vertices left out."""
        triangle = np.array([(f[0], f[k], f[k + 1]) for f in self.face if f for k in range(1, len(f) - 1)])
        used = np.unique(triangle)
        number = np.full(len(self.vertex), -1)
        number[used] = np.arange(len(used))
        return np.array(self.vertex)[used], number[triangle]


# ---- rings ----------------------------------------------------------------------------------------

def circle(radius, z, n, flute=0.0, lobes=0):
    """A ring about z; a flute of 0.1 lets the radius wave by a tenth, `lobes` times around."""
    a = 2 * np.pi * np.arange(n) / n
    r = radius * (1 + flute * np.cos(lobes * a))
    return np.column_stack([r * np.cos(a), r * np.sin(a), np.full(n, z)])


def lathe(profile, n=32, closed=False, flute=0.0, lobes=0):
    """Surface of revolution of (radius, z) points, from the axis up and back to it; closed: around a hole."""
    return Surface().loft([[(0, 0, z)] if r == 0 else circle(r, z, n, flute, lobes) for r, z in profile], closed)


def arc(center, radius, start_deg, end_deg, n):
    """n points on an arc, as (x, y) pairs."""
    a = np.radians(np.linspace(start_deg, end_deg, n))
    return [(center[0] + radius * np.cos(t), center[1] + radius * np.sin(t)) for t in a]


def tube_rings(path, radius, n, side):
    """Rings along a path that lies in a plane with the normal `side`."""
    path, side = np.asarray(path, dtype=float), np.asarray(side, dtype=float)
    along = np.gradient(path, axis=0)
    along /= np.linalg.norm(along, axis=1)[:, None]
    a = 2 * np.pi * np.arange(n) / n
    radius = np.broadcast_to(radius, len(path))
    return [p + r * (np.outer(np.cos(a), side) + np.outer(np.sin(a), np.cross(t, side)))
            for p, t, r in zip(path, along, radius)]


def clip_ears(polygon):
    """Triangles of a simple polygon that runs counter-clockwise."""
    p, left, out = np.asarray(polygon, dtype=float), list(range(len(polygon))), []

    def turn(i, j, k):
        (ax, ay), (bx, by) = p[j] - p[i], p[k] - p[i]
        return ax * by - ay * bx

    while len(left) > 3:
        for at in range(len(left)):
            i, j, k = left[at - 1], left[at], left[(at + 1) % len(left)]
            if turn(i, j, k) > 1e-12 and not any(min(turn(i, j, m), turn(j, k, m), turn(k, i, m)) >= 0
                                                 for m in left if m not in (i, j, k)):
                out.append((i, j, k))
                left.pop(at)
                break
        else:
            raise ValueError("the outline crosses itself")
    return out + [tuple(left)]


def extrude(outline, thickness):
    """A plate in the plane of x and z, standing."""
    s = Surface()
    n = len(outline)
    back = s.add_ring([(x, thickness / 2, z) for x, z in outline])
    front = s.add_ring([(x, -thickness / 2, z) for x, z in outline])
    s.join(back, front)
    for a, b, c in clip_ears(outline):
        s.face += [(front[a], front[b], front[c]), (back[c], back[b], back[a])]
    assert n == len(front)
    return s


# ---- things ---------------------------------------------------------------------------------------

def torus():
    """Standing as a wheel that a hand grips through; it rests on a facet of both circles."""
    s = lathe(arc((0.06, 0), 0.013, 11.25, 348.75, 16), 48, closed=True)
    half = np.pi / 48
    for i, (x, y, z) in enumerate(s.vertex):
        s.vertex[i] = np.array([x * np.cos(half) - y * np.sin(half), -z, x * np.sin(half) + y * np.cos(half)])
    return s


def ring():
    return lathe([(0.026, 0.003), (0.029, 0), (0.033, 0.003), (0.035, 0.03), (0.033, 0.057), (0.029, 0.06), (0.026, 0.057)],
                 48, closed=True)


def bottle():
    return lathe([(0, 0), (0.026, 0), (0.03, 0.004), (0.03, 0.1), (0.028, 0.112), (0.014, 0.132), (0.012, 0.14),
                  (0.012, 0.165), (0.014, 0.166), (0.014, 0.18), (0, 0.18)])


def cup():
    return lathe([(0, 0), (0.024, 0), (0.026, 0.002), (0.034, 0.09), (0.032, 0.09), (0.0235, 0.006), (0, 0.006)], 48)


def bowl():
    a = np.radians(np.arange(-60, 1, 10))
    outer = [(0.036 * np.cos(t), 0.07 + 0.07 * np.sin(t) / np.sin(np.pi / 3)) for t in a]
    inner = [(0.032 * np.cos(t), 0.07 + 0.064 * np.sin(t) / np.sin(np.pi / 3)) for t in a[::-1]]
    return lathe([(0, 0), *outer, *inner, (0, inner[-1][1])], 48)


def cone():
    return lathe([(0, 0), (0.032, 0), (0.033, 0.002), (0.02, 0.12), (0.018, 0.122), (0, 0.122)], 40)


def pawn():
    return lathe([(0, 0), (0.026, 0), (0.028, 0.006), (0.027, 0.014), (0.02, 0.02), (0.014, 0.04), (0.011, 0.07),
                  (0.02, 0.075), (0.012, 0.08), *arc((0, 0.094), 0.018, -45, 75, 9), (0, 0.112)])


def dumbbell():
    return lathe([(0, 0), (0.03, 0), (0.032, 0.004), (0.032, 0.022), (0.028, 0.027), (0.014, 0.03), (0.013, 0.06),
                  (0.014, 0.09), (0.028, 0.093), (0.032, 0.098), (0.032, 0.116), (0.03, 0.12), (0, 0.12)])


def star_knob():
    return lathe([(0, 0), (0.016, 0), (0.016, 0.03), (0.03, 0.034), (0.032, 0.04), (0.032, 0.062), (0.029, 0.068),
                  (0, 0.07)], 60, flute=0.14, lobes=5)


def screwdriver():
    """Standing on its handle; the blade's end is flat."""
    s = lathe([(0, 0), (0.014, 0), (0.017, 0.004), (0.018, 0.05), (0.016, 0.09), (0.011, 0.1), (0.004, 0.104),
               (0.004, 0.17), (0.0045, 0.18), (0.0045, 0.195), (0, 0.195)], 36, flute=0.06, lobes=6)
    for v in s.vertex:
        if v[2] > 0.16:
            v[1] *= max(0.25, 1 - (v[2] - 0.16) / 0.03)
    return s


def dice():
    """A cube with rounded edges: a grid on the cube, pushed onto the surface at one radius around a smaller cube."""
    half, radius, n = 0.03, 0.007, 6
    inner = half - radius
    grid = np.concatenate([[-half], np.linspace(-inner, inner, n - 1), [half]])
    s, number = Surface(), {}

    def vertex(p):
        if p not in number:
            core = np.clip(p, -inner, inner)
            out = np.array(p) - core
            number[p] = s.add_ring([core + radius * out / np.linalg.norm(out) + [0, 0, half]])[0]
        return number[p]

    for axis in range(3):
        for side in (-half, half):
            for i in range(n):
                for k in range(n):
                    corner = []
                    for u, v in ((i, k), (i + 1, k), (i + 1, k + 1), (i, k + 1)):
                        p = [0.0, 0.0, 0.0]
                        p[axis], p[axis - 2], p[axis - 1] = side, grid[u], grid[v]
                        corner.append(vertex(tuple(p)))
                    s.face.append(tuple(corner if side > 0 else corner[::-1]))
    return s


def wrench():
    """Open at one end, standing on it."""
    jaw = [(-0.008, 0), (-0.008, 0.022), (0.008, 0.022), (0.008, 0)]
    right = [(0.014, 0), (0.021, 0.008), (0.023, 0.018), (0.019, 0.032), (0.011, 0.042), (0.009, 0.05), (0.009, 0.14)]
    end = arc((0, 0.15), 0.014, -40, 220, 12)
    left = [(-x, z) for x, z in reversed(right)]
    return extrude(jaw[2:] + right + end + left + jaw[:2], 0.016)


def octagon(radius, z, n):
    """A square ring with cut corners."""
    ring = circle(radius, z, n)
    x, y = np.abs(ring[:, 0]), np.abs(ring[:, 1])
    ring[:, :2] *= (radius / np.maximum(np.maximum(x, y), (x + y) / 1.5))[:, None]
    return ring


def hammer():
    """Standing on its head, the handle up: a tube out of an opening in the head's side."""
    n, rows = 32, 12
    z = np.linspace(-0.035, 0.035, rows + 1)
    radius = np.where(np.abs(z) > 0.015, 0.016, 0.013)
    head = Surface().loft([[(0, 0, z[0])], *[octagon(r, h, n) for r, h in zip(radius, z)], [(0, 0, z[-1])]])
    # The head's axis along x; column 0 then looks up. Rows count from the first apex on.
    loop = head.open(range(5, 9), [n - 2, n - 1, 0, 1])
    for i, v in enumerate(head.vertex):
        head.vertex[i] = np.array([v[2], v[1], v[0]]) * [-1, 1, 1]
    path = [(0, 0, h) for h in (0.03, 0.05, 0.09, 0.13, 0.15)]
    rings = tube_rings(path, [0.009, 0.011, 0.013, 0.012, 0.011], 16, (0, 1, 0))
    return head.grow(loop, rings, (0, 0, 0.153))


def mug():
    """Its handle leaves the wall and comes back to it."""
    n = 64
    wall = [(0.038, 0.003 + 0.0035 * i) for i in range(25)]
    s = lathe([(0, 0), (0.035, 0), *wall, (0.0365, 0.0885), (0.035, 0.087), (0.034, 0.01), (0.031, 0.006), (0, 0.006)], n)
    low, high = s.open(range(5, 9), [n - 2, n - 1, 0, 1]), s.open(range(18, 22), [n - 2, n - 1, 0, 1])
    path = [(0.038 + 0.026 * np.cos(a), 0, 0.047 + 0.024 * np.sin(a)) for a in np.radians(np.linspace(-62, 62, 11))]
    return s.grow(low, tube_rings(path, 0.0065, 16, (0, 1, 0)), high)


THINGS = {f.__name__: f for f in (torus, ring, bottle, mug, cup, bowl, hammer, screwdriver, wrench, dice, cone, star_knob,
                                  dumbbell, pawn)}


def obj_text(name, vertex, triangle):
    return "\n".join([f"# {name}, made by gloved-shapes: metres, z up"] + ["v %.9g %.9g %.9g" % tuple(v) for v in vertex]
                     + ["f %d %d %d" % tuple(t + 1) for t in triangle] + [""])


def main(argv):
    if not argv or argv[0].startswith("-"):
        print(f"usage: gloved-shapes DIRECTORY [NAME...]\nnames: {' '.join(THINGS)}")
        return 0 if argv else 2
    for name in argv[1:] or THINGS:
        if name not in THINGS:
            print(f"gloved-shapes: no shape is named {name}; there are {' '.join(THINGS)}", file=sys.stderr)
            return 2
        os.makedirs(argv[0], exist_ok=True)
        with open(os.path.join(argv[0], name + ".obj"), "w") as f:
            f.write(obj_text(name, *THINGS[name]().triangles()))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
