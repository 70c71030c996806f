"""Who uses which asset of a running scene, and what of it nobody has."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Iterable
from functools import lru_cache
from typing import Final, NamedTuple

from elys.bus.asset_service import AssetOffer
from elys.bus.mirror import SceneMirror
from elys.common.assets.primitives import is_primitive
from elys.common.assets.store import is_reference
from elys.common.assets.texture import split_texture
from elys.common.components import Kind, declaration_of, declarations

PREFAB: Final = "prefab"  # stands for a component in a Use of a whole file
_AT_ONCE: Final = 16  # questions to the host
_LOOK_SHARE: Final = 0.02  # of the time that a glance may spend on looking through the scene


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
    """All uses in a scene by asset, looked for again only when the scene is another. Files of prefabs are named by their path."""

    def __init__(self, mirror: SceneMirror, *, clock: Callable[[], float] = time.perf_counter) -> None:
        self._mirror = mirror
        self._clock = clock
        self._seen = (-1, -1)
        self._uses: dict[str, list[Use]] = {}
        self._next_look = 0.0  # [s] by the clock

    @property
    def uses(self) -> dict[str, list[Use]]:
        """By content reference or path."""
        now = (self._mirror.epoch, self._mirror.sequence)
        if now != self._seen:
            start = self._clock()
            self._seen, self._uses = now, all_uses(self._mirror)
            end = self._clock()
            self._next_look = end + (end - start) / _LOOK_SHARE
        return self._uses

    def glance(self, assets: Iterable[str]) -> list[Use]:
        """Of any of the assets, each once, for who shows them each frame: of a large scene that changes all the time a while old."""
        uses = self.uses if self._clock() >= self._next_look else self._uses
        return list(dict.fromkeys(use for asset in assets for use in uses.get(asset, ())))


def all_uses(mirror: SceneMirror) -> dict[str, list[Use]]:
    """What every asset field of a scene names: content references without how they are laid, meshes, files; no empty ones."""
    found: dict[str, list[Use]] = {}
    fields_of = asset_fields()
    for entity in mirror.entities.values():
        if entity.prefab:
            found.setdefault(entity.prefab, []).append(Use(entity.id, PREFAB))
        for name, component in entity.components.items():
            for field in fields_of.get(name, ()):
                value = getattr(component, field)
                if value:
                    asset, options = split_texture(value)
                    found.setdefault(asset, []).append(Use(entity.id, name, field, options))
    return found


def uses_of(mirror: SceneMirror, asset: str) -> list[Use]:
    """Of one asset."""
    return all_uses(mirror).get(asset, [])


@lru_cache(maxsize=1)
def asset_fields() -> dict[str, tuple[str, ...]]:
    """The fields of each component that name assets."""
    found = {
        name: tuple(f.name for f in declaration_of(name).fields if f.kind is Kind.ASSET) for name in declarations()
    }
    return {name: fields for name, fields in found.items() if fields}


async def missing_assets(mirror: SceneMirror, offer: AssetOffer) -> list[MissingAsset]:
    """What the scene names and nobody can serve, in the order in which it is named.

    Raises:
        BusError: the host does not say what it has.
    """
    uses = all_uses(mirror)
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
    return is_primitive(asset) or all(use.component in (PREFAB, "Script") for use in users)
