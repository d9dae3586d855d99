# SPDX-License-Identifier: BSD-3-Clause
"""What comes from the network or lies damaged on the disk ends neither look.py nor log-to-trace, and look.py answers only
those who call it by its name."""
import http.client
import json
import os
import socket
import subprocess
import sys
import tempfile
import threading
import time

sys.path.insert(0, "tools")
import lcm

import gloved_log
import look

B = os.environ["B"]


def test_log_to_trace_leaves_damaged_messages_out():
    with tempfile.TemporaryDirectory() as folder:
        path = lambda name: os.path.join(folder, name)
        subprocess.run([B + "/gloved", "--fcu", "sim:?speed=0", "--lcm", "none", "--duration", "1", "--log", path("run.lcm")], check=True,
                       stdout=subprocess.DEVNULL)
        log = lcm.EventLog(path("bad.lcm"), "w", overwrite=True)
        for number, event in enumerate(lcm.EventLog(path("run.lcm"))):
            log.write_event(event.timestamp, event.channel, event.data)
            if event.channel == "GLOVED_TRACE" and number % 2:
                for damaged in (b"", event.data[:-5], event.data[:40], bytes(8) + event.data[8:], event.data[:30] + b"\xff" * 60):
                    log.write_event(event.timestamp, event.channel, damaged)
        log.close()
        run = subprocess.run(["tools/log-to-trace", path("bad.lcm"), path("out.log")], capture_output=True, text=True, check=False)
        assert run.returncode == 0 and "Traceback" not in run.stderr and "damaged message" in run.stderr, run.stderr


def test_look_leaves_damaged_messages_out():
    picture, types = look.Picture(), gloved_log.types()
    state = types.state_t()
    state.time_s, state.limb = float("nan"), [types.limb_t() for _ in range(16)]
    good = state.encode()
    state.safety_state = 99
    for data in (b"", good[:-3], bytes(200), state.encode()):
        for take in (picture.on_state, picture.on_about, picture.on_load):
            take("", data)
    assert picture.damaged > 10 and "state" not in picture.event
    picture.on_state("", good)
    assert json.loads(picture.event["state"])["time_s"] is None, picture.event["state"]


def serve():
    look.Page.names = look.LOCAL
    server = look.http.server.ThreadingHTTPServer(("127.0.0.1", 0), look.Page)
    server.daemon_threads = True
    threading.Thread(target=server.serve_forever, daemon=True).start()
    return server


def ask(server, method, host, path="/"):
    link = http.client.HTTPConnection("127.0.0.1", server.server_address[1], timeout=5)
    link.request(method, path, headers={"Host": host})
    answer = link.getresponse()
    return answer.status, answer.read()


def test_look_answers_to_its_own_name_alone():
    server = serve()
    port = server.server_address[1]
    assert ask(server, "GET", f"localhost:{port}")[0] == 200
    assert ask(server, "GET", f"[::1]:{port}")[0] == 200
    for host in ("evil.example", f"evil.example:{port}", "localhost.evil.example", ""):
        assert ask(server, "GET", host)[0] == 421, host
        assert ask(server, "HEAD", host, "/events")[0] == 421, host
    server.shutdown()


def test_look_answers_head():
    server = serve()
    assert ask(server, "HEAD", "localhost") == (200, b"") and ask(server, "HEAD", "localhost", "/nothing")[0] == 404
    server.shutdown()


def test_look_ends_the_threads_of_closed_pages():
    server, before = serve(), threading.active_count()
    for _ in range(5):
        link = socket.create_connection(("127.0.0.1", server.server_address[1]))
        link.sendall(b"GET /events HTTP/1.1\r\nHost: localhost\r\n\r\n")
        link.recv(100)
        link.close()
    end = time.time() + 20  # nothing is published: the server finds out by itself
    while threading.active_count() > before and time.time() < end:
        time.sleep(0.1)
    assert threading.active_count() <= before, threading.active_count() - before
    server.shutdown()


def main():
    failed = False
    for name, test in sorted(globals().items()):
        if not name.startswith("test_"):
            continue
        try:
            test()
            print("ok " + name, flush=True)
        except Exception as error:  # a test that cannot run has failed as well
            failed = True
            print(f"  {type(error).__name__}: {str(error)[:1500]}\nFAIL {name}", flush=True)
    return 1 if failed else 0


sys.exit(main())
