"""A scene in another engine, with its default parameters: what it costs and how it moves, as of a run of ELYS."""

from __future__ import annotations

import importlib.util
import math
import time
from collections.abc import Mapping
from importlib import metadata
from typing import Any, Final, NamedTuple

import numpy as np

from elys.common.assets.store import AssetStore
from elys.common.errors import ElysError
from elys.common.ids import Entity
from elys.common.math import quaternion
from elys.common.scene import OpenedScene
from elys.lab.motion import LEAST_COST, Motion
from elys.lab.peers.columns import columns_of
from elys.lab.peers.engine import CannotError, Engine
from elys.lab.setting import Setting
from elys.samples.rigid_cases import BOX, DYNAMIC, SPHERE, RigidScene, deepest_overlap
from elys.sim_node.simulation import Simulation

Array = np.ndarray[Any, Any]

PACKAGES: Final[Mapping[str, str]] = {"rapier": "rapier3d", "mujoco": "mujoco"}


class PeerJob(NamedTuple):
    """A run of a peer that is asked for."""

    peer: str  # of PACKAGES
    scene: OpenedScene
    assets: AssetStore
    duration: float  # [s]
    sample_rate: int  # [Hz]


def require_peers() -> None:
    """Raises ElysError where a peer is not installed."""
    absent = [package for package in PACKAGES.values() if importlib.util.find_spec(package) is None]
    if absent:
        raise ElysError(f"{' and '.join(absent)} cannot be compared with: pip install 'elys[peers]'")


def version_of(peer: str) -> str:
    """A peer's name and version, as a report shows it."""
    package = PACKAGES[peer]
    return f"{package} {metadata.version(package)}"


def run_peer(job: PeerJob) -> Motion | str:
    """How the scene moved there; or why it cannot be built there."""
    simulation = Simulation.load(job.scene, job.assets)
    try:
        scene = columns_of(simulation)
        motion = _run(job, simulation, scene)
        spent = motion.cost
        while spent < LEAST_COST:
            again = _run(job, simulation, scene)
            spent += again.cost
            motion = motion._replace(cost=min(motion.cost, again.cost))
    except CannotError as reason:
        return str(reason)
    return motion


def _engine(peer: str, scene: RigidScene, time_step: float) -> Engine:
    if peer == "rapier":
        from elys.lab.peers.rapier import Rapier

        return Rapier(scene, time_step=time_step)
    from elys.lab.peers.mujoco import MuJoCo

    return MuJoCo(scene, time_step=time_step)


def _run(job: PeerJob, simulation: Simulation, scene: RigidScene) -> Motion:
    rate = job.scene.settings.tick_rate
    engine = _engine(job.peer, scene, 1.0 / rate)
    bodies = scene.bodies
    moving = bodies.motion == DYNAMIC
    frames, overlaps, cost = [engine.frame()], [0.0], 0.0
    count = round(job.duration * job.sample_rate)
    for _ in range(count):
        for _ in range(rate // job.sample_rate):
            began = time.process_time()
            engine.step()
            cost += time.process_time() - began
        frame = engine.frame()
        frames.append(frame)
        is_finite = bool(np.isfinite(frame.position).all())
        overlaps.append(deepest_overlap(bodies, frame.position, frame.rotation) if is_finite else math.inf)
    position, rotation, linear, angular = (np.array(column)[:, moving] for column in zip(*frames, strict=True))
    mass = bodies.mass[moving]
    names = [simulation.world.hierarchy.name_of(Entity(entity)) for entity in simulation.physics.bodies.entity.tolist()]
    spin = quaternion.rotate(quaternion.conjugate(rotation), angular)
    moments = _moments(scene)[moving]
    return Motion(
        setting=Setting(rate, 1, 1),
        gravity=math.hypot(*scene.gravity),
        names=tuple(name for name, moves in zip(names, moving.tolist(), strict=True) if moves),
        mass=mass,
        size=simulation.physics.radii[moving] * (2.0 / math.sqrt(3.0)),
        time=np.arange(count + 1) / job.sample_rate,
        position=position,
        rotation=rotation,
        linear_velocity=linear,
        angular_velocity=angular,
        kinetic=0.5 * ((linear**2).sum(2) @ mass + (moments * spin**2).sum((1, 2))),
        potential=-(position @ np.asarray(scene.gravity)) @ mass,
        momentum=np.einsum("tnk,n->tk", linear, mass),
        overlap=np.array(overlaps),
        overlap_between=("",) * (count + 1),
        joint_error=np.zeros(count + 1),
        joint=("",) * (count + 1),
        first_contacts=None,  # the peers tell of none
        state_hash=0,
        cost=cost,
    )


def _moments(scene: RigidScene) -> Array:
    """Moments of inertia about the bodies' own axes (N, 3) [kg m^2], of solids of even density."""
    bodies = scene.bodies
    mass = bodies.mass[:, None]
    squares = bodies.size**2
    box = mass / 12.0 * (squares.sum(1, keepdims=True) - squares)
    radius, length = bodies.radius, 2.0 * bodies.half_length
    sphere = np.repeat(0.4 * mass * radius[:, None] ** 2, 3, axis=1)
    # A cylinder and two half balls, each with its share of the mass; y is the axis.
    cylinder, ball = length * radius**2, 4.0 / 3.0 * radius**3
    of_cylinder = bodies.mass * cylinder / (cylinder + ball)
    of_ball = bodies.mass - of_cylinder
    along = 0.5 * of_cylinder * radius**2 + 0.4 * of_ball * radius**2
    across = of_cylinder * (radius**2 / 4.0 + length**2 / 12.0)
    across = across + of_ball * (0.4 * radius**2 + length**2 / 4.0 + 0.375 * length * radius)
    capsule = np.stack([across, along, across], axis=1)
    shape = bodies.shape[:, None]
    return np.where(shape == BOX, box, np.where(shape == SPHERE, sphere, capsule))
