# SPDX-License-Identifier: BSD-3-Clause
"""Meshes in OFF, glTF and 3DS, by Assimp. It tells no lines and makes triangles of its own, so a face is named by its
number alone; all meshes of a file come as they stand in it."""
import numpy as np

import apart
from read import Builder, Fault


def load(path):
    """([n, 3] corners, [m, 3] triangles), in a child process."""
    import assimp_py
    steps = assimp_py.Process_Triangulate | assimp_py.Process_PreTransformVertices | assimp_py.Process_SortByPType
    corner, triangle, count = [np.zeros((0, 3))], [np.zeros((0, 3), dtype=np.int64)], 0
    for mesh in assimp_py.import_file(path, steps).meshes:
        if mesh.num_indices != 3 * mesh.num_faces:
            continue    # points or lines
        corner.append(np.array(mesh.vertices, dtype=float).reshape(-1, 3))
        triangle.append(np.array(mesh.indices, dtype=np.int64).reshape(-1, 3) + count)
        count += len(corner[-1])
    corner = np.concatenate(corner)
    if path.lower().endswith(".3ds"):  # Assimp turns its z into y: back to what the file says
        corner = corner[:, [0, 2, 1]] * (1, -1, 1) + 0.0
    return corner, np.concatenate(triangle)


def read_foreign(path, data):
    if not data:
        raise Fault(f"{path}: an empty file; export the mesh again")
    corner, triangle = apart.call(path, load, path)
    b = Builder(path)
    b.vertex, b.vertex_line = corner, [0] * len(corner)
    b.polygon, b.line = triangle.tolist(), [0] * len(triangle)
    return b.build()
