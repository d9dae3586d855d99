# SPDX-License-Identifier: BSD-3-Clause
"""The page of gloved-look without a browser: what its server tells, and the page's own modules (log reader, runs, skin of the hand) in a
small JavaScript engine against the same log read by Python. In a real browser: test/system/page.py (make test-view)."""
import http.client
import json
import math
import os
import re
import subprocess
import sys
import threading

import lcm
import pytest

sys.path.insert(0, "tools")
import gloved_log  # noqa: E402
import look  # noqa: E402
import scene_mesh  # noqa: E402

B = os.environ["B"]
VIEWER = "data/viewer"


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    path = str(tmp_path_factory.mktemp("look") / "run.lcm")
    subprocess.run([B + "/gloved", "--fcu", "sim:power_box?speed=0", "--scene", "box", "--lcm", "none", "--duration", "4", "--log", path], check=True,
                   stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return path


@pytest.fixture(scope="module")
def states(log):
    return [gloved_log.types().state_t.decode(event.data) for event in lcm.EventLog(log) if event.channel == "GLOVED_STATE"]


@pytest.fixture
def server(log):
    look.Page.logs, look.Page.names = (log,), look.LOCAL
    server = look.http.server.ThreadingHTTPServer(("127.0.0.1", 0), look.Page)
    server.daemon_threads = True
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield server.server_address[1]
    server.shutdown()


def get(port, path):
    link = http.client.HTTPConnection("127.0.0.1", port, timeout=10)
    link.request("GET", path, headers={"Host": "localhost"})
    answer = link.getresponse()
    return answer, answer.read()


# ---- server ----

def test_layouts_are_those_of_the_generated_types():
    types = gloved_log.types()
    told = look.layouts()
    assert len(told) >= 14
    for name, layout in told.items():
        kind = getattr(types, name)
        assert [field for field, _, _ in layout["fields"]] == list(kind.__slots__), name
        assert layout["fingerprint"] == kind._get_packed_fingerprint().hex(), name


def test_everything_the_page_asks_for_is_served_and_nothing_else(server):
    page = get(server, "/")[1].decode()
    names = set(re.findall(r'(?:src|href)="(/[^"]*)"', page)) | {"/three.js"}
    for name in os.listdir(VIEWER):
        if name.endswith(".js"):
            with open(os.path.join(VIEWER, name), encoding="utf-8") as file:
                names |= {"/" + path.lstrip("./") for path in re.findall(r'from "([^"]*)"', file.read())}
    assert len(names) >= 9
    for name in names - ({"/three.js"} if not os.path.exists(look.THREE) else set()):
        assert get(server, name)[0].status == 200, name
    for name in ("/../look.py", "/viewer.json", "/look.py", "/log/1", "/log/-1", "/log/0x0", "//etc/passwd", "/%2e%2e/Makefile", "/."):
        assert get(server, name)[0].status == 404, name


def test_nothing_comes_from_a_network(server):
    for name in os.listdir(VIEWER):
        with open(os.path.join(VIEWER, name), encoding="utf-8") as file:
            assert not re.search(r"https?://(?!localhost)", file.read()), name
    assert "default-src 'self'" in get(server, "/")[0].headers["Content-Security-Policy"]


def test_a_log_is_served_as_it_is(server, log):
    assert json.loads(get(server, "/logs")[1]) == ["run.lcm"]
    with open(log, "rb") as file:
        assert get(server, "/log/0")[1] == file.read()


def test_meshes_come_from_the_scene_with_that_hash_alone(server):
    with open("data/scenes/frame.scene", "rb") as file:
        right = scene_mesh.fnv1a64(file.read())
    frame = json.loads(get(server, f"/meshes?file=data/scenes/frame.scene&hash={right}")[1])["frame"]
    assert frame[1] == 38 and len(frame) == 2 + 3 * frame[0] + 3 * frame[1], frame[:2]
    for query in ("file=data/scenes/frame.scene&hash=0", f"file=/etc/passwd&hash={right}", "", "file=%00.scene&hash=0"):
        look.Page.scenes.clear()
        assert get(server, "/meshes?" + query)[1] == b"{}", query


def test_the_hash_is_the_one_that_gloved_tells(log):
    about = next(gloved_log.types().about_t.decode(event.data) for event in lcm.EventLog(log) if event.channel == "GLOVED_ABOUT")
    with open("data/scenes/box.scene", "rb") as file:
        assert scene_mesh.fnv1a64(file.read()) == about.scene_hash


def test_a_state_reaches_the_page_as_json(states):
    picture = look.Picture()
    picture.on_state("", states[-1].encode())
    told = json.loads(picture.event["state"])
    assert told["time_s"] == round(states[-1].time_s, 6)
    assert told["limb"][15]["driver_position_m"] == [round(x, 6) for x in states[-1].limb[15].driver_position_m]
    assert [o["name"] for o in told["object"]] == ["table", "box"] and len(told["contact"]) == len(states[-1].contact)


def post(port, body, **headers):
    link = http.client.HTTPConnection("127.0.0.1", port, timeout=10)
    link.request("POST", headers.pop("path", "/hand"), body, {"Host": "localhost", "Content-Type": "application/json", **headers})
    answer = link.getresponse()
    return answer.status, answer.read()


def test_sliders_reach_the_hand_and_no_other_page_does(server, monkeypatch):
    class Hand:
        sent = []

        def send(self, *pose, dead_man):
            self.sent.append((*pose, dead_man))

        def ask(self):
            return None
    monkeypatch.setattr(look.Page, "hand", Hand())
    good = json.dumps({"position": [0, 0, 0.1], "quaternion": [1, 0, 0, 0], "grips": [0, 0, 0, 0, 1], "dead_man": True})
    assert post(server, good) == (200, b"null") and Hand.sent == [([0, 0, 0.1], [1, 0, 0, 0], [0, 0, 0, 0, 1], True)]
    assert post(server, '{"ask": true}', Origin="http://localhost") == (200, b"null")
    for headers in ({"Origin": "http://evil.example"}, {"Origin": "null"}, {"Content-Type": "text/plain"}, {"path": "/other"}):
        assert post(server, good, **headers)[0] == 403, headers
    assert post(server, good, Host="evil.example")[0] == 421
    for bad in ("", "[]", "{}", "nonsense", good.replace("0.1", "NaN"), good.replace("0.1", "1e999"), good.replace("[0, 0, 0.1]", "[0, 0]"),
                good.replace("0.1", '"x"'), "{" + " " * 3000 + "}"):
        assert post(server, bad)[0] == 400, bad[:60]
    assert len(Hand.sent) == 1


def test_a_busy_port_names_both_ways_to_another():
    run = subprocess.run([sys.executable, "-c", "import sys; sys.path.insert(0, 'tools'); import look, socket\n"
                          "s = socket.create_server(('127.0.0.1', 0)); look.serve('127.0.0.1', s.getsockname()[1])"], capture_output=True, text=True, check=False)
    assert run.returncode == 1 and "--port" in run.stderr and "make look PORT=" in run.stderr and "Traceback" not in run.stderr, run.stderr


# ---- the page's modules ----

class Modules:
    """lcm.js, run.js and skin.js in one context."""

    def __init__(self):
        quickjs = pytest.importorskip("quickjs", reason="PyPI's quickjs is missing (make build/venv/.ready)")
        self.context = quickjs.Context()
        self.context.eval("globalThis.TextDecoder = class { decode(bytes) { return String.fromCharCode(...bytes); } };")
        for name in ("lcm", "run", "skin", "sliders"):
            with open(f"{VIEWER}/{name}.js", encoding="utf-8") as file:
                text = re.sub(r"^import .*\n", "", file.read(), flags=re.M)
            inside = re.sub(r"^export ", "", text, flags=re.M)
            exported = ", ".join(re.findall(r"^export (?:const|class|function) (\w+)", text, flags=re.M))
            imported = {"run": "const {index, decode} = lcm;", "sliders": "const {multiply} = skin;"}.get(name, "")
            self.context.eval(f"globalThis.{name} = (() => {{ {imported}\n{inside}\nreturn {{{exported}}}; }})();")

    def value(self, expression):
        return json.loads(self.context.eval(f"JSON.stringify({expression})"))

    def open(self, name, data):
        self.context.set("hex", data.hex())
        self.context.set("layouts_text", json.dumps(look.layouts()))
        self.context.eval("globalThis.bytes = new Uint8Array(hex.length / 2); for (let i = 0; i < bytes.length; i++) bytes[i] = parseInt(hex.substr(2 * i, 2), 16);"
                          f"globalThis.opened = new run.LogRun({json.dumps(name)}, bytes.buffer, JSON.parse(layouts_text));")


@pytest.fixture(scope="module")
def page():
    return Modules()


@pytest.fixture(scope="module")
def opened(page, log):
    with open(log, "rb") as file:
        page.open("run.lcm", file.read())
    return page


def plain(message):
    if hasattr(message, "__slots__"):
        return {name: plain(getattr(message, name)) for name in message.__slots__}
    return [plain(item) for item in message] if isinstance(message, (list, tuple)) else message


def test_the_page_reads_a_log_as_python_does(opened, states):
    assert opened.value("opened.curves.t") == [s.time_s for s in states]
    assert opened.value("opened.curves.commanded") == [[s.force_commanded_n[i] for s in states] for i in range(5)]
    for number in (0, len(states) // 2, len(states) - 1):
        assert opened.value(f"opened.state({number})") == plain(states[number])
    assert opened.value("opened.about.scene").endswith("box.scene") and opened.value("opened.damaged") == 0
    assert "objects::box" in opened.value("opened.loadAt(1).map(link => link.name)")


def test_scrubbing_finds_the_states_around_a_time(opened, states):
    for time in (-1, 0, 1.0, 1.013, 2.5, 99):
        found = opened.value(f"(() => {{ const x = opened.around({time}); return [x.a.time_s, x.b.time_s, x.part]; }})()")
        assert found[0] <= max(time, states[0].time_s) and 0 <= found[2] <= 1
        wanted = min(max(time, states[0].time_s), states[-1].time_s)
        assert abs(found[0] + found[2] * (found[1] - found[0]) - wanted) < 1e-9, time


def test_damaged_logs_are_answered_in_words(page, log):
    with open(log, "rb") as file:
        sound = file.read()
    page.open("cut.lcm", sound[:len(sound) // 2])
    assert page.value("opened.curves.t.length") > 10
    events = [at for at in range(len(sound)) if sound.startswith(b"\xed\xa1\xda\x01", at)]
    spoiled = bytearray(sound)
    for number, at in enumerate(events[::7]):
        name = int.from_bytes(sound[at + 20:at + 24], "big")
        spoiled[at + (0, 24, 28 + name)[number % 3]] ^= 0xff  # its beginning, its length, its message's fingerprint
    page.open("spoiled.lcm", bytes(spoiled))
    assert page.value("opened.damaged") > 0 and page.value("opened.curves.t.length") > 10
    for bad in (b"", b"this is no log\n" * 100, sound[:200]):
        with pytest.raises(Exception, match="bad.lcm: no"):
            page.open("bad.lcm", bad)


def test_a_live_run_begins_anew_with_the_next_one(page):
    state = "{time_s: %g, force_commanded_n: [1,2,3,4,5], force_measured_n: [0,0,0,0,0], contact: []}"
    page.context.eval("globalThis.alive = new run.LiveRun();")
    begun = [page.value(f"alive.add({state % t}, 0)") for t in (1, 1.02, 1.04, 0.02, 0.04)]
    assert begun == [True, False, False, True, False] and page.value("alive.curves.t") == [0.02, 0.04]


HAND = """{radius: [.011,.010,.009,.0095,.0085,.0075,.0095,.0085,.0075,.009,.008,.007,.008,.007,.0065],
  half: [.0233,.0157,.009,.0202,.0111,.0064,.0235,.014,.0068,.0217,.0131,.0081,.0171,.0089,.0072],
  base: [[-.026,.025,-.012],[.0411,.028,0],[.039,.007,0],[.0326,-.012,0],[.0243,-.029,0]], left: %s, wrist: [-.044,.003,0],
  palm: {half: [.032,.027,.002], radius: .01}}"""


@pytest.mark.parametrize("left", ["false", "true"])
def test_the_skin_is_closed_and_as_large_as_a_hand(page, left):
    skin = page.value(f"skin.makeSkin({HAND % left}, 0.005)")
    points, faces = skin["points"], skin["faces"]
    edges = {}
    for a, b, c in faces:
        for edge in ((a, b), (b, c), (c, a)):
            edges[edge] = edges.get(edge, 0) + 1
    loose = sum(1 for (a, b), n in edges.items() if edges.get((b, a), 0) != n)
    assert len(points) > 1000 and loose < 0.002 * len(edges), (len(points), loose)
    volume = sum(p[0] * (q[1] * r[2] - q[2] * r[1]) + p[1] * (q[2] * r[0] - q[0] * r[2]) + p[2] * (q[0] * r[1] - q[1] * r[0])
                 for p, q, r in ([points[i] for i in face] for face in faces)) / 6
    assert 250e-6 < volume < 500e-6, volume  # a man's hand with its wrist: about 400 cm3
    for four in skin["weights"]:
        assert abs(sum(four["weight"]) - 1) < 1e-9 and min(four["weight"]) >= 0
    length = max(p[0] for p in points) - min(p[0] for p in points)
    assert 0.2 < length < 0.3
    assert (sum(p[1] for p in points) > 0) != (sum(p["p"][1] for p in skin["bones"][:3]) < 0)
    thumb = skin["bones"][0]["p"][1]
    assert (thumb < 0) == (left == "true")


def test_the_skin_lies_on_the_capsules_that_touch(page):
    """A contact's point is on the surface that one sees: off the joints the skin is where the capsule of the limb is."""
    page.context.eval(f"globalThis.hand = {HAND % 'false'}; globalThis.bones = skin.rest(hand); globalThis.shape = new skin.Shape(hand, bones);")
    for limb in range(3, 15):
        off = page.value(f"(() => {{ const b = bones[{limb}]; return skin.rotate(b.q, [0, 0, -hand.radius[{limb}]]).map((x, k) => x + b.p[k]); }})()")
        assert abs(page.value(f"shape.at({json.dumps(off)})")) < 0.0012, limb
    assert all(math.isfinite(x) for x in page.value("shape.gradient([0, 0, 0.02])"))


def test_turns_and_quaternions_are_each_others_inverse(page):
    for turns in ([90, 0, 0], [0, -40, 170], [-120, 35, -60]):
        back = page.value(f"sliders.turnsOf(sliders.quaternionOf({turns}))")
        assert max(abs(a - b) for a, b in zip(turns, back)) < 1e-9, (turns, back)
    assert page.value("sliders.quaternionOf([90, 0, 0])") == pytest.approx([math.sqrt(0.5), math.sqrt(0.5), 0, 0])
