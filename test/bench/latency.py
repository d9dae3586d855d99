# SPDX-License-Identifier: BSD-3-Clause
"""From a glove's frame to the force that answers it, over UDP, in blocks that alternate with a bare echo; and the loop's
wake-up, in blocks that alternate with cyclictest. A machine whose load changes changes all kinds alike: compare medians.
Writes data/bench/latency.csv and latency.png. Usage: latency.py BUILD [ROUNDS [SECONDS]]; `make latency` calls it."""
import csv
import json
import os
import subprocess
import sys
import time

import matplotlib
import numpy as np

sys.path.insert(0, "tools")
import gloved_log  # noqa: E402

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

BUILD = sys.argv[1]
ROUNDS = int(sys.argv[2]) if len(sys.argv) > 2 else 12
SECONDS = float(sys.argv[3]) if len(sys.argv) > 3 else 5.0
WORK = "build/latency"
WARM = 1000  # answers left out: the daemon starts beside the probe
HERE, THERE = 20870, 20871
TARGET_US = 15  # beyond the echo's median and the step


def probe(name):
    path = f"{WORK}/{name}.ns"
    subprocess.run([f"{BUILD}/test/bench_latency", "probe", f"udp://127.0.0.1:{THERE}?listen={HERE}", str(SECONDS), path], check=True)
    return np.fromfile(path, dtype=np.int32)[WARM:] / 1e3


def echo():
    server = subprocess.Popen([f"{BUILD}/test/bench_latency", "echo", str(THERE)])
    time.sleep(0.2)
    try:
        return probe("echo")
    finally:
        server.terminate()
        server.wait()


def gloved(*options):
    """Answers in us, the summary, and the wake-up of every step in us (with --log)."""
    summary, log = f"{WORK}/summary.json", f"{WORK}/run.lcm"
    daemon = subprocess.Popen([f"{BUILD}/gloved", "--fcu", f"udp://127.0.0.1:{HERE}?listen={THERE}", "--lcm", "none",
                               "--summary", summary, *options], stdout=subprocess.DEVNULL)
    time.sleep(0.2)
    answers = probe("gloved")
    daemon.terminate()
    daemon.wait()
    wake = []
    if "--log" in options:
        wake = [s.wake_ns / 1e3 for message in gloved_log.Log(log).of("GLOVED_TRACE") for s in message.step][WARM:]
        os.remove(log)
    with open(summary) as file:
        return answers, json.load(file), np.array(wake)


def cyclictest():
    """Latencies in us as (value, count), of a thread of the same priority on the same core."""
    run = subprocess.run(["cyclictest", "-m", "-p", "80", "-a", str(os.cpu_count() - 1), "-t", "1", "-i", "1000", "-q", "-D", str(int(SECONDS)),
                          "-h", "20000"], capture_output=True, text=True, check=True)
    rows = [line.split() for line in run.stdout.splitlines() if line[:1].isdigit()]
    values = [int(value) for value, count in rows for _ in range(int(count))]
    return np.array(values, dtype=float)


def measure():
    """Every kind once a round, so that all feel the same machine."""
    kinds = {name: [] for name in ("echo", "sync", "clock", "wake", "wake without hold", "cyclictest")}
    steps = []
    hold = f"{WORK}/sleepy.conf"
    with open(hold, "w") as file:
        file.write("version = 1;\nrealtime = { cpu_dma_latency = false; };\n")
    log = ["--log", f"{WORK}/run.lcm"]
    for number in range(ROUNDS):
        print(f"round {number + 1} of {ROUNDS}", flush=True)
        kinds["echo"].append(echo())
        answers, summary, _ = gloved("--sync", "device")
        kinds["sync"].append(answers)
        steps.append(summary["step_us"]["p50"])
        answers, _, wake = gloved(*log)
        kinds["clock"].append(answers)
        kinds["wake"].append(wake)
        kinds["wake without hold"].append(gloved("--config", hold, *log)[2])
        kinds["cyclictest"].append(cyclictest())
    return kinds, float(np.median(steps))


WHAT = {"echo": "bare echo", "sync": "gloved --sync device", "clock": "gloved on its own clock", "wake": "wake-up, gloved",
        "wake without hold": "wake-up, gloved without cpu_dma_latency", "cyclictest": "wake-up, cyclictest"}


def write_table(kinds, step_us):
    excess = float(np.median([np.median(s) - np.median(e) for s, e in zip(kinds["sync"], kinds["echo"])]))
    with open("data/bench/latency.csv", "w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["what", "median_us", "p99_us", "p999_us", "max_us", "samples", "blocks"])
        for kind, blocks in kinds.items():
            values = np.concatenate(blocks)
            q = np.quantile(values, [0.5, 0.99, 0.999])
            row = [WHAT[kind], *(f"{v:.1f}" for v in q), f"{values.max():.1f}", len(values), len(blocks)]
            table.writerow(row)
            print(f"{WHAT[kind]:42} median {q[0]:7.1f}  p99 {q[1]:7.1f}  p99.9 {q[2]:7.1f}  max {values.max():8.1f} us")
        table.writerow(["gloved --sync device over the echo (median of the blocks' differences)", f"{excess:.1f}", "", "", "", "", ROUNDS])
        table.writerow(["step (median)", f"{step_us:.1f}", "", "", "", "", ROUNDS])
    met = excess <= step_us + TARGET_US
    print(f"a sample is answered {excess:.1f} us after a bare echo would; the step is {step_us:.1f} us, "
          f"the target {step_us + TARGET_US:.1f}: {'met' if met else 'missed'}")


def draw(kinds):
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 3.6))
    for axis, names, title, end in ((left, ("echo", "sync", "clock"), "from a frame to its answer", 1200),
                                    (right, ("cyclictest", "wake", "wake without hold"), "from the deadline to waking up", 120)):
        edges = np.linspace(0, end, end // 10 + 1 if end > 500 else end + 1)  # cyclictest counts whole microseconds
        for name in names:
            values = np.concatenate(kinds[name])
            axis.hist(np.clip(values, 0, end), bins=edges, histtype="step", density=True, label=f"{WHAT[name]}: {np.median(values):.0f} us")
        axis.set_yscale("log")
        axis.set_xlabel("us (beyond the edge: in the last bin)")
        axis.set_title(title)
        axis.legend(fontsize=8)
    figure.tight_layout()
    figure.savefig("data/bench/latency.png", dpi=110)


os.makedirs(WORK, exist_ok=True)
measured, step = measure()
write_table(measured, step)
draw(measured)
