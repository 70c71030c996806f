"""The engines that are measured, behind one face: a scene's columns in, steps, frames out."""

from __future__ import annotations

import importlib.util
import inspect
import time
from importlib import metadata
from typing import Any, ClassVar, NamedTuple, Protocol

import numpy as np

from elys.samples.rigid_cases import BOX, CAPSULE, DYNAMIC, SPHERE, STATIC, TIME_STEP, Bodies, RigidScene, Trajectory
from elys.sim_node.physics import PhysicsSettings, PhysicsWorld

Array = np.ndarray[Any, Any]


class CannotError(Exception):
    """An engine lacks what a scene needs."""


class Frame(NamedTuple):
    """All bodies of a scene at one moment, in its order, as the columns of a Trajectory."""

    position: Array
    rotation: Array
    linear_velocity: Array
    angular_velocity: Array


class Engine(Protocol):
    """A scene in an engine. Bodies are named by their row in the scene; added ones count on."""

    label: ClassVar[str]

    def __init__(self, scene: RigidScene, *, sleeping: bool = False, threads: int = 1) -> None: ...
    def step(self) -> None: ...
    def frame(self) -> Frame: ...
    def cast_rays(self, origins: Array, directions: Array) -> int:
        """How many of the rays hit something."""
        ...

    def add(self, bodies: Bodies) -> None: ...
    def remove_last(self, count: int) -> None: ...


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


class Rapier:
    """rapier3d from PyPI with its default parameters; its own step alone is worth timing, not the reading of its state."""

    label: ClassVar = "Rapier"

    def __init__(self, scene: RigidScene, *, sleeping: bool = False, threads: int = 1) -> None:
        import rapier3d

        self._rapier = rapier3d
        self._sleeping = sleeping
        self._handles: list[Any] = []
        self.world = rapier3d.PhysicsWorld(gravity=scene.gravity)
        self.world.set_num_threads(threads)
        self.world.integration_parameters.dt = TIME_STEP
        self.add(scene.bodies)

    def step(self) -> None:
        self.world.step()

    def frame(self) -> Frame:
        found = np.empty((len(self._handles), 13))
        bodies = self.world.rigid_bodies
        for row, handle in enumerate(self._handles):
            body = bodies[handle]
            turn = body.rotation
            velocities = (*body.linvel.to_tuple(), *body.angvel.to_tuple())
            found[row] = (*body.translation.to_tuple(), turn.i, turn.j, turn.k, turn.w, *velocities)
        return Frame(found[:, 0:3], found[:, 3:7], found[:, 7:10], found[:, 10:13])

    def cast_rays(self, origins: Array, directions: Array) -> int:
        make_ray, cast = self._rapier.Ray, self.world.query_pipeline.cast_ray
        self.world.update_query_pipeline()
        starts, ways = origins.tolist(), directions.tolist()
        return sum(cast(make_ray(start, way), 1e9, True) is not None for start, way in zip(starts, ways, strict=True))

    def add(self, bodies: Bodies) -> None:
        kinds = {DYNAMIC: self._rapier.RigidBodyType.DYNAMIC, STATIC: self._rapier.RigidBodyType.FIXED}
        for row in range(len(bodies.motion)):
            x, y, z, w = bodies.rotation[row].tolist()
            turn = self._rapier.Rotation3.from_quaternion(w, x, y, z)
            builder = self._rapier.RigidBodyBuilder(kinds[int(bodies.motion[row])])
            builder = builder.position((bodies.position[row].tolist(), turn))
            builder = builder.linvel(bodies.linear_velocity[row].tolist())
            builder = builder.angvel(bodies.angular_velocity[row].tolist())
            builder = builder.can_sleep(self._sleeping).ccd_enabled(bool(bodies.fast[row]))
            self._handles.append(self.world.add_body(builder, [self._collider(bodies, row)]))

    def _collider(self, bodies: Bodies, row: int) -> Any:
        radius = float(bodies.radius[row])
        make = self._rapier.Collider
        match int(bodies.shape[row]):
            case shape if shape == BOX:
                builder = make.cuboid(*(0.5 * bodies.size[row]).tolist())
            case shape if shape == SPHERE:
                builder = make.ball(radius)
            case _:
                builder = make.capsule_y(float(bodies.half_length[row]), radius)
        # Of equal values the geometric mean is the value, and 0 stays 0, as in ELYS.
        rule = self._rapier.CoefficientCombineRule.GEOMETRIC_MEAN
        builder = builder.friction_combine_rule(rule).restitution_combine_rule(rule)
        builder = builder.friction(float(bodies.friction[row])).restitution(float(bodies.restitution[row]))
        return builder.mass(float(bodies.mass[row]))

    def remove_last(self, count: int) -> None:
        for handle in self._handles[-count:]:
            self.world.remove_body(handle)
        del self._handles[-count:]


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
