# SPDX-License-Identifier: BSD-3-Clause
"""Recordings, LCM logs and summaries say what they were made of, and a recording is replayed on the scene that it was made
on, or not at all."""
import json
import os
import shutil
import subprocess
import sys
import tempfile

import can

sys.path.insert(0, "tools")
import gloved_log

B = os.environ["B"]
SIM = "sim:data/scripts/bar_frame.user?speed=0" if os.path.exists("data/scripts/bar_frame.user") else "sim:?speed=0"


def gloved(*options, code=0):
    run = subprocess.run([B + "/gloved", "--lcm", "none", "--duration", "2", *options], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                         check=False, timeout=60)
    assert run.returncode == code, (run.returncode, run.stderr)
    return run.stderr


def summary(path):
    with open(path, encoding="utf-8") as file:
        return json.load(file)


class Recording:
    """Two seconds on a scene of our own, in a folder of its own."""

    def __init__(self, folder):
        path = lambda name: os.path.join(folder, name)
        self.scene, self.log, self.lcm, self.summary, self.again = map(path, ("my.scene", "run.log", "run.lcm", "run.json", "again.json"))
        shutil.copy("data/scenes/frame.scene", self.scene)
        gloved("--fcu", SIM, "--scene", self.scene, "--record", self.log, "--log", self.lcm, "--summary", self.summary)
        self.hash = summary(self.summary)["state_hash"]

    def replay(self, *options, code=0):
        return gloved("--fcu", f"trace:{self.log}?speed=0", "--summary", self.again, *options, code=code)

    def is_the_same(self):
        assert summary(self.again)["state_hash"] == self.hash


def test_replay_takes_the_recorded_scene(folder):
    r = Recording(folder)
    r.replay()
    r.is_the_same()
    assert summary(r.again)["about"]["scene"]["name"] == r.scene


def test_replay_on_another_scene_is_refused_with_both_names(folder):
    r = Recording(folder)
    said = r.replay("--scene", "data/scenes/box.scene", code=2)
    assert r.scene in said and "data/scenes/box.scene" in said and said.count("\n") == 1, said
    r.replay("--scene", "data/scenes/frame.scene")  # another name, the same bytes
    r.is_the_same()


def test_replay_where_the_scene_has_gone_or_changed(folder):
    r = Recording(folder)
    shutil.copy("data/scenes/box.scene", r.scene)
    r.replay()
    r.is_the_same()
    os.remove(r.scene)
    r.replay()
    r.is_the_same()


def test_damaged_about_is_refused(folder):
    r = Recording(folder)
    with open(r.log + ".about", encoding="utf-8") as file:
        text = file.read()
    assert "gravity" in text or "objects" in text
    with open(r.log + ".about", "w", encoding="utf-8") as file:
        file.write(text.replace("objects", "objekts"))
    assert ".about:" in r.replay(code=2)
    with open(r.log + ".about", "w", encoding="utf-8") as file:
        file.write(text[:len(text) // 2])
    assert ".about:" in r.replay(code=2)
    os.remove(r.log + ".about")
    r.replay("--scene", "data/scenes/box.scene")


def test_other_rate_is_said(folder):
    r = Recording(folder)
    assert "recorded at 1000 Hz, replayed at 500 Hz" in r.replay("--rate", "500")


def test_summary_and_log_say_what_they_are_of(folder):
    r = Recording(folder)
    about = summary(r.summary)["about"]
    with open(r.scene, encoding="utf-8") as file:
        text = file.read()
    version = subprocess.run([B + "/gloved", "--version"], stdout=subprocess.PIPE, text=True, check=True).stdout
    assert about["version"] in version and about["commit"] in version
    assert about["scene"]["text"] == text and about["scene"]["name"] == r.scene and len(about["scene"]["hash"]) == 16
    assert r.scene in about["command_line"] and "'" + SIM + "'" in about["command_line"], about["command_line"]
    assert about["hand"] == "right" and about["rate_hz"] == 1000 and about["date"].endswith("Z")
    log = gloved_log.Log(r.lcm)
    assert log.raw[0][0] == "GLOVED_ABOUT"
    message = log.of("GLOVED_ABOUT")[0]
    assert (message.scene, message.scene_text, message.scene_hash) == (r.scene, text, about["scene"]["hash"])
    assert message.command_line == about["command_line"] and message.commit == about["commit"]


def tool(*words, code=0):
    told = subprocess.run(words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=60)
    assert told.returncode == code, told
    return told.stdout


def test_a_recording_made_of_a_log_knows_its_scene(folder):
    r = Recording(folder)
    out = os.path.join(folder, "made.log")
    tool(sys.executable, "tools/log_to_trace.py", r.lcm, out)
    said = gloved("--fcu", f"trace:{out}?speed=0", "--scene", "data/scenes/box.scene", code=2)
    assert r.scene in said and "data/scenes/box.scene" in said, said
    gloved("--fcu", f"trace:{out}?speed=0", "--summary", r.again)
    r.is_the_same()
    os.remove(r.scene)  # the text is kept
    gloved("--fcu", f"trace:{out}?speed=0", "--summary", r.again)
    r.is_the_same()


def test_recordings_of_the_tools_say_what_made_them(folder):
    log, report = os.path.join(folder, "device.log"), os.path.join(folder, "device.json")
    tool(B + "/fcusim", "--udp", "udp://127.0.0.1:29301?listen=29300", "--script", "data/scripts/pinch_box.user", "--wait", "0", "--duration", "0.3",
         "--record", log, "--report", report)
    with open(log + ".about", encoding="utf-8") as file:
        text = file.read()
    assert "fcusim --udp" in text and 'hand = "right"' in text and "pinch_box.user" in text and "posture" in text, text
    about = summary(report)["about"]
    assert about["hand"] == "right" and about["settings"]["name"] == "data/scripts/pinch_box.user" and about["date"].endswith("Z"), about
    gloved("--fcu", f"trace:{log}?speed=0")
    table = os.path.join(folder, "table.csv")
    with open(table, "w", encoding="utf-8") as file:
        file.write("t_s,index_mpj\n" + "".join(f"{i / 100},{i / 200}\n" for i in range(100)))
    out = os.path.join(folder, "imported.log")
    tool(B + "/gloved-trace", "import", table, "-o", out)
    with open(out + ".about", encoding="utf-8") as file:
        assert "gloved-trace import" in file.read()
    gloved("--fcu", f"trace:{out}?speed=0")


def test_settings_file_is_kept(folder):
    conf, again = os.path.join(folder, "my.conf"), os.path.join(folder, "run.json")
    with open(conf, "w", encoding="utf-8") as file:
        file.write('version = 1;\n# "quoted"\trate\nrate_hz = 500.0;\n')
    gloved("--config", conf, "--fcu", SIM, "--summary", again, "--record", os.path.join(folder, "run.log"))
    about = summary(again)["about"]
    assert about["settings"]["text"].endswith("rate_hz = 500.0;\n") and about["rate_hz"] == 500
    gloved("--fcu", f"trace:{folder}/run.log?speed=0", "--rate", "500")


def test_recordings_stay_what_other_tools_read(folder):
    r = Recording(folder)
    with open(r.log, encoding="utf-8") as file:
        lines = len(list(file))
    assert len(list(can.CanutilsLogReader(r.log))) == lines > 2000
    assert subprocess.run(["log2asc", "-I", r.log, "can0"], stdout=subprocess.PIPE, check=True).stdout.count(b"CANFD") == lines


def main():
    failed = False
    for name, test in sorted(globals().items()):
        if not name.startswith("test_"):
            continue
        try:
            with tempfile.TemporaryDirectory() as folder:
                test(folder)
            print("ok " + name, flush=True)
        except Exception as error:  # a test that cannot run has failed as well
            failed = True
            print(f"  {type(error).__name__}: {str(error)[:1500]}\nFAIL {name}", flush=True)
    return 1 if failed else 0


sys.exit(main())
