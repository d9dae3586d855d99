# SPDX-License-Identifier: BSD-3-Clause
"""gloved-trace as a user runs it: import (read back through the frame database, not our codec), info,
record from a socket, and what it says to bad input."""
import json
import math
import os
import random
import signal
import socket
import struct
import subprocess
import tempfile
import time

import cantools
import pytest

TOOL = os.path.join(os.environ["B"], "gloved-trace")
PIPE = os.path.join(os.environ["B"], "test", "fcu_pipe")
DBC = cantools.database.load_file("data/gloved.dbc")
NO_RECORDINGS = "needs recordings of real hands, which are no part of a clone, so there is nothing to do; who has them says GV_RECORDINGS=FOLDER"
RECORDINGS = os.environ.get("GV_RECORDINGS", "../shared/data")
SENSORS = subprocess.run([PIPE], input="sensors\n", capture_output=True, text=True, check=True).stdout.split()
FOLDER = tempfile.TemporaryDirectory()
random.seed(2)
HALF_COUNT = math.pi / 8192


def path(name, text=None):
    full = os.path.join(FOLDER.name, name)
    if text is not None:
        with open(full, "w", encoding="utf-8") as file:
            file.write(text)
    return full


def run(*words, code=0):
    done = subprocess.run([TOOL, *words], capture_output=True, text=True, check=False)
    assert done.returncode == code, f"{words}: exit code {done.returncode}, not {code}: {done.stderr}"
    return done


def frames(log):
    """(time, message name, decoded signals) of every line."""
    out = []
    for line in open(log, encoding="utf-8"):
        stamp, _, frame = line.split()
        message = DBC.get_message_by_frame_id(int(frame.split("##")[0], 16))
        out.append((float(stamp.strip("()")), message.name, message.decode(bytes.fromhex(frame.split("##1")[1]), decode_choices=False)))
    return out


def angle(signals, sensor):
    return (signals["".join(part.capitalize() for part in sensor.split("_"))] / 4096 - 0.25) * math.pi


def test_import_of_every_sensor_and_the_wrist():
    rows = [[i * 0.01] + [random.uniform(-0.7, 2.3) for _ in SENSORS] + [0.1, -0.2, 0.3 + i, 0.5, -0.5, 0.5, 0.5] for i in range(50)]
    header = ["t_s"] + SENSORS + ["px", "py", "pz", "qw", "qx", "qy", "qz"]
    csv = path("all.csv", "\n".join([", ".join(header)] + [",".join(repr(v) for v in row) for row in rows]) + "\n")
    done = run("import", csv, "-o", path("all.log"))
    assert done.stderr.count("\n") == 1 and "50 glove and 50 pose" in done.stderr, done.stderr
    got = frames(path("all.log"))
    gloves = [f for f in got if f[1] == "GLOVE"]
    poses = [f for f in got if f[1] == "POSE"]
    assert len(gloves) == len(poses) == 50
    for i, (row, glove, pose) in enumerate(zip(rows, gloves, poses)):
        for sensor, want in zip(SENSORS, row[1:]):
            assert abs(angle(glove[2], sensor) - want) <= HALF_COUNT * 1.000001, f"row {i} {sensor}"
        assert abs(glove[0] - row[0]) < 1e-6 and glove[2]["Stamp"] == round(row[0] * 1e6) and glove[2]["Counter"] == i and glove[2]["DeadMan"] == 1
        assert pose[2]["Receiver"] == 2 and pose[2]["Valid"] == 1 and abs(pose[0] - row[0]) < 1e-6
        values = [pose[2][n] for n in ("PositionX", "PositionY", "PositionZ", "QuaternionW", "QuaternionX", "QuaternionY", "QuaternionZ")]
        assert all(abs(v - w) < 1e-7 for v, w in zip(values, row[-7:])), values


def test_import_fills_in_and_says_so():
    csv = path("few.csv", "t_s,index_mpj,index_pij,mood\n0,0.5,0.9,1\n0.5,9,0.9,2\n")
    done = run("import", csv, "-o", path("few.log"), "--left")
    for words in ("mood: not used", "index_dij: two thirds of index_pij", "no column thumb_ij: 0", "1 angles were beyond the sensors' range (-45 to 135 degrees)"):
        assert words in done.stderr, f"{words}: {done.stderr}"
    glove = [f for f in frames(path("few.log")) if f[1] == "GLOVE"]
    assert abs(angle(glove[0][2], "index_dij") - 0.6) <= HALF_COUNT * 1.001 and angle(glove[0][2], "thumb_ij") == 0 and glove[0][2]["LeftHand"] == 1
    assert glove[1][2]["IndexMpj"] == 4095


# A CyberGlove's sensors in its order, by its own names (CyberGlove: "?"-commands; ninapro's DB9 lists the same 22).
GLOVE = SENSORS


def imported(name, text, *options):
    done = run("import", path(name, text), "-o", path("imported.log"), *options)
    return done, [f for f in frames(path("imported.log")) if f[1] == "GLOVE"]


def test_import_of_public_tables():
    """The same angles however a table parts its cells, with a header or without, in radians, degrees or counts."""
    rows = [[random.uniform(0, 1.4) for _ in GLOVE] for _ in range(5)]
    def table(separator, scale, header=""):
        return header + "".join(separator.join(f"{v * scale:.6f}" for v in row) + "\n" for row in rows)
    deg = 180 / math.pi
    for text, options in [(table(",", 1), ()), (table(";", deg), ("--degrees",)), (table("\t", 1), ()), (table("  ", deg), ("--degrees",)),
                          (table(" ", 1, "a line about the file\n"), ())]:
        _, gloves = imported("public.txt", text, "--columns", "cyberglove22", "--rows", "90", *options)
        assert len(gloves) == len(rows), text[:80]
        for i, (row, glove) in enumerate(zip(rows, gloves)):
            assert abs(glove[0] - i / 90) < 1e-6
            for sensor, want in zip(GLOVE, row):
                assert abs(angle(glove[2], sensor) - want) <= HALF_COUNT * 1.001 + 1e-5, (sensor, options)


def test_import_of_column_maps():
    """GraspDB14's parser: date, switch, 23 angles; VMG 30: tick, seconds, 23 readings of 0 to 1000, two quaternions."""
    angles = [round(0.02 * i, 2) for i in range(23)]
    grasp = " ".join(map(str, [2014, 5, 1, 12, 0, 3.25, 1] + angles)) + "\n"
    _, gloves = imported("grasp.txt", grasp * 2, "--columns", "graspdb14", "--rows", "60")
    for sensor, column in (("thumb_abduction", 3), ("index_dij", 6), ("middle_mpj", 8), ("middle_index_abduction", 11), ("little_ring_abduction", 19), ("wrist_yaw", 22)):
        assert abs(angle(gloves[0][2], sensor) - angles[column]) <= HALF_COUNT * 1.001, sensor
    vmg = "4680, 4.789247512817383, 1000.0,500.0,225.0,100.0" + ",0.0" * 6 + ",1000.0,0.0,500.0" + ",999.0" * 10 + ", 0.25,-0.03,-0.18,0.95, 0.87,-0.27,0.12,-0.39\n"
    _, gloves = imported("vmg.txt", vmg + vmg.replace("4.789", "4.799"), "--columns", "vmg30", "--degrees")
    for sensor, want in (("thumb_ij", 80), ("thumb_mpj", 30), ("index_pij", 22.5), ("index_mpj", 9), ("palm_arch", 40), ("thumb_abduction", 30)):
        assert abs(math.degrees(angle(gloves[0][2], sensor)) - want) < 0.05, sensor


def test_import_of_counts_and_of_18_sensors():
    _, gloves = imported("counts.txt", "0 " + " ".join(["128"] * 18) + " 7\n0.01 " + " ".join(["255"] * 18) + " 7\n", "--counts", "255", "--columns", "t_s,cyberglove18,-")
    assert gloves[0][2]["IndexMpj"] == gloves[0][2]["WristYaw"] == round(128 * 4095 / 255) and gloves[1][2]["LittlePij"] == 4095, gloves[0]
    want = 2 / 3 * angle(gloves[0][2], "index_pij")
    assert abs(angle(gloves[0][2], "index_dij") - want) < 0.3, "the distal joint follows"


def test_import_of_columns_with_terms():
    done, gloves = imported("terms.csv", "0,30,10\n1,60,20\n", "--degrees", "--columns", "t_s,thumb_rotate*0.5-10&thumb_abduction*0.25,index_mpj*-1")
    for glove, roll, mpj in zip(gloves, (30, 60), (10, 20)):
        for sensor, want in (("thumb_rotate", 0.5 * roll - 10), ("thumb_abduction", 0.25 * roll), ("index_mpj", -mpj)):
            assert abs(math.degrees(angle(glove[2], sensor)) - want) < 0.05, (sensor, want)
    poses = [f for f in frames(path("imported.log")) if f[1] == "POSE"]
    assert poses[0][2]["PositionX"] < -0.6 - 0.2 and poses[0][2]["PositionZ"] > 0.1, "without a wrist the hand stands beside the table"
    for options, words in ((("--columns", "t_s,bogus"), "bogus is no column"), (("--columns", "cyberglove22"), "no column t_s"), (("--counts", "0"), "largest count"),
                           (("--counts", "255", "--virtualhand"), "leave one")):
        bad = run("import", path("terms.csv"), "-o", path("x.log"), *options, code=2)
        assert words in bad.stderr, bad.stderr


def test_import_of_virtualhand_angles():
    """Flexion negative; the thumb's roll is 39 to 122 degrees in recordings, and none of it is beyond our thumb."""
    def row(**angles):
        return ",".join(str(angles.get(n, 0.0)) for n in GLOVE) + "\n"
    opposed = {"thumb_rotate": 99, "thumb_mpj": -20, "thumb_ij": -20, "index_mpj": -55, "index_pij": -50, "index_dij": -33, "thumb_abduction": 77, "middle_index_abduction": 4}
    text = row(thumb_rotate=39) + row(**opposed) + row(thumb_rotate=122) + row(thumb_rotate=108)
    _, gloves = imported("virtualhand.csv", text, "--columns", "cyberglove22", "--rows", "100", "--degrees", "--virtualhand")
    for glove, wanted in zip(gloves, ({"thumb_rotate": 0, "thumb_abduction": 0}, {"thumb_rotate": 25, "thumb_abduction": 30, "thumb_mpj": 20, "thumb_ij": 20,
                                      "index_mpj": 55, "index_pij": 50, "index_dij": 33, "middle_index_abduction": 4}, {},
                                      {"thumb_rotate": 28.75, "thumb_abduction": 34.5})):  # test_hand.c: pads meet there
        for sensor, want in wanted.items():
            assert abs(math.degrees(angle(glove[2], sensor)) - want) < 0.05, (sensor, want)
    assert math.degrees(angle(gloves[2][2], "thumb_rotate")) < 35 and math.degrees(angle(gloves[2][2], "thumb_abduction")) < 60, "beyond the anatomy"


def test_import_interpolates_to_a_rate():
    csv = path("two.csv", "t_s,index_mpj,px,py,pz,qw,qx,qy,qz\n10,0,0,0,0,1,0,0,0\n10.1,1,1,0,0,0,0,0,-1\n")
    run("import", csv, "-o", path("two.log"), "--rate", "1000")
    got = frames(path("two.log"))
    gloves = [f for f in got if f[1] == "GLOVE"]
    assert len(gloves) == 101 and len(got) == 202
    for i, (stamp, _, signals) in enumerate(gloves):
        assert abs(stamp - i * 0.001) < 1e-6 and abs(angle(signals, "index_mpj") - i * 0.01) <= HALF_COUNT * 1.001, i
    middle = got[100][2]
    assert abs(middle["PositionX"] - 0.5) < 1e-6 and abs(middle["QuaternionW"] - math.sqrt(0.5)) < 1e-6 and abs(middle["QuaternionZ"] + math.sqrt(0.5)) < 1e-6


def rotation(w, x, y, z):
    return [[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)], [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]]


def check_wrist(trajectory, log):
    numbers = [float(v) for v in open(trajectory, encoding="utf-8").read().split()]
    matrices = [numbers[i:i + 16] for i in range(0, len(numbers), 16)]
    poses = [f for f in frames(log) if f[1] == "POSE"]
    assert len(poses) == len(matrices)
    for i, (m, (stamp, _, s)) in enumerate(zip(matrices, poses)):
        r = rotation(s["QuaternionW"], s["QuaternionX"], s["QuaternionY"], s["QuaternionZ"])
        assert abs(stamp - i * 0.01) < 1e-6
        assert max(abs(r[a][b] - m[4 * a + b]) for a in range(3) for b in range(3)) < 2e-5, f"matrix {i}"
        assert max(abs(s["Position" + n] - m[4 * a + 3]) for a, n in enumerate("XYZ")) < 2e-7, f"matrix {i}"


def test_import_of_wrist_matrices():
    text = ""
    for _ in range(300):
        q = [random.gauss(0, 1) for _ in range(4)]
        length = math.sqrt(sum(c * c for c in q))
        for row in rotation(*(c / length for c in q)):
            text += " ".join(f"{v:.7f}" for v in row) + f" {random.uniform(-2, 2):.5f}\n"
        text += "0 0 0 1\n\n"
    run("import", path("few.csv", "t_s,index_mpj\n0,0\n3,1\n"), "-o", path("wrist.log"), "--wrist", path("wrist.traj", text))
    check_wrist(path("wrist.traj"), path("wrist.log"))


def test_import_of_real_recordings():
    if not os.path.isdir(RECORDINGS):
        pytest.skip(NO_RECORDINGS)
    for i, wrist in enumerate(("user1_cup0", "user1_spray_can0", "user2_b_jug0")):
        csv, trajectory = f"{RECORDINGS}/teleop_door/door_demo_0{i}.csv", f"{RECORDINGS}/fastrak_wrist/{wrist}.traj"
        run("import", csv, "-o", path("door.log"), "--wrist", trajectory)
        check_wrist(trajectory, path("door.log"))
        lines = open(csv, encoding="utf-8").read().splitlines()
        names = lines[0].split(",")
        gloves = [f for f in frames(path("door.log")) if f[1] == "GLOVE"]
        assert len(gloves) == len(lines) - 1
        for line, glove in zip(lines[1:], gloves):
            row = dict(zip(names, map(float, line.split(","))))
            want = {"index_pij": row["FFJ1"], "little_dij": row["LFJ0"], "palm_arch": row["LFJ4"], "ring_middle_abduction": row["MFJ3"] - row["RFJ3"], "thumb_ij": -row["THJ0"]}
            for sensor, value in want.items():
                assert abs(angle(glove[2], sensor) - min(max(value, -math.pi / 4), 0.75 * math.pi)) <= HALF_COUNT * 1.001 + 1e-3 * (value < -0.78), (sensor, value)
        assert " jump" in run("info", path("door.log")).stdout


def test_recorded_wrists_are_not_held_back():
    """Real hands at a tracker, 100 Hz logs of a slower stream: where one is only fast, no pose is held back."""
    if not os.path.isdir(RECORDINGS):
        pytest.skip(NO_RECORDINGS)
    gloved = os.path.join(os.environ["B"], "gloved")
    for wrist in ("user1_cup0", "user1_spray_can0", "user1_toolbox0", "user2_b_jug0"):
        run("import", path("few.csv", "t_s,index_mpj\n0,0\n3,1\n"), "-o", path("fast.log"), "--wrist", f"{RECORDINGS}/fastrak_wrist/{wrist}.traj")
        subprocess.run([gloved, "--fcu", f"trace:{path('fast.log')}?speed=0", "--lcm", "none", "--summary", path("s.json")], capture_output=True, check=True)
        with open(path("s.json"), encoding="utf-8") as file:
            report = json.load(file)
        assert report["samples_refused"] == 0 and report["frames"]["rx"] > 180, (wrist, report["samples_refused"])


def info_row(text, name):
    """frames, rate, gap, lost, behind, refused, ages of one message."""
    words = next(line for line in text.splitlines() if name in line.split()[:2]).split()
    return words[2:]


def test_info_counts_what_is_in_the_log():
    rows = "".join(f"{i * 0.01:.2f},{[0.1, 0.1, 0.9][i % 3]}\n" for i in range(100))
    run("import", path("jumps.csv", "t_s,index_mpj\n" + rows), "-o", path("jumps.log"))
    text = run("info", path("jumps.log")).stdout
    assert info_row(text, "GLOVE")[:6] == ["100", "100.0", "10.000", "0", "0", "0"], text
    assert "33.3 % of the samples equal the one before, 66 jump by more than 0.3 rad; largest step 0.800 rad (index_mpj" in text, text
    lines = open(path("jumps.log"), encoding="utf-8").read().splitlines()
    gloves = [line for line in lines if " 110##" in line]
    gloves[50:53] = []                                     # three lost
    gloves[20] = gloves[20][:-1] + "1"                     # one damaged, so also missing from the count
    gloves.insert(81, gloves[80])                          # one doubled
    text = run("info", path("damaged.log", "\n".join(gloves) + "\n(0.99")).stdout
    assert info_row(text, "GLOVE")[:6] == ["98", "98.0", "40.000", "4", "1", "1"], text
    assert "first refused frame at 0.200000: wrong checksum" in text and "broke off after line 98" in text, text


def cannelloni(seq, payloads):
    body = b"".join(struct.pack(">IBB", frame_id, 0x80 | len(data), 1) + data for frame_id, data in payloads)
    return struct.pack(">BBBH", 2, 0, seq, len(payloads)) + body


def free_ports():
    sockets = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2)]
    for s in sockets:
        s.bind(("127.0.0.1", 0))
    ports = [s.getsockname()[1] for s in sockets]
    sockets[1].close()
    return sockets[0], ports[0], ports[1]


def glove_payloads(count):
    lines = [line for line in open(path("all.log"), encoding="utf-8") if " 110##" in line][:count]
    return [(0x110, bytes.fromhex(line.split("##1")[1])) for line in lines]


def start_recorder(log, *more):
    device, device_port, port = free_ports()
    recorder = subprocess.Popen([TOOL, "record", "--udp", f"udp://127.0.0.1:{device_port}?listen={port}", "-o", log, *more], stderr=subprocess.PIPE, text=True)
    for _ in range(200):  # until it listens: the file is made after the socket
        if os.path.exists(log):
            break
        time.sleep(0.01)
    return device, port, recorder


def send_slowly(device, port, payloads):
    for seq, payload in enumerate(payloads):
        device.sendto(cannelloni(seq, [payload]), ("127.0.0.1", port))
        time.sleep(0.001)


def wait_lines(log, count):
    for _ in range(300):
        if len(open(log, encoding="utf-8").read().splitlines()) >= count:
            return
        time.sleep(0.01)


def test_record_survives_its_own_death():
    payloads = glove_payloads(40)
    device, port, recorder = start_recorder(path("killed.log"))
    send_slowly(device, port, payloads)
    wait_lines(path("killed.log"), 40)
    recorder.kill()
    recorder.wait()
    text = run("info", path("killed.log")).stdout
    assert info_row(text, "GLOVE")[0] == "40" and info_row(text, "GLOVE")[3:6] == ["0", "0", "0"], text
    assert abs(frames(path("killed.log"))[0][0] - time.time()) < 60, "stamps are the time of day"


def test_record_ends_by_signal_and_counts():
    payloads = glove_payloads(30)
    device, port, recorder = start_recorder(path("counted.log"))
    send_slowly(device, port, payloads)
    device.sendto(b"\x02\x00", ("127.0.0.1", port))
    device.sendto(cannelloni(35, payloads[:1]), ("127.0.0.1", port))
    wait_lines(path("counted.log"), 31)
    recorder.send_signal(signal.SIGINT)
    said = recorder.communicate()[1]
    assert recorder.returncode == 0 and said.startswith("31 frames") and "5 datagrams lost, 1 broken" in said, said


def test_record_without_a_device():
    device, device_port, port = free_ports()
    done = run("record", "--udp", f"udp://127.0.0.1:{device_port}?listen={port}", "-o", path("none.log"), "--duration", "0.1", code=1)
    device.close()
    assert "no frame came" in done.stderr and done.stderr.count("\n") == 1, done.stderr


def bus_log(lines):
    """What candump would have written beside that run: stamps of its own, and some frames of the next step already
    on the bus before the command of this one."""
    frames = [line.split()[2] for line in lines]
    for i in range(1, len(frames) - 1):
        if frames[i].startswith("090") and not frames[i + 1].startswith("090") and random.random() < 0.5:
            frames[i], frames[i + 1] = frames[i + 1], frames[i]
    clock, text = 1e9, []
    for frame in frames:
        clock += random.uniform(0, 8e-4)
        text.append(f"({clock:.6f}) vcan0 {frame}\n")
    return text


def test_align_puts_a_bus_log_into_step():
    gloved = os.path.join(os.environ["B"], "gloved")
    def state(fcu, *more):
        subprocess.run([gloved, "--fcu", fcu, "--lcm", "none", "--summary", path("s.json"), *more], capture_output=True)
        with open(path("s.json"), encoding="utf-8") as file:
            return json.load(file)["state_hash"]
    live = state("sim:data/scripts/pinch_box.user?speed=0", "--duration", "4", "--record", path("own.log"))
    with open(path("own.log"), encoding="utf-8") as file:
        own = file.readlines()
    bus = bus_log(own)
    path("bus.log", "".join(bus))
    run("align", path("bus.log"), "-o", path("aligned.log"), "--rate", "1000")
    assert state("trace:" + path("bus.log") + "?speed=0") != live and state("trace:" + path("aligned.log") + "?speed=0") == live
    path("cut.log", "".join(bus[200:]))
    assert "begin before the engine" in run("align", path("cut.log"), "-o", path("x.log"), "--rate", "1000", code=2).stderr
    device = next(i for i, line in enumerate(bus) if i > 500 and " 110#" in line)
    path("lost.log", "".join(bus[:device] + bus[device + 1:]))
    assert "do not fit" in run("align", path("lost.log"), "-o", path("x.log"), "--rate", "1000", code=2).stderr


def test_bad_input_gets_one_line_and_exit_2():
    good = path("good.csv", "t_s,index_mpj\n0,0\n1,1\n")
    bad_tables = {"": "empty", "a,b\n1,2\n": ":1: no column t_s", "t_s\n0\n": ":1: no column of a sensor", "t_s,index_mpj\n": "no row", "t_s,index_mpj\n0\n": ":2: fewer cells",
                  "t_s,index_mpj\n0,0,0\n": ":2: more cells", "t_s,index_mpj\n0,nan\n": ":2: a cell", "t_s,index_mpj\n0,1\n0,1\n": ":3: t_s does not rise", "t_s,index_mpj\n0,inf\n": ":2:",
                  "t_s,index_mpj\n0,1x\n": ":2: a cell",
                  "t_s,index_mpj\n0,1\n1e300,1\n": ":3: t_s is more", "t_s,index_mpj,px,py,pz\n0,1,0,0,-1e3\n": ":2: a position", "t_s,index_mpj,index_mpj\n0,1,2\n": ":1: two columns", "t_s,index_mpj,px\n0,1,2\n": ":1: a position",
                  "t_s,index_mpj,qw,qx,qy,qz\n0,0,1,1,0,0\n": ":2: qw", "t_s,index_mpj\n0," + "1" * 5000 + "\n": ":2: a line of more", "t_s," + ",".join(f"c{i}" for i in range(70)) + "\n": ":1: more than 64"}
    bad_wrists = {"": "not complete", "1 0 0 0\n0 1 0 0\n0 0 1 0\n": "not complete", "1 0 0 0\n0 1 0\n": ":2: not four", "2 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n": ":4: the matrix",
                  "1 0 0 0\n0 1 0 0\n0 0 -1 0\n0 0 0 1\n": ":4: the matrix", "1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 2\n": ":4:", "1 0 0 nan\n": ":1: not four", "1 0 0 999\n0 1 0 0\n0 0 1 0\n0 0 0 1\n": ":4: a position"}
    cases = [(["import", path("t.csv"), "-o", path("x.log")], words, text, path("t.csv")) for text, words in bad_tables.items()]
    cases += [(["import", good, "-o", path("x.log"), "--wrist", path("w.traj")], words, text, path("w.traj")) for text, words in bad_wrists.items()]
    cases += [(words.split(), needle, None, None) for words, needle in (
        ("", "no job"), ("play x", "no such job"), ("info", "give one FILE"), ("info /nowhere/x", "check the path"), ("info test/system/test_trace_tool.py", "test_trace_tool.py:2:"),
        ("import", "give one CSV"), (f"import {good}", "give one CSV"), (f"import {good} -o /nowhere/x", "cannot be written"), (f"import {good} -o x --rate 0", "no rate"), (f"import {good} -o x --rate 1e3x", "no rate"),
        (f"import {good} -o x --bogus", "no option"), ("import /nowhere/x.csv -o x", "check the path"), (f"import {good} -o x --wrist /nowhere/x", "check the path"), ("record", "give --udp"), ("align x", "give FILE"), ("align x -o y --rate 5", "--rate"), ("align /nowhere/x -o y --rate 1000", "check the path"),
        ("record --udp udp://127.0.0.1 -o x", "udp://HOST:PORT"), ("record --udp udp://127.0.0.1:9?listen=9999999 -o x", "65535"), ("record --udp udp://127.0.0.1:9?listen=9 --duration -1 -o x", "seconds"))]
    for words, needle, text, file in cases:
        if text is not None:
            path(os.path.basename(file), text)
        done = run(*words, code=2)
        last = done.stderr.splitlines()[-1]
        assert needle in last and last.startswith("gloved-trace: ") and "; " in last, f"{words}: {done.stderr}"
    assert "info FILE" in run("--help").stdout
