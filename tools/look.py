#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""look.py [LOG [LOG]] [--port N] - the 3D view in the browser: serves a page (data/viewer/look.html) that shows what
gloved publishes over LCM, or plays LCM logs, two of them side by side. Everything comes from this machine: the page is
ours, three.js is Debian's libjs-three. Runs until it is interrupted. LCM_DEFAULT_URL says where to listen."""
import argparse
import glob
import http.server
import json
import math
import os
import re
import shutil
import struct
import sys
import threading
import urllib.parse

import lcm

import gloved_log
import hand_source
import scene_mesh

VIEWER = os.path.join(gloved_log.ROOT, "data", "viewer")
THREE = "/usr/share/javascript/three/three.module.js"
LOCAL = ("localhost", "127.0.0.1", "::1")
KINDS = {".html": "text/html; charset=utf-8", ".js": "text/javascript; charset=utf-8", ".css": "text/css; charset=utf-8"}
SHAPE = ("name", "geom", "type", "position", "quaternion", "color", "float_data")
STATE = ("utime", "time_s", "safety_state", "faults", "dead_man", "glove_age_s", "force_desired_n", "force_commanded_n", "force_measured_n",
         "wrist_position_m", "wrist_quaternion", "head_position_m", "head_quaternion", "limb", "object", "contact", "polygon",
         "position_m", "quaternion", "driver_position_m", "driver_quaternion", "name", "is_static", "limb", "object", "face", "piece",
         "depth_m", "normal", "force_n")
POST_MAX = 2000
ANSWER = ("position", "quaternion", "grips", "tensions", "dead_man", "forces", "other")
ABOUT = ("version", "commit", "date", "fcu", "hand", "rate_hz", "scene", "scene_hash")


def plain(message, fields):
    """A message as what JSON can say: those fields; a number that is none becomes null."""
    if isinstance(message, float):
        return round(message, 6) if math.isfinite(message) else None
    if isinstance(message, (list, tuple)):
        return [plain(item, fields) for item in message]
    names = getattr(message, "__slots__", None) or getattr(message, "__dict__", None)
    if names is not None:
        return {name: plain(getattr(message, name), fields) for name in names if name in fields}
    return message


def layouts():
    """Every type of data/lcm with its fingerprint and fields (name, type, dimensions), for the page's own reading of logs."""
    out = {}
    for path in glob.glob(os.path.join(gloved_log.ROOT, "data", "lcm", "*.lcm")):
        with open(path, encoding="utf-8") as file:
            text = re.sub(r"//.*", "", file.read())
        for name, body in re.findall(r"struct (\w+) \{(.*?)\}", text, re.S):
            fields = [(field, kind, [int(n) if n.isdecimal() else n for n in re.findall(r"\[(\w+)\]", dimensions)])
                      for kind, field, dimensions in re.findall(r"(\w+)\s+(\w+)((?:\[\w+\])*);", body)]
            out[name] = {"fingerprint": getattr(gloved_log.types(), name)._get_packed_fingerprint().hex(), "fields": fields}
    return out


def move(hand, wanted):
    """What the page asks of the hand, to gloved; the newest answer, or nothing. ValueError where it cannot be meant."""
    if hand is None or not isinstance(wanted, dict):
        raise ValueError("no hand")
    if wanted.get("home"):
        return hand.home()
    if wanted.get("ask"):
        return hand.ask()
    lists = [[float(x) for x in wanted[name]] for name in ("position", "quaternion", "grips")]
    if [len(x) for x in lists] != [3, 4, 5] or not all(math.isfinite(x) for one in lists for x in one):
        raise ValueError("no pose")
    return hand.send(*lists, dead_man=wanted.get("dead_man") is True)


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

    KINDS = ("about", "load", "state")  # in this order

    def __init__(self):
        self.changed = threading.Condition()
        self.event, self.number, self.raw_load, self.damaged = {}, {}, None, 0
        self.second = None  # hand's newest state: gloved sends it just before the first one's of the same step

    def put(self, kind, content):
        with self.changed:
            self.event[kind] = json.dumps(content, separators=(",", ":"), allow_nan=False)
            self.number[kind] = self.number.get(kind, 0) + 1
            self.changed.notify_all()

    @careful
    def on_load(self, _, data):
        if data == self.raw_load:  # once a second, always the same
            return
        links = gloved_log.types().viewer_load_t.decode(data).link
        kept = [link for link in links if link.name.startswith(("hand::", "hand2::", "objects::"))]
        self.put("load", plain(kept, SHAPE))
        self.raw_load = data

    @careful
    def on_about(self, _, data):
        self.put("about", plain(gloved_log.types().about_t.decode(data), ABOUT))

    def state_of(self, data):
        state = gloved_log.types().state_t.decode(data)
        if not 0 <= state.safety_state <= 6:
            raise ValueError("no such state of the safety machine")
        return state

    @careful
    def on_second(self, _, data):
        self.second = self.state_of(data)

    @careful
    def on_state(self, _, data):
        state, second = self.state_of(data), self.second
        content = plain(state, STATE)
        if second and second.step == state.step:
            content["second"] = plain(second, STATE)
        self.put("state", content)

    def wait(self, seen):
        """What is newer than `seen` (kind to number), which is brought up to date."""
        with self.changed:
            self.changed.wait_for(lambda: self.number != seen, timeout=5)
            fresh = [(kind, self.event[kind]) for kind in self.KINDS if self.number.get(kind) != seen.get(kind)]
            seen.update(self.number)
            return fresh


class Page(http.server.BaseHTTPRequestHandler):
    picture = Picture()
    logs = ()   # paths of the logs to play
    names = ()  # that this server is called by; empty: any
    hand = None  # hand_source.Hand, once main has made it
    scenes, reading = {}, threading.Lock()  # meshes of the last scene by its hash

    def is_for_us(self):
        """A page of somebody else's that has its name point here (DNS rebinding) comes with that name as Host."""
        host = self.headers.get("Host", "").lower()
        host = host[1:].split("]")[0] if host.startswith("[") else host.split(":")[0]
        if not self.names or host in self.names:
            return True
        self.send_error(421, "this server is not called that; open http://localhost")
        return False

    def meshes(self, query):
        """Those of the scene file that the page asks for by name and hash, as text; {} where it is not here."""
        asked = urllib.parse.parse_qs(query)
        name, wanted = asked.get("file", [""])[0], asked.get("hash", [""])[0]
        with self.reading:
            if wanted not in self.scenes:
                text = scene_mesh.read(name, wanted)
                if text is None:
                    return b"{}"
                self.scenes.clear()
                self.scenes[wanted] = json.dumps(scene_mesh.meshes(text), separators=(",", ":")).encode()
            return self.scenes[wanted]

    def find(self):
        """(content type, file or bytes or None for the stream) of the path asked for; None where there is nothing."""
        path, _, query = self.path.partition("?")
        if path == "/events":
            return "text/event-stream", None
        if path == "/meshes":
            return "application/json", self.meshes(query)
        if path == "/types":
            return "application/json", json.dumps(layouts()).encode()
        if path == "/logs":
            return "application/json", json.dumps([os.path.basename(log) for log in self.logs]).encode()
        if path.startswith("/log/") and path[5:].isdecimal() and int(path[5:]) < len(self.logs):
            return "application/octet-stream", self.logs[int(path[5:])]
        if path == "/three.js":
            return KINDS[".js"], THREE
        name = "look.html" if path == "/" else path[1:]
        if name in os.listdir(VIEWER) and os.path.splitext(name)[1] in KINDS:
            return KINDS[os.path.splitext(name)[1]], os.path.join(VIEWER, name)
        return None

    def respond(self, with_body):
        if not self.is_for_us():
            return
        found = self.find()
        if not found:
            self.send_error(404)
            return
        kind, content = found
        try:
            if content is None:
                self.answer(kind)
                if with_body:
                    self.stream()
            elif isinstance(content, bytes):
                self.answer(kind, len(content))
                if with_body:
                    self.wfile.write(content)
            else:
                self.send_file(kind, content, with_body)
        except OSError:
            pass  # the page was closed

    def do_POST(self):
        """/hand alone: what the page's sliders want of the hand of gloved --fcu hand:, in JSON; the answer says where it is."""
        if not self.is_for_us():
            return
        host, origin, length = self.headers.get("Host", ""), self.headers.get("Origin"), self.headers.get("Content-Length", "")
        if self.path != "/hand" or origin not in (None, "http://" + host) or self.headers.get("Content-Type") != "application/json":
            self.send_error(403, "only this server's own page may do that")
            return
        try:
            wanted = json.loads(self.rfile.read(int(length))) if 0 < int(length) <= POST_MAX else None
            with self.reading:
                told = move(self.hand, wanted)
        except (ValueError, TypeError, KeyError, struct.error, OverflowError):
            self.send_error(400)
            return
        try:
            text = json.dumps(plain(told, ANSWER)).encode()
            self.answer("application/json", len(text))
            self.wfile.write(text)
        except OSError:
            pass

    def do_HEAD(self):
        self.respond(False)

    def do_GET(self):
        self.respond(True)

    def answer(self, kind, length=None):
        self.send_response(200)
        self.send_header("Content-Type", kind)
        if length is not None:
            self.send_header("Content-Length", str(length))
        self.send_header("Cache-Control", "no-store")
        self.send_header("Content-Security-Policy", "default-src 'self' data:; style-src 'self' 'unsafe-inline'")  # nothing from a network
        self.send_header("X-Content-Type-Options", "nosniff")
        self.end_headers()

    def send_file(self, kind, path, with_body):
        try:
            file = open(path, "rb")
        except OSError as error:
            self.send_error(404, f"{os.path.basename(path)}: {error.strerror}")
            return
        with file:
            self.answer(kind, os.fstat(file.fileno()).st_size)
            if with_body:
                shutil.copyfileobj(file, self.wfile)

    def stream(self):
        seen = {}
        while True:
            fresh = self.picture.wait(seen)
            for kind, text in fresh:
                self.wfile.write(f"event: {kind}\ndata: {text}\n\n".encode())
            if not fresh:  # a page that was closed is found out by writing to it
                self.wfile.write(b": still here\n\n")
            self.wfile.flush()

    def log_message(self, *_):
        pass


def serve(host, port):
    try:
        server = http.server.ThreadingHTTPServer((host, port), Page)
    except OSError as error:
        raise SystemExit(f"gloved-look: port {port}: {error.strerror}; choose another: gloved-look --port {port + 1}, or make look PORT={port + 1}")
    except OverflowError:
        raise SystemExit(f"gloved-look: --port {port}: ports go from 1 to 65535")
    server.daemon_threads = True
    if host in LOCAL:
        Page.names = LOCAL
    threading.Thread(target=server.serve_forever, daemon=True).start()
    return server


def listen():
    try:
        link = lcm.LCM()
    except RuntimeError:
        raise SystemExit("gloved-look: LCM does not start; check LCM_DEFAULT_URL, or give this machine a multicast route "
                         "(ip route add 224.0.0.0/4 dev lo)")
    link.subscribe("DRAKE_VIEWER_LOAD_ROBOT", Page.picture.on_load)
    link.subscribe("GLOVED_ABOUT", Page.picture.on_about)
    link.subscribe("GLOVED_STATE2", Page.picture.on_second).set_queue_capacity(5)
    link.subscribe("GLOVED_STATE", Page.picture.on_state).set_queue_capacity(5)
    return link


def take(link):
    while True:
        link.handle()


def main():
    parser = argparse.ArgumentParser(prog="gloved-look", description=__doc__.split(" - ")[1])
    parser.add_argument("log", nargs="*", help="LCM log of a run (gloved --log); two are shown side by side")
    parser.add_argument("--host", default="localhost", help="0.0.0.0: other machines may look, too")
    parser.add_argument("--port", type=int, default=7000, help="of the page (7000)")
    parser.add_argument("--hand-port", type=int, default=hand_source.PORT, help="as gloved's --fcu hand:?listen=N (20500): sliders move it")
    args = parser.parse_args()
    for log in args.log:
        if not os.access(log, os.R_OK):
            raise SystemExit(f"gloved-look: {log}: cannot be read")
    if len(args.log) > 2:
        raise SystemExit("gloved-look: give one log, or two to compare")
    if not os.path.exists(THREE):
        raise SystemExit("gloved-look: three.js is missing; apt-get install libjs-three")
    Page.logs, Page.hand = args.log, hand_source.Hand(args.hand_port)
    gloved_log.types()
    link = listen()
    serve(args.host, args.port)
    print(f"viewer: open http://localhost:{args.port}", flush=True)
    threading.Thread(target=take, args=(link,), daemon=True).start()
    try:
        threading.Event().wait()  # signals come to this thread, and not in the middle of a message
    except KeyboardInterrupt:
        pass


if __name__ == "__main__":
    sys.exit(main())
