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


def frame_text(frame):
    data = bytes(frame.data[:frame.len]).hex().upper()
    name = f"{frame.id:08X}" if frame.flags & 8 else f"{frame.id:03X}"
    return f"{name}##{frame.flags >> 1 & 3:X}{data}" if frame.flags & 1 else f"{name}#{data}"


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
        out.write(f"(0.000000) gloved {MARK}\n")
        for step, _ in steps:
            stamp_us = round((step.step - 1) * period * 1e9) // 1000
            for frame in step.frame:
                out.write(f"({stamp_us // 1000000}.{stamp_us % 1000000:06d}) gloved {frame_text(frame)}\n")
        stamp_us = round((last - 1) * period * 1e9) // 1000
        out.write(f"({stamp_us // 1000000}.{stamp_us % 1000000:06d}) gloved {MARK}\n")
    print(f"{sys.argv[2]}: {last} steps of {period * 1e3:g} ms")


if __name__ == "__main__":
    main()
