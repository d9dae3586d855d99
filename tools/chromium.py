# SPDX-License-Identifier: BSD-3-Clause
"""Headless Chromium by its remote debugging port: opens a page and takes pictures of it. WebGL is drawn without a
graphics card (SwiftShader). Needs `pip install websocket-client`."""
import base64
import json
import subprocess
import time
import urllib.request

import websocket

FLAGS = """--headless --no-sandbox --disable-gpu --use-angle=swiftshader --enable-unsafe-swiftshader --disable-quic
--no-first-run --disable-background-networking --disable-component-update --disable-sync --window-size=1280,800
--remote-allow-origins=*""".split()


class Browser:
    """One page in a window of 1280 x 800; `folder`: an empty one for Chromium's own files."""

    def __init__(self, folder, url, port=9318):
        self.port = port
        self.process = subprocess.Popen(["chromium", *FLAGS, f"--user-data-dir={folder}", f"--remote-debugging-port={port}", url],
                                        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self.socket = websocket.create_connection(self.page(), timeout=60)
        self.number, self.complaints = 0, []
        self.ask("Runtime.enable")
        self.ask("Log.enable")

    def page(self):
        for _ in range(120):
            try:
                pages = json.load(urllib.request.urlopen(f"http://127.0.0.1:{self.port}/json"))
                return next(p for p in pages if p["type"] == "page")["webSocketDebuggerUrl"]
            except (OSError, StopIteration):
                time.sleep(0.25)
        raise RuntimeError("Chromium did not start")

    def ask(self, method, **params):
        """One command of the debugging protocol; its result. What the page complains of meanwhile goes to `complaints`."""
        self.number += 1
        self.socket.send(json.dumps({"id": self.number, "method": method, "params": params}))
        while True:
            answer = json.loads(self.socket.recv())
            if answer.get("method") == "Runtime.exceptionThrown":
                details = answer["params"]["exceptionDetails"]
                self.complaints.append(details.get("exception", {}).get("description") or details["text"])
            if answer.get("method") == "Log.entryAdded" and answer["params"]["entry"]["level"] == "error":
                self.complaints.append(answer["params"]["entry"]["text"] + " " + answer["params"]["entry"].get("url", ""))
            if answer.get("id") == self.number:
                return answer.get("result", {})

    def value(self, expression):
        """What a JavaScript expression is in the page (None: it has no value, or failed)."""
        return self.ask("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True).get("result", {}).get("value")

    def wait(self, expression, seconds=30):
        """Until the expression is true; whether it was in time."""
        end = time.time() + seconds
        while not self.value(expression):
            if time.time() > end:
                return False
            time.sleep(0.1)
        return True

    def key(self, key):
        """A key pressed and let go."""
        code = {" ": 32, "ArrowLeft": 37, "ArrowRight": 39}.get(key, ord(key[0].upper()))
        for kind in ("keyDown", "keyUp"):
            self.ask("Input.dispatchKeyEvent", type=kind, key=key, text=key if len(key) == 1 and kind == "keyDown" else "", windowsVirtualKeyCode=code)

    def size(self, width, height):
        self.ask("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)

    def picture(self):
        """The page as PNG."""
        return base64.b64decode(self.ask("Page.captureScreenshot", format="png")["data"])

    def close(self):
        self.process.terminate()
        self.process.wait()
