"""The hand of the tool "grab": it takes a body at a point and drags that point in the plane that faces the camera."""

from __future__ import annotations

import asyncio

import numpy as np
from numpy.typing import NDArray

from elys.bus.messages.commands import Grab, Release
from elys.bus.messages.views import ViewCamera
from elys.common.components import RigidBody, Vec3
from elys.common.math import quaternion
from elys.editor_node.language import tr
from elys.editor_node.model import EditorModel

Point = NDArray[np.float64]


class BodyHand:
    """Tells the simulation where it pulls: one command under way, the newest place counts."""

    def __init__(self, model: EditorModel) -> None:
        self._model = model
        self._entity = 0
        self._anchor = np.zeros(3)  # in the body's axes [m]
        self._start = np.zeros(3)  # in the world [m]
        self.target: Point | None = None  # where it pulls; None: it holds nothing
        self._told: Point | None = None
        self._sending: asyncio.Task[None] | None = None

    @property
    def held(self) -> int:
        """The body that it holds; 0 for none."""
        return self._entity if self.target is not None else 0

    @property
    def held_point(self) -> Point | None:
        """Where the point that it holds is now [m]; None: it holds nothing, or what it held is gone."""
        if self.target is None or not self._model.scene.exists(self._entity):
            return None
        pose = self._model.scene.world_pose(self._entity)
        return np.asarray(
            np.array(pose.position) + quaternion.rotate(np.array(pose.rotation), self._anchor), np.float64
        )

    def take(self, entity: int, point: Point) -> bool:
        """Takes the body that an entity is part of, at a point in the world; False, and a line that says why, for none."""
        scene = self._model.scene
        body = next(
            (e for e in (entity, *scene.ancestors_of(entity)) if scene.echo_of(e, "RigidBody") is not None), 0
        ) if scene.exists(entity) else 0  # fmt: skip
        value = scene.echo_of(body, "RigidBody")
        if not isinstance(value, RigidBody) or value.motion != "dynamic":
            self._model.say("error", tr("{name} is no body that can be dragged", name=scene.name_of(entity)))
            return False
        pose = scene.world_pose(body)
        turn = quaternion.conjugate(np.array(pose.rotation))
        self._anchor = np.asarray(quaternion.rotate(turn, point - np.array(pose.position)), np.float64)
        self._entity, self._start = body, point
        self.pull(point)
        return True

    def drag(self, camera: ViewCamera, aspect: float, at: tuple[float, float]) -> None:
        """Pulls to where the ray through `at` (-1 to 1, y up) comes through the plane that faces the camera."""
        if self.target is not None:
            self.pull(on_facing_plane(camera, aspect, at, self._start))

    def pull(self, target: Point) -> None:
        """Pulls to a point in the world [m]."""
        self.target = target
        if self._sending is None or self._sending.done():
            self._sending = self._model.session.start(self._send())

    def let_go(self) -> None:
        """Lets go; the body flies on as it moves."""
        if self.target is not None:
            self.target = None
            if self._sending is None or self._sending.done():
                self._sending = self._model.session.start(self._send())

    async def _send(self) -> None:
        while self.target is not None and self.target is not self._told:
            self._told = self.target
            command = Grab(entity=self._entity, anchor=_vec3(self._anchor), target=_vec3(self.target))
            await self._model.command("Drag", command)
        if self.target is None:
            self._told = None
            await self._model.command("Let go", Release())


def _vec3(point: Point) -> Vec3:
    x, y, z = point.tolist()
    return x, y, z


def on_facing_plane(camera: ViewCamera, aspect: float, at: tuple[float, float], through: Point) -> Point:
    """Where the ray of a picture's point (-1 to 1, y up) meets the plane through a point that faces the camera."""
    turn, eye = np.array(camera.rotation), np.array(camera.position)
    local = np.asarray(quaternion.rotate(quaternion.conjugate(turn), through - eye))
    half = camera.ortho_height / 2.0 or -local[2] * np.tan(camera.field_of_view / 2.0)
    place = np.array((at[0] * half * aspect, at[1] * half, local[2]))
    return np.asarray(eye + quaternion.rotate(turn, place), np.float64)
