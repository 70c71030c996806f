"""What a picture costs after an edit of one of many still things, before the driver draws: see `picture_python.py`."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Final

import msgspec
import numpy as np

from elys.bus.messages.scene import ComponentSet, SceneDelta, Spawned
from elys.bus.messages.views import ViewCamera
from elys.bus.mirror import SceneMirror
from elys.common.components import Component, Light, Material, MeshRenderer, Transform
from elys.common.math.matrix import look_rotation
from elys.render_node.render_world import RenderWorld
from elys.render_node.renderer import Renderer
from elys.render_node.scene_reader import SceneReader

EDITS: Final = 130
WARMING: Final = 20  # edits before those that count
SUN_WAY: Final = (-0.4, -1.0, -0.6)


def edit_times(renderer: Renderer, count: int, size: tuple[int, int]) -> dict[str, list[float]]:
    """From the scene delta to the last draw call [ms], and of a picture before which nothing was edited."""
    scene = _Scene(count)
    one, sun = count // 2, count + 1
    place = scene.mirror.entities[one].components["Transform"]
    assert isinstance(place, Transform)
    x, y, z = place.position
    edits: dict[str, Callable[[float], tuple[int, Component] | None]] = {
        "nothing set": lambda share: None,
        "one material set": lambda share: (one, Material(base_color=(share, 0.5, 0.4))),
        "one transform set": lambda share: (one, Transform(position=(x + share, y, z))),
        "one light set": lambda share: (sun, Light(intensity=1.0 + share)),
    }
    renderer.settle(scene.world)
    spent = {
        words: [scene.spent(renderer, edit(i / (EDITS + WARMING)), size) for i in range(EDITS + WARMING)]
        for words, edit in edits.items()
    }
    return {words: values[WARMING:] for words, values in spent.items()}


class _Scene:
    """Cubes of many colours in a block over a floor, the sun, and a world that follows them."""

    def __init__(self, count: int) -> None:
        side = int(np.ceil(count ** (1 / 3)))
        places = (np.array(np.unravel_index(np.arange(count), (side,) * 3)).T - side / 2) * 2.0
        things: list[tuple[Component, ...]] = [
            (Transform(position=tuple(place)), MeshRenderer(), Material(base_color=(0.3 + 0.1 * (i % 7), 0.5, 0.4)))
            for i, place in enumerate(places.tolist())
        ]
        things.append((Transform(rotation=tuple(look_rotation(SUN_WAY).tolist())), Light()))
        floor = Transform(position=(0.0, -2.0 * side, 0.0), scale=(9.0 * side, 0.1, 9.0 * side))
        things.append((floor, MeshRenderer(), Material()))
        self.mirror, self.world = SceneMirror(), RenderWorld()
        self._reader = SceneReader(self.mirror)
        self._tell(
            *(
                Spawned(entity=i, name="", parent=0, enabled=True, components=dict(map(_values, thing)))
                for i, thing in enumerate(things, 1)
            )
        )
        self.world.read_scene(self._reader)
        away = np.array((1.6, 1.2, 2.2)) * side
        rotation = tuple(look_rotation(-away).tolist())
        self._camera = ViewCamera(position=tuple(away.tolist()), rotation=rotation, far=50.0 * side)

    def spent(self, renderer: Renderer, edit: tuple[int, Component] | None, size: tuple[int, int]) -> float:
        """[ms] of the drawing thread's processor time for a picture after an edit."""
        start = time.thread_time()
        if edit is not None:
            name, values = _values(edit[1])
            self._tell(ComponentSet(entity=edit[0], component=name, values=values))
        self.world.read_scene(self._reader)
        self.world.place()
        renderer.draw(self.world, self._camera, *size)
        return (time.thread_time() - start) * 1e3

    def _tell(self, *changes: Spawned | ComponentSet) -> None:
        sequence = self.mirror.sequence + 1
        self.mirror.apply_delta(SceneDelta(epoch=0, sequence=sequence, tick=0, changes=changes))


def _values(component: Component) -> tuple[str, dict[str, object]]:
    return type(component).__name__, msgspec.structs.asdict(component)
