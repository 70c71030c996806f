"""Bodies that fly, bounce, turn, rest, come and go; and both ends of a stream of them over a simulated link."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from elys.bus.messages.state_frame import StateFrame, pack_frame, unpack_frame
from elys.bus.messages.streaming import StreamInterest
from elys.bus.streaming.receiver import Arrival, Receiver
from elys.bus.streaming.sender import Sender
from elys.bus.streaming.truth import Truth, TruthReader
from elys.bus.streaming.wire import pack_ack, unpack_ack
from elys.common.errors import MessageError
from tests.property.simulated_link import Conditions, Network

TICK = 1.0 / 60.0


class Bodies:
    """Balls in a box under gravity, some of them at rest. Known exactly at each tick."""

    def __init__(self, count: int, *, seed: int, resting: float = 0.0, restless: bool = False) -> None:
        self.random = np.random.default_rng(seed)
        self.entity = np.arange(1, count + 1, dtype=np.uint32)
        self.position = self.random.uniform(-10.0, 10.0, (count, 3))
        self.linear = self.random.normal(size=(count, 3)) * 3.0
        self.angular = self.random.normal(size=(count, 3)) * 2.0
        self.rotation = Rotation.random(count, random_state=seed)
        rest = self.random.random(count) < resting
        self.linear[rest] = self.angular[rest] = 0.0
        self.gravity = np.where(rest[:, None], 0.0, np.array([0.0, -9.81, 0.0]))
        self.tick = 0
        self.restless = restless  # bodies come and go
        self.tail_count = 0

    def step(self) -> None:
        self.tick += 1
        self.linear += self.gravity * TICK
        self.position += self.linear * TICK
        outside = np.abs(self.position) > 10.0
        self.linear[outside] *= -0.98
        np.clip(self.position, -10.0, 10.0, out=self.position)
        hit = outside.any(axis=1)
        self.angular[hit] = self.random.normal(size=(int(hit.sum()), 3)) * 2.0
        self.rotation = Rotation.from_rotvec(self.angular * TICK) * self.rotation
        if self.restless and self.tick % 7 == 0:
            self._replace()

    def stop(self) -> None:
        """All come to rest where they are."""
        self.linear[:], self.angular[:], self.gravity[:] = 0.0, 0.0, 0.0

    def _replace(self) -> None:
        kept = np.flatnonzero(self.random.random(len(self.entity)) > 0.02)
        back = np.uint32(1 + self.tick % 20)  # one who was there before, unless he still is
        new = np.uint32([10_000 + self.tick, back if back not in self.entity[kept] else 20_000 + self.tick])
        self.entity = np.concatenate([self.entity[kept], new])
        self.position = np.concatenate([self.position[kept], self.random.uniform(-5, 5, (2, 3))])
        self.linear = np.concatenate([self.linear[kept], np.zeros((2, 3))])
        self.angular = np.concatenate([self.angular[kept], np.zeros((2, 3))])
        self.gravity = np.concatenate([self.gravity[kept], np.array([[0.0, -9.81, 0.0]] * 2)])
        self.rotation = Rotation.from_quat(np.concatenate([self.rotation.as_quat()[kept], [[0, 0, 0, 1]] * 2]))

    def frame(self) -> StateFrame:
        rows = self.tail_count
        animated = {} if not rows else {
            "local_position": np.full((rows, 3), np.float32(self.tick)),
            "local_rotation": np.ones((rows, 4), np.float32),
            "local_scale": np.ones((rows, 3), np.float32),
            "local_entity": np.arange(rows, dtype=np.uint32),
        }  # fmt: skip
        return StateFrame(
            epoch=1,
            tick=self.tick,
            simulation_time=self.tick * TICK,
            published_at=int(self.tick * TICK * 1e9),
            delta_sequence=0,
            state_hash=self.tick,
            playing=True,
            position=self.position.copy(),
            rotation=self.rotation.as_quat().astype(np.float32),
            linear_velocity=self.linear.astype(np.float32),
            angular_velocity=self.angular.astype(np.float32),
            entity=self.entity.copy(),
            **animated,
        )


class Stream:
    """A simulation, a sender, a link of several connections and a viewer. `shown` are (when, frame, arrival)."""

    def __init__(self, bodies: Bodies, link: Conditions, *, seed: int, lanes: int = 4) -> None:
        self.bodies = bodies
        self.network = Network(link, seed=seed)
        self.sender = Sender(0.0, generation=1000)
        self.receiver = Receiver()
        self.truths: dict[int, StateFrame] = {}
        self.shown: list[tuple[float, StateFrame, Arrival]] = []
        self.sizes: list[int] = []
        self.is_running = True
        self.refusals = 0
        self._reader = TruthReader()
        self._truth: Truth | None = None
        self.lanes = (1 << lanes) - 1
        self._acks = 0
        self.network.every(TICK, self._tick)
        self.network.every(0.25, self._say)
        self.network.every(TICK, self._offer)

    def run(self, seconds: float) -> None:
        self.network.run(self.network.now + seconds)

    def look(self, interest: StreamInterest) -> None:
        self.sender.interest = interest

    def new_sender(self) -> None:
        """The streaming process was started anew."""
        self.sender = Sender(self.network.now, generation=self.sender.generation + 1_000_000)

    def _tick(self) -> None:
        if self.is_running:
            self.bodies.step()
        frame = self.bodies.frame()
        self.truths[frame.tick] = frame
        if self.is_running or self._truth is None:
            self._truth = self._reader.read(pack_frame(frame), offset=0)

    def _offer(self) -> None:
        assert self._truth is not None
        sent = self.sender.frame(self._truth, self.network.now)
        if sent is not None:
            self.sizes.append(len(sent.body))
            self.network.send(0, sent.lane, sent.body, self._arrived)

    def _arrived(self, body: bytes) -> None:
        try:
            arrival = self.receiver.take(body)
        except MessageError:
            self.refusals += 1
            raise
        if arrival.state is not None:
            self.shown.append((self.network.now, unpack_frame(arrival.state), arrival))
        if arrival.is_new:
            self._say()

    def _say(self) -> None:
        ack = pack_ack(self.receiver.ack(self.lanes))
        open_lanes = [lane for lane in range(32) if self.lanes >> lane & 1]
        self._acks += 1
        lane = open_lanes[self._acks % len(open_lanes)]
        self.network.send(1, lane, ack, lambda body: self.sender.acked(unpack_ack(body, 0), self.network.now))


def ages(stream: Stream, start: float, end: float, *, steps: int = 400) -> np.ndarray:
    """[s] how old the newest state frame was, at moments spread evenly over a time."""
    times = np.array([when for when, _, _ in stream.shown])
    of = np.array([frame.simulation_time - TICK for _, frame, _ in stream.shown])  # tick 1 was at 0
    moments = np.linspace(start, end, steps, endpoint=False)
    rows = np.searchsorted(times, moments, side="right") - 1
    return np.where(rows >= 0, moments - of[np.maximum(rows, 0)], np.inf)


def errors(stream: Stream, frame: StateFrame) -> tuple[np.ndarray, np.ndarray]:
    """[n] m and [n] rad that bodies of a shown frame are off, by scipy."""
    truth = stream.truths[frame.tick]
    place = {int(entity): row for row, entity in enumerate(truth.entity)}
    rows = [place[int(entity)] for entity in frame.entity]
    off = np.linalg.norm(frame.position - truth.position[rows], axis=1)
    shown = Rotation.from_quat(frame.rotation.astype(float))
    turned = (shown.inv() * Rotation.from_quat(truth.rotation[rows].astype(float))).magnitude()
    return off, turned
