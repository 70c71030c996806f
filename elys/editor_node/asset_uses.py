"""Who uses which asset of a running scene, and what of it nobody has."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterable
from functools import lru_cache
from operator import attrgetter
from typing import Any, Final, NamedTuple

from elys.bus.asset_service import AssetOffer
from elys.bus.mirror import MirrorEntity, SceneMirror
from elys.common.assets.primitives import PRIMITIVES
from elys.common.assets.store import is_reference
from elys.common.assets.texture import split_texture
from elys.common.components import Kind, declaration_of, declarations

PREFAB: Final = "prefab"  # stands for a component in a Use of a whole file
_AT_ONCE: Final = 16  # questions to the host
_PIECE: Final = 500  # entities that are looked through between two looks at what else is to be done


class Use(NamedTuple):
    """A field of an entity that names an asset; `options` is how a texture is laid. A prefab's instance has no field."""

    entity: int
    component: str
    field: str = ""
    options: str = ""


class MissingAsset(NamedTuple):
    """Content that the scene names and the host has not, and who names it."""

    reference: str
    uses: tuple[Use, ...]


class UseIndex:
    """All uses in a scene by asset, looked for again only when the scene is another, and in pieces that hold up no frame.

    Files of prefabs are named by their path; meshes that are built in are left out.
    """

    def __init__(self, mirror: SceneMirror) -> None:
        self._mirror = mirror
        self._seen = (-1, -1)
        self._uses: dict[str, list[Use]] = {}

    @property
    def is_fresh(self) -> bool:
        """Whether the scene is the one that was looked through last."""
        return self._seen == (self._mirror.epoch, self._mirror.sequence)

    async def fresh(self) -> dict[str, list[Use]]:
        """The uses now. What changes while it looks is looked for the next time."""
        if not self.is_fresh:
            seen = (self._mirror.epoch, self._mirror.sequence)
            uses: dict[str, list[Use]] = {}
            entities = list(self._mirror.entities.values())
            for start in range(0, len(entities), _PIECE):
                _gather(entities[start : start + _PIECE], uses)
                await asyncio.sleep(0)
            self._seen, self._uses = seen, uses
        return self._uses

    def known(self, assets: Iterable[str]) -> list[Use]:
        """Of any of the assets, each once, as of the last look."""
        return list(dict.fromkeys(use for asset in assets for use in self._uses.get(asset, ())))


def _gather(entities: Iterable[MirrorEntity], found: dict[str, list[Use]]) -> None:
    readers = _readers()
    for entity in entities:
        if entity.prefab:
            found.setdefault(entity.prefab, []).append(Use(entity.id, PREFAB))
        for name, component in entity.components.items():
            reader = readers.get(name)
            if reader is None:
                continue
            fields, read = reader
            values = read(component)
            for field, value in zip(fields, values if len(fields) > 1 else (values,), strict=True):
                if value and value not in PRIMITIVES:
                    asset, options = split_texture(value)
                    found.setdefault(asset, []).append(Use(entity.id, name, field, options))


@lru_cache(maxsize=1)
def _readers() -> dict[str, tuple[tuple[str, ...], Callable[[Any], Any]]]:
    return {name: (fields, attrgetter(*fields)) for name, fields in asset_fields().items()}


@lru_cache(maxsize=1)
def asset_fields() -> dict[str, tuple[str, ...]]:
    """The fields of each component that name assets."""
    found = {
        name: tuple(f.name for f in declaration_of(name).fields if f.kind is Kind.ASSET) for name in declarations()
    }
    return {name: fields for name, fields in found.items() if fields}


async def missing_assets(index: UseIndex, offer: AssetOffer) -> list[MissingAsset]:
    """What the scene names and nobody can serve, in the order in which it is named.

    Raises:
        BusError: the host does not say what it has.
    """
    uses = await index.fresh()
    content = [asset for asset in uses if is_reference(asset)]
    there: dict[str, bool] = {}
    for start in range(0, len(content), _AT_ONCE):
        some = content[start : start + _AT_ONCE]
        there.update(zip(some, await asyncio.gather(*(offer.is_there(asset) for asset in some)), strict=True))
    return [MissingAsset(asset, tuple(users)) for asset, users in uses.items() if not _is_had(asset, users, there)]


def _is_had(asset: str, users: list[Use], there: dict[str, bool]) -> bool:
    if asset in there:
        return there[asset]
    # Scripts are files of the host's; a prefab is only where its entities came from.
    return all(use.component in (PREFAB, "Script") for use in users)
