# SPDX-License-Identifier: BSD-3-Clause
# The live view on a terminal of 80 x 24 (a pseudo-terminal here): it fits, even with a crowded scene, it shows
# what it should, and it gives the terminal back, also after SIGTERM.
import fcntl, os, pty, re, select, signal, struct, subprocess, sys, tempfile, termios, time

GLOVED = os.environ["B"] + "/gloved"
USER = """posture flat thumb_abduction 40
posture press like flat index_mpj 60
at 0.0 posture flat wrist -0.3 0 0.06 0 0 0 dead_man off
at 0.1 dead_man on
at 0.4 posture press
end 30
"""
BOX = '{{ name = "a-box-with-a-rather-long-name-{0}"; mass = 0.1; mu = 0.8; box = [0.02, 0.02, 0.02]; position = [{1}, 0.2, 0.01]; }}'
failed = False


def verdict(name, why):
    global failed
    print(f"ok {name}" if not why else f"  {why}\nFAIL {name}", flush=True)
    failed |= bool(why)


def watch(arguments, kill_after=None):
    """Everything the daemon writes to a terminal of 80 x 24, and its exit code."""
    pid, terminal = pty.fork()
    if pid == 0:
        os.execv(GLOVED, [GLOVED] + arguments)
    fcntl.ioctl(terminal, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
    text, start, killed = b"", time.monotonic(), False
    while time.monotonic() - start < 30:
        if kill_after and not killed and text.count(b"\033[H") >= kill_after:
            os.kill(pid, signal.SIGTERM)
            killed = True
        if not select.select([terminal], [], [], 0.1)[0]:
            continue
        try:
            part = os.read(terminal, 65536)
        except OSError:
            break
        if not part:
            break
        text += part
    return text.decode(), os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])


def screens(text):
    """The screens as lists of lines, escape sequences taken out, and what follows the last one."""
    body, _, after = text.rpartition("\033[J")
    plain = lambda t: re.sub(r"\033\[[0-9;?]*[A-Za-z]", "", t).replace("\r", "")
    return [plain(s).split("\n") for s in body.split("\033[H")[1:]], plain(after)


def main():
    with tempfile.TemporaryDirectory() as folder:
        with open(folder + "/press.user", "w") as file:
            file.write(USER)
        with open(folder + "/crowd.scene", "w") as file:
            table = '{ name = "table"; static = true; mu = 0.8; box = [1.2, 0.8, 0.04]; position = [0.0, 0.0, -0.02]; }'
            boxes = [BOX.format(i, round(-0.4 + 0.08 * i, 3)) for i in range(10)]
            file.write("version = 1;\nobjects = (" + ",\n".join([table] + boxes) + ");\n")
        base = ["--fcu", f"sim:{folder}/press.user", "--scene", folder + "/crowd.scene", "--lcm", "none"]
        text, code = watch(base + ["--duration", "1.2"])
        drawn, after = screens(text)
        verdict("view_runs", "" if code == 0 and 5 <= len(drawn) <= 20 else f"exit {code}, {len(drawn)} screens: {text[-500:]}")
        if len(drawn) < 2:
            return 1
        rows, columns = max(len(s) for s in drawn), max(len(line) for s in drawn for line in s)
        verdict("view_fits_80_by_24", "" if rows <= 24 and columns <= 80 else f"{rows} rows, {columns} columns")
        last = "\n".join(drawn[-2])
        missing = [w for w in ("active", "index   |#", "contacts", "missed deadlines", "dead-man switch held", "lifted",
                               "safety: armed -> active") if w not in last]
        verdict("view_shows_the_state", f"no {missing} in\n{last}" if missing else "")
        verdict("a_narrow_terminal_cuts_lines", "" if "\033[?7l" in text and text.rfind("\033[?7h") > text.rfind("\033[?7l") else text[:100])
        verdict("summary_follows_the_view", "" if "state hash" in after else after)
        text, code = watch(base, kill_after=4)
        verdict("view_gives_the_cursor_back", "" if text.rfind("\033[?25h") > text.rfind("\033[?25l") else text[-300:])
        verdict("sigterm_ends_the_view", "" if code == 0 and "ended (signal)" in text else f"exit {code}")
    return 1 if failed else 0


sys.exit(main())
