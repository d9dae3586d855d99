# SPDX-License-Identifier: BSD-3-Clause
"""--sync device over UDP: the glove's frames begin the steps, a recording of it replays to the same bits, frames that
stay away are told while the loop goes on, and a device without a wire is refused. Counts, no times."""
import json
import os
import re
import socket
import subprocess
import sys
import tempfile

sys.path.insert(0, "tools")
import gloved_log  # noqa: E402

B = os.environ["B"]
fails = 0


def verdict(name, good, why=""):
    global fails
    fails += not good
    print(f"ok {name}" if good else f"  {why}\nFAIL {name}", flush=True)


def free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


def run_pair(folder, device_s, daemon_s, *options):
    """fcusim and gloved against each other; the daemon's summary, its output and the device's report."""
    here, there = free_port(), free_port()
    summary, report = f"{folder}/summary.json", f"{folder}/report.json"
    sim = subprocess.Popen([f"{B}/fcusim", "--udp", f"udp://127.0.0.1:{here}?listen={there}", "--script",
                            "data/scripts/power_box.user", "--duration", str(device_s), "--report", report],
                           stdout=subprocess.DEVNULL)
    daemon = subprocess.run([f"{B}/gloved", "--fcu", f"udp://127.0.0.1:{there}?listen={here}", "--lcm", "none", "--duration",
                             str(daemon_s), "--summary", summary, *options], capture_output=True, text=True, timeout=60)
    sim.wait(timeout=60)
    return json.load(open(summary)), daemon, json.load(open(report))


def test_frames_begin_the_steps_and_replay(folder):
    log = f"{folder}/sync.log"
    lcm_log = f"{folder}/sync.lcm"
    s, daemon, device = run_pair(folder, 4.0, 3.0, "--sync", "device", "--record", log, "--log", lcm_log)
    on_frame, on_clock = s["sync"]["on_frame"], s["sync"]["on_clock"]
    verdict("the_gloves_frames_begin_the_steps", on_frame > 9 * on_clock and on_frame + on_clock == s["steps"],
            f"{s['sync']}, {s['steps']} steps: {daemon.stdout}")
    verdict("it_says_that_the_device_is_the_clock", "sync: the glove's frames are the clock" in daemon.stdout, daemon.stdout)
    told = gloved_log.Log(lcm_log).of("GLOVED_STATS")[-1]
    verdict("the_statistics_count_both_clocks", told.steps_on_frame > 9 * told.steps_on_clock and
            told.steps_on_frame + told.steps_on_clock <= s["steps"], (told.steps_on_frame, told.steps_on_clock))
    replay = f"{folder}/replay.json"
    subprocess.run([f"{B}/gloved", "--fcu", f"trace:{log}?speed=0", "--lcm", "none", "--summary", replay],
                   check=True, capture_output=True)
    again = json.load(open(replay))
    verdict("a_recording_in_sync_replays_to_the_same_bits",
            again["state_hash"] == s["state_hash"] and again["steps"] == s["steps"] and s["contacts_max"] > 0,
            f"{s['steps']} {s['state_hash']}, replayed {again['steps']} {again['state_hash']}")


def test_frames_stay_away(folder):
    s, daemon, _ = run_pair(folder, 1.0, 3.0, "--sync", "device")
    verdict("frames_that_stay_away_are_told", "the glove's frames stay away: on by the loop's own clock" in daemon.stdout, daemon.stdout)
    steps = s["steps"] + s["overruns"]
    verdict("without_frames_the_loop_goes_on", s["sync"]["on_clock"] > 1000 and 2900 < steps < 3100,
            f"{s['sync']}, {steps} steps and skipped periods in 3 s")


def test_slow_loop(folder):
    """A loop of 200 Hz beside a glove of 1 kHz: the nearest frame of five begins the step, and commands are repeated."""
    s, daemon, device = run_pair(folder, 4.0, 3.0, "--sync", "device", "--rate", "200")
    on_frame = s["sync"]["on_frame"]
    verdict("a_slow_loop_takes_one_frame_of_five", on_frame > 0.7 * s["steps"] and 580 < s["steps"] + s["overruns"] < 620, f"{s['sync']}, {s['steps']} steps in 3 s")
    # More where the machine stood still; once at the end.
    verdict("a_slow_loop_keeps_the_device_fed", device["watchdog_trips"] <= 5 and device["commands"] > 2500, device)


def test_refusals():
    for name, options in (("of_a_device_in_the_process", ["--fcu", "sim:", "--sync", "device"]), ("of_another_word", ["--sync", "glove"])):
        done = subprocess.run([f"{B}/gloved", "--lcm", "none", *options], capture_output=True, text=True, timeout=20)
        verdict(f"sync_refusal_{name}", done.returncode == 2 and re.search(r"--sync.*", done.stderr) and done.stderr.count("\n") == 1, done.stderr)


with tempfile.TemporaryDirectory() as place:
    test_frames_begin_the_steps_and_replay(place)
    test_frames_stay_away(place)
    test_slow_loop(place)
test_refusals()
sys.exit(fails > 0)
