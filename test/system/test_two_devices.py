# SPDX-License-Identifier: BSD-3-Clause
"""Two gloves, one world (--fcu and --fcu2), judged at the other ends of two wires by two fcusims: a bar goes from hand to
hand, a fault of one device ends the force in both, a recording has both hands and replays to the same bits, and what does
not go together is refused with what to do."""
import csv
import json
import os
import re
import signal
import subprocess
import sys

import pytest

sys.path[:0] = ["test/support", "tools"]
import gloved_log
from press import SCRIPT, free_ports

B = os.environ["B"]
WATCHDOG_S, AGE_S, RAMP_S = 0.005, 0.032, 0.017
FAULT_S = 0.8
PRESS = SCRIPT + "1.5\n"
# A left hand's, beside the other one.
PRESS_LEFT = "hand left\n" + PRESS.replace("wrist -0.3 0 0.06", "wrist -0.3 0.3 0.06")


class Device:
    """fcusim on a wire of its own."""

    def __init__(self, folder, name, script, fault=None):
        self.ours, self.theirs = free_ports()
        self.path = lambda kind: os.path.join(folder, f"{name}.{kind}")
        if not os.path.exists(script):
            with open(self.path("user"), "w", encoding="utf-8") as file:
                file.write(script)
            script = self.path("user")
        self.command = [B + "/fcusim", "--udp", f"udp://127.0.0.1:{self.theirs}?listen={self.ours}", "--script", script, "--forces",
                        self.path("forces"), "--report", self.path("report")] + (["--fault", f"{fault}@{FAULT_S}"] if fault else [])

    @property
    def url(self):
        return f"udp://127.0.0.1:{self.ours}?listen={self.theirs}"

    def start(self):
        self.process = subprocess.Popen(self.command, stdout=subprocess.DEVNULL)

    def end(self):
        self.process.wait(60)
        with open(self.path("report"), encoding="utf-8") as file:
            self.report = json.load(file)
        with open(self.path("forces"), encoding="utf-8") as file:
            self.rows = [(float(r["device_s"]), r["fault"] == "1", max(float(v) for k, v in r.items() if k.endswith("_n")))
                         for r in csv.DictReader(file)]

    def largest_n(self):
        return max(row[2] for row in self.rows)

    def zero_after_s(self, at_s):
        """From a time of this device on until no force is applied any more."""
        return max((row[0] for row in self.rows if row[2] > 0), default=at_s) + 0.001 - at_s


def run(folder, scripts, fault=None, options=()):
    """Both devices, and gloved until it is told to end. The text that gloved printed."""
    kinds = [fault[1] if fault and fault[0] == i else None for i in range(2)]
    devices = [Device(folder, name, script, kind) for name, script, kind in zip(("right", "left"), scripts, kinds)]
    with open(os.path.join(folder, "said"), "w", encoding="utf-8") as said:
        engine = subprocess.Popen([B + "/gloved", "--fcu", devices[0].url, "--fcu2", devices[1].url, "--lcm", "none", "--black-box", folder,
                                   *options], stdout=said, stderr=subprocess.STDOUT)
        for device in devices:
            device.start()
        for device in devices:
            device.end()
        engine.send_signal(signal.SIGTERM)
        engine.wait(10)
    with open(os.path.join(folder, "said"), encoding="utf-8") as said:
        return devices, said.read()


@pytest.mark.parametrize("observer", ("false", "true"))
def test_a_bar_goes_from_hand_to_hand(tmp_path, observer):
    folder = str(tmp_path)
    conf = os.path.join(folder, "two.conf")
    with open(conf, "w", encoding="utf-8") as file:
        file.write(f"version = 1;\nfinger = {{ observer = {observer}; }};\n")
    log, record, summary = (os.path.join(folder, name) for name in ("log.lcm", "record", "summary"))
    devices, said = run(folder, ("data/scripts/give_bar.user", "data/scripts/take_bar.user"),
                        options=("--config", conf, "--scene", "handover", "--log", log, "--record", record, "--summary", summary, "--duration", "11.7"))
    for device in devices:
        assert device.report["over_max"] == 0 and device.report["over_slew"] == 0, device.report
        assert 0.5 < device.largest_n() < 6, f"{device.largest_n()} N"
    with open(summary, encoding="utf-8") as file:
        told = json.load(file)
    bar = told["objects"][1]
    assert bar["position"][2] > 0.2 and bar["position"][1] > 0.03, f"{bar}\n{said}"
    assert told["rt_heap_calls"] == 0 and told["second_hand"]["frames"]["rx"] > 20000, told
    print(f"figure a period of both hands, live: median {told['step_us']['p50']:.0f} us, p99 {told['step_us']['p99']:.0f} us; "
          f"{told['missed_deadlines']} missed of {told['steps']}")
    check_log(log)
    check_replay(record, told["state_hash"], conf)
    trace = os.path.join(folder, "from-log")
    subprocess.run([sys.executable, "tools/log_to_trace.py", log, trace], check=True, stdout=subprocess.DEVNULL)
    replay = subprocess.run([B + "/gloved", "--fcu", f"trace:{trace}?speed=0", "--lcm", "none", "--config", conf], stdout=subprocess.PIPE, text=True, check=True)
    assert f"state hash {told['state_hash']}" in replay.stdout, replay.stdout


def check_log(path):
    """Both hands' states, step by step the same world; each with limbs, contacts and forces of its own."""
    log = gloved_log.Log(path)
    first, second = {s.step: s for s in log.of("GLOVED_STATE")}, {s.step: s for s in log.of("GLOVED_STATE2")}
    assert len(first) > 400 and first.keys() == second.keys(), (len(first), len(second))
    last = max(first)
    for step in first:
        assert first[step].object[1].position_m == second[step].object[1].position_m
    assert all(-1 - len(s.object) <= c.limb <= 15 for s in [*first.values(), *second.values()] for c in s.contact)
    held = {hand: max(sum(c.limb >= 0 and c.object == 1 for c in s.contact) for s in states.values())
            for hand, states in (("right", first), ("left", second))}
    assert min(held.values()) >= 3, held
    palms = [state.limb[15].position_m for state in (first[last], second[last])]
    assert abs(palms[0][1] - palms[1][1]) > 0.1, palms
    loads = log.of("DRAKE_VIEWER_LOAD_ROBOT")
    folders = {link.name.split("::")[0] for link in loads[-1].link}
    assert {"hand", "glove", "hand2", "glove2"} <= folders, folders


def check_replay(record, state_hash, conf):
    """The recording alone: it knows that it is of two hands, and which interface is whose."""
    with open(record, encoding="utf-8") as file:
        interfaces = {line.split()[1] for line in file}
    assert interfaces == {"can0", "can1"}, interfaces
    replay = subprocess.run([B + "/gloved", "--fcu", f"trace:{record}?speed=0", "--lcm", "none", "--config", conf], stdout=subprocess.PIPE,
                            stderr=subprocess.STDOUT, text=True, check=True)
    assert f"state hash {state_hash}" in replay.stdout, replay.stdout
    assert "second hand: largest forces" in replay.stdout, replay.stdout
    one = subprocess.run([B + "/gloved", "--fcu", f"trace:{record}?iface=can1&speed=0", "--lcm", "none", "--scene", "data/scenes/handover.scene"],
                         stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
    assert "second hand" not in one.stdout and "steps of 1 ms" in one.stdout, one.stdout


@pytest.mark.parametrize("broken", (0, 1), ids=("first", "second"))
@pytest.mark.parametrize("kind, limit_s", (("sensor-fault", RAMP_S + 0.003), ("silence", AGE_S + RAMP_S + 0.01)))
def test_a_fault_of_one_ends_both_forces(tmp_path, broken, kind, limit_s):
    for attempt in range(3):  # a machine that stands still ends the force before the fault does
        folder = str(tmp_path / str(attempt))
        os.mkdir(folder)
        devices, said = run(folder, (PRESS, PRESS_LEFT), (broken, kind))
        sick, well = devices[broken], devices[1 - broken]
        fault_s = next(row[0] for row in sick.rows if row[1])
        before_n = [max(row[2] for row in device.rows if fault_s - 0.1 < row[0] < fault_s) for device in devices]
        if min(before_n) > 0.5:
            break
    assert min(before_n) > 0.5, f"{before_n}\n{said}"
    # Both start with their first command, a few milliseconds apart.
    zero_s = [device.zero_after_s(fault_s) for device in (sick, well)]
    print(f"figure {kind} of the {('first', 'second')[broken]} device: zero after {1e3 * zero_s[0]:.0f} ms there, "
          f"{1e3 * zero_s[1]:.0f} ms at the other")
    assert zero_s[0] <= limit_s and zero_s[1] <= limit_s + 0.02, (zero_s, said)
    assert well.report["over_slew"] == 0 and well.report["over_max"] == 0, well.report
    other = ("second hand: ", "")[broken]
    assert re.search(rf"s  {other}safety: active -> fault: the other hand's device is in a fault", said), said
    check_black_box(folder, said)


def check_black_box(folder, said):
    names = [name for name in os.listdir(folder) if re.fullmatch(r"gloved-fault-.*\.log", name)]
    assert len(names) == 1, (os.listdir(folder), said)
    replay = subprocess.run([B + "/gloved", "--fcu", f"trace:{os.path.join(folder, names[0])}?speed=0", "--lcm", "none"],
                            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
    assert replay.returncode == 1 and "second hand: largest forces" in replay.stdout, replay.stdout


def gloved(*options):
    done = subprocess.run([B + "/gloved", "--lcm", "none", *options], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, timeout=60,
                          check=False)
    return done.returncode, done.stdout, done.stderr


def test_check_says_what_was_found():
    code, out, _ = gloved("--fcu", "sim:give_bar", "--fcu2", "sim:take_bar", "--scene", "handover", "--check")
    assert code == 0 and re.search(r"^fcu2 +sim:take_bar; the left hand$", out, re.M), out


REFUSED = {
    "two clocks": (("--fcu", "sim:", "--fcu2", "udp://127.0.0.1:1?listen=PORT"), "a time of its own"),
    "two kinds of force": (("--fcu", "udp://127.0.0.1:1?listen=PORT", "--fcu2", "serial:/dev/null?type=lucidglove"), "devices of different forces"),
    "no such script": (("--fcu", "sim:", "--fcu2", "sim:none.user"), "none.user"),
    "no such kind": (("--fcu", "sim:", "--fcu2", "cab:can1"), "--fcu2 cab:can1: no such kind of URL"),
    "a bare glove": (("--fcu", "udp://127.0.0.1:1?listen=PORT", "--fcu2", "serial:/dev/null?type=cyberglove"), "--tracker"),
    "two trackers for one": (("--fcu", "udp://127.0.0.1:1?listen=PORT", "--fcu2", "can:can9", "--tracker", "serial:/dev/ptmx?type=fastrak&hand2=5"),
                             "hand2=5 is not known"),
    "a tracker of two for one": (("--fcu", "udp://127.0.0.1:1?listen=PORT", "--tracker", "serial:/dev/ptmx?type=fastrak&hand2=3"),
                                "a second hand that has no device"),
    "no value": (("--fcu2",), "--fcu2 needs a value"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_does_not_go_together(name):
    options, why = REFUSED[name]
    port = str(free_ports()[0])
    code, out, err = gloved(*(option.replace("PORT", port) for option in options), "--duration", "1")
    assert code == 2 and why in err and err.count("\n") == 1 and not out, (code, out, err)


def test_settings_of_the_second_hand(tmp_path):
    """Its calibration is its own, and a file that is none is named with its line."""
    conf, cal = tmp_path / "two.conf", tmp_path / "bad.cal"
    cal.write_text("version = 1;\nsensors = 5;\n", encoding="utf-8")
    conf.write_text(f'version = 1;\nfcu = "sim:give_bar";\nfcu2 = "sim:take_bar";\ncalibration2 = "{cal}";\n', encoding="utf-8")
    code, _, err = gloved("--config", str(conf), "--check")
    assert code == 2 and "two.conf:4" in err and "bad.cal" in err, err
    conf.write_text('version = 1;\nfcu = "sim:give_bar";\nfcu2 = "sim:take_bar";\nhand = { side = "left"; };\n', encoding="utf-8")
    code, out, err = gloved("--config", str(conf), "--check")
    assert code == 0 and "the right hand" in out, out + err
