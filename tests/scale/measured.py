"""What a message costs a router, measured on a small real tree; and the same tree at other sizes, to hold the model against."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from tests.benchmarks.viewers import Phase, stage
from tests.scale.model import Costs

SCENES: Final = ("stack", "pile")  # ten bodies and a thousand
CALIBRATED_AT: Final = (2, 20)  # viewers
CHECKED_AT: Final = (1, 10, 100)  # viewers, none of which the costs were taken from


@dataclass(frozen=True, slots=True, kw_only=True)
class Point:
    """A router with so many viewers below it."""

    scene: str
    viewers: int
    size: float  # [bytes] of a state
    router: float  # [s] of its processor time in a tick
    age_p50: float  # [ms]
    age_p99: float


def measure(counts: Sequence[int], scenes: Sequence[str] = SCENES, *, seconds: float) -> list[Point]:
    """One router below a real simulation, with each of these counts of viewers."""
    points = []
    for scene in scenes:
        with stage(scene) as on:
            points += [_point(scene, on.phase(count, seconds)) for count in counts]
    return points


def _point(scene: str, phase: Phase) -> Point:
    return Point(
        scene=scene,
        viewers=phase.viewers,
        size=phase.state_size,
        router=phase.routers[0] / phase.ticks,
        age_p50=float(np.percentile(phase.ages, 50)),
        age_p99=float(np.percentile(phase.ages, 99)),
    )


def fitted(points: Sequence[Point], *, snapshot: float) -> Costs:
    """The costs of a message that explain these points best (least squares of relative errors, none below 0)."""
    count = np.array([point.viewers for point in points], float)
    size = np.array([point.size for point in points])
    router = np.array([point.router for point in points])
    terms = np.stack([np.ones_like(count), size, count, count * size], axis=1) / router[:, None]
    free = list(range(terms.shape[1]))
    while True:  # a cost that would come out negative is none
        found = np.linalg.lstsq(terms[:, free], np.ones_like(router), rcond=None)[0]
        if (found >= 0.0).all():
            break
        free.pop(int(np.argmin(found)))
    take, take_byte, give, give_byte = (found[free.index(place)] if place in free else 0.0 for place in range(4))
    few = [point for point in points if point.viewers == min(count)]
    hop = max(min(point.age_p50 for point in few) / 2e3, 0.0)  # host to router, router to viewer
    return Costs(take=take, take_byte=take_byte, give=give, give_byte=give_byte, hop=hop, snapshot=snapshot)


def predicted(point: Point, costs: Costs) -> float:
    """[s] of a router's processor in a tick."""
    return costs.taking(point.size) + point.viewers * costs.giving(point.size)


def snapshot_cost() -> float:
    """[s] of processor time to make and encode a snapshot of a thousand entities, as a host does for each who joins."""
    with stage("pile") as on:
        return float(np.median([on.host.ask("snapshot")["snapshot"] for _ in range(10)]))
