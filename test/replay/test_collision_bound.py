# SPDX-License-Identifier: BSD-3-Clause
"""The most that collision detection takes in a step, in instructions counted by callgrind, on the crowds of
test/unit/test_crowd.c: the bound that its budget makes, beside data/bench/collision_bound.csv. A twentieth more is a failure;
what is meant is written by `make instructions`."""
import csv
import glob
import os
import re
import subprocess
import sys
import tempfile

B = os.environ.get("B", "build/gcc-O2")
TABLE = "data/bench/collision_bound.csv"
STEPS, MORE = 12, 1.05


def most(scene):
    """Of the steps' instructions in gv_engine_collide: callgrind writes a file after each call."""
    with tempfile.TemporaryDirectory() as folder:
        run = subprocess.run(["valgrind", "--tool=callgrind", "--toggle-collect=gv_engine_collide", "--dump-after=gv_engine_collide",
                              f"--callgrind-out-file={folder}/out", f"{B}/test/test_crowd", "--steps", scene, str(STEPS)],
                             capture_output=True, text=True)
        assert run.returncode == 0, run.stderr
        counts = [int(re.search(r"^(?:summary|totals): (\d+)", open(part).read(), re.M).group(1)) for part in glob.glob(f"{folder}/out.*")]
    assert len([count for count in counts if count > 1000]) == STEPS, counts
    return max(counts)


def main():
    if os.path.basename(B) != "gcc-O2":
        print("skip test_collision_bound: the table is of gcc -O2, and this build is another; make test without CC= and OPT= runs it")
        return
    scenes = subprocess.run([f"{B}/test/test_crowd", "--list"], capture_output=True, text=True, check=True).stdout.split()
    counted = {scene: most(scene) for scene in scenes}
    if "--update" in sys.argv:
        with open(TABLE, "w", newline="") as file:
            csv.writer(file, lineterminator="\n").writerows([("scene", "instructions"), *counted.items()])
    with open(TABLE) as file:
        table = {row["scene"]: int(row["instructions"]) for row in csv.DictReader(file)}
    failed = False
    for scene, now in counted.items():
        print(f"figure {scene:12} {now} instructions of collision detection in a step at most, {now / table[scene]:.3f} of the table's")
        good = 1000 < now <= MORE * table[scene]
        print("ok" if good else "FAIL", f"{scene}_keeps_to_its_bound")
        failed = failed or not good
    sys.exit(failed)


main()
