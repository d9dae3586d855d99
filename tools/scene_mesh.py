# SPDX-License-Identifier: BSD-3-Clause
"""Meshes of a scene file as they are, for the page of gloved-look: what comes over LCM is thinned to fit into a message. The
daemon says its scene's file and hash (GLOVED_ABOUT); a file with another hash is not it."""
import os
import re

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
FILE_MAX = 64 << 20
NUMBER = re.compile(r"[-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?")
MESH = re.compile(r'name\s*=\s*"([^"]*)"|vertices\s*=\s*\(([^()]*)\)|triangles\s*=\s*\(([^()]*)\)')


def fnv1a64(data):
    value = 0xcbf29ce484222325
    for byte in data:
        value = ((value ^ byte) * 0x100000001b3) & 0xffffffffffffffff
    return f"{value:016x}"


def read(name, wanted):
    """The file's text where it is a scene of that hash; None otherwise. Looked for from here and from gloved's own folder."""
    if not name.endswith(".scene") or "\0" in name:
        return None
    for path in (name, os.path.join(ROOT, name)):
        try:
            if not os.path.isfile(path) or os.path.getsize(path) > FILE_MAX:
                continue
            with open(path, "rb") as file:
                data = file.read()
        except OSError:
            continue
        if fnv1a64(data) == wanted:
            return data.decode("utf-8", "replace")
    return None


def meshes(text):
    """Object's name to its mesh in the layout of viewer_geometry_t.float_data: V, T, coordinates, corners; in the object's frame."""
    out, name, vertices = {}, None, []
    for found in MESH.finditer(re.sub(r"#.*", "", text)):
        if found[1] is not None:
            name, vertices = found[1], []
        elif found[2] is not None:
            vertices = [round(float(x), 6) for x in NUMBER.findall(found[2])]
        else:
            corners = [int(x) for x in NUMBER.findall(found[3])]
            if name and vertices and corners and max(corners) < len(vertices) // 3 and min(corners) >= 0:
                out[name] = [len(vertices) // 3, len(corners) // 3] + vertices + corners
    return out
