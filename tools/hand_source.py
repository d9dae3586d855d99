# SPDX-License-Identifier: BSD-3-Clause
"""What moves the hand of `gloved --fcu hand:` from Python: datagrams to 127.0.0.1 (src/wire/hand_input.h says each byte).

    hand = Hand()                                   # or Hand(port)
    hand.send(position, quaternion, grips, dead_man=True)      # 20 times a second or more; answers are read with it
    hand.now                                        # the newest answer, None until one came

Positions in metres in the world, quaternions w x y z, grips 0 (open) to 1 (closed) from the thumb to the little finger.
Targets may jump: the hand goes there at its own speed. Standard library alone."""
import socket
import struct

PORT = 20500
DEAD_MAN, HOME, ASK = 1, 2, 4
IN, OUT = struct.Struct("<4sBBH3f4f5f"), struct.Struct("<4sBBH3f4f5f5f")


class Now:
    """An answer: where the hand is, and the tensions in newtons that a glove would pull with."""

    def __init__(self, values):
        _, _, flags, self.number, *numbers = values
        self.dead_man, self.forces, self.other = bool(flags & 1), bool(flags & 2), bool(flags & 4)
        self.position, self.quaternion, self.grips, self.tensions = numbers[:3], numbers[3:7], numbers[7:12], numbers[12:]


class Hand:
    def __init__(self, port=PORT):
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.connect(("127.0.0.1", port))
        self.socket.setblocking(False)
        self.number, self.now = 0, None

    def close(self):
        self.socket.close()

    def put(self, flags, position, quaternion, grips):
        self.number = (self.number + 1) % 65536
        try:
            self.socket.send(IN.pack(b"GVHI", 1, flags, self.number, *position, *quaternion, *grips))
        except OSError:
            pass  # gloved is not there, or not there yet
        return self.read()

    def send(self, position, quaternion, grips, dead_man=False):
        """New targets. Returns the newest answer, which is that to an earlier datagram."""
        return self.put(DEAD_MAN if dead_man else 0, position, quaternion, grips)

    def home(self):
        """Back to the start, the hand and the switch open."""
        return self.put(HOME, (0, 0, 0), (1, 0, 0, 0), (0,) * 5)

    def ask(self):
        """Only an answer, without moving anything."""
        return self.put(ASK, (0, 0, 0), (1, 0, 0, 0), (0,) * 5)

    def read(self):
        try:
            while True:
                data = self.socket.recv(256)
                if len(data) == OUT.size and data[:5] == b"GVHO\1":
                    self.now = Now(OUT.unpack(data))
        except OSError:
            return self.now
