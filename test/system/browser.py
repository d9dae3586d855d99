# SPDX-License-Identifier: BSD-3-Clause
"""Drake's viewer as a person sees it: gloved, the viewer, and headless Chromium; the pictures are checked for the hand, the object, the
forces and for movement, and kept in $B/test/view. Not part of `make test`: make test-view, with page.py for gloved-look's page."""
import io
import os
import signal
import subprocess
import sys
import tempfile
import time

from PIL import Image, ImageChops

sys.path.insert(0, "tools")
from chromium import Browser  # noqa: E402

B = os.environ["B"]
URL = "udpm://239.255.76.67:7778?ttl=0"  # a port of its own: a running viewer is not disturbed
PORT = 7018
SCRIPT, SCENE = "data/scripts/power_box.user", os.environ.get("SCENE", "data/scenes/box.scene")
PICTURES = os.path.join(B, "test", "view")
failed = False


def verdict(name, why):
    global failed
    print(f"ok {name}" if not why else f"  {why}\nFAIL {name}", flush=True)
    failed |= bool(why)


def start_viewer(program="viewer"):
    viewer = subprocess.Popen([sys.executable, f"tools/{program}.py", "--port", str(PORT)], stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT, text=True, env=dict(os.environ, LCM_DEFAULT_URL=URL))
    for line in viewer.stdout:
        if "open http" in line:
            return viewer
    raise RuntimeError("the viewer did not start")


def start_engine(options="", duration=None):
    command = [B + "/gloved", "--fcu", f"sim:{SCRIPT}{options}", "--scene", SCENE, "--lcm", URL, "--no-rt"]
    return subprocess.Popen(command + (["--duration", str(duration)] if duration else []),
                            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def stop(process):
    process.send_signal(signal.SIGINT)
    try:
        process.wait(10)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def picture(browser, name):
    """Kept in PICTURES; returned without the "Open Controls" button and the panel."""
    data = browser.picture()
    os.makedirs(PICTURES, exist_ok=True)
    with open(os.path.join(PICTURES, name + ".png"), "wb") as file:
        file.write(data)
    return Image.open(io.BytesIO(data)).convert("RGB").crop((0, 130, 1000, 650))


def count(image, wanted):
    return sum(n for n, color in image.getcolors(1 << 24) if wanted(*color))


def skin(r, g, b):
    return r > 150 and r - b > 18 and r >= g >= b


def paint(r, g, b):  # of the first object that can move
    return b - r > 60 and g - r > 30


def arrow(r, g, b):
    return g - r > 25 and g - b > 25


def changed(a, b):
    return sum(ImageChops.difference(a, b).convert("L").point(lambda v: 255 if v > 12 else 0).histogram()[255:])


def check_pictures(pictures, order):
    seen = [(count(p, skin), count(p, paint), count(p, arrow)) for p in pictures]
    moved = [changed(a, b) for a, b in zip(pictures, pictures[1:])]
    print(f"  pixels of hand, object, forces: {seen}; changed between pictures: {moved}")
    verdict(f"the_hand_is_seen_{order}", "" if max(s[0] for s in seen) > 3000 else str(seen))
    verdict(f"the_object_is_seen_{order}", "" if max(s[1] for s in seen) > 1000 else str(seen))
    verdict(f"forces_are_seen_{order}", "" if max(s[2] for s in seen) > 60 else str(seen))
    verdict(f"the_picture_moves_{order}", "" if max(moved) > 2000 else str(moved))


def look(folder, program, viewer_first):
    """Pictures of one whole grasp; whether both programs lived on."""
    if viewer_first:
        viewer = start_viewer(program)
        engine = start_engine()
    else:
        engine = start_engine()
        time.sleep(2)
        viewer = start_viewer(program)
    browser = Browser(folder, f"http://localhost:{PORT}")
    order = program + ("_first" if viewer_first else "_last")
    pictures = []
    try:
        while engine.poll() is None and len(pictures) < 9:
            time.sleep(1)
            pictures.append(picture(browser, f"{order}-{len(pictures)}"))
        pictures.append(picture(browser, f"{order}-end"))
        verdict(f"it_lives_{order}", "" if viewer.poll() is None else viewer.stdout.read()[-500:])
        check_pictures(pictures, order)
    finally:
        browser.close()
        stop(engine)
        stop(viewer)


def check_faults(program):
    """A run that ends in a fault, one killed in the middle, then a sound one: the viewer shows them all."""
    viewer = start_viewer(program)
    stop(start_engine("?loss_chance=0.3", 3))
    for duration in (2, 1):
        engine = start_engine("?loss_chance=0.3&jump_chance=0.2&noise_rad=0.2", duration)
        engine.wait()
    engine = start_engine()
    time.sleep(1.5)
    engine.kill()
    engine.wait()
    start_engine("", 1.5).wait()
    verdict(f"{program}_lives_through_faults", "" if viewer.poll() is None else viewer.stdout.read()[-500:])
    stop(viewer)


def main():
    for viewer_first in (True, False):
        with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
            look(folder, "viewer", viewer_first)
    check_faults("viewer")
    return 1 if failed else 0


sys.exit(main())
