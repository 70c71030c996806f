"""How a component is declared: one msgspec Struct, from which everything else is derived.

    @component
    class Spring(Component, frozen=True):
        \"\"\"Pulls its entity towards an anchor.\"\"\"

        stiffness: Annotated[float, about("How hard it pulls.", unit="N/m", minimum=0.0, step=1.0)] = 100.0
        anchor: Annotated[Vec3, about("Where it pulls to, in world space.", unit="m", step=0.1)] = (0.0, 0.0, 0.0)

That is all: `columns.py` derives the simulation's numpy storage, the Struct itself is the wire format and the recording's
schema, `schema.py` writes the scene file's JSON Schema and the editor draws a widget for each `FieldDeclaration`.

Values are plain Python: float, int, bool, str and tuples, so that a component can be compared, printed and diffed.
"""

from __future__ import annotations

import enum
import types
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Final, Literal, TypeVar, get_args, get_origin, get_type_hints

import msgspec

from elys.common.components.curve import KEY_WIDTH, MAX_KEYS, Curve
from elys.common.errors import ComponentError

Vec3 = tuple[float, float, float]
Quat = tuple[float, float, float, float]  # x y z w, unit length
Values = dict[str, Any]  # by name: numbers, booleans, texts and lists of numbers
Check = Callable[
    [str, Any], None
]  # where it stands and a value of the right kind; raises ComponentError for what is wrong


class Kind(enum.Enum):
    """What a field holds, and so how it is stored, written and edited."""

    FLOAT = "float"
    INT = "int"
    BOOL = "bool"
    VEC3 = "vec3"
    QUAT = "quat"
    COLOR = "color"  # linear RGB
    CHOICE = "choice"  # one of a few names
    TEXT = "text"
    ASSET = "asset"  # the name of a mesh, an image, ...
    ENTITY = "entity"  # another entity's id, 0 for none
    CURVE = "curve"  # a number over time, see curve.py; unit and range are the number's
    VALUES = "values"  # named values that only a script's file declares: a JSON object


class Naming(enum.Enum):
    """How a TEXT names clips, those of the Animation beside it, so that an editor can offer the ones there are."""

    CLIP = "clip"  # it is the name of one
    MIX = "mix"  # with numbers, see animation_texts.mix_of
    MARKERS = "markers"  # with instants, see animation_texts.markers_of


class Component(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What every component is: immutable values with defaults. Derive and decorate with `@component`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class About:
    """What a person and a widget need to know of a field; made by `about`."""

    text: str
    unit: str
    minimum: float | None
    maximum: float | None
    step: float
    kind: Kind | None
    dtype: str | None
    check: Check | None
    is_memory: bool
    names: Naming | None


def about(
    text: str,
    *,
    unit: str = "",
    minimum: float | None = None,
    maximum: float | None = None,
    step: float = 0.1,
    kind: Kind | None = None,
    dtype: str | None = None,
    check: Check | None = None,
    is_memory: bool = False,
    names: Naming | None = None,
) -> About:
    """Describes a field: a sentence for the tooltip, SI unit, inclusive range and the step of a drag.

    `kind` is only needed where the type does not tell (COLOR, ASSET, ENTITY); `dtype` overrides the storage (`"f4"`); `check`
    refuses values that are of the right kind and wrong all the same. `is_memory` is for what ticks write for themselves and for
    scripts: it stays in the simulation, where exact states keep it, and is neither told to readers nor shown to people. `names`
    says what a text names, so that people can choose it from a list.
    """
    return About(
        text=text,
        unit=unit,
        minimum=minimum,
        maximum=maximum,
        step=step,
        kind=kind,
        dtype=dtype,
        check=check,
        is_memory=is_memory,
        names=names,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class FieldDeclaration:
    """One field of a component, as every derivation reads it."""

    name: str
    kind: Kind
    default: Any
    text: str
    unit: str
    minimum: float | None
    maximum: float | None
    step: float
    choices: tuple[str, ...]
    dtype: str  # numpy dtype of one element
    width: int  # numbers that are stored of a value: 1, 3, 4, or those of all keys of a curve
    check: Check | None = None
    is_memory: bool = False
    names: Naming | None = None

    @property
    def elements(self) -> int:
        """How many parts of a value are edited one by one."""
        return 1 if self.kind is Kind.CURVE else self.width


@dataclass(frozen=True, slots=True, kw_only=True)
class ComponentDeclaration:
    """A component's name, its Struct, its docstring's first line and its fields in order."""

    name: str
    struct: type[Component]
    text: str
    fields: tuple[FieldDeclaration, ...]

    @property
    def told(self) -> tuple[FieldDeclaration, ...]:
        """The fields that readers of the scene know and people see: all but its memory."""
        return tuple(field for field in self.fields if not field.is_memory)

    def field(self, name: str) -> FieldDeclaration:
        """Raises ComponentError, naming the fields there are, if `name` is none of them."""
        for field in self.fields:
            if field.name == name:
                return field
        known = ", ".join(field.name for field in self.fields)
        raise ComponentError(f"{self.name} has no field '{name}'; it has {known}")


_STORAGE: Final[Mapping[Kind, tuple[str, int]]] = {
    Kind.FLOAT: ("f4", 1),
    Kind.INT: ("i4", 1),
    Kind.BOOL: ("?", 1),
    Kind.VEC3: ("f4", 3),
    Kind.QUAT: ("f4", 4),
    Kind.COLOR: ("f4", 3),
    Kind.CHOICE: ("u1", 1),
    Kind.TEXT: ("i4", 1),  # a row of the world's string table
    Kind.ASSET: ("i4", 1),  # likewise
    Kind.ENTITY: ("u4", 1),
    Kind.CURVE: ("f4", MAX_KEYS * KEY_WIDTH),
    Kind.VALUES: ("i4", 1),  # a row of the string table, as JSON
}

_registry: dict[str, ComponentDeclaration] = {}
C = TypeVar("C", bound=type[Component])


def component(struct: C) -> C:
    """Class decorator: makes a Component known under its class name to all five derivations."""
    declaration = declare(struct)
    known = _registry.get(declaration.name)
    if known is not None and known.struct.__module__ != struct.__module__:
        raise ComponentError(f"a component named {declaration.name} is declared in {known.struct.__module__} already")
    _registry[declaration.name] = declaration
    return struct


def forget(struct: type[Component]) -> None:
    """Takes a component out of the registry again (tests that declare their own)."""
    _registry.pop(struct.__name__, None)


def declarations() -> Mapping[str, ComponentDeclaration]:
    """All known components by name, in the order in which they were declared."""
    return types.MappingProxyType(_registry)


def declaration_of(component: str | type[Component] | Component) -> ComponentDeclaration:
    """The declaration of a component given by name, class or value; ComponentError if there is none."""
    if isinstance(component, str):
        name = component
    else:
        name = component.__name__ if isinstance(component, type) else type(component).__name__
    try:
        return _registry[name]
    except KeyError:
        known = ", ".join(_registry)
        raise ComponentError(f"there is no component '{name}'; known are {known}") from None


def declare(struct: type[Component]) -> ComponentDeclaration:
    """Reads a Component class; raises ComponentError where a field is not declared as it must be."""
    hints = get_type_hints(struct, include_extras=True)
    fields = []
    for info in msgspec.structs.fields(struct):
        default = info.default
        if default is msgspec.NODEFAULT and info.default_factory is not msgspec.NODEFAULT:
            default = info.default_factory()
        if default is msgspec.NODEFAULT:
            raise ComponentError(f"{struct.__name__}.{info.name} needs a default: every component can be added empty")
        fields.append(declare_field(struct.__name__, info.name, hints[info.name], default))
    text = (struct.__doc__ or "").strip().split("\n")[0]
    return ComponentDeclaration(name=struct.__name__, struct=struct, text=text, fields=tuple(fields))


def declare_field(owner: str, name: str, hint: Any, default: Any) -> FieldDeclaration:
    """One field of `owner` from its annotation; ComponentError where that does not say what it must."""
    where = f"{owner}.{name}"
    notes = [note for note in getattr(hint, "__metadata__", ()) if isinstance(note, About)]
    if get_origin(hint) is not Annotated or not notes:
        raise ComponentError(f"{where} must be declared as Annotated[type, about('...')]")
    note, value_type = notes[0], get_args(hint)[0]
    kind = note.kind or _kind_of(where, value_type)
    dtype, width = _STORAGE[kind]
    return FieldDeclaration(
        name=name,
        kind=kind,
        default=default,
        text=note.text,
        unit=note.unit,
        minimum=note.minimum,
        maximum=note.maximum,
        step=note.step,
        choices=get_args(value_type) if kind is Kind.CHOICE else (),
        dtype=note.dtype or dtype,
        width=width,
        check=note.check,
        is_memory=note.is_memory,
        names=note.names,
    )


def _kind_of(where: str, value_type: Any) -> Kind:
    if get_origin(value_type) is Literal:
        return Kind.CHOICE
    kinds: dict[Any, Kind] = {
        float: Kind.FLOAT,
        int: Kind.INT,
        bool: Kind.BOOL,
        str: Kind.TEXT,
        Vec3: Kind.VEC3,
        Quat: Kind.QUAT,
        Curve: Kind.CURVE,
        Values: Kind.VALUES,
    }
    if value_type in kinds:
        return kinds[value_type]
    raise ComponentError(f"{where} has type {value_type}; use float, int, bool, str, Vec3, Quat, Curve or Literal[...]")
