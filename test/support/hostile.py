# SPDX-License-Identifier: BSD-3-Clause
"""A scene that is sound in every line and slow to check: a box whose sides are divided into small triangles, filled by as many
round pieces as a scene may have, each near every triangle."""
import math


def box_mesh(n):
    """Vertices and triangles of a cube of 0.1 m whose sides are n by n squares."""
    index, vertices, triangles = {}, [], []

    def vertex(p):
        if p not in index:
            index[p] = len(vertices)
            vertices.append([x * 0.1 / n for x in p])
        return index[p]

    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for side in (0, n):
            for i in range(n):
                for k in range(n):
                    corner = []
                    for a, b in ((0, 0), (1, 0), (1, 1), (0, 1)):
                        p = [0, 0, 0]
                        p[axis], p[u], p[v] = side, i + a, k + b
                        corner.append(vertex(tuple(p)))
                    if side == 0:
                        corner.reverse()
                    triangles += [[corner[0], corner[1], corner[2]], [corner[0], corner[2], corner[3]]]
    return vertices, triangles


def ball(n, radius):
    """n points on a sphere around the middle of the cube."""
    golden = math.pi * (3 - math.sqrt(5))
    points = []
    for i in range(n):
        z = 1 - (2 * i + 1) / n
        r = math.sqrt(1 - z * z)
        points.append([0.05 + radius * r * math.cos(golden * i), 0.05 + radius * r * math.sin(golden * i), 0.05 + radius * z])
    return points


def write(path, n=100, pieces=250, points=60):
    vertices, triangles = box_mesh(n)
    text = lambda rows, form: ",\n".join("[" + ", ".join(form % x for x in row) + "]" for row in rows)
    whole = [[x, y, z] for x in (0.0, 0.1) for y in (0.0, 0.1) for z in (0.0, 0.1)]
    shapes = [whole] + [ball(points, 0.049 - 1e-6 * i) for i in range(pieces - 1)]
    with open(path, "w", encoding="ascii") as file:
        file.write('version = 1;\nobjects = ( { name = "hostile"; mass = 0.2;\nvertices = (' + text(vertices, "%.9f") + ");\ntriangles = (" + text(triangles, "%d") + ");\npieces = (")
        file.write(",\n".join("(" + text(shape, "%.9f") + ")" for shape in shapes))
        file.write(");\n} );\n")
