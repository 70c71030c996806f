"""How a scene moved under a setting: what an experiment keeps of a run, and the run that makes it.

A `Job` and its `Motion` travel between processes and machines: both are plain data.
"""

from __future__ import annotations

import contextlib
import logging
import math
import time
from collections.abc import Iterator
from typing import Any, Final, NamedTuple

import numpy as np

from elys.common.assets.store import AssetStore
from elys.common.errors import SceneError
from elys.common.ids import Entity
from elys.common.scene import OpenedScene
from elys.lab.setting import Setting, setting_of
from elys.sim_node.kernel_cache import warm_kernels
from elys.sim_node.kernel_needs import needed_kernels
from elys.sim_node.physics.kernels.tables import DYNAMIC
from elys.sim_node.simulation import Simulation

Array = np.ndarray[Any, Any]

MOST_SAMPLES: Final = 600_000_000  # numbers that a motion may hold, 4.8 GB
LEAST_COST: Final = 0.2  # [s] of processor time on which a measurement rests


class Job(NamedTuple):
    """A run that is asked for."""

    scene: OpenedScene
    assets: AssetStore
    duration: float  # [s] of simulation
    sample_rate: int  # [Hz] at which the motion is kept; the tick rate is a multiple of it
    is_timed: bool = True  # whether short runs are repeated until their cost is known well

    @property
    def setting(self) -> Setting:
        """How it is simulated."""
        return setting_of(self.scene.settings)


class Motion(NamedTuple):
    """The dynamic bodies of a scene at T moments, the first as it was loaded; N bodies."""

    setting: Setting
    gravity: float  # [m/s^2]
    names: tuple[str, ...]  # (N,)
    mass: Array  # (N,) [kg]
    size: Array  # (N,) edge of the cube that fits into the same ball [m]
    time: Array  # (T,) [s]
    position: Array  # (T, N, 3) of the entity [m]
    rotation: Array  # (T, N, 4) x y z w
    linear_velocity: Array  # (T, N, 3) of the centre of mass [m/s]
    angular_velocity: Array  # (T, N, 3) in world axes [rad/s]
    kinetic: Array  # (T,) [J]
    potential: Array  # (T,) [J]
    momentum: Array  # (T, 3) [kg m/s]
    overlap: Array  # (T,) the deepest of all contacts [m]
    overlap_between: tuple[str, ...]  # (T,) "A on B", "" where there is none
    joint_error: Array  # (T,) the largest by which a joint's parts stand off each other [m]
    joint: tuple[str, ...]  # (T,) whose it is, "" where there is none
    first_contacts: dict[tuple[str, str], float] | None  # [s] when two entities first touched; None: it is not told
    state_hash: int  # of the end
    cost: float  # [s] of processor time that all steps took
    lost: str = ""  # the first entity that left the numbers, where one did

    @property
    def duration(self) -> float:
        """Simulated time [s]."""
        return float(self.time[-1])

    @property
    def energy(self) -> Array:
        """Kinetic and potential [J]."""
        return self.kinetic + self.potential

    @property
    def is_finite(self) -> bool:
        """Whether it stayed in numbers."""
        return not self.lost and all(
            bool(np.isfinite(column).all()) for column in (self.position, self.linear_velocity, self.energy)
        )


def run_job(job: Job) -> Motion:
    """Simulates and keeps what happened.

    Raises:
        SceneError: nothing in the scene can move, or there is too much to keep.
    """
    warm_kernels(needs=needed_kernels(job.scene))
    motion = _run(job)
    spent = motion.cost
    while job.is_timed and spent < LEAST_COST:  # what takes so little is measured again: once is chance
        again = _run(job)
        spent += again.cost
        motion = motion._replace(cost=min(motion.cost, again.cost))
    return motion


@contextlib.contextmanager
def _unheard() -> Iterator[None]:
    """Within it the simulation tells no log of its problems: a ladder's cheap end has many, and a motion keeps the first."""
    log = logging.getLogger("elys.sim_node.simulation")
    before = log.level
    log.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        log.setLevel(before)


@_unheard()
def _run(job: Job) -> Motion:
    simulation = Simulation.load(job.scene, job.assets)
    keeper = _Keeper(simulation, round(job.duration * job.sample_rate) + 1)
    every = job.setting.tick_rate // job.sample_rate
    for _ in range(round(job.duration * job.sample_rate)):
        for _ in range(every):
            began = time.process_time()
            simulation.step()
            keeper.cost += time.process_time() - began
            keeper.note_contacts()
            keeper.note_problems()
        keeper.keep()
    return keeper.motion(job.setting)


class _Keeper:
    def __init__(self, simulation: Simulation, count: int) -> None:
        self.cost = 0.0
        self._simulation = simulation
        self._count = count
        bodies = simulation.physics.bodies
        is_dynamic = bodies.motion == DYNAMIC
        self._entities = bodies.entity[is_dynamic].copy()
        self._mass = simulation.physics.masses[is_dynamic].copy()
        self._size = simulation.physics.radii[is_dynamic] * (2.0 / math.sqrt(3.0))
        if not len(self._entities):
            raise SceneError(f"nothing in {simulation.name} can move: give it a RigidBody that is dynamic")
        if count * len(self._entities) * 13 > MOST_SAMPLES:
            raise SceneError(
                f"{len(self._entities)} bodies at {count} moments are too much to keep: choose a shorter time"
            )
        self._names: dict[int, str] = {}
        self._moments: list[tuple[Any, ...]] = []
        self._lost = ""
        self._touched: dict[tuple[str, str], float] = {}
        self.keep()

    def keep(self) -> None:
        """Keeps the present moment."""
        simulation = self._simulation
        physics = simulation.physics
        states = physics.bodies
        rows = np.searchsorted(states.entity, self._entities)
        energy, momentum = physics.energy(), physics.momentum()
        overlap, between = self._deepest()
        left = physics.diagnostics
        violation = (left.joint_error, self._name(left.joint) if left.joint else "")
        self._moments.append(
            (
                simulation.time,
                states.position[rows],
                states.rotation[rows],
                states.linear_velocity[rows],
                states.angular_velocity[rows],
                energy.kinetic,
                energy.potential,
                momentum.linear,
                overlap,
                between,
                *violation,
            )
        )

    def note_contacts(self) -> None:
        """Keeps who touched for the first time in the last step."""
        begun = self._simulation.physics.event_changes.begun
        for a, b in zip(begun.entity_a.tolist(), begun.entity_b.tolist(), strict=True):
            pair = tuple(sorted((self._name(a), self._name(b))))
            self._touched.setdefault((pair[0], pair[1]), self._simulation.time)

    def note_problems(self) -> None:
        """Keeps who left the numbers first."""
        for event in self._simulation.take_events():
            if not self._lost and event.values.get("cause") == "not_finite":
                self._lost = self._name(event.entity)

    def motion(self, setting: Setting) -> Motion:
        """All that was kept."""
        (
            time,
            position,
            rotation,
            linear,
            angular,
            kinetic,
            potential,
            momentum,
            overlap,
            between,
            joint_error,
            joint,
        ) = zip(*self._moments, strict=True)
        return Motion(
            setting=setting,
            gravity=math.hypot(*self._simulation.settings.gravity),
            names=tuple(self._name(int(entity)) for entity in self._entities),
            mass=self._mass,
            size=self._size,
            time=np.array(time),
            position=np.array(position),
            rotation=np.array(rotation),
            linear_velocity=np.array(linear),
            angular_velocity=np.array(angular),
            kinetic=np.array(kinetic),
            potential=np.array(potential),
            momentum=np.array(momentum),
            overlap=np.array(overlap),
            overlap_between=between,
            joint_error=np.array(joint_error),
            joint=joint,
            first_contacts=self._touched,
            state_hash=self._simulation.physics.state_hash(),
            cost=self.cost,
            lost=self._lost,
        )

    def _deepest(self) -> tuple[float, str]:
        contacts = self._simulation.physics.contacts
        if not len(contacts.depth):
            return 0.0, ""
        worst = int(np.argmax(contacts.depth))
        depth = float(contacts.depth[worst])
        if depth <= 0.0:
            return 0.0, ""
        return depth, f"{self._name(int(contacts.entity_a[worst]))} on {self._name(int(contacts.entity_b[worst]))}"

    def _name(self, entity: int) -> str:
        if entity not in self._names:
            self._names[entity] = self._simulation.world.hierarchy.name_of(Entity(entity)) or f"entity {entity}"
        return self._names[entity]
