# SPDX-License-Identifier: BSD-3-Clause
"""doc_pictures.py BUILD - the pictures of doc/: postures of the calibration, and what the settings of doc/tuning.md do, each a few
runs of a simulated user as fast as they go. `make doc-pictures` runs it; it prints the figures of the page's tables.
Needs `pip install lcm numpy matplotlib`."""
import os
import subprocess
import sys
import tempfile

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from gloved_run import FINGERS, Run  # noqa: E402

BUILD = sys.argv[1]
OUT = "data/pictures"


def run(folder, fcu, settings, *options):
    conf, log = os.path.join(folder, "run.conf"), os.path.join(folder, "run.lcm")
    with open(conf, "w", encoding="utf-8") as file:
        file.write("version = 1;\n" + settings)
    subprocess.run([BUILD + "/gloved", "--config", conf, "--fcu", fcu, "--lcm", "none", "--log", log, *options], check=True,
                   stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return Run(log)


def draw_hand(axes, state, title):
    joints = np.array([limb.driver_position_m for limb in state.limb])
    palm = joints[15]
    for finger in range(5):
        points = np.vstack([palm, joints[3 * finger:3 * finger + 3]])
        axes.plot(*points.T, "-o", lw=6, ms=7, solid_capstyle="round", label=FINGERS[finger])
    low, high = joints.min(0), joints.max(0)
    middle, half = (low + high) / 2, 0.06
    axes.set(xlim=(middle[0] - half, middle[0] + half), ylim=(middle[1] - half, middle[1] + half), zlim=(middle[2] - half, middle[2] + half),
             title=title, xticklabels=[], yticklabels=[], zticklabels=[])
    axes.set_axis_off()
    axes.view_init(25, -150)
    axes.set_box_aspect((1, 1, 1))


def postures(folder):
    r = run(folder, "sim:calibrate?speed=0", "")
    figure = plt.figure(figsize=(10, 3.6), layout="constrained")
    for number, (time_s, title) in enumerate(((2.5, "1: flat hand"), (6.5, "2: fist"), (10.5, "3: tips of thumb and index meet"))):
        state = r.states[int(np.searchsorted(r.t, time_s))]
        draw_hand(figure.add_subplot(1, 3, number + 1, projection="3d"), state, title)
    figure.axes[0].legend(loc="lower left", fontsize=7)
    figure.savefig(OUT + "/postures.png", dpi=80)


def felt(r, first_s, last_s):
    """Commanded tension of each finger in N, one row a state, and the distance of tips from where they were measured, m."""
    states = [s for s in r.states if first_s <= s.time_s <= last_s]
    force = np.array([s.force_commanded_n for s in states])
    away = np.array([[np.linalg.norm(np.subtract(s.limb[3 * f + 2].position_m, s.limb[3 * f + 2].driver_position_m)) for f in range(5)] for s in states])
    return force, away


def coupling(folder):
    print("coupling: force of the firmest finger (N), tip away from the measured finger (mm), of a power grasp")
    figure, axes = plt.subplots(figsize=(7, 3.5), layout="constrained")
    rows = []
    for times in (0.5, 1.0, 2.0, 4.0):
        r = run(folder, "sim:power_box?speed=0", f"coupling = {{ limb = {{ k_f = {200 * times}; k_t = {0.48 * times}; }}; }};\n")
        force, away = felt(r, 6, 14)
        rows.append((200 * times, force.mean(0).max(), 1e3 * away.mean(0).max()))
        print("  k_f {:4.0f} N/m: {:.2f} N, {:.1f} mm".format(*rows[-1]))
    rows = np.array(rows)
    axes.plot(rows[:, 0], rows[:, 1], "o-", label="force of the firmest finger, N")
    axes.plot(rows[:, 0], rows[:, 2], "s--", label="its tip away from the measured one, mm")
    axes.set(xlabel="coupling.limb.k_f, N/m (k_t with it)", title="A stiffer coupling: more force, a hand closer to the glove")
    axes.grid(True, alpha=0.3)
    axes.legend()
    figure.savefig(OUT + "/tuning-coupling.png", dpi=80)


def filters(folder):
    print("filter: ripple of the felt force while a box is held still, N rms")
    figure, axes = plt.subplots(figsize=(7, 3.5), layout="constrained")
    firmest = None
    for name, settings in (("default: 1 Hz at rest, 30 Hz moving", ""), ("rest_hz = 0: 30 Hz always", "filter = { rest_hz = 0.0; };\n"),
                           ("off", "filter = { corner_hz = 0.0; };\n")):
        r = run(folder, "sim:power_box_real?speed=0", settings)
        force, _ = felt(r, 6, 14)
        firmest = int(force.mean(0).argmax()) if firmest is None else firmest
        lifted = 1e3 * min(s.object[1].position_m[2] - 0.04 for s in r.states if 6 <= s.time_s <= 14)
        print(f"  {name}: box {lifted + 0.0 if lifted > 0.5 else 0:.0f} mm up, {FINGERS[firmest]} {force[:, firmest].mean():.2f} N, {np.sqrt(np.mean((force[:, firmest] - force[:, firmest].mean()) ** 2)):.4f} N rms")
        times = [s.time_s for s in r.states if 6 <= s.time_s <= 10]
        axes.plot(times, [s.force_commanded_n[firmest] for s in r.states if 6 <= s.time_s <= 10], lw=1, label=name)
    axes.set(xlabel="s", ylabel=f"{FINGERS[firmest]}, N", title="The same grasp with a glove of 8 bits, filtered three ways")
    axes.grid(True, alpha=0.3)
    axes.legend()
    figure.savefig(OUT + "/tuning-filter.png", dpi=80)


def main():
    os.makedirs(OUT, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        postures(folder)
        coupling(folder)
        filters(folder)


if __name__ == "__main__":
    main()
