"""A level that a person made: a scene's file, saved from the editor, and read again for each race."""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import msgspec

from elys.common.assets.scripts import decode_script, only_class
from elys.common.assets.store import PREFIX, AssetStore, is_reference, reference_of
from elys.common.errors import ElysError
from elys.common.scene import SCENE_SUFFIX, EntityRecord, OpenedScene, open_scene
from elys.samples.game.kit import Medals
from elys.samples.game.levels import with_values

NEEDED: Final = {"Race": "clock", "Gate": "gate", "Ball": "ball"}  # behaviours of elys:game
_TOLD: Final = frozenset({"Menu", "Hud", "Ball"})  # who is told something before a race, and what:
_TOLD_VALUES: Final = frozenset(
    {"levels", "level", "settings", "result", "is_open", "players", "best", "look_speed", "is_followed"}
)
_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneLevel:
    """Beside `samples.game.levels.Level`; nobody knows a line along which it can be driven.

    Its times are of the level as it is: with any change it has a board of its own, for they cannot be compared.
    """

    name: str
    title: str
    board: str
    medals: Medals
    path: Path
    seats: int  # balls in it
    opened: OpenedScene

    @classmethod
    def read(cls, path: Path, assets: AssetStore) -> SceneLevel:
        """Raises ElysError where the file cannot be opened, or nobody could race in it."""
        opened = open_scene(path, assets)
        behaviours = [_behaviour(record, assets) for record in opened.records]
        count = Counter(behaviours)
        races = [_values(record) for record, name in zip(opened.records, behaviours, strict=True) if name == "Race"]
        missing = [f"{noun} (`elys:game`, {name})" for name, noun in NEEDED.items() if not count[name]]
        if missing or len(races) > 1:
            wrong = f"it has no {' and no '.join(missing)}" if missing else f"it has {len(races)} clocks"
            raise ElysError(
                f"{path} is no level: {wrong}. Begin with one that ELYS has: `elys run meadow` opens it in the editor, "
                "where it is saved under another name"
            )
        stem = opened.path.name.removesuffix(SCENE_SUFFIX).removesuffix(".json")
        return cls(
            name=opened.path.name.replace("|", "/"),
            title=" ".join(opened.name.replace("|", "/").split()) or stem,
            board=f"{stem}-{_digest(opened, behaviours)}",
            medals=Medals(**{medal: races[0][medal] for medal in ("gold", "silver", "bronze") if medal in races[0]}),
            path=opened.path,
            seats=count["Ball"],
            opened=opened,
        )

    def renewed(self, assets: AssetStore) -> SceneLevel:
        """As its file is now; as it was, where that cannot be raced in at the moment, which is said."""
        try:
            return SceneLevel.read(self.path, assets)
        except ElysError as error:
            _log.error("%s; the race is that of before", error)
            return self

    def open(
        self,
        assets: AssetStore,
        *,
        players: int = 1,
        values: Mapping[str, Mapping[str, Any]] = MappingProxyType({}),
    ) -> tuple[OpenedScene, None]:
        """As `Level.open` does; its contents are in the store since it was read."""
        if players > self.seats:
            raise ElysError(f"{self.path} has balls for {self.seats}, not for {players}: give --players {self.seats}")
        return msgspec.structs.replace(self.opened, records=with_values(self.opened.records, values)), None


def _behaviour(record: EntityRecord, assets: AssetStore) -> str:
    """The class of the script that an entity runs, "" where it runs none."""
    source = str((record.components.get("Script") or {}).get("source", ""))
    if not record.enabled or not is_reference(source):
        return ""
    bundle = decode_script(assets.get(source))
    return bundle.behaviour or only_class(bundle.files[bundle.main])


def _values(record: EntityRecord) -> dict[str, Any]:
    return dict((record.components.get("Script") or {}).get("values", {}))


def _digest(opened: OpenedScene, behaviours: list[str]) -> str:
    """What names a level's content: everything in it but what each race is told, and where its prefabs lie."""
    records = [
        msgspec.structs.replace(_untold(record) if name in _TOLD else record, prefab="")
        for record, name in zip(opened.records, behaviours, strict=True)
    ]
    data = msgspec.json.encode((records, opened.settings), order="sorted")
    return reference_of(data).removeprefix(PREFIX)[:8]


def _untold(record: EntityRecord) -> EntityRecord:
    script = record.components["Script"]
    values = {key: value for key, value in _values(record).items() if key not in _TOLD_VALUES}
    return msgspec.structs.replace(record, components={**record.components, "Script": {**script, "values": values}})
