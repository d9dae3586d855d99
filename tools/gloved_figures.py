# SPDX-License-Identifier: BSD-3-Clause
"""The figures of gloved-plot: one function each, for one run or for two, of which each has a colour. Made to be read in
print: colours that differ in grey as well, units on every axis, a title that names the runs. A function returns None
where the runs have nothing to show."""
import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402

from gloved_run import FINGERS, PARTS, SENSORS  # noqa: E402

# Okabe and Ito's colours for everybody's eyes.
COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#000000", "#56B4E9")
STYLES = ("-", "--", ":", "-.")
plt.rcParams.update({"font.size": 9, "axes.grid": True, "grid.alpha": 0.3, "axes.spines.top": False, "axes.spines.right": False,
                     "lines.linewidth": 1.2, "savefig.dpi": 150, "legend.frameon": False, "figure.constrained_layout.use": True})


def label(text, runs, number):
    return text if len(runs) == 1 else f"{runs[number].stem}: {text}"


def look(runs, number, item):
    """Colour and line of the item-th curve: of one run each item has a colour, of two each run has one."""
    if len(runs) == 1:
        return {"color": COLORS[item % len(COLORS)]}
    return {"color": COLORS[number], "linestyle": STYLES[item % len(STYLES)]}


def figure_force(runs):
    """Force of each finger"""
    figure, axes = plt.subplots(5, 1, sharex=True, sharey=True, figsize=(7.5, 8.5))
    for finger, axis in enumerate(axes):
        for number, run in enumerate(runs):
            axis.plot(run.step_t, run.step_commanded[:, finger], label=label("commanded", runs, number), **look(runs, number, 0))
            if len(runs) == 1:
                axis.plot(run.step_t, run.step_desired[:, finger], ":", color=COLORS[1], label="wanted by the coupling (simulated)")
                axis.plot(run.t, run.measured[:, finger], "--", color=COLORS[2], label="measured by the device")
        for begin, end in runs[0].phases(finger):
            axis.axvspan(begin, end, color="0.88", zorder=0)
        axis.set_ylabel(f"{FINGERS[finger]} (N)")
    axes[0].legend(loc="upper left", ncols=3)
    axes[-1].set_xlabel("time (s); shaded: the finger touches an object" + (f" ({runs[0].stem})" if len(runs) > 1 else ""))
    return figure


def figure_penetration(runs):
    """Deepest contact of each part of the simulated hand"""
    figure, axis = plt.subplots(figsize=(7.5, 3.5))
    for number, run in enumerate(runs):
        if len(runs) > 1:
            axis.plot(run.step_t, run.step_depth * 1e3, label=label("deepest", runs, number), **look(runs, number, 0))
            continue
        for part, name in enumerate(PARTS):
            axis.plot(run.t, run.depth[:, part] * 1e3, color=COLORS[part], label=name)
    axis.set(xlabel="time (s)", ylabel="penetration (mm)")
    axis.legend(ncols=3)
    return figure


def figure_force_depth(runs):
    """Contact force of each part of the hand against its penetration"""
    figure, axis = plt.subplots(figsize=(7.5, 4.5))
    for number, run in enumerate(runs):
        for part, name in enumerate(PARTS):
            touching = run.contact_force[:, part] > 0
            text = name if len(runs) == 1 else label("all parts", runs, number) if part == 0 else None
            color = COLORS[part] if len(runs) == 1 else COLORS[number]
            axis.plot(run.depth[touching, part] * 1e3, run.contact_force[touching, part], ".", markersize=3, color=color, label=text)
    axis.set(xlabel="deepest contact (mm)", ylabel="sum of contact forces (N)")
    axis.legend(ncols=2, markerscale=3)
    return figure


def figure_angles(runs):
    """The 22 joint angles as measured by the glove, smoothed"""
    groups = [[i for i, s in enumerate(SENSORS) if s.startswith(f)] for f in FINGERS] + [[19, 20, 21]]
    figure, axes = plt.subplots(6, 1, sharex=True, figsize=(7.5, 10))
    for axis, group, title in zip(axes, groups, FINGERS + ("palm, wrist",)):
        for number, run in enumerate(runs):
            for item, sensor in enumerate(group):
                axis.plot(run.t, np.degrees(run.angle[:, sensor]), label=label(SENSORS[sensor], runs, number), **look(runs, number, item))
        axis.set_ylabel(f"{title} (°)")
        axis.legend(loc="center left", bbox_to_anchor=(1, 0.5), fontsize=7)
    axes[-1].set_xlabel("time (s)")
    return figure


def figure_objects(runs):
    """Where the simulated objects that can move are, and how far they turned"""
    if not any(run.objects for run in runs):
        return None
    figure, axes = plt.subplots(2, 1, sharex=True, figsize=(7.5, 5.5))
    for number, run in enumerate(runs):
        for index, name in enumerate(run.objects):
            for axis_number, axis_name in enumerate("xyz"):
                axes[0].plot(run.t, run.position[:, index, axis_number] * 1e3, label=label(f"{name} {axis_name}", runs, number),
                             **look(runs, number, 3 * index + axis_number))
            axes[1].plot(run.t, np.degrees(run.turned[:, index]), label=label(name, runs, number), **look(runs, number, index))
    axes[0].set_ylabel("position (mm)")
    axes[1].set(xlabel="time (s)", ylabel="turned since the start (°)")
    for axis in axes:
        axis.legend(loc="center left", bbox_to_anchor=(1, 0.5), fontsize=7)
    return figure


def plot_histogram(axis, runs, names):
    for number, run in enumerate(runs):
        for item, name in enumerate(names if len(runs) == 1 else names[:1]):
            found = run.histogram(name)
            if found:
                upper, count, h = found
                axis.step(upper, count, where="pre", label=label(f"{name} (p50 {h.p50_us:.1f}, p99 {h.p99_us:.1f})", runs, number), **look(runs, number, item))
    axis.axvline(runs[0].period_us, color="0.4", linewidth=0.8, label=f"period ({runs[0].period_us:.0f})")
    axis.set(xscale="log", yscale="log", xlabel="duration (µs)")
    axis.legend(fontsize=7, loc="upper center", bbox_to_anchor=(0.5, -0.15))


def figure_timing(runs):
    """Work of a step and its stages, and the delay of waking up, over the whole run"""
    panels = [names for names in (("step", "compute", "poll", "send", "tell"), ("wake",)) if any(run.histogram(names[0]) for run in runs)]
    if not panels:  # nothing was published; without a clock nothing wakes up
        return None
    figure, axes = plt.subplots(1, len(panels), sharey=True, squeeze=False, figsize=(7.5, 4.5))
    for axis, names in zip(axes[0], panels):
        plot_histogram(axis, runs, names)
    axes[0][0].set_ylabel("steps")
    return figure


def figure_energy(runs):
    """Energy in the springs between the measured and the simulated hand"""
    figure, axis = plt.subplots(figsize=(7.5, 3.5))
    for number, run in enumerate(runs):
        for part, name in enumerate(PARTS if len(runs) == 1 else ()):
            axis.plot(run.t, run.energy[:, part] * 1e3, color=COLORS[part], label=name)
        axis.plot(run.t, run.energy.sum(axis=1) * 1e3, color="0.5" if len(runs) == 1 else COLORS[number], linewidth=0.8,
                  label=label("all", runs, number))
    axis.set(xlabel="time (s)", ylabel="energy of the coupling (mJ)")
    axis.legend(ncols=3)
    return figure


FIGURES = {"force": figure_force, "penetration": figure_penetration, "force-penetration": figure_force_depth, "angles": figure_angles,
           "objects": figure_objects, "timing": figure_timing, "energy": figure_energy}


def draw(runs, folder):
    """Every figure as FOLDER/RUN-NAME.png, .pdf and .svg; returns (name without ending, what it shows)."""
    names = " and ".join(run.stem for run in runs)
    drawn = []
    for name, make in FIGURES.items():
        figure = make(runs)
        if figure is None:
            continue
        figure.suptitle(f"{make.__doc__}: {names}", fontsize=10)
        file = f"{'-'.join(run.stem for run in runs)}-{name}"
        for ending in ("png", "pdf", "svg"):
            figure.savefig(f"{folder}/{file}.{ending}")
        plt.close(figure)
        drawn.append((file, make.__doc__))
    return drawn
