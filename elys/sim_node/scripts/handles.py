"""What scripts see of the world: entities, and all that can be asked and done.

Places, speeds and forces are in world space, in SI units; y is up. What a script writes holds at once for scripts, and for
physics in its next step.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, Final, NamedTuple, TypeVar

from elys.common.components import Component, RigidBody, Transform
from elys.common.errors import EntityError
from elys.common.ids import MAX_ENTITIES, NO_ENTITY, Entity
from elys.common.math import poses
from elys.sim_node.inputs import PlayerInput
from elys.sim_node.scripts.vector import Rotation, Vector
from elys.sim_node.scripts.walking import Legs

if TYPE_CHECKING:
    from elys.sim_node.scripts.behaviour import Behaviour
    from elys.sim_node.scripts.runner import Scripts
    from elys.sim_node.scripts.waiting import Call

NAME_LENGTH: Final = 200  # characters
C = TypeVar("C", bound=Component)
B = TypeVar("B", bound="Behaviour")


class Touch(NamedTuple):
    """Where a contact began."""

    point: Vector  # [m]
    normal: Vector  # away from the other
    impulse: float  # [N s]
    speed: float  # of approach [m/s]


class Hit(NamedTuple):
    """What a ray met."""

    entity: EntityHandle
    point: Vector  # [m]
    normal: Vector
    distance: float  # [m]


class EntityHandle:
    """One entity. Two handles of one entity are equal; of one that has ended everything but `is_alive` is an EntityError."""

    __slots__ = ("_scripts", "id")

    def __init__(self, scripts: Scripts, entity: int) -> None:
        self._scripts = scripts
        self.id = Entity(entity)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, EntityHandle) and other.id == self.id

    def __hash__(self) -> int:
        return hash(self.id)

    def __repr__(self) -> str:
        return f"<{self._scripts.simulation.named(self.id)}>"

    # --- who it is

    @property
    def is_alive(self) -> bool:
        """Whether it is still there."""
        return self._world.is_alive(self.id)

    @property
    def name(self) -> str:
        """What it is called."""
        return self._world.hierarchy.name_of(self.id)

    @name.setter
    def name(self, name: str) -> None:
        self._world.rename(self.id, _checked_name(name))

    @property
    def parent(self) -> EntityHandle | None:
        """The one it stands under."""
        parent = self._world.hierarchy.parent_of(self.id)
        return EntityHandle(self._scripts, parent) if parent != NO_ENTITY else None

    @property
    def children(self) -> list[EntityHandle]:
        """Those right under it, in order."""
        return [EntityHandle(self._scripts, child) for child in self._world.hierarchy.children_of(self.id)]

    @property
    def enabled(self) -> bool:
        """Whether it is switched on itself; a switch above counts as well."""
        return bool(self._world.hierarchy.is_enabled(self.id))

    @enabled.setter
    def enabled(self, enabled: bool) -> None:
        self._world.set_enabled(self.id, enabled)

    def child(self, name: str) -> EntityHandle:
        """The first one below it, at any depth, of a name; LookupError if there is none."""
        for child in self.children:
            if child.name == name:
                return child
        for child in self.children:
            try:
                return child.child(name)
            except LookupError:
                continue
        raise LookupError(f"{self!r} has nobody called {name!r} below it")

    # --- where it is

    @property
    def position(self) -> Vector:
        """Its place [m]."""
        return Vector(self._pose("position", 0))

    @position.setter
    def position(self, position: Iterable[float]) -> None:
        self._place(Vector(position), None)

    @property
    def rotation(self) -> Rotation:
        """How it is turned."""
        return Rotation(self._pose("rotation", 1))

    @rotation.setter
    def rotation(self, rotation: Iterable[float]) -> None:
        self._place(None, Rotation(rotation))

    @property
    def velocity(self) -> Vector:
        """Of its body [m/s]."""
        return Vector(self.get(RigidBody).linear_velocity)

    @velocity.setter
    def velocity(self, velocity: Iterable[float]) -> None:
        self.set(RigidBody, linear_velocity=tuple(Vector(velocity)))

    @property
    def spin(self) -> Vector:
        """Turning speed of its body about the world's axes [rad/s]."""
        return Vector(self.get(RigidBody).angular_velocity)

    @spin.setter
    def spin(self, spin: Iterable[float]) -> None:
        self.set(RigidBody, angular_velocity=tuple(Vector(spin)))

    def forward(self) -> Vector:
        """Where its local -z points."""
        return Vector(poses.rotate(self.rotation, (0.0, 0.0, -1.0)))

    def move_to(
        self,
        position: Iterable[float],
        *,
        duration: float,
        rotation: Iterable[float] | None = None,
        ease: str = "smooth",
    ) -> Call:
        """To be awaited: goes there in some seconds, "linear" or "smooth" (slow at both ends). A kinematic body takes along what
        stands on it."""
        target = None if rotation is None else Rotation(rotation)
        return self._scripts.prelude(
            "move_to", self._scripts.world, self, Vector(position), target, float(duration), ease
        )

    # --- what it has

    def has(self, component: type[Component] | str) -> bool:
        """Whether it has a component."""
        return self._world.has(self.id, component)

    def get(self, component: type[C]) -> C:
        """The value of a component; ComponentError if it has none."""
        return self._world.get(self.id, component)

    def set(self, component: type[Component] | str, **values: Any) -> None:
        """Changes fields of a component that it has; ComponentError for what it does not take."""
        self._world.set_fields(self.id, component, values)

    def add(self, component: Component) -> None:
        """Gives it a component it has not."""
        self._world.add(self.id, component)

    def remove(self, component: type[Component] | str) -> None:
        """Takes a component away."""
        self._world.remove(self.id, component)

    def script(self, behaviour: type[B]) -> B:
        """Its behaviour, if it is one of this class; LookupError if not."""
        return self._scripts.behaviour_of(self, behaviour)

    @property
    def legs(self) -> Legs:
        """What its Character does and shall do; ComponentError if it has none."""
        return Legs(self)

    def destroy(self) -> None:
        """Ends it and all below it, when this tick's scripts are through."""
        if self.is_alive:
            self._scripts.destroy_later(self.id)

    # --- forces on its body, until the next step of physics

    def apply_force(self, force: Iterable[float], at: Iterable[float] | None = None) -> None:
        """Pushes its body [N] at a place [m]; None: at its centre of mass."""
        point = None if at is None else [tuple(Vector(at))]
        self._scripts.simulation.physics.apply_force([self.id], [tuple(Vector(force))], point)

    def apply_impulse(self, impulse: Iterable[float], at: Iterable[float] | None = None) -> None:
        """Strikes its body [N s]."""
        point = None if at is None else [tuple(Vector(at))]
        self._scripts.simulation.physics.apply_impulse([self.id], [tuple(Vector(impulse))], point)

    def apply_torque(self, torque: Iterable[float]) -> None:
        """Turns its body [N m]."""
        self._scripts.simulation.physics.apply_torque([self.id], [tuple(Vector(torque))])

    @property
    def _world(self) -> Any:
        return self._scripts.simulation.world

    def _pose(self, name: str, part: int) -> Any:
        world = self._world
        if world.hierarchy.parent_of(self.id) != NO_ENTITY or not world.has(self.id, Transform):
            return world.transforms.world_pose(self.id)[part]
        table = world.table(Transform)  # of a root: its own values are the world's
        return table.whole_column(name)[table.row_of[self.id & MAX_ENTITIES]].tolist()

    def _place(self, position: Vector | None, rotation: Rotation | None) -> None:
        world = self._world
        parent = world.hierarchy.parent_of(self.id)
        if parent == NO_ENTITY:
            local: dict[str, Any] = {"position": position, "rotation": rotation}
        else:
            above, now = world.transforms.world_pose(parent), world.transforms.world_pose(self.id)
            place, turn, scale = above
            placed = poses.local_pose(place, turn, scale, tuple(position or now[0]), tuple(rotation or now[1]))
            local = dict(zip(("position", "rotation"), placed, strict=True))
        world.set_fields(self.id, Transform, {name: tuple(value) for name, value in local.items() if value is not None})


def _checked_name(name: str) -> str:
    if not isinstance(name, str) or len(name) > NAME_LENGTH:
        raise TypeError(f"a name is a text of at most {NAME_LENGTH} characters, not {str(name)[:100]!r}")
    name.encode()  # raises for half a surrogate pair, which could not go over the bus
    return name


class GameWorld:
    """Everything that is not a script's own entity."""

    def __init__(self, scripts: Scripts) -> None:
        self._scripts = scripts

    @property
    def time(self) -> float:
        """Simulation time [s]."""
        return self._scripts.simulation.time

    @property
    def tick(self) -> int:
        """Steps done."""
        return self._scripts.simulation.tick

    @property
    def dt(self) -> float:
        """The length of a tick [s]."""
        return 1.0 / self._scripts.simulation.settings.tick_rate

    @property
    def gravity(self) -> Vector:
        """[m/s^2]"""
        return Vector(self._scripts.simulation.settings.gravity)

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
        """A new entity; with a position it has a Transform there."""
        parts = list(components)
        if position is not None and not any(isinstance(part, Transform) for part in parts):
            parts.insert(0, Transform(position=tuple(Vector(position))))  # type: ignore[arg-type]
        above = parent.id if parent is not None else NO_ENTITY
        return EntityHandle(
            self._scripts, self._scripts.simulation.world.spawn(parts, name=_checked_name(name), parent=above)
        )

    def raycast(
        self, origin: Iterable[float], direction: Iterable[float], max_distance: float = 1000.0, **filters: Any
    ) -> Hit | None:
        """The first collider that a ray meets; None if it meets none. Filters as `PhysicsWorld.raycast`'s."""
        ray = [tuple(Vector(origin))], [tuple(Vector(direction))], max_distance
        with self._scripts.watchdog.resting():
            hits = self._scripts.simulation.physics.raycast(*ray, **filters)
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

    def input(self, player: int = 1) -> PlayerInput:
        """What a player does in this tick."""
        return self._scripts.simulation.inputs[player]

    @property
    def players(self) -> tuple[int, ...]:
        """Those who do or hold anything."""
        return self._scripts.simulation.inputs.players

    def emit(self, name: str, to: EntityHandle | None = None, **values: Any) -> None:
        """Tells an event: to one entity's script, or to all; they hear it in the next tick, in the order in which it was told."""
        self._scripts.emit(name, to.id if to is not None else NO_ENTITY, values)

    def entity(self, number: int) -> EntityHandle:
        """The handle of an id; EntityError if nobody has it."""
        if not self._scripts.simulation.world.is_alive(number):
            raise EntityError(f"there is no entity {number}")
        return EntityHandle(self._scripts, number)
