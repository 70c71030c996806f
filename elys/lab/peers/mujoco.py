"""MuJoCo with its default solver and integrator: the exact one among the peers, and slow with crowds."""

from __future__ import annotations

import sys
from typing import Any, ClassVar

import numpy as np

from elys.common.math import quaternion
from elys.lab.peers.engine import CannotError, Frame
from elys.samples.rigid_cases import BOX, CAPSULE, DYNAMIC, TIME_STEP, Bodies, RigidScene

Array = np.ndarray[Any, Any]

_MOST = 300  # bodies; a pyramid of 820 takes a tenth of a second a step


class MuJoCo:
    """For accuracy alone: scenes without restitution, which its contacts do not have, and without capsules."""

    label: ClassVar = "MuJoCo"

    def __init__(
        self, scene: RigidScene, *, sleeping: bool = False, threads: int = 1, time_step: float = TIME_STEP
    ) -> None:
        import mujoco

        bodies = scene.bodies
        if (bodies.restitution > 0.0).any():
            raise CannotError("MuJoCo has no coefficient of restitution")
        if (bodies.shape == CAPSULE).any() or sleeping or threads != 1:
            raise CannotError("MuJoCo is measured with boxes and spheres alone, awake and on one thread")
        if len(bodies.motion) > _MOST:
            raise CannotError(f"MuJoCo is measured with up to {_MOST} bodies")
        # Else it writes its warnings into a file in the working directory.
        mujoco.set_mju_user_warning(lambda text: print(f"    MuJoCo: {text}", file=sys.stderr))
        self._step = mujoco.mj_step
        self._moving = bodies.motion == DYNAMIC
        self._start = Frame(bodies.position, bodies.rotation, bodies.linear_velocity, bodies.angular_velocity)
        self._model = mujoco.MjModel.from_xml_string(_document(scene, time_step))
        self._data = mujoco.MjData(self._model)
        velocity = self._data.qvel.reshape(-1, 6)
        velocity[:, :3] = bodies.linear_velocity[self._moving]
        # Angular velocity is kept in the body's own axes.
        back = quaternion.conjugate(bodies.rotation[self._moving])
        velocity[:, 3:] = quaternion.rotate(back, bodies.angular_velocity[self._moving])

    def step(self) -> None:
        self._step(self._model, self._data)

    def frame(self) -> Frame:
        found = Frame(*(np.array(column) for column in self._start))
        pose, velocity = self._data.qpos.reshape(-1, 7), self._data.qvel.reshape(-1, 6)
        rotation = pose[:, [4, 5, 6, 3]]
        found.position[self._moving] = pose[:, :3]
        found.rotation[self._moving] = rotation
        found.linear_velocity[self._moving] = velocity[:, :3]
        found.angular_velocity[self._moving] = quaternion.rotate(rotation, velocity[:, 3:])
        return found

    def cast_rays(self, origins: Array, directions: Array) -> int:
        raise CannotError("MuJoCo is measured for accuracy alone")

    def add(self, bodies: Bodies) -> None:
        raise CannotError("MuJoCo is measured for accuracy alone")

    def remove_last(self, count: int) -> None:
        raise CannotError("MuJoCo is measured for accuracy alone")


def _document(scene: RigidScene, time_step: float) -> str:
    """The scene in MuJoCo's XML; its quaternions begin with w, its boxes have half edges."""
    bodies = scene.bodies
    lines = []
    for row in range(len(bodies.motion)):
        x, y, z, w = bodies.rotation[row].tolist()
        place = f'pos="{_numbers(bodies.position[row])}" quat="{_numbers([w, x, y, z])}"'
        is_box = bodies.shape[row] == BOX
        size = _numbers(0.5 * bodies.size[row] if is_box else bodies.radius[row : row + 1])
        surface = f'friction="{bodies.friction[row]!s} 0 0" mass="{bodies.mass[row]!s}"'
        geometry = f'<geom type="{"box" if is_box else "sphere"}" size="{size}" {surface}/>'
        joint = "<freejoint/>" if bodies.motion[row] == DYNAMIC else ""
        lines.append(f"<body {place}>{joint}{geometry}</body>")
    option = f'<option timestep="{time_step!r}" gravity="{_numbers(scene.gravity)}"/>'
    return f"<mujoco>{option}<worldbody>{''.join(lines)}</worldbody></mujoco>"


def _numbers(values: Any) -> str:
    return " ".join(repr(float(value)) for value in values)
