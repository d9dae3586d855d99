# SPDX-License-Identifier: BSD-3-Clause
"""One run of gloved as arrays, from its LCM log: what the figures and tables of gloved-plot are made of. SI units."""
import os

import numpy as np

import gloved_log
from gloved_names import FINGERS, SAFETY, SENSORS  # noqa: F401 (for gloved-plot)

PARTS = FINGERS + ("palm",)


def part_of_limb(limb):
    """0..4 the finger, 5 the palm."""
    return min(limb // 3, 5)


def turn(a, b):
    """Angle in radians between unit quaternions (w first), any shape (..., 4)."""
    return 2 * np.arccos(np.clip(np.abs(np.sum(np.asarray(a) * np.asarray(b), axis=-1)), 0, 1))


def coupling_energy(states, stats):
    """Joules held in the springs between glove and simulated limbs, (states, 6): half k x^2 + half k_t angle^2."""
    k = stats[-1] if stats else None
    limb_k, palm_k = ((k.limb_k_f, k.limb_k_t), (k.palm_k_f, k.palm_k_t)) if k else ((np.nan, np.nan), (np.nan, np.nan))
    energy = np.zeros((len(states), 6))
    for i, state in enumerate(states):
        for number, limb in enumerate(state.limb):
            k_f, k_t = palm_k if number == 15 else limb_k
            x = np.subtract(limb.position_m, limb.driver_position_m)
            angle = turn(limb.quaternion, limb.driver_quaternion)
            energy[i, part_of_limb(number)] += 0.5 * k_f * x @ x + 0.5 * k_t * angle**2
    return energy


def contacts_of(states):
    """Deepest contact (m, 0: none) and contact force (N) of each part of the hand, (states, 6) each."""
    depth, force = np.zeros((len(states), 6)), np.zeros((len(states), 6))
    for i, state in enumerate(states):
        for contact in state.contact:
            if contact.limb < 0:
                continue
            part = part_of_limb(contact.limb)
            depth[i, part] = max(depth[i, part], contact.depth_m)
            force[i, part] += np.linalg.norm(contact.force_n)
    return depth, force


class Run:
    """Arrays over time; `t` seconds of the run, one row per GLOVED_STATE."""

    def __init__(self, path):
        self.log = gloved_log.Log(path)
        self.name = os.path.basename(path)
        self.stem = os.path.splitext(self.name)[0]
        states = self.log.of("GLOVED_STATE")
        if not states:
            raise SystemExit(f"gloved-plot: {path}: no GLOVED_STATE in it; record it with gloved --log")
        self.states, self.stats, self.events = states, self.log.of("GLOVED_STATS"), self.log.of("GLOVED_EVENT")
        self.period_us = 1e6 * self.stats[0].period_s if self.stats else 1000.0
        self.t = np.array([s.time_s for s in states])
        self.commanded = np.array([s.force_commanded_n for s in states])
        self.desired = np.array([s.force_desired_n for s in states])
        self.measured = np.array([s.force_measured_n for s in states])
        self.port_energy = np.array([s.energy_j for s in states])
        self.safety = np.array([s.safety_state for s in states])
        self.angle = np.array([s.angle_rad for s in states])
        self.depth, self.contact_force = contacts_of(states)
        self.energy = coupling_energy(states, self.stats)
        self.objects = [o.name for o in states[0].object if not o.is_static]
        number = [i for i, o in enumerate(states[0].object) if not o.is_static]
        self.position = np.array([[s.object[i].position_m for i in number] for s in states]).reshape(len(states), len(number), 3)
        quaternion = np.array([[s.object[i].quaternion for i in number] for s in states]).reshape(len(states), len(number), 4)
        self.turned = turn(quaternion, quaternion[:1]) if number else np.zeros((len(states), 0))
        self.read_steps()

    def read_steps(self):
        """Every step, where the log has GLOVED_TRACE; otherwise the rows of GLOVED_STATE."""
        steps = {step.step: (step, trace.period_s) for trace in self.log.of("GLOVED_TRACE") for step in trace.step}
        if not steps:
            self.step_t, self.step_commanded, self.step_desired = self.t, self.commanded, self.desired
            self.step_depth, self.step_work_us, self.step_wake_us = self.depth.max(axis=1), None, None
            return
        rows = [steps[number] for number in sorted(steps)]
        self.step_t = np.array([s.step * period for s, period in rows])
        self.step_commanded = np.array([s.force_commanded_n for s, _ in rows])
        self.step_desired = np.array([s.force_desired_n for s, _ in rows])
        self.step_depth = np.array([s.depth_m for s, _ in rows])
        self.step_work_us = np.array([s.work_ns for s, _ in rows]) * 1e-3
        self.step_wake_us = np.array([s.wake_ns for s, _ in rows]) * 1e-3

    def histogram(self, name):
        """Upper edges (us) and counts over the whole run, or None."""
        for h in self.stats[-1].histogram if self.stats else ():
            if h.name == name and h.count:
                return np.array(h.upper_us), np.array(h.in_bin), h
        return None

    def phases(self, part):
        """(begin, end) seconds of each contact of a part of the hand."""
        touching = np.concatenate(([False], self.depth[:, part] + self.contact_force[:, part] > 0, [False]))
        begins, ends = np.flatnonzero(touching[1:] & ~touching[:-1]), np.flatnonzero(~touching[1:] & touching[:-1])
        return [(self.t[b], self.t[min(e, len(self.t) - 1)]) for b, e in zip(begins, ends)]

    def numbers(self):
        """What two runs are compared by: (what, unit, value)."""
        last = self.states[-1]
        rows = [("duration", "s", self.t[-1]), ("steps", "", last.step)]
        rows += [(f"largest force, {name}", "N", force) for name, force in zip(FINGERS, self.step_commanded.max(axis=0))]
        rows += [(f"mean force, {name}", "N", force) for name, force in zip(FINGERS, self.step_commanded.mean(axis=0))]
        rows += [("deepest penetration", "mm", last.depth_max_m * 1e3), ("most energy given out at a tendon", "mJ", -self.port_energy.min(initial=0.0) * 1e3), ("largest energy of the coupling", "mJ", self.energy.sum(axis=1).max() * 1e3),
                 ("missed deadlines", "", last.missed_deadlines), ("frames lost", "", last.frames_lost), ("frames bad", "", last.frames_bad)]
        for name in ("step", "wake"):
            found = self.histogram(name)
            if found:
                rows += [(f"{name} time {q}", "us", getattr(found[2], f"{q}_us")) for q in ("p50", "p99", "max")]
        for number, name in enumerate(self.objects):
            rows.append((f"{name}: highest over its start", "mm", (self.position[:, number, 2].max() - self.position[0, number, 2]) * 1e3))
        return rows

    def figures(self):
        """Rows of the summary table: what, value."""
        last = self.states[-1]
        rows = [("duration", f"{self.t[-1]:.2f} s"), ("steps", f"{last.step}"),
                ("largest force", ", ".join(f"{name} {force:.2f} N" for name, force in zip(FINGERS, self.step_commanded.max(axis=0)))),
                ("deepest penetration", f"{last.depth_max_m * 1e3:.3f} mm"),
                ("largest energy of the coupling", f"{self.energy.sum(axis=1).max() * 1e3:.2f} mJ"),
                ("most energy given out at each tendon", ", ".join(f"{name} {-energy * 1e3 + 0.0:.1f} mJ" for name, energy in zip(FINGERS, self.port_energy.min(axis=0, initial=0.0)))),
                ("missed deadlines", f"{last.missed_deadlines}"), ("frames lost, bad, late", f"{last.frames_lost}, {last.frames_bad}, {last.frames_late}")]
        about = self.log.of("GLOVED_ABOUT")
        if about:
            a = about[0]
            rows += [("made by", f"gloved {a.version} ({a.commit}), {a.date}"), ("command line", a.command_line),
                     ("scene", f"{a.scene} ({a.scene_hash})"), ("settings", a.settings or "the defaults"), ("hand, rate", f"{a.hand}, {a.rate_hz:g} Hz")]
        for name in ("step", "wake"):
            found = self.histogram(name)
            if found:
                h = found[2]
                rows.append((f"{name} time p50, p99, p99.9, max", f"{h.p50_us:.1f}, {h.p99_us:.1f}, {h.p999_us:.1f}, {h.max_us:.1f} us"))
        for number, name in enumerate(self.objects):
            rows.append((f"{name}: highest over its start", f"{(self.position[:, number, 2].max() - self.position[0, number, 2]) * 1e3:.1f} mm"))
        return rows
