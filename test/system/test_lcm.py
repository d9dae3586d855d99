# SPDX-License-Identifier: BSD-3-Clause
# What the daemon publishes, read by a stock LCM subscriber (LCM's own Python module, types by lcm-gen):
# GLOVED_STATE at 50 Hz with a sound content, GLOVED_EVENT in words, and the same messages in --log.
import math, os, subprocess, sys, tempfile, time

sys.path.insert(0, "tools")
from gloved_names import SAFETY  # noqa: E402

GLOVED = os.environ["B"] + "/gloved"
URL = "udpm://239.255.76.67:7777?ttl=0"  # a port of its own: a running daemon is not disturbed
SECONDS = 2.0
USER = """posture flat thumb_abduction 40
posture press like flat index_mpj 60
at 0.0 posture flat wrist -0.3 0 0.06 0 0 0 dead_man off
at 0.1 dead_man on
at 0.4 posture press
end 30
"""
failed = False


def verdict(name, why):
    global failed
    print(f"ok {name}" if not why else f"  {why}\nFAIL {name}", flush=True)
    failed |= bool(why)


def skip_all(why):
    print(f"skip test_lcm: {why}")
    sys.exit(0)


def check_state(s):
    """The first thing wrong with a state message of the pressing user, or an empty text."""
    unit = lambda q: abs(math.hypot(*q) - 1) < 1e-9
    if not all(unit(l.quaternion) and unit(l.driver_quaternion) for l in s.limb):
        return "a limb's quaternion is not of unit length"
    if [o.name for o in s.object] != ["table", "box"] or not s.object[0].is_static or s.object[1].is_static:
        return f"objects {[o.name for o in s.object]}"
    if math.dist(s.object[1].position_m, (0, 0, 0.04)) > 1e-3 or not unit(s.object[1].quaternion):
        return f"the box is not where the scene has it: {s.object[1].position_m}"
    if not 0 <= s.glove_age_s < 0.05 or not 0 <= s.tracker_age_s < 0.1:
        return f"ages {s.glove_age_s} {s.tracker_age_s}"
    for c in s.contact:
        if abs(math.hypot(*c.normal) - 1) > 1e-9 or not -1 <= c.object < 2 or not -3 < c.limb < 16:
            return f"contact {c.limb} {c.object} {c.normal}"
    if abs(s.time_s - s.step * 0.001) > 1e-9:
        return f"step {s.step} at {s.time_s} s"
    return ""


def check_press(s):
    """The last message: the index finger lies on the table and is held back."""
    touching = {c.limb for c in s.contact if c.object == 0 and c.limb >= 0}
    if not touching & {3, 4, 5}:
        return f"limbs {touching} touch the table, not the index finger"
    if s.safety_state != SAFETY.index("active") or not s.dead_man:
        return f"safety state {s.safety_state}"
    if not 0.1 < s.force_commanded_n[1] < 12 or abs(s.force_commanded_n[1] - s.force_desired_n[1]) > 0.5:
        return f"index finger: wanted {s.force_desired_n[1]} N, commanded {s.force_commanded_n[1]} N"
    if abs(s.force_commanded_n[1] - s.force_measured_n[1]) > 0.1:
        return f"the device reports {s.force_measured_n[1]} N of {s.force_commanded_n[1]} N"
    if not 1e-5 < abs(s.energy_j[1]) < 1 or any(s.energy_dissipated_j) or not all(map(math.isfinite, s.energy_j)):
        return f"energy at the tendons {s.energy_j} J, dissipated {s.energy_dissipated_j} J"
    if s.heap_calls != 0 or s.frames_lost != 0 or s.frames_bad != 0:
        return f"heap calls {s.heap_calls}, frames lost {s.frames_lost}, bad {s.frames_bad}"
    return ""


def multicast_works(lcm):
    """Whether this machine hands a multicast message back to itself."""
    got = []
    link = lcm.LCM(URL)
    link.subscribe("GLOVED_TEST_LOOPBACK", lambda channel, data: got.append(data))
    for _ in range(10):
        link.publish("GLOVED_TEST_LOOPBACK", b"x")
        link.handle_timeout(200)
        if got:
            return True
    return False


def receive(lcm, types, script):
    states, events = [], []
    link = lcm.LCM(URL)
    link.subscribe("GLOVED_STATE", lambda _, data: states.append((len(data), types.state_t.decode(data)))).set_queue_capacity(500)
    link.subscribe("GLOVED_EVENT", lambda _, data: events.append(types.event_t.decode(data))).set_queue_capacity(500)
    daemon = subprocess.Popen([GLOVED, "--fcu", f"sim:{script}", "--lcm", URL, "--duration", str(SECONDS)],
                              stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    while daemon.poll() is None:
        link.handle_timeout(50)
    while link.handle_timeout(200):
        pass
    return states, events, daemon.returncode, daemon.stderr.read()


def check_network(lcm, types, script):
    states, events, code, text = receive(lcm, types, script)
    verdict("the_daemon_publishes", f"exit code {code}: {text}" if code or not states else "")
    if not states:
        return
    every = 20  # steps of 1 ms between messages at 50 Hz
    steps = [s.step for _, s in states]
    running = [s for _, s in states if s.safety_state != SAFETY.index("stopped")]
    gaps = [b - a for a, b in zip(steps, steps[1:]) if b <= SECONDS * 1000 - every]
    dropped = states[-1][1].snapshots_dropped
    verdict("state_comes_every_20_steps",
            f"gaps {set(gaps)}, {dropped} dropped" if set(gaps) != {every} and not dropped else "")
    # The messages' own clock, not the arrival: a busy machine may deliver late.
    elapsed = (running[-1].utime - running[0].utime) * 1e-6
    rate = (running[-1].step - running[0].step) / every / elapsed
    verdict("state_comes_at_50_hz", "" if 45 <= rate <= 55 else f"{rate} Hz")
    verdict("state_clock_is_wall_time", "" if abs(running[-1].utime * 1e-6 - time.time()) < 10 else f"utime {running[-1].utime}")
    verdict("state_is_small", "" if max(n for n, _ in states) < 65000 else f"{max(n for n, _ in states)} bytes")
    wrong = [w for w in (check_state(s) for s in running[1:]) if w]
    verdict("state_is_sound", wrong[0] if wrong else "")
    verdict("state_shows_the_pressed_finger", check_press(running[-1]))
    texts = [e.text for e in events]
    wanted = ["engine: hand placed at the first sample", "safety: ready -> armed", "safety: armed -> active"]
    missing = [w for w in wanted if w not in texts]
    verdict("events_in_words", f"no {missing} in {texts}" if missing else "")


def check_log(lcm, types, script, path):
    run = subprocess.run([GLOVED, "--fcu", f"sim:{script}?speed=0", "--lcm", "none", "--duration", str(SECONDS), "--log", path],
                         capture_output=True, text=True)
    logged = list(lcm.EventLog(path)) if run.returncode == 0 else []
    states = [types.state_t.decode(e.data) for e in logged if e.channel == "GLOVED_STATE"]
    steps = [s.step for s in states]
    wanted = list(range(1, int(SECONDS * 1000), 20)) + [int(SECONDS * 1000)]
    verdict("log_of_a_replay_is_complete", "" if steps == wanted else f"{run.stderr} steps {steps[:3]} ... {steps[-3:]}")
    if not states:
        return
    times = [e.timestamp for e in logged if e.channel == "GLOVED_STATE"]
    verdict("log_keeps_the_simulated_time", "" if {b - a for a, b in zip(times[:-1], times[1:-1])} == {20000} else f"{times[:4]}")
    verdict("log_shows_the_pressed_finger", check_press(states[-2]))
    verdict("log_has_the_events", "" if any(e.channel == "GLOVED_EVENT" for e in logged) else "none")


def main():
    try:
        import lcm
    except ImportError:
        skip_all("LCM's Python module is not installed (pip install lcm)")
    with tempfile.TemporaryDirectory() as folder:
        types_in = [f"data/lcm/{f}" for f in sorted(os.listdir("data/lcm")) if f.startswith("gloved_")]
        subprocess.run(["lcm-gen", "-p", "--ppath", folder] + types_in, check=True, stdout=subprocess.DEVNULL)
        sys.path.insert(0, folder)
        import gloved as types
        script = folder + "/press.user"
        with open(script, "w") as file:
            file.write(USER)
        check_log(lcm, types, script, folder + "/run.lcm")
        try:
            works = multicast_works(lcm)
        except Exception:
            works = False
        if works:
            check_network(lcm, types, script)
        else:
            print("skip state_comes_at_50_hz: no multicast here (ip link set lo up; ip route add 224.0.0.0/4 dev lo)")
    return 1 if failed else 0


sys.exit(main())
