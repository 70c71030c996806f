"""What scripts see of the world beside entities: time, the scene, questions to its shapes, players, events."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any, TypeVar

import msgspec

from elys.common.assets.store import is_reference
from elys.common.components import Component, Script, Transform
from elys.common.errors import EntityError, ScriptError
from elys.common.ids import NO_ENTITY
from elys.common.scene_document import ComponentChanges
from elys.sim_node.inputs import PlayerInput
from elys.sim_node.scripts.behaviour import Behaviour
from elys.sim_node.scripts.handles import EntityHandle, Hit, checked_name
from elys.sim_node.scripts.holding import CALLED
from elys.sim_node.scripts.planting import spawn_records
from elys.sim_node.scripts.vector import Rotation, Vector

if TYPE_CHECKING:
    from elys.sim_node.scripts.runner import Scripts

B = TypeVar("B", bound=Behaviour)


class GameWorld:
    """Everything that is not a script's own entity.

    Attributes:
        source: the script that asks: it brings the prefabs that it names. "" for none.
    """

    __slots__ = ("_scripts", "source")

    def __init__(self, scripts: Scripts, source: str = "") -> None:
        self._scripts = scripts
        self.source = source

    @property
    def time(self) -> float:
        """Simulation time [s], but for what of it was held."""
        simulation, hold = self._scripts.simulation, self._scripts.hold
        return simulation.tick_time.without(hold.held).at(self.tick, simulation.settings.tick_rate)

    @property
    def tick(self) -> int:
        """Steps done, but for those in which time was held."""
        return self._scripts.tick

    @property
    def is_held(self) -> bool:
        """Whether a script holds time, or will from the next step on."""
        return bool(self._scripts.hold.by)

    @property
    def held_time(self) -> float:
        """How long time was held in all so far [s]."""
        hold = self._scripts.hold
        return hold.held.at(hold.ticks, self._scripts.simulation.settings.tick_rate)

    def hold(self, by: Behaviour) -> None:
        """Lets time stand from the next step on, for all but one script: nothing moves, and only its `fixed_update` and `update`
        are called, until `let_go`, or until it is off or gone. Its async functions and what it hears stand as well. What was told
        meanwhile is heard then.

        Raises:
            ScriptError: it has neither of both, and so could not let go.
        """
        if not any(getattr(type(by), hook) is not getattr(Behaviour, hook) for hook in CALLED):
            raise ScriptError(
                f"{type(by).__name__} cannot hold time: it has no fixed_update and no update in which it could let go"
            )
        self._scripts.hold.by = by.entity.id

    def let_go(self) -> None:
        """Lets time go on from the next step."""
        self._scripts.hold.by = 0

    @property
    def dt(self) -> float:
        """The length of a tick [s]."""
        return 1.0 / self._scripts.simulation.settings.tick_rate

    @property
    def gravity(self) -> Vector:
        """[m/s^2]"""
        return Vector(self._scripts.simulation.settings.gravity)

    @gravity.setter
    def gravity(self, gravity: Iterable[float]) -> None:
        simulation = self._scripts.simulation
        vector = Vector(gravity)
        if not all(abs(part) <= 1e6 for part in vector):
            raise ValueError(f"gravity must be a vector of at most 1e6 m/s^2 along each axis, not {vector!r}")
        simulation.change_settings(msgspec.structs.replace(simulation.settings, gravity=tuple(vector)))

    def find(self, name: str) -> EntityHandle:
        """The first entity of a name, in the tree's order; LookupError if there is none."""
        found = self.find_all(name)
        if not found:
            raise LookupError(f"nobody is called {name!r}")
        return found[0]

    def find_all(self, name: str) -> list[EntityHandle]:
        """All entities of a name."""
        return [EntityHandle(self._scripts, entity) for entity in self._scripts.named(name)]

    def with_component(self, *components: type[Component]) -> list[EntityHandle]:
        """All that have these components, in the order of their ids, those switched off too."""
        query = self._scripts.simulation.world.query(*components)
        return [EntityHandle(self._scripts, entity) for entity in sorted(query.entities.tolist())]

    def behaviours(self, behaviour: type[B]) -> list[B]:
        """All scripts of a class that run, in the order in which they do."""
        return self._scripts.behaviours_of(behaviour)

    def spawn(
        self,
        *components: Component,
        name: str = "",
        parent: EntityHandle | None = None,
        position: Iterable[float] | None = None,
    ) -> EntityHandle:
        """A new entity; with a position it has a Transform there. A Script names its file as scenes do, "door.py#Door"."""
        parts = list(components)
        if position is not None and not any(isinstance(part, Transform) for part in parts):
            parts.insert(0, Transform(position=tuple(Vector(position))))  # type: ignore[arg-type]
        parts = [self._with_known_script(part) if isinstance(part, Script) else part for part in parts]
        above = parent.id if parent is not None else NO_ENTITY
        self._scripts.make_room(1)
        return EntityHandle(
            self._scripts, self._scripts.simulation.world.spawn(parts, name=checked_name(name), parent=above)
        )

    def _with_known_script(self, component: Script) -> Script:
        """The component with the content of the script that it names by its file; ScriptError where nothing here has it."""
        if not component.source or is_reference(component.source):
            return component
        source = self._scripts.source_named(component.source)
        if source is None:
            raise ScriptError(
                f"nothing here has the script {component.source}, so its text is not known: let a prefab beside the script "
                "bring it, with spawn_prefab"
            )
        return msgspec.structs.replace(component, source=source)

    def spawn_prefab(
        self,
        prefab: str,
        *,
        name: str = "",
        parent: EntityHandle | None = None,
        position: Iterable[float] | None = None,
        rotation: Iterable[float] | None = None,
        components: ComponentChanges | None = None,
        overrides: Mapping[str, ComponentChanges] | None = None,
    ) -> EntityHandle:
        """A new instance of a prefab; its root.

        Args:
            prefab: a file beside the script ("crate.prefab.json", as one text), or what a field of it says in the scene.
            position: of the root, in its parent's space [m]; None: as in the file. So for `rotation`.
            components: laid over those of the root, `{"Material": {"roughness": 0.1}}`; None takes one away.
            overrides: the same for those below it, by path of names.

        Raises:
            ScriptError: there is no such prefab here, or too many entities. SceneError, ComponentError: what is laid over it does
                not fit.
        """
        laid = dict(components or {})
        placed = {
            **({"position": tuple(Vector(position))} if position is not None else {}),
            **({"rotation": tuple(Rotation(rotation))} if rotation is not None else {}),
        }
        if placed:
            laid["Transform"] = {**(laid.get("Transform") or {}), **placed}
        above = parent.id if parent is not None else NO_ENTITY
        changes = {**(overrides or {}), "": laid}
        records = self._scripts.library.prefab(prefab, self.source)
        self._scripts.make_room(len(records))
        return EntityHandle(
            self._scripts,
            spawn_records(self._scripts.simulation.world, records, above, changes, name=checked_name(name)),
        )

    def raycast(
        self, origin: Iterable[float], direction: Iterable[float], max_distance: float = 1000.0, **filters: Any
    ) -> Hit | None:
        """The first collider that a ray meets; None if it meets none. Filters as `PhysicsWorld.raycast`'s."""
        ray = [tuple(Vector(origin))], [tuple(Vector(direction))], max_distance
        with self._scripts.watchdog.resting():
            return self._first(self._scripts.simulation.physics.raycast(*ray, **filters))

    def cast_sphere(
        self,
        origin: Iterable[float],
        direction: Iterable[float],
        radius: float,
        max_distance: float = 1000.0,
        **filters: Any,
    ) -> Hit | None:
        """What a ball touches first on its way."""
        ray = [tuple(Vector(origin))], [tuple(Vector(direction))], radius, max_distance
        with self._scripts.watchdog.resting():
            return self._first(self._scripts.simulation.physics.cast_sphere(*ray, **filters))

    def closest_point(self, point: Iterable[float], max_distance: float = 1000.0, **filters: Any) -> Hit | None:
        """The collider closest to a place, and where on it."""
        with self._scripts.watchdog.resting():
            return self._first(
                self._scripts.simulation.physics.closest_point([tuple(Vector(point))], max_distance, **filters)
            )

    def _first(self, hits: Any) -> Hit | None:
        if not len(hits.entity) or not int(hits.entity[0]):
            return None
        return Hit(
            EntityHandle(self._scripts, int(hits.entity[0])),
            Vector(hits.point[0].tolist()),
            Vector(hits.normal[0].tolist()),
            float(hits.distance[0]),
        )

    def overlap_sphere(self, center: Iterable[float], radius: float, **filters: Any) -> list[EntityHandle]:
        """All whose colliders share a point with a ball, once each."""
        with self._scripts.watchdog.resting():
            found = self._scripts.simulation.physics.overlap_sphere([tuple(Vector(center))], [radius], **filters)
        return [EntityHandle(self._scripts, entity) for entity in dict.fromkeys(found.entity.tolist())]

    def overlap_box(
        self,
        center: Iterable[float],
        size: Iterable[float],
        rotation: Iterable[float] = (0.0, 0.0, 0.0, 1.0),
        **filters: Any,
    ) -> list[EntityHandle]:
        """All whose colliders share a point with a box of full edge lengths [m], once each."""
        with self._scripts.watchdog.resting():
            found = self._scripts.simulation.physics.overlap_box(
                [tuple(Vector(center))], [tuple(Vector(size))], rotation=[tuple(Rotation(rotation))], **filters
            )
        return [EntityHandle(self._scripts, entity) for entity in dict.fromkeys(found.entity.tolist())]

    def input(self, player: int = 1) -> PlayerInput:
        """What a player does in this tick."""
        return self._scripts.simulation.inputs[player]

    @property
    def players(self) -> tuple[int, ...]:
        """Those who do or hold anything."""
        return self._scripts.simulation.inputs.players

    def emit(self, event: str | Any, /, to: EntityHandle | None = None, **values: Any) -> None:
        """Tells an event: to one entity's script, or to all; they hear it in the next tick, in the order in which it was told.

        Args:
            event: its name, with `values`; or a value of a class that declares it, a named tuple or a msgspec Struct.

        Raises:
            TypeError: something of it is of another type than its class, or that of a listener, says.
        """
        self._scripts.events.emit(event, to.id if to is not None else NO_ENTITY, values)

    def play_sound(self, sound: str, *, volume: float = 1.0, pitch: float = 1.0) -> None:
        """Lets a sound be heard once, on both sides alike, wherever the camera is."""
        self._scripts.sounds.play(sound, NO_ENTITY, {"volume": volume, "pitch": pitch})

    def entity(self, number: int) -> EntityHandle:
        """The handle of an id; EntityError if nobody has it."""
        if not self._scripts.simulation.world.is_alive(number):
            raise EntityError(f"there is no entity {number}")
        return EntityHandle(self._scripts, number)
