"""What an engine is to whoever measures it: a scene's columns in, steps, frames out."""

from __future__ import annotations

from typing import Any, ClassVar, NamedTuple, Protocol

import numpy as np

from elys.common.errors import ElysError
from elys.samples.rigid_cases import Bodies, RigidScene

Array = np.ndarray[Any, Any]


class CannotError(ElysError):
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
