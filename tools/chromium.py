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
        self.number = 0

    def page(self):
        for _ in range(120):
            try:
                pages = json.load(urllib.request.urlopen(f"http://127.0.0.1:{self.port}/json"))
                return next(p for p in pages if p["type"] == "page")["webSocketDebuggerUrl"]
            except (OSError, StopIteration):
                time.sleep(0.25)
        raise RuntimeError("Chromium did not start")

    def picture(self):
        """The page as PNG."""
        self.number += 1
        self.socket.send(json.dumps({"id": self.number, "method": "Page.captureScreenshot", "params": {"format": "png"}}))
        while True:
            answer = json.loads(self.socket.recv())
            if answer.get("id") == self.number:
                return base64.b64decode(answer["result"]["data"])

    def close(self):
        self.process.terminate()
        self.process.wait()
