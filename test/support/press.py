# SPDX-License-Identifier: BSD-3-Clause
"""What the tests against fcusim share: a script in which a finger is pressed onto the table, and two free UDP ports."""
import socket

SCRIPT = """posture flat  thumb_abduction 40
posture press like flat  index_mpj 60
at 0.0 posture flat wrist -0.3 0 0.06 0 0 0 dead_man off
at 0.1 dead_man on
at 0.6 posture press
at 0.8
at 1.1 index_mpj 75
end """


def free_ports():
    sockets = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2)]
    for s in sockets:
        s.bind(("127.0.0.1", 0))
    ports = [s.getsockname()[1] for s in sockets]
    for s in sockets:
        s.close()
    return ports
