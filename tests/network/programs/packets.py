"""What a line does to packets, seen by plain sockets.

packets.py echo PORT              says "ready" and sends every datagram back, and every stream
packets.py ask ADDRESS PORT N     sends N datagrams, each after the other's answer or 0.5 s
packets.py flood ADDRESS PORT N   sends N datagrams at once
packets.py stream ADDRESS PORT N  sends N bytes and gets them back

They print, as JSON: the round trips [s], null where none came; which numbers came back; and the seconds, whether the bytes are
the same and how many packets TCP sent again.
"""

from __future__ import annotations

import json
import random
import socket
import struct
import sys
import threading
import time

RETRANSMISSIONS = struct.Struct("=100xI")  # tcpi_total_retrans in struct tcp_info


def echo(port: int) -> None:
    stream, datagrams = socket.create_server(("0.0.0.0", port)), socket.socket(type=socket.SOCK_DGRAM)
    datagrams.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 22)
    datagrams.bind(("0.0.0.0", port))
    threading.Thread(target=echo_streams, args=[stream], daemon=True).start()
    print("ready", flush=True)
    while True:
        packet, sender = datagrams.recvfrom(65536)
        datagrams.sendto(packet, sender)


def echo_streams(listening: socket.socket) -> None:
    while True:
        connection, _ = listening.accept()
        with connection:
            while data := connection.recv(65536):
                connection.sendall(data)


def ask(address: str, port: int, count: int) -> object:
    asking = socket.socket(type=socket.SOCK_DGRAM)
    asking.settimeout(0.5)
    asking.connect((address, port))
    times: list[float | None] = []
    for number in range(count):
        begun = time.monotonic()
        asking.send(bytes([number % 256]) * 100)
        try:
            asking.recv(65536)
            times.append(time.monotonic() - begun)
        except TimeoutError:
            times.append(None)
    return times


def flood(address: str, port: int, count: int) -> object:
    asking = socket.socket(type=socket.SOCK_DGRAM)
    asking.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 22)
    asking.settimeout(2.0)
    asking.connect((address, port))
    for number in range(count):
        asking.send(struct.pack("<I", number))
        time.sleep(0.0002)  # what is lost shall be lost on the line, not in a queue of the kernel's
    came: list[int] = []
    try:
        while len(came) < count:
            came.append(struct.unpack("<I", asking.recv(65536))[0])
    except TimeoutError:
        pass
    return came


def stream(address: str, port: int, size: int) -> object:
    sent = random.Random(3).randbytes(size)
    came = bytearray()
    begun = time.monotonic()
    with socket.create_connection((address, port)) as connection:
        sender = threading.Thread(target=connection.sendall, args=[sent])
        sender.start()
        while len(came) < size:
            came += connection.recv(1 << 16)
        seconds = time.monotonic() - begun
        sender.join()
        info = connection.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, 256)
    return {"seconds": seconds, "same": bytes(came) == sent, "again": RETRANSMISSIONS.unpack_from(info)[0]}


if __name__ == "__main__":
    verb, *arguments = sys.argv[1:]
    if verb == "echo":
        echo(int(arguments[0]))
    else:
        does = {"ask": ask, "flood": flood, "stream": stream}[verb]
        print(json.dumps(does(arguments[0], int(arguments[1]), int(arguments[2]))))
