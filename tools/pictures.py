#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""pictures.py SCRIPT SCENE SECONDS OUT.png - one picture of the 3D view (tools/look.py) at SECONDS of a simulated user's
grasp, as headless Chromium shows it. make pictures makes those of the documentation."""
import os
import subprocess
import sys
import tempfile

import lcm

import gloved_log
from chromium import Browser

URL, PORT = "udpm://239.255.76.67:7783?ttl=0", 7019


def wait_until(seconds):
    """Until the run has come this far."""
    link, now = lcm.LCM(URL), [0.0]
    link.subscribe("GLOVED_STATE", lambda _, data: now.__setitem__(0, gloved_log.types().state_t.decode(data).time_s))
    while now[0] < seconds:
        if not link.handle_timeout(20000):
            raise SystemExit("pictures: nothing comes over LCM")


def main():
    if len(sys.argv) != 5:
        raise SystemExit("usage: pictures.py SCRIPT SCENE SECONDS OUT.png")
    script, scene, seconds, out = sys.argv[1:]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    viewer = subprocess.Popen([sys.executable, os.path.join(gloved_log.ROOT, "tools", "look.py"), "--port", str(PORT)],
                              stdout=subprocess.DEVNULL, env=dict(os.environ, LCM_DEFAULT_URL=URL))
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        browser = Browser(folder, f"http://localhost:{PORT}")
        engine = subprocess.Popen([os.environ["B"] + "/gloved", "--fcu", "sim:" + script, "--scene", scene, "--lcm", URL, "--no-rt"], **quiet)
        try:
            wait_until(float(seconds))
            with open(out, "wb") as file:
                file.write(browser.picture())
            print(out)
        finally:
            for process in (engine, viewer):
                process.terminate()
                process.wait()
            browser.close()


if __name__ == "__main__":
    main()
