# SPDX-License-Identifier: BSD-3-Clause
"""How far each step of every recorded grasp is from the laws of contact, with each solver of the engine and in MuJoCo and
Bullet: the four residuals of "Contact Models in Robotics: a Comparative Analysis" (arXiv 2304.06372), of the worst contact
of a step (test/support/contact_laws.h, bench_mujoco.c, bench_bullet.py). Writes data/bench/residuals.csv and prints the
table of DESIGN. No figure depends on the load of the machine. Usage: residuals.py BUILD [TRACE...]; `make residuals`."""
import csv
import json
import os
import subprocess
import sys

import numpy as np

from bench import WORK, Program, list_scenes, mujoco_model
from bench_bullet import Bullet

TABLE = "data/bench/residuals.csv"
VARIANTS = ("newton", "dantzig", "quickstep", "stock", "paper")
SOLVERS = VARIANTS + ("mujoco", "bullet")
LAWS = ("signorini", "coulomb_n", "dissipation_w", "momentum_n_s")
# The paper's fixed limits are no cone.
NOT_JUDGED = {"paper": ("coulomb_n", "dissipation_w")}
HEAD = ["trace", "solver", "steps"] + [f"{law}_{what}" for law in LAWS for what in ("median", "p99", "max")]


def ask_engine(build, trace, variant):
    run = subprocess.run([f"{build}/test/bench_laws", trace, variant], stdout=subprocess.PIPE, check=True)
    return np.frombuffer(run.stdout).reshape(-1, len(LAWS))


def ask_peers(build, row):
    """Steps in which the hand is there and something touches."""
    name, scene_path, url, obj, _ = row
    drivers, model = f"{WORK}/{name}.drivers", f"{WORK}/{name}.xml"
    engine = Program(f"{build}/test/bench_engine", url, scene_path, obj, drivers)
    scene = json.loads(engine.line())
    engine.close()
    with open(model, "w") as file:
        file.write(mujoco_model(scene))
    peer = Program(f"{build}/test/bench_mujoco", model, drivers, obj, "laws")
    records = peer.run(0, scene["steps"], 12)
    peer.close()
    yield "mujoco", records[records[:, 3] > 0, 8:]
    records = Bullet(scene, drivers, obj).run(0, scene["steps"], laws=True)
    yield "bullet", records[records[:, 12] > 0, 8:12]


def table_row(trace, solver, laws):
    at = np.percentile(laws, [50, 99, 100], axis=0)
    figures = ["" if law in NOT_JUDGED.get(solver, ()) else f"{at[k][i]:.2g}" for i, law in enumerate(LAWS) for k in range(3)]
    return [trace, solver, len(laws)] + figures


def ask(build, row):
    """One row of the table for each solver, and all that they said."""
    answers = {variant: ask_engine(build, row[0], variant) for variant in VARIANTS}
    answers.update(ask_peers(build, row))
    for solver, laws in answers.items():
        print("  ".join(f"{v:>9}" for v in table_row(row[0], solver, laws)), flush=True)
    return answers


def print_worst(answers):
    """Medians over the steps of all traces, and the worst of them."""
    print("| | " + " | ".join(LAWS) + " |\n|---" + "|---" * len(LAWS) + "|")
    for solver in SOLVERS:
        laws = np.concatenate([a[solver] for a in answers.values()])
        cells = ["-" if law in NOT_JUDGED.get(solver, ()) else
                 ", ".join(f"{v:.1e}" for v in np.percentile(laws[:, i], [50, 99, 100])) for i, law in enumerate(LAWS)]
        print(f"| {solver} | " + " | ".join(cells) + " |")


def publish(build, names=()):
    os.makedirs(WORK, exist_ok=True)
    answers = {row[0]: ask(build, row) for row in list_scenes(names)}
    print_worst(answers)
    if names:
        return
    with open(TABLE, "w", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows(
            [HEAD] + [table_row(trace, solver, a[solver]) for trace, a in answers.items() for solver in SOLVERS])


if __name__ == "__main__":
    publish(sys.argv[1], sys.argv[2:])
