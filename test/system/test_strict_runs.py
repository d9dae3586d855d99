# SPDX-License-Identifier: BSD-3-Clause
"""Whole runs under --strict, where one system call too many of the real-time thread ends the daemon: every recorded
trace, the simulated device, UDP with both clocks, a serial glove whose cable is pulled, a LucidGlove's brakes. (CAN
interfaces: test/can.) And that the list is the real-time thread's alone, and lives through stop and continue."""
import concurrent.futures
import glob
import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time

B = os.environ["B"]
failed = False
tmp = tempfile.TemporaryDirectory()


def test(function):
    global failed
    try:
        function()
        print("ok", function.__name__, flush=True)
    except (AssertionError, OSError, ValueError, subprocess.SubprocessError) as error:
        print(f"  {error!r}\nFAIL {function.__name__}", flush=True)
        failed = True


def run(name, *options):
    """gloved to its end; its summary. Killed by the list, it would leave none and exit with -31."""
    summary = f"{tmp.name}/{name}.json"
    done = subprocess.run([f"{B}/gloved", "--lcm", "none", "--summary", summary, *options],
                          capture_output=True, text=True, timeout=120)
    assert done.returncode in (0, 1), (name, done)
    with open(summary) as file:
        return json.load(file)


def strict(name, *options):
    return run(name, "--strict", *options)


def free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


def device(program, *options):
    return subprocess.Popen([f"{B}/{program}", *options], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)


def serial(kind, *options):
    link = f"{tmp.name}/{kind}{time.monotonic_ns()}"
    sim = device("serialsim", kind, *options, "--link", link)
    assert sim.stdout.readline().strip() == link
    return sim, link


def every_trace_runs_under_strict():
    folders = sorted(glob.glob("data/traces/*/"))
    assert len(folders) >= 8
    for folder in folders:
        with open(folder + "expected") as file:
            expected = dict(line.split(" ", 1) for line in file.read().splitlines() if " " in line)
        scene = expected["scene"]
        if not os.path.exists(scene):
            continue
        replay = ("--fcu", f"trace:{folder}input.log.gz?speed=0", "--scene", scene)
        # A compiled scene has no golden hash: there the same run without the list says what is right.
        golden = expected.get("hash_default") or run("plain", *replay)["state_hash"]
        s = run("trace", "--strict", *replay)
        assert s["state_hash"] == golden, (folder, s["state_hash"])


def the_simulated_device_runs_under_strict():
    s = strict("sim", "--fcu", "sim:", "--duration", "2")
    assert s["steps"] > 1900 and s["exit_reason"] == "duration", s


def over_udp(name, *options):
    here, there = free_port(), free_port()
    sim = device("fcusim", "--udp", f"udp://127.0.0.1:{here}?listen={there}", "--script", "data/scripts/power_box.user", "--duration", "4")
    s = strict(name, "--fcu", f"udp://127.0.0.1:{there}?listen={here}", "--duration", "3", *options)
    sim.terminate()
    sim.wait()
    assert s["frames"]["rx"] > 5000 and s["steps"] + s["overruns"] >= 3000, (name, s["frames"], s["steps"])


def udp_runs_under_strict():
    over_udp("udp")


def udp_in_sync_with_the_device_runs_under_strict():
    over_udp("udp_sync", "--sync", "device")


def serial_devices_run_under_strict():
    """With the cable out and in: what reconnects is the driver's own thread, which may open files."""
    for clock in ([], ["--sync", "device"]):
        glove, link = serial("cyberglove", "--garbage", "0.05", "--unplug", "1")
        tracker, other = serial("fastrak")
        s = strict("serial", "--fcu", f"serial:{link}?type=cyberglove", "--tracker", f"serial:{other}?type=fastrak", "--duration", "3", *clock)
        glove.terminate()
        tracker.terminate()
        assert s["frames"]["rx"] > 100 and s["frames"]["link_downs"] >= 1, s["frames"]


def a_lucidglove_runs_under_strict():
    glove, link = serial("lucidglove")
    tracker, other = serial("fastrak")
    s = strict("lucid", "--fcu", f"serial:{link}?type=lucidglove", "--tracker", f"serial:{other}?type=fastrak", "--duration", "3")
    glove.terminate()
    tracker.terminate()
    assert s["frames"]["rx"] > 100 and s["frames"]["tx"] > 1500, s["frames"]  # a shared machine skips periods


def running(*options):
    """gloved with the simulated device, once its loop has stepped."""
    run = subprocess.Popen([f"{B}/gloved", "--lcm", "none", "--fcu", "sim:", *options], stdout=subprocess.PIPE, text=True)
    while "wait -> ready" not in run.stdout.readline():
        assert run.poll() is None
    return run


def of_each_thread(pid, name):
    """A line of /proc/PID/task/N/status of every thread."""
    values = {}
    for task in os.listdir(f"/proc/{pid}/task"):
        with open(f"/proc/{pid}/task/{task}/status") as file:
            values[int(task)] = next(line.split()[1] for line in file if line.startswith(name + ":"))
    return values


def no_signal_reaches_the_real_time_thread():
    run = running()
    blocked = {task: int(mask, 16) for task, mask in of_each_thread(run.pid, "SigBlk").items()}
    run.terminate()
    run.communicate(timeout=20)
    ending = sum(1 << (number - 1) for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGALRM))
    assert blocked.pop(run.pid) & ending == 0 and blocked and all(mask & ending == ending for mask in blocked.values()), blocked


def cores_are_kept_awake_unless_told_otherwise():
    if not os.access("/dev/cpu_dma_latency", os.W_OK):
        return
    off = f"{tmp.name}/off.conf"
    with open(off, "w") as file:
        file.write("version = 1;\nrealtime = { cpu_dma_latency = false; };\n")
    for options, held in (([], True), (["--config", off], False), (["--no-rt"], False)):
        run = running(*options)
        files = [os.readlink(f"/proc/{run.pid}/fd/{fd}") for fd in os.listdir(f"/proc/{run.pid}/fd")]
        run.terminate()
        run.communicate(timeout=20)
        assert ("/dev/cpu_dma_latency" in files) == held, (options, files)


def the_list_is_the_real_time_threads_alone():
    run = running("--strict")
    lists = of_each_thread(run.pid, "Seccomp")
    for number in (signal.SIGSTOP, signal.SIGCONT):
        run.send_signal(number)
        time.sleep(0.1)
    run.terminate()
    run.communicate(timeout=20)
    assert lists.pop(run.pid) == "0" and list(lists.values()) == ["2"], lists
    assert run.returncode in (0, 1), run.returncode


with concurrent.futures.ThreadPoolExecutor(3) as pool:
    list(pool.map(test, (every_trace_runs_under_strict, the_simulated_device_runs_under_strict, udp_runs_under_strict,
                         udp_in_sync_with_the_device_runs_under_strict, serial_devices_run_under_strict, a_lucidglove_runs_under_strict,
                         the_list_is_the_real_time_threads_alone, no_signal_reaches_the_real_time_thread,
                         cores_are_kept_awake_unless_told_otherwise)))
sys.exit(failed)
