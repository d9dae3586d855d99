# SPDX-License-Identifier: BSD-3-Clause
"""The longest steps of a recorded grasp: of a thousand steps all but one take at most 2.5 times the instructions of the median
step, counted by callgrind on every step. Here the three traces with the longest tails; `make instructions` asks all of
them and writes data/bench/tail_instructions.csv."""
import csv
import os
import sys

sys.path.insert(0, "test/support")
from callgrind import count, traces  # noqa: E402 (test/support is no package)

B = os.environ.get("B", "build/gcc-O2")
TABLE = "data/bench/tail_instructions.csv"
HEAD = ("trace", "steps", "median", "p99", "p999", "max", "p999_over_median")
LONGEST = ("finger_frame", "power_bunny", "power_bunny250")
MOST = 2.5


def row(trace):
    counts = sorted(count(trace))
    at = [counts[min(len(counts) - 1, int(share * len(counts)))] for share in (0.5, 0.99, 0.999, 1)]
    return (trace, len(counts), *at, f"{at[2] / at[0]:.2f}")


def main():
    if os.path.basename(B) != "gcc-O2":
        print("skip test_tail: the figures are of gcc -O2, and this build is another; make test without CC= and OPT= runs it")
        return
    rows, failed, update = [], False, "--update" in sys.argv
    for trace in traces():
        if trace not in LONGEST and not update:
            continue
        rows.append(row(trace))
        _, steps, median, _, p999, _, over = rows[-1]
        print(f"figure {trace:15} {median} instructions a step, {p999} in the longest of a thousand: {over} times")
        good = steps > 5000 and median > 10000 and float(over) <= MOST
        print("ok" if good else "FAIL", f"{trace}_has_a_short_tail")
        failed = failed or not good
    if update:
        with open(TABLE, "w", newline="") as file:
            csv.writer(file, lineterminator="\n").writerows([HEAD, *rows])
    sys.exit(failed)


main()
