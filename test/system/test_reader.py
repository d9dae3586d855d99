# SPDX-License-Identifier: BSD-3-Clause
"""Who reads what gloved prints may stop reading (Ctrl-S on the terminal, a pager, a program that hangs): commands and states go
on, disarm is obeyed, SIGTERM ends it. A reader that reads gets the whole summary."""
import os
import pty
import signal
import subprocess
import sys
import tempfile
import time

B = os.environ["B"]
URL = f"udpm://239.255.76.67:{20000 + os.getpid() % 20000}?ttl=0"
USER = """posture flat thumb_abduction 40
posture press like flat index_mpj 60
at 0.0 posture flat wrist -0.3 0 0.06 0 0 0 dead_man off
at 0.1 dead_man on
at 0.4 posture press
end 60
"""


def start(folder, out):
    script = os.path.join(folder, "press.user")
    with open(script, "w", encoding="utf-8") as file:
        file.write(USER)
    return subprocess.Popen([B + "/gloved", "--fcu", f"sim:{script}", "--scene", "data/scenes/box.scene", "--lcm", URL, "--no-rt",
                             "--black-box", "none"], stdin=subprocess.DEVNULL, stdout=out, stderr=out)


def ask(*words):
    told = subprocess.run([B + "/gloved-command", *words], env=dict(os.environ, LCM_DEFAULT_URL=URL), capture_output=True, text=True, timeout=20)
    return (told.stdout + told.stderr).strip()


def wait_for_force():
    for _ in range(100):
        said = ask("get", "state")
        if said == "active":
            return True
        time.sleep(0.1)
    print("  state:", said)
    return False


def fill(writer):
    """Nothing more goes in."""
    os.set_blocking(writer, False)
    for size in (4096, 1):
        try:
            while True:
                os.write(writer, b"x" * size)
        except BlockingIOError:
            pass
    os.set_blocking(writer, True)


def goes_on(run):
    """What went wrong, or nothing. Two seconds: the view prints once a second into a pipe."""
    time.sleep(2.2)
    state, disarmed = ask("get", "state"), ask("disarm")
    after = ask("get", "state")
    run.send_signal(signal.SIGTERM)
    began = time.monotonic()
    try:
        code = run.wait(10)
    except subprocess.TimeoutExpired:
        code = "none"
    ended_s = time.monotonic() - began
    run.kill()
    run.wait()
    print(f"figure nobody reads: ended {ended_s:.1f} s after SIGTERM")
    good = state == "active" and "done" in disarmed and after == "ready" and code == 0 and ended_s < 5
    return "" if good else f"state {state}, disarm: {disarmed}, then {after}; exit {code} after {ended_s:.1f} s"


def test_a_pipe_that_nobody_reads_holds_nothing_up(folder):
    reader, writer = os.pipe()
    run = start(folder, writer)
    assert wait_for_force()
    fill(writer)
    why = goes_on(run)
    os.close(reader)
    os.close(writer)
    assert not why, why


def test_a_terminal_that_is_stopped_holds_nothing_up(folder):
    master, slave = pty.openpty()
    run = start(folder, slave)
    assert wait_for_force()
    fill(slave)
    why = goes_on(run)
    os.close(master)
    os.close(slave)
    assert not why, why


def test_a_reader_gets_the_whole_summary(folder):
    run = start(folder, subprocess.PIPE)
    time.sleep(1.5)
    run.send_signal(signal.SIGTERM)
    told = run.communicate(timeout=20)[0].decode()
    assert "force" in told and "steps" in told and told.endswith("\n") and len(told.splitlines()) > 10, told


def multicast_works():
    with tempfile.TemporaryDirectory() as folder:
        run = start(folder, subprocess.DEVNULL)
        works = any(ask("get", "state") in ("active", "armed", "ready", "wait") for _ in range(5))
        run.terminate()
        run.wait()
        return works


def main():
    if not multicast_works():
        print("skip test_reader: no multicast here (ip link set lo up; ip route add 224.0.0.0/4 dev lo)")
        return 0
    failed = 0
    for name, test in list(globals().items()):
        if not name.startswith("test_"):
            continue
        try:
            with tempfile.TemporaryDirectory() as folder:
                test(folder)
            print("ok", name, flush=True)
        except (AssertionError, OSError, subprocess.SubprocessError) as problem:
            failed = 1
            print(f"  {type(problem).__name__}: {str(problem)[:900]}\nFAIL {name}", flush=True)
    return failed


if __name__ == "__main__":
    sys.exit(main())
