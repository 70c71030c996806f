"""Balls fall on eight bars that ring, under a board that shows which: what overlays and sounds are for."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

from elys.common.math import quaternion
from elys.common.scene import EntityNode, SceneDocument
from elys.samples.entities import STONE, Color, camera, group, material, obstacle, sun

SCRIPTS: Final = Path(__file__).parent / "scripts" / "carillon.py"
# A major scale, equally tempered, from the lowest bar on: half tones above it.
STEPS: Final = (0, 2, 4, 5, 7, 9, 11, 12)
NAMES: Final = ("C", "D", "E", "F", "G", "A", "B", "C′")
_TILT: Final = 0.22  # [rad] towards who looks, so that balls leave
_BRASS: Final[Color] = (0.78, 0.56, 0.2)
_ROW: Final = 0.055  # heights of the picture


def carillon() -> SceneDocument:
    """The bars, the board and the script that drops balls."""
    return SceneDocument(
        name="Carillon",
        entities=[
            sun((-0.4, -0.8, -0.45), intensity=3.2),
            camera((0.0, 4.6, 12.5), (0.0, 1.9, 0.0), field_of_view=0.72),
            obstacle("Ground", size=(40.0, 1.0, 30.0), position=(0.0, -0.5, 0.0), color=STONE, roughness=0.9),
            group("Bars", [_bar(number) for number in range(len(STEPS))]),
            _wind(),
            _board(),
            *_clocks(),
            EntityNode(name="Carillon", components={"Script": {"source": f"{SCRIPTS}#Carillon"}}),
        ],
    )


def _bar(number: int) -> EntityNode:
    length = 2.6 - 0.14 * number  # a higher tone has a shorter bar
    size = (1.0, 0.16, length)
    rotation = quaternion.from_axis_angle((1.0, 0.0, 0.0), _TILT).tolist()
    values = {"number": number, "pitch": round(0.5 * 2.0 ** (STEPS[number] / 12.0), 5)}
    return EntityNode(
        name=f"Bar {number + 1}",
        components={
            "Transform": {
                "position": [-4.2 + 1.2 * number, 1.5, 0.0],
                "rotation": [round(part, 7) for part in rotation],
                "scale": list(size),
            },
            "MeshRenderer": {"mesh": "box"},
            "Material": material(_BRASS, roughness=0.28, metallic=1.0),
            "Collider": {"restitution": 0.8, "friction": 0.3},
            "Script": {"source": f"{SCRIPTS}#Bar", "values": values},
        },
    )


def _wind() -> EntityNode:
    return EntityNode(
        name="Wind",
        components={
            "Transform": {"position": [-8.0, 2.0, 2.0]},
            "SoundSource": {"sound": "roll", "volume": 0.12, "pitch": 0.7, "reference_distance": 6.0},
        },
    )


def _overlay(name: str, layout: dict[str, Any], **parts: dict[str, Any]) -> EntityNode:
    return EntityNode(name=name, components={"Overlay": layout, **parts})


def _board() -> EntityNode:
    """A panel with a title and a row for each bar."""
    rows = [
        _overlay(
            f"Row {number + 1}",
            {"anchor": "top", "y": 0.1 + _ROW * number, "width": 0.24, "height": _ROW},
            OverlayPanel={"color": [0.55, 0.36, 0.06], "opacity": 0.0, "radius": 0.012},
            OverlayText={"text": name, "size": 0.036, "align": "center"},
        )
        for number, name in enumerate(NAMES)
    ]
    title = _overlay("Title", {"anchor": "top", "y": 0.02}, OverlayText={"text": "Carillon", "size": 0.05})
    board = _overlay(
        "Board",
        {"anchor": "left", "x": 0.04, "width": 0.28, "height": 0.1 + _ROW * len(NAMES) + 0.02},
        OverlayPanel={"radius": 0.025, "border": 0.002, "border_color": [0.6, 0.5, 0.3]},
    )
    board.children.extend([title, *rows])
    return board


def _clocks() -> list[EntityNode]:
    return [
        _overlay(
            "Clock",
            {"anchor": "top", "y": 0.025},
            OverlayText={"text": "{:time}", "size": 0.075, "align": "center", "shadow": 0.05},
        ),
        _overlay(
            "Count",
            {"anchor": "top_right", "x": -0.04, "y": 0.03},
            OverlayText={"text": "{:d} struck", "size": 0.045, "align": "right"},
        ),
        _overlay("Wait", {"anchor": "bottom", "y": -0.04, "width": 0.6, "height": 0.022}, OverlayBar={"value": 0.0}),
        _overlay(
            "Label",
            {"anchor": "bottom", "rise": 0.7, "visible": False, "clamp": True},
            OverlayPanel={"opacity": 0.8, "radius": 0.02},
            OverlayText={"text": "Ding!", "size": 0.035, "color": [1.0, 0.75, 0.3]},
        ),
    ]
