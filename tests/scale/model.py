"""A tree of routers as queues: how old states are at each viewer, what routers carry, from measured costs of a message.

Time goes in ticks; each node takes a message, then gives it to each of those below it, one after the other. It begins when the
message is there and the last one is done (Lindley's recursion). Giving costs processor time, and the link's time to carry the
bytes; the slower of the two counts. Of what waits longer than the queue of a link holds, the message is lost for all below.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

QUEUE: Final = 16 * 65536  # [bytes] that a link's queue holds, see elys/bus/transports/zenoh.py


@dataclass(frozen=True, slots=True, kw_only=True)
class Costs:
    """Processor time [s] of a router, for each message and each of its bytes, and what passes between nodes besides."""

    take: float
    take_byte: float
    give: float
    give_byte: float
    hop: float  # [s] from one process to the next without anything to wait for
    snapshot: float = 0.0  # [s] of the host for a scene of a thousand entities

    def taking(self, size: float) -> float:
        """[s] to take a message of so many bytes."""
        return self.take + self.take_byte * size

    def giving(self, size: float) -> float:
        """[s] to give it to one below."""
        return self.give + self.give_byte * size


@dataclass(frozen=True, slots=True, kw_only=True)
class Level:
    """Nodes of a tree at one distance from its root, all alike."""

    fan_out: int  # how many hang below each
    delay: float = 0.0  # [s] on the way to those below
    jitter: float = 0.0  # [s] mean of what comes on top, as a network's queues have it (exponential)
    bandwidth: float = 1.25e9  # [bytes/s] of a node towards all below
    cores: float = 1.0  # that work on giving at the same time


@dataclass(frozen=True, slots=True, kw_only=True)
class LevelLoad:
    """What the nodes of a level have to do."""

    nodes: int
    processor: float  # share of the time that a node's cores work
    sent: float  # [bytes/s] of a node
    lost: float  # share of messages that its queues had no room for


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What a tree does."""

    viewers: int
    ages: NDArray[np.float64]  # [s] (ticks, viewers); NaN where the state was lost
    levels: tuple[LevelLoad, ...]

    def age(self, percentile: float) -> float:
        """[ms]; not a number if nothing came at all."""
        came = self.ages[np.isfinite(self.ages)]
        return 1e3 * float(np.percentile(came, percentile)) if len(came) else math.nan

    @property
    def lost(self) -> float:
        """Share of the states that did not come."""
        return float(np.mean(~np.isfinite(self.ages)))


def run(
    levels: Sequence[Level], costs: Costs, *, size: float, rate: float = 60.0, ticks: int = 240, seed: int = 1
) -> Outcome:
    """Sends `ticks` states of `size` bytes at `rate` [Hz] down a tree whose first level is the host."""
    random = np.random.default_rng(seed)
    sent_at = np.arange(ticks)[:, None] / rate
    arrivals, loads = sent_at.copy(), []
    for level in levels:
        arrivals, load = _pass_on(arrivals, level, costs, size, rate, random)
        loads.append(load)
    return Outcome(viewers=arrivals.shape[1], ages=arrivals - sent_at, levels=tuple(loads))


def _pass_on(
    arrivals: NDArray[np.float64], level: Level, costs: Costs, size: float, rate: float, random: np.random.Generator
) -> tuple[NDArray[np.float64], LevelLoad]:
    """When what comes to a level's nodes (ticks, nodes) is at those below (ticks, nodes times fan-out), and the level's load."""
    ticks, nodes = arrivals.shape
    taking, giving = costs.taking(size), costs.giving(size) / level.cores
    places = np.arange(1, level.fan_out + 1)
    given = np.maximum(taking + places * giving, places * size / level.bandwidth)  # [s] after it began, for each below
    patience = max(QUEUE / size, 1.0) / rate  # [s] of messages that a queue holds
    begun = np.full((ticks, nodes), np.nan)
    free_at = np.full(nodes, -np.inf)
    for tick in range(ticks):
        begins = np.maximum(arrivals[tick], free_at)
        taken = np.isfinite(begins) & (begins - arrivals[tick] <= patience)
        begun[tick] = np.where(taken, begins, np.nan)
        free_at = np.where(taken, begins + given[-1], free_at)
    below = begun[:, :, None] + given + costs.hop + level.delay
    if level.jitter:
        below = _in_order(below + random.exponential(level.jitter, below.shape))
    came = np.isfinite(arrivals)
    load = LevelLoad(
        nodes=nodes,
        processor=rate * (taking + level.fan_out * giving),
        sent=rate * size * level.fan_out,
        lost=float(np.mean(came & ~np.isfinite(begun))),
    )
    return below.reshape(ticks, -1), load


def _in_order(below: NDArray[np.float64]) -> NDArray[np.float64]:
    """A connection overtakes nothing: what comes late holds up what was sent after it."""
    lost = ~np.isfinite(below)
    ordered = np.maximum.accumulate(np.where(lost, -np.inf, below), axis=0)
    return np.where(lost, np.nan, ordered)


def tree_for(viewers: int, *, fan_out: int) -> list[int]:
    """Fan-outs of the flattest tree of routers of at most `fan_out` for so many viewers; the host sends to one router."""
    depth = max(1, math.ceil(math.log(max(viewers, 2)) / math.log(fan_out) - 1e-9))
    each = math.ceil(viewers ** (1.0 / depth) - 1e-9)
    return [1, *[each] * depth]


@dataclass(frozen=True, slots=True, kw_only=True)
class JoinStorm:
    """What happens when so many viewers come at once."""

    host: float  # [s] of the host's processor for all snapshots
    presence: float  # messages by which all routers and the host hear of them
    presence_of_all: float  # the same if each viewer heard of each other as well


def join_storm(viewers: int, costs: Costs, *, routers: int) -> JoinStorm:
    """The cost of `viewers` that join below so many routers."""
    told = float(viewers) * (routers + 1)
    return JoinStorm(host=viewers * costs.snapshot, presence=told, presence_of_all=told + float(viewers) ** 2)
