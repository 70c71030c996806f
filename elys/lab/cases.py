"""Runs hard cases: a simulation of the case's document, without processes or bus, recorded and judged.

outcome = run_case(HARD_CASES["newtons-cradle"])
outcome.errors        # {"height": 0.003, ...}, the worst over the case's seeds
outcome.is_met        # whether all are within their bounds
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from elys.common.assets.store import AssetStore
from elys.common.components import Collider, Joint, RigidBody
from elys.common.ids import NO_ENTITY, Entity
from elys.common.math.matrix import transform_points
from elys.common.scene import OpenedScene, SceneDocument, expand
from elys.lab.setting import Setting
from elys.samples.hard_cases import CaseMeasure, CaseRun, HardCase
from elys.samples.rigid_cases import Trajectory
from elys.sim_node.simulation import Simulation

Array = np.ndarray[Any, Any]
Progress = Callable[[float], None]  # the share of a case that is done, from 0 to 1

_TOGETHER = ("fixed", "ball", "hinge", "cone_twist")  # kinds whose two anchors shall be at one place
_TIME = 0  # place of `time` among the columns of a Trajectory


class MeasuredError(msgspec.Struct, frozen=True, kw_only=True):
    """What a measure of a case has come to."""

    name: str
    unit: str
    value: float | None  # the worst over the seeds; None where the motion was not finite
    bound: float
    is_met: bool
    known_miss: str = ""


class CaseOutcome(msgspec.Struct, frozen=True, kw_only=True):
    """A case that was run and judged."""

    case: str
    title: str
    difficulty: str
    errors: tuple[MeasuredError, ...]
    duration: float  # simulated, of each seed [s]
    seconds: float  # of wall time, all seeds together

    @property
    def is_met(self) -> bool:
        """Whether every error is within its bound."""
        return all(error.is_met for error in self.errors)


def opened_case(case: HardCase, seed: int) -> OpenedScene:
    """A case's scene, ready to be loaded."""
    return _opened(case.name, case.build(seed))


def run_case(case: HardCase, *, progress: Progress = lambda share: None) -> CaseOutcome:
    """Runs a case with each of its seeds and judges it by the worst."""
    started = time.perf_counter()
    found = []
    for number, seed in enumerate(case.seeds):

        def tell(share: float, done: int = number) -> None:
            progress((done + share) / len(case.seeds))

        found.append(case.errors(record_case(case, seed, progress=tell)))
    return CaseOutcome(
        case=case.name,
        title=case.title,
        difficulty=case.difficulty,
        errors=tuple(_judged(measure, max(errors[measure.name] for errors in found)) for measure in case.measures),
        duration=case.duration,
        seconds=time.perf_counter() - started,
    )


def record_case(
    case: HardCase, seed: int, *, setting: Setting | None = None, progress: Progress = lambda share: None
) -> CaseRun:
    """Simulates a case from its start to its end, at its own setting unless told another, and records it every `stride` ticks."""
    scene = opened_case(case, seed)
    simulation = Simulation.load(setting.applied_to(scene) if setting is not None else scene, AssetStore())
    simulation.physics.settings = msgspec.structs.replace(simulation.physics.settings, sleeping=case.sleeping)
    recorder = CaseRecorder(simulation)
    ticks = case.tick_count(simulation.settings.tick_rate)
    told = max(ticks // 100, 1)
    problems: list[str] = []
    logger = logging.getLogger("elys.sim_node.simulation")
    # Some cases are there to make physics complain: what it says is a result here.
    was_disabled, logger.disabled = logger.disabled, True
    try:
        recorder.note()
        for tick in range(1, ticks + 1):
            simulation.step()
            problems += [str(event.values["text"]) for event in simulation.take_events() if event.kind == "physics"]
            if tick % case.stride == 0:
                recorder.note()
            if tick % told == 0:
                progress(tick / ticks)
    finally:
        logger.disabled = was_disabled
    return recorder.run(seed, tuple(problems))


class CaseRecorder:
    """Notes moments of a simulation whose entities stay the same, and makes a CaseRun of them."""

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        world = simulation.world
        moving = simulation.moving_bodies().entity
        present = world.entities()
        collides = (world.table(Collider).rows(present) >= 0) | (world.table(RigidBody).rows(present) >= 0)
        still = present[collides & ~np.isin(present, moving)]
        self._still = world.transforms.world_poses(still)
        order = [*moving.tolist(), *still.tolist()]
        self._names = tuple(world.hierarchy.name_of(Entity(entity)) for entity in order)
        self._gaps = JointGaps(simulation)
        self._moments: list[tuple[Array, ...]] = []
        self._scalars: list[tuple[float, ...]] = []

    def note(self) -> None:
        """The moment as it is."""
        simulation = self._simulation
        moving = simulation.moving_bodies()
        columns = (moving.position, moving.rotation, moving.linear_velocity, moving.angular_velocity)
        self._moments.append(tuple(np.array(column) for column in columns))
        energy, momentum = simulation.physics.energy(), simulation.physics.momentum()
        depth = simulation.physics.contacts.depth
        overlap = max(0.0, float(depth.max())) if len(depth) else 0.0
        gap = self._gaps.largest()
        linear = momentum.linear.tolist()
        self._scalars.append((simulation.time, sum(energy), energy.kinetic, *linear, overlap, gap))

    def run(self, seed: int, problems: tuple[str, ...]) -> CaseRun:
        """All that was noted."""
        scalars = np.array(self._scalars)
        count = len(self._moments)
        none = np.zeros((len(self._still.position), 3))
        still: tuple[Array, ...] = (self._still.position, self._still.rotation, none, none)
        columns = []
        for number, fixed in enumerate(still):
            moved = np.stack([moment[number] for moment in self._moments])
            resting = np.broadcast_to(np.asarray(fixed, np.float64), (count, *fixed.shape))
            columns.append(np.concatenate([moved, resting], axis=1))
        return CaseRun(
            seed=seed,
            names=self._names,
            motion=Trajectory(scalars[:, _TIME], *columns),
            energy=scalars[:, 1],
            kinetic=scalars[:, 2],
            momentum=scalars[:, 3:6],
            overlap=scalars[:, 6],
            joint_gap=scalars[:, 7],
            problems=problems,
        )


class JointGaps:
    """How far joints are from holding together, from components and places of entities alone: no joint of physics is asked."""

    def __init__(self, simulation: Simulation) -> None:
        world = simulation.world
        self._transforms = world.transforms
        own = []
        for entity in world.query(Joint).entities.tolist():
            joint = world.get(Entity(entity), Joint)
            if joint.kind in _TOGETHER:
                own.append((entity, joint))
        self._own = np.array([entity for entity, _ in own], np.uint32)
        self._other = np.array([joint.other for _, joint in own], np.uint32)
        self._anchors = np.array([joint.anchor for _, joint in own]).reshape(-1, 3)
        self._other_anchors = np.array([joint.other_anchor for _, joint in own]).reshape(-1, 3)

    def largest(self) -> float:
        """The farthest that two anchors of one joint are apart now [m]."""
        if not len(self._own):
            return 0.0
        here = transform_points(self._transforms.world_affines(self._own), self._anchors)
        there = self._other_anchors.copy()
        held = self._other != NO_ENTITY
        if held.any():
            affines = self._transforms.world_affines(self._other[held])
            there[held] = transform_points(affines, self._other_anchors[held])
        return float(np.linalg.norm(here - there, axis=1).max())


def _opened(name: str, document: SceneDocument) -> OpenedScene:
    return OpenedScene(
        name=document.name or name,
        path=Path(f"{name}.scene.json").absolute(),
        settings=document.settings,
        records=expand(document, directory=Path(), assets=AssetStore()),
    )


def _judged(measure: CaseMeasure, value: float) -> MeasuredError:
    return MeasuredError(
        name=measure.name,
        unit=measure.unit,
        value=value if np.isfinite(value) else None,
        bound=measure.bound,
        is_met=measure.is_met(value),
        known_miss=measure.known_miss,
    )
