# SPDX-License-Identifier: BSD-3-Clause
# gloved-top on a pseudo-terminal that changes its size, and gloved-command: what they show of a running daemon is
# what it does, and the terminal comes back as it was.
import fcntl
import os
import pty
import re
import select
import signal
import struct
import subprocess
import sys
import tempfile
import termios
import time

B = os.environ["B"]
URL = "udpm://239.255.76.67:7781?ttl=0"  # a port of its own: a running daemon is not disturbed
USER = """posture flat thumb_abduction 40
posture press like flat index_mpj 60
at 0.0 posture flat wrist -0.3 0 0.06 0 0 0 dead_man off
at 0.1 dead_man on
at 0.4 posture press
end 60
"""
failed = False


def verdict(name, why):
    global failed
    print(f"ok {name}" if not why else f"  {why}\nFAIL {name}", flush=True)
    failed |= bool(why)


class Terminal:
    """gloved-top with the other end of its terminal."""

    def __init__(self, rows, columns):
        self.pid, self.fd = pty.fork()
        if self.pid == 0:
            time.sleep(0.1)
            os.execv(B + "/gloved-top", ["gloved-top", URL])
        self.before = termios.tcgetattr(self.fd)
        self.text = ""
        self.resize(rows, columns)

    def resize(self, rows, columns):
        fcntl.ioctl(self.fd, termios.TIOCSWINSZ, struct.pack("HHHH", rows, columns, 0, 0))

    def watch(self, seconds):
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            if select.select([self.fd], [], [], 0.05)[0]:
                try:
                    self.text += os.read(self.fd, 65536).decode()
                except OSError:
                    return

    def last_screen(self):
        """Lines of the newest whole screen."""
        whole = self.text.rpartition("\033[J")[0].rpartition("\033[H")[2]
        return re.sub(r"\033\[[0-9;?]*[A-Za-z]", "", whole).replace("\r", "").split("\n")

    def end(self):
        """Exit code, whether the terminal's settings are back, and whether its screen is."""
        self.watch(1)
        after = termios.tcgetattr(self.fd)
        code = os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1])
        os.close(self.fd)
        return code, after[3] == self.before[3], self.text.endswith("\033[?25h\033[?1049l")


def command(*arguments):
    run = subprocess.run([B + "/gloved-command", *arguments], capture_output=True, text=True, env=dict(os.environ, LCM_DEFAULT_URL=URL))
    return run.returncode, (run.stdout + run.stderr).strip()


def check_screens(top):
    for rows, columns in ((24, 80), (15, 50), (60, 140), (3, 20)):
        top.resize(rows, columns)
        top.text = ""
        top.watch(0.8)
        lines = top.last_screen()
        fits = len(lines) <= rows and max(map(len, lines)) <= columns
        verdict(f"fits_{columns}_x_{rows}", "" if fits and lines[0].startswith("gloved-top") else f"{len(lines)} lines, widest {max(map(len, lines))}: {lines[:3]}")
        if columns == 140:
            check_content("\n".join(lines))


def check_content(screen):
    wanted = {"the state": r"gloved-top  active", "the pressing finger": r"index +\|##", "its contact": r"index_\w+ +on table", "timing": r"compute +[1-9]",
              "ages": r"glove [0-9.]+ ms old", "angles": r"index +[4-9][0-9]\.", "events": r"armed -> active", "the object": r"box +at", "losses": r"snapshots 0"}
    verdict("it_shows_the_run", ", ".join(name for name, pattern in wanted.items() if not re.search(pattern, screen)) and
            f"missing {[n for n, p in wanted.items() if not re.search(p, screen)]} in\n{screen}")


def check_command():
    verdict("a_command_is_done", "" if command("friction", "0.7") == (0, "command friction: done") else str(command("friction", "0.7")))
    answers = command("coupling", "9"), command("reset")
    verdict("a_command_is_refused", "" if [a[0] for a in answers] == [1, 1] and "0.1 to 2" in answers[0][1] and "disarm first" in answers[1][1] else str(answers))
    codes = [command(*words)[0] for words in ((), ("arm",), ("friction",), ("friction", "much"), ("reset", "now"))]
    verdict("bad_usage_of_command", "" if codes == [2] * 5 else str(codes))


def main():
    plain = subprocess.run([B + "/gloved-top", URL], capture_output=True, text=True)
    verdict("no_terminal_no_top", "" if plain.returncode == 2 and "no terminal" in plain.stderr else plain.stderr)
    with tempfile.TemporaryDirectory() as folder:
        with open(folder + "/press.user", "w") as file:
            file.write(USER)
        top = Terminal(24, 80)
        top.watch(1)
        if not top.text:
            print("skip it_shows_the_run: no multicast here (ip link set lo up; ip route add 224.0.0.0/4 dev lo)")
            return 1 if failed else 0
        verdict("it_waits_for_a_daemon", "" if "waiting for GLOVED_STATE" in top.text else repr(top.text[-200:]))
        daemon = subprocess.Popen([B + "/gloved", "--fcu", f"sim:{folder}/press.user", "--lcm", URL, "--no-rt"], stdout=subprocess.DEVNULL)
        top.watch(2.5)
        check_screens(top)
        check_command()
        daemon.send_signal(signal.SIGTERM)
        daemon.wait()
        top.resize(24, 80)
        top.watch(1.2)
        verdict("it_says_that_nothing_comes", "" if "SILENT" in top.last_screen()[0] else top.last_screen()[0])
    os.write(top.fd, b"q")
    verdict("q_ends_it", "" if top.end() == (0, True, True) else "the terminal is not as it was")
    top = Terminal(24, 80)
    top.watch(0.7)
    os.kill(top.pid, signal.SIGTERM)
    verdict("a_signal_ends_it", "" if top.end() == (0, True, True) else "the terminal is not as it was")
    return 1 if failed else 0


sys.exit(main())
