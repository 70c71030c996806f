"""What scripts see of a character: its legs. Wishes hold until they are changed, and are written without an edit of the scene."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, Final

from elys.common.components import Character
from elys.common.errors import ComponentError
from elys.common.ids import MAX_ENTITIES
from elys.sim_node.scripts.vector import Vector

if TYPE_CHECKING:
    from elys.sim_node.scripts.handles import EntityHandle

MODES: Final = ("walk", "swim", "fly")


class Legs:
    """One entity's Character, to be asked and told in a tick."""

    __slots__ = ("_entity",)

    def __init__(self, entity: EntityHandle) -> None:
        entity.get(Character)  # says who has none
        self._entity = entity

    def wish(
        self,
        direction: Iterable[float] | None = None,
        *,
        run: bool | None = None,
        jump: bool | None = None,
        crouch: bool | None = None,
        yaw: float | None = None,
    ) -> None:
        """What it shall do from now on: go along a direction in world space (at length 1 as fast as it can), run, jump (once each
        time that this becomes true), crouch, face a yaw [rad]. What is not given stays."""
        if direction is not None:
            self._write("wish", tuple(Vector(direction)))
        for name, value in (("wish_run", run), ("wish_jump", jump), ("wish_crouch", crouch)):
            if value is not None:
                self._write(name, bool(value))
        if yaw is not None:
            self._write("yaw", float(yaw))

    @property
    def velocity(self) -> Vector:
        """In world space, with that of what carries it [m/s]."""
        now = self._now()
        return Vector([own + carried for own, carried in zip(now.velocity, now.carried, strict=True)])

    @property
    def is_grounded(self) -> bool:
        """Whether it stands."""
        return self._now().grounded

    @property
    def is_crouching(self) -> bool:
        """Whether it is smaller than upright, because it wants to or has no room."""
        now = self._now()
        return 0.0 < now.stature < now.height

    @property
    def ground(self) -> EntityHandle | None:
        """What it stands on."""
        entity = self._now().ground
        return type(self._entity)(self._entity._scripts, entity) if entity else None

    @property
    def ground_normal(self) -> Vector:
        """Of the ground, or of a slope that is too steep to stand on; else 0."""
        return Vector(self._now().ground_normal)

    @property
    def yaw(self) -> float:
        """Where it faces [rad]: 0 is along -z."""
        return self._now().yaw

    @property
    def mode(self) -> str:
        """walk, swim or fly."""
        return self._now().mode

    @mode.setter
    def mode(self, mode: str) -> None:
        if mode not in MODES:
            raise ComponentError(f"a character's mode is {', '.join(MODES)}, not {str(mode)[:40]!r}")
        self._write("mode", MODES.index(mode))

    def launch(self, velocity: Iterable[float]) -> None:
        """Throws it: its own velocity becomes this [m/s], and it leaves the ground if that is upwards."""
        way = Vector(velocity)
        self._write("velocity", tuple(way))
        if way[1] > 0.0:
            self._write("grounded", False)
            self._write("has_jumped", True)

    def _now(self) -> Character:
        return self._entity.get(Character)

    def _write(self, field: str, value: Any) -> None:
        table = self._entity._world.table(Character)
        self._entity.get(Character)  # it may have gone
        table.column(field)[table.row_of[self._entity.id & MAX_ENTITIES]] = value
