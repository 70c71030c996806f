"""How fast engines step crowds: in one process, in turns of a few steps, so that a noisy machine disturbs all alike."""

from __future__ import annotations

import gc
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple

import numpy as np

from elys.samples.rigid_cases import DYNAMIC, Crowd, RigidScene, deepest_overlap
from tests.benchmarks.rigid_engines import CannotError, Elys, Engine, engines

FIRST_STEPS = 100
SETTLED = "settled"
_TURN = 10  # steps of one engine before the next has its turn


class SpeedRow(NamedTuple):
    """One crowd in one window. What an engine could not do is missing from its figures."""

    crowd: str
    title: str
    window: str
    bound: float  # of ELYS's time over the peer's
    step_ms: dict[str, float]  # engine -> median
    quiet_ms: dict[str, float]  # engine -> median of its fastest turn: what a step costs when nothing else runs
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
        """The same of the fastest turns: steadier on a busy machine, without meaning where steps differ by nature."""
        return _ratio(self.quiet_ms) if self.window == SETTLED else None


def _ratio(costs: dict[str, float]) -> float | None:
    peers = [cost for label, cost in costs.items() if label != "ELYS"]
    return costs["ELYS"] / min(peers) if peers and "ELYS" in costs else None


def measure_crowd(crowd: Crowd, *, quick: bool = False, stages: bool = False) -> list[SpeedRow]:
    """A row for the first steps, where something falls, and one for the settled window.

    `quick` settles half as long and looks shorter; with `stages` ELYS also tells what its stages took.
    """
    scene = crowd.build()
    worlds = start_all(scene, sleeping=crowd.sleeping, threads=crowd.threads)
    rows = []
    print(f"  {crowd.name}: the first {FIRST_STEPS} steps ...", file=sys.stderr, flush=True)
    _note_stages(worlds, wanted=stages)
    times = step_in_turns(worlds, FIRST_STEPS)
    if crowd.falling_bound is not None:
        rows.append(_row(crowd, f"first {FIRST_STEPS}", crowd.falling_bound, scene, worlds, times))
    print(f"  {crowd.name}: settling ...", file=sys.stderr, flush=True)
    step_in_turns(worlds, crowd.settle_steps // (2 if quick else 1) - FIRST_STEPS)
    _note_stages(worlds, wanted=stages)
    times = step_in_turns(worlds, 50 if quick else 150)
    rows.append(_row(crowd, SETTLED, crowd.settled_bound, scene, worlds, times))
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
            warm_up(engine, scene, threads)
            worlds.append(engine(scene, sleeping=sleeping, threads=threads))
        except CannotError as reason:
            print(f"    {reason}", file=sys.stderr)
    return worlds


def warm_up(engine: type[Engine], scene: RigidScene, threads: int) -> None:
    """Loads or compiles what a scene of this kind needs, so that its first step costs what a first step costs."""
    part = scene.bodies.__class__(*(column[:40] for column in scene.bodies))
    world = engine(RigidScene(part, scene.gravity), threads=threads)
    for _ in range(60):
        world.step()


def step_in_turns(worlds: list[Engine], steps: int) -> dict[str, np.ndarray]:
    """What each step took (steps,) [ms], by engine."""
    times: dict[str, list[float]] = {world.label: [] for world in worlds}
    with _without_garbage_collection():
        for begin in range(0, steps, _TURN):
            for world in worlds:
                for _ in range(min(_TURN, steps - begin)):
                    times[world.label].append(timed(world.step))
    return {label: np.array(taken) for label, taken in times.items()}


def timed(work: object) -> float:
    """How long a call takes [ms]."""
    assert callable(work)
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
    crowd: Crowd, window: str, bound: float, scene: RigidScene, worlds: list[Engine], times: dict[str, np.ndarray]
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
    medians = {label: float(np.median(taken)) for label, taken in times.items()}
    quiet = {label: float(np.median(taken.reshape(-1, _TURN), axis=1).min()) for label, taken in times.items()}
    noted = next((world.stages for world in worlds if isinstance(world, Elys)), None) or {}
    stages = {stage: 1000.0 * float(np.median(taken)) for stage, taken in noted.items()}
    return SpeedRow(crowd.name, crowd.title, window, bound, medians, quiet, overlap, restless, lost, stages)


def speed_table(rows: list[SpeedRow]) -> str:
    """Markdown."""
    labels = [engine.label for engine in engines()]
    head = ["crowd", "window", *(f"{label}, ms" for label in labels), "ratio", "must reach", "", "quiet ratio"]
    head += [f"{label}: overlap, mm" for label in labels] + [f"{label}: RMS speed, m/s" for label in labels]
    lines = ["| " + " | ".join(head) + " |", "| " + " | ".join(["---"] * len(head)) + " |"]
    for row in rows:
        ratio = row.ratio
        verdict = "-" if ratio is None else "ok" if ratio <= row.bound else "MISS"
        cells = [row.title, row.window, *(_figure(row.step_ms, label, ".3f") for label in labels)]
        quiet = "-" if row.quiet_ratio is None else f"{row.quiet_ratio:.2f}"
        cells += ["-" if ratio is None else f"{ratio:.2f}", f"{row.bound:g}", verdict, quiet]
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
    for stage in stages:
        lines.append("| " + " | ".join([stage, *(_figure(row.stages, stage, ".3f") for row in noted)]) + " |")
    return "\n".join(lines)


def _figure(figures: dict[str, float], label: str, form: str) -> str:
    return format(figures[label], form) if label in figures else "-"
