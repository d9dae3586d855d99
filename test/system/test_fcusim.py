# SPDX-License-Identifier: BSD-3-Clause
"""fcusim from the other end of its wire: cannelloni datagrams written here, frames as data/gloved.dbc has them.
A sound command pulls, a broken, too strong or too fast one never does and ends in exit code 1."""
import binascii
import json
import os
import socket
import struct
import subprocess
import tempfile

import cantools

FCUSIM = os.path.join(os.environ["B"], "fcusim")
DBC = cantools.database.load_file("data/gloved.dbc")
COMMAND, STATUS, GLOVE = 0x090, 0x0A0, 0x110
SCRIPT = """posture p index_mpj 30 index_pij 30
at 0 posture p wrist 0 0 0.2 0 0 0 dead_man on
end 60
"""
FOLDER = tempfile.TemporaryDirectory()


def in_folder(name):
    return os.path.join(FOLDER.name, name)


with open(in_folder("hold.user"), "w") as f:
    f.write(SCRIPT)


def command(counter, index_n):
    """A FORCE_COMMAND that pulls the index finger."""
    message = DBC.get_message_by_frame_id(COMMAND)
    values = {signal.name: 0 for signal in message.signals}
    values.update(Counter=counter & 255, Enable=1, TensionIndex=index_n)
    data = bytearray(message.encode(values, strict=False))
    data[2:4] = bytes(2)
    crc = binascii.crc_hqx(struct.pack("<H", COMMAND) + bytes(data), 0xFFFF)
    data[2:4] = struct.pack("<H", crc)
    return data


def datagram(sequence, data):
    return struct.pack(">BBBH", 2, 0, sequence & 255, 1) + struct.pack(">IBB", COMMAND, 0x80 | len(data), 0) + bytes(data)


def frames(packet):
    version, _, _, count = struct.unpack_from(">BBBH", packet)
    assert version == 2
    at = 5
    for _ in range(count):
        identifier, length = struct.unpack_from(">IB", packet, at)
        at += 6 if length & 0x80 else 5
        yield identifier, packet[at:at + (length & 0x7F)]
        at += length & 0x7F
    assert at == len(packet), "bytes left over"


def session(answer, periods=1000, extra=()):
    """Runs fcusim; answer(n) gives the n-th command's bytes or None. Returns exit code, report, what was seen."""
    wire = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    wire.bind(("127.0.0.1", 0))
    wire.settimeout(5)
    probe = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    probe.bind(("127.0.0.1", 0))
    port = probe.getsockname()[1]
    probe.close()
    run = subprocess.Popen([FCUSIM, "--udp", f"udp://127.0.0.1:{wire.getsockname()[1]}?listen={port}", "--script",
                            in_folder("hold.user"), "--duration", str(periods / 1000), "--report", in_folder("report.json"),
                            "--record", in_folder("record.log"), *extra], stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    seen = {"gloves": [], "status": []}
    sequence = 0
    try:
        while run.poll() is None:
            for identifier, data in frames(wire.recv(2048)):
                if identifier == GLOVE:
                    seen["gloves"].append(DBC.decode_message(GLOVE, bytes(data)))
                    data = answer(sequence)
                    if data:
                        wire.sendto(datagram(sequence, data), ("127.0.0.1", port))
                    sequence += 1
                elif identifier == STATUS:
                    seen["status"].append(DBC.decode_message(STATUS, bytes(data)))
            if len(seen["gloves"]) >= periods:
                break
    except socket.timeout:
        pass
    run.wait(20)
    with open(in_folder("report.json")) as report:
        return run.returncode, json.load(report), seen


def test_sound_commands_pull():
    code, report, seen = session(lambda n: command(n, min(2.0, 0.1 * n)) if n < 700 else None)
    assert code == 0, code
    assert report["commands"] >= 600 and report["refused_frames"] + report["over_max"] + report["over_slew"] == 0, report
    assert abs(report["tension_max_n"][1] - 2.0) < 0.004, report
    assert max(s["TensionIndex"] for s in seen["status"]) > 1.9
    straight = seen["gloves"][0]["IndexMpj"], seen["gloves"][600]["IndexMpj"]
    assert straight[0] - straight[1] > 30, f"the finger was not held back: {straight}"
    assert report["watchdog_trips"] >= 1 and report["zero_after_s"] <= 0.005, report
    last = seen["status"][-1]
    assert last["TensionIndex"] == 0 and last["Watchdog"] == 1, last


def test_record_holds_both_ways():
    with open(in_folder("record.log")) as log:
        lines = log.read().splitlines()
    with open(in_folder("report.json")) as f:
        report = json.load(f)
    commands = sum(" 090##" in line for line in lines)
    assert commands == report["commands"] + report["repeated"], (commands, report)
    assert len(lines) - commands == report["sent"], (len(lines), report)


def no_force(answer, key):
    code, report, seen = session(answer, 300)
    assert code == 1, code
    assert report[key] > 50, report
    assert all(s["TensionIndex"] == 0 for s in seen["status"]), "a force all the same"
    assert report["deviation_max_rad"] == 0, report


def broken(n):
    data = command(n, 0.2)
    data[9] ^= 0x10
    return data


def test_broken_command_is_no_force():
    no_force(broken, "refused_frames")


def test_command_above_the_maximum_is_no_force():
    no_force(lambda n: command(n, 12.2), "over_max")


def test_jump_is_no_force():
    # After each zero the next command would rise by 11.9 N in a millisecond.
    no_force(lambda n: command(n, 11.9 * (n % 2)), "over_slew")


def test_bad_usage():
    cases = [[], ["--udp"], ["--udp", "udp://nowhere"], ["--speed", "3"], ["--udp", "udp://127.0.0.1:9?listen=0", "--seed", "x"],
             ["--udp", "udp://127.0.0.1:9?listen=0", "--device", "noise_rad=9"],
             ["--udp", "udp://127.0.0.1:9?listen=0", "--script", in_folder("none.user")],
             ["--udp", "udp://127.0.0.1:9?listen=0", "--wait", "-1"]]
    for case in cases:
        run = subprocess.run([FCUSIM, *case], capture_output=True, text=True, timeout=20)
        assert run.returncode == 2, (case, run)
        assert run.stderr.startswith("fcusim: ") and run.stderr.count("\n") == 1, (case, run.stderr)
