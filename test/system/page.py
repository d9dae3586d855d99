# SPDX-License-Identifier: BSD-3-Clause
"""The page of gloved-look in headless Chromium as a person uses it: live, with the daemon killed, logs played, scrubbed, compared, keys and
mouse, nothing cut off. Pictures are kept in $B/test/view. Not part of `make test`: make test-look (no browser: test_look.py)."""
import io
import json
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
URL = "udpm://239.255.76.67:7778?ttl=0"  # a port of its own: a running gloved is not disturbed
PORT, HAND_PORT = 7017, 20571
PICTURES = os.path.join(B, "test", "view")
failed = False


def verdict(name, why):
    global failed
    print(f"ok {name}" if not why else f"  {why}\nFAIL {name}", flush=True)
    failed |= bool(why)


def record(folder, name, script, scene="data/scenes/box.scene"):
    log = os.path.join(folder, name + ".lcm")
    subprocess.run([B + "/gloved", "--fcu", f"sim:{script}?speed=0", "--scene", scene, "--lcm", "none", "--log", log], check=True,
                   stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return log


def start_viewer(*logs):
    viewer = subprocess.Popen([sys.executable, "tools/look.py", "--port", str(PORT), "--hand-port", str(HAND_PORT), *logs], stdout=subprocess.PIPE, text=True,
                              env=dict(os.environ, LCM_DEFAULT_URL=URL))
    viewer.stdout.readline()
    return viewer


def stop(process):
    process.send_signal(signal.SIGINT)
    try:
        process.wait(10)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


class Page:
    """gloved-look with a browser that shows it."""

    def __init__(self, folder, *logs, address=""):
        self.viewer = start_viewer(*logs)
        self.browser = Browser(folder, "about:blank")
        self.browser.size(1280, 800)
        self.browser.ask("Page.navigate", url=f"http://localhost:{PORT}/?{address}")
        self.browser.wait("window.gloved")

    def shown(self):
        return json.loads(self.browser.value("JSON.stringify(gloved.shown)"))

    def wait(self, condition, seconds=30):
        return self.browser.wait(f"(shown => {condition})(gloved.shown)", seconds)

    def picture(self, name):
        data = self.browser.picture()
        os.makedirs(PICTURES, exist_ok=True)
        with open(os.path.join(PICTURES, f"page-{name}.png"), "wb") as file:
            file.write(data)
        return Image.open(io.BytesIO(data)).convert("RGB")

    def settle(self):
        self.browser.value("new Promise(done => setTimeout(done, 700))")

    def click(self, selector):
        self.browser.value(f"document.querySelector('{selector}').click()")
        self.settle()

    def key(self, key):
        self.browser.key(key)
        self.settle()

    def close(self):
        self.browser.close()
        stop(self.viewer)


def pixels(image, wanted):
    inside = image.crop((0, 41, 980, 680))
    return sum(n for n, color in inside.getcolors(1 << 24) if wanted(*color))


def skin(r, g, b):
    return r > 90 and r - b > 40 and r > g > b


def paint(r, g, b):
    return b - r > 60 and b > 110


def arrow(r, g, b):
    return g - r > 60 and g - b > 40


def differ(a, b):
    return sum(ImageChops.difference(a, b).convert("L").point(lambda v: 255 if v > 16 else 0).histogram()[255:])


def check_live(folder):
    """A live grasp; then the daemon is killed, and another one comes."""
    page = Page(folder)
    verdict("it_waits_for_gloved", "" if page.browser.value("!document.getElementById('waiting').hidden") else "no word of waiting")
    run = lambda: subprocess.Popen([B + "/gloved", "--fcu", "sim:power_box", "--scene", "box", "--lcm", URL, "--no-rt"],
                                   stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    daemon = run()
    verdict("it_shows_a_live_grasp", "" if page.wait("shown.hand && shown.forces > 2 && shown.state === 'active' && !shown.banner", 40) else str(page.shown()))
    seen = [page.picture("live")]
    page.browser.value("new Promise(done => setTimeout(done, 1500))")
    first = page.shown()["time"]
    seen.append(page.picture("live-later"))
    verdict("the_picture_moves", "" if page.shown()["time"] > first and differ(*seen) > 500 else str((first, page.shown()["time"], differ(*seen))))
    daemon.kill()
    daemon.wait()
    verdict("a_killed_daemon_is_told_in_red", "" if page.wait("shown.banner.includes('Nothing arrives') && shown.state === 'silent'", 8) else str(page.shown()))
    red = page.picture("killed").getpixel((20, 50))
    verdict("the_banner_is_red", "" if red[0] > 150 and red[1] < 60 else str(red))
    daemon = run()
    verdict("the_next_run_ends_the_alarm", "" if page.wait("!shown.banner && shown.time < 3 && shown.hand", 30) else str(page.shown()))
    stop(page.viewer)
    verdict("a_viewer_that_ended_is_told", "" if page.wait("shown.banner.includes('gloved-look has ended')", 15) else str(page.shown()))
    stop(daemon)
    verdict("no_complaint_live", "\n".join(c for c in page.browser.complaints if "/events" not in c and "ERR_" not in c))
    page.close()


def check_log(folder, log):
    page = Page(folder, log, address="time=7")
    verdict("a_log_is_shown_at_a_time", "" if page.wait("!shown.live && shown.hand && shown.time === 7 && shown.drawn > 3") else str(page.shown()))
    page.settle()
    picture = page.picture("palm")
    seen = pixels(picture, skin), pixels(picture, paint), pixels(picture, arrow)
    verdict("hand_object_and_forces_are_seen", "" if seen[0] > 15000 and seen[1] > 15000 and seen[2] > 250 else str(seen))
    views = {}
    for key, preset in zip("12345", ("palm", "side", "top", "back", "head")):
        page.key(key)
        views[preset] = page.picture(preset)
    same = [name for name in ("side", "top", "back") if differ(views["palm"], views[name]) < 30000]
    verdict("presets_look_from_elsewhere", " ".join(same))
    page.key("1")
    check_switches(page)
    check_time(page)
    check_help_and_window(page)
    verdict("no_complaint_in_a_log", "\n".join(page.browser.complaints))
    page.close()


def check_switches(page):
    before = page.shown()
    for key in "fcpmg":
        page.key(key)
    after = page.shown()
    changed = (before["forces"] > 0 == after["forces"], before["contacts"] == 0 < after["contacts"], before["polygons"] == 0 < after["polygons"],
               before["measured"] > 0 == after["measured"])
    verdict("keys_switch_what_is_shown", "" if all(changed) else f"{before} {after}")
    page.picture("switched")
    page.click("[data-show=forces]")
    verdict("a_button_switches_as_well", "" if page.shown()["forces"] == before["forces"] else str(page.shown()))
    for key in "cpmg":
        page.key(key)


def check_time(page):
    page.key("ArrowLeft")
    back = page.shown()["time"]
    page.browser.value("{const s = document.getElementById('scrub'); s.value = 2; s.oninput();}")
    page.settle()
    verdict("arrows_and_slider_move_in_time", "" if abs(back - 6.98) < 1e-6 and abs(page.shown()["time"] - 2) < 0.05 else f"{back} {page.shown()['time']}")
    page.browser.value("document.getElementById('speed').value = '0.1'")
    page.key(" ")
    begun, clock = page.shown()["time"], time.monotonic()
    page.browser.value("new Promise(done => setTimeout(done, 2000))")
    page.key(" ")
    passed, real = page.shown()["time"] - begun, time.monotonic() - clock
    paused = page.shown()["time"]
    page.settle()
    verdict("slow_motion_is_a_tenth", "" if 0.01 * real < passed < 0.12 * real else f"{passed} of {real}")
    verdict("space_pauses", "" if page.shown()["time"] == paused and not page.shown()["playing"] else str(page.shown()))


def check_help_and_window(page):
    page.key("h")
    page.picture("help")
    told = page.browser.value("document.getElementById('help').open && document.getElementById('help').innerText")
    verdict("help_tells_mouse_and_keys", "" if told and all(word in told for word in ("drag", "wheel", "space", "contacts")) else str(told))
    page.key("h")
    for width, height in ((1280, 800), (1000, 640), (1920, 1080)):
        page.browser.size(width, height)
        page.settle()
        out = page.browser.value("""[...document.querySelectorAll('header *, footer *, aside *, #legend, canvas')].filter(e => {
          const r = e.getBoundingClientRect();
          return r.width && (r.right > innerWidth + 0.5 || r.bottom > innerHeight + 0.5 || r.left < -0.5 || r.top < -0.5); }).map(e => e.outerHTML.slice(0, 60)).join(' ')""")
        verdict(f"nothing_is_cut_off_at_{width}", out or "")
    page.browser.size(1280, 800)


def check_head(folder):
    """A tracker on the head: the view is from there."""
    script = os.path.join(folder, "head.user")
    with open("data/scripts/power_box.user", encoding="utf-8") as source, open(script, "w", encoding="utf-8") as out:
        out.write("head -0.45 0.25 0.5 0 35 -30\n" + source.read())
    page = Page(folder, record(folder, "head", script), address="time=6&camera=head")
    page.wait("!shown.live && shown.hand && shown.drawn > 3")
    page.settle()
    eye = page.shown()["eye"]
    seen = pixels(page.picture("head-tracker"), skin)
    verdict("the_view_is_from_the_head", "" if max(abs(a - b) for a, b in zip(eye, (-0.45, 0.25, 0.5))) < 0.001 and seen > 5000 else f"{eye} {seen}")
    page.close()


def check_compare(folder, a, b):
    page = Page(folder, a, b, address="time=6")
    verdict("two_runs_side_by_side", "" if page.wait("shown.runs.length === 2 && shown.hand && shown.time === 6") else str(page.shown()))
    page.settle()
    picture = page.picture("two")
    halves = [picture.crop((0, 41, 490, 640)), picture.crop((490, 41, 980, 640))]
    seen = [pixels_of(half, skin) for half in halves]
    verdict("each_half_has_its_hand", "" if min(seen) > 4000 and differ(*halves) > 5000 else f"{seen} {differ(*halves)}")
    page.key("l")
    verdict("back_to_live", "" if page.shown()["live"] else str(page.shown()))
    verdict("no_complaint_with_two", "\n".join(page.browser.complaints))
    page.close()


def check_two_hands(folder):
    """Both hands around one bar, live and out of a log."""
    log = os.path.join(folder, "two.lcm")
    both = [B + "/gloved", "--scene", "handover", "--no-rt", "--fcu"]
    subprocess.run([*both, "sim:give_bar?speed=0", "--fcu2", "sim:take_bar?speed=0", "--lcm", "none", "--log", log], check=True,
                   stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    page = Page(folder, log, address="time=7.8")
    verdict("a_log_shows_both_hands", "" if page.wait("shown.hands === 2 && shown.forces > 5") else str(page.shown()))
    page.settle()
    picture = page.picture("hands")
    seen = pixels_of(picture, skin)
    verdict("both_are_seen", "" if seen > 20000 else f"{seen} pixels of skin")
    page.close()
    page = Page(folder)
    daemon = subprocess.Popen([*both, "sim:give_bar", "--fcu2", "sim:take_bar", "--lcm", URL], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    verdict("live_shows_both_hands", "" if page.wait("shown.live && shown.hands === 2", 20) else str(page.shown()))
    verdict("no_complaint_with_two_hands", "\n".join(page.browser.complaints))
    stop(daemon)
    page.close()


def check_sliders(folder):
    """The hand of gloved --fcu hand: goes where the sliders say, and closes around the box."""
    page = Page(folder)
    verdict("no_sliders_without_such_a_hand", "" if not page.shown()["sliders"] else "they are there")
    daemon = subprocess.Popen([B + "/gloved", "--fcu", f"hand:?listen={HAND_PORT}", "--scene", "box", "--lcm", URL, "--no-rt"], stdout=subprocess.DEVNULL,
                              stderr=subprocess.DEVNULL)
    verdict("sliders_come_with_it", "" if page.wait("shown.sliders && shown.hand", 30) else str(page.shown()))
    page.settle()
    page.click("#sliders button")
    move = lambda i, value: page.browser.value(
        f"{{const s = document.querySelectorAll('#sliders input')[{i}]; s.value = {value}; s.dispatchEvent(new Event('input'));}}")
    move(1, -0.047)
    page.browser.value("new Promise(done => setTimeout(done, 1500))")
    move(6, 1)
    verdict("the_hand_closes_around_the_box", "" if page.wait("shown.forces > 3", 15) else str(page.shown()))
    page.browser.value("new Promise(done => setTimeout(done, 2000))")
    move(2, 0.195)
    page.browser.value("new Promise(done => setTimeout(done, 2000))")
    page.picture("sliders")
    verdict("and_lifts_it", "" if page.wait("shown.lifted > 0.1", 10) else str(page.shown()))
    page.click("#sliders .buttons button:nth-child(2)")
    verdict("home_opens_the_hand", "" if page.wait("shown.lifted < 0.02 && shown.forces === 0", 15) else str(page.shown()))
    verdict("no_complaint_with_sliders", "\n".join(page.browser.complaints))
    stop(daemon)
    page.close()


def pixels_of(image, wanted):
    return sum(n for n, color in image.getcolors(1 << 24) if wanted(*color))


def check_bad_log(folder, log):
    bad = os.path.join(folder, "bad.lcm")
    with open(log, "rb") as file:
        data = bytearray(file.read())
    for at in range(5000, len(data), 7001):
        data[at] ^= 0xff
    with open(bad, "wb") as file:
        file.write(data)
    page = Page(folder, bad, address="time=6")
    verdict("a_damaged_log_is_shown_and_told", "" if page.wait("!shown.live && shown.hand") and "left out" in page.browser.value(
        "document.getElementById('what').textContent") else str(page.shown()))
    page.close()
    with open(bad, "wb") as file:
        file.write(b"this is no log\n" * 100)
    page = Page(folder, bad)
    verdict("what_is_no_log_is_answered", "" if page.wait("shown.banner.includes('no LCM log')", 10) else str(page.shown()))
    page.close()


def main():
    for check in (check_live, check_sliders, check_two_hands, check_head, check_log, check_compare, check_bad_log):
        with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
            logs = [] if check in (check_live, check_sliders, check_two_hands, check_head) else [record(folder, "power", "power_box")]
            check(folder, *logs, *([record(folder, "pinch", "pinch_box")] if check is check_compare else []))
    return 1 if failed else 0


sys.exit(main())
