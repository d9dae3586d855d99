# SPDX-License-Identifier: BSD-3-Clause
"""Damaged mesh files against gloved-scene: whatever was done to an OBJ, STL, PLY, OFF, glTF or 3DS file, the answer is a scene or one line that
names the file, says what is wrong and what to do, and it comes soon. Each mutant has a seed, printed where it fails;
GV_SEED=N runs that one alone, GV_MUTANTS=N so many of each kind of file."""
import base64
import contextlib
import io
import json
import os
import random
import signal
import struct
import sys
import tempfile
import traceback
import warnings

sys.path.insert(0, "tools/mesh")
sys.dont_write_bytecode = True
import read as reading      # noqa: E402
import repair               # noqa: E402
import scene as compiler    # noqa: E402
import shapes               # noqa: E402
import solid                # noqa: E402

MUTANTS = int(os.environ.get("GV_MUTANTS", "400"))
COMPILED = 12               # of each kind: through the whole compiler, which takes a second
FOREIGN_MUTANTS = MUTANTS // 4  # of a kind that a library reads in a process of its own
SOON_S = 20
BIG = (0, 1, -1, 2, 255, 256, 2**31 - 1, -2**31, 2**32 - 1, 2**63, 10**11, 10**30)
WORDS = ("nan", "inf", "-inf", "1e308", "-1e308", "1e-320", "element nothing 100000000000", "element face 3", "property list float int vertex_indices",
         "property list char int vertex_indices", "property int vertex_indices", "property list uchar float x", "f 1 2 3", "f 1//1 2//2", "v 0 0", "endfacet", "facet", "vertex 0 0 0", "end_header", "", "\0", "\u0661", "f -1 -2 -99999999999999999999")
warnings.simplefilter("error")  # a warning of numpy's is no answer


def sources():
    """Name of the file and its bytes, a sound tetrahedral thing in every format."""
    vertex, face = shapes.THINGS["dice"]().triangles()
    vertex, face = [tuple(map(float, v)) for v in vertex], [tuple(map(int, f)) for f in face]
    corners = [[vertex[i] for i in f] for f in face]
    text = "".join("facet normal 0 0 0\nouter loop\n" + "".join("vertex %r %r %r\n" % c for c in three) + "endloop\nendfacet\n" for three in corners)
    yield "m.obj", ("".join("v %r %r %r\n" % v for v in vertex) + "".join("f %d %d %d\n" % tuple(i + 1 for i in f) for f in face)).encode()
    yield "text.stl", f"solid m\n{text}endsolid m\n".encode()
    yield "m.stl", bytes(80) + struct.pack("<I", len(face)) + b"".join(struct.pack("<12fH", 0, 0, 0, *sum(three, ()), 0) for three in corners)
    for order, kind in (("", "ascii"), ("<", "binary_little_endian"), (">", "binary_big_endian")):
        head = (f"ply\nformat {kind} 1.0\nelement vertex {len(vertex)}\nproperty float x\nproperty float y\nproperty float z\n"
                f"element face {len(face)}\nproperty list uchar int vertex_indices\nend_header\n").encode()
        if order:
            body = b"".join(struct.pack(order + "3f", *v) for v in vertex) + b"".join(struct.pack(order + "B3i", 3, *f) for f in face)
        else:
            body = ("".join("%r %r %r\n" % v for v in vertex) + "".join("3 %d %d %d\n" % f for f in face)).encode()
        yield f"{kind}.ply", head + body


def foreign_sources():
    """The same in the kinds that a library reads."""
    vertex, face = shapes.THINGS["dice"]().triangles()
    vertex, face = [tuple(map(float, v)) for v in vertex], [tuple(map(int, f)) for f in face]
    yield "m.off", (f"OFF\n{len(vertex)} {len(face)} 0\n" + "".join("%r %r %r\n" % v for v in vertex)
                    + "".join("3 %d %d %d\n" % f for f in face)).encode()

    def chunk(number, data):
        return struct.pack("<HI", number, 6 + len(data)) + data
    points = chunk(0x4110, struct.pack("<H", len(vertex)) + b"".join(struct.pack("<3f", *v) for v in vertex))
    sides = chunk(0x4120, struct.pack("<H", len(face)) + b"".join(struct.pack("<4H", *f, 0) for f in face))
    yield "m.3ds", chunk(0x4D4D, chunk(0x3D3D, chunk(0x4000, b"a\0" + chunk(0x4100, points + sides))))
    blob = b"".join(struct.pack("<3f", *v) for v in vertex) + b"".join(struct.pack("<3H", *f) for f in face)
    start = 12 * len(vertex)
    about = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
             "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
             "buffers": [{"byteLength": len(blob), "uri": "data:application/octet-stream;base64," + base64.b64encode(blob).decode()}],
             "bufferViews": [{"buffer": 0, "byteOffset": 0, "byteLength": start},
                             {"buffer": 0, "byteOffset": start, "byteLength": len(blob) - start}],
             "accessors": [{"bufferView": 0, "componentType": 5126, "count": len(vertex), "type": "VEC3",
                            "min": [min(c) for c in zip(*vertex)], "max": [max(c) for c in zip(*vertex)]},
                           {"bufferView": 1, "componentType": 5123, "count": 3 * len(face), "type": "SCALAR"}]}
    yield "m.gltf", json.dumps(about).encode()
    del about["buffers"][0]["uri"]
    text = json.dumps(about).encode()
    text, body = text + b" " * (-len(text) % 4), blob + bytes(-len(blob) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(body), b"BIN\0") + body
    yield "m.glb", b"glTF" + struct.pack("<2I", 2, 12 + len(chunks)) + chunks


def mutate(data, rng):
    """One to four damages: bytes, cuts, doubled stretches, words and numbers of the text."""
    data = bytearray(data)
    for _ in range(rng.randint(1, 4)):
        at, kind = rng.randrange(len(data) + 1), rng.randrange(7)
        if kind == 0 and at < len(data):
            data[at] = rng.randrange(256)
        elif kind == 1:
            del data[at:at + rng.choice((1, 4, 50, len(data)))]
        elif kind == 2:
            data[at:at] = data[at:at + rng.choice((1, 12, 50))]
        elif kind == 3:
            data[at:at] = rng.choice(WORDS).encode()
        elif kind == 4:
            data[at:at] = f"\n{rng.choice(WORDS)}\n".encode("utf-8")
        elif kind == 5 and rng.random() < 0.3:
            at = max(data.find(rng.choice((b"property", b"list ", b"uchar", b"int ", b"float"))), 0)
            data[at:at + rng.choice((0, 5, 9, 20))] = rng.choice((b"property", b"list uchar ", b"char ", b"float ", b"double ", b"x\n"))
        elif kind == 5:
            lines = data.split(b"\n")
            i = rng.randrange(len(lines))
            words = lines[i].split(b" ")
            words[rng.randrange(len(words))] = str(rng.choice(BIG)).encode()
            lines[i] = b" ".join(words)
            data = bytearray(b"\n".join(lines))
        elif len(data) > 90:
            struct.pack_into("<I", data, rng.choice((80, rng.randrange(len(data) - 4))), rng.choice(BIG) & 0xFFFFFFFF)
    return bytes(data)


class TooLong(Exception):
    pass


def on_alarm(number, frame):
    raise TooLong(f"no answer in {SOON_S} s")


def check(path, whole):
    """What is wrong with the answer; empty: nothing."""
    said = io.StringIO()
    signal.alarm(SOON_S)
    try:
        if whole:
            with contextlib.redirect_stderr(said), contextlib.redirect_stdout(said):
                code = compiler.main([path, "-o", path + ".scene", "--size", "0.1", "--threshold", "0.3"])
            last = said.getvalue().strip().splitlines()[-1]
            return "" if code == 0 or (code == 2 and path in last and ";" in last) else f"exit code {code}: {last}"
        mesh = reading.read(path)
        try:
            solid.check(mesh)
        except reading.Fault:
            solid.check(repair.repair(mesh, "all"))
        return ""
    except reading.Fault as fault:
        return "" if str(fault).startswith(path) and (";" in str(fault) or ":" in str(fault)) and "\n" not in str(fault) else f"not a sentence: {fault}"
    except Exception:
        return traceback.format_exc(limit=-3)
    finally:
        signal.alarm(0)


def test_mutants(name, data, folder):
    path = os.path.join(folder, name)
    count = FOREIGN_MUTANTS if name.rsplit(".", 1)[-1] in reading.FOREIGN else MUTANTS
    seeds = [int(os.environ["GV_SEED"])] if "GV_SEED" in os.environ else range(count)
    for seed in seeds:
        with open(path, "wb") as f:
            f.write(mutate(data, random.Random(f"{name} {seed}")))
        why = check(path, "GV_SEED" in os.environ or seed < COMPILED)
        if why:
            return f"GV_SEED={seed}: {why}"
    return ""


def main():
    failed = False
    signal.signal(signal.SIGALRM, on_alarm)
    with tempfile.TemporaryDirectory(prefix="gloved-test-") as folder:
        for name, data in (*sources(), *foreign_sources()):
            why = test_mutants(name, data, folder)
            print("".join(f"  {line}\n" for line in why.splitlines()) + f"{'FAIL' if why else 'ok'} mutants_of_{name}_are_answered", flush=True)
            failed |= bool(why)
        bomb = os.path.join(folder, "bomb.ply")
        with open(bomb, "wb") as f:
            f.write(b"ply\nformat binary_little_endian 1.0\nelement nothing 100000000000\nelement vertex 0\nend_header\n")
        why = check(bomb, True)
        print(f"{'  ' + why + chr(10) + 'FAIL' if why else 'ok'} a_hundred_billion_rows_of_nothing_are_refused", flush=True)
    return 1 if failed or why else 0


sys.exit(main())
