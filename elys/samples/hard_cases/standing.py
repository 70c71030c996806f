"""Things that must stay as they are: columns of unequal masses, wedges, dice on a mountain, what lies for an hour."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import Any, Final

import numpy as np

from elys.common.scene import SceneDocument
from elys.samples.entities import PALETTE, STONE
from elys.samples.hard_cases.case import CaseMeasure, CaseRun, HardCase, always
from elys.samples.hard_cases.measures import drift_under, moved_under, none_fallen, overlap_under
from elys.samples.hard_cases.scenery import (
    IRON,
    about_z,
    fixture,
    frame,
    ground,
    part,
    scene,
    solid,
)

Array = np.ndarray[Any, Any]

# ---------------------------------------------------------------- columns of unequal masses


def ratio_tower(*, heavy_on_top: bool) -> SceneDocument:
    """Four cubes of 1, 10, 100 and 1000 kg."""
    masses = [1.0, 10.0, 100.0, 1000.0]
    cubes = [
        solid(
            f"Cube {level + 1}",
            "box",
            position=(0.0, level + 0.5, 0.0),
            mass=mass,
            color=(PALETTE[7], PALETTE[2], PALETTE[1], PALETTE[0])[round(math.log10(mass))],
        )
        for level, mass in enumerate(masses if heavy_on_top else masses[::-1])
    ]
    title = "Masses that grow upward" if heavy_on_top else "Masses that grow downward"
    return scene(title, [ground(), *cubes], eye=(4.0, 3.5, 7.5), target=(0.0, 1.9, 0.0))


# ---------------------------------------------------------------- wedge

_FLANK: Final = math.radians(5.0)  # of the wedge and of the walls, from the vertical
_WEDGE_HEIGHT: Final = 1.0  # [m]
_WEDGE_WIDTH: Final = 0.4  # [m] in the middle


def wedge() -> SceneDocument:
    """A wedge of 100 kg between two walls that lean outward by 5 degrees, without friction."""
    flank = []
    lean = about_z(-_FLANK), about_z(_FLANK)
    for side, turn in zip((1.0, -1.0), lean, strict=True):
        # A box whose outer face is a flank: it passes through (side * width / 2, 0).
        outward = np.array([side * math.cos(_FLANK), -math.sin(_FLANK)])
        center = np.array([side * 0.5 * _WEDGE_WIDTH, 0.0]) - 0.1 * outward
        flank.append(
            part(
                f"Flank {'right' if side > 0 else 'left'}",
                size=(0.2, _WEDGE_HEIGHT, 0.6),
                position=(*center, 0.0),
                rotation=turn,
                color=PALETTE[0],
                friction=0.0,
            )
        )
    walls = []
    for side, turn in zip((1.0, -1.0), lean, strict=True):
        outward = np.array([side * math.cos(_FLANK), -math.sin(_FLANK)])
        center = np.array([side * 0.5 * _WEDGE_WIDTH, 2.0]) + 0.5 * outward
        walls.append(
            fixture(
                f"Wall {'right' if side > 0 else 'left'}",
                size=(1.0, 3.0, 1.2),
                position=(*center, 0.0),
                rotation=turn,
                friction=0.0,
            )
        )
    body = frame("Wedge", position=(0.0, 2.0, 0.0), mass=100.0, children=flank)
    return scene("Wedge", [ground(), *walls, body], eye=(1.2, 3.6, 6.0), target=(0.0, 1.9, 0.0))


# ---------------------------------------------------------------- tiny on huge

_TINY: Final = 0.01  # [m]
_TINY_COUNT: Final = 5
_HUGE: Final = 1000.0  # [m]
_TINY_MISS: Final = (
    "contacts give way by up to 1.1 mm whatever the size of what they carry (PhysicsSettings.contact_overlap)"
)


def tiny_on_huge() -> SceneDocument:
    """A stack of five cubes of 1 cm, 2.5 g each, on a cube of 1 km."""
    huge = fixture("Huge", size=(_HUGE,) * 3, position=(0.0, -0.5 * _HUGE, 0.0))
    tiny = [
        solid(
            f"Tiny {level + 1}",
            "box",
            size=(_TINY,) * 3,
            position=(0.0, (level + 0.5) * _TINY, 0.0),
            mass=0.0025,
            color=PALETTE[level],
        )
        for level in range(_TINY_COUNT)
    ]
    document = scene("Tiny on huge", [huge, *tiny], eye=(0.06, 0.06, 0.13), target=(0.0, 0.024, 0.0))
    view = next(entity for entity in document.entities if entity.name == "Camera")
    view.components["Camera"] = {**(view.components["Camera"] or {}), "near": 0.005}
    return document


# ---------------------------------------------------------------- an hour


def hour_at_rest() -> SceneDocument:
    """A table of a plank on two blocks, with three cubes and a ball on it."""
    wood, iron = PALETTE[2], IRON
    bodies = [
        solid("Block left", "box", size=(0.4, 0.6, 0.6), position=(-0.9, 0.3, 0.0), mass=4.0, color=STONE),
        solid("Block right", "box", size=(0.4, 0.6, 0.6), position=(0.9, 0.3, 0.0), mass=4.0, color=STONE),
        solid("Plank", "box", size=(2.4, 0.1, 0.6), position=(0.0, 0.65, 0.0), mass=3.0, color=wood),
        *[
            solid(f"Cube {n + 1}", "box", size=(0.3,) * 3, position=(-0.7, 0.85 + 0.3 * n, 0.0), color=PALETTE[n])
            for n in range(3)
        ],
        solid(
            "Ball",
            "sphere",
            size=(0.4,) * 3,
            position=(0.6, 0.9, 0.0),
            color=iron,
            metallic=1.0,
            roughness=0.3,
            collider={"rolling_friction": 1e-3},
        ),
    ]
    return scene("An hour at rest", [ground(), *bodies], eye=(2.0, 1.9, 4.4), target=(0.0, 0.75, 0.0))


def _all_drift(run: CaseRun) -> float:
    moved = run.motion.position - run.motion.position[0]
    return 1000.0 * float(np.linalg.norm(moved, axis=2).max())


_HOUR: Final = HardCase(
    name="hour-at-rest",
    title="a laden plank on two blocks, for an hour, never asleep",
    difficulty="216,000 steps: what creeps by a micrometre a second has gone 4 mm",
    answer="nothing moves, but for the tenths of a millimetre by which contacts give way at first",
    build=always(hour_at_rest),
    duration=3600.0,
    measures=(CaseMeasure(name="drift", unit="mm", bound=1.0, of=_all_drift),),
    picture_time=10.0,
    stride=60,
    sleeping=False,
)


STANDING_CASES: Final = (
    HardCase(
        name="ratio-up",
        title="1, 10, 100 and 1000 kg, each on the lighter, 10 s",
        difficulty="the lightest carries 1110 times its weight",
        answer="every cube stays",
        build=always(partial(ratio_tower, heavy_on_top=True)),
        duration=10.0,
        measures=(none_fallen("Cube "), drift_under(3.0, "Cube "), overlap_under(2.0)),
        picture_time=3.0,
        sleeping=False,
    ),
    HardCase(
        name="ratio-down",
        title="1, 10, 100 and 1000 kg, each on the heavier, 10 s",
        difficulty="what is done for the heavy must not shake the light",
        answer="every cube stays",
        build=always(partial(ratio_tower, heavy_on_top=False)),
        duration=10.0,
        measures=(none_fallen("Cube "), drift_under(1.0, "Cube "), overlap_under(1.0)),
        picture_time=3.0,
        sleeping=False,
    ),
    HardCase(
        name="wedge",
        title="a wedge of 5 degrees and 100 kg between walls, 5 s",
        difficulty="without friction the walls push with 5.7 times its weight each, nearly against each other",
        answer="it stays; 0.1 mm of overlap lets it sink by 1.1 mm",
        build=always(wedge),
        duration=5.0,
        measures=(moved_under(10.0, "Wedge"), overlap_under(1.0)),
        picture_time=2.0,
        sleeping=False,
    ),
    HardCase(
        name="tiny-on-huge",
        title="a stack of cubes of 1 cm on a cube of 1 km, 5 s",
        difficulty="single precision has steps of 0.03 mm at 500 m, and tolerances for houses are large for dice",
        answer="every cube stays",
        build=always(tiny_on_huge),
        duration=5.0,
        measures=(
            moved_under(0.2, "Tiny ", known_miss=_TINY_MISS),
            overlap_under(0.1, known_miss=_TINY_MISS),
        ),
        picture_time=3.0,
        sleeping=False,
    ),
    replace(_HOUR, small=replace(_HOUR, duration=60.0)),
)
