# SPDX-License-Identifier: BSD-3-Clause
"""Solvers, narrow phases and presets side by side on every recorded trace: what the object does while it is held
(test_replay --measure), and instructions of a step (callgrind, three traces). Writes data/bench/solvers.csv and prints
the table of README and DESIGN. No figure depends on the load of the machine."""
import csv
import os
import subprocess
import sys

sys.path.insert(0, "test/support")
from callgrind import mean  # noqa: E402 (test/support is no package)

B = os.environ.get("B", "build/gcc-O2")
TABLE = "data/bench/solvers.csv"
VARIANTS = ("default", "newton", "dantzig", "quickstep", "libccd", "stock", "paper", "finger_joints", "pads")
COUNTED = ("power_box", "bar_frame", "power_bunny250")
FIRST, STEPS = 6500, 100
COLUMNS = ("trace", "variant", "slip_mm", "tilt_deg", "depth_mm", "loaded", "outside_cone", "worst", "newton", "dantzig",
           "quickstep", "apart_mm", "instructions")


def measure(variant):
    run = subprocess.run([f"{B}/test/test_replay", "--measure", variant], capture_output=True, text=True, check=True)
    for line in csv.reader(run.stdout.splitlines()):
        row = dict(zip(COLUMNS, line))
        row["instructions"] = mean(row["trace"], FIRST, STEPS, variant) if row["trace"] in COUNTED else ""
        yield row


def share(row, key):
    return 100 * int(row[key]) / max(1, int(row["loaded"]))


def main():
    rows = [row for variant in VARIANTS for row in measure(variant)]
    with open(TABLE, "w", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    print("| | slip, worst mm | tilt, worst deg | deepest mm | outside the cone | steps newton / dantzig / quickstep | bones apart, mm | "
          "1000 instructions: " + ", ".join(COUNTED) + " |")
    print("|---|---|---|---|---|---|---|---|")
    for variant in VARIANTS:
        mine = [row for row in rows if row["variant"] == variant]
        worst = {key: max(float(row[key]) for row in mine) for key in ("slip_mm", "tilt_deg", "depth_mm", "worst", "apart_mm")}
        loaded = sum(int(row["loaded"]) for row in mine)
        outside = 100 * sum(int(row["outside_cone"]) for row in mine) / max(1, loaded)
        cone = "-" if not loaded else f"{outside:.2g} %" + (f", x{worst['worst']:.2f}" if outside else "")
        steps = " / ".join(f"{sum(int(row[name]) for row in mine)}" for name in ("newton", "dantzig", "quickstep"))
        cost = ", ".join(f"{int(row['instructions']) / 1000:.0f}" for name in COUNTED for row in mine if row["trace"] == name)
        print(f"| {variant} | {worst['slip_mm']:.3f} | {worst['tilt_deg']:.3f} | {worst['depth_mm']:.3f} | {cone} | {steps} | "
              f"{worst['apart_mm']:.2f} | {cost} |")


sys.exit(main())
