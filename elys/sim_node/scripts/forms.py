"""What an inspector is told of a script's fields."""

from __future__ import annotations

import inspect
from typing import TYPE_CHECKING

from elys.bus.messages.scripts import ScriptField, ScriptForm
from elys.common.components import Script
from elys.common.components.declaration import FieldDeclaration
from elys.common.errors import RequestError, ScriptError
from elys.common.ids import Entity

if TYPE_CHECKING:
    from elys.sim_node.scripts.runner import Scripts


def form_of(scripts: Scripts, source: str) -> ScriptForm:
    """The fields of a script that an entity carries; it is loaded if it was not yet, as it will be anyhow.

    Raises:
        RequestError: nobody carries it. Whoever asks could otherwise have anything run.
    """
    world = scripts.simulation.world
    carriers = world.query(Script).entities.tolist()
    if not any(world.get(Entity(entity), Script).source == source for entity in carriers):
        raise RequestError("no entity of the scene carries that script")
    try:
        script = scripts.loaded(source)
    except ScriptError as error:
        return ScriptForm(problem=str(error))
    text = (inspect.getdoc(script.behaviour) or "").partition("\n")[0]
    return ScriptForm(name=script.name, text=text, fields=tuple(map(_field, script.fields.values())))


def _field(declared: FieldDeclaration) -> ScriptField:
    return ScriptField(
        name=declared.name,
        kind=declared.kind.value,
        default=declared.default,
        text=declared.text,
        unit=declared.unit,
        minimum=declared.minimum,
        maximum=declared.maximum,
        step=declared.step,
        choices=declared.choices,
    )
