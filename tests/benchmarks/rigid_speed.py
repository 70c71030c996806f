"""How fast engines step crowds: in one process, in turns of a few steps, so that a noisy machine disturbs all alike.

Alike is not equally: a peer that hands its step to a thread of its own waits longer for a busy core. So beside the median
of wall times stands the quiet time: the least processor time that the same work took when it was done again (of all
threads; where there are several, wall time). ELYS must reach its bound in both.
"""

from __future__ import annotations

import gc
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np

from elys.lab.peers.engine import CannotError, Engine
from elys.samples.rigid_cases import DYNAMIC, Crowd, RigidScene, deepest_overlap
from tests.benchmarks.rigid_engines import Elys, engines

FIRST_STEPS = 100
SETTLED = "settled"
_TURN = 5  # steps of one engine before the next has its turn


Times = dict[str, np.ndarray[Any, Any]]  # engine -> wall and processor time of each step (steps, 2) [ms]


class SpeedRow(NamedTuple):
    """One crowd in one window. What an engine could not do is missing from its figures."""

    crowd: str
    title: str
    window: str
    bound: float  # of ELYS's time over the peer's
    step_ms: dict[str, float]  # engine -> median
    quiet_ms: dict[str, float]  # engine -> what it costs when nothing else runs, as near as can be told
    overlap_mm: dict[str, float]  # engine -> deepest at the window's end
    restless: dict[str, float]  # engine -> RMS speed of dynamic bodies at the window's end [m/s]
    lost: dict[str, int]  # engine -> bodies that fell through the ground or are not finite
    stages: dict[str, float]  # of ELYS -> median [ms]; empty if not asked for

    @property
    def ratio(self) -> float | None:
        """ELYS's time over that of its fastest peer."""
        return _ratio(self.step_ms)

    @property
    def quiet_ratio(self) -> float | None:
        """The same of the quiet times."""
        return _ratio(self.quiet_ms)

    @property
    def is_met(self) -> bool | None:
        """Whether both ratios are within the bound; None without a peer, or where ELYS cannot have the scene."""
        if self.ratio is None or self.quiet_ratio is None:
            return None
        return max(self.ratio, self.quiet_ratio) <= self.bound


def _ratio(costs: dict[str, float]) -> float | None:
    peers = [cost for label, cost in costs.items() if label != "ELYS"]
    return costs["ELYS"] / min(peers) if peers and "ELYS" in costs else None


def measure_crowd(crowd: Crowd, *, quick: bool = False, stages: bool = False) -> list[SpeedRow]:
    """A row for the first steps, where something falls, and one for the settled window.

    `quick` settles half as long and looks shorter; with `stages` ELYS also tells what its stages took.
    """
    scene = crowd.build()
    clock = 1 if crowd.threads == 1 else 0  # processor time, or wall time
    rows = []
    falls: list[Times] = []
    # The first steps are the same each time, so the least that each took is known after some rounds.
    for _ in range(1 if crowd.falling_bound is None else 2 if quick else 3):
        print(f"  {crowd.name}: the first {FIRST_STEPS} steps ...", file=sys.stderr, flush=True)
        worlds = start_all(scene, sleeping=crowd.sleeping, threads=crowd.threads)
        _note_stages(worlds, wanted=stages)
        falls.append(step_in_turns(worlds, FIRST_STEPS))
    if crowd.falling_bound is not None:
        rounds = {world.label: np.stack([times[world.label] for times in falls]) for world in worlds}
        quiet = {label: float(np.median(taken[:, :, clock].min(0))) for label, taken in rounds.items()}
        rows.append(_row(crowd, f"first {FIRST_STEPS}", crowd.falling_bound, scene, worlds, rounds, quiet))
    print(f"  {crowd.name}: settling ...", file=sys.stderr, flush=True)
    step_in_turns(worlds, crowd.settle_steps // (2 if quick else 1) - FIRST_STEPS)
    _note_stages(worlds, wanted=stages)
    times = step_in_turns(worlds, 75 if quick else 150)
    turns = {label: np.median(taken[:, clock].reshape(-1, _TURN), axis=1) for label, taken in times.items()}
    quiet = {label: float(medians.min()) for label, medians in turns.items()}
    rows.append(_row(crowd, SETTLED, crowd.settled_bound, scene, worlds, times, quiet))
    return rows


def _note_stages(worlds: list[Engine], *, wanted: bool) -> None:
    """Begins a new note of what the stages take."""
    for world in worlds:
        if isinstance(world, Elys):
            world.stages = {} if wanted else None


def start_all(scene: RigidScene, *, sleeping: bool = False, threads: int = 1) -> list[Engine]:
    """The scene in each engine that can have it, stepped by none."""
    worlds: list[Engine] = []
    for engine in engines():
        try:
            warm_up(engine, scene, sleeping=sleeping, threads=threads)
            worlds.append(engine(scene, sleeping=sleeping, threads=threads))
        except CannotError as reason:
            print(f"    {reason}", file=sys.stderr)
    return worlds


def warm_up(engine: type[Engine], scene: RigidScene, *, sleeping: bool, threads: int) -> None:
    """Loads or compiles what a scene of this kind needs, so that its first step costs what a first step costs."""
    part = scene.bodies.__class__(*(column[:40] for column in scene.bodies))
    world = engine(RigidScene(part, scene.gravity), sleeping=sleeping, threads=threads)
    for _ in range(60):
        world.step()


def step_in_turns(worlds: list[Engine], steps: int) -> Times:
    """Wall and processor time of each step (steps, 2) [ms], by engine."""
    times: dict[str, list[tuple[float, float]]] = {world.label: [] for world in worlds}
    with _without_garbage_collection():
        for begin in range(0, steps, _TURN):
            for world in worlds:
                for _ in range(min(_TURN, steps - begin)):
                    began = time.process_time()
                    wall = timed(world.step)
                    times[world.label].append((wall, 1000.0 * (time.process_time() - began)))
    return {label: np.array(taken) for label, taken in times.items()}


def timed(work: Callable[[], object]) -> float:
    """How long a call takes by the wall's clock [ms]."""
    began = time.perf_counter()
    work()
    return 1000.0 * (time.perf_counter() - began)


@contextmanager
def _without_garbage_collection() -> Iterator[None]:
    gc.collect()
    gc.disable()
    try:
        yield
    finally:
        gc.enable()


def _row(
    crowd: Crowd,
    window: str,
    bound: float,
    scene: RigidScene,
    worlds: list[Engine],
    times: Times,
    quiet: dict[str, float],
) -> SpeedRow:
    overlap, restless, lost = {}, {}, {}
    moving = scene.bodies.motion == DYNAMIC
    for world in worlds:
        frame = world.frame()
        below = ~(frame.position[:, 1] > -0.5) & moving
        lost[world.label] = int(below.sum())
        speed = frame.linear_velocity[moving & ~below]
        restless[world.label] = float(np.sqrt((speed**2).sum(1).mean()))
        sound = np.isfinite(frame.position).all() and np.isfinite(frame.rotation).all()
        overlap[world.label] = (
            1000.0 * deepest_overlap(scene.bodies, frame.position, frame.rotation) if sound else np.inf
        )
    medians = {label: float(np.median(taken[..., 0])) for label, taken in times.items()}
    noted = next((world.stages for world in worlds if isinstance(world, Elys)), None) or {}
    stages = {stage: 1000.0 * float(np.median(taken)) for stage, taken in noted.items()}
    return SpeedRow(crowd.name, crowd.title, window, bound, medians, quiet, overlap, restless, lost, stages)


def speed_table(rows: list[SpeedRow]) -> str:
    """Markdown."""
    labels = [engine.label for engine in engines()]
    head = ["crowd", "window", *(f"{label}, ms (quiet)" for label in labels), "ratio (quiet)", "must reach", ""]
    head += [f"{label}: overlap, mm" for label in labels] + [f"{label}: RMS speed, m/s" for label in labels]
    lines = ["| " + " | ".join(head) + " |", "| " + " | ".join(["---"] * len(head)) + " |"]
    for row in rows:
        costs = ((_figure(row.step_ms, label, ".3f"), _figure(row.quiet_ms, label, ".3f")) for label in labels)
        cells = [row.title, row.window, *(f"{median} ({quiet})" for median, quiet in costs)]
        cells += ["-" if row.ratio is None else f"{row.ratio:.2f} ({row.quiet_ratio:.2f})"]
        cells += [f"{row.bound:g}", {None: "-", True: "ok", False: "MISS"}[row.is_met]]
        cells += [
            _figure(row.overlap_mm, label, ".2f") + (f", {row.lost[label]} lost" if row.lost.get(label) else "")
            for label in labels
        ]
        cells += [_figure(row.restless, label, ".3f") for label in labels]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def stage_table(rows: list[SpeedRow]) -> str:
    """Markdown: medians of ELYS's stages [ms], by window."""
    noted = [row for row in rows if row.stages]
    stages = list(dict.fromkeys(stage for row in noted for stage in row.stages))
    head = ["stage of ELYS, ms", *(f"{row.title}, {row.window}" for row in noted)]
    lines = ["| " + " | ".join(head) + " |", "| " + " | ".join(["---"] * len(head)) + " |"]
    cells = ([stage, *(_figure(row.stages, stage, ".3f") for row in noted)] for stage in stages)
    return "\n".join([*lines, *(f"| {' | '.join(row)} |" for row in cells)])


def _figure(figures: dict[str, float], label: str, form: str) -> str:
    return format(figures[label], form) if label in figures else "-"
