# SPDX-License-Identifier: BSD-3-Clause
"""Instructions of each step of a recorded grasp, counted by callgrind: a figure that no load on the machine changes."""
import os
import re
import subprocess

BENCH = os.path.join(os.environ.get("B", "build/gcc-O2"), "test/bench_engine")
ALL_STEPS = 60000


def expected(trace):
    """What data/traces/NAME/expected says, by the first word of each line."""
    with open(f"data/traces/{trace}/expected") as file:
        words = [line.split() for line in file if not line.startswith(("chain", "#"))]
    return {line[0]: line[1:] for line in words if line}


def traces():
    """Those whose scene is compiled here."""
    names = sorted(os.listdir("data/traces"))
    return [name for name in names if os.path.exists(expected(name)["scene"][0])]


def ask(command, variant="default"):
    """Instructions of each step that a program says it has done: one number for each."""
    valgrind = ["valgrind", "--tool=callgrind", "--instr-atstart=no", "--toggle-collect=gv_bench_counted_step",
                "--callgrind-out-file=/dev/null"]
    run = subprocess.run(valgrind + command, capture_output=True, text=True, env={**os.environ, "GV_VARIANT": variant})
    so_far = [0] + [int(n) for n in re.findall(r"^events-1: (\d+)$", run.stderr, re.M)]
    assert run.returncode == 0 and len(so_far) > 1, run.stderr
    return [after - before for before, after in zip(so_far, so_far[1:])]


def count(trace, first=0, steps=ALL_STEPS, variant="default"):
    """Of the engine's steps. variant: of test/replay/expectation.h."""
    what = expected(trace)
    return ask([BENCH, f"trace:data/traces/{trace}/input.log.gz?speed=0", what["scene"][0], what["object"][0], "-",
                str(first), str(steps)], variant)


def mean(trace, first, steps, variant="default"):
    return round(sum(count(trace, first, steps, variant)) / steps)
