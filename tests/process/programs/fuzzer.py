"""Says and asks nonsense on every topic and query of a session, as a user who was let in; and knocks as one who was not.

    python fuzzer.py ENDPOINT SESSION RENDER_NODE SEED COUNT < USER:SECRET       as a user, over zenoh
    python fuzzer.py ENDPOINT - - SEED COUNT                                     over a bare socket

Prints how many messages were sent, and how many questions were answered.
"""

from __future__ import annotations

import errno
import json
import random
import socket
import sys
import threading

import zenoh
from zenoh.handlers import Callback

from elys.bus import topics
from elys.bus.topics import NODE_KINDS, QUERIES, TOPICS
from tests.process.programs.fuzzed_messages import Stock

CLIENTS = 4
MOST_ASKED = 64  # questions under way
FRAMES_A_CONNECTION = 50


class Fuzzer:
    """One client of several."""

    def __init__(self, endpoint: str, session: str, render_node: str, credentials: str, seed: int) -> None:
        user, _, secret = credentials.partition(":")
        config = zenoh.Config()
        for key, value in {
            "mode": "client",
            "connect/endpoints": [endpoint],
            "scouting/multicast/enabled": False,
            "transport/auth/usrpwd": {"user": user, "password": secret},
        }.items():
            config.insert_json5(key, json.dumps(value))
        self._zenoh = zenoh.open(config)
        self._chance = random.Random(seed)
        self._stock = Stock(self._chance)
        self._session = session
        self._nodes = (f"rogue-{seed}.{user}", f"rogue-{seed}.owner-aaaaaa", render_node, "simulation-1", "rogue")
        self._places = threading.Semaphore(MOST_ASKED)
        self._tokens: list[zenoh.LivelinessToken] = []
        self.answered = 0

    def run(self, count: int) -> None:
        for number in range(count):
            if number % 500 == 0:
                self._pretend()
            topic = self._chance.choice((*TOPICS, *QUERIES))
            payload = self._stock.of(topic)
            if isinstance(topic, topics.Topic):
                self._say(topic, payload)
            else:
                self._ask(topic, payload)

    def close(self) -> None:
        for _ in range(MOST_ASKED):
            self._places.acquire()
        self._zenoh.close()

    def _say(self, topic: topics.Topic, payload: bytes) -> None:
        key = topics.key_of(self._session, topic, self._node())
        if self._chance.random() < 0.05:
            self._zenoh.delete(key, congestion_control=zenoh.CongestionControl.BLOCK)
        else:
            self._zenoh.put(key, payload, congestion_control=zenoh.CongestionControl.BLOCK)

    def _ask(self, query: topics.Query, payload: bytes) -> None:
        key = topics.asked_key(self._session, query, self._node(), asker=self._node())
        self._places.acquire()
        handler = Callback(self._answered, self._places.release, indirect=False)
        self._zenoh.get(key, handler, payload=payload, timeout=10.0)

    def _answered(self, _: zenoh.Reply) -> None:
        self.answered += 1

    def _pretend(self) -> None:
        """Shows itself as all kinds of nodes, and offers to answer all questions; what it showed before goes."""
        for token in self._tokens:
            token.undeclare()
        self._tokens = [
            self._zenoh.liveliness().declare_token(topics.node_key(self._session, kind, self._node()))
            for kind in (*NODE_KINDS, "stranger")
        ]
        for query in QUERIES:
            expression = topics.asked_key(self._session, query, self._chance.choice(self._nodes))
            lying = self._zenoh.declare_queryable(
                expression, Callback(lambda asked: asked.reply(str(asked.key_expr), b"ELYS lies"), indirect=False)
            )
            lying.undeclare()

    def _node(self) -> str:
        return self._chance.choice(self._nodes)


def fuzz_as_user(endpoint: str, session: str, render_node: str, seed: int, count: int) -> int:
    """How many questions were answered."""
    credentials = sys.stdin.readline().strip()
    fuzzers = [Fuzzer(endpoint, session, render_node, credentials, seed + number) for number in range(CLIENTS)]
    threads = [threading.Thread(target=fuzzer.run, args=(count // CLIENTS,)) for fuzzer in fuzzers]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for fuzzer in fuzzers:
        fuzzer.close()
    return sum(fuzzer.answered for fuzzer in fuzzers)


def fuzz_as_stranger(endpoint: str, seed: int, count: int) -> int:
    """How many connections answered anything."""
    chance = random.Random(seed)
    host, _, port = endpoint.partition("/")[2].rpartition(":")
    answered = sent = 0
    while sent < count:
        frames = [strange_frame(chance) for _ in range(min(FRAMES_A_CONNECTION, count - sent))]
        if chance.random() < 0.5:
            frames[0] = greeting(chance)
        sent += len(frames)
        try:
            with socket.create_connection((host, int(port)), 20.0) as connection:
                connection.sendall(b"".join(frames))
                connection.shutdown(socket.SHUT_WR)
                answered += bool(connection.recv(500))
        except OSError as error:
            if error.errno not in (errno.ECONNRESET, errno.EPIPE, errno.ENOTCONN):
                raise  # anything but that it was shut out before it had said all
    return answered


def greeting(chance: random.Random) -> bytes:
    """What a zenoh client says first, often with a fault, and with extensions of any kind."""
    body = bytearray(b"\x01\x09\xf2" + chance.randbytes(16))
    if chance.random() < 0.5:
        body[0] |= 0x80
        body += chance.randbytes(chance.randrange(40))
    if chance.random() < 0.3:
        body[chance.randrange(len(body))] ^= 1 << chance.randrange(8)
    return len(body).to_bytes(2, "little") + bytes(body)


def strange_frame(chance: random.Random) -> bytes:
    """A frame of the length it says, or not, that begins as one of zenoh's messages or as none."""
    body = bytes((chance.choice((0x01, 0x02, 0x03, 0x04, 0x05, 0x06, 0x25, 0xE5, chance.randrange(256))),))
    body += chance.randbytes(chance.choice((0, 3, 20, 200)))
    length = len(body) if chance.random() < 0.9 else chance.randrange(1 << 16)
    return length.to_bytes(2, "little") + body


if __name__ == "__main__":
    endpoint, session, render_node, seed, count = sys.argv[1:]
    if session == "-":
        print("sent", count, "answered", fuzz_as_stranger(endpoint, int(seed), int(count)))
    else:
        print("sent", count, "answered", fuzz_as_user(endpoint, session, render_node, int(seed), int(count)))
