#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""look.py [--port N] - the 3D view without Drake: a web page (data/viewer/look.html) that draws with WebGL what gloved
publishes for Drake's viewer. A few MB instead of 420: needs `pip install lcm` and nothing else. Runs until it is
interrupted. LCM_DEFAULT_URL says where to listen."""
import argparse
import http.server
import json
import math
import os
import struct
import threading

import lcm

import gloved_log
from gloved_names import FINGERS, SAFETY

VIEWER = os.path.join(gloved_log.ROOT, "data", "viewer")
LOCAL = ("localhost", "127.0.0.1", "::1")


def finite(content):
    """What JSON can say: a number that is none becomes null."""
    if isinstance(content, float):
        return content if math.isfinite(content) else None
    if isinstance(content, dict):
        return {key: finite(value) for key, value in content.items()}
    return [finite(value) for value in content] if isinstance(content, (list, tuple)) else content


def careful(take):
    """A message that does not decode, or says what cannot be, is left out."""
    def taken(self, channel, data):
        try:
            take(self, channel, data)
        except (ValueError, IndexError, UnicodeDecodeError, struct.error, TypeError, MemoryError, AttributeError):
            self.damaged += 1
    return taken


class Picture:
    """The newest message of each kind as text for the page; `changed` wakes the pages that wait."""

    def __init__(self):
        self.changed = threading.Condition()
        self.event, self.number, self.raw_load, self.states, self.damaged = {}, {}, None, 0, 0

    def put(self, kind, content):
        with self.changed:
            self.event[kind] = json.dumps(finite(content), separators=(",", ":"), allow_nan=False)
            self.number[kind] = self.number.get(kind, 0) + 1
            self.changed.notify_all()

    @careful
    def on_load(self, _, data):
        if data == self.raw_load:  # once a second, always the same
            return
        links = gloved_log.types().viewer_load_t.decode(data).link
        self.raw_load = data
        self.put("load", [{"name": link.name, "geometry": [
            {"type": g.type, "position": g.position, "quaternion": g.quaternion, "color": g.color, "numbers": g.float_data} for g in link.geom]}
            for link in links])

    @careful
    def on_draw(self, _, data):
        draw = gloved_log.types().viewer_draw_t.decode(data)
        self.put("draw", [[round(x, 6) for x in (*p, *q)] for p, q in zip(draw.position, draw.quaternion)])

    @careful
    def on_state(self, _, data):
        self.states += 1
        if self.states % 5:
            return
        s = gloved_log.types().state_t.decode(data)
        self.put("state", {"state": SAFETY[s.safety_state], "time": s.time_s, "contacts": s.num_contacts, "fingers": FINGERS, "force": s.force_commanded_n})

    def wait(self, seen):
        """What is newer than `seen` (kind to number), which is brought up to date. Load before draw."""
        with self.changed:
            self.changed.wait_for(lambda: self.number != seen, timeout=5)
            fresh = [(kind, self.event[kind]) for kind in ("load", "draw", "state") if self.number.get(kind) != seen.get(kind)]
            seen.update(self.number)
            return fresh


class Page(http.server.BaseHTTPRequestHandler):
    picture = Picture()

    names = ()  # that this server is called by; empty: any

    def is_for_us(self):
        """A page of somebody else's that has its name point here (DNS rebinding) comes with that name as Host."""
        host = self.headers.get("Host", "").lower()
        host = host[1:].split("]")[0] if host.startswith("[") else host.split(":")[0]
        if not self.names or host in self.names:
            return True
        self.send_error(421, "this server is not called that; open http://localhost")
        return False

    def do_HEAD(self):
        if not self.is_for_us():
            return
        kind = {"/": "text/html; charset=utf-8", "/events": "text/event-stream"}.get(self.path)
        if kind:
            self.answer(kind)
        else:
            self.send_error(404)

    def do_GET(self):
        if not self.is_for_us():
            return
        if self.path == "/":
            self.answer("text/html; charset=utf-8")
            with open(os.path.join(VIEWER, "look.html"), "rb") as file:
                self.wfile.write(file.read())
        elif self.path == "/events":
            self.answer("text/event-stream")
            self.stream()
        else:
            self.send_error(404)

    def answer(self, kind):
        self.send_response(200)
        self.send_header("Content-Type", kind)
        self.send_header("Cache-Control", "no-store")
        self.end_headers()

    def stream(self):
        seen = {}
        try:
            with open(os.path.join(VIEWER, "viewer.json"), encoding="utf-8") as file:
                self.say("camera", json.dumps(json.load(file)))
            while True:
                fresh = self.picture.wait(seen)
                for kind, text in fresh:
                    self.say(kind, text)
                if not fresh:  # a page that was closed is found out by writing to it
                    self.wfile.write(b": still here\n\n")
                    self.wfile.flush()
        except OSError:
            pass  # the page was closed

    def say(self, kind, text):
        self.wfile.write(f"event: {kind}\ndata: {text}\n\n".encode())
        self.wfile.flush()

    def log_message(self, *_):
        pass


def main():
    parser = argparse.ArgumentParser(description=__doc__.split(" - ")[1])
    parser.add_argument("--host", default="localhost", help="0.0.0.0: other machines may look, too")
    parser.add_argument("--port", type=int, default=7000)
    args = parser.parse_args()
    gloved_log.types()
    try:
        link = lcm.LCM()
    except RuntimeError:
        raise SystemExit("look: LCM does not start; check LCM_DEFAULT_URL, or give this machine a multicast route (ip route add 224.0.0.0/4 dev lo)")
    link.subscribe("DRAKE_VIEWER_LOAD_ROBOT", Page.picture.on_load)
    link.subscribe("DRAKE_VIEWER_DRAW", Page.picture.on_draw).set_queue_capacity(2)
    link.subscribe("GLOVED_STATE", Page.picture.on_state).set_queue_capacity(10)
    try:
        server = http.server.ThreadingHTTPServer((args.host, args.port), Page)
    except OSError as error:
        raise SystemExit(f"look: port {args.port}: {error.strerror}; choose another with --port")
    server.daemon_threads = True
    if args.host in LOCAL:
        Page.names = LOCAL
    threading.Thread(target=server.serve_forever, daemon=True).start()
    print(f"viewer: open http://localhost:{args.port}", flush=True)
    try:
        while True:
            link.handle()
    except KeyboardInterrupt:
        pass


if __name__ == "__main__":
    main()
