# SPDX-License-Identifier: BSD-3-Clause
"""The report's three pictures, data/pictures/report-*.svg, of the tables that the page is made of. Usage: plots.py; `make report` calls
it, in the virtual environment of matplotlib."""
import csv

import matplotlib

matplotlib.use("Agg")
matplotlib.rcParams.update({"svg.hashsalt": "gloved", "svg.fonttype": "none", "font.size": 9})
import matplotlib.pyplot as plt  # noqa: E402 (after the choice of the canvas)

from report import FORCE, PRESETS, STIFFNESSES, TESTS, Figures  # noqa: E402

OUT = "data/pictures/report-"
COLORS = {"paper": "C3", "stock": "C1", "default": "C0", "MuJoCo": "0.5", "Bullet": "0.75"}


def save(figure, name):
    figure.savefig(f"{OUT}{name}.svg", metadata={"Date": None})
    figure.savefig(f"build/report/{name}.png", dpi=90)


def rates(f, trace):
    yield from ((f"preset {preset}" if preset != "default" else "default", 1e6 / f.step_us(preset, trace), COLORS[preset]) for preset in PRESETS)
    yield from ((name, 1e6 / float(f.steps[trace, name.lower()]["median_us"]), COLORS[name]) for name in ("MuJoCo", "Bullet"))


def draw_rates(f):
    figure, axes = plt.subplots(figsize=(8, 3.6), layout="constrained")
    for at, (_, trace, paper) in enumerate(TESTS.values()):
        for k, (name, rate, color) in enumerate(rates(f, trace)):
            axes.bar(at + 0.16 * (k - 2), rate, 0.15, color=color, label=name if at == 0 else None)
        if paper:
            axes.plot([at - 0.42, at + 0.42], [paper, paper], "k-", lw=2, label="the paper's loop, 2005" if at == 0 else None)
            axes.annotate(f"{paper} Hz", (at, 1.12 * paper), ha="center", fontsize=8,
                          bbox={"fc": "w", "ec": "none", "alpha": 0.8, "pad": 0.5})
    axes.axhline(1000, color="k", lw=0.8, ls=":", label="1 kHz, the loop's default")
    axes.set(yscale="log", ylabel="steps a second", xticks=range(len(TESTS)), xticklabels=[name for name, _, _ in TESTS.values()], ylim=(100, 1e6))
    axes.legend(fontsize=7, ncols=4, loc="upper center")
    save(figure, "rate")


def draw_force():
    with open(FORCE, encoding="utf-8") as file:
        rows = list(csv.reader(file))
    columns = list(zip(*([float(v) for v in row] for row in rows[1:])))
    figure, axes = plt.subplots(2, 1, figsize=(8, 4.6), layout="constrained", gridspec_kw={"height_ratios": (3, 2)})
    for name, values in zip(rows[0][1:], columns[1:]):
        preset, _, _, _, device = name.split("-")
        label = f"{preset if preset == 'default' else 'preset ' + preset}, {'perfect' if device == 'best' else 'real'} glove"
        style = dict(color=COLORS[preset], lw=1.6 if device == "best" else 0.7, alpha=0.55 if device == "best" else 1.0, label=label)
        axes[0].plot(columns[0], values, **style)
        if preset == "default":
            axes[1].plot(columns[0], values, **style)
    axes[0].set(ylabel="thumb, N", xlim=(1, 14.6))
    axes[0].legend(fontsize=7, loc="lower right")
    kept = [v for t, row in zip(columns[0], zip(columns[1], columns[3])) if t > 6 for v in row]
    axes[1].set(xlabel="s: closes from 2.2, lifts from 3.6, holds from 4.6", ylabel="thumb, N, while held", xlim=(6, 14.6),
                ylim=(min(kept) - 0.05, max(kept) + 0.05))
    for ax in axes:
        ax.grid(True, alpha=0.3)
    save(figure, "force")


def draw_couplings(f):
    figure, axes = plt.subplots(figsize=(8, 3.6), layout="constrained")
    for rate, mark in ((1000, "-"), (5000, "--")):
        for device, color in (("best", "C0"), ("real", "C3")):
            rows = [f.run("default", "box", device, k, rate) for k in STIFFNESSES]
            noise = [max(float(r["std_n"]), 1e-5) for r in rows]
            axes.plot(STIFFNESSES, noise, mark, color=color, label=f"{'perfect' if device == 'best' else 'real'} glove, {rate // 1000} kHz")
            for lost, shape in ((False, "o"), (True, "X")):
                at = [(k, n) for k, n, r in zip(STIFFNESSES, noise, rows) if (r["held"] != r["seeds"]) == lost]
                axes.plot([k for k, _ in at], [n for _, n in at], shape, color=color, ms=8 if lost else 4)
    axes.plot([], [], "X", color="k", ms=8, label="not held on every seed")
    axes.axhline(0.05, color="k", lw=0.8, ls=":", label="noticed at rest")
    axes.set(xscale="log", yscale="log", xlabel="coupling.limb.k_f, N/m (the paper: 200)", ylabel="noise of the thumb's force, N, worst seed",
             xticks=STIFFNESSES, xticklabels=STIFFNESSES)
    axes.minorticks_off()
    axes.grid(True, alpha=0.3)
    axes.legend(fontsize=7)
    save(figure, "couplings")


def main():
    figures = Figures()
    draw_rates(figures)
    draw_force()
    draw_couplings(figures)


if __name__ == "__main__":
    main()
