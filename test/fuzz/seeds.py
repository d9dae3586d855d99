# SPDX-License-Identifier: BSD-3-Clause
"""What the fuzz targets begin with, made from the project's own files and types: seeds.py FOLDER writes FOLDER/TARGET/seed-*.
Run by `make fuzz-corpus`."""
import gzip
import os
import random
import struct
import subprocess
import sys

FOLDER = sys.argv[1]
TRACE = "data/traces/power_box/input.log.gz"


def put(target, name, data):
    os.makedirs(os.path.join(FOLDER, target), exist_ok=True)
    with open(os.path.join(FOLDER, target, "seed-" + name), "wb") as f:
        f.write(data)


def read(path):
    with open(path, "rb") as f:
        return f.read()


def without_comments(data):
    lines = [line.split(b"#")[0].rstrip() for line in data.split(b"\n")]
    return b"\n".join(line for line in lines if line) + b"\n"


def texts():
    for folder, target in (("data/scenes", "scene"), ("data/scripts", "user")):
        for name in sorted(os.listdir(folder)):
            put(target, name.split(".")[0], without_comments(read(os.path.join(folder, name))))
    for shape in ("capsule = [0.02, 0.1]", "cylinder = [0.03, 0.08]", "cone = [0.03, 0.08]", "ellipsoid = [0.02, 0.03, 0.05]"):
        put("scene", shape.split()[0], b'version = 1;\nobjects = ( { name = "a"; mass = 0.1; mu = 0.8; %s; position = [0.0, 0.0, 0.05]; } );\n' % shape.encode())
    put("scene", "ball", b'version = 1;\nobjects = ( { name = "a"; mass = 0.1; mu = 0.8; ball = 0.03; position = [0.0, 0.0, 0.03]; } );\n')
    put("config", "all", without_comments(read("data/gloved.conf")))
    for preset in ("default", "paper", "stock"):
        put("config", preset, f'version = 1;\npreset = "{preset}";\n'.encode())
    for name in sorted(os.listdir("data/calibration")):
        put("calibration", name.split(".")[0], without_comments(read(os.path.join("data/calibration", name))))


def traces():
    with gzip.open(TRACE) as f:
        lines = b"".join(f.readline() for _ in range(12))
    for kind in range(3):
        put("trace", f"kind{kind}", bytes((kind, 128)) + lines)
    put("trace", "gzip", bytes((0, 0)) + gzip.compress(lines, mtime=0))
    put("log", "line", lines.split(b"\n")[0])


# Operations of fuzz_session.c.
GLOVE, POSE, STATUS, PRESS, ANY, STEP, MANY, STALL, REQUEST, LOST, OTHER = range(11)


def sessions():
    wait, arm, press = bytes((PRESS, 63, 0, 0, 0)), bytes((PRESS, 63, 0, 1, 0)), bytes((PRESS, 63, 168, 1, 0))
    force = wait + arm + 3 * press
    rng = random.Random(1)
    put("session", "force", force)
    put("session", "let_go", force + bytes((PRESS, 20, 168, 0, 0)) + press)
    put("session", "stall", force + bytes((STALL, 30)) + press)
    put("session", "silence", force + bytes((MANY, 63, MANY, 63)))
    put("session", "any", force + bytes((ANY, 0x10, 1, 48, 4)) + rng.randbytes(48) + bytes((STEP,)) + press)
    put("session", "sound", force + bytes((GLOVE,)) + rng.randbytes(47) + bytes((POSE,)) + rng.randbytes(47) + bytes((STATUS,)) + rng.randbytes(19) + press)
    put("session", "requests", force + b"".join(bytes((REQUEST, kind, 100, STEP)) for kind in range(8)) + press)
    put("session", "lost", force + bytes((LOST, 40)) + press)
    # Both hands at once, the other one's frames by PRESS of one period each; the length says that there are two.
    one = lambda bend, dead_man: bytes((PRESS, 0, bend, dead_man, 0))
    both = lambda bend, dead_man, n: n * (one(bend, dead_man) + bytes((OTHER,)))
    two = both(0, 0, 40) + both(0, 1, 40) + both(168, 1, 120)
    for name, rest in (("two", b""), ("two_let_go", both(168, 0, 20)), ("two_silence", 60 * one(168, 1))):
        put("session", name, two + rest + bytes((STEP,)) * ((2 - len(two + rest)) % 4))


def commands():
    with subprocess.Popen(["lcm-gen", "-p", "--ppath", os.path.join("build", "types-python"), "data/lcm/gloved_command_t.lcm"], stdout=subprocess.DEVNULL) as run:
        run.wait()
    sys.path.insert(0, os.path.join("build", "types-python"))
    from gloved.command_t import command_t
    for kind, value, text in ((0, 0, ""), (1, 0, "data/scenes/box.scene"), (2, 1.5, ""), (3, 0.7, ""), (4, 0, "a.lcm"), (5, 0, ""), (6, 0, ""), (7, 1, ""), (9, 0, "")):
        message = command_t()
        message.kind, message.value, message.text = kind, float(value), text
        data = message.encode()
        put("command", str(kind), bytes((len(data),)) + data)


def wires():
    with gzip.open(TRACE) as f:
        frames = [line.split()[2].split(b"##1") for line in (f.readline() for _ in range(6))]
    packed = b"".join(struct.pack(">IBB", int(i, 16), 0x80 | len(d) // 2, 1) + bytes.fromhex(d.decode()) for i, d in frames)
    put("cannelloni", "frames", struct.pack(">BBBH", 2, 0, 35, len(frames)) + packed)
    for kind in range(6):
        put("serial", str(kind), bytes((kind,)) + random.Random(kind).randbytes(60))
    put("doglove", "servo", bytes.fromhex("fffffd0001080055 00a6000000 8cc0 fffffd0001090003 7400 00020000 ca89".replace(" ", "")))
    put("hand_input", "right", b"GVHI\1\1\1\0" + struct.pack("<12f", 0.1, -0.2, 0.3, 1, 0, 0, 0, 0, 0.25, 0.5, 0.75, 1))
    put("lucid", "line", b"A100B200C300D4000E4095F2048G2048J\n")
    put("classic", "parts", b"".join(struct.pack("<HBB8s", 0x111 + i, 8, 0, bytes((7, *range(i, i + 7)))) for i in range(6)))


texts()
traces()
sessions()
commands()
wires()
