"""The levels: where their roads lead, what stands in the way, and how fast one should be."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from elys.common.assets.store import AssetStore
from elys.common.scene import EntityNode, OpenedScene, SceneDocument, SceneSettings, expand
from elys.samples.entities import sun
from elys.samples.game import kit
from elys.samples.game.course import Course, Place
from elys.samples.game.kit import Medals


@dataclass(frozen=True, slots=True)
class Layout:
    """A level as it was laid out: its scene, and the line along which it can be driven, for who drives by himself."""

    document: SceneDocument
    line: tuple[Place, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Level:
    """One level."""

    name: str
    title: str
    medals: Medals
    lay_out: Callable[[AssetStore, Medals, int], Layout]

    def build(self, assets: AssetStore, players: int = 1) -> Layout:
        """The level for so many players, its meshes in the store."""
        return self.lay_out(assets, self.medals, players)


def meadow(assets: AssetStore, medals: Medals, players: int) -> Layout:
    """A gentle beginning: bends, one hill, one jump, and bricks that stand in the short way."""
    course = Course(width=7.0, height=8.0)
    start = course.straight(14.0).here
    course.straight(18.0)
    gates = [course.turn(90.0, radius=16.0, bank=14.0).here]
    course.straight(12.0, climb=2.5).turn(-60.0, radius=18.0, bank=12.0)
    gates.append(course.straight(10.0).here)
    bricks = course.straight(12.0).here
    course.straight(10.0).turn(-120.0, radius=15.0, climb=-2.0, bank=18.0)
    gates.append(course.straight(16.0).here)
    course.ramp(9.0, climb=1.6).gap(7.0, drop=1.2)
    gates.append(course.straight(22.0).here)
    course.turn(90.0, radius=13.0, bank=16.0)
    gates.append(course.straight(20.0).here)
    course.straight(14.0)
    things = [kit.wall_of_boxes(bricks, columns=5, rows=3)]
    return _laid_out("Meadow", assets, medals, players, course, start, gates, things)


def _laid_out(
    name: str,
    assets: AssetStore,
    medals: Medals,
    players: int,
    course: Course,
    start: Place,
    gates: list[Place],
    things: list[EntityNode],
) -> Layout:
    entities = [
        sun((-0.5, -0.75, -0.35), intensity=3.4),
        EntityNode(name="Sky", components={"Transform": {}, "Environment": {"kind": "sky", "turbidity": 2.6}}),
        kit.race(medals),
        kit.controls(),
        kit.menu(),
        kit.road(course, assets),
        *(kit.gate(place, number, width=course.width) for number, place in enumerate(gates, 1)),
        *things,
    ]
    for number in range(1, players + 1):
        side = (number - (players + 1) / 2.0) * 1.6
        entities += [*kit.player(start, number, assets, side=side), kit.hud(number)]
    return Layout(SceneDocument(name=name, settings=SceneSettings(), entities=entities), tuple(course.stations))


LEVELS: Final[Mapping[str, Level]] = {
    level.name: level
    for level in (
        Level(name="meadow", title="Meadow", medals=Medals(gold=24.0, silver=30.0, bronze=45.0), lay_out=meadow),
    )
}


def open_level(level: Level, assets: AssetStore, *, players: int = 1) -> tuple[OpenedScene, Layout]:
    """A level as a scene that can be loaded, its meshes and scripts in the store; and how it was laid out."""
    layout = level.build(assets, players)
    document = layout.document
    opened = OpenedScene(
        name=document.name,
        path=Path(f"{level.name}.scene.json").absolute(),
        settings=document.settings,
        records=expand(document, directory=kit.SCRIPTS, assets=assets),
    )
    return opened, layout
