# SPDX-License-Identifier: BSD-3-Clause
"""An LCM log of gloved, decoded. The types are made by lcm-gen from data/lcm into build/types-python."""
import glob
import os
import struct
import subprocess
import sys

import lcm

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
INSTALLED = not os.path.exists(os.path.join(ROOT, "Makefile"))
CACHE = os.path.join(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache"), "gloved") if INSTALLED else os.path.join(ROOT, "build")
FOLDER = os.path.join(CACHE, "types-python")
TYPES = {"GLOVED_STATE": "state_t", "GLOVED_STATE2": "state_t", "GLOVED_STATS": "stats_t", "GLOVED_EVENT": "event_t",
         "GLOVED_ABOUT": "about_t", "GLOVED_TRACE": "trace_t",
         "DRAKE_VIEWER_LOAD_ROBOT": "viewer_load_t", "DRAKE_VIEWER_DRAW": "viewer_draw_t"}


def types():
    """The module of generated types, made anew where a definition is younger."""
    sources = sorted(glob.glob(os.path.join(ROOT, "data", "lcm", "*.lcm")))
    mark = os.path.join(FOLDER, ".done")
    if not os.path.exists(mark) or os.path.getmtime(mark) < max(map(os.path.getmtime, sources)):
        os.makedirs(FOLDER, exist_ok=True)
        subprocess.run(["lcm-gen", "-p", "--ppath", FOLDER, *sources], check=True, stdout=subprocess.DEVNULL)
        open(mark, "w").close()
    if FOLDER not in sys.path:
        sys.path.insert(0, FOLDER)
    import gloved
    return gloved


class Log:
    """Messages of a log by channel, in order."""

    def __init__(self, path):
        self.path, self.raw, self.damaged = path, [], 0
        try:
            self.raw = [(event.channel, event.timestamp, event.data) for event in lcm.EventLog(path)]
        except OSError as error:
            sys.exit(f"{os.path.basename(sys.argv[0])}: {path}: {error.strerror or 'cannot be read'}")
        if not self.raw:
            sys.exit(f"{os.path.basename(sys.argv[0])}: {path}: no LCM log, or empty; record one with gloved --log")

    def of(self, channel):
        """Every message of one channel."""
        kind = getattr(types(), TYPES[channel])
        messages = []
        for name, _, data in self.raw:
            if name != channel:
                continue
            try:
                messages.append(kind.decode(data))
            except (ValueError, IndexError, UnicodeDecodeError, struct.error, TypeError, MemoryError):
                self.damaged += 1
                print(f"{os.path.basename(sys.argv[0])}: {self.path}: a damaged message of {channel} is left out", file=sys.stderr)
        return messages
