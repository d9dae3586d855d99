# SPDX-License-Identifier: BSD-3-Clause
"""Triangle meshes from OBJ, STL (text and binary) and PLY (text and binary) files; foreign.py reads other kinds.

Every face keeps its number in the file, counted from 1, and its line, so that a fault can be named where its owner
finds it. Corners in the same place become one vertex (an STL has no others); polygons become fans of triangles.
"""
import struct
from dataclasses import dataclass

import numpy as np


FARTHEST = 1e12   # units of the file: the squares and cubes of all that is nearer are numbers


class Fault(Exception):
    """What is wrong with the input, where, and what to do: one line."""


@dataclass
class Mesh:
    path: str
    vertex: np.ndarray       # [n, 3] float64, units of the file
    triangle: np.ndarray     # [m, 3] into vertex
    face: np.ndarray         # [m] number of the triangle's face in the file, from 1
    line: np.ndarray         # [m] its line, 0 in a binary file
    vertex_line: np.ndarray  # [n] likewise
    note: str = ""           # what was left out

    def where(self, t):
        """Where triangle t stands: the opening words of a message."""
        line = f"{self.line[t]}:" if self.line[t] else ""
        return f"{self.path}:{line} face {self.face[t]}"

    def fault(self, t, text):
        return Fault(f"{self.where(t)}: {text}")


class Builder:
    """Collects vertices and polygons as a file lists them."""

    def __init__(self, path):
        self.path, self.vertex, self.vertex_line = path, [], []
        self.polygon, self.line = [], []

    def at(self, line):
        return f"{self.path}:{line}:" if line else f"{self.path}:"

    def add_vertex(self, words, line=0):
        try:
            self.vertex.append((float(words[0]), float(words[1]), float(words[2])))
        except (ValueError, IndexError, TypeError):
            raise Fault(f"{self.at(line)} vertex {len(self.vertex) + 1} is not three numbers ({' '.join(map(str, words))[:40]}); "
                        "write x y z, or export the mesh again") from None
        self.vertex_line.append(line)

    def add_face(self, corners, line=0):
        if len(corners) < 3:
            raise Fault(f"{self.at(line)} face {len(self.polygon) + 1} has {len(corners)} corners; give it at least 3")
        # A number beyond every file becomes -1, which check_indices refuses.
        self.polygon.append([c if 0 <= c < 2**31 else -1 for c in corners])
        self.line.append(line)

    def fan(self):
        """Triangles, with the polygon of each."""
        corner, owner = [], []
        for i, polygon in enumerate(self.polygon):
            for k in range(1, len(polygon) - 1):
                corner.append((polygon[0], polygon[k], polygon[k + 1]))
                owner.append(i)
        return np.array(corner, dtype=np.int64), np.array(owner)

    def build(self):
        if not self.polygon:
            raise Fault(f"{self.path}: no faces in it; export the mesh as triangles")
        vertex = np.array(self.vertex, dtype=float).reshape(-1, 3) + 0.0  # + 0.0: -0 becomes 0
        triangle, owner = self.fan()
        line = np.array(self.line)
        mesh = Mesh(self.path, vertex, triangle, owner + 1, line[owner], np.array(self.vertex_line))
        check_indices(mesh)
        check_finite(mesh)
        check_fans(mesh)
        return weld(mesh)


def check_indices(mesh):
    wrong = ((mesh.triangle < 0) | (mesh.triangle >= len(mesh.vertex))).any(axis=1)
    if wrong.any():
        t = int(wrong.argmax())
        raise mesh.fault(t, f"a corner is not among the {len(mesh.vertex)} vertices; export the mesh again")


def check_finite(mesh):
    bad = ~(np.abs(mesh.vertex) < FARTHEST).all(axis=1)
    if not bad.any():
        return
    users = bad[mesh.triangle].any(axis=1)
    if users.any():
        t = int(users.argmax())
        v = int(next(v for v in mesh.triangle[t] if bad[v]))
    else:
        t, v = -1, int(bad.argmax())
    line = f" (line {mesh.vertex_line[v]})" if mesh.vertex_line[v] else ""
    start = f"{mesh.where(t)}: its" if t >= 0 else f"{mesh.path}:"
    raise Fault(f"{start} vertex {v + 1}{line} is not a finite number below {FARTHEST:g}: {' '.join(map(str, mesh.vertex[v]))}; correct it")


def check_fans(mesh):
    """A fan covers a convex polygon only: its triangles must not turn against the polygon."""
    a, b, c = (mesh.vertex[mesh.triangle[:, k]] for k in range(3))
    area = np.cross(b - a, c - a)
    whole = np.zeros((mesh.face[-1] + 1, 3))
    np.add.at(whole, mesh.face, area)
    against = (area * whole[mesh.face]).sum(axis=1) < 0
    if against.any():
        t = int(against.argmax())
        raise mesh.fault(t, "a polygon that is not convex; triangulate the mesh where it comes from")


def weld(mesh):
    """One vertex per place, in the order of the file; triangles that collapse and vertices unused go."""
    _, first, same = np.unique(mesh.vertex, axis=0, return_index=True, return_inverse=True)
    triangle = first[same.reshape(-1)][mesh.triangle]
    keep = (triangle[:, 0] != triangle[:, 1]) & (triangle[:, 1] != triangle[:, 2]) & (triangle[:, 2] != triangle[:, 0])
    if not keep.any():
        raise mesh.fault(0, "every face has two corners in the same place; export the mesh in larger units")
    used = np.unique(triangle[keep])
    number = np.full(len(mesh.vertex), -1)
    number[used] = np.arange(len(used))
    gone = len(keep) - int(keep.sum())
    note = f"{gone} faces with two corners in the same place left out, the first at {mesh.where(int((~keep).argmax()))}" if gone else ""
    return Mesh(mesh.path, mesh.vertex[used], number[triangle[keep]], mesh.face[keep], mesh.line[keep], mesh.vertex_line[used], note)


# ---- OBJ ------------------------------------------------------------------------------------------

def obj_corner(word, vertex_count):
    index = int(word.split("/")[0])
    return index - 1 if index > 0 else vertex_count + index if index < 0 else -1


def read_obj(path, data):
    b = Builder(path)
    for line, text in enumerate(data.decode("utf-8", "replace").split("\n"), 1):
        words = text.split("#")[0].split()
        if not words:
            continue
        if words[0] == "v":
            b.add_vertex(words[1:4], line)
        elif words[0] == "f":
            try:
                b.add_face([obj_corner(w, len(b.vertex)) for w in words[1:]], line)
            except ValueError:
                raise Fault(f"{path}:{line}: face {len(b.polygon) + 1} has a corner that is no number ({text.strip()[:40]}); "
                            "export the mesh again") from None
    return b.build()


# ---- STL ------------------------------------------------------------------------------------------

def read_stl(path, data):
    count = struct.unpack_from("<I", data, 80)[0] if len(data) >= 84 else 0
    if len(data) >= 84 and len(data) == 84 + 50 * count:
        return read_stl_binary(path, data, count)
    if data[:5].lower() == b"solid":
        return read_stl_text(path, data)
    raise Fault(f"{path}: {len(data)} bytes, but its header announces {count} triangles ({84 + 50 * count} bytes); "
                "the file is cut short: copy it again")


def read_stl_binary(path, data, count):
    record = np.dtype([("normal", "<f4", 3), ("corner", "<f4", (3, 3)), ("attribute", "<u2")])
    b = Builder(path)
    with np.errstate(invalid="ignore"):  # what is no number is refused by its face, below
        b.vertex = np.frombuffer(data, record, count, 84)["corner"].reshape(-1, 3).astype(float)
    b.vertex_line = [0] * (3 * count)
    b.polygon = [(3 * i, 3 * i + 1, 3 * i + 2) for i in range(count)]
    b.line = [0] * count
    return b.build()


def read_stl_text(path, data):
    b = Builder(path)
    facet_line, corners = 0, []
    for line, text in enumerate(data.decode("utf-8", "replace").split("\n"), 1):
        words = text.split()
        if not words:
            continue
        if words[0] == "facet":
            facet_line, corners = line, []
        elif words[0] == "vertex":
            corners.append(len(b.vertex))
            b.add_vertex(words[1:4], line)
        elif words[0] == "endfacet":
            b.add_face(corners, facet_line)
    return b.build()


# ---- PLY ------------------------------------------------------------------------------------------

PLY_TYPE = {"char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
            "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
            "double": "f8", "float64": "f8"}


PLY_COUNT_TYPE = {name: kind for name, kind in PLY_TYPE.items() if kind[0] != "f"}


def ply_count(word, file_bytes):
    """Rows of an element: none of them is shorter than a byte, so more than the file has bytes is no count."""
    count = int(word)
    if not 0 <= count <= file_bytes:
        raise ValueError
    return count


def read_ply_header(path, data):
    """(format, [(element, count, [(property, type, count type of a list or None)])], bytes, lines)."""
    end = data.find(b"end_header")
    newline = data.find(b"\n", end)
    if end < 0 or newline < 0:
        raise Fault(f"{path}:1: the PLY header has no end_header; export the mesh again")
    layout, elements = None, []
    lines = data[:end].decode("ascii", "replace").split("\n")
    for number, text in enumerate(lines, 1):
        words = text.split()
        try:
            if words[:1] == ["format"]:
                layout = words[1]
            elif words[:1] == ["element"]:
                elements.append((words[1], ply_count(words[2], len(data)), []))
            elif words[:2] == ["property", "list"]:
                elements[-1][2].append((words[4], PLY_TYPE[words[3]], PLY_COUNT_TYPE[words[2]]))
            elif words[:1] == ["property"]:
                elements[-1][2].append((words[2], PLY_TYPE[words[1]], None))
        except (IndexError, KeyError, ValueError):
            raise Fault(f"{path}:{number}: not understood in a PLY header of a file of {len(data)} bytes: {text.strip()[:40]!r}; "
                        "export the mesh again") from None
    if layout not in ("ascii", "binary_little_endian", "binary_big_endian"):
        raise Fault(f"{path}:2: PLY format {layout} is not known; export it as ascii or binary_little_endian")
    return layout, elements, newline + 1, len(lines)


class PlyText:
    """Rows of values, a line each."""

    def __init__(self, path, data, lines_before):
        self.rows, self.line = data.decode("ascii", "replace").split("\n"), lines_before
        self.path, self.first = path, lines_before

    def row(self, properties):
        self.line += 1
        at = self.line - self.first - 1
        words = self.rows[at].split() if at < len(self.rows) else []
        out, k = {}, 0
        try:
            for name, _, counted in properties:
                length = int(words[k]) if counted else 1
                k += 1 if counted else 0
                if not 0 <= length <= len(words) - k:
                    raise IndexError
                out[name] = words[k:k + length] if counted else words[k]
                k += length
        except (IndexError, ValueError):
            raise Fault(f"{self.path}:{self.line}: a row of the PLY ends early; the file is cut short: copy it again") from None
        return out


class PlyBinary:
    line = 0

    def __init__(self, path, data, order):
        self.path, self.data, self.order, self.at = path, data, order, 0

    def take(self, kind, count):
        dtype = np.dtype(self.order + kind)
        if not 0 <= count * dtype.itemsize <= len(self.data) - self.at:
            raise Fault(f"{self.path}: the PLY ends early; the file is cut short: copy it again")
        out = np.frombuffer(self.data, dtype, count, self.at)
        self.at += count * dtype.itemsize
        return out.tolist()

    def row(self, properties):
        return {name: self.take(kind, self.take(counted, 1)[0]) if counted else self.take(kind, 1)[0]
                for name, kind, counted in properties}


def ply_index(value):
    """The number of a vertex; -1, which check_indices refuses, for what is none."""
    try:
        return int(value)
    except (ValueError, OverflowError):
        return -1


def read_ply(path, data):
    layout, elements, start, lines = read_ply_header(path, data)
    body = data[start:]
    rows = PlyText(path, body, lines) if layout == "ascii" else PlyBinary(path, body, "<" if "little" in layout else ">")
    b = Builder(path)
    for element, count, properties in elements:
        for _ in range(count):
            row = rows.row(properties)
            if element == "vertex":
                b.add_vertex([row.get("x", "?"), row.get("y", "?"), row.get("z", "?")], rows.line)
            elif element == "face":
                corners = row.get("vertex_indices", row.get("vertex_index"))
                if not isinstance(corners, list):
                    raise Fault(f"{path}: its faces have no list vertex_indices; export the mesh again")
                b.add_face([ply_index(c) for c in corners], rows.line)
    return b.build()


READERS = {"obj": read_obj, "stl": read_stl, "ply": read_ply}
FOREIGN = ("off", "gltf", "glb", "3ds")


def read(path):
    kind = path.rsplit(".", 1)[-1].lower()
    if kind not in READERS and kind not in FOREIGN:
        raise Fault(f"{path}: not a mesh by its name; give a file that ends in .obj, .stl, .ply, .off, .gltf, .glb or .3ds")
    try:
        with open(path, "rb") as f:
            data = f.read()
    except OSError as error:
        raise Fault(f"{path}: {error.strerror}; give a mesh that can be read") from None
    if kind in FOREIGN:
        from foreign import read_foreign  # here, since it takes its faults from this file
        return read_foreign(path, data)
    return READERS[kind](path, data)
