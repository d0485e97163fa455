"""A client of the fake control box, as small as can be: it wants the arm at rest for as long as it is asked.

`python tests/support/control_client.py ADDRESS`
"""

import socket
import struct
import sys

from bridge.fakes import control_box_protocol as p


def main(address: str) -> None:
    udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    udp.bind(("127.0.0.1", 0))
    tcp = socket.create_connection((address, p.PORT))
    tcp.sendall(p.HEADER.pack(p.CONNECT, 1, p.HEADER.size + 4) + struct.pack("<HH", p.VERSION, udp.getsockname()[1]))
    udp.recv(4096)
    tcp.sendall(p.HEADER.pack(p.MOVE, 2, p.HEADER.size + 8) + struct.pack("<II", 0, p.JOINT_VELOCITY))
    while True:
        state, sender = udp.recvfrom(4096)
        (number,) = struct.unpack_from("<Q", state)
        udp.sendto(p.COMMAND.pack(number, *(0.0,) * 38, False, False, *(0.0,) * 7), sender)


if __name__ == "__main__":
    main(sys.argv[1])
