"""The cable between two network namespaces: takes IP packets out of one TUN device and puts them into the other, late or never.

    python relay.py PID_A NAME_A PID_B NAME_B     the namespaces of two processes, and what the device in each shall be called

Packets really get lost, so that TCP really sends them again. Each direction holds its packets in order: a delay, a jitter on top
that never reorders, a rate with a queue before it, a share that is lost by chance. What comes while the cable is cut is lost, and
what is in it then as well.

On standard input come settings, a line of JSON for both directions, each answered by a line with what has passed so far. The
process ends when its input does, and with it the devices.
"""

from __future__ import annotations

import ctypes
import fcntl
import json
import os
import random
import select
import struct
import sys
import time
from collections import deque
from dataclasses import dataclass, field

CLONE_NEWNET = 0x40000000
TUNSETIFF = 0x400454CA
IFF_TUN, IFF_NO_PI = 0x0001, 0x1000
BATCH = 64  # packets taken from one device before the other has its turn
PACKET_LIMIT = 65536


@dataclass(slots=True)
class Direction:
    """One way through the cable: what is under way in it, each with the time at which it comes out."""

    source: int
    target: int
    chance: random.Random
    delay: float = 0.0  # [s]
    jitter: float = 0.0  # [s] at most, on top
    loss: float = 0.0  # share of packets
    rate: float = 0.0  # [bytes/s]; 0: as fast as it can
    queue: int = 1 << 18  # [bytes] that may wait for the rate
    is_cut: bool = False
    waiting: deque[tuple[float, bytes]] = field(default_factory=deque)
    free_at: float = 0.0  # when the line has sent all that waits for it
    packets: int = 0
    sent_bytes: int = 0
    lost: int = 0
    overflowed: int = 0

    def take(self) -> None:
        """Takes what the source has."""
        for _ in range(BATCH):
            try:
                packet = os.read(self.source, PACKET_LIMIT)
            except BlockingIOError:
                return
            self._send(packet)

    def _send(self, packet: bytes) -> None:
        now = time.monotonic()
        self.packets += 1
        if self.is_cut or (self.loss and self.chance.random() < self.loss):
            self.lost += 1
            return
        leaves = now
        if self.rate:
            begins = max(now, self.free_at)
            if (begins - now) * self.rate > self.queue:
                self.overflowed += 1
                return
            leaves = self.free_at = begins + len(packet) / self.rate
        arrives = leaves + self.delay
        if self.jitter:
            arrives += self.chance.random() * self.jitter
        if self.waiting:
            arrives = max(arrives, self.waiting[-1][0])
        if arrives <= now and not self.waiting:
            self._deliver(packet)
        else:
            self.waiting.append((arrives, packet))

    def deliver_due(self, now: float) -> None:
        """Puts out what has come through."""
        while self.waiting and self.waiting[0][0] <= now:
            self._deliver(self.waiting.popleft()[1])

    def _deliver(self, packet: bytes) -> None:
        try:
            os.write(self.target, packet)
            self.sent_bytes += len(packet)
        except BlockingIOError:
            self.overflowed += 1
        except OSError:  # the device is down
            self.lost += 1

    def change(self, settings: dict[str, float]) -> None:
        for name, value in settings.items():
            setattr(self, name, value)
        if self.is_cut:
            self.lost += len(self.waiting)
            self.waiting.clear()
            self.free_at = 0.0

    def counts(self) -> dict[str, int]:
        return {
            "packets": self.packets,
            "bytes": self.sent_bytes,
            "lost": self.lost,
            "overflowed": self.overflowed,
            "waiting": len(self.waiting),
        }


def opened_tun(process: str, name: str) -> int:
    """A TUN device in the network namespace of a process; this thread stays in that namespace."""
    namespace = os.open(f"/proc/{process}/ns/net", os.O_RDONLY)
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.setns(namespace, CLONE_NEWNET):
        raise OSError(ctypes.get_errno(), "setns")
    os.close(namespace)
    device = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
    fcntl.ioctl(device, TUNSETIFF, struct.pack("16sH22x", name.encode(), IFF_TUN | IFF_NO_PI))
    return device


def main(process_a: str, name_a: str, process_b: str, name_b: str) -> None:
    """Relays until the standard input ends."""
    a, b = opened_tun(process_a, name_a), opened_tun(process_b, name_b)
    ways = (Direction(a, b, random.Random(1)), Direction(b, a, random.Random(2)))
    order, commands = 0, bytearray()
    print(json.dumps([way.counts() for way in ways]), flush=True)
    while True:
        dues = [way.waiting[0][0] for way in ways if way.waiting]
        patience = max(0.0, min(dues) - time.monotonic()) if dues else None
        # select, not poll: its patience has microseconds.
        ready, _, _ = select.select([a, b, 0], [], [], patience)
        if 0 in ready:
            text = os.read(0, 65536)
            if not text:
                return
            commands += text
            while (end := commands.find(b"\n")) >= 0:
                settings = json.loads(commands[:end])
                del commands[: end + 1]
                for way, changes in zip(ways, settings, strict=True):
                    way.change(changes)
                print(json.dumps([way.counts() for way in ways]), flush=True)
        order ^= 1
        for way in ways if order else reversed(ways):
            if way.source in ready:
                way.take()
        now = time.monotonic()
        for way in ways:
            way.deliver_due(now)


if __name__ == "__main__":
    main(*sys.argv[1:])
