"""Physics as time has left it, kept while time stands still: edits that are all undone have then never been.

A body that is edited is made anew from its components, which are rounder than what physics has of it; neighbours wake, and
impulses that a contact had gathered are gone. So before the first edit of a standstill the whole of physics is copied, and when
undo brings the scene's content back to what it was then, so is that.
"""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

from elys.sim_node.simulation import Simulation


class PausedPhysics:
    """Of one simulation. `instant`: of which it is kept, see `Chronicle`."""

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self.instant = -1
        self._kept: dict[str, NDArray[Any]] | None = None
        self._tick = -1
        self._content = 0  # of the scene, see EditHistory
        self._last_content = 0

    def keep(self, content: int, instant: int) -> None:
        """An edit is about to be made while time stands still at an instant, in a scene of this content."""
        if self._kept is None or self._tick != self._simulation.tick:
            self._kept, self._tick = self._simulation.physics.snapshot(), self._simulation.tick
            self._content = self._last_content = content
            self.instant = instant

    def follow(self, content: int) -> bool:
        """Bodies have followed edits, which left this content; returns whether physics is what it was before them."""
        if self._kept is None or content == self._last_content:
            return False
        self._last_content = content
        if content != self._content or self._tick != self._simulation.tick:
            return False
        self._simulation.take_physics_back(self._kept)
        return True

    def forget(self) -> None:
        """Time goes on, or another scene is there."""
        self._kept = None
