"""Rapier, https://rapier.rs, through the package rapier3d: the fastest among the peers."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from elys.lab.peers.engine import Frame
from elys.samples.rigid_cases import BOX, DYNAMIC, SPHERE, STATIC, TIME_STEP, Bodies, RigidScene

Array = np.ndarray[Any, Any]


class Rapier:
    """rapier3d from PyPI with its default parameters; its own step alone is worth timing, not the reading of its state."""

    label: ClassVar = "Rapier"

    def __init__(
        self, scene: RigidScene, *, sleeping: bool = False, threads: int = 1, time_step: float = TIME_STEP
    ) -> None:
        import rapier3d

        self._rapier = rapier3d
        self._sleeping = sleeping
        self._handles: list[Any] = []
        self.world = rapier3d.PhysicsWorld(gravity=scene.gravity)
        self.world.set_num_threads(threads)
        self.world.integration_parameters.dt = time_step
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
