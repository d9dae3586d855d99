# SPDX-License-Identifier: BSD-3-Clause
"""Instructions of a step while the hand holds an object, counted by callgrind, beside those in data/bench/instructions.csv:
a figure that no load on the machine changes. A twentieth more is a failure; what is meant is written by `make instructions`."""
import csv
import os
import re
import subprocess
import sys
import tempfile

B = os.environ.get("B", "build/gcc-O2")
TABLE = "data/bench/instructions.csv"
SCENES = (("power_box", "box"), ("bar_frame", "frame"), ("pinch_box", "box"))
FIRST, STEPS, MORE = 6500, 100, 1.05


def count(trace, scene):
    with tempfile.TemporaryDirectory() as folder:
        run = subprocess.run(["valgrind", "--tool=callgrind", "--toggle-collect=gv_bench_counted_step",
                              f"--callgrind-out-file={folder}/out", f"{B}/test/bench_engine", f"trace:data/traces/{trace}/input.log.gz?speed=0",
                              f"data/scenes/{scene}.scene", scene, "-", str(FIRST), str(STEPS)], capture_output=True, text=True)
    found = re.search(r"Collected : (\d+)", run.stderr)
    assert run.returncode == 0 and found, run.stderr
    return round(int(found.group(1)) / STEPS)


def main():
    if os.path.basename(B) != "gcc-O2":
        print("skip test_instructions: the table is of gcc -O2")
        return
    counted = {trace: count(trace, scene) for trace, scene in SCENES}
    if "--update" in sys.argv:
        with open(TABLE, "w", newline="") as file:
            csv.writer(file, lineterminator="\n").writerows([("trace", "instructions"), *counted.items()])
    with open(TABLE) as file:
        table = {row["trace"]: int(row["instructions"]) for row in csv.DictReader(file)}
    failed = False
    for trace, now in counted.items():
        print(f"figure {trace:12} {now} instructions a step, {now / table[trace]:.3f} of the table's")
        good = 1000 < now <= MORE * table[trace]
        print("ok" if good else "FAIL", f"{trace}_costs_what_it_did")
        failed = failed or not good
    sys.exit(failed)


main()
