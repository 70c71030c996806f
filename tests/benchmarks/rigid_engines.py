"""The engines that are measured: ELYS behind the face of its peers, and how a run of any is recorded."""

from __future__ import annotations

import importlib.util
import inspect
import time
from importlib import metadata
from typing import Any, ClassVar

import numpy as np

from elys.lab.peers.engine import CannotError, Engine, Frame
from elys.lab.peers.rapier import Rapier
from elys.samples.rigid_cases import CAPSULE, TIME_STEP, Bodies, RigidScene, Trajectory
from elys.sim_node.physics import PhysicsSettings, PhysicsWorld

Array = np.ndarray[Any, Any]


class Elys:
    """A PhysicsWorld, through its public methods alone."""

    label: ClassVar = "ELYS"

    def __init__(self, scene: RigidScene, *, sleeping: bool = False, threads: int = 1) -> None:
        self._count = 0
        choices: dict[str, Any] = {"gravity": scene.gravity}
        known = PhysicsSettings.__struct_fields__
        choices["events"] = False  # as Rapier, which is asked for none
        if "sleeping" in known:
            choices["sleeping"] = sleeping
        if "threads" in known:
            choices["threads"] = threads
        elif threads != 1:
            raise CannotError("ELYS steps on one thread yet")
        self.stages: dict[str, list[float]] | None = None  # a dict makes each step note the seconds of its stages
        self.world = PhysicsWorld(PhysicsSettings(**choices))
        self.add(scene.bodies)

    def step(self) -> None:
        if self.stages is None:
            self.world.step(TIME_STEP)
            return
        profile: dict[str, float] = {}
        self.world.step(TIME_STEP, profile)
        for stage, seconds in profile.items():
            self.stages.setdefault(stage, []).append(seconds)

    def frame(self) -> Frame:
        states = self.world.bodies
        return Frame(*(np.array(column, np.float64) for column in states[2:6]))

    def cast_rays(self, origins: Array, directions: Array) -> int:
        return int((self.world.raycast(origins, directions).entity > 0).sum())

    def add(self, bodies: Bodies) -> None:
        entities = np.arange(self._count + 1, self._count + 1 + len(bodies.motion))
        shapes: dict[str, Any] = {"shape": bodies.shape, "size": bodies.size, "radius": bodies.radius}
        if "half_length" in inspect.signature(PhysicsWorld.add_colliders).parameters:
            # A box and a sphere have no half length; it is not judged there, but must be above 0 of a capsule.
            shapes["half_length"] = np.where(bodies.shape == CAPSULE, bodies.half_length, 0.5)
        elif (bodies.shape == CAPSULE).any():
            raise CannotError("ELYS has no capsules yet")
        self.world.add_bodies(
            entities,
            motion=bodies.motion,
            position=bodies.position,
            rotation=bodies.rotation,
            linear_velocity=bodies.linear_velocity,
            angular_velocity=bodies.angular_velocity,
            mass=bodies.mass,
        )
        self.world.add_colliders(entities, **shapes, friction=bodies.friction, restitution=bodies.restitution)
        self._count += len(entities)

    def remove_last(self, count: int) -> None:
        self.world.remove_bodies(np.arange(self._count - count + 1, self._count + 1))
        self._count -= count


def engines() -> list[type[Engine]]:
    """ELYS, and those of its peers that are installed."""
    return [Elys, *([Rapier] if importlib.util.find_spec("rapier3d") else [])]


def versions() -> dict[str, str]:
    """Of ELYS and of what is installed to measure it against."""
    packages = ["elys", *(name for name in ("rapier3d", "mujoco") if importlib.util.find_spec(name))]
    return {name: metadata.version(name) for name in packages}


def record(engine: Engine, steps: int, *, stride: int = 1) -> tuple[Trajectory, Array]:
    """Steps an engine and records the start and every `stride` steps; also each step's processor time (steps,) [ms]."""
    frames, times = [engine.frame()], np.empty(steps)
    for number in range(steps):
        began = time.process_time()
        engine.step()
        times[number] = 1000.0 * (time.process_time() - began)
        if (number + 1) % stride == 0:
            frames.append(engine.frame())
    moments = np.arange(len(frames)) * stride * TIME_STEP
    return Trajectory(moments, *(np.stack(columns) for columns in zip(*frames, strict=True))), times
