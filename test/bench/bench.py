# SPDX-License-Identifier: BSD-3-Clause
"""Benchmark: per scene the time of collision, dynamics and the whole step, instructions per step, and the same hand
and objects in MuJoCo and Bullet, alternating in blocks of half a second of simulation so that all feel the same machine.
Each step is done several times, bit by bit the same, and counts with its least time: what the machine does beside this is
taken out, of the peers' steps as of ours. Then the steps' tail, the engine's solvers, the growth with idle objects, and the
narrow phase per pair beside coal. Writes data/bench/*.csv and data/bench/bench.png. Usage: bench.py BUILD [SCENE...]; `make bench` calls it."""
import csv
import glob
import json
import os
import re
import subprocess
import sys

import matplotlib
import numpy as np

from bench_bullet import Bullet

sys.path.insert(0, "test/support")
import callgrind  # noqa: E402 (test/support is no package)

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402 (after the choice of the canvas)

BLOCK = 500  # steps
REPLAYS = 3
WORK = "build/bench"


def read_expected(path):
    found = {}
    for line in open(path):
        word = line.split()
        if word and word[0] in ("scene", "object", "hold_s"):
            found[word[0]] = word[1:]
    return found


def list_scenes(names):
    """Each trace with its scene; scenes that a trace is missing for come from the simulated user."""
    rows = []
    for path in sorted(glob.glob("data/traces/*/expected")):
        folder, what = os.path.dirname(path), read_expected(path)
        scene = what["scene"][0]
        if os.path.exists(scene):
            rows.append((os.path.basename(folder), scene, f"trace:{folder}/input.log.gz?speed=0", what["object"][0],
                         [float(t) for t in what["hold_s"]]))
    if not any(r[1].endswith("frame.scene") for r in rows):
        rows.append(("bar_frame", "data/scenes/frame.scene", "sim:data/scripts/bar_frame.user", "frame", [5.5, 14.5]))
    return [r for r in rows if not names or r[0] in names]


class Program:
    """bench_engine or bench_mujoco behind pipes."""

    def __init__(self, *command, variant="default"):
        env = {**os.environ, "GV_VARIANT": variant}
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=env)

    def line(self):
        text = self.process.stdout.readline()
        if not text:
            sys.exit(f"bench: {self.process.args[0]} ended")
        return text

    def run(self, first, count, width=8):
        self.process.stdin.write(f"{first} {count}\n".encode())
        self.process.stdin.flush()
        size = count * width * 8
        data = self.process.stdout.read(size)
        if len(data) != size:
            sys.exit(f"bench: {self.process.args[0]} ended")
        return np.frombuffer(data).reshape(count, width)

    def close(self):
        self.process.stdin.close()
        self.process.wait()


# ---- MuJoCo's model -----------------------------------------------------------------------------------------------
def numbers(values):
    return " ".join(f"{v:.17g}" for v in values)


def is_box(points):
    points = np.array(points)
    return len(points) == 8 and np.allclose(np.abs(points), np.abs(points).max(0), atol=1e-12)


def mujoco_model(scene):
    """Elliptic cones, impratio 10, noslip 3, solref .002: the settings at which MuJoCo slips least."""
    assets, bodies = [], []
    for i, limb in enumerate(scene["limbs"]):
        r, half = limb["radius"], limb["half"]
        shape = (f'type="capsule" size="{r:.17g} {half[0]:.17g}" euler="0 90 0"' if i < 15 else
                 f'type="box" size="{numbers([h + r for h in half])}"')
        inertia = numbers([limb["inertia"]] * 3)
        bodies.append(f'<body name="limb{i}" pos="0 0 {10 + i}"><freejoint/><inertial pos="0 0 0" mass="{limb["mass"]:.17g}" '
                      f'diaginertia="{inertia}"/><geom {shape} friction="{scene["mu_hand"]} 0 0" contype="2" conaffinity="1"/></body>')
    for o in scene["objects"]:
        geoms = []
        for k, piece in enumerate(o["pieces"]):
            common = f'friction="{o["mu"]} 0 0" contype="1" conaffinity="3"'
            if is_box(piece):
                geoms.append(f'<geom type="box" size="{numbers(np.abs(np.array(piece)).max(0))}" {common}/>')
            else:
                mesh = f'{o["name"]}{k}'
                assets.append(f'<mesh name="{mesh}" vertex="{numbers(np.array(piece).ravel())}" inertia="convex"/>')
                geoms.append(f'<geom type="mesh" mesh="{mesh}" {common}/>')
        inertial = "" if o["static"] else (f'<freejoint/><inertial pos="0 0 0" mass="{o["mass"]:.17g}" '
                                           f'fullinertia="{numbers(o["inertia"])}"/>')
        bodies.append(f'<body name="{o["name"]}" pos="{numbers(o["position"])}" quat="{numbers(o["quaternion"])}">'
                      f'{inertial}{"".join(geoms)}</body>')
    newline = "\n"
    return (f'<mujoco><compiler angle="degree" balanceinertia="true"/><option timestep="0.001" gravity="{numbers(scene["gravity"])}" cone="elliptic" '
            f'impratio="10" noslip_iterations="3"/><default><geom condim="3" solref=".002 1"/></default>\n'
            f'<asset>{newline.join(assets)}</asset>\n<worldbody>{newline.join(bodies)}</worldbody></mujoco>\n')


# ---- one scene ----------------------------------------------------------------------------------------------------
FIRST, COUNTED = 7000, 1000  # a second in which the object is held


def mean_instructions(command):
    return str(round(sum(callgrind.ask(command)) / COUNTED))


def slip_mm(records, hold):
    a, b = (int(t * 1000) for t in hold)
    in_palm = records[a:b, 4:7]
    if records[a:b, 7].min() < records[100, 7] + 0.02:
        return float("nan")  # not in the air: dropped, or never lifted
    return 1e3 * np.linalg.norm(in_palm - in_palm[0], axis=1).max()


def run_blocks(runners, steps):
    parts = {name: [] for name in runners}
    for first in range(0, steps, BLOCK):
        for name, runner in runners.items():
            parts[name].append(runner.run(first, min(BLOCK, steps - first)))
    return {name: np.concatenate(p) for name, p in parts.items()}


def least(replays):
    """Of several replays of the same steps: the least of their times (the first three values)."""
    records = replays[0].copy()
    records[:, :3] = np.min([r[:, :3] for r in replays], axis=0)
    return records


def tell_machine(name, replays, records):
    """How busy the machine was beside this: steps that took half as much again as their least time."""
    times = np.array([r[:, 0] for r in replays])
    share = np.mean(times > 1.5 * records[:, 0])
    print(f"{name}: {100 * share:.1f} % of the steps were disturbed, {os.getloadavg()[0]:.1f} programs ran"
          + ("; too many: run again when the machine is quiet" if share > 0.1 else ""), file=sys.stderr, flush=True)


def open_peers(build, scene, drivers, row):
    model = f"{WORK}/{row[0]}.xml"
    open(model, "w").write(mujoco_model(scene))
    return {"mujoco": Program(f"{build}/test/bench_mujoco", model, drivers, row[3]), "bullet": Bullet(scene, drivers, row[3])}


def bench_pairs(build):
    """Narrow phase per pair beside coal; the table goes to data/bench/pairs.csv."""
    run = subprocess.run([f"{build}/test/bench_pairs"], capture_output=True, text=True)
    if run.returncode:
        sys.exit(f"bench: bench_pairs: {run.stderr}")
    rows = list(csv.reader(run.stdout.splitlines()))
    for r in rows:
        print("  ".join(f"{v:>16}" for v in r), flush=True)
    return rows


IDLE_BOX = """  {{ name = "idle{0}"; mass = 0.2; box = [0.03, 0.03, 0.03]; position = [{1:.3f}, {2:.3f}, 0.015]; }}"""


def scene_with_idle(count):
    """The box on its table, and `count` small boxes at rest around it, out of the hand's way."""
    text = open("data/scenes/box.scene").read()
    place = [(0.25 + 0.05 * (i // 12), -0.33 + 0.06 * (i % 12)) for i in range(count)]
    boxes = ",\n".join(IDLE_BOX.format(i, x, y) for i, (x, y) in enumerate(place))
    path = f"{WORK}/idle{count}.scene"
    open(path, "w").write(text.rstrip().removesuffix(");") + ("," + boxes if boxes else "") + "\n);\n")
    return path


def bench_idle(build):
    """How much a step grows with objects that nobody touches: alternating blocks, median while the box is held."""
    url, counts = "trace:data/traces/power_box/input.log.gz?speed=0", [0, 1, 4, 16, 32, 62]
    runners = {n: Program(f"{build}/test/bench_engine", url, scene_with_idle(n), "box", f"{WORK}/idle.drivers") for n in counts}
    steps = min(json.loads(r.line())["steps"] for r in runners.values())
    replays = [run_blocks(runners, steps) for _ in range(REPLAYS)]
    records = {n: least([r[n] for r in replays]) for n in counts}
    rows = [["idle", "median_us", "p99_us", "ratio"]]
    base = np.median(records[1][6000:14000, 0])
    for n in counts:
        held = records[n][6000:14000, 0]
        rows.append([n, f"{np.median(held):.2f}", f"{np.percentile(held, 99):.2f}", f"{np.median(held) / base:.2f}"])
        print("  ".join(f"{v:>10}" for v in rows[-1]), flush=True)
    for r in runners.values():
        r.close()
    return rows


VARIANTS = ("newton", "dantzig", "quickstep", "libccd", "stock", "paper")


def bench_solvers(build, scenes):
    """The engine's solvers, narrow phases and presets beside each other: a step while the object is held."""
    rows = [["scene", "variant", "median_us", "p99_us"]]
    for name, scene_path, url, obj, hold in scenes:
        command = [f"{build}/test/bench_engine", url, scene_path, obj, f"{WORK}/solvers.drivers"]
        runners = {v: Program(*command, variant=v) for v in VARIANTS}
        steps = min(json.loads(r.line())["steps"] for r in runners.values())
        replays = [run_blocks(runners, steps) for _ in range(REPLAYS)]
        for v, runner in runners.items():
            runner.close()
            held = least([r[v] for r in replays])[slice(*(int(t * 1000) for t in hold)), 0]
            rows.append([name, v, f"{np.median(held):.2f}", f"{np.percentile(held, 99):.2f}"])
            print("  ".join(f"{v:>16}" for v in rows[-1]), flush=True)
    return rows


def figures(name, what, micros):
    at = np.percentile(micros, [50, 99, 99.9, 100])
    return [name, what] + [f"{v:.2f}" for v in at]


def bench_scene(build, row):
    name, scene_path, url, obj, hold = row
    drivers = f"{WORK}/{name}.drivers"
    engine = Program(f"{build}/test/bench_engine", url, scene_path, obj, drivers)
    scene = json.loads(engine.line())
    runners = {"gloved": engine, **open_peers(build, scene, drivers, row)}
    replays = [run_blocks(runners, scene["steps"]) for _ in range(REPLAYS)]
    engine.close()
    records = {what: least([r[what] for r in replays]) for what in runners}
    tell_machine(name, [r["gloved"] for r in replays], records["gloved"])
    rows, held = [], slice(*(int(t * 1000) for t in hold))
    ours = records["gloved"]
    placed = ours[:, 2] > 0
    for k, part in enumerate(("whole", "collision", "dynamics")):
        rows.append(figures(name, f"gloved {part}", ours[placed, k]) + ["", "", ""])
    rows[0][6:] = [f"{slip_mm(ours, hold):.4f}", "1.00", ""]
    rows[0][8] = mean_instructions([f"{build}/test/bench_engine", url, scene_path, obj, "-", str(FIRST), str(COUNTED)])
    mujoco = mean_instructions([f"{build}/test/bench_mujoco", f"{WORK}/{name}.xml", drivers, obj, "count", str(FIRST), str(COUNTED)])
    for peer in list(records)[1:]:
        # Ratio of the medians while the object is held.
        ratio = np.median(records[peer][held, 0]) / np.median(ours[held, 0])
        rows.append(figures(name, peer, records[peer][placed, 0]) + [f"{slip_mm(records[peer], hold):.4f}", f"{ratio:.2f}", mujoco if peer == "mujoco" else ""])
    for r in rows:
        print("  ".join(f"{v:>10}" if i > 1 else f"{v:<16}" for i, v in enumerate(r)), flush=True)
    return rows


def bench_tail(build, scenes, runs=9):
    """The machine's own stalls taken out: of each step the least time of several replays, which are the same step bit by bit."""
    rows = [["scene", "median_us", "p99_us", "p999_us", "max_us", "p999_over_median"]]
    for name, scene_path, url, obj, _ in scenes:
        engine = Program(f"{build}/test/bench_engine", url, scene_path, obj, f"{WORK}/tail.drivers")
        steps = json.loads(engine.line())["steps"]
        micros = least([engine.run(0, steps) for _ in range(runs)])[:, 0]
        engine.close()
        at = np.percentile(micros, [50, 99, 99.9, 100])
        rows.append([name] + [f"{v:.2f}" for v in at] + [f"{at[2] / at[0]:.2f}"])
        print("  ".join(f"{v:>16}" for v in rows[-1]), flush=True)
    return rows


def draw_steps(ax, rows):
    kinds = ("gloved whole", "mujoco", "bullet")
    names = list(dict.fromkeys(r[0] for r in rows))
    for k, what in enumerate(kinds):
        mine = [r for r in rows if r[1] == what]
        at = [names.index(r[0]) + 0.27 * (k - 1) for r in mine]
        ax.bar(at, [float(r[2]) for r in mine], 0.25, label=what.replace(" whole", ""))
        ax.plot(at, [float(r[3]) for r in mine], "k_")
    ax.set_xticks(range(len(names)), names, rotation=30, ha="right")
    ax.set_ylabel("us a step: median, dash p99")
    ax.set_yscale("log")
    ax.legend()


def draw_growth(ax, pairs):
    hulls = [r for r in pairs if re.fullmatch(r"limb-hull\d+", r[0])]
    at = [int(r[0][9:]) for r in hulls]
    for column, what in ((1, "gloved distance"), (2, "coal distance"), (4, "gloved manifold"), (5, "coal contact")):
        ax.plot(at, [float(r[column]) for r in hulls], "o-", label=what)
    ax.set_xscale("log")
    ax.set_xlabel("vertices of the hull that a limb touches")
    ax.set_ylabel("ns a pair")
    ax.set_ylim(0, 1.4 * max(float(r[c]) for r in hulls for c in (1, 2, 4, 5)))
    ax.legend(loc="upper left", ncols=2)


def draw_idle(ax, idle):
    ax.plot([int(r[0]) for r in idle], [float(r[1]) for r in idle], "o-")
    ax.set_xlabel("idle objects beside the grasp")
    ax.set_ylabel("us a step, median")
    ax.set_ylim(bottom=0)


def save(name, rows):
    with open(f"data/bench/{name}.csv", "w", newline="") as f:
        csv.writer(f, lineterminator="\n").writerows(rows)


HEAD = ["scene", "what", "median_us", "p99_us", "p999_us", "max_us", "slip_mm", "ratio", "instructions"]


def main():
    build, names = sys.argv[1], sys.argv[2:]
    os.makedirs(WORK, exist_ok=True)
    os.makedirs("data/bench", exist_ok=True)
    print("  ".join(f"{v:>10}" if i > 1 else f"{v:<16}" for i, v in enumerate(HEAD)))
    scenes = list_scenes(names)
    rows = [r for row in scenes for r in bench_scene(build, row)]
    tail, solvers = bench_tail(build, scenes), bench_solvers(build, scenes)
    if names:
        return
    idle, pairs = bench_idle(build), bench_pairs(build)
    save("tail", tail)
    save("steps", [HEAD] + rows)
    save("solver_times", solvers)
    save("idle", idle)
    save("pairs", pairs)
    fig, ax = plt.subplots(1, 3, figsize=(15, 4.5))
    draw_steps(ax[0], rows)
    draw_growth(ax[1], pairs)
    draw_idle(ax[2], idle[1:])
    fig.tight_layout()
    fig.savefig("data/bench/bench.png", dpi=100)


if __name__ == "__main__":
    main()
