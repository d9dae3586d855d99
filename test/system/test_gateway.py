# SPDX-License-Identifier: BSD-3-Clause
"""The reference gateway from the other end of its wire: datagrams written here, frames as data/gloved.dbc has them (not by
our encoder). What a sound command asks for reaches the device; a broken, old or doubled one does not, and silence of 5 ms
lets go. Then with gloved itself."""
import binascii
import json
import os
import re
import socket
import struct
import subprocess
import tempfile
import time

import cantools

GATEWAY, GLOVED = (os.path.join(os.environ["B"], name) for name in ("gateway", "gloved"))
DBC = cantools.database.load_file("data/gloved.dbc")
COMMAND, STATUS, GLOVE, POSE = 0x090, 0x0A0, 0x110, 0x120


def free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def command(counter, index_n, enable=1):
    message = DBC.get_message_by_frame_id(COMMAND)
    values = {signal.name: 0 for signal in message.signals}
    values.update(Counter=counter & 255, Enable=enable, TensionIndex=index_n)
    data = bytearray(message.encode(values, strict=False))
    data[2:4] = bytes(2)
    data[2:4] = struct.pack("<H", binascii.crc_hqx(struct.pack("<H", COMMAND) + bytes(data), 0xFFFF))
    return data


def frames(packet):
    count = struct.unpack_from(">BBBH", packet)[3]
    at = 5
    for _ in range(count):
        identifier, length = struct.unpack_from(">IB", packet, at)
        at += 6 if length & 0x80 else 5
        yield identifier, packet[at:at + (length & 0x7F)]
        at += length & 0x7F


def session(answer, seconds=1.2):
    """answer(n): the n-th command's bytes or None, one for each of the gateway's bundles. What was seen, and what it said."""
    wire, port = socket.socket(socket.AF_INET, socket.SOCK_DGRAM), free_port()
    wire.bind(("127.0.0.1", 0))
    wire.settimeout(0.5)
    url = f"udp://127.0.0.1:{wire.getsockname()[1]}?listen={port}"
    run = subprocess.Popen([GATEWAY, "--udp", url, "--duration", str(seconds)], stdout=subprocess.PIPE, text=True)
    seen, number = {GLOVE: [], POSE: [], STATUS: []}, 0
    try:
        while True:
            for identifier, data in frames(wire.recv(2048)):
                seen[identifier].append(DBC.decode_message(identifier, bytes(data)))
            data = answer(number)
            if data:
                header = struct.pack(">BBBH", 2, 0, number & 255, 1) + struct.pack(">IBB", COMMAND, 0x80 | len(data), 0)
                wire.sendto(header + bytes(data), ("127.0.0.1", port))
            number += 1
    except socket.timeout:
        pass
    finally:
        wire.close()
        said = run.communicate(timeout=10)[0]
    assert run.returncode == 0, said
    taken, refused, largest, let_go = re.search(r"(\d+) commands taken, (\d+) refused, largest tension ([\d.]+) N, the watchdog let go (\d+)", said).groups()
    return seen, int(taken), int(refused), float(largest), int(let_go)


def test_samples_are_frames():
    seen, *_ = session(lambda n: None)
    for messages in seen.values():
        counters = [message["Counter"] for message in messages]
        assert len(counters) > 20 and all((b - a) % 256 == 1 for a, b in zip(counters, counters[1:])), counters[:20]
    assert seen[GLOVE][0]["DeadMan"] == 0 and seen[GLOVE][-1]["DeadMan"] == 1 and seen[POSE][-1]["Valid"] == 1, (seen[GLOVE][-1], seen[POSE][-1])
    assert abs(seen[POSE][0]["PositionZ"] - 0.06) < 1e-6, seen[POSE][0]


def test_a_sound_command_reaches_the_device():
    seen, taken, refused, largest, _ = session(lambda n: command(n, 2.0))
    assert taken > 300 and refused == 0 and abs(largest - 2.0) < 0.004, (taken, refused, largest)
    assert max(status["TensionIndex"] for status in seen[STATUS]) > 1.9


def test_silence_lets_go():
    seen, _, _, largest, let_go = session(lambda n: command(n, 2.0) if n % 400 < 200 else None, 1.5)
    assert largest > 1.9 and let_go >= 2, (largest, let_go)
    assert seen[STATUS][-1]["TensionIndex"] == 0 or len(seen[STATUS]) % 20 < 12


def test_doubled_commands_do_not_hold_a_force():
    seen, taken, _, _, let_go = session(lambda n: command(min(n, 100), 2.0))
    assert taken <= 102 and let_go >= 1, (taken, let_go)
    assert seen[STATUS][-1]["TensionIndex"] == 0, seen[STATUS][-1]


def broken(n):
    data = command(n, 2.0)
    data[9] ^= 0x10
    return data


def test_broken_commands_and_no_enable_are_no_force():
    for answer in (broken, lambda n: command(n, 2.0, enable=0)):
        _, _, refused, largest, _ = session(answer)
        assert largest == 0, largest
        assert refused > 100 or answer is not broken, refused


def test_with_gloved():
    """Its hand bends a finger onto the table: gloved feels it, and the force comes back to the device; gloved killed, the
    watchdog lets go. Generous ages, so that a busy machine does not end the press."""
    with tempfile.TemporaryDirectory() as folder:
        conf, summary = os.path.join(folder, "c.conf"), os.path.join(folder, "s.json")
        with open(conf, "w") as file:
            file.write("version = 1;\nsafety = { max_age_s = 0.2; overrun_limit = 100; bad_limit = 100; };\nlimiter = { max_age_s = 0.2; };\n")
        here, there = free_port(), free_port()
        gateway = subprocess.Popen([GATEWAY, "--udp", f"udp://127.0.0.1:{there}?listen={here}", "--duration", "5.5"], stdout=subprocess.PIPE, text=True)
        run = subprocess.run([GLOVED, "--config", conf, "--fcu", f"udp://127.0.0.1:{here}?listen={there}", "--duration", "3.9",
                              "--lcm", "none", "--no-rt", "--summary", summary], capture_output=True, text=True, timeout=60)
        time.sleep(0.1)
        said = gateway.communicate(timeout=20)[0]
        assert run.returncode == 0, run
        with open(summary) as file:
            report = json.load(file)
    assert report["frames"]["bad"] == 0 and report["frames"]["rx"] > 1000, report["frames"]
    largest = float(re.search(r"largest tension ([\d.]+) N", said).group(1))
    assert report["force_max_n"][1] > 0.3 and abs(largest - max(report["force_max_n"])) < 0.05, (largest, report["force_max_n"], run.stdout[-600:])
    assert said.rstrip().endswith("free"), said
