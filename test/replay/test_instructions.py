# SPDX-License-Identifier: BSD-3-Clause
"""Instructions of a step while the hand holds an object, counted by callgrind, beside those in data/bench/instructions.csv:
a figure that no load on the machine changes. A twentieth more is a failure; what is meant is written by `make instructions`."""
import csv
import os
import sys

sys.path.insert(0, "test/support")
from callgrind import mean  # noqa: E402 (test/support is no package)

B = os.environ.get("B", "build/gcc-O2")
TABLE = "data/bench/instructions.csv"
TRACES = ("power_box", "bar_frame", "pinch_box")
FIRST, STEPS, MORE = 6500, 100, 1.05


def main():
    if os.path.basename(B) != "gcc-O2":
        print("skip test_instructions: the table is of gcc -O2, and this build is another; make test without CC= and OPT= runs it")
        return
    counted = {trace: mean(trace, FIRST, STEPS) for trace in TRACES}
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
