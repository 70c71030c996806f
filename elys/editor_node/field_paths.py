"""What can be plotted, as a person writes it: `Box 3.Transform.position.y`, `Box 3.speed`, `world.kinetic`.

    ENTITY.COMPONENT.FIELD[.ELEMENT]   a field of a component; ENTITY is a name, or #ID where several are called so;
                                       ELEMENT a letter (position.y), or a place in a list of numbers (Morph.weights.2)
    ENTITY.FIGURE                      what follows from where it is: FIGURES; and CONTACTS, in how many it takes part
    world.FIGURE                       what the host measures of everything: WORLD_FIGURES

A name may itself hold points: the longest that there is counts.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final, NamedTuple

from elys.bus.messages.physics import Diagnostics
from elys.common.assets.morph_weights import parse_weights
from elys.common.components import FieldDeclaration, Kind, RigidBody, declaration_of
from elys.common.errors import ElysError
from elys.editor_node.language import tr
from elys.editor_node.scene_mirror import EditorScene

WORLD: Final = "world"
CONTACTS: Final = "contacts"
SUGGESTIONS: Final = 12
_NUMBERS: Final = (Kind.FLOAT, Kind.INT, Kind.BOOL, Kind.VEC3, Kind.QUAT, Kind.COLOR)
_LISTS: Final = {("Morph", "weights"): parse_weights}  # texts that are numbers; those not named are 0
_ELEMENTS: Final = {Kind.VEC3: "xyz", Kind.QUAT: "xyzw", Kind.COLOR: "rgb"}


class FieldPathError(ElysError):
    """A path that leads to no number: what is wrong with it, and what there is instead."""


class Figure(NamedTuple):
    """Something that follows from the scene or is measured."""

    unit: str
    read: Callable[..., float]


@dataclass(frozen=True, slots=True, kw_only=True)
class PlotField:
    """A number that can be read at any moment."""

    path: str  # as it was written
    unit: str
    entity: int = 0  # 0 for the world
    component: str = ""  # "" for figures
    field: str = ""
    element: int = -1  # of fields that have several


def _velocity(scene: EditorScene, entity: int, name: str) -> float:
    body = scene.component_of(entity, "RigidBody")
    return math.hypot(*getattr(body, name)) if isinstance(body, RigidBody) else math.nan


FIGURES: Final[dict[str, Figure]] = {
    "height": Figure("m", lambda scene, entity: float(scene.world_pose(entity).position[1])),
    "speed": Figure("m/s", lambda scene, entity: _velocity(scene, entity, "linear_velocity")),
    "spin": Figure("rad/s", lambda scene, entity: _velocity(scene, entity, "angular_velocity")),
    "enabled": Figure("", lambda scene, entity: float(scene.is_enabled(entity))),
    CONTACTS: Figure("", lambda scene, entity: math.nan),  # the scene does not know of them
}
WORLD_FIGURES: Final[dict[str, Figure]] = {
    "kinetic": Figure("J", lambda found: found.kinetic),
    "potential": Figure("J", lambda found: found.potential),
    "energy": Figure("J", lambda found: found.kinetic + found.potential),
    "momentum": Figure("kg m/s", lambda found: math.hypot(*found.momentum)),
    "angular_momentum": Figure("kg m^2/s", lambda found: math.hypot(*found.angular_momentum)),
    "deepest_overlap": Figure("m", lambda found: found.deepest_overlap),
    "residual": Figure("m/s", lambda found: found.residual),
    "joint_error": Figure("m", lambda found: found.joint_error),
    "contacts": Figure("", lambda found: float(found.contacts)),
    "islands": Figure("", lambda found: float(found.islands)),
    "awake": Figure("", lambda found: float(found.awake)),
    "bodies": Figure("", lambda found: float(found.bodies)),
}


class FieldPaths:
    """Reads paths of a scene. The index of names is made anew when the tree changed and somebody asks."""

    def __init__(self, scene: EditorScene, *, contacts_of: Callable[[int], float] = lambda entity: math.nan) -> None:
        """`contacts_of` counts the contacts of an entity."""
        self._scene = scene
        self._contacts_of = contacts_of
        self._version: tuple[int, int] = (-1, -1)
        self._entity_of: dict[str, int] = {}
        self._suggested: tuple[tuple[object, ...], list[str]] = ((), [])

    def resolve(self, path: str) -> PlotField:
        """What a path leads to.

        Raises:
            FieldPathError: nothing, or nothing that is a number.
        """
        path = path.strip()
        owner, rest = self._split(path)
        if owner is None:
            raise FieldPathError(tr("'{path}' begins with no entity's name and point", path=path))
        if owner == 0:
            return _world_field(path, rest)
        if rest in FIGURES:
            return PlotField(path=path, unit=FIGURES[rest].unit, entity=owner, field=rest)
        component, _, inner = rest.partition(".")
        if component not in self._scene.components_of(owner):
            known = ", ".join((*self._plottable(owner), *FIGURES))
            raise FieldPathError(
                tr("{name} has no {what}; it has {known}", name=self._scene.name_of(owner), what=component, known=known)
            )
        return _component_field(path, owner, component, inner)

    def read(self, field: PlotField, measured: Diagnostics | None = None) -> float:
        """The number now; not a number where there is none: the entity or its component is gone, nothing was measured."""
        if not field.entity:
            return WORLD_FIGURES[field.field].read(measured) if measured is not None else math.nan
        if not self._scene.exists(field.entity):
            return math.nan
        if not field.component and field.field == CONTACTS:
            return self._contacts_of(field.entity)
        if not field.component:
            return FIGURES[field.field].read(self._scene, field.entity)
        component = self._scene.component_of(field.entity, field.component)
        if component is None:
            return math.nan
        value = getattr(component, field.field)
        parse = _LISTS.get((field.component, field.field))
        if parse is not None:
            numbers = parse(value)
            return numbers[field.element] if field.element < len(numbers) else 0.0
        return float(value[field.element] if field.element >= 0 else value)

    def suggestions(self, text: str) -> list[str]:
        """How a path that begins so may go on; what ends with a point goes on further."""
        key = (text, self._scene.structure_version, self._scene.mirror.epoch)
        if self._suggested[0] != key:
            self._suggested = key, self._suggest(text.lstrip())
        return self._suggested[1]

    def paths_to(self, entity: int, component: str, field: str) -> list[str]:
        """The paths of a field, one for each element, as `resolve` reads them; by id where the name leads elsewhere."""
        name = self._scene.name_of(entity)
        path = f"{name}.{component}.{field}"
        owner, rest = self._split(path)
        if owner != entity or rest != f"{component}.{field}":
            path = f"#{entity}.{component}.{field}"
        letters = _ELEMENTS.get(declaration_of(component).field(field).kind, "")
        return [f"{path}.{letter}" for letter in letters] or [path]

    # --- inside ----------------------------------------------------------------------------------------------------

    def _split(self, path: str) -> tuple[int | None, str]:
        """The entity at a path's beginning (0: the world, None: none) and what stands behind its point."""
        names, at = self._names(), len(path)
        while (at := path.rfind(".", 0, at)) >= 0:
            name, rest = path[:at], path[at + 1 :]
            if name == WORLD:
                return 0, rest
            if name in names:
                return names[name], rest
            if name.startswith("#") and name[1:].isdigit() and self._scene.exists(int(name[1:])):
                return int(name[1:]), rest
        return None, path

    def _suggest(self, text: str) -> list[str]:
        owner, rest = self._split(text)
        if owner is None:
            return self._suggest_names(text)
        start = text[: len(text) - len(rest)]
        if owner == 0:
            return [start + name for name in _fitting(rest, WORLD_FIGURES)]
        component, dot, inner = rest.partition(".")
        if not dot:
            found = [*_fitting(rest, (f"{name}." for name in self._plottable(owner))), *_fitting(rest, FIGURES)]
            return [start + name for name in found]
        if component not in self._scene.components_of(owner):
            return []
        return [f"{start}{component}.{name}" for name in _fitting(inner, _leaves(component))][:SUGGESTIONS]

    def _suggest_names(self, text: str) -> list[str]:
        wanted = text.casefold()
        first: list[str] = []
        second: list[str] = []
        for name in (WORLD, *self._names()):
            folded = name.casefold()
            if folded.startswith(wanted):
                first.append(f"{name}.")
                if len(first) == SUGGESTIONS:
                    break
            elif wanted in folded and len(second) < SUGGESTIONS:
                second.append(f"{name}.")
        return [*first, *second][:SUGGESTIONS]

    def _plottable(self, entity: int) -> list[str]:
        return [name for name in self._scene.components_of(entity) if any(True for _ in _leaves(name))]

    def _names(self) -> dict[str, int]:
        version = (self._scene.structure_version, self._scene.mirror.epoch)
        if version != self._version:
            self._version = version
            self._entity_of = {}
            for entity in self._scene.mirror.entities.values():
                self._entity_of.setdefault(entity.name, entity.id)  # of several of one name the first
        return self._entity_of


def is_plottable(declared: FieldDeclaration) -> bool:
    """Whether it holds numbers."""
    return declared.kind in _NUMBERS


def _fitting(text: str, names: Iterator[str] | dict[str, Figure]) -> list[str]:
    """Those in which a text stands, those that begin with it first."""
    wanted = text.casefold()
    found = [name for name in names if wanted in name.casefold()]
    return sorted(found, key=lambda name: not name.casefold().startswith(wanted))


def _leaves(component: str) -> Iterator[str]:
    """`field` or `field.element` of every number in a component."""
    for field in declaration_of(component).fields:
        if field.kind in _ELEMENTS:
            yield from (f"{field.name}.{letter}" for letter in _ELEMENTS[field.kind])
        elif field.kind in _NUMBERS:
            yield field.name
        elif (component, field.name) in _LISTS:
            yield f"{field.name}.0"


def _world_field(path: str, name: str) -> PlotField:
    if name not in WORLD_FIGURES:
        raise FieldPathError(
            tr(
                "of the {world} there is no '{what}'; there is {known}",
                world=WORLD,
                what=name,
                known=", ".join(WORLD_FIGURES),
            )
        )
    return PlotField(path=path, unit=WORLD_FIGURES[name].unit, field=name)


def _component_field(path: str, entity: int, component: str, inner: str) -> PlotField:
    name, dot, letter = inner.partition(".")
    if (component, name) in _LISTS and letter.isdecimal():
        return PlotField(path=path, unit="", entity=entity, component=component, field=name, element=int(letter))
    declared = next((field for field in declaration_of(component).fields if field.name == name), None)
    if declared is None or declared.kind not in _NUMBERS:
        known = ", ".join(_leaves(component))
        raise FieldPathError(
            tr("{component} has no number '{what}'; it has {known}", component=component, what=name, known=known)
        )
    element = _element(declared, letter) if dot else -1
    if element < 0 and (dot or declared.kind in _ELEMENTS):
        letters = ", ".join(_ELEMENTS.get(declared.kind, ())) or tr("no parts")
        raise FieldPathError(tr("'{what}' has {known}: name one of them", what=name, known=letters))
    return PlotField(
        path=path, unit=declared.unit, entity=entity, component=component, field=name, element=element
    )  # fmt: skip


def _element(declared: FieldDeclaration, letter: str) -> int:
    """Its place; -1 for none."""
    return _ELEMENTS.get(declared.kind, "").find(letter) if len(letter) == 1 else -1
