# SPDX-License-Identifier: BSD-3-Clause
"""The report of `make zwidth`, in this folder: how stiff the coupling may be (zwidth.csv, table.md), and two pictures. Reads the
worker's rows; the name of each file says what they are of."""
import csv
import os
import sys

import matplotlib
matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.patches import Patch

FINGERS = {"relaxed": "tab:blue", "normal": "black", "firm": "tab:red"}
AXES = ("task", "device", "rate", "delay_ms", "quantum", "filter_hz", "passivity", "finger")
USUAL = {"task": "press", "device": "best", "rate": "1000", "delay_ms": "0", "quantum": "0", "filter_hz": "30", "passivity": "off", "finger": "normal"}
COLORS = ("#d5ecd4", "#ffe9a8", "#f0a39a", "#cccccc")
CLASS = {"stable": 0, "noisy": 1, "oscillates": 2}
LEVELS = ("quiet: force std below 0.05 N", "noisy: above", "oscillates: above a fifth of the force", "no answer (limit of force, dropped)")


def read(path):
    words = dict(USUAL, **dict(word.split("=") for word in os.path.basename(path)[:-len(".csv")].split("+")))
    with open(path) as file:
        rows = [{**row, "k": float(row["k_n_m"]), "d": float(row["d_n_s_m"])} for row in csv.DictReader(file)]
    return words, rows


def most(rows, good):
    """The stiffest coupling up to which all are good, at one damping; 0: none is."""
    best = 0.0
    for row in sorted(rows, key=lambda row: row["k"]):
        if row["outcome"] not in good:
            break
        best = row["k"]
    return best


def quiet(rows):
    return most(rows, ("stable",))


def stable(rows):
    return most(rows, ("stable", "noisy"))


def write_table(runs):
    with open("zwidth.csv", "w", newline="") as file:
        out = csv.writer(file, lineterminator="\n")
        out.writerow((*AXES, "d_n_s_m", "quiet_k_n_m", "stable_k_n_m"))
        for words, rows in runs:
            for d in sorted({row["d"] for row in rows}):
                mine = [row for row in rows if row["d"] == d]
                out.writerow((*(words[a] for a in AXES), f"{d:g}", f"{quiet(mine):g}", f"{stable(mine):g}"))


# ---- the map ------------------------------------------------------------------------------------------------------
def draw_panel(ax, of_finger):
    rows = of_finger["normal"]
    k, d = sorted({row["k"] for row in rows}), sorted({row["d"] for row in rows})
    cell = np.full((len(k), len(d)), 3)
    for row in rows:
        cell[k.index(row["k"]), d.index(row["d"])] = CLASS.get(row["outcome"], 3)
    ratio = k[1] / k[0]
    edges = np.array([k[0] / np.sqrt(ratio), *(np.array(k) * np.sqrt(ratio))])
    ax.pcolormesh(np.arange(len(d) + 1) - 0.5, edges, cell, cmap=ListedColormap(COLORS), vmin=-0.5, vmax=3.5)
    for finger, color in FINGERS.items():
        for style, limit in (("-", quiet), ("--", stable)):
            top = np.array([limit([row for row in of_finger[finger] if row["d"] == one]) for one in d])
            top = np.where(top > 0, top * np.sqrt(ratio), edges[0])
            ax.stairs(top, np.arange(len(d) + 1) - 0.5, color=color, ls=style, lw=1.6, baseline=None)
    ax.set_yscale("log")
    ax.set_ylim(edges[0], edges[-1])
    ax.set_xticks(range(len(d)), [f"{one:g}" for one in d])


def draw_map(runs):
    panels = {}
    for words, rows in runs:
        key = (words["device"], words["filter_hz"], words["rate"], words["delay_ms"])
        panels.setdefault(key, {})[words["finger"]] = rows
    fig, axes = plt.subplots(4, 4, figsize=(15, 15), sharex=True, sharey=True)
    order = [(device, hz) for device in ("best", "real") for hz in ("30", "0")]
    columns = [(rate, delay) for rate in ("1000", "5000") for delay in ("0", "2")]
    for i, (device, hz) in enumerate(order):
        for j, (rate, delay) in enumerate(columns):
            ax = axes[i][j]
            draw_panel(ax, panels[device, hz, rate, delay])
            ax.set_title(f"{'perfect' if device == 'best' else 'real'} device, {int(rate) / 1000:g} kHz, delay {delay} ms\nfilter {'on' if hz != '0' else 'off'}",
                         fontsize=10)
    for ax in axes[-1]:
        ax.set_xlabel("damping of the coupling, N s/m")
    for ax in axes[:, 0]:
        ax.set_ylabel("stiffness of the coupling, N/m")
    lines = [plt.Line2D([], [], color=color, label=f"{finger} finger") for finger, color in FINGERS.items()]
    lines += [plt.Line2D([], [], color="0.4", ls=style, label=label) for style, label in (("-", "quiet up to here"), ("--", "no oscillation up to here"))]
    patches = [Patch(color=color, label=label) for color, label in zip(COLORS, LEVELS)]
    fig.legend(handles=patches + lines, loc="lower center", ncol=3, fontsize=10, title="colours: the normal finger")
    fig.suptitle("An index finger presses on a wall: where the loop is quiet, and where it oscillates", fontsize=14)
    fig.tight_layout(rect=(0, 0.075, 1, 0.985))
    fig.savefig("zwidth-map.png", dpi=65)


# ---- the lines ----------------------------------------------------------------------------------------------------
def draw_lines(runs):
    fig, axes = plt.subplots(2, 4, figsize=(17, 8), sharey=True)
    delay = "delay of the wire, both ways together, ms"
    for j, (given, axis, label) in enumerate((("delay_ms", "delay_ms", delay), ("passivity", "delay_ms", delay), ("rate", "rate", "rate of loop and glove, Hz"),
                                              ("quantum", "quantum", "quantum of the sensors, rad (0: 12 bits)"))):
        for i, hz in enumerate(("30", "0")):
            ax = axes[i][j]
            mine = [(w, rows) for w, rows in runs if w["filter_hz"] == hz and w["given"] == given]
            at = sorted({float(w[axis]) for w, _ in mine})
            for finger, color in FINGERS.items():
                of = {float(w[axis]): rows for w, rows in mine if w["finger"] == finger}
                for style, limit in (("-", quiet), ("--", stable)):
                    ax.plot(range(len(at)), [max(limit(of[x]), 80) for x in at], style, marker="o", ms=4, color=color,
                            label=f"{finger}, {'quiet' if style == '-' else 'no oscillation'}")
            ax.set_xticks(range(len(at)), [f"{x:g}" for x in at])
            ax.set_yscale("log")
            ax.set_ylim(70, 1.3e5)
            ax.grid(alpha=0.3)
            ax.set_title(f"filter {'on' if hz != '0' else 'off'}, passivity controller {'on' if given == 'passivity' else 'off'}", fontsize=10)
            ax.set_xlabel(label)
    for ax in axes[:, 0]:
        ax.set_ylabel("largest stiffness of the coupling, N/m")
    handles, labels = axes[0][0].get_legend_handles_labels()
    fig.legend(handles, labels, loc="lower center", ncol=3)
    fig.suptitle("Critical damping, otherwise a perfect device at 1 kHz without delay (80: none is; 1e5: all are)")
    fig.tight_layout(rect=(0, 0.08, 1, 0.99))
    fig.savefig("zwidth-lines.png", dpi=80)


# ---- the table ----------------------------------------------------------------------------------------------------
def words_of(rows):
    top = max(row["k"] for row in rows)
    low = min(row["k"] for row in rows)
    return ", ".join("none" if k == 0 else f"{k:,.0f}" + (" (all)" if k == top else "") for k in (quiet(rows), stable(rows))), low


def write_markdown(grasps):
    lines = ["| device | rate | delay | relaxed finger | normal | firm |", "|---|---|---|---|---|---|"]
    for device in ("best", "real"):
        for rate in ("1000", "5000"):
            for delay in ("0", "2"):
                cells = []
                for finger in FINGERS:
                    rows = next(rows for w, rows in grasps if (w["device"], w["rate"], w["delay_ms"], w["finger"]) == (device, rate, delay, finger))
                    cells.append(words_of(rows)[0])
                lines.append(f"| {'perfect' if device == 'best' else 'real'} | {int(rate) / 1000:g} kHz | {delay} ms | " + " | ".join(cells) + " |")
    with open("table.md", "w") as file:
        file.write("\n".join(lines) + "\n")
    print("\n".join(lines))


def main():
    maps, lines, grasps = [], [], []
    for path in sys.argv[1:]:
        words, rows = read(path)
        words["given"] = os.path.basename(path).split("=")[0]
        (maps if path.startswith("maps/") else grasps if words["task"] == "power" else lines).append((words, rows))
    write_table(maps + lines + grasps)
    draw_map(maps)
    draw_lines(lines)
    write_markdown(grasps)


if __name__ == "__main__":
    main()
