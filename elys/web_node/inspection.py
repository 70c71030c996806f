"""What one browser's inspector shows: the components of an entity as they are now."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any, Final

from elys.bus.live_values import live_components
from elys.bus.mirror import MirrorUpdate, SceneMirror
from elys.common.components import Kind, declaration_of, declarations, values_of

PAUSE: Final = 0.2  # [s] between two tellings


class Inspection:
    """Follows one entity. `run` tells of it."""

    def __init__(self, mirror: SceneMirror, tell: Callable[..., None]) -> None:
        """`tell("entity", ...)` is called with what the entity is."""
        self._mirror = mirror
        self._tell = tell
        self._unlisten = mirror.listen(self._follow)
        self._told: dict[str, Any] = {}
        self._wake = asyncio.Event()
        self.entity = 0

    def inspect(self, entity: int) -> None:
        """From now on this one; 0 for none."""
        self.entity, self._told = entity, {}
        self._wake.set()

    def moved(self) -> None:
        """Hears that a state frame came."""
        if self.entity:
            self._wake.set()

    def close(self) -> None:
        """Follows no more."""
        self._unlisten()

    async def run(self) -> None:
        """Tells of the entity when it has changed, until cancelled."""
        while True:
            await self._wake.wait()
            self._wake.clear()
            told = content_of(self._mirror, self.entity)
            if told != self._told:
                self._told = told
                self._tell("entity", **told, revision=self._mirror.revision)
            await asyncio.sleep(PAUSE)

    def _follow(self, update: MirrorUpdate) -> None:
        if self.entity:
            self._wake.set()


def content_of(mirror: SceneMirror, entity: int) -> dict[str, Any]:
    """An entity as JSON; with only its id if it does not live."""
    found = mirror.entities.get(entity)
    if found is None:
        return {"entity": entity, "lives": False}
    components = {name: values_of(value) for name, value in live_components(mirror, entity).items()}
    meant = {
        values[field.name]
        for name, values in components.items()
        for field in declaration_of(name).fields
        if field.kind is Kind.ENTITY
    }
    return {
        "entity": entity,
        "lives": True,
        "name": found.name,
        "enabled": found.enabled,
        "prefab": found.prefab.replace("\\", "/").rpartition("/")[2],
        "components": components,
        "names": {str(other): mirror.entities[other].name for other in meant if other in mirror.entities},
    }


def declared() -> list[dict[str, Any]]:
    """All components there are, as a page needs them for its fields."""
    return [
        {
            "name": declaration.name,
            "text": declaration.text,
            "fields": [
                {
                    "name": field.name,
                    "kind": field.kind.value,
                    "text": field.text,
                    "unit": field.unit,
                    "minimum": field.minimum,
                    "maximum": field.maximum,
                    "step": field.step,
                    "choices": field.choices,
                    "default": field.default,
                }
                for field in declaration.told
            ],
        }
        for declaration in declarations().values()
    ]
