"""The fields that scripts declare, which the host is asked for as they are looked at."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

from elys.bus import topics
from elys.bus.messages.scripts import ScriptField, ScriptForm, ScriptFormRequest
from elys.bus.session import Session
from elys.common.components import ComponentDeclaration, FieldDeclaration, Kind, Script, declaration_of
from elys.common.errors import BusError
from elys.editor_node.scene_mirror import EditorScene

ASK_AGAIN: Final = 2.0  # [s] until one is asked for again that could not be told
_WIDTHS: Final = {Kind.VEC3: 3, Kind.COLOR: 3, Kind.QUAT: 4}


@dataclass(frozen=True, slots=True, kw_only=True)
class Form:
    """A script as an inspector shows it: its fields as a component's, or why there are none."""

    declaration: ComponentDeclaration
    problem: str = ""


class ScriptForms:
    """What is known of the scripts of a scene, by what their components name."""

    def __init__(
        self,
        session: Session,
        *,
        on_change: Callable[[], None] = lambda: None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """`on_change` is called when another is known."""
        self._session = session
        self._on_change = on_change
        self._clock = clock
        self._known: dict[str, Form] = {}
        self._asked: dict[str, float] = {}  # when, last
        session.on_link(lambda connected: self._asked.clear())

    def of(self, source: str) -> Form | None:
        """The form of a script; None while it is not known."""
        known, now = self._known.get(source), self._clock()
        is_due = source not in self._asked or now - self._asked[source] >= ASK_AGAIN
        if source and is_due and (known is None or known.problem):
            self._asked[source] = now
            self._session.start(self._ask(source))
        return known

    async def _ask(self, source: str) -> None:
        try:
            told = await self._session.request(topics.SCRIPT_FORM, ScriptFormRequest(source=source))
        except BusError:
            return  # a recording, or a host of before: the values are shown as they stand in the file
        form = form_from(told)
        if self._known.get(source) != form:
            self._known[source] = form
            self._on_change()


def form_from(told: ScriptForm) -> Form:
    """What was told as declarations; fields of kinds that this editor does not know are left out."""
    kinds = {kind.value for kind in Kind}
    fields = tuple(_declared(field) for field in told.fields if field.kind in kinds)
    struct = declaration_of("Script").struct
    return Form(
        declaration=ComponentDeclaration(name=told.name, struct=struct, text=told.text, fields=fields),
        problem=told.problem,
    )


def _declared(field: ScriptField) -> FieldDeclaration:
    kind = Kind(field.kind)
    return FieldDeclaration(
        name=field.name,
        kind=kind,
        default=tuple(field.default) if isinstance(field.default, list) else field.default,
        text=field.text,
        unit=field.unit,
        minimum=field.minimum,
        maximum=field.maximum,
        step=field.step,
        choices=field.choices,
        dtype="f8",
        width=_WIDTHS.get(kind, 1),
    )


def value_of(scene: EditorScene, script: Script, declared: FieldDeclaration) -> Any:
    """What a field is in a component's values, as its widget takes it; an entity's path is its id there."""
    value = script.values.get(declared.name, declared.default)
    if declared.kind is Kind.ENTITY:
        return entity_at(scene, value) if isinstance(value, str) else value
    return tuple(value) if isinstance(value, list) else value


def values_with(scene: EditorScene, script: Script, declared: FieldDeclaration, value: Any) -> dict[str, Any]:
    """The component's values with another value of a field; one that is its default is left out."""
    others = {name: known for name, known in script.values.items() if name != declared.name}
    if value == declared.default:
        return others
    written = "/".join(scene.path_of(value)) if declared.kind is Kind.ENTITY else value
    return {**others, declared.name: written}


def entity_at(scene: EditorScene, path: str) -> int:
    """The first entity at a path of names from the scene's root, as scripts find it; 0 if there is none."""
    found = [0]
    for name in path.split("/") if path else ():
        found = [child for entity in found for child in scene.children_of(entity) if scene.name_of(child) == name]
    return found[0] if found else 0
