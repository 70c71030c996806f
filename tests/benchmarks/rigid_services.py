"""What is measured beside steps: rays, bodies that come and go, and how time grows with the crowd.

All by the quickest of some rounds of the same work: what else the machine does can only make it slower.
"""

from __future__ import annotations

import math
import sys
from typing import NamedTuple

import numpy as np

from elys.lab.peers.engine import Engine
from elys.samples.rigid_cases import CROWDS, DYNAMIC, Bodies, rays_into
from tests.benchmarks.rigid_engines import engines
from tests.benchmarks.rigid_speed import SETTLED, SpeedRow, start_all, step_in_turns, timed

_RAYS = {"ELYS": 100_000, "Rapier": 20_000}


class ServiceRow(NamedTuple):
    """A figure that is judged by itself, not by a ratio."""

    title: str
    unit: str
    figures: dict[str, float]  # engine -> figure
    bound: float
    more_is_better: bool = False

    @property
    def is_met(self) -> bool:
        """Whether ELYS's figure is good enough."""
        figure = self.figures.get("ELYS", math.nan)
        return bool(figure >= self.bound if self.more_is_better else figure <= self.bound)


def measure_rays(*, quick: bool = False) -> list[ServiceRow]:
    """Rays a second into the settled pile of 1000, all of a batch at once where an engine can."""
    print("  rays: settling ...", file=sys.stderr, flush=True)
    scene = CROWDS["pile-1000"].build()
    worlds = start_all(scene)
    step_in_turns(worlds, 100 if quick else 400)
    rates = {}
    for world in worlds:
        count = _RAYS[world.label]
        origins, directions = rays_into(scene, count)
        hits = world.cast_rays(origins, directions)
        if hits < count:
            raise AssertionError(f"{count - hits} rays into a closed bin hit nothing in {world.label}")
        times = []
        for _ in range(3 if quick else 7):
            world.step()  # the batch pays for whatever must be built anew after a step
            times.append(timed(lambda: world.cast_rays(origins, directions)))  # noqa: B023
        rates[world.label] = count / min(times) / 1000.0
    return [ServiceRow("rays a second into 1000 settled cubes", "million", rates, 2.0, more_is_better=True)]


def measure_spawning(*, quick: bool = False) -> list[ServiceRow]:
    """1000 bodies that come into a running world of 10000 and go again, with what the next step takes longer for it."""
    print("  spawn: 1000 into 10000 ...", file=sys.stderr, flush=True)
    scene = CROWDS["pile-10000"].build()
    worlds = start_all(scene)
    step_in_turns(worlds, 20 if quick else 60)
    moving = np.flatnonzero(scene.bodies.motion == DYNAMIC)[:1000]
    above = Bodies(*(column[moving] for column in scene.bodies))
    above = above._replace(position=above.position + np.array([0.0, 20.0, 0.0]))
    come, gone = {}, {}
    for world in worlds:
        come[world.label], gone[world.label] = _come_and_go(world, above, rounds=2 if quick else 5)
    return [
        ServiceRow("spawning 1000 bodies in a running world of 10000", "ms", come, 20.0),
        ServiceRow("destroying them", "ms", gone, 20.0),
    ]


def _come_and_go(world: Engine, above: Bodies, *, rounds: int) -> tuple[float, float]:
    """What adding and removing take, each with what the step after it takes longer than others [ms]."""
    usual, come, after_come, gone, after_gone = [], [], [], [], []
    for _ in range(rounds):
        usual += [timed(world.step) for _ in range(5)]
        come.append(timed(lambda: world.add(above)))
        after_come.append(timed(world.step))
        gone.append(timed(lambda: world.remove_last(len(above.motion))))
        after_gone.append(timed(world.step))
    return (
        min(come) + max(0.0, min(after_come) - min(usual)),
        min(gone) + max(0.0, min(after_gone) - min(usual)),
    )


def growth(rows: list[SpeedRow]) -> list[ServiceRow]:
    """How time grows with the crowd, from the settled rows that are there; by quiet turns, for the rows are minutes apart."""
    settled = {row.crowd: row.quiet_ms for row in rows if row.window == SETTLED}
    found = []
    for title, large, small, share, bound in (
        ("time a body at 10000 over that at 1000", "pile-10000", "pile-1000", 0.1, 1.4),
        ("one moves: 5000 asleep over 1000 asleep", "asleep-5000", "asleep-1000", 1.0, 1.2),
    ):
        if large in settled and small in settled:
            figures = {label: share * time / settled[small][label] for label, time in settled[large].items()}
            found.append(ServiceRow(title, "1", figures, bound))
    return found


def service_table(rows: list[ServiceRow]) -> str:
    """Markdown."""
    labels = [engine.label for engine in engines()]
    head = ["measure", *labels, "must reach", ""]
    lines = ["| " + " | ".join(head) + " |", "| " + " | ".join(["---"] * len(head)) + " |"]
    for row in rows:
        cells = [f"{row.title} [{row.unit}]"]
        cells += [f"{row.figures[label]:.3g}" if label in row.figures else "-" for label in labels]
        cells += [f"{'>=' if row.more_is_better else '<='} {row.bound:g}", "ok" if row.is_met else "MISS"]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)
