"""The levels: where their roads lead, what stands in the way, and how fast one should be."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import msgspec
import numpy as np
from numpy.typing import NDArray

from elys.common.assets.store import AssetStore
from elys.common.errors import SceneError
from elys.common.made_contents import keep_made_contents
from elys.common.scene import (
    EntityNode,
    EntityRecord,
    OpenedScene,
    SceneDocument,
    SceneSettings,
    collapse,
    expand,
    write_scene,
)
from elys.common.scene_files import PIECES_FOLDER
from elys.samples.game import kit, scenery
from elys.samples.game.course import Course, Look, Place
from elys.samples.game.kit import Daylight, Medals

STONE: Final = Look(deck=(0.34, 0.30, 0.25), line=(0.62, 0.57, 0.48), curb=(0.60, 0.34, 0.05), side=(0.20, 0.16, 0.13))
STEEL: Final = Look(deck=(0.20, 0.23, 0.28), line=(0.60, 0.66, 0.74), curb=(0.05, 0.35, 0.55), side=(0.07, 0.08, 0.11))
GRASS, SAND, ASPHALT = (0.12, 0.22, 0.06), (0.34, 0.24, 0.15), (0.05, 0.06, 0.08)
MORNING: Final = Daylight(sky_color=(0.85, 1.0, 1.1))
HAZE: Final = Daylight(direction=(0.55, -0.5, -0.45), sun_color=(1.0, 0.86, 0.66), turbidity=5.0, sun=4.0, sky=0.55)
EVENING: Final = Daylight(direction=(-0.5, -0.22, -0.75), sun_color=(1.0, 0.70, 0.45), turbidity=3.0, sky=0.46)


@dataclass(frozen=True, slots=True)
class Ferry:
    """A platform that leads over a gap: between which stations, and where its middle waits at either edge."""

    name: str
    station: int  # the last before the gap
    near: NDArray[np.float64]
    far: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Layout:
    """A level as it was laid out: its scene, and the line along which it can be driven, for who drives by himself; and the one
    over its board, if it has one.
    """

    document: SceneDocument
    line: tuple[Place, ...]
    ferries: tuple[Ferry, ...] = ()
    shortcut: tuple[Place, ...] = ()

    def by_shortcut(self) -> Layout:
        """The same, to be driven over the board, where no ferry is waited for."""
        return replace(self, line=self.shortcut, ferries=())


@dataclass(frozen=True, slots=True, kw_only=True)
class Level:
    """One level."""

    name: str
    title: str
    about: str  # what is in the way
    medals: Medals
    lay_out: Callable[[AssetStore, Medals, int], Layout]

    @property
    def board(self) -> str:
        """What its times are kept under."""
        return self.name

    @property
    def seats(self) -> int:
        """How many may race in it."""
        return len(kit.PLAYER_COLORS)

    def renewed(self, assets: AssetStore) -> Level:
        """As it is now: it never changes."""
        return self

    def open(
        self,
        assets: AssetStore,
        *,
        players: int = 1,
        values: Mapping[str, Mapping[str, Any]] = MappingProxyType({}),
    ) -> tuple[OpenedScene, Layout]:
        """The level as a scene that can be loaded, its meshes and scripts in the store; and how it was laid out.

        `values` are laid over those of the scripts of entities at the top, by their names.
        """
        layout = self.lay_out(assets, self.medals, players)
        opened = OpenedScene(
            name=layout.document.name,
            path=Path(f"{self.name}.scene.json").absolute(),
            settings=layout.document.settings,
            records=with_values(expand(layout.document, directory=PIECES_FOLDER, assets=assets), values),
        )
        return opened, layout

    def write(self, path: Path) -> None:
        """As a scene file, its meshes in a folder beside it; SceneError where one cannot be written."""
        assets = AssetStore()
        opened, _ = self.open(assets)
        if not path.absolute().parent.is_dir():
            raise SceneError(f"{path} cannot be written: there is no folder {path.parent}")
        keep_made_contents(opened.records, path, assets)
        directory = path.absolute().parent
        write_scene(
            collapse(opened.records, name=self.title, settings=opened.settings, directory=directory, assets=assets),
            path,
        )


def with_values(records: list[EntityRecord], values: Mapping[str, Mapping[str, Any]]) -> list[EntityRecord]:
    """Records of which those at the top have other values of their scripts, by their names."""
    return [
        msgspec.structs.replace(
            record,
            components={
                **record.components,
                "Script": {**script, "values": {**script.get("values", {}), **values[record.name]}},
            },
        )
        if record.parent < 0 and record.name in values and (script := record.components.get("Script"))
        else record
        for record in records
    ]


def meadow(assets: AssetStore, medals: Medals, players: int) -> Layout:
    """A gentle beginning: bends, one hill, one jump, and bricks that stand in the way."""
    course = Course(width=7.0, height=8.0)
    start = course.straight(14.0).here
    course.straight(18.0)
    course.turn(90.0, radius=16.0, bank=14.0).gate()
    course.straight(12.0, climb=2.5).turn(-60.0, radius=18.0, bank=12.0)
    course.straight(10.0).gate()
    bricks = course.straight(12.0).here
    course.straight(10.0).turn(-120.0, radius=15.0, climb=-2.0, bank=18.0)
    course.straight(16.0).gate()
    course.ramp(9.0, climb=1.6).gap(7.0, drop=1.2)
    course.straight(22.0).gate()
    course.turn(90.0, radius=13.0, bank=16.0)
    course.straight(20.0).gate()
    course.straight(14.0)
    site = scenery.Site(course, depth=6.0)
    things = [
        kit.wall_of_boxes(bricks, columns=5, rows=3),
        scenery.plain(site, GRASS),
        scenery.hills(site, assets, seed=11, color=GRASS),
        scenery.forest(site, seed=1, trees=90),
    ]
    return _laid_out("Meadow", assets, medals, players, course, start, things, light=MORNING)


def quarry(assets: AssetStore, medals: Medals, players: int) -> Layout:
    """A ferry over a pit, beside which a board saves the waiting; bars that sweep the road; a wind that throws far."""
    course = Course(width=6.0, height=10.0, look=STONE)
    start = course.straight(10.0).here
    course.straight(16.0)
    course.turn(-90.0, radius=12.0, bank=14.0).gate()
    near = course.straight(14.0).here
    at = course.station
    far = course.gap(18.0).here
    ferry = kit.ferry("Ferry", near, far)
    line = Ferry("Ferry", at, *kit.docks(near, far, length=4.0))
    course.plank(near.at(right=-2.3, forward=-4.0), far.at(right=-2.3, forward=4.0), width=1.2)
    course.straight(12.0).gate()
    bars = [kit.bar("Bar 1", course.straight(8.0).here, length=5.2, speed=1.5)]
    bars.append(kit.bar("Bar 2", course.straight(11.0).here, length=5.2, speed=-1.8))
    course.straight(10.0).turn(110.0, radius=13.0, climb=3.0, bank=16.0)
    course.straight(6.0).gate()
    bricks = course.straight(12.0).here
    course.straight(8.0).turn(70.0, radius=14.0, bank=14.0)
    wind = kit.boost("Wind", course.straight(8.0).here)
    course.straight(4.0).ramp(9.0, climb=1.8).gap(12.0, drop=2.0)
    course.straight(26.0).gate()
    course.turn(-90.0, radius=14.0, bank=16.0)
    course.straight(14.0).gate()
    course.straight(14.0)
    site = scenery.Site(course, depth=6.0)
    things = [
        *(ferry, *bars, wind),
        kit.wall_of_boxes(bricks, columns=4, rows=4),
        scenery.plain(site, SAND),
        scenery.terraces(site, assets, seed=12, color=SAND),
        scenery.forest(site, seed=2, trees=40),
    ]
    board = course.way_over(0, leaves=at - 8, joins=at + 9)  # 4 m before and after the edges
    return _laid_out(
        "Quarry", assets, medals, players, course, start, things, light=HAZE, ferries=(line,), shortcut=board
    )


def skyline(assets: AssetStore, medals: Medals, players: int) -> Layout:
    """High and narrow, without curbs: hairpins, gaps to be jumped, and a board straight ahead where the road goes round."""
    course = Course(width=5.0, height=30.0, curb=0.0, look=STEEL)
    start = course.straight(8.0).here
    course.straight(14.0)
    course.turn(60.0, radius=14.0, bank=12.0)
    course.straight(2.0).gate()
    # Who falls begins again at the gate: there is room for a run. A jump at full speed goes 15 m.
    course.straight(6.0).gap(3.0).straight(16.0)
    # Flat, so that the board lies level with the road where it leaves it and where it comes back.
    fork, leaves = course.here, course.station
    course.turn(60.0, radius=11.0).turn(-120.0, radius=11.0).turn(60.0, radius=11.0)
    course.plank(fork.at(right=1.4, forward=-3.0), course.here.at(right=1.4, forward=3.0), width=1.8)
    joins = course.station
    course.straight(8.0).turn(-180.0, radius=12.0, climb=-3.0, bank=20.0)
    course.straight(6.0).gate()
    course.widen(3.2).straight(14.0, climb=-2.0)
    course.widen(5.0, curb=0.4).turn(150.0, radius=11.0, bank=22.0)
    course.straight(8.0).gate()
    bar = kit.bar("Bar", course.straight(9.0).here, length=4.4, speed=1.25)
    wind = kit.boost("Wind", course.straight(12.0).here)
    course.straight(4.0).ramp(10.0, climb=2.2).gap(14.0, drop=3.0)
    course.widen(7.0).straight(28.0).gate()
    course.widen(5.0, curb=0.0).turn(-90.0, radius=13.0, climb=-2.0, bank=16.0).straight(6.0)
    course.gap(3.5, drop=0.4).straight(15.0)
    course.turn(60.0, radius=14.0, bank=10.0).straight(12.0).gate()
    course.straight(14.0)
    site = scenery.Site(course, depth=26.0)
    things = [bar, wind, scenery.plain(site, ASPHALT), scenery.city(site, assets, seed=3)]
    board = course.way_over(0, leaves=leaves - 6, joins=joins + 6)  # 3 m before and after
    return _laid_out("Skyline", assets, medals, players, course, start, things, light=EVENING, shortcut=board)


def _laid_out(
    name: str,
    assets: AssetStore,
    medals: Medals,
    players: int,
    course: Course,
    start: Place,
    things: list[EntityNode],
    *,
    light: Daylight,
    ferries: tuple[Ferry, ...] = (),
    shortcut: tuple[Place, ...] = (),
) -> Layout:
    entities = [
        *light.entities(),
        kit.race(medals),
        kit.controls(),
        kit.road(course, assets),
        *(kit.gate(one.place, number, width=one.width) for number, one in enumerate(course.gates, 1)),
        *things,
    ]
    for number in range(1, players + 1):
        side = (number - (players + 1) / 2.0) * 1.6
        entities += [*kit.player(start, number, assets, side=side), kit.hud(number)]
    entities.append(kit.menu())  # the last is drawn over all others
    document = SceneDocument(name=name, settings=SceneSettings(), entities=entities)
    return Layout(document, tuple(course.stations), ferries, shortcut)


LEVELS: Final[Mapping[str, Level]] = {
    level.name: level
    for level in (
        Level(
            name="meadow",
            title="Meadow",
            about="Bends, a wall of bricks, one jump",
            medals=Medals(gold=20.0, silver=26.0, bronze=45.0),
            lay_out=meadow,
        ),
        Level(
            name="quarry",
            title="Quarry",
            about="A ferry, bars that sweep the road, a wind that throws far",
            medals=Medals(gold=30.0, silver=45.0, bronze=75.0),
            lay_out=quarry,
        ),
        Level(
            name="skyline",
            title="Skyline",
            about="Narrow roads without curbs, gaps, a board where the road goes round",
            medals=Medals(gold=29.0, silver=40.0, bronze=70.0),
            lay_out=skyline,
        ),
    )
}
