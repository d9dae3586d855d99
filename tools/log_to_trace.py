#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""log-to-trace LOG TRACE - an LCM log of gloved (--log) to a trace (candump -L text) that `gloved --fcu
trace:TRACE?speed=0` replays to the same state: GLOVED_TRACE says which frames went into which step, and each frame
is stamped with its step's time. Needs `pip install lcm`."""
import os
import sys

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import gloved_log  # noqa: E402

# A frame that is not ours holds the place of the first and the last step: a replay begins and ends with them.
MARK = "7FF#"
SECOND = 64  # flag of a frame of the second hand's device


def frame_text(frame):
    data = bytes(frame.data[:frame.len]).hex().upper()
    name = f"{frame.id:08X}" if frame.flags & 8 else f"{frame.id:03X}"
    return f"{name}##{frame.flags >> 1 & 3:X}{data}" if frame.flags & 1 else f"{name}#{data}"


def quoted(text):
    """As libconfig reads it."""
    escaped = "".join({"\\": "\\\\", '"': '\\"', "\n": "\\n", "\t": "\\t", "\r": "\\r"}.get(c, c if c >= " " and c != "\x7f" else f"\\x{ord(c):02x}")
                      for c in text)
    return f'"{escaped}"'


def about_file(key, name, digest, text):
    lines = [f"  name = {quoted(name)};", f"  hash = {quoted(digest)};"] + ([f"  text = {quoted(text)};"] if text else [])
    return f"{key} = {{\n" + "\n".join(lines) + "\n};\n" if name else ""


def interface(frame):
    """As gloved --record names them, so that a replay of two hands finds its frames."""
    return "can1" if frame.flags & SECOND else "can0"


def write_about(log, path, hands):
    """What the run was made of (GLOVED_ABOUT) beside the recording, as gloved --record writes it: a replay takes that scene."""
    about = log.of("GLOVED_ABOUT")
    if not about:
        print("log-to-trace: no GLOVED_ABOUT in the log: a replay will not know the scene", file=sys.stderr)
        return
    a = about[0]
    texts = {"program": a.version, "commit": a.commit, "date": a.date, "command_line": a.command_line, "fcu": a.fcu, "tracker": a.tracker, "hand": a.hand}
    if hands == 2:
        texts.update(fcu="log: " + a.fcu, fcu2="log: the second hand")
    with open(path + ".about", "w", encoding="utf-8") as out:
        out.write(f"# What {path} was made of; gloved reads it when the recording is replayed.\nversion = 1;\n")
        out.write("".join(f"{key} = {quoted(text)};\n" for key, text in texts.items()) + f"rate_hz = {a.rate_hz:.9f};\n")
        out.write(about_file("scene", a.scene, a.scene_hash, a.scene_text) + about_file("settings", a.settings, a.settings_hash, a.settings_text))


def main():
    if sys.argv[1:] in (["--help"], ["-h"]):
        print(__doc__)
        return
    if len(sys.argv) != 3:
        sys.exit("log-to-trace: give LOG and TRACE; see log-to-trace --help")
    log = gloved_log.Log(sys.argv[1])
    steps = [(step, trace.period_s) for trace in log.of("GLOVED_TRACE") for step in trace.step]
    if not steps:
        sys.exit(f"log-to-trace: {sys.argv[1]}: no GLOVED_TRACE in it; record it with gloved --log")
    numbers = {step.step for step, _ in steps}
    last = max(numbers)
    missing = last - len(numbers)
    if missing:
        print(f"log-to-trace: {missing} of {last} steps are missing; the replay will differ", file=sys.stderr)
    if any(event.kind == 4 and not event.bits & 256 for event in log.of("GLOVED_EVENT")):
        print("log-to-trace: commands were obeyed in this run; the replay does not have them", file=sys.stderr)
    period = steps[0][1]
    with open(sys.argv[2], "w", encoding="ascii") as out:
        out.write(f"(0.000000) can0 {MARK}\n")
        for step, _ in steps:
            stamp_us = round((step.step - 1) * period * 1e9) // 1000
            for frame in step.frame:
                out.write(f"({stamp_us // 1000000}.{stamp_us % 1000000:06d}) {interface(frame)} {frame_text(frame)}\n")
        stamp_us = round((last - 1) * period * 1e9) // 1000
        out.write(f"({stamp_us // 1000000}.{stamp_us % 1000000:06d}) can0 {MARK}\n")
    two = any(frame.flags & SECOND for step, _ in steps for frame in step.frame)
    write_about(log, sys.argv[2], 2 if two else 1)
    print(f"{sys.argv[2]}: {last} steps of {period * 1e3:g} ms")


if __name__ == "__main__":
    main()
