"""People who dance while others go around them: clips alone and mixed, layers, markers and root motion."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Final

from elys.common.scene import ComponentChanges, EntityNode, SceneDocument
from elys.samples.entities import camera, group, obstacle, sun
from elys.samples.figure import RUN, WALK, WALK_ROUND

FIGURE: Final = "figure.glb"
RADIUS: Final = WALK_ROUND.stride / WALK_ROUND.turn  # [m] of the way that "Walk round" goes
STEPS: Final = "Walk: step 0.02 0.52; Walk round: step 0.02 0.52; Run: step 0.02 0.34"
_WALKERS: Final = 3


def dance() -> SceneDocument:
    """The scene."""
    floor = obstacle(
        "Floor", size=(14.0, 0.2, 14.0), position=(0.0, -0.1, 0.0), color=(0.32, 0.30, 0.28), roughness=0.9
    )
    entities = [sun((-0.5, -0.8, -0.45)), camera((0.5, 3.4, 7.4), (0.0, 0.75, 0.0), field_of_view=0.75), floor]
    entities.append(group("Dancers", [_dancer(number) for number in range(3)]))
    entities.append(group("Around", [_walker(number) for number in range(_WALKERS)]))
    entities += [_mixed(), _waving()]
    return SceneDocument(name="Dance", entities=entities)


def check_dance(positions: Mapping[str, Sequence[float]]) -> str:
    """What is wrong with the final positions [m] by name: "" if those who go around are still on their circle."""
    for number in range(1, _WALKERS + 1):
        x, y, z = positions[f"Walker {number}"]
        if abs(math.hypot(x, z) - RADIUS) > 0.02 or abs(y) > 1e-6:
            return f"Walker {number} left the circle of {RADIUS:.2f} m, and is at ({x:.2f}, {y:.2f}, {z:.2f})"
    return ""


def figure(name: str, position: Sequence[float], *, heading: float = 0.0, **components: dict[str, Any]) -> EntityNode:
    """A figure that looks `heading` [rad] to the left of -z."""
    rotation = [0.0, round(math.sin(heading / 2.0), 7), 0.0, round(math.cos(heading / 2.0), 7)]
    transform = {"position": [round(float(x), 4) for x in position], "rotation": rotation}
    return EntityNode(name=name, prefab=FIGURE, components={"Transform": transform, **components})


def _dancer(number: int) -> EntityNode:
    angle = 2.0 * math.pi * number / 3.0
    place = (0.85 * math.sin(angle), 0.0, 0.85 * math.cos(angle))
    playing = {"clip": "Dance", "time": round(0.4 * number, 2)}
    return figure(f"Dancer {number + 1}", place, heading=angle + math.pi, Animation=playing)


def _walker(number: int) -> EntityNode:
    """It goes to its left around the middle, a third of a round behind the one before."""
    angle = 2.0 * math.pi * number / _WALKERS
    place = (RADIUS * math.cos(angle), 0.0, -RADIUS * math.sin(angle))
    return figure(
        f"Walker {number + 1}",
        place,
        heading=angle,
        Animation={"clip": "Walk round", "time": 0.0},
        AnimationMarkers={"markers": STEPS},
        RootMotion={"node": "Hips", "turn": True},
    )


def _mixed() -> EntityNode:
    """Between a walk and a run, on the spot."""
    speeds = f"Idle 0, Walk {WALK.stride / WALK.duration:.2f}, Run {RUN.stride / RUN.duration:.2f}"
    return figure(
        "Jogger",
        (-4.2, 0.0, -1.5),
        heading=-0.9,
        AnimationBlend={"mix": speeds, "by": "value", "value": 2.2},
        RootMotion={"node": "Hips", "mode": "tell"},
    )


def _waving() -> EntityNode:
    """It stands, and its arm waves: a layer over the rest."""
    node = figure("Waver", (4.1, 0.0, -1.2), heading=2.6)
    layer: ComponentChanges = {
        "Animation": {"clips": f"{FIGURE}#clips", "clip": "Wave"},
        "AnimationLayer": {"mask": "R Arm"},
    }
    node.children.append(EntityNode(name="Greeting", components=layer))
    return node
