"""What scripts see of the world: entities, and all that can be asked and done.

Places, speeds and forces are in world space, in SI units; y is up. What a script writes holds at once for scripts, and for
physics in its next step.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any, Final, NamedTuple, TypeVar, overload

from elys.common.components import Component, RigidBody, Transform
from elys.common.ids import MAX_ENTITIES, NO_ENTITY, Entity
from elys.common.math import poses
from elys.sim_node.scripts import clip_playing
from elys.sim_node.scripts.easing import checked
from elys.sim_node.scripts.pushes import Kind, Push
from elys.sim_node.scripts.tweening import goal_of
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
        self._world.rename(self.id, checked_name(name))

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
        """To be awaited: goes there in some seconds, and turns if a rotation is given; `ease` as in `tween`. A kinematic body
        takes along what stands on it."""
        place, turn = Vector(position), None if rotation is None else Rotation(rotation)
        return self._scripts.prelude("move_to", self._scripts.world, self, place, turn, *checked(duration, ease))

    def rotate_to(self, rotation: Iterable[float], *, duration: float, ease: str = "smooth") -> Call:
        """To be awaited: turns to there in some seconds, the shorter way round."""
        turn = Rotation(rotation)
        return self._scripts.prelude("move_to", self._scripts.world, self, None, turn, *checked(duration, ease))

    def tween(self, component: type[Component] | str, *, duration: float, ease: str = "smooth", **values: Any) -> Call:
        """To be awaited: fields of a component that it has go to these values in some seconds.

        Numbers, vectors, colours and rotations do; `ease` is one of easing.EASES. Raises ComponentError for a field that is
        not there, TypeError for one that has no values between two.
        """
        name = component if isinstance(component, str) else component.__name__
        if not values:
            raise TypeError(f"tween({name}, ...) takes the fields that shall change, as in intensity=2.0")
        self._world.get(self.id, name)  # raises for one that it has not
        goals = {field: goal_of(name, field, value) for field, value in values.items()}
        return self._scripts.prelude("tween", self._scripts.world, self, name, goals, *checked(duration, ease))

    # --- how it moves: clips of its own Animation, or of the first below it

    def play(
        self,
        clip: str,
        *,
        fade: float | None = None,
        speed: float | None = None,
        loop: str | None = None,
        time: float | None = None,
    ) -> None:
        """Plays a clip, coming in over `fade` seconds; of what is not given the Animation's own. One that plays goes on, unless a
        `time` [s] is given. LookupError if there is no such clip."""
        values = {"fade": fade, "speed": speed, "loop": loop, "time": time}
        clip_playing.play(self._scripts.simulation, self.id, clip, values)

    def blend(self, mix: Mapping[str, float], *, value: float | None = None, fade: float | None = None) -> None:
        """Plays several clips in step: by their weights; or, with a `value`, by where it is between their numbers."""
        clip_playing.blend(self._scripts.simulation, self.id, mix, value, fade)

    def animation_end(self) -> Call:
        """To be awaited: until the clip comes to its end, of one that repeats its next one, or another clip is played."""
        return self._scripts.prelude("animation_end", self)

    @property
    def animation_passes(self) -> tuple[str, int]:
        """The clip that is named, and how often it has come to an end since it began."""
        return clip_playing.passes_of(self._scripts.simulation, self.id)

    @property
    def root_motion(self) -> tuple[Vector, Rotation]:
        """How far it went by root motion in the last tick, in the world [m], and how it turned, in its own space."""
        return clip_playing.root_motion_of(self._scripts.simulation, self.id)

    # --- what it has

    def has(self, component: type[Component] | str) -> bool:
        """Whether it has a component."""
        return self._world.has(self.id, component)

    @overload
    def get(self, component: type[C]) -> C: ...
    @overload
    def get(self, component: str) -> Any: ...
    def get(self, component: type[Component] | str) -> Any:
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

    def play_sound(
        self,
        sound: str,
        *,
        volume: float = 1.0,
        pitch: float = 1.0,
        spatial: bool = True,
        reference_distance: float = 2.0,
        max_distance: float = 0.0,
    ) -> None:
        """Lets a sound be heard once, from where it is now: a built in one, or a file beside the scene. See docs/sound.md."""
        values: dict[str, Any] = {"reference_distance": reference_distance, "max_distance": max_distance}
        if spatial:
            values["position"] = tuple(self.position)
        self._scripts.sounds.play(sound, self.id, {"volume": volume, "pitch": pitch, **values})

    # --- forces on its body, until the next step of physics

    def apply_force(self, force: Iterable[float], at: Iterable[float] | None = None) -> None:
        """Pushes its body [N] at a place [m] in this step; None: at its centre of mass. Nothing is pushed while time is held."""
        if self._scripts.hold.stands:
            return  # or the first step that is none would have the forces of all that were
        self._push("force", force, at)

    def apply_impulse(self, impulse: Iterable[float], at: Iterable[float] | None = None) -> None:
        """Strikes its body [N s]; one that was spawned in this tick as soon as it has one."""
        self._push("impulse", impulse, at)

    def apply_torque(self, torque: Iterable[float]) -> None:
        """Turns its body [N m], as `apply_force` pushes it."""
        if self._scripts.hold.stands:
            return
        self._push("torque", torque, None)

    def _push(self, kind: Kind, vector: Iterable[float], at: Iterable[float] | None) -> None:
        point = None if at is None else tuple(Vector(at))
        self._scripts.pushes.push(Push(kind, self.id, tuple(Vector(vector)), point))

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


def checked_name(name: str) -> str:
    """The name; TypeError for what none can be."""
    if not isinstance(name, str) or len(name) > NAME_LENGTH:
        raise TypeError(f"a name is a text of at most {NAME_LENGTH} characters, not {str(name)[:100]!r}")
    name.encode()  # raises for half a surrogate pair, which could not go over the bus
    return name
