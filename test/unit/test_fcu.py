# SPDX-License-Identifier: BSD-3-Clause
"""The frame codec in C against data/gloved.dbc as cantools reads it, thousands of random frames both
ways; the checksum against Python's own CRC; the log text against python-can's reader and writer."""
import binascii
import os
import random
import re
import subprocess
import sys
import tempfile

import can
import cantools

COUNT = 1500
PIPE = os.path.join(os.environ["B"], "test", "fcu_pipe")
DBC = cantools.database.load_file("data/gloved.dbc")
random.seed(1)


def pipe(lines):
    run = subprocess.run([PIPE], input="\n".join(lines) + "\n", capture_output=True, text=True, check=True)
    answers = run.stdout.splitlines()
    assert len(answers) == len(lines), f"{len(answers)} answers to {len(lines)} lines"
    return answers


SENSORS = ["".join(part.capitalize() for part in name.split("_")) for name in pipe(["sensors"])[0].split()]
TENSIONS = ["Tension" + finger.capitalize() for finger in pipe(["fingers"])[0].split()]
# Per message: identifier, bytes, flag signals from bit 8, the other signals in the order of the C struct.
MESSAGES = {
    "command": (0x090, 20, ["Enable", "Ending", "Repeat"], ["Counter", "Flags", "SampleStamp", "SampleAge"] + TENSIONS + ["FramesTaken"]),
    "status": (0x0A0, 20, ["DeadMan", "Watchdog", "Fault"],
               ["Counter", "Flags", "Stamp", "CommandCounter", "Mode"] + TENSIONS + ["BadCommands"]),
    "glove": (0x110, 48, ["DeadMan", "LeftHand", "SensorFault"], ["Counter", "Flags", "Stamp", "Age"] + SENSORS),
    "pose": (0x120, 48, ["Valid", "TrackerError"],
             ["Counter", "Flags", "Stamp", "Age", "Receiver", "PositionX", "PositionY", "PositionZ",
              "QuaternionW", "QuaternionX", "QuaternionY", "QuaternionZ"]),
}


def checksum(frame_id, data):
    """Independent of the C code: crc_hqx is the same polynomial in Python's library."""
    zeroed = data[:2] + b"\0\0" + data[4:]
    return binascii.crc_hqx(frame_id.to_bytes(2, "little") + zeroed, 0xFFFF)


def with_checksum(frame_id, data):
    return data[:2] + checksum(frame_id, data).to_bytes(2, "little") + data[4:]


def line_of(frame_id, data):
    return f"(0.0) can0 {frame_id:03X}##1{data.hex()}"


def data_of(line):
    return bytes.fromhex(line.split("##1")[1])


def unit_quaternion():
    q = [random.gauss(0, 1) for _ in range(4)]
    length = sum(c * c for c in q) ** 0.5
    return [round(c / length * 2**30) for c in q]


def random_raw(kind):
    """Raw value of every signal, within the signal's range."""
    frame_id = MESSAGES[kind][0]
    raw = {}
    for signal in DBC.get_message_by_frame_id(frame_id).signals:
        bits = signal.length
        low, high = (-(1 << (bits - 1)), (1 << (bits - 1)) - 1) if signal.is_signed else (0, (1 << bits) - 1)
        raw[signal.name] = random.choice([low, high, random.randint(low, high), random.randint(low, high)])
    if kind == "pose":
        raw["Receiver"] = random.randint(1, 255)
        raw.update(zip(("QuaternionW", "QuaternionX", "QuaternionY", "QuaternionZ"), unit_quaternion()))
    return raw


def fields_of(kind, raw):
    """Physical values in the order of the C struct, by the factors of the database."""
    frame_id, _, flags, names = MESSAGES[kind]
    message = DBC.get_message_by_frame_id(frame_id)
    fields = []
    for name in names:
        if name == "Flags":
            fields.append(sum(raw[flag] << bit for bit, flag in enumerate(flags)))
        else:
            fields.append(raw[name] * message.get_signal_by_name(name).scale)
    return fields


def close(kind, a, b):
    tolerance = 2e-9 if kind == "pose" else 1e-12  # the C decoder makes the quaternion unit
    return all(abs(x - y) <= tolerance * max(1, abs(y)) for x, y in zip(a, b)) and len(a) == len(b)


def test_database_has_the_frames_of_the_header():
    assert sorted(m.frame_id for m in DBC.messages if m.is_fd) == sorted(m[0] for m in MESSAGES.values())
    for kind, (frame_id, size, flags, names) in MESSAGES.items():
        message = DBC.get_message_by_frame_id(frame_id)
        assert message.length == size and message.is_fd and not message.is_extended_frame, kind
        assert {s.name for s in message.signals} == set(names) - {"Flags"} | set(flags) | {"Checksum"}, kind
        assert all(s.comment for s in message.signals) and message.comment, f"{kind}: comments"
    text = open("include/gloved/fcu.h", encoding="utf-8").read()
    for name in ("FORCE_COMMAND", "STATUS", "GLOVE", "POSE"):
        assert f"GV_ID_{name} = 0x{DBC.get_message_by_name(name).frame_id:03X}" in text, name
    for message in (m for m in DBC.messages if not m.is_fd):
        first = re.sub(r"_CLASSIC_[2-9]$", "_CLASSIC", message.name.replace("_CLASSIC_1", "_CLASSIC"))
        first_id = int(re.search(rf"GV_ID_{first} = 0x([0-9A-F]+)", text)[1], 16)
        number = int(message.name[-1]) if message.name[-1].isdigit() else 1
        assert message.frame_id == first_id + number - 1 and message.length <= 8, message.name
        assert message.comment and all(s.comment for s in message.signals), message.name


def test_c_encodes_what_cantools_decodes():
    for kind, (frame_id, size, _, _) in MESSAGES.items():
        raws = [random_raw(kind) for _ in range(COUNT)]
        answers = pipe([kind + " " + " ".join(repr(v) for v in fields_of(kind, raw)) for raw in raws])
        for raw, answer in zip(raws, answers):
            assert answer.startswith(f"(0000000000.000000) can0 {frame_id:03X}##1"), answer
            data = data_of(answer)
            assert len(data) == size
            decoded = DBC.decode_message(frame_id, data, decode_choices=False, scaling=False)
            assert decoded.pop("Checksum") == checksum(frame_id, data), f"{kind}: {answer}"
            raw.pop("Checksum")
            assert decoded == raw, f"{kind}: {answer}\n{decoded}\n{raw}"


def test_c_decodes_what_cantools_encodes():
    for kind, (frame_id, _, _, _) in MESSAGES.items():
        raws = [random_raw(kind) for _ in range(COUNT)]
        message = DBC.get_message_by_frame_id(frame_id)
        lines = [line_of(frame_id, with_checksum(frame_id, message.encode(raw, scaling=False, strict=False))) for raw in raws]
        for raw, line, answer in zip(raws, lines, pipe(lines)):
            words = answer.split()
            assert words[0] == kind, f"{line}: {answer}"
            assert close(kind, [float(w) for w in words[1:]], fields_of(kind, raw)), f"{line}\n{answer}\n{fields_of(kind, raw)}"


def test_every_bit_is_a_signal_or_reserved():
    for kind, (frame_id, size, _, _) in MESSAGES.items():
        message = DBC.get_message_by_frame_id(frame_id)
        used = set()
        for signal in message.signals:
            used |= set(range(signal.start, signal.start + signal.length))
        raw = random_raw(kind)
        data = message.encode(raw, scaling=False, strict=False)
        spare = [bit for bit in range(8 * size) if bit not in used]
        lines = []
        for bit in spare:
            changed = bytearray(data)
            changed[bit // 8] |= 1 << bit % 8
            lines.append(line_of(frame_id, with_checksum(frame_id, bytes(changed))))
        for bit, answer in zip(spare, pipe(lines)):
            assert "reserved bit" in answer, f"{kind} bit {bit}: {answer}"


def test_damaged_frames_are_refused():
    for kind, (frame_id, size, _, _) in MESSAGES.items():
        data = with_checksum(frame_id, DBC.get_message_by_frame_id(frame_id).encode(random_raw(kind), scaling=False, strict=False))
        lines = [line_of(frame_id, bytes(b ^ (1 << bit % 8 if i == bit // 8 else 0) for i, b in enumerate(data))) for bit in range(8 * size)]
        assert all("checksum" in answer for answer in pipe(lines)), kind
        short = {20: 16, 48: 32}[size]
        answers = pipe([line_of(frame_id, data[:short]), line_of(frame_id, data + bytes(64 - size)), f"(0.0) can0 {frame_id:03X}#{data[:8].hex()}",
                        f"(0.0) can0 {frame_id:08X}##1{data.hex()}", line_of(frame_id + 1, data)])
        assert ["length" in a for a in answers[:3]] == [True] * 3 and ["identifier" in a for a in answers[3:]] == [True] * 2, f"{kind}: {answers}"


# ---- classic CAN: what cantools reads out of the small frames is what went into the large one ----

def crc8(data):
    """CRC-8 AUTOSAR, bit by bit by the definition: the remainder of the message as a polynomial."""
    value = int.from_bytes(data, "big") << 8 ^ 0xFF << 8 * len(data)
    for bit in range(8 * len(data) + 7, 7, -1):
        if value >> bit & 1:
            value ^= 0x12F << (bit - 8)
    return value ^ 0xFF


def classic_frames(kind, raw):
    """Frames of the message by the C codec: identifier and bytes."""
    line = pipe(["classic " + kind + " " + " ".join(repr(v) for v in fields_of(kind, raw))])[0]
    frames = [word.split("#") for word in line.split() if "#" in word]
    return [(int(frame_id, 16), bytes.fromhex(data)) for frame_id, data in frames]


def test_classic_frames_carry_the_same_values():
    for kind, count in (("glove", 6), ("pose", 8), ("status", 3)):
        for _ in range(100):
            raw, got = random_raw(kind), {}
            frames = classic_frames(kind, raw)
            assert len(frames) == count, kind
            for frame_id, data in frames:
                message = DBC.get_message_by_frame_id(frame_id)
                assert len(data) == message.length, message.name
                got.update(message.decode(data, decode_choices=False, scaling=False))
            for name in ("Age", "Checksum"):
                if name + "Low" in got:
                    got[name] = got.pop(name + "Low") + 256 * got.pop(name + "High")
            whole = data_of(pipe([kind + " " + " ".join(repr(v) for v in fields_of(kind, raw))])[0])
            raw["Checksum"] = checksum(MESSAGES[kind][0], whole)
            assert got == raw, f"{kind}:\n{got}\n{raw}"


def test_classic_frames_join_to_the_same_frame():
    for kind in ("glove", "pose", "status"):
        for _ in range(50):
            raw = random_raw(kind)
            whole = pipe([kind + " " + " ".join(repr(v) for v in fields_of(kind, raw))])[0]
            frames = classic_frames(kind, raw)
            random.shuffle(frames)
            lines = [f"(0.0) can0 {frame_id:03X}#{data.hex()}" for frame_id, data in frames]
            answers = pipe(["join"] + lines)[1:]
            assert all(a == "-" for a in answers[:-1]), answers
            assert close(kind, [float(w) for w in answers[-1].split()[1:]], fields_of(kind, raw)), f"{whole}\n{answers[-1]}"


def test_classic_command_is_one_frame():
    message = DBC.get_message_by_name("FORCE_COMMAND_CLASSIC")
    for number in range(300):
        raw = random_raw("command")
        (frame_id, data), = classic_frames("command", raw)
        assert frame_id == message.frame_id and len(data) == 8
        got = message.decode(data, scaling=False)
        assert got["Counter"] == raw["Counter"] % 16 and got["Enable"] == raw["Enable"]
        assert all(got[t] == raw[t] // 4 for t in TENSIONS), (got, raw)
        assert got["Checksum"] == crc8(frame_id.to_bytes(2, "little") + data[:7])
        words = pipe(["join", f"(0.0) can0 {frame_id:03X}#{data.hex()}"])[1].split()
        assert words[0] == "command" and int(words[1]) % 16 == got["Counter"] and int(words[2]) == raw["Enable"]
        assert all(abs(float(w) - 0.012 * got[t]) < 1e-9 for w, t in zip(words[5:10], TENSIONS)), words
        if number < 10:
            damaged = [bytes(b ^ (1 << bit % 8 if i == bit // 8 else 0) for i, b in enumerate(data)) for bit in range(64)]
            answers = pipe(["join"] + [f"(0.0) can0 {frame_id:03X}#{d.hex()}" for d in damaged])[1:]
            assert all(a.startswith("refused") for a in answers), answers


def test_quaternion_off_length_is_refused():
    message = DBC.get_message_by_name("POSE")
    for factor, good in ((1, True), (1.0009, True), (0.9991, True), (1.0011, False), (0.9989, False), (0, False)):
        raw = random_raw("pose")
        for name in ("QuaternionW", "QuaternionX", "QuaternionY", "QuaternionZ"):
            raw[name] = round(raw[name] * factor)
        answer = pipe([line_of(message.frame_id, with_checksum(message.frame_id, message.encode(raw, scaling=False, strict=False)))])[0]
        assert answer.startswith("pose") == good, f"length {factor}: {answer}"


def test_python_can_reads_and_writes_the_same_logs():
    raws = [random_raw("glove") for _ in range(200)]
    lines = pipe(["glove " + " ".join(repr(v) for v in fields_of("glove", raw)) for raw in raws])
    with tempfile.NamedTemporaryFile("w", suffix=".log") as log:
        log.write("\n".join(lines) + "\n")
        log.flush()
        messages = list(can.CanutilsLogReader(log.name))
        assert len(messages) == len(lines)
        for line, message in zip(lines, messages):
            assert message.arbitration_id == 0x110 and message.is_fd and message.bitrate_switch and not message.is_extended_id
            assert bytes(message.data) == data_of(line), line
    with tempfile.NamedTemporaryFile("r", suffix=".log") as log:
        writer = can.CanutilsLogWriter(log.name)
        for message in messages:
            message.timestamp = 1436509052.249713
            writer(message)
        writer.stop()
        written = log.read().splitlines()
    assert [a.split()[0] for a in pipe(written)] == ["glove"] * len(lines)


def test_names_in_python_are_those_in_c():
    sys.path.insert(0, "tools")
    import gloved_names
    said = [tuple(line.split()) for line in pipe(["fingers", "sensors", "states"])]
    assert said == [gloved_names.FINGERS, gloved_names.SENSORS, gloved_names.SAFETY]
