# SPDX-License-Identifier: BSD-3-Clause
"""The figures of gloved-plot: one function each, one or two runs (the second dashed). Made to be read in print:
colours that differ in grey as well, units on every axis."""
import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402

from gloved_run import FINGERS, PARTS, SENSORS  # noqa: E402

# Okabe and Ito's colours for everybody's eyes.
COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#000000", "#56B4E9")
STYLES = ("-", "--")
plt.rcParams.update({"font.size": 9, "axes.grid": True, "grid.alpha": 0.3, "axes.spines.top": False, "axes.spines.right": False,
                     "lines.linewidth": 1.2, "savefig.dpi": 150, "legend.frameon": False, "figure.constrained_layout.use": True})


def label(text, runs, number):
    return text if len(runs) == 1 else f"{text}, {'AB'[number]}"


def figure_force(runs):
    """Force of each finger; shaded while the finger touches something."""
    figure, axes = plt.subplots(5, 1, sharex=True, sharey=True, figsize=(7.5, 8.5))
    for finger, axis in enumerate(axes):
        for number, run in enumerate(runs):
            axis.plot(run.step_t, run.step_commanded[:, finger], STYLES[number], color=COLORS[0], label=label("commanded", runs, number))
            if len(runs) == 1:
                axis.plot(run.step_t, run.step_desired[:, finger], ":", color=COLORS[1], label="wanted by the coupling")
                axis.plot(run.t, run.measured[:, finger], "--", color=COLORS[2], label="measured by the device")
        for begin, end in runs[0].phases(finger):
            axis.axvspan(begin, end, color="0.88", zorder=0)
        axis.set_ylabel(f"{FINGERS[finger]} (N)")
    axes[0].legend(loc="upper left", ncols=3)
    axes[-1].set_xlabel("time (s); shaded: the finger touches an object" + (" (run A)" if len(runs) > 1 else ""))
    return figure


def figure_penetration(runs):
    """Deepest contact of each part of the hand."""
    figure, axis = plt.subplots(figsize=(7.5, 3.5))
    for number, run in enumerate(runs):
        if len(runs) > 1:
            axis.plot(run.step_t, run.step_depth * 1e3, STYLES[number], color=COLORS[number], label=label("deepest", runs, number))
            continue
        for part, name in enumerate(PARTS):
            axis.plot(run.t, run.depth[:, part] * 1e3, color=COLORS[part], label=name)
    axis.set(xlabel="time (s)", ylabel="penetration (mm)")
    axis.legend(ncols=3)
    return figure


def figure_angles(runs):
    """The 22 joint angles."""
    groups = [[i for i, s in enumerate(SENSORS) if s.startswith(f)] for f in FINGERS] + [[19, 20, 21]]
    figure, axes = plt.subplots(6, 1, sharex=True, figsize=(7.5, 10))
    for axis, group, title in zip(axes, groups, FINGERS + ("palm, wrist",)):
        for number, run in enumerate(runs):
            for color, sensor in enumerate(group):
                axis.plot(run.t, np.degrees(run.angle[:, sensor]), STYLES[number], color=COLORS[color], label=SENSORS[sensor] if number == 0 else None)
        axis.set_ylabel(f"{title} (°)")
        axis.legend(loc="center left", bbox_to_anchor=(1, 0.5), fontsize=7)
    axes[-1].set_xlabel("time (s)")
    return figure


def figure_objects(runs):
    """Where the objects that can move are, and how far they turned."""
    figure, axes = plt.subplots(2, 1, sharex=True, figsize=(7.5, 5.5))
    for number, run in enumerate(runs):
        for index, name in enumerate(run.objects):
            for axis_number, axis_name in enumerate("xyz"):
                axes[0].plot(run.t, run.position[:, index, axis_number] * 1e3, STYLES[number], color=COLORS[(3 * index + axis_number) % 7],
                             label=label(f"{name} {axis_name}", runs, number))
            axes[1].plot(run.t, np.degrees(run.turned[:, index]), STYLES[number], color=COLORS[index % 7], label=label(name, runs, number))
    axes[0].set_ylabel("position (mm)")
    axes[1].set(xlabel="time (s)", ylabel="turned since the start (°)")
    for axis in axes:
        axis.legend(loc="center left", bbox_to_anchor=(1, 0.5), fontsize=7)
    return figure


def figure_timing(runs):
    """Histograms of the whole run: work of a step and its stages, and the delay of waking up."""
    figure, axes = plt.subplots(1, 2, sharey=True, figsize=(7.5, 4.5))
    for axis, names in zip(axes, (("step", "compute", "poll", "send", "tell"), ("wake",))):
        for number, run in enumerate(runs):
            for color, name in enumerate(names if len(runs) == 1 else names[:1]):
                found = run.histogram(name)
                if found:
                    upper, count, h = found
                    axis.step(upper, count, STYLES[number], where="pre", color=COLORS[color + 2 * number],
                              label=label(f"{name} (p50 {h.p50_us:.1f}, p99 {h.p99_us:.1f})", runs, number))
        axis.set(xscale="log", yscale="log", xlabel="duration (µs)")
        if axis.get_legend_handles_labels()[0]:  # no waking up in a replay as fast as possible
            axis.legend(fontsize=7, loc="upper center", bbox_to_anchor=(0.5, -0.15))
    axes[0].set_ylabel("steps")
    return figure


def figure_energy(runs):
    """Energy in the springs between the measured and the simulated hand."""
    figure, axis = plt.subplots(figsize=(7.5, 3.5))
    for number, run in enumerate(runs):
        for part, name in enumerate(PARTS if len(runs) == 1 else ()):
            axis.plot(run.t, run.energy[:, part] * 1e3, color=COLORS[part], label=name)
        axis.plot(run.t, run.energy.sum(axis=1) * 1e3, STYLES[number], color="0.5" if len(runs) == 1 else COLORS[number], linewidth=0.8,
                  label=label("all", runs, number))
    axis.set(xlabel="time (s)", ylabel="energy of the coupling (mJ)")
    axis.legend(ncols=3)
    return figure


FIGURES = {"force": figure_force, "penetration": figure_penetration, "angles": figure_angles, "objects": figure_objects,
           "timing": figure_timing, "energy": figure_energy}


def draw(runs, folder):
    """Every figure as FOLDER/NAME.png; returns (name, what it shows)."""
    for name, make in FIGURES.items():
        figure = make(runs)
        figure.savefig(f"{folder}/{name}.png")
        plt.close(figure)
    return [(name, make.__doc__) for name, make in FIGURES.items()]
