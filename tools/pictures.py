#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""pictures.py BUILD FOLDER NAME=SCENE,SCRIPT[+SCRIPT2][,ADDRESS]... - the page of gloved-look as FOLDER/NAME.jpg, for the documentation: each a run of
the simulated user as fast as it goes, played in headless Chromium at what ADDRESS says (time=7&camera=palm, see look.js)."""
import io
import os
import subprocess
import sys
import tempfile

from PIL import Image

import gloved_log
from chromium import Browser

PORT, SIZE = 7019, (1200, 720)
LOADED = "window.gloved && !gloved.shown.live && gloved.shown.whole && gloved.shown.hand && gloved.shown.drawn > 2"


def record(build, folder, name, scene, script):
    log = os.path.join(folder, name + ".lcm")
    fcus = [part for option, one in zip(("--fcu", "--fcu2"), script.split("+")) for part in (option, f"sim:{one}?speed=0")]
    subprocess.run([build + "/gloved", *fcus, "--scene", scene, "--lcm", "none", "--log", log], check=True,
                   stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return log


def viewer(log):
    """gloved-look with a log, ready."""
    process = subprocess.Popen([sys.executable, os.path.join(gloved_log.ROOT, "tools", "look.py"), "--port", str(PORT), log], stdout=subprocess.PIPE,
                               text=True, env=dict(os.environ, LCM_DEFAULT_URL="memq://"))
    process.stdout.readline()
    return process


def take(folder, log, address):
    """The page as a picture."""
    look = viewer(log)
    browser = Browser(folder, "about:blank")
    try:
        browser.size(*SIZE)
        browser.ask("Page.navigate", url=f"http://localhost:{PORT}/?log=0&{address}")
        if not browser.wait(LOADED, 60) or browser.complaints:
            raise SystemExit(f"pictures: the page does not show {log}: {browser.value('JSON.stringify(gloved.shown)')} {browser.complaints}")
        browser.value("new Promise(done => setTimeout(done, 1500))")
        return Image.open(io.BytesIO(browser.picture())).convert("RGB")
    finally:
        browser.close()
        look.terminate()
        look.wait()


def main():
    if len(sys.argv) < 4:
        raise SystemExit("usage: pictures.py BUILD FOLDER NAME=SCENE,SCRIPT[+SCRIPT2][,ADDRESS]...")
    build, out, *wanted = sys.argv[1:]
    for one in wanted:
        name, _, rest = one.partition("=")
        scene, script, *address = rest.split(",")
        with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
            picture = take(folder, record(build, folder, name, scene, script), address[0] if address else "time=7")
        picture.save(os.path.join(out, name + ".jpg"), quality=90, subsampling=0, optimize=True)
        print(os.path.join(out, name + ".jpg"))


if __name__ == "__main__":
    main()
